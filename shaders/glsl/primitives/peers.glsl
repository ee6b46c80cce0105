// Which threads of a subgroup have the same digit, by ballots over its bits.

// Those of the threads `peers` whose digit, of at most 8 bits, is `own`.
uvec4 peers_of(uint own, uvec4 peers) {
    [[unroll]] for (uint bit = 0; bit < 8; bit++) {
        uint set = (own >> bit) & 1;
        peers &= subgroupBallot(set == 1) ^ uvec4(set - 1);
    }
    return peers;
}

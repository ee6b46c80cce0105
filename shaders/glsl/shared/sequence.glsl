// Low-discrepancy points: the first two dimensions of Sobol's sequence, their order and digits scrambled by hashing (Burley 2020,
// "Practical Hash-based Owen Scrambling", JCGT 9(4)). Twin: src/scene/sequence.rs. Needs random.glsl.

// Laine and Karras's permutation: each bit is flipped or not by those below it.
uint permuted(uint v, uint key) {
    v += key;
    v ^= v * 0x6c50b47cu;
    v ^= v * 0xb82f1e52u;
    v ^= v * 0xc7afe638u;
    v ^= v * 0x8d22f6e6u;
    return v;
}

// The second dimension's digits, reversed: the product with Pascal's matrix over two elements.
uint pascal(uint v) {
    v ^= v >> 16u;
    v ^= (v & 0xff00ff00u) >> 8u;
    v ^= (v & 0xf0f0f0f0u) >> 4u;
    v ^= (v & 0xccccccccu) >> 2u;
    v ^= (v & 0xaaaaaaaau) >> 1u;
    return v;
}

// Two words of a point of the sequence that `seed`, `stream` and `dimension` name. The first 2^k points have one in each of 2^k
// equal rectangles, whatever their sides.
uvec2 sequence_pair(uint seed, uint stream, uint index, uint dimension) {
    uvec4 key = pcg4d(uvec4(seed, stream, dimension, 0x736f626fu));
    uint i = bitfieldReverse(permuted(bitfieldReverse(index), key.x));
    return bitfieldReverse(uvec2(permuted(i, key.y), permuted(pascal(i), key.z)));
}

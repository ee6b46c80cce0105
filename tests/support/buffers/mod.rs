//! What the tests of the primitives share.
#![allow(dead_code, reason = "each test binary uses a part")]

/// Around workgroups, tiles and blocks; then many of them, and radix tables with rows longer than one chunk.
pub const SIZES: [usize; 16] =
    [0, 1, 2, 255, 256, 257, 2047, 2049, 4095, 4096, 4097, 65_535, 65_536, 65_537, 1_000_003, (1 << 22) + 3];

/// Random words: the same for the same seed.
pub fn random(seed: u64, count: usize) -> Vec<u32> {
    (0..count as u64).map(|i| mix(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(i))).collect()
}

/// The finaliser of SplitMix64, upper half.
fn mix(counter: u64) -> u32 {
    let mut z = counter.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 32) as u32
}

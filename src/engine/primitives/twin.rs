//! The primitives in plain Rust: what the shaders are tested against.

use super::reduce::BLOCK;
use super::{Arithmetic, Operation};

/// Sum of the elements before each, modulo 2³², and the sum of all.
pub fn scan(values: &[u32]) -> (Vec<u32>, u32) {
    let mut total = 0u32;
    let mut sums = Vec::with_capacity(values.len());
    for value in values {
        sums.push(total);
        total = total.wrapping_add(*value);
    }
    (sums, total)
}

/// Keys and values in the order of the keys' low `bits` bits; equal ones keep their order.
pub fn radix_sort(keys: &[u32], values: &[u32], bits: u32) -> (Vec<u32>, Vec<u32>) {
    let mut pairs: Vec<(u32, u32)> = keys.iter().copied().zip(values.iter().copied()).collect();
    pairs.sort_by_key(|pair| pair.0 & (u32::MAX >> (32 - bits)));
    pairs.into_iter().unzip()
}

/// First element of each key among sorted ones, and the one after the last; of `count` keys.
pub fn key_ranges(sorted: &[u32], count: usize) -> Vec<[u32; 2]> {
    let of = |key: u32| {
        let [first, end] = [key, key + 1].map(|key| sorted.partition_point(|other| *other < key) as u32);
        if first == end { [0, 0] } else { [first, end] }
    };
    (0..count as u32).map(of).collect()
}

/// All elements folded into one, floats as their bits, in the shaders' order.
pub fn reduce(operation: Operation, elements: &[u32]) -> u32 {
    let partials: Vec<u32> = elements.chunks(BLOCK as usize).map(|block| reduce_block(operation, block)).collect();
    reduce_block(operation, &partials)
}

/// A thread takes every 256th element, one after the other; then the upper half of the threads folds onto the lower.
fn reduce_block(operation: Operation, elements: &[u32]) -> u32 {
    let mut folded = [identity(operation); 256];
    for (i, element) in elements.iter().enumerate() {
        folded[i % 256] = combine(operation, folded[i % 256], *element);
    }
    for half in [128, 64, 32, 16, 8, 4, 2, 1] {
        for i in 0..half {
            folded[i] = combine(operation, folded[i], folded[i + half]);
        }
    }
    folded[0]
}

/// What thread `thread` writes: the sum of its chains of multiply-adds. With values that the shader keeps exact, fused or not.
pub fn multiply_add(thread: u32, rounds: u32, [factor, addend]: [f32; 2]) -> f32 {
    let chain = |c: u32| {
        let start = (thread % 256 + c) as f32;
        (0..rounds * Arithmetic::STEPS).fold(start, |value, _| value.mul_add(factor, addend))
    };
    (0..Arithmetic::CHAINS).map(chain).sum()
}

fn identity(operation: Operation) -> u32 {
    match operation {
        Operation::SumF32 | Operation::SumU32 | Operation::MaxU32 => 0,
        Operation::MinF32 => f32::INFINITY.to_bits(),
        Operation::MaxF32 => f32::NEG_INFINITY.to_bits(),
        Operation::MinU32 => u32::MAX,
    }
}

fn combine(operation: Operation, a: u32, b: u32) -> u32 {
    let (x, y) = (f32::from_bits(a), f32::from_bits(b));
    match operation {
        Operation::SumF32 => (x + y).to_bits(),
        Operation::MinF32 => x.min(y).to_bits(),
        Operation::MaxF32 => x.max(y).to_bits(),
        Operation::SumU32 => a.wrapping_add(b),
        Operation::MinU32 => a.min(b),
        Operation::MaxU32 => a.max(b),
    }
}

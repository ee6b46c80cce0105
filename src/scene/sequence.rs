//! The twin of `shaders/glsl/shared/sequence.glsl`: Sobol's sequence in two dimensions, its order and digits scrambled by hashing
//! (Burley 2020, "Practical Hash-based Owen Scrambling", JCGT 9(4)).

use super::random::pcg4d;

/// Laine and Karras's permutation: each bit is flipped or not by those below it.
fn permuted(v: u32, key: u32) -> u32 {
    let v = v.wrapping_add(key);
    let v = v ^ v.wrapping_mul(0x6c50_b47c);
    let v = v ^ v.wrapping_mul(0xb82f_1e52);
    let v = v ^ v.wrapping_mul(0xc7af_e638);
    v ^ v.wrapping_mul(0x8d22_f6e6)
}

/// The second dimension's digits, reversed: the product with Pascal's matrix over two elements.
fn pascal(v: u32) -> u32 {
    let v = v ^ v >> 16;
    let v = v ^ (v & 0xff00_ff00) >> 8;
    let v = v ^ (v & 0xf0f0_f0f0) >> 4;
    let v = v ^ (v & 0xcccc_cccc) >> 2;
    v ^ (v & 0xaaaa_aaaa) >> 1
}

/// Two words of a point of the sequence that `seed`, `stream` and `dimension` name. The first 2^k points have one in each of 2^k
/// equal rectangles, whatever their sides.
pub fn sequence_pair(seed: u32, stream: u32, index: u32, dimension: u32) -> [u32; 2] {
    let key = pcg4d([seed, stream, dimension, 0x736f_626f]);
    let i = permuted(index.reverse_bits(), key[0]).reverse_bits();
    [permuted(i, key[1]).reverse_bits(), permuted(pascal(i), key[2]).reverse_bits()]
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    /// If this failed, points would clump, and pictures be as noisy as with independent ones.
    #[test]
    fn points_are_one_to_each_rectangle_of_their_number() {
        for seed in 0..50 {
            for k in 0..9u32 {
                let points: Vec<[u32; 2]> = (0..1 << k).map(|index| sequence_pair(seed, 7, index, 3)).collect();
                for columns in 0..=k {
                    let cell = |[x, y]: &[u32; 2]| {
                        let part = |v: u32, digits: u32| v.checked_shr(32 - digits).unwrap_or(0);
                        (part(*x, columns), part(*y, k - columns))
                    };
                    let cells: HashSet<_> = points.iter().map(cell).collect();
                    assert_eq!(cells.len(), 1 << k, "seed {seed}: {columns} of {k} digits");
                }
            }
        }
    }

    /// If this failed, pixels or dimensions would share their points, and errors would show as patterns.
    #[test]
    fn streams_and_dimensions_differ() {
        let first = |seed, stream, dimension| sequence_pair(seed, stream, 0, dimension);
        let points = [first(1, 2, 3), first(2, 2, 3), first(1, 3, 3), first(1, 2, 4), first(1, 2, 5)];
        assert_eq!(points.iter().collect::<HashSet<_>>().len(), points.len());
        let mean = (0..4096).map(|stream| f64::from(sequence_pair(9, stream, 0, 0)[0])).sum::<f64>() / 4096.0;
        assert!((mean / f64::from(u32::MAX) - 0.5).abs() < 0.02, "{mean}");
    }
}

//! Counter-based random numbers: every draw is a pure function of (seed, stream, index), so no result depends on the
//! order of evaluation, and a shader that knows the same three numbers draws the same bits.
//!
//! The hash is `pcg4d` of Jarzynski and Olano, "Hash Functions for GPU Rendering" (JCGT 9(3), 2020).

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

/// Four well-mixed 32-bit words from four words that may be plain counters.
pub(crate) fn pcg4d(words: [u32; 4]) -> [u32; 4] {
    let mut v = words.map(|word| word.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    let mix = |v: &mut [u32; 4]| {
        v[0] = v[0].wrapping_add(v[1].wrapping_mul(v[3]));
        v[1] = v[1].wrapping_add(v[2].wrapping_mul(v[0]));
        v[2] = v[2].wrapping_add(v[0].wrapping_mul(v[1]));
        v[3] = v[3].wrapping_add(v[1].wrapping_mul(v[2]));
    };
    mix(&mut v);
    v = v.map(|word| word ^ (word >> 16));
    mix(&mut v);
    v
}

/// The four words of draw `index` in `stream` (an iteration, a purpose): `pcg4d(seed low, seed high, stream, index)`.
pub fn bits(seed: u64, stream: u32, index: u32) -> [u32; 4] {
    // The two halves of the seed, low half first.
    pcg4d([seed as u32, (seed >> 32) as u32, stream, index])
}

/// A uniform number in [0, 1) from the upper 24 bits of a word; exact in f32 as well.
pub fn uniform(word: u32) -> f32 {
    (word >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Four uniform numbers in [0, 1): [`bits`] through [`uniform`].
pub fn uniforms(seed: u64, stream: u32, index: u32) -> [f64; 4] {
    bits(seed, stream, index).map(|word| f64::from(uniform(word)))
}

/// An integer in `0..n` from a word, by multiplication instead of division; zero for `n = 0`.
pub fn below(word: u32, n: u32) -> u32 {
    // The product of two 32-bit words, shifted by 32, fits 32 bits.
    ((u64::from(word) * u64::from(n)) >> 32) as u32
}

/// A unit vector, uniform on the sphere, from two uniform numbers in [0, 1).
pub fn direction(u: f64, v: f64) -> DVec3 {
    let z = 1.0 - 2.0 * u;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (TAU * v).sin_cos();
    DVec3::new(r * cos, r * sin, z)
}

/// A rotation, uniform over all of them, from three uniform numbers in [0, 1): Shoemake, "Uniform Random Rotations"
/// (Graphics Gems III, 1992).
pub fn rotation([u, v, w]: [f64; 3]) -> DQuat {
    let (a, b) = ((1.0 - u).sqrt(), u.sqrt());
    let ((sin_v, cos_v), (sin_w, cos_w)) = ((TAU * v).sin_cos(), (TAU * w).sin_cos());
    DQuat::from_xyzw(a * sin_v, a * cos_v, b * sin_w, b * cos_w).normalize()
}

/// Fisher-Yates shuffle in place, keyed by (seed, stream). At most 2^32 items take part.
pub(crate) fn shuffle<T>(items: &mut [T], seed: u64, stream: u32) {
    let n = u32::try_from(items.len()).unwrap_or(u32::MAX);
    for last in (1..n).rev() {
        let other = below(bits(seed, stream, last)[3], last + 1);
        items.swap(last as usize, other as usize);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The published function, written out for one input with plain arithmetic modulo 2^32. A difference would mean that
    /// the shader's copy and this one draw different numbers.
    #[test]
    fn the_hash_is_the_published_one() {
        const M: u64 = 1 << 32;
        let mut v = [1u64, 2, 3, 4].map(|x| (x * 1_664_525 + 1_013_904_223) % M);
        for round in 0..2 {
            for [to, a, b] in [[0, 1, 3], [1, 2, 0], [2, 0, 1], [3, 1, 2]] {
                v[to] = (v[to] + v[a] * v[b] % M) % M;
            }
            if round == 0 {
                v = v.map(|x| x ^ (x >> 16));
            }
        }
        assert_eq!(pcg4d([1, 2, 3, 4]).map(u64::from), v);
    }

    /// Counters that differ in one bit of the seed, the stream or the index must give unrelated numbers: the mean, the
    /// variance and the correlation of neighbours are those of independent uniform draws.
    #[test]
    fn neighbouring_counters_are_unrelated() {
        for step in [(1u64, 0, 0), (0, 1, 0), (0, 0, 1), (1 << 32, 0, 0)] {
            let draws: Vec<[f64; 4]> =
                (0..20_000u32).map(|i| uniforms(step.0 * u64::from(i), step.1 * i, step.2 * i)).collect();
            for lane in 0..4 {
                let x: Vec<f64> = draws.iter().map(|d| d[lane] - 0.5).collect();
                let n = x.len() as f64;
                let mean = x.iter().sum::<f64>() / n;
                let variance = x.iter().map(|v| v * v).sum::<f64>() / n;
                let neighbours = x.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / n;
                assert!(mean.abs() < 0.01, "mean {mean} for {step:?}");
                assert!((variance - 1.0 / 12.0).abs() < 0.002, "variance {variance} for {step:?}");
                assert!(neighbours.abs() < 0.002, "covariance {neighbours} for {step:?}");
            }
        }
    }

    /// A value of 1 would index past the end wherever a uniform number picks an element.
    #[test]
    fn uniforms_stay_below_one_and_integers_below_their_bound() {
        assert_eq!(uniform(0), 0.0);
        assert!(uniform(u32::MAX) < 1.0);
        assert_eq!(below(u32::MAX, 7), 6);
        assert_eq!(below(u32::MAX, 0), 0);
    }

    /// Directions must be unit vectors without a preferred axis, or cameras and probes would be biased.
    #[test]
    fn directions_are_unit_vectors_without_a_preferred_axis() {
        let mut sum = DVec3::ZERO;
        let mut squares = DVec3::ZERO;
        for i in 0..20_000 {
            let [u, v, ..] = uniforms(5, 0, i);
            let d = direction(u, v);
            assert!((d.length() - 1.0).abs() < 1e-12);
            sum += d;
            squares += d * d;
        }
        assert!((sum / 20_000.0).length() < 0.02);
        assert!((squares / 20_000.0 - DVec3::splat(1.0 / 3.0)).length() < 0.02);
    }

    /// A shuffle must keep every item, depend on its key, and put each item anywhere.
    #[test]
    fn a_shuffle_is_a_keyed_permutation() {
        let shuffled = |seed, stream| {
            let mut items: Vec<u32> = (0..100).collect();
            shuffle(&mut items, seed, stream);
            items
        };
        let a = shuffled(1, 0);
        let mut sorted = a.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..100).collect::<Vec<_>>());
        assert_eq!(a, shuffled(1, 0));
        assert_ne!(a, shuffled(2, 0));
        assert_ne!(a, shuffled(1, 1));
        let mean = (0..2000).map(|seed| f64::from(shuffled(seed, 0)[0])).sum::<f64>() / 2000.0;
        assert!((mean - 49.5).abs() < 3.0, "the first item's mean is {mean}");
    }
}

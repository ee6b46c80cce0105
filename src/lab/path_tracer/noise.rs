//! How noisy photographs are, by two halves of their samples.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::scene::colour::encoded;

/// Pictures of a capture that are measured at most, evenly chosen.
pub(super) const PICTURES: u32 = 8;
/// Pixels of a picture that are looked at, about.
const PIXELS: usize = 1 << 17;
/// The squared error that eight bits make, uniform within half a step.
const EIGHT_BITS: f64 = 1.0 / (12.0 * 255.0 * 255.0);

/// The noise of a capture's pictures: for some of them the PSNR in decibels of the scene without noise against the picture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Noise {
    pictures: BTreeMap<String, f64>,
}

impl Noise {
    /// Adds a picture of a mean squared error of sRGB values from 0 to 1, as it is once it has eight bits.
    pub(super) fn add(&mut self, name: &str, error: f64) {
        self.pictures.insert(name.to_owned(), -10.0 * (error + EIGHT_BITS).log10());
    }

    /// The mean over pictures; none of none.
    pub fn psnr(&self) -> Option<f64> {
        let sum: f64 = self.pictures.values().sum();
        (!self.pictures.is_empty()).then(|| sum / self.pictures.len() as f64)
    }

    /// Pictures that were measured.
    pub fn pictures(&self) -> usize {
        self.pictures.len()
    }
}

/// A photograph's samples in two parts, pixel by pixel.
pub(super) struct Halves {
    /// Sums of the first samples, and their number.
    pub first: Vec<[f32; 4]>,
    pub count: u32,
    /// Numbers of all samples.
    pub all: Vec<u32>,
}

/// Mean squared error of the picture's sRGB values from 0 to 1 over black, estimated from what the means of both halves differ by.
/// Samples of a sequence, of which each half is spread as evenly as the whole, are less noisy than that says. None where no pixel has
/// two halves.
pub(super) fn error(taken: &[[f32; 4]], halves: &Halves, gain: f32) -> Option<f64> {
    let shown = |value: f32| encoded(f64::from(gain * value).clamp(0.0, 1.0));
    let (mut sum, mut pixels) = (0.0, 0u64);
    // An odd step does not stay in the same columns.
    let step = (taken.len() / PIXELS) | 1;
    for ((mean, first), &all) in taken.iter().zip(&halves.first).zip(&halves.all).step_by(step) {
        let (a, n) = (f64::from(halves.count), f64::from(all));
        let b = n - a;
        if b < 1.0 {
            continue;
        }
        // The variance of the mean is that of the difference of the halves, by 1/n in place of 1/a + 1/b.
        let share = a * b / (n * n);
        for (mean, first) in mean.iter().zip(first).take(3) {
            let other = (f64::from(*mean) * n - f64::from(*first)) / b;
            sum += share * (shown(first / halves.count as f32) - shown(other as f32)).powi(2) / 3.0;
        }
        pixels += 1;
    }
    (pixels > 0).then(|| sum / pixels as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    /// Samples with a known spread. If this failed, a table's ceiling would be another than its photographs have.
    #[test]
    fn the_error_of_known_noise_is_found() {
        let (pixels, samples, count) = (100_000, 12u32, 4u32);
        let (mut taken, mut first, mut truth) = (Vec::new(), Vec::new(), 0.0);
        for pixel in 0..pixels {
            let sample = |i: u32| 0.3 + 0.1 * (random::uniforms(3, pixel, i)[0] as f32 - 0.5);
            let sum = |range: std::ops::Range<u32>| range.map(sample).sum::<f32>();
            let mean = sum(0..samples) / samples as f32;
            taken.push([mean, mean, mean, 1.0]);
            first.push([sum(0..count); 4]);
            truth += (encoded(f64::from(mean)) - encoded(0.3)).powi(2) / f64::from(pixels);
        }
        let halves = Halves { first, count, all: vec![samples; pixels as usize] };
        let found = error(&taken, &halves, 1.0).unwrap();
        assert!((found / truth - 1.0).abs() < 0.03, "{found} is not {truth}");
        // White is white, however noisy the light is.
        assert_eq!(error(&taken, &halves, 10.0), Some(0.0));
        assert_eq!(error(&taken, &Halves { all: vec![count; pixels as usize], ..halves }, 1.0), None);
        let mut noise = Noise::default();
        assert_eq!(noise.psnr(), None);
        noise.add("a", 0.0);
        noise.add("b", 1e-4);
        assert!((noise.psnr().unwrap() - 0.5 * (58.92 + 39.94)).abs() < 0.01, "{noise:?}");
    }
}

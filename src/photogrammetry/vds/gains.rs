//! Exposure of each photo, from what all photos show of the same points.
//!
//! Photo k shows point p with intensity `I = g_k R_p + o_k`. The reference R_p is the median over the photos of what
//! they would show at gain one and offset zero, gains and offsets are robust regressions onto the references, in turn.
//! Points weigh by the inverse of how much their looks vary, so that what does not change with the view decides. A common factor
//! and offset cannot be separated from the scene: the mean gain is one, the mean offset zero.

use super::observe::Observations;
use super::variance::median;

/// Views that a point's reference takes at least.
const MIN_VIEWS: usize = 5;
/// Observations that a photo's fit takes at least; photos with fewer keep gain one and offset zero.
const MIN_OBSERVATIONS: usize = 20;
/// Observations a photo that are enough, on average.
const ENOUGH: usize = 1500;
/// Brighter intensities may be clipped.
const CLIPPED: f32 = 0.95;
/// Iterations that weigh residuals by Huber, whose answer depends on no start; then Tukey's weights leave highlights out
/// altogether.
const FIRST: u32 = 10;
/// Iterations at most, and the change of a gain or offset that ends them.
const ROUNDS: u32 = 100;
const SETTLED: f64 = 1e-5;
/// Deviation of a point's looks, in luma, below which it weighs no more: were it much less, a few dark points would
/// weigh more than all others, and gains could shrink until nothing varies. A point that varies more, by gloss or by
/// being badly placed, says less about the exposures.
const NOISE: f64 = 0.02;
/// How much gain one and offset zero are preferred, as a fraction of the observations' weight. Photos of one side of an
/// object share points with their neighbours only, so that a drift of gains and offsets all around it costs them
/// little: the preference holds it down, and otherwise reduces the observations' estimate by about a hundredth.
const PRIOR: [f64; 2] = [0.001, 0.004];
/// Bounds of what is taken for an exposure.
const MIN_GAIN: f64 = 0.1;
const MAX_GAIN: f64 = 10.0;

/// Gain and offset of each photo.
#[derive(Clone, Debug, PartialEq)]
pub struct Gains {
    /// Gains, on average one.
    pub gains: Vec<f64>,
    /// Offsets in luma, on average zero.
    pub offsets: Vec<f64>,
    /// Photos that shared too few points with others to be fitted: gain one, offset zero.
    pub unfitted: usize,
}

impl Gains {
    /// Photos as they are.
    pub fn none(photos: usize) -> Self {
        Self { gains: vec![1.0; photos], offsets: vec![0.0; photos], unfitted: photos }
    }

    /// Estimates gains and offsets of so many photos.
    pub fn fit(observations: &Observations, photos: usize) -> Self {
        let mut fit = Self::none(photos);
        let points = shared(observations, photos);
        let mut seen = vec![0usize; photos];
        points.iter().flatten().for_each(|(photo, _)| seen[*photo] += 1);
        let fitted: Vec<usize> = (0..photos).filter(|k| seen[*k] >= MIN_OBSERVATIONS).collect();
        fit.unfitted = photos - fitted.len();
        if fitted.is_empty() {
            return fit;
        }
        for round in 0..ROUNDS {
            // What each photo should show, what it does, and how much that weighs.
            let mut pairs: Vec<Vec<[f64; 3]>> = seen.iter().map(|n| Vec::with_capacity(*n)).collect();
            let mut corrected = Vec::new();
            for point in &points {
                corrected.clear();
                corrected.extend(point.iter().map(|(photo, intensity)| fit.corrected(*photo, *intensity)));
                let reference = median(&mut corrected);
                corrected.iter_mut().for_each(|look| *look = (*look - reference).abs());
                let weight = 1.0 / (median(&mut corrected).powi(2) + NOISE * NOISE);
                point.iter().for_each(|(photo, intensity)| pairs[*photo].push([reference, *intensity, weight]));
            }
            let before = fit.clone();
            for &photo in &fitted {
                let line = [fit.gains[photo], fit.offsets[photo]];
                let [gain, offset] = regression(&pairs[photo], line, if round < FIRST { huber } else { biweight });
                (fit.gains[photo], fit.offsets[photo]) = (gain.clamp(MIN_GAIN, MAX_GAIN), offset);
            }
            let mean = |of: &[f64]| fitted.iter().map(|k| of[*k]).sum::<f64>() / fitted.len() as f64;
            let (gain, offset) = (mean(&fit.gains), mean(&fit.offsets));
            let mut change = 0f64;
            for &k in &fitted {
                fit.gains[k] /= gain;
                fit.offsets[k] -= fit.gains[k] * offset;
                change = change.max((fit.gains[k] - before.gains[k]).abs());
                change = change.max((fit.offsets[k] - before.offsets[k]).abs());
            }
            if change < SETTLED && round > FIRST {
                break;
            }
        }
        fit
    }

    /// What a photo would have shown at gain one and offset zero.
    pub fn corrected(&self, photo: usize, intensity: f64) -> f64 {
        (intensity - self.offsets[photo]) / self.gains[photo]
    }
}

/// Photo and intensity of the observations of points that several photos see; every n-th such point, as many as are
/// enough.
fn shared(observations: &Observations, photos: usize) -> Vec<Vec<(usize, f64)>> {
    let eligible: Vec<usize> =
        (0..observations.points()).filter(|point| observations.of(*point).0.len() >= MIN_VIEWS).collect();
    let all: usize = eligible.iter().map(|point| observations.of(*point).0.len()).sum();
    let stride = (all / (ENOUGH * photos).max(1)).max(1);
    let of = |point: &usize| {
        let (photos, intensities) = observations.of(*point);
        let pairs = photos.iter().zip(intensities).filter(|(_, intensity)| **intensity < CLIPPED);
        pairs.map(|(photo, intensity)| (*photo as usize, f64::from(*intensity))).collect::<Vec<_>>()
    };
    eligible.iter().step_by(stride).map(of).filter(|point| point.len() >= MIN_VIEWS).collect()
}

/// Huber's weight of a residual in standard deviations.
fn huber(residual: f64) -> f64 {
    (1.345 / residual.max(1e-12)).min(1.0)
}

/// Tukey's.
fn biweight(residual: f64) -> f64 {
    (1.0 - (residual / 4.685).min(1.0).powi(2)).powi(2)
}

/// Gain and offset of the line through triples of reference, intensity and weight, by two iterations of reweighted least squares
/// from the line before; `robust` weighs residuals.
fn regression(pairs: &[[f64; 3]], mut line: [f64; 2], robust: fn(f64) -> f64) -> [f64; 2] {
    for _ in 0..2 {
        let residual = |[reference, intensity, _]: &[f64; 3]| (intensity - line[0] * reference - line[1]).abs();
        let mut sizes: Vec<f64> = pairs.iter().map(residual).collect();
        let deviation = (1.4826 * median(&mut sizes)).max(1e-6);
        let (mut rr, mut r, mut n, mut ri, mut i) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for pair @ [reference, intensity, weight] in pairs {
            let weight = weight * robust(residual(pair) / deviation);
            rr += weight * reference * reference;
            r += weight * reference;
            n += weight;
            ri += weight * reference * intensity;
            i += weight * intensity;
        }
        let preferred = PRIOR[0] * rr;
        (rr, ri, n) = (rr + preferred, ri + preferred, n * (1.0 + PRIOR[1]));
        let determinant = rr * n - r * r;
        if determinant <= 0.0 {
            return line;
        }
        line = [(ri * n - i * r) / determinant, (rr * i - r * ri) / determinant];
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    /// Points of known brightness in photos of known exposure, each seen by every other photo or so; a tenth of what is
    /// seen is a shadow or a highlight.
    fn world(photos: usize, points: usize) -> (Observations, Vec<f64>, Vec<f64>) {
        let uniform = |stream, i: usize| random::uniforms(11, stream, i as u32);
        let mut gains: Vec<f64> = (0..photos).map(|k| 0.7 + 0.6 * uniform(0, k)[0]).collect();
        let mut offsets: Vec<f64> = (0..photos).map(|k| 0.06 * uniform(0, k)[1] - 0.03).collect();
        let mean = |of: &[f64]| of.iter().sum::<f64>() / photos as f64;
        let (gain, offset) = (mean(&gains), mean(&offsets));
        gains.iter_mut().for_each(|g| *g /= gain);
        offsets.iter_mut().for_each(|o| *o -= offset);
        let mut observations = Observations { starts: vec![0], ..Observations::default() };
        for p in 0..points {
            let albedo = 0.05 + 0.5 * uniform(1, p)[0];
            for k in 0..photos {
                let [seen, odd, size, noise] = uniform(2, p * photos + k);
                if seen < 0.5 {
                    continue;
                }
                let look = albedo * if odd < 0.1 { 2.0 * size } else { 1.0 + 0.02 * (noise - 0.5) };
                observations.photos.push(k as u32);
                observations.intensities.push((gains[k] * look + offsets[k]) as f32);
            }
            observations.starts.push(observations.photos.len());
        }
        (observations, gains, offsets)
    }

    /// If this failed, a cloud before the sun would pass for gloss.
    #[test]
    fn exposures_are_found_beneath_shadows_and_highlights() {
        let (observations, gains, offsets) = world(30, 2000);
        let fit = Gains::fit(&observations, 30);
        for k in 0..30 {
            assert!((fit.gains[k] / gains[k] - 1.0).abs() < 0.01, "photo {k}: {} for {}", fit.gains[k], gains[k]);
            assert!((fit.offsets[k] - offsets[k]).abs() < 0.005, "photo {k}: {} for {}", fit.offsets[k], offsets[k]);
        }
        assert_eq!(fit.unfitted, 0);
        assert!((fit.gains.iter().sum::<f64>() / 30.0 - 1.0).abs() < 1e-9);
        assert!(fit.offsets.iter().sum::<f64>().abs() < 1e-9);
    }

    /// A photo that shares nothing with the others must be left as it is, not blown up by a line through no points.
    #[test]
    fn photos_without_common_points_are_left_alone() {
        let (mut observations, ..) = world(6, 500);
        let last = observations.points();
        observations.photos.extend([6, 6]);
        observations.intensities.extend([0.1, 0.2]);
        observations.starts.push(observations.starts[last] + 2);
        let fit = Gains::fit(&observations, 7);
        assert_eq!((fit.gains[6], fit.offsets[6], fit.unfitted), (1.0, 0.0, 1));
        assert_eq!(Gains::fit(&Observations::default(), 2), Gains::none(2));
    }

    /// On a grey wall gain and offset explain the same: whatever is chosen must stay small.
    #[test]
    fn a_wall_of_one_grey_gives_no_wild_lines() {
        let photos = 8;
        let mut observations = Observations { starts: vec![0], ..Observations::default() };
        for _ in 0..300 {
            for k in 0..photos {
                observations.photos.push(k);
                observations.intensities.push(0.2 + 0.01 * k as f32);
            }
            observations.starts.push(observations.photos.len());
        }
        let fit = Gains::fit(&observations, photos as usize);
        let looks: Vec<f64> = (0..photos as usize).map(|k| fit.corrected(k, 0.2 + 0.01 * k as f64)).collect();
        assert!(looks.iter().all(|look| (look - looks[0]).abs() < 0.002), "{looks:?}");
        assert!(fit.gains.iter().all(|gain| (0.7..1.4).contains(gain)), "{:?}", fit.gains);
    }
}

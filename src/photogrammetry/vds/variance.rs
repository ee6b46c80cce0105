//! How much the intensity of one point varies over the views that see it, robust to a few outliers.

use glam::DVec3;

/// Least number of views for which outliers can be detected.
const MIN_VIEWS: usize = 5;
/// Standard deviations, as the median absolute deviation has them, past which a view is an outlier.
const FENCE: f64 = 3.0;
/// What that deviation is at least: the noise of a photo.
const NOISE: f64 = 0.005;
/// Nearest views that may confirm a highlight, and the cosine of the greatest angle to them (30 degrees).
const WITNESSES: usize = 2;
const BESIDE: f64 = 0.866;
/// Part of a highlight's height above the median that a confirming view sees at least.
const WITNESSED: f64 = 0.25;

/// Variance of the intensities of a point (squared differences from the mean summed, over their number less one), and the mean. None
/// for fewer than two views.
pub fn moments(intensities: &[f64]) -> Option<(f64, f64)> {
    let count = intensities.len();
    if count < 2 {
        return None;
    }
    let mean = intensities.iter().sum::<f64>() / count as f64;
    let squares: f64 = intensities.iter().map(|v| (v - mean) * (v - mean)).sum();
    Some((squares / (count - 1) as f64, mean))
}

/// Which views of a point are inliers; `toward` are the unit directions to the cameras.
///
/// From five views on, a view that is more than three robust standard deviations off the median is left out: a shadow
/// that moved, a photo that was blurred or lit otherwise. Of three ways tried on normal deviates with a tenth of gross
/// outliers (winsorised, trimmed, squared median absolute deviation) trimming comes closest to the true variance. A
/// highlight is off the median too, but it adds light, and where it is seen from one direction it shows in the next
/// ones: a brighter view stays if one of the two views beside it (within 30 degrees) is at least a quarter as far above
/// the median. What is lost: a highlight so sharp that a single view sees it, and dark reflections that only a
/// few views see.
pub fn believed(intensities: &[f64], toward: &[DVec3]) -> Vec<bool> {
    if intensities.len() < MIN_VIEWS {
        return vec![true; intensities.len()];
    }
    let middle = median(&mut intensities.to_vec());
    let mut sizes: Vec<f64> = intensities.iter().map(|v| (v - middle).abs()).collect();
    let fence = FENCE * (1.4826 * median(&mut sizes)).max(NOISE);
    let witnessed = |k: usize| {
        let excess = intensities[k] - middle;
        let mut nearest = [(BESIDE, 0.0); WITNESSES];
        for (other, direction) in toward.iter().enumerate().filter(|(other, _)| *other != k) {
            let mut candidate = (direction.dot(toward[k]), intensities[other] - middle);
            for place in &mut nearest {
                if candidate.0 > place.0 {
                    std::mem::swap(&mut candidate, place);
                }
            }
        }
        nearest.iter().any(|(_, witness)| *witness >= WITNESSED * excess)
    };
    (0..intensities.len())
        .map(|k| {
            let excess = intensities[k] - middle;
            excess.abs() <= fence || (excess > 0.0 && witnessed(k))
        })
        .collect()
}

/// The median; zero of nothing. Reorders `values`.
pub(super) fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    let odd = values.len() % 2 == 1;
    let (below, &mut upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    let lower = if odd { upper } else { below.iter().copied().fold(f64::NEG_INFINITY, f64::max) };
    0.5 * (lower + upper)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{octahedral, random};

    /// Variance and mean over the inliers.
    fn variance(intensities: &[f64], toward: &[DVec3]) -> Option<(f64, f64)> {
        let believed = believed(intensities, toward);
        let kept = intensities.iter().zip(&believed).filter(|(_, believed)| **believed);
        moments(&kept.map(|(v, _)| *v).collect::<Vec<_>>())
    }

    /// A normal deviate (Box and Muller).
    fn normal(i: u32) -> f64 {
        let [u, v, ..] = random::uniforms(3, 0, i);
        (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }

    /// Directions of the upper hemisphere, 40 of them.
    fn above() -> Vec<DVec3> {
        octahedral::directions(9).into_iter().filter(|w| w.z > 0.0).take(40).collect()
    }

    /// If this failed, points would be called view dependent for what a passer-by did, or a whole class of scores would
    /// be off by a common factor.
    #[test]
    fn a_tenth_of_outliers_leaves_the_variance_as_it_is() {
        let toward = above();
        for part in [0.0, 0.1] {
            let trials = 2000;
            let mut mean = 0.0;
            for trial in 0..trials {
                let value = |k: u32| {
                    let i = trial * 64 + k;
                    let [odd, sign, ..] = random::uniforms(4, 0, i);
                    let off = if odd < part { 10.0 * (2.0 * sign - 1.0).signum() } else { 0.0 };
                    0.3 + 0.05 * (normal(i) + off)
                };
                let values: Vec<f64> = (0..toward.len() as u32).map(value).collect();
                mean += variance(&values, &toward).unwrap().0 / f64::from(trials) / 0.0025;
            }
            // Some bright outliers have another beside them by chance, and are kept: 1.6 of the true variance is
            // left, where all of it would be eleven times as much.
            let most = if part > 0.0 { 1.8 } else { 1.02 };
            assert!((0.93..most).contains(&mean), "{part} outliers: {mean} of the true variance");
        }
    }

    /// A highlight is what is looked for: if this failed, gloss would be removed with the shadows.
    #[test]
    fn a_highlight_that_neighbours_see_stays_and_a_lone_one_goes() {
        let toward = above();
        let peak = toward[17];
        let lobe = |w: &DVec3| 0.2 + 0.6 * ((w.dot(peak) - 1.0) / 0.06).exp();
        let glossy: Vec<f64> = toward.iter().map(lobe).collect();
        let plain = |values: &[f64]| {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64
        };
        let kept = variance(&glossy, &toward).unwrap().0;
        assert!((kept / plain(&glossy) - 1.0).abs() < 1e-9, "{kept} of {}", plain(&glossy));
        for wrong in [0.9, 0.0] {
            let mut matt = vec![0.2; toward.len()];
            matt[17] = wrong;
            let (left, mean) = variance(&matt, &toward).unwrap();
            assert!(left < 1e-12 && (mean - 0.2).abs() < 1e-12, "a lone {wrong} leaves {left}");
        }
    }

    /// Two views are enough for a variance, one is none.
    #[test]
    fn few_views_are_all_believed() {
        let toward = above();
        assert_eq!(variance(&[0.5], &toward[..1]), None);
        assert_eq!(variance(&[], &[]), None);
        let (two, mean) = variance(&[0.25, 0.75], &toward[..2]).unwrap();
        assert_eq!((two, mean), (0.125, 0.5));
    }
}

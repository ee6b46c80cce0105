//! Along which directions the radiance of a point varies.

use glam::DVec3;

use crate::scene::harmonics::{self, Lobe};

/// Views that an estimate takes at least.
const LEAST_VIEWS: usize = 6;
/// Length of the mean direction up to which views are spread out: about that of a cone of 25 degrees to each side.
const MOST_AGREEMENT: f64 = 0.95;
/// Ridge: the variance of a single residual's size about its expectation (0.57 times the square, for normal deviates)
/// over the variance that coefficients are expected to have (0.2 squared).
const RIDGE: f64 = 0.57 / 0.04;
/// Least of the function: views are never wanted less than a quarter as densely as on average.
const LEAST: f64 = 0.25;
/// Variance of a photo's noise, in luma: where the intensities vary no more than that, their residuals have no
/// direction.
const NOISE: f64 = 1e-4;

/// The lobe of a point: how large the residuals of its intensities against their `mean` are in each direction, relative
/// to their size on average, smoothed into a function of mean one. `toward` are the unit directions to the cameras.
///
/// Ridge regression of `|I_k - mean| / (mean of these) - 1` on the eight harmonics of degrees 1 and 2. All zero for
/// fewer than six views, or where these are all within a narrow cone; and the less the intensities vary beyond the
/// noise of photos, the flatter.
pub fn lobe(intensities: &[f64], toward: &[DVec3], mean: f64) -> Lobe {
    let count = intensities.len() as f64;
    let agreement = toward.iter().sum::<DVec3>().length() / count;
    let size = intensities.iter().map(|v| (v - mean).abs()).sum::<f64>() / count;
    if intensities.len() < LEAST_VIEWS || agreement > MOST_AGREEMENT || size <= 0.0 {
        return Lobe::default();
    }
    let mut normal = [[0.0; 8]; 8];
    let mut right = [0.0; 8];
    for (intensity, direction) in intensities.iter().zip(toward) {
        let basis = harmonics::basis(*direction);
        let residual = (intensity - mean).abs() / size - 1.0;
        for i in 0..8 {
            right[i] += residual * basis[i];
            for j in 0..=i {
                normal[i][j] += basis[i] * basis[j];
            }
        }
    }
    (0..8).for_each(|i| normal[i][i] += RIDGE);
    let coefficients = solve(normal, right);
    let variance = intensities.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count;
    let trust = variance / (variance + NOISE);
    harmonics::at_least(&coefficients.map(|c| (trust * c) as f32), LEAST)
}

/// Solves a positive definite system, of which the lower half is given, by Cholesky's decomposition.
fn solve(mut a: [[f64; 8]; 8], mut x: [f64; 8]) -> [f64; 8] {
    for i in 0..8 {
        for j in 0..=i {
            let sum = a[i][j] - (0..j).map(|k| a[i][k] * a[j][k]).sum::<f64>();
            a[i][j] = if i == j { sum.sqrt() } else { sum / a[j][j] };
        }
        x[i] = (x[i] - (0..i).map(|k| a[i][k] * x[k]).sum::<f64>()) / a[i][i];
    }
    for i in (0..8).rev() {
        x[i] = (x[i] - (i + 1..8).map(|k| a[k][i] * x[k]).sum::<f64>()) / a[i][i];
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::octahedral;

    /// If this failed, cameras would be asked for where a highlight is not.
    #[test]
    fn the_lobe_points_to_where_the_radiance_varies() {
        let toward: Vec<DVec3> = octahedral::directions(12).into_iter().filter(|w| w.z > 0.1).collect();
        let peak = DVec3::new(0.6, 0.0, 0.8);
        let look = |w: &DVec3| 0.2 + 0.5 * ((w.dot(peak) - 1.0) / 0.1).exp();
        let intensities: Vec<f64> = toward.iter().map(look).collect();
        let mean = intensities.iter().sum::<f64>() / intensities.len() as f64;
        let lobe = lobe(&intensities, &toward, mean);
        let [there, away] = [peak, DVec3::new(-0.6, 0.0, 0.8)].map(|w| harmonics::value(&lobe, w));
        assert!(there > 1.3 && there > 1.5 * away, "{there} toward the highlight, {away} opposite");
        let least = octahedral::directions(64).iter().map(|w| harmonics::value(&lobe, *w)).fold(9.0, f64::min);
        assert!(least >= LEAST, "{least}");
    }

    /// If this failed, the noise of a matt point, or a handful of views, would pass for a direction.
    #[test]
    fn noise_and_few_views_give_a_flat_lobe() {
        let toward: Vec<DVec3> = octahedral::directions(12).into_iter().filter(|w| w.z > 0.1).collect();
        let noise: Vec<f64> = (0..toward.len()).map(|i| 0.3 + 0.001 * ((i * 7919) % 13) as f64 / 13.0).collect();
        let flat = lobe(&noise, &toward, 0.3005);
        assert!(flat.iter().all(|c| c.abs() < 0.01), "{flat:?}");
        assert_eq!(lobe(&[0.1, 0.9, 0.1, 0.9, 0.1], &toward[..5], 0.4), Lobe::default());
        let narrow: Vec<DVec3> = (0..9).map(|i| DVec3::new(0.02 * f64::from(i), 0.0, 1.0).normalize()).collect();
        assert_eq!(lobe(&[0.1, 0.9, 0.1, 0.9, 0.1, 0.9, 0.1, 0.9, 0.1], &narrow, 0.4), Lobe::default());
    }
}

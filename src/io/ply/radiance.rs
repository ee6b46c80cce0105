//! What the spherical harmonics of trained splats say of view dependency.

use glam::DVec3;

use crate::scene::harmonics::{self, Lobe, above_constant};
use crate::scene::{colour, octahedral};

/// Texels along a side of the map that a splat's radiance is sampled on.
const RESOLUTION: u32 = 8;
/// No direction counts for less than this part of the mean, so that harmonics that merely ring do not blind a point.
const LEAST: f64 = 0.25;

/// Harmonics above the constant one, as trained files store them: all of red, then of green, then of blue.
pub(super) struct Radiance<'a> {
    columns: &'a [Vec<f64>],
    directions: Vec<DVec3>,
    /// The harmonics in each of the directions.
    basis: Vec<[f64; 15]>,
}

impl<'a> Radiance<'a> {
    /// From the columns of f_rest_0 and its like; none where they are no whole degrees of them, up to the third.
    pub fn new(columns: &'a [Vec<f64>]) -> Option<Self> {
        if ![9, 24, 45].contains(&columns.len()) {
            return None;
        }
        let directions = octahedral::directions(RESOLUTION);
        // Renderers evaluate them in the direction from the camera to the splat.
        let basis = directions.iter().map(|w| above_constant(-*w)).collect();
        Some(Self { columns, directions, basis })
    }

    /// Variance over all directions of the luma of splat `i`'s linear colour, clamped to [0, 1] as a photo is, and the lobe
    /// along which it departs from its mean; `dc` is its sRGB colour without the harmonics.
    pub fn variation(&self, i: usize, dc: DVec3) -> (f32, Lobe) {
        let each = self.columns.len() / 3;
        let luma: Vec<f64> = self
            .basis
            .iter()
            .map(|basis| {
                let channel = |c: usize| (0..each).map(|k| basis[k] * self.columns[c * each + k][i]).sum::<f64>();
                colour::luma(dc + DVec3::new(channel(0), channel(1), channel(2)))
            })
            .collect();
        let count = luma.len() as f64;
        let mean = luma.iter().sum::<f64>() / count;
        let variance = luma.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / count;
        let departure = luma.iter().map(|l| (l - mean).abs()).sum::<f64>() / count;
        // Nothing but rounding.
        if departure < 1e-6 {
            return (0.0, Lobe::default());
        }
        let mut lobe = [0.0; 8];
        for (w, l) in self.directions.iter().zip(&luma) {
            let part = (l - mean).abs() / departure / count;
            harmonics::basis(*w).iter().zip(&mut lobe).for_each(|(b, c)| *c += part * b);
        }
        (variance as f32, harmonics::at_least(&lobe.map(|c| c as f32), LEAST))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A splat that is brighter from one side must be planned for around that axis, and a plain one not at all.
    #[test]
    fn a_splat_that_shines_one_way_has_a_lobe_there() {
        // Grey: the same in all channels. Negative z of degree one, seen from +z: brighter there.
        let mut columns = vec![vec![0.0, 0.0]; 9];
        for channel in 0..3 {
            columns[3 * channel + 1] = vec![-0.5, 0.0];
        }
        let shining = Radiance::new(&columns).unwrap();
        let (variance, lobe) = shining.variation(0, DVec3::splat(0.5));
        assert!(variance > 1e-3, "{variance}");
        let at = |w: DVec3| harmonics::value(&lobe, w);
        // sRGB is steeper where it is bright, so the bright side departs from the mean the most.
        assert!(at(DVec3::Z) > at(DVec3::X) + 0.2, "{} against {}", at(DVec3::Z), at(DVec3::X));
        assert!(at(DVec3::Z) > at(DVec3::NEG_Z), "{} against {}", at(DVec3::Z), at(DVec3::NEG_Z));
        assert_eq!(shining.variation(1, DVec3::splat(0.5)), (0.0, Lobe::default()));
    }
}

//! View dependency from the spherical harmonics of trained splats.

use glam::DVec3;

use crate::scene::harmonics::above_constant;
use crate::scene::{colour, octahedral};

/// Texels along a side of the map that a splat's radiance is sampled on.
const RESOLUTION: u32 = 8;

/// Harmonics above the constant one, as trained files store them: all of red, then of green, then of blue.
pub(super) struct Radiance<'a> {
    columns: &'a [Vec<f64>],
    /// The harmonics in each direction of the map.
    basis: Vec<[f64; 15]>,
}

impl<'a> Radiance<'a> {
    /// From the columns of f_rest_0 and its like; none where they are no whole degrees of them, up to the third.
    pub fn new(columns: &'a [Vec<f64>]) -> Option<Self> {
        if ![9, 24, 45].contains(&columns.len()) {
            return None;
        }
        // Renderers evaluate them in the direction from the camera to the splat.
        let basis = octahedral::directions(RESOLUTION).iter().map(|w| above_constant(-*w)).collect();
        Some(Self { columns, basis })
    }

    /// Variance over all directions of the luma of splat `i`'s linear colour, clamped to [0, 1] as a photo is;
    /// `dc` is its sRGB colour without the harmonics.
    pub fn variance(&self, i: usize, dc: DVec3) -> f32 {
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
        // Less is nothing but rounding.
        if departure < 1e-6 { 0.0 } else { variance as f32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, splats that shine one way would be scored as matt ones, or matt ones as if they shone.
    #[test]
    fn a_splat_varies_as_its_harmonics_say() {
        // Grey: the same in all channels. Along z, of degree one.
        let mut columns = vec![vec![0.0, 0.0]; 9];
        for channel in 0..3 {
            columns[3 * channel + 1] = vec![-0.5, 0.0];
        }
        let radiance = Radiance::new(&columns).unwrap();
        let [shining, plain] = [0, 1].map(|i| radiance.variance(i, DVec3::splat(0.5)));
        assert!(shining > 1e-3 && plain == 0.0, "{shining}, {plain}");
    }
}

//! View dependency from the spherical harmonics of trained splats.

use glam::DVec3;

use crate::scene::gaussians::Gaussians;
use crate::scene::harmonics::above_constant;
use crate::scene::{colour, octahedral};

/// Texels along a side of the map that a splat's radiance is sampled on.
const RESOLUTION: u32 = 8;

/// The harmonics of splats above the constant one.
pub(super) struct Radiance<'a> {
    splats: &'a Gaussians,
    /// The harmonics in each direction of the map.
    basis: Vec<[f64; 15]>,
}

impl<'a> Radiance<'a> {
    /// Of splats; none where their colour is the same from all sides.
    pub fn new(splats: &'a Gaussians) -> Option<Self> {
        // Renderers evaluate them in the direction from the camera to the splat.
        let basis = || octahedral::directions(RESOLUTION).iter().map(|w| above_constant(-*w)).collect();
        (splats.degree > 0).then(|| Self { splats, basis: basis() })
    }

    /// Variance over all directions of the luma of splat `i`'s linear colour, clamped to [0, 1] as a photo is;
    /// `dc` is its sRGB colour without the harmonics.
    pub fn variance(&self, i: usize, dc: DVec3) -> f32 {
        let each = self.splats.coefficients();
        let own = &self.splats.harmonics[3 * each * i..3 * each * (i + 1)];
        let luma: Vec<f64> = self
            .basis
            .iter()
            .map(|basis| {
                let channel = |c: usize| (1..each).map(|k| basis[k - 1] * f64::from(own[3 * k + c])).sum::<f64>();
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
        let mut splats =
            Gaussians { centres: vec![DVec3::ZERO; 2], degree: 1, harmonics: vec![0.0; 24], ..Gaussians::default() };
        // Grey: the same in all channels. Along z, of degree one.
        splats.harmonics[6..9].fill(-0.5);
        let radiance = Radiance::new(&splats).unwrap();
        let [shining, plain] = [0, 1].map(|i| radiance.variance(i, DVec3::splat(0.5)));
        assert!(shining > 1e-3 && plain == 0.0, "{shining}, {plain}");
        assert!(Radiance::new(&Gaussians::default()).is_none());
    }
}

//! Trained splats: three-dimensional Gaussians with an opacity and a colour that changes with the view.

use glam::{DQuat, DVec3};

use super::harmonics;
use super::similarity::Similarity;

/// Highest degree of the harmonics.
pub const MAX_DEGREE: u32 = 3;

/// Gaussians, one entry of every list each; values are those that a trainer optimises and a .ply file stores.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gaussians {
    /// Centres, in the file's frame and units.
    pub centres: Vec<DVec3>,
    /// Natural logarithms of the standard deviations along the three axes.
    pub log_scales: Vec<[f32; 3]>,
    /// World-from-splat quaternions (w, x, y, z) of any length but zero.
    pub rotations: Vec<[f32; 4]>,
    /// Logits of the opacities.
    pub opacities: Vec<f32>,
    /// Degree of the spherical harmonics, 0 to [`MAX_DEGREE`].
    pub degree: u32,
    /// Coefficients of the real spherical harmonics: `(degree + 1)^2` of red, green and blue side by side for each Gaussian.
    /// With basis B in the direction w from the camera to the centre, the sRGB colour is `max(0, 0.5 + sum_k c_k B_k(w))`.
    pub harmonics: Vec<f32>,
    /// Whether they were trained with Mip-Splatting's 2D filter, so that renderers have to apply it.
    pub antialiased: bool,
}

/// Largest size of a logit: the opacity is 0 or 1 in single precision.
pub const MAX_LOGIT: f32 = 20.0;

/// Logarithm of the standard deviation of what is flat: its square is still a number in single precision.
pub const FLAT: f32 = -40.0;

impl Gaussians {
    /// Opacity of Gaussian `i`, from 0 to 1.
    pub fn opacity(&self, i: usize) -> f64 {
        1.0 / (1.0 + (-f64::from(self.opacities[i])).exp())
    }

    /// Gives what files hold as infinite the values that can be computed with: opacities of 0 or 1, and no extent along an axis.
    pub fn bounded(mut self) -> Self {
        let infinite = self.opacities.iter_mut().filter(|opacity| opacity.is_infinite());
        infinite.for_each(|opacity| *opacity = MAX_LOGIT.copysign(*opacity));
        let flat = self.log_scales.iter_mut().flatten().filter(|scale| **scale == f32::NEG_INFINITY);
        flat.for_each(|scale| *scale = FLAT);
        self
    }

    /// The same model in another frame.
    pub fn through(mut self, map: &Similarity) -> Self {
        let grown = map.scale.ln();
        self.centres.iter_mut().for_each(|centre| *centre = map.point(*centre));
        for scale in self.log_scales.as_flattened_mut() {
            *scale = (f64::from(*scale) + grown) as f32;
        }
        if map.rotation == DQuat::IDENTITY {
            return self;
        }
        for rotation in &mut self.rotations {
            let [w, x, y, z] = rotation.map(f64::from);
            let DQuat { x, y, z, w } = map.rotation * DQuat::from_xyzw(x, y, z, w);
            *rotation = [w, x, y, z].map(|v| v as f32);
        }
        let (each, matrix) = (self.coefficients(), harmonics::turned(map.rotation));
        for own in self.harmonics.chunks_exact_mut(3 * each) {
            for channel in 0..3 {
                let before: Vec<f64> = (1..each).map(|k| f64::from(own[3 * k + channel])).collect();
                for (k, row) in (1..each).zip(&matrix) {
                    own[3 * k + channel] = row.iter().zip(&before).map(|(a, b)| a * b).sum::<f64>() as f32;
                }
            }
        }
        self
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.centres.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.centres.is_empty()
    }

    /// Those that `keep` accepts, by their number.
    pub fn filtered(&self, keep: impl Fn(usize) -> bool) -> Self {
        let kept: Vec<usize> = (0..self.len()).filter(|&i| keep(i)).collect();
        let row = 3 * self.coefficients();
        Self {
            centres: kept.iter().map(|&i| self.centres[i]).collect(),
            log_scales: kept.iter().map(|&i| self.log_scales[i]).collect(),
            rotations: kept.iter().map(|&i| self.rotations[i]).collect(),
            opacities: kept.iter().map(|&i| self.opacities[i]).collect(),
            degree: self.degree,
            harmonics: kept.iter().flat_map(|&i| self.harmonics[row * i..][..row].iter().copied()).collect(),
            antialiased: self.antialiased,
        }
    }

    /// Whether all values of Gaussian `i` are finite.
    pub fn is_finite(&self, i: usize) -> bool {
        let row = 3 * self.coefficients();
        let shape = self.log_scales[i].iter().chain(&self.rotations[i]).chain(&self.opacities[i..=i]);
        self.centres[i].is_finite() && shape.chain(&self.harmonics[row * i..][..row]).all(|value| value.is_finite())
    }

    /// Coefficients of each Gaussian and channel: `(degree + 1)^2`.
    pub fn coefficients(&self) -> usize {
        coefficients(self.degree)
    }
}

/// Coefficients of all harmonics up to a degree.
pub const fn coefficients(degree: u32) -> usize {
    ((degree + 1) * (degree + 1)) as usize
}

//! Trained splats: three-dimensional Gaussians with an opacity and a colour that changes with the view.

use glam::DVec3;

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
}

impl Gaussians {
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

//! How Gaussians lie in device memory, and the constants of stages.

use glam::DVec3;

use crate::engine::vulkan::shaders::glsl::splats::gaussian;
use crate::engine::vulkan::shaders::glsl::splats::sums;
use crate::scene::gaussians::{Gaussians, MAX_DEGREE, coefficients};

crate::specialisation! {
    /// Constants of stages with a thread per Gaussian (`splats/gaussian.glsl`).
    pub(crate) struct SplatConstants {
        /// Whether the low-pass filter is compensated for (Yu et al. 2024).
        antialiased: bool,
    }
}

crate::specialisation! {
    /// Constants of stages with a workgroup per tile.
    pub(crate) struct TileConstants {
        /// As [`SplatConstants::antialiased`].
        antialiased: bool,
        /// Threads per workgroup.
        local_size_x: u32,
        /// Whether the forward pass writes depths.
        depths: bool,
        /// Threads that share a block of pixels.
        lanes: u32,
        /// Whether those are a subgroup.
        subgroups: bool,
    }
}

crate::gpu_struct! {
    /// A Gaussian as a view sees it; an opacity of zero where it is not seen.
    pub struct Projected {
        /// Centre in pixels.
        pub mean: [f32; 2],
        /// Depth along the optical axis.
        pub depth: f32,
        /// Opacity, with what antialiasing takes from it.
        pub opacity: f32,
        /// Inverse covariance (xx, xy, yy) in pixels^-2.
        pub conic: [f32; 3],
        /// Determinant of it.
        pub determinant: f32,
        /// sRGB colour, not negative.
        pub colour: [f32; 3],
        /// Unused.
        pub spare0: u32,
    }
}

crate::gpu_struct! {
    /// Push constants of the stages that make one picture.
    pub struct PassPush {
        /// From one plane of parameters to the next: the most Gaussians there can be.
        pub stride: u32,
        /// The view's index.
        pub view: u32,
        /// Degree of the harmonics that take part.
        pub degree: u32,
        /// Capacity for instances.
        pub capacity: u32,
        /// sRGB colour behind everything.
        pub background: [f32; 3],
        /// Iteration, from zero.
        pub iteration: u32,
    }
}

/// Planes of the parameters: value `plane` of Gaussian `i` is at `plane * stride + i`.
pub const CENTRE: usize = gaussian::CENTRE as usize;
/// First of three planes of logarithms of standard deviations.
pub const LOG_SCALE: usize = gaussian::LOG_SCALE as usize;
/// First of four planes of quaternions (w, x, y, z).
pub(crate) const ROTATION: usize = gaussian::ROTATION as usize;
/// Logits of opacities.
pub const OPACITY: usize = gaussian::OPACITY as usize;
/// First of the planes of harmonics: red, green and blue of each function.
pub const HARMONICS: usize = gaussian::HARMONICS as usize;
/// Planes of harmonics up to a degree and all before them.
pub const fn planes(degree: u32) -> usize {
    HARMONICS + 3 * coefficients(degree)
}

/// Pixels of a tile along a side.
pub(crate) const TILE: u32 = gaussian::TILE;
/// Instances between two checkpoints of the transmittance.
pub(crate) const BLOCK: u32 = gaussian::BLOCK;
/// Sums over pixels that the gradient of an instance is made of.
pub(crate) const SUMS: u64 = sums::SUMS as u64;

/// Gaussians as planes, `stride` values apart, with all harmonics up to `degree`; what a file lacks is zero. Centres are
/// rounded: give them in a frame whose origin is near.
pub fn to_planes(gaussians: &Gaussians, degree: u32, stride: usize) -> Vec<f32> {
    let mut values = vec![0f32; planes(degree) * stride];
    let own = gaussians.coefficients();
    for i in 0..gaussians.len() {
        let mut put = |plane: usize, value: f32| values[plane * stride + i] = value;
        let vectors = [gaussians.centres[i].as_vec3().to_array(), gaussians.log_scales[i]];
        vectors.iter().flatten().enumerate().for_each(|(k, value)| put(CENTRE + k, *value));
        gaussians.rotations[i].iter().enumerate().for_each(|(k, value)| put(ROTATION + k, *value));
        put(OPACITY, gaussians.opacities[i]);
        let taken = 3 * own.min(coefficients(degree));
        let harmonics = &gaussians.harmonics[3 * own * i..][..taken];
        harmonics.iter().enumerate().for_each(|(k, value)| put(HARMONICS + k, *value));
    }
    values
}

/// The first `count` Gaussians of planes that [`to_planes`] made.
pub fn from_planes(values: &[f32], degree: u32, stride: usize, count: usize) -> Gaussians {
    let degree = degree.min(MAX_DEGREE);
    let at = |plane: usize, i: usize| values[plane * stride + i];
    let vector = |plane: usize, i: usize| [0, 1, 2].map(|k| at(plane + k, i));
    Gaussians {
        centres: (0..count).map(|i| DVec3::from(vector(CENTRE, i).map(f64::from))).collect(),
        log_scales: (0..count).map(|i| vector(LOG_SCALE, i)).collect(),
        rotations: (0..count).map(|i| [0, 1, 2, 3].map(|k| at(ROTATION + k, i))).collect(),
        opacities: (0..count).map(|i| at(OPACITY, i)).collect(),
        degree,
        harmonics: (0..count)
            .flat_map(|i| (0..3 * coefficients(degree)).map(move |k| (i, k)))
            .map(|(i, k)| at(HARMONICS + k, i))
            .collect(),
        antialiased: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a trained model would come back with its values exchanged.
    #[test]
    fn planes_give_back_what_they_were_made_of() {
        let n = 5;
        let value = |k: usize| (k as f32).sin();
        let gaussians = Gaussians {
            centres: (0..n).map(|i| DVec3::new(i as f64, 0.5, -1.0)).collect(),
            log_scales: (0..n).map(|i| [value(i), value(i + 1), value(i + 2)]).collect(),
            rotations: (0..n).map(|i| [value(i), 1.0, value(i + 1), value(i + 2)]).collect(),
            opacities: (0..n).map(value).collect(),
            degree: 2,
            harmonics: (0..27 * n).map(value).collect(),
            antialiased: false,
        };
        assert_eq!(from_planes(&to_planes(&gaussians, 2, 8), 2, 8, n), gaussians);
        // A trainer of degree 3 adds zeros behind.
        let wider = from_planes(&to_planes(&gaussians, 3, n), 3, n, n);
        assert_eq!(wider.harmonics[48..48 + 27], gaussians.harmonics[27..54]);
        assert_eq!(wider.harmonics[48 + 27..96], [0.0; 21]);
    }
}

//! Distance between the features of two pictures (`lpips_distance.comp`).

use crate::engine::vulkan::shaders::glsl::splats::image_metrics::lpips_distance as glsl;

crate::gpu_struct! {
    /// Push constants of [`LpipsDistanceStage`].
    pub struct DistancePush {
        /// Channels of the features.
        pub channels: u32,
        /// Pixels of the layer's picture.
        pub pixels: u32,
    }
}

crate::stage!(
    /// A thread per pixel.
    pub LpipsDistanceStage = lpips_distance(DistancePush) { read weights, read first, read second, write distances }
);

/// Keeps features that are all zero from being divided by zero; as in the shader.
const TINY: f64 = glsl::TINY;

/// The twin of `lpips_distance`, in f64: the distance at each of `pixels` pixels of features that lie channel by channel.
pub fn lpips_distance(weights: &[f32], first: &[f32], second: &[f32], pixels: usize) -> Vec<f32> {
    let value = |features: &[f32], c: usize, pixel: usize| f64::from(features[c * pixels + pixel]);
    let length = |features: &[f32], pixel| {
        let squares = (0..weights.len()).map(|c| value(features, c, pixel).powi(2));
        squares.sum::<f64>().sqrt() + TINY
    };
    let at = |pixel| {
        let (a, b) = (length(first, pixel), length(second, pixel));
        let difference = |c| value(first, c, pixel) / a - value(second, c, pixel) / b;
        (0..weights.len()).map(|c| f64::from(weights[c]) * difference(c).powi(2)).sum::<f64>() as f32
    };
    (0..pixels).map(at).collect()
}

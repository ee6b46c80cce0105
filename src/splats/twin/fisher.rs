//! The diagonal of a view's Fisher information, by its definition.

use glam::DVec3;

use super::{Rules, Splat, View, gradients};

/// Sum over pixels of the square of the derivative of red + green + blue by every value, over a black background; one whole
/// backward pass a pixel.
pub fn information(splats: &[Splat], view: &View, rules: &Rules) -> Vec<Splat> {
    let mut sums: Vec<Splat> = splats.iter().map(|splat| Splat::zero(splat.harmonics.len())).collect();
    let mut by_colour = vec![DVec3::ZERO; view.pixels()];
    for pixel in 0..view.pixels() {
        by_colour[pixel] = DVec3::ONE;
        for (sum, by) in sums.iter_mut().zip(gradients(splats, view, rules, DVec3::ZERO, &by_colour)) {
            sum.centre += by.centre * by.centre;
            sum.log_scale += by.log_scale * by.log_scale;
            (0..4).for_each(|k| sum.rotation[k] += by.rotation[k] * by.rotation[k]);
            sum.opacity += by.opacity * by.opacity;
            sum.harmonics.iter_mut().zip(by.harmonics).for_each(|(sum, by)| *sum += by * by);
        }
        by_colour[pixel] = DVec3::ZERO;
    }
    sums
}

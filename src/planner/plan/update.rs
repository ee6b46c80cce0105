//! One Adam step of every splat (`planner/plan/update.glsl`): its twin. The stage is the objective's own, which gathers the gradients.

use glam::DVec3;

use super::clock::Clock;
use super::shared::Settings;
use crate::engine::vulkan::physical::Physical;

crate::specialisation! {
    /// Constants of an update that has none of its own.
    pub(crate) struct UpdateConstants {
        /// Threads per workgroup, a power of two from 64 to 1024.
        threads: u32,
    }
}

/// Adam's moments of a vector.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Adam {
    /// First moment.
    pub mean: DVec3,
    /// Second moment.
    pub square: DVec3,
}

impl Adam {
    /// Takes in a gradient at step `step` (from 1); returns the step against it at a learning rate of one.
    pub fn change(&mut self, gradient: DVec3, step: u32) -> DVec3 {
        self.mean = 0.9 * self.mean + 0.1 * gradient;
        self.square = 0.999 * self.square + 0.001 * gradient * gradient;
        let mean = self.mean / (1.0 - 0.9f64.powf(f64::from(step)));
        let square = self.square / (1.0 - 0.999f64.powf(f64::from(step)));
        mean / (square.map(f64::sqrt) + 1e-10)
    }
}

/// Moves a splat, centre and unit direction, against the gradient of the loss by the two; `moments` are theirs.
pub fn update(
    settings: &Settings,
    clock: &Clock,
    splat: (DVec3, DVec3),
    moments: &mut [Adam; 2],
    gradient: (DVec3, DVec3),
) -> (DVec3, DVec3) {
    let [of_centre, of_direction] = moments;
    let (centre, direction) = splat;
    // Only the part across the direction turns it.
    let across = gradient.1 - gradient.1.dot(direction) * direction;
    let by_centre = f64::from(settings.lr_position) * clock.rate * of_centre.change(gradient.0, clock.step);
    let by_direction = f64::from(settings.lr_direction) * clock.rate * of_direction.change(across, clock.step);
    (centre - by_centre, (direction - by_direction).normalize())
}

/// Most splats whose updates leave threads of a GPU idle.
const FEW: u32 = 512;

/// Threads of a workgroup of the update, one to a splat: the sums of few splats are shared among more threads.
pub(crate) fn update_threads(physical: &Physical, splats: u32) -> u32 {
    if physical.is_cpu() || splats > FEW { 64 } else { 256 }
}

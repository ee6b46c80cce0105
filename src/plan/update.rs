//! Sums over probes, regulariser, region and one Adam step (`update_*.comp`), and its twin: the regulariser and the step.

use glam::DVec3;

use super::dense::Batch;
use super::shared::{Anchor, Control, Gradient, Moments, PlanConstants, Record, Settings, Splat, Tally};
use super::tally::Clock;
use crate::scene::octahedral;
use crate::visibility::device_scene::DeviceRegion;
use crate::visibility::probe_depth::Probe;

crate::stage!(
    /// One Adam step, a workgroup per camera splat; the last one ends the iteration, and nothing else writes [`Control`].
    pub(crate) UpdateSplatStage = update_splat<PlanConstants>(()) {
        read settings, write control, write splats, read slots, read partials, read tallies, write moments, write terms,
        write gradients, read region, read free_distance, write history, write mailbox, write arrivals, read probes,
        read depth,
    } with [Settings, Control, Splat, Probe, Gradient, Tally, Moments, DeviceRegion, Record]
);
crate::stage!(
    /// The same where the objective is what viewers are expected to see.
    pub(crate) UpdateQualityStage = update_quality<PlanConstants>(()) {
        read settings, write control, write splats, read slots, read partials, read tallies, write moments, write terms,
        write gradients, read region, read free_distance, write history, write mailbox, write arrivals, read anchor_starts,
        read anchors,
    } with [Settings, Control, Splat, Gradient, Tally, Moments, DeviceRegion, Record, Anchor]
);

/// Coverage regulariser of a batch with the given coverage weights: the mean over probes and splats of
/// `vis w (1 - c)`, and its gradients by centre and by direction (as if the direction were a free vector).
pub fn regulariser(batch: &Batch<'_>, weights: &[f64]) -> (f64, Vec<DVec3>, Vec<DVec3>) {
    let share = 1.0 / (batch.probes.len() as f64 * batch.splats.len() as f64);
    let texels = batch.directions.len();
    let resolution = (texels as f64).sqrt() as u32;
    let mut loss = 0.0;
    let (mut by_centre, mut by_direction) = (Vec::new(), Vec::new());
    for &(centre, direction) in batch.splats {
        let (mut a, mut b) = (DVec3::ZERO, DVec3::ZERO);
        for (i, &(position, _)) in batch.probes.iter().enumerate() {
            let ray = centre - position;
            let d = ray.length().max(1e-6);
            let n = ray / d;
            let texel = octahedral::texel(n, resolution) as usize;
            if batch.occlusion && d >= batch.depth[i * texels + texel].abs() {
                continue;
            }
            let weight = weights[i] * share;
            loss += weight * (1.0 + direction.dot(n));
            a += weight / d * (direction - direction.dot(n) * n);
            b += weight * n;
        }
        by_centre.push(a);
        by_direction.push(b);
    }
    (loss, by_centre, by_direction)
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

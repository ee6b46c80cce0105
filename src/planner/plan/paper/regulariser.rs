//! The end of an iteration of the paper's objective (`update_paper.comp`), and the twin of its coverage regulariser.

use glam::DVec3;

use super::dense::Batch;
use super::shared::{PaperConstants, PaperSettings, Scale, Tally};
use crate::planner::plan::shared::{CameraState, Control, Gradient, Moments, Record, Settings};
use crate::scene::octahedral;
use crate::visibility::device_scene::DeviceRegion;
use crate::visibility::probe_depth::Probe;

crate::stage!(
    /// One Adam step, a workgroup per camera splat; the last one ends the iteration, and nothing else writes [`Control`] and [`Scale`].
    pub(crate) UpdatePaperStage = update_paper<PaperConstants>(()) {
        read settings, write control, write splats, read slots, read partials, write moments, write terms, write gradients,
        read region, read free_distance, write history, write mailbox, write arrivals, read tallies, read probes, read depth,
        read paper, write scale_state,
    } with [Settings, Control, CameraState, Probe, Gradient, Tally, Moments, DeviceRegion, Record, PaperSettings, Scale]
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

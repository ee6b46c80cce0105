//! Relocation of splats of low utility (`rank.comp`, `relocate.comp`; docs/reference/method.md, Optimisation).

use super::shared::{PaperConstants, PaperSettings, Tally};
use crate::planner::plan::shared::{CameraState, Control, Moments, Settings};
use crate::visibility::device_scene::DeviceRegion;
use crate::visibility::probe_depth::Probe;

crate::stage!(
    /// Splats by utility, least first.
    pub(crate) RankStage = rank<PaperConstants>(()) {
        read settings, read control, read moments, write order, read paper,
    } with [Settings, Control, Moments, PaperSettings]
);

crate::stage!(
    /// A workgroup for each of the tenth of splats with the least utility.
    pub(crate) RelocateStage = relocate<PaperConstants>(()) {
        read settings, read control, write splats, read probes, read directions, read depth, read deficit,
        write moments, read order, read region, read free_distance, read tallies, read paper,
    } with [Settings, Control, CameraState, Probe, Moments, Tally, DeviceRegion, PaperSettings]
);

/// The splats in the order of their utility, least first, kept ones last: the twin of `rank`.
pub fn rank(utility: &[f32], kept: usize) -> Vec<u32> {
    let mut order: Vec<u32> = (kept as u32..utility.len() as u32).collect();
    order.sort_by(|&a, &b| utility[a as usize].total_cmp(&utility[b as usize]));
    order.extend(0..kept as u32);
    order
}

//! The order in which formats that compress neighbours together want splats.

use glam::DVec3;

use crate::scene::morton;

/// Numbers of positions along the Morton curve of their bounds.
pub(in crate::files::io) fn along_morton(positions: &[DVec3]) -> Vec<usize> {
    let (low, high) = positions.iter().fold((DVec3::MAX, DVec3::MIN), |(low, high), p| (low.min(*p), high.max(*p)));
    let side = (high - low).max_element();
    let mut order: Vec<(u64, usize)> = positions.iter().map(|p| morton::code(*p, low, side)).zip(0..).collect();
    order.sort_unstable();
    order.into_iter().map(|(_, i)| i).collect()
}

//! How many pairs of probe and splat, and tiles of them, a run has room for.

use super::binned::TILE;
use super::dense::KERNEL_CUTOFF;
use crate::engine::vulkan::physical::Physical;
use crate::planner::plan::config::MAX_VIEWS;

/// Depth maps of the pool take at most this much, and no more than an eighth of the device.
const POOL_BYTES: u64 = 256 << 20;

/// How many of `points` probes' depth maps fit; never fewer than one step needs.
pub(super) fn pool(points: usize, probes: u32, resolution: u32, physical: &Physical) -> usize {
    let bytes = POOL_BYTES.min(physical.storage_range).min(physical.heap / 8) / (4 * (resolution * resolution) as u64);
    points.min((bytes as usize).max(probes as usize))
}

/// About how many views a plan on this device can have with so many probes a step: one point camera in ten sees a view,
/// a third more is left for everything else, and no buffer passes the device's limit.
pub fn largest(physical: &Physical, probes: u32) -> u64 {
    let limit = physical.storage_range.min(physical.allocation);
    let a_view = 4 * probes as u64;
    let a_visible_view = 36 * probes as u64 / 10;
    let most = ((1 << 28) / probes as u64).min(u64::from(MAX_VIEWS));
    most.min(limit / a_view).min(physical.heap * 2 / 3 / (a_view + a_visible_view + 2000))
}

/// The capacities of a run.
pub(super) struct Capacity {
    /// Visible splats of a probe (dense), or pairs of probe and visible splat in all (binned).
    pub pairs: u32,
    /// Instances of the binned pass.
    pub instances: u32,
}

impl Capacity {
    /// Capacity for all splats, or as many as one buffer of partials can hold; in the binned pass for twice the pairs that
    /// pass the gate at the start, and the tiles that kernels half again as wide as at the start reach into. A run that needs
    /// more reports it and is restarted with more.
    pub fn new(
        [splats, probes]: [u32; 2],
        gated: f64,
        binned: bool,
        scale: f32,
        resolution: u32,
        physical: &Physical,
    ) -> Self {
        let limit = physical.storage_range.min(physical.allocation).min(physical.heap / 4) / 32;
        let most = |wanted: u64| wanted.min(limit).clamp(1, 1 << 28) as u32;
        if !binned {
            // Partials come in blocks of texels, up to 256 for 256 x 256 texels.
            let blocks = (resolution * resolution).div_ceil(256);
            let rows = probes * blocks;
            return Self { pairs: most(splats as u64 * rows as u64).div_ceil(rows).min(splats), instances: 0 };
        }
        let pairs = ((2.0 * gated * f64::from(probes)) as u64 + 4096).min(splats as u64 * probes as u64);
        // A cap of the sphere up to the kernel's cut-off, in tiles: its area, its rim and its corners.
        let tiles = f64::from((resolution / TILE).pow(2));
        let area = tiles * 0.5 * KERNEL_CUTOFF * (1.5 * f64::from(scale)).powi(2);
        let reached = (area + 4.0 * area.sqrt() + 4.0).min(tiles);
        Self { pairs: most(pairs), instances: most((reached * pairs as f64) as u64 + 4096) }
    }
}

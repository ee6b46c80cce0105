//! How much device memory a plan takes, known before anything is allocated.

use super::binned::TILE;
use super::buffers::element_sizes;
use super::config::{Config, Objective};
use super::dense::KERNEL_CUTOFF;
use super::links;
use super::shared::{Anchor, Control, Settings};
use super::tally::mailbox;
use super::viewed::draws;
use crate::Result;
use crate::metrics::score_point;
use crate::quality::expected::LOOKS;
use crate::quality::look::{Look, Viewer};
use crate::visibility::probe_depth::Probe;
use crate::vulkan::Context;
use crate::vulkan::footprint::Footprint;
use crate::vulkan::physical::Physical;

/// What the metrics need beside everything else: depth maps of the held-out points, and lists of directions.
const HELD_OUT: &str = "held-out metrics";
/// Entries that cover several buffers, none of which is the whole.
const SEVERAL: [&str; 4] = ["surface and region", "sort", "scan", HELD_OUT];
/// Depth maps of the pool take at most this much, and no more than an eighth of the device.
const POOL_BYTES: u64 = 256 << 20;

/// The buffers of a plan; `scene` is the size of surface and region on the device.
pub(super) fn footprint(
    context: &Context,
    s: &Settings,
    config: &Config,
    resolution: u32,
    scene: u64,
    binned: bool,
) -> Footprint {
    let (splats, probes, texels) = (s.splats as u64, s.probes as u64, (resolution * resolution) as u64);
    let quality = config.objective == Objective::Quality;
    let linked = config.connect.is_some();
    let looks = probes * u64::from(LOOKS);
    let slots = match (quality, binned) {
        // Three partials a look.
        (true, _) => 3 * looks,
        (_, true) => s.capacity as u64,
        _ => probes * s.blocks as u64 * s.capacity as u64,
    };
    let snapshots = (s.iterations.div_ceil(config.checkpoint_every.max(1)) + 1) as u64;
    let [splat, gradient, tally, moments, terms, record] = element_sizes();
    let mut buffers = vec![
        ("surface and region", scene),
        ("probes", size_of::<Probe>() as u64 * s.pool as u64),
        ("depth", 4 * s.pool as u64 * texels),
        ("directions", 16 * texels),
        ("settings", size_of::<Settings>() as u64),
        ("control", size_of::<Control>() as u64),
        ("splats", splat * splats),
        ("visible", if binned || quality { 0 } else { 4 * slots }),
        ("slots", if quality { 4 * slots } else { 4 * probes * splats }),
        ("partials", gradient * slots),
        ("tallies", tally * probes * s.blocks as u64),
        ("deficit", if quality { 4 } else { 4 * probes * texels }),
        ("moments", moments * splats),
        ("terms", terms * splats),
        ("arrivals", 8),
        ("gradients", gradient * splats),
        ("order", 4 * splats),
        ("history", record * s.iterations as u64),
        ("snapshots", splat * splats * snapshots),
        ("mailbox", 4 * mailbox::WORDS as u64),
        ("viewers", if quality { size_of::<Viewer>() as u64 * config.viewers_drawn() as u64 } else { 0 }),
        (
            "looks",
            if quality { size_of::<Look>() as u64 * looks * u64::from(draws(s.probes, block(s, config))) } else { 0 },
        ),
        ("errors", if quality { 4 * looks } else { 0 }),
        ("viewer arrivals", if quality { 4 * probes } else { 0 }),
        ("anchor starts", if linked { 4 * (splats + 1) } else { 4 }),
        ("anchors", size_of::<Anchor>() as u64 * if linked { links::anchors(splats) } else { 1 }),
        (HELD_OUT, score_point::footprint(2 * config.held_out as u64, splats)),
    ];
    if binned {
        buffers.extend(super::binned::footprint(context, s, resolution));
    }
    Footprint { buffers, several: &SEVERAL }
}

/// Checks a plan's footprint against the device.
///
/// # Errors
/// As for [`Footprint::check`].
pub fn check(footprint: &Footprint, context: &Context) -> Result<()> {
    footprint.check(context, "the plan", |name| match name {
        HELD_OUT => "use fewer held-out points (`held_out`)",
        "history" => "run fewer iterations (`iterations`)",
        "snapshots" => "plan fewer views, or take fewer checkpoints (`checkpoint_every`)",
        _ => "plan fewer views, or use fewer probes (`probes`) or texels (`resolution`)",
    })
}

/// Iterations of a block of commands: snapshots, relocations and new links all fall on the start of one.
pub(super) fn block(s: &Settings, config: &Config) -> u32 {
    // Intervals longer than the run never occur, except at the start.
    let within = |every: u32| if every > s.iterations { 0 } else { every };
    let common = |mut a: u32, mut b: u32| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let linked = if config.connect.is_some() { within(links::EVERY) } else { 0 };
    let all = common(common(within(config.checkpoint_every.max(1)), within(s.relocate_every)), linked);
    if all > 0 { all } else { s.iterations }
}

/// Refuses counts that no surface and no resolution could make fit the device, before the host has drawn a single
/// probe or placed a single splat: those would take the host's memory first.
///
/// # Errors
/// As for [`check`].
pub(super) fn check_counts(config: &Config, kept: usize, context: &Context) -> Result<()> {
    let splats = config.views.saturating_add(u32::try_from(kept).unwrap_or(u32::MAX));
    let probes = config.probes.min(config.pool);
    let settings = Settings {
        splats,
        probes,
        pool: probes,
        capacity: 1,
        blocks: 1,
        // The iterative variant rounds them down, by the number of views.
        iterations: if config.iterative { 0 } else { config.iterations },
        relocate_every: config.relocate_every,
        ..Settings::default()
    };
    check(&footprint(context, &settings, config, 16, 0, false), context)
}

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
    let most = ((1 << 28) / probes as u64).min(super::config::MAX_VIEWS as u64);
    most.min(limit / a_view).min(physical.heap * 2 / 3 / (a_view + a_visible_view + 2000))
}

/// The capacities of a run.
pub(super) struct Room {
    /// Visible splats of a probe (dense), or pairs of probe and visible splat in all (binned).
    pub capacity: u32,
    /// Instances of the binned pass.
    pub instances: u32,
}

impl Room {
    /// Capacity for all splats, or as many as one buffer of partials can hold; in the binned pass for twice the pairs that
    /// pass the gate at the start, and the tiles that kernels half again as wide as at the start reach into. A run that needs
    /// more reports it and is restarted with more.
    pub fn new(
        splats: u32,
        probes: u32,
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
            return Self { capacity: most(splats as u64 * rows as u64).div_ceil(rows).min(splats), instances: 0 };
        }
        let pairs = ((2.0 * gated * f64::from(probes)) as u64 + 4096).min(splats as u64 * probes as u64);
        // A cap of the sphere up to the kernel's cut-off, in tiles: its area, its rim and its corners.
        let tiles = f64::from((resolution / TILE).pow(2));
        let area = tiles * 0.5 * KERNEL_CUTOFF * (1.5 * f64::from(scale)).powi(2);
        let reached = (area + 4.0 * area.sqrt() + 4.0).min(tiles);
        Self { capacity: most(pairs), instances: most((reached * pairs as f64) as u64 + 4096) }
    }
}

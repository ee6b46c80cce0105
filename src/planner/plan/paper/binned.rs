//! The splat pass for large view budgets: (probe, tile) instances, sorted by depth and then by tile, composited front to
//! back, gradients gathered in order (`bin_*.comp`). It computes what [`super::dense`] does, with work per texel that
//! stays constant as the views grow; that pass's twin is its twin as well.

use std::sync::Arc;

use super::shared::{InstanceSum, PaperConstants, PaperSettings, Scale, Tally};
use super::state::State;
use crate::Result;
use crate::engine::primitives::{Count, KeyRanges, RadixSort, Scan};
use crate::engine::vulkan::shaders::glsl::planner::plan::paper::bin;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::planner::plan::objective::Run;
use crate::planner::plan::shared::{CameraState, Control, Gradient, Settings};
use crate::scene::octahedral;
use crate::visibility::probe_depth::Probe;

crate::stage!(
    /// Which pairs of probe and splat pass the gate.
    pub(crate) BinCullStage = bin_cull<PaperConstants>(()) { read settings, read control, read splats, read probes, write flags, read paper,
    }
    with [Settings, Control, CameraState, Probe, PaperSettings]
);
crate::stage!(
    /// Slots and depth keys of the pairs that do.
    pub(crate) BinListStage = bin_list<PaperConstants>(()) {
        read settings, read control, read splats, read probes, read flags, read offsets,
        write slots, write pairs, write depth_keys, write depth_slots, read paper,
    } with [Settings, Control, CameraState, Probe, PaperSettings]
);
crate::stage!(
    /// Tiles of each pair.
    pub(crate) BinCountStage = bin_count<PaperConstants>(()) {
        read settings, read control, read splats, read probes, read cones, read pairs, read depth_slots, read counts,
        write tile_counts, read paper, read scale_state,
    } with [Settings, Control, CameraState, Probe, PaperSettings, Scale]
);
crate::stage!(
    /// An instance per tile of each pair.
    pub(crate) BinEmitStage = bin_emit<PaperConstants>(()) {
        read settings, read control, read splats, read probes, read cones, read pairs, read depth_slots, read counts,
        read tile_offsets, write tile_keys, write tile_instances, write instance_slots, write runs, read paper, read scale_state,
    } with [Settings, Control, CameraState, Probe, PaperSettings, Scale]
);
crate::stage!(
    /// Compositing, a workgroup per tile.
    pub(crate) BinForwardStage = bin_forward<PaperConstants>(()) {
        read settings, read control, read splats, read probes, read directions, read depth, read pairs,
        read instance_slots, read tile_instances, read ranges, write left, write tile_sums, write deficit, read paper, read scale_state,
    } with [Settings, Control, CameraState, Probe, PaperSettings, Scale]
);
crate::stage!(
    /// Sums over texels, a workgroup per tile.
    pub(crate) BinBackwardStage = bin_backward<PaperConstants>(()) {
        read settings, read control, read splats, read probes, read directions, read depth, read pairs,
        read instance_slots, read tile_instances, read ranges, read left, write instance_sums, read paper, read scale_state,
    } with [Settings, Control, CameraState, Probe, InstanceSum, PaperSettings, Scale]
);
crate::stage!(
    /// Sums over instances, a thread per pair.
    pub(crate) BinGatherStage = bin_gather<PaperConstants>(()) {
        read settings, read control, read splats, read probes, read pairs, read counts, read runs, read instance_sums,
        write partials, read paper, read scale_state,
    } with [Settings, Control, CameraState, Probe, InstanceSum, Gradient, PaperSettings, Scale]
);
crate::stage!(
    /// Sums over tiles, a workgroup per probe.
    pub(crate) BinTallyStage = bin_tally<PaperConstants>(()) {
        read settings, read control, read tile_sums, read slots, read partials, read counts, write tallies,
        write mailbox, read probes, read paper,
    } with [Settings, Control, Gradient, Tally, Probe, PaperSettings]
);

/// Texels of a tile along a side.
pub(crate) const TILE: u32 = bin::TILE;

/// Pipelines and buffers of the pass.
pub(super) struct Binned {
    cull: Pipeline,
    list: Pipeline,
    count: Pipeline,
    emit: Pipeline,
    ranges: KeyRanges,
    forward: Pipeline,
    backward: Pipeline,
    gather: Pipeline,
    tally: Pipeline,
    scan: Scan,
    sort: RadixSort,
    flags: Buffer,
    offsets: Buffer,
    counts: Buffer,
    cones: Buffer,
    pairs: Buffer,
    depth_keys: Buffer,
    depth_slots: Buffer,
    tile_counts: Buffer,
    tile_offsets: Buffer,
    tile_keys: Buffer,
    tile_instances: Buffer,
    instance_slots: Buffer,
    instance_sums: Buffer,
    runs: Buffer,
    tile_ranges: Buffer,
    tile_sums: Buffer,
    left: Buffer,
}

/// Buffers of the pass by name and bytes.
pub(super) fn footprint(
    context: &Context,
    run: &Settings,
    s: &PaperSettings,
    resolution: u32,
) -> Vec<(&'static str, u64)> {
    let [all, pairs, instances] = [s.probes * run.splats, s.capacity, s.instances].map(u64::from);
    let tiles = (s.probes * (resolution / TILE).pow(2)) as u64;
    let texels = (s.probes * resolution * resolution) as u64;
    vec![
        ("flags", 4 * all),
        ("offsets", 4 * all),
        ("counts", 8),
        ("cones", 16 * (resolution / TILE).pow(2) as u64),
        ("pairs", 4 * pairs),
        ("depth_keys", 4 * pairs),
        ("depth_slots", 4 * pairs),
        ("tile_counts", 4 * pairs),
        ("tile_offsets", 4 * pairs),
        ("tile_keys", 4 * instances),
        ("tile_instances", 4 * instances),
        ("instance_slots", 4 * instances),
        ("instance_sums", size_of::<InstanceSum>() as u64 * instances),
        ("runs", 8 * pairs),
        ("tile_ranges", 8 * tiles),
        ("tile_sums", 16 * tiles),
        ("left", 4 * texels),
        ("sort", RadixSort::footprint(context, s.capacity.max(s.instances))),
        ("scan", Scan::footprint((s.probes * run.splats).max(s.capacity))),
    ]
}

/// Axis and cosine of the half angle of a cone around each tile, row-major.
pub(crate) fn cones(resolution: u32) -> Vec<[f32; 4]> {
    let wide = resolution / TILE;
    let texel = |x: u32, y: u32| octahedral::texel_centre(y * resolution + x, resolution);
    // Texel centres are what is lit, so they are what the cone has to hold.
    let tile = |tile: u32| {
        let (x0, y0) = (tile % wide * TILE, tile / wide * TILE);
        let texels = || (0..TILE * TILE).map(move |k| (x0 + k % TILE, y0 + k / TILE));
        let axis = texels().map(|(x, y)| texel(x, y)).sum::<glam::DVec3>().normalize_or(glam::DVec3::Z);
        let cos = texels().map(|(x, y)| axis.dot(texel(x, y))).fold(1.0, f64::min);
        axis.extend((cos - 1e-6).max(-1.0)).as_vec4().to_array()
    };
    (0..wide * wide).map(tile).collect()
}

impl Binned {
    pub(super) fn new(
        context: &Arc<Context>,
        run: &Settings,
        s: &PaperSettings,
        constants: &PaperConstants,
        buffer: impl Fn(&str) -> Result<Buffer>,
    ) -> Result<Self> {
        Ok(Self {
            cull: Pipeline::new::<BinCullStage>(context, constants)?,
            list: Pipeline::new::<BinListStage>(context, constants)?,
            count: Pipeline::new::<BinCountStage>(context, constants)?,
            emit: Pipeline::new::<BinEmitStage>(context, constants)?,
            ranges: KeyRanges::new(context, s.instances)?,
            forward: Pipeline::new::<BinForwardStage>(context, constants)?,
            backward: Pipeline::new::<BinBackwardStage>(context, constants)?,
            gather: Pipeline::new::<BinGatherStage>(context, constants)?,
            tally: Pipeline::new::<BinTallyStage>(context, constants)?,
            scan: Scan::new(context, (s.probes * run.splats).max(s.capacity))?,
            sort: RadixSort::new(context, s.capacity.max(s.instances))?,
            flags: buffer("flags")?,
            offsets: buffer("offsets")?,
            counts: buffer("counts")?,
            cones: Buffer::from_slice(context, "cones", &cones(constants.resolution))?,
            pairs: buffer("pairs")?,
            depth_keys: buffer("depth_keys")?,
            depth_slots: buffer("depth_slots")?,
            tile_counts: buffer("tile_counts")?,
            tile_offsets: buffer("tile_offsets")?,
            tile_keys: buffer("tile_keys")?,
            tile_instances: buffer("tile_instances")?,
            instance_slots: buffer("instance_slots")?,
            instance_sums: buffer("instance_sums")?,
            runs: buffer("runs")?,
            tile_ranges: buffer("tile_ranges")?,
            tile_sums: buffer("tile_sums")?,
            left: buffer("left")?,
        })
    }

    /// Records the pass: partials, slots and tallies come out as those of the dense pass do.
    ///
    /// # Errors
    /// Where a sort or scan exceeds its capacity, which the settings rule out.
    pub(super) fn record(&self, commands: &mut Recorder, run: &Run, own: &State) -> Result<()> {
        let (b, s, maps) = (&run.buffers, &own.settings, &own.maps);
        let all = (s.probes * run.settings.splats).div_ceil(256);
        let tiles = (maps.resolution / TILE).pow(2);
        let probes = &maps.probe_buffer;
        commands
            .stage(
                &self.cull,
                BinCullStage {
                    settings: &b.settings,
                    control: &b.control,
                    splats: &b.splats,
                    probes,
                    flags: &self.flags,
                    paper: &own.paper,
                },
            )
            .linear(all);
        let pairs = Count::Host(s.probes * run.settings.splats);
        self.scan.record(commands, &self.flags, &self.offsets, pairs, (&self.counts, 0))?;
        commands
            .stage(
                &self.list,
                BinListStage {
                    settings: &b.settings,
                    control: &b.control,
                    splats: &b.splats,
                    probes,
                    flags: &self.flags,
                    offsets: &self.offsets,
                    slots: &b.slots,
                    pairs: &self.pairs,
                    depth_keys: &self.depth_keys,
                    depth_slots: &self.depth_slots,
                    paper: &own.paper,
                },
            )
            .linear(all);
        let pairs = || Count::Device(&self.counts, 0);
        let by_depth = self.sort.pairs(commands, &self.depth_keys, &self.depth_slots, pairs(), 32)?;
        let ranks = s.capacity.div_ceil(64);
        commands
            .stage(
                &self.count,
                BinCountStage {
                    settings: &b.settings,
                    control: &b.control,
                    splats: &b.splats,
                    probes,
                    cones: &self.cones,
                    pairs: &self.pairs,
                    depth_slots: by_depth.values,
                    counts: &self.counts,
                    tile_counts: &self.tile_counts,
                    paper: &own.paper,
                    scale_state: &own.scale,
                },
            )
            .linear(ranks);
        self.scan.record(commands, &self.tile_counts, &self.tile_offsets, pairs(), (&self.counts, 1))?;
        commands
            .stage(
                &self.emit,
                BinEmitStage {
                    settings: &b.settings,
                    control: &b.control,
                    splats: &b.splats,
                    probes,
                    cones: &self.cones,
                    pairs: &self.pairs,
                    depth_slots: by_depth.values,
                    counts: &self.counts,
                    tile_offsets: &self.tile_offsets,
                    tile_keys: &self.tile_keys,
                    tile_instances: &self.tile_instances,
                    instance_slots: &self.instance_slots,
                    runs: &self.runs,
                    paper: &own.paper,
                    scale_state: &own.scale,
                },
            )
            .linear(ranks);
        let bits = 32 - (s.probes * tiles - 1).leading_zeros().min(31);
        let instances = Count::Device(&self.counts, 1);
        let by_tile = self.sort.pairs(commands, &self.tile_keys, &self.tile_instances, instances, bits)?;
        self.ranges.record(commands, by_tile.keys, instances, &self.tile_ranges)?;
        commands
            .stage(
                &self.forward,
                BinForwardStage {
                    settings: &b.settings,
                    control: &b.control,
                    splats: &b.splats,
                    probes,
                    directions: &own.directions,
                    depth: &maps.depth,
                    pairs: &self.pairs,
                    instance_slots: &self.instance_slots,
                    tile_instances: by_tile.values,
                    ranges: &self.tile_ranges,
                    left: &self.left,
                    tile_sums: &self.tile_sums,
                    deficit: &own.deficit,
                    paper: &own.paper,
                    scale_state: &own.scale,
                },
            )
            .groups([tiles, s.probes, 1]);
        commands
            .stage(
                &self.backward,
                BinBackwardStage {
                    settings: &b.settings,
                    control: &b.control,
                    splats: &b.splats,
                    probes,
                    directions: &own.directions,
                    depth: &maps.depth,
                    pairs: &self.pairs,
                    instance_slots: &self.instance_slots,
                    tile_instances: by_tile.values,
                    ranges: &self.tile_ranges,
                    left: &self.left,
                    instance_sums: &self.instance_sums,
                    paper: &own.paper,
                    scale_state: &own.scale,
                },
            )
            .groups([tiles, s.probes, 1]);
        commands
            .stage(
                &self.gather,
                BinGatherStage {
                    settings: &b.settings,
                    control: &b.control,
                    splats: &b.splats,
                    probes,
                    pairs: &self.pairs,
                    counts: &self.counts,
                    runs: &self.runs,
                    instance_sums: &self.instance_sums,
                    partials: &b.partials,
                    paper: &own.paper,
                    scale_state: &own.scale,
                },
            )
            .linear(ranks);
        commands
            .stage(
                &self.tally,
                BinTallyStage {
                    settings: &b.settings,
                    control: &b.control,
                    tile_sums: &self.tile_sums,
                    slots: &b.slots,
                    partials: &b.partials,
                    counts: &self.counts,
                    tallies: &own.tallies,
                    mailbox: &b.mailbox,
                    probes,
                    paper: &own.paper,
                },
            )
            .groups([s.probes, 1, 1]);
        Ok(())
    }
}

#[cfg(test)]
#[path = "binned_tests.rs"]
mod tests;

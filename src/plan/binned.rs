//! The splat pass for large view budgets: (probe, tile) instances, sorted by depth and then by tile, composited front to
//! back, gradients gathered in order (`bin_*.comp`). It computes what [`super::dense`] does, with work per texel that
//! stays constant as the views grow; that pass's twin is its twin as well.

use std::sync::Arc;

use super::buffers::Buffers;
use super::shared::{Control, Gradient, InstanceSum, PlanConstants, Settings, Splat, Tally};
use crate::Result;
use crate::primitives::{Count, RadixSort, Scan};
use crate::scene::octahedral;
use crate::visibility::probe_depth::{Probe, ProbeMaps};
use crate::vulkan::shaders::glsl::plan::bin;
use crate::vulkan::{Buffer, Context, Pipeline, Recorder};

crate::stage!(
    /// Which pairs of probe and splat pass the gate.
    pub(crate) BinCullStage = bin_cull<PlanConstants>(()) { read settings, read control, read splats, read probes, write flags }
    with [Settings, Control, Splat, Probe]
);
crate::stage!(
    /// Slots and depth keys of the pairs that do.
    pub(crate) BinListStage = bin_list<PlanConstants>(()) {
        read settings, read control, read splats, read probes, read flags, read offsets,
        write slots, write pairs, write depth_keys, write depth_slots,
    } with [Settings, Control, Splat, Probe]
);
crate::stage!(
    /// Tiles of each pair.
    pub(crate) BinCountStage = bin_count<PlanConstants>(()) {
        read settings, read control, read splats, read probes, read cones, read pairs, read depth_slots, read counts,
        write tile_counts,
    } with [Settings, Control, Splat, Probe]
);
crate::stage!(
    /// An instance per tile of each pair.
    pub(crate) BinEmitStage = bin_emit<PlanConstants>(()) {
        read settings, read control, read splats, read probes, read cones, read pairs, read depth_slots, read counts,
        read tile_offsets, write tile_keys, write tile_instances, write instance_slots, write runs,
    } with [Settings, Control, Splat, Probe]
);
crate::stage!(
    /// Instances of each tile.
    pub(crate) BinRangesStage = bin_ranges<PlanConstants>(()) { read settings, read control, read counts, read tile_keys, write ranges }
    with [Settings, Control]
);
crate::stage!(
    /// Compositing, a workgroup per tile.
    pub(crate) BinForwardStage = bin_forward<PlanConstants>(()) {
        read settings, read control, read splats, read probes, read directions, read depth, read pairs,
        read instance_slots, read tile_instances, read ranges, write left, write tile_sums, write deficit,
    } with [Settings, Control, Splat, Probe]
);
crate::stage!(
    /// Sums over texels, a workgroup per tile.
    pub(crate) BinBackwardStage = bin_backward<PlanConstants>(()) {
        read settings, read control, read splats, read probes, read directions, read depth, read pairs,
        read instance_slots, read tile_instances, read ranges, read left, write instance_sums,
    } with [Settings, Control, Splat, Probe, InstanceSum]
);
crate::stage!(
    /// Sums over instances, a thread per pair.
    pub(crate) BinGatherStage = bin_gather<PlanConstants>(()) {
        read settings, read control, read splats, read probes, read pairs, read counts, read runs, read instance_sums,
        write partials,
    } with [Settings, Control, Splat, Probe, InstanceSum, Gradient]
);
crate::stage!(
    /// Sums over tiles, a workgroup per probe.
    pub(crate) BinTallyStage = bin_tally<PlanConstants>(()) {
        read settings, read control, read tile_sums, read slots, read partials, read counts, write tallies,
        write mailbox, read probes,
    } with [Settings, Control, Gradient, Tally, Probe]
);

/// Texels of a tile along a side.
pub(crate) const TILE: u32 = bin::TILE;

/// Pipelines and buffers of the pass.
pub(super) struct Binned {
    cull: Pipeline,
    list: Pipeline,
    count: Pipeline,
    emit: Pipeline,
    ranges: Pipeline,
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
pub(super) fn footprint(context: &Context, s: &Settings, resolution: u32) -> Vec<(&'static str, u64)> {
    let [all, pairs, instances] = [s.probes * s.splats, s.capacity, s.instances].map(u64::from);
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
        ("scan", Scan::footprint((s.probes * s.splats).max(s.capacity))),
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
        s: &Settings,
        constants: &PlanConstants,
        buffer: impl Fn(&str) -> Result<Buffer>,
    ) -> Result<Self> {
        Ok(Self {
            cull: Pipeline::new::<BinCullStage>(context, constants)?,
            list: Pipeline::new::<BinListStage>(context, constants)?,
            count: Pipeline::new::<BinCountStage>(context, constants)?,
            emit: Pipeline::new::<BinEmitStage>(context, constants)?,
            ranges: Pipeline::new::<BinRangesStage>(context, constants)?,
            forward: Pipeline::new::<BinForwardStage>(context, constants)?,
            backward: Pipeline::new::<BinBackwardStage>(context, constants)?,
            gather: Pipeline::new::<BinGatherStage>(context, constants)?,
            tally: Pipeline::new::<BinTallyStage>(context, constants)?,
            scan: Scan::new(context, (s.probes * s.splats).max(s.capacity))?,
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
    pub(super) fn record(&self, commands: &mut Recorder, s: &Settings, maps: &ProbeMaps, b: &Buffers) -> Result<()> {
        let all = (s.probes * s.splats).div_ceil(256);
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
                },
            )
            .linear(all);
        let pairs = Count::Host(s.probes * s.splats);
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
                },
            )
            .linear(ranks);
        let bits = 32 - (s.probes * tiles - 1).leading_zeros().min(31);
        let instances = Count::Device(&self.counts, 1);
        let by_tile = self.sort.pairs(commands, &self.tile_keys, &self.tile_instances, instances, bits)?;
        commands.fill(&self.tile_ranges, 0);
        commands
            .stage(
                &self.ranges,
                BinRangesStage {
                    settings: &b.settings,
                    control: &b.control,
                    counts: &self.counts,
                    tile_keys: by_tile.keys,
                    ranges: &self.tile_ranges,
                },
            )
            .linear(s.instances.div_ceil(256));
        commands
            .stage(
                &self.forward,
                BinForwardStage {
                    settings: &b.settings,
                    control: &b.control,
                    splats: &b.splats,
                    probes,
                    directions: &b.directions,
                    depth: &maps.depth,
                    pairs: &self.pairs,
                    instance_slots: &self.instance_slots,
                    tile_instances: by_tile.values,
                    ranges: &self.tile_ranges,
                    left: &self.left,
                    tile_sums: &self.tile_sums,
                    deficit: &b.deficit,
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
                    directions: &b.directions,
                    depth: &maps.depth,
                    pairs: &self.pairs,
                    instance_slots: &self.instance_slots,
                    tile_instances: by_tile.values,
                    ranges: &self.tile_ranges,
                    left: &self.left,
                    instance_sums: &self.instance_sums,
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
                    tallies: &b.tallies,
                    mailbox: &b.mailbox,
                    probes,
                },
            )
            .groups([s.probes, 1, 1]);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::config::{Gate, Kernel};
    use crate::scene::random;

    /// Instances of random pairs, some of them infinite or no numbers, from what `bin_count` counted plus `extra(rank)`.
    struct Emitted {
        counts: Vec<u32>,
        given: Vec<u32>,
        keys: Vec<u32>,
        slots: Vec<u32>,
        runs: Vec<[u32; 2]>,
    }

    /// What no pair has been given.
    const UNTOUCHED: u32 = 0xabcd_1234;

    fn emitted(context: &Arc<Context>, kernel: Kernel, round: u32, extra: impl Fn(u32) -> i64) -> Result<Emitted> {
        let (probes, splats) = (16, 64);
        let pairs = probes * splats;
        let uniform = |i: u32| random::bits(7, round, i).map(random::uniform);
        let log_scale = uniform(u32::MAX)[0] * 5.0 - 4.0;
        let centre = |i: u32| {
            let [x, y, z, odd] = uniform(i).map(|v| 4.0 * v - 2.0);
            [
                if odd > 1.9 {
                    f32::NAN
                } else if odd < -1.9 {
                    f32::INFINITY
                } else {
                    x
                },
                y,
                z,
            ]
        };
        let all: Vec<Splat> = (0..splats).map(|i| Splat { centre: centre(i), ..Splat::default() }).collect();
        let at = |i: u32| Probe { position: uniform(1000 + i)[..3].try_into().unwrap_or_default(), ..Probe::default() };
        let pool: Vec<Probe> = (0..probes).map(at).collect();
        let resolution = 16;
        let constants = PlanConstants { resolution, gate: Gate::Hard, kernel, occlusion: true, threads: 256, each: 1 };
        let tiles = (resolution / TILE).pow(2);
        let instances = pairs * tiles + 64;
        let settings = Settings { splats, probes, pool: probes, capacity: pairs, instances, ..Settings::default() };
        let upload = |name: &str, words: &[u32]| Buffer::from_slice(context, name, words);
        let settings_buffer = Buffer::from_slice(context, "settings", &[settings])?;
        let control = Buffer::from_slice(context, "control", &[Control { log_scale, ..Control::default() }])?;
        let splat_buffer = Buffer::from_slice(context, "splats", &all)?;
        let probe_buffer = Buffer::from_slice(context, "probes", &pool)?;
        let cone_buffer = Buffer::from_slice(context, "cones", &cones(resolution))?;
        let order: Vec<u32> = (0..pairs).collect();
        let (pair_buffer, slots) = (upload("pairs", &order)?, upload("slots", &order)?);
        let tile_counts = upload("tile counts", &order)?;
        let counts = upload("counts", &[pairs, 0])?;
        let (count, emit) =
            (Pipeline::new::<BinCountStage>(context, &constants)?, Pipeline::new::<BinEmitStage>(context, &constants)?);
        let mut commands = Recorder::new(context)?;
        let bound = BinCountStage {
            settings: &settings_buffer,
            control: &control,
            splats: &splat_buffer,
            probes: &probe_buffer,
            cones: &cone_buffer,
            pairs: &pair_buffer,
            depth_slots: &slots,
            counts: &counts,
            tile_counts: &tile_counts,
        };
        commands.stage(&count, bound).linear(pairs.div_ceil(64));
        commands.submit_and_wait()?;
        let counted: Vec<u32> = tile_counts.download(pairs as usize)?;
        let given: Vec<u32> = (0..).zip(&counted).map(|(i, n)| (i64::from(*n) + extra(i)).max(0) as u32).collect();
        let offsets = given.iter().scan(0, |sum, n| {
            *sum += n;
            Some(*sum - n)
        });
        let (offsets, total): (Vec<u32>, u32) = (offsets.collect(), given.iter().sum());
        counts.upload(&[pairs, total])?;
        let offset_buffer = upload("offsets", &offsets)?;
        let fresh = |name| upload(name, &vec![UNTOUCHED; instances as usize]);
        let (keys, places, instance_slots) = (fresh("keys")?, fresh("places")?, fresh("instance slots")?);
        let runs = upload("runs", &vec![0; 2 * pairs as usize])?;
        let bound = BinEmitStage {
            settings: &settings_buffer,
            control: &control,
            splats: &splat_buffer,
            probes: &probe_buffer,
            cones: &cone_buffer,
            pairs: &pair_buffer,
            depth_slots: &slots,
            counts: &counts,
            tile_offsets: &offset_buffer,
            tile_keys: &keys,
            tile_instances: &places,
            instance_slots: &instance_slots,
            runs: &runs,
        };
        let mut commands = Recorder::new(context)?;
        commands.stage(&emit, bound).linear(pairs.div_ceil(64));
        commands.submit_and_wait()?;
        let (keys, slots) = (keys.download(instances as usize)?, instance_slots.download(instances as usize)?);
        Ok(Emitted { counts: counted, given, keys, slots, runs: runs.download(pairs as usize)? })
    }

    /// A fuzz of the two stages that must count alike, on whatever device there is. If this failed, instances of one pair would overwrite
    /// those of the next, or words of memory that nobody wrote would be taken for the numbers of tiles.
    #[test]
    fn pairs_have_the_instances_that_were_counted_and_no_others_are_written() -> Result<()> {
        let context = Context::new(&crate::vulkan::Options::default())?;
        // As counted; then as if a driver had counted otherwise, by up to two tiles of four.
        let off = |i: u32| i64::from(random::bits(9, 9, i)[0] % 5) - 2;
        for (round, kernel) in (0..24).zip([Kernel::Angular, Kernel::Metric].into_iter().cycle()) {
            let exact = emitted(&context, kernel, round, |_| 0)?;
            assert!(
                exact.counts.iter().any(|n| *n > 0) && exact.runs.iter().map(|run| run[1]).eq(exact.counts.clone())
            );
            let wrong = emitted(&context, kernel, round, off)?;
            for Emitted { given, keys, slots, runs, .. } in [&exact, &wrong] {
                let mut at = 0;
                for (slot, (n, run)) in given.iter().zip(runs).enumerate() {
                    // A pair has four tiles: more than that nobody fills.
                    let (n, filled) = (*n as usize, (*n).min(4) as usize);
                    assert_eq!(*run, [at as u32, filled as u32], "slot {slot} of {n}");
                    let (mine, probe) = (&keys[at..at + filled], slot as u32 / 64);
                    assert!(mine.is_sorted_by(|a, b| a < b) && mine.iter().all(|key| key / 4 == probe), "{mine:?}");
                    assert!(slots[at..at + filled].iter().all(|found| *found == slot as u32));
                    at += n;
                }
                assert!(keys[at..].iter().chain(&slots[at..]).all(|word| *word == UNTOUCHED));
            }
        }
        Ok(())
    }

    /// A texel outside its tile's cone would lose splats that light it.
    #[test]
    fn cones_hold_their_texels() {
        for resolution in [16, 24, 64] {
            let wide = resolution / TILE;
            for (texel, direction) in octahedral::directions(resolution).iter().enumerate() {
                let (x, y) = (texel as u32 % resolution, texel as u32 / resolution);
                let cone = cones(resolution)[(y / TILE * wide + x / TILE) as usize];
                let axis = glam::Vec3::from_slice(&cone).as_dvec3();
                assert!(axis.dot(*direction) >= cone[3] as f64, "texel {texel} of {resolution}");
            }
        }
    }
}

//! Tests of the binned pass alone; `tests/library/planner/plans.rs` holds it against its twin.

use super::*;
use crate::planner::plan::gate::Gate;
use crate::planner::plan::paper::Kernel;
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
    let all: Vec<CameraState> =
        (0..splats).map(|i| CameraState { centre: centre(i), ..CameraState::default() }).collect();
    let at = |i: u32| Probe { position: uniform(1000 + i)[..3].try_into().unwrap_or_default(), ..Probe::default() };
    let pool: Vec<Probe> = (0..probes).map(at).collect();
    let resolution = 16;
    let constants = PaperConstants { resolution, gate: Gate::Hard, kernel, occlusion: true, threads: 256, each: 1 };
    let tiles = (resolution / TILE).pow(2);
    let instances = pairs * tiles + 64;
    let settings = Settings { splats, ..Settings::default() };
    let paper = PaperSettings { probes, pool: probes, capacity: pairs, instances, ..PaperSettings::default() };
    let upload = |name: &str, words: &[u32]| Buffer::from_slice(context, name, words);
    let settings_buffer = Buffer::from_slice(context, "settings", &[settings])?;
    let control = Buffer::from_slice(context, "control", &[Control::default()])?;
    let paper = Buffer::from_slice(context, "paper", &[paper])?;
    let scale_state = Buffer::from_slice(context, "scale", &[Scale { log_scale, ..Scale::default() }])?;
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
        paper: &paper,
        scale_state: &scale_state,
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
        paper: &paper,
        scale_state: &scale_state,
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
    let context = Context::new(&crate::engine::vulkan::ContextOptions::default())?;
    // As counted; then as if a driver had counted otherwise, by up to two tiles of four.
    let off = |i: u32| i64::from(random::bits(9, 9, i)[0] % 5) - 2;
    for (round, kernel) in (0..24).zip([Kernel::Angular, Kernel::Metric].into_iter().cycle()) {
        let exact = emitted(&context, kernel, round, |_| 0)?;
        assert!(exact.counts.iter().any(|n| *n > 0) && exact.runs.iter().map(|run| run[1]).eq(exact.counts.clone()));
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

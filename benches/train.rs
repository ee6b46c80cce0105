//! GPU time of a training iteration, per stage and as a whole, over growing numbers of splats.
//!
//! The scene is made here: splats on and near a sphere, a ring and a floor, as large as their neighbours are far away,
//! and photos of smooth noise. A sample begins with the same splats in the middle of a run: all harmonics take part,
//! the budget is spent, and a refinement comes every 100 iterations.

mod report;

use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

use camsplat::Result;
use camsplat::engine::primitives::RadixSort;
use camsplat::engine::vulkan::Context;
use camsplat::engine::vulkan::footprint::Footprint;
use camsplat::engine::vulkan::profile::Profile;
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::gaussians::{Gaussians, MAX_DEGREE, coefficients};
use camsplat::scene::random;
use camsplat::splats::config::TrainConfig;
use camsplat::splats::data::store::PhotoStore;
use camsplat::splats::render::frame::{Frame, View};
use camsplat::splats::render::layout;
use camsplat::splats::train::loss::Record;
use camsplat::splats::train::memory;
use camsplat::splats::train::read_back::State;
use camsplat::splats::train::trainer::Trainer;
use glam::{DQuat, DVec3};
use report::{Amount, Report, Sample};

const SIZES: [u32; 4] = [10_000, 100_000, 1_000_000, 5_000_000];
const SEED: u64 = 20;
const SCENE_STREAM: u32 = 0;
const PHOTO_STREAM: u32 = 100;
/// Iterations done when a sample begins.
const DONE: u32 = 10_000;
const CAMERAS: u32 = 4;
/// Samples of a row, each the mean of many iterations.
const SAMPLES: usize = 21;
/// Distance of the cameras from the middle, in radii of the scene.
const AWAY: f64 = 2.8;

/// How much is measured.
struct Extent {
    /// Pixels of a picture along a side.
    side: u32,
    /// Iterations before each sample, in which Adam's moments grow and the device wakes.
    warm: u32,
    /// Iterations of a sample.
    sample: u32,
    /// Iterations of the run whose wall-clock time is measured.
    whole: u32,
}

fn main() -> ExitCode {
    report::run("train", rows)
}

fn rows(context: Arc<Context>, report: &mut Report) -> Result<()> {
    let extent = match context.physical().is_cpu() {
        // A sixteenth of the pixels: 100,000 splats lie as densely as 1.6 million on a GPU.
        true => Extent { side: 200, warm: 1, sample: 1, whole: 3 },
        false => Extent { side: 800, warm: 20, sample: 100, whole: 200 },
    };
    drop(context);
    for splats in SIZES {
        // A context each, so that its peak of memory is that of this size.
        training(&report::context()?, report, &extent, splats)?;
    }
    Ok(())
}

/// A run that can be repeatedly resumed from the same state.
struct Timed {
    trainer: Trainer,
    state: State,
    history: Vec<Record>,
    warm: u32,
}

impl Timed {
    /// With `start` in the training frame.
    fn new(trainer: Trainer, start: &Gaussians, warm: u32) -> Self {
        let parameters = layout::to_planes(start, MAX_DEGREE, start.len());
        let zeros = vec![0.0; parameters.len()];
        let planes = [parameters, zeros.clone(), zeros];
        let state = State {
            done: DONE,
            population: start.len() as u32,
            planes,
            statistics: Vec::new(),
            exposures: Vec::new(),
            poses: Vec::new(),
        };
        Self { trainer, state, history: vec![Record::default(); DONE as usize], warm }
    }

    /// Trains so many iterations from the same state, with the profile or without it; milliseconds of the GPU and on the wall.
    fn run(&mut self, iterations: u32, profile: Option<&mut Profile>) -> Result<[f64; 2]> {
        let go_on = |_| ControlFlow::Continue(());
        self.trainer.restore(&self.state, &self.history)?;
        self.trainer.run(DONE + self.warm, None, go_on)?;
        let (begun, before) = (Instant::now(), self.trainer.gpu_ms());
        self.trainer.run(DONE + self.warm + iterations, profile, go_on)?;
        Ok([self.trainer.gpu_ms() - before, 1e3 * begun.elapsed().as_secs_f64()])
    }

    /// Mean GPU time of an iteration among so many.
    fn sample(&mut self, iterations: u32) -> Result<Sample> {
        let mut profile = Profile::default();
        self.run(iterations, Some(&mut profile))?;
        let each = |ms: f64| ms * 1e6 / f64::from(iterations);
        let stages = profile.rows().iter().map(|row| (row.name, each(row.total_ms))).collect();
        Ok(Sample { ns: each(profile.gpu_ms()), stages })
    }

    /// Mean number of instances of the iterations that [`Timed::run`] timed last.
    fn instances(&self) -> Result<u64> {
        let history = self.trainer.history()?;
        let timed = &history[(DONE + self.warm) as usize..];
        Ok(timed.iter().map(|record| u64::from(record.instances)).sum::<u64>() / timed.len() as u64)
    }
}

fn training(context: &Arc<Context>, report: &mut Report, extent: &Extent, splats: u32) -> Result<()> {
    if !["train", "train_run"].iter().any(|name| report.wants(name, u64::from(splats))) {
        return Ok(());
    }
    let cameras = cameras(extent.side);
    let frame = Frame::new(&cameras, &[]);
    let views: Vec<View> = cameras.iter().map(|camera| frame.view(camera)).collect();
    let config = TrainConfig::new(30_000, splats);
    let sizes = memory::sizes(&config, &views, memory::first_capacity(splats));
    let buffers = memory::footprint(context, &config, &sizes, views.len());
    let footprint = Footprint { buffers, several: vec!["sort", "scan", "draws scan"] };
    if let Err(error) = footprint.check(context, "the training", |_| "take a larger device") {
        println!("train {splats}: skipped, {error}");
        return Ok(());
    }
    let mut photos = PhotoStore::new(context, u64::MAX);
    for number in 0..CAMERAS {
        photos.add(&photo(extent.side, number))?;
    }
    photos.flush()?;
    let start = frame.gaussians_to_training(scene(splats));
    let trainer = Trainer::new(context, config, &start, views, photos)?;
    let mut timed = Timed::new(trainer, &start, extent.warm);

    // The first run finds how much capacity the instances of all others need.
    timed.run(extent.whole.max(extent.sample), None)?;
    let pixels = u64::from(sizes.pixels);
    let traffic = Traffic { splats: u64::from(splats), instances: timed.instances()?, pixels, tiles: sizes.tiles };
    let amount = |bytes| Amount { count: u64::from(splats), bytes, operations: 0 };
    let whole = amount(STAGES.iter().map(|stage| traffic.bytes(stage)).sum());
    let measured = report.sampled("train", whole, SAMPLES, || timed.sample(extent.sample))?;
    let mut stages: Vec<_> = measured.stages.into_iter().collect();
    stages.sort_by(|a, b| b.1.median().total_cmp(&a.1.median()));
    for (stage, times) in stages {
        report.stage("train", stage, amount(traffic.bytes(stage)), &times);
    }

    let [gpu, wall] = timed.run(extent.whole, None)?;
    report.total("train_run", u64::from(splats), vec![gpu * 1e6], wall * 1e-3);
    let each = timed.instances()? as f64 / f64::from(splats);
    let gap = wall / gpu - 1.0;
    let [announced, peak] = [footprint.total(), context.peak_allocated()];
    let mebi = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    let Extent { side, whole, .. } = extent;
    println!(
        "train {splats}: {whole} iterations at {side} x {side} pixels, {each:.2} instances a splat, host gap {:.1}%, \
         {:.0} MiB announced, {:.0} MiB at the peak",
        100.0 * gap,
        mebi(announced),
        mebi(peak),
    );
    report.facts(serde_json::json!({
        "name": "train_facts", "count": splats, "iterations": whole, "side": side, "instances_per_splat": each,
        "host_gap": gap, "announced_bytes": announced, "peak_bytes": peak,
    }));
    Ok(())
}

/// Stages of which [`Traffic::bytes`] knows what they move. The others are scans and a refinement now and then.
const STAGES: [&str; 12] = [
    "copy",
    "splat_project",
    "radix_histogram",
    "radix_scatter",
    "splat_count",
    "splat_emit",
    "key_ranges",
    "splat_forward",
    "photo_ssim",
    "photo_gradient",
    "splat_backward",
    "splat_update",
];

/// What an iteration works on.
struct Traffic {
    splats: u64,
    instances: u64,
    pixels: u64,
    tiles: u32,
}

impl Traffic {
    /// Bytes that a stage reads and writes in an iteration if every buffer's values move once; of records, 48 a projected
    /// splat, 236 its parameters. Caches may keep some of it, and atomics and halos are left out.
    fn bytes(&self, stage: &str) -> u64 {
        let Self { splats, instances, pixels, tiles } = *self;
        let tile_passes = u64::from(RadixSort::passes(32 - (tiles - 1).leading_zeros()));
        let sorted = 4 * splats + tile_passes * instances;
        match stage {
            "copy" => 8 * pixels,
            "splat_project" => (236 + 48 + 8) * splats,
            "radix_histogram" => 4 * sorted,
            "radix_scatter" => 16 * sorted,
            "splat_count" => (4 + 48 + 4) * splats,
            "splat_emit" => (12 + 48 + 8) * splats + 12 * instances,
            "key_ranges" => 4 * instances,
            // A checkpoint of 256 pixels every 128 instances.
            "splat_forward" => (8 + 48 + 32) * instances + 20 * pixels,
            "photo_ssim" => (20 + 36) * pixels,
            "photo_gradient" => (20 + 36 + 16) * pixels,
            "splat_backward" => (12 + 48 + 32 + 36) * instances + 36 * pixels,
            // Parameters and both moments, there and back; 180 bytes of harmonics every other time.
            "splat_update" => (48 + 8 + 6 * (236 - 90)) * splats + 36 * instances,
            _ => 0,
        }
    }
}

/// Cameras on a ring that see the whole unit ball.
fn cameras(side: u32) -> Vec<Camera> {
    let intrinsics = Intrinsics::from_fov(side, side, 2.0 * (1.05 / AWAY).asin());
    let camera = |number: u32| {
        let turn = TAU * f64::from(number) / f64::from(CAMERAS);
        let position = AWAY * DVec3::new(turn.cos(), turn.sin(), 0.6).normalize();
        Camera { name: number.to_string(), pose: Pose::looking(position, -position, DVec3::Z), intrinsics }
    };
    (0..CAMERAS).map(camera).collect()
}

/// Smooth noise.
fn photo(side: u32, number: u32) -> Vec<u32> {
    let wave = |k: u32| random::uniforms(SEED, PHOTO_STREAM + number, k).map(|u| 2.0 * u - 1.0);
    let waves: [[[f64; 4]; 3]; 4] = [0, 3, 6, 9].map(|k| [k, k + 1, k + 2].map(wave));
    let pixel = |at: u32| {
        let [x, y] = [at % side, at / side].map(|at| 40.0 * f64::from(at) / f64::from(side));
        let channel = |c: usize| {
            let sum: f64 = waves.iter().map(|wave| (wave[c][0] * x + wave[c][1] * y + 9.0 * wave[c][2]).cos()).sum();
            (127.5 + 31.0 * sum) as u8
        };
        u32::from_le_bytes([channel(0), channel(1), channel(2), 255])
    };
    (0..side * side).map(pixel).collect()
}

/// Splats on a sphere, a ring around it and a floor, inside the unit ball: flat, of all opacities, and so large that each
/// overlaps its neighbours.
fn scene(count: u32) -> Gaussians {
    const SPHERE: f64 = 0.4;
    const RING: [f64; 2] = [0.6, 0.12];
    const FLOOR: f64 = 0.85;
    let areas = [2.0 * TAU * SPHERE * SPHERE, TAU * TAU * RING[0] * RING[1], 0.5 * TAU * FLOOR * FLOOR];
    let area: f64 = areas.iter().sum();
    let spacing = (area / f64::from(count)).sqrt();
    let mut scene = Gaussians { degree: MAX_DEGREE, ..Gaussians::default() };
    for i in 0..count {
        let draw = |stream: u32| random::uniforms(SEED, SCENE_STREAM + stream, i);
        let [which, u, v, _] = draw(0);
        let (sin, cos) = (TAU * u).sin_cos();
        let (point, normal) = if area * which < areas[0] {
            let normal = random::direction(u, v);
            (SPHERE * normal + 0.1 * DVec3::Z, normal)
        } else if area * which < areas[0] + areas[1] {
            let (up, out) = (TAU * v).sin_cos();
            let normal = DVec3::new(cos * out, sin * out, up);
            (RING[0] * DVec3::new(cos, sin, 0.0) + RING[1] * normal - 0.2 * DVec3::Z, normal)
        } else {
            let away = FLOOR * v.sqrt();
            (DVec3::new(away * cos, away * sin, -0.45), DVec3::Z)
        };
        let [near, opacity] = normals(draw(1));
        let [long, wide] = normals(draw(2)).map(|normal| (spacing.ln() + 0.8 * normal + 0.2) as f32);
        let turned = DQuat::from_rotation_arc(DVec3::Z, normal);
        scene.centres.push(point + 0.3 * near * spacing * normal);
        scene.log_scales.push([long, wide, long.min(wide) - 1.5]);
        scene.rotations.push([turned.w, turned.x, turned.y, turned.z].map(|value| value as f32));
        scene.opacities.push((2.0 * opacity) as f32);
        let harmonic = |k: u32| {
            let size = if k < 3 { 1.5 } else { 0.1 };
            (size * (2.0 * draw(3 + k / 4)[(k % 4) as usize] - 1.0)) as f32
        };
        scene.harmonics.extend((0..3 * coefficients(MAX_DEGREE) as u32).map(harmonic));
    }
    scene
}

/// Two draws of the normal distribution from four uniform ones.
fn normals([a, b, c, d]: [f64; 4]) -> [f64; 2] {
    [(a, b), (c, d)].map(|(size, turn)| (-2.0 * (1.0 - size).ln()).sqrt() * (TAU * turn).cos())
}

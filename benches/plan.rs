//! GPU time of the planner: whole runs by both objectives, and an iteration per stage over growing view budgets, through both
//! passes of the paper's objective.
//!
//! The scene is the sample room (the sample object for 50 views); the cameras have been optimised for a few
//! iterations, so that as many are visible as in a real run.

mod report;

use std::ops::ControlFlow;
use std::process::ExitCode;
use std::sync::Arc;

use camsplat::Result;
use camsplat::engine::vulkan::{Context, Recorder};
use camsplat::planner::plan::config::{Config, Preset};
use camsplat::planner::plan::paper::{PaperPass, Pass};
use camsplat::planner::plan::planner::Planner;
use camsplat::planner::plan::preparation::Preparation;
use camsplat::planner::plan::problem::Problem;
use camsplat::planner::plan::record::SurfaceRecord;
use camsplat::planner::plan::target::Target;
use camsplat::scene::camera::Intrinsics;
use camsplat::scene::limits::Limits;
use camsplat::scene::proxy::{Orientation, Proxy};
use camsplat::scene::region::Region;
use camsplat::scene::samples;
use camsplat::visibility::device_scene::{DeviceScene, SceneGeometry};
use glam::DVec3;
use report::{Amount, Job, Report};

/// Iterations of a row.
const ITERATIONS: u32 = 10;
/// Operations of a kernel's exponent, see `kernel_exponent` in `shaders/glsl/planner/plan/paper/paper.glsl`.
const EXPONENT: u64 = 10;

fn main() -> ExitCode {
    report::run("plan", rows)
}

fn rows(context: Arc<Context>, report: &mut Report) -> Result<()> {
    let on_cpu = context.physical().is_cpu();
    let object = Scene::new(&context, Preset::Object)?;
    let room = Scene::new(&context, Preset::Room)?;

    // 1000 iterations of the paper's objective, texels and probes as in the paper.
    for (name, scene, views, probes) in [("plan_object_50", &object, 50, 20), ("plan_room_300", &room, 300, 200)] {
        let config = Config::paper(scene.preset, views).with_paper(|own| own.resolution = Some(32));
        whole(&context, report, name, scene, Config { probes, ..config })?;
    }
    // Expected quality: as many iterations as by default, and 50 where only the time of one is of interest.
    let quality = |scene: &Scene, views| Config::new(scene.preset, views);
    whole(&context, report, "quality_object_50", &object, quality(&object, 50))?;
    whole(&context, report, "quality_room_300", &room, quality(&room, 300))?;
    for &views in if on_cpu { &[1000][..] } else { &[1000, 3000, 10_000, 30_000] } {
        let config = Config { iterations: 50, ..quality(&room, views) };
        whole(&context, report, "quality_50_iterations", &room, config)?;
    }

    let (sizes, probes): (&[u32], u32) =
        if on_cpu { (&[300, 1000], 20) } else { (&[300, 1000, 3000, 10_000, 30_000], 200) };
    iteration(&context, report, &object, 50, 20, Pass::Dense)?;
    for &views in sizes {
        for pass in [Pass::Dense, Pass::Binned] {
            // The loops of the dense pass are bounded, see `config::MAX_DENSE`.
            if pass == Pass::Dense && views > 1000 {
                continue;
            }
            iteration(&context, report, &room, views, probes, pass)?;
        }
    }
    Ok(())
}

struct Scene {
    preset: Preset,
    target: Target,
    device: Arc<DeviceScene>,
}

impl Scene {
    fn new(context: &Arc<Context>, preset: Preset) -> Result<Self> {
        let surface = match preset {
            Preset::Object => samples::object(),
            Preset::Room => samples::room(),
        };
        let proxy = Proxy::new(&surface, Orientation::Trusted)?;
        let region = match preset {
            Preset::Object => Region::around_object(proxy.sphere, 0.5 * intrinsics().inscribed_cone(), DVec3::Z, None)?,
            Preset::Room => Region::inside_room(proxy.robust_bounds(), None, DVec3::Z)?,
        };
        let device = Arc::new(DeviceScene::new(context, SceneGeometry::new(&proxy, &region)?)?);
        let target = Target { proxy, region, limits: Limits::default(), record: SurfaceRecord::default() };
        Ok(Self { preset, target, device })
    }

    /// A planner that never halts by itself within a benchmark, after a few iterations.
    fn planner(&self, context: &Arc<Context>, config: Config, warm: u32) -> Result<Planner> {
        let geometry = self.device.geometry.clone();
        let (lens, lenses) = (intrinsics(), Vec::new());
        let problem = Problem { target: &self.target, geometry, lens, lenses, viewers_lens: lens, kept: &[] };
        let preparation = Preparation::new(context, &problem, config)?;
        let planner = Planner::new(context, &self.device, preparation)?;
        let mut commands = Recorder::new(context)?;
        for _ in 0..warm {
            planner.record_iteration(&mut commands)?;
        }
        commands.submit_and_wait()?;
        drop(commands);
        Ok(planner)
    }
}

fn intrinsics() -> Intrinsics {
    Intrinsics::from_fov(800, 800, 50f64.to_radians())
}

fn iteration(
    context: &Arc<Context>,
    report: &mut Report,
    scene: &Scene,
    views: u32,
    probes: u32,
    pass: Pass,
) -> Result<()> {
    let name = if pass == Pass::Binned { "iteration_binned" } else { "iteration_dense" };
    if !report.wants(name, u64::from(views)) {
        return Ok(());
    }
    let paper = Config::paper(scene.preset, views).with_paper(|own| (own.relocate_every, own.pass) = (0, pass));
    let config = Config { iterations: 1 << 20, checkpoint_every: 1 << 19, probes, ..paper };
    let planner = scene.planner(context, config, 20)?;
    let Some(paper) = planner.pass::<PaperPass>() else { unreachable!("the configuration says so") };
    let resolution = paper.maps().resolution;
    let texels = u64::from(probes * resolution * resolution);
    let tallies = paper.tallies()?;
    // Every block of texels of a probe counts the same splats.
    let blocks = u64::from(paper.settings().blocks);
    let visible = tallies.iter().map(|tally| u64::from(tally.visible)).sum::<u64>() / blocks;
    let [pairs, instances] = if pass == Pass::Binned { planner.needed() } else { [0; 2] };
    let all = u64::from(probes * views);
    // The least that must move: records and partials of the pairs (and instances, sorted), depth and texels once each way. The least
    // that must be computed: the kernel's exponent of every splat and texel (of its tiles), once each way.
    let (bytes, exponents) = match pass {
        Pass::Binned => {
            let (pairs, instances) = (u64::from(pairs), u64::from(instances));
            let sorted = 84 * pairs + 42 * instances;
            (28 * all + 80 * pairs + 88 * instances + sorted + 20 * texels, 2 * 64 * instances)
        }
        _ => (8 * all + 68 * visible + 8 * texels, 2 * visible * u64::from(resolution * resolution)),
    };
    println!(
        "{name}: {views} views, {probes} probes of {resolution}x{resolution}, {} pairs, {instances} instances",
        visible.max(u64::from(pairs))
    );
    let n = u64::from(ITERATIONS);
    let amount = Amount { count: u64::from(views), bytes: n * bytes, operations: n * EXPONENT * exponents };
    let mut job = Job::new(
        context,
        planner.stages_of_a_block().min(45 * ITERATIONS),
        |_| {},
        |commands| {
            for _ in 0..ITERATIONS {
                planner.record_iteration(commands)?;
            }
            Ok(())
        },
    )?;
    report.row(name, amount, &mut job)
}

/// A whole run, relocation included: GPU time of a few, of one on CPU devices.
fn whole(context: &Arc<Context>, report: &mut Report, name: &str, scene: &Scene, config: Config) -> Result<()> {
    let (views, iterations) = (config.views, config.iterations);
    if !report.wants(name, u64::from(views)) {
        return Ok(());
    }
    let planner = scene.planner(context, config, 0)?;
    let blocks = iterations / planner.block();
    let repeats = if context.physical().is_cpu() { 1 } else { 15 };
    let mut totals = Vec::new();
    for _ in 0..repeats {
        planner.reset()?;
        let mut commands = Recorder::timed_whole(context)?;
        planner.record_block(&mut commands)?;
        let mut total = 0.0;
        for _ in 0..blocks {
            commands.submit_and_wait()?;
            total += commands.timings()?.first().map_or(0.0, |timing| timing.end - timing.start);
        }
        totals.push(total);
    }
    // The untimed way, wall clock included, must do as many iterations.
    planner.reset()?;
    let outcome = planner.run(None, |_| ControlFlow::Continue(()))?;
    assert_eq!(outcome.history.len(), iterations as usize, "a run of the bench broke off");
    report.total(name, u64::from(views), totals, outcome.seconds);
    Ok(())
}

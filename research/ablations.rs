//! Tables like that of docs/results/planner.md: what each choice is worth, by held-out metrics, over scenes and seeds.
//!
//! ```text
//! cargo run --release --example ablations -- shipped|defaults|parts|starts|voronoi|search [--seeds N] [--scene NAME] [--data DIR]
//! ```
//!
//! Scenes are the two samples and, where DIR (or the environment variable CAMSPLAT_DATA) has them, four more; `search`
//! also knows `donut`, a trained splat file.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use camsplat::engine::vulkan::{Context, ContextOptions};
use camsplat::files::io;
use camsplat::planner::metrics::score_point::{Field, Scorer, aggregate};
use camsplat::planner::metrics::{Metrics, PointMetrics};
use camsplat::planner::plan::config::{Config, Minimise, Preset};
use camsplat::planner::plan::gate::Gate;
use camsplat::planner::plan::paper::{Kernel, PaperConfig, Start};
use camsplat::planner::plan::pipeline::optimise;
use camsplat::planner::plan::preparation::Preparation;
use camsplat::planner::plan::problem::Problem;
use camsplat::planner::plan::run::Outcome;
use camsplat::planner::plan::target::{RegionChoice, Target};
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::layouts;
use camsplat::scene::proxy::SurfacePoint;
use camsplat::scene::random;
use camsplat::scene::region::Shape;
use camsplat::scene::samples;
use camsplat::scene::surface::Surface;
use camsplat::visibility::device_scene::DeviceScene;
use camsplat::{Error, Result};
use clap::Parser;
use glam::DVec3;

#[derive(Parser)]
struct Arguments {
    /// Which tables
    #[arg(required = true)]
    tables: Vec<String>,
    /// Seeds of each entry
    #[arg(long, default_value_t = 5)]
    seeds: u64,
    /// Folder with objects/ and rooms/
    #[arg(long, env = "CAMSPLAT_DATA")]
    data: Option<PathBuf>,
    /// Scenes by name; all where none is given
    #[arg(long)]
    scene: Vec<String>,
    #[arg(long)]
    device: Option<String>,
}

struct Scene {
    name: &'static str,
    preset: Preset,
    views: u32,
    surface: Surface,
    target: Target,
    device: Arc<DeviceScene>,
}

impl Scene {
    fn new(
        context: &Arc<Context>,
        name: &'static str,
        surface: Surface,
        preset: Preset,
        up: DVec3,
        shape: Option<Shape>,
    ) -> Result<Self> {
        let choice = RegionChoice { shape, ..RegionChoice::default() };
        let target = Target::new(&surface, name, preset, &choice, up, &intrinsics())?;
        let geometry = target.geometry()?;
        let views = if preset == Preset::Object { 50 } else { 300 };
        Ok(Self { name, preset, views, surface, target, device: Arc::new(DeviceScene::new(context, geometry)?) })
    }
}

fn scenes(context: &Arc<Context>, data: Option<&Path>, wanted: &[String]) -> Result<Vec<Scene>> {
    let mut scenes = vec![Scene::new(context, "object", samples::object(), Preset::Object, DVec3::Z, None)?];
    if let Some(data) = data {
        for (name, file) in [("helmet", "objects/DamagedHelmet.glb"), ("car", "objects/ToyCar.glb")] {
            let surface = io::read_surface(&data.join(file))?;
            scenes.push(Scene::new(context, name, surface, Preset::Object, DVec3::Y, None)?);
        }
    }
    if let Some(data) = data.filter(|_| wanted.iter().any(|name| name == "donut")) {
        let surface = io::read_surface(&data.join("splats/donut_3dgs_dc_45624.ply"))?;
        scenes.push(Scene::new(context, "donut", surface, Preset::Object, DVec3::Z, None)?);
    }
    scenes.push(Scene::new(context, "room", samples::room(), Preset::Room, DVec3::Z, None)?);
    if let Some(data) = data {
        // The boxes are the `free_box` entries of the files that come with the rooms.
        let boxes = [
            ("living-room", "rooms/living-room.glb", [0.35, 1.3, -3.25, 4.8, 2.55, -0.5]),
            ("staircase", "rooms/staircase2.glb", [-8.0, 0.6, 0.7, 6.5, 5.0, 2.3]),
        ];
        for (name, file, [x0, y0, z0, x1, y1, z1]) in boxes {
            let shape = Shape::Box { min: DVec3::new(x0, y0, z0), max: DVec3::new(x1, y1, z1) };
            let surface = io::read_surface(&data.join(file))?;
            scenes.push(Scene::new(context, name, surface, Preset::Room, DVec3::Y, Some(shape))?);
        }
    }
    Ok(scenes)
}

fn intrinsics() -> Intrinsics {
    Intrinsics::from_fov(800, 800, 50f64.to_radians())
}

fn cameras(poses: &[Pose]) -> Vec<Camera> {
    let camera = |(i, pose): (usize, &Pose)| Camera { name: format!("{i}"), pose: *pose, intrinsics: intrinsics() };
    poses.iter().enumerate().map(camera).collect()
}

/// A row: its name, and what it changes in [`base`].
struct Variant(String, Box<dyn Fn(&mut Config)>);

/// The row with the defaults.
const SHIPPED: &str = "as shipped";

/// What the rows of all tables but `shipped` and `search` vary: the paper's objective, as it was before they settled the
/// gate's softness.
fn base(preset: Preset, views: u32) -> Config {
    Config { gate_softness: 0.005, ..Config::paper(preset, views) }
}

fn variant(name: impl Into<String>, edit: impl Fn(&mut Config) + 'static) -> Variant {
    Variant(name.into(), Box::new(edit))
}

/// A row that changes what the paper's objective has for itself.
fn of_paper(name: impl Into<String>, edit: impl Fn(&mut PaperConfig) + 'static) -> Variant {
    variant(name, move |config| {
        if let Minimise::Paper(own) = &mut config.minimise {
            edit(own);
        }
    })
}

fn defaults() -> Vec<Variant> {
    let mut rows = Vec::new();
    for (reg, pressures) in [
        (0.3, &[0.1, 0.3, 1.0][..]),
        (1.0, &[0.0, 0.03, 0.1, 0.3, 0.5, 1.0]),
        (3.0, &[0.03, 0.1, 0.3, 0.5, 1.0]),
        (10.0, &[0.0, 0.03, 0.1, 0.3, 1.0]),
        (30.0, &[0.1, 0.3, 1.0]),
    ] {
        rows.extend(pressures.iter().map(|&pressure| {
            of_paper(format!("regulariser {reg}, pressure {pressure}"), move |own| {
                own.lambda_reg = reg;
                own.lambda_scale = pressure;
            })
        }));
    }
    rows
}

fn parts() -> Vec<Variant> {
    vec![
        variant("the base", |_| {}),
        variant("the random start", |config| {
            let still = Config { lr_position: 0.0, lr_direction: 0.0, ..config.clone() };
            *config = still.with_paper(|own| own.relocate_every = 0);
        }),
        of_paper("directions weigh the same, not probes", |own| own.equal_probes = false),
        variant("hard gate", |config| config.gate = Gate::Hard),
        variant("pinhole gate", |config| config.gate = Gate::Pinhole),
        of_paper("metric kernel", |own| own.kernel = Kernel::Metric),
        of_paper("no regulariser", |own| own.lambda_reg = 0.0),
        of_paper("no relocation", |own| own.relocate_every = 0),
        of_paper("relocation every 25", |own| own.relocate_every = 25),
        of_paper("scale held", |own| own.lr_scale = 0.0),
        of_paper("no pressure on the scale", |own| own.lambda_scale = 0.0),
        of_paper("no occlusion", |own| own.occlusion = false),
        of_paper("no scores (VDS)", |own| own.vds = false),
        of_paper("iterative", |own| own.iterative = true),
        of_paper("32 texels a side", |own| own.resolution = Some(32)),
        variant("200 probes a step", |config| config.probes = 200),
        variant("3000 iterations", |config| config.iterations = 3000),
        variant("50 probes a step", |config| config.probes = 50),
        variant("gate softness 0.02", |config| config.gate_softness = 0.02),
        variant("gate softness 0.05", |config| config.gate_softness = 0.05),
        of_paper("opacity 0.05", |own| own.alpha = 0.05),
        of_paper("opacity 0.2", |own| own.alpha = 0.2),
        variant("positions half as fast", |config| config.lr_position *= 0.5),
        variant("positions twice as fast", |config| config.lr_position *= 2.0),
        variant("directions half as fast", |config| config.lr_direction *= 0.5),
        variant("directions twice as fast", |config| config.lr_direction *= 2.0),
        of_paper("regulariser 0.3", |own| own.lambda_reg = 0.3),
        of_paper("pressure 0.2", |own| own.lambda_scale = 0.2),
    ]
}

struct Run {
    outcome: Outcome,
    points: Vec<SurfacePoint>,
    scores: Vec<PointMetrics>,
}

fn run(context: &Arc<Context>, scene: &Scene, config: Config) -> Result<Run> {
    let points = scene.target.proxy.sample(config.held_out as usize, 1000 + config.seed, 1);
    let geometry = scene.device.geometry.clone();
    let (lens, lenses) = (intrinsics(), Vec::new());
    let problem = Problem { target: &scene.target, geometry, lens, lenses, viewers_lens: lens, kept: &[] };
    let preparation = Preparation::new(context, &problem, config)?;
    let (_, outcome) = optimise(context, &scene.device, preparation, None, |_, _| ControlFlow::Continue(()))?;
    let scores = Scorer::new(context, &scene.device, &points)?.score(&cameras(&outcome.poses), Field::Cone)?;
    Ok(Run { outcome, points, scores })
}

fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (mean, variance.sqrt())
}

/// "mean gap ± deviation over seeds (95th percentile), seen by three or more, views per point".
fn entry(all: &[Metrics]) -> String {
    let of = |value: fn(&Metrics) -> f64| mean_and_deviation(&all.iter().map(value).collect::<Vec<_>>());
    let (gap, deviation) = of(|m| m.gap_mean_deg);
    format!(
        " {gap:.2} ± {deviation:.2} ({:.1}), {:.1}%, {:.1} |",
        of(|m| m.gap_p95_deg).0,
        100.0 * of(|m| m.coverage_3).0,
        of(|m| m.views_mean).0
    )
}

fn table(context: &Arc<Context>, scenes: &[Scene], seeds: u64, title: &str, rows: &[Variant]) -> Result<()> {
    println!("\n## {title}\n");
    println!("| |{}", scenes.iter().map(|scene| format!(" {} |", scene.name)).collect::<String>());
    println!("|---|{}", "---|".repeat(scenes.len()));
    for Variant(name, edit) in rows {
        let mut line = format!("| {name} |");
        for scene in scenes {
            let all = (0..seeds).map(|seed| {
                let defaults = if name == SHIPPED { Config::new } else { base };
                let mut config = Config { seed, ..defaults(scene.preset, scene.views) };
                edit(&mut config);
                Ok(aggregate(&run(context, scene, config)?.scores))
            });
            line += &entry(&all.collect::<Result<Vec<_>>>()?);
        }
        println!("{line}");
    }
    for (name, random) in [("*random*", true), ("*Fibonacci*", false)] {
        let mut line = format!("| {name} |");
        for scene in scenes {
            let all = (0..seeds).filter_map(|seed| control(context, scene, seed, random).transpose());
            let all = all.collect::<Result<Vec<_>>>()?;
            line += &if all.is_empty() { " – |".into() } else { entry(&all) };
        }
        println!("{line}");
    }
    Ok(())
}

/// Metrics of a baseline; none where it does not apply to the scene.
fn control(context: &Arc<Context>, scene: &Scene, seed: u64, random: bool) -> Result<Option<Metrics>> {
    let geometry = &scene.device.geometry;
    let poses = match random {
        true => layouts::random(&geometry.free, scene.views as usize, seed, scene.preset == Preset::Object),
        false if scene.preset == Preset::Room => return Ok(None),
        false => layouts::fibonacci_shell(&geometry.region, scene.views as usize)?,
    };
    let back = geometry.to_internal.inverse();
    let world: Vec<Pose> = poses.iter().map(|pose| back.pose(pose)).collect();
    let points = scene.target.proxy.sample(1000, 1000 + seed, 1);
    let scores = Scorer::new(context, &scene.device, &points)?.score(&cameras(&world), Field::Cone)?;
    Ok(Some(aggregate(&scores)))
}

/// Rows of something by iteration, averaged over seeds: one line per name, some of the checkpoints as columns.
#[derive(Default)]
struct ByIteration {
    headed: bool,
}

impl ByIteration {
    const COLUMNS: [u32; 8] = [0, 50, 100, 200, 400, 600, 800, 1000];

    fn line(&mut self, name: &str, values: &[(u32, f64)], format: impl Fn(f64) -> String) {
        let few: Vec<_> = values.iter().filter(|(i, _)| Self::COLUMNS.contains(i)).collect();
        if !self.headed {
            println!("| iteration |{}", few.iter().map(|(i, _)| format!(" {i} |")).collect::<String>());
            println!("|---|{}", "---|".repeat(few.len()));
            self.headed = true;
        }
        println!("| {name} |{}", few.iter().map(|(_, v)| format!(" {} |", format(*v))).collect::<String>());
    }
}

/// The mean over seeds of a value at every checkpoint.
fn by_iteration(
    context: &Arc<Context>,
    scene: &Scene,
    seeds: u64,
    config: impl Fn(u64) -> Config,
    value: impl Fn(&[SurfacePoint], &[PointMetrics]) -> f64,
) -> Result<Vec<(u32, f64)>> {
    let mut sums: Vec<(u32, f64)> = Vec::new();
    for seed in 0..seeds {
        let run = run(context, scene, config(seed))?;
        let scorer = Scorer::new(context, &scene.device, &run.points)?;
        sums.resize(run.outcome.snapshots.len(), (0, 0.0));
        for (sum, (iteration, poses)) in sums.iter_mut().zip(&run.outcome.snapshots) {
            let scores = scorer.score(&cameras(poses), Field::Cone)?;
            *sum = (*iteration, sum.1 + value(&run.points, &scores) / seeds as f64);
        }
    }
    Ok(sums)
}

/// Coverage by iteration, with and without regulariser and relocation, from random and identical starts.
fn starts(context: &Arc<Context>, scenes: &[Scene], seeds: u64) -> Result<()> {
    for scene in scenes {
        println!("\n### Coverage by iteration, {}\n", scene.name);
        let mut lines = ByIteration::default();
        for (start_name, start) in [("random", Start::Random), ("identical", Start::Identical)] {
            for (name, reg, relocation) in [
                ("", true, true),
                (", no relocation", true, false),
                (", no regulariser", false, true),
                (", neither", false, false),
            ] {
                let config = |seed| {
                    let base = base(scene.preset, scene.views).with_paper(|own| {
                        own.start = start;
                        own.lambda_reg *= f32::from(u8::from(reg));
                        own.relocate_every *= u32::from(relocation);
                    });
                    Config { seed, ..base }
                };
                let covered = |_: &[SurfacePoint], scores: &[PointMetrics]| {
                    let metrics = aggregate(scores);
                    metrics.coverage_1 / metrics.reachable
                };
                let values = by_iteration(context, scene, seeds, config, covered)?;
                lines.line(&format!("{start_name}{name}"), &values, |v| format!("{:.1}%", 100.0 * v));
            }
        }
    }
    Ok(())
}

/// Mean Voronoi cell area by iteration for points of high and low score: the half of each surface with the higher x is
/// given the score 2, the other half 1.
fn voronoi(context: &Arc<Context>, scenes: &[Scene], seeds: u64) -> Result<()> {
    for scene in scenes {
        let Surface::Mesh(mut mesh) = scene.surface.clone() else { continue };
        let mut xs: Vec<f64> = mesh.positions.iter().map(|p| p.x).collect();
        xs.sort_unstable_by(f64::total_cmp);
        let middle = xs[xs.len() / 2];
        mesh.scores = mesh.positions.iter().map(|p| if p.x > middle { 2.0 } else { 1.0 }).collect();
        let region = scene.target.region;
        let scored = Scene::new(context, scene.name, Surface::Mesh(mesh), scene.preset, region.up, Some(region.shape))?;
        println!("\n### Voronoi cell area by iteration, {}, steradians\n", scene.name);
        let mut lines = ByIteration::default();
        for (name, vds) in [("with scores", true), ("without", false)] {
            for (half, high) in [("low score", false), ("high score", true)] {
                let base = || base(scene.preset, scene.views).with_paper(|own| own.vds = vds);
                let config = |seed| Config { seed, ..base() };
                let area = |points: &[SurfacePoint], scores: &[PointMetrics]| {
                    let of_half = points.iter().zip(scores).filter(|(p, s)| (p.score > 1.5) == high && s.views > 0);
                    mean_and_deviation(&of_half.map(|(_, s)| s.voronoi_mean as f64).collect::<Vec<_>>()).0
                };
                let values = by_iteration(context, &scored, seeds, config, area)?;
                lines.line(&format!("{name}, {half}"), &values, |v| format!("{v:.3}"));
            }
        }
    }
    Ok(())
}

/// Trials of [`search`].
const TRIALS: u32 = 20_000;

/// How low the mean gap gets when it is descended on itself: a local search that moves one camera at a time and is scored on the very
/// points that it is searched on. It uses information that no planner may use, so its result bounds what a planner can reach.
fn search(context: &Arc<Context>, scenes: &[Scene], seeds: u64) -> Result<()> {
    println!(
        "\n## Search\n\n| scene, start | gap | after {TRIALS} trials | there, on fresh points |\n|---|---|---|---|"
    );
    for scene in scenes.iter().filter(|scene| scene.preset == Preset::Object) {
        let (geometry, sample) = (&scene.device.geometry, |seed| scene.target.proxy.sample(1000, seed, 1));
        let back = geometry.to_internal.inverse();
        for start in ["as shipped", "Fibonacci"] {
            let mut gaps: [Vec<f64>; 3] = Default::default();
            for seed in 0..seeds {
                let mut poses = match start {
                    "Fibonacci" => layouts::fibonacci_shell(&geometry.region, scene.views as usize)?
                        .iter()
                        .map(|pose| back.pose(pose))
                        .collect(),
                    _ => run(context, scene, Config { seed, ..Config::new(scene.preset, scene.views) })?.outcome.poses,
                };
                let (known, fresh) = (sample(1000 + seed), sample(2000 + seed));
                let (known, fresh) =
                    (Scorer::new(context, &scene.device, &known)?, Scorer::new(context, &scene.device, &fresh)?);
                let gap = |scorer: &Scorer, poses: &[Pose]| -> Result<f64> {
                    Ok(aggregate(&scorer.score(&cameras(poses), Field::Cone)?).gap_mean_deg)
                };
                let mut least = gap(&known, &poses)?;
                gaps[0].push(least);
                for trial in 0..TRIALS {
                    let chosen = (trial % scene.views) as usize;
                    let old = poses[chosen];
                    // From a third of the region's size down to a hundredth of it.
                    let reach = 0.3 * 0.03f64.powf(f64::from(trial) / f64::from(TRIALS));
                    let [u, v, w, _] = random::uniforms(seed, 100, 2 * trial);
                    let [a, b, c, _] = random::uniforms(seed, 100, 2 * trial + 1);
                    let inside = geometry.to_internal.pose(&old);
                    let position = geometry.settle(inside.position + reach * w * random::direction(u, v));
                    let direction = (inside.forward() + reach * c * random::direction(a, b)).normalize();
                    poses[chosen] = back.pose(&Pose::looking(position, direction, geometry.region.up));
                    let now = gap(&known, &poses)?;
                    if now < least {
                        least = now;
                    } else {
                        poses[chosen] = old;
                    }
                }
                gaps[1].push(least);
                gaps[2].push(gap(&fresh, &poses)?);
            }
            let [before, after, there] = gaps.map(|gaps| {
                let (mean, deviation) = mean_and_deviation(&gaps);
                format!("{mean:.2} ± {deviation:.2}")
            });
            println!("| {}, {start} | {before} | {after} | {there} |", scene.name);
        }
    }
    Ok(())
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    let context = Context::new(&ContextOptions { device: arguments.device.clone(), ..ContextOptions::default() })?;
    let mut scenes = scenes(&context, arguments.data.as_deref(), &arguments.scene)?;
    if !arguments.scene.is_empty() {
        scenes.retain(|scene| arguments.scene.iter().any(|name| name == scene.name));
    }
    for name in &arguments.tables {
        match name.as_str() {
            "shipped" => table(&context, &scenes, arguments.seeds, "Shipped", &[variant(SHIPPED, |_| {})])?,
            "defaults" => table(&context, &scenes, arguments.seeds, "Weights", &defaults())?,
            "parts" => table(&context, &scenes, arguments.seeds, "Parts", &parts())?,
            "starts" => starts(&context, &scenes, arguments.seeds)?,
            "voronoi" => voronoi(&context, &scenes, arguments.seeds)?,
            "search" => search(&context, &scenes, arguments.seeds)?,
            other => {
                return Err(Error::request(format!(
                    "no table `{other}`: shipped, defaults, parts, starts, voronoi or search"
                )));
            }
        }
    }
    Ok(())
}

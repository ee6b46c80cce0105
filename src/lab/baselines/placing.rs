//! A whole plan of a baseline: region, candidates, choice, metrics and baselines, from a surface to a record.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::DVec3;

use super::manifold;
use super::request::BaselineRequest;
use crate::engine::vulkan::Context;
use crate::files::photos::{Photo, PhotoSet};
use crate::planner::methods::Method;
use crate::planner::plan::config::{Config, Preset};
use crate::planner::plan::pipeline::{Placed, Plan, conclude};
use crate::planner::plan::preparation::PROBE_STREAM;
use crate::planner::plan::problem::Problem;
use crate::planner::plan::record::Status;
use crate::planner::plan::run::Outcome;
use crate::planner::plan::simple_layouts::even_layout;
use crate::planner::quality::expected::Judge;
use crate::planner::quality::law::Law;
use crate::planner::quality::look::Surroundings;
use crate::planner::select::information::Model;
use crate::planner::select::objective::Objective;
use crate::planner::select::pool::Pool;
use crate::planner::select::retrained::Photograph;
use crate::planner::select::rule::{Means, Rule};
use crate::planner::select::sight::{Sight, Survey};
use crate::scene::camera::{Camera, Pose};
use crate::scene::free_space::FreeSpace;
use crate::scene::layouts;
use crate::scene::lens::Distortion;
use crate::scene::random;
use crate::visibility::device_scene::DeviceScene;
use crate::{Error, Result};

/// Stream that the candidates' seed is drawn from, so that they are not the random baseline.
const CANDIDATES: u32 = 0x5045_0000;
/// Viewers whose looks the greedy choice is made by, and the key that separates them from those that judge it.
const VIEWERS: u32 = 512;
const VIEWER_SEED: u64 = 0x6772_6565;
/// Candidates up to which it is worth knowing what each of them sees of all these looks.
const MAX_GREEDY: usize = 20_000;
/// Points that shared points and coverage are counted on.
const POINTS: usize = 2000;

/// Places cameras as a baseline does, and scores them as a plan of ours. The record's seconds are those of the choice: candidates
/// are there before, and taking photographs does not count.
///
/// # Errors
/// A region without free space, a method that does not fit the scene, or a device that fails.
pub fn run(
    context: &Arc<Context>,
    problem: &Problem<'_>,
    request: &BaselineRequest,
    model: Option<&Model>,
) -> Result<Plan> {
    if request.method.needs_photographs() {
        return Err(no_photographs(request.method));
    }
    let photograph = &mut |_: &Photo| Err(no_photographs(request.method));
    let outside = Callbacks { photograph, go_on: &mut || ControlFlow::Continue(()) };
    photographing(context, problem, request, model, outside)
}

/// The error where a method takes photographs and none can be taken.
pub fn no_photographs(method: Method) -> Error {
    let what = match method {
        Method::OursTwoPasses => {
            "looks at photographs of its first pass, which do not exist yet; use `camsplat evaluate`"
        }
        _ => {
            "trains on photographs of the views that it chooses, which do not exist yet; use `camsplat evaluate`, or \
             `camsplat select` on photos"
        }
    };
    Error::request(format!("`method` {}: {what}", method.name()))
}

/// What a method calls while it chooses.
pub struct Callbacks<'o> {
    /// Photographs of candidates, for the methods that need them.
    pub photograph: Photograph<'o>,
    /// Whether to continue, for methods that take long.
    pub go_on: &'o mut dyn FnMut() -> ControlFlow<()>,
}

/// As [`run`], with photographs of candidates.
///
/// # Errors
/// As [`run`], or where a photograph cannot be taken or it was stopped.
pub fn photographing(
    context: &Arc<Context>,
    problem: &Problem<'_>,
    request: &BaselineRequest,
    model: Option<&Model>,
    outside: Callbacks<'_>,
) -> Result<Plan> {
    let scene = problem.on(context)?;
    let candidates = PhotoSet { photos: candidates(problem, request), ..PhotoSet::default() };
    let (start, mut behind_the_camera) = (Instant::now(), Duration::ZERO);
    let timed = &mut |photo: &Photo| {
        let start = Instant::now();
        let taken = (outside.photograph)(photo);
        behind_the_camera += start.elapsed();
        taken
    };
    let timed = Callbacks { photograph: timed, go_on: outside.go_on };
    let site = Site { context, problem, scene: &scene, candidates: &candidates, request, model };
    let poses = site.place(timed)?;
    let seconds = start.elapsed().saturating_sub(behind_the_camera).as_secs_f64();
    let outcome = Outcome { poses, history: Vec::new(), snapshots: Vec::new(), status: Status::Complete, seconds };
    let BaselineRequest { method, views, preset, seed, gate, held_out, .. } = *request;
    let viewers = request.viewers.clone();
    let config = Config { seed, gate, held_out, viewers, ..Config::new(preset, views) };
    let configuration =
        serde_json::to_value(request).map_err(|e| Error::request(format!("the request cannot be written: {e}")))?;
    let placed = Placed { method: method.name(), configuration, outcome, prediction: None };
    conclude(context, problem, &scene, &config, placed)
}

/// The cameras that are kept, and behind them poses at random in the region.
fn candidates(problem: &Problem<'_>, request: &BaselineRequest) -> Vec<Photo> {
    let geometry = &problem.geometry;
    let [low, high, ..] = random::bits(request.seed, CANDIDATES, 0);
    let seed = u64::from(low) | u64::from(high) << 32;
    let count = request.candidates.unwrap_or(0) as usize;
    let back = geometry.to_internal.inverse();
    let drawn = layouts::random(&geometry.free, count, seed, request.preset == Preset::Object);
    let drawn = drawn.iter().enumerate().map(|(i, pose)| Camera {
        name: format!("candidate_{i:06}"),
        pose: back.pose(pose),
        intrinsics: problem.lens,
    });
    let photo = |camera| Photo { camera, distortion: Distortion::default(), image: None, mask: None };
    problem.kept.iter().cloned().chain(drawn).map(photo).collect()
}

/// How a baseline places cameras.
enum Placement {
    /// At random in the region.
    Random,
    /// Evenly, in a random rotation.
    Fibonacci,
    /// By a layout of rooms.
    Level(fn(&FreeSpace, usize) -> Vec<Pose>),
    /// Chosen among random poses by a rule.
    Choice(Rule),
    /// Chosen among random poses by expected quality.
    Greedy,
    /// By the noise of a model.
    Manifold(manifold::ManifoldSettings),
}

impl Placement {
    /// What a request asks for.
    ///
    /// # Errors
    /// Where the method is no baseline that places cameras, or does not fit the scene.
    fn of(request: &BaselineRequest) -> Result<Self> {
        let refuse = |what: &str| Err(Error::request(format!("`method` {}: {what}", request.method.name())));
        Ok(match (request.method, request.method.rule()) {
            (Method::Random, _) => Self::Random,
            (Method::Fibonacci, _) => Self::Fibonacci,
            (Method::Grid | Method::Rings, _) if request.preset == Preset::Object => {
                return refuse("it is of rooms; give `preset` room, or use fibonacci");
            }
            (Method::Grid, _) => Self::Level(layouts::grid),
            (Method::Rings, _) => Self::Level(layouts::rings),
            (Method::Greedy, _) => Self::Greedy,
            (Method::Manifold, _) => Self::Manifold(request.manifold.unwrap_or_default()),
            (method, Some(rule)) if method.entry().places => Self::Choice(match rule {
                Rule::Acp(usual) => Rule::Acp(request.acp.unwrap_or(usual)),
                Rule::Fisher(usual) => Rule::Fisher(request.model_based.unwrap_or(usual)),
                Rule::Cover(usual) => Rule::Cover(request.model_based.unwrap_or(usual)),
                Rule::FisherRetrain(usual) => Rule::FisherRetrain(request.retraining.unwrap_or(usual)),
                rule => rule,
            }),
            _ => return refuse("it is no baseline that places cameras"),
        })
    }
}

/// A scene in which a baseline is to place cameras.
struct Site<'s> {
    context: &'s Arc<Context>,
    problem: &'s Problem<'s>,
    scene: &'s DeviceScene,
    candidates: &'s PhotoSet,
    request: &'s BaselineRequest,
    model: Option<&'s Model>,
}

impl Site<'_> {
    /// Poses in the user's world, in the order in which they were chosen.
    fn place(&self, outside: Callbacks<'_>) -> Result<Vec<Pose>> {
        let Self { context, problem, request, .. } = *self;
        let (geometry, kept, views) = (&self.scene.geometry, problem.kept, request.views as usize);
        let back = geometry.to_internal.inverse();
        let settled = |pose: &Pose| back.pose(&Pose { position: geometry.settle(pose.position), ..*pose });
        Ok(match Placement::of(request)? {
            Placement::Random => {
                let poses = layouts::random(&geometry.free, views, request.seed, request.preset == Preset::Object);
                poses.iter().map(|pose| back.pose(pose)).collect()
            }
            Placement::Fibonacci => {
                // Layouts differ by their rotation alone, so that each seed has its own.
                let turn = layouts::turn(&geometry.region, request.seed, 0);
                let all = even_layout(geometry, &request.viewers, views + kept.len(), turn)?;
                let taken: Vec<DVec3> =
                    kept.iter().map(|camera| geometry.to_internal.point(camera.pose.position)).collect();
                layouts::left_beside(all, &taken).iter().map(settled).collect()
            }
            Placement::Level(layout) => layout(&geometry.free, views).iter().map(settled).collect(),
            Placement::Choice(rule) => self.choose(rule, outside)?,
            Placement::Greedy => self.greedy(outside.go_on)?,
            Placement::Manifold(settings) => {
                let missing = || Error::request("`method` manifold needs trained splats; give them with `model`");
                let model = self.model.ok_or_else(missing)?;
                let placed = manifold::place(context, problem, model, (settings, request.seed), views, outside.go_on)?;
                placed.iter().map(|pose| settled(&geometry.to_internal.pose(pose))).collect()
            }
        })
    }

    /// As many of the candidates as there are to be views, one after another the one that lowers most what viewers are expected to see
    /// of errors.
    fn greedy(&self, go_on: &mut dyn FnMut() -> ControlFlow<()>) -> Result<Vec<Pose>> {
        let Self { context, problem, scene, candidates, request, .. } = *self;
        let (inward, seed) = (request.preset == Preset::Object, request.seed ^ VIEWER_SEED);
        let law = Law::embedded(inward);
        let around = Surroundings::new(&scene.geometry, problem.target.proxy.sphere, inward, &law);
        let viewers = request.viewers.sample(&scene.geometry, problem.viewers_lens, inward, seed, VIEWERS)?;
        let judge = Judge::new(context, scene, around, viewers, &law, seed)?;
        let photos = &candidates.photos;
        if photos.len() > MAX_GREEDY {
            let what = format!("all looks are held for up to {MAX_GREEDY} candidates and kept cameras");
            return Err(Error::request(format!("`method` greedy: {what}, and these are {}; take fewer", photos.len())));
        }
        let looked_at = Objective::new(context, scene, photos, judge.looks()?, judge.viewers().len(), law)?;
        let kept = problem.kept.len();
        let free: Vec<usize> = (kept..photos.len()).collect();
        let taken: Vec<usize> = (0..kept).collect();
        let chosen = looked_at.grown(&taken, &free, kept + request.views as usize, go_on)?;
        Ok(chosen[kept..].iter().map(|photo| photos[*photo].camera.pose).collect())
    }

    /// As many of the candidates as there are to be views, by a rule.
    fn choose(&self, rule: Rule, outside: Callbacks<'_>) -> Result<Vec<Pose>> {
        let Self { context, problem, scene, candidates, request, model } = *self;
        let photos = &candidates.photos;
        rule.check(photos.len())?;
        let sight = if rule.needs_sight() {
            let points = problem.target.proxy.sample(POINTS, request.seed, PROBE_STREAM);
            let inward = request.preset == Preset::Object;
            let points = request.viewers.facing(points, &scene.geometry, problem.viewers_lens, inward)?;
            Survey::new(context, scene, photos, points)?.sight
        } else {
            Sight::empty(0, photos.len())
        };
        let kept = problem.kept.len();
        let (include, allowed): (Vec<usize>, Vec<usize>) = ((0..kept).collect(), (0..photos.len()).collect());
        let pool = Pool {
            set: candidates,
            region: &problem.target.region,
            sight: &sight,
            include: &include,
            allowed: &allowed,
            count: kept + request.views as usize,
            seed: request.seed,
        };
        let means = Means {
            context,
            geometry: &scene.geometry,
            proxy: &problem.target.proxy,
            planned: &[],
            model,
            photograph: outside.photograph,
        };
        let chosen = rule.choose(&pool, means)?;
        Ok(chosen[kept..].iter().map(|photo| photos[*photo].camera.pose).collect())
    }
}

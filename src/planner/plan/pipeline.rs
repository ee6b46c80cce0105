//! A whole plan: proxy, region, optimisation, held-out metrics and baselines, from a surface to a record.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use glam::{DQuat, DVec3};

use super::aim::aim;
use super::config::{Config, Preset};
use super::planner::Planner;
use super::preparation::Preparation;
use super::problem::Problem;
use super::record::{BaselineRecord, CheckpointRecord, Connection, Expected, PlanRecord, Status, TourRecord};
use super::reference::{Prediction, Reference};
use super::run::Outcome;
use super::simple_layouts::even_layout;
use super::target::Target;
use crate::engine::vulkan::capture::RenderDoc;
use crate::engine::vulkan::profile::Profile;
use crate::engine::vulkan::{Context, Recorder};
use crate::files::io::folder::make_parent;
use crate::planner::metrics::score_point::{Field, Scorer, aggregate};
use crate::planner::metrics::{Metrics, PointMetrics};
use crate::planner::quality::expected::Expectation;
use crate::planner::quality::map::ErrorMap;
use crate::scene::camera::{Camera, Intrinsics, Pose, middle_lens};
use crate::scene::layouts;
use crate::scene::proxy::SurfacePoint;
use crate::scene::tour::{self, Tour};
use crate::visibility::device_scene::{DeviceScene, SceneGeometry};
use crate::{Error, Result};

/// Held-out points of a checkpoint: the first so many.
const CHECKPOINT_POINTS: usize = 400;

/// A plan with everything that is written about it.
pub struct Plan {
    /// What goes into plan.json.
    pub record: PlanRecord,
    /// The held-out points.
    pub points: Vec<SurfacePoint>,
    /// What the plan gives each of them.
    pub scores: Vec<PointMetrics>,
    /// Where it leaves error, by held-out point among others.
    pub map: ErrorMap,
    /// The scene in the planner's frame.
    pub geometry: Arc<SceneGeometry>,
}

/// Progress events.
pub enum PlanEvent {
    /// The surface and the simple layouts are looked at; there is no plan yet.
    Preparing,
    /// Iterations done, and the total.
    Iterations(u32, u32),
    /// A capture was taken and lies here.
    Captured(PathBuf),
    /// The optimisation is over and is being scored.
    Scoring,
}

/// How a run is observed.
#[derive(Default)]
pub struct Tools<'t> {
    /// Times every stage.
    pub profile: Option<&'t mut Profile>,
    /// Captures the first iteration into files that start with this path.
    pub capture: Option<(&'t RenderDoc, PathBuf)>,
    /// Whether nobody wants a plan that was stopped: it is not scored.
    pub whole_only: bool,
}

/// Makes a plan. `observe` receives the progress and may stop the optimisation; the plan so far is then scored.
///
/// # Errors
/// A request that makes no sense, a plan that does not fit the device, or a device that fails; [`Error::Interrupted`] where it was stopped
/// before there was a plan, or where only a whole one is wanted.
pub fn run(
    context: &Arc<Context>,
    problem: &Problem<'_>,
    config: Config,
    tools: Tools<'_>,
    mut observe: impl FnMut(PlanEvent) -> ControlFlow<()>,
) -> Result<Plan> {
    let Tools { mut profile, capture, whole_only } = tools;
    let start = Instant::now();
    let preparation = Preparation::new(context, problem, config.clone())?;
    mark(&mut profile, "preparation", start);
    Error::unless_stopped(observe(PlanEvent::Preparing))?;
    let scene = Arc::new(problem.on(context)?);
    if let Some((renderdoc, template)) = capture {
        let planner = Planner::new(context, &scene, preparation.clone())?;
        make_parent(&template)?;
        renderdoc.start(&template)?;
        let mut commands = Recorder::new(context)?;
        planner.record_iteration(&mut commands)?;
        commands.submit_and_wait()?;
        let _ = observe(PlanEvent::Captured(renderdoc.end()?));
    }
    let start = Instant::now();
    let reference = match config.of_quality() {
        Some(_) => {
            let go_on = &mut || observe(PlanEvent::Preparing);
            Some(Reference::observed(context, problem, &scene, &config, go_on)?)
        }
        None => None,
    };
    let preparation = match &reference {
        Some(reference) => preparation.starting_from(&reference.start()),
        None => preparation,
    };
    mark(&mut profile, "simple layouts", start);
    let (planner, mut outcome) = optimise(context, &scene, preparation, profile.as_deref_mut(), |done, all| {
        observe(PlanEvent::Iterations(done, all))
    })?;

    if whole_only && outcome.status == Status::Interrupted {
        return Err(Error::Interrupted);
    }
    // A stop at this point has no effect.
    let _ = observe(PlanEvent::Scoring);
    let start = Instant::now();
    let config = planner.config().clone();
    drop(planner);
    let (mut prediction, mut began_from, mut connection) = (None, None, None);
    check_finite(&outcome.poses)?;
    if let Some(reference) = reference {
        reference.guard(&mut outcome)?;
        if problem.target.limits.space.is_some() {
            aim(&reference, problem, &mut outcome.poses)?;
        }
        let points = problem.held_out(&config)?;
        prediction = Some(reference.prediction(&problem.cameras(&outcome.poses), &positions(&points))?);
        began_from = Some(reference.best().name.clone());
        let poses: Vec<Pose> = outcome.poses.iter().map(|pose| scene.geometry.to_internal.pose(pose)).collect();
        let groups = reference.groups(&poses);
        let kept = problem.kept.len();
        let groups = groups.filter(|_| kept + poses.len() > 1);
        connection = config.connect().zip(groups).map(|(degrees, groups)| Connection { degrees, groups, kept });
    }
    let configuration = serde_json::to_value(&config)
        .map_err(|e| Error::request(format!("the configuration cannot be written: {e}")))?;
    let placed = Placed { method: config.method().name(), configuration, outcome, prediction };
    let mut plan = conclude(context, problem, &scene, &config, placed)?;
    if let Some(expected) = &mut plan.record.expected
        && expected.db == 0.0
        && began_from.as_ref() == Some(&expected.against)
    {
        let least = config.law().spread(0.0);
        expected.reason = Some(format!(
            "the plan is that layout itself: the descent gains less than {least:.2} dB, too little to be distinguished"
        ));
    }
    plan.record.began_from = began_from;
    plan.record.connection = connection;
    mark(&mut profile, "metrics", start);
    Ok(plan)
}

/// The poses that a plan ends with, in the user's world, not scored: of an objective that compares them with no simple layouts.
///
/// # Errors
/// As [`run`].
pub fn poses(context: &Arc<Context>, problem: &Problem<'_>, config: Config) -> Result<Vec<Pose>> {
    let scene = Arc::new(problem.on(context)?);
    let preparation = Preparation::new(context, problem, config)?;
    let (_, outcome) = optimise(context, &scene, preparation, None, |_, _| ControlFlow::Continue(()))?;
    check_finite(&outcome.poses)?;
    Ok(outcome.poses)
}

/// Plans by expected quality: what is expected of the plan, which is not scored otherwise, and its poses in the user's world.
///
/// # Errors
/// As [`run`].
pub fn expected_plan(
    context: &Arc<Context>,
    problem: &Problem<'_>,
    config: Config,
) -> Result<(Expectation, Vec<Pose>)> {
    let scene = Arc::new(problem.on(context)?);
    let preparation = Preparation::new(context, problem, config.clone())?;
    let reference = Reference::new(context, problem, &scene, &config)?;
    expected_beside(context, &scene, &reference, preparation, &mut || ControlFlow::Continue(()))
}

/// [`expected_plan`] of what is prepared, beside simple layouts that have been judged; `go_on` is asked between iterations and may stop it.
///
/// # Errors
/// As [`run`], and [`Error::Interrupted`] where it was stopped.
pub(super) fn expected_beside(
    context: &Arc<Context>,
    scene: &Arc<DeviceScene>,
    reference: &Reference<'_>,
    preparation: Preparation,
    go_on: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<(Expectation, Vec<Pose>)> {
    let preparation = preparation.starting_from(&reference.start());
    let (planner, mut outcome) = optimise(context, scene, preparation, None, |_, _| go_on())?;
    drop(planner);
    Error::unless_stopped(go_on())?;
    check_finite(&outcome.poses)?;
    Ok((reference.guard(&mut outcome)?, outcome.poses))
}

fn check_finite(poses: &[Pose]) -> Result<()> {
    if poses.iter().all(|pose| pose.position.is_finite() && pose.rotation.is_finite()) {
        return Ok(());
    }
    Err(Error::request(
        "cameras have left all bounds, which a rate or weight does that is far too large; give smaller ones",
    ))
}

/// Scores cameras that were placed by other means, in the user's world, beside those that are kept, as a plan is scored; it took no time.
/// `name` is what they are called; of `config` count the same as in [`conclude`].
///
/// # Errors
/// A region without free space, or a device that fails.
pub fn given(
    context: &Arc<Context>,
    problem: &Problem<'_>,
    poses: Vec<Pose>,
    name: &str,
    config: &Config,
) -> Result<Plan> {
    let scene = problem.on(context)?;
    let configuration = serde_json::json!({ "cameras": poses.len() });
    let outcome = Outcome { poses, history: Vec::new(), snapshots: Vec::new(), status: Status::Complete, seconds: 0.0 };
    conclude(context, problem, &scene, config, Placed { method: name, configuration, outcome, prediction: None })
}

/// Cameras that a method has placed.
pub struct Placed<'p> {
    /// The method's name.
    pub method: &'p str,
    /// Its own configuration, as the record has it.
    pub configuration: serde_json::Value,
    /// What came out.
    pub outcome: Outcome,
    /// What is expected of it, where that is known.
    pub prediction: Option<Prediction>,
}

/// Scores what came out, its snapshots and the baselines on held-out points, and writes the record. Of `config` count the views,
/// the seed, the preset, the viewers, the gate and the held-out points. What is expected of the outcome is worked out where it is not given.
///
/// # Errors
/// A device that fails.
pub fn conclude(
    context: &Arc<Context>,
    problem: &Problem<'_>,
    scene: &DeviceScene,
    config: &Config,
    placed: Placed<'_>,
) -> Result<Plan> {
    let Placed { method, configuration, outcome, prediction } = placed;
    let points = problem.held_out(config)?;
    let scorer = Scorer::new(context, scene, &points)?;
    let few = Scorer::new(context, scene, &points[..points.len().min(CHECKPOINT_POINTS)])?;
    let field = if config.gate.pinhole() { Field::Frustum } else { Field::Cone };
    let cameras = |poses: &[Pose]| problem.cameras(poses);
    let scores = scorer.score(&cameras(&outcome.poses), field)?;
    let mut checkpoints = Vec::new();
    for (iteration, poses) in &outcome.snapshots {
        let scores = few.score(&cameras(poses), field)?;
        let [low, high] = voronoi_by_score(&points, &scores);
        checkpoints.push(CheckpointRecord {
            iteration: *iteration,
            metrics: aggregate(&scores),
            voronoi_low_vds: low,
            voronoi_high_vds: high,
        });
    }
    let mut baselines = Vec::new();
    for (name, poses) in control_poses(scene, config).into_iter().filter(|(name, _)| *name != method) {
        baselines
            .push(BaselineRecord { name: name.into(), metrics: aggregate(&scorer.score(&cameras(&poses), field)?) });
    }
    let Prediction { expected, map } = match prediction {
        Some(prediction) => prediction,
        None => {
            let reference = Reference::new(context, problem, scene, config)?;
            reference.prediction(&cameras(&outcome.poses), &positions(&points))?
        }
    };
    let physical = context.physical();
    let record = PlanRecord {
        version: env!("CARGO_PKG_VERSION").into(),
        status: outcome.status,
        method: method.into(),
        surface: problem.target.record.clone(),
        device: physical.title(),
        seed: config.seed,
        config: configuration,
        region: problem.target.region,
        limits: problem.target.limits.clone(),
        cameras: cameras(&outcome.poses),
        kept: problem.kept.len(),
        history: outcome.history,
        checkpoints,
        metrics: aggregate(&scores),
        expected: Some(expected),
        began_from: None,
        connection: None,
        tour: None,
        elsewhere: scene.geometry.elsewhere(),
        baselines,
        seconds: outcome.seconds,
    };
    drop((scorer, few));
    Ok(Plan { record, points, scores, map, geometry: scene.geometry.clone() })
}

fn positions(points: &[SurfacePoint]) -> Vec<DVec3> {
    points.iter().map(|point| point.position).collect()
}

fn mark(profile: &mut Option<&mut Profile>, name: &str, start: Instant) {
    if let Some(profile) = profile {
        profile.host(name, start);
    }
}

/// Runs the planner of a preparation; again with more capacity where the binned pass needs it. `observe` receives the iterations
/// done and the total, and may stop the run.
///
/// # Errors
/// A plan that does not fit the device, or a device that fails.
pub fn optimise(
    context: &Arc<Context>,
    scene: &Arc<DeviceScene>,
    mut preparation: Preparation,
    mut profile: Option<&mut Profile>,
    mut observe: impl FnMut(u32, u32) -> ControlFlow<()>,
) -> Result<(Planner, Outcome)> {
    loop {
        let start = Instant::now();
        let planner = Planner::new(context, scene, preparation.clone())?;
        mark(&mut profile, "set-up", start);
        let start = Instant::now();
        let all = planner.settings().iterations;
        let outcome = planner.run(profile.as_deref_mut(), |done| observe(done, all));
        mark(&mut profile, "optimisation", start);
        let lost = matches!(outcome, Err(Error::DeviceLost { .. } | Error::Vulkan { .. }));
        match planner.overflow() {
            Some(needed) if !lost => match preparation.objective.with_capacity(needed) {
                Some(larger) => preparation = preparation.with_objective(context, larger),
                None => return Ok((planner, outcome?)),
            },
            _ => return Ok((planner, outcome?)),
        }
    }
}

/// Expected quality and held-out metrics of any camera set on a target, the last `kept` of which the simple layouts keep, too. Of
/// `config` count the preset, the seed, the viewers, the held-out points and the gate's shape.
///
/// # Errors
/// A region without free space, viewers without a place, or a device that fails.
pub fn score(
    context: &Arc<Context>,
    target: &Target,
    cameras: &[Camera],
    kept: usize,
    config: &Config,
) -> Result<(Expected, Metrics)> {
    let lens = middle_lens(cameras).ok_or_else(|| Error::request("there are no cameras to score"))?;
    let (planned, kept) = cameras.split_at(cameras.len() - kept.min(cameras.len() - 1));
    let lenses = planned.iter().map(|camera| camera.intrinsics).collect();
    let problem = Problem { lenses, viewers_lens: lens, ..Problem::new(target, lens, kept)? };
    let scene = problem.on(context)?;
    let config = &Config { views: (cameras.len() - kept.len()) as u32, ..config.clone() };
    let reference = Reference::new(context, &problem, &scene, config)?;
    let expected = reference.compare(&reference.expect_cameras(cameras)?);
    let points = problem.held_out(config)?;
    let field = if config.gate.pinhole() { Field::Frustum } else { Field::Cone };
    Ok((expected, aggregate(&Scorer::new(context, &scene, &points)?.score(cameras, field)?)))
}

/// Other ways to place as many cameras in the same region, in the user's world.
fn control_poses(scene: &DeviceScene, config: &Config) -> Vec<(&'static str, Vec<Pose>)> {
    let back = scene.geometry.to_internal.inverse();
    let world = |poses: Vec<Pose>| poses.iter().map(|pose| back.pose(pose)).collect::<Vec<_>>();
    let (count, inward) = (config.views as usize, config.preset == Preset::Object);
    let mut baselines = vec![("random", world(layouts::random(&scene.geometry.free, count, config.seed, inward)))];
    if let Ok(poses) = even_layout(&scene.geometry, &config.viewers, count, DQuat::IDENTITY) {
        baselines.push(("fibonacci", world(poses)));
    }
    baselines
}

/// Mean Voronoi cell area over the thirds of seen points with the lowest and the highest score; none where all scores
/// are equal.
fn voronoi_by_score(points: &[SurfacePoint], scores: &[PointMetrics]) -> [Option<f64>; 2] {
    let mut seen: Vec<(f32, f32)> = points
        .iter()
        .zip(scores)
        .filter(|(_, metrics)| metrics.views > 0 && metrics.reachable > 0.0)
        .map(|(point, metrics)| (point.score, metrics.voronoi_mean))
        .collect();
    seen.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (Some(first), Some(last)) = (seen.first(), seen.last()) else { return [None, None] };
    if first.0 == last.0 {
        return [None, None];
    }
    // Where more than a third shares the lowest (highest) score, all of these count.
    let third = seen.len() / 3;
    let (low, high) = (seen[third].0, seen[seen.len() - 1 - third].0);
    let mean = |keep: &dyn Fn(f32) -> bool| {
        let areas: Vec<f64> = seen.iter().filter(|(score, _)| keep(*score)).map(|(_, area)| *area as f64).collect();
        (!areas.is_empty()).then(|| areas.iter().sum::<f64>() / areas.len() as f64)
    };
    if low == high {
        return [mean(&|score| score < last.0), mean(&|score| score == last.0)];
    }
    [mean(&|score| score <= low), mean(&|score| score >= high)]
}

impl Plan {
    /// Puts the planned cameras in the order of a short tour that keeps the clearance, and names them by it. More than
    /// [`tour::MAX_PLACES`] stay as they are.
    pub fn sort_for_a_tour(&mut self) {
        let PlanRecord { cameras, kept, .. } = &mut self.record;
        let planned = cameras.len() - *kept;
        if planned > tour::MAX_PLACES {
            return;
        }
        let map = self.geometry.to_internal;
        let places: Vec<DVec3> = cameras[..planned].iter().map(|camera| map.point(camera.pose.position)).collect();
        let found = Tour::new(&self.geometry.free, &places);
        let sorted: Vec<(Pose, Intrinsics)> =
            found.order.iter().map(|i| (cameras[*i].pose, cameras[*i].intrinsics)).collect();
        cameras.iter_mut().zip(sorted).for_each(|(camera, sorted)| (camera.pose, camera.intrinsics) = sorted);
        let back = map.inverse();
        self.record.tour = Some(TourRecord {
            length: back.length(found.length()),
            path: found.path.iter().map(|corner| back.point(*corner)).collect(),
            blocked: found.blocked,
        });
    }

    /// Whether the user stopped the run.
    pub fn interrupted(&self) -> bool {
        self.record.status == Status::Interrupted
    }
}

//! A whole plan of a baseline: region, candidates, choice, metrics and baselines, from a surface to a record.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::DVec3;

use super::manifold;
use super::request::Request;
use crate::engine::vulkan::Context;
use crate::files::photos::{Photo, PhotoSet};
use crate::planner::methods::Method;
use crate::planner::plan::config::{Config, Preset};
use crate::planner::plan::job::{Placed, Plan, conclude};
use crate::planner::plan::preparation::PROBE_STREAM;
use crate::planner::plan::problem::Problem;
use crate::planner::plan::record::Status;
use crate::planner::plan::run::Outcome;
use crate::planner::plan::starts::even_layout;
use crate::planner::select::acp;
use crate::planner::select::farthest::Distance;
use crate::planner::select::information::{self, Model};
use crate::planner::select::pool::{MAX_SHARED, Pool};
use crate::planner::select::retrained::{self, Photograph};
use crate::planner::select::sight::{Sight, Survey};
use crate::scene::camera::{Camera, Pose};
use crate::scene::layouts;
use crate::scene::lens::Distortion;
use crate::scene::random;
use crate::visibility::device_scene::DeviceScene;
use crate::{Error, Result};

/// Stream that the candidates' seed is drawn from, so that they are not the random baseline.
const CANDIDATES: u32 = 0x5045_0000;
/// Points that shared points and coverage are counted on.
const POINTS: usize = 2000;

/// Places cameras as a baseline does, and scores them as a plan of ours. The record's seconds are those of the choice: candidates
/// are there before, and taking photographs does not count.
///
/// # Errors
/// A region without free space, a method that does not fit the scene, or a device that fails.
pub fn run(context: &Arc<Context>, problem: &Problem<'_>, request: &Request, model: Option<&Model>) -> Result<Plan> {
    if request.method.needs_photographs() {
        return Err(no_photographs(request.method));
    }
    let photograph = &mut |_: &Photo| Err(no_photographs(request.method));
    let outside = Outside { photograph, go_on: &mut || ControlFlow::Continue(()) };
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
pub struct Outside<'o> {
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
    request: &Request,
    model: Option<&Model>,
    outside: Outside<'_>,
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
    let timed = Outside { photograph: timed, go_on: outside.go_on };
    let poses = place(context, problem, &scene, &candidates, (request, model, timed))?;
    let seconds = start.elapsed().saturating_sub(behind_the_camera).as_secs_f64();
    let outcome = Outcome { poses, history: Vec::new(), snapshots: Vec::new(), status: Status::Complete, seconds };
    let Request { method, views, preset, seed, gate, held_out, .. } = *request;
    let viewers = request.viewers.clone();
    let config = Config { seed, gate, held_out, viewers, ..Config::new(preset, views) };
    let configuration =
        serde_json::to_value(request).map_err(|e| Error::request(format!("the request cannot be written: {e}")))?;
    let placed = Placed { method: method.name(), configuration, outcome, outlook: None };
    conclude(context, problem, &scene, &config, placed)
}

/// The cameras that are kept, and behind them poses at random in the region.
fn candidates(problem: &Problem<'_>, request: &Request) -> Vec<Photo> {
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

/// Poses of a method in the user's world, in the order in which they were chosen.
fn place(
    context: &Arc<Context>,
    problem: &Problem<'_>,
    scene: &DeviceScene,
    candidates: &PhotoSet,
    (request, model, outside): (&Request, Option<&Model>, Outside<'_>),
) -> Result<Vec<Pose>> {
    let (target, kept) = (problem.target, problem.kept);
    let (geometry, views) = (&scene.geometry, request.views as usize);
    let back = geometry.to_internal.inverse();
    let inward = request.preset == Preset::Object;
    let include: Vec<usize> = (0..kept.len()).collect();
    let allowed: Vec<usize> = (0..candidates.photos.len()).collect();
    let too_many = || {
        let what = "shared points are counted among up to";
        Error::request(format!(
            "`method` fvs-shared: {what} {MAX_SHARED} candidates; give fewer `candidates`, or use fvs"
        ))
    };
    if request.method == Method::FvsShared && candidates.photos.len() > MAX_SHARED {
        return Err(too_many());
    }
    let sight = match request.method {
        Method::FvsShared | Method::Coverage => {
            let points = target.proxy.sample(POINTS, request.seed, PROBE_STREAM);
            Survey::new(context, scene, &candidates.photos, points)?.sight
        }
        _ => Sight::empty(0, candidates.photos.len()),
    };
    let pool = Pool {
        set: candidates,
        region: &target.region,
        sight: &sight,
        include: &include,
        allowed: &allowed,
        count: kept.len() + views,
        seed: request.seed,
    };
    let farthest = |distance| pool.farthest(distance).ok_or_else(too_many);
    let settled = |pose: &Pose| back.pose(&Pose { position: geometry.settle(pose.position), ..*pose });
    let chosen = match request.method {
        // As the request has it, which was checked when it was made.
        Method::Ours
        | Method::Paper
        | Method::PaperNoVds
        | Method::PaperIterative
        | Method::OursTwoPasses
        | Method::Assigned
        | Method::Nearest => {
            let name = request.method.name();
            return Err(Error::request(format!("`method` {name}: it is no baseline that places cameras")));
        }
        Method::Random => {
            let poses = layouts::random(&geometry.free, views, request.seed, inward);
            return Ok(poses.iter().map(|pose| back.pose(pose)).collect());
        }
        Method::Fibonacci => {
            // Layouts differ by their rotation alone, so that each seed has its own.
            let turn = layouts::turn(&geometry.region, request.seed, 0);
            let all = even_layout(geometry, &request.viewers, views + kept.len(), turn)?;
            let taken: Vec<DVec3> =
                kept.iter().map(|camera| geometry.to_internal.point(camera.pose.position)).collect();
            let poses = layouts::left_beside(all, &taken);
            return Ok(poses.iter().map(settled).collect());
        }
        Method::Grid | Method::Rings => {
            if inward {
                let name = request.method.name();
                return Err(Error::request(format!(
                    "`method` {name}: it is of rooms; give `preset` room, or use fibonacci"
                )));
            }
            let layout = if request.method == Method::Grid { layouts::grid } else { layouts::rings };
            return Ok(layout(&geometry.free, views).iter().map(settled).collect());
        }
        Method::Fvs => farthest(Distance::GreatCircle)?,
        Method::FvsChord => farthest(Distance::Chord)?,
        Method::FvsShared => farthest(Distance::Shared)?,
        Method::Coverage => pool.coverage(),
        Method::Acp => {
            let settings = request.acp.unwrap_or_default();
            acp::choose(&pool, settings, settings.occlusion.then_some(geometry))?
        }
        Method::Manifold => {
            let missing = || Error::request("`method` manifold needs trained splats; give them with `model`");
            let settings = (request.manifold.unwrap_or_default(), request.seed);
            let model = model.ok_or_else(missing)?;
            let placed = manifold::place(context, problem, model, settings, views, outside.go_on)?;
            return Ok(placed.iter().map(|pose| settled(&geometry.to_internal.pose(pose))).collect());
        }
        Method::FisherRetrain => {
            let settings = request.retraining.unwrap_or_default();
            retrained::fisher(context, &pool, &target.proxy, settings, outside.photograph)?
        }
        method @ (Method::Fisher | Method::Cover) => {
            let what = "needs trained splats; give them with `model`";
            let missing = || Error::request(format!("`method` {} {what}", method.name()));
            let choose = if method == Method::Fisher { information::fisher } else { information::cover };
            choose(context, &pool, model.ok_or_else(missing)?, request.model_based.unwrap_or_default())?
        }
    };
    Ok(chosen[kept.len()..].iter().map(|photo| candidates.photos[*photo].camera.pose).collect())
}

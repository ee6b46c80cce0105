//! What a plan is measured against: the expected quality of simple layouts in the same region.

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::DVec3;

use super::config::{Config, Preset};
use super::expected_quality::links::Links;
use super::preparation::splat;
use super::problem::Problem;
use super::record::{Expected, Status};
use super::run::Outcome;
use super::start::tangents;
use super::{reachable, simple_layouts};
use crate::engine::vulkan::Context;
use crate::planner::quality::expected::{Expectation, Judge};
use crate::planner::quality::law::Fitted;
use crate::planner::quality::look::Surroundings;
use crate::planner::quality::map::{ErrorMap, error_map};
use crate::planner::quality::viewers::Viewers;
use crate::scene::camera::{Camera, Intrinsics, Pose};
use crate::visibility::device_scene::DeviceScene;
use crate::{Error, Result};

/// Viewers that layouts are judged by; none of the optimiser's is among them.
const VIEWERS: u32 = 512;
/// The first so many of these compare rotations of a layout; of fewer it is chance which of them comes out best.
const FEWER: usize = 128;
/// Key that separates them.
const JUDGE_SEED: u64 = 0x6a75_6467;

/// What is expected of a set of cameras, and where they leave error.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// In numbers.
    pub expected: Expected,
    /// On the surface, and what the worst viewers see.
    pub map: ErrorMap,
}

/// A simple layout and what is expected of it.
pub struct Layout {
    /// What it is called.
    pub name: String,
    /// Its poses in the planner's frame, kept cameras left out.
    pub poses: Vec<Pose>,
    /// What viewers are expected to see of it.
    pub expectation: Expectation,
}

/// Simple layouts of as many cameras as a plan has, judged by viewers that no optimiser saw.
pub struct Reference<'a> {
    judge: Judge<'a>,
    scene: &'a DeviceScene,
    around: Surroundings,
    law: Fitted,
    /// Of planned cameras; the last applies to all that follow.
    lenses: Vec<Intrinsics>,
    kept: Vec<Camera>,
    links: Option<Links>,
    /// At least one, as [`simple_layouts::layouts`] gives them.
    pub layouts: Vec<Layout>,
}

impl<'a> Reference<'a> {
    /// Judges the layouts of `config.views` cameras beside those kept.
    ///
    /// # Errors
    /// Viewers without a place, or a device that fails.
    pub fn new(context: &Arc<Context>, problem: &Problem<'_>, scene: &'a DeviceScene, config: &Config) -> Result<Self> {
        Self::observed(context, problem, scene, config, &mut || ControlFlow::Continue(()))
    }

    /// The same; `go_on` is asked between the layouts and may stop it.
    ///
    /// # Errors
    /// As there, and [`Error::Interrupted`] where it was stopped.
    pub fn observed(
        context: &Arc<Context>,
        problem: &Problem<'_>,
        scene: &'a DeviceScene,
        config: &Config,
        go_on: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Self> {
        let Problem { target, lens, viewers_lens, kept, .. } = problem;
        let inward = config.preset == Preset::Object;
        let seed = config.seed ^ JUDGE_SEED;
        let viewers = config.viewers.sample(&scene.geometry, *viewers_lens, inward, seed, VIEWERS)?;
        let fitted = config.law();
        let law = fitted.coefficients.on_device();
        let around = Surroundings::new(&scene.geometry, target.proxy.sphere, inward, &law);
        let judge = Judge::new(context, scene, around, viewers, &law, seed)?;
        let links = config.of_quality().and_then(|own| Links::of(own, &target.proxy, &scene.geometry, config.seed));
        let lenses = [&problem.lenses[..], &[*lens]].concat();
        let (mine, layouts) = (kept.to_vec(), Vec::new());
        let mut reference = Self { judge, scene, around, law: fitted, lenses, kept: mine, links, layouts };
        for (name, ways) in simple_layouts::layouts(config, &scene.geometry, kept) {
            let poses = reference.best_way(ways, go_on)?;
            Error::unless_stopped(go_on())?;
            let expectation = reference.expect(&poses)?;
            if expectation.viewers.iter().all(Option::is_none) {
                return Err(match config.viewers {
                    Viewers::Region => reachable::unseen(config.preset),
                    _ => Error::request(
                        "viewers: none of them has the surface in a sixteenth of its picture; give nearer ones (`viewers`), in its frame",
                    ),
                });
            }
            reference.layouts.push(Layout { name, poses, expectation });
        }
        Ok(reference)
    }

    /// Of some ways to place a layout the one of which fewer viewers expect most.
    fn best_way(&self, mut ways: Vec<Vec<Pose>>, go_on: &mut dyn FnMut() -> ControlFlow<()>) -> Result<Vec<Pose>> {
        let mut best = (f64::INFINITY, 0);
        if ways.len() > 1 {
            for (index, poses) in ways.iter().enumerate() {
                Error::unless_stopped(go_on())?;
                let error = self.judge.expect_of(FEWER, &self.cameras(poses))?.error_db;
                if error < best.0 {
                    best = (error, index);
                }
            }
        }
        Ok(ways.swap_remove(best.1))
    }

    /// The lenses of planned cameras, without an end.
    fn lenses(&self) -> impl Iterator<Item = Intrinsics> {
        (0..).map(|j: usize| self.lenses[j.min(self.lenses.len() - 1)])
    }

    /// Cameras at poses in the planner's frame, and those kept, in the user's world.
    fn cameras(&self, poses: &[Pose]) -> Vec<Camera> {
        let back = self.scene.geometry.to_internal.inverse();
        let planned = poses.iter().zip(self.lenses()).map(|(pose, intrinsics)| Camera {
            name: String::new(),
            pose: back.pose(pose),
            intrinsics,
        });
        planned.chain(self.kept.iter().cloned()).collect()
    }

    /// What is expected of poses in the planner's frame, beside the kept cameras.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn expect(&self, poses: &[Pose]) -> Result<Expectation> {
        self.judge.expect(&self.cameras(poses))
    }

    /// What is expected of cameras in the user's world, without those kept.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn expect_cameras(&self, cameras: &[Camera]) -> Result<Expectation> {
        self.judge.expect(cameras)
    }

    /// The layout of which most is expected.
    pub fn best(&self) -> &Layout {
        // `simple_layouts::layouts` always has cameras at random.
        best_of(self.layouts.iter()).expect("there is a simple layout in every region")
    }

    /// Where a run begins, in the planner's frame: with the layout of which most is expected, brought near kept cameras where it is to connect
    /// to these.
    pub fn start(&self) -> Vec<Pose> {
        let (geometry, poses) = (&self.scene.geometry, &self.best().poses);
        let Some(links) = &self.links else { return poses.clone() };
        let placed = |camera: &Camera| (geometry.to_internal.pose(&camera.pose), splat(camera, geometry));
        let kept: Vec<_> = self.kept.iter().map(placed).collect();
        let lenses: Vec<[f32; 2]> = self.lenses().take(poses.len()).map(|lens| tangents(&lens)).collect();
        links.begun(&geometry.bvh, &kept, &lenses, poses, |position| geometry.settle(position))
    }

    /// Sizes of the groups of cameras that connect, kept ones and `poses` in the planner's frame, the largest first; none where no
    /// camera has to.
    pub fn groups(&self, poses: &[Pose]) -> Option<Vec<usize>> {
        let links = self.links.as_ref()?;
        let geometry = &self.scene.geometry;
        let planned = &self.cameras(poses)[..poses.len()];
        let splats: Vec<_> = self.kept.iter().chain(planned).map(|camera| splat(camera, geometry)).collect();
        Some(links.groups(&geometry.bvh, &splats, self.kept.len()))
    }

    /// What is expected of a run. A complete run takes the poses of the best layout unless its own are expected to be better by
    /// the law's standard deviation for layouts that are alike, less where cameras are kept: smaller gains are not seen in
    /// trained splats, and no plan is to be worse than a layout that is simpler. Where cameras are to connect, a layout counts only if
    /// its own do, and takes the place of a run whose cameras do not.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn guard(&self, outcome: &mut Outcome) -> Result<Expectation> {
        let to_internal = &self.scene.geometry.to_internal;
        let planned: Vec<Pose> = outcome.poses.iter().map(|pose| to_internal.pose(pose)).collect();
        let expectation = self.expect(&planned)?;
        let whole = |poses: &[Pose]| self.groups(poses).is_none_or(|groups| groups.len() == 1);
        let connects = |layout: &&Layout| whole(&layout.poses);
        let Some(best) = best_of(self.layouts.iter().filter(connects)) else { return Ok(expectation) };
        // Cameras that both keep make neither better.
        let all = planned.len() + self.kept.len();
        let margin = self.law.spread(0.0) * planned.len() as f64 / all.max(1) as f64;
        let better = expectation.error_db + margin <= best.expectation.error_db && whole(&planned);
        if better || outcome.status != Status::Complete {
            return Ok(expectation);
        }
        outcome.poses = best.poses.iter().map(|pose| to_internal.inverse().pose(pose)).collect();
        // The last of the snapshots is the plan.
        if let Some((_, poses)) = outcome.snapshots.last_mut() {
            poses.clone_from(&outcome.poses);
        }
        Ok(best.expectation.clone())
    }

    /// What is expected of cameras in the user's world, those kept among them, and where it lies at these points.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn prediction(&self, cameras: &[Camera], points: &[DVec3]) -> Result<Prediction> {
        let law = self.law.coefficients.on_device();
        let (expectation, map) = error_map(&self.judge, &self.scene.geometry, self.around, &law, cameras, points)?;
        Ok(Prediction { expected: self.compare(&expectation), map })
    }

    /// An expectation against the best layout.
    pub fn compare(&self, expectation: &Expectation) -> Expected {
        let best = self.best();
        let db = best.expectation.error_db - expectation.error_db;
        let (sd, against) = (self.law.spread(db), best.name.clone());
        Expected { db, sd, unseen: expectation.unseen, against, reason: None }
    }
}

/// The layout of which most is expected.
fn best_of<'l>(layouts: impl Iterator<Item = &'l Layout>) -> Option<&'l Layout> {
    layouts.min_by(|a, b| a.expectation.error_db.total_cmp(&b.expectation.error_db))
}

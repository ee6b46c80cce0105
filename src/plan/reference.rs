//! What a plan is measured against: the expected quality of simple layouts in the same region.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::config::{Config, Preset};
use super::job::Target;
use super::planner::Outcome;
use super::record::Status;
use super::{probes, starts};
use crate::quality::expected::{Expectation, Judge};
use crate::quality::law::Law;
use crate::quality::look::Surroundings;
use crate::quality::viewers::Viewers;
use crate::scene::camera::{Camera, Intrinsics, Pose};
use crate::visibility::device_scene::DeviceScene;
use crate::vulkan::Context;
use crate::{Error, Result};

/// Viewers that layouts are judged by; none of them is one of the optimiser's.
const VIEWERS: u32 = 512;
/// What sets them apart.
const JUDGE_SEED: u64 = 0x6a75_6467;

/// Expected quality of a set of cameras, against the best simple layout of as many.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Expected {
    /// Decibels of PSNR of trained splats, the mean over viewers; positive is better than the layout it is measured against.
    pub db: f64,
    /// Standard deviation of that figure, as [`Law::spread`] has it.
    pub sd: f64,
    /// Share of what viewers look at that no camera sees.
    pub unseen: f64,
    /// The layout it is measured against.
    pub against: String,
}

impl Expected {
    /// In words, on one line.
    pub fn line(&self) -> String {
        format!(
            "{:+.2} dB (sd {:.2}) against {}; no camera sees {:.1}% of what viewers look at",
            self.db,
            self.sd,
            self.against,
            100.0 * self.unseen
        )
    }
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
    intrinsics: Intrinsics,
    kept: Vec<Camera>,
    /// At least one, as [`starts::layouts`] gives them.
    pub layouts: Vec<Layout>,
}

impl<'a> Reference<'a> {
    /// Judges the layouts of `config.views` cameras beside those kept.
    ///
    /// # Errors
    /// Viewers without a place, or a device that fails.
    pub fn new(
        context: &Arc<Context>,
        scene: &'a DeviceScene,
        target: &Target,
        (intrinsics, kept): (Intrinsics, &[Camera]),
        config: &Config,
    ) -> Result<Self> {
        let inward = config.preset == Preset::Object;
        let seed = config.seed ^ JUDGE_SEED;
        let viewers = config.viewers.sample(&scene.geometry, intrinsics, inward, seed, VIEWERS)?;
        let law = Law::embedded();
        let around = Surroundings::new(&scene.geometry, target.proxy.sphere, inward, &law);
        let judge = Judge::new(context, scene, around, viewers, &law, seed)?;
        let mut reference = Self { judge, scene, intrinsics, kept: kept.to_vec(), layouts: Vec::new() };
        for (name, poses) in starts::layouts(config, &scene.geometry) {
            let expectation = reference.expect(&poses)?;
            if expectation.viewers.iter().all(Option::is_none) {
                return Err(match config.viewers {
                    Viewers::Region => probes::unseen(config.preset),
                    _ => {
                        Error::request("viewers: none of them sees the surface; give others (--viewers), in its frame")
                    }
                });
            }
            reference.layouts.push(Layout { name, poses, expectation });
        }
        Ok(reference)
    }

    /// What is expected of poses in the planner's frame, beside the kept cameras.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn expect(&self, poses: &[Pose]) -> Result<Expectation> {
        let back = self.scene.geometry.to_internal.inverse();
        let planned =
            poses.iter().map(|pose| Camera { name: String::new(), pose: back.pose(pose), intrinsics: self.intrinsics });
        self.judge.expect(&planned.chain(self.kept.iter().cloned()).collect::<Vec<_>>())
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
        let error = |layout: &&Layout| layout.expectation.error_db;
        let best = self.layouts.iter().min_by(|a, b| error(a).total_cmp(&error(b)));
        // `starts::layouts` always has cameras at random.
        best.expect("there is a simple layout in every region")
    }

    /// What is expected of a run, which takes the poses of the best layout where these are better and it was not broken off: no
    /// plan is worse than a layout that is simpler.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn guard(&self, outcome: &mut Outcome) -> Result<Expectation> {
        let to_internal = &self.scene.geometry.to_internal;
        let planned: Vec<Pose> = outcome.poses.iter().map(|pose| to_internal.pose(pose)).collect();
        let (expectation, best) = (self.expect(&planned)?, self.best());
        if expectation.error_db <= best.expectation.error_db || outcome.status != Status::Complete {
            return Ok(expectation);
        }
        outcome.poses = best.poses.iter().map(|pose| to_internal.inverse().pose(pose)).collect();
        // The last of the snapshots is the plan.
        if let Some((_, poses)) = outcome.snapshots.last_mut() {
            poses.clone_from(&outcome.poses);
        }
        Ok(best.expectation.clone())
    }

    /// An expectation against the best layout.
    pub fn compare(&self, expectation: &Expectation) -> Expected {
        let best = self.best();
        let law = Law::embedded();
        let db = law.decibels(best.expectation.error_db - expectation.error_db);
        Expected { db, sd: law.spread(db), unseen: expectation.unseen, against: best.name.clone() }
    }
}

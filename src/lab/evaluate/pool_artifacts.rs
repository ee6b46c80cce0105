//! The artifacts of a pool, each made once: the surface, where the capture has none, choices among its photos, trained splats.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::artifact::{Artifact, Observe};
use super::competitor::Competitor;
use super::kind::Kind;
use super::pool::Pool;
use super::request::{EvaluationRequest, Run};
use super::settings::EvaluationSettings;
use super::training::{self, Training};
use crate::engine::vulkan::Context;
use crate::files::io;
use crate::files::photos::{Photo, PhotoSet};
use crate::photogrammetry::stereo;
use crate::planner::plan::config::Preset;
use crate::planner::plan::target::{RegionChoice, Target};
use crate::planner::select::farthest::Distance;
use crate::planner::select::pool;
use crate::planner::select::request::SelectionRequest as Choice;
use crate::planner::select::selection::{self as select, SelectionContext};
use crate::planner::select::sight::Sight;
use crate::scene::camera::{Camera, Pose, common_up};
use crate::scene::region::Shape;
use crate::scene::surface::Surface;
use crate::splats::config::{Start, Strategy, TrainConfig};
use crate::splats::data::split::Split;
use crate::splats::run::record::TrainRecord;
use crate::{Error, Result};

/// Seed of the surface, and of the photos that a model is trained on to choose by: both are the same in all runs.
const SEED: u64 = 1;
/// Files of the artifacts.
const SURFACE: &str = "surface.ply";
const CHOSEN: &str = "chosen.json";

/// Photos that a method chose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Chosen {
    /// Their names, in order.
    pub photos: Vec<String>,
    /// Seconds that planning and choosing took; what each photo sees of the surface is known before.
    pub seconds: f64,
}

/// A pool with its artifacts.
pub(crate) struct PoolArtifacts<'a> {
    context: Arc<Context>,
    root: PathBuf,
    settings: EvaluationSettings,
    pool: &'a Pool,
    target: Target,
    /// The surface's name among the inputs of others.
    surface: String,
}

impl<'a> PoolArtifacts<'a> {
    /// Finds the surface of a pool, whose artifacts lie below `root`: the capture's own points, as `camsplat select` takes them,
    /// or else what `camsplat proxy` makes of the candidates.
    ///
    /// # Errors
    /// Where there is no surface, or the device fails.
    pub fn new(
        context: &Arc<Context>,
        root: &Path,
        request: &EvaluationRequest,
        pool: &'a Pool,
        observe: Observe,
    ) -> Result<Self> {
        let set = &pool.candidates;
        let (surface, key) = if set.points.positions.is_empty() {
            let artifact = Artifact::new(root, "surface", json!({ "pool": pool.checksum, "seed": SEED }));
            if artifact.begins(observe)? {
                let options = stereo::StereoOptions { seed: SEED, ..stereo::StereoOptions::default() };
                let found = stereo::reconstruct(context, set, &options).map_err(|error| match error {
                    Error::Request(what) => Error::input(pool.path(), what),
                    other => other,
                })?;
                artifact.write(SURFACE, &io::ply::write::surface_points(&found.points))?;
                artifact.finish()?;
            }
            let surface =
                io::read_surface(&artifact.file(SURFACE)).map_err(|error| artifact.damaged(&error.to_string()))?;
            (surface, artifact.key().to_owned())
        } else {
            (Surface::Points(set.points.clone()), "points of the capture".to_owned())
        };
        let poses: Vec<Pose> = set.photos.iter().map(|photo| photo.camera.pose).collect();
        let choice = RegionChoice { shape: Shape::around_cameras(&poses), ..RegionChoice::default() };
        let up = common_up(&poses).unwrap_or(DVec3::Z);
        let path = pool.path().to_string_lossy().into_owned();
        let intrinsics = set.photos[0].camera.intrinsics;
        let target = Target::new(&surface, &path, Preset::Object, &choice, up, &intrinsics)?;
        let (context, root) = (context.clone(), root.to_owned());
        Ok(Self { context, root, settings: request.settings, pool, target, surface: key })
    }

    /// Splats trained on a few candidates far from each other, for the methods that choose by a model.
    ///
    /// # Errors
    /// As [`PoolArtifacts::training`].
    pub fn model(&self, observe: Observe) -> Result<Artifact> {
        let set = &self.pool.candidates;
        let all: Vec<usize> = (0..set.photos.len()).collect();
        let count = self.settings.inputs as usize;
        let sight = Sight::empty(0, all.len());
        let (region, allowed) = (&self.target.region, &all[..]);
        let spread = pool::Pool { set, region, sight: &sight, include: &[], allowed, count, seed: SEED };
        // Only shared points can be too many to count.
        let chosen = spread.farthest(Distance::Chord);
        let mut names: Vec<String> = chosen.iter().map(|photo| set.photos[*photo].camera.name.clone()).collect();
        names.sort_unstable();
        Ok(self.trained(&names, Vec::new(), 0, observe)?.0)
    }

    /// Cameras of chosen photos.
    pub fn cameras(&self, chosen: &Chosen) -> Vec<Camera> {
        let photos = self.pool.candidates.photos.iter();
        let of_these = photos.filter(|photo| chosen.photos.contains(&photo.camera.name));
        of_these.map(|photo| photo.camera.clone()).collect()
    }

    /// Lets a method choose photos.
    ///
    /// # Errors
    /// Where the method cannot, or the device fails.
    pub fn choice(
        &self,
        Run { method, views, seed, .. }: Run<'_>,
        model: Option<&Artifact>,
        observe: Observe,
    ) -> Result<Chosen> {
        method.check(Kind::Pool)?;
        let Competitor::Method(chooser) = *method else {
            return Err(Error::request(format!("{method} chooses no photos")));
        };
        let request = Choice { method: chooser, seed, ..Choice::new(views as usize) };
        let inputs = json!({
            "pool": self.pool.checksum, "surface": self.surface, "model": model.map(Artifact::key), "request": request,
            "shrink": self.settings.shrink, "device": self.context.physical().name,
        });
        let artifact = Artifact::new(&self.root, "choice", inputs);
        if !artifact.begins(observe)? {
            return artifact.read(CHOSEN);
        }
        // As they are trained on: what a model measures of a photo depends on its pixels, as does the time it takes.
        let mut set = self.pool.candidates.clone();
        for photo in &mut set.photos {
            photo.camera.intrinsics = photo.camera.intrinsics.shrunk(self.settings.shrink);
        }
        let model = model.map(training::model).transpose()?;
        let selector = SelectionContext::new(&self.context, &set, &self.target, request)?.with_model(model);
        let selection = selector.select(None, false)?;
        let name = |chosen: &select::Chosen| set.photos[chosen.photo].camera.name.clone();
        let [_, planning, choosing] = selection.seconds;
        let chosen = Chosen { photos: selection.chosen.iter().map(name).collect(), seconds: planning + choosing };
        artifact.write_json(CHOSEN, &chosen)?;
        artifact.finish()?;
        Ok(chosen)
    }

    /// Trains splats on chosen photos alone, from the points that these see, and evaluates those held out.
    ///
    /// # Errors
    /// Where photos cannot be read any more, or the device fails or has not enough memory.
    pub fn training(&self, chosen: &Chosen, seed: u64, observe: Observe) -> Result<(Artifact, TrainRecord)> {
        self.trained(&chosen.photos, self.pool.held_out.clone(), seed, observe)
    }

    fn trained(
        &self,
        names: &[String],
        test: Vec<Photo>,
        seed: u64,
        observe: Observe,
    ) -> Result<(Artifact, TrainRecord)> {
        let EvaluationSettings { iterations, max_splats, shrink, antialiased, .. } = self.settings;
        let kept: HashSet<&str> = names.iter().map(String::as_str).collect();
        let of_these = |photo: &Photo| kept.contains(photo.camera.name.as_str());
        let train: PhotoSet = self.pool.candidates.clone().filtered(of_these).with_points_seen();
        let start = Start::of(&train);
        let split = Split { train, test, notes: Vec::new() };
        let config = TrainConfig {
            background: split.usual_background(),
            antialiased,
            seed,
            ..TrainConfig::new(iterations, max_splats).with_strategy(Strategy::Mcmc, start)
        };
        let inputs = json!({
            "pool": self.pool.checksum, "photos": names, "tests": split.test.len(), "config": config, "shrink": shrink,
        });
        let artifact = Artifact::new(&self.root, "training", inputs);
        let capture = self.pool.path().to_string_lossy().into_owned();
        training::run(&self.context, artifact, Training { capture, config, shrink }, || Ok(split), observe)
    }
}

//! The views that a competitor chooses.

use std::sync::Mutex;

use serde_json::json;

use super::artifact::{Artifact, ArtifactEvent, Observe};
use super::baseline::sized;
use super::competitor::Competitor;
use super::given::Given;
use super::kind::Kind;
use super::passes;
use super::request::Run;
use super::scene_artifacts::{MethodInputs, SceneArtifacts};
use super::settings::{BaselinesFrom, Space};
use super::training;
use crate::engine::parallel::lock;
use crate::lab::baselines;
use crate::lab::baselines::placing::Callbacks;
use crate::planner::methods::Method;
use crate::planner::plan;
use crate::planner::plan::config::Config;
use crate::planner::plan::pipeline::Tools;
use crate::planner::plan::problem::Problem;
use crate::planner::plan::record::PlanRecord;
use crate::{Error, Result};

/// Held-out points of a plan's metrics, which are not what is evaluated here.
const HELD_OUT: u32 = 200;

const PLAN: &str = "plan.json";

impl SceneArtifacts<'_> {
    /// Lets a method choose views.
    ///
    /// # Errors
    /// Where the method cannot, or the device fails.
    pub fn choice(
        &self,
        Run { method, views, seed, .. }: Run<'_>,
        given: MethodInputs<'_>,
        model: Option<&Artifact>,
        observe: Observe,
    ) -> Result<PlanRecord> {
        let config = Config {
            held_out: HELD_OUT,
            viewers: self.viewers.clone(),
            ..method.config(self.kind.preset(), views, seed)?
        };
        let lens = method.lens(self.intrinsics());
        let method = method.chooser();
        let baseline = match method {
            Competitor::Method(placing) if placing.planner(&config).is_none() => Some(sized(
                baselines::request::BaselineRequest::new(*placing, None, &config)?,
                self.kind,
                &self.settings,
            )),
            _ => None,
        };
        let region = match (baseline.is_some(), self.settings.baselines_from, self.kind) {
            (true, BaselinesFrom::Sphere, Kind::Object) => self.scene.region.outermost(),
            _ => self.scene.region,
        };
        let device = &self.context.physical().name;
        let kept = self.scene.kept(self.intrinsics(), views, seed)?;
        let limits = &self.scene.limits;
        let cameras = |layout: &Given| layout.cameras(&self.scene.name, views, seed, self.settings.size);
        let photographs = matches!(method, Competitor::Method(placing) if placing.needs_photographs());
        let mut made_of = match method {
            // Independent of their names and, where the files are, of the seed.
            Competitor::Cameras(layout) => json!({
                "surface": given.shown.key(), "given": cameras(layout).0, "region": region, "camera": lens, "device": device,
                "limits": limits, "viewers": config.viewers, "kept": kept,
            }),
            _ => json!({
                "surface": given.shown.key(), "model": model.map(Artifact::key), "method": method, "config": config, "baseline": baseline,
                "region": region, "camera": lens, "device": device, "limits": limits, "kept": kept,
                "samples": photographs.then_some(self.settings.samples),
            }),
        };
        if let Competitor::Cameras(layout) = method
            && let (_, lenses) = cameras(layout)
            && !lenses.is_empty()
        {
            made_of["lenses"] = json!(lenses);
        }
        if lens != self.intrinsics() {
            made_of["viewers_lens"] = json!(self.intrinsics());
        }
        if self.settings.space == Space::Known {
            made_of["space"] = json!(self.settings.space);
        }
        let artifact = self.artifact("choice", made_of);
        if !artifact.begins(observe)? {
            return artifact.read(PLAN);
        }
        let scored = baseline.is_none() && config.of_paper().is_some();
        let target = self.target(given, &region, scored)?;
        let problem = Problem { lens, ..Problem::new(&target, self.intrinsics(), &kept)? };
        let plan = match (baseline, method) {
            (Some(request), _) => {
                let model = model.map(training::model).transpose()?;
                let observe = Mutex::new(observe);
                let observe = |event: ArtifactEvent<'_>| lock(&observe)(event);
                let outside = Callbacks {
                    photograph: &mut |photo| self.photograph(artifact.folder(), photo, &mut |event| observe(event)),
                    go_on: &mut || observe(ArtifactEvent::Working),
                };
                baselines::placing::photographing(&self.context, &problem, &request, model.as_ref(), outside)?
            }
            (None, Competitor::Cameras(layout)) => {
                let config = Config { seed: 0, ..config };
                let (poses, lenses) = cameras(layout);
                let problem = Problem { lenses, ..problem };
                plan::pipeline::given(&self.context, &problem, poses, method.name(), &config)?
            }
            (None, Competitor::Method(Method::OursTwoPasses)) => {
                passes::run(self, given, (lens, &kept), &config, &mut *observe)?
            }
            (None, _) => plan::pipeline::run(&self.context, &problem, config, Tools::default(), |_| {
                observe(ArtifactEvent::Working)
            })?,
        };
        if plan.interrupted() {
            return Err(Error::Interrupted);
        }
        artifact.write_json(PLAN, &plan.record)?;
        artifact.finish()?;
        Ok(plan.record)
    }
}

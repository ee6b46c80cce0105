//! The demo pipeline: cameras planned for a room, and as many at random and on a grid at eye height; photographs from all of
//! them, splats trained on these, and what held-out test views show.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use super::artifact::{Artifact, ArtifactEvent};
use super::competitor::Competitor;
use super::kind::Kind;
use super::request::EvaluationRequest;
use super::results::{self, Entry, Outcome};
use super::scene::{Scene, Setting};
use super::scene_artifacts::SceneArtifacts;
use super::settings::{EvaluationSettings, Shown};
use super::situation::Situation;
use crate::engine::vulkan::Context;
use crate::lab::baselines;
use crate::lab::baselines::request::BaselineRequest as Baseline;
use crate::lab::path_tracer::lightmap::Light;
use crate::lab::path_tracer::outputs::named;
use crate::planner::methods::Method;
use crate::planner::plan;
use crate::planner::plan::config::Preset;
use crate::planner::plan::pipeline::{Plan, Tools};
use crate::planner::plan::problem::Problem;
use crate::planner::plan::target::Target;
use crate::planner::quality::viewers::Viewers;
use crate::scene::camera::Camera;
use crate::scene::samples::textured::two_rooms_model;
use crate::{Error, Result};

/// The methods that place cameras, ours first.
pub const METHODS: [Method; 3] = [Method::Ours, Method::Random, Method::Grid];

/// The places of a method's cameras, in words.
pub fn title(method: Method) -> &'static str {
    match method {
        Method::Ours => "planned places",
        Method::Grid => "a grid at eye height",
        _ => "random places",
    }
}

/// How large everything is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    /// Pictures, tests and training.
    pub settings: EvaluationSettings,
    /// Views of each method.
    pub views: u32,
    /// Seed of choices and training.
    pub seed: u64,
}

impl Size {
    /// What two cores do in a minute and a half. Rooms are photographed with a wide lens.
    pub const DEMO: Self = Self {
        settings: EvaluationSettings {
            size: 128,
            fov_deg: 75.0,
            light: Light::Baked,
            samples: 2,
            test_samples: 4,
            tests: 12,
            iterations: 200,
            max_splats: 40_000,
            degree: 0,
            shown: Shown::True,
            ..EvaluationSettings::QUICK
        },
        views: 30,
        seed: 0,
    };

    /// The scene that is photographed: two rooms of our own, under a name.
    ///
    /// # Errors
    /// Where its limits leave no place for cameras.
    pub fn scene(&self, name: &str) -> Result<Scene> {
        let model = two_rooms_model();
        let surface = model.surface();
        let setting = Setting { preset: Preset::Room, situation: Situation::TwoRooms, ..Setting::default() };
        Scene::new(Path::new(name), &setting, (model, None), surface, &self.settings.intrinsics())
    }
}

/// The step.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// In a word.
    pub name: &'static str,
    /// Its result.
    pub what: String,
    /// Its duration.
    pub seconds: f64,
}

/// Progress events.
pub enum DemoEvent<'e> {
    /// A step is done.
    Done(&'e Step),
    /// A step is in progress.
    Working,
}

/// Receives progress events and returns whether to continue.
pub(crate) type Observe<'o> = &'o mut (dyn FnMut(DemoEvent<'_>) -> ControlFlow<()> + Send);

/// The result of the demo.
pub struct Demo {
    /// The scene's name, and that of the folder of its artifacts.
    pub name: String,
    /// The steps in their order.
    pub steps: Vec<Step>,
    /// What was planned for.
    pub target: Target,
    /// The plan.
    pub plan: Plan,
    /// Photographs from the cameras of each of [`METHODS`], as files in the scene's folder.
    pub photos: Vec<Vec<String>>,
    /// The splats trained on them, with their tests.
    pub outcome: Outcome,
    /// PSNR of each of [`METHODS`] in each test view, ordered as the pictures of an entry.
    pub psnr: Vec<Vec<f64>>,
}

impl Demo {
    /// The result in a sentence.
    pub fn sentence(&self) -> String {
        let views = self.plan.record.cameras.len();
        // PSNR on the only test set.
        let psnr =
            |index: usize| self.outcome.entries.get(index).and_then(|entry| entry.quality.first()).map(|q| q.psnr);
        match (psnr(0), psnr(1), psnr(2)) {
            (Some(ours), Some(random), Some(grid)) => format!(
                "The model of {views} photos from planned places shows them with {ours:.1} dB: {} than that of as many photos from random \
                 places, and {} than that of a grid at eye height.",
                beside(ours - random),
                beside(ours - grid)
            ),
            _ => String::from("Not everything was trained."),
        }
    }
}

/// A difference in decibels.
fn beside(db: f64) -> String {
    format!("{:.1} dB {}", db.abs(), if db < 0.0 { "worse" } else { "better" })
}

/// Runs the pipeline in a room; artifacts lie in the scene's folder below `folder`, and those that are there are taken as they are.
///
/// # Errors
/// Where a step fails, or `observe` stopped it; what is finished stays, and the same call continues from there.
pub fn run(context: &Arc<Context>, folder: &Path, size: Size, scene: &Scene, observe: Observe) -> Result<Demo> {
    let Size { settings, views, seed } = size;
    let (name, kind) = (scene.name.clone(), Kind::Room);
    let intrinsics = settings.intrinsics();
    let request = EvaluationRequest {
        kind,
        methods: METHODS.map(Competitor::Method).to_vec(),
        budgets: vec![views],
        seeds: 1,
        first_seed: seed as u32,
        settings,
        viewers: Viewers::Region,
        situation: scene.situation,
        limits: scene.limits.clone(),
    };
    let tests = scene.tests(intrinsics, settings.tests, request.test_viewers())?;
    let mut walk = Walk { observe, begun: Instant::now(), kept: false, steps: Vec::new() };
    let artifacts =
        SceneArtifacts::new(context, &folder.join(&name), &request, scene, &mut |event| walk.observe(&event))?;
    walk.done("light", String::from("the rooms are lit, once for all photos"));
    let target = artifacts.target_of(&scene.surface, &scene.region)?;
    let config = Competitor::Method(Method::Ours).config(kind.preset(), views, seed)?;

    let tools = Tools::default();
    let problem = Problem::new(&target, intrinsics, &[])?;
    let mut plan = plan::pipeline::run(context, &problem, config.clone(), tools, |_| walk.work())?;
    if plan.interrupted() {
        return Err(Error::Interrupted);
    }
    plan.sort_for_a_tour();
    let expected = plan.record.expected.as_ref().map(|expected| format!("; expected {}", expected.line()));
    walk.done("plan", format!("where to take {views} photos{}", expected.unwrap_or_default()));

    let tests = artifacts.test_photographs(&tests, &mut |event| walk.observe(&event))?;
    walk.done("tests", format!("{} photos of held-out views, which no method knows", settings.tests));

    let (mut entries, mut photos, mut psnr) = (Vec::new(), Vec::new(), Vec::new());
    for placing in METHODS {
        let other = match placing {
            Method::Ours => None,
            _ => {
                let baseline = Baseline::new(placing, None, &config)?;
                Some(baselines::placing::run(context, &problem, &baseline, None)?)
            }
        };
        let record = &other.as_ref().unwrap_or(&plan).record;
        let of = title(placing);
        let artifact = artifacts.photographs(&record.cameras, &mut |event| walk.observe(&event))?;
        walk.done("photos", format!("{views} taken from {of}"));
        let (trained, training) =
            artifacts.training(&artifact, Some(&tests), seed, &mut |event| walk.observe(&event))?;
        walk.done(
            "training",
            format!("a 3D model of {} splats from these photos, and its pictures of the tests", training.splats),
        );
        let (pictures, of_pictures) = results::pictures(&training).into_iter().unzip();
        psnr.push(of_pictures);
        entries.push(Entry {
            scene: name.clone(),
            method: Competitor::Method(placing),
            views,
            seed,
            seconds: Some(record.seconds),
            outside: 0,
            quality: results::by_set(&training, kind.sets()),
            diverged: training.diverged(),
            folder: trained.key().to_owned(),
            pictures,
            cameras: record.cameras.clone(),
        });
        photos.push(files(&artifact, &record.cameras)?);
    }
    let outcome = Outcome::new(kind, entries, METHODS.len());
    Ok(Demo { steps: walk.steps, name, target, plan, photos, outcome, psnr })
}

/// Steps, reported as they are done.
struct Walk<'o> {
    observe: Observe<'o>,
    begun: Instant,
    /// Whether the step's artifact existed.
    kept: bool,
    steps: Vec<Step>,
}

impl Walk<'_> {
    fn observe(&mut self, event: &ArtifactEvent<'_>) -> ControlFlow<()> {
        match event {
            ArtifactEvent::Begins(_) => self.kept = false,
            ArtifactEvent::Kept => self.kept = true,
            ArtifactEvent::Working | ArtifactEvent::Note(_) => {}
        }
        self.work()
    }

    fn work(&mut self) -> ControlFlow<()> {
        (self.observe)(DemoEvent::Working)
    }

    fn done(&mut self, name: &'static str, mut what: String) {
        if self.kept {
            what += ", there from an earlier run";
        }
        let step = Step { name, what, seconds: self.begun.elapsed().as_secs_f64() };
        // A stop requested here takes effect within the next step.
        let _ = (self.observe)(DemoEvent::Done(&step));
        self.steps.push(step);
        (self.begun, self.kept) = (Instant::now(), false);
    }
}

/// The photographs of cameras.
fn files(artifact: &Artifact, cameras: &[Camera]) -> Result<Vec<String>> {
    let file = |camera: &Camera| format!("{}/images/{}", artifact.key(), camera.name);
    Ok(named(cameras)?.iter().map(file).collect())
}

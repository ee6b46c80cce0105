//! What evaluations have trained, read back for the law of expected error to be fitted to.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;

use super::given::files_of;
use super::kind::Kind;
use super::scene::Setting;
use super::situation::Situation;
use crate::engine::vulkan::Context;
use crate::files::io;
use crate::files::io::gltf::read_model;
use crate::lab::path_tracer::outputs::RECORD as CAPTURED;
use crate::lab::quality_fit::Observations;
use crate::planner::plan::config::Preset;
use crate::planner::plan::target::{RegionChoice, Target};
use crate::planner::quality::expected::Judge;
use crate::planner::quality::law::Law;
use crate::planner::quality::look::Surroundings;
use crate::planner::quality::viewers::Viewers;
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::limits::Limits;
use crate::splats::run::outputs::RECORD as TRAINED;
use crate::splats::run::record::TestView;
use crate::visibility::device_scene::{DeviceScene, SceneGeometry};
use crate::{Error, Result};

/// Viewers that [`Trained::scored`] judges by, and their seed.
const VIEWERS: u32 = 512;
const SEED: u64 = 0;

/// The part of `results.json` that is needed here.
#[derive(Deserialize)]
struct Results {
    request: Asked,
    runs: Vec<Run>,
}

#[derive(Clone, PartialEq, Deserialize)]
struct Asked {
    kind: Kind,
    settings: LayoutSettings,
    #[serde(default)]
    viewers: Viewers,
    #[serde(default)]
    situation: Situation,
    #[serde(default)]
    limits: Limits,
}

#[derive(Clone, Copy, PartialEq, Deserialize)]
struct LayoutSettings {
    region: RegionChoice,
}

#[derive(Deserialize)]
struct Run {
    scene: String,
    method: String,
    seed: u64,
    folder: String,
}

/// The part of a training's `done.json` that is needed here.
#[derive(Deserialize)]
struct Done {
    inputs: Inputs,
}

#[derive(Deserialize)]
struct Inputs {
    photos: String,
    tests: Option<String>,
}

/// The part of a training's record that is needed here.
#[derive(Deserialize)]
struct Tested {
    test_views: Vec<TestView>,
}

/// The part of a capture's record that is needed here.
#[derive(Deserialize)]
struct Captured {
    cameras: Vec<Camera>,
}

/// Name, cameras and PSNR by test view of each.
type Runs = Vec<(String, Vec<Camera>, Vec<f64>)>;

/// The trainings of one scene in one situation.
pub struct Trained {
    /// The scene's name.
    pub name: String,
    /// Its situation.
    pub situation: Situation,
    target: Target,
    geometry: SceneGeometry,
    preset: Preset,
    viewers: Viewers,
    tests: Vec<Camera>,
    runs: Runs,
}

impl Trained {
    /// Reads every run of the scene in these folders of evaluations: one for each region, situation, limits, viewers and tests that they
    /// have. Rooms without a file are the scene that [`Situation::name`] says, such as `two-rooms`.
    ///
    /// # Errors
    /// Where a folder holds no evaluation, none of them has this scene, or a file cannot be read.
    pub fn read(scene: &Path, evaluations: &[PathBuf]) -> Result<Vec<Self>> {
        let name = scene.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let mut settings: Vec<(Asked, Vec<Camera>, Runs)> = Vec::new();
        for folder in evaluations {
            let file = folder.join("results.json");
            let Results { request, runs: all } = read(&file)?;
            if request.kind == Kind::Pool {
                return Err(Error::input(&file, "this evaluation is of photos; the law is fitted to scenes"));
            }
            for run in all.iter().filter(|run| run.scene == name) {
                let (tests, cameras, psnr) = trained(&folder.join(&name), &run.folder)?;
                let run = (format!("{}, seed {}", label(&run.method), run.seed), cameras, psnr);
                match settings.iter_mut().find(|(asked, of, _)| *asked == request && *of == tests) {
                    Some((.., runs)) => runs.push(run),
                    None => settings.push((request.clone(), tests, vec![run])),
                }
            }
        }
        if settings.is_empty() {
            return Err(Error::input(
                scene,
                "none of the evaluations has trained anything of it; leave it out or name its evaluation",
            ));
        }
        settings.into_iter().map(|setting| Self::of(scene, &name, setting)).collect()
    }

    fn of(scene: &Path, name: &str, (asked, tests, runs): (Asked, Vec<Camera>, Runs)) -> Result<Self> {
        let intrinsics = tests.first().map_or(Intrinsics::from_fov(1, 1, 1.0), |test| test.intrinsics);
        let Asked { kind, settings: LayoutSettings { region }, viewers, situation, limits } = asked;
        let preset = kind.preset();
        let setting = Setting { preset, choice: region, situation, limits };
        let (mut model, mut surface) = match situation.rooms() {
            Some(model) => {
                let surface = model.surface();
                (model, surface)
            }
            None => (read_model(scene, &mut Vec::new())?, io::read_surface(scene)?),
        };
        let target = setting.target(scene, &mut model, &mut surface, &intrinsics)?;
        let geometry = target.geometry()?;
        Ok(Self { name: name.to_owned(), situation, target, geometry, preset, viewers, tests, runs })
    }

    /// What the law is fitted to.
    pub fn observations(&self) -> Observations {
        // Looks beside an object are recorded for any law; their weight is fitted.
        let around = self.surroundings(&Law { background: 1.0, ..Law::default() });
        Observations::new(&self.name, &self.geometry, around, &self.tests, &self.runs)
    }

    /// Expected quality of each run in decibels, as `camsplat score` judges it: by viewers of its own, not by the tests.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn scored(self, context: &Arc<Context>, law: &Law) -> Result<Vec<f64>> {
        let (around, inward) = (self.surroundings(law), self.preset == Preset::Object);
        let intrinsics = self.tests[0].intrinsics;
        let viewers = self.viewers.sample(&self.geometry, intrinsics, inward, SEED, VIEWERS)?;
        let scene = DeviceScene::new(context, self.geometry)?;
        let judge = Judge::new(context, &scene, around, viewers, law, SEED)?;
        self.runs.iter().map(|(_, cameras, _)| Ok(-judge.expect(cameras)?.error_db)).collect()
    }

    fn surroundings(&self, law: &Law) -> Surroundings {
        Surroundings::new(&self.geometry, self.target.proxy.sphere, self.preset == Preset::Object, law)
    }
}

/// A layout's name: for a file of cameras its own name.
fn label(method: &str) -> &str {
    match files_of(method) {
        Some(file) => Path::new(file).file_stem().and_then(|stem| stem.to_str()).unwrap_or(file),
        None => method,
    }
}

/// Test cameras that were evaluated, cameras and PSNR by test camera of a training.
fn trained(root: &Path, key: &str) -> Result<(Vec<Camera>, Vec<Camera>, Vec<f64>)> {
    let folder = root.join(key);
    let done: Done = read(&folder.join("done.json"))?;
    let record: Tested = read(&folder.join(TRAINED))?;
    let Some(tests) = done.inputs.tests else {
        return Err(Error::input(&folder, "this training has no test views; fit runs of camsplat evaluate"));
    };
    let cameras = |key: &str| read::<Captured>(&root.join(key).join(CAPTURED)).map(|record| record.cameras);
    if record.test_views.is_empty() || !record.test_views.iter().all(|view| view.quality.psnr.is_finite()) {
        return Err(Error::input(
            &folder,
            "a test view has no finite PSNR; remove the folder and run the evaluation again",
        ));
    }
    let of_view = |test: Camera| {
        let view = record.test_views.iter().find(|view| view.name == test.name)?;
        Some((test, view.quality.psnr))
    };
    let (tests, psnr): (Vec<Camera>, Vec<f64>) = cameras(&tests)?.into_iter().filter_map(of_view).unzip();
    if tests.len() != record.test_views.len() {
        return Err(Error::input(
            &folder,
            "its test views are not those of its capture; remove the folder and run the evaluation again",
        ));
    }
    Ok((tests, cameras(&done.inputs.photos)?, psnr))
}

fn read<T: for<'de> Deserialize<'de>>(file: &Path) -> Result<T> {
    let text = fs::read(file).map_err(|source| io::unreadable(file, source))?;
    serde_json::from_slice(&text).map_err(|e| Error::input(file, format!("no file of a complete evaluation: {e}")))
}

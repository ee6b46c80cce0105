//! The products of one scene, each made once: photographs, the surface that methods are shown, choices, trained splats.
//!
//! Every stage answers none where `observe` broke it off. What is finished stays, and the next run goes on from there.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::{Value, json};

use super::peer::sized;
use super::request::{Method, Settings, Shown};
use super::stage::Stage;
use super::subject::Subject;
use crate::gaussians::config::{Background, Config, Strategy};
use crate::gaussians::job::{self, Run};
use crate::gaussians::products::{CHECKPOINT, MODEL, RECORD};
use crate::gaussians::record::{Status, TrainRecord};
use crate::gaussians::split::{Split, Test};
use crate::io::photos::{self, Images, Options};
use crate::photograph::products::{Products, Record, named};
use crate::photograph::tracer::Tracer;
use crate::photos::{Photo, PhotoSet};
use crate::plan::config::Preset;
use crate::plan::job::{RegionChoice, Target, Tools};
use crate::plan::record::PlanRecord;
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::region::Region;
use crate::scene::surface::Surface;
use crate::select::information::Model;
use crate::vulkan::Context;
use crate::{Error, Result, io, peers, photograph, plan, stereo, vds};

/// Seed of the photographs' noise, of the surface and of its scores: these are the same in all runs.
const SEED: u64 = 1;
/// Points of the scene's own mesh that are scored, where that is what methods are shown.
const SCORED: usize = 20_000;
/// Held-out points of a plan's metrics, which are not what is evaluated here.
const HELD_OUT: u32 = 200;
/// Files of the products.
const SURFACE: &str = "surface.ply";
const PLAN: &str = "plan.json";

/// What happens on the way.
pub enum Event<'e> {
    /// A product is made.
    Begins(&'e str),
    /// A product was there from an earlier run.
    Kept(&'e str),
    /// A stage goes on.
    Working,
}

/// Hears what happens and says whether to go on.
pub type Observe<'o> = &'o mut dyn FnMut(Event<'_>) -> ControlFlow<()>;

/// A scene with its products.
pub struct Bench {
    context: Arc<Context>,
    root: PathBuf,
    settings: Settings,
    tracer: Tracer,
    surface: Surface,
    path: String,
    region: Region,
}

impl Bench {
    /// Uploads a scene, whose products lie below `root`.
    ///
    /// # Errors
    /// Where the device has no room for it.
    pub fn new(context: &Arc<Context>, root: &Path, settings: Settings, subject: Subject) -> Result<Self> {
        let Subject { path, assembly, surface, region, .. } = subject;
        let pixels = u64::from(settings.size).pow(2);
        Ok(Self {
            context: context.clone(),
            root: root.to_owned(),
            settings,
            tracer: Tracer::new(context, assembly, pixels)?,
            surface,
            path: path.to_string_lossy().into_owned(),
            region,
        })
    }

    fn intrinsics(&self) -> Intrinsics {
        self.settings.intrinsics()
    }

    /// Takes photographs.
    ///
    /// # Errors
    /// Where the device fails or the system refuses a file.
    pub fn photographs(&self, cameras: &[Camera], observe: Observe) -> Result<Option<Stage>> {
        self.photographs_in(&self.root, cameras, observe)
    }

    /// Takes a photograph of a view that a method may choose, as a product below `folder`.
    fn photograph(&self, folder: &Path, photo: &Photo, observe: Observe) -> Result<Option<Photo>> {
        let taken = self.photographs_in(folder, std::slice::from_ref(&photo.camera), observe)?;
        let read = |stage| read_photos(&stage).map(|set| set.photos.into_iter().next());
        taken.map_or(Ok(None), read)
    }

    fn photographs_in(&self, root: &Path, cameras: &[Camera], observe: Observe) -> Result<Option<Stage>> {
        let record = Record {
            version: env!("CARGO_PKG_VERSION").into(),
            scene: self.tracer.assembly().checksum(),
            cameras: named(cameras)?,
            samples: self.settings.samples,
            seed: SEED,
            exposure: 0.0,
            show_sky: false,
            depth: false,
            normals: false,
            exr: false,
        };
        let stage = Stage::new(root, "photos", json!(record));
        if !begins(&stage, observe)? {
            return Ok(Some(stage));
        }
        let products = Products::new(stage.folder(), &record, false)?;
        let all = record.cameras.len() as u32;
        // The tracer's observer cannot change anything: what it hears goes through a cell.
        let heard = std::cell::RefCell::new(observe);
        let taken = photograph::job::run(&self.tracer, &record, &products, stage.folder(), |_| {
            (heard.borrow_mut())(Event::Working)
        })?;
        if taken.pictures < all {
            return Ok(None);
        }
        stage.finish()?;
        Ok(Some(stage))
    }

    /// Makes what the methods are shown of the scene: the surface of the input photos, or the scene's own, with scores from
    /// these photos.
    ///
    /// # Errors
    /// Where the photos give no surface, or the device fails.
    pub fn shown(&self, inputs: &Stage, observe: Observe) -> Result<Option<Stage>> {
        let stage =
            self.stage("surface", json!({ "photos": inputs.key(), "shown": self.settings.shown, "seed": SEED }));
        if !begins(&stage, observe)? {
            return Ok(Some(stage));
        }
        let set = read_photos(inputs)?;
        let (surface, points) = match self.settings.shown {
            Shown::Proxy => {
                let options = stereo::Options { seed: SEED, ..stereo::Options::default() };
                let points = match stereo::reconstruct(&self.context, &set, &options) {
                    Ok(found) => found.points,
                    // Few photos from all around see too little in common: their masks' hull stands in.
                    Err(Error::Request(_)) => stereo::hull_of(&self.context, &set, &options)?,
                    Err(error) => return Err(error),
                };
                (Surface::Points(points), None)
            }
            Shown::True => (self.surface.clone(), Some(SCORED)),
        };
        if observe(Event::Working).is_break() {
            return Ok(None);
        }
        let settings = vds::job::Settings { points, seed: SEED, ..vds::job::Settings::default() };
        let scored = vds::job::run(&self.context, &set, &surface, &settings, |_| {})?.points;
        stage.write(SURFACE, &io::ply::write::surface_points(&scored))?;
        stage.finish()?;
        Ok(Some(stage))
    }

    /// Lets a method choose views.
    ///
    /// # Errors
    /// Where the method cannot, or the device fails.
    pub fn choice(
        &self,
        (method, views, seed): (Method, u32, u64),
        shown: &Stage,
        model: Option<&Stage>,
        observe: Observe,
    ) -> Result<Option<PlanRecord>> {
        let config = crate::plan::config::Config { held_out: HELD_OUT, ..method.config(views, seed) };
        let peer = match method {
            Method::Peer(peer) => Some(sized(peers::request::Request::new(peer, None, &config)?, &self.settings)),
            _ => None,
        };
        let stage = self.stage(
            "choice",
            json!({
                "surface": shown.key(), "model": model.map(Stage::key), "method": method, "config": config, "peer": peer,
                "region": self.region, "camera": self.intrinsics(), "device": self.context.physical().name,
            }),
        );
        let file = stage.file(PLAN);
        if !begins(&stage, observe)? {
            let text = std::fs::read(&file).map_err(|source| Error::io(&file, source))?;
            let again = |e| Error::input(&file, format!("{e}; remove the folder and run again"));
            return serde_json::from_slice(&text).map(Some).map_err(again);
        }
        let surface = io::read_surface(&shown.file(SURFACE))?;
        let choice = RegionChoice {
            shape: Some(self.region.shape),
            floor: self.region.floor,
            clearance: Some(self.region.clearance),
        };
        let intrinsics = self.intrinsics();
        let target = Target::new(&surface, &self.path, Preset::Object, &choice, self.region.up, &intrinsics)?;
        let plan = match peer {
            Some(request) => {
                let model = model.map(read_model).transpose()?;
                let (cameras, model) = ((intrinsics, &[][..]), model.as_ref());
                let photograph = &mut |photo: &Photo| self.photograph(stage.folder(), photo, observe);
                match peers::job::photographing(&self.context, &target, cameras, &request, model, photograph)? {
                    Some(plan) => plan,
                    None => return Ok(None),
                }
            }
            None => plan::job::run(&self.context, &target, intrinsics, &[], config, Tools::default(), |_| {
                observe(Event::Working)
            })?,
        };
        if plan.interrupted() {
            return Ok(None);
        }
        let text = serde_json::to_vec_pretty(&plan.record)
            .map_err(|e| Error::input(&file, format!("the plan cannot be written: {e}")))?;
        stage.write(PLAN, &text)?;
        stage.finish()?;
        Ok(Some(plan.record))
    }

    /// Trains splats on photographs and, where there are tests, looks at these.
    ///
    /// # Errors
    /// Where photographs cannot be read any more, or the device fails or has not enough memory.
    pub fn training(
        &self,
        photos: &Stage,
        tests: Option<&Stage>,
        seed: u64,
        observe: Observe,
    ) -> Result<Option<(Stage, TrainRecord)>> {
        let Settings { iterations, max_splats, .. } = self.settings;
        let config = Config {
            background: Background::White,
            seed,
            ..Config::new(iterations, max_splats).with_strategy(Strategy::Mcmc, true)
        };
        let stage =
            self.stage("training", json!({ "photos": photos.key(), "tests": tests.map(Stage::key), "config": config }));
        let file = stage.file(RECORD);
        if !begins(&stage, observe)? {
            let text = std::fs::read(&file).map_err(|source| Error::io(&file, source))?;
            let again = |e| Error::input(&file, format!("{e}; remove the folder and run again"));
            return serde_json::from_slice(&text).map(|record| Some((stage, record))).map_err(again);
        }
        let test = tests.map_or(Test::Every(0), |tests| Test::Capture(tests.folder().to_owned()));
        let split = Split::new(read_photos(photos)?, &test, Images::Needed)?;
        let run = Run::new(
            &self.context,
            job::Request {
                capture: photos.folder().to_string_lossy().into_owned(),
                split,
                config,
                shrink: 1,
                folder: stage.folder().to_owned(),
                save_every: 5000,
                evaluate_every: 0,
            },
        )?;
        let resume = stage.file(CHECKPOINT).is_file();
        let record = run.run(resume, None, &mut |_| observe(Event::Working))?;
        let Some(record) = record.filter(|record| record.status == Status::Complete) else { return Ok(None) };
        let text = serde_json::to_vec_pretty(&record)
            .map_err(|e| Error::input(&file, format!("the record cannot be written: {e}")))?;
        stage.write(RECORD, &text)?;
        stage.finish()?;
        Ok(Some((stage, record)))
    }

    fn stage(&self, name: &str, inputs: Value) -> Stage {
        Stage::new(&self.root, name, inputs)
    }
}

/// Whether a product is to be made; its folder is there then.
fn begins(stage: &Stage, observe: Observe) -> Result<bool> {
    let is_done = stage.is_done();
    // A stop that is asked for here is heard within the stage, or before the next.
    let _ = observe(if is_done { Event::Kept(stage.key()) } else { Event::Begins(stage.key()) });
    if !is_done {
        stage.begin()?;
    }
    Ok(!is_done)
}

fn read_photos(stage: &Stage) -> Result<PhotoSet> {
    photos::read(stage.folder(), &Options { images: Images::Needed, ..Options::default() })
}

fn read_model(stage: &Stage) -> Result<Model> {
    let file = stage.file(MODEL);
    let (gaussians, _) = io::read_gaussians_with_notes(&file)?;
    Ok(Model { path: file.to_string_lossy().into_owned(), gaussians, antialiased: false })
}

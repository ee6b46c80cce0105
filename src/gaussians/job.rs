//! A whole training run: from a capture to a folder with the trained file, test pictures, metrics, checkpoint and report.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::checkpoint::{self, Checkpoint, Input};
use super::config::Config;
use super::course::Course;
use super::evaluate::{Pair, Tests};
use super::frame::{Frame, View};
use super::memory;
use super::pictures;
use super::products::{self, CHECKPOINT};
use super::rasterizer::MAX_SIDE;
use super::record::{Evaluation, Status, TrainRecord};
use super::split::Split;
use super::start;
use super::store::PhotoStore;
use super::trainer::Trainer;
use crate::photos::Photo;
use crate::vulkan::Context;
use crate::vulkan::footprint::Footprint;
use crate::vulkan::profile::Profile;
use crate::{Error, Result};

/// Entries of the footprint that stand for several buffers.
const SEVERAL: [&str; 3] = ["sort", "scan", "photos"];

/// What is wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Path of the capture as the user gave it.
    pub capture: String,
    /// The capture, taken apart.
    pub split: Split,
    /// Configuration.
    pub config: Config,
    /// Each pixel is a square of so many stored pixels.
    pub shrink: u32,
    /// The folder of the run; made when training begins.
    pub folder: PathBuf,
    /// Iterations between checkpoints; none but the last where zero.
    pub save_every: u32,
    /// Iterations between evaluations; none but the last where zero.
    pub evaluate_every: u32,
}

/// What happens on the way.
pub enum Event<'a> {
    /// So many photos of so many have been decoded.
    Photos(usize, usize),
    /// So many iterations are done.
    Iterations(u32),
    /// The test views have been looked at.
    Evaluated(&'a Evaluation),
    /// Something could not be written; the run goes on with what was there before.
    NotSaved(&'a Error),
    /// The record has changed, and with it the pictures of the worst test views (worst first).
    Report(&'a TrainRecord, &'a [(String, Pair)]),
}

/// A run that is prepared: nothing is on the device yet.
pub struct Run {
    pub(super) context: Arc<Context>,
    pub(super) request: Request,
    pub(super) frame: Frame,
    pub(super) views: Vec<View>,
    pub(super) footprint: Footprint,
}

impl Run {
    /// Prepares a run.
    ///
    /// # Errors
    /// Where the configuration makes no sense.
    pub fn new(context: &Arc<Context>, request: Request) -> Result<Self> {
        request.config.validate()?;
        let sides = request.split.train.photos.iter().chain(&request.split.test).map(|photo| photo.camera.intrinsics);
        if let Some(k) = sides.into_iter().find(|k| k.width.max(k.height) / request.shrink > MAX_SIDE) {
            let what = format!("photos of {} x {} pixels are too large; train with --shrink", k.width, k.height);
            return Err(Error::input(&request.capture, what));
        }
        let Split { train, test, .. } = &request.split;
        let cameras = pictures::cameras(&train.photos, request.shrink);
        let frame = Frame::new(&cameras, &train.points.positions);
        let mut views: Vec<View> = cameras.iter().map(|camera| frame.view(camera)).collect();
        views.extend(pictures::cameras(test, request.shrink).iter().map(|camera| frame.view(camera)));
        let sizes = memory::sizes(&request.config, &views, memory::first_room(request.config.max_splats));
        let mut buffers = memory::footprint(context, &request.config, &sizes, views.len());
        buffers.push(("photos", pictures::picture_bytes(&train.photos, request.shrink)));
        let footprint = Footprint { buffers, several: &SEVERAL };
        Ok(Self { context: context.clone(), request, frame, views, footprint })
    }

    /// Device memory that the run takes. Photos that find no place there stay on the host.
    pub fn footprint(&self) -> &Footprint {
        &self.footprint
    }

    /// Instances (pairs of a splat and a tile) that there is room for at first.
    pub fn room(&self) -> u32 {
        memory::first_room(self.request.config.max_splats)
    }

    /// Checks the footprint against the device.
    ///
    /// # Errors
    /// Where it does not fit.
    pub fn check(&self) -> Result<()> {
        let without_photos = self.footprint.buffers.iter().filter(|buffer| buffer.0 != "photos").copied().collect();
        let footprint = Footprint { buffers: without_photos, several: &SEVERAL };
        footprint.check(
            &self.context,
            "the training",
            |_| "train with fewer splats (--max-splats) or smaller photos (--shrink)",
        )
    }

    /// Trains, from the checkpoint in the folder where `resume` says so. `profile` takes the time of every stage. `observe`
    /// may break the run off; what there is is written then as well. Before training begins the folder is not touched, and
    /// there is no record of a run that was broken off by then.
    ///
    /// # Errors
    /// Where a photo cannot be read, the checkpoint is of another run, the device fails or has not enough memory, or the
    /// folder cannot be written at the end. Checkpoints that are there stay.
    pub fn run(
        &self,
        resume: bool,
        mut profile: Option<&mut Profile>,
        observe: &mut dyn FnMut(Event) -> ControlFlow<()>,
    ) -> Result<Option<TrainRecord>> {
        self.check()?;
        let photos: Vec<&Photo> = self.request.split.train.photos.iter().chain(&self.request.split.test).collect();
        let capture = Path::new(&self.request.capture);
        products::check(&self.request.folder, capture, &photos, &self.picture_names())?;
        let Request { split, config, shrink, folder, .. } = &self.request;
        let begun = start::Settings {
            budget: config.max_splats as usize,
            degree: config.degree,
            scale: config.init_scale,
            opacity: config.init_opacity,
            seed: config.seed,
            ..start::Settings::default()
        };
        let first = start::start(&split.train, &self.frame, &begun)?;
        let file = folder.join(CHECKPOINT);
        let resumed = if resume { Some(checkpoint::read(&file)?) } else { None };
        let Some((photos, tests)) = self.photos(observe)? else { return Ok(None) };
        let input = Input {
            photos: split.train.photos.len(),
            cameras: fingerprint(&split.train.photos, &self.views),
            pixels: photos.fingerprint(),
            shrink: *shrink,
            start: first.len(),
            tests: split.test.len(),
            test_photos: [fingerprint(&split.test, &self.views[split.train.photos.len()..]), tests.fingerprint()],
        };
        if let Some(resumed) = &resumed {
            checkpoint::check(&file, &resumed.header, config, &input)?;
        }
        let mut trainer = Trainer::new(&self.context, config.clone(), &first, self.views.clone(), photos)?;
        let mut course = Course::new(self, input, first.len(), tests);
        if let Some(Checkpoint { header, history, state }) = resumed {
            trainer.restore(&state, &history)?;
            course.record.evaluations = header.evaluations;
        }
        std::fs::create_dir_all(folder).map_err(|source| Error::io(folder, source))?;
        if !resume {
            products::clear(folder)?;
        }
        let trained = course.train(trainer, &mut profile, observe);
        if trained.is_err() {
            course.record.status = Status::Failed;
            let _ = observe(Event::Report(&course.record, &course.worst));
        }
        trained.map(|()| Some(course.record))
    }

    /// File names of the test views' pictures.
    pub(super) fn picture_names(&self) -> Vec<PathBuf> {
        let names: Vec<String> = self.request.split.test.iter().map(|photo| photo.camera.name.clone()).collect();
        products::picture_names(&names)
    }

    /// Decodes all photos: those to train on into the store. Nothing where `observe` breaks that off.
    fn photos(&self, observe: &mut dyn FnMut(Event) -> ControlFlow<()>) -> Result<Option<(PhotoStore, Tests)>> {
        let Split { train, test, .. } = &self.request.split;
        let settings = pictures::Settings { shrink: self.request.shrink, ..pictures::Settings::default() };
        // The run itself comes first; half of what it leaves is for photos.
        let announced = self.footprint.total() - self.footprint.bytes_of("photos")?;
        let most = self.context.memory_available().saturating_sub(announced) / 2;
        let mut store = PhotoStore::new(&self.context, most);
        let all = train.photos.len() + test.len();
        for picture in pictures::pictures(&train.photos, &settings)? {
            store.add(&picture?.pixels)?;
            if observe(Event::Photos(store.len(), all)).is_break() {
                return Ok(None);
            }
        }
        store.flush()?;
        let background = self.request.config.test_background();
        let decoded = |done| observe(Event::Photos(train.photos.len() + done, all));
        let tests = Tests::new(test, settings, train.photos.len(), background, decoded)?;
        Ok(tests.map(|tests| (store, tests)))
    }
}

/// CRC-32 of photos' names, sizes and cameras.
fn fingerprint(photos: &[Photo], views: &[View]) -> u32 {
    let mut sum = crc32fast::Hasher::new();
    for (photo, view) in photos.iter().zip(views) {
        sum.update(photo.camera.name.as_bytes());
        sum.update(bytemuck::bytes_of(view));
    }
    sum.finalize()
}

//! The training loop: from a capture to a folder with the trained file, test pictures, metrics, checkpoint and report.

use std::cell::RefCell;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::checkpoint::{self, Checkpoint, Header, Input};
use super::evaluate::{self, Camera, Pair, Tests};
use super::outputs::{self, CHECKPOINT, MODEL};
use super::record::{
    CurvePoint, Evaluation, MemoryRecord, PhotoExposure, PhotoPose, PhotosRecord, StageTime, Status, TrainRecord,
    finite_mean,
};
use super::request::{Run, TrainEvent, TrainRequest};
use crate::engine::vulkan::profile::{Profile, Row};
use crate::files::io::folder::replace_file;
use crate::files::photos::Photo;
use crate::splats::data::split::Split;
use crate::splats::data::store::PhotoStore;
use crate::splats::data::{pictures, start};
use crate::splats::render::frame::View;
use crate::splats::render::rasterizer::Size;
use crate::splats::render::renderer::Renderer;
use crate::splats::render::wanted::Wanted;
use crate::splats::train::loss::Record;
use crate::splats::train::trainer::Trainer;
use crate::{Error, Result};

/// Time between two updates of a run's report.
const BETWEEN_REPORTS: Duration = Duration::from_secs(15);
/// Iterations whose stages are timed before each report.
const SAMPLED: u32 = 10;
/// Points of the curves at most.
const CURVE: usize = 400;
/// Test views whose pictures go into the report.
pub(crate) const WORST: usize = 8;

/// A run in progress.
pub(super) struct TrainingLoop<'a> {
    run: &'a Run,
    input: Input,
    tests: Tests,
    /// The record so far.
    pub record: TrainRecord,
    /// The worst test views of the last evaluation.
    pub worst: Vec<(String, Pair)>,
    sampled: Profile,
    sampled_iterations: u32,
    /// Iterations that had been done, and when, as this process began.
    first: u32,
    started: Instant,
    saving: Option<JoinHandle<Result<()>>>,
}

impl<'a> TrainingLoop<'a> {
    /// A run that starts with so many Gaussians.
    pub fn new(run: &'a Run, input: Input, start: usize, tests: Tests) -> Self {
        let Run { context, request, frame, views, footprint } = run;
        let record = TrainRecord {
            version: env!("CARGO_PKG_VERSION").into(),
            status: Status::Running,
            device: context.physical().name.clone(),
            photos: PhotosRecord {
                capture: request.capture.clone(),
                train: request.split.train.photos.len(),
                test: request.split.test.len(),
                largest: largest(views),
                shrink: request.shrink,
                points: request.split.train.points.positions.len(),
                extent: frame.extent(),
            },
            config: request.config.clone(),
            iterations: 0,
            splats: start as u32,
            seconds: 0.0,
            seconds_for: 0,
            gpu_seconds: None,
            curve: Vec::new(),
            evaluations: Vec::new(),
            test_views: Vec::new(),
            exposures: Vec::new(),
            poses: Vec::new(),
            stages: Vec::new(),
            memory: MemoryRecord {
                buffers: footprint.buffers.iter().map(|(name, bytes)| ((*name).to_owned(), *bytes)).collect(),
                announced: footprint.total(),
                peak: 0,
            },
        };
        Self {
            run,
            input,
            tests,
            record,
            worst: Vec::new(),
            sampled: Profile::default(),
            sampled_iterations: 0,
            first: 0,
            started: Instant::now(),
            saving: None,
        }
    }

    /// Trains to the end or until `observe` stops it, and writes the outputs. Any failure except of the device itself leaves the
    /// trainer as it was after its last iteration, which is saved.
    ///
    /// # Errors
    /// As for [`Run::run`].
    pub fn train(
        &mut self,
        mut trainer: Trainer,
        profile: &mut Option<&mut Profile>,
        observe: &mut dyn FnMut(TrainEvent) -> ControlFlow<()>,
    ) -> Result<()> {
        let first = trainer.done();
        let trained = self.iterate(&mut trainer, profile, observe);
        let lost = matches!(trained, Err(Error::DeviceLost { .. } | Error::Vulkan { .. }));
        if trained.is_err() && !lost && trainer.done() > first {
            self.save(&trainer, observe)?;
        }
        self.join(observe);
        trained?;
        self.finish(trainer, observe)
    }

    /// The iterations, with stops for evaluations, checkpoints and reports.
    fn iterate(
        &mut self,
        trainer: &mut Trainer,
        profile: &mut Option<&mut Profile>,
        observe: &mut dyn FnMut(TrainEvent) -> ControlFlow<()>,
    ) -> Result<()> {
        let TrainRequest { config, save_every, evaluate_every, .. } = &self.run.request;
        let due = |every: u32, done: u32| every > 0 && done.is_multiple_of(every);
        let next = |every: u32, done: u32| match every {
            0 => config.iterations,
            every => (done / every + 1).saturating_mul(every).min(config.iterations),
        };
        let mut flow = ControlFlow::Continue(());
        self.first = trainer.done();
        self.started = Instant::now();
        // Checkpoints are written before test views are evaluated: a run resumed there lacks that evaluation.
        let looked = self.record.evaluations.last().is_some_and(|last| last.iteration == self.first);
        if self.first > 0 && self.first < config.iterations && due(*evaluate_every, self.first) && !looked {
            self.evaluate(&mut |view, _| trainer.picture(view), self.first, false, observe)?;
        }
        self.report(trainer, profile, observe)?;
        while flow.is_continue() && trainer.done() < config.iterations {
            let done = trainer.done();
            let stop = next(*save_every, done).min(next(*evaluate_every, done));
            flow = self.stretch(trainer, stop, profile, observe)?;
            let done = trainer.done();
            let last = done == config.iterations;
            if flow.is_break() || last || due(*save_every, done) {
                self.save(trainer, observe)?;
            }
            if !last && flow.is_continue() && due(*evaluate_every, done) {
                self.evaluate(&mut |view, _| trainer.picture(view), done, false, observe)?;
            }
            self.report(trainer, profile, observe)?;
        }
        Ok(())
    }

    /// Trains until `stop` iterations are done, or a report is due.
    fn stretch(
        &mut self,
        trainer: &mut Trainer,
        stop: u32,
        profile: &mut Option<&mut Profile>,
        observe: &mut dyn FnMut(TrainEvent) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>> {
        let (first, begun) = (trainer.done(), Instant::now());
        let mut flow = ControlFlow::Continue(());
        let mut watch = |done| {
            flow = observe(TrainEvent::Iterations(done));
            flow
        };
        if let Some(profile) = profile {
            trainer.run(stop, Some(profile), &mut watch)?;
            return Ok(flow);
        }
        trainer.run(stop.min(first + SAMPLED), Some(&mut self.sampled), &mut watch)?;
        self.sampled_iterations += trainer.done() - first;
        if flow.is_continue() {
            let enough = || begun.elapsed() > BETWEEN_REPORTS;
            trainer.run(stop, None, |done| {
                flow = observe(TrainEvent::Iterations(done));
                if flow.is_break() || enough() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            })?;
        }
        Ok(flow)
    }

    /// Evaluates test views: some of them during training, all of them, with LPIPS, at the end.
    fn evaluate(
        &mut self,
        camera: Camera,
        done: u32,
        all: bool,
        observe: &mut dyn FnMut(TrainEvent) -> ControlFlow<()>,
    ) -> Result<()> {
        if self.tests.is_empty() {
            return Ok(());
        }
        let (folder, files) = (&self.run.request.folder, self.run.picture_names());
        let mut worst: Vec<(f64, String, Pair)> = Vec::new();
        let keep = |view: usize, pair: &Pair| match all {
            true => outputs::write_pair(folder, &files[view], pair),
            false => Ok(()),
        };
        let mut views = self.tests.evaluate(&self.run.context, camera, all, keep, |view, pair| {
            let place = worst.partition_point(|(psnr, ..)| psnr.total_cmp(&view.quality.psnr).is_le());
            if place < WORST {
                worst.insert(place, (view.quality.psnr, view.name.clone(), pair));
                worst.truncate(WORST);
            }
        })?;
        if all {
            outputs::force_pairs(folder, &files)?;
        }
        self.worst = worst.into_iter().map(|(_, name, pair)| (name, pair)).collect();
        let evaluation = Evaluation { iteration: done, views: views.len(), quality: evaluate::mean(&views) };
        views.sort_by(|a, b| a.quality.psnr.total_cmp(&b.quality.psnr));
        self.record.test_views = views;
        self.record.evaluations.push(evaluation);
        let _ = observe(TrainEvent::Evaluated(&evaluation));
        Ok(())
    }

    /// Writes the checkpoint while training continues. A failure to write is reported, and the run continues.
    fn save(&mut self, trainer: &Trainer, observe: &mut dyn FnMut(TrainEvent) -> ControlFlow<()>) -> Result<()> {
        let state = trainer.state()?;
        let header = Header {
            config: self.run.request.config.clone(),
            input: self.input.clone(),
            done: state.done,
            population: state.population,
            evaluations: self.record.evaluations.clone(),
        };
        let checkpoint = Checkpoint { header, history: trainer.history()?, state };
        let file = self.run.request.folder.join(CHECKPOINT);
        // The previous one finishes first: two would write one file.
        self.join(observe);
        self.saving = Some(std::thread::spawn(move || checkpoint::write(&file, &checkpoint)));
        Ok(())
    }

    /// Waits for the checkpoint that is being written.
    fn join(&mut self, observe: &mut dyn FnMut(TrainEvent) -> ControlFlow<()>) {
        let Some(saving) = self.saving.take() else { return };
        let fault = |_| {
            let what = "writing the checkpoint ended by a fault of this program, told above; please report it";
            Err(Error::input(self.run.request.folder.join(CHECKPOINT), what))
        };
        if let Err(error) = saving.join().unwrap_or_else(fault) {
            let _ = observe(TrainEvent::NotSaved(&error));
        }
    }

    /// Brings the record up to date and shows it.
    fn report(
        &mut self,
        trainer: &Trainer,
        profile: &Option<&mut Profile>,
        observe: &mut dyn FnMut(TrainEvent) -> ControlFlow<()>,
    ) -> Result<()> {
        let history = trainer.history()?;
        let record = &mut self.record;
        record.iterations = trainer.done();
        record.splats = history.last().map_or(record.splats, |last| last.splats);
        record.seconds = self.started.elapsed().as_secs_f64();
        record.seconds_for = trainer.done() - self.first;
        let timed = self.run.context.physical().timestamp_bits > 0 && !self.run.context.debug_sync();
        record.gpu_seconds = timed.then(|| 1e-3 * trainer.gpu_ms());
        record.curve = curve(&history);
        record.memory.peak = self.run.context.peak_allocated();
        let (profile, iterations) = match profile {
            Some(profile) => (&**profile, record.seconds_for),
            None => (&self.sampled, self.sampled_iterations),
        };
        let stage = |row: Row| StageTime { name: row.name.into(), ms: row.total_ms / f64::from(iterations.max(1)) };
        record.stages = profile.rows().into_iter().map(stage).collect();
        let _ = observe(TrainEvent::Report(&self.record, &self.worst));
        Ok(())
    }

    /// Evaluates all test views with their poses corrected, which takes as long as some iterations for each: `observe` may stop it.
    fn evaluate_corrected(
        &mut self,
        mut trainer: Trainer,
        done: u32,
        observe: &mut dyn FnMut(TrainEvent) -> ControlFlow<()>,
    ) -> Result<()> {
        let (all, mut tested) = (self.tests.len(), 0);
        let observe = RefCell::new(observe);
        let mut camera = |view: usize, photo: &[u32]| {
            Error::unless_stopped(observe.borrow_mut()(TrainEvent::Tests(tested, all)))?;
            tested += 1;
            trainer.picture_like(view, photo)
        };
        self.evaluate(&mut camera, done, true, &mut |event| observe.borrow_mut()(event))
    }

    /// The outputs. Test views are evaluated once the trainer's memory is free again, unless their poses are to be found.
    fn finish(&mut self, trainer: Trainer, observe: &mut dyn FnMut(TrainEvent) -> ControlFlow<()>) -> Result<()> {
        let Run { context, request, frame, views, .. } = self.run;
        let (done, trained) = (trainer.done(), trainer.gaussians()?);
        let photos = &request.split.train.photos;
        let names = photos.iter().map(|photo| photo.camera.name.clone());
        self.record.exposures =
            names.zip(trainer.exposures()?).map(|(name, exposure)| PhotoExposure::new(name, &exposure)).collect();
        let corrections = trainer.poses()?;
        let refined: Vec<Photo> =
            photos.iter().zip(&corrections).map(|(photo, by)| by.of_photo(photo, frame)).collect();
        self.record.poses = photos
            .iter()
            .zip(&refined)
            .map(|(given, refined)| PhotoPose::new(&given.camera, &refined.camera))
            .collect();
        let trainer = (!refined.is_empty()).then_some(trainer);
        // Not those of the last iteration: a refinement may have followed it.
        self.record.splats = trained.len() as u32;
        let mut in_world = frame.gaussians_to_world(trained.clone());
        in_world.antialiased = request.config.antialiased;
        let bytes = crate::files::io::ply::write::gaussians(&in_world);
        replace_file(&request.folder.join(MODEL), |file| file.write_all(&bytes))?;
        if !refined.is_empty() {
            for note in outputs::write_refined(&request.folder, &refined, &request.split.train.points)? {
                let _ = observe(TrainEvent::Note(&note));
            }
        }
        let _ = observe(TrainEvent::Trained(&in_world));
        drop((bytes, in_world));
        let mut complete = done == request.config.iterations;
        if complete && !self.tests.is_empty() {
            self.record.evaluations.retain(|evaluation| evaluation.iteration < done);
            let evaluated = match trainer {
                Some(trainer) => self.evaluate_corrected(trainer, done, observe),
                None => {
                    let [width, height] = largest(views);
                    let wanted = Wanted { antialiased: request.config.antialiased, ..Wanted::default() };
                    let mut renderer = Renderer::new(context, &trained, Size { width, height }, wanted)?;
                    let background = request.config.test_background();
                    let mut camera = |view: usize, _: &[u32]| Ok(renderer.picture(&views[view], background)?.pixels);
                    self.evaluate(&mut camera, done, true, observe)
                }
            };
            match evaluated {
                // The checkpoint is there: a run that is resumed evaluates the test views anew.
                Err(Error::Interrupted) => complete = false,
                evaluated => evaluated?,
            }
        }
        self.record.status = if complete { Status::Complete } else { Status::Interrupted };
        let _ = observe(TrainEvent::Report(&self.record, &self.worst));
        Ok(())
    }
}

/// The training of a run in a few hundred points: means over stretches.
fn curve(history: &[Record]) -> Vec<CurvePoint> {
    let stretch = history.len().div_ceil(CURVE).max(1);
    let point = |(i, part): (usize, &[Record])| {
        let mean = |of: fn(&Record) -> f64| part.iter().map(of).sum::<f64>() / part.len() as f64;
        let iteration = (i * stretch + part.len()) as u32;
        CurvePoint {
            iteration,
            loss: mean(Record::loss),
            psnr: finite_mean(part.iter().map(Record::psnr)),
            splats: part.last().map_or(0, |record| record.splats),
            instances: mean(|record| f64::from(record.instances)),
        }
    };
    history.chunks(stretch).enumerate().map(point).collect()
}

/// Largest width and height of views.
fn largest(views: &[View]) -> [u32; 2] {
    let of = |side: fn(&View) -> u32| views.iter().map(side).max().unwrap_or(0);
    [of(|view| view.width), of(|view| view.height)]
}

impl Run {
    /// Trains, from the checkpoint in the folder where `resume` is set. `profile` times every stage. `observe` may stop the run;
    /// the outputs so far are then written as well. Before training begins the folder is not touched, and a run that was stopped
    /// by then is [`Error::Interrupted`].
    ///
    /// # Errors
    /// Where a photo cannot be read, the checkpoint is of another run, the device fails or has not enough memory, or the
    /// folder cannot be written at the end. Checkpoints that are there stay.
    pub fn run(
        &self,
        resume: bool,
        mut profile: Option<&mut Profile>,
        observe: &mut dyn FnMut(TrainEvent) -> ControlFlow<()>,
    ) -> Result<TrainRecord> {
        self.check()?;
        let photos: Vec<&Photo> = self.request.split.train.photos.iter().chain(&self.request.split.test).collect();
        let capture = Path::new(&self.request.capture);
        outputs::check(&self.request.folder, capture, &photos, &self.picture_names())?;
        let TrainRequest { split, config, shrink, folder, .. } = &self.request;
        let first = start::start(&split.train, &self.frame, &start::StartSettings::from(config))?;
        let file = folder.join(CHECKPOINT);
        let resumed = if resume { Some(checkpoint::read(&file)?) } else { None };
        let (photos, tests) = self.photos(observe)?;
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
        let mut training = TrainingLoop::new(self, input, first.len(), tests);
        if let Some(Checkpoint { header, history, state }) = resumed {
            trainer.restore(&state, &history)?;
            training.record.evaluations = header.evaluations;
        }
        std::fs::create_dir_all(folder).map_err(|source| Error::io(folder, source))?;
        if !resume {
            outputs::clear(folder)?;
        }
        let trained = training.train(trainer, &mut profile, observe);
        if trained.is_err() {
            training.record.status = Status::Failed;
            let _ = observe(TrainEvent::Report(&training.record, &training.worst));
        }
        trained.map(|()| training.record)
    }

    /// File names of the test views' pictures.
    pub(super) fn picture_names(&self) -> Vec<PathBuf> {
        let names: Vec<String> = self.request.split.test.iter().map(|photo| photo.camera.name.clone()).collect();
        outputs::picture_names(&names)
    }

    /// Decodes all photos: those to train on into the store.
    fn photos(&self, observe: &mut dyn FnMut(TrainEvent) -> ControlFlow<()>) -> Result<(PhotoStore, Tests)> {
        let Split { train, test, .. } = &self.request.split;
        let TrainRequest { shrink, config, .. } = &self.request;
        let usual = pictures::PictureSettings::default();
        let settings = pictures::PictureSettings { shrink: *shrink, masks: config.masks, ..usual };
        let mut store = PhotoStore::new(&self.context, self.photos_on_device()?);
        let all = train.photos.len() + test.len();
        for picture in pictures::pictures(&train.photos, &settings)? {
            store.add(&picture?.pixels)?;
            Error::unless_stopped(observe(TrainEvent::Photos(store.len(), all)))?;
        }
        store.flush()?;
        let background = config.test_background();
        let decoded = |done| observe(TrainEvent::Photos(train.photos.len() + done, all));
        let tests = Tests::new(test, settings, train.photos.len(), background, config.exposure, decoded)?;
        Ok((store, tests))
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

//! A training run on the device: iterations recorded ahead of it, block by block, and nothing read back between them.
//!
//! Everything that outlives an iteration (parameters, moments, population, statistics) is a function of the start, the
//! configuration and the photos. Where an iteration needs more capacity for instances than there is, the stages leave all of that
//! as it was, and the run continues from that iteration with more.

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::density::AdaptiveDensity;
use super::epoch_sampler::EpochSampler;
use super::exposure::Exposures;
use super::loss::{Ledger, Loss, Record, mailbox};
use super::mcmc::{self, Mcmc};
use super::memory;
use super::poses::Poses;
use super::test_poses::TestPoses;
use super::update::{Learnt, Moments, Trained, Update, UpdatePush};
use crate::engine::vulkan::pace::Pace;
use crate::engine::vulkan::profile::Profile;
use crate::engine::vulkan::{Buffer, Context, Recorder};
use crate::scene::gaussians::Gaussians;
use crate::scene::random;
use crate::splats::config::{Background, Schedule, Strategy, TrainConfig};
use crate::splats::data::store::PhotoStore;
use crate::splats::render::frame::View;
use crate::splats::render::layout::{self, PassPush};
use crate::splats::render::rasterizer::{Model, Rasterizer, Size};
use crate::{Error, Result};

/// Iterations of a submission at most, and submissions ahead of the device.
const ITERATIONS: u32 = 10;
const AHEAD: usize = 3;
/// Stages of an iteration, with its sorts and a refinement, at most.
const MAX_STAGES: u32 = 96;
const BACKGROUND_STREAM: u32 = 0x4580_0000;

/// What changes the number of Gaussians.
enum Density {
    Mcmc(Mcmc),
    Adaptive(AdaptiveDensity),
}

/// A run.
pub struct Trainer {
    pub(super) context: Arc<Context>,
    pub(super) config: TrainConfig,
    schedule: Schedule,
    /// Gaussians at the start.
    started_with: u32,
    pub(super) views: Vec<View>,
    pub(super) view_buffer: Buffer,
    photos: PhotoStore,
    /// View of each photo.
    taken_from: Vec<u32>,
    pub(super) model: Model,
    pub(super) moments: Moments,
    pub(super) rasterizer: Rasterizer,
    pub(super) loss: Loss,
    /// Where they are learnt.
    pub(super) exposures: Option<Exposures>,
    update: Update,
    /// Corrections of poses, where there are any, and the search for those of test views.
    pub(super) poses: Option<Poses>,
    pub(super) test_poses: Option<TestPoses>,
    density: Density,
    pub(super) ledger: Ledger,
    pub(super) done: u32,
    gpu_ms: f64,
    // Of iterations.
    pub(super) pace: Pace,
}

impl Trainer {
    /// Prepares a run from `start`, which is in the training frame; `views` are those of `photos`, in their order, and may be
    /// followed by others that are only rendered.
    ///
    /// # Errors
    /// Where there is nothing to start from or more than the budget, or the device has not enough memory.
    pub fn new(
        context: &Arc<Context>,
        config: TrainConfig,
        start: &Gaussians,
        views: Vec<View>,
        photos: PhotoStore,
    ) -> Result<Self> {
        config.validate()?;
        let population = u32::try_from(start.len()).unwrap_or(u32::MAX);
        if population == 0 || population > config.max_splats {
            let most = config.max_splats;
            return Err(Error::request(format!("training starts with 1 to {most} splats, not with {population}")));
        }
        let sizes = memory::sizes(&config, &views, memory::first_capacity(config.max_splats));
        let model = Model::new(context, config.max_splats, config.degree)?;
        model.parameters.upload(&layout::to_planes(start, config.degree, model.stride as usize))?;
        model.population.upload(&[population])?;
        let (statistics, forces) = (memory::statistics(&config), memory::forces(&config));
        let moments = Moments::new(context, model.parameters.size(), statistics, forces)?;
        let ledger = Ledger::new(context, config.iterations)?;
        let mut commands = Recorder::new(context)?;
        commands.fill(&moments.first, 0);
        commands.fill(&moments.second, 0);
        commands.fill(&moments.statistics, 0);
        commands.fill(&ledger.control, 0);
        commands.submit_and_wait()?;
        drop(commands);
        let exposures = || Exposures::new(context, &sizes, views.len(), photos.len() as u32, config.iterations);
        let exposures = config.exposure.then(exposures).transpose()?;
        let poses = config.refine_poses.then(|| Poses::new(context, &sizes, &views, photos.len() as u32));
        let wanted = memory::wanted(&config);
        let test_poses = config.refine_poses.then(|| TestPoses::new(context, &sizes, wanted, &config));
        let learnt = if config.refine_poses { Learnt::GaussiansAndPose } else { Learnt::Gaussians };
        Ok(Self {
            context: context.clone(),
            schedule: config.schedule(photos.len()),
            started_with: population,
            view_buffer: Buffer::from_slice(context, "views", &views)?,
            views,
            taken_from: (0..photos.len() as u32).collect(),
            photos,
            model,
            moments,
            rasterizer: Rasterizer::new(context, sizes, wanted)?,
            loss: Loss::new(context, &sizes, wanted.divided(context)?)?,
            exposures,
            update: Update::new(context, wanted, config.strategy == Strategy::Adc, learnt)?,
            poses: poses.transpose()?,
            test_poses: test_poses.transpose()?,
            density: match config.strategy {
                Strategy::Mcmc => Density::Mcmc(Mcmc::new(context, config.max_splats)?),
                Strategy::Adc => Density::Adaptive(AdaptiveDensity::new(context, config.max_splats)?),
            },
            ledger,
            config,
            done: 0,
            gpu_ms: 0.0,
            pace: Pace::new(context, 1),
        })
    }

    /// Adds a photo from one of the views, in 8 bits as [`crate::splats::data::pictures`] has them; iterations to come look at it as well. The
    /// schedule stays that of the photos that were there at first; of a run that began with none, that of few.
    ///
    /// # Errors
    /// Where there is no such view, the photo is of another size, or there is no memory for it.
    pub fn add_photo(&mut self, view: u32, pixels: &[u32]) -> Result<()> {
        let size = self.views.get(view as usize).map(|view| view.width as usize * view.height as usize);
        if size != Some(pixels.len()) {
            return Err(Error::request(format!("view {view} takes no photo of {} pixels", pixels.len())));
        }
        self.photos.add(pixels)?;
        self.photos.flush()?;
        self.taken_from.push(view);
        Ok(())
    }

    /// The Gaussians on the device, in the training frame.
    pub(in crate::splats) fn model(&self) -> &Model {
        &self.model
    }

    /// What photos are and may be taken from.
    pub(in crate::splats) fn views(&self) -> &[View] {
        &self.views
    }

    /// The configuration.
    pub(in crate::splats) fn config(&self) -> &TrainConfig {
        &self.config
    }

    /// Degree of the harmonics that took part in the last iteration.
    pub(in crate::splats) fn degree(&self) -> u32 {
        self.schedule.degree(self.done.saturating_sub(1), self.config.degree)
    }

    pub(super) fn planes(&self) -> usize {
        layout::planes(self.config.degree)
    }

    /// Iterations done.
    pub fn done(&self) -> u32 {
        self.done
    }

    /// Gaussians of a hard budget at an iteration: a function of the schedule alone.
    fn budgeted(&self, iteration: u32) -> u32 {
        (0..self.schedule.refinements_before(iteration)).fold(self.started_with, |n, _| self.grown(n))
    }

    /// The same after a refinement.
    fn grown(&self, before: u32) -> u32 {
        mcmc::grown(before, self.schedule.growth, self.config.max_splats)
    }

    /// GPU time of the iterations so far in milliseconds, with the gaps between stages but not those between blocks of them.
    pub fn gpu_ms(&self) -> f64 {
        self.gpu_ms
    }

    /// Losses of the iterations so far.
    ///
    /// # Errors
    /// None: the history has capacity for all iterations.
    pub fn history(&self) -> Result<Vec<Record>> {
        self.ledger.history.read(self.done as usize)
    }

    /// Trains until `until` iterations are done. `observe` is called regularly with the number of iterations done and may stop
    /// the run after the block that is running. With a profile every stage is timed.
    ///
    /// # Errors
    /// Where the device fails or has not enough memory, or the loss is no number any more.
    pub fn run(
        &mut self,
        until: u32,
        mut profile: Option<&mut Profile>,
        mut observe: impl FnMut(u32) -> ControlFlow<()>,
    ) -> Result<()> {
        let until = until.min(self.config.iterations);
        loop {
            self.gpu_ms += self.advance(until, profile.as_deref_mut(), &mut observe)?;
            self.done = self.ledger.mailbox.peek(mailbox::DONE).unwrap_or(0).max(self.done);
            let [needed, broken] =
                [mailbox::NEEDED, mailbox::BROKEN].map(|word| self.ledger.mailbox.peek(word).unwrap_or(0));
            if broken != 0 {
                let what = "the loss of iteration {} is no number; a photo or a start value may be damaged";
                return Err(Error::request(what.replace("{}", &self.done.to_string())));
            }
            if needed == 0 {
                return Ok(());
            }
            self.unhalt()?;
            self.rasterizer.ensure_capacity(needed)?;
        }
    }

    /// Submits blocks until `until` iterations are done, the run is halted or `observe` stops it; waits for all of them. Returns
    /// how long they took, see [`Trainer::gpu_ms`].
    fn advance(
        &mut self,
        until: u32,
        mut profile: Option<&mut Profile>,
        observe: &mut impl FnMut(u32) -> ControlFlow<()>,
    ) -> Result<f64> {
        let mut gpu_ms = 0.0;
        let ahead = if self.context.submits_one_by_one() { 1 } else { AHEAD };
        let done = || self.ledger.mailbox.peek(mailbox::DONE).unwrap_or(0).max(self.done);
        let halted =
            || [mailbox::NEEDED, mailbox::BROKEN].iter().any(|&word| self.ledger.mailbox.peek(word) != Some(0));
        let mut flow = ControlFlow::Continue(());
        // Submissions with how many iterations each has.
        let mut running: VecDeque<(Recorder, Instant, u32)> = VecDeque::new();
        let mut pace = self.pace.clone();
        let mut next = self.done;
        let mut rounds = EpochSampler::new(self.config.seed, self.photos.len() as u32);
        loop {
            while flow.is_continue() && !halted() && next < until && running.len() < ahead {
                let mut commands = match &profile {
                    Some(_) => Recorder::timed(&self.context, ITERATIONS * MAX_STAGES)?,
                    // Timed as a whole, no stage could be waited for.
                    None if self.context.physical().timestamp_bits > 0 && !self.context.debug_sync() => {
                        Recorder::timed_whole(&self.context)?
                    }
                    None => Recorder::new(&self.context)?,
                };
                let end = (next + pace.items().min(ITERATIONS)).min(until);
                for iteration in next..end {
                    self.record_iteration(&mut commands, iteration, rounds.photo(iteration))?;
                }
                let submitted = Instant::now();
                commands.submit()?;
                running.push_back((commands, submitted, end - next));
                next = end;
            }
            let in_flight = running.len() as u32;
            let Some((oldest, submitted, iterations)) = running.front_mut() else {
                self.pace = pace;
                return Ok(gpu_ms);
            };
            if oldest.pending()? == 0 {
                oldest.wait()?;
                let timings = oldest.timings()?;
                // Without timestamps the time has that of those before it in it.
                let mut took = submitted.elapsed() / in_flight;
                if let [first, .., last] | [first @ last] = &timings[..] {
                    gpu_ms += (last.end - first.start) * 1e-6;
                    took = Duration::from_secs_f64((last.end - first.start) * 1e-9);
                }
                pace.took(*iterations, took);
                if let Some(profile) = &mut profile {
                    profile.device(*submitted, &timings);
                }
                running.pop_front();
            } else {
                std::thread::sleep(Duration::from_micros(500));
            }
            if flow.is_continue() {
                flow = observe(done());
            }
        }
    }

    /// Reserves capacity for so many instances. A run does so by itself, and no result depends on it.
    ///
    /// # Errors
    /// Where the device has not enough memory.
    pub fn set_capacity(&mut self, capacity: u32) -> Result<()> {
        self.rasterizer.set_capacity(capacity)
    }

    /// Clears a halt.
    fn unhalt(&self) -> Result<()> {
        self.ledger.mailbox.write(&[self.done, 0, 0, 0])?;
        let mut commands = Recorder::new(&self.context)?;
        commands.fill(&self.ledger.control, 0);
        commands.submit_and_wait().map(drop)
    }

    fn background_of(&self, iteration: u32) -> [f32; 3] {
        match self.config.background {
            Background::Black => [0.0; 3],
            Background::White => [1.0; 3],
            Background::Random => {
                let [r, g, b, _] = random::uniforms(self.config.seed, BACKGROUND_STREAM, iteration);
                [r, g, b].map(|v| v as f32)
            }
        }
    }

    /// Records one iteration, and the refinement that follows it where one is due.
    fn record_iteration(&self, commands: &mut Recorder, iteration: u32, photo: u32) -> Result<()> {
        let view = self.taken_from[photo as usize];
        let View { width, height, .. } = self.views[view as usize];
        let size = Size { width, height };
        let push = PassPush {
            stride: self.model.stride,
            view,
            degree: self.schedule.degree(iteration, self.config.degree),
            capacity: self.rasterizer.sizes().capacity,
            background: self.background_of(iteration),
            iteration,
        };
        self.photos.record_copy(commands, photo as usize, &self.loss.photo);
        let Self { rasterizer, model, view_buffer, ledger, .. } = self;
        let instances = rasterizer.forward(commands, model, view_buffer, size, &push)?;
        if let Some(exposures) = &self.exposures {
            exposures.record_apply(commands, [view_buffer, &rasterizer.picture], size, &push);
        }
        self.loss.record(
            commands,
            [view_buffer, &rasterizer.picture, &rasterizer.counts, &model.population],
            ledger,
            size,
            &push,
        );
        if let Some(exposures) = &self.exposures {
            let buffers = [view_buffer, &rasterizer.picture, &self.loss.by_pixel, &ledger.control];
            exposures.record_step(commands, buffers, size, &push);
        }
        rasterizer.backward(commands, view_buffer, instances, &self.loss.by_pixel, &push);
        let step = UpdatePush::new(&self.config, &self.schedule, &push);
        self.update.record(commands, [view_buffer, &ledger.control], rasterizer, model, &self.moments, &step);
        if let Some(poses) = &self.poses {
            let rate = Poses::rate(f64::from(iteration) / f64::from(self.config.iterations));
            poses.record_step(commands, model, [view_buffer, &ledger.control, &self.moments.forces], (view, rate));
        }
        if self.schedule.refines_after(iteration) {
            self.record_refinement(commands, iteration)?;
        }
        if let Density::Adaptive(adaptive) = &self.density
            && self.schedule.resets_after(iteration)
        {
            adaptive.record_reset(commands, self.trained());
        }
        Ok(())
    }

    fn trained(&self) -> Trained<'_> {
        Trained { model: &self.model, moments: &self.moments, control: &self.ledger.control }
    }

    /// Records the refinement that follows an iteration.
    fn record_refinement(&self, commands: &mut Recorder, iteration: u32) -> Result<()> {
        let (trained, rasterizer) = (self.trained(), &self.rasterizer);
        let keys = [self.config.seed, u64::from(iteration)];
        match &self.density {
            Density::Mcmc(mcmc) => {
                let before = self.budgeted(iteration);
                mcmc.record(commands, trained, rasterizer, [before, self.grown(before)], keys)
            }
            Density::Adaptive(adaptive) => {
                let removes_wide = iteration >= self.schedule.reset_every;
                adaptive.record(commands, trained, rasterizer, keys, removes_wide)
            }
        }
    }

    /// Refines now, regardless of the schedule: for tests, since the population would no longer follow the schedule.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn refine(&mut self) -> Result<()> {
        let mut commands = Recorder::new(&self.context)?;
        self.record_refinement(&mut commands, self.done)?;
        commands.submit_and_wait().map(drop)
    }
}

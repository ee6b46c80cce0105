//! The planner: device state and the recording of iterations.

use std::any::Any;
use std::ops::Range;
use std::sync::Arc;

use super::buffers::Buffers;
use super::config::Config;
use super::footprint;
use super::objective::{Pass, Run};
use super::preparation::Preparation;
use super::shared::{CameraState, Control, Gradient, Settings};
use super::snapshot::{SnapshotPush, SnapshotStage};
use crate::Result;
use crate::engine::vulkan::{Context, Pipeline, Recorder};
use crate::visibility::device_scene::DeviceScene;

/// All device state of one run.
pub struct Planner {
    pub(super) run: Run,
    pub(super) config: Config,
    pub(super) start: Vec<CameraState>,
    pub(super) pass: Box<dyn Pass>,
    block: u32,
    snapshot: Pipeline,
}

impl Planner {
    /// Allocates a run and what the objective has of its own.
    ///
    /// # Errors
    /// A surface that no camera can see from the region, or a plan that is larger than the device's memory.
    pub fn new(context: &Arc<Context>, scene: &Arc<DeviceScene>, preparation: Preparation) -> Result<Self> {
        let Preparation { config, settings, start, objective, footprint, .. } = preparation;
        footprint::check(&footprint, context)?;
        let (snapshot, pass) = Pipeline::beside(
            || Pipeline::new::<SnapshotStage>(context, &()),
            || objective.on_device(context, scene, &settings, &footprint),
        );
        let buffers = Buffers::new(context, &footprint)?;
        let block = footprint::block(&settings, &config, &*objective);
        let run = Run { context: context.clone(), scene: scene.clone(), settings, buffers };
        let planner = Self { run, config, start, pass: pass?, block, snapshot: snapshot? };
        planner.reset()?;
        Ok(planner)
    }

    /// Puts everything back to the start of the run.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn reset(&self) -> Result<()> {
        let (b, s) = (&self.run.buffers, &self.run.settings);
        b.settings.upload(&[*s])?;
        b.splats.upload(&self.start)?;
        b.control.upload(&[Control {
            first: s.kept,
            live: if s.round_length > 0 { s.kept + 1 } else { s.splats },
            step: 1,
            rate: 1.0,
            ..Control::default()
        }])?;
        let mut commands = Recorder::new(&self.run.context)?;
        commands.fill(&b.moments, 0);
        commands.fill(&b.mailbox, 0);
        commands.fill(&b.arrivals, 0);
        self.pass.reset(&self.run, &mut commands)?;
        commands.submit_and_wait()?;
        self.between_blocks()
    }

    /// What the objective does on the host before each block: where cameras are to connect (`connect`), it links each anew to the neighbours
    /// that it has now. [`Planner::run`] calls it; who submits blocks does so between them, while nothing of this planner runs on the device.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn between_blocks(&self) -> Result<()> {
        self.pass.between_blocks(&self.run)
    }

    /// The settings of the run.
    pub fn settings(&self) -> &Settings {
        &self.run.settings
    }

    /// The configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// What the objective has on the device, where that is a `T`: [`super::expected_quality::QualityPass`] or
    /// [`super::paper::PaperPass`].
    pub fn pass<T: 'static>(&self) -> Option<&T> {
        let pass: &dyn Any = &*self.pass;
        pass.downcast_ref()
    }

    /// The splats at the start, kept ones first.
    pub fn start(&self) -> &[CameraState] {
        &self.start
    }

    /// Length of a block of commands: the greatest that checkpoints and what the objective does between iterations are multiples of.
    pub fn block(&self) -> u32 {
        self.block
    }

    /// Records one block: a snapshot, what the objective does before a block, then [`Planner::block`] iterations. The device
    /// counts the iterations, so a block can be submitted again and again; once the run is over it does nothing.
    ///
    /// # Errors
    /// None that the settings do not rule out.
    pub fn record_block(&self, commands: &mut Recorder) -> Result<()> {
        self.record_part(commands, 0..self.block())
    }

    /// Records some iterations of a block, for submissions that must be short: all parts of a block are to be submitted in order. What comes
    /// before the iterations goes with the first.
    ///
    /// # Errors
    /// As [`Planner::record_block`].
    pub fn record_part(&self, commands: &mut Recorder, iterations: Range<u32>) -> Result<()> {
        if iterations.start == 0 {
            self.record_snapshot(commands);
            self.pass.record_start(&self.run, commands);
        }
        self.pass.record(&self.run, commands, iterations, self.block())
    }

    fn record_snapshot(&self, commands: &mut Recorder) {
        let b = &self.run.buffers;
        commands
            .stage(
                &self.snapshot,
                SnapshotStage {
                    settings: &b.settings,
                    control: &b.control,
                    splats: &b.splats,
                    snapshots: &b.snapshots,
                },
            )
            .push(&SnapshotPush { interval: self.config.checkpoint_every.max(1) })
            .linear(self.run.settings.splats.div_ceil(64));
    }

    /// Records one iteration, without what a block begins with.
    ///
    /// # Errors
    /// None that the settings do not rule out.
    pub fn record_iteration(&self, commands: &mut Recorder) -> Result<()> {
        self.pass.record(&self.run, commands, 0..1, 1)
    }

    /// The splats as they are now, kept ones first.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn splats(&self) -> Result<Vec<CameraState>> {
        self.run.splats()
    }

    /// Gradient of the whole loss by each splat's pose and its utility, as of the last iteration.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn gradients(&self) -> Result<Vec<Gradient>> {
        self.run.buffers.gradients.download(self.run.settings.splats as usize)
    }
}

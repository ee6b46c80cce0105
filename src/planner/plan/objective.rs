//! What a plan minimises: what is an objective's own before the device has allocated anything, and what is its own on it.

use std::any::Any;
use std::ops::Range;
use std::sync::Arc;

use super::buffers::Buffers;
use super::shared::{CameraState, Record, Settings};
use crate::Result;
use crate::engine::vulkan::footprint::Footprint;
use crate::engine::vulkan::{Context, Recorder};
use crate::visibility::device_scene::DeviceScene;

/// An objective, ready for a problem and known to suit the device.
pub(crate) trait Objective: Any + Send + Sync {
    /// Iterations a view where views are added one at a time; 0 where all move at once.
    fn round_length(&self) -> u32 {
        0
    }

    /// Iterations between one time and the next that it does something before an iteration; 0 for never. Blocks of commands begin there.
    fn period(&self) -> u32 {
        0
    }

    /// Its buffers by name and bytes, for blocks of so many iterations. Among them are `slots` and `partials`, which the end of an iteration
    /// reads (`planner/plan/update.glsl`).
    fn buffers(&self, context: &Context, settings: &Settings, block: u32) -> Vec<(&'static str, u64)>;

    /// Names of entries of [`Objective::buffers`] that cover several buffers, none of which is the whole.
    fn several(&self) -> &'static [&'static str] {
        &[]
    }

    /// Allocates and compiles what it has on the device. Buffers are filled on the calling thread: a host's lock may be of threads.
    ///
    /// # Errors
    /// A surface that no camera can see from the region, or a device that fails.
    fn on_device(
        &self,
        context: &Arc<Context>,
        scene: &Arc<DeviceScene>,
        settings: &Settings,
        footprint: &Footprint,
    ) -> Result<Box<dyn Pass>>;

    /// The same with more capacity, where a run needed `needed` of it; none where that does not help.
    fn with_capacity(&self, _needed: [u32; 2]) -> Option<Arc<dyn Objective>> {
        None
    }
}

/// What all objectives have on the device.
pub(crate) struct Run {
    pub(super) context: Arc<Context>,
    pub(super) scene: Arc<DeviceScene>,
    pub(super) settings: Settings,
    pub(super) buffers: Buffers,
}

impl Run {
    /// Iterations done so far; may be called during a run.
    pub(super) fn done(&self) -> u32 {
        self.buffers.mailbox.peek(super::clock::mailbox::DONE).unwrap_or(0)
    }

    /// The splats as they are now, kept ones first.
    ///
    /// # Errors
    /// Where the device fails.
    pub(super) fn splats(&self) -> Result<Vec<CameraState>> {
        self.buffers.splats.download(self.settings.splats as usize)
    }
}

/// An objective's part of a run on the device.
pub(crate) trait Pass: Any + Send + Sync {
    /// Puts its own state back to the start of the run.
    ///
    /// # Errors
    /// Where the device fails.
    fn reset(&self, run: &Run, commands: &mut Recorder) -> Result<()>;

    /// Whether [`Pass::between_blocks`] does anything, which nothing may be running for.
    fn waits_between_blocks(&self) -> bool {
        false
    }

    /// What it does on the host before a block of commands.
    ///
    /// # Errors
    /// Where the device fails.
    fn between_blocks(&self, _run: &Run) -> Result<()> {
        Ok(())
    }

    /// Records what it does before the first iteration of a block.
    fn record_start(&self, _run: &Run, _commands: &mut Recorder) {}

    /// Records some iterations of a block of so many: the objective's gradients, then the end of the iteration (`planner/plan/update.glsl`). All
    /// parts of a block are recorded in order.
    ///
    /// # Errors
    /// None that the settings do not rule out.
    fn record(&self, run: &Run, commands: &mut Recorder, iterations: Range<u32>, block: u32) -> Result<()>;

    /// Stages of an iteration at most.
    fn stages(&self) -> u32;

    /// Most that any iteration needed of what it has a capacity for.
    fn needed(&self, _run: &Run) -> [u32; 2] {
        [0; 2]
    }

    /// The same where the run had less.
    fn overflow(&self, _run: &Run) -> Option<[u32; 2]> {
        None
    }

    /// What its penalties add to the loss of an iteration.
    fn penalty(&self, record: &Record) -> f32 {
        record.penalty
    }

    /// The scale that its splats share, where they have one.
    fn scale(&self, _record: &Record) -> Option<f32> {
        None
    }
}

#[cfg(test)]
#[path = "objective_tests.rs"]
mod tests;

//! The run of a planner: blocks submitted until its iterations are done, and what they leave.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use glam::Vec3;

use super::clock::mailbox;
use super::planner::Planner;
use super::record::{IterationRecord, Status};
use super::shared::{CameraState, Record};
use crate::engine::vulkan::Recorder;
use crate::engine::vulkan::pace::Pace;
use crate::engine::vulkan::profile::Profile;
use crate::scene::camera::Pose;
use crate::{Error, Result};

/// About how many iterations are submitted ahead: enough that the device never waits for the host, and few enough that a stopped
/// run soon ends, since submitted blocks must still pass through the device, though empty.
const AHEAD: u32 = 800;

/// What a run leaves.
pub struct Outcome {
    /// Planned poses in the user's world, kept cameras left out.
    pub poses: Vec<Pose>,
    /// Loss by iteration.
    pub history: Vec<IterationRecord>,
    /// Planned poses by iteration, from the start on.
    pub snapshots: Vec<(u32, Vec<Pose>)>,
    /// Whether all iterations ran.
    pub status: Status,
    /// Wall time of the iterations.
    pub seconds: f64,
}

impl Planner {
    /// Iterations done so far; may be called during a run.
    pub fn done(&self) -> u32 {
        self.run.done()
    }

    /// Runs all iterations. `observe` is called every few milliseconds with the number of iterations done and may stop the run
    /// after the current one. With a profile every stage is timed.
    ///
    /// # Errors
    /// Where the device fails, or a probe saw more splats than the capacity.
    pub fn run(
        &self,
        mut profile: Option<&mut Profile>,
        mut observe: impl FnMut(u32) -> ControlFlow<()>,
    ) -> Result<Outcome> {
        let started = Instant::now();
        let (block, blocks) = (self.block(), self.run.settings.iterations.div_ceil(self.block()));
        let mut asked = false;
        // Of iterations; the first is submitted alone.
        let mut pace = Pace::new(&self.run.context, 1);
        let block_by_block =
            self.run.context.debug_sync() || self.run.context.submits_one_by_one() || self.pass.waits_between_blocks();
        if profile.is_some() || block_by_block {
            for block in 0..blocks {
                // Before the first it was done with the start.
                if block > 0 {
                    self.between_blocks()?;
                }
                asked = match profile.as_deref_mut() {
                    Some(profile) => {
                        self.run_timed(&mut pace, profile)?;
                        observe(self.done()).is_break()
                    }
                    None => self.run_block(&mut pace, &mut observe)?,
                };
                if asked {
                    break;
                }
            }
        } else {
            asked = self.run_block(&mut pace, &mut observe)?;
            let ahead = (AHEAD / block).max(2) as usize;
            let mut left = if asked { 0 } else { blocks - 1 };
            let (mut commands, mut each) = self.block_in_parts(&pace)?;
            let mut looked = (Instant::now(), self.done());
            loop {
                let (now, done) = (Instant::now(), self.done());
                if done >= looked.1 + each {
                    pace.took(done - looked.1, now - looked.0);
                    looked = (now, done);
                }
                // Iterations have become so slow that submissions would be too long: shorter ones follow when these have run.
                let too_long = pace.items() < each / 3;
                if too_long && left > 0 && commands.pending()? == 0 {
                    (commands, each) = self.block_in_parts(&pace)?;
                }
                // The device continues meanwhile: two reads may differ.
                let due = if too_long { 0 } else { due(commands.pending()?, left, ahead) };
                for _ in 0..due {
                    commands.submit()?;
                }
                left -= due;
                if left == 0 && commands.pending()? == 0 {
                    break;
                }
                std::thread::sleep(Duration::from_millis(2));
                if observe(self.done()).is_break() {
                    self.run.buffers.mailbox.poke(mailbox::STOP, 1);
                    (asked, left) = (true, 0);
                }
            }
            commands.wait()?;
        }
        let outcome = Outcome { seconds: started.elapsed().as_secs_f64(), ..self.outcome()? };
        if outcome.status == Status::Interrupted && !asked {
            let (done, all) = (self.done(), self.run.settings.iterations);
            return Err(Error::request(format!(
                "the plan ended after {done} of {all} iterations without a request to stop; reset the planner before it runs again"
            )));
        }
        Ok(outcome)
    }

    /// A block in submissions of as many iterations as the pace allows, and how many that are.
    fn block_in_parts(&self, pace: &Pace) -> Result<(Recorder, u32)> {
        let each = pace.items().min(self.block());
        let mut commands = Recorder::new(&self.run.context)?;
        self.record_in_parts(&mut commands, each)?;
        Ok((commands, each))
    }

    /// Records a block in submissions of so many iterations.
    fn record_in_parts(&self, commands: &mut Recorder, each: u32) -> Result<()> {
        for first in (0..self.block()).step_by(each as usize) {
            if first > 0 {
                commands.cut()?;
            }
            self.record_part(commands, first..(first + each).min(self.block()))?;
        }
        Ok(())
    }

    /// Runs a block in submissions whose length `pace` learns from one another, and answers whether a stop was requested.
    fn run_block(&self, pace: &mut Pace, observe: &mut impl FnMut(u32) -> ControlFlow<()>) -> Result<bool> {
        let mut first = 0;
        while first < self.block() {
            let end = (first + pace.items()).min(self.block());
            let mut commands = Recorder::paced(&self.run.context)?;
            self.record_part(&mut commands, first..end)?;
            pace.took(end - first, commands.submit_and_wait()?);
            first = end;
            if observe(self.done()).is_break() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Runs a block with every stage timed.
    fn run_timed(&self, pace: &mut Pace, profile: &mut Profile) -> Result<()> {
        let mut commands = Recorder::timed(&self.run.context, self.stages_of_a_block())?;
        self.record_in_parts(&mut commands, pace.items())?;
        let submitted = Instant::now();
        pace.took(self.block(), commands.submit_and_wait()?);
        profile.device(submitted, &commands.timings()?);
        Ok(())
    }

    /// Most that any iteration needed of what the objective has a capacity for; of the paper's objective pairs of probe and visible splat, and
    /// (tile, splat) instances.
    pub fn needed(&self) -> [u32; 2] {
        self.pass.needed(&self.run)
    }

    /// Timestamps that a block needs at most.
    pub fn stages_of_a_block(&self) -> u32 {
        1 + (self.pass.stages() + 2) * self.block()
    }

    /// What iterations needed where that exceeded the capacity.
    pub(super) fn overflow(&self) -> Option<[u32; 2]> {
        self.pass.overflow(&self.run)
    }

    /// What the blocks that were recorded with [`Planner::record_block`] and have been waited for leave, by whichever submitter.
    /// The time they took is the submitter's to measure and zero here.
    ///
    /// # Errors
    /// Where the device fails, or a probe saw more splats than the capacity.
    pub fn outcome(&self) -> Result<Outcome> {
        if let Some([pairs, instances]) = self.overflow() {
            return Err(Error::request(format!(
                "the plan needs capacity for {pairs} visible pairs and {instances} tile instances and had less; use fewer `probes` or a \
                 larger device"
            )));
        }
        let done = self.done();
        let history: Vec<Record> = self.run.buffers.history.download(done as usize)?;
        let history = history.iter().zip(0..).map(|(record, iteration)| self.iteration(iteration, record)).collect();
        let poses = self.poses(&self.splats()?, true);
        let rows = done.div_ceil(self.config.checkpoint_every.max(1)) as usize;
        let all: Vec<CameraState> = self.run.buffers.snapshots.download(rows * self.run.settings.splats as usize)?;
        let mut snapshots: Vec<_> = all
            .chunks_exact(self.run.settings.splats as usize)
            .zip(0..)
            .map(|(splats, row)| (row * self.config.checkpoint_every.max(1), self.poses(splats, false)))
            .collect();
        snapshots.push((done, poses.clone()));
        let status = if done >= self.run.settings.iterations { Status::Complete } else { Status::Interrupted };
        Ok(Outcome { poses, history, snapshots, status, seconds: 0.0 })
    }

    fn iteration(&self, iteration: u32, record: &Record) -> IterationRecord {
        let Record { loss: image, penalty: reg, bound, .. } = *record;
        IterationRecord {
            iteration,
            loss: image + self.run.settings.lambda_bound * bound + self.pass.penalty(record),
            image,
            reg,
            bound,
            scale: self.pass.scale(record),
        }
    }

    /// Poses in the user's world of the planned splats. The region's pull is soft, so a camera may end a little outside;
    /// `settle` moves it to the nearest feasible place.
    fn poses(&self, splats: &[CameraState], settle: bool) -> Vec<Pose> {
        let back = self.run.scene.geometry.to_internal.inverse();
        let up = back.direction(self.run.scene.geometry.region.up);
        splats[self.run.settings.kept as usize..]
            .iter()
            .map(|splat| {
                let mut position = Vec3::from(splat.centre).as_dvec3();
                if settle {
                    position = self.run.scene.geometry.settle(position);
                }
                let direction = Vec3::from(splat.direction).as_dvec3();
                Pose::looking(back.point(position), back.direction(direction), up)
            })
            .collect()
    }
}

/// Blocks to submit now, where `pending` run and `left` are to come: as many as keep `ahead` of them running.
fn due(pending: usize, left: u32, ahead: usize) -> u32 {
    left.min(ahead.saturating_sub(pending) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a device that is faster than the host would end a run early, or blocks would be submitted without end.
    #[test]
    fn every_block_is_submitted_whatever_the_device_has_done() {
        assert_eq!((due(0, 5, 16), due(0, 40, 16), due(10, 40, 16), due(16, 40, 16), due(0, 0, 16)), (5, 16, 6, 0, 0));
        // A device that takes any number of blocks between two polls.
        let (mut left, mut pending, mut submitted) = (200, 0, 0);
        for look in 0..1000 {
            let now = due(pending, left, 16);
            (left, submitted) = (left - now, submitted + now);
            pending = (pending + now as usize).saturating_sub([0, 16, 3, 1][look % 4]);
        }
        assert_eq!((left, submitted), (0, 200));
    }
}

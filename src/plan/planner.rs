//! The planner: device state, the recording of iterations, and the run.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::Vec3;

use super::binned::Binned;
use super::buffers::Buffers;
use super::config::{Config, Objective};
use super::dense::DenseStage;
use super::footprint;
use super::preparation::{Preparation, dense_shape};
use super::probes;
use super::record::{IterationRecord, Status};
use super::relocate::{RankStage, RelocateStage};
use super::shared::{Control, Gradient, PlanConstants, Record, Settings, Splat, Tally};
use super::snapshot::{SnapshotPush, SnapshotStage};
use super::tally::mailbox;
use super::update::{UpdateQualityStage, UpdateSplatStage};
use super::viewed::Viewed;
use crate::quality::look::Look;
use crate::scene::camera::Pose;
use crate::visibility::device_scene::DeviceScene;
use crate::visibility::probe_depth::ProbeMaps;
use crate::vulkan::profile::Profile;
use crate::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::{Error, Result};

/// About how many iterations are submitted ahead: enough that the device never waits for the host, and few enough that a
/// run that is broken off soon ends, for what is submitted must still pass through the device, empty as it is.
const AHEAD: u32 = 800;

/// A plan in the making: all device state of one run.
pub struct Planner<'a> {
    context: Arc<Context>,
    scene: &'a DeviceScene,
    config: Config,
    settings: Settings,
    start: Vec<Splat>,
    start_scale: f32,
    maps: ProbeMaps,
    pipelines: Pipelines,
    buffers: Buffers,
}

/// The way through the splat pass.
enum Way {
    Dense(Pipeline),
    Binned(Box<Binned>),
    Viewed(Box<Viewed>),
}

struct Pipelines {
    splat: Way,
    update: Pipeline,
    rank: Pipeline,
    relocate: Pipeline,
    snapshot: Pipeline,
}

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

impl<'a> Planner<'a> {
    /// Allocates a run and casts its depth maps.
    ///
    /// # Errors
    /// A surface that no camera can see from the region, or a plan that is larger than the device's memory.
    pub fn new(context: &Arc<Context>, scene: &'a DeviceScene, preparation: Preparation) -> Result<Self> {
        let Preparation { config, mut settings, points, viewers, around, start, start_scale, .. } = preparation;
        let Preparation { resolution, binned, footprint, .. } = preparation;
        footprint::check(&footprint, context)?;
        let maps = probes::reachable(context, scene, points, resolution, config.preset)?;
        settings.pool = maps.probes.len() as u32;
        let quality = config.objective == Objective::Quality;
        if !quality {
            settings.probes = settings.probes.min(settings.pool);
        }
        let [threads, each] = dense_shape(context.physical());
        let constants = PlanConstants {
            resolution,
            gate: config.gate,
            kernel: config.kernel,
            occlusion: config.occlusion,
            threads,
            each,
        };
        let splat = || {
            if quality {
                let looks = Buffer::device(context, "looks", footprint.bytes_of("looks")?)?;
                let of = (&viewers[..], around);
                return Ok(Way::Viewed(Box::new(Viewed::new(
                    context,
                    &settings,
                    of,
                    (config.gate, scene.constants()),
                    looks,
                )?)));
            }
            if binned {
                let buffer = |name: &str| Buffer::device(context, name, footprint.bytes_of(name)?);
                return Ok(Way::Binned(Box::new(Binned::new(context, &settings, &constants, buffer)?)));
            }
            Ok(Way::Dense(Pipeline::new::<DenseStage>(context, &constants)?))
        };
        let update = if quality { Pipeline::new::<UpdateQualityStage> } else { Pipeline::new::<UpdateSplatStage> };
        let [rank, relocate] = [Pipeline::new::<RankStage>, Pipeline::new::<RelocateStage>];
        let others =
            || Pipeline::several(context, &constants, [update, rank, relocate, Pipeline::new::<SnapshotStage>]);
        let (splat, others): (Result<Way>, _) = rayon::join(splat, others);
        let [update, rank, relocate, snapshot] = others?;
        let pipelines = Pipelines { splat: splat?, update, rank, relocate, snapshot };
        let buffers = Buffers::new(context, &footprint, resolution)?;
        let context = context.clone();
        let planner = Self { context, scene, config, settings, start, start_scale, maps, pipelines, buffers };
        planner.reset()?;
        Ok(planner)
    }

    /// Puts everything back to the start of the run.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn reset(&self) -> Result<()> {
        let b = &self.buffers;
        let s = &self.settings;
        b.settings.upload(&[*s])?;
        b.splats.upload(&self.start)?;
        b.control.upload(&[Control {
            first: s.kept,
            live: if s.round_length > 0 { s.kept + 1 } else { s.splats },
            step: 1,
            rate: 1.0,
            log_scale: self.start_scale.ln(),
            ..Control::default()
        }])?;
        let mut commands = Recorder::new(&self.context)?;
        commands.fill(&b.moments, 0);
        commands.fill(&b.mailbox, 0);
        commands.fill(&b.arrivals, 0);
        commands.fill(&b.deficit, 0);
        commands.submit_and_wait()
    }

    /// What the run is set to.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Probes and depth maps of the run.
    pub fn maps(&self) -> &ProbeMaps {
        &self.maps
    }

    /// The looks of the last iteration; none where the objective has no viewers.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn looks(&self) -> Result<Vec<Look>> {
        match &self.pipelines.splat {
            Way::Viewed(viewed) => viewed.looks(),
            _ => Ok(Vec::new()),
        }
    }

    /// The splats at the start, kept ones first.
    pub fn start(&self) -> &[Splat] {
        &self.start
    }

    /// Scale at the start.
    pub fn start_scale(&self) -> f32 {
        self.start_scale
    }

    /// Length of a block of commands: the greatest that both checkpoints and relocations are multiples of.
    pub fn block(&self) -> u32 {
        footprint::block(&self.settings, &self.config)
    }

    /// Records one block: a snapshot, a relocation where it is time, then [`Planner::block`] iterations. The device
    /// counts the iterations, so a block can be submitted again and again; once the run is over it does nothing.
    ///
    /// # Errors
    /// None that the settings do not rule out.
    pub fn record_block(&'a self, commands: &mut Recorder<'a>) -> Result<()> {
        let (b, p, s) = (&self.buffers, &self.pipelines, &self.settings);
        commands
            .stage(
                &p.snapshot,
                SnapshotStage {
                    settings: &b.settings,
                    control: &b.control,
                    splats: &b.splats,
                    snapshots: &b.snapshots,
                },
            )
            .push(&SnapshotPush { interval: self.config.checkpoint_every.max(1) })
            .linear(s.splats.div_ceil(64));
        // Blocks start at multiples of their length; the device knows whether this one is due.
        if s.relocate_every > 0 {
            self.record_relocation(commands);
        }
        for _ in 0..self.block() {
            self.record_iteration(commands)?;
        }
        Ok(())
    }

    fn record_relocation(&'a self, commands: &mut Recorder<'a>) {
        let (b, p, s, scene, maps) = (&self.buffers, &self.pipelines, &self.settings, self.scene, &self.maps);
        let least = ((s.splats - s.kept) / 10).max(1);
        commands
            .stage(
                &p.rank,
                RankStage { settings: &b.settings, control: &b.control, moments: &b.moments, order: &b.order },
            )
            .linear(s.splats.div_ceil(64));
        commands
            .stage(
                &p.relocate,
                RelocateStage {
                    settings: &b.settings,
                    control: &b.control,
                    splats: &b.splats,
                    probes: &maps.probe_buffer,
                    directions: &b.directions,
                    depth: &maps.depth,
                    deficit: &b.deficit,
                    moments: &b.moments,
                    order: &b.order,
                    region: &scene.region,
                    free_distance: &scene.free_distance,
                    tallies: &b.tallies,
                },
            )
            .groups([least, 1, 1]);
    }

    /// Records one iteration: splat pass and update.
    ///
    /// # Errors
    /// None that the settings do not rule out.
    pub fn record_iteration(&'a self, commands: &mut Recorder<'a>) -> Result<()> {
        let (b, p, s, scene, maps) = (&self.buffers, &self.pipelines, &self.settings, self.scene, &self.maps);
        match &p.splat {
            Way::Binned(binned) => binned.record(commands, s, maps, b)?,
            Way::Viewed(viewed) => viewed.record(commands, scene, b),
            Way::Dense(dense) => commands
                .stage(
                    dense,
                    DenseStage {
                        settings: &b.settings,
                        control: &b.control,
                        splats: &b.splats,
                        probes: &maps.probe_buffer,
                        directions: &b.directions,
                        depth: &maps.depth,
                        visible: &b.visible,
                        slots: &b.slots,
                        partials: &b.partials,
                        tallies: &b.tallies,
                        deficit: &b.deficit,
                    },
                )
                .groups([s.probes, s.blocks, 1]),
        }
        match &p.splat {
            Way::Viewed(_) => commands
                .stage(
                    &p.update,
                    UpdateQualityStage {
                        settings: &b.settings,
                        control: &b.control,
                        splats: &b.splats,
                        slots: &b.slots,
                        partials: &b.partials,
                        tallies: &b.tallies,
                        moments: &b.moments,
                        terms: &b.terms,
                        gradients: &b.gradients,
                        region: &scene.region,
                        free_distance: &scene.free_distance,
                        history: &b.history,
                        mailbox: &b.mailbox,
                        arrivals: &b.arrivals,
                    },
                )
                .linear(s.splats),
            Way::Dense(_) | Way::Binned(_) => commands
                .stage(
                    &p.update,
                    UpdateSplatStage {
                        settings: &b.settings,
                        control: &b.control,
                        splats: &b.splats,
                        slots: &b.slots,
                        partials: &b.partials,
                        tallies: &b.tallies,
                        moments: &b.moments,
                        terms: &b.terms,
                        gradients: &b.gradients,
                        region: &scene.region,
                        free_distance: &scene.free_distance,
                        history: &b.history,
                        mailbox: &b.mailbox,
                        arrivals: &b.arrivals,
                        probes: &maps.probe_buffer,
                        depth: &maps.depth,
                    },
                )
                .linear(s.splats),
        }
        Ok(())
    }

    /// Iterations done so far; may be called while a run goes on.
    pub fn done(&self) -> u32 {
        self.buffers.mailbox.peek(mailbox::DONE).unwrap_or(0)
    }

    /// Runs all iterations. `observe` is called every few milliseconds with the number of iterations done and may break
    /// the run off after the one that is running. With a profile every stage is timed.
    ///
    /// # Errors
    /// Where the device fails, or a probe saw more splats than there was room for.
    pub fn run(
        &'a self,
        mut profile: Option<&mut Profile>,
        mut observe: impl FnMut(u32) -> ControlFlow<()>,
    ) -> Result<Outcome> {
        let started = Instant::now();
        let blocks = self.settings.iterations.div_ceil(self.block());
        let mut asked = false;
        if profile.is_some() || self.context.debug_sync() {
            for _ in 0..blocks {
                let stages = self.stages_of_a_block();
                let mut commands = match profile {
                    Some(_) => Recorder::timed(&self.context, stages)?,
                    None => Recorder::new(&self.context)?,
                };
                self.record_block(&mut commands)?;
                let submitted = Instant::now();
                commands.submit_and_wait()?;
                if let Some(profile) = profile.as_deref_mut() {
                    profile.device(submitted, &commands.timings()?);
                }
                asked = observe(self.done()).is_break();
                if asked {
                    break;
                }
            }
        } else {
            let mut commands = Recorder::new(&self.context)?;
            self.record_block(&mut commands)?;
            let ahead = (AHEAD / self.block()).max(2) as usize;
            let mut left = blocks;
            loop {
                // The device goes on meanwhile: asked twice, it may say two things.
                let due = due(commands.pending(), left, ahead);
                for _ in 0..due {
                    commands.submit()?;
                }
                left -= due;
                if left == 0 && commands.pending() == 0 {
                    break;
                }
                std::thread::sleep(Duration::from_millis(2));
                if observe(self.done()).is_break() {
                    self.buffers.mailbox.poke(mailbox::STOP, 1);
                    (asked, left) = (true, 0);
                }
            }
            commands.wait()?;
        }
        let outcome = Outcome { seconds: started.elapsed().as_secs_f64(), ..self.outcome()? };
        if outcome.status == Status::Interrupted && !asked {
            let (done, all) = (self.done(), self.settings.iterations);
            return Err(Error::request(format!(
                "the plan ended after {done} of {all} iterations, and nobody stopped it"
            )));
        }
        Ok(outcome)
    }

    /// Pairs of probe and visible splat and (tile, splat) instances of the iteration of the binned pass that had most;
    /// zero for the dense pass.
    pub fn most_binned(&self) -> (u32, u32) {
        let word = |word| self.buffers.mailbox.peek(word).unwrap_or(0);
        (word(mailbox::MAX_PAIRS), word(mailbox::MAX_INSTANCES))
    }

    /// Timestamps that a block needs at most.
    pub fn stages_of_a_block(&self) -> u32 {
        let splat = match self.pipelines.splat {
            Way::Dense(_) => 1,
            Way::Viewed(_) => 2,
            // Nine stages and a fill, two scans of three stages, seven or eight sorting passes of three.
            Way::Binned(_) => 10 + 6 + 24,
        };
        1 + (splat + 3) * self.block()
    }

    /// Pairs and instances that an iteration had (a probe's splats in the dense pass), where that was more than there was room for.
    pub(super) fn overflow(&self) -> Option<[u32; 2]> {
        let needed = |word| self.buffers.mailbox.peek(word).unwrap_or(0);
        let [pairs, instances] = match self.pipelines.splat {
            Way::Dense(_) => [needed(mailbox::MAX_VISIBLE), 0],
            Way::Viewed(_) => [0, 0],
            Way::Binned(_) => [needed(mailbox::MAX_PAIRS), needed(mailbox::MAX_INSTANCES)],
        };
        (pairs > self.settings.capacity || instances > self.settings.instances).then_some([pairs, instances])
    }

    /// What the blocks that were recorded with [`Planner::record_block`] and have been waited for leave, whoever
    /// submitted them. The time they took is the submitter's to measure and zero here.
    ///
    /// # Errors
    /// Where the device fails, or a probe saw more splats than there was room for.
    pub fn outcome(&self) -> Result<Outcome> {
        if let Some([pairs, instances]) = self.overflow() {
            return Err(Error::request(format!(
                "the plan needs room for {pairs} visible pairs and {instances} tile instances and had less; use fewer `probes` or a \
                 larger device"
            )));
        }
        let done = self.done();
        let history: Vec<Record> = self.buffers.history.download(done as usize)?;
        let history = history.iter().zip(0..).map(|(record, iteration)| self.iteration(iteration, record)).collect();
        let poses = self.poses(&self.splats()?, true);
        let rows = done.div_ceil(self.config.checkpoint_every.max(1)) as usize;
        let all: Vec<Splat> = self.buffers.snapshots.download(rows * self.settings.splats as usize)?;
        let mut snapshots: Vec<_> = all
            .chunks_exact(self.settings.splats as usize)
            .zip(0..)
            .map(|(splats, row)| (row * self.config.checkpoint_every.max(1), self.poses(splats, false)))
            .collect();
        snapshots.push((done, poses.clone()));
        let status = if done >= self.settings.iterations { Status::Complete } else { Status::Interrupted };
        Ok(Outcome { poses, history, snapshots, status, seconds: 0.0 })
    }

    fn iteration(&self, iteration: u32, record: &Record) -> IterationRecord {
        let s = &self.settings;
        let scale = record.log_scale.exp();
        let splat = self.config.objective == Objective::Splat;
        let weighed = if splat { s.lambda_reg * record.reg + s.lambda_scale * scale * scale } else { 0.0 };
        IterationRecord {
            iteration,
            loss: record.image + s.lambda_bound * record.bound + weighed,
            image: record.image,
            reg: record.reg,
            bound: record.bound,
            scale,
        }
    }

    /// The splats as they are now, kept ones first.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn splats(&self) -> Result<Vec<Splat>> {
        self.buffers.splats.download(self.settings.splats as usize)
    }

    /// Gradient of the whole loss by each splat's pose and its utility, as of the last iteration.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn gradients(&self) -> Result<Vec<Gradient>> {
        self.buffers.gradients.download(self.settings.splats as usize)
    }

    /// What each block of texels of each probe contributed to the last iteration.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn tallies(&self) -> Result<Vec<Tally>> {
        self.buffers.tallies.download((self.settings.probes * self.settings.blocks) as usize)
    }

    /// Poses in the user's world of the planned splats. The region's pull is soft, so a camera may end a little outside;
    /// `settle` moves it to the nearest feasible place.
    fn poses(&self, splats: &[Splat], settle: bool) -> Vec<Pose> {
        let back = self.scene.geometry.to_internal.inverse();
        let up = back.direction(self.scene.geometry.region.up);
        splats[self.settings.kept as usize..]
            .iter()
            .map(|splat| {
                let mut position = Vec3::from(splat.centre).as_dvec3();
                if settle {
                    position = self.scene.geometry.settle(position);
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
        // A device that takes any number of blocks between two looks.
        let (mut left, mut pending, mut submitted) = (200, 0, 0);
        for look in 0..1000 {
            let now = due(pending, left, 16);
            (left, submitted) = (left - now, submitted + now);
            pending = (pending + now as usize).saturating_sub([0, 16, 3, 1][look % 4]);
        }
        assert_eq!((left, submitted), (0, 200));
    }
}

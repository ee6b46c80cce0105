//! The planner: device state and the recording of iterations.

use std::ops::Range;
use std::sync::Arc;

use super::binned::Binned;
use super::buffers::Buffers;
use super::config::{Config, Objective};
use super::dense::DenseStage;
use super::footprint;
use super::links::Links;
use super::preparation::{Preparation, dense_shape, update_threads};
use super::probes;
use super::relocate::{RankStage, RelocateStage};
use super::shared::{Control, Gradient, PlanConstants, Settings, Splat, Tally};
use super::snapshot::{SnapshotPush, SnapshotStage};
use super::update::{UpdateQualityStage, UpdateSplatStage};
use super::viewed::{Viewed, ViewedConstants, draws};
use crate::quality::look::Look;
use crate::visibility::device_scene::DeviceScene;
use crate::visibility::probe_depth::ProbeMaps;
use crate::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::{Error, Result};

/// All device state of one run.
pub struct Planner {
    pub(super) context: Arc<Context>,
    pub(super) scene: Arc<DeviceScene>,
    pub(super) config: Config,
    pub(super) settings: Settings,
    pub(super) start: Vec<Splat>,
    pub(super) start_scale: f32,
    pub(super) maps: ProbeMaps,
    pub(super) links: Option<Arc<Links>>,
    pub(super) pipelines: Pipelines,
    pub(super) buffers: Buffers,
}

/// The way through the splat pass.
pub(super) enum Way {
    Dense(Pipeline),
    Binned(Box<Binned>),
    Viewed(Box<Viewed>),
}

pub(super) struct Pipelines {
    pub(super) splat: Way,
    update: Pipeline,
    rank: Pipeline,
    relocate: Pipeline,
    snapshot: Pipeline,
}

impl Planner {
    /// Allocates a run and casts its depth maps.
    ///
    /// # Errors
    /// A surface that no camera can see from the region, or a plan that is larger than the device's memory.
    pub fn new(context: &Arc<Context>, scene: &Arc<DeviceScene>, preparation: Preparation) -> Result<Self> {
        let Preparation { config, mut settings, points, viewers, around, start, start_scale, .. } = preparation;
        let Preparation { resolution, binned, footprint, links, lanes, .. } = preparation;
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
        let buffer = |name: &str| Buffer::device(context, name, footprint.bytes_of(name)?);
        let splat = || {
            if quality {
                let constants = ViewedConstants::new(config.gate, scene.constants(), lanes);
                let viewed = Viewed::new(context, &settings, (&viewers, around), constants, buffer)?;
                return Ok(Way::Viewed(Box::new(viewed)));
            }
            if binned {
                return Ok(Way::Binned(Box::new(Binned::new(context, &settings, &constants, buffer)?)));
            }
            Ok(Way::Dense(Pipeline::new::<DenseStage>(context, &constants)?))
        };
        let update = if quality { Pipeline::new::<UpdateQualityStage> } else { Pipeline::new::<UpdateSplatStage> };
        let [rank, relocate] = [Pipeline::new::<RankStage>, Pipeline::new::<RelocateStage>];
        let of_update = PlanConstants { threads: update_threads(context.physical(), settings.splats), ..constants };
        let others =
            || Pipeline::several(context, &of_update, [update, rank, relocate, Pipeline::new::<SnapshotStage>]);
        // Buffers are filled on this thread: a host's lock may be of threads.
        let (mut compiled, mut way) = (None, None);
        rayon::in_place_scope(|scope| {
            scope.spawn(|_| compiled = Some(others()));
            way = Some(splat());
        });
        // The scope ends when both are there.
        let none = || Error::request("the pipelines of the planner were not compiled");
        let [update, rank, relocate, snapshot] = compiled.ok_or_else(none)??;
        let pipelines = Pipelines { splat: way.ok_or_else(none)??, update, rank, relocate, snapshot };
        let buffers = Buffers::new(context, &footprint, resolution)?;
        let (context, scene) = (context.clone(), scene.clone());
        let planner = Self { context, scene, config, settings, start, start_scale, maps, links, pipelines, buffers };
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
        if let Way::Viewed(viewed) = &self.pipelines.splat {
            commands.fill(viewed.arrivals(), 0);
        }
        commands.fill(&b.deficit, 0);
        commands.submit_and_wait()?;
        self.link()
    }

    /// Where cameras are to connect (`connect`), links each anew to the neighbours that it has now. [`Planner::run`] does so before every
    /// block; who submits blocks does it between them, while nothing of this planner runs on the device.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn link(&self) -> Result<()> {
        let Some(links) = &self.links else { return Ok(()) };
        let [starts, anchors] = [&self.buffers.anchor_starts, &self.buffers.anchors];
        let done = self.done() as f32 / self.settings.iterations as f32;
        let kept = self.settings.kept as usize;
        let (from, of) = links.anchors(&self.scene.geometry.bvh, &self.splats()?, kept, done);
        starts.upload(&from)?;
        if of.is_empty() { Ok(()) } else { anchors.upload(&of) }
    }

    /// The settings of the run.
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

    /// Looks of the first iteration of the last draw, which after a block is not the last iteration; none where the objective has no
    /// viewers.
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

    /// Records one block: a snapshot, a relocation where one is due, then [`Planner::block`] iterations. The device
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
            self.record_start(commands);
        }
        let (block, draws) = (self.block(), draws(self.settings.probes, self.block()));
        for i in iterations {
            if let (Way::Viewed(viewed), 0) = (&self.pipelines.splat, i % draws) {
                viewed.draw(commands, &self.scene, &self.buffers, draws.min(block - i));
            }
            self.record_drawn(commands, i % draws)?;
        }
        Ok(())
    }

    /// Records what a block begins with: a snapshot, and a relocation where one is due.
    fn record_start(&self, commands: &mut Recorder) {
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
    }

    fn record_relocation(&self, commands: &mut Recorder) {
        let (b, p, s, scene, maps) = (&self.buffers, &self.pipelines, &self.settings, &*self.scene, &self.maps);
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
    pub fn record_iteration(&self, commands: &mut Recorder) -> Result<()> {
        if let Way::Viewed(viewed) = &self.pipelines.splat {
            viewed.draw(commands, &self.scene, &self.buffers, 1);
        }
        self.record_drawn(commands, 0)
    }

    /// Records an iteration whose looks are the `nth` that were drawn.
    fn record_drawn(&self, commands: &mut Recorder, nth: u32) -> Result<()> {
        let (b, p, s, scene, maps) = (&self.buffers, &self.pipelines, &self.settings, &*self.scene, &self.maps);
        match &p.splat {
            Way::Binned(binned) => binned.record(commands, s, maps, b)?,
            Way::Viewed(viewed) => viewed.record(commands, scene, b, nth),
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
                        anchor_starts: &b.anchor_starts,
                        anchors: &b.anchors,
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
}

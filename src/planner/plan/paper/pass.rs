//! The paper's objective on the device: the splat pass, the end of the iteration, and relocation.

use std::ops::Range;
use std::sync::Arc;

use super::binned::Binned;
use super::dense::DenseStage;
use super::regulariser::UpdatePaperStage;
use super::relocate::{RankStage, RelocateStage};
use super::shared::{PaperConstants, PaperSettings, Scale, Tally};
use super::state::State;
use super::{Paper, mailbox};
use crate::Result;
use crate::engine::vulkan::footprint::Footprint;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::planner::plan::objective::{Pass, Run};
use crate::planner::plan::reachable::reachable;
use crate::planner::plan::shared::{Record, Settings};
use crate::planner::plan::update::update_threads;
use crate::scene::octahedral;
use crate::visibility::device_scene::DeviceScene;
use crate::visibility::probe_depth::ProbeMaps;

/// The way through the splat pass.
enum SplatPass {
    Dense { pipeline: Pipeline, visible: Buffer },
    Binned(Box<Binned>),
}

/// The objective on the device.
pub struct PaperPass {
    own: State,
    way: SplatPass,
    update: Pipeline,
    rank: Pipeline,
    relocate: Pipeline,
    order: Buffer,
    start_scale: f32,
}

impl PaperPass {
    pub(super) fn new(
        context: &Arc<Context>,
        scene: &DeviceScene,
        run: &Settings,
        paper: &Paper,
        footprint: &Footprint,
    ) -> Result<Self> {
        let constants = paper.constants;
        let maps = reachable(context, scene, paper.points.clone(), constants.resolution, paper.preset)?;
        let mut settings = paper.settings;
        settings.pool = maps.probes.len() as u32;
        settings.probes = settings.probes.min(settings.pool);
        let buffer = |name: &str| Buffer::device(context, name, footprint.bytes_of(name)?);
        let way = || {
            Ok(match paper.binned {
                true => SplatPass::Binned(Box::new(Binned::new(context, run, &settings, &constants, buffer)?)),
                false => {
                    let pipeline = Pipeline::new::<DenseStage>(context, &constants)?;
                    SplatPass::Dense { pipeline, visible: buffer("visible")? }
                }
            })
        };
        let of_update = PaperConstants { threads: update_threads(context.physical(), run.splats), ..constants };
        let others = || {
            let [rank, relocate] = [Pipeline::new::<RankStage>, Pipeline::new::<RelocateStage>];
            Pipeline::several(context, &of_update, [Pipeline::new::<UpdatePaperStage>, rank, relocate])
        };
        let (others, way): (_, Result<SplatPass>) = Pipeline::beside(others, way);
        let [update, rank, relocate] = others?;
        let directions: Vec<[f32; 4]> =
            octahedral::directions(constants.resolution).iter().map(|d| d.as_vec3().extend(0.0).to_array()).collect();
        let own = State {
            settings,
            maps,
            directions: Buffer::from_slice(context, "directions", &directions)?,
            paper: buffer("paper")?,
            scale: buffer("scale")?,
            tallies: buffer("tallies")?,
            deficit: buffer("deficit")?,
        };
        Ok(Self { own, way: way?, update, rank, relocate, order: buffer("order")?, start_scale: paper.start_scale })
    }

    /// Numbers of the run.
    pub fn settings(&self) -> &PaperSettings {
        &self.own.settings
    }

    /// Probes and depth maps of the run.
    pub fn maps(&self) -> &ProbeMaps {
        &self.own.maps
    }

    /// Scale at the start.
    pub fn start_scale(&self) -> f32 {
        self.start_scale
    }

    /// What each block of texels of each probe contributed to the last iteration.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn tallies(&self) -> Result<Vec<Tally>> {
        let settings = &self.own.settings;
        self.own.tallies.download((settings.probes * settings.blocks) as usize)
    }

    fn record_relocation(&self, run: &Run, commands: &mut Recorder) {
        let (b, own, s) = (&run.buffers, &self.own, &run.settings);
        let least = ((s.splats - s.kept) / 10).max(1);
        commands
            .stage(
                &self.rank,
                RankStage {
                    settings: &b.settings,
                    control: &b.control,
                    moments: &b.moments,
                    order: &self.order,
                    paper: &own.paper,
                },
            )
            .linear(s.splats.div_ceil(64));
        commands
            .stage(
                &self.relocate,
                RelocateStage {
                    settings: &b.settings,
                    control: &b.control,
                    splats: &b.splats,
                    probes: &own.maps.probe_buffer,
                    directions: &own.directions,
                    depth: &own.maps.depth,
                    deficit: &own.deficit,
                    moments: &b.moments,
                    order: &self.order,
                    region: &run.scene.region,
                    free_distance: &run.scene.free_distance,
                    tallies: &own.tallies,
                    paper: &own.paper,
                },
            )
            .groups([least, 1, 1]);
    }

    fn record_splats(&self, run: &Run, commands: &mut Recorder) -> Result<()> {
        let (b, own) = (&run.buffers, &self.own);
        let (pipeline, visible) = match &self.way {
            SplatPass::Binned(binned) => return binned.record(commands, run, own),
            SplatPass::Dense { pipeline, visible } => (pipeline, visible),
        };
        commands
            .stage(
                pipeline,
                DenseStage {
                    settings: &b.settings,
                    control: &b.control,
                    splats: &b.splats,
                    probes: &own.maps.probe_buffer,
                    directions: &own.directions,
                    depth: &own.maps.depth,
                    visible,
                    slots: &b.slots,
                    partials: &b.partials,
                    tallies: &own.tallies,
                    deficit: &own.deficit,
                    paper: &own.paper,
                    scale_state: &own.scale,
                    mailbox: &b.mailbox,
                },
            )
            .groups([own.settings.probes, own.settings.blocks, 1]);
        Ok(())
    }
}

impl Pass for PaperPass {
    fn reset(&self, _run: &Run, commands: &mut Recorder) -> Result<()> {
        self.own.paper.upload(&[self.own.settings])?;
        self.own.scale.upload(&[Scale { log_scale: self.start_scale.ln(), mean: 0.0, square: 0.0 }])?;
        commands.fill(&self.own.deficit, 0);
        Ok(())
    }

    fn record_start(&self, run: &Run, commands: &mut Recorder) {
        // Blocks start at multiples of their length; the device knows whether this one is due.
        if self.own.settings.relocate_every > 0 {
            self.record_relocation(run, commands);
        }
    }

    fn record(&self, run: &Run, commands: &mut Recorder, iterations: Range<u32>, _block: u32) -> Result<()> {
        let (b, own) = (&run.buffers, &self.own);
        for _ in iterations {
            self.record_splats(run, commands)?;
            commands
                .stage(
                    &self.update,
                    UpdatePaperStage {
                        settings: &b.settings,
                        control: &b.control,
                        splats: &b.splats,
                        slots: &b.slots,
                        partials: &b.partials,
                        moments: &b.moments,
                        terms: &b.terms,
                        gradients: &b.gradients,
                        region: &run.scene.region,
                        free_distance: &run.scene.free_distance,
                        history: &b.history,
                        mailbox: &b.mailbox,
                        arrivals: &b.arrivals,
                        tallies: &own.tallies,
                        probes: &own.maps.probe_buffer,
                        depth: &own.maps.depth,
                        paper: &own.paper,
                        scale_state: &own.scale,
                    },
                )
                .linear(run.settings.splats);
        }
        Ok(())
    }

    fn stages(&self) -> u32 {
        match self.way {
            SplatPass::Dense { .. } => 2,
            // Nine stages and a fill, two scans of three stages, seven or eight sorting passes of three, and the update.
            SplatPass::Binned(_) => 10 + 6 + 24 + 1,
        }
    }

    fn needed(&self, run: &Run) -> [u32; 2] {
        let word = |word| run.buffers.mailbox.peek(word).unwrap_or(0);
        match self.way {
            SplatPass::Dense { .. } => [word(mailbox::MAX_VISIBLE), 0],
            SplatPass::Binned(_) => [word(mailbox::MAX_PAIRS), word(mailbox::MAX_INSTANCES)],
        }
    }

    fn overflow(&self, run: &Run) -> Option<[u32; 2]> {
        let ([pairs, instances], settings) = (self.needed(run), &self.own.settings);
        (pairs > settings.capacity || instances > settings.instances).then_some([pairs, instances])
    }

    fn penalty(&self, record: &Record) -> f32 {
        let (settings, scale) = (&self.own.settings, record.state.exp());
        settings.lambda_reg * record.penalty + settings.lambda_scale * scale * scale
    }

    fn scale(&self, record: &Record) -> Option<f32> {
        Some(record.state.exp())
    }
}

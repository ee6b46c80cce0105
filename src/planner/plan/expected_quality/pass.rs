//! Expected quality on the device: looks of fresh viewers each iteration (`look.comp`, for many iterations at once), the gradients of the
//! splats nearest to them (`viewed.comp`), and the end of the iteration (`update_quality.comp`).

use std::ops::Range;
use std::sync::{Arc, Mutex};

use super::Quality;
use super::links::{Links, Sight};
use super::shared::{Anchor, QualitySettings, ViewerLoss};
use super::viewed::{ViewedConstants, ViewedPush, ViewedStage, draws};
use crate::Result;
use crate::engine::parallel::lock;
use crate::engine::vulkan::footprint::Footprint;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::planner::plan::objective::{Pass, Run};
use crate::planner::plan::reachable::reachable;
use crate::planner::plan::shared::{CameraState, Control, Gradient, Moments, Record, Settings};
use crate::planner::plan::update::{UpdateConstants, update_threads};
use crate::planner::quality::expected::{LOOKS, SIDE};
use crate::planner::quality::look::{Look, LookPush, LookStage, Viewer};
use crate::visibility::bvh::TraversalConstants;
use crate::visibility::device_scene::{DeviceRegion, DeviceScene};

crate::stage!(
    /// One Adam step, a workgroup per camera splat; the last one ends the iteration, and nothing else writes [`Control`].
    pub(crate) UpdateQualityStage = update_quality<UpdateConstants>(()) {
        read settings, write control, write splats, read slots, read partials, write moments, write terms, write gradients,
        read region, read free_distance, write history, write mailbox, write arrivals, read viewer_losses,
        read anchor_starts, read anchors, read quality,
    } with [Settings, Control, CameraState, Gradient, Moments, DeviceRegion, Record, ViewerLoss, Anchor, QualitySettings]
);

/// Texels along a side of the maps that test whether the region sees the surface.
const COARSE: u32 = 16;

/// The objective on the device.
pub struct QualityPass {
    settings: QualitySettings,
    draw: Pipeline,
    judge: Pipeline,
    update: Pipeline,
    looks_a_group: u32,
    quality: Buffer,
    viewers: Buffer,
    looks: Buffer,
    errors: Buffer,
    losses: Buffer,
    arrivals: Buffer,
    law: Buffer,
    push: LookPush,
    links: Option<Arc<Links>>,
    /// What kept cameras see, where cameras are to connect.
    kept: Mutex<Option<Vec<Sight>>>,
    anchor_starts: Buffer,
    anchors: Buffer,
}

impl QualityPass {
    pub(super) fn new(
        context: &Arc<Context>,
        scene: &DeviceScene,
        run: &Settings,
        quality: &Quality,
        footprint: &Footprint,
    ) -> Result<Self> {
        // Only the error counts, where nothing of the surface can be seen.
        reachable(context, scene, quality.points.clone(), COARSE, quality.preset)?;
        let constants = ViewedConstants::new(quality.gate, scene.constants(), quality.lanes);
        let traversal = TraversalConstants { discs: constants.discs };
        let of_update = UpdateConstants { threads: update_threads(context.physical(), run.splats) };
        let draw = || Pipeline::new::<LookStage>(context, &traversal);
        let judge = || Pipeline::new::<ViewedStage>(context, &constants);
        let update = || Pipeline::new::<UpdateQualityStage>(context, &of_update);
        let (draw, (judge, update)) = rayon::join(draw, || rayon::join(judge, update));
        let buffer = |name: &str| Buffer::device(context, name, footprint.bytes_of(name)?);
        Ok(Self {
            settings: quality.settings,
            draw: draw?,
            judge: judge?,
            update: update?,
            looks_a_group: constants.local_size_x / constants.lanes,
            quality: buffer("quality")?,
            viewers: Buffer::from_slice(context, "viewers", &quality.viewers)?,
            looks: buffer("looks")?,
            errors: buffer("errors")?,
            losses: buffer("viewer losses")?,
            arrivals: buffer("viewer arrivals")?,
            law: Buffer::from_slice(context, "law", &[quality.law])?,
            push: quality.around.push(quality.viewers.len() as u32, quality.settings.viewers, SIDE, quality.seed),
            links: quality.links.clone(),
            kept: Mutex::new(None),
            anchor_starts: buffer("anchor starts")?,
            anchors: buffer("anchors")?,
        })
    }

    /// Numbers of the run.
    pub fn settings(&self) -> &QualitySettings {
        &self.settings
    }

    /// Looks of the first iteration of the last draw, which after a block is not the last iteration.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn looks(&self) -> Result<Vec<Look>> {
        self.looks.download((self.push.count * LOOKS) as usize)
    }

    /// Viewers that there are.
    pub(in crate::planner::plan) fn pool(&self) -> usize {
        self.viewers.size() as usize / size_of::<Viewer>()
    }

    /// Puts as many others in their place.
    pub(in crate::planner::plan) fn look_from(&self, viewers: &[Viewer]) -> Result<()> {
        self.viewers.upload(viewers)
    }

    /// Records the looks of so many iterations to come, [`draws`] at most: many rays take as long as few, since they wait for memory.
    fn record_looks(&self, run: &Run, commands: &mut Recorder, iterations: u32) {
        let count = iterations * self.push.count;
        commands
            .stage(
                &self.draw,
                LookStage {
                    nodes: &run.scene.nodes,
                    primitives: &run.scene.primitives,
                    control: &run.buffers.control,
                    viewers: &self.viewers,
                    looks: &self.looks,
                },
            )
            .push(&LookPush { count, ..self.push })
            .linear((count * LOOKS).div_ceil(64));
    }

    /// Records an iteration whose looks are the `nth` that were drawn.
    fn record_drawn(&self, run: &Run, commands: &mut Recorder, nth: u32) {
        let (b, looks) = (&run.buffers, self.push.count * LOOKS);
        commands
            .stage(
                &self.judge,
                ViewedStage {
                    quality: &self.quality,
                    control: &b.control,
                    splats: &b.splats,
                    nodes: &run.scene.nodes,
                    primitives: &run.scene.primitives,
                    looks: &self.looks,
                    law: &self.law,
                    slots: &b.slots,
                    partials: &b.partials,
                    viewer_losses: &self.losses,
                    errors: &self.errors,
                    arrivals: &self.arrivals,
                },
            )
            .push(&ViewedPush { first_look: nth * looks })
            .linear(looks / self.looks_a_group);
        commands
            .stage(
                &self.update,
                UpdateQualityStage {
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
                    viewer_losses: &self.losses,
                    anchor_starts: &self.anchor_starts,
                    anchors: &self.anchors,
                    quality: &self.quality,
                },
            )
            .linear(run.settings.splats);
    }
}

impl Pass for QualityPass {
    fn reset(&self, _run: &Run, commands: &mut Recorder) -> Result<()> {
        self.quality.upload(&[self.settings])?;
        // Kept cameras may be others now.
        *lock(&self.kept) = None;
        // Each iteration leaves them so.
        commands.fill(&self.arrivals, 0);
        Ok(())
    }

    fn waits_between_blocks(&self) -> bool {
        self.links.is_some()
    }

    fn between_blocks(&self, run: &Run) -> Result<()> {
        let Some(links) = &self.links else { return Ok(()) };
        let done = run.done() as f32 / run.settings.iterations as f32;
        let (bvh, splats) = (&run.scene.geometry.bvh, run.splats()?);
        let mut kept = lock(&self.kept);
        let kept = kept.get_or_insert_with(|| links.sights(bvh, &splats[..run.settings.kept as usize]));
        let (starts, anchors) = links.anchors(bvh, &splats, kept, done);
        self.anchor_starts.upload(&starts)?;
        if anchors.is_empty() { Ok(()) } else { self.anchors.upload(&anchors) }
    }

    fn record(&self, run: &Run, commands: &mut Recorder, iterations: Range<u32>, block: u32) -> Result<()> {
        let draws = draws(self.settings.viewers, block);
        for i in iterations {
            if i % draws == 0 {
                self.record_looks(run, commands, draws.min(block - i));
            }
            self.record_drawn(run, commands, i % draws);
        }
        Ok(())
    }

    fn stages(&self) -> u32 {
        3
    }
}

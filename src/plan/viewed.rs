//! The pass of expected quality: looks of fresh viewers each iteration (`look.comp`), and what they ask of the splats nearest to
//! them (`viewed.comp`).

use std::sync::Arc;

use super::buffers::Buffers;
use super::shared::{Control, Gradient, Settings, Splat, Tally};
use crate::Result;
use crate::quality::expected::{LOOKS, SIDE};
use crate::quality::law::Law;
use crate::quality::look::{self, LOOK, Look, LookPush, Viewer};
use crate::visibility::bvh::Node;
use crate::visibility::device_scene::DeviceScene;
use crate::vulkan::{Buffer, Context, Pipeline, Recorder};

crate::stage!(
    /// Loss and gradient partials, a workgroup per viewer of the iteration.
    pub VIEWED = viewed(()) {
        read settings, read control, read splats, read nodes, read primitives, read looks, read law, write slots,
        write partials, write tallies,
    } with [Settings, Control, Splat, Node, Look, Law, Gradient, Tally]
);

/// Pipelines and buffers of the pass.
pub(super) struct Viewed {
    draw: Pipeline,
    judge: Pipeline,
    viewers: Buffer,
    looks: Buffer,
    law: Buffer,
    push: LookPush,
}

impl Viewed {
    /// Uploads the viewers of a run on a surface of bounding radius `radius` in the user's world.
    pub(super) fn new(
        context: &Arc<Context>,
        scene: &DeviceScene,
        settings: &Settings,
        (viewers, radius): (&[Viewer], f64),
        constants: &[u32],
        looks: Buffer,
    ) -> Result<Self> {
        let [draw, judge] = Pipeline::several(context, [&LOOK, &VIEWED], constants)?;
        Ok(Self {
            draw,
            judge,
            viewers: Buffer::from_slice(context, "viewers", viewers)?,
            looks,
            law: Buffer::from_slice(context, "law", &[Law::embedded()])?,
            push: LookPush {
                pool: viewers.len() as u32,
                count: settings.probes,
                first: 0,
                side: SIDE,
                seed: settings.seed,
                lift: look::lift(&scene.geometry, radius),
            },
        })
    }

    /// Records the looks of an iteration and what they ask for.
    pub(super) fn record<'a>(&'a self, commands: &mut Recorder<'a>, scene: &'a DeviceScene, b: &'a Buffers) {
        commands
            .stage(&self.draw)
            .bind(&[&scene.nodes, &scene.primitives, &b.control, &self.viewers, &self.looks])
            .push(&self.push)
            .linear((self.push.count * LOOKS).div_ceil(64));
        commands
            .stage(&self.judge)
            .bind(&[
                &b.settings,
                &b.control,
                &b.splats,
                &scene.nodes,
                &scene.primitives,
                &self.looks,
                &self.law,
                &b.slots,
                &b.partials,
                &b.tallies,
            ])
            .groups([self.push.count, 1, 1]);
    }
}

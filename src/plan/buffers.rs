//! Device memory of one run.

use std::sync::Arc;

use super::shared::{Gradient, Moments, Record, Splat, Tally};
use crate::Result;
use crate::scene::octahedral;
use crate::vulkan::footprint::Footprint;
use crate::vulkan::{Buffer, Context};

/// Everything that lives as long as the run, allocated once.
pub(super) struct Buffers {
    pub(super) settings: Buffer,
    pub(super) control: Buffer,
    pub(super) splats: Buffer,
    pub(super) directions: Buffer,
    pub(super) visible: Buffer,
    pub(super) slots: Buffer,
    pub(super) partials: Buffer,
    pub(super) tallies: Buffer,
    pub(super) deficit: Buffer,
    pub(super) moments: Buffer,
    pub(super) terms: Buffer,
    pub(super) arrivals: Buffer,
    pub(super) gradients: Buffer,
    pub(super) order: Buffer,
    pub(super) history: Buffer,
    pub(super) snapshots: Buffer,
    pub(super) mailbox: Buffer,
    pub(super) anchor_starts: Buffer,
    pub(super) anchors: Buffer,
}

impl Buffers {
    pub(super) fn new(context: &Arc<Context>, plan: &Footprint, resolution: u32) -> Result<Self> {
        let directions: Vec<[f32; 4]> =
            octahedral::directions(resolution).iter().map(|d| d.as_vec3().extend(0.0).to_array()).collect();
        let device = |name: &str| Buffer::device(context, name, plan.bytes_of(name)?);
        Ok(Self {
            settings: device("settings")?,
            control: device("control")?,
            splats: device("splats")?,
            directions: Buffer::from_slice(context, "directions", &directions)?,
            visible: device("visible")?,
            slots: device("slots")?,
            partials: device("partials")?,
            tallies: device("tallies")?,
            deficit: device("deficit")?,
            moments: device("moments")?,
            terms: device("terms")?,
            arrivals: device("arrivals")?,
            gradients: device("gradients")?,
            order: device("order")?,
            history: device("history")?,
            snapshots: device("snapshots")?,
            mailbox: Buffer::host(context, "mailbox", plan.bytes_of("mailbox")?)?,
            anchor_starts: device("anchor starts")?,
            anchors: device("anchors")?,
        })
    }
}

/// Bytes of one element of the buffers whose structs are the planner's own.
pub(super) fn element_sizes() -> [u64; 6] {
    [
        size_of::<Splat>(),
        size_of::<Gradient>(),
        size_of::<Tally>(),
        size_of::<Moments>(),
        2 * size_of::<f32>(),
        size_of::<Record>(),
    ]
    .map(|size| size as u64)
}

//! Device memory of a run that all objectives have.

use std::sync::Arc;

use super::clock::mailbox;
use super::shared::{CameraState, Control, Gradient, Moments, Record, Settings};
use crate::Result;
use crate::engine::vulkan::footprint::Footprint;
use crate::engine::vulkan::{Buffer, Context};

/// Everything that lives as long as the run, allocated once.
pub(crate) struct Buffers {
    pub(super) settings: Buffer,
    pub(super) control: Buffer,
    pub(super) splats: Buffer,
    pub(super) slots: Buffer,
    pub(super) partials: Buffer,
    pub(super) moments: Buffer,
    pub(super) terms: Buffer,
    pub(super) arrivals: Buffer,
    pub(super) gradients: Buffer,
    pub(super) history: Buffer,
    pub(super) snapshots: Buffer,
    pub(super) mailbox: Buffer,
}

impl Buffers {
    pub(super) fn new(context: &Arc<Context>, plan: &Footprint) -> Result<Self> {
        let device = |name: &str| Buffer::device(context, name, plan.bytes_of(name)?);
        Ok(Self {
            settings: device("settings")?,
            control: device("control")?,
            splats: device("splats")?,
            slots: device("slots")?,
            partials: device("partials")?,
            moments: device("moments")?,
            terms: device("terms")?,
            arrivals: device("arrivals")?,
            gradients: device("gradients")?,
            history: device("history")?,
            snapshots: device("snapshots")?,
            mailbox: Buffer::host(context, "mailbox", plan.bytes_of("mailbox")?)?,
        })
    }
}

/// These buffers by name and bytes, but for `slots` and `partials`, which the objective measures.
pub(super) fn sizes(s: &Settings, checkpoint_every: u32) -> Vec<(&'static str, u64)> {
    let splats = u64::from(s.splats);
    let snapshots = u64::from(s.iterations.div_ceil(checkpoint_every.max(1))) + 1;
    let bytes = |size: usize, count: u64| size as u64 * count;
    vec![
        ("settings", size_of::<Settings>() as u64),
        ("control", size_of::<Control>() as u64),
        ("splats", bytes(size_of::<CameraState>(), splats)),
        ("moments", bytes(size_of::<Moments>(), splats)),
        ("terms", bytes(2 * size_of::<f32>(), splats)),
        ("arrivals", 8),
        ("gradients", bytes(size_of::<Gradient>(), splats)),
        ("history", bytes(size_of::<Record>(), s.iterations.into())),
        ("snapshots", bytes(size_of::<CameraState>(), splats * snapshots)),
        ("mailbox", 4 * mailbox::WORDS as u64),
    ]
}

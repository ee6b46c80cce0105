//! Command buffers, fences and queries that recordings are done with, kept for the next ones: making them takes some drivers
//! longer than a short recording runs, and other devices of the process have to wait meanwhile.

use std::sync::Mutex;

use ash::vk;

use crate::engine::parallel::lock;

/// Of each kind so many are kept.
const MAX_REUSABLE: usize = 16;

/// Unused objects.
#[derive(Default)]
pub(super) struct Reusable {
    pub commands: Mutex<Vec<Commands>>,
    pub fences: Mutex<Vec<vk::Fence>>,
    pub queries: Mutex<Vec<Queries>>,
}

/// A command buffer in a pool of its own, so that recording on several threads shares none.
#[derive(Clone, Copy)]
pub(super) struct Commands {
    pub pool: vk::CommandPool,
    pub raw: vk::CommandBuffer,
}

/// Capacity in timestamps.
#[derive(Clone, Copy)]
pub(super) struct Queries {
    pub pool: vk::QueryPool,
    pub count: u32,
}

/// Keeps `unused`, and gives the oldest back where there are too many.
pub(super) fn keep<T>(reusable: &Mutex<Vec<T>>, unused: T) -> Option<T> {
    let mut reusable = lock(reusable);
    reusable.push(unused);
    (reusable.len() > MAX_REUSABLE).then(|| reusable.remove(0))
}

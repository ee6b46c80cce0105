//! How many paths are submitted at once.

use std::time::Duration;

use crate::engine::vulkan::Context;
use crate::engine::vulkan::pace::Pace;

/// Paths of the first submission of a picture, and pixels of a part of it at most: on a CPU they should end within a second, so
/// that a run can be stopped, on a GPU long before a watchdog interferes.
pub(super) const CPU_PATHS: u64 = 1 << 17;
pub(super) const GPU_PATHS: u64 = 1 << 20;
/// Paths of a thread in one dispatch at most where places wait for one another: the longest paths, through glass, decide how long
/// all take.
const THREAD_PATHS: u32 = 8;
/// Places that are in work at once at least.
const MIN_ITEMS: u32 = 4096;

/// How much is submitted at once where the work is independent paths from places.
pub(super) struct PathPace {
    on_cpu: bool,
    paths: Pace,
}

impl PathPace {
    pub fn new(context: &Context) -> Self {
        let on_cpu = context.physical().is_cpu();
        Self { on_cpu, paths: Pace::new(context, if on_cpu { CPU_PATHS } else { GPU_PATHS } as u32) }
    }

    /// How many places of so many paths a submission should have.
    pub fn items(&self, paths: u32) -> u32 {
        (self.paths.items() / paths.max(1)).max(MIN_ITEMS)
    }

    /// How many paths a thread takes in a dispatch.
    pub fn in_one_dispatch(&self, paths: u32) -> u32 {
        if self.on_cpu { 1 } else { paths.clamp(1, THREAD_PATHS) }
    }

    /// A submission of so many places of so many paths took so long.
    pub fn took(&mut self, [items, paths]: [u32; 2], time: Duration) {
        self.paths.took(items.saturating_mul(paths), time);
    }
}

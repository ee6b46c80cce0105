//! What recordings keep in memory.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::buffer::Memory;
use super::pipeline::Compiled;

/// The buffers and pipelines of a recording. They stay in memory while this is there, whatever becomes of the [`Buffer`](super::Buffer)s and
/// [`Pipeline`](super::Pipeline)s that were recorded.
#[must_use = "what was recorded is freed with it, and may still run"]
pub struct Kept {
    mark: u64,
    buffers: Vec<Arc<Memory>>,
    pipelines: Vec<Arc<Compiled>>,
}

/// The mark of the recording that kept an object last: a recording uses the same ones again and again, and keeps each once, or a few times
/// where several record at once.
#[derive(Default)]
pub(super) struct LastKept(AtomicU64);

impl LastKept {
    /// Whether that is another one; it is this one from now on.
    fn renewed(&self, mark: u64) -> bool {
        self.0.load(Ordering::Relaxed) != mark && self.0.swap(mark, Ordering::Relaxed) != mark
    }
}

impl Default for Kept {
    fn default() -> Self {
        static MARKS: AtomicU64 = AtomicU64::new(1);
        Self { mark: MARKS.fetch_add(1, Ordering::Relaxed), buffers: Vec::new(), pipelines: Vec::new() }
    }
}

impl Kept {
    pub(super) fn buffer(&mut self, memory: &Arc<Memory>) {
        if memory.last_kept.renewed(self.mark) {
            self.buffers.push(memory.clone());
        }
    }

    pub(super) fn pipeline(&mut self, compiled: &Arc<Compiled>) {
        if compiled.last_kept.renewed(self.mark) {
            self.pipelines.push(compiled.clone());
        }
    }
}

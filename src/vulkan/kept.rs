//! What recordings keep in memory.

use std::collections::HashMap;
use std::sync::Arc;

use super::buffer::Memory;
use super::pipeline::Compiled;

/// The buffers and pipelines of a recording. They stay in memory while this is there, whatever becomes of the [`Buffer`](super::Buffer)s and
/// [`Pipeline`](super::Pipeline)s that were recorded.
#[must_use = "what was recorded is freed with it, and may still run"]
#[derive(Default)]
pub struct Kept {
    // By address: a recording uses the same again and again.
    buffers: HashMap<usize, Arc<Memory>>,
    pipelines: HashMap<usize, Arc<Compiled>>,
}

impl Kept {
    pub(super) fn buffer(&mut self, memory: &Arc<Memory>) {
        self.buffers.entry(Arc::as_ptr(memory).addr()).or_insert_with(|| memory.clone());
    }

    pub(super) fn pipeline(&mut self, compiled: &Arc<Compiled>) {
        self.pipelines.entry(Arc::as_ptr(compiled).addr()).or_insert_with(|| compiled.clone());
    }
}

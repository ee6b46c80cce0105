//! What recordings keep in memory.

use std::any::Any;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// The buffers of a recording, and the context, which has its pipelines. They stay in memory while this is there, whatever becomes of the
/// [`Buffer`](super::Buffer)s and [`Pipeline`](super::Pipeline)s that were recorded.
#[must_use = "what was recorded is freed with it, and may still run"]
pub struct Kept {
    mark: u64,
    objects: Vec<Arc<dyn Any + Send + Sync>>,
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
        Self { mark: MARKS.fetch_add(1, Ordering::Relaxed), objects: Vec::new() }
    }
}

impl Kept {
    /// With the context of the recording.
    pub(super) fn new<T: Any + Send + Sync>(context: &Arc<T>) -> Self {
        Self { objects: vec![context.clone()], ..Self::default() }
    }

    /// Keeps an object, whose `last` it is.
    pub(super) fn keep<T: Any + Send + Sync>(&mut self, object: &Arc<T>, last: &LastKept) {
        if last.renewed(self.mark) {
            self.objects.push(object.clone());
        }
    }
}

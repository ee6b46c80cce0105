//! Who may use a queue, which takes one call at a time.

use std::sync::Mutex;

use crate::parallel::lock;

/// Keeps everybody else from a queue while the engine submits to it.
pub trait QueueLock: Send + Sync {
    /// Calls `submit` once, while nobody else uses the queue. It may wait before, for as long as it likes.
    fn locked(&self, submit: &mut dyn FnMut());
}

impl QueueLock for Mutex<()> {
    fn locked(&self, submit: &mut dyn FnMut()) {
        let _guard = lock(self);
        submit();
    }
}

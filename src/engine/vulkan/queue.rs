//! Who may use a queue, which takes one call at a time.

use std::sync::Mutex;

use crate::engine::parallel::lock;

/// Keeps everybody else from a queue while the engine submits to it.
pub trait QueueLock: Send + Sync {
    /// Calls `submit` while nobody else uses the queue, on the thread that called the engine. It may wait before, for as long as it likes. Where
    /// it returns without a call, what the engine was doing ends with [`Error::Interrupted`](crate::Error): so a host ends a plan at any
    /// time.
    fn locked(&self, submit: &mut dyn FnMut());
}

impl QueueLock for Mutex<()> {
    fn locked(&self, submit: &mut dyn FnMut()) {
        let _guard = lock(self);
        submit();
    }
}

//! The queue between the decoding threads and the consumer of the photos, and the budget of bytes in flight.

use std::collections::BTreeMap;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use crate::engine::parallel::lock;
use crate::error::Result;

/// Memory is reserved for photos in their order, so that the next one waited for always has its memory: no deadlock under any
/// budget.
pub(super) struct Queue<T> {
    count: usize,
    memory: u64,
    state: Mutex<State<T>>,
    changed: Condvar,
}

struct State<T> {
    /// The next photo that a thread takes up.
    untaken: usize,
    /// The next photo that memory is reserved for.
    unreserved: usize,
    /// The next photo that is handed out.
    awaited: usize,
    /// Bytes in flight, and the most there were.
    bytes: u64,
    most: u64,
    /// Photos that are done and not handed out yet, with the bytes they hold.
    done: BTreeMap<usize, (u64, Result<T>)>,
    stopped: bool,
}

impl<T> Queue<T> {
    pub fn new(count: usize, memory: u64) -> Self {
        let state =
            State { untaken: 0, unreserved: 0, awaited: 0, bytes: 0, most: 0, done: BTreeMap::new(), stopped: false };
        Self { count, memory, state: Mutex::new(state), changed: Condvar::new() }
    }

    fn lock(&self) -> MutexGuard<'_, State<T>> {
        // Nothing panics while it holds the lock.
        lock(&self.state)
    }

    fn wait<'a>(&self, state: MutexGuard<'a, State<T>>) -> MutexGuard<'a, State<T>> {
        self.changed.wait(state).unwrap_or_else(PoisonError::into_inner)
    }

    /// The next photo to decode; none where there is none left.
    pub fn take(&self) -> Option<usize> {
        let mut state = self.lock();
        let index = state.untaken;
        if state.stopped || index == self.count {
            return None;
        }
        state.untaken += 1;
        Some(index)
    }

    /// Waits until those before it have their memory and `bytes` more fit, or none is in use; false where
    /// decoding has been stopped meanwhile.
    pub fn reserve(&self, index: usize, bytes: u64) -> bool {
        let mut state = self.lock();
        loop {
            if state.stopped {
                return false;
            }
            let fits = state.bytes == 0 || state.bytes.saturating_add(bytes) <= self.memory;
            if state.unreserved == index && fits {
                state.unreserved += 1;
                state.bytes += bytes;
                state.most = state.most.max(state.bytes);
                self.changed.notify_all();
                return true;
            }
            state = self.wait(state);
        }
    }

    /// Puts a photo in for which `bytes` were reserved and which keeps `left` of them.
    pub fn finish(&self, index: usize, bytes: u64, left: u64, made: Result<T>) {
        let mut state = self.lock();
        state.bytes -= bytes - left;
        state.done.insert(index, (left, made));
        self.changed.notify_all();
    }

    /// Waits for the next photo in order; none after the last.
    pub fn next(&self) -> Option<Result<T>> {
        let mut state = self.lock();
        if state.awaited == self.count {
            return None;
        }
        loop {
            let awaited = state.awaited;
            if let Some((bytes, made)) = state.done.remove(&awaited) {
                state.awaited += 1;
                state.bytes -= bytes;
                self.changed.notify_all();
                return Some(made);
            }
            state = self.wait(state);
        }
    }

    /// Photos that have not been handed out.
    pub fn left(&self) -> usize {
        self.count - self.lock().awaited
    }

    /// Most bytes in flight so far.
    pub fn most(&self) -> u64 {
        self.lock().most
    }

    /// Lets no thread start another photo.
    pub fn stop(&self) {
        self.lock().stopped = true;
        self.changed.notify_all();
    }
}

//! End of an iteration (`tally.comp`): losses summed, the shared scale stepped, the next iteration set up.

use super::shared::{Control, Record, Settings, Tally, Terms};

crate::stage!(
    /// One workgroup; the only stage that writes [`Control`].
    pub TALLY = tally(()) { read settings, write control, read tallies, read terms, write history, write mailbox }
    with [Settings, Control, Tally, Terms, Record]
);

/// Words of the mailbox, the buffer that host and device share while a run goes on.
pub mod mailbox {
    /// The host sets it to stop after the running iteration.
    pub const STOP: usize = 0;
    /// Iterations done.
    pub const DONE: usize = 1;
    /// Most splats that any probe saw.
    pub const MOST_VISIBLE: usize = 2;
    /// Most (probe, splat) pairs that any iteration of the binned pass needed.
    pub const MOST_PAIRS: usize = 3;
    /// Most (tile, splat) instances that any iteration of the binned pass needed.
    pub const MOST_INSTANCES: usize = 4;
    /// Number of words.
    pub const WORDS: usize = 5;
}

/// Factor on the learning rates at Adam step `step` (from 1) of a run or round of `length` iterations.
pub fn rate(decay: f64, step: u32, length: u32) -> f64 {
    decay.powf((step - 1) as f64 / length as f64)
}

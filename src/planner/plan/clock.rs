//! The end of an iteration (`planner/plan/finish.glsl`): losses summed, the next iteration set up; and the twin of the latter.

use super::shared::Settings;

/// Words of the mailbox, the buffer that host and device share during a run.
pub mod mailbox {
    /// The host sets it to stop after the running iteration.
    pub const STOP: usize = 0;
    /// Iterations done.
    pub const DONE: usize = 1;
    /// The first of those that the objective has for itself.
    pub const OWN: usize = 2;
    /// Number of words.
    pub const WORDS: usize = 8;
}

/// Factor on the learning rates at Adam step `step` (from 1) of a run, or of one view's part of it, of `length` iterations.
pub fn rate(decay: f64, step: u32, length: u32) -> f64 {
    decay.powf((step - 1) as f64 / length as f64)
}

/// What changes from one iteration to the next: [`super::shared::Control`] as the twin has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Iterations done.
    pub iteration: u32,
    /// Splats `first..live` move.
    pub first: u32,
    /// Splats `0..live` are seen.
    pub live: u32,
    /// Adam's step, from 1.
    pub step: u32,
    /// Factor on the learning rates.
    pub rate: f64,
}

impl Clock {
    /// Before the first iteration.
    pub fn new(settings: &Settings) -> Self {
        let live = if settings.round_length > 0 { settings.kept + 1 } else { settings.splats };
        Self { iteration: 0, first: settings.kept, live, step: 1, rate: 1.0 }
    }

    /// After an iteration.
    pub fn next(&self, settings: &Settings) -> Self {
        let mut next = Self { iteration: self.iteration + 1, step: self.step + 1, ..*self };
        let rounds = settings.round_length > 0;
        if rounds && next.iteration.is_multiple_of(settings.round_length) {
            next.first += 1;
            next.live = settings.splats.min(next.live + 1);
            next.step = 1;
        }
        let length = if rounds { settings.round_length } else { settings.iterations };
        next.rate = rate(f64::from(settings.decay), next.step, length);
        next
    }
}

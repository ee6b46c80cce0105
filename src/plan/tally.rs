//! End of an iteration (`plan/tally.glsl`): losses summed, the shared scale stepped, the next iteration set up; and the twin
//! of the latter two.

use super::shared::Settings;

/// Words of the mailbox, the buffer that host and device share during a run.
pub mod mailbox {
    /// The host sets it to stop after the running iteration.
    pub const STOP: usize = 0;
    /// Iterations done.
    pub const DONE: usize = 1;
    /// Most splats that any probe saw.
    pub const MAX_VISIBLE: usize = 2;
    /// Most (probe, splat) pairs that any iteration of the binned pass needed.
    pub const MAX_PAIRS: usize = 3;
    /// Most (tile, splat) instances that any iteration of the binned pass needed.
    pub const MAX_INSTANCES: usize = 4;
    /// Number of words.
    pub const WORDS: usize = 5;
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
    /// Logarithm of the shared scale s.
    pub log_scale: f64,
    /// Adam's first moment of log s.
    pub scale_mean: f64,
    /// Adam's second moment of log s.
    pub scale_square: f64,
}

impl Clock {
    /// Before the first iteration.
    pub fn new(settings: &Settings, start_scale: f64) -> Self {
        let live = if settings.round_length > 0 { settings.kept + 1 } else { settings.splats };
        let log_scale = start_scale.ln();
        let (scale_mean, scale_square) = (0.0, 0.0);
        Self { iteration: 0, first: settings.kept, live, step: 1, rate: 1.0, log_scale, scale_mean, scale_square }
    }
}

/// The clock after an iteration whose image loss has the given gradient by log s.
pub fn tally(settings: &Settings, by_log_scale: f64, clock: &Clock) -> Clock {
    let mut next = *clock;
    if settings.lr_scale > 0.0 {
        // Of the image loss and of lambda_scale s squared.
        let gradient = by_log_scale + 2.0 * f64::from(settings.lambda_scale) * (2.0 * clock.log_scale).exp();
        next.scale_mean = 0.9 * clock.scale_mean + 0.1 * gradient;
        next.scale_square = 0.999 * clock.scale_square + 0.001 * gradient * gradient;
        let mean = next.scale_mean / (1.0 - 0.9f64.powf(f64::from(clock.step)));
        let square = next.scale_square / (1.0 - 0.999f64.powf(f64::from(clock.step)));
        let change = f64::from(settings.lr_scale) * clock.rate * mean / (square.sqrt() + 1e-10);
        next.log_scale = (clock.log_scale - change).max(f64::from(settings.scale_floor).ln());
    }
    next.iteration += 1;
    next.step += 1;
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

//! The scale that all splats share: the twin of its step at the end of an iteration (`own_step` of `update_paper.comp`).

use super::shared::PaperSettings;
use crate::planner::plan::clock::Clock;

/// Logarithm of the scale s, with Adam's moments: [`super::shared::Scale`] as the twin has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearntScale {
    /// Logarithm of s.
    pub log_scale: f64,
    /// Adam's first moment of log s.
    pub mean: f64,
    /// Adam's second moment of log s.
    pub square: f64,
}

impl LearntScale {
    /// Before the first iteration.
    pub fn new(start_scale: f64) -> Self {
        Self { log_scale: start_scale.ln(), mean: 0.0, square: 0.0 }
    }

    /// After the iteration that begins at `clock`, whose image loss has the given gradient by log s.
    pub fn next(&self, settings: &PaperSettings, by_log_scale: f64, clock: &Clock) -> Self {
        if settings.lr_scale <= 0.0 {
            return *self;
        }
        // Of the image loss and of lambda_scale s squared.
        let gradient = by_log_scale + 2.0 * f64::from(settings.lambda_scale) * (2.0 * self.log_scale).exp();
        let mean = 0.9 * self.mean + 0.1 * gradient;
        let square = 0.999 * self.square + 0.001 * gradient * gradient;
        let step = f64::from(clock.step);
        let (unbiased, scatter) = (mean / (1.0 - 0.9f64.powf(step)), square / (1.0 - 0.999f64.powf(step)));
        let change = f64::from(settings.lr_scale) * clock.rate * unbiased / (scatter.sqrt() + 1e-10);
        let log_scale = (self.log_scale - change).max(f64::from(settings.scale_floor).ln());
        Self { log_scale, mean, square }
    }
}

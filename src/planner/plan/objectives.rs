//! The place where a plan takes its objective.

use super::config::{Config, Minimise};
use super::preparation::Preparation;
use super::problem::Problem;
use super::{expected_quality, paper};
use crate::Result;
use crate::engine::vulkan::Context;

impl Preparation {
    /// Places the splats and prepares the objective of the configuration.
    ///
    /// # Errors
    /// A configuration that makes no sense, or does not suit the problem or the device.
    pub fn new(context: &Context, problem: &Problem<'_>, config: Config) -> Result<Self> {
        Self::of(context, problem, config, |config, start| match &config.minimise {
            Minimise::Quality(own) => expected_quality::prepare(context, problem, config, own, start),
            Minimise::Paper(own) => paper::prepare(context, problem, config, own, start),
        })
    }
}

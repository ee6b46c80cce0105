//! The configuration of expected quality.

use serde::{Deserialize, Serialize};

use crate::Result;
use crate::planner::plan::bounds::refused;
use crate::planner::quality::law::Coefficients;

/// Sums over looks stay within lavapipe's bound on loops.
const MAX_VIEWERS_A_STEP: u32 = 16_384;
/// Most viewers that a run draws; then it begins again with the first, and with other pixels of it.
pub(super) const MAX_VIEWERS: u32 = 1 << 15;

/// What expected quality has beside [`crate::planner::plan::config::Config`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct QualityConfig {
    /// The law that errors are expected by.
    pub law: Coefficients,
    /// Every camera is to share surface with a neighbour, at no wider angle between the two than this, in degrees, and all of them
    /// to hang together, so that structure from motion can join their photos.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub connect: Option<f32>,
    /// Each of them to a camera that is kept, not by way of others: of photos that are taken one after another, any may be left out or lost.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub direct: bool,
}

impl QualityConfig {
    /// The defaults, of objects or of rooms.
    pub fn new(object: bool) -> Self {
        Self { law: Coefficients::embedded(object), connect: None, direct: false }
    }

    /// Checks that the numbers make sense, for so many viewers a step.
    ///
    /// # Errors
    /// One line that names the option.
    pub(in crate::planner::plan) fn validate(&self, viewers: u32) -> Result<()> {
        if viewers > MAX_VIEWERS_A_STEP {
            return refused("`probes`", viewers, &format!("at most {MAX_VIEWERS_A_STEP} viewers a step"));
        }
        self.law.check()?;
        match self.connect {
            Some(degrees) if !(1.0..=90.0).contains(&degrees) => {
                refused("`connect`", degrees, "an angle between 1 and 90 degrees")
            }
            None if self.direct => refused("`direct`", self.direct, "false where `connect` is none"),
            _ => Ok(()),
        }
    }
}

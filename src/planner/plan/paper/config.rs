//! The configuration of the paper's objective.

use serde::{Deserialize, Serialize};

use crate::Result;
use crate::engine::vulkan::shaders::glsl::planner::plan::paper::paper;
use crate::planner::plan::bounds::{not_negative, positive, refused};

/// How a splat looks to a probe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum Kernel {
    /// The same apparent size at any distance.
    Angular = paper::ANGULAR as isize,
    /// A Gaussian in space, at its closest approach to the ray.
    Metric = paper::METRIC as isize,
}

/// Where the cameras are before the first iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// At random, as the preset specifies.
    Random,
    /// All in one place, but for a seeded jitter.
    Identical,
}

/// The way through the splat pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum Pass {
    /// By estimated cost.
    Auto,
    /// A workgroup per probe.
    Dense,
    /// Sorted into tiles.
    Binned,
}

/// Splats that the loops of the dense pass can take before lavapipe would end them: 65,535 iterations an invocation, and
/// a probe that sees all splats takes about eight for each.
pub const MAX_DENSE: u32 = 6000;

/// What the paper's objective has beside [`crate::planner::plan::config::Config`]; as arguments, the options of the command line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct PaperConfig {
    /// Point cameras in all, from which each step takes the next few.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = Self::default().pool))]
    pub pool: u32,
    /// Texels of a point camera along a side, a multiple of 8 [default: by the scale]
    #[cfg_attr(feature = "cli", arg(long))]
    pub resolution: Option<u32>,
    /// Kernel of the splats.
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value_t = Self::default().kernel))]
    pub kernel: Kernel,
    /// Opacity of a splat.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = Self::default().alpha))]
    pub alpha: f32,
    /// Whether surfaces hide splats and unreachable directions are left out.
    #[cfg_attr(feature = "cli", arg(long = "no-occlusion", help = "Ignore occlusion", action = clap::ArgAction::SetFalse))]
    pub occlusion: bool,
    /// Whether scores of the surface weigh the target.
    #[cfg_attr(feature = "cli", arg(skip = Self::default().vds))]
    pub vds: bool,
    /// Whether every probe weighs the same in the image term, however few directions it can be seen from; else every
    /// direction does (docs/reference/method.md).
    #[cfg_attr(feature = "cli", arg(
        long = "equal-directions",
        help = "Weight every direction of a point camera equally in the image term, as the paper does, instead of every point camera",
        action = clap::ArgAction::SetFalse
    ))]
    pub equal_probes: bool,
    /// Weight of the coverage regulariser.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = Self::default().lambda_reg))]
    pub lambda_reg: f32,
    /// Pressure on the square of the scale.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = Self::default().lambda_scale))]
    pub lambda_scale: f32,
    /// Learning rate of the scale's logarithm; 0 holds it where it starts.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = Self::default().lr_scale))]
    pub lr_scale: f32,
    /// Scale of the splats at the start, in radians [default: by the number of splats that a point camera sees]
    #[cfg_attr(feature = "cli", arg(long))]
    pub scale: Option<f32>,
    /// Iterations between relocations of splats that light nothing; 0 for never.
    #[cfg_attr(feature = "cli", arg(long, default_value_t = Self::default().relocate_every))]
    pub relocate_every: u32,
    /// Part of the run during which splats are relocated.
    #[cfg_attr(feature = "cli", arg(skip = Self::default().relocate_until))]
    pub relocate_until: f32,
    /// Where the cameras are at first.
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value_t = Self::default().start))]
    pub start: Start,
    /// Add the views one at a time, earlier ones fixed, with a fifth of `iterations` for each.
    #[cfg_attr(feature = "cli", arg(skip))]
    pub iterative: bool,
    /// The way through the splat pass.
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value_t = Self::default().pass))]
    pub pass: Pass,
}

impl Default for PaperConfig {
    /// The defaults, settled in docs/results/planner.md.
    fn default() -> Self {
        Self {
            pool: 2048,
            resolution: None,
            kernel: Kernel::Angular,
            alpha: 0.1,
            occlusion: true,
            vds: true,
            equal_probes: true,
            lambda_reg: 3.0,
            lambda_scale: 0.2,
            lr_scale: 0.005,
            scale: None,
            relocate_every: 50,
            relocate_until: 0.7,
            start: Start::Random,
            iterative: false,
            pass: Pass::Auto,
        }
    }
}

impl PaperConfig {
    /// Checks that the numbers make sense, for so many point cameras a step.
    ///
    /// # Errors
    /// One line that names the option.
    pub(in crate::planner::plan) fn validate(&self, probes: u32) -> Result<()> {
        positive(&[("`alpha`", self.alpha), ("`scale`", self.scale.unwrap_or(1.0))])?;
        not_negative(&[
            ("`lambda_reg`", self.lambda_reg),
            ("`lambda_scale`", self.lambda_scale),
            ("`lr_scale`", self.lr_scale),
            ("the part of the run that relocates", self.relocate_until),
        ])?;
        if self.pool == 0 {
            return refused("`pool`", self.pool, "at least 1");
        }
        for (name, value, most) in [("`probes`", probes, 65_535), ("`pool`", self.pool, 1 << 20)] {
            if value > most {
                return refused(name, value, &format!("at most {most}"));
            }
        }
        if self.alpha >= 0.5 {
            return refused("`alpha`", self.alpha, "less than 0.5, so that a score of 2 stays below full brightness");
        }
        let resolution = self.resolution.unwrap_or(16);
        if !resolution.is_multiple_of(8) || !(16..=256).contains(&resolution) {
            return refused("`resolution`", resolution, "a multiple of 8 between 16 and 256");
        }
        Ok(())
    }
}

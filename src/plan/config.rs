//! The configuration of the planner.

use serde::{Deserialize, Serialize};

use crate::quality::viewers::Viewers;
use crate::vulkan::shaders::glsl::plan::plan;
use crate::{Error, Result};

/// What is minimised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum Objective {
    /// Every point camera's picture should be evenly bright (the paper).
    Splat,
    /// The error that viewers are expected to see of what the photographs train.
    Quality,
}

/// How a camera's field of view is tested while optimising. Metrics always use the hard gate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum Gate {
    /// The cone inscribed in the image, yes or no (the paper).
    Hard = plan::HARD_CONE as isize,
    /// The same cone with a soft edge, so that directions get a gradient.
    Soft = plan::SOFT_CONE as isize,
    /// The rectangular image itself, with a soft edge and a roll that keeps the image upright.
    Pinhole = plan::SOFT_FRUSTUM as isize,
    /// The rectangular image, yes or no.
    PinholeHard = plan::HARD_FRUSTUM as isize,
}

impl Gate {
    /// Whether the edge is soft.
    pub fn soft(self) -> bool {
        matches!(self, Self::Soft | Self::Pinhole)
    }

    /// Whether the rectangular image is tested.
    pub fn pinhole(self) -> bool {
        matches!(self, Self::Pinhole | Self::PinholeHard)
    }
}

/// How a splat looks to a probe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum Kernel {
    /// The same apparent size at any distance.
    Angular = plan::ANGULAR as isize,
    /// A Gaussian in space, at its closest approach to the ray.
    Metric = plan::METRIC as isize,
}

/// Which scene the defaults are for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// Something seen from around it, in a shell; cameras look in at first.
    #[default]
    Object,
    /// A space seen from inside, in a box; cameras look anywhere.
    Room,
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

/// Most views of a plan: the loop of `rank` over all of them stays within lavapipe's bound.
pub(crate) const MAX_VIEWS: u32 = 200_000;
/// Most viewers that a run draws; then it begins again with the first, and with other pixels of it.
const MAX_VIEWERS: u32 = 1 << 15;

/// The planner's configuration. [`Config::new`] gives the defaults of a preset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Config {
    /// Cameras to place.
    pub views: u32,
    /// Which scene the start is for.
    pub preset: Preset,
    /// Seed of every random number.
    pub seed: u64,
    /// Iterations.
    pub iterations: u32,
    /// Point cameras a step.
    pub probes: u32,
    /// Point cameras in all, from which each step takes the next few.
    pub pool: u32,
    /// Texels of a point camera along a side, a multiple of 8; by the start scale where absent.
    pub resolution: Option<u32>,
    /// What is minimised.
    pub objective: Objective,
    /// Field-of-view test while optimising.
    pub gate: Gate,
    /// Softness of the gate.
    pub gate_softness: f32,
    /// Kernel of the splats.
    pub kernel: Kernel,
    /// Opacity of a splat.
    pub alpha: f32,
    /// Whether surfaces hide splats and unreachable directions are left out.
    pub occlusion: bool,
    /// Whether scores of the surface weigh the target.
    pub vds: bool,
    /// Whether every probe weighs the same in the image term, however few directions it can be seen from; else every
    /// direction does (docs/reference/method.md).
    pub equal_probes: bool,
    /// Weight of the coverage regulariser.
    pub lambda_reg: f32,
    /// Weight of the region term.
    pub lambda_bound: f32,
    /// Pressure on s squared.
    pub lambda_scale: f32,
    /// Where viewers will look from at the trained model.
    pub viewers: Viewers,
    /// Learning rate of positions, in radii of the region.
    pub lr_position: f32,
    /// Learning rate of directions.
    pub lr_direction: f32,
    /// Learning rate of log s; 0 holds s where it starts.
    pub lr_scale: f32,
    /// What the rates have fallen to at the end.
    pub decay: f32,
    /// Start scale; by the number of splats that a probe sees where absent.
    pub scale: Option<f32>,
    /// Iterations between relocations; 0 for never.
    pub relocate_every: u32,
    /// Part of the run during which splats are relocated.
    pub relocate_until: f32,
    /// Where the cameras are at first.
    pub start: Start,
    /// Add the views one at a time, earlier ones fixed, with a fifth of `iterations` for each.
    pub iterative: bool,
    /// The way through the splat pass.
    pub pass: Pass,
    /// Every camera is to share surface with a neighbour, at no wider angle between the two than this, in degrees, and all of them
    /// to hang together, so that structure from motion can join their photos.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub connect: Option<f32>,
    /// Held-out points for the metrics.
    pub held_out: u32,
    /// Iterations between checkpoints of the metrics.
    pub checkpoint_every: u32,
}

impl Config {
    /// How many viewers a run draws.
    pub fn viewers_drawn(&self) -> u32 {
        self.iterations.saturating_mul(self.probes).min(MAX_VIEWERS)
    }

    /// Checks that the numbers make sense together.
    ///
    /// # Errors
    /// One line that names the option.
    pub fn validate(&self) -> Result<()> {
        let resolution = self.resolution.unwrap_or(16);
        let positive = [
            ("`alpha`", self.alpha),
            ("`gate_softness`", self.gate_softness),
            ("decay", self.decay),
            ("`scale`", self.scale.unwrap_or(1.0)),
        ];
        let not_negative = [
            ("`lambda_reg`", self.lambda_reg),
            ("`lambda_bound`", self.lambda_bound),
            ("`lambda_scale`", self.lambda_scale),
            ("`lr_position`", self.lr_position),
            ("`lr_direction`", self.lr_direction),
            ("`lr_scale`", self.lr_scale),
            ("the part of the run that relocates", self.relocate_until),
        ];
        let counts = [
            ("`views`", self.views),
            ("`iterations`", self.iterations),
            ("`probes`", self.probes),
            ("`pool`", self.pool),
            ("`held_out`", self.held_out),
        ];
        let bad = |name: &str, value: &dyn std::fmt::Display, want: &str| {
            Err(Error::request(format!("{name} is {value}; give {want}")))
        };
        if let Some((name, value)) = counts.iter().find(|(_, value)| *value == 0) {
            return bad(name, value, "at least 1");
        }
        let limits =
            [("`probes`", self.probes, 65_535), ("`pool`", self.pool, 1 << 20), ("`held_out`", self.held_out, 1 << 20)];
        if let Some((name, value, most)) = limits.iter().find(|(_, value, most)| value > most) {
            return bad(name, value, &format!("at most {most}"));
        }
        if let Some((name, value)) = positive.iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
            return bad(name, value, "a positive number");
        }
        if let Some((name, value)) = not_negative.iter().find(|(_, value)| !(value.is_finite() && *value >= 0.0)) {
            return bad(name, value, "zero or a positive number");
        }
        if let Some(degrees) = self.connect {
            if !(1.0..=90.0).contains(&degrees) {
                return bad("`connect`", &degrees, "an angle between 1 and 90 degrees");
            }
            if self.objective != Objective::Quality {
                return Err(Error::request(
                    "`connect` goes with expected quality alone; leave it out, or what belongs to the paper's objective",
                ));
            }
        }
        if self.alpha >= 0.5 {
            return bad("`alpha`", &self.alpha, "less than 0.5, so that a score of 2 stays below full brightness");
        }
        if !resolution.is_multiple_of(8) || !(16..=256).contains(&resolution) {
            return bad("`resolution`", &resolution, "a multiple of 8 between 16 and 256");
        }
        Ok(())
    }

    /// The defaults of a preset.
    pub fn new(preset: Preset, views: u32) -> Self {
        Self::of(Objective::Quality, preset, views)
    }

    /// The same with cameras that connect, at no wider an angle between neighbours than this, in degrees, and the iterations that
    /// this takes.
    pub fn connected(self, degrees: f32) -> Self {
        Self { connect: Some(degrees), iterations: 1000, ..self }
    }

    /// The same with another objective and its defaults; as it is where that is its own.
    pub fn with_objective(self, objective: Objective) -> Self {
        if self.objective == objective {
            return self;
        }
        let Self { views, preset, seed, held_out, checkpoint_every, viewers, connect, .. } = self;
        Self { seed, held_out, checkpoint_every, viewers, connect, ..Self::of(objective, preset, views) }
    }

    /// The defaults of an objective, settled in docs/results/objects.md and docs/results/planner.md.
    pub fn of(objective: Objective, preset: Preset, views: u32) -> Self {
        let quality = objective == Objective::Quality;
        Self {
            views,
            preset,
            seed: 0,
            iterations: match (quality, preset) {
                (true, Preset::Object) => 100,
                (true, Preset::Room) => 600,
                (false, _) => 1000,
            },
            probes: 20,
            pool: 2048,
            resolution: None,
            objective,
            gate: if quality { Gate::Pinhole } else { Gate::Soft },
            gate_softness: if quality { 0.01 } else { 0.02 },
            kernel: Kernel::Angular,
            alpha: 0.1,
            occlusion: true,
            vds: true,
            equal_probes: true,
            lambda_reg: 3.0,
            lambda_bound: 10.0,
            lambda_scale: 0.2,
            viewers: Viewers::Region,
            lr_position: if quality { 0.015 } else { 0.0065 },
            lr_direction: if quality { 0.05 } else { 0.02 },
            lr_scale: 0.005,
            decay: 0.05,
            scale: None,
            relocate_every: 50,
            relocate_until: 0.7,
            start: Start::Random,
            iterative: false,
            pass: Pass::Auto,
            connect: None,
            held_out: 1000,
            checkpoint_every: 50,
        }
    }
}

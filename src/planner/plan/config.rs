//! The configuration of a plan: what all objectives share, and the objective with what is its own.

use serde::{Deserialize, Serialize};

use super::bounds::{not_negative, positive, refused};
use super::expected_quality::QualityConfig;
use super::gate::Gate;
use super::paper::PaperConfig;
use crate::planner::methods::Method;
use crate::planner::quality::law::Fitted;
use crate::planner::quality::viewers::Viewers;
use crate::{Error, Result};

/// What is minimised, with the configuration of its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "objective", rename_all = "snake_case")]
pub enum Minimise {
    /// The error that viewers are expected to see of what the photographs train.
    Quality(QualityConfig),
    /// That every point camera's picture is evenly bright (the paper).
    Paper(PaperConfig),
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

/// Most views of a plan: the loop of `rank` over all of them stays within lavapipe's bound.
pub(crate) const MAX_VIEWS: u32 = 200_000;

/// The planner's configuration. [`Config::new`] gives the defaults of a preset, [`Config::paper`] those of the paper's objective.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Config {
    /// Cameras to place.
    pub views: u32,
    /// Which scene the start is for.
    pub preset: Preset,
    /// Seed of every random number.
    pub seed: u64,
    /// Iterations of the descent.
    pub iterations: u32,
    /// Viewers a step, or point cameras of the paper's objective.
    pub probes: u32,
    /// Field-of-view test while optimising. Metrics always use the hard gate.
    pub gate: Gate,
    /// Softness of the gate.
    pub gate_softness: f32,
    /// Weight of the region term.
    pub lambda_bound: f32,
    /// Where viewers will look from at the trained model.
    pub viewers: Viewers,
    /// Learning rate of positions, in radii of the region.
    pub lr_position: f32,
    /// Learning rate of directions.
    pub lr_direction: f32,
    /// What the rates have fallen to at the end.
    pub decay: f32,
    /// Held-out points for the metrics.
    pub held_out: u32,
    /// Iterations between checkpoints of the metrics.
    pub checkpoint_every: u32,
    /// What is minimised.
    #[serde(flatten)]
    pub minimise: Minimise,
}

impl Config {
    /// Expected quality with its defaults, settled in docs/results/objects.md.
    pub fn new(preset: Preset, views: u32) -> Self {
        Self {
            views,
            preset,
            seed: 0,
            iterations: match preset {
                Preset::Object => 100,
                Preset::Room => 600,
            },
            probes: 20,
            gate: Gate::Pinhole,
            gate_softness: 0.01,
            lambda_bound: 10.0,
            viewers: Viewers::Region,
            lr_position: 0.015,
            lr_direction: 0.05,
            decay: 0.05,
            held_out: 1000,
            checkpoint_every: 50,
            minimise: Minimise::Quality(QualityConfig::new(preset == Preset::Object)),
        }
    }

    /// Expected quality with its defaults for a few views beside photos that there are, settled in docs/results/watch.md: most of a step are
    /// these photos, which do not move, so few viewers a step and more steps gain more in the same time.
    pub fn beside_photos(preset: Preset, views: u32) -> Self {
        let iterations = match preset {
            Preset::Object => 400,
            Preset::Room => 600,
        };
        Self { iterations, probes: 5, ..Self::new(preset, views) }
    }

    /// The paper's objective with its defaults, settled in docs/results/planner.md.
    pub fn paper(preset: Preset, views: u32) -> Self {
        Self {
            iterations: 1000,
            gate: Gate::Soft,
            gate_softness: 0.02,
            lr_position: 0.0065,
            lr_direction: 0.02,
            minimise: Minimise::Paper(PaperConfig::default()),
            ..Self::new(preset, views)
        }
    }

    /// The method that plans so.
    pub fn method(&self) -> Method {
        match &self.minimise {
            Minimise::Quality(_) => Method::Ours,
            Minimise::Paper(own) if own.iterative => Method::PaperIterative,
            Minimise::Paper(own) if own.vds => Method::Paper,
            Minimise::Paper(_) => Method::PaperNoVds,
        }
    }

    /// What expected quality has for itself, where that is minimised.
    pub fn of_quality(&self) -> Option<&QualityConfig> {
        match &self.minimise {
            Minimise::Quality(own) => Some(own),
            _ => None,
        }
    }

    /// What the paper's objective has for itself, where that is minimised.
    pub fn of_paper(&self) -> Option<&PaperConfig> {
        match &self.minimise {
            Minimise::Paper(own) => Some(own),
            _ => None,
        }
    }

    /// The same with the paper's objective as `change` leaves it; as it is where another is minimised.
    pub fn with_paper(mut self, change: impl FnOnce(&mut PaperConfig)) -> Self {
        if let Minimise::Paper(own) = &mut self.minimise {
            change(own);
        }
        self
    }

    /// The same for the paper's objective, with its defaults; as it is where that is its own.
    pub fn to_paper(self) -> Self {
        if self.of_paper().is_some() {
            return self;
        }
        let Self { views, preset, seed, held_out, checkpoint_every, viewers, .. } = self;
        Self { seed, held_out, checkpoint_every, viewers, ..Self::paper(preset, views) }
    }

    /// The same by expected quality with cameras that connect, at no wider an angle between neighbours than this, in degrees, and the
    /// iterations that this takes.
    ///
    /// # Errors
    /// Where another objective is minimised.
    pub fn connected(mut self, degrees: f32) -> Result<Self> {
        let Minimise::Quality(own) = &mut self.minimise else {
            return Err(Error::request(
                "`connect` goes with expected quality alone; leave it out, or the paper's objective",
            ));
        };
        own.connect = Some(degrees);
        Ok(Self { iterations: 1000, ..self })
    }

    /// The same as [`Self::connected`], each camera with one that is kept, not by way of others.
    ///
    /// # Errors
    /// As there.
    pub fn connected_to_kept(self, degrees: f32) -> Result<Self> {
        let mut connected = self.connected(degrees)?;
        if let Minimise::Quality(own) = &mut connected.minimise {
            own.direct = true;
        }
        Ok(connected)
    }

    /// The law that plans are judged by: that of expected quality, or the one that is built in. Its spread is the latter's.
    pub fn law(&self) -> Fitted {
        let fitted = Fitted::embedded(self.preset == Preset::Object);
        Fitted { coefficients: self.of_quality().map_or(fitted.coefficients, |own| own.law), ..fitted }
    }

    /// Angle between neighbours, in degrees, where cameras are to connect.
    pub fn connect(&self) -> Option<f32> {
        self.of_quality().and_then(|own| own.connect)
    }

    /// Checks that the numbers make sense together.
    ///
    /// # Errors
    /// One line that names the option.
    pub fn validate(&self) -> Result<()> {
        for (name, value) in [
            ("`views`", self.views),
            ("`iterations`", self.iterations),
            ("`probes`", self.probes),
            ("`held_out`", self.held_out),
        ] {
            if value == 0 {
                return refused(name, value, "at least 1");
            }
        }
        if self.held_out > 1 << 20 {
            return refused("`held_out`", self.held_out, &format!("at most {}", 1 << 20));
        }
        positive(&[("`gate_softness`", self.gate_softness), ("decay", self.decay)])?;
        not_negative(&[
            ("`lambda_bound`", self.lambda_bound),
            ("`lr_position`", self.lr_position),
            ("`lr_direction`", self.lr_direction),
        ])?;
        match &self.minimise {
            Minimise::Quality(own) => own.validate(self.probes),
            Minimise::Paper(own) => own.validate(self.probes),
        }
    }
}
impl Method {
    /// The planner's configuration, where this is the planner or a variant of it.
    pub fn planner(self, config: &Config) -> Option<Config> {
        let paper = || config.clone().to_paper();
        match self {
            Self::Ours | Self::OursTwoPasses => Some(config.clone()),
            Self::Paper => Some(paper()),
            Self::PaperNoVds => Some(paper().with_paper(|own| own.vds = false)),
            Self::PaperIterative => Some(paper().with_paper(|own| (own.vds, own.iterative) = (false, true))),
            _ => None,
        }
    }
}

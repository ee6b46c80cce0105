//! What is asked of a peer.

use serde::{Deserialize, Serialize};

use super::manifold;
use crate::plan::config::{Config, Gate, Objective, Preset};
use crate::quality::viewers::Viewers;
use crate::select::request::Method as Choosing;
use crate::select::{acp, information, retrained};
use crate::{Error, Result};

/// How cameras are placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The planner
    Ours,
    /// The paper's objective without scores
    OursNoVds,
    /// The paper's objective without scores, one view after another
    OursIterative,
    /// The planner in two passes, the second on what the photographs of the first show too; of `evaluate` only
    OursTwoPasses,
    /// At random: looking in around an object, anywhere in a room
    Random,
    /// Evenly over the sphere around an object, as much of it as cameras can stand on, in a random rotation (spherical Fibonacci points)
    Fibonacci,
    /// In a room on an even grid at eye height, in four level directions a place
    Grid,
    /// In a room on three level rings along the walls, looking across
    Rings,
    /// Farthest view sampling by the angle between camera centres (NeRF Director)
    Fvs,
    /// Farthest view sampling by the distance between camera centres, or its square, which gives the same
    #[value(alias = "fvs-square")]
    FvsChord,
    /// Farthest view sampling by angle and shared points (NeRF Director's photogrammetric distance)
    FvsShared,
    /// Greedy on points seen by one view, then by three
    Coverage,
    /// Greedy on the uniformity of view directions and the frequency at nodes of a grid (Kopanas and Drettakis)
    Acp,
    /// Greedy on the Fisher information about a trained model (FisherRF)
    #[value(name = "fisherrf")]
    #[serde(rename = "fisherrf")]
    Fisher,
    /// The same, with the model trained on photographs of the views chosen so far, and on with each; of `evaluate` and `select` only
    #[value(name = "fisherrf-retrain")]
    #[serde(rename = "fisherrf-retrain")]
    FisherRetrain,
    /// Greedy on what a trained model shows from directions not seen yet (COVER)
    Cover,
    /// One camera after another to where pictures of a trained model differ most under its noise (manifold sampling)
    Manifold,
}

impl Method {
    /// As on the command line and in the record: methods that choose among photos too have the same names there.
    pub fn name(self) -> &'static str {
        let choosing = match self {
            Self::Ours => return crate::plan::job::OURS,
            Self::OursNoVds => return "ours-no-vds",
            Self::OursIterative => return "ours-iterative",
            Self::OursTwoPasses => return "ours-two-passes",
            Self::Manifold => return "manifold",
            Self::Grid => return "grid",
            Self::Rings => return "rings",
            Self::Random => Choosing::Random,
            Self::Fibonacci => Choosing::Fibonacci,
            Self::Fvs => Choosing::Fvs,
            Self::FvsChord => Choosing::FvsChord,
            Self::FvsShared => Choosing::FvsShared,
            Self::Coverage => Choosing::Coverage,
            Self::Acp => Choosing::Acp,
            Self::Fisher => Choosing::Fisher,
            Self::FisherRetrain => Choosing::FisherRetrain,
            Self::Cover => Choosing::Cover,
        };
        choosing.name()
    }

    /// What it minimises, where it has only one objective: scores, and one view after another, are the paper's.
    pub fn objective(self) -> Option<Objective> {
        matches!(self, Self::OursNoVds | Self::OursIterative).then_some(Objective::Splat)
    }

    /// The planner's configuration, where this is the planner or a variant of it.
    pub fn planner(self, config: &Config) -> Option<Config> {
        let paper = || config.clone().with_objective(Objective::Splat);
        match self {
            Self::Ours | Self::OursTwoPasses => Some(config.clone()),
            Self::OursNoVds => Some(Config { vds: false, ..paper() }),
            Self::OursIterative => Some(Config { vds: false, iterative: true, ..paper() }),
            _ => None,
        }
    }

    /// Whether it chooses by a model of the scene.
    pub fn needs_model(self) -> bool {
        matches!(self, Self::Fisher | Self::Cover | Self::Manifold)
    }

    /// Whether it takes photographs of the views that it chooses, while it chooses.
    pub fn needs_photographs(self) -> bool {
        matches!(self, Self::FisherRetrain | Self::OursTwoPasses)
    }

    /// Candidates to choose `views` from where nothing is said; none where there is no choice.
    pub fn candidates(self, views: u32) -> Option<u32> {
        let usual = match self {
            Self::Ours | Self::OursNoVds | Self::OursIterative | Self::OursTwoPasses => None,
            Self::Random | Self::Fibonacci | Self::Grid | Self::Rings | Self::Manifold => None,
            Self::Fvs | Self::FvsChord => Some(10_000),
            // Counting shared points takes every pair.
            Self::FvsShared | Self::Coverage => Some(2000),
            Self::Acp => Some(1000),
            // Few, since each takes a look at a model; as many as there are views would leave no choice.
            Self::Fisher | Self::FisherRetrain | Self::Cover => Some(views.saturating_mul(3).max(300)),
        };
        usual.map(|usual| usual.max(views))
    }
}

/// A plan that is asked of a peer; what `plan.json` says of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Request {
    /// How.
    pub method: Method,
    /// Cameras to place.
    pub views: u32,
    /// Poses to choose from, where the method chooses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub candidates: Option<u32>,
    /// Kind of scene.
    pub preset: Preset,
    /// Seed of every random number.
    pub seed: u64,
    /// Field of view that the metrics have.
    pub gate: Gate,
    /// Held-out points for the metrics.
    pub held_out: u32,
    /// Of [`Method::Acp`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acp: Option<acp::Settings>,
    /// Of [`Method::Fisher`] and [`Method::Cover`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model_based: Option<information::Settings>,
    /// Of [`Method::FisherRetrain`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub retraining: Option<retrained::Settings>,
    /// From where people will look, for what is expected of the choice.
    #[serde(skip_serializing_if = "Viewers::is_default")]
    pub viewers: Viewers,
    /// Of [`Method::Manifold`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub manifold: Option<manifold::Settings>,
    /// Path of the trained splats, where the method chooses by them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
}

impl Request {
    /// What a method is asked for, with the rest as a plan's configuration has it.
    ///
    /// # Errors
    /// One line that names the option that does not fit.
    pub fn new(method: Method, candidates: Option<u32>, config: &Config) -> Result<Self> {
        config.validate()?;
        let name = method.name();
        let plain = Config {
            seed: config.seed,
            gate: config.gate,
            held_out: config.held_out,
            viewers: config.viewers.clone(),
            ..Config::new(config.preset, config.views)
        };
        if plain != *config {
            let what = "of the optimisation's options it takes --seed, --gate, --viewers and --held-out only";
            return Err(Error::request(format!("--method {name}: {what}; leave the others out")));
        }
        let most = 1 << 20;
        let candidates = match (method.candidates(config.views), candidates) {
            (None, Some(_)) => {
                return Err(Error::request(format!(
                    "--method {name} chooses from no candidates; leave --candidates out"
                )));
            }
            (default, given) => given.or(default),
        };
        if let Some(count) = candidates.filter(|count| *count < config.views || *count > most) {
            let views = config.views;
            return Err(Error::request(format!("--candidates is {count} for {views} views; give {views} to {most}")));
        }
        Ok(Self {
            method,
            views: config.views,
            candidates,
            preset: config.preset,
            seed: config.seed,
            gate: config.gate,
            held_out: config.held_out,
            viewers: config.viewers.clone(),
            acp: (method == Method::Acp).then(acp::Settings::default),
            model_based: matches!(method, Method::Fisher | Method::Cover).then(information::Settings::default),
            retraining: (method == Method::FisherRetrain).then(retrained::Settings::default),
            manifold: (method == Method::Manifold).then(manifold::Settings::default),
            model: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum;

    use super::*;

    /// If this failed, a method that looks at a model would take all of its candidates, as good as at random, or another would have
    /// fewer candidates than views.
    #[test]
    fn candidates_outnumber_views() {
        let of = |method, views| Request::new(method, None, &Config::new(Preset::Room, views)).unwrap().candidates;
        for method in [Method::Fisher, Method::FisherRetrain, Method::Cover] {
            assert_eq!([50, 100, 300].map(|views| of(method, views)), [Some(300), Some(300), Some(900)]);
        }
        assert_eq!([300, 20_000].map(|views| of(Method::Fvs, views)), [Some(10_000), Some(20_000)]);
        assert_eq!(of(Method::Random, 300), None);
    }

    /// If this failed, a method would have one name on the command line and another in tables or records.
    #[test]
    fn a_method_has_one_name_everywhere() {
        fn names<M: ValueEnum + Serialize + Copy>(name: fn(M) -> &'static str) {
            for method in M::value_variants() {
                let on_the_command_line = method.to_possible_value().map(|value| value.get_name().to_owned());
                assert_eq!(on_the_command_line.as_deref(), Some(name(*method)));
                assert_eq!(serde_json::to_value(method).unwrap(), name(*method));
            }
        }
        names(Method::name);
        names(Choosing::name);
    }
}

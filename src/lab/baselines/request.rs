//! The request for a plan by a baseline.

use serde::{Deserialize, Serialize};

use super::manifold;
use crate::planner::methods::Method;
use crate::planner::plan::config::{Config, Preset};
use crate::planner::plan::gate::Gate;
use crate::planner::quality::viewers::Viewers;
use crate::planner::select::{acp, information, retrained};
use crate::{Error, Result};

impl Method {
    /// Candidates to choose `views` from by default; none where there is no choice.
    pub fn candidates(self, views: u32) -> Option<u32> {
        let usual = match self {
            Self::Fvs | Self::FvsChord => 10_000,
            // Counting shared points takes every pair.
            Self::FvsShared | Self::Coverage | Self::Greedy => 2000,
            Self::Acp | Self::AcpHidden => 1000,
            // Few, since each renders a model; as many as there are views would leave no choice.
            Self::Fisher | Self::PopD | Self::PopT | Self::FisherRetrain | Self::Cover => {
                views.saturating_mul(3).max(300)
            }
            _ => return None,
        };
        Some(usual.max(views))
    }
}

/// A request for a plan by a baseline, as `plan.json` records it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BaselineRequest {
    /// The method that places the cameras.
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
    /// Of [`Method::Acp`] and [`Method::AcpHidden`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acp: Option<acp::AcpSettings>,
    /// Of [`Method::Fisher`], its other criteria, and [`Method::Cover`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model_based: Option<information::InformationSettings>,
    /// Of [`Method::FisherRetrain`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub retraining: Option<retrained::RetrainingSettings>,
    /// Where viewers will look from, for the expected quality of the choice.
    #[serde(skip_serializing_if = "Viewers::is_default")]
    pub viewers: Viewers,
    /// Of [`Method::Manifold`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub manifold: Option<manifold::ManifoldSettings>,
    /// Path of the trained splats, where the method chooses by them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
}

impl BaselineRequest {
    /// The request for a method, with the rest from a plan's configuration.
    ///
    /// # Errors
    /// One line that names the option that does not fit.
    pub fn new(method: Method, candidates: Option<u32>, config: &Config) -> Result<Self> {
        config.validate()?;
        let name = method.name();
        if !method.entry().places || method.planner(config).is_some() {
            return Err(Error::request(format!("`method` {name}: it is no baseline that places cameras")));
        }
        let plain = Config {
            seed: config.seed,
            gate: config.gate,
            held_out: config.held_out,
            viewers: config.viewers.clone(),
            ..Config::new(config.preset, config.views)
        };
        if plain != *config {
            let what = "of the optimisation's options it takes `seed`, `gate`, `viewers` and `held_out` only";
            return Err(Error::request(format!("`method` {name}: {what}; leave the others out")));
        }
        let most = 1 << 20;
        let candidates = match (method.candidates(config.views), candidates) {
            (None, Some(_)) => {
                return Err(Error::request(format!(
                    "`method` {name} chooses from no candidates; leave `candidates` out"
                )));
            }
            (default, given) => given.or(default),
        };
        if let Some(count) = candidates.filter(|count| *count < config.views || *count > most) {
            let views = config.views;
            return Err(Error::request(format!("`candidates` is {count} for {views} views; give {views} to {most}")));
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
            acp: matches!(method, Method::Acp | Method::AcpHidden)
                .then(|| acp::AcpSettings { occlusion: method == Method::AcpHidden, ..acp::AcpSettings::default() }),
            model_based: matches!(method, Method::Fisher | Method::PopD | Method::PopT | Method::Cover).then(|| {
                information::InformationSettings {
                    criterion: method.criterion(),
                    ..information::InformationSettings::default()
                }
            }),
            retraining: (method == Method::FisherRetrain).then(retrained::RetrainingSettings::default),
            manifold: (method == Method::Manifold).then(manifold::ManifoldSettings::default),
            model: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a method that uses a model would take all of its candidates, as good as at random, or another would have
    /// fewer candidates than views.
    #[test]
    fn candidates_outnumber_views() {
        let of =
            |method, views| BaselineRequest::new(method, None, &Config::new(Preset::Room, views)).unwrap().candidates;
        for method in [Method::Fisher, Method::PopD, Method::FisherRetrain, Method::Cover] {
            assert_eq!([50, 100, 300].map(|views| of(method, views)), [Some(300), Some(300), Some(900)]);
        }
        assert_eq!([300, 20_000].map(|views| of(Method::Fvs, views)), [Some(10_000), Some(20_000)]);
        assert_eq!(of(Method::Random, 300), None);
    }

    /// If this failed, a request in code for the planner or for a choice of photos would be refused only on the device, if at all.
    #[test]
    fn what_places_no_cameras_is_no_baseline() {
        let config = Config::new(Preset::Object, 20);
        for method in [Method::Ours, Method::PaperIterative, Method::Assigned, Method::Nearest] {
            let refused = BaselineRequest::new(method, None, &config).unwrap_err().to_string();
            assert!(refused.contains(method.name()) && refused.contains("no baseline"), "{refused}");
        }
    }
}

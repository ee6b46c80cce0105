//! What is asked of a pool: how many photos, how they are chosen, which ones in any case.

use serde::{Deserialize, Serialize};

use super::retrained::Settings;
use crate::plan::config::Preset;
use crate::quality::viewers::Viewers;
use crate::{Error, Result};

/// How photos are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Swaps that lower the expected error on the real frusta, from the best of simple choices
    Swap,
    /// For each planned camera a photo of its own, nearest in sum
    Assigned,
    /// For each planned camera the nearest photo, as in the paper: perhaps fewer than asked for
    Nearest,
    /// At random
    Random,
    /// For each spherical Fibonacci point a photo of its own
    Fibonacci,
    /// Farthest view sampling by the angle between camera centres
    Fvs,
    /// Farthest view sampling by the distance between camera centres, or its square, which gives the same
    #[value(alias = "fvs-square")]
    FvsChord,
    /// Farthest view sampling by angle and shared points
    FvsShared,
    /// Greedy on points seen by one photo, then by three
    Coverage,
    /// Greedy on the uniformity of view directions and the frequency at nodes of a grid (Kopanas and Drettakis)
    Acp,
    /// Greedy on the Fisher information about a trained model (FisherRF)
    #[value(name = "fisherrf")]
    #[serde(rename = "fisherrf")]
    Fisher,
    /// The same, with the model trained on the photos chosen so far, and on with each
    #[value(name = "fisherrf-retrain")]
    #[serde(rename = "fisherrf-retrain")]
    FisherRetrain,
    /// Greedy on what a trained model shows from directions not seen yet (COVER)
    Cover,
}

impl Method {
    /// Those that every choice is put beside.
    pub const CONTROLS: [Self; 8] = [
        Self::Assigned,
        Self::Nearest,
        Self::Random,
        Self::Fibonacci,
        Self::Fvs,
        Self::FvsChord,
        Self::FvsShared,
        Self::Coverage,
    ];

    /// Whether it chooses by a model of the scene.
    pub fn needs_model(self) -> bool {
        matches!(self, Self::Fisher | Self::Cover)
    }

    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Swap => "swap",
            Self::Assigned => "assigned",
            Self::Nearest => "nearest",
            Self::Random => "random",
            Self::Fibonacci => "fibonacci",
            Self::Fvs => "fvs",
            Self::FvsChord => "fvs-chord",
            Self::FvsShared => "fvs-shared",
            Self::Coverage => "coverage",
            Self::Acp => "acp",
            Self::Fisher => "fisherrf",
            Self::FisherRetrain => "fisherrf-retrain",
            Self::Cover => "cover",
        }
    }
}

/// What is asked for. Photos by index into the set, ascending.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Request {
    /// Photos to select.
    pub count: usize,
    /// How.
    pub method: Method,
    /// Photos that are chosen in any case.
    pub include: Vec<usize>,
    /// Photos that are not chosen.
    pub exclude: Vec<usize>,
    /// Seed of every random number.
    pub seed: u64,
    /// Points that the choice is made on, and as many that it is scored on; fewer where the surface is a cloud that holds
    /// less than twice as many.
    pub points: u32,
    /// Kind of scene, for the planned cameras.
    pub preset: Preset,
    /// From where people will look; else from where the pool's photos were taken.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub viewers: Option<Viewers>,
    /// How [`Method::FisherRetrain`] trains.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub retraining: Option<Settings>,
}

impl Request {
    /// The defaults.
    pub fn new(count: usize) -> Self {
        Self {
            count,
            method: Method::Swap,
            include: Vec::new(),
            exclude: Vec::new(),
            seed: 0,
            points: 4000,
            preset: Preset::Object,
            viewers: None,
            retraining: None,
        }
    }

    /// Refuses what cannot be had from a pool of `photos`.
    ///
    /// # Errors
    /// One line that says which number does not fit.
    pub fn validate(&self, photos: usize) -> Result<()> {
        let wrong = |what: String| Err(Error::request(what));
        let allowed = photos - self.exclude.len();
        if self.count == 0 {
            return wrong("--count is 0; give at least 1".into());
        }
        if self.count > allowed {
            let barred =
                if self.exclude.is_empty() { String::new() } else { format!(" of {photos}, without --exclude") };
            return wrong(format!("--count is {}, but the pool has {allowed} photos{barred}; give fewer", self.count));
        }
        if self.include.len() > self.count {
            let included = self.include.len();
            return wrong(format!(
                "--include names {included} photos, more than --count {}; raise --count",
                self.count
            ));
        }
        if !(1..=1 << 20).contains(&self.points) {
            return wrong(format!("--points is {}; give 1 to {}", self.points, 1 << 20));
        }
        Ok(())
    }
}

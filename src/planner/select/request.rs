//! The request for a choice from a pool: how many photos, how they are chosen, which ones in any case.

use serde::{Deserialize, Serialize};

use super::retrained::RetrainingSettings;
use crate::planner::methods::Method;
use crate::planner::plan::config::Preset;
use crate::planner::quality::viewers::Viewers;
use crate::{Error, Result};

/// The request for a choice. Photos by index into the set, ascending.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SelectionRequest {
    /// Photos to select.
    pub count: usize,
    /// The method that chooses.
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
    /// Where viewers will look from; else the positions of the pool's photos.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub viewers: Option<Viewers>,
    /// How [`Method::FisherRetrain`] trains.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub retraining: Option<RetrainingSettings>,
}

impl SelectionRequest {
    /// The defaults.
    pub fn new(count: usize) -> Self {
        Self {
            count,
            method: Method::Ours,
            include: Vec::new(),
            exclude: Vec::new(),
            seed: 0,
            points: 4000,
            preset: Preset::Object,
            viewers: None,
            retraining: None,
        }
    }

    /// Rejects a request that a pool of `photos` cannot meet.
    ///
    /// # Errors
    /// One line with the number that does not fit.
    pub fn validate(&self, photos: usize) -> Result<()> {
        let wrong = |what: String| Err(Error::request(what));
        if !self.method.entry().chooses {
            return wrong(format!("`method` {}: it places cameras and chooses no photos", self.method.name()));
        }
        let allowed = photos - self.exclude.len();
        if self.count == 0 {
            return wrong("`count` is 0; give at least 1".into());
        }
        if self.count > allowed {
            let barred =
                if self.exclude.is_empty() { String::new() } else { format!(" of {photos}, without `exclude`") };
            return wrong(format!("`count` is {}, but the pool has {allowed} photos{barred}; give fewer", self.count));
        }
        if self.include.len() > self.count {
            let included = self.include.len();
            return wrong(format!(
                "`include` names {included} photos, more than `count` {}; raise `count`",
                self.count
            ));
        }
        if !(1..=1 << 20).contains(&self.points) {
            return wrong(format!("`points` is {}; give 1 to {}", self.points, 1 << 20));
        }
        Ok(())
    }
}

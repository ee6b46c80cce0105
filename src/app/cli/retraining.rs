//! Options of methods that train while they choose.

use clap::Args;

use crate::files::photos::PhotoSet;
use crate::planner::select::retrained::RetrainingSettings;
use crate::splats::config::Background;
use crate::{Error, Result};

/// How the model is trained between two choices.
#[derive(Args, Debug)]
#[command(next_help_heading = "Training while choosing (fisherrf-retrain)")]
pub struct RetrainingOptions {
    /// Training iterations before each choice, for each photo chosen so far; 100, as published, are 495,000 iterations in total for 100
    /// photos [default: 100]
    #[arg(long, value_name = "N")]
    train_every: Option<u32>,
    /// Maximum number of splats [default: 200000]
    #[arg(long, value_name = "N")]
    max_splats: Option<u32>,
    /// Downsampling factor of the photos [default: 1]
    #[arg(long, value_name = "N")]
    shrink: Option<u32>,
    /// Background [default: black]
    #[arg(long, value_enum)]
    background: Option<Background>,
}

impl RetrainingOptions {
    /// The settings, where `method` trains; all photos of the set must have an image then.
    pub fn settings(&self, method: &str, trains: bool, set: &PhotoSet) -> Result<Option<RetrainingSettings>> {
        let given = [self.train_every, self.max_splats, self.shrink].iter().any(Option::is_some);
        if !trains {
            let what = "--train-every, --max-splats, --shrink and --background are for --method fisherrf-retrain";
            let wrong = given || self.background.is_some();
            return if wrong { Err(Error::request(format!("{what}; leave them out"))) } else { Ok(None) };
        }
        if set.photos.iter().any(|photo| photo.image.is_none()) {
            let what = format!("--method {method} trains on the photos, and these are poses alone; take fisherrf");
            return Err(Error::input(&set.path, what));
        }
        let of = RetrainingSettings::default();
        let settings = RetrainingSettings {
            every: self.train_every.unwrap_or(of.every),
            max_splats: self.max_splats.unwrap_or(of.max_splats),
            shrink: self.shrink.unwrap_or(of.shrink),
            background: self.background.unwrap_or(of.background),
            ..of
        };
        settings.validate()?;
        Ok(Some(settings))
    }
}

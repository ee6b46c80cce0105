//! Splats trained on photos, as a product: what scenes and pools share.

use std::fs;
use std::sync::Arc;

use super::stage::{Event, Observe, Stage};
use crate::gaussians::config::Config;
use crate::gaussians::data::split::Split;
use crate::gaussians::run::job::{self, Run};
use crate::gaussians::run::products::{CHECKPOINT, MODEL, RECORD};
use crate::gaussians::run::record::{Status, TrainRecord};
use crate::select::information::Model;
use crate::vulkan::Context;
use crate::{Error, Result, io};

/// How splats are trained.
pub struct Training {
    /// Where the photos come from.
    pub capture: String,
    /// Configuration.
    pub config: Config,
    /// Each pixel is a square of so many stored pixels.
    pub shrink: u32,
}

/// Trains splats on the photos of `split` and looks at its tests, unless `stage` holds all of that already.
///
/// # Errors
/// Where photos cannot be read any more, the device fails or has not enough memory, or `observe` broke it off.
pub fn run(
    context: &Arc<Context>,
    stage: Stage,
    training: Training,
    split: impl FnOnce() -> Result<Split>,
    observe: Observe,
) -> Result<(Stage, TrainRecord)> {
    if !stage.begins(observe)? {
        return stage.read(RECORD).map(|record| (stage, record));
    }
    let Training { capture, config, shrink } = training;
    let folder = stage.folder().to_owned();
    let asked = job::Request { capture, split: split()?, config, shrink, folder, save_every: 5000, evaluate_every: 0 };
    let run = Run::new(context, asked)?;
    let resume = stage.file(CHECKPOINT).is_file();
    let record = run.run(resume, None, &mut |_| observe(Event::Working))?;
    if record.status != Status::Complete {
        return Err(Error::Interrupted);
    }
    stage.write_json(RECORD, &record)?;
    stage.finish()?;
    // Three times as large as the model, and of no use any more; what cannot be removed harms nobody.
    drop(fs::remove_file(stage.file(CHECKPOINT)));
    Ok((stage, record))
}

/// The splats of a training that is complete.
///
/// # Errors
/// Where they cannot be read any more.
pub fn model(stage: &Stage) -> Result<Model> {
    let file = stage.file(MODEL);
    let (gaussians, _) = io::read_gaussians_with_notes(&file).map_err(|error| stage.damaged(&error.to_string()))?;
    let TrainRecord { config, .. } = stage.read(RECORD)?;
    Ok(Model { path: file.to_string_lossy().into_owned(), gaussians, antialiased: config.antialiased })
}

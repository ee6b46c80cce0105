//! Splats trained on photos, as an artifact: what scenes and pools share.

use std::fs;
use std::sync::Arc;

use super::artifact::{Artifact, ArtifactEvent, Observe};
use crate::engine::vulkan::Context;
use crate::files::io;
use crate::planner::select::information::Model;
use crate::splats::config::TrainConfig;
use crate::splats::data::split::Split;
use crate::splats::run::outputs::{CHECKPOINT, MODEL, RECORD};
use crate::splats::run::record::{Status, TrainRecord};
use crate::splats::run::request::{self, Run};
use crate::{Error, Result};

/// How splats are trained.
pub struct Training {
    /// Where the photos come from.
    pub capture: String,
    /// How splats are trained.
    pub config: TrainConfig,
    /// Each pixel is a square of so many stored pixels.
    pub shrink: u32,
}

/// Trains splats on the photos of `split` and evaluates its tests, unless `artifact` holds all of that already.
///
/// # Errors
/// Where photos cannot be read any more, the device fails or has not enough memory, or `observe` stopped it.
pub fn run(
    context: &Arc<Context>,
    artifact: Artifact,
    training: Training,
    split: impl FnOnce() -> Result<Split>,
    observe: Observe,
) -> Result<(Artifact, TrainRecord)> {
    if !artifact.begins(observe)? {
        return artifact.read(RECORD).map(|record| (artifact, record));
    }
    let Training { capture, config, shrink } = training;
    let folder = artifact.folder().to_owned();
    let asked =
        request::TrainRequest { capture, split: split()?, config, shrink, folder, save_every: 5000, evaluate_every: 0 };
    let run = Run::new(context, asked)?;
    let resume = artifact.file(CHECKPOINT).is_file();
    let record = run.run(resume, None, &mut |_| observe(ArtifactEvent::Working))?;
    if record.status != Status::Complete {
        return Err(Error::Interrupted);
    }
    artifact.write_json(RECORD, &record)?;
    artifact.finish()?;
    // Three times as large as the model, and no longer needed; a file that cannot be removed does no harm.
    drop(fs::remove_file(artifact.file(CHECKPOINT)));
    Ok((artifact, record))
}

/// The splats of a training that is complete.
///
/// # Errors
/// Where they cannot be read any more.
pub fn model(artifact: &Artifact) -> Result<Model> {
    let file = artifact.file(MODEL);
    let (gaussians, _) = io::read_gaussians_with_notes(&file).map_err(|error| artifact.damaged(&error.to_string()))?;
    let TrainRecord { config, .. } = artifact.read(RECORD)?;
    Ok(Model { path: file.to_string_lossy().into_owned(), gaussians, antialiased: config.antialiased })
}

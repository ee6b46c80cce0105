//! LPIPS with VGG16 of the test views, whose weights are the user's: an artifact of its own, so that nothing is trained again
//! for it.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Arc;

use serde_json::json;

use super::artifact::{Artifact, ArtifactEvent, Observe};
use super::settings::EvaluationSettings;
use super::subject::Subject;
use crate::engine::parallel::mapped;
use crate::engine::vulkan::Context;
use crate::files::photos::decode::{Encoded, encoded};
use crate::splats::image_metrics::{Lpips, Rgb8, Weights};
use crate::splats::run::outputs::{PICTURES, RECORD, picture_names};
use crate::splats::run::record::TrainRecord;
use crate::{Error, Result};

/// Distances of the test views by their names; none where a picture is too small for the network.
const DISTANCES: &str = "lpips.json";
type Distances = BTreeMap<String, Option<f64>>;

/// Pairs that are decoded at once.
const AT_ONCE: usize = 16;

/// Refuses a network whose test pictures would be too large for one of the devices, or all too small.
///
/// # Errors
/// In a line that names the subject or what to do.
pub fn check(
    contexts: &[Arc<Context>],
    weights: &Weights,
    subject: &Subject,
    settings: &EvaluationSettings,
) -> Result<()> {
    let (width, height) = match subject {
        Subject::Scene(_) => (settings.size, settings.size),
        Subject::Pool(pool) => {
            let sizes = pool.held_out.iter().map(|photo| &photo.camera.intrinsics);
            let largest = sizes.fold((0, 0), |(w, h), lens| (w.max(lens.width), h.max(lens.height)));
            (largest.0 / settings.shrink, largest.1 / settings.shrink)
        }
    };
    for context in contexts {
        Lpips::check(context, weights.network(), width, height).map_err(|error| match error {
            Error::OutOfMemory { what, wanted, available, .. } => {
                let remedy = "leave out --lpips-vgg, or take smaller pictures (--size, of pools --shrink)".into();
                Error::OutOfMemory { what, wanted, available, remedy }
            }
            error => Error::input(subject.path(), format!("--lpips-vgg: {error}")),
        })?;
    }
    Ok(())
}

/// Adds the distances of the test views to the record of a training, which has its folder below `root`. False where `observe`
/// stopped it; it then starts over.
///
/// # Errors
/// Where pictures cannot be read any more, or the device fails or has not enough memory for their size.
pub fn measure(
    context: &Arc<Context>,
    weights: &Weights,
    root: &Path,
    trained: &Artifact,
    record: &mut TrainRecord,
    observe: Observe,
) -> Result<()> {
    // A training that was made again has other pictures, perhaps, under the same key.
    let made = fs::read(trained.file(RECORD)).map_err(|error| trained.damaged(&format!("{RECORD}: {error}")))?;
    let made = crc32fast::hash(&made);
    let inputs = json!({ "training": trained.key(), "made": made, "weights": weights.fingerprint() });
    let artifact = Artifact::new(root, "lpips", inputs);
    let distances: Distances = if artifact.begins(observe)? {
        let distances = distances(context, weights, trained, record, observe)?;
        artifact.write_json(DISTANCES, &distances)?;
        artifact.finish()?;
        distances
    } else {
        artifact.read(DISTANCES)?
    };
    for view in &mut record.test_views {
        let distance = distances.get(&view.name);
        let lacks = || artifact.damaged(&format!("{DISTANCES} lacks {}", view.name));
        view.quality.lpips_vgg = *distance.ok_or_else(lacks)?;
    }
    Ok(())
}

/// The network stays on the device while it is used and no longer: training needs the memory.
fn distances(
    context: &Arc<Context>,
    weights: &Weights,
    trained: &Artifact,
    record: &TrainRecord,
    observe: Observe,
) -> Result<Distances> {
    let mut lpips = Lpips::new(context, weights)?;
    let names: Vec<String> = record.test_views.iter().map(|view| view.name.clone()).collect();
    let files = picture_names(&names);
    let views: Vec<_> = names.into_iter().zip(&files).collect();
    let folder = trained.folder();
    let read = |file: &Path| {
        let [rendered, reference] = PICTURES.map(|of| encoded(&folder.join(of).join(file), [0; 3]));
        Ok([rendered?, reference?])
    };
    let mut distances = Distances::new();
    for some in views.chunks(AT_ONCE) {
        for ((name, _), pair) in some.iter().zip(mapped(some, |_, (_, file)| read(file))) {
            Error::unless_stopped(observe(ArtifactEvent::Working))?;
            let [rendered, reference] = pair.map_err(|error: Error| trained.damaged(&error.to_string()))?;
            let least = lpips.network().least();
            let distance = match rendered.width.min(rendered.height) >= least {
                true => Some(lpips.distance(&view(&rendered)?, &view(&reference)?)?),
                false => None,
            };
            distances.insert(name.clone(), distance);
        }
    }
    Ok(distances)
}

fn view(picture: &Encoded) -> Result<Rgb8<'_>> {
    Rgb8::new(picture.width, picture.height, &picture.pixels)
}

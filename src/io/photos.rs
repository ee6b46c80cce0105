//! Captures: posed photos with lenses, images and masks, and the sparse points where a reconstruction has them.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::colmap;
use crate::error::{Error, Result};
use crate::photos::{Photo, PhotoSet};
use crate::scene::surface::{Points, Surface};

/// Reads a capture: a folder with a COLMAP model (here, in `sparse/0` or `sparse`), images beside it.
///
/// # Errors
/// As [`super::read_cameras`], and where the folder is no capture.
pub fn read(path: &Path) -> Result<PhotoSet> {
    let Some(model) = colmap::model_folder(path) else {
        return Err(Error::input(path, "the folder holds no COLMAP model (cameras and images as .bin or .txt)"));
    };
    let mut notes = Vec::new();
    let parts = colmap::model(&model, &mut notes)?;
    let root = root(path, &model);
    let number: HashMap<u32, u32> = parts.images.iter().zip(0..).map(|(image, i)| (image.id, i)).collect();
    let photos = parts
        .cameras
        .into_iter()
        .zip(&parts.images)
        .map(|(camera, image)| {
            let distortion = parts.lenses.get(&image.lens).map(colmap::Lens::unified).unwrap_or_default();
            let image = existing(root.join("images").join(&camera.name));
            let mask = existing(root.join("masks").join(format!("{}.png", camera.name)));
            Photo { camera, distortion, image, mask }
        })
        .collect();
    let (mut points, mut tracks, mut errors) = (Points::default(), Vec::new(), Vec::new());
    if let Some((Surface::Points(surface), sparse)) = parts.points {
        points = surface;
        for point in sparse {
            let mut track: Vec<u32> = point.track.iter().filter_map(|id| number.get(id).copied()).collect();
            track.sort_unstable();
            track.dedup();
            tracks.push(track);
            errors.push(point.error as f32);
        }
    }
    Ok(PhotoSet { path: path.to_owned(), photos, points, tracks, errors, notes })
}

fn existing(path: PathBuf) -> Option<PathBuf> {
    path.is_file().then_some(path)
}

/// The folder that holds `images`: the capture itself, or one above the model.
fn root(path: &Path, model: &Path) -> PathBuf {
    let above = [path, model].into_iter().flat_map(Path::ancestors).take(8);
    above.into_iter().find(|folder| folder.join("images").is_dir()).unwrap_or(path).to_owned()
}

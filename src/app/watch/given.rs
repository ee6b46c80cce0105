//! Poses that lie beside the photos: what is to be watched of such a capture.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::inbox::{Stamp, below};
use crate::Result;
use crate::files::io::colmap;
use crate::files::io::photos::{self, Images, ReadOptions};

/// What has the poses of captures, beside COLMAP's models; of folders the time counts at which one was added.
const POSES: [&str; 6] = [
    "transforms.json",
    "transforms_train.json",
    "metadata",
    "keyframes/cameras",
    "keyframes/corrected_cameras",
    "pose",
];
const COLMAP: [&str; 6] = ["images.bin", "images.txt", "points3D.bin", "points3D.txt", "cameras.bin", "cameras.txt"];

/// The files that say where the photos of a folder were taken, as they were at the last look.
pub struct PoseFiles {
    folder: PathBuf,
    stamps: BTreeMap<PathBuf, Stamp>,
}

impl PoseFiles {
    /// Of a folder, before the first look.
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), stamps: BTreeMap::new() }
    }

    /// Looks for them; whether any is new, changed or gone.
    pub fn scan(&mut self) -> bool {
        let files = POSES.iter().map(|name| self.folder.join(name));
        let model = colmap::model_folder(&self.folder);
        let all = files.chain(model.iter().flat_map(|model| COLMAP.map(|name| model.join(name))));
        let stamps = all.filter_map(|file| Some((file.clone(), Stamp::of(&file)?))).collect();
        std::mem::replace(&mut self.stamps, stamps) != self.stamps
    }
}

/// The folders that the photos of a capture lie in, by their path from `images`: others have masks, depths and the like.
///
/// # Errors
/// Where the capture cannot be read.
pub fn folders_of_photos(capture: &Path, images: &Path) -> Result<Vec<String>> {
    let files = photos::read(capture, &ReadOptions::from(Images::SkipMissing))?
        .photos
        .into_iter()
        .filter_map(|photo| photo.image);
    let folders: BTreeSet<String> = files.filter_map(|file| below(images, file.parent()?)).collect();
    Ok(folders.into_iter().collect())
}

//! A pool of photos that is evaluated on: candidates to choose from, and photos that are held out.

use std::fs;
use std::path::Path;

use super::request::EvaluationRequest;
use crate::files::io::photos::{self, Images, ReadOptions};
use crate::files::photos::{Photo, PhotoSet};
use crate::splats::data::split::{Split, TEST_EVERY, Test};
use crate::{Error, Result};

/// A capture, split into candidates and held-out photos.
pub struct Pool {
    /// Name in tables and of its folder.
    pub name: String,
    /// The photos to choose from, with the points that any of them sees.
    pub candidates: PhotoSet,
    /// The photos that choices are scored on.
    pub held_out: Vec<Photo>,
    /// CRC-32 of all photos, their cameras and the points.
    pub checksum: u32,
}

impl Pool {
    /// Reads a capture and holds every eighth photo out, by name from the first on; the notes report what was understood. Points
    /// that only photos held out see are left out too.
    ///
    /// # Errors
    /// Where it cannot be read, lacks an image, or has too few photos for the request.
    pub fn read(path: &Path, request: &EvaluationRequest, notes: &mut Vec<String>) -> Result<Self> {
        let mut set = photos::read(path, &ReadOptions { images: Images::Needed, ..ReadOptions::default() })?;
        notes.append(&mut set.notes);
        let all = set.photos.len();
        let checksum = checksum(&set)?;
        let Split { train, test: held_out, .. } = Split::new(set, &Test::Every(TEST_EVERY), Images::Needed.into())?;
        let candidates = train.with_points_seen();
        let count = candidates.photos.len();
        let needed = request.budgets.iter().map(|budget| ("--budgets", *budget));
        let inputs = request.needs_model().then_some(request.settings.inputs);
        let mut needed = needed.chain(inputs.map(|inputs| ("--inputs", inputs)));
        if let Some((option, wanted)) = needed.find(|(_, wanted)| *wanted as usize > count) {
            let what = format!(
                "{count} of its {all} photos are to choose from, the rest is held out, and {option} is {wanted}; give fewer"
            );
            return Err(Error::input(path, what));
        }
        notes.push(format!("{}: {} photos held out, {count} to choose from", path.display(), held_out.len()));
        let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let name = if whole.is_dir() { whole.file_name() } else { whole.file_stem() };
        let name = name.map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        Ok(Self { name, candidates, held_out, checksum })
    }

    /// Where it was read from.
    pub fn path(&self) -> &Path {
        &self.candidates.path
    }
}

/// CRC-32 of all that a choice and a training depend on.
fn checksum(set: &PhotoSet) -> Result<u32> {
    let mut sum = crc32fast::Hasher::new();
    for Photo { camera, distortion, image, mask } in &set.photos {
        sum.update(format!("{camera:?} {distortion:?}").as_bytes());
        for file in image.iter().chain(mask) {
            sum.update(&fs::read(file).map_err(|source| Error::io(file, source))?);
        }
    }
    sum.update(format!("{:?} {:?}", set.points, set.tracks).as_bytes());
    Ok(sum.finalize())
}

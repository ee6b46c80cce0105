//! The files of a capture: which there are, whether a folder holds the same capture already, and how each is written.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::tracer::{FirstHits, Photograph};
use crate::io::folder::{check_folder, replace_file};
use crate::io::picture::{self, Format, stem};
use crate::scene::camera::Camera;
use crate::scene::colour::encoded;
use crate::{Error, Result};

/// The file that says what a folder's capture is of.
pub const RECORD: &str = "capture.json";
/// The file that is written last.
pub const LAST: &str = "transforms.json";

/// What a capture is of, and how: two captures of the same record have the same bits on the same device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Version of the program.
    pub version: String,
    /// Checksum of scene and environment as they are laid out for the device.
    pub scene: u32,
    /// The cameras.
    pub cameras: Vec<Camera>,
    /// Samples of a pixel.
    pub samples: u32,
    /// Key of the random numbers.
    pub seed: u64,
    /// Factor of two, so many times, on the light of the 8-bit pictures.
    pub exposure: f32,
    /// Whether the environment is seen behind the scene; else alpha is written there.
    pub show_sky: bool,
    /// Whether depths are written.
    pub depth: bool,
    /// Whether normals are written.
    pub normals: bool,
    /// Whether linear pictures are written.
    pub exr: bool,
}

/// Cameras under the names of their photographs, which are PNG files.
///
/// # Errors
/// Where a name is none, or two would be the same.
pub fn named(cameras: &[Camera]) -> Result<Vec<Camera>> {
    let mut owners = HashMap::new();
    let mut named = Vec::with_capacity(cameras.len());
    for camera in cameras {
        let Some(stem) = stem(&camera.name) else {
            let what = format!("a camera is called {:?}, which names no file; rename it", camera.name);
            return Err(Error::request(what));
        };
        let name = format!("{stem}.png");
        if let Some(other) = owners.insert(name.clone(), &camera.name) {
            let what = format!("the cameras {other:?} and {:?} would both be images/{name}; rename one", camera.name);
            return Err(Error::request(what));
        }
        named.push(Camera { name, ..camera.clone() });
    }
    Ok(named)
}

/// A folder that a capture is written into, picture by picture.
pub struct Products {
    folder: PathBuf,
    /// Whether pictures that are there stay.
    resumes: bool,
}

impl Products {
    /// Looks at the folder: a capture of the same record is taken up where it stopped, unless `force` is given.
    ///
    /// # Errors
    /// Where it holds something else and `force` is not given, or cannot be written.
    pub fn new(folder: &Path, record: &Record, force: bool) -> Result<Self> {
        let file = folder.join(RECORD);
        let resumes = !force && file.is_file();
        if resumes {
            let text = fs::read(&file).map_err(|source| Error::io(&file, source))?;
            let other: Option<Record> = serde_json::from_slice(&text).ok();
            // Both through text, so that numbers compare as they are stored.
            let same = serde_json::to_value(record).ok() == other.and_then(|other| serde_json::to_value(other).ok());
            if !same {
                let what = "the folder holds a capture of something else, or with other settings; name another folder, or \
                            pass --force to begin anew";
                return Err(Error::input(folder, what));
            }
        }
        check_folder(folder, force || resumes)?;
        Ok(Self { folder: folder.to_owned(), resumes })
    }

    /// Makes the folder and says in it what it holds. What an earlier capture left as its last is taken away first, so that
    /// the folder is never taken for complete.
    ///
    /// # Errors
    /// Where the system refuses.
    pub fn begin(&self, record: &Record) -> Result<()> {
        let last = self.folder.join(LAST);
        if !self.resumes && last.is_file() {
            fs::remove_file(&last).map_err(|source| Error::io(&last, source))?;
        }
        let text = serde_json::to_vec_pretty(record).unwrap_or_default();
        self.write(RECORD, &text)
    }

    /// Whether a camera's photograph is there from an earlier run.
    pub fn has(&self, camera: &Camera) -> bool {
        self.resumes && self.folder.join("images").join(&camera.name).is_file()
    }

    /// Writes what belongs to one camera; its photograph comes last, and each file appears whole.
    ///
    /// # Errors
    /// Where the system refuses.
    pub fn picture(
        &self,
        record: &Record,
        camera: &Camera,
        taken: &Photograph,
        hits: Option<&FirstHits>,
    ) -> Result<()> {
        let Photograph { width, pixels } = taken;
        let name = &camera.name;
        let stem = name.strip_suffix(".png").unwrap_or(name);
        let with_alpha = !record.show_sky;
        if let Some(hits) = hits {
            if record.depth {
                let depths = hits.iter().map(|hit| hit[3]).collect();
                self.write(&format!("depth/{stem}.exr"), &picture::depths(*width, depths)?)?;
            }
            if record.normals {
                self.write(&format!("normals/{stem}.exr"), &picture::normals(*width, hits)?)?;
            }
        }
        if record.exr {
            self.write(&format!("linear/{stem}.exr"), &picture::linear(*width, pixels, with_alpha)?)?;
        }
        if with_alpha {
            let mask: Vec<u8> = pixels.iter().map(|pixel| (255.0 * pixel[3]).round() as u8).collect();
            self.write(&format!("masks/{name}.png"), &picture::grey(*width, &mask)?)?;
        }
        let gain = record.exposure.exp2();
        let straight = |pixel: &[f32; 4]| {
            let [r, g, b, alpha] = *pixel;
            let scale = if with_alpha && alpha > 0.0 { gain / alpha } else { gain };
            let [r, g, b] = [r, g, b].map(|v| encoded(f64::from(scale * v)) as f32);
            [r, g, b, alpha]
        };
        let shown: Vec<[f32; 4]> = pixels.iter().map(straight).collect();
        self.write(&format!("images/{name}"), &picture::colours(Format::Png, *width, &shown, with_alpha)?)
    }

    /// The photograph of a camera as it stands in the folder.
    ///
    /// # Errors
    /// Where it cannot be read any more.
    pub fn read(&self, camera: &Camera) -> Result<image::RgbaImage> {
        let file = self.folder.join("images").join(&camera.name);
        let picture = image::open(&file).map_err(|e| Error::input(&file, format!("{e}; remove it and run again")))?;
        Ok(picture.into_rgba8())
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let file = self.folder.join(name);
        if let Some(parent) = file.parent() {
            fs::create_dir_all(parent).map_err(|source| Error::io(parent, source))?;
        }
        replace_file(&file, |to| to.write_all(bytes))
    }
}

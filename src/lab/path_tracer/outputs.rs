//! The files of a capture: which there are, whether a folder holds the same capture already, and how each is written.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use exr::prelude::read_first_flat_layer_from_file;
use image::GenericImageView as _;
use serde::{Deserialize, Serialize};

use super::lightmap;
use super::noise::Noise;
use super::tracer::{FirstHits, Photograph};
use crate::files::io::folder::{check_folder, check_no_links, replace_file};
use crate::files::io::picture::{self, Format, stem};
use crate::scene::camera::Camera;
use crate::scene::colour::encoded;
use crate::{Error, Result};

/// The file that records what a folder's capture shows.
pub(crate) const RECORD: &str = "capture.json";
/// The file that is written last.
pub(crate) const LAST: &str = "transforms.json";

/// The file that has the noise of the pictures.
const NOISE: &str = "noise.json";

/// The noise of a folder's pictures, of those that were measured.
pub(crate) fn noise_of(folder: &Path) -> Noise {
    fs::read(folder.join(NOISE)).ok().and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default()
}

/// What a capture shows, and its settings: two captures of the same record have the same bits on the same device.
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
    /// The light map; none where diffuse light is traced.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light: Option<lightmap::LightmapSettings>,
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

/// Folders that are written into.
const FOLDERS: [&str; 6] = ["images", "masks", "depth", "normals", "linear", "sparse/0"];

/// Bytes of a file's name before `.png.png`, which masks have.
const LONGEST_NAME: usize = 255 - 8;

/// The exposure of the capture that a folder holds, where it holds one.
pub fn recorded_exposure(folder: &Path) -> Option<f32> {
    let record: Record = serde_json::from_slice(&fs::read(folder.join(RECORD)).ok()?).ok()?;
    Some(record.exposure)
}

/// Cameras under the names of their photographs, which are PNG files.
///
/// # Errors
/// Where a name is none, or two would be the same.
pub fn named(cameras: &[Camera]) -> Result<Vec<Camera>> {
    let mut owners = HashMap::new();
    let mut named = Vec::with_capacity(cameras.len());
    for camera in cameras {
        // The longest suffix makes file names of 255 bytes.
        let Some(stem) = stem(&camera.name)
            .filter(|stem| !stem.contains('\0') && stem.split('/').all(|part| part.len() <= LONGEST_NAME))
        else {
            let what = format!("a camera is called {:?}, which no file can be; rename it", camera.name);
            return Err(Error::request(what));
        };
        let name = format!("{stem}.png");
        if let Some(other) = owners.insert(name.clone(), &camera.name) {
            let what = format!("the cameras {other:?} and {:?} would both be images/{name}; rename one", camera.name);
            return Err(Error::request(what));
        }
        named.push(Camera { name, ..camera.clone() });
    }
    for name in owners.keys() {
        // A folder of that name would be in the way of the picture, or of its mask.
        let folder = named.iter().find_map(|camera| {
            let mut above = camera.name.match_indices('/').map(|(end, _)| &camera.name[..end]);
            above.find(|above| above == name || above.strip_suffix(".png") == Some(name))
        });
        if folder.is_some() {
            let what = format!("images/{name} would be a picture and a folder of others; rename the camera {name:?}");
            return Err(Error::request(what));
        }
    }
    Ok(named)
}

/// What there is of a photograph with its mask and maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    /// The photograph is not there.
    Nothing,
    /// It is, but it, its mask or a map cannot be read whole, or is of another size.
    Damaged,
    /// All of it is there.
    Whole,
}

/// A folder that a capture is written into, picture by picture.
pub struct Outputs {
    folder: PathBuf,
    /// Whether pictures that are there stay.
    resumes: bool,
}

impl Outputs {
    /// Looks at the folder: a capture of the same record is resumed where it stopped, unless `force` is given.
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
                            pass `force` to begin anew";
                return Err(Error::input(folder, what));
            }
        }
        check_folder(folder, force || resumes)?;
        let subfolders = FOLDERS.iter().map(|name| folder.join(name).join("any"));
        let nested = record.cameras.iter().flat_map(|camera| FOLDERS.map(|name| folder.join(name).join(&camera.name)));
        subfolders.chain(nested).try_for_each(|file| check_no_links(folder, &file))?;
        Ok(Self { folder: folder.to_owned(), resumes })
    }

    /// Makes the folder and records in it what it holds. Where pictures are to be taken, what an earlier capture left as its last is
    /// taken away first, so that the folder is never taken for complete; then what has the names of this one's pictures, which
    /// would be taken for its own where it is stopped and resumed.
    ///
    /// # Errors
    /// Where the system refuses.
    pub fn begin(&self, record: &Record, complete: bool) -> Result<()> {
        let last = self.folder.join(LAST);
        if !complete && last.is_file() {
            fs::remove_file(&last).map_err(|source| Error::io(&last, source))?;
        }
        let noise = self.folder.join(NOISE);
        if !self.resumes && noise.is_file() {
            fs::remove_file(&noise).map_err(|source| Error::io(&noise, source))?;
        }
        for camera in record.cameras.iter().filter(|_| !self.resumes) {
            let name = &camera.name;
            let stem = name.strip_suffix(".png").unwrap_or(name);
            let masks = [format!("images/{name}"), format!("masks/{name}.png")];
            let maps = ["depth", "normals", "linear"].map(|kind| format!("{kind}/{stem}.exr"));
            for file in masks.iter().chain(&maps).map(|file| self.folder.join(file)).filter(|file| file.is_file()) {
                fs::remove_file(&file).map_err(|source| Error::io(&file, source))?;
            }
        }
        // Plain numbers and text can always be written.
        let text = serde_json::to_vec_pretty(record).unwrap_or_default();
        self.write(RECORD, &text)
    }

    /// What an earlier run left of a camera's photograph.
    pub fn found(&self, record: &Record, camera: &Camera) -> Found {
        let file = |name: String| self.folder.join(name);
        let picture = file(format!("images/{}", camera.name));
        if !self.resumes || !picture.is_file() {
            return Found::Nothing;
        }
        let size = (camera.intrinsics.width, camera.intrinsics.height);
        let whole = |file: &Path| image::open(file).is_ok_and(|picture| picture.dimensions() == size);
        let stem = camera.name.strip_suffix(".png").unwrap_or(&camera.name);
        let maps = [("depth", record.depth), ("normals", record.normals), ("linear", record.exr)];
        let maps_are_whole = maps
            .into_iter()
            .filter(|(_, wanted)| *wanted)
            .all(|(kind, _)| read_first_flat_layer_from_file(file(format!("{kind}/{stem}.exr"))).is_ok());
        match whole(&picture)
            && (record.show_sky || whole(&file(format!("masks/{}.png", camera.name))))
            && maps_are_whole
        {
            true => Found::Whole,
            false => Found::Damaged,
        }
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

    /// The noise of pictures that an earlier run of this capture has measured.
    pub fn noise(&self) -> Noise {
        if self.resumes { noise_of(&self.folder) } else { Noise::default() }
    }

    /// Puts the pictures' noise down.
    ///
    /// # Errors
    /// Where the system refuses.
    pub fn write_noise(&self, noise: &Noise) -> Result<()> {
        // Plain numbers and text can always be written.
        self.write(NOISE, &serde_json::to_vec_pretty(noise).unwrap_or_default())
    }

    /// The photograph of a camera as it is in the folder.
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

//! COLMAP sparse models: cameras, images and points3D, as text or little-endian binary.
//!
//! COLMAP stores camera-from-world rotations and translations in OpenCV axes; here poses are world-from-camera. The
//! world frame and its arbitrary scale are left as they are. Where a model has rigs and frames, images have their poses
//! ([`rigs`]). Lenses, images, points and lines of text that cannot be used are left out, counted and named.

pub mod binary;
mod lens;
pub mod rigs;
mod subset;
pub mod text;
pub(crate) mod write;

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

pub(crate) use self::lens::PROJECTIONS;
pub use self::lens::{Lens, Projection};
pub use self::subset::{Subset, subset};
use super::checks;
use super::left_out::LeftOut;
use crate::error::{Error, Result};
use crate::scene::camera::{Camera, Pose};
use crate::scene::surface::{Points, Surface};

/// A posed image.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Number that tracks refer to.
    pub id: u32,
    /// Number of its lens.
    pub lens: u32,
    /// File name, relative to the image folder.
    pub name: String,
    /// Camera-from-world quaternion (w, x, y, z) and translation, as they are in the file.
    pub stored: ([f64; 4], [f64; 3]),
    /// What was observed in it, in the order of the file; empty where it was not requested.
    pub observations: Vec<Observation>,
}

/// A feature in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Where, in pixels.
    pub pixel: [f64; 2],
    /// Number of the point that it shows, or [`NO_POINT`].
    pub point: u64,
}

/// The number that means no point.
pub const NO_POINT: u64 = u64::MAX;

/// A reconstructed point.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Number that observations refer to.
    pub id: u64,
    /// Position in the world.
    pub position: DVec3,
    /// 8-bit sRGB.
    pub colour: [u8; 3],
    /// Mean reprojection error in pixels.
    pub error: f64,
    /// Where it was seen: number of the image, and which of its observations.
    pub track: Vec<[u32; 2]>,
}

impl Image {
    /// World-from-camera pose; none where the quaternion has no length or a number is not finite.
    pub fn pose(&self) -> Option<Pose> {
        let ([w, x, y, z], translation) = self.stored;
        let rotation = DQuat::from_xyzw(x, y, z, w);
        let length = rotation.length();
        if !(length.is_finite() && length > 1e-9) {
            return None;
        }
        let rotation = rotation.normalize().conjugate();
        let position = -(rotation * DVec3::from_array(translation));
        checks::usable(position).then_some(Pose { position, rotation })
    }
}

/// Folders of a capture that hold a model, or one in each of their numbered folders.
const MODEL_FOLDERS: [&str; 3] = ["", "sparse", "colmap/sparse"];

/// The folder in or under `path` that holds a model: itself, or in `sparse` or `colmap/sparse`. Of several numbered ones, as COLMAP writes
/// them where it could not join all images, that with the most images.
pub(crate) fn model_folder(path: &Path) -> Option<PathBuf> {
    if is_model(path) {
        return Some(path.to_owned());
    }
    MODEL_FOLDERS.iter().find_map(|below| {
        let folder = path.join(below);
        largest(numbered(&folder)).or_else(|| is_model(&folder).then_some(folder))
    })
}

/// What to say of a model that [`model_folder`] chose among several in `path`.
pub(crate) fn others_note(path: &Path, model: &Path) -> Option<String> {
    let parent = model.parent().filter(|_| model != path)?;
    let mut all = numbered(parent);
    all.retain(|(folder, _)| folder != model);
    let (other, images) = all.iter().max_by_key(|(_, images)| *images)?;
    let count = image_count(model);
    let name = |folder: &Path| folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Some(format!(
        "{} holds {} models: {} is read, of {count} images; {} has {images}; name another one's folder to read that",
        parent.display(),
        all.len() + 1,
        name(model),
        name(other)
    ))
}

fn is_model(folder: &Path) -> bool {
    file(folder, "cameras").is_some() && file(folder, "images").is_some()
}

/// The models in folders of `folder` whose names are numbers, in their order, with their numbers of images.
fn numbered(folder: &Path) -> Vec<(PathBuf, usize)> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let number = |entry: std::fs::DirEntry| Some((entry.file_name().to_str()?.parse::<u32>().ok()?, entry.path()));
    let mut found: Vec<(u32, PathBuf)> = entries.filter_map(number).filter(|(_, path)| is_model(path)).collect();
    found.sort();
    match &found[..] {
        // Nothing to compare.
        [_] => found.into_iter().map(|(_, path)| (path, 0)).collect(),
        _ => found.into_iter().map(|(_, path)| (image_count(&path), path)).map(|(count, path)| (path, count)).collect(),
    }
}

/// The first of those with the most images.
fn largest(models: Vec<(PathBuf, usize)>) -> Option<PathBuf> {
    models.into_iter().rev().max_by_key(|(_, images)| *images).map(|(folder, _)| folder)
}

/// Number of images of a model; zero where its file cannot be read.
fn image_count(folder: &Path) -> usize {
    let Ok(Some(source)) = Source::find(folder, "images") else { return 0 };
    match source.is_binary {
        true => source.bytes.first_chunk().map_or(0, |count| u64::from_le_bytes(*count) as usize),
        false => text::images(&source.bytes, &mut LeftOut::default()).len(),
    }
}

/// What a folder in or under `path` that holds only one half of a model has, and what it lacks.
pub(crate) fn half_model(path: &Path) -> Option<(&'static str, &'static str)> {
    let folders = MODEL_FOLDERS.iter().flat_map(|below| [path.join(below), path.join(below).join("0")]);
    let folders: Vec<PathBuf> = folders.collect();
    let has = |name: &str| folders.iter().any(|folder| file(folder, name).is_some());
    match (has("cameras"), has("images")) {
        (true, false) => Some(("cameras.bin or cameras.txt", "images.bin or images.txt")),
        (false, true) => Some(("images.bin or images.txt", "cameras.bin or cameras.txt")),
        _ => None,
    }
}

/// The binary or text file of that name in a model folder; the binary one where there are both, as COLMAP does.
fn file(folder: &Path, name: &str) -> Option<PathBuf> {
    ["bin", "txt"].iter().map(|extension| folder.join(name).with_extension(extension)).find(|path| path.is_file())
}

/// One of a model's files, which may be empty.
struct Source {
    path: PathBuf,
    bytes: Vec<u8>,
    is_binary: bool,
}

impl Source {
    /// The file of that name in a model folder; none where there is none.
    fn find(folder: &Path, name: &str) -> Result<Option<Self>> {
        let Some(path) = file(folder, name) else { return Ok(None) };
        let bytes = std::fs::read(&path).map_err(|source| Error::io(&path, source))?;
        let is_binary = path.extension().is_some_and(|extension| extension == "bin");
        Ok(Some(Self { path, bytes, is_binary }))
    }

    /// As [`Source::find`], where there must be one that holds something.
    fn needed(folder: &Path, name: &str) -> Result<Self> {
        match Self::find(folder, name)? {
            Some(source) if source.bytes.is_empty() => {
                Err(Error::input(source.path, "the file is empty; export it again"))
            }
            Some(source) => Ok(source),
            None => {
                let what = format!("it holds no {name}.bin and no {name}.txt; export the model again");
                Err(Error::input(folder, what))
            }
        }
    }
}

/// The lenses of a model and its images in the order of the file, with the observations of those whose name `wanted` accepts. All images
/// can be used.
///
/// # Errors
/// Where a file is missing or cut short, or no image is left.
fn views(
    folder: &Path,
    wanted: impl Fn(&str) -> bool,
    notes: &mut Vec<String>,
) -> Result<(BTreeMap<u32, Lens>, Vec<Image>)> {
    let (mut bad_lenses, mut bad_images) = (LeftOut::default(), LeftOut::default());
    let source = Source::needed(folder, "cameras")?;
    let lenses = match source.is_binary {
        true => binary::cameras(&source.path, &source.bytes, &mut bad_lenses)?,
        false => text::cameras(&source.bytes, &mut bad_lenses),
    };
    let source = Source::needed(folder, "images")?;
    let mut images = match source.is_binary {
        true => binary::observed(&source.path, &source.bytes, wanted)?,
        false => text::observed(&source.bytes, wanted, &mut bad_images),
    };
    if let (Some(of_rigs), Some(of_frames)) = (Source::find(folder, "rigs")?, Source::find(folder, "frames")?) {
        let (mut bad_rigs, mut bad_frames) = (LeftOut::default(), LeftOut::default());
        let rigs = match of_rigs.is_binary {
            true => binary::rigs(&of_rigs.path, &of_rigs.bytes)?,
            false => text::rigs(&of_rigs.bytes, &mut bad_rigs),
        };
        let frames = match of_frames.is_binary {
            true => binary::frames(&of_frames.path, &of_frames.bytes)?,
            false => text::frames(&of_frames.bytes, &mut bad_frames),
        };
        bad_rigs.note("rigs", notes);
        bad_frames.note("frames", notes);
        rigs::pose_images(&rigs, &frames, &mut images, notes);
    }
    let images = usable(&lenses, images, &mut bad_images);
    if images.is_empty() {
        let why = bad_lenses.first().or(bad_images.first());
        let what = why.map_or("it holds no images".into(), |why| format!("no image of the model can be used: {why}"));
        return Err(Error::input(source.path, format!("{what}; export the model again")));
    }
    bad_lenses.note("cameras of the model", notes);
    bad_images.note("images", notes);
    Ok((lenses, images))
}

/// The images that have a pose, a lens, and a number and name of their own.
pub fn usable(lenses: &BTreeMap<u32, Lens>, mut images: Vec<Image>, left_out: &mut LeftOut) -> Vec<Image> {
    let (mut numbers, mut names) = (HashSet::new(), HashSet::new());
    images.retain(|image| {
        let Image { id, lens, name, .. } = image;
        let what = if image.pose().is_none() {
            "has a pose that is not finite or no rotation".into()
        } else if !lenses.contains_key(lens) {
            format!("was taken with camera {lens}, which is not among those of the model that can be used")
        } else if !numbers.insert(*id) {
            format!("has the number {id} of another one")
        } else if !names.insert(name.clone()) {
            "is there twice".into()
        } else {
            return true;
        };
        left_out.add(format!("image {name:?} {what}"));
        false
    });
    images
}

/// The cameras of images that can be used, in their order.
pub fn cameras_of(lenses: &BTreeMap<u32, Lens>, images: &[Image]) -> Vec<Camera> {
    let camera = |image: &Image| {
        let intrinsics = lenses.get(&image.lens)?.intrinsics;
        Some(Camera { name: image.name.clone(), pose: image.pose()?, intrinsics })
    };
    images.iter().filter_map(camera).collect()
}

/// Reads the cameras of a model folder, ordered by name, since COLMAP's own order changes from run to run.
pub fn cameras(folder: &Path, notes: &mut Vec<String>) -> Result<Vec<Camera>> {
    let (lenses, mut images) = views(folder, |_| false, notes)?;
    images.sort_by(|a, b| a.name.cmp(&b.name));
    let distorted = images.iter().filter(|image| lenses[&image.lens].distortion.iter().any(|&k| k != 0.0)).count();
    if distorted > 0 {
        notes.push(checks::taken_as_pinholes(distorted, images.len()));
    }
    Ok(cameras_of(&lenses, &images))
}

/// All parts of a model, images and cameras in the order of names.
pub struct Model {
    /// Lenses by their number.
    pub lenses: BTreeMap<u32, Lens>,
    /// Images, ordered by name.
    pub images: Vec<Image>,
    /// Their cameras, in the same order.
    pub cameras: Vec<Camera>,
    /// The points; none where there is no file of points or it is empty.
    pub points: Vec<Point>,
}

impl Model {
    /// The points with the mean direction to the cameras of each point's track.
    pub fn surface_points(&self) -> Points {
        surface_points(&self.points, &self.images)
    }
}

/// Reads a whole model folder.
pub fn model(folder: &Path, notes: &mut Vec<String>) -> Result<Model> {
    let (lenses, mut images) = views(folder, |_| false, notes)?;
    images.sort_by(|a, b| a.name.cmp(&b.name));
    let cameras = cameras_of(&lenses, &images);
    let points = points(folder, notes)?.unwrap_or_default();
    Ok(Model { lenses, images, cameras, points })
}

/// The points of a model folder that are somewhere; none where it has no file of points.
fn points(folder: &Path, notes: &mut Vec<String>) -> Result<Option<Vec<Point>>> {
    let Some(source) = Source::find(folder, "points3D")? else { return Ok(None) };
    let mut left_out = LeftOut::default();
    let mut points = match source.is_binary {
        // Some programs leave an empty file where there are no points.
        true if source.bytes.is_empty() => Vec::new(),
        true => binary::points(&source.path, &source.bytes)?,
        false => text::points(&source.bytes, &mut left_out),
    };
    points.retain(|point| {
        let usable = checks::usable(point.position);
        if !usable {
            left_out.add(format!("point {} is at {}", point.id, point.position));
        }
        usable
    });
    left_out.note("points", notes);
    Ok(Some(points))
}

/// Reads the points of a model folder.
pub fn surface(folder: &Path, notes: &mut Vec<String>) -> Result<Surface> {
    let model = model(folder, notes)?;
    let Model { images, points, .. } = &model;
    if points.is_empty() {
        let what = "the model holds no points; make a surface from its photos with `camsplat proxy`, and give that";
        return Err(Error::input(folder, what));
    }
    let surface = Surface::Points(model.surface_points());
    checks::sound(folder, &surface)?;
    let error = points.iter().map(|p| p.error).sum::<f64>() / points.len() as f64;
    notes.push(format!(
        "COLMAP model of {} images and {} points, mean reprojection error {error:.2} pixels",
        images.len(),
        points.len()
    ));
    Ok(surface)
}

/// The points as a surface, with the mean direction to the cameras of each point's track. Images of a track that are not among `images`
/// count for nothing.
pub fn surface_points(points: &[Point], images: &[Image]) -> Points {
    let centres: HashMap<u32, DVec3> =
        images.iter().filter_map(|image| Some((image.id, image.pose()?.position))).collect();
    let mut surface = Points::default();
    for point in points {
        let centres = point.track.iter().filter_map(|[image, _]| centres.get(image));
        let toward: DVec3 = centres.map(|centre| (*centre - point.position).normalize_or_zero()).sum();
        surface.positions.push(point.position);
        surface.colours.push(point.colour);
        surface.toward_cameras.push(toward.normalize_or_zero());
    }
    surface
}

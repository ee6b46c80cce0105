//! Captures: posed photos with lenses, images and masks, and the sparse points where a reconstruction has them.
//!
//! | capture | poses in the files |
//! |---|---|
//! | COLMAP model, text or binary, with `images` and `masks` beside it | camera-from-world, OpenCV axes |
//! | transforms.json of nerfstudio, instant-ngp, Blender | world-from-camera, OpenGL axes |
//! | NSVF ([`nsvf`]) | world-from-camera, OpenCV axes |
//! | Tanks and Temples `.log` ([`trajectory`]) | world-from-camera, OpenCV axes |
//! | LLFF's poses_bounds.npy ([`llff`]) | world-from-camera, axes down, right, backwards |
//! | cameras of Metashape, .xml ([`metashape`]) | world-from-camera, OpenCV axes |
//! | cameras of RealityCapture, .csv ([`realitycapture`]) | world-from-camera, OpenGL axes |
//! | raw export of Polycam, folder of Record3D (`phone`) | world-from-camera, OpenGL axes |

pub(crate) mod files;
pub mod llff;
pub(crate) mod lookup;
pub mod metashape;
pub mod nsvf;
pub(crate) mod phone;
pub mod realitycapture;
pub mod trajectory;

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use glam::DVec3;

use self::files::Settled;
use self::lookup::Lookup;
use super::{colmap, ply, transforms};
use crate::error::{Error, Result, bounded};
use crate::files::photos::{self, Convention, Photo, PhotoSet};
use crate::scene::camera::Intrinsics;
use crate::scene::surface::{Points, Surface};

/// What to do about images that are missing or cannot be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Images {
    /// Poses are enough: such photos stay, without an image.
    #[default]
    Optional,
    /// Such photos are left out (`--skip-missing`).
    SkipMissing,
    /// They are an error.
    Needed,
}

/// How to read a capture.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReadOptions {
    /// Images that are missing or cannot be read.
    pub images: Images,
    /// The lens of a file of poses only; a default, which the notes state, where none is given.
    pub intrinsics: Option<Intrinsics>,
    /// Whether files that a transforms.json names outside its own folder are read too.
    pub outside_paths: bool,
}

impl From<Images> for ReadOptions {
    fn from(images: Images) -> Self {
        Self { images, ..Self::default() }
    }
}

/// What a format's reader hands over, before the files of images have been read.
#[derive(Default)]
struct Found {
    photos: Vec<Photo>,
    convention: Convention,
    points: Points,
    tracks: Vec<Vec<u32>>,
    errors: Vec<f32>,
    notes: Vec<String>,
    /// Images that lie there without a pose.
    unposed: Vec<String>,
    /// Masks that a file names and that are not there.
    missing_masks: Vec<String>,
}

/// Reads a capture: a COLMAP model folder or the folder around one, a transforms.json or a folder with one (of
/// transforms_{train,val,test}.json the first), an NSVF or LLFF folder, one of Polycam or Record3D,
/// cameras of Metashape (.xml) or RealityCapture (.csv), or a `.log` trajectory. Photos are ordered by name, poses are
/// world-from-camera in OpenCV axes in the file's world frame, and lenses are those of the stored images. The notes report what
/// was understood.
///
/// # Errors
/// As [`super::read_cameras`]; where the path is not a capture; where images are missing, unreadable or of another shape than their camera or
/// mask, unless `options` allows it; where [`photos::check_convention`] finds the poses wrong.
pub fn read(path: &Path, options: &ReadOptions) -> Result<PhotoSet> {
    let mut found = find(path, options)?;
    if !found.unposed.is_empty() {
        found.notes.push(format!("left out, for they have no pose: {}", some(&found.unposed)));
    }
    let Settled { mut missing, rescaled, turned } = files::settle(&mut found.photos);
    missing.append(&mut found.missing_masks);
    if !missing.is_empty() && options.images == Images::Needed {
        let all = found.photos.iter().all(|photo| photo.image.is_none());
        let way_out =
            if all { "give the folder with the images" } else { "bring them back, or go on without (`skip_missing`)" };
        let what = format!("missing or unreadable: {}; {way_out}", some(&missing));
        return Err(Error::input(path, what));
    }
    if rescaled > 0 {
        let what = format!("the intrinsics of {rescaled} cameras were rescaled to the size of their stored images");
        found.notes.push(what);
    }
    if turned > 0 {
        let what = "photos are stored on their side and turned as their EXIF data say, which their cameras fit; other trainers may need \
                    the files themselves turned";
        found.notes.push(format!("{turned} {what}"));
    }
    let Found { photos, convention, points, tracks, errors, notes, .. } = found;
    // Phones that measure depth give metres.
    let metre = (path.is_dir() && phone::is_layout(path)).then_some(1.0);
    let path_of = path.to_owned();
    let mut set = PhotoSet {
        path: path_of,
        photos,
        convention,
        points,
        tracks,
        errors,
        metre,
        apart: None,
        missing,
        notes: Vec::new(),
    };
    if options.images == Images::SkipMissing {
        set = set.filtered(|photo| photo.image.is_some());
        if set.photos.is_empty() {
            return Err(Error::input(path, "no photo has an image that can be read; give the folder with the images"));
        }
    }
    let warning = photos::check_convention(&set)?;
    set.notes = photos::describe(&set);
    set.notes.extend(notes.into_iter().chain(warning));
    set.notes = set.notes.into_iter().map(bounded).collect();
    Ok(set)
}

/// The first few of a list and its length.
fn some(names: &[String]) -> String {
    const FEW: usize = 3;
    let rest = names.len().saturating_sub(FEW);
    let more = if rest > 0 { format!(" and {rest} more") } else { String::new() };
    format!("{}{more} ({} in all)", names[..names.len() - rest].join(", "), names.len())
}

/// Whether a folder is a capture in a layout of its own, and not by a COLMAP model or a transforms.json.
pub(crate) fn is_layout(folder: &Path) -> bool {
    nsvf::is_layout(folder) || folder.join(llff::FILE).is_file() || phone::is_layout(folder)
}

/// Whether a folder holds a capture, complete or damaged.
pub fn is_capture(folder: &Path) -> bool {
    let transforms = ["transforms.json", "transforms_train.json"];
    colmap::model_folder(folder).is_some()
        || colmap::half_model(folder).is_some()
        || transforms.iter().any(|name| folder.join(name).is_file())
        || is_layout(folder)
}

/// Reads whatever format lies at `path`.
fn find(path: &Path, options: &ReadOptions) -> Result<Found> {
    if !path.is_dir() {
        if path.file_name().is_some_and(|name| is_video(&name.to_string_lossy())) && path.is_file() {
            let what = "this is a video; choose frames of it with `camsplat frames`, run COLMAP on them as that prints, and give their folder";
            return Err(Error::input(path, what));
        }
        return match path.extension().and_then(|extension| extension.to_str()) {
            Some("xml") => metashape::read(path),
            Some("csv") => realitycapture::read(path),
            Some("log") => trajectory::read(path, &super::read_file(path)?, options.intrinsics),
            _ => from_transforms(path, &super::read_file(path)?, options),
        };
    }
    if let Some(model) = colmap::model_folder(path) {
        return from_colmap(path, &model);
    }
    let names = ["transforms.json", "transforms_train.json"];
    if let Some(file) = names.iter().map(|name| path.join(name)).find(|file| file.is_file()) {
        let mut found = from_transforms(&file, &super::read_file(&file)?, options)?;
        let others = ["transforms_val.json", "transforms_test.json"].map(|name| path.join(name).is_file());
        if file.ends_with(names[1]) && others.contains(&true) {
            found.notes.push("only transforms_train.json is read; name one of the others to read that".into());
        }
        return Ok(found);
    }
    if nsvf::is_layout(path) {
        return nsvf::read(path);
    }
    if path.join(llff::FILE).is_file() {
        return llff::read(path);
    }
    if phone::is_layout(path) {
        return phone::read(path);
    }
    Err(Error::input(path, unposed(path)))
}

/// Whether a file is a video, by its name.
pub(crate) fn is_video(name: &str) -> bool {
    const VIDEOS: [&str; 6] = ["mp4", "mov", "avi", "mkv", "webm", "m4v"];
    let extension = name.rsplit_once('.').map(|(_, extension)| extension.to_lowercase());
    extension.is_some_and(|extension| VIDEOS.contains(&extension.as_str()))
}

/// Images above which a folder without poses is likely to hold the frames of a video, all of which COLMAP would be slow to match.
const MANY: usize = 400;

/// What a folder without poses holds, and what to do next.
fn unposed(folder: &Path) -> String {
    let mut images = files::image_folders(folder);
    images.push(folder.to_owned());
    let found = images.iter().map(|images| (files::images_in(images).len(), images)).find(|(count, _)| *count > 0);
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let video = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).find(|name| is_video(name));
    let colmap = |images: &Path| {
        let (workspace, images) = (folder.display(), images.display());
        format!("colmap automatic_reconstructor --workspace_path {workspace} --image_path {images}")
    };
    match (colmap::half_model(folder), found, video) {
        (Some((part, missing)), ..) => {
            format!("its COLMAP model has {part} and no {missing}, so that no camera has a pose; export the whole model")
        }
        (None, Some((count, images)), _) => {
            let fewer = match count > MANY {
                true => "; of the frames of a walk, choose those that differ first, with `camsplat frames`",
                false => "",
            };
            format!("found {count} images but no camera poses; run COLMAP first: {}{fewer}", colmap(images))
        }
        (None, None, Some(video)) => {
            let video = folder.join(&video);
            format!("found a video and no images; choose frames of it: `camsplat frames {}`, then run COLMAP as that prints", video.display())
        }
        (None, None, None) => "the folder is no capture: it holds no COLMAP model (cameras and images as .bin or .txt, here or in \
             sparse/0), no transforms.json, nothing of NSVF, LLFF, Polycam or Record3D, and no images; give the folder of a capture, or a \
             surface's file"
            .into(),
    }
}

fn from_transforms(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Found> {
    let mut notes = Vec::new();
    let mut read = transforms::photos(path, bytes, options.outside_paths, &mut notes)?;
    if !read.outside.is_empty() {
        let what = format!(
            "files outside the capture's folder are not read: {}; copy them into it, or pass `outside_paths`",
            some(&read.outside)
        );
        if options.images != Images::Optional {
            return Err(Error::input(path, what));
        }
        notes.push(what);
    }
    let root = path.parent().unwrap_or(Path::new(""));
    for photo in read.photos.iter_mut().filter(|photo| photo.mask.is_none()) {
        photo.mask = files::mask(root, &photo.camera.name);
    }
    read.photos.sort_by(|a, b| a.camera.name.cmp(&b.camera.name));
    let mut found = Found {
        photos: read.photos,
        convention: Convention::Transforms,
        missing_masks: read.missing_masks,
        ..Found::default()
    };
    match read.points {
        Some(file) if file.is_file() => {
            match ply::parse(&file, &super::read_file(&file)?, &mut notes)? {
                Surface::Points(points) => found.points = points,
                Surface::Mesh(_) => notes.push(format!("{} is a mesh and no seed cloud: left out", file.display())),
            };
        }
        Some(file) => notes.push(format!("the seed cloud {} is not there", file.display())),
        None => {}
    }
    found.notes = notes;
    Ok(found)
}

fn from_colmap(path: &Path, model: &Path) -> Result<Found> {
    let mut notes: Vec<String> = colmap::others_note(path, model).into_iter().collect();
    let parts = colmap::model(model, &mut notes)?;
    let root = root(path, model, &parts.images);
    let folders = files::image_folders(&root);
    let number: HashMap<u32, u32> = parts.images.iter().zip(0..).map(|(image, i)| (image.id, i)).collect();
    let surface = parts.surface_points();
    let lookup = Lookup::default();
    let photos: Vec<Photo> = parts
        .cameras
        .into_iter()
        .zip(&parts.images)
        .map(|(camera, image)| {
            let distortion = parts.lenses.get(&image.lens).map(colmap::Lens::unified).unwrap_or_default();
            let image = lookup.image(&folders, &camera.name);
            let mask = files::mask(&root, &camera.name);
            Photo { camera, distortion, image, mask }
        })
        .collect();
    let mut found = Found { photos, notes, ..Found::default() };
    if let Some(folder) = folders.first() {
        let shown: HashSet<&Path> = found.photos.iter().filter_map(|photo| photo.image.as_deref()).collect();
        let listed = |name: &String| parts.images.binary_search_by(|image| image.name.cmp(name)).is_ok();
        let known = |name: &String| listed(name) || shown.contains(&*folder.join(name));
        found.unposed = files::images_in(folder).into_iter().filter(|name| !known(name)).collect();
    }
    found.points = surface;
    found.points.normals = normals_beside(&root, &found.points.positions);
    found.points.oriented = !found.points.normals.is_empty();
    for point in parts.points {
        let mut track: Vec<u32> = point.track.iter().filter_map(|[id, _]| number.get(id).copied()).collect();
        track.sort_unstable();
        track.dedup();
        found.tracks.push(track);
        found.errors.push(point.error as f32);
    }
    Ok(found)
}

/// The normals of a model's points, which COLMAP's files have no place for: from a `points.ply` of the same points, as captures of
/// rendered scenes have it; none where there is no such file.
fn normals_beside(root: &Path, positions: &[DVec3]) -> Vec<DVec3> {
    let file = root.join("points.ply");
    let cloud = super::read_file(&file).ok().and_then(|bytes| ply::parse(&file, &bytes, &mut Vec::new()).ok());
    let Some(Surface::Points(Points { positions: others, normals, .. })) = cloud else { return Vec::new() };
    // The file has its positions as float.
    let same = |(a, b): (&DVec3, &DVec3)| (*a - *b).abs().max_element() <= 1e-6 * a.abs().max_element();
    let matches = positions.len() == others.len() && positions.iter().zip(&others).all(same);
    if matches { normals } else { Vec::new() }
}

/// The folder that the images of a model lie under: the capture itself, or one above the model.
fn root(path: &Path, model: &Path, images: &[colmap::Image]) -> PathBuf {
    let holds = |folder: &&Path| {
        let folders = files::image_folders(folder);
        let lookup = Lookup::default();
        !folders.is_empty() && images.iter().any(|image| lookup.image(&folders, &image.name).is_some())
    };
    std::iter::once(path).chain(model.ancestors().take(4)).find(holds).unwrap_or(path).to_owned()
}

#[cfg(test)]
mod tests;

//! Files: surfaces and cameras in, plans out.
//!
//! Reading refuses what cannot be planned with, in one line that names the file, the place in it and the remedy; no
//! file makes it panic or allocate memory without bound. Nothing is moved, scaled or turned: frames and units are those
//! of the file.
//!
//! | file | surface | cameras |
//! |---|---|---|
//! | PLY points, meshes, trained and packed splats | [`ply`] | |
//! | SPZ, SOG, `.splat`, glTF with splats | [`splats`] | |
//! | OBJ, STL | [`obj`], [`stl`] | |
//! | glTF 2.0 (.glb, .gltf) | [`gltf`] | |
//! | COLMAP model, text or binary | [`colmap`] | [`colmap`] |
//! | transforms.json of nerfstudio, instant-ngp, Blender | | [`transforms`] |
//! | NSVF, LLFF, Polycam and Record3D folders, Metashape's .xml, RealityCapture's .csv, `.log` trajectory | | [`photos`] |
//! | plan.json | | [`plan_json`] |
//! | boxes (.json), as a volume to keep out of | [`volume`] | |
//! | polygons (.geojson, .kml), as areas on Earth to keep out of | [`areas`] | |
//!
//! Trained splats are also read as what they are, for rendering, and written: [`splats`].
//! [`photos`] reads captures: cameras with their lenses, images and masks, and the points of a reconstruction; [`depth_maps`] the depth
//! maps that lie beside one. [`picture`] writes rendered pictures. For photographing, [`gltf::read_model`] reads a scene with its
//! materials and lamps, and [`environment`] the light around it.

pub mod areas;
mod binary;
pub mod camera_files;
pub(crate) mod checks;
pub mod colmap;
pub mod depth_maps;
pub mod environment;
pub mod folder;
pub mod gltf;
pub mod left_out;
mod matrix;
pub mod npy;
pub mod obj;
pub mod photos;
pub mod picture;
pub mod plan_json;
pub mod ply;
pub mod splats;
pub mod stl;
pub mod transforms;
pub mod volume;
pub(crate) mod xml;

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};

use crate::error::{Error, Result};
use crate::scene::camera::Camera;
use crate::scene::gaussians::Gaussians;
use crate::scene::surface::Surface;

/// Reads a surface: a .ply, .obj, .stl, .glb or .gltf file, a COLMAP model folder, or the points of a capture (a folder with a model
/// under `sparse/0`, a transforms.json with a cloud). Frame and units are the file's.
///
/// # Errors
/// See [`read_surface_with_notes`].
pub fn read_surface(path: &Path) -> Result<Surface> {
    Ok(read_surface_with_notes(path)?.0)
}

/// Reads a surface as [`read_surface`] does, and reports in a few lines what was understood or left out, for the
/// user to check.
///
/// # Errors
/// [`Error::Io`] where the system refuses; [`Error::Input`] where the file is of no known kind, damaged, cut short, or
/// no surface: fewer than two distinct points, positions that are not finite, indices out of range.
pub fn read_surface_with_notes(path: &Path) -> Result<(Surface, Vec<String>)> {
    let mut notes = Vec::new();
    if let Some(folder) = colmap::model_folder(path) {
        notes.extend(colmap::others_note(path, &folder));
        let surface = colmap::surface(&folder, &mut notes)?;
        return Ok((surface, notes));
    }
    if may_be_capture(path) {
        let set = photos::read(path, &photos::ReadOptions::default())?;
        if set.points.positions.is_empty() {
            let what =
                "the capture holds no points; make a surface from its photos with `camsplat proxy`, and give that";
            return Err(Error::input(path, what));
        }
        return Ok((Surface::Points(set.points), set.notes));
    }
    let bytes = read_file(path)?;
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    // The first bytes are more reliable than the name.
    let surface = if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") || extension == "ply" {
        ply::parse(path, &bytes, &mut notes)?
    } else if splats::is_splats(path, &bytes) {
        let splats = splats::parse(path, &bytes, &mut notes)?;
        checks::surface(path, splats::surface::points(path, &splats, &mut notes)?, &mut notes)?
    } else if bytes.starts_with(b"glTF") || extension == "gltf" || extension == "glb" {
        gltf::parse(path, &bytes, &mut notes)?
    } else if extension == "obj" {
        obj::parse(path, &bytes, &mut notes)?
    } else if extension == "stl" {
        stl::parse(path, &bytes, &mut notes)?
    } else {
        return Err(Error::input(
            path,
            "this is no surface that can be read; give a .ply, .obj, .stl, .glb or .gltf file or a COLMAP folder",
        ));
    };
    Ok((surface, notes))
}

/// Reads trained splats for rendering, in any of the formats of [`splats`]. Reports in a few lines what was understood, for the user to
/// check. Frame and units are the file's.
///
/// # Errors
/// [`Error::Io`] where the system refuses; [`Error::Input`] where [`splats::parse`] refuses what the file holds.
pub fn read_gaussians_with_notes(path: &Path) -> Result<(Gaussians, Vec<String>)> {
    let mut notes = Vec::new();
    let gaussians = match path.file_name().is_some_and(|name| name == "meta.json") {
        true => splats::sog::read_meta(path, &mut notes)?,
        false => splats::parse(path, &read_file(path)?, &mut notes)?,
    };
    if gaussians.antialiased {
        notes.push("the model was trained with antialiasing (Mip-Splatting's 2D filter), by its file".into());
    }
    Ok((gaussians, notes))
}

/// Whether a surface's path is that of a capture rather than of a file of triangles or points: a folder, a .json, .xml or .csv.
pub fn may_be_capture(path: &Path) -> bool {
    path.is_dir() || has_extension(path, &["json", "xml", "csv"])
}

fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    path.extension().is_some_and(|extension| extensions.iter().any(|other| extension == *other))
}

/// Reads cameras: a COLMAP model folder, a capture folder with a model under `sparse/0` (or else a transforms.json), a
/// transforms.json of any dialect, an NSVF folder, a `.log` trajectory, or a plan.json. Poses are world-from-camera with OpenCV axes in the file's own world
/// frame; lens distortion is left out.
///
/// # Errors
/// See [`read_cameras_with_notes`].
pub fn read_cameras(path: &Path) -> Result<Vec<Camera>> {
    Ok(read_cameras_with_notes(path)?.0)
}

/// Reads cameras as [`read_cameras`] does, and reports in a few lines what was understood or left out, for the
/// user to check.
///
/// # Errors
/// [`Error::Io`] where the system refuses; [`Error::Input`] where the file is of no known kind, damaged, cut short, or
/// holds a camera that cannot be: no rotation, no image size, no focal length, a name taken twice.
pub fn read_cameras_with_notes(path: &Path) -> Result<(Vec<Camera>, Vec<String>)> {
    let mut notes = Vec::new();
    if path.is_dir()
        && let Some(folder) = colmap::model_folder(path)
    {
        notes.extend(colmap::others_note(path, &folder));
        let cameras = colmap::cameras(&folder, &mut notes)?;
        return Ok((cameras, notes));
    }
    if photos::is_layout(path) || has_extension(path, &["log", "xml", "csv"]) {
        let set = photos::read(path, &photos::ReadOptions::default())?;
        return Ok((set.cameras(), set.notes));
    }
    let file = json_file(path)?;
    let bytes = read_file(&file)?;
    /// The entry that distinguishes the kinds.
    #[derive(Deserialize)]
    struct Kind {
        frames: Option<IgnoredAny>,
        cameras: Option<IgnoredAny>,
    }
    let kind: Kind = json(&file, &bytes)?;
    let cameras = match kind {
        Kind { frames: Some(_), .. } => transforms::parse(&file, &bytes, &mut notes)?,
        Kind { cameras: Some(_), .. } => plan_json::parse(&file, &bytes)?,
        _ => {
            let what =
                "it has neither \"frames\", as transforms.json, nor \"cameras\", as plan.json; give one of these";
            return Err(Error::input(file, what));
        }
    };
    Ok((cameras, notes))
}

/// The plan.json of a plan's folder, which has the planned cameras first and the kept ones last, and `path` itself where there is none.
pub fn plan_file(path: &Path) -> PathBuf {
    let plan = path.join("plan.json");
    if plan.is_file() { plan } else { path.to_owned() }
}

/// `path` itself, or the file with cameras in the folder `path`.
pub(crate) fn json_file(path: &Path) -> Result<PathBuf> {
    if !path.is_dir() {
        return Ok(path.to_owned());
    }
    let names = ["plan.json", "transforms.json", "transforms_train.json"];
    names.iter().map(|name| path.join(name)).find(|file| file.is_file()).ok_or_else(|| {
        Error::input(
            path,
            "the folder holds no COLMAP model, no plan.json and no transforms.json; give the poses' file",
        )
    })
}

/// Checks that there is something at `path`, long before it is read.
pub(crate) fn check_there(path: &Path) -> Result<()> {
    std::fs::metadata(path).map(drop).map_err(|source| unreadable(path, source))
}

/// Why a file or folder cannot be read, with what helps.
pub(crate) fn unreadable(path: &Path, source: std::io::Error) -> Error {
    match source.kind() {
        ErrorKind::NotFound | ErrorKind::NotADirectory => {
            Error::input(path, "there is no such file or folder; check the path")
        }
        ErrorKind::IsADirectory => Error::input(path, "this is a folder; give a file in it"),
        _ => Error::io(path, source),
    }
}

/// The bytes of a file, of which there must be some.
fn read_file(path: &Path) -> Result<Vec<u8>> {
    let bytes = std::fs::read(path).map_err(|source| unreadable(path, source))?;
    if bytes.is_empty() {
        return Err(Error::input(path, "the file is empty; export it again"));
    }
    Ok(bytes)
}

/// Parses JSON; the message has the line and column. NaN and infinite numbers, which Python writes though JSON has none, count as null.
pub(crate) fn json<T: DeserializeOwned>(path: &Path, bytes: &[u8]) -> Result<T> {
    // A mark of byte order, which some editors leave, is no part of JSON.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    serde_json::from_slice(bytes)
        .or_else(|e| serde_json::from_slice(&without_nan(bytes).ok_or(e)?))
        .map_err(|e| Error::input(path, format!("{}; mend or export the file again", fault(&e))))
}

/// What is wrong with JSON that has been read as [`json`] does: a number that is null was none that JSON has.
pub(crate) fn fault(error: &serde_json::Error) -> String {
    error.to_string().replace("invalid type: null, expected f64", "a value that is no finite number")
}

/// The JSON with `null` in place of `NaN`, `Infinity` and `-Infinity` outside of strings; none where it has none.
fn without_nan(bytes: &[u8]) -> Option<Vec<u8>> {
    const WORDS: [&[u8]; 3] = [b"NaN", b"Infinity", b"-Infinity"];
    let mut clean = Vec::with_capacity(bytes.len());
    let (mut rest, mut in_string, mut any) = (bytes, false, false);
    while let [first, after @ ..] = rest {
        if let Some(word) = WORDS.iter().find(|word| !in_string && rest.starts_with(word)) {
            clean.extend(b"null");
            (rest, any) = (&rest[word.len()..], true);
            continue;
        }
        clean.push(*first);
        rest = after;
        match (first, after) {
            // What is escaped does not end a string.
            (b'\\', [escaped, after @ ..]) if in_string => {
                clean.push(*escaped);
                rest = after;
            }
            (b'"', _) => in_string = !in_string,
            _ => {}
        }
    }
    any.then_some(clean)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a wrong path or file would produce a message without a remedy.
    #[test]
    fn what_cannot_be_read_is_refused_with_a_way_out() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let surface = |path: &Path| read_surface(path).unwrap_err().to_string();
        let cameras = |path: &Path| read_cameras(path).unwrap_err().to_string();
        assert!(surface(folder.path()).contains("holds no COLMAP model"));
        assert!(surface(&folder.path().join("none.ply")).contains("none.ply"));
        assert!(surface(&file("a.txt", "hello")).contains("give a .ply, .obj"));
        assert!(surface(&file("a.ply", "")).contains("the file is empty"));
        assert!(cameras(&file("a.json", "{}")).contains("neither \"frames\""));
        assert!(cameras(&file("b.json", "{\n  oops")).contains("line 2"));
        let empty = folder.path().join("empty");
        std::fs::create_dir(&empty).unwrap();
        assert!(cameras(&empty).contains("no plan.json"));
    }

    /// If this failed, a NaN that nobody needs would refuse a whole capture, or a name that holds the word be changed.
    #[test]
    fn numbers_that_json_lacks_are_null() {
        let text = br#"{"sharp": NaN, "far": [-Infinity, Infinity, 1], "name": "NaN \" Infinity"}"#;
        let value: serde_json::Value = json(Path::new("a.json"), text).unwrap();
        assert_eq!(value, serde_json::json!({"sharp": null, "far": [null, null, 1], "name": "NaN \" Infinity"}));
        assert!(json::<serde_json::Value>(Path::new("a.json"), b"{\"a\": Nan}").is_err());
    }
}

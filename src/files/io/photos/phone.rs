//! Captures of phones, posed by ARKit: the raw export of Polycam, and folders of Record3D. Poses are camera-to-world in OpenGL axes, the
//! world has +Y up.

use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat};
use serde::Deserialize;

use super::lookup::Lookup;
use super::{Found, files};
use crate::error::{Error, Result};
use crate::files::io::left_out::LeftOut;
use crate::files::io::matrix::{self, Axes};
use crate::files::io::{checks, json, read_file};
use crate::files::photos::{Convention, Photo};
use crate::scene::camera::{Camera, Intrinsics, Pose};
use crate::scene::lens::Distortion;

/// Polycam's folders of cameras and their images: those that the app has refined first.
const POLYCAM: [[&str; 2]; 2] =
    [["keyframes/corrected_cameras", "keyframes/corrected_images"], ["keyframes/cameras", "keyframes/images"]];

/// A camera of Polycam.
#[derive(Deserialize)]
struct Keyframe {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    width: f64,
    height: f64,
    t_00: f64,
    t_01: f64,
    t_02: f64,
    t_03: f64,
    t_10: f64,
    t_11: f64,
    t_12: f64,
    t_13: f64,
    t_20: f64,
    t_21: f64,
    t_22: f64,
    t_23: f64,
}

/// The file `metadata` of Record3D: intrinsics by columns, image size, and a quaternion (x, y, z, w) and a position for each image.
#[derive(Deserialize)]
struct Metadata {
    #[serde(rename = "K")]
    intrinsics: [f64; 9],
    w: f64,
    h: f64,
    poses: Vec<[f64; 7]>,
}

/// The folders of cameras and images of a raw export of Polycam; none where `folder` is no such.
fn polycam_folders(folder: &Path) -> Option<[PathBuf; 2]> {
    POLYCAM.map(|pair| pair.map(|below| folder.join(below))).into_iter().find(|[cameras, _]| cameras.is_dir())
}

/// Whether a folder is of Polycam or Record3D.
pub(crate) fn is_layout(folder: &Path) -> bool {
    polycam_folders(folder).is_some() || folder.join("metadata").is_file() && folder.join("rgbd").is_dir()
}

/// Reads either.
pub(super) fn read(folder: &Path) -> Result<Found> {
    match polycam_folders(folder) {
        Some([cameras, images]) => polycam(folder, &cameras, images),
        None => record3d(folder),
    }
}

fn polycam(folder: &Path, cameras: &Path, images: PathBuf) -> Result<Found> {
    let mut stems: Vec<String> = std::fs::read_dir(cameras)
        .map_err(|source| Error::io(cameras, source))?
        .flatten()
        .filter_map(|entry| entry.file_name().to_str()?.strip_suffix(".json").map(str::to_owned))
        .collect();
    stems.sort();
    let images = Images { folder, images: vec![images], lookup: Lookup::default() };
    let mut left_out = LeftOut::default();
    let mut photos = Vec::with_capacity(stems.len());
    for stem in stems {
        let file = cameras.join(format!("{stem}.json"));
        let k: Keyframe = match read_file(&file).and_then(|bytes| json(&file, &bytes)) {
            Ok(keyframe) => keyframe,
            Err(what) => {
                left_out.add(what.to_string());
                continue;
            }
        };
        let rows =
            [[k.t_00, k.t_01, k.t_02, k.t_03], [k.t_10, k.t_11, k.t_12, k.t_13], [k.t_20, k.t_21, k.t_22, k.t_23]];
        let pose = match matrix::pose(&rows, Axes::OpenGl) {
            Ok(pose) => pose,
            Err(what) => {
                left_out.add(format!("{stem}: the matrix of t_00 to t_23 {what}"));
                continue;
            }
        };
        let intrinsics =
            Intrinsics { width: k.width as u32, height: k.height as u32, focal: [k.fx, k.fy], principal: [k.cx, k.cy] };
        photos.push(images.photo(format!("{stem}.jpg"), pose, intrinsics));
    }
    checks::usable_photos(cameras, &mut photos, &mut left_out)?;
    let mut notes = Vec::new();
    left_out.note("keyframes", &mut notes);
    Ok(Found { photos, convention: Convention::Phone, notes, ..Found::default() })
}

fn record3d(folder: &Path) -> Result<Found> {
    let file = folder.join("metadata");
    let Metadata { intrinsics: k, w, h, poses } = json(&file, &read_file(&file)?)?;
    let images = Images { folder, images: vec![folder.join("rgbd"), folder.join("rgb")], lookup: Lookup::default() };
    let mut left_out = LeftOut::default();
    let intrinsics = Intrinsics { width: w as u32, height: h as u32, focal: [k[0], k[4]], principal: [k[6], k[7]] };
    let mut photos = Vec::with_capacity(poses.len());
    for (i, [x, y, z, w, px, py, pz]) in poses.into_iter().enumerate() {
        let axes = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
        let row = |r: usize, p: f64| [axes.x_axis[r], axes.y_axis[r], axes.z_axis[r], p];
        match matrix::pose(&[row(0, px), row(1, py), row(2, pz)], Axes::OpenGl) {
            Ok(pose) => photos.push(images.photo(format!("{i}.jpg"), pose, intrinsics)),
            Err(what) => left_out.add(format!("pose {i}: its rotation {what}")),
        }
    }
    checks::usable_photos(&file, &mut photos, &mut left_out)?;
    let mut notes = Vec::new();
    left_out.note("poses", &mut notes);
    // Names are numbers without leading zeros: photos go by name everywhere.
    photos.sort_by(|a, b| a.camera.name.cmp(&b.camera.name));
    Ok(Found { photos, convention: Convention::Phone, notes, ..Found::default() })
}

/// Where the images of a capture lie.
struct Images<'a> {
    folder: &'a Path,
    images: Vec<PathBuf>,
    lookup: Lookup,
}

impl Images<'_> {
    /// The photo of a pose, with its image where there is one.
    fn photo(&self, name: String, pose: Pose, intrinsics: Intrinsics) -> Photo {
        let image = self.lookup.image(&self.images, &name);
        let stored = image.as_deref().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
        let name = stored.unwrap_or(name);
        let mask = files::mask(self.folder, &name);
        Photo { camera: Camera { name, pose, intrinsics }, distortion: Distortion::default(), image, mask }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn write(folder: &Path, name: &str, contents: &str) {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, contents).unwrap();
    }

    /// A camera at (1, 2, 3) that looks along -z with +y up has the unit matrix.
    const KEYFRAME: &str = r#"{"fx": 30, "fy": 31, "cx": 20.5, "cy": 14, "width": 40, "height": 30, "blur_score": 80.2,
        "t_00": 1, "t_01": 0, "t_02": 0, "t_03": 1, "t_10": 0, "t_11": 1, "t_12": 0, "t_13": 2,
        "t_20": 0, "t_21": 0, "t_22": 1, "t_23": 3}"#;

    fn looks_along_minus_z(camera: &Camera) {
        assert_eq!(camera.pose.position, DVec3::new(1.0, 2.0, 3.0));
        assert!(camera.pose.forward().distance(DVec3::NEG_Z) < 1e-12 && camera.pose.up().distance(DVec3::Y) < 1e-12);
        assert_eq!((camera.intrinsics.width, camera.intrinsics.height), (40, 30));
        assert_eq!((camera.intrinsics.focal, camera.intrinsics.principal), ([30.0, 31.0], [20.5, 14.0]));
    }

    /// If this failed, scans of Polycam would be read with wrong axes, or with the poses that the app itself has corrected since.
    #[test]
    fn polycam_is_read_with_its_corrected_cameras() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "keyframes/cameras/7.json", &KEYFRAME.replace("\"t_03\": 1", "\"t_03\": 9"));
        write(folder.path(), "keyframes/corrected_cameras/7.json", KEYFRAME);
        assert!(is_layout(folder.path()));
        let found = read(folder.path()).unwrap();
        looks_along_minus_z(&found.photos[0].camera);
        write(folder.path(), "keyframes/corrected_cameras/8.json", &KEYFRAME.replace("\"t_00\": 1", "\"t_00\": 3"));
        write(folder.path(), "keyframes/corrected_cameras/9.json", &KEYFRAME.replace("\"t_01\": 0", "\"t_01\": 1"));
        let found = read(folder.path()).unwrap();
        assert_eq!(found.photos.len(), 2);
        assert!(
            found.notes[0].starts_with("keyframes left out: 1; 9: the matrix of t_00 to t_23 is no rotation"),
            "{:?}",
            found.notes
        );
        for good in ["7", "8"] {
            std::fs::remove_file(folder.path().join(format!("keyframes/corrected_cameras/{good}.json"))).unwrap();
        }
        assert!(
            read(folder.path()).err().unwrap().to_string().contains("none of its cameras can be used: 9: the matrix")
        );
    }

    /// If this failed, recordings of Record3D would be read with quaternions or intrinsics in the wrong order.
    #[test]
    fn record3d_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let poses = "[[0, 0, 0, 1, 1, 2, 3], [0, 1, 0, 0, 1, 2, 3]]";
        let text =
            format!(r#"{{"K": [30, 0, 0, 0, 31, 0, 20.5, 14, 1], "w": 40, "h": 30, "fps": 60, "poses": {poses}}}"#);
        write(folder.path(), "metadata", &text);
        write(folder.path(), "rgbd/0.depth", "");
        let found = read(folder.path()).unwrap();
        looks_along_minus_z(&found.photos[0].camera);
        // Half a turn about +y.
        assert!(found.photos[1].camera.pose.forward().distance(DVec3::Z) < 1e-12);
        write(folder.path(), "metadata", &text.replace("0, 1, 0, 0", "0, 0, 0, 0"));
        let found = read(folder.path()).unwrap();
        assert!(found.photos.len() == 1 && found.notes[0].contains("pose 1: its rotation"), "{:?}", found.notes);
    }
}

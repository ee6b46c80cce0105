//! transforms.json: one reader for the dialects of nerfstudio, instant-ngp and Blender (NeRF synthetic), and a writer of
//! nerfstudio's.
//!
//! Poses in these files are camera-to-world matrices in OpenGL camera axes (X right, Y up, -Z forward); here cameras
//! have OpenCV axes, so Y and Z of the camera change sign. The world frame is left untouched on both ways: where a file
//! has an `applied_transform`, its poses are already transformed by it and are taken as they are, and instant-ngp's
//! own scale and offset are not applied.

mod write;

use std::collections::{BTreeSet, HashSet};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use serde::Deserialize;

pub use self::write::{write, write_photos, write_photos_at};
use super::checks;
use super::left_out::LeftOut;
use super::matrix::{self, Axes};
use super::photos::files;
use super::photos::lookup::Lookup;
use crate::error::{Result, bounded};
use crate::files::photos::Photo;
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::lens::Distortion;

/// Camera models that are no pinhole with the distortion of k1 to k4, p1 and p2.
const NO_PINHOLES: [&str; 5] = ["EQUIRECTANGULAR", "OMNIDIRECTIONAL", "VR180", "ORTHOPHOTO", "FISHEYE624"];

/// Camera models that are a pinhole with that distortion, or a fisheye of k1 to k4.
const MODELS: [&str; 9] = [
    "OPENCV",
    "OPENCV_FISHEYE",
    "FISHEYE",
    "PINHOLE",
    "SIMPLE_PINHOLE",
    "RADIAL",
    "SIMPLE_RADIAL",
    "RADIAL_FISHEYE",
    "PERSPECTIVE",
];

/// Intrinsics of the file or of one frame.
#[derive(Deserialize, Default, Clone, Copy)]
struct Lens {
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    w: Option<f64>,
    h: Option<f64>,
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
}

#[derive(Deserialize)]
struct Frame {
    file_path: String,
    transform_matrix: Option<Vec<[f64; 4]>>,
    camera_model: Option<String>,
    mask_path: Option<String>,
    #[serde(flatten)]
    lens: Lens,
}

#[derive(Deserialize)]
struct File {
    #[serde(flatten)]
    lens: Lens,
    camera_model: Option<String>,
    /// instant-ngp's way to name the fisheye.
    #[serde(default)]
    is_fisheye: bool,
    applied_transform: Option<serde::de::IgnoredAny>,
    ply_file_path: Option<String>,
    frames: Vec<serde_json::Value>,
}

/// What a transforms.json holds.
pub struct Transforms {
    /// The photos in the order of the frames. An image is none where no file was found.
    pub photos: Vec<Photo>,
    /// Masks that the file names and that are not there.
    pub missing_masks: Vec<String>,
    /// The file of seed points that `ply_file_path` names.
    pub points: Option<PathBuf>,
    /// Names that lead out of the file's folder, and are not followed.
    pub outside: Vec<String>,
}

/// Reads cameras as [`photos`] does, without their distortion; `notes` reports this, and all else that a user should know.
///
/// # Errors
/// See [`photos`].
pub fn parse(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Vec<Camera>> {
    let photos = photos(path, bytes, false, notes)?.photos;
    let distorted = photos.iter().filter(|photo| !photo.distortion.is_none()).count();
    if distorted > 0 {
        notes.push(checks::taken_as_pinholes(distorted, photos.len()));
    }
    Ok(photos.into_iter().map(|photo| photo.camera).collect())
}

/// Reads photos from the bytes of a transforms.json. Images are looked for beside `path`: their headers give the size
/// where the file does not, and the intrinsics are rescaled where a stored image has another size than w and h specify.
/// A camera is named by its `file_path` after the folder `images`, which is how COLMAP names the same image. Files outside the folder
/// of `path` are looked at only where `outside` is set; the last parts of such paths are looked for inside. Frames that cannot be used are
/// left out and counted.
///
/// # Errors
/// When the file is no such JSON, or no frame can be used: it has no pose or a matrix that is none, or an image size or focal length
/// cannot be known.
pub fn photos(path: &Path, bytes: &[u8], outside_paths: bool, notes: &mut Vec<String>) -> Result<Transforms> {
    let file: File = super::json(path, bytes)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut reading = Reading {
        file: &file,
        folder,
        outside: outside_paths,
        lookup: Lookup::default(),
        missing_masks: Vec::new(),
        left_out: Vec::new(),
        rescaled: 0,
        moved: HashSet::new(),
        unknown_models: BTreeSet::new(),
    };
    let mut photos = Vec::with_capacity(file.frames.len());
    let mut left_out = LeftOut::default();
    for (i, value) in file.frames.iter().enumerate() {
        let name = value.get("file_path").and_then(|name| name.as_str()).unwrap_or_default();
        let frame =
            Frame::deserialize(value).map_err(|e| format!("{}; mend it, or remove the frame", super::fault(&e)));
        match frame.and_then(|frame| reading.photo(&frame)) {
            Ok(photo) => photos.push(photo),
            Err(what) => left_out.add(format!("frame {i} ({name:?}): {what}")),
        }
    }
    let Reading { missing_masks, left_out: outside, rescaled, unknown_models, moved, .. } = reading;
    for (model, fisheye) in unknown_models {
        let lens = if fisheye { "fisheye of k1 to k4" } else { "pinhole with the distortion of k1 to k4, p1 and p2" };
        notes.push(bounded(format!("camera_model {model:?} is not known and taken for a {lens}")));
    }
    if rescaled > 0 {
        notes.push(format!("the intrinsics of {rescaled} cameras were rescaled to the size of their stored images"));
    }
    if !moved.is_empty() {
        let all = file.frames.len();
        let count = moved.len();
        notes.push(format!(
            "the paths of {count} of {all} frames lead elsewhere: what lies here by the same name was taken"
        ));
    }
    if file.applied_transform.is_some() {
        notes.push("poses are taken as they stand, in the frame after the file's applied_transform".into());
    }
    checks::usable_photos(path, &mut photos, &mut left_out)?;
    left_out.note("frames", notes);
    let points = file.ply_file_path.as_ref().and_then(|name| seed_cloud(folder, name, outside_paths, notes));
    Ok(Transforms { photos, missing_masks, points, outside })
}

/// Where the seed cloud `name` lies, or would lie. Where that is outside of `folder` and may not be read, what lies inside by the last parts
/// of its path is taken, or else nothing; `notes` reports both.
fn seed_cloud(folder: &Path, name: &str, outside_paths: bool, notes: &mut Vec<String>) -> Option<PathBuf> {
    let named = folder.join(name);
    if let Some(inside) = files::within(folder, name).or_else(|| (outside_paths && named.is_file()).then_some(named)) {
        return Some(inside);
    }
    let found = Lookup::default().tail(folder, name);
    notes.push(bounded(match &found {
        Some(path) => format!("the seed cloud {name:?} leads elsewhere: {} was taken", path.display()),
        None => format!(
            "the seed cloud {name:?} lies outside the capture's folder and is not read; copy it into it, or pass `outside_paths`"
        ),
    }));
    found
}

/// What is known on the way through the frames.
struct Reading<'f> {
    file: &'f File,
    folder: &'f Path,
    /// Whether files outside of the folder are looked at.
    outside: bool,
    lookup: Lookup,
    missing_masks: Vec<String>,
    left_out: Vec<String>,
    rescaled: usize,
    /// Images that were found by the last parts of their paths.
    moved: HashSet<PathBuf>,
    unknown_models: BTreeSet<(String, bool)>,
}

impl Reading<'_> {
    fn photo(&mut self, frame: &Frame) -> Result<Photo, String> {
        let model = frame.camera_model.as_ref().or(self.file.camera_model.as_ref());
        if let Some(model) = model.filter(|model| NO_PINHOLES.iter().any(|start| model.starts_with(start))) {
            return Err(format!("camera_model {model:?} is no pinhole; give perspective images"));
        }
        let Some(rows) = &frame.transform_matrix else {
            return Err("it has no transform_matrix; give the camera's pose or remove the frame".into());
        };
        let pose = matrix::pose(rows, Axes::OpenGl).map_err(|what| format!("transform_matrix {what}"))?;
        let lens = frame.lens.or(self.file.lens);
        let image = self.place(&frame.file_path)?;
        let stored = image.as_deref().and_then(files::size);
        let intrinsics = lens.intrinsics(stored)?;
        self.rescaled +=
            usize::from(stored.is_some() && lens.size().is_ok_and(|size| size.is_some() && size != stored));
        let fisheye = self.file.is_fisheye || model.is_some_and(|model| model.contains("FISHEYE"));
        let unknown = model.filter(|model| !MODELS.contains(&model.as_str()));
        self.unknown_models.extend(unknown.map(|model| (model.clone(), fisheye)));
        let mask = frame.mask_path.as_ref().map(|name| self.place(name)).transpose()?.flatten();
        self.missing_masks.extend(frame.mask_path.iter().filter(|_| mask.is_none()).cloned());
        Ok(Photo {
            camera: Camera { name: name(&frame.file_path, image.as_deref()), pose, intrinsics },
            distortion: lens.distortion(fisheye),
            image,
            mask,
        })
    }

    /// The picture that the file names; none where it is not there.
    fn place(&mut self, name: &str) -> Result<Option<PathBuf>, String> {
        let named = self.folder.join(name);
        let found = if self.outside && named.is_file() { Some(named) } else { self.lookup.picture(self.folder, name) };
        if found.is_some() {
            return Ok(found);
        }
        match self.lookup.tail(self.folder, name) {
            Some(path) if self.moved.contains(&path) => {
                Err(format!("{name:?} is not there, and what lies here by its name is another frame's"))
            }
            Some(path) => {
                self.moved.insert(path.clone());
                Ok(Some(path))
            }
            None => {
                let outside = files::within(self.folder, name).is_none();
                self.left_out.extend(outside.then(|| name.to_owned()));
                Ok(None)
            }
        }
    }
}

impl Lens {
    /// These intrinsics, with those of the whole file where a frame leaves them open.
    fn or(self, file: Self) -> Self {
        // A frame's own focal length or angle must not be mixed with the file's other one.
        let angles = self.fl_x.or(self.camera_angle_x).map_or(file, |_| self);
        let own = [self.k1, self.k2, self.k3, self.k4, self.p1, self.p2].iter().any(Option::is_some);
        let distortion = if own { self } else { file };
        Self {
            fl_x: self.fl_x.or(angles.fl_x),
            fl_y: self.fl_y.or(angles.fl_y),
            camera_angle_x: self.camera_angle_x.or(angles.camera_angle_x),
            camera_angle_y: self.camera_angle_y.or(angles.camera_angle_y),
            cx: self.cx.or(file.cx),
            cy: self.cy.or(file.cy),
            w: self.w.or(file.w),
            h: self.h.or(file.h),
            ..distortion
        }
    }

    /// Image size that the file gives.
    fn size(&self) -> Result<Option<(u32, u32)>, String> {
        let whole = |v: f64| (v.fract() == 0.0 && v >= 1.0 && v <= f64::from(u32::MAX)).then_some(v as u32);
        let (Some(w), Some(h)) = (self.w, self.h) else { return Ok(None) };
        match (whole(w), whole(h)) {
            (Some(w), Some(h)) => Ok(Some((w, h))),
            _ => Err(format!("w and h are {w} and {h}; give the image size in whole pixels")),
        }
    }

    /// The pinhole part, for an image of the size `stored` where that is known.
    fn intrinsics(&self, stored: Option<(u32, u32)>) -> Result<Intrinsics, String> {
        let Some((w, h)) = self.size()?.or(stored) else {
            return Err("the file gives no w and h, and the image was not found beside it; add w and h".into());
        };
        if let Some(angle) = [self.camera_angle_x, self.camera_angle_y].into_iter().flatten().find(|angle| *angle >= PI)
        {
            return Err(format!("an angle of view is {angle}, which must be in radians and below pi"));
        }
        let half = [0.5 * f64::from(w), 0.5 * f64::from(h)];
        let from_angle = |half: f64, angle: Option<f64>| angle.map(|angle| half / (0.5 * angle).tan());
        let x = self.fl_x.or(from_angle(half[0], self.camera_angle_x));
        let y = self.fl_y.or(from_angle(half[1], self.camera_angle_y));
        let (Some(x), Some(y)) = (x.or(y), y.or(x)) else {
            return Err(
                "no focal length is given, or none that is a number; add fl_x, or camera_angle_x in radians".into()
            );
        };
        let principal = [self.cx.unwrap_or(half[0]), self.cy.unwrap_or(half[1])];
        let given = Intrinsics { width: w, height: h, focal: [x, y], principal };
        // Where the image is of another shape, whoever needs it says so.
        Ok(stored.and_then(|(width, height)| given.resized(width, height)).unwrap_or(given))
    }

    /// The distortion. nerfstudio has four radial factors for perspective cameras as for fisheyes.
    fn distortion(&self, fisheye: bool) -> Distortion {
        Distortion {
            fisheye,
            radial: [self.k1, self.k2, self.k3, self.k4, None, None].map(Option::unwrap_or_default),
            tangential: if fisheye { [0.0; 2] } else { [self.p1, self.p2].map(Option::unwrap_or_default) },
            ..Distortion::default()
        }
    }
}

/// A camera's name: the frame's path after its folder `images` (or `images_2` and the like, shrunk copies), without
/// leading dots or a drive, with the extension of the stored image, or `.png` where there is neither.
fn name(file_path: &str, image: Option<&Path>) -> String {
    let parts: Vec<&str> =
        file_path.split(['/', '\\']).filter(|part| !matches!(*part, "" | "." | "..") && !part.ends_with(':')).collect();
    let is_images =
        |part: &&str| part.strip_prefix("images").is_some_and(|rest| rest.is_empty() || rest.starts_with('_'));
    let folders = parts.len().saturating_sub(1);
    let start = parts[..folders].iter().rposition(is_images).map_or(0, |images| images + 1);
    let name = parts[start..].join("/");
    match image.and_then(Path::extension) {
        _ if files::is_picture(Path::new(&name)) => name,
        Some(extension) if Path::new(&name).extension() != Some(extension) => {
            format!("{name}.{}", extension.to_string_lossy())
        }
        Some(_) => name,
        None => format!("{name}.png"),
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn read(text: &str) -> Result<Vec<Camera>> {
        parse(Path::new("no-such-folder/transforms.json"), text.as_bytes(), &mut Vec::new())
    }

    const IDENTITY: &str = "[[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]";

    /// If this failed, cameras would look backwards: the commonest mistake with these files.
    #[test]
    fn an_opengl_identity_looks_along_minus_z() {
        let text = format!(
            r#"{{"camera_angle_x": 1.5707963267948966, "w": 100.0, "h": 50,
                "frames": [{{"file_path": "./train/r_0", "transform_matrix": {IDENTITY}}}]}}"#
        );
        let camera = &read(&text).unwrap()[0];
        assert_eq!(camera.name, "train/r_0.png");
        assert_eq!(camera.pose.position, DVec3::new(1.0, 2.0, 3.0));
        assert!((camera.pose.forward() - DVec3::NEG_Z).length() < 1e-12);
        assert!((camera.pose.up() - DVec3::Y).length() < 1e-12);
        assert_eq!((camera.intrinsics.width, camera.intrinsics.height), (100, 50));
        assert!((camera.intrinsics.focal[0] - 50.0).abs() < 1e-9);
        assert_eq!(camera.intrinsics.principal, [50.0, 25.0]);
    }

    /// If this failed, a frame with its own lens would be given the file's.
    #[test]
    fn a_frame_may_have_its_own_lens() {
        let text = format!(
            r#"{{"fl_x": 10, "fl_y": 11, "cx": 5, "cy": 6, "w": 10, "h": 12, "applied_transform": [[1,0,0,0]],
                "frames": [{{"file_path": "images/a.jpg", "transform_matrix": {IDENTITY}}},
                           {{"file_path": "images/b.jpg", "transform_matrix": {IDENTITY}, "fl_x": 20, "k1": 0.5}}]}}"#
        );
        let mut notes = Vec::new();
        let cameras = parse(Path::new("no-such-folder/t.json"), text.as_bytes(), &mut notes).unwrap();
        assert_eq!((cameras[0].name.as_str(), cameras[0].intrinsics.focal), ("a.jpg", [10.0, 11.0]));
        assert_eq!((cameras[1].name.as_str(), cameras[1].intrinsics.focal), ("b.jpg", [20.0, 20.0]));
        assert!(notes[0].contains("applied_transform"), "{notes:?}");
        assert!(notes[1].starts_with("1 of 2 images have lens distortion"), "{notes:?}");
    }

    /// If this failed, the same image would have another name here than in COLMAP's model of the same capture.
    #[test]
    fn names_start_after_the_image_folder() {
        let named = |file_path| name(file_path, None);
        assert_eq!(named("./images/0001.jpg"), "0001.jpg");
        assert_eq!(named("../scene/images_4/left/0001.PNG"), "left/0001.PNG");
        assert_eq!(named("/home/me/a.png"), "home/me/a.png");
        assert_eq!(named("train/r_0.5"), "train/r_0.5.png");
        assert_eq!(named("images"), "images.png");
        assert_eq!(named("D:\\scene\\images\\left\\a.webp"), "left/a.webp");
        assert_eq!(name("r_0", Some(Path::new("x/r_0.jpg"))), "r_0.jpg");
    }

    /// If this failed, intrinsics would not fit the images that a trainer loads.
    #[test]
    fn intrinsics_follow_the_stored_image() {
        let folder = tempfile::tempdir().unwrap();
        image::RgbImage::new(20, 10).save(folder.path().join("a.png")).unwrap();
        let text = format!(
            r#"{{"fl_x": 50, "w": 40, "h": 20, "frames": [{{"file_path": "a", "transform_matrix": {IDENTITY}}}]}}"#
        );
        let mut notes = Vec::new();
        let camera = &parse(&folder.path().join("t.json"), text.as_bytes(), &mut notes).unwrap()[0];
        assert_eq!(camera.name, "a.png");
        assert_eq!((camera.intrinsics.width, camera.intrinsics.focal), (20, [25.0, 25.0]));
        assert_eq!(camera.intrinsics.principal, [10.0, 5.0]);
        assert_eq!(notes, ["the intrinsics of 1 cameras were rescaled to the size of their stored images"]);
    }

    /// If this failed, photos of an unknown lens would silently be taken for a pinhole's, or every
    /// usual file would come with a warning.
    #[test]
    fn a_camera_model_that_is_not_known_is_told() {
        let noted = |model: &str| {
            let frame = |name: &str| format!(r#"{{"file_path": "{name}", "transform_matrix": {IDENTITY}}}"#);
            let (a, b) = (frame("a.png"), frame("b.png"));
            let text = format!(r#"{{"fl_x": 10, "w": 10, "h": 10, "camera_model": "{model}", "frames": [{a}, {b}]}}"#);
            let mut notes = Vec::new();
            photos(Path::new("t.json"), text.as_bytes(), false, &mut notes).unwrap();
            notes
        };
        assert!(matches!(&noted("WOBBLE")[..], [note] if note.contains("camera_model \"WOBBLE\" is not known")));
        assert!(matches!(&noted("THIN_PRISM_FISHEYE")[..], [note] if note.contains("taken for a fisheye")));
        assert!(noted("OPENCV").is_empty() && noted("PINHOLE").is_empty());
    }

    /// If this failed, a file with a fault would be read as something else, or its message would not give its place.
    #[test]
    fn faults_name_their_frame() {
        let with = |lens: &str, matrix: &str| {
            let frame = format!(r#"{{"file_path": "a.png", "transform_matrix": {matrix}}}"#);
            read(&format!(r#"{{{lens} "frames": [{frame}]}}"#)).unwrap_err().to_string()
        };
        let lens = r#""fl_x": 10, "w": 10, "h": 10,"#;
        assert!(with(lens, "[[1,0,0,1],[0,1,0,2],[0,0,-1,3],[0,0,0,1]]").contains("frame 0 (\"a.png\")"));
        assert!(with(lens, "[[1,0,0,1],[0,1,0,2]]").contains("4x4"));
        assert!(
            with(lens, "[[1,0,0,NaN],[0,1,0,2],[0,0,1,3]]").contains("(\"a.png\"): a value that is no finite number")
        );
        assert!(
            with(lens, "[[1,0,0,null],[0,1,0,2],[0,0,1,3]]").contains("(\"a.png\"): a value that is no finite number")
        );
        assert!(with(r#""camera_angle_x": 52, "w": 10, "h": 10,"#, IDENTITY).contains("in radians"));
        assert!(with(r#""camera_model": "EQUIRECTANGULAR","#, IDENTITY).contains("no pinhole"));
        assert!(with("", IDENTITY).contains("no w and h"));
        for lens in [r#""w": 10, "h": 10,"#, r#""w": 10, "h": 10, "fl_x": NaN,"#] {
            assert!(with(lens, IDENTITY).contains("no focal length is given, or none that is a number"));
        }
        assert!(with(r#""fl_x": 10, "w": 10.5, "h": 10,"#, IDENTITY).contains("whole pixels"));
        assert!(read("{\"frames\": []}").unwrap_err().to_string().contains("no cameras"));
        assert!(read("{\"frames\": [{]}").unwrap_err().to_string().contains("line 1 column"));
    }

    /// If this failed, one bad frame would lose a capture, or be read as something.
    #[test]
    fn bad_frames_are_left_out_and_named() {
        let good =
            |name: &str| format!(r#"{{"file_path": "{name}", "sharpness": NaN, "transform_matrix": {IDENTITY}}}"#);
        let frames = [
            good("a.png"),
            r#"{"file_path": "b.png"}"#.into(),
            good("a.png"),
            r#"{"transform_matrix": []}"#.into(),
            good("c.png"),
        ];
        let text = format!(r#"{{"fl_x": 10, "w": 10, "h": 10, "frames": [{}]}}"#, frames.join(", "));
        let mut notes = Vec::new();
        let photos = photos(Path::new("t.json"), text.as_bytes(), false, &mut notes).unwrap().photos;
        assert_eq!(photos.iter().map(|photo| &photo.camera.name[..]).collect::<Vec<_>>(), ["a.png", "c.png"]);
        assert_eq!(notes.len(), 1, "{notes:?}");
        for part in [
            "frames left out: 3",
            "frame 1 (\"b.png\"): it has no transform_matrix",
            "frame 3",
            "\"a.png\" has the name",
        ] {
            assert!(notes[0].contains(part), "{part} is not in {notes:?}");
        }
    }
}

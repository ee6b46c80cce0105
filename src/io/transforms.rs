//! transforms.json: one reader for the dialects of nerfstudio, instant-ngp and Blender (NeRF synthetic), and a writer of
//! nerfstudio's.
//!
//! Poses in these files are camera-to-world matrices in OpenGL camera axes (X right, Y up, -Z forward); here cameras
//! have OpenCV axes, so Y and Z of the camera change sign. The world frame is left untouched on both ways: where a file
//! has an `applied_transform`, its poses are already transformed by it and are taken as they stand, and instant-ngp's
//! own scale and offset are not applied.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use glam::{DMat3, DQuat, DVec3};
use serde::Deserialize;
use serde_json::json;

use super::checks;
use crate::error::{Error, Result};
use crate::scene::camera::{Camera, Intrinsics, Pose};

/// Extensions that stored images have, in the order they are looked for.
const IMAGE_EXTENSIONS: [&str; 6] = ["png", "jpg", "jpeg", "PNG", "JPG", "JPEG"];

/// Camera models that no pinhole comes near to.
const NO_PINHOLES: [&str; 4] = ["EQUIRECTANGULAR", "OMNIDIRECTIONAL", "VR180", "ORTHOPHOTO"];

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
    #[serde(default)]
    k1: f64,
    #[serde(default)]
    k2: f64,
    #[serde(default)]
    k3: f64,
    #[serde(default)]
    k4: f64,
    #[serde(default)]
    p1: f64,
    #[serde(default)]
    p2: f64,
}

#[derive(Deserialize)]
struct Frame {
    file_path: String,
    transform_matrix: Vec<[f64; 4]>,
    camera_model: Option<String>,
    #[serde(flatten)]
    lens: Lens,
}

#[derive(Deserialize)]
struct File {
    #[serde(flatten)]
    lens: Lens,
    camera_model: Option<String>,
    applied_transform: Option<serde::de::IgnoredAny>,
    frames: Vec<Frame>,
}

/// Reads cameras from the bytes of a transforms.json. Images are looked for beside `path`: their headers give the size
/// where the file does not, and the intrinsics are rescaled where a stored image has another size than w and h say.
/// A camera is named by its `file_path` after the folder `images`, which is how COLMAP names the same image.
/// Distortion is left out; `notes` says so, and of all else that a user should know.
///
/// # Errors
/// When the file is no such JSON, a matrix is no pose, or an image size or focal length cannot be known.
pub fn parse(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Vec<Camera>> {
    let file: File = super::json(path, bytes)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut cameras = Vec::with_capacity(file.frames.len());
    let (mut distorted, mut rescaled) = (0, 0);
    for (i, frame) in file.frames.iter().enumerate() {
        let refuse = |what: &str| Error::input(path, format!("frame {i} ({:?}): {what}", frame.file_path));
        let model = frame.camera_model.as_ref().or(file.camera_model.as_ref());
        if let Some(model) = model.filter(|model| NO_PINHOLES.iter().any(|start| model.starts_with(start))) {
            return Err(refuse(&format!("camera_model {model:?} is no pinhole; give perspective images")));
        }
        let pose = pose(&frame.transform_matrix).map_err(|what| refuse(&what))?;
        let lens = frame.lens.or(file.lens);
        let image = stored_image(folder, &frame.file_path);
        let stored = image.as_deref().and_then(|image| image::image_dimensions(image).ok());
        let intrinsics = lens.intrinsics(stored).map_err(|what| refuse(&what))?;
        rescaled += usize::from(stored.is_some() && lens.size().is_ok_and(|size| size.is_some() && size != stored));
        distorted += usize::from([lens.k1, lens.k2, lens.k3, lens.k4, lens.p1, lens.p2].iter().any(|&k| k != 0.0));
        cameras.push(Camera { name: name(&frame.file_path, image.as_deref()), pose, intrinsics });
    }
    if rescaled > 0 {
        notes.push(format!("the intrinsics of {rescaled} cameras were rescaled to the size of their stored images"));
    }
    if distorted > 0 {
        notes.push(format!(
            "{distorted} of {} images have lens distortion, which is left out: their cameras are taken as pinholes",
            cameras.len()
        ));
    }
    if file.applied_transform.is_some() {
        notes.push("poses are taken as they stand, in the frame after the file's applied_transform".into());
    }
    checks::cameras(path, cameras)
}

impl Lens {
    /// These intrinsics, with those of the whole file where a frame leaves them open.
    fn or(self, file: Self) -> Self {
        // A frame's own focal length or angle must not be mixed with the file's other one.
        let angles = self.fl_x.or(self.camera_angle_x).map_or(file, |_| self);
        let distortion = if self.fl_x.is_some() { self } else { file };
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
        let half = [0.5 * f64::from(w), 0.5 * f64::from(h)];
        let from_angle = |half: f64, angle: Option<f64>| angle.map(|angle| half / (0.5 * angle).tan());
        let x = self.fl_x.or(from_angle(half[0], self.camera_angle_x));
        let y = self.fl_y.or(from_angle(half[1], self.camera_angle_y));
        let (Some(x), Some(y)) = (x.or(y), y.or(x)) else {
            return Err("no focal length is given; add fl_x, or camera_angle_x in radians".into());
        };
        let principal = [self.cx.unwrap_or(half[0]), self.cy.unwrap_or(half[1])];
        let (width, height) = stored.unwrap_or((w, h));
        let scale = [f64::from(width) / f64::from(w), f64::from(height) / f64::from(h)];
        Ok(Intrinsics {
            width,
            height,
            focal: [x * scale[0], y * scale[1]],
            principal: [principal[0] * scale[0], principal[1] * scale[1]],
        })
    }
}

/// The world-from-camera pose of a camera-to-world matrix in OpenGL axes; the axes may have any one length.
fn pose(rows: &[[f64; 4]]) -> Result<Pose, String> {
    let last_is_sound = rows.len() == 3 || rows.len() == 4 && rows[3] == [0.0, 0.0, 0.0, 1.0];
    if !last_is_sound {
        return Err("transform_matrix must have the rows of a 4x4 pose, the last one 0 0 0 1".into());
    }
    let column = |c: usize| DVec3::new(rows[0][c], rows[1][c], rows[2][c]);
    let [x, y, z] = [0, 1, 2].map(|c| column(c).normalize_or_zero());
    let axes = DMat3::from_cols(x, -y, -z);
    // Matrices are often printed with few digits; a shear or a mirror is far from this.
    let skew = x.dot(y).abs().max(y.dot(z).abs()).max(z.dot(x).abs());
    if !(skew < 1e-2 && axes.determinant() > 0.9) {
        return Err("transform_matrix is no rotation; its first three columns must be right-handed unit axes".into());
    }
    Ok(Pose { position: column(3), rotation: DQuat::from_mat3(&axes).normalize() })
}

/// The image file of a frame, which may be named without an extension.
fn stored_image(folder: &Path, file_path: &str) -> Option<PathBuf> {
    let path = folder.join(file_path);
    let with_extension = |extension: &&str| PathBuf::from(format!("{}.{extension}", path.display()));
    std::iter::once(path.clone()).chain(IMAGE_EXTENSIONS.iter().map(with_extension)).find(|path| path.is_file())
}

/// A camera's name: the frame's path after its folder `images` (or `images_2` and the like, shrunk copies), without
/// leading dots, with the extension of the stored image, or `.png` where there is neither.
fn name(file_path: &str, image: Option<&Path>) -> String {
    let normal = |c: Component| match c {
        Component::Normal(part) => Some(part.to_string_lossy().into_owned()),
        _ => None,
    };
    let parts: Vec<String> = Path::new(file_path).components().filter_map(normal).collect();
    let is_images =
        |part: &String| part.strip_prefix("images").is_some_and(|rest| rest.is_empty() || rest.starts_with('_'));
    let folders = parts.len().saturating_sub(1);
    let start = parts[..folders].iter().rposition(is_images).map_or(0, |images| images + 1);
    let name = parts[start..].join("/");
    let has_extension = Path::new(&name).extension().is_some_and(|e| IMAGE_EXTENSIONS.iter().any(|known| e == *known));
    match image.and_then(Path::extension) {
        _ if has_extension => name,
        Some(extension) if Path::new(&name).extension() != Some(extension) => {
            format!("{name}.{}", extension.to_string_lossy())
        }
        Some(_) => name,
        None => format!("{name}.png"),
    }
}

/// The text of a transforms.json in nerfstudio's dialect, which instant-ngp reads as well: OpenGL camera-to-world
/// matrices in the untouched world frame, `camera_model` OPENCV without distortion (some loaders refuse PINHOLE), and
/// both camera angles (some need them where images are not square). Images are named `images/` and
/// [`crate::io::export::image_name`]. Intrinsics stand at the top where all cameras share them, else in each frame.
/// `ply_file_path` is the seed cloud, relative to the file.
pub fn write(cameras: &[Camera], ply_file_path: &str) -> String {
    let shared = cameras.first().map(|c| c.intrinsics).filter(|k| cameras.iter().all(|c| c.intrinsics == *k));
    let frames: Vec<_> = cameras
        .iter()
        .map(|camera| {
            let axes = DMat3::from_quat(camera.pose.rotation);
            let p = camera.pose.position;
            let rows: Vec<[f64; 4]> = (0..3)
                .map(|r| [axes.x_axis[r], -axes.y_axis[r], -axes.z_axis[r], p[r]])
                .chain([[0.0, 0.0, 0.0, 1.0]])
                .collect();
            let mut frame = if shared.is_some() { BTreeMap::new() } else { lens_entries(&camera.intrinsics) };
            frame.insert("file_path", json!(format!("images/{}", super::export::image_name(camera))));
            frame.insert("transform_matrix", json!(rows));
            frame
        })
        .collect();
    let mut file = shared.as_ref().map(lens_entries).unwrap_or_default();
    file.insert("camera_model", json!("OPENCV"));
    file.insert("ply_file_path", json!(ply_file_path));
    file.insert("frames", json!(frames));
    format!("{:#}\n", json!(file))
}

/// The entries that describe a lens.
fn lens_entries(k: &Intrinsics) -> BTreeMap<&'static str, serde_json::Value> {
    let angle = |size: u32, focal: f64| 2.0 * (0.5 * f64::from(size) / focal).atan();
    BTreeMap::from([
        ("fl_x", json!(k.focal[0])),
        ("fl_y", json!(k.focal[1])),
        ("cx", json!(k.principal[0])),
        ("cy", json!(k.principal[1])),
        ("w", json!(k.width)),
        ("h", json!(k.height)),
        ("camera_angle_x", json!(angle(k.width, k.focal[0]))),
        ("camera_angle_y", json!(angle(k.height, k.focal[1]))),
        ("k1", json!(0.0)),
        ("k2", json!(0.0)),
        ("p1", json!(0.0)),
        ("p2", json!(0.0)),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<Camera>> {
        parse(Path::new("no-such-folder/transforms.json"), text.as_bytes(), &mut Vec::new())
    }

    const IDENTITY: &str = "[[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]";

    /// If this failed, what a trainer reads would not be what was planned, for shared and for separate lenses.
    #[test]
    fn cameras_survive_a_round_trip() {
        let camera = |name: &str, x: f64, width| Camera {
            name: name.into(),
            pose: Pose::looking(DVec3::new(x, 0.5, -4.0), DVec3::new(-x, 0.1, 4.0), DVec3::Z),
            intrinsics: Intrinsics::from_fov(width, 480, 1.0),
        };
        for second in [640, 320] {
            let written = vec![camera("0000.png", 0.3, 640), camera("0001.png", -2.0, second)];
            let text = write(&written, "points.ply");
            assert!(text.contains("camera_angle_y") && text.contains("\"OPENCV\""), "{text}");
            for (a, b) in written.iter().zip(&read(&text).unwrap()) {
                assert_eq!((&a.name, a.intrinsics), (&b.name, b.intrinsics));
                assert!((a.pose.position - b.pose.position).length() < 1e-12);
                assert!(a.pose.rotation.dot(b.pose.rotation).abs() > 1.0 - 1e-12);
            }
        }
    }

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
        assert!(notes[0].starts_with("1 of 2 images have lens distortion"), "{notes:?}");
        assert!(notes[1].contains("applied_transform"), "{notes:?}");
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

    /// If this failed, a file with a fault would be read as something else, or its message would not say where it is.
    #[test]
    fn faults_name_their_frame() {
        let with = |lens: &str, matrix: &str| {
            let frame = format!(r#"{{"file_path": "a.png", "transform_matrix": {matrix}}}"#);
            read(&format!(r#"{{{lens} "frames": [{frame}]}}"#)).unwrap_err().to_string()
        };
        let lens = r#""fl_x": 10, "w": 10, "h": 10,"#;
        assert!(with(lens, "[[1,0,0,1],[0,1,0,2],[0,0,-1,3],[0,0,0,1]]").contains("frame 0 (\"a.png\")"));
        assert!(with(lens, "[[1,0,0,1],[0,1,0,2]]").contains("4x4"));
        assert!(with(r#""camera_model": "EQUIRECTANGULAR","#, IDENTITY).contains("no pinhole"));
        assert!(with("", IDENTITY).contains("no w and h"));
        assert!(with(r#""w": 10, "h": 10,"#, IDENTITY).contains("no focal length"));
        assert!(with(r#""fl_x": 10, "w": 10.5, "h": 10,"#, IDENTITY).contains("whole pixels"));
        assert!(read("{\"frames\": []}").unwrap_err().to_string().contains("no cameras"));
        assert!(read("{\"frames\": [{]}").unwrap_err().to_string().contains("line 1 column"));
    }
}

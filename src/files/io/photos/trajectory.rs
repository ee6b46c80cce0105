//! Trajectories of Tanks and Temples (`.log`): for each view a line of three numbers (its index twice and a 0) and a 4x4
//! camera-to-world matrix in OpenCV axes. Lenses and images are not given.

use std::path::Path;

use super::lookup::Lookup;
use super::{Found, files};
use crate::error::{Error, Result};
use crate::files::io::checks;
use crate::files::io::matrix::{self, Axes};
use crate::files::photos::{Convention, Photo};
use crate::scene::camera::{Camera, Intrinsics, Pose};
use crate::scene::lens::Distortion;

/// Image size of the frames of Tanks and Temples.
const SIZE: (u32, u32) = (1920, 1080);

/// Focal length over image width that is taken where nothing is known of the lens: 71 degrees across.
const FOCAL: f64 = 0.7;

/// Parses the poses, in the order of the file.
///
/// # Errors
/// When a view is cut short or its matrix is no pose.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Vec<Pose>> {
    let lines = matrix::lines(path, bytes)?;
    let mut poses = Vec::with_capacity(lines.len() / 5);
    for view in lines.chunks(5) {
        let refuse = |what: &str| {
            let number = view.first().map_or(0, |line| line.0);
            Error::input(path, format!("line {number}, view {}: {what}", poses.len()))
        };
        let rows = matrix::rows(view.get(1..).unwrap_or_default()).filter(|rows| rows.len() == 4);
        let (Some(rows), 3) = (rows, view[0].1.len()) else {
            return Err(refuse("a view is a line of three numbers and four lines of four; copy or export it again"));
        };
        poses.push(matrix::pose(&rows, Axes::OpenCv).map_err(|what| refuse(&format!("the matrix {what}")))?);
    }
    Ok(poses)
}

/// Reads poses, with `intrinsics` for all or a default lens, and the images beside the file where there are as many.
pub(super) fn read(path: &Path, bytes: &[u8], intrinsics: Option<Intrinsics>) -> Result<Found> {
    let poses = parse(path, bytes)?;
    let root = path.parent().unwrap_or(Path::new(""));
    let folders = files::image_folders(root);
    let names = folders.first().map(|folder| files::images_in(folder)).unwrap_or_default();
    let paired = names.len() == poses.len();
    let mut notes = Vec::new();
    if !names.is_empty() && !paired {
        notes.push(format!("{} images lie beside {} poses, so none is taken for any", names.len(), poses.len()));
    }
    let lookup = Lookup::default();
    let mut photos = Vec::with_capacity(poses.len());
    for (i, pose) in poses.into_iter().enumerate() {
        // Without images, the names that Tanks and Temples gives them.
        let name = if paired { names[i].clone() } else { format!("{:06}.jpg", i + 1) };
        let image = if paired { lookup.image(&folders, &name) } else { None };
        let (width, height) = image.as_deref().and_then(files::size).unwrap_or(SIZE);
        let (w, h) = (f64::from(width), f64::from(height));
        let guess = Intrinsics { width, height, focal: [FOCAL * w.max(h); 2], principal: [0.5 * w, 0.5 * h] };
        let mask = files::mask(root, &name);
        let camera = Camera { name, pose, intrinsics: intrinsics.unwrap_or(guess) };
        photos.push(Photo { camera, distortion: Distortion::default(), image, mask });
    }
    checks::cameras(path, photos.iter().map(|photo| &photo.camera))?;
    if intrinsics.is_none() {
        let k = photos[0].camera.intrinsics;
        notes.push(format!(
            "the file says nothing of the lens: {} x {} pixels and a focal length of {} are a guess",
            k.width, k.height, k.focal[0]
        ));
    }
    Ok(Found { photos, convention: Convention::Trajectory, notes, ..Found::default() })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    const VIEW: &str = "0 0 0\n0 0 1 1\n1 0 0 2\n0 1 0 3\n0 0 0 1\n";

    /// If this failed, poses would be inverted, or a cut file be read as a shorter trajectory.
    #[test]
    fn views_are_camera_to_world() {
        let path = Path::new("a.log");
        let poses = parse(path, format!("{VIEW}{VIEW}").as_bytes()).unwrap();
        assert_eq!((poses.len(), poses[1].position), (2, DVec3::new(1.0, 2.0, 3.0)));
        assert!((poses[0].forward() - DVec3::X).length() < 1e-12);
        let message = parse(path, format!("{VIEW}1 1 0\n0 0 1 1\n").as_bytes()).unwrap_err().to_string();
        assert!(message.contains("line 6, view 1") && message.contains("export it again"), "{message}");
        let sheared = VIEW.replace("1 0 0 2", "1 0 1 2");
        assert!(parse(path, sheared.as_bytes()).unwrap_err().to_string().contains("no rotation"));
    }
}

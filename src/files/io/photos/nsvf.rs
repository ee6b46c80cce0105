//! The layout of NSVF: `rgb/`, `pose/NAME.txt` (OpenCV camera-to-world, 4x4), `intrinsics.txt` and `bbox.txt`. Names that
//! start with `0_`, `1_` and `2_` are for training, validation and test.

use std::path::Path;

use super::lookup::Lookup;
use super::{Found, files};
use crate::error::{Error, Result};
use crate::files::io::left_out::LeftOut;
use crate::files::io::matrix::{self, Axes};
use crate::files::io::{checks, read_file};
use crate::files::photos::{Convention, Photo};
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::lens::Distortion;

/// Whether a folder has this layout.
pub(crate) fn is_layout(folder: &Path) -> bool {
    folder.join("pose").is_dir() && folder.join("intrinsics.txt").is_file()
}

/// What intrinsics.txt holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    /// Focal lengths in pixels.
    pub focal: [f64; 2],
    /// Principal point in pixels.
    pub principal: [f64; 2],
    /// Width and height of the images, where the file has them.
    pub size: Option<(u32, u32)>,
}

/// Parses intrinsics.txt. Two dialects: a 3x3 or 4x4 matrix; or a line
/// `f cx cy 0` and, as the last line, `height width`.
///
/// # Errors
/// When it is neither.
pub fn intrinsics(path: &Path, bytes: &[u8]) -> Result<Pinhole> {
    let lines = matrix::lines(path, bytes)?;
    let numbers: Vec<f64> = lines.iter().flat_map(|(_, numbers)| numbers.iter().copied()).collect();
    let first = lines.first().map(|(_, numbers)| numbers.len());
    match (&numbers[..], first) {
        (&[fx, _, cx, _, fy, cy, _, _, _], _) => Ok(Pinhole { focal: [fx, fy], principal: [cx, cy], size: None }),
        (&[fx, _, cx, _, _, fy, cy, _, _, _, _, _, _, _, _, _], _) => {
            Ok(Pinhole { focal: [fx, fy], principal: [cx, cy], size: None })
        }
        (&[f, cx, cy, _, ..], Some(4)) => {
            let size = lines.last().and_then(|(_, last)| match last[..] {
                [h, w] if h >= 1.0 && w >= 1.0 && h.max(w) < 1e6 => Some((w as u32, h as u32)),
                _ => None,
            });
            Ok(Pinhole { focal: [f, f], principal: [cx, cy], size })
        }
        _ => Err(Error::input(path, "it holds neither a matrix nor a line `f cx cy 0`; export the intrinsics again")),
    }
}

/// The pose of a camera from the bytes of its file.
///
/// # Errors
/// When it is no 4x4 (or 3x4) camera-to-world matrix.
pub fn pose(path: &Path, bytes: &[u8]) -> Result<crate::scene::camera::Pose> {
    let lines = matrix::lines(path, bytes)?;
    let rows = matrix::rows(&lines).unwrap_or_default();
    matrix::pose(&rows, Axes::OpenCv).map_err(|what| Error::input(path, format!("the matrix {what}")))
}

/// Reads a folder: the views for training where the names mark them, else all.
pub(super) fn read(folder: &Path) -> Result<Found> {
    let file = folder.join("intrinsics.txt");
    let Pinhole { focal, principal, size } = intrinsics(&file, &read_file(&file)?)?;
    let poses = folder.join("pose");
    let mut stems: Vec<String> = std::fs::read_dir(&poses)
        .map_err(|source| Error::io(&poses, source))?
        .flatten()
        .filter_map(|entry| entry.file_name().to_str()?.strip_suffix(".txt").map(str::to_owned))
        .collect();
    stems.sort();
    let mut notes = Vec::new();
    let all = stems.len();
    if stems.iter().any(|stem| stem.starts_with("0_")) {
        stems.retain(|stem| stem.starts_with("0_"));
        notes.push(format!("only the {} views for training (0_) of {all} are read", stems.len()));
    }
    let rgb = [folder.join("rgb")];
    let lookup = Lookup::default();
    let mut left_out = LeftOut::default();
    let mut photos = Vec::with_capacity(stems.len());
    for stem in &stems {
        let path = poses.join(format!("{stem}.txt"));
        let pose = match read_file(&path).and_then(|bytes| pose(&path, &bytes)) {
            Ok(pose) => pose,
            Err(what) => {
                left_out.add(what.to_string());
                continue;
            }
        };
        let image = lookup.image(&rgb, &format!("{stem}.png"));
        let stored = image.as_deref().and_then(files::size);
        // Without a size in the file, the lens is that of the stored images.
        let Some((width, height)) = size.or(stored) else {
            let what = "the image was not found in rgb, and intrinsics.txt has no image size; add `height width` as its \
                        last line";
            return Err(Error::input(path, what));
        };
        let name = image.as_deref().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
        photos.push(Photo {
            camera: Camera {
                name: name.unwrap_or_else(|| format!("{stem}.png")),
                pose,
                intrinsics: Intrinsics { width, height, focal, principal },
            },
            distortion: Distortion::default(),
            mask: files::mask(folder, &format!("{stem}.png")),
            image,
        });
    }
    checks::usable_photos(&poses, &mut photos, &mut left_out)?;
    left_out.note("views", &mut notes);
    let unposed = files::images_in(&rgb[0]).into_iter().filter(|name| {
        let stem = name.rsplit_once('.').map_or(name.as_str(), |(stem, _)| stem);
        !poses.join(format!("{stem}.txt")).is_file()
    });
    let bbox = folder.join("bbox.txt");
    if bbox.is_file() {
        let lines = matrix::lines(&bbox, &read_file(&bbox)?)?;
        if let Some([x0, y0, z0, x1, y1, z1, ..]) = lines.first().map(|(_, numbers)| &numbers[..]) {
            notes.push(format!("bbox.txt: the scene lies from [{x0}, {y0}, {z0}] to [{x1}, {y1}, {z1}]"));
        }
    }
    Ok(Found { photos, convention: Convention::Nsvf, notes, unposed: unposed.collect(), ..Found::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both dialects, with values written out. If this failed, a focal length would be taken for a principal point.
    #[test]
    fn both_dialects_of_intrinsics() {
        let read = |text: &str| intrinsics(Path::new("intrinsics.txt"), text.as_bytes());
        let line = "1111.1 400.0 300.0 0.\n0. 0. 0.\n0.\n1.\n600 800\n";
        let known = Pinhole { focal: [1111.1; 2], principal: [400.0, 300.0], size: Some((800, 600)) };
        assert_eq!(read(line).unwrap(), known);
        let matrix = "1 0 3 0\n0 5 6 0\n0 0 1 0\n0 0 0 1\n";
        assert_eq!(read(matrix).unwrap(), Pinhole { focal: [1.0, 5.0], principal: [3.0, 6.0], size: None });
        assert!(read("1 2 3\n").unwrap_err().to_string().contains("neither a matrix"));
        assert!(read("1 2 x 0\n").unwrap_err().to_string().contains("line 1: \"x\" is no number"));
    }
}

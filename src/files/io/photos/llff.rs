//! LLFF's `poses_bounds.npy`: for each image of `images/`, in the order of names, a 3x5 matrix (rotation with the axes down, right and
//! backwards as columns; position; height, width and focal length in pixels) and the nearest and farthest depth.

use std::path::Path;

use super::lookup::Lookup;
use super::{Found, files};
use crate::error::{Error, Result};
use crate::files::io::left_out::LeftOut;
use crate::files::io::matrix::{self, Axes};
use crate::files::io::{checks, npy, read_file};
use crate::files::photos::{Convention, Photo};
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::lens::Distortion;

/// The file's name.
pub(crate) const FILE: &str = "poses_bounds.npy";

/// Numbers of a row.
const ROW: usize = 17;

/// The rows of the file.
///
/// # Errors
/// Where the file is no NumPy array of 17 columns in double or single precision, or cut short.
pub fn rows(path: &Path, bytes: &[u8]) -> Result<Vec<[f64; ROW]>> {
    let array = npy::parse(path, bytes)?;
    if !matches!(array.shape[..], [count, ROW] if count > 0) {
        let what = format!("its shape is {:?} and not rows of {ROW} numbers; write it as LLFF does", array.shape);
        return Err(Error::input(path, what));
    }
    let values: Vec<f64> = array.values().collect();
    Ok(values.chunks_exact(ROW).filter_map(|row| row.try_into().ok()).collect())
}

/// Reads a folder with such a file.
pub(super) fn read(folder: &Path) -> Result<Found> {
    let path = folder.join(FILE);
    let rows = rows(&path, &read_file(&path)?)?;
    let folders = files::image_folders(folder);
    let names = folders.first().map(|images| files::images_in(images)).unwrap_or_default();
    if !names.is_empty() && names.len() != rows.len() {
        let what = format!(
            "it has {} poses and there are {} images beside it, so that nothing says which is which; leave those images that were posed",
            rows.len(),
            names.len()
        );
        return Err(Error::input(&path, what));
    }
    let lookup = Lookup::default();
    let mut left_out = LeftOut::default();
    let mut photos = Vec::with_capacity(rows.len());
    for (i, row) in rows.iter().enumerate() {
        let column = |c: usize| [row[c], row[c + 5], row[c + 10]];
        let [down, right, back, position, [height, width, focal]] = [0, 1, 2, 3, 4].map(column);
        let pose = [0, 1, 2].map(|r| [right[r], -down[r], back[r], position[r]]);
        let pose = match matrix::pose(&pose, Axes::OpenGl) {
            Ok(pose) => pose,
            Err(what) => {
                left_out.add(format!("pose {i}: the matrix {what}"));
                continue;
            }
        };
        let name = names.get(i).cloned().unwrap_or_else(|| format!("{i:03}.png"));
        let image = names.get(i).and_then(|name| lookup.image(&folders, name));
        // The lens is given for the full size; `settle` brings it to that of the stored image.
        let intrinsics = Intrinsics {
            width: width as u32,
            height: height as u32,
            focal: [focal; 2],
            principal: [0.5 * width, 0.5 * height],
        };
        let camera = Camera { name, pose, intrinsics };
        photos.push(Photo {
            mask: files::mask(folder, &camera.name),
            camera,
            distortion: Distortion::default(),
            image,
        });
    }
    checks::usable_photos(&path, &mut photos, &mut left_out)?;
    let mut notes = Vec::new();
    left_out.note("poses", &mut notes);
    Ok(Found { photos, convention: Convention::Llff, notes, ..Found::default() })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// A file of rows as numpy writes it.
    fn npy(rows: &[[f64; ROW]]) -> Vec<u8> {
        npy::written(&[rows.len(), ROW], rows.as_flattened())
    }

    /// A camera at (1, 2, 3) that looks along -z with +y up: down is -y, right +x, backwards +z.
    const LOOKS_ALONG_MINUS_Z: [f64; ROW] =
        [0.0, 1.0, 0.0, 1.0, 30.0, -1.0, 0.0, 0.0, 2.0, 40.0, 0.0, 0.0, 1.0, 3.0, 25.0, 0.5, 9.0];

    /// If this failed, LLFF captures would be read with cameras that lie on their side or look backwards.
    #[test]
    fn axes_and_lens_are_those_of_llff() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(FILE), npy(&[LOOKS_ALONG_MINUS_Z; 1])).unwrap();
        let camera = &read(folder.path()).unwrap().photos[0].camera;
        assert_eq!(camera.pose.position, DVec3::new(1.0, 2.0, 3.0));
        assert!(camera.pose.forward().distance(DVec3::NEG_Z) < 1e-12 && camera.pose.up().distance(DVec3::Y) < 1e-12);
        let Intrinsics { width, height, focal, principal } = camera.intrinsics;
        assert_eq!((width, height, focal, principal), (40, 30, [25.0; 2], [20.0, 15.0]));
    }

    /// If this failed, a damaged file would be read as other poses, or end the program.
    #[test]
    fn damaged_files_are_refused() {
        let whole = npy(&[LOOKS_ALONG_MINUS_Z; 3]);
        for length in 0..whole.len() {
            assert!(rows(Path::new("a.npy"), &whole[..length]).is_err(), "{length} bytes");
        }
        assert_eq!(rows(Path::new("a.npy"), &whole).unwrap().len(), 3);
        let text = String::from_utf8_lossy(&whole[..128]).into_owned();
        assert!(text.contains("(3, 17)"));
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(FILE), &whole).unwrap();
        std::fs::create_dir(folder.path().join("images")).unwrap();
        image::RgbImage::new(4, 3).save(folder.path().join("images/a.png")).unwrap();
        let message = read(folder.path()).err().unwrap().to_string();
        assert!(message.contains("3 poses and there are 1 images"), "{message}");
    }
}

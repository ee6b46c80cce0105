//! Photos that are stored on their side: cameras write how to turn them into EXIF data, and some programs have turned them before they
//! found the poses.

use std::path::Path;

use image::metadata::Orientation;
use image::{ImageDecoder, ImageReader};

use crate::scene::camera::Intrinsics;

/// How an image of `stored` pixels has to be turned to be that of its camera: as its EXIF data say, where they say a quarter turn and the
/// image fits only then. None elsewhere: COLMAP's models are of pixels as they are stored. Of square images nobody knows.
pub fn quarter_turn(path: &Path, stored: (u32, u32), camera: &Intrinsics) -> Option<Orientation> {
    let fits = |width: u32, height: u32| camera.resized(width, height).is_some();
    if fits(stored.0, stored.1) || !fits(stored.1, stored.0) {
        return None;
    }
    let mut decoder = ImageReader::open(path).ok()?.with_guessed_format().ok()?.into_decoder().ok()?;
    decoder.orientation().ok().filter(is_quarter)
}

/// Whether width and height change places.
pub fn is_quarter(orientation: &Orientation) -> bool {
    use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    matches!(orientation, Rotate90 | Rotate90FlipH | Rotate270 | Rotate270FlipH)
}

/// Where a pixel at (x, y) of the turned image is in the stored one of `width` x `height` pixels.
pub fn source(orientation: Orientation, [x, y]: [u32; 2], [width, height]: [u32; 2]) -> [u32; 2] {
    match orientation {
        Orientation::Rotate90 => [y, height - 1 - x],
        Orientation::Rotate270 => [width - 1 - y, x],
        Orientation::Rotate90FlipH => [y, x],
        Orientation::Rotate270FlipH => [width - 1 - y, height - 1 - x],
        Orientation::Rotate180 => [width - 1 - x, height - 1 - y],
        Orientation::FlipHorizontal => [width - 1 - x, y],
        Orientation::FlipVertical => [x, height - 1 - y],
        Orientation::NoTransforms => [x, y],
    }
}

/// A JPEG with EXIF data, a TIFF file, behind its start.
#[cfg(test)]
pub(crate) fn with_exif(jpeg: &[u8], tiff: &[u8]) -> Vec<u8> {
    let segment = [b"Exif\0\0", tiff].concat();
    let length = (segment.len() as u16 + 2).to_be_bytes();
    [&jpeg[..2], &[0xff, 0xe1], &length, &segment, &jpeg[2..]].concat()
}

/// EXIF data that say a quarter turn: one entry, tag 0x112, orientation 6.
#[cfg(test)]
pub(crate) const QUARTER: &[u8] = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";

#[cfg(test)]
mod tests {
    use image::{DynamicImage, GenericImageView, Rgb, RgbImage};

    use super::*;

    /// If this failed, photos would be trained on mirrored or upside down.
    #[test]
    fn turns_are_those_of_the_image_library() {
        let stored = RgbImage::from_fn(5, 3, |x, y| Rgb([x as u8, y as u8, 7]));
        for tag in 1..=8 {
            let orientation = Orientation::from_exif(tag).unwrap();
            let mut turned = DynamicImage::from(stored.clone());
            turned.apply_orientation(orientation);
            assert_eq!(turned.dimensions() == (3, 5), is_quarter(&orientation), "{tag}");
            for (x, y, pixel) in turned.to_rgb8().enumerate_pixels() {
                let [u, v] = source(orientation, [x, y], [5, 3]);
                assert_eq!(stored.get_pixel(u, v), pixel, "{tag}: {x}, {y}");
            }
        }
    }
}

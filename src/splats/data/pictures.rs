//! Pictures to train on: photos in 8 bits, without distortion, decoded in the background.

use std::path::Path;
use std::sync::{Arc, Mutex};

use super::undistort::Map;
pub use super::undistort::UNKNOWN;
use crate::engine::parallel::lock;
use crate::files::photos::Photo;
use crate::files::photos::decode::{self, Channels, Decoded, Decoder, Precision};
use crate::scene::camera::Camera;
use crate::scene::lens::Lens;
use crate::splats::config::Masks;
use crate::{Error, Result};

/// How photos are turned into pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureSettings {
    /// Each pixel is the mean of `shrink` x `shrink` stored pixels, of linear values. At least 1.
    pub shrink: u32,
    /// Bytes that photos on their way take together; see [`decode::DecodeSettings::memory`].
    pub memory: u64,
    /// Threads; 0 for as many as there are: one per core, or a worker's share of them.
    pub threads: usize,
    /// What masks mean.
    pub masks: Masks,
}

impl Default for PictureSettings {
    fn default() -> Self {
        let decode::DecodeSettings { memory, threads, .. } = decode::DecodeSettings::default();
        Self { shrink: 1, memory, threads, masks: Masks::default() }
    }
}

/// A photo as it is trained on.
///
/// Pixels run row by row from the top left. Each is 8-bit sRGB with straight alpha, red in the lowest byte and alpha in the
/// highest. Alpha comes from the mask file, or else from the image's alpha channel; it is 255 where there is neither. A pixel
/// with an alpha of 0 is 0, or [`UNKNOWN`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Place of its photo among those that were given.
    pub index: usize,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The pixels.
    pub pixels: Vec<u32>,
}

/// Starts to make pictures of photos, in their order, in parallel, in bounded memory: what [`cameras`] see.
///
/// Where a lens bends, its photo is resampled to the pinhole of the same intrinsics, between the four nearest pixels in
/// sRGB, as OpenCV does; colours are weighted by alpha.
///
/// # Errors
/// As [`Decoder`]: each photo on its own, in a line that names its file; also where straightening leaves nothing of it.
pub fn pictures(photos: &[Photo], settings: &PictureSettings) -> Result<Decoder<Picture>> {
    let PictureSettings { shrink, memory, threads, masks } = *settings;
    let decoding =
        decode::DecodeSettings { channels: Channels::Rgb, precision: Precision::Byte, shrink, memory, threads };
    // Photos of one lens mostly follow each other.
    let last: Mutex<Option<Arc<Map>>> = Mutex::default();
    // The photo and its picture, and a map that takes as much as both.
    let copies = if photos.iter().any(|photo| !photo.distortion.is_none()) { 4 } else { 2 };
    Decoder::making(photos, decoding, copies, move |photo, decoded| {
        let Decoded { index, width, height, .. } = decoded;
        let bent = packed(decoded);
        let lens = Lens::new(photo.camera.intrinsics.shrunk(shrink.max(1)), photo.distortion);
        let mut pixels = if lens.distortion.is_none() { bent } else { map(&last, lens).straightened(&bent) };
        if masks == Masks::Ignore {
            pixels
                .iter_mut()
                .for_each(|pixel| *pixel = if *pixel >> 24 < 128 { UNKNOWN } else { *pixel | 0xff00_0000 });
        }
        if pixels.iter().all(|pixel| *pixel == UNKNOWN) {
            return Err(Error::input(
                photo.image.as_deref().unwrap_or(Path::new(&photo.camera.name)),
                "nothing is left of this photo once it is straightened, and its mask cut out where that is ignored; give the lens that it was \
                 taken with, or leave it out",
            ));
        }
        Ok(Picture { index, width, height, pixels })
    })
}

/// The map of a lens: that of the last photo, or a new one.
fn map(last: &Mutex<Option<Arc<Map>>>, lens: Lens) -> Arc<Map> {
    if let Some(map) = lock(last).as_ref().filter(|map| map.is_of(&lens)) {
        return Arc::clone(map);
    }
    // Not under the lock: where every photo has its own lens, threads must not wait for each other.
    let map = Arc::new(Map::new(lens));
    *lock(last) = Some(Arc::clone(&map));
    map
}

/// The pixels of a photo as it was taken.
fn packed(decoded: Decoded) -> Vec<u32> {
    let Decoded { values, mask, .. } = decoded;
    let pixel = |(i, colour): (usize, &[u8; 3])| {
        let alpha = mask.as_ref().map_or(255, |mask| mask[i]);
        let [r, g, b] = *colour;
        if alpha == 0 { 0 } else { u32::from_le_bytes([r, g, b, alpha]) }
    };
    values.into_bytes().as_chunks::<3>().0.iter().enumerate().map(pixel).collect()
}

/// The cameras of the pictures: pinholes of their size.
pub fn cameras(photos: &[Photo], shrink: u32) -> Vec<Camera> {
    let small =
        |photo: &Photo| Camera { intrinsics: photo.camera.intrinsics.shrunk(shrink.max(1)), ..photo.camera.clone() };
    photos.iter().map(small).collect()
}

/// Bytes of all pixels of the pictures together.
pub fn picture_bytes(photos: &[Photo], shrink: u32) -> u64 {
    let bytes = |photo: &Photo| {
        let small = photo.camera.intrinsics.shrunk(shrink.max(1));
        4 * u64::from(small.width) * u64::from(small.height)
    };
    photos.iter().map(bytes).sum()
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use glam::DVec3;
    use image::{GrayImage, Rgb, RgbImage, Rgba, RgbaImage};

    use super::*;
    use crate::files::photos::orientation::{QUARTER, with_exif};
    use crate::scene::camera::{Intrinsics, Pose};
    use crate::scene::lens::Distortion;

    fn photo(path: PathBuf, width: u32, height: u32) -> Photo {
        let camera = Camera {
            name: path.file_name().unwrap().to_string_lossy().into_owned(),
            pose: Pose::looking(DVec3::ZERO, DVec3::Z, DVec3::Y),
            intrinsics: Intrinsics::from_fov(width, height, 1.0),
        };
        Photo { camera, distortion: Distortion::default(), image: Some(path), mask: None }
    }

    fn all(photos: &[Photo], shrink: u32) -> Vec<Result<Picture>> {
        pictures(photos, &PictureSettings { shrink, ..PictureSettings::default() }).unwrap().collect()
    }

    fn one(photo: &Photo, shrink: u32) -> Vec<[u8; 4]> {
        let picture = all(std::slice::from_ref(photo), shrink).remove(0).unwrap();
        assert_eq!(picture.pixels.len(), (picture.width * picture.height) as usize);
        picture.pixels.into_iter().map(u32::to_le_bytes).collect()
    }

    /// Computed directly. If this failed, training would fit other colours than the photos have, or learn the colour that a
    /// program left under transparent pixels.
    #[test]
    fn pixels_are_the_stored_bytes_with_alpha() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let mut image = RgbaImage::new(3, 2);
        image.put_pixel(0, 0, Rgba([10, 128, 250, 255]));
        image.put_pixel(1, 0, Rgba([10, 128, 250, 7]));
        image.put_pixel(2, 1, Rgba([255, 255, 255, 0]));
        image.save(path("a.png")).unwrap();
        let cut_out = photo(path("a.png"), 3, 2);
        assert_eq!(one(&cut_out, 1), [[10, 128, 250, 255], [10, 128, 250, 7], [0; 4], [0; 4], [0; 4], [0; 4]]);
        // A mask goes before alpha.
        GrayImage::from_raw(3, 2, vec![0, 255, 51, 255, 255, 0]).unwrap().save(path("mask.png")).unwrap();
        let masked = Photo { mask: Some(path("mask.png")), ..cut_out };
        let expected = [[0; 4], [10, 128, 250, 255], [0, 0, 0, 51], [0, 0, 0, 255], [0, 0, 0, 255], [0; 4]];
        assert_eq!(one(&masked, 1), expected);
        // Where masks mean nothing, what is mostly covered by them is not known, and the rest is whole.
        let ignoring = PictureSettings { masks: Masks::Ignore, ..PictureSettings::default() };
        let picture = pictures(std::slice::from_ref(&masked), &ignoring).unwrap().next().unwrap().unwrap();
        let opaque = |r: u8, g: u8, b: u8| u32::from_le_bytes([r, g, b, 255]);
        let black = opaque(0, 0, 0);
        assert_eq!(picture.pixels, [UNKNOWN, opaque(10, 128, 250), UNKNOWN, black, black, UNKNOWN]);
        // White and black make half the light, which is 188 of 255 in sRGB; a third column is cut off.
        let mut image = RgbImage::new(3, 2);
        [(0, 0), (1, 1)].iter().for_each(|(x, y)| image.put_pixel(*x, *y, Rgb([255; 3])));
        image.save(path("b.png")).unwrap();
        assert_eq!(one(&photo(path("b.png"), 3, 2), 1)[..2], [[255; 4], [0, 0, 0, 255]]);
        assert_eq!(one(&photo(path("b.png"), 3, 2), 2), [[188, 188, 188, 255]]);
    }

    /// If this failed, photos would be turned that the capture's program did not turn, or not turned that it did, and nothing would fit.
    #[test]
    fn exif_turns_what_fits_only_turned() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        RgbImage::from_fn(24, 16, |x, y| Rgb([10 * x as u8, 15 * y as u8, 90])).save(path("a.jpg")).unwrap();
        std::fs::write(path("b.jpg"), with_exif(&std::fs::read(path("a.jpg")).unwrap(), QUARTER)).unwrap();
        let orientation = |name: &str| {
            let mut decoder = image::ImageReader::open(path(name)).unwrap().into_decoder().unwrap();
            image::ImageDecoder::orientation(&mut decoder).unwrap()
        };
        assert_ne!(orientation("a.jpg"), orientation("b.jpg"));
        assert_eq!(one(&photo(path("b.jpg"), 24, 16), 1), one(&photo(path("a.jpg"), 24, 16), 1));
        // Orientation 6: the stored image's left column is the top row, from the bottom up.
        let stored = one(&photo(path("a.jpg"), 24, 16), 1);
        let upright = one(&photo(path("b.jpg"), 16, 24), 1);
        assert!((0..24 * 16).all(|i| upright[i] == stored[(15 - i % 16) * 24 + i / 16]));
        assert!(all(&[photo(path("a.jpg"), 16, 24)], 1).remove(0).is_err(), "no EXIF data say how to turn it");
    }

    fn noisy(path: &Path, width: u32, height: u32, seed: u32) {
        let pixel = |x: u32, y: u32| Rgb([(x * 7 + seed) as u8, (y * 5 + 3 * seed) as u8, (x * y + seed) as u8]);
        RgbImage::from_fn(width, height, pixel).save(path).unwrap();
    }

    /// If this failed, one damaged photo would spoil others or pass unnoticed, or photos be mistaken for each other.
    #[test]
    fn a_damaged_photo_is_an_error_at_its_place() {
        let folder = tempfile::tempdir().unwrap();
        let photos: Vec<Photo> = (0..12)
            .map(|i| {
                let path = folder.path().join(format!("{i:02}.{}", if i % 2 == 0 { "jpg" } else { "png" }));
                noisy(&path, 40 + i, 30, i);
                let mut photo = photo(path, 40 + i, 30);
                photo.distortion.radial[0] = 0.01 * f64::from(i % 3);
                photo
            })
            .collect();
        let broken = photos[4].image.clone().unwrap();
        let bytes = std::fs::read(&broken).unwrap();
        std::fs::write(&broken, &bytes[..bytes.len() / 2]).unwrap();
        let pictures = all(&photos, 1);
        for (i, picture) in pictures.iter().enumerate() {
            match picture {
                Ok(picture) => assert_eq!((picture.index, picture.width), (i, 40 + i as u32)),
                Err(error) => assert!(i == 4 && error.to_string().contains("04.jpg"), "{error}"),
            }
        }
        assert!(pictures[4].is_err());
        let alone =
            super::pictures(&photos[5..], &PictureSettings { threads: 1, memory: 1, ..PictureSettings::default() })
                .unwrap();
        for (alone, picture) in alone.zip(&pictures[5..]) {
            assert_eq!(alone.unwrap().pixels, picture.as_ref().unwrap().pixels);
        }
    }

    /// If this failed, a lens that cannot have taken a photo would leave a test that every model passes, with no error at all.
    #[test]
    fn a_photo_of_which_its_lens_leaves_nothing_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        noisy(&path, 40, 30, 1);
        let mut taken = photo(path, 40, 30);
        assert!(all(std::slice::from_ref(&taken), 1)[0].is_ok());
        // Folds over within a hundredth of the focal length, of which the picture, beside the axis, shows nothing.
        taken.distortion.radial[0] = -1e4;
        taken.camera.intrinsics.principal = [-400.0, 15.0];
        let error = all(&[taken], 1).remove(0).unwrap_err().to_string();
        assert!(error.contains("a.png") && error.contains("nothing is left") && error.contains("lens"), "{error}");
    }

    /// If this failed, a dry run would promise memory that the pictures do not have, or cameras would not fit the pictures.
    #[test]
    fn sizes_are_known_beforehand() {
        let folder = tempfile::tempdir().unwrap();
        let photos: Vec<Photo> = (0..3)
            .map(|i| {
                let path = folder.path().join(format!("{i}.png"));
                noisy(&path, 41 + i, 30, i);
                Photo {
                    distortion: Distortion { radial: [0.1; 6], ..Distortion::default() },
                    ..photo(path, 41 + i, 30)
                }
            })
            .collect();
        for shrink in [1, 2, 3, 50] {
            let pictures: Vec<Picture> = all(&photos, shrink).into_iter().map(Result::unwrap).collect();
            let bytes: usize = pictures.iter().map(|picture| 4 * picture.pixels.len()).sum();
            assert_eq!(picture_bytes(&photos, shrink), bytes as u64);
            for (picture, camera) in pictures.iter().zip(cameras(&photos, shrink)) {
                let Intrinsics { width, height, .. } = camera.intrinsics;
                assert_eq!((picture.width, picture.height), (width, height));
            }
        }
    }
}

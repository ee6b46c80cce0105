//! Depth maps that lie beside a capture, of LiDAR or of a learnt model, and how sure each depth is: `NAME.png` (16 bits, millimetres, as
//! Polycam exports those of ARKit) or `NAME.npy` (float32 or float64, in the capture's units), along the optical axis, for the photo NAME.jpg.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::codecs::png::PngDecoder;
use image::{ColorType, ImageDecoder, Limits};

use super::photos::files;
use super::{npy, read_file};
use crate::error::{Error, Result};

/// Folders of Polycam's raw export, under that of the capture.
const POLYCAM: &str = "keyframes/depth";
/// The folder of confidence beside one of depths.
const CONFIDENCE: &str = "confidence";
/// Metres of a step in a PNG.
const MILLIMETRE: f32 = 1e-3;
/// Bytes that a decoded PNG takes at most.
const LARGEST: u64 = 1 << 30;

/// Where depth maps are, and which of their depths count.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMaps {
    /// The folder of depths.
    pub folder: PathBuf,
    /// The folder of confidence maps; without one all depths count.
    pub confidence: Option<PathBuf>,
    /// Least confidence of a depth that counts, in the maps' own values; none for a value that follows from the maps.
    pub min_confidence: Option<f64>,
}

impl DepthMaps {
    /// The maps in a folder, with the confidence in the folder of that name beside it, where there is one.
    pub fn new(folder: PathBuf) -> Self {
        let confidence = folder.with_file_name(CONFIDENCE);
        Self { confidence: Some(confidence).filter(|beside| beside.is_dir()), folder, min_confidence: None }
    }

    /// The maps that a capture of Polycam brings along; none where it is of another kind, or was taken without LiDAR.
    pub fn of_capture(capture: &Path) -> Option<Self> {
        let folder = capture.join(POLYCAM);
        let holds_any = std::fs::read_dir(&folder).is_ok_and(|mut entries| entries.next().is_some());
        holds_any.then(|| Self::new(folder))
    }

    /// The depth map of a photo by its name.
    pub fn depth_of(&self, name: &str) -> Option<PathBuf> {
        file_of(&self.folder, name)
    }

    /// The confidence map of a photo by its name.
    pub fn confidence_of(&self, name: &str) -> Option<PathBuf> {
        file_of(self.confidence.as_deref()?, name)
    }
}

fn file_of(folder: &Path, name: &str) -> Option<PathBuf> {
    let path = files::within(folder, name)?;
    ["npy", "png"].into_iter().map(|extension| path.with_extension(extension)).find(|file| file.is_file())
}

/// Numbers by pixel, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    /// Pixels in a row.
    pub width: u32,
    /// Rows of pixels.
    pub height: u32,
    /// The numbers.
    pub values: Vec<f32>,
    /// Whether they are whole numbers of a PNG.
    pub is_png: bool,
}

impl Raster {
    /// The number at a place in shares of width and height.
    pub fn at(&self, [x, y]: [f64; 2]) -> f32 {
        let pixel = |share: f64, side: u32| ((share * f64::from(side)) as u32).min(side - 1) as usize;
        self.values[pixel(y, self.height) * self.width as usize + pixel(x, self.width)]
    }
}

/// Depths of a file, in metres where it is a PNG; 0 where it has none (zero or less, or not finite).
///
/// # Errors
/// Where the file is neither a PNG of 16 bits and one channel nor a NumPy array of two axes, or is damaged.
pub fn depths(path: &Path, bytes: &[u8]) -> Result<Raster> {
    let mut raster = raster(path, bytes, true)?;
    let unit = if raster.is_png { MILLIMETRE } else { 1.0 };
    for depth in &mut raster.values {
        *depth = if *depth > 0.0 && depth.is_finite() { unit * *depth } else { 0.0 };
    }
    Ok(raster)
}

/// Confidence of a file; least where it is not a number.
///
/// # Errors
/// As [`depths`], but a PNG may have 8 bits.
pub fn confidence(path: &Path, bytes: &[u8]) -> Result<Raster> {
    let mut raster = raster(path, bytes, false)?;
    raster.values.iter_mut().filter(|value| value.is_nan()).for_each(|value| *value = f32::NEG_INFINITY);
    Ok(raster)
}

/// As [`depths`], of the file at a path.
///
/// # Errors
/// As [`depths`], and where it cannot be read.
pub fn read_depths(path: &Path) -> Result<Raster> {
    depths(path, &read_file(path)?)
}

/// As [`confidence`], of the file at a path.
///
/// # Errors
/// As [`confidence`], and where it cannot be read.
pub fn read_confidence(path: &Path) -> Result<Raster> {
    confidence(path, &read_file(path)?)
}

fn raster(path: &Path, bytes: &[u8], wide: bool) -> Result<Raster> {
    let refuse = |what: String| Error::input(path, what);
    if bytes.starts_with(npy::SIGNATURE) {
        let array = npy::parse(path, bytes)?;
        let sides: Vec<usize> = array.shape.iter().copied().filter(|side| *side != 1).collect();
        let sides: Option<[u32; 2]> = match sides[..] {
            [height, width] => height.try_into().ok().zip(width.try_into().ok()).map(|(height, width)| [height, width]),
            _ => None,
        };
        let Some([height, width]) = sides.filter(|sides| !sides.contains(&0)) else {
            return Err(refuse(format!(
                "its shape is {:?} and not that of one picture; save one array a photo",
                array.shape
            )));
        };
        return Ok(Raster { width, height, values: array.values().map(|value| value as f32).collect(), is_png: false });
    }
    let damaged = |e: image::ImageError| {
        refuse(format!("it is neither a whole PNG ({e}) nor a NumPy file; write it again as one of these"))
    };
    let mut limits = Limits::default();
    limits.max_alloc = Some(LARGEST);
    let decoder = PngDecoder::with_limits(Cursor::new(bytes), limits).map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    let size = match decoder.color_type() {
        ColorType::L16 => 2,
        ColorType::L8 if !wide => 1,
        other => {
            let bits = if wide { "16 bits (millimetres)" } else { "8 or 16 bits" };
            return Err(refuse(format!(
                "its pixels are {other:?} where a map has one channel of {bits}; export it so"
            )));
        }
    };
    let total = decoder.total_bytes();
    if total > LARGEST {
        return Err(refuse(format!("{width} x {height} pixels are too many; shrink it")));
    }
    let mut pixels = vec![0; total as usize];
    decoder.read_image(&mut pixels).map_err(damaged)?;
    let value = |pixel: &[u8]| match *pixel {
        [a, b] => f32::from(u16::from_ne_bytes([a, b])),
        _ => f32::from(pixel[0]),
    };
    Ok(Raster { width, height, values: pixels.chunks_exact(size).map(value).collect(), is_png: true })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png(image: impl Into<image::DynamicImage>) -> Vec<u8> {
        let mut bytes = Vec::new();
        image.into().write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
        bytes
    }

    /// If this failed, depths of LiDAR would be in other units, or rows and columns of a model's array swapped.
    #[test]
    fn depths_of_both_formats() {
        let path = Path::new("a");
        let image = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(3, 2, vec![0, 1250, 2, 3, 4, 65_535]).unwrap();
        let read = depths(path, &png(image)).unwrap();
        assert_eq!((read.width, read.height, read.at([0.5, 0.0]), read.at([1.0, 1.0])), (3, 2, 1.25, 65.535));
        let values = [1.5, f64::NAN, -1.0, f64::INFINITY, 0.0, 7.0];
        for shape in [&[2, 3][..], &[1, 2, 3], &[2, 3, 1]] {
            let read = depths(path, &npy::written(shape, &values)).unwrap();
            assert_eq!((read.width, read.height, &read.values[..]), (3, 2, &[1.5, 0.0, 0.0, 0.0, 0.0, 7.0][..]));
        }
        let sure = image::GrayImage::from_raw(3, 1, vec![0, 127, 255]).unwrap();
        assert_eq!(confidence(path, &png(sure.clone())).unwrap().values, [0.0, 127.0, 255.0]);
        assert_eq!(confidence(path, &npy::written(&[2, 3], &values)).unwrap().values[1], f32::NEG_INFINITY);
        for (bytes, fragment) in [
            (png(sure), "16 bits"),
            (png(image::RgbImage::new(2, 2)), "one channel"),
            (npy::written(&[6], &values), "one picture"),
            (npy::written(&[2, 3, 4], &[0.0; 24]), "one picture"),
            (b"text".to_vec(), "neither a whole PNG"),
        ] {
            let message = depths(path, &bytes).unwrap_err().to_string();
            assert!(message.contains(fragment), "{fragment:?} is not in {message}");
        }
    }

    /// If this failed, a damaged map would be read as another, or end the program.
    #[test]
    fn damaged_maps_are_refused() {
        let image = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(2, 2, vec![1, 2, 3, 4]).unwrap();
        for whole in [png(image), npy::written(&[2, 2], &[1.0; 4])] {
            assert!(depths(Path::new("a"), &whole).is_ok());
            // A PNG's end mark may be missing.
            for length in 0..whole.len() - 16 {
                assert!(depths(Path::new("a"), &whole[..length]).is_err(), "{length} bytes");
            }
        }
    }

    /// If this failed, maps would be given to other photos, or a name in a capture would lead out of the folder.
    #[test]
    fn maps_are_found_by_the_names_of_photos() {
        let folder = tempfile::tempdir().unwrap();
        let depth = folder.path().join(POLYCAM);
        std::fs::create_dir_all(depth.join("sub")).unwrap();
        std::fs::write(depth.join("sub/7.png"), "").unwrap();
        let maps = DepthMaps::of_capture(folder.path()).unwrap();
        assert_eq!(
            (maps.depth_of("sub/7.jpg"), maps.confidence_of("sub/7.jpg")),
            (Some(depth.join("sub/7.png")), None)
        );
        assert_eq!(maps.depth_of("../depth/sub/7.jpg"), None);
        std::fs::create_dir(folder.path().join("keyframes/confidence")).unwrap();
        assert!(DepthMaps::of_capture(folder.path()).unwrap().confidence.is_some());
        assert_eq!(DepthMaps::of_capture(&depth), None);
    }
}

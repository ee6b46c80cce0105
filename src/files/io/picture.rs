//! Pictures out: PNG with 8 bits a channel, OpenEXR with single precision.

use std::io::Cursor;
use std::path::{Component, Path};

use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, WritableImage};
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use crate::scene::camera::Camera;
use crate::scene::colour::decoded;
use crate::{Error, Result};

/// Formats of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Format {
    /// 8 bits a channel, sRGB; colours are not multiplied by alpha.
    Png,
    /// 32-bit float, linear, as compositing programs take it; colours are multiplied by alpha.
    Exr,
}

impl Format {
    /// The extension of its files.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Exr => "exr",
        }
    }
}

/// A file of a picture whose pixels, in rows of `width` from the top left, are sRGB colours, not multiplied by alpha, and
/// alpha. Alpha is left out unless it is requested; colours are then taken as opaque.
///
/// # Errors
/// Where the pixels make no whole rows.
pub fn colours(format: Format, width: u32, pixels: &[[f32; 4]], with_alpha: bool) -> Result<Vec<u8>> {
    match format {
        Format::Png => png(width, pixels, with_alpha),
        Format::Exr => {
            let linear = |channel: usize| {
                let of = |pixel: &[f32; 4]| {
                    let scale = if with_alpha { f64::from(pixel[3]) } else { 1.0 };
                    (scale * decoded(f64::from(pixel[channel]))) as f32
                };
                pixels.iter().map(of).collect()
            };
            let mut channels = vec![("R", linear(0)), ("G", linear(1)), ("B", linear(2))];
            if with_alpha {
                channels.push(("A", pixels.iter().map(|pixel| pixel[3]).collect()));
            }
            exr(width, channels)
        }
    }
}

/// An OpenEXR file of depths, in rows of `width` from the top left, as the channel Z.
///
/// # Errors
/// Where the depths make no whole rows.
pub fn depths(width: u32, depths: Vec<f32>) -> Result<Vec<u8>> {
    exr(width, vec![("Z", depths)])
}

/// An OpenEXR file of linear colours that are multiplied by alpha, in rows of `width` from the top left.
///
/// # Errors
/// Where the pixels make no whole rows.
pub fn linear(width: u32, pixels: &[[f32; 4]], with_alpha: bool) -> Result<Vec<u8>> {
    let names = if with_alpha { &["R", "G", "B", "A"][..] } else { &["R", "G", "B"] };
    exr(width, planes(names, pixels))
}

/// An OpenEXR file of unit vectors in the world, as the channels X, Y and Z, in rows of `width` from the top left.
///
/// # Errors
/// Where the pixels make no whole rows.
pub fn normals(width: u32, vectors: &[[f32; 4]]) -> Result<Vec<u8>> {
    exr(width, planes(&["X", "Y", "Z"], vectors))
}

/// The first components of pixels, a channel for each.
fn planes<'a>(names: &[&'a str], pixels: &[[f32; 4]]) -> Vec<(&'a str, Vec<f32>)> {
    let plane = |(c, name): (usize, &&'a str)| (*name, pixels.iter().map(|pixel| pixel[c]).collect());
    names.iter().enumerate().map(plane).collect()
}

/// A PNG file of grey values with 8 bits, in rows of `width` pixels from the top left.
///
/// # Errors
/// Where the values make no whole rows.
pub fn grey(width: u32, values: &[u8]) -> Result<Vec<u8>> {
    png_of(width, values.len(), values, ExtendedColorType::L8)
}

fn png(width: u32, pixels: &[[f32; 4]], with_alpha: bool) -> Result<Vec<u8>> {
    let (channels, kind) = if with_alpha { (4, ExtendedColorType::Rgba8) } else { (3, ExtendedColorType::Rgb8) };
    let byte = |value: &f32| (255.0 * value.clamp(0.0, 1.0)).round() as u8;
    let bytes: Vec<u8> = pixels.iter().flat_map(|pixel| pixel[..channels].iter().map(byte)).collect();
    png_of(width, pixels.len(), &bytes, kind)
}

/// A PNG file of 8-bit red, green and blue side by side, in rows of `width` pixels from the top left.
///
/// # Errors
/// Where the bytes make no whole rows.
pub(crate) fn rgb(width: u32, bytes: &[u8]) -> Result<Vec<u8>> {
    png_of(width, bytes.len() / 3, bytes, ExtendedColorType::Rgb8)
}

fn png_of(width: u32, pixels: usize, bytes: &[u8], kind: ExtendedColorType) -> Result<Vec<u8>> {
    let [_, height] = size(width, pixels)?;
    let mut file = Vec::new();
    PngEncoder::new(&mut file)
        .write_image(bytes, width, height as u32, kind)
        .map_err(|e| Error::request(format!("a picture cannot be written as PNG: {e}")))?;
    Ok(file)
}

/// An OpenEXR file of channels with names, all of the same length.
fn exr(width: u32, channels: Vec<(&str, Vec<f32>)>) -> Result<Vec<u8>> {
    let size = size(width, channels.first().map_or(0, |channel| channel.1.len()))?;
    let channel = |(name, values)| AnyChannel::new(name, FlatSamples::F32(values));
    let channels = AnyChannels::sort(channels.into_iter().map(channel).collect());
    let mut file = Cursor::new(Vec::new());
    // Lines deflated sixteen at a time: which every reader of the format supports.
    Image::from_encoded_channels((size[0], size[1]), Encoding::SMALL_LOSSLESS, channels)
        .write()
        .non_parallel()
        .to_buffered(&mut file)
        .map_err(|e| Error::request(format!("a picture cannot be written as OpenEXR: {e}")))?;
    Ok(file.into_inner())
}

/// Width and height of so many pixels in rows of `width`.
fn size(width: u32, pixels: usize) -> Result<[usize; 2]> {
    let width = width as usize;
    if width == 0 || pixels == 0 || !pixels.is_multiple_of(width) {
        return Err(Error::request(format!("{pixels} pixels make no picture with rows of {width}")));
    }
    Ok([width, pixels / width])
}

/// The name of a camera's picture: its own without the extension of its image, and without what leads out of a folder; none where nothing is left.
pub fn stem(name: &str) -> Option<String> {
    let inside = |part: Component<'_>| match part {
        Component::Normal(part) => Some(part.to_string_lossy().into_owned()),
        _ => None,
    };
    let mut stem = Path::new(name).components().filter_map(inside).collect::<Vec<_>>().join("/");
    // What follows the dot of 0.5 is no extension.
    let is_kind = |extension: &&str| extension.starts_with(|first: char| first.is_ascii_alphabetic());
    let extension = Path::new(&stem).extension().and_then(|extension| extension.to_str()).filter(is_kind);
    stem.truncate(stem.len() - extension.map_or(0, |extension| extension.len() + 1));
    (!stem.is_empty()).then_some(stem)
}

/// Reports which cameras have names that lead out of a folder, and are called otherwise where pictures of them are written.
pub fn renamed(cameras: &[Camera]) -> Option<String> {
    let leads_out = |part: Component<'_>| !matches!(part, Component::Normal(_) | Component::CurDir);
    let odd = |camera: &&Camera| Path::new(&camera.name).components().any(leads_out);
    let mut odd = cameras.iter().filter(odd);
    let first = odd.next()?;
    let more = match odd.count() {
        0 => String::new(),
        more => format!(", and {more} more in the same way"),
    };
    let name = stem(&first.name).unwrap_or_default();
    Some(format!("names that lead out of the folder are shortened: {:?} is written as {name:?}{more}", first.name))
}

#[cfg(test)]
mod tests {
    use exr::prelude::read_first_flat_layer_from_file;

    use super::*;

    const PIXELS: [[f32; 4]; 6] = [
        [0.0, 0.5, 1.0, 1.0],
        [0.2, 0.4, 0.6, 0.5],
        [1.5, 0.0, 0.0, 0.25],
        [0.0; 4],
        [1.0, 1.0, 1.0, 0.004],
        [0.1, 0.2, 0.3, 1.0],
    ];

    /// Name and values of every channel, and the size.
    fn channels(file: &[u8]) -> (Vec<(String, Vec<f32>)>, [usize; 2]) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        std::fs::write(&path, file).unwrap();
        let image = read_first_flat_layer_from_file(path).unwrap();
        let channel = |channel: &AnyChannel<FlatSamples>| {
            let FlatSamples::F32(values) = &channel.sample_data else { panic!("not single precision") };
            (channel.name.to_string(), values.clone())
        };
        let size = image.layer_data.size;
        (image.layer_data.channel_data.list.iter().map(channel).collect(), [size.0, size.1])
    }

    /// If this failed, a PNG would have darkened edges, or rows and columns exchanged.
    #[test]
    fn png_holds_the_nearest_bytes() {
        let read =
            |with_alpha| image::load_from_memory(&colours(Format::Png, 3, &PIXELS, with_alpha).unwrap()).unwrap();
        let (opaque, alpha) = (read(false).into_rgb8(), read(true).into_rgba8());
        assert_eq!((opaque.dimensions(), alpha.dimensions()), ((3, 2), (3, 2)));
        assert_eq!(opaque.get_pixel(1, 0).0, [51, 102, 153]);
        assert_eq!(alpha.get_pixel(1, 0).0, [51, 102, 153, 128]);
        assert_eq!(alpha.get_pixel(2, 0).0, [255, 0, 0, 64]);
        assert_eq!(alpha.get_pixel(1, 1).0, [255, 255, 255, 1]);
    }

    /// If this failed, a compositing program would show the picture too bright, or its edges twice as faint.
    #[test]
    fn exr_is_linear_and_multiplied_by_alpha() {
        let (found, size) = channels(&colours(Format::Exr, 3, &PIXELS, true).unwrap());
        assert_eq!(size, [3, 2]);
        assert_eq!(found.iter().map(|channel| channel.0.as_str()).collect::<Vec<_>>(), ["A", "B", "G", "R"]);
        assert_eq!(found[0].1, PIXELS.map(|pixel| pixel[3]));
        // 0.5 in sRGB is 0.21404 of the light, 0.2 is 0.03310.
        assert!((found[2].1[0] - 0.21404).abs() < 1e-5 && (found[3].1[1] - 0.5 * 0.03310).abs() < 1e-5, "{found:?}");
        // Brighter than white stays so.
        assert!(found[3].1[2] > 0.5 && found[3].1[3] == 0.0, "{found:?}");
        let (opaque, _) = channels(&colours(Format::Exr, 3, &PIXELS, false).unwrap());
        assert_eq!(opaque.len(), 3);
        assert!((opaque[2].1[1] - 0.03310).abs() < 1e-5, "{opaque:?}");
    }

    /// If this failed, depths would lose digits or their place.
    #[test]
    fn depths_are_kept_to_the_bit() {
        let values = vec![0.0, 1.5, 1e-30, 123_456.79, 7.0, 0.1];
        assert_eq!(channels(&depths(2, values.clone()).unwrap()), (vec![("Z".to_owned(), values)], [2, 3]));
        assert!(depths(4, vec![0.0; 6]).is_err() && depths(0, Vec::new()).is_err());
    }
}

//! One photo from its files to linear values.

use std::io::Cursor;
use std::path::Path;
use std::sync::LazyLock;

use half::f16;
use image::metadata::Orientation;
use image::{ColorType, ImageDecoder, ImageFormat, ImageReader};

use super::{Channels, DecodeSettings, Decoded, Encoded, Precision, Values};
use crate::error::{Error, Result};
use crate::files::photos::orientation::{self, quarter_turn};
use crate::files::photos::{Header, Photo};
use crate::scene::colour;

/// Most bytes that one image may decode to; a header that announces more is taken for damaged.
const LARGEST: u64 = 4 << 30;

/// Pixels as they are stored: 8 or 16 bits per sample, one to four samples.
struct Stored {
    width: u32,
    height: u32,
    samples: usize,
    wide: bool,
    bytes: Vec<u8>,
}

/// Bytes that decoding a photo takes at its height besides the result; none where that is unknown.
pub(super) fn estimate(photo: &Photo) -> Option<u64> {
    let k = &photo.camera.intrinsics;
    let file = |path: &Path| -> Option<u64> {
        let header = Header::read(path).ok()?;
        // The bytes of the file are there twice: here and in the decoder.
        let length = 2 * std::fs::metadata(path).ok()?.len();
        // A photo on its side is there twice while it is turned.
        let copies = if (header.width, header.height) == (k.height, k.width) { 2 } else { 1 };
        let per_pixel = copies * header.pixel_bytes + header.scratch_bytes;
        Some(length + u64::from(header.width) * u64::from(header.height) * per_pixel)
    };
    let image = file(photo.image.as_deref()?)?;
    let mask = photo.mask.as_deref().map_or(Some(0), file)?;
    // The mask is held while the image is decoded, reduced to a byte per pixel.
    let held = if mask > 0 { u64::from(k.width) * u64::from(k.height) } else { 0 };
    Some((image + held).max(mask + held))
}

/// Decodes a photo and its mask.
pub(super) fn decode(photo: &Photo, index: usize, settings: &DecodeSettings) -> Result<Decoded> {
    let Some(path) = &photo.image else {
        let name = &photo.camera.name;
        return Err(Error::input(name, "this photo has no image file; bring it back or leave the photo out"));
    };
    check_announced(path)?;
    let k = &photo.camera.intrinsics;
    let mask = photo.mask.as_deref().map(|mask| coverage(mask, k.width, k.height)).transpose()?;
    let stored = read(path)?;
    let stored = match quarter_turn(path, (stored.width, stored.height), k) {
        Some(orientation) => stored.turned(orientation),
        None => stored,
    };
    if (stored.width, stored.height) != (k.width, k.height) {
        let what = format!(
            "the image is {} x {} pixels and its camera {} x {}; read the capture again",
            stored.width, stored.height, k.width, k.height
        );
        return Err(Error::input(path, what));
    }
    let shrink = settings.shrink;
    let (width, height) = ((k.width / shrink).max(1), (k.height / shrink).max(1));
    let has_mask = mask.is_some() || stored.has_alpha();
    let channels = if settings.channels == Channels::Rgb { 3 } else { 1 };
    let pixels = width as usize * height as usize;
    let mut out = match settings.precision {
        Precision::Byte => Values::Byte(Vec::with_capacity(channels * pixels)),
        Precision::Half => Values::Half(Vec::with_capacity(channels * pixels)),
        Precision::Single => Values::Single(Vec::with_capacity(channels * pixels)),
    };
    // To linear and back would give the same bytes, slowly.
    let is_stored = shrink == 1 && !stored.wide;
    let mut covered = Vec::with_capacity(if has_mask { pixels } else { 0 });
    for y in 0..height {
        for x in 0..width {
            let (colour, cover) = stored.block(x, y, shrink, mask.as_deref());
            let [r, g, b] = colour;
            match (&mut out, settings.channels) {
                (Values::Byte(values), Channels::Rgb) if is_stored => values.extend(stored.bytes(x, y)),
                (Values::Byte(values), Channels::Rgb) => values.extend(colour.map(byte)),
                (Values::Byte(values), Channels::Luma) => values.push(byte(luma(r, g, b))),
                (Values::Single(values), Channels::Rgb) => values.extend(colour),
                (Values::Half(values), Channels::Rgb) => values.extend(colour.map(f16::from_f32)),
                (Values::Single(values), Channels::Luma) => values.push(luma(r, g, b)),
                (Values::Half(values), Channels::Luma) => values.push(f16::from_f32(luma(r, g, b))),
            }
            if has_mask {
                covered.push((255.0 * cover).round() as u8);
            }
        }
    }
    Ok(Decoded { index, width, height, values: out, mask: has_mask.then_some(covered) })
}

/// 8-bit sRGB of a linear value.
pub(super) fn byte(linear: f32) -> u8 {
    (255.0 * colour::encoded(f64::from(linear))).round() as u8
}

/// Decodes an image file to 8-bit colours as they are stored.
pub(super) fn encoded(path: &Path, background: [u8; 3]) -> Result<Encoded> {
    let stored = read(path)?;
    let (width, height) = (stored.width, stored.height);
    let value = |i: usize, c: usize| {
        let colour = stored.sample(i, if stored.samples > 2 { c } else { 0 });
        let cover = if stored.has_alpha() { stored.sample(i, stored.samples - 1) } else { 1.0 };
        (255.0 * cover * colour + (1.0 - cover) * f64::from(background[c])).round() as u8
    };
    let pixels = (0..width as usize * height as usize).flat_map(|i| [0, 1, 2].map(|c| value(i, c))).collect();
    Ok(Encoded { width, height, pixels })
}

fn luma(r: f32, g: f32, b: f32) -> f32 {
    let [red, green, blue] = colour::LUMA.as_vec3().to_array();
    red * r + green * g + blue * b
}

/// The mask file as a byte per pixel of its image, 255 for white; of another size, the nearest pixel is taken.
fn coverage(path: &Path, width: u32, height: u32) -> Result<Vec<u8>> {
    let stored = read(path)?;
    let bytes = if stored.wide { 2 } else { 1 };
    let step = stored.samples * bytes;
    let mut mask = Vec::with_capacity(width as usize * height as usize);
    for y in 0..u64::from(height) {
        let row = y * u64::from(stored.height) / u64::from(height) * u64::from(stored.width);
        for x in 0..u64::from(width) {
            let at = (row + x * u64::from(stored.width) / u64::from(width)) as usize * step;
            // Of two bytes in native order, the one that counts.
            let high = if stored.wide && cfg!(target_endian = "little") { 1 } else { 0 };
            mask.push(stored.bytes[at + high]);
        }
    }
    Ok(mask)
}

/// Linear values of 8-bit sRGB.
static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|v| colour::linear(v as u8) as f32));

impl Stored {
    /// The image after a quarter turn.
    fn turned(self, orientation: Orientation) -> Self {
        let (width, height) = (self.height, self.width);
        let step = self.samples * if self.wide { 2 } else { 1 };
        let mut bytes = Vec::with_capacity(self.bytes.len());
        for y in 0..height {
            for x in 0..width {
                let [u, v] = orientation::source(orientation, [x, y], [self.width, self.height]);
                let at = (v as usize * self.width as usize + u as usize) * step;
                bytes.extend(&self.bytes[at..at + step]);
            }
        }
        Self { width, height, bytes, ..self }
    }

    /// Whether the last sample is alpha.
    fn has_alpha(&self) -> bool {
        self.samples.is_multiple_of(2)
    }

    /// Sample `c` of pixel `i`, in [0, 1] as it is stored.
    fn sample(&self, i: usize, c: usize) -> f64 {
        let at = i * self.samples + c;
        match self.wide {
            true => f64::from(u16::from_ne_bytes([self.bytes[2 * at], self.bytes[2 * at + 1]])) / 65_535.0,
            false => f64::from(self.bytes[at]) / 255.0,
        }
    }

    fn linear(&self, i: usize, c: usize) -> f32 {
        match self.wide {
            true => colour::decoded(self.sample(i, c)) as f32,
            false => LINEAR[usize::from(self.bytes[i * self.samples + c])],
        }
    }

    /// The bytes of a pixel of an image with 8 bits.
    fn bytes(&self, x: u32, y: u32) -> [u8; 3] {
        let at = (y as usize * self.width as usize + x as usize) * self.samples;
        match self.samples {
            1 | 2 => [self.bytes[at]; 3],
            _ => [0, 1, 2].map(|c| self.bytes[at + c]),
        }
    }

    /// The mean linear colour of a block of pixels and how much of it is covered, both in [0, 1]. Colours are weighted by
    /// coverage, which comes from the mask or else from alpha, unless nothing is covered.
    fn block(&self, x: u32, y: u32, shrink: u32, mask: Option<&[u8]>) -> ([f32; 3], f32) {
        let (mut weighted, mut plain, mut cover, mut count) = ([0f32; 3], [0f32; 3], 0f32, 0f32);
        for v in (y * shrink)..((y + 1) * shrink).min(self.height) {
            for u in (x * shrink)..((x + 1) * shrink).min(self.width) {
                let i = v as usize * self.width as usize + u as usize;
                let colour = match self.samples {
                    1 | 2 => [self.linear(i, 0); 3],
                    _ => [0, 1, 2].map(|c| self.linear(i, c)),
                };
                let weight = match mask {
                    Some(mask) => f32::from(mask[i]) / 255.0,
                    None if self.has_alpha() => self.sample(i, self.samples - 1) as f32,
                    None => 1.0,
                };
                for c in 0..3 {
                    weighted[c] += weight * colour[c];
                    plain[c] += colour[c];
                }
                cover += weight;
                count += 1.0;
            }
        }
        if cover > 0.0 { (weighted.map(|v| v / cover), cover / count) } else { (plain.map(|v| v / count), 0.0) }
    }
}

/// Reads an image file.
fn read(path: &Path) -> Result<Stored> {
    let refuse = |what: String| undecodable(path, &what);
    let bytes = std::fs::read(path).map_err(|source| Error::io(path, source))?;
    let mut reader =
        ImageReader::new(Cursor::new(&bytes[..])).with_guessed_format().map_err(|e| refuse(e.to_string()))?;
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(LARGEST);
    reader.limits(limits);
    if reader.format() == Some(ImageFormat::Jpeg) && !is_whole_jpeg(&bytes) {
        return Err(refuse("the file is cut short".into()));
    }
    let decoder = reader.into_decoder().map_err(|e| refuse(e.to_string()))?;
    let (width, height) = decoder.dimensions();
    let (samples, wide) = match decoder.color_type() {
        ColorType::L8 => (1, false),
        ColorType::La8 => (2, false),
        ColorType::Rgb8 => (3, false),
        ColorType::Rgba8 => (4, false),
        ColorType::L16 => (1, true),
        ColorType::La16 => (2, true),
        ColorType::Rgb16 => (3, true),
        ColorType::Rgba16 => (4, true),
        other => return Err(refuse(format!("its colours are {other:?}"))),
    };
    let total = decoder.total_bytes();
    check_size(path, width, height, total)?;
    let mut pixels = vec![0; total as usize];
    decoder.read_image(&mut pixels).map_err(|e| refuse(e.to_string()))?;
    Ok(Stored { width, height, samples, wide, bytes: pixels })
}

/// Refuses an image whose header announces too much, before anything is made of its size. Headers that cannot be read are left to
/// the decoder.
fn check_announced(path: &Path) -> Result<()> {
    let Ok(Header { width, height, pixel_bytes, .. }) = Header::read(path) else { return Ok(()) };
    check_size(path, width, height, u64::from(width) * u64::from(height) * pixel_bytes)
}

fn check_size(path: &Path, width: u32, height: u32, bytes: u64) -> Result<()> {
    match bytes > LARGEST {
        true => Err(undecodable(path, &format!("{width} x {height} pixels are too many"))),
        false => Ok(()),
    }
}

fn undecodable(path: &Path, what: &str) -> Error {
    Error::input(path, format!("the image cannot be decoded ({what}); bring back a whole one"))
}

/// Whether a JPEG's scan is followed by its end mark: decoders fill what a cut file lacks with grey, silently.
fn is_whole_jpeg(bytes: &[u8]) -> bool {
    let mut at = 2;
    // Segments before the scan, which may hold a whole thumbnail, are skipped by their length.
    while let Some(&[0xff, marker, high, low]) = bytes.get(at..at + 4) {
        match marker {
            0xff => at += 1,
            0xda => return bytes[at..].windows(2).any(|mark| mark == [0xff, 0xd9]),
            _ => at += 2 + usize::from(u16::from_be_bytes([high, low])),
        }
    }
    false
}

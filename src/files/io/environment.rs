//! Light from far around, as Radiance .hdr files have it: equirectangular, the top row is up (+Y).

use std::io::Cursor;
use std::path::Path;

use glam::Vec3;
use image::codecs::hdr::HdrDecoder;
use image::{ImageDecoder, Limits};

use crate::error::{Error, Result};
use crate::scene::model::Environment;

/// Texels that are kept: sixteen bytes each must fit in what devices show a shader of one buffer.
const MAX_TEXELS: u64 = 1 << 22;
/// Pixels of the largest file that is decoded.
const MAX_PIXELS: u64 = 1 << 28;
/// Radiance above this is taken for damage.
const BRIGHTEST: f32 = 1e9;

/// Reads an environment map. One with more than 2^22 pixels is halved until it has fewer, which the notes report.
///
/// # Errors
/// [`Error::Input`] where the file is no Radiance picture, damaged, not twice as wide as high, or black.
pub fn read_environment(path: &Path, notes: &mut Vec<String>) -> Result<Environment> {
    parse_environment(path, &super::read_file(path)?, notes)
}

/// As [`read_environment`], of the bytes of a file; messages name it by `path`.
///
/// # Errors
/// As [`read_environment`]'s.
pub fn parse_environment(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Environment> {
    let refuse = |what: String| Err(Error::input(path, what));
    let wanted = "give an equirectangular Radiance .hdr file";
    let decoder = match HdrDecoder::new(Cursor::new(bytes)) {
        Ok(decoder) => decoder,
        Err(e) => return refuse(format!("this is no environment map ({e}); {wanted}")),
    };
    let (width, height) = decoder.dimensions();
    let pixels = u64::from(width) * u64::from(height);
    if u64::from(width) != 2 * u64::from(height) || height < 2 {
        return refuse(format!(
            "a picture of {width} x {height} is no environment map, which is twice as wide as high; {wanted}"
        ));
    }
    // Run lengths make a row of pixels from four bytes for each 128.
    if pixels > MAX_PIXELS || pixels / 64 > bytes.len() as u64 {
        return refuse(format!("it announces {width} x {height} pixels and has {} bytes; {wanted}", bytes.len()));
    }
    let mut decoder = decoder;
    let mut limits = Limits::default();
    limits.max_alloc = Some(16 * MAX_PIXELS);
    let mut values = vec![0f32; 3 * pixels as usize];
    let read = decoder.set_limits(limits).and_then(|()| decoder.read_image(bytemuck::cast_slice_mut(&mut values)));
    if let Err(e) = read {
        return refuse(format!("the environment map is damaged ({e}); copy or export it again"));
    }
    let light = |c: &[f32]| Vec3::new(c[0], c[1], c[2]);
    if values.iter().any(|v| !(0.0..=BRIGHTEST).contains(v)) {
        return refuse("the environment map has radiance that no light has; export it again".into());
    }
    if values.iter().all(|v| *v == 0.0) {
        return refuse("the environment map is black; give one with light in it".into());
    }
    let mut map = Environment { width, height, radiance: values.chunks_exact(3).map(light).collect() };
    while map.radiance.len() as u64 > MAX_TEXELS {
        map = map.halved();
    }
    if map.width < width {
        notes.push(format!("the environment map was shrunk from {width} to {} pixels", map.width));
    }
    Ok(map)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A map of 4 x 2 pixels whose bytes of red, green, blue and exponent are `pixels`.
    fn map(size: &str, pixels: &[[u8; 4]]) -> Vec<u8> {
        let mut bytes = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n").into_bytes();
        pixels.iter().for_each(|pixel| bytes.extend(pixel));
        bytes
    }

    fn read(bytes: &[u8]) -> Result<Environment> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.hdr");
        std::fs::write(&path, bytes).unwrap();
        read_environment(&path, &mut Vec::new())
    }

    /// If this failed, light would come from elsewhere, or with another strength, than the map specifies.
    #[test]
    fn radiance_is_what_the_file_says() {
        let mut pixels = [[0, 0, 0, 0]; 8];
        pixels[1] = [128, 64, 0, 130];
        let read = read(&map("-Y 2 +X 4", &pixels)).unwrap();
        // The exponent 130 means 4 = 2^(130 - 128), in units of 256.
        assert_eq!((read.width, read.height, read.radiance[0]), (4, 2, Vec3::ZERO));
        assert!((read.radiance[1] - Vec3::new(2.0, 1.0, 0.0)).length() < 0.02, "{:?}", read.radiance[1]);
    }

    /// If this failed, a photo, or a broken file, would silently light a scene.
    #[test]
    fn what_is_no_environment_map_is_refused() {
        let says = |bytes: &[u8]| read(bytes).unwrap_err().to_string();
        assert!(says(b"\x89PNG\r\n\x1a\n and more").contains("no environment map"));
        assert!(says(&map("-Y 2 +X 2", &[[1, 1, 1, 128]; 4])).contains("twice as wide as high"));
        assert!(says(&map("-Y 2 +X 4", &[[0; 4]; 8])).contains("is black"));
        assert!(says(&map("-Y 2 +X 4", &[[9, 9, 9, 128]; 3])).contains("damaged"));
        assert!(says(&map("-Y 20000 +X 40000", &[[9, 9, 9, 128]; 3])).contains("announces"));
        // Twice this height is 0 in 32 bits.
        assert!(says(&map("-Y 2147483648 +X 0", &[[9, 9, 9, 128]; 3])).contains("no environment map"));
    }
}

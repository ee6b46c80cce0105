//! How sharp photos are: the variance of the Laplacian (Pech-Pacheco et al., "Diatom autofocusing in brightfield
//! microscopy", 2000), at a reduced size, so that noise counts little and sizes compare.

use image::GrayImage;
use image::imageops::FilterType;

use crate::files::photos::PhotoSet;
use crate::files::photos::decode::{Channels, DecodeSettings, Decoded, Decoder, Precision};
use crate::{Error, Result};

/// Longer side of the reduced image, in pixels.
const SIDE: u32 = 512;

/// Sharpness of each photo.
///
/// # Errors
/// Where an image is missing or cannot be decoded.
pub fn of_photos(set: &PhotoSet) -> Result<Vec<f64>> {
    let missing: Vec<&str> =
        set.photos.iter().filter(|photo| photo.image.is_none()).map(|photo| photo.camera.name.as_str()).collect();
    if let Some(first) = missing.first() {
        let what = format!(
            "{} images are missing or cannot be read, {first} the first; sharpness needs them all",
            missing.len()
        );
        return Err(Error::input(&set.path, what));
    }
    let decoding = DecodeSettings { channels: Channels::Luma, precision: Precision::Half, ..DecodeSettings::default() };
    Decoder::new(&set.photos, decoding)?.map(|photo| Ok(of_photo(&photo?))).collect()
}

fn of_photo(photo: &Decoded) -> f64 {
    // Square roots, as an eye sees it: near enough to the curve of the file.
    let eight_bit = |luma: f32| (255.0 * luma.clamp(0.0, 1.0).sqrt()).round() as u8;
    let pixels = photo.width as usize * photo.height as usize;
    let bytes: Vec<u8> = (0..pixels).map(|i| eight_bit(photo.values.linear(i))).collect();
    // One value a pixel: the image has its declared size.
    let grey = GrayImage::from_raw(photo.width, photo.height, bytes).unwrap_or_default();
    let longer = grey.width().max(grey.height()).max(1);
    let side = |length: u32| (u64::from(length) * u64::from(SIDE) / u64::from(longer)).max(1) as u32;
    if longer <= SIDE {
        return of_image(&grey);
    }
    of_image(&image::imageops::resize(&grey, side(grey.width()), side(grey.height()), FilterType::Triangle))
}

/// Variance of the four-neighbour Laplacian over the inside of an image.
pub fn of_image(image: &GrayImage) -> f64 {
    let at = |x: u32, y: u32| f64::from(image.get_pixel(x, y)[0]);
    let inside =
        (1..image.height().saturating_sub(1)).flat_map(|y| (1..image.width().saturating_sub(1)).map(move |x| (x, y)));
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for (x, y) in inside {
        let value = at(x - 1, y) + at(x + 1, y) + at(x, y - 1) + at(x, y + 1) - 4.0 * at(x, y);
        count += 1.0;
        sum += value;
        squares += value * value;
    }
    if count > 0.0 { squares / count - (sum / count) * (sum / count) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, blurred photos would be preferred.
    #[test]
    fn a_blurred_image_is_less_sharp() {
        let sharp = GrayImage::from_fn(64, 64, |x, y| image::Luma([if (x / 4 + y / 4) % 2 == 0 { 40 } else { 200 }]));
        let blurred = image::imageops::blur(&sharp, 2.0);
        assert!(of_image(&sharp) > 4.0 * of_image(&blurred));
        assert_eq!(of_image(&GrayImage::new(2, 2)), 0.0);
    }
}

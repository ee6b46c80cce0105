//! What the tests of image metrics share: images made from whole numbers, the same in every language.
#![allow(dead_code, reason = "each test binary uses a part")]

use camsplat::splats::image_metrics::Rgb8;

/// An image that owns its bytes.
#[derive(Clone)]
pub struct Image {
    pub width: u32,
    pub height: u32,
    pub pixels: Vec<u8>,
}

impl Image {
    /// Slopes with edges and, on top, noise below `amount` (at most 56).
    pub fn new(width: u32, height: u32, seed: u64, amount: u64) -> Self {
        let value = |i: u64| {
            let noise = (((i * 2_654_435_761 + seed * 2_246_822_519) % (1 << 32)) >> 24) % amount;
            let (x, y) = (i / 3 % u64::from(width), i / 3 / u64::from(width));
            ((5 * x + 3 * y + 50 * (i % 3)) % 200 + noise) as u8
        };
        let pixels = (0..3 * u64::from(width) * u64::from(height)).map(value).collect();
        Self { width, height, pixels }
    }

    /// As metrics take it.
    pub fn view(&self) -> Rgb8<'_> {
        Rgb8::new(self.width, self.height, &self.pixels).unwrap()
    }

    /// As the bytes of a PNG file.
    pub fn png(&self) -> Vec<u8> {
        let image = image::RgbImage::from_raw(self.width, self.height, self.pixels.clone()).unwrap();
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner()
    }
}

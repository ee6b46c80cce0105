//! How like two images are: PSNR, SSIM, LPIPS.
//!
//! All take 8-bit colours as they are stored (sRGB-encoded): what a viewer and other programs see. PSNR and SSIM run on
//! the host in f64 and are those of scikit-image; [`Lpips`] runs on the device.

pub mod convolve;
pub mod lpips;
pub mod lpips_distance;
pub mod lpips_planes;
pub mod max_pool;
pub mod network;
mod ssim;
pub mod weights;

pub use lpips::Lpips;
pub use network::Network;
pub use ssim::{SSIM_WINDOW, ssim};
pub use weights::Weights;

use serde::Serialize;

use crate::{Error, Result};

/// An image of 8-bit sRGB-encoded colours: red, green and blue side by side, row by row from the top left.
#[derive(Clone, Copy, Debug)]
pub struct Rgb8<'a> {
    width: u32,
    height: u32,
    pixels: &'a [u8],
}

impl<'a> Rgb8<'a> {
    /// An image of three bytes a pixel.
    ///
    /// # Errors
    /// Where there are no pixels, or not three bytes for each.
    pub fn new(width: u32, height: u32, pixels: &'a [u8]) -> Result<Self> {
        let count = u64::from(width) * u64::from(height);
        if count == 0 || count.checked_mul(3) != Some(pixels.len() as u64) {
            let what = format!("{} bytes are no image of {width} x {height} pixels; give three a pixel", pixels.len());
            return Err(Error::request(what));
        }
        Ok(Self { width, height, pixels })
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The bytes.
    pub fn pixels(&self) -> &'a [u8] {
        self.pixels
    }

    /// Refuses another image of another size.
    fn check_size(&self, other: &Self) -> Result<()> {
        let (a, b) = ((self.width, self.height), (other.width, other.height));
        if a == b {
            return Ok(());
        }
        let what = format!("the images have {} x {} and {} x {} pixels; give them one size", a.0, a.1, b.0, b.1);
        Err(Error::request(what))
    }
}

/// Peak signal-to-noise ratio in decibels, over all pixels and channels, of a peak of 255; infinite where the images
/// are the same.
///
/// # Errors
/// Where the images differ in size.
pub fn psnr(a: &Rgb8, b: &Rgb8) -> Result<f64> {
    a.check_size(b)?;
    let squares = a.pixels.iter().zip(b.pixels).map(|(a, b)| u64::from(a.abs_diff(*b)).pow(2));
    let mean = squares.sum::<u64>() as f64 / a.pixels.len() as f64;
    Ok(10.0 * (255.0 * 255.0 / mean).log10())
}

/// How like an image is to its reference. In JSON a PSNR that is infinite is `null`, and what was not measured is left out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ImageMetrics {
    /// Peak signal-to-noise ratio in decibels; infinite where the images are the same.
    pub psnr: f64,
    /// Mean structural similarity, 1 where the images are the same.
    pub ssim: f64,
    /// LPIPS with AlexNet, 0 where the images are the same.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lpips_alex: Option<f64>,
    /// LPIPS with VGG16, 0 where the images are the same.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lpips_vgg: Option<f64>,
}

impl ImageMetrics {
    /// Means over images. One PSNR that is infinite makes the mean infinite; a LPIPS that some image lacks has no mean.
    pub fn mean(images: impl ExactSizeIterator<Item = Self> + Clone) -> Self {
        let mean = |of: fn(&Self) -> f64| images.clone().map(|image| of(&image)).sum::<f64>() / images.len() as f64;
        let every = |of: fn(&Self) -> Option<f64>| {
            let sum = images.clone().map(|image| of(&image)).sum::<Option<f64>>();
            sum.map(|sum| sum / images.len() as f64)
        };
        Self {
            psnr: mean(|image| image.psnr),
            ssim: mean(|image| image.ssim),
            lpips_alex: every(|image| image.lpips_alex),
            lpips_vgg: every(|image| image.lpips_vgg),
        }
    }
}

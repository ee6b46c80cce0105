//! How good pictures of the model are where no photo was trained on.

use std::sync::Arc;

use super::pictures::{Picture, UNKNOWN};
use super::record::{Quality, TestView};
use crate::metrics::image::weights::Weights;
use crate::metrics::image::{Lpips, Rgb8, psnr, ssim};
use crate::parallel::in_parallel;
use crate::vulkan::Context;
use crate::{Error, Result};

/// Makes the picture of a view, over the background of the tests.
pub type Camera<'c> = &'c mut dyn FnMut(usize) -> Result<Vec<[f32; 4]>>;

/// Photos to test with, as 8-bit colours over the background.
pub struct Tests {
    /// Names of the photos.
    pub names: Vec<String>,
    pictures: Vec<Picture>,
    /// The view of the first; the others follow.
    first: usize,
    background: [f32; 3],
    lpips: Option<Lpips>,
}

/// A test view as it is and as it should be, 8-bit sRGB.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pair {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// What the model looks like.
    pub rendered: Vec<u8>,
    /// The photo.
    pub reference: Vec<u8>,
}

impl Tests {
    /// Photos to test with, over a background; their views are those from `first` on.
    pub fn new(names: Vec<String>, pictures: Vec<Picture>, first: usize, background: [f32; 3]) -> Self {
        Self { names, pictures, first, background, lpips: None }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.pictures.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.pictures.is_empty()
    }

    /// Test view `i`. What the photo does not show is black in both.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn pair(&self, camera: Camera, i: usize) -> Result<Pair> {
        let Picture { width, height, pixels, .. } = &self.pictures[i];
        let background = self.background.map(f64::from);
        let seen = camera(self.first + i)?;
        let byte = |value: f64| (255.0 * value.clamp(0.0, 1.0)).round() as u8;
        let mut pair = Pair { width: *width, height: *height, rendered: Vec::new(), reference: Vec::new() };
        for (stored, seen) in pixels.iter().zip(seen) {
            let [r, g, b, a] = stored.to_le_bytes().map(|v| f64::from(v) / 255.0);
            for (c, value) in [r, g, b].into_iter().enumerate() {
                let known = *stored != UNKNOWN;
                pair.rendered.push(if known { byte(seen[c].into()) } else { 0 });
                pair.reference.push(if known { byte(a * value + (1.0 - a) * background[c]) } else { 0 });
            }
        }
        Ok(pair)
    }

    /// Every `step`-th test view with its metrics, in their order; `look` sees each pair. LPIPS is measured where `lpips` says so
    /// and the picture is large enough for it.
    ///
    /// # Errors
    /// Where the device fails or has not enough memory.
    pub fn evaluate(
        &mut self,
        context: &Arc<Context>,
        camera: Camera,
        step: usize,
        lpips: bool,
        mut look: impl FnMut(&TestView, &Pair) -> Result<()>,
    ) -> Result<Vec<TestView>> {
        if lpips && self.lpips.is_none() && !self.is_empty() {
            self.lpips = Some(Lpips::new(context, &Weights::alex()?)?);
        }
        let chosen: Vec<usize> = (0..self.len()).step_by(step.max(1)).collect();
        let mut views = Vec::new();
        // As many at once as there are threads to measure them.
        for some in chosen.chunks(16) {
            let mut measured: Vec<(Pair, Result<Quality>)> = Vec::new();
            for &i in some {
                measured.push((self.pair(camera, i)?, Ok(Quality::default())));
            }
            in_parallel(&mut measured, 1, |_, part| {
                for (pair, quality) in part {
                    *quality = compared(pair);
                }
            });
            for (&i, (pair, quality)) in some.iter().zip(measured) {
                let mut quality = quality?;
                if lpips && let Some(network) = &mut self.lpips {
                    let least = network.network().least();
                    if pair.width.min(pair.height) >= least {
                        let distance = network.distance(&pair.of(&pair.rendered)?, &pair.of(&pair.reference)?);
                        quality.lpips = match distance {
                            // No reason to lose a model.
                            Err(Error::OutOfMemory { .. }) => None,
                            distance => Some(distance?),
                        };
                    }
                }
                let view = TestView { name: self.names[i].clone(), quality };
                look(&view, &pair)?;
                views.push(view);
            }
        }
        Ok(views)
    }
}

impl Pair {
    fn of<'a>(&self, pixels: &'a [u8]) -> Result<Rgb8<'a>> {
        Rgb8::new(self.width, self.height, pixels)
    }
}

/// PSNR and SSIM; of pictures too small for its window, SSIM counts as 1 where they are the same and 0 else.
fn compared(pair: &Pair) -> Result<Quality> {
    let (rendered, reference) = (pair.of(&pair.rendered)?, pair.of(&pair.reference)?);
    let same = if pair.rendered == pair.reference { 1.0 } else { 0.0 };
    let ssim = if pair.width.min(pair.height) < 11 { same } else { ssim(&rendered, &reference)? };
    Ok(Quality { psnr: psnr(&rendered, &reference)?, ssim, lpips: None })
}

/// Means over test views; a LPIPS that one lacks has no mean.
pub fn mean(views: &[TestView]) -> Quality {
    let n = views.len().max(1) as f64;
    let of = |value: fn(&Quality) -> f64| views.iter().map(|view| value(&view.quality)).sum::<f64>() / n;
    let lpips = views.iter().map(|view| view.quality.lpips).sum::<Option<f64>>().map(|sum| sum / n);
    Quality { psnr: of(|q| q.psnr), ssim: of(|q| q.ssim), lpips: lpips.filter(|_| !views.is_empty()) }
}

//! Quality of the model's pictures on held-out test views.

use std::borrow::Borrow;
use std::ops::ControlFlow;
use std::sync::Arc;

use glam::DVec3;

use super::record::{Quality, TestView};
use crate::engine::parallel::{beside, mapped};
use crate::engine::vulkan::Context;
use crate::files::photos::Photo;
use crate::splats::data::pictures::{self, Picture, UNKNOWN};
use crate::splats::exposure::Exposure;
use crate::splats::image_metrics::weights::Weights;
use crate::splats::image_metrics::{Lpips, Rgb8, SSIM_WINDOW, psnr, ssim};
use crate::{Error, Result};

/// Makes the picture of a view, over the background of the tests; it gets the pixels of the photo too.
pub type Camera<'c> = &'c mut dyn FnMut(usize, &[u32]) -> Result<Vec<[f32; 4]>>;

/// Test views that are evaluated during training.
const FEW: usize = 16;
/// Pictures that are measured at once, and bytes of these as they are drawn, 16 a pixel. As many are drawn meanwhile.
const AT_ONCE: usize = 16;
const BYTES: u64 = 1 << 28;

/// Photos to test with. Few of them are kept decoded; all of them are decoded again in the end.
pub struct Tests {
    photos: Vec<Photo>,
    settings: pictures::PictureSettings,
    few: Vec<Picture>,
    /// The view of the first photo; the others follow.
    first: usize,
    background: [f32; 3],
    /// Whether each half of a picture is shown with the exposure that fits the other half best.
    exposure: bool,
    /// CRC-32 of all pixels.
    pixels: u32,
    lpips: Option<Lpips>,
}

/// Of the photos to test with every so many, at most [`FEW`]: those that are kept decoded.
pub(super) fn few(photos: &[Photo]) -> impl Iterator<Item = &Photo> {
    photos.iter().step_by(step(photos.len()))
}

fn step(photos: usize) -> usize {
    photos.div_ceil(FEW).max(1)
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
    /// Photos to test with, over a background, with an exposure fitted where `exposure` is set; their views are those from `first` on. All
    /// are decoded once, to find those that are damaged. `observe` receives how many have been, and may stop it.
    ///
    /// # Errors
    /// Where a photo cannot be decoded.
    pub fn new(
        photos: &[Photo],
        settings: pictures::PictureSettings,
        first: usize,
        background: [f32; 3],
        exposure: bool,
        mut observe: impl FnMut(usize) -> ControlFlow<()>,
    ) -> Result<Self> {
        let step = step(photos.len());
        let (mut few, mut pixels) = (Vec::new(), crc32fast::Hasher::new());
        for (i, picture) in pictures::pictures(photos, &settings)?.enumerate() {
            let picture = picture?;
            pixels.update(bytemuck::cast_slice(&picture.pixels));
            if i % step == 0 {
                few.push(picture);
            }
            Error::unless_stopped(observe(i + 1))?;
        }
        let (photos, pixels) = (photos.to_vec(), pixels.finalize());
        Ok(Self { photos, settings, few, first, background, exposure, pixels, lpips: None })
    }

    /// CRC-32 of all pixels.
    pub fn fingerprint(&self) -> u32 {
        self.pixels
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.photos.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.photos.is_empty()
    }

    /// Some of the test views, or all of them, with their metrics, in their order. `keep` gets the place of each with its pictures, on
    /// several threads and in any order; then `look` gets it with its metrics, in order. LPIPS is measured of all, where the picture is
    /// large enough for it.
    ///
    /// # Errors
    /// Where a photo cannot be decoded any more, `keep` fails, or the device fails or has not enough memory.
    pub fn evaluate(
        &mut self,
        context: &Arc<Context>,
        camera: Camera,
        all: bool,
        keep: impl Fn(usize, &Pair) -> Result<()> + Sync,
        look: impl FnMut(&TestView, Pair),
    ) -> Result<Vec<TestView>> {
        if all && self.lpips.is_none() && !self.is_empty() {
            self.lpips = match Lpips::new(context, &Weights::alex()?) {
                // No reason to discard a model.
                Err(Error::OutOfMemory { .. }) => None,
                network => Some(network?),
            };
        }
        let mut lpips = self.lpips.take();
        let measured = match all {
            true => {
                let pictures = pictures::pictures(&self.photos, &self.settings)?;
                self.measure(camera, pictures, lpips.as_mut(), keep, look)
            }
            false => self.measure(camera, self.few.iter().map(Ok), lpips.as_mut(), keep, look),
        };
        self.lpips = lpips;
        measured
    }

    /// Measures test views, as many at a time as fit in memory; LPIPS with a network. While the host compares and keeps what has been
    /// drawn, the device draws the next and compares the last with the network.
    fn measure<P: Borrow<Picture> + Send + Sync>(
        &self,
        camera: Camera,
        mut pictures: impl Iterator<Item = Result<P>>,
        mut lpips: Option<&mut Lpips>,
        keep: impl Fn(usize, &Pair) -> Result<()> + Sync,
        mut look: impl FnMut(&TestView, Pair),
    ) -> Result<Vec<TestView>> {
        let largest = self
            .photos
            .iter()
            .map(|photo| 4 * pictures::picture_bytes(std::slice::from_ref(photo), self.settings.shrink));
        let at_once = (BYTES / largest.max().unwrap_or(0).max(1)).clamp(1, AT_ONCE as u64) as usize;
        let mut draw = || -> Result<Vec<(P, Vec<[f32; 4]>)>> {
            let some = pictures.by_ref().take(at_once);
            let mut draw = |picture: P| {
                let Picture { index, pixels, .. } = picture.borrow();
                camera(self.first + index, pixels).map(|drawn| (picture, drawn))
            };
            some.map(|picture| picture.and_then(&mut draw)).collect()
        };
        let compare = |(picture, drawn): &(P, Vec<[f32; 4]>)| {
            let index = picture.borrow().index;
            let shown = self.exposure.then(|| exposed(drawn, picture.borrow(), self.background));
            let pair = pair(shown.as_deref().unwrap_or(drawn), picture.borrow(), self.background);
            keep(index, &pair)?;
            compared(&pair).map(|quality| (TestView { name: self.photos[index].camera.name.clone(), quality }, pair))
        };
        let mut views = Vec::new();
        let (mut drawn, mut last): (_, Vec<(TestView, Pair)>) = (draw()?, Vec::new());
        while !(drawn.is_empty() && last.is_empty()) {
            let (compared, next) = beside(
                || mapped(&drawn, |_, drawn| compare(drawn)),
                || {
                    if let Some(network) = lpips.as_deref_mut() {
                        for (TestView { quality, .. }, pair) in &mut last {
                            quality.lpips = distance(network, pair)?;
                        }
                    }
                    draw()
                },
            );
            drawn = next?;
            for (view, pair) in last {
                look(&view, pair);
                views.push(view);
            }
            last = compared.into_iter().collect::<Result<_>>()?;
        }
        Ok(views)
    }
}

/// The picture with the exposure of its photo, which nobody has learnt: each half is shown with that which fits the other half best, so that
/// no pixel is compared with the exposure that was fitted to it.
fn exposed(rendered: &[[f32; 4]], picture: &Picture, background: [f32; 3]) -> Vec<[f32; 4]> {
    let behind = DVec3::from(background.map(f64::from));
    let width = picture.width as usize;
    let is_left = |i: usize| i % width < width / 2;
    let drawn = |i: usize| {
        let [r, g, b, left] = rendered[i].map(f64::from);
        (DVec3::new(r, g, b), left)
    };
    let fitted = |to_left: bool| {
        let known = (0..picture.pixels.len()).filter(|i| is_left(*i) == to_left && picture.pixels[*i] != UNKNOWN);
        let pixels = known.map(|i| {
            let [r, g, b, a] = picture.pixels[i].to_le_bytes().map(|v| f64::from(v) / 255.0);
            let (colour, left) = drawn(i);
            (colour, left, behind.lerp(DVec3::new(r, g, b), a))
        });
        Exposure::fit(pixels, behind)
    };
    let [of_left, of_right] = [true, false].map(fitted);
    let shown = |i: usize| {
        let (colour, left) = drawn(i);
        let shown = if is_left(i) { of_right } else { of_left }.shown(colour, left, behind);
        [shown.x, shown.y, shown.z, left].map(|v| v as f32)
    };
    (0..picture.pixels.len()).map(shown).collect()
}

/// A test view as it is and as it should be, of what the model looks like there. What the photo does not show is black in both.
fn pair(rendered: &[[f32; 4]], picture: &Picture, background: [f32; 3]) -> Pair {
    let Picture { width, height, pixels, .. } = picture;
    let background = background.map(f64::from);
    let byte = |value: f64| (255.0 * value.clamp(0.0, 1.0)).round() as u8;
    let bytes = || Vec::with_capacity(3 * pixels.len());
    let mut pair = Pair { width: *width, height: *height, rendered: bytes(), reference: bytes() };
    for (stored, rendered) in pixels.iter().zip(rendered) {
        let [r, g, b, a] = stored.to_le_bytes().map(|v| f64::from(v) / 255.0);
        for (c, value) in [r, g, b].into_iter().enumerate() {
            let known = *stored != UNKNOWN;
            pair.rendered.push(if known { byte(rendered[c].into()) } else { 0 });
            pair.reference.push(if known { byte(a * value + (1.0 - a) * background[c]) } else { 0 });
        }
    }
    pair
}

/// LPIPS of a pair; none where it is too small for the network, or the device has no room for it.
fn distance(network: &mut Lpips, pair: &Pair) -> Result<Option<f64>> {
    if pair.width.min(pair.height) < network.network().least() {
        return Ok(None);
    }
    match network.distance(&pair.of(&pair.rendered)?, &pair.of(&pair.reference)?) {
        // No reason to discard a model.
        Err(Error::OutOfMemory { .. }) => Ok(None),
        distance => distance.map(Some),
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
    let ssim = if pair.width.min(pair.height) < SSIM_WINDOW { same } else { ssim(&rendered, &reference)? };
    Ok(Quality { psnr: psnr(&rendered, &reference)?, ssim, ..Quality::default() })
}

/// Means over test views; a LPIPS that one lacks has no mean.
pub fn mean(views: &[TestView]) -> Quality {
    let n = views.len().max(1) as f64;
    let of = |value: fn(&Quality) -> f64| views.iter().map(|view| value(&view.quality)).sum::<f64>() / n;
    let every = |value: fn(&Quality) -> Option<f64>| {
        let sum = views.iter().map(|view| value(&view.quality)).sum::<Option<f64>>();
        sum.filter(|_| !views.is_empty()).map(|sum| sum / n)
    };
    let (lpips, lpips_vgg) = (every(|q| q.lpips), every(|q| q.lpips_vgg));
    Quality { psnr: of(|q| q.psnr), ssim: of(|q| q.ssim), lpips, lpips_vgg }
}

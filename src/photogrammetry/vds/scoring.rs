//! From a capture to scored points: proxy, photos, exposures, scores.

use std::sync::Arc;

use glam::DVec3;

use super::observe::Scene;
use super::pyramid::Pyramid;
use super::vdsf::Vdsf;
use super::{Estimate, estimate};
use crate::engine::vulkan::Context;
use crate::files::photos::PhotoSet;
use crate::files::photos::decode::{self, Channels, Decoded, Decoder, Precision};
use crate::scene::camera::Pose;
use crate::scene::proxy::{Occluder, Orientation, Proxy};
use crate::scene::region::Shape;
use crate::scene::surface::Surface;
use crate::visibility::exposure;
use crate::{Error, Result};

/// Points drawn on triangles where no number is given.
pub const DEFAULT_POINTS: usize = 100_000;

/// How to score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoringSettings {
    /// Points; where no number is given, all of a cloud, [`DEFAULT_POINTS`] on triangles.
    pub points: Option<usize>,
    /// Seed of the points.
    pub seed: u64,
    /// Whether the photos' exposures are evened out.
    pub exposure: bool,
    /// Bytes that photos being decoded take together; see [`decode::DecodeSettings::memory`].
    pub memory: u64,
    /// Whether a photo that cannot be decoded is left out; else it is an error.
    pub skip_unreadable: bool,
    /// Which side of the surface is photographed, where that is known; else the cameras determine it.
    pub orientation: Option<Orientation>,
}

/// Progress events.
pub enum ScoringEvent<'e> {
    /// Photos done.
    Done(usize),
    /// A photo was left out, and why.
    Skipped(&'e Error),
}

impl Default for ScoringSettings {
    fn default() -> Self {
        Self {
            points: None,
            seed: 0,
            exposure: true,
            memory: decode::DecodeSettings::default().memory,
            skip_unreadable: false,
            orientation: None,
        }
    }
}

/// Scores points of `surface`, which is in the frame of `capture`, from the photos of the capture that have an image.
/// `observe` receives progress events.
///
/// # Errors
/// An invalid surface; an image that cannot be read; no point that two photos see; a device that fails.
pub fn run(
    context: &Arc<Context>,
    capture: &PhotoSet,
    surface: &Surface,
    settings: &ScoringSettings,
    mut observe: impl FnMut(ScoringEvent<'_>),
) -> Result<Estimate> {
    let capture = capture.clone().filtered(|photo| photo.image.is_some());
    let photos = &capture.photos;
    if photos.len() < 2 {
        let what = "fewer than two photos have an image; give the folder with the images";
        return Err(Error::input(&capture.path, what));
    }
    let decoding = decode::DecodeSettings {
        channels: Channels::Luma,
        precision: Precision::Single,
        memory: settings.memory,
        ..decode::DecodeSettings::default()
    };
    // First of all, so that the first photos are there when the points are.
    let mut decoder = Decoder::new(photos, decoding)?;
    let proxy = proxy(&capture, surface, settings.orientation)?;
    let points = proxy.sample(settings.points.unwrap_or_else(|| standard(&proxy)), settings.seed, 0);
    let scene = Scene::new(&proxy, &points, photos)?.with_tracks(&points, &capture);
    let mut done = 0;
    let observations = scene.observe(context, || {
        loop {
            observe(ScoringEvent::Done(done));
            done += 1;
            match decoder.next() {
                Some(Err(error)) if settings.skip_unreadable => observe(ScoringEvent::Skipped(&error)),
                decoded => return decoded.map(|decoded| decoded.map(pyramid)).transpose(),
            }
        }
    })?;
    let vdsf = Vdsf::embedded();
    let estimate = estimate(&points, photos, &observations, settings.exposure, |v| vdsf.apply(v));
    if estimate.variances.iter().all(Option::is_none) {
        let what = "no point of the surface is seen in two photos or more; check that both are in one frame";
        return Err(Error::input(&capture.path, what));
    }
    Ok(estimate)
}

/// Points where no number is given.
fn standard(proxy: &Proxy) -> usize {
    match &proxy.occluder {
        Occluder::Triangles(_) => DEFAULT_POINTS,
        Occluder::Discs(discs) => discs.len() - proxy.buried.iter().filter(|buried| **buried).count(),
    }
}

/// A decoded photo with its place, as it is sampled.
fn pyramid(photo: Decoded) -> (usize, Pyramid) {
    let luma = photo.values.into_linear();
    (photo.index, Pyramid::new(photo.width, photo.height, &luma, photo.mask.as_deref()))
}

/// The proxy of a surface that photos look at. By default: from outside where they surround it, else from inside.
fn proxy(capture: &PhotoSet, surface: &Surface, orientation: Option<Orientation>) -> Result<Proxy> {
    let poses: Vec<Pose> = capture.photos.iter().map(|photo| photo.camera.pose).collect();
    let positions = surface.positions();
    let middle = positions.iter().sum::<DVec3>() / positions.len().max(1) as f64;
    let orientation = orientation.unwrap_or_else(|| match Shape::around_cameras(&poses) {
        Some(_) => Orientation::Outward(middle),
        None => Orientation::Inward(middle),
    });
    let around = matches!(orientation, Orientation::Outward(_));
    let mut proxy = Proxy::new(surface, orientation)?;
    if let Surface::Points(points) = surface
        && around
        && !points.oriented
        && points.toward_cameras.is_empty()
    {
        exposure::expose(&mut proxy)?;
    }
    Ok(proxy)
}

//! The range of depths in a capture whose cameras look at no one place, such as a walk: from its sparse points, or else by stereo itself.

use std::sync::Arc;

use glam::DVec3;

use super::{Reconstruction, StereoOptions, choose_photos, reconstruct};
use crate::engine::vulkan::Context;
use crate::files::photos::PhotoSet;
use crate::scene::camera::Camera;
use crate::{Error, Result};

/// Points in the pictures that determine a range at least.
const FEWEST: usize = 100;
/// Part of the depths that is left out at each end, and what is allowed beyond the rest.
const TAIL: f64 = 0.02;
const BELOW: f64 = 0.7;
const BEYOND: f64 = 1.5;
/// Largest depths that are tried, in distances between neighbouring cameras; each with a near end of a twelfth. Together they hold all
/// depths at which neighbours look at a thing from 3 to 60 degrees apart.
const TRIED: [f64; 3] = [4.0, 12.0, 36.0];
const SPAN: f64 = 12.0;
/// How finely they are tried: the picture's longest side and the planes.
const RESOLUTION: u32 = 160;
const HYPOTHESES: u32 = 96;

/// Smallest and largest depth in the capture's units.
///
/// # Errors
/// Where neither points nor stereo show any, and where the device fails.
pub fn of_walk(context: &Arc<Context>, set: &PhotoSet, options: &StereoOptions) -> Result<[f64; 2]> {
    let cameras: Vec<Camera> = choose_photos(set, options)?.into_iter().map(|photo| photo.camera).collect();
    if let Some(range) = range(&set.points.positions, &cameras) {
        return Ok(range);
    }
    let apart = between_neighbours(&cameras);
    let mut best: Option<Reconstruction> = None;
    for far in TRIED.map(|far| far * apart) {
        let coarse = StereoOptions {
            depths: Some([far / SPAN, far]),
            resolution: RESOLUTION.min(options.resolution),
            hypotheses: HYPOTHESES,
            hull: false,
            ..options.clone()
        };
        match reconstruct(context, set, &coarse) {
            Ok(found) if best.as_ref().is_none_or(|best| found.kept > best.kept) => best = Some(found),
            // Nothing overlaps or agrees at such depths.
            Ok(_) | Err(Error::Request { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    let found = best.and_then(|found| range(&found.points.positions, &cameras));
    found.ok_or_else(|| {
        Error::request(
            "the cameras do not look at one place and stereo agrees at no depth, so that nothing says how far the scene is; give `near` and \
             `far` in the capture's units",
        )
    })
}

/// The range in which cameras see points, with something to spare; none where they see too few.
fn range(points: &[DVec3], cameras: &[Camera]) -> Option<[f64; 2]> {
    let depth = |camera: &Camera, point: DVec3| (point - camera.pose.position).dot(camera.pose.forward());
    let seen = |camera| {
        points.iter().filter(move |point| Camera::sees(camera, **point)).map(move |point| depth(camera, *point))
    };
    of_depths(cameras.iter().flat_map(seen).collect())
}

/// The range that holds most of some depths, with something to spare; none where they are too few.
pub(super) fn of_depths(mut depths: Vec<f64>) -> Option<[f64; 2]> {
    if depths.len() < FEWEST {
        return None;
    }
    depths.sort_unstable_by(f64::total_cmp);
    let tail = (TAIL * depths.len() as f64) as usize;
    let (near, far) = (BELOW * depths[tail], BEYOND * depths[depths.len() - 1 - tail]);
    (near > 0.0 && far > near && far.is_finite()).then_some([near, far])
}

/// Median distance from a camera to the nearest other that stands elsewhere.
fn between_neighbours(cameras: &[Camera]) -> f64 {
    let to_nearest = |camera: &Camera| {
        let apart = |other: &Camera| other.pose.position.distance(camera.pose.position);
        cameras.iter().map(apart).filter(|distance| *distance > 0.0).fold(f64::INFINITY, f64::min)
    };
    let mut distances: Vec<f64> = cameras.iter().map(to_nearest).filter(|distance| distance.is_finite()).collect();
    distances.sort_unstable_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied().unwrap_or(1.0)
}

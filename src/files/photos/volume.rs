//! Where the scene is: from the cameras alone, or from points.

use glam::DVec3;

use super::looked_at;
use crate::scene::bounding_sphere::bounding_sphere;
use crate::scene::camera::{Camera, Intrinsics};

/// A ball that holds what is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Volume {
    /// Its centre.
    pub centre: DVec3,
    /// Its radius.
    pub radius: f64,
}

/// The point nearest to all optical axes, where at least four fifths of the cameras look towards it.
pub(crate) fn focus(cameras: &[Camera]) -> Option<DVec3> {
    let focus = looked_at(cameras)?;
    let towards = cameras.iter().filter(|c| (focus - c.pose.position).dot(c.pose.forward()) > 0.0).count();
    (5 * towards >= 4 * cameras.len()).then_some(focus)
}

/// The ball about the [`focus`] that the cameras' pictures hold: its radius is the median over the cameras of what the longer
/// side of a picture shows at the focus, and at most nine tenths of the way to the nearest twentieth of the cameras.
pub fn around_focus(cameras: &[Camera]) -> Option<Volume> {
    let centre = focus(cameras)?;
    let distance = |camera: &Camera| (camera.pose.position - centre).length();
    let mut distances: Vec<f64> = cameras.iter().map(distance).collect();
    let mut reaches: Vec<f64> = cameras
        .iter()
        .map(|camera| {
            let Intrinsics { width, height, focal, .. } = camera.intrinsics;
            let half = (0.5 * f64::from(width) / focal[0]).max(0.5 * f64::from(height) / focal[1]);
            distance(camera) * half.atan().sin()
        })
        .collect();
    distances.sort_unstable_by(f64::total_cmp);
    reaches.sort_unstable_by(f64::total_cmp);
    let radius = reaches[reaches.len() / 2].min(0.9 * distances[distances.len() / 20]);
    Some(Volume { centre, radius })
}

/// The ball around points, less the outermost hundredth on each side of each axis.
pub(crate) fn around_points(positions: &[DVec3]) -> Option<Volume> {
    let percentiles = |axis: usize| {
        let mut values: Vec<f64> = positions.iter().map(|p| p[axis]).collect();
        values.sort_unstable_by(f64::total_cmp);
        let cut = values.len() / 100;
        Some((*values.get(cut)?, *values.get(values.len().checked_sub(1 + cut)?)?))
    };
    let [x, y, z] = [percentiles(0)?, percentiles(1)?, percentiles(2)?];
    let corner = |i: usize| {
        let side = |bit: usize, (low, high): (f64, f64)| if i >> bit & 1 == 0 { low } else { high };
        DVec3::new(side(0, x), side(1, y), side(2, z))
    };
    let (centre, radius) = bounding_sphere(&(0..8).map(corner).collect::<Vec<_>>())?;
    Some(Volume { centre, radius })
}

//! A picture of values on points: three views of them side by side.

use std::io::Cursor;

use glam::{DVec2, DVec3};
use image::{ImageFormat, Rgb, RgbImage};

use crate::io::viridis;
use crate::photos::Photo;
use crate::scene::camera::Pose;
use crate::scene::surface::Points;
use crate::{Error, Result};

/// Side of a view in pixels, and height of the scale beneath.
const SIDE: u32 = 640;
const SCALE: u32 = 24;
/// Views.
const VIEWS: usize = 3;
const BACKGROUND: Rgb<u8> = Rgb([24, 24, 28]);

/// PNG of the scores of points, dark for 1 and bright for 2, from the places of three of the photos that look from as
/// different directions as there are. The bar beneath is the scale from 1 to 2.
///
/// # Errors
/// Where the image cannot be encoded.
pub fn scores(points: &Points, photos: &[Photo]) -> Result<Vec<u8>> {
    let centre = median_position(points);
    let poses = apart(photos, centre);
    let mut image = RgbImage::from_pixel(SIDE * poses.len().max(1) as u32, SIDE + SCALE, BACKGROUND);
    for (panel, pose) in (0..).zip(&poses) {
        draw(&mut image, panel * SIDE, points, pose, centre);
    }
    let width = image.width();
    for x in 0..width {
        let colour = Rgb(viridis(x as f32 / (width - 1) as f32));
        (SIDE + 8..SIDE + SCALE).for_each(|y| image.put_pixel(x, y, colour));
    }
    let mut bytes = Cursor::new(Vec::new());
    image
        .write_to(&mut bytes, ImageFormat::Png)
        .map_err(|e| Error::request(format!("the picture of the scores cannot be encoded: {e}")))?;
    Ok(bytes.into_inner())
}

/// A place in the middle of the points, whatever stray ones do.
fn median_position(points: &Points) -> DVec3 {
    let along = |axis: usize| super::quantile(points.positions.iter().map(|p| p[axis]).collect(), 0.5);
    DVec3::new(along(0), along(1), along(2))
}

/// Poses of up to three photos: the first one, and each time the one whose direction from `centre` is farthest from those
/// taken.
fn apart(photos: &[Photo], centre: DVec3) -> Vec<Pose> {
    let direction = |pose: &Pose| (pose.position - centre).normalize_or_zero();
    let mut taken: Vec<Pose> = photos.first().map(|photo| photo.camera.pose).into_iter().collect();
    while (1..VIEWS.min(photos.len())).contains(&taken.len()) {
        let nearest = |pose: &Pose| taken.iter().map(|t| direction(t).dot(direction(pose))).fold(-1.0, f64::max);
        let poses = photos.iter().map(|photo| photo.camera.pose);
        let Some(next) = poses.min_by(|a, b| nearest(a).total_cmp(&nearest(b))) else { break };
        taken.push(next);
    }
    taken
}

/// Draws the points that face a pose into a square of the image, the far ones first; the square holds 95% of them.
fn draw(image: &mut RgbImage, left: u32, points: &Points, pose: &Pose, centre: DVec3) {
    let pose = Pose::looking(pose.position, centre - pose.position, pose.up());
    let away = pose.rotation.inverse();
    let mut seen: Vec<(f64, DVec2, f64, f32)> = Vec::new();
    for (i, position) in points.positions.iter().enumerate() {
        let p = away * (*position - pose.position);
        let facing = points.normals.get(i).is_none_or(|normal| normal.dot(pose.position - *position) > 0.0);
        if p.z > 0.0 && facing {
            let radius = points.radii.get(i).map_or(0.0, |r| f64::from(*r)) / p.z;
            seen.push((p.z, p.truncate() / p.z, radius, points.scores.get(i).copied().unwrap_or(1.0)));
        }
    }
    let reach = super::quantile(seen.iter().map(|(_, at, ..)| at.abs().max_element()).collect(), 0.95);
    let zoom = 0.5 * f64::from(SIDE) / (1.1 * reach).max(f64::MIN_POSITIVE);
    seen.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (_, at, radius, score) in seen {
        let at = zoom * at + 0.5 * f64::from(SIDE);
        let radius = (0.7 * zoom * radius).clamp(0.8, 12.0);
        let colour = Rgb(viridis(score - 1.0));
        let bound = |v: f64| v.clamp(0.0, f64::from(SIDE)) as u32;
        for y in bound(at.y - radius)..bound((at.y + radius).ceil()) {
            for x in bound(at.x - radius)..bound((at.x + radius).ceil()) {
                let off = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) - at;
                if off.length_squared() <= radius * radius {
                    image.put_pixel(left + x, y, colour);
                }
            }
        }
    }
}

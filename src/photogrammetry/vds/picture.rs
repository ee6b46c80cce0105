//! A picture of values on points: three views of them side by side.

use glam::{DVec2, DVec3};
use image::{Rgb, RgbImage};

use crate::Result;
use crate::files::io::picture;
use crate::files::photos::Photo;
use crate::scene::colour::viridis;
use crate::scene::surface::Points;

/// Width of a view in pixels, and height of the scale beneath.
const WIDTH: u32 = 640;
const SCALE: u32 = 24;
/// Photos in the picture, beside one another.
const VIEWS: usize = 3;
const BACKGROUND: Rgb<u8> = Rgb([24, 24, 28]);

/// PNG of the scores of points, dark for 1 and bright for 2, as three of the photos see them that look from as
/// different directions as there are. The bar beneath is the scale from 1 to 2.
///
/// # Errors
/// Where the image cannot be encoded.
pub fn scores(points: &Points, photos: &[Photo]) -> Result<Vec<u8>> {
    let photos = apart(photos, median_position(points));
    let height = |photo: &&Photo| (f64::from(photo.camera.intrinsics.height) * zoom(photo)).ceil() as u32;
    let highest = photos.iter().map(height).max().unwrap_or(0);
    let mut image = RgbImage::from_pixel(WIDTH * photos.len().max(1) as u32, highest + SCALE, BACKGROUND);
    for (panel, photo) in (0..).zip(&photos) {
        draw(&mut image, [panel * WIDTH, height(photo)], points, photo);
    }
    let width = image.width();
    for x in 0..width {
        let colour = Rgb(viridis(x as f32 / (width - 1) as f32));
        (highest + 8..highest + SCALE).for_each(|y| image.put_pixel(x, y, colour));
    }
    picture::rgb(image.width(), image.as_raw())
}

/// Pixels of the picture to one of the photo.
fn zoom(photo: &Photo) -> f64 {
    f64::from(WIDTH) / f64::from(photo.camera.intrinsics.width)
}

/// A place in the middle of the points, robust to stray ones.
fn median_position(points: &Points) -> DVec3 {
    let along = |axis: usize| super::quantile(points.positions.iter().map(|p| p[axis]).collect(), 0.5);
    DVec3::new(along(0), along(1), along(2))
}

/// Up to three photos: the first one, and each time the one whose direction from `centre` is farthest from those taken.
fn apart(photos: &[Photo], centre: DVec3) -> Vec<&Photo> {
    let direction = |photo: &Photo| (photo.camera.pose.position - centre).normalize_or_zero();
    let mut taken: Vec<&Photo> = photos.first().into_iter().collect();
    while (1..VIEWS.min(photos.len())).contains(&taken.len()) {
        let nearest = |photo: &Photo| taken.iter().map(|t| direction(t).dot(direction(photo))).fold(-1.0, f64::max);
        let Some(next) = photos.iter().min_by(|a, b| nearest(a).total_cmp(&nearest(b))) else { break };
        taken.push(next);
    }
    taken
}

/// Draws the points that face a photo into a panel of the image, the far ones first.
fn draw(image: &mut RgbImage, [left, height]: [u32; 2], points: &Points, photo: &Photo) {
    let (pose, lens, zoom) = (photo.camera.pose, photo.lens(), zoom(photo));
    let away = pose.rotation.inverse();
    let mut seen: Vec<(f64, DVec2, f64, f32)> = Vec::new();
    for (i, position) in points.positions.iter().enumerate() {
        let p = away * (*position - pose.position);
        let facing = points.normals.get(i).is_none_or(|normal| normal.dot(pose.position - *position) > 0.0);
        if let Some(pixel) = lens.project(p).filter(|_| facing) {
            let radius = points.radii.get(i).map_or(0.0, |r| f64::from(*r)) * lens.intrinsics.focal[0] / p.z;
            seen.push((p.z, zoom * pixel, zoom * radius, points.scores.get(i).copied().unwrap_or(1.0)));
        }
    }
    seen.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (_, at, radius, score) in seen {
        let radius = (0.7 * radius).clamp(0.8, 12.0);
        let colour = Rgb(viridis(score - 1.0));
        let bound = |v: f64, size: u32| v.clamp(0.0, f64::from(size)) as u32;
        for y in bound(at.y - radius, height)..bound((at.y + radius).ceil(), height) {
            for x in bound(at.x - radius, WIDTH)..bound((at.x + radius).ceil(), WIDTH) {
                let off = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) - at;
                if off.length_squared() <= radius * radius {
                    image.put_pixel(left + x, y, colour);
                }
            }
        }
    }
}

//! A ball above a table that tests of stereo draw themselves, and photos of it.

use std::f64::consts::PI;
use std::path::Path;

use camsplat::files::photos::Photo;
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::lens::Distortion;
use glam::{DVec2, DVec3};

/// Centre and radius of the ball, and the height of the table below it.
pub const BALL: (DVec3, f64) = (DVec3::new(0.05, -0.1, 0.1), 0.45);
pub const TABLE: f64 = -0.35;
pub const WIDTH: u32 = 128;
pub const HEIGHT: u32 = 96;

/// Brightness in [0, 1] of the material at a point: waves of several lengths, none of which repeats within the scene.
pub fn texture(p: DVec3) -> f64 {
    let waves = [(3.1, 0.3), (9.3, 1.1), (17.7, 2.3), (29.9, 0.7)];
    let sum: f64 = waves
        .iter()
        .map(|(f, shift)| (f * p.x + shift).sin() * (f * p.y - 2.0 * shift).cos() + (0.8 * f * p.z + 3.0 * shift).sin())
        .sum();
    (0.5 + 0.1 * sum).clamp(0.0, 1.0)
}

/// Distance along a ray to the ball, or else to the table.
pub fn hit(origin: DVec3, direction: DVec3, ball_only: bool) -> Option<f64> {
    let (centre, radius) = BALL;
    let off = origin - centre;
    let (b, c) = (off.dot(direction), off.length_squared() - radius * radius);
    if b * b > c {
        return Some(-b - (b * b - c).sqrt());
    }
    let t = (TABLE - origin.z) / direction.z;
    (!ball_only && t > 0.0).then_some(t)
}

/// Direction in the world of a pixel's point, of depth 1.
pub fn ray(camera: &Camera, pixel: DVec2) -> DVec3 {
    let Intrinsics { focal, principal, .. } = camera.intrinsics;
    camera.pose.rotation * ((pixel - DVec2::from(principal)) / DVec2::from(focal)).extend(1.0)
}

/// Depth of the centre of a pixel; 0 where it shows nothing.
pub fn true_depth(camera: &Camera, x: u32, y: u32, ball_only: bool) -> f64 {
    let direction = ray(camera, DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
    hit(camera.pose.position, direction.normalize(), ball_only).map_or(0.0, |t| t / direction.length())
}

/// Brightness of a pixel, and how much of it the scene covers: means over 3 x 3 rays.
pub fn pixel(camera: &Camera, x: u32, y: u32, ball_only: bool) -> (f64, f64) {
    let (mut brightness, mut cover) = (0.0, 0.0);
    for i in 0..9 {
        let at = DVec2::new(
            f64::from(x) + f64::from(2 * (i % 3) + 1) / 6.0,
            f64::from(y) + f64::from(2 * (i / 3) + 1) / 6.0,
        );
        let direction = ray(camera, at).normalize();
        if let Some(t) = hit(camera.pose.position, direction, ball_only) {
            brightness += texture(camera.pose.position + t * direction);
            cover += 1.0;
        }
    }
    (if cover > 0.0 { brightness / cover } else { 0.0 }, cover / 9.0)
}

/// So many cameras around the scene at two heights, that look at its middle.
pub fn cameras(count: u32) -> Vec<Camera> {
    let camera = |i: u32| {
        let (sin, cos) = (2.0 * PI * f64::from(i) / f64::from(count)).sin_cos();
        let lift = if i.is_multiple_of(2) { 1.4 } else { 2.0 };
        let position = DVec3::new(2.2 * cos, 2.2 * sin, lift);
        Camera {
            name: format!("{i:02}.png"),
            pose: Pose::looking(position, -position, DVec3::Z),
            intrinsics: Intrinsics::from_fov(WIDTH, HEIGHT, 36f64.to_radians()),
        }
    };
    (0..count).map(camera).collect()
}

/// Writes the pictures of cameras into a folder; of the ball alone with alpha.
pub fn photograph(folder: &Path, cameras: &[Camera], ball_only: bool) -> Vec<Photo> {
    let write = |camera: &Camera| {
        let path = folder.join(&camera.name);
        let image = image::RgbaImage::from_fn(WIDTH, HEIGHT, |x, y| {
            let (brightness, cover) = pixel(camera, x, y, ball_only);
            let value = (255.0 * brightness).round() as u8;
            image::Rgba([value, value, value, (255.0 * cover).round() as u8])
        });
        image.save(&path).unwrap();
        Photo { camera: camera.clone(), distortion: Distortion::default(), image: Some(path), mask: None }
    };
    cameras.iter().map(write).collect()
}

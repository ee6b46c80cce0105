//! The training views that see a surface point, nearest to a viewer's direction first: what the law of expected error is
//! made of. Twin of `shared/nearest_views.glsl`.

use glam::Vec3;

use super::look::Look;
use crate::metrics::score_point::View;
use crate::visibility::bvh::Bvh;
use crate::visibility::raycast::Ray;

/// Views at least this far from a viewer's direction, in radians, count as none.
pub const FARTHEST: f32 = 2.0;

/// A view that sees the point of a look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Near {
    /// Angle at the point between the viewer and the view, in radians.
    pub angle: f32,
    /// Distance of the view over that of the viewer.
    pub ratio: f32,
    /// Cosine of the angle at which the view sees the surface.
    pub cosine: f32,
    /// Which view.
    pub view: u32,
}

/// Angle between unit vectors, exact for small angles.
pub fn angle(a: Vec3, b: Vec3) -> f32 {
    2.0 * (0.5 * (a - b).length()).min(1.0).asin()
}

/// The at most `most` views of `views` that see the point of a look, in the order of their angles; of equals the first.
pub fn nearest(bvh: &Bvh, look: &Look, views: &[View], most: usize) -> Vec<Near> {
    let (point, direction, normal) = (Vec3::from(look.position), Vec3::from(look.direction), Vec3::from(look.normal));
    let mut gated: Vec<(Near, Vec3, f32)> = Vec::new();
    for (view, index) in views.iter().zip(0..) {
        let ray = Vec3::from(view.position) - point;
        let distance = ray.length().max(1e-6);
        let n = ray / distance;
        let along = |axis: [f32; 3]| -n.dot(Vec3::from(axis));
        let forward = along(view.forward);
        let inside = forward > 0.0 && along(view.right).abs() <= forward && along(view.down).abs() <= forward;
        let (angle, cosine) = (angle(direction, n), n.dot(normal));
        if inside && (cosine > 0.0 || normal == Vec3::ZERO) && angle < FARTHEST {
            gated.push((Near { angle, ratio: distance / look.distance, cosine, view: index }, n, distance));
        }
    }
    gated.sort_by(|a, b| a.0.angle.total_cmp(&b.0.angle));
    let free = gated.into_iter().filter(|(_, n, distance)| {
        !bvh.any_hit(&Ray { origin: point, direction: *n, t_min: 0.0, t_max: *distance })
    });
    free.map(|(near, ..)| near).take(most).collect()
}

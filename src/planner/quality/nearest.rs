//! The training views that see a surface point, nearest to a viewer's direction first: what the law of expected error is
//! made of. Twin of `shared/nearest_views.glsl`.

use glam::{DVec3, Vec3};

use super::law::{FARTHEST, Near};
use super::look::Look;
use crate::engine::vulkan::shaders::glsl::shared::nearest_views;
use crate::planner::metrics::score_point::View;
use crate::visibility::bvh::Bvh;
use crate::visibility::raycast::Ray;

/// So many of the nearest views, occlusion ignored, are tested, as on the device.
const LISTED: usize = nearest_views::LISTED as usize * nearest_views::WALKS as usize;

/// The point of a look, the unit direction to the viewer, and the normal.
pub fn vectors(look: &Look) -> [DVec3; 3] {
    [look.position, look.direction, look.normal].map(|v| Vec3::from(v).as_dvec3())
}

/// Angle between unit vectors, exact for small angles.
pub fn angle(a: DVec3, b: DVec3) -> f64 {
    2.0 * (0.5 * (a - b).length()).min(1.0).asin()
}

/// What a view at `centre` is to a look but for its image and what hides it; none where it is behind the surface or farther away than
/// [`FARTHEST`]. `widest` is the tangent of half its wider field of view.
pub fn toward(look: &Look, view: u32, centre: DVec3, widest: f64) -> Option<Near> {
    let [point, to_viewer, normal] = vectors(look);
    let ray = centre - point;
    let distance = ray.length().max(1e-6);
    let direction = ray / distance;
    let cost = angle(to_viewer, direction);
    ((direction.dot(normal) > 0.0 || normal == DVec3::ZERO) && cost < FARTHEST).then_some(Near {
        cost,
        direction,
        distance,
        footprint: distance * widest,
        view,
    })
}

/// The at most three of `views` that nothing hides, in the order of their costs; of equals the first.
pub fn nearest(bvh: &Bvh, look: &Look, views: impl Iterator<Item = Near>) -> Vec<Near> {
    let mut views: Vec<Near> = views.filter(|view| view.cost < FARTHEST).collect();
    views.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let origin = Vec3::from(look.position);
    let free = views.into_iter().take(LISTED).filter(|view| {
        let (direction, t_max) = (view.direction.as_vec3(), view.distance as f32);
        !bvh.any_hit(&Ray { origin, direction, t_min: 0.0, t_max })
    });
    free.take(3).collect()
}

/// The tangent of half a camera's wider field of view.
pub(crate) fn widest(camera: &View) -> f64 {
    let [x, y] = [camera.right, camera.down].map(|axis| 1.0 / Vec3::from(axis).as_dvec3().length());
    x.max(y)
}

/// As [`nearest`], of cameras whose whole image counts.
pub(crate) fn nearest_cameras(bvh: &Bvh, look: &Look, cameras: &[View]) -> Vec<Near> {
    let views = cameras.iter().zip(0..).filter_map(|(camera, index)| {
        let near = toward(look, index, Vec3::from(camera.position).as_dvec3(), widest(camera))?;
        let along = |axis: [f32; 3]| -near.direction.dot(Vec3::from(axis).as_dvec3());
        let forward = along(camera.forward);
        let inside = forward > 0.0 && along(camera.right).abs() <= forward && along(camera.down).abs() <= forward;
        inside.then_some(near)
    });
    nearest(bvh, look, views)
}

//! Cameras inside objects: they see nothing but backs.

use glam::DVec3;

use super::assembly::Assembly;
use crate::scene::camera::Camera;
use crate::scene::model::Model;
use crate::scene::random;
use crate::visibility::raycast::Ray;

/// Rays from a camera, in all directions.
const RAYS: u32 = 64;
/// Share of the rays that must hit something, and share of the hits that must be backs of single-sided triangles.
const MIN_HITS: f64 = 0.5;
const MIN_BACKS: f64 = 0.9;

/// Names of the cameras around which nearly everything that is near shows a back that is not meant to be seen.
pub fn cameras_inside<'a>(model: &Model, assembly: &Assembly, cameras: &'a [Camera]) -> Vec<&'a str> {
    let is_back = |primitive: u32, direction: DVec3| {
        let corners = model.faces[primitive as usize].corners.map(|v| model.vertices[v as usize].position);
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        assembly.single_sided[primitive as usize] && normal.dot(direction) > 0.0
    };
    let is_inside = |camera: &&Camera| {
        let origin = (camera.pose.position - assembly.centre).as_vec3();
        let (mut hits, mut backs) = (0, 0);
        for i in 0..RAYS {
            let golden = 0.618_033_988_75 * f64::from(i);
            let direction = random::direction((f64::from(i) + 0.5) / f64::from(RAYS), golden.fract());
            let ray = Ray { origin, direction: direction.as_vec3(), t_min: 0.0, t_max: f32::MAX };
            if let Some(hit) = assembly.bvh.closest_hit(&ray) {
                hits += 1;
                backs += u32::from(is_back(hit.primitive, direction));
            }
        }
        f64::from(hits) >= MIN_HITS * f64::from(RAYS) && f64::from(backs) >= MIN_BACKS * f64::from(hits)
    };
    cameras.iter().filter(is_inside).map(|camera| camera.name.as_str()).collect()
}

//! Where the splats are before the first iteration, and how large.

use glam::DVec3;

use super::config::{Config, Preset};
use super::shared::CameraState;
use crate::scene::camera::Intrinsics;
use crate::scene::random;
use crate::scene::region::Shape;
use crate::visibility::device_scene::SceneGeometry;

/// Streams of random numbers, apart from those of baselines and samples.
const DIRECTIONS: u32 = 0x5354_0000;
const POSITIONS: u32 = 0x5354_1000;

/// Positions that are tried before any free voxel is taken; each has a stream of its own.
const TRIES: u32 = 64;

/// Tangents of half the horizontal and vertical fields of view.
pub fn tangents(intrinsics: &Intrinsics) -> [f32; 2] {
    intrinsics.fov().map(|fov| (0.5 * fov).tan() as f32)
}

/// Start poses of `config.views` splats in the planner's frame: for an object uniform on a sphere (or in the box) and
/// looking in, for a room uniform in free space with uniform directions.
pub fn splats(config: &Config, scene: &SceneGeometry, lens_of: impl Fn(usize) -> Intrinsics) -> Vec<CameraState> {
    (0..config.views)
        .map(|j| {
            let [tan_x, tan_y] = tangents(&lens_of(j as usize));
            let (position, direction) = pose(config, scene, j);
            let (centre, direction) = (position.as_vec3().to_array(), direction.as_vec3().normalize().to_array());
            CameraState { centre, direction, tan_x, tan_y }
        })
        .collect()
}

/// Position and direction of splat `j` of these.
pub(super) fn pose(config: &Config, scene: &SceneGeometry, j: u32) -> (DVec3, DVec3) {
    let [u, v, ..] = random::uniforms(config.seed, DIRECTIONS, j);
    let uniform = random::direction(u, v);
    match (config.preset, scene.region.shape) {
        (Preset::Object, Shape::Shell { centre, r_min, r_max }) => {
            let radius = 0.5 * (r_min + r_max);
            // Uniform over the part of the sphere above the floor: height is uniform on a sphere (Archimedes).
            let lowest = scene.region.floor.map_or(-1.0, |floor| ((floor - centre.z) / radius).clamp(-1.0, 1.0));
            let height = lowest + (1.0 - lowest) * u;
            let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
            let flat = (1.0 - height * height).max(0.0).sqrt();
            let outward = DVec3::new(flat * cos, flat * sin, height);
            let position = scene.free.project(centre + radius * outward);
            (position, (centre - position).normalize_or(DVec3::NEG_X))
        }
        (Preset::Object, Shape::Box { min, max }) => {
            let position = anywhere(config.seed, scene, j);
            (position, (0.5 * (min + max) - position).normalize_or(uniform))
        }
        (Preset::Room, _) => (anywhere(config.seed, scene, j), uniform),
    }
}

/// A uniform position in free space, by rejection: a voxel more or less moves no other position.
fn anywhere(seed: u64, scene: &SceneGeometry, j: u32) -> DVec3 {
    let (min, max) = scene.region.bounds();
    let tries = (0..TRIES).map(|attempt| {
        let [x, y, z, _] = random::uniforms(seed, POSITIONS + attempt, j);
        min + (max - min) * DVec3::new(x, y, z)
    });
    let mut free = tries.filter(|&p| scene.region.contains(p) && scene.free.is_free(p));
    free.next().unwrap_or_else(|| scene.free.sample(seed, POSITIONS, j))
}

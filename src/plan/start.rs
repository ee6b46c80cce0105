//! Where the splats are before the first iteration, and how large.

use glam::{DVec3, Vec3};

use super::config::{Config, Preset, Start};
use super::shared::Splat;
use crate::scene::camera::Intrinsics;
use crate::scene::random;
use crate::scene::region::Shape;
use crate::visibility::device_scene::SceneGeometry;
use crate::visibility::probe_depth::Probe;
use crate::visibility::raycast::Ray;

/// Streams of random numbers, apart from those of baselines and samples.
const DIRECTIONS: u32 = 0x5354_0000;
const JITTER: u32 = 0x5354_0001;
const POSITIONS: u32 = 0x5354_1000;

/// Positions that are tried before any free voxel is taken; each has a stream of its own.
const TRIES: u32 = 64;

/// Most probes that the mean number of visible splats is taken over.
pub(crate) const PROBES: usize = 256;

/// Jitter of an identical start, in radii of the region: enough to separate the splats.
const SPREAD: f64 = 0.01;

/// Tangents of half the horizontal and vertical fields of view.
pub fn tangents(intrinsics: &Intrinsics) -> [f32; 2] {
    intrinsics.fov().map(|fov| (0.5 * fov).tan() as f32)
}

/// Start poses of `config.views` splats in the planner's frame: for an object uniform on a sphere (or in the box) and
/// looking in, for a room uniform in free space with uniform directions; or all near the first of these.
pub fn splats(config: &Config, scene: &SceneGeometry, intrinsics: &Intrinsics) -> Vec<Splat> {
    let [tan_x, tan_y] = tangents(intrinsics);
    (0..config.views)
        .map(|j| {
            let source = if config.start == Start::Identical { 0 } else { j };
            let (mut position, mut direction) = pose(config, scene, source);
            if config.start == Start::Identical {
                let [a, b, c, _] = random::uniforms(config.seed, JITTER, 2 * j);
                let [d, e, f, _] = random::uniforms(config.seed, JITTER, 2 * j + 1);
                position += SPREAD * (2.0 * DVec3::new(a, b, c) - 1.0);
                direction = (direction + SPREAD * (2.0 * DVec3::new(d, e, f) - 1.0)).normalize();
            }
            Splat {
                centre: position.as_vec3().to_array(),
                direction: direction.as_vec3().normalize().to_array(),
                tan_x,
                tan_y,
            }
        })
        .collect()
}

fn pose(config: &Config, scene: &SceneGeometry, j: u32) -> (DVec3, DVec3) {
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

/// How many splats a probe sees, in the mean over the first probes of the pool.
#[derive(Clone, Copy, Debug)]
pub struct Visible {
    /// Whose cone the probe is in.
    pub gated: f64,
    /// And that nothing hides.
    pub seen: f64,
}

/// Counts the splats that probes see.
pub fn visible(splats: &[Splat], probes: &[Probe], scene: &SceneGeometry) -> Visible {
    let few = (100_000 / splats.len().max(1)).clamp(16, PROBES).min(probes.len());
    let (mut gated, mut seen) = (0usize, 0usize);
    for probe in &probes[..few] {
        let origin = Vec3::from(probe.position);
        for splat in splats {
            let ray = Vec3::from(splat.centre) - origin;
            let distance = ray.length();
            let direction = ray / distance.max(1e-6);
            let cone_cos = 1.0 / splat.tan_x.min(splat.tan_y).hypot(1.0);
            if -direction.dot(Vec3::from(splat.direction)) >= cone_cos {
                gated += 1;
                let ray = Ray { origin, direction, t_min: 0.0, t_max: distance };
                seen += (probe.faces(direction) && !scene.bvh.any_hit(&ray)) as usize;
            }
        }
    }
    let all = few.max(1) as f64;
    Visible { gated: gated as f64 / all, seen: seen as f64 / all }
}

/// The start scale `0.8 / sqrt(splats that a probe sees)` (docs/reference/method.md, Optimisation), at most half a radian.
pub fn scale(seen: f64) -> f32 {
    (0.8 / seen.max(1.0).sqrt()).min(0.5) as f32
}

/// Texels along a side so that one is about as wide as the scale: `3.5 / s`, a multiple of 8 between 16 and 256.
pub fn resolution(scale: f32) -> u32 {
    let texels = (3.5 / scale / 8.0).ceil() as u32 * 8;
    texels.clamp(16, 256)
}

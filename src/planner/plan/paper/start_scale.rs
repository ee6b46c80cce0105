//! The splats at the start: all in one place where that is asked for, how many a probe sees of them, and what scale and resolution follow.

use glam::{DVec3, Vec3};

use crate::planner::plan::config::Config;
use crate::planner::plan::shared::CameraState;
use crate::planner::plan::start;
use crate::scene::random;
use crate::visibility::device_scene::SceneGeometry;
use crate::visibility::probe_depth::Probe;
use crate::visibility::raycast::Ray;

/// Stream of random numbers, apart from those of [`start`].
const JITTER: u32 = 0x5354_0001;

/// Most probes that the mean number of visible splats is taken over.
pub(super) const PROBES: usize = 256;

/// Jitter of an identical start, in radii of the region: enough to separate the splats.
const SPREAD: f64 = 0.01;

/// Puts all planned splats near where the first is, but for a seeded jitter.
pub(super) fn identical(planned: &mut [CameraState], config: &Config, scene: &SceneGeometry) {
    let (position, direction) = start::pose(config, scene, 0);
    for (j, splat) in (0..).zip(planned) {
        let [a, b, c, _] = random::uniforms(config.seed, JITTER, 2 * j);
        let [d, e, f, _] = random::uniforms(config.seed, JITTER, 2 * j + 1);
        let position = position + SPREAD * (2.0 * DVec3::new(a, b, c) - 1.0);
        let direction = (direction + SPREAD * (2.0 * DVec3::new(d, e, f) - 1.0)).normalize();
        splat.centre = position.as_vec3().to_array();
        splat.direction = direction.as_vec3().normalize().to_array();
    }
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
pub fn visible(splats: &[CameraState], probes: &[Probe], scene: &SceneGeometry) -> Visible {
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

//! From how far away point cameras are to be seen, direction by direction (`probe_stand.comp`), and the twin.

use std::sync::Arc;

use glam::Vec3;

use super::device_scene::{DeviceRegion, DeviceScene, SceneGeometry};
use super::probe_depth::{Probe, ProbeMaps, feasible};
use crate::Result;
use crate::scene::octahedral;
use crate::scene::random::{pcg4d, uniform};
use crate::vulkan::{Buffer, Context, Pipeline, Recorder};

crate::gpu_struct! {
    /// Push constants of `probe_stand`.
    pub struct ProbeStandPush {
        /// Texels of all probes.
        pub texels: u32,
        /// Texels along a side.
        pub resolution: u32,
        /// Seed of the draws.
        pub seed: u32,
    }
}

crate::stage!(
    /// A distance for each texel of each probe.
    pub PROBE_STAND = probe_stand(ProbeStandPush) {
        read probes, read depth, read region, read free_distance, write stands,
    } with [Probe, DeviceRegion]
);

/// Stream of the draws.
const STREAM: u32 = 0x7374_616e;
/// Steps along a ray.
const STEPS: u32 = 32;
/// What a texel holds that asks for no distance.
pub const ANY: f32 = 1e30;

/// Draws, for each texel of each probe of `maps` from which the region sees it, the logarithm of a distance in the planner's
/// frame, uniform over the feasible, unblocked part of the ray; [`ANY`] for the others. `probes x texels` float32.
///
/// # Errors
/// Where device memory runs out or the device fails.
pub fn draw(context: &Arc<Context>, scene: &DeviceScene, maps: &ProbeMaps, seed: u32) -> Result<Buffer> {
    let texels = maps.probes.len() as u32 * maps.resolution * maps.resolution;
    let stands = Buffer::device(context, "stands", 4 * u64::from(texels))?;
    let pipeline = Pipeline::new(context, &PROBE_STAND, &[])?;
    let mut commands = Recorder::new(context)?;
    commands
        .stage(&pipeline)
        .bind(&[&maps.probe_buffer, &maps.depth, &scene.region, &scene.free_distance, &stands])
        .push(&ProbeStandPush { texels, resolution: maps.resolution, seed })
        .linear(texels.div_ceil(64));
    commands.submit_and_wait()?;
    drop(commands);
    Ok(stands)
}

/// Twin of [`draw`] for one texel of the probe of this index, whose depth there is `reach`.
pub fn stand(
    geometry: &SceneGeometry,
    (index, probe): (u32, &Probe),
    texel: u32,
    resolution: u32,
    reach: f32,
    seed: u32,
) -> f32 {
    let [pick, jitter, ..] = pcg4d([seed, STREAM, index, texel]).map(uniform);
    let w = octahedral::texel_centre(texel, resolution).as_vec3();
    let found = (reach > 0.0).then(|| along(geometry, Vec3::from(probe.position), w, reach, [pick, jitter])).flatten();
    found.filter(|distance| *distance > 0.0).map_or(ANY, f32::ln)
}

/// A distance from `from` along unit `w`, uniform over the feasible part of the ray before `reach` as some steps find it, by two
/// uniform numbers. Twin of `stand_along` in `shaders/glsl/shared/region.glsl`.
fn along(geometry: &SceneGeometry, from: Vec3, w: Vec3, reach: f32, [pick, jitter]: [f32; 2]) -> Option<f32> {
    let region = geometry.device_region();
    let middle = from.dot(w);
    let outer = middle * middle - from.length_squared() + 1.0;
    let (near, far) = ((-middle - outer.sqrt()).max(0.0), (-middle + outer.sqrt()).min(reach));
    // Not a number where the ray misses the ball.
    if outer < 0.0 || near >= far {
        return None;
    }
    let at = |k: u32| near + (far - near) * ((k as f32 + jitter) / STEPS as f32);
    let found: Vec<f32> = (0..STEPS).map(at).filter(|t| feasible(geometry, &region, from + *t * w)).collect();
    found.get((pick * found.len() as f32) as usize).or(found.last()).copied()
}

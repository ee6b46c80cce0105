//! Depth maps of point cameras, ray-cast once on the device (`probe_depth.comp`, `probe_sky.comp`), and their twins.

use std::sync::Arc;

use glam::Vec3;

use super::bvh::{Node, Primitives};
use super::device_scene::{DeviceRegion, DeviceScene, SceneGeometry};
use super::raycast::{MISS, Ray, inverse_slope};
use crate::Result;
use crate::engine::vulkan::pace::{Pace, in_parts};
use crate::engine::vulkan::shaders::glsl::visibility::probe_depth as glsl;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::scene::proxy::SurfacePoint;
use crate::visibility::bvh::TraversalConstants;

crate::gpu_struct! {
    /// A point camera, lifted off the surface, in the planner's frame.
    pub struct Probe {
        /// Where it is.
        pub position: [f32; 3],
        /// View dependency score in [1, 2].
        pub score: f32,
        /// Normal of the side from which it can be seen; zero where the surface itself is in the way.
        pub normal: [f32; 3],
        /// Fraction of directions from which the region sees it.
        pub sky: f32,
    }
}

crate::gpu_struct! {
    /// Push constants of `probe_depth`.
    pub(crate) struct ProbeDepthPush {
        /// Probe of the first row.
        pub first: u32,
        /// Rays of this dispatch.
        pub rays: u32,
        /// Texels along a side.
        pub resolution: u32,
    }
}

crate::stage!(
    /// A ray per texel of each probe.
    pub(crate) ProbeDepthStage = probe_depth<TraversalConstants>(ProbeDepthPush) {
        read nodes, read primitives, read probes, read region, read free_distance, write depth,
    } with [Node, Probe, DeviceRegion]
);

impl Probe {
    /// Whether unit `direction` is on the side from which the probe can be seen. A disc hides no more than itself, and a
    /// cloud of them has gaps: what is behind one must not be seen through the next.
    pub fn faces(&self, direction: Vec3) -> bool {
        Vec3::from(self.normal).dot(direction) >= 0.0
    }

    /// The probe of a surface point, given in the user's world.
    pub fn new(point: &SurfacePoint, geometry: &SceneGeometry) -> Self {
        let to_internal = &geometry.to_internal;
        let normal = match geometry.bvh.primitives {
            Primitives::Triangles(_) => Vec3::ZERO,
            Primitives::Discs(_) => to_internal.direction(point.normal).as_vec3(),
        };
        let lifted = point.position + point.lift * point.normal;
        Self {
            position: to_internal.point(lifted).as_vec3().to_array(),
            score: point.score,
            normal: normal.to_array(),
            sky: 0.0,
        }
    }
}

crate::gpu_struct! {
    /// Push constants of `probe_sky`.
    pub(crate) struct ProbeSkyPush {
        /// Texels along a side.
        pub resolution: u32,
    }
}

crate::stage!(
    /// A workgroup per probe: how much of the sphere the region takes.
    pub(crate) ProbeSkyStage = probe_sky(ProbeSkyPush) { read depth, write probes } with [Probe]
);

/// Depth of the directions behind a disc: everything there is hidden.
const BEHIND: f32 = glsl::BEHIND as f32;
/// Rays of one dispatch, and of the first submission: short on any device.
const RAYS: u32 = 1 << 20;

/// Probes and what each sees of the surface.
pub struct ProbeMaps {
    /// The probes.
    pub probes: Vec<Probe>,
    /// Texels along a side.
    pub resolution: u32,
    pub(crate) probe_buffer: Buffer,
    pub(crate) depth: Buffer,
}

impl ProbeMaps {
    /// Casts `resolution` squared rays from each of `points` (given in the user's world).
    ///
    /// # Errors
    /// Where device memory runs out or the device fails.
    pub fn new(context: &Arc<Context>, scene: &DeviceScene, points: &[SurfacePoint], resolution: u32) -> Result<Self> {
        let probes: Vec<Probe> = points.iter().map(|point| Probe::new(point, &scene.geometry)).collect();
        let texels = resolution * resolution;
        let probe_buffer = Buffer::from_slice(context, "probes", &probes)?;
        let depth = Buffer::device(context, "depth", 4 * probes.len() as u64 * texels as u64)?;
        let pipeline = Pipeline::new::<ProbeDepthStage>(context, &scene.constants())?;
        let sky = Pipeline::new::<ProbeSkyStage>(context, &())?;
        let rows = (RAYS / texels).max(1);
        in_parts(context, &mut Pace::new(context, rows), [probes.len() as u32, 1], |commands, part| {
            for first in part.clone().step_by(rows as usize) {
                let rays = rows.min(part.end - first) * texels;
                commands
                    .stage(
                        &pipeline,
                        ProbeDepthStage {
                            nodes: &scene.nodes,
                            primitives: &scene.primitives,
                            probes: &probe_buffer,
                            region: &scene.region,
                            free_distance: &scene.free_distance,
                            depth: &depth,
                        },
                    )
                    .push(&ProbeDepthPush { first, rays, resolution })
                    .linear(rays.div_ceil(64));
            }
            Ok(())
        })?;
        let mut commands = Recorder::new(context)?;
        commands
            .stage(&sky, ProbeSkyStage { depth: &depth, probes: &probe_buffer })
            .push(&ProbeSkyPush { resolution })
            .linear(probes.len() as u32);
        commands.submit_and_wait()?;
        drop(commands);
        let probes = probe_buffer.download(probes.len())?;
        Ok(Self { probes, resolution, probe_buffer, depth })
    }

    /// The maps of those probes that are to be kept, as if they had been cast alone.
    ///
    /// # Errors
    /// Where device memory runs out or the device fails.
    pub fn with(self, context: &Arc<Context>, keep: impl Fn(&Probe) -> bool) -> Result<Self> {
        if self.probes.iter().all(&keep) {
            return Ok(self);
        }
        let rows = self.download()?;
        let rows = rows.chunks((self.resolution * self.resolution) as usize).zip(&self.probes);
        let depth: Vec<f32> = rows.filter(|(_, probe)| keep(probe)).flat_map(|(row, _)| row).copied().collect();
        let probes: Vec<Probe> = self.probes.iter().copied().filter(keep).collect();
        Ok(Self {
            probe_buffer: Buffer::from_slice(context, "probes", &probes)?,
            depth: Buffer::from_slice(context, "depth", &depth)?,
            probes,
            ..self
        })
    }

    /// The signed depths, row by row; negative where the ray misses the feasible region.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn download(&self) -> Result<Vec<f32>> {
        self.depth.download(self.probes.len() * (self.resolution * self.resolution) as usize)
    }
}

/// What a texel of a probe's map holds: the distance along unit `direction` to the first hit, 1e30 where there is none;
/// negative where the ray does not meet the feasible region before. Twin of `probe_depth`, in the same precision.
pub fn probe_depth(geometry: &SceneGeometry, probe: &Probe, direction: Vec3) -> f32 {
    if !probe.faces(direction) {
        return -BEHIND;
    }
    let origin = Vec3::from(probe.position);
    let ray = Ray { origin, direction, t_min: 0.0, t_max: MISS };
    let reach = geometry.bvh.closest_hit(&ray).map_or(MISS, |hit| hit.distance);
    if meets_region(geometry, origin, direction, reach) { reach } else { -reach }
}

/// Fraction of a map's texels from whose direction the region sees the probe: the twin of `probe_sky`.
pub fn probe_sky(depth: &[f32]) -> f32 {
    depth.iter().filter(|depth| **depth > 0.0).count() as f32 / depth.len() as f32
}

/// Whether the ray meets the feasible region before `reach`.
fn meets_region(geometry: &SceneGeometry, origin: Vec3, direction: Vec3, reach: f32) -> bool {
    let region = geometry.device_region();
    let (mut near, mut far) = (0f32, reach);
    if region.is_box != 0 {
        let inverse = direction.map(inverse_slope);
        let (a, b) = ((Vec3::from(region.box_min) - origin) * inverse, (Vec3::from(region.box_max) - origin) * inverse);
        near = near.max(a.min(b).max_element());
        far = far.min(a.max(b).min_element());
    } else {
        let middle = origin.dot(direction);
        let outer = middle * middle - origin.dot(origin) + region.r_max * region.r_max;
        if outer < 0.0 {
            return false;
        }
        near = near.max(-middle - outer.sqrt());
        far = far.min(-middle + outer.sqrt());
    }
    let stands = |t: f32| feasible(geometry, &region, origin + t * direction);
    let (mut hollow_in, mut hollow_out) = (far, near);
    if region.is_box == 0 && near < far {
        let middle = origin.dot(direction);
        let inner = middle * middle - origin.dot(origin) + region.r_min * region.r_min;
        if inner > 0.0 {
            hollow_in = (-middle - inner.sqrt()).clamp(near, far);
            hollow_out = (-middle + inner.sqrt()).clamp(near, far);
        }
    }
    if near < far && (stands(0.5 * (near + hollow_in)) || stands(0.5 * (hollow_out + far))) {
        return true;
    }
    let mut t = near;
    for _ in 0..512 {
        if t > far {
            return false;
        }
        if stands(t) {
            return true;
        }
        let p = origin + t * direction;
        let to_free = geometry.free.clamped_violation(p).0;
        let inner = if region.is_box != 0 { 0.0 } else { (region.r_min - p.length()).max(0.0) };
        t += (to_free - region.cell).max(inner).max(0.5 * region.cell);
    }
    false
}

/// Whether a camera may be placed at `p`: the twin of `region_contains` in `shaders/glsl/shared/region.glsl`.
fn feasible(geometry: &SceneGeometry, region: &DeviceRegion, p: Vec3) -> bool {
    contains(region, p) && geometry.free.clamped_violation(p).0 < 0.5 * region.cell
}

/// Whether `p` is within the shape and above the floor.
fn contains(region: &DeviceRegion, p: Vec3) -> bool {
    let within = if region.is_box != 0 {
        p.cmpge(Vec3::from(region.box_min)).all() && p.cmple(Vec3::from(region.box_max)).all()
    } else {
        (region.r_min * region.r_min..=region.r_max * region.r_max).contains(&p.length_squared())
    };
    within && p.z >= region.floor_z
}

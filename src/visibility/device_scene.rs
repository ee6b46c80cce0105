//! The surface and the region on the device, in the planner's frame: what rays are cast against and where cameras may be placed.

use std::sync::Arc;

use glam::DVec3;

use crate::engine::vulkan::{Buffer, Context};
use crate::scene::camera::Camera;
use crate::scene::free_space::{self, FreeSpace};
use crate::scene::limits::Limits;
use crate::scene::proxy::Proxy;
use crate::scene::region::{Region, Shape};
use crate::scene::similarity::Similarity;
use crate::visibility::bvh::{Bvh, Primitives, TraversalConstants};
use crate::visibility::raycast::Ray;
use crate::{Error, Result};

/// How far a surface may lie from the middle of the region, over its size: its points are resolved to less than a hundredth of
/// it.
const FARTHEST: f64 = 1e5;

crate::gpu_struct! {
    /// The region of the cameras, in the planner's frame (`shared/region_types.glsl`).
    pub struct DeviceRegion {
        /// Lowest corner of the box.
        pub box_min: [f32; 3],
        /// 1 for a box, 0 for a shell about the origin.
        pub is_box: u32,
        /// Highest corner of the box.
        pub box_max: [f32; 3],
        /// Inner radius of the shell.
        pub r_min: f32,
        /// Centre of the first voxel of the free-space field.
        pub grid_origin: [f32; 3],
        /// Outer radius of the shell.
        pub r_max: f32,
        /// Voxels along x, y, z.
        pub grid_size: [u32; 3],
        /// Side of a voxel.
        pub cell: f32,
        /// Height of the floor.
        pub floor_z: f32,
        /// Unused.
        pub spare0: f32,
        /// Unused.
        pub spare1: f32,
        /// Unused.
        pub spare2: f32,
    }
}

/// Surface, region and free space in the planner's frame, on the host.
pub struct SceneGeometry {
    /// From the user's world to the planner's frame: up is +Z, the region's bounding sphere the unit sphere.
    pub to_internal: Similarity,
    /// The region in the planner's frame.
    pub region: Region,
    /// The free space of cameras in it.
    pub free: FreeSpace,
    /// Further limits, in the planner's frame.
    pub limits: Limits,
    /// The free space of viewers, if some limits do not apply to them.
    everywhere: Option<FreeSpace>,
    /// The hierarchy over the surface.
    pub bvh: Bvh,
}

impl SceneGeometry {
    /// Maps surface and region into the planner's frame.
    ///
    /// # Errors
    /// Where the region leaves no free space, or the surface cannot be represented: beside the region, or at all.
    pub fn new(proxy: &Proxy, region: &Region) -> Result<Self> {
        Self::among(proxy, region, &Limits::default())
    }

    /// As [`SceneGeometry::new`], within limits in the user's world.
    ///
    /// # Errors
    /// As [`SceneGeometry::new`], also where the limits leave nothing.
    pub fn among(proxy: &Proxy, region: &Region, limits: &Limits) -> Result<Self> {
        let (lo, hi) = proxy.bounds();
        let (away, size) = ((0.5 * (lo + hi) - region.bounding_sphere().0).length(), (hi - lo).length());
        if away > FARTHEST * size && size > 0.0 {
            return Err(Error::request(format!(
                "the surface lies {:.0e} times its own size away from the middle of the region, where single precision cannot \
                 tell its points apart; move the region nearer (`shell`, `box`)",
                away / size
            )));
        }
        let to_internal = region.to_planner_frame();
        let internal = region.transformed(&to_internal)?;
        let occluder = proxy.occluder.transformed(&to_internal);
        let limits = limits.transformed(&to_internal, region.up);
        let (free, everywhere) =
            FreeSpace::with_everybody(&occluder, proxy.assumed, &internal, &limits, free_space::RESOLUTION)?;
        let bvh = Bvh::new(&proxy.occluder, &to_internal)?;
        Ok(Self { to_internal, region: internal, free, limits, everywhere, bvh })
    }

    /// Whether a point is in a camera's image and nothing is between them; both in the user's world.
    pub fn sees(&self, camera: &Camera, point: DVec3) -> bool {
        if !camera.sees(point) {
            return false;
        }
        let origin = self.to_internal.point(point).as_vec3();
        let ray = self.to_internal.point(camera.pose.position).as_vec3() - origin;
        let distance = ray.length();
        let direction = ray / distance.max(1e-6);
        !self.bvh.any_hit(&Ray { origin, direction, t_min: 0.0, t_max: distance })
    }

    /// Lowest and highest corner, in the user's world, of what may be a room, where free space is not in it.
    pub fn elsewhere(&self) -> Option<[DVec3; 2]> {
        let back = self.to_internal.inverse();
        let [a, b] = self.free.elsewhere?.map(|corner| back.point(corner));
        Some([a.min(b), a.max(b)])
    }

    /// The free space of viewers.
    pub fn open(&self) -> &FreeSpace {
        self.everywhere.as_ref().unwrap_or(&self.free)
    }

    /// Whether limits allow a viewer at `p` in the planner's frame.
    pub fn is_allowed(&self, p: DVec3) -> bool {
        let unknown = self.limits.space.as_ref().is_some_and(|space| !space.holds(p));
        let held =
            if self.open().grid.holds(p) { self.open().is_barred(p) } else { self.limits.in_a_volume(p) || unknown };
        !held && !self.limits.behind_a_wall(p)
    }

    /// Whether a camera at `p` in the planner's frame keeps all limits: walls, volumes and heights exactly, ground and known space by the
    /// voxel.
    pub fn keeps_limits(&self, p: DVec3) -> bool {
        let Limits { heights, walk, space, .. } = &self.limits;
        let slack = 1e-9;
        !self.limits.behind_a_wall(p)
            && !self.limits.in_a_volume(p)
            && heights.is_none_or(|[low, high]| (low - slack..=high + slack).contains(&p.z))
            && ((walk.is_none() && space.is_none()) || !self.free.is_barred(p))
    }

    /// The feasible place nearest to `position` in the planner's frame, to the resolution of the free space's voxels:
    /// `position` itself where it is feasible.
    pub fn settle(&self, position: DVec3) -> DVec3 {
        let mut place = self.region.nearest(position);
        // Each of the two may lead out of the other, by less than a voxel.
        for _ in 0..8 {
            if self.free.is_free(place) {
                break;
            }
            place = self.region.nearest(self.free.project(place));
        }
        if self.free.is_free(place) { place } else { self.free.nearest_drawn(place) }
    }

    /// Squared distance outside the region and its gradient, as the planner's loss has them: that of the shape and the
    /// floor, and that of the free space past a voxel. Twin of `region_violation` in `shaders/glsl/shared/region.glsl`.
    pub fn violation(&self, position: DVec3) -> (f64, DVec3) {
        let (shape, by_shape) = self.region.violation(position);
        let (field, slope) = self.free.clamped_violation(position.as_vec3());
        let deep = (f64::from(field) - self.free.grid.cell).max(0.0);
        (shape + deep * deep, by_shape + 2.0 * deep * slope.as_dvec3())
    }

    /// The region's numbers as the device has them.
    pub fn device_region(&self) -> DeviceRegion {
        DeviceRegion::new(&self.region, &self.free)
    }

    /// Bytes of device memory that it takes.
    pub fn bytes(&self) -> u64 {
        let primitives = match &self.bvh.primitives {
            Primitives::Triangles(triangles) => size_of_val(&triangles[..]),
            Primitives::Discs(discs) => size_of_val(&discs[..]),
        };
        let field = size_of_val(&self.free.distance[..]);
        (size_of_val(&self.bvh.nodes[..]) + primitives + field + size_of::<DeviceRegion>()) as u64
    }
}

/// Surface, region and free space on the device.
pub struct DeviceScene {
    /// The same on the host.
    pub geometry: Arc<SceneGeometry>,
    pub(crate) nodes: Buffer,
    pub(crate) primitives: Buffer,
    pub(crate) region: Buffer,
    pub(crate) free_distance: Buffer,
}

impl DeviceScene {
    /// Uploads a scene.
    ///
    /// # Errors
    /// Where device memory runs out or the device fails.
    pub fn new(context: &Arc<Context>, geometry: impl Into<Arc<SceneGeometry>>) -> Result<Self> {
        let geometry = geometry.into();
        Ok(Self {
            nodes: Buffer::from_slice(context, "nodes", &geometry.bvh.nodes)?,
            primitives: match &geometry.bvh.primitives {
                Primitives::Triangles(triangles) => Buffer::from_slice(context, "primitives", triangles)?,
                Primitives::Discs(discs) => Buffer::from_slice(context, "primitives", discs)?,
            },
            region: Buffer::from_slice(context, "region", &[geometry.device_region()])?,
            free_distance: Buffer::from_slice(context, "free_distance", &geometry.free.distance)?,
            geometry,
        })
    }

    /// Constants of the stages that trace it.
    pub(crate) fn constants(&self) -> TraversalConstants {
        TraversalConstants { discs: matches!(self.geometry.bvh.primitives, Primitives::Discs(_)) }
    }
}

impl DeviceRegion {
    fn new(region: &Region, free: &FreeSpace) -> Self {
        let grid = &free.grid;
        let mut device = Self {
            grid_origin: (grid.origin + 0.5 * grid.cell).as_vec3().to_array(),
            grid_size: grid.dims,
            cell: grid.cell as f32,
            floor_z: region.floor.map_or(-1e30, |floor| floor as f32),
            ..Self::default()
        };
        match region.shape {
            // The planner's frame puts the centre of a shell at the origin.
            Shape::Shell { r_min, r_max, .. } => (device.r_min, device.r_max) = (r_min as f32, r_max as f32),
            Shape::Box { min, max } => {
                device.is_box = 1;
                device.box_min = min.as_vec3().to_array();
                device.box_max = max.as_vec3().to_array();
            }
        }
        device
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::proxy::Orientation;
    use crate::scene::region::Shape;
    use crate::scene::samples::textured::two_rooms_model;
    use crate::scene::volume::{Volume, box_triangles};
    use crate::scene::{random, samples};

    /// If this failed, a planned camera would be nearer to surfaces than the clearance, and move when it is photographed.
    #[test]
    fn every_place_settles_where_cameras_can_stand() {
        let proxy = Proxy::new(&two_rooms_model().surface(), Orientation::Trusted).unwrap();
        let region = Region::inside_room(proxy.bounds(), None, DVec3::Y).unwrap();
        let geometry = SceneGeometry::new(&proxy, &region).unwrap();
        for i in 0..20_000 {
            let [x, y, z, _] = random::uniforms(4, 0, i);
            let settled = geometry.settle(2.4 * DVec3::new(x, y, z) - 1.2);
            assert!(geometry.free.is_free(settled), "{settled} is not free");
            assert_eq!(geometry.settle(settled), settled);
        }
    }

    /// If this failed, a camera beside a volume to keep out of would be pushed into it by the sphere that it must not leave; or viewers
    /// would look from within one that lies outside of the region.
    #[test]
    fn nobody_is_pushed_into_a_volume() {
        let proxy = Proxy::new(&samples::sphere(1.0, 24), Orientation::Trusted).unwrap();
        let shape = Shape::Shell { centre: DVec3::ZERO, r_min: 2.0, r_max: 3.0 };
        let region = Region { shape, up: DVec3::Z, floor: None, clearance: 0.05 };
        let boxes =
            [(DVec3::new(2.2, -1.0, -1.0), DVec3::new(2.999, 0.1, 1.0)), (DVec3::splat(3.2), DVec3::splat(4.0))];
        let volume = |(min, max): (DVec3, DVec3)| Volume { triangles: box_triangles(min, max), ..Volume::default() };
        let limits = Limits { keep_out: boxes.map(volume).to_vec(), ..Limits::default() };
        let geometry = SceneGeometry::among(&proxy, &region, &limits).unwrap();
        let back = geometry.to_internal.inverse();
        for i in 0..5_000 {
            let [x, y, z, _] = random::uniforms(5, 0, i);
            let start = boxes[0].0 - 0.3 + (boxes[0].1 - boxes[0].0 + 0.6) * DVec3::new(x, y, z);
            let settled = geometry.settle(geometry.to_internal.point(start));
            let p = back.point(settled);
            assert!(geometry.free.is_free(settled), "from {start} to {p}, which is not free");
            assert!((p.cmplt(boxes[0].0) | p.cmpgt(boxes[0].1)).any(), "from {start} to {p} in the volume");
        }
        let allowed = |p: DVec3| geometry.is_allowed(geometry.to_internal.point(p));
        assert!(!allowed(DVec3::splat(3.6)) && allowed(DVec3::splat(3.1)) && allowed(DVec3::splat(4.1)));
    }
}

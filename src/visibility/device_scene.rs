//! The surface and the region on the device, in the planner's frame: what rays are cast against and where cameras may
//! stand.

use std::sync::Arc;

use glam::DVec3;

use crate::Result;
use crate::scene::free_space::{self, FreeSpace};
use crate::scene::proxy::Proxy;
use crate::scene::region::{Region, Shape};
use crate::scene::similarity::Similarity;
use crate::visibility::bvh::{Bvh, Primitives};
use crate::vulkan::{Buffer, Context};

crate::gpu_struct! {
    /// Where cameras may stand, in the planner's frame (`Region` in `shared/region_types.glsl`).
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

/// Surface, region and free space, on host and device.
pub struct DeviceScene {
    /// From the user's world to the planner's frame: up is +Z, the region's bounding sphere the unit sphere.
    pub to_internal: Similarity,
    /// The region in the planner's frame.
    pub region: Region,
    /// Its free space.
    pub free: FreeSpace,
    /// The hierarchy over the surface, for rays on the host.
    pub bvh: Bvh,
    /// Bytes of device memory that all of it takes.
    pub bytes: u64,
    pub(crate) nodes: Buffer,
    pub(crate) primitives: Buffer,
    pub(crate) region_buffer: Buffer,
    pub(crate) free_distance: Buffer,
}

impl DeviceScene {
    /// Maps surface and region into the planner's frame and uploads them.
    ///
    /// # Errors
    /// Where the region leaves no free space, the surface cannot be represented, or device memory runs out.
    pub fn new(context: &Arc<Context>, proxy: &Proxy, region: &Region) -> Result<Self> {
        let to_internal = region.to_planner_frame();
        let internal = region.transformed(&to_internal)?;
        let occluder = proxy.occluder.transformed(&to_internal);
        let free = FreeSpace::new(&occluder, &internal, free_space::RESOLUTION)?;
        let bvh = Bvh::new(&proxy.occluder, &to_internal)?;
        let device_region = DeviceRegion::new(&internal, &free);
        let nodes = Buffer::from_slice(context, "nodes", &bvh.nodes)?;
        let primitives = match &bvh.primitives {
            Primitives::Triangles(triangles) => Buffer::from_slice(context, "primitives", triangles)?,
            Primitives::Discs(discs) => Buffer::from_slice(context, "primitives", discs)?,
        };
        let region_buffer = Buffer::from_slice(context, "region", &[device_region])?;
        let free_distance = Buffer::from_slice(context, "free_distance", &free.distance)?;
        let bytes = [&nodes, &primitives, &region_buffer, &free_distance].iter().map(|buffer| buffer.size()).sum();
        Ok(Self { to_internal, region: internal, free, bvh, bytes, nodes, primitives, region_buffer, free_distance })
    }

    /// The feasible place nearest to `position` in the planner's frame, as far as the voxels of the free space can tell:
    /// `position` itself where it is feasible.
    pub fn settle(&self, position: DVec3) -> DVec3 {
        let inside = self.region.nearest(position);
        if self.free.is_free(inside) { inside } else { self.free.project(inside) }
    }

    /// Specialisation constant 5 of every stage that traces: whether the primitives are discs.
    pub(crate) fn discs(&self) -> u32 {
        matches!(self.bvh.primitives, Primitives::Discs(_)) as u32
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

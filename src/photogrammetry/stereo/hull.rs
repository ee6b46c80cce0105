//! The hull: voxels that no mask and no depth rules out.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::frame::StereoView;
use crate::Result;
use crate::engine::vulkan::pace::{Pace, in_parts};
use crate::engine::vulkan::shaders::glsl::photogrammetry::stereo::carve as glsl;
use crate::engine::vulkan::{Buffer, Context, Pipeline};
use crate::scene::voxels::Grid;

/// Coverage of a pixel from which it counts as the object: a thin part does not fill its pixels.
const COVERED: f32 = glsl::COVERED as f32;
/// Views that must see through a voxel for it to be empty; more than have their own depth there.
const VOTES: u32 = glsl::VOTES;

/// A part of the hull stays where it is at least this much of the largest.
const MIN_PART: f64 = 0.01;
/// Workgroups of the first submission.
const FIRST_GROUPS: u32 = 1 << 10;

crate::gpu_struct! {
    /// Push constants of `carve`.
    pub(crate) struct CarvePush {
        /// Lowest corner of the first voxel.
        pub origin: [f32; 3],
        /// Side of a voxel.
        pub cell: f32,
        /// Voxels along x.
        pub cells_x: u32,
        /// Voxels along y.
        pub cells_y: u32,
        /// Voxels along z.
        pub cells_z: u32,
        /// Views that carve.
        pub count: u32,
        /// Views that must hold a voxel.
        pub least: u32,
        /// How far behind a voxel a depth is that sees through it; nearer, it is there.
        pub behind: f32,
        /// First workgroup.
        pub first: u32,
    }
}

crate::stage!(
    /// An invocation per voxel: whether it may be the object.
    pub(crate) CarveStage = carve(CarvePush) { read views, read masks, read depths, write hull } with [StereoView]
);

/// What voxels are carved by.
#[derive(Clone, Copy)]
pub struct Evidence<'a> {
    /// The views.
    pub views: &'a [StereoView],
    /// How much of each pixel the object covers, of all views; 1 where nothing is known.
    pub masks: &'a [f32],
    /// Depths of all views' pixels, 0 where there is none.
    pub depths: &'a [f32],
    /// Views that must hold a voxel.
    pub least: u32,
    /// How far behind a voxel a depth is that sees through it; nearer, it is there.
    pub behind: f32,
}

/// Voxels that may be the object, here and on the device.
pub struct Hull {
    grid: Grid,
    cells: Vec<u32>,
    buffer: Buffer,
}

impl Hull {
    /// No hull: everything may be the object.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn none(context: &Arc<Context>) -> Result<Self> {
        let grid = Grid { origin: DVec3::ZERO, cell: 1.0, dims: [0; 3] };
        Ok(Self { grid, cells: Vec::new(), buffer: Buffer::from_slice(context, "hull", &[0u32])? })
    }

    /// The voxels of `grid` that nothing in the evidence rules out.
    ///
    /// # Errors
    /// Where device memory runs out or the device fails.
    pub fn carve(context: &Arc<Context>, grid: Grid, evidence: &Evidence) -> Result<Self> {
        let pipeline = Pipeline::new::<CarveStage>(context, &())?;
        let views = Buffer::from_slice(context, "views", evidence.views)?;
        let masks = Buffer::from_slice(context, "masks", evidence.masks)?;
        let depths = Buffer::from_slice(context, "depths", evidence.depths)?;
        let buffer = Buffer::device(context, "hull", 4 * grid.voxels() as u64)?;
        let [cells_x, cells_y, cells_z] = grid.dims;
        let push = |first| CarvePush {
            first,
            origin: grid.origin.as_vec3().to_array(),
            cell: grid.cell as f32,
            cells_x,
            cells_y,
            cells_z,
            count: evidence.views.len() as u32,
            least: evidence.least,
            behind: evidence.behind,
        };
        let groups = grid.voxels().div_ceil(64) as u32;
        in_parts(context, &mut Pace::new(context, FIRST_GROUPS), [groups, 1], |commands, part| {
            commands
                .stage(&pipeline, CarveStage { views: &views, masks: &masks, depths: &depths, hull: &buffer })
                .push(&push(part.start))
                .linear(part.len() as u32);
            Ok(())
        })?;
        let mut cells = buffer.download(grid.voxels())?;
        drop_fragments(&mut cells, grid.dims);
        buffer.upload(&cells)?;
        Ok(Self { grid, cells, buffer })
    }

    /// Whether there is a hull at all.
    pub fn exists(&self) -> bool {
        !self.cells.is_empty()
    }

    /// The voxels, 1 where the object may be.
    pub fn cells(&self) -> &[u32] {
        &self.cells
    }

    /// Where the voxels are.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The voxels on the device.
    pub(super) fn buffer(&self) -> &Buffer {
        &self.buffer
    }

    /// The grid as shaders take it: origin, cell, voxels along each axis.
    pub(super) fn device_grid(&self) -> ([f32; 3], f32, [u32; 3]) {
        (self.grid.origin.as_vec3().to_array(), self.grid.cell as f32, self.grid.dims)
    }

    /// Lowest and highest corner of the voxels that may be the object; none where all are ruled out.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let mut bounds: Option<([u32; 3], [u32; 3])> = None;
        for (index, _) in self.cells.iter().enumerate().filter(|(_, cell)| **cell != 0) {
            let at = self.grid.coordinates(index);
            let (low, high) = bounds.get_or_insert((at, at));
            for axis in 0..3 {
                low[axis] = low[axis].min(at[axis]);
                high[axis] = high[axis].max(at[axis]);
            }
        }
        let half = DVec3::splat(0.5 * self.grid.cell);
        bounds.map(|(low, high)| (self.grid.centre(low) - half, self.grid.centre(high) + half))
    }

    /// Points on the hull's surface with unit normals outward: one for each voxel of the hull with a face to the outside,
    /// moved along the gradient of the smoothed voxels to where these are half full.
    pub fn surface(&self) -> Vec<(DVec3, DVec3)> {
        let [nx, ny, nz] = self.grid.dims.map(i64::from);
        let solid: Vec<f32> = self.cells.iter().map(|cell| if *cell != 0 { 1.0 } else { 0.0 }).collect();
        let smooth = blurred(&blurred(&solid, self.grid.dims), self.grid.dims);
        let value = |field: &[f32], [x, y, z]: [i64; 3]| {
            let inside = (0..nx).contains(&x) && (0..ny).contains(&y) && (0..nz).contains(&z);
            if inside { field[((z * ny + y) * nx + x) as usize] } else { 0.0 }
        };
        const FACES: [[i64; 3]; 6] = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];
        let mut points = Vec::new();
        for index in (0..solid.len()).filter(|index| solid[*index] > 0.0) {
            let voxel = self.grid.coordinates(index);
            let [x, y, z] = voxel.map(i64::from);
            let beside = |[i, j, k]: [i64; 3], field: &[f32]| value(field, [x + i, y + j, z + k]);
            if FACES.iter().all(|face| beside(*face, &solid) > 0.0) {
                continue;
            }
            let slope =
                |axis: usize| 0.5 * f64::from(beside(FACES[2 * axis + 1], &smooth) - beside(FACES[2 * axis], &smooth));
            let gradient = DVec3::new(slope(0), slope(1), slope(2));
            // A sheet of one voxel has no outside of its own: which side faces the cameras is unknown.
            let Some(normal) = (-gradient).try_normalize() else { continue };
            let off = ((f64::from(smooth[index]) - 0.5) / gradient.length()).clamp(-1.0, 1.0);
            points.push((self.grid.centre(voxel) + self.grid.cell * off * normal, normal));
        }
        points
    }
}

/// Empties the voxels of parts smaller than [`MIN_PART`] of the largest: what no picture that holds them rules out, because
/// few do.
fn drop_fragments(cells: &mut [u32], dims: [u32; 3]) {
    let [nx, ny, _] = dims.map(|n| n as usize);
    let mut seen = vec![false; cells.len()];
    let mut parts: Vec<Vec<usize>> = Vec::new();
    for start in 0..cells.len() {
        if seen[start] || cells[start] == 0 {
            continue;
        }
        seen[start] = true;
        let mut part = vec![start];
        let mut next = 0;
        while let Some(&at) = part.get(next) {
            next += 1;
            let (x, y) = (at % nx, at / nx % ny);
            let beside = [
                (x > 0).then(|| at - 1),
                (x + 1 < nx).then_some(at + 1),
                (y > 0).then(|| at - nx),
                (y + 1 < ny).then_some(at + nx),
                at.checked_sub(nx * ny),
                Some(at + nx * ny).filter(|above| *above < cells.len()),
            ];
            for other in beside.into_iter().flatten().filter(|other| cells[*other] != 0) {
                if !seen[other] {
                    seen[other] = true;
                    part.push(other);
                }
            }
        }
        parts.push(part);
    }
    let largest = parts.iter().map(Vec::len).max().unwrap_or(0);
    let small = parts.into_iter().filter(|part| (part.len() as f64) < MIN_PART * largest as f64);
    small.flatten().for_each(|at| cells[at] = 0);
}

/// The mean over three voxels along each axis in turn; outside the grid is empty.
fn blurred(field: &[f32], dims: [u32; 3]) -> Vec<f32> {
    let mut field = field.to_vec();
    let strides = [1, dims[0] as usize, dims[0] as usize * dims[1] as usize];
    for (stride, count) in strides.into_iter().zip(dims.map(|n| n as usize)) {
        let source = field.clone();
        for (index, value) in field.iter_mut().enumerate() {
            let at = index / stride % count;
            let before = if at > 0 { source[index - stride] } else { 0.0 };
            let after = if at + 1 < count { source[index + stride] } else { 0.0 };
            *value = (before + source[index] + after) / 3.0;
        }
    }
    field
}

/// Whether the voxel around `p` may be the object: the twin of `carve`.
pub fn carve(evidence: &Evidence, p: Vec3) -> bool {
    let (mut held, mut through, mut there) = (0, 0, 0);
    for view in evidence.views {
        let Some((texel, depth)) = view.texel(p) else { continue };
        held += 1;
        if evidence.masks[texel] < COVERED {
            return false;
        }
        if evidence.depths[texel] > depth + evidence.behind {
            through += 1;
        } else if evidence.depths[texel] >= depth - evidence.behind {
            there += 1;
        }
    }
    let open = through >= VOTES && through > there;
    held >= evidence.least && !open
}

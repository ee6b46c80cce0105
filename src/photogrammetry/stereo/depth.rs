//! Depth maps: the sweep and its refinement on the device.

use std::sync::{Arc, Mutex};

use glam::{DVec3, Vec2};

use super::cost::{NO_MATCH, Plane};
use super::frame::{StereoPair, StereoView};
use super::hull::Hull;
use crate::Result;
use crate::engine::parallel::lock;
use crate::engine::vulkan::pace::{Pace, in_parts};
use crate::engine::vulkan::{Buffer, Context, Pipeline};
use crate::scene::camera::Intrinsics;

crate::gpu_struct! {
    /// Push constants of `plane_sweep`.
    pub(crate) struct SweepPush {
        /// Lowest corner of the hull's first voxel.
        pub origin: [f32; 3],
        /// Side of a voxel.
        pub cell: f32,
        /// Voxels along x; 0 without a hull.
        pub cells_x: u32,
        /// Voxels along y.
        pub cells_y: u32,
        /// Voxels along z.
        pub cells_z: u32,
        /// The view whose depth is looked for.
        pub reference: u32,
        /// Planes that the sweep tries.
        pub hypotheses: u32,
        /// First row of the dispatch.
        pub first_row: u32,
    }
}

crate::stage!(
    /// Depth of each pixel of a view, by planes parallel to its picture.
    pub(crate) PlaneSweepStage = plane_sweep(SweepPush) { read views, read pictures, read pairs, read hull, write planes }
    with [StereoView, StereoPair]
);

crate::gpu_struct! {
    /// Push constants of `refine_depth`.
    pub(crate) struct RefinePush {
        /// Lowest corner of the hull's first voxel.
        pub origin: [f32; 3],
        /// Side of a voxel.
        pub cell: f32,
        /// Voxels along x; 0 without a hull.
        pub cells_x: u32,
        /// Voxels along y.
        pub cells_y: u32,
        /// Voxels along z.
        pub cells_z: u32,
        /// The view that is refined.
        pub reference: u32,
        /// The iteration.
        pub iteration: u32,
        /// Seed of the random moves.
        pub seed: u32,
        /// Pixels to those that planes are taken over from.
        pub reach: i32,
        /// Largest move of a plane, as a fraction of its inverse depth.
        pub shift: f32,
        /// Largest change of slope, as a fraction of inverse depth in a whole picture's width.
        pub turn: f32,
        /// First row of the dispatch.
        pub first_row: u32,
    }
}

crate::stage!(
    /// An iteration of refinement: planes of neighbouring pixels, and random changes of its own.
    pub(crate) RefineDepthStage = refine_depth(RefinePush) {
        read views, read pictures, read pairs, read hull, read planes, write refined,
    } with [StereoView, StereoPair]
);

/// Iterations of refinement: how far planes are taken over from, and the largest move and change of slope.
const ROUNDS: [(i32, f32, f32); 4] = [(1, 0.01, 2.0), (4, 0.005, 1.0), (2, 0.0025, 0.5), (1, 0.00125, 0.25)];

/// Rows of workgroups of the first submission.
const FIRST_ROWS: u32 = 8;

/// Largest change of inverse depth from a pixel to the next within a patch, as a fraction.
const PATCH_STEP: f32 = 0.01;

/// What a view sees, pixel by pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap {
    /// The surface there.
    pub planes: Vec<Plane>,
    /// How badly the neighbours match, 0 to 2; [`NO_MATCH`] where no depth was found.
    pub costs: Vec<f32>,
}

impl DepthMap {
    /// Depth of a pixel; 0 where it has none.
    pub fn depth(&self, pixel: usize) -> f32 {
        if self.costs[pixel] < NO_MATCH { 1.0 / self.planes[pixel].inverse_depth } else { 0.0 }
    }

    /// Removes depths in patches of fewer than `least` pixels; a patch continues from a pixel to the next where inverse depth
    /// changes by at most `PATCH_STEP`. Chance matches seldom have neighbours that agree.
    pub fn drop_specks(&mut self, width: usize, least: usize) {
        let found = |costs: &[f32], i: usize| costs[i] < NO_MATCH;
        let mut seen = vec![false; self.costs.len()];
        for start in 0..self.costs.len() {
            if seen[start] || !found(&self.costs, start) {
                continue;
            }
            let mut patch = vec![start];
            seen[start] = true;
            let mut next = 0;
            while let Some(&at) = patch.get(next) {
                next += 1;
                let x = at % width;
                let beside = [
                    (x > 0).then(|| at - 1),
                    (x + 1 < width).then_some(at + 1),
                    at.checked_sub(width),
                    Some(at + width).filter(|below| *below < self.costs.len()),
                ];
                for other in beside.into_iter().flatten() {
                    let [a, b] = [at, other].map(|i| self.planes[i].inverse_depth);
                    if !seen[other] && found(&self.costs, other) && (a - b).abs() <= PATCH_STEP * a.max(b) {
                        seen[other] = true;
                        patch.push(other);
                    }
                }
            }
            if patch.len() < least {
                patch.into_iter().for_each(|i| self.costs[i] = NO_MATCH);
            }
        }
    }

    /// Takes over the depths in `closed` of pixels that have none in `depths`, with the slope that they have in the picture.
    pub fn close(&mut self, width: usize, depths: &[f32], closed: &[f32]) {
        for at in (0..closed.len()).filter(|at| closed[*at] > 0.0 && depths[*at] <= 0.0) {
            let inverse = |at: Option<usize>| at.and_then(|at| closed.get(at)).filter(|d| **d > 0.0).map(|d| 1.0 / d);
            let own = 1.0 / closed[at];
            let slope = |before: Option<usize>, after: Option<usize>| match (inverse(before), inverse(after)) {
                (Some(before), Some(after)) => 0.5 * (after - before),
                (Some(before), None) => own - before,
                (None, Some(after)) => after - own,
                (None, None) => 0.0,
            };
            let x = at % width;
            let across = slope((x > 0).then(|| at - 1), (x + 1 < width).then_some(at + 1));
            let down = slope(at.checked_sub(width), Some(at + width));
            self.planes[at] = Plane { slope: Vec2::new(across, down), inverse_depth: own };
        }
    }

    /// Unit normal in camera axes of the surface at pixel (x, y) of a row of `intrinsics.width`, towards the camera.
    ///
    /// A plane n . X = 1 has inverse depth n . K^-1 (x, y, 1), so that n is K^T times inverse depth as a form in (x, y, 1).
    pub fn normal(&self, intrinsics: &Intrinsics, [x, y]: [u32; 2]) -> DVec3 {
        let Plane { slope, inverse_depth } = self.planes[(y * intrinsics.width + x) as usize];
        let slope = slope.as_dvec2();
        let [fx, fy] = intrinsics.focal;
        let [cx, cy] = intrinsics.principal;
        let at = glam::DVec2::new(f64::from(x) + 0.5 - cx, f64::from(y) + 0.5 - cy);
        -DVec3::new(fx * slope.x, fy * slope.y, f64::from(inverse_depth) - slope.dot(at)).normalize_or(DVec3::Z)
    }
}

/// Views and their pictures on the device, ready for depth to be looked for.
pub struct Sweeper {
    context: Arc<Context>,
    sweep: Pipeline,
    refine: Pipeline,
    views: Vec<StereoView>,
    /// The views.
    pub(super) view_buffer: Buffer,
    pictures: Buffer,
    pairs: Buffer,
    planes: [Buffer; 2],
    // Of rows of workgroups.
    pace: Mutex<Pace>,
}

impl Sweeper {
    /// Uploads views, the brightness of all their pixels, and their pairs.
    ///
    /// # Errors
    /// Where device memory runs out or the device fails.
    pub fn new(context: &Arc<Context>, views: &[StereoView], pictures: &[f32], pairs: &[StereoPair]) -> Result<Self> {
        let largest = views.iter().map(|view| u64::from(view.width) * u64::from(view.height)).max().unwrap_or(0);
        let planes = || Buffer::device(context, "planes", 16 * largest);
        Ok(Self {
            context: context.clone(),
            sweep: Pipeline::new::<PlaneSweepStage>(context, &())?,
            refine: Pipeline::new::<RefineDepthStage>(context, &())?,
            views: views.to_vec(),
            view_buffer: Buffer::from_slice(context, "views", views)?,
            pictures: Buffer::from_slice(context, "pictures", pictures)?,
            pairs: Buffer::from_slice(context, "pairs", pairs)?,
            planes: [planes()?, planes()?],
            pace: Mutex::new(Pace::new(context, FIRST_ROWS)),
        })
    }

    /// Depth of view `reference` from so many planes, after at most `rounds` iterations of refinement.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn depth(&self, reference: usize, hypotheses: u32, rounds: usize, hull: &Hull, seed: u64) -> Result<DepthMap> {
        let view = &self.views[reference];
        let ([origin_x, origin_y, origin_z], cell, [cells_x, cells_y, cells_z]) = hull.device_grid();
        let origin = [origin_x, origin_y, origin_z];
        let reference = reference as u32;
        let rounds = rounds.min(ROUNDS.len());
        let columns = view.width.div_ceil(8);
        // Rows of workgroups of all passes, one pass after another.
        let rows = view.height.div_ceil(8);
        in_parts(&self.context, &mut lock(&self.pace), [rows * (1 + rounds as u32), 1], |commands, part| {
            let mut at = part.start;
            while at < part.end {
                let (pass, row) = ((at / rows) as usize, at % rows);
                let count = (rows - row).min(part.end - at);
                let groups = [columns, count, 1];
                let first_row = 8 * row;
                at += count;
                let Some((reach, shift, turn)) = pass.checked_sub(1).map(|round| ROUNDS[round]) else {
                    let push = SweepPush { origin, cell, cells_x, cells_y, cells_z, reference, hypotheses, first_row };
                    commands
                        .stage(
                            &self.sweep,
                            PlaneSweepStage {
                                views: &self.view_buffer,
                                pictures: &self.pictures,
                                pairs: &self.pairs,
                                hull: hull.buffer(),
                                planes: &self.planes[0],
                            },
                        )
                        .push(&push)
                        .groups(groups);
                    continue;
                };
                let [from, to] = [(pass + 1) % 2, pass % 2].map(|i| &self.planes[i]);
                commands
                    .stage(
                        &self.refine,
                        RefineDepthStage {
                            views: &self.view_buffer,
                            pictures: &self.pictures,
                            pairs: &self.pairs,
                            hull: hull.buffer(),
                            planes: from,
                            refined: to,
                        },
                    )
                    .push(&RefinePush {
                        origin,
                        cell,
                        cells_x,
                        cells_y,
                        cells_z,
                        reference,
                        iteration: pass as u32 - 1,
                        seed: seed as u32,
                        reach,
                        shift,
                        turn,
                        first_row,
                    })
                    .groups(groups);
            }
            Ok(())
        })?;
        let found: Vec<[f32; 4]> = self.planes[rounds % 2].download((view.width * view.height) as usize)?;
        let plane =
            |[x, y, inverse_depth, _]: &[f32; 4]| Plane { slope: Vec2::new(*x, *y), inverse_depth: *inverse_depth };
        Ok(DepthMap { planes: found.iter().map(plane).collect(), costs: found.iter().map(|found| found[3]).collect() })
    }
}

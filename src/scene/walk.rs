//! Ground that the photographer can walk to.

use glam::DVec3;

use super::distance_transform::nearest_sites;
use super::limits::{Limits, Walk};
use super::proxy::Occluder;
use super::voxels::{Grid, touched};
use crate::{Error, Result};

/// Most voxels between the feet and the head.
const MAX_LAYERS: f64 = 1000.0;
/// Part of the walker's height that feet are lifted over: thresholds, carpets and cables do not stop the walker.
const STEP: f64 = 0.15;

/// The places on level ground that are connected with the start of a walk, from above.
pub(super) struct Ground {
    /// A single layer.
    grid: Grid,
    reached: Vec<bool>,
    /// Height of the feet.
    feet: f64,
    /// By column, the lowest thing above the head.
    ceiling: Vec<f64>,
}

impl Ground {
    /// Of the columns of a grid, up along +Z, those whose ground can be walked to. The walker is an upright cylinder that may not
    /// touch the surface, walls and the volumes of `limits`, between a step's height and the head.
    ///
    /// # Errors
    /// [`Error::Request`] where the start is outside of the region, or it is blocked or has no ground under it.
    pub(super) fn new(
        around: &Grid,
        (surface, occupied, floor): (&Occluder, &[bool], Option<f64>),
        limits: &Limits,
        walk: Walk,
    ) -> Result<Self> {
        let cell = around.cell;
        let (foot, head) = (walk.start.z + STEP * walk.height, walk.start.z + walk.height);
        let layers = (head - foot) / cell;
        if !(1.0..MAX_LAYERS).contains(&layers) {
            let what = if layers < 1.0 { "low for voxels of a region so large" } else { "high for a region so small" };
            return Err(Error::request(format!("`walk`: whoever walks is too {what}; give another height or region")));
        }
        // Those that fit, from the head down: one more would reach to the ground.
        let layers = layers as u32;
        let [nx, ny, _] = around.dims;
        let origin = DVec3::new(around.origin.x, around.origin.y, head - f64::from(layers) * cell);
        let body = Grid { origin, cell, dims: [nx, ny, layers] };
        let mut taken = touched(&body, surface);
        limits.fill_volumes(&body, &mut taken);
        let grid = Grid { dims: [nx, ny, 1], ..body };
        let columns = grid.voxels();
        let blocked = |column: usize| {
            let foot = grid.centre(grid.coordinates(column));
            // A wall is a plane: what is in front of it at both ends is so all along.
            limits.behind_a_wall(foot)
                || limits.behind_a_wall(foot.with_z(head))
                || (0..layers as usize).any(|layer| taken[layer * columns + column])
        };
        let blocked: Vec<bool> = (0..columns).map(blocked).collect();
        let nearest = nearest_sites(grid.dims, |column| blocked[column]);
        let free = |column: usize| {
            let site = nearest[column];
            if site == u32::MAX {
                return true;
            }
            let here = grid.centre(grid.coordinates(column));
            // From the centre to the near side of what blocks.
            here.distance(grid.centre(grid.coordinates(site as usize))) - 0.5 * cell >= walk.radius
        };
        let free: Vec<bool> = (0..columns).map(free).collect();
        let start = DVec3::new(walk.start.x, walk.start.y, grid.origin.z + 0.5 * cell);
        let at = grid.index(grid.voxel(start));
        let within = (start - grid.centre(grid.coordinates(at))).abs().max_element() <= cell;
        if !within {
            return Err(Error::request(
                "`walk`: its start is outside of the region; give a place on the floor within it",
            ));
        }
        if !free[at] {
            return Err(Error::request(
                "`walk`: there is no room at its start for somebody of this radius and height: something stands there, or the feet are \
                 below the floor; give a place on open floor",
            ));
        }
        let height_of = |layer: u32| around.origin.z + f64::from(layer) * cell;
        let touched_at = |column: usize, layer: u32| occupied[layer as usize * columns + column];
        let mut below =
            (0..around.dims[2]).rev().filter(|layer| height_of(layer + 1) <= walk.start.z + STEP * walk.height);
        let ground = below.find(|layer| touched_at(at, *layer)).map(|layer| height_of(layer + 1));
        let ground = ground.into_iter().chain(floor).reduce(f64::max);
        let outside = !(height_of(0) - walk.height..=height_of(around.dims[2])).contains(&walk.start.z);
        // Of a surface without a floor nothing is known.
        if outside || ground.is_some_and(|ground| ground < walk.start.z - STEP * walk.height - cell) {
            return Err(Error::request(
                "`walk`: there is no ground under its start; give the place where the feet are, with the height along `up`",
            ));
        }
        let lowest_above = |column: usize| {
            let above = (0..around.dims[2]).find(|layer| height_of(*layer) >= head && touched_at(column, *layer));
            above.map_or(f64::INFINITY, height_of)
        };
        let ceiling = (0..columns).map(lowest_above).collect();
        let mut reached = vec![false; columns];
        reached[at] = true;
        let mut next = vec![at];
        while let Some(column) = next.pop() {
            let [x, y, _] = grid.coordinates(column);
            let sides = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
            for (x, y) in sides.into_iter().filter(|(x, y)| *x < nx && *y < ny) {
                let side = grid.index([x, y, 0]);
                if free[side] && !reached[side] {
                    reached[side] = true;
                    next.push(side);
                }
            }
        }
        Ok(Self { grid, reached, feet: walk.start.z, ceiling })
    }

    /// Whether `p` is above ground that is reached, with nothing between.
    pub(super) fn holds(&self, p: DVec3) -> bool {
        let column = self.grid.index(self.grid.voxel(DVec3::new(p.x, p.y, self.grid.origin.z)));
        self.reached[column] && (self.feet..self.ceiling[column]).contains(&p.z)
    }
}

impl Limits {
    /// For every voxel, whether the limits of cameras alone bar it, where the surface touches the `occupied` ones and none are
    /// below the floor; empty where there are none. A voxel that only reaches into the heights is not barred. Up is +Z.
    ///
    /// # Errors
    /// [`Error::Request`] where the start of the walk is blocked.
    pub(super) fn barred_for_cameras(
        &self,
        grid: &Grid,
        surface: &Occluder,
        (occupied, floor): (&[bool], Option<f64>),
    ) -> Result<Vec<bool>> {
        if !self.narrows() {
            return Ok(Vec::new());
        }
        let ground = self.walk.map(|walk| Ground::new(grid, (surface, occupied, floor), self, walk)).transpose()?;
        let half = 0.5 * grid.cell;
        let barred = |i: usize| {
            let centre = grid.centre(grid.coordinates(i));
            self.heights.is_some_and(|[low, high]| centre.z + half <= low || centre.z - half >= high)
                || ground.as_ref().is_some_and(|ground| !ground.holds(centre))
        };
        Ok((0..grid.voxels()).map(barred).collect())
    }
}

//! Free space: where a camera can be without touching anything, as a field of distances on a voxel grid.

use glam::{DVec3, Vec3};

use super::connected::{Air, best_component, connected_with};
use super::distance_transform::nearest_sites;
use super::enclosure::{Indoors, indoors};
use super::known::KnownSpace;
use super::limits::Limits;
use super::proxy::Occluder;
use super::random;
use super::region::{Region, Shape};
pub use super::voxels::Grid;
use super::voxels::{touched, touched_by};
use crate::{Error, Result};

/// Default number of voxels along the region's longest side.
pub const RESOLUTION: u32 = 96;
/// From the centre of a voxel to its corners, in sides.
const HALF_DIAGONAL: f64 = 0.87;
/// Alternating projections onto a voxel and the region; where they meet at all a few are enough.
const PROJECTIONS: u32 = 16;
/// Most voxels of a grid: a gigabyte of scratch.
const MAX_VOXELS: f64 = 6.4e7;

/// The voxels where a camera may be, and the distance of every voxel to them, in the frame of the occluder it was made
/// from.
///
/// A voxel is free where it may hold a point of the region above the floor, the surface does not touch it, its
/// centre is at least the clearance away from the centre of every voxel that the surface touches, and it is connected
/// (through faces) to the largest such set, which leaves out the insides of closed furniture and what lies behind a
/// wall; where photos were taken, to where they were. Of a box around a room what lies beyond its walls is left out.
/// Any point of a free voxel is at least clearance - sqrt(3) cells away from the surface. Limits bar voxels too; heights,
/// which a voxel may be larger than, hold within it.
#[derive(Clone, Debug)]
pub struct FreeSpace {
    /// The voxel grid; it reaches beyond the region by the clearance.
    pub grid: Grid,
    /// Distance from each voxel's centre to the nearest free voxel, zero for free ones; x runs fastest.
    pub distance: Vec<f32>,
    /// Fraction of the voxels within the region that are free.
    pub free_fraction: f64,
    /// Fraction of the places that would be free, were they connected with the rest.
    pub unconnected: f64,
    /// Fraction of what would be free that lies beyond the walls of the room that the box surrounds.
    pub beyond: f64,
    /// Lowest and highest corner of what may be a room, where free space is not in it.
    pub elsewhere: Option<[DVec3; 2]>,
    /// The region.
    pub region: Region,
    /// Index of the free voxel nearest to each voxel.
    nearest: Vec<u32>,
    /// Indices of the free voxels that positions are drawn from.
    free: Vec<u32>,
    /// Voxels that the surface touches.
    touched: Vec<bool>,
    /// Voxels that limits bar; empty where there are none.
    barred: Vec<bool>,
    /// Lowest and greatest z, where they are limited.
    heights: Option<[f64; 2]>,
}

impl FreeSpace {
    /// The free space of a region around a surface in the same frame, with `resolution` voxels along the region's longest
    /// side.
    ///
    /// # Errors
    /// [`Error::Request`] where no voxel is free, or the grid would be too large or too coarse.
    pub fn new(occluder: &Occluder, region: &Region, resolution: u32) -> Result<Self> {
        Self::among(occluder, region, &Limits::default(), resolution)
    }

    /// As [`FreeSpace::new`], within limits in the same frame, whose up is +Z.
    ///
    /// # Errors
    /// As [`FreeSpace::new`], also where the limits leave nothing.
    pub fn among(occluder: &Occluder, region: &Region, limits: &Limits, resolution: u32) -> Result<Self> {
        Self::with_everybody(occluder, 0, region, limits, resolution).map(|(own, _)| own)
    }

    /// The free space within all limits, and the one within those that apply to viewers too, where others exist. The second is
    /// connected, and the first a part of it: of several unconnected spaces the one of which most is left. The last `assumed` primitives
    /// of the surface are walls that nobody saw: they block, and say nothing of where a room ends.
    ///
    /// # Errors
    /// As [`FreeSpace::among`].
    pub fn with_everybody(
        occluder: &Occluder,
        assumed: usize,
        region: &Region,
        limits: &Limits,
        resolution: u32,
    ) -> Result<(Self, Option<Self>)> {
        let grid = grid_around(region, resolution)?;
        let occupied = touched(&grid, occluder);
        let shared = limits.barred_for_everybody(&grid);
        let own = limits.barred_for_cameras(&grid, occluder, (&occupied, region.floor))?;
        let is_barred = |barred: &[bool], i: usize| barred.get(i).is_some_and(|barred| *barred);
        let surface = nearest_sites(grid.dims, |i| occupied[i]);
        let clearance = region.clearance / grid.cell;
        let (mut within, mut open) = (0, vec![false; grid.voxels()]);
        for (i, open) in open.iter_mut().enumerate() {
            let voxel = grid.coordinates(i);
            // A voxel counts where the shape may cut it: a shell thinner than a voxel is still one piece.
            let centre = grid.centre(voxel);
            if region.nearest(centre).distance(centre) <= HALF_DIAGONAL * grid.cell {
                within += 1;
                *open = !occupied[i]
                    && !is_barred(&shared, i)
                    && (surface[i] == u32::MAX
                        || offset(voxel, grid.coordinates(surface[i] as usize)).length() >= clearance)
                    // Next to a limit the nearest place of the region may be barred.
                    && (limits.is_empty() || place_in(&grid, voxel, region, None).is_some());
            }
        }
        let heights = limits.heights;
        let is_own = |i: &u32| {
            !is_barred(&own, *i as usize)
                && (heights.is_none() || place_in(&grid, grid.coordinates(*i as usize), region, heights).is_some())
        };
        let photos: Vec<DVec3> = limits.space.iter().flat_map(KnownSpace::photos).collect();
        let count = |some: &[u32]| some.iter().filter(|i| is_own(i)).count();
        let Indoors { space: component, beyond, elsewhere } = if !photos.is_empty() {
            // Next to a thing a photo's own place may be nearer to it than the clearance.
            let near = |p: &DVec3| grid.around(*p, *p, region.clearance + grid.cell);
            connected_with(&grid, &open, photos.iter().filter(|p| grid.holds(**p)).flat_map(near)).into()
        } else if matches!(region.shape, Shape::Box { .. }) && limits.space.is_none() {
            let seen = (assumed > 0).then(|| touched_by(&grid, occluder, occluder.len() - assumed));
            indoors(&grid, seen.as_ref().unwrap_or(&occupied), &mut open, count)
        } else {
            best_component(&grid, &open, count).into()
        };
        let free: Vec<u32> = component.iter().copied().filter(is_own).collect();
        if free.is_empty() {
            return Err(Error::request(if limits.is_empty() {
                "region: no free space; every position is closer than the clearance to the surface: enlarge the region or lower `clearance`"
            } else {
                "region: no free space; `wall`, `keep_out`, `heights`, `walk` and `space` leave nothing of it that is as far from the surface \
                 as the clearance: allow more, or lower `clearance`"
            }));
        }
        let all_open = open.iter().filter(|open| **open).count().max(1);
        let unconnected = 1.0 - component.len() as f64 / all_open as f64;
        let barred = if own.is_empty() {
            shared.clone()
        } else {
            (0..grid.voxels()).map(|i| is_barred(&shared, i) || own[i]).collect()
        };
        let space = |free: Vec<u32>, barred: Vec<bool>, heights: Option<[f64; 2]>, touched: Vec<bool>| {
            let mut is_free = vec![false; grid.voxels()];
            for i in &free {
                is_free[*i as usize] = true;
            }
            let nearest = nearest_sites(grid.dims, |i| is_free[i]);
            let to_box = |(i, site): (usize, &u32)| {
                let centres = offset(grid.coordinates(i), grid.coordinates(*site as usize));
                ((centres.abs() - 0.5).max(DVec3::ZERO).length() * grid.cell) as f32
            };
            let distance = nearest.iter().enumerate().map(to_box).collect();
            let free_fraction = free.len() as f64 / f64::from(within);
            // Positions are drawn from voxels whose centre is in the region, unless it is too thin to have any.
            let inside = |i: &&u32| region.contains(grid.centre(grid.coordinates(**i as usize)));
            let well_inside: Vec<u32> = free.iter().filter(inside).copied().collect();
            let free = if well_inside.is_empty() { free } else { well_inside };
            Self {
                grid,
                distance,
                free_fraction,
                unconnected,
                beyond,
                elsewhere,
                region: *region,
                nearest,
                free,
                touched,
                barred,
                heights,
            }
        };
        let everybody = limits.narrows().then(|| space(component, shared, None, occupied.clone()));
        Ok((space(free, barred, heights, occupied), everybody))
    }

    /// Distance from `p` to free space and its gradient, interpolated trilinearly between voxel centres: zero where all
    /// eight voxels around are free. Outside the grid the distance to the grid is added.
    pub fn violation(&self, p: Vec3) -> (f32, Vec3) {
        let cell = self.grid.cell as f32;
        let scaled = (p - self.grid.origin.as_vec3()) / cell - 0.5;
        let last = Vec3::from_array(self.grid.dims.map(|n| (n - 1) as f32));
        let held = scaled.clamp(Vec3::ZERO, last);
        let (value, gradient) = self.interpolated(held);
        let outside = (scaled - held) * cell;
        let beyond = outside.length();
        if beyond == 0.0 {
            return (value, gradient);
        }
        let within = Vec3::select(outside.cmpeq(Vec3::ZERO), gradient, Vec3::ZERO);
        (value + beyond, within + outside / beyond)
    }

    /// The same as the device has it (`free_space` in `shaders/glsl/shared/region.glsl`): outside the grid that of the
    /// place on its edge nearest to `p`, since the shape of the region, which the grid surrounds, pulls back from there.
    pub fn clamped_violation(&self, p: Vec3) -> (f32, Vec3) {
        let first = (self.grid.origin + 0.5 * self.grid.cell).as_vec3();
        let last = Vec3::from_array(self.grid.dims.map(|n| n as f32 - 1.001));
        self.interpolated(((p - first) / self.grid.cell as f32).clamp(Vec3::ZERO, last))
    }

    /// The field and its gradient at `held`, counted in voxels from the centre of the first and within the last.
    fn interpolated(&self, held: Vec3) -> (f32, Vec3) {
        let last = Vec3::from_array(self.grid.dims.map(|n| (n - 1) as f32));
        // The lower voxel of the pair along each axis; every axis has at least two voxels.
        let low = held.floor().min(last - 1.0);
        let t = held - low;
        let [x, y, z] = low.to_array().map(|v| v as u32);
        let at = |dx, dy, dz| self.distance[self.grid.index([x + dx, y + dy, z + dz])];
        let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let along_x = |dy, dz| lerp(at(0, dy, dz), at(1, dy, dz), t.x);
        let along_xy = |dz| lerp(along_x(0, dz), along_x(1, dz), t.y);
        let slope_x = |dy, dz| at(1, dy, dz) - at(0, dy, dz);
        let slope_y = |dz| along_x(1, dz) - along_x(0, dz);
        let value = lerp(along_xy(0), along_xy(1), t.z);
        let gradient = Vec3::new(
            lerp(lerp(slope_x(0, 0), slope_x(1, 0), t.y), lerp(slope_x(0, 1), slope_x(1, 1), t.y), t.z),
            lerp(slope_y(0), slope_y(1), t.z),
            along_xy(1) - along_xy(0),
        );
        (value, gradient / self.grid.cell as f32)
    }

    /// The open air: what is connected with free space, however near to the surface, also beyond the region.
    pub fn air(&self) -> Air {
        let open = |i: usize| !self.touched[i] && !self.barred.get(i).is_some_and(|barred| *barred);
        Air::new(self.grid, self.free.iter().map(|i| *i as usize), open)
    }

    /// For every voxel, whether a camera may pass it on its way: as far from the surface as the clearance, not barred, and neither below
    /// the floor nor wholly beyond the heights. The shape of the region does not count, which is where photos are taken.
    pub(super) fn passable(&self) -> Vec<bool> {
        let surface = nearest_sites(self.grid.dims, |i| self.touched[i]);
        let clearance = self.region.clearance / self.grid.cell;
        let ([low, high], half) = (self.height_range(), 0.5 * self.grid.cell);
        let passable = |(i, site): (usize, &u32)| {
            let voxel = self.grid.coordinates(i);
            let height = self.grid.centre(voxel).z;
            let far = *site == u32::MAX || offset(voxel, self.grid.coordinates(*site as usize)).length() >= clearance;
            let barred = self.barred.get(i).is_some_and(|barred| *barred);
            self.nearest[i] as usize == i
                || (far && !self.touched[i] && !barred && height + half > low && height - half < high)
        };
        surface.iter().enumerate().map(passable).collect()
    }

    /// Least and greatest height that floor and limits allow.
    pub(super) fn height_range(&self) -> [f64; 2] {
        let [low, high] = self.heights.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        [self.region.floor.map_or(low, |floor| low.max(floor)), high]
    }

    /// Whether limits bar the voxel that `p` lies in; never outside of the grid.
    pub fn is_barred(&self, p: DVec3) -> bool {
        self.grid.holds(p) && self.barred.get(self.grid.index(self.grid.voxel(p))).is_some_and(|barred| *barred)
    }

    /// Whether `p` lies in a free voxel, between the heights.
    pub fn is_free(&self, p: DVec3) -> bool {
        if self.heights.is_some_and(|[low, high]| !(low..=high).contains(&p.z)) {
            return false;
        }
        let cell = ((p - self.grid.origin) / self.grid.cell).floor();
        let dims = DVec3::from_array(self.grid.dims.map(f64::from));
        let voxel = self.grid.index(self.grid.voxel(p));
        cell.cmpge(DVec3::ZERO).all() && cell.cmplt(dims).all() && self.nearest[voxel] as usize == voxel
    }

    /// A free position near `p`: `p` itself where it is free, else the nearest position of the free voxel nearest to
    /// `p`'s voxel.
    pub fn project(&self, p: DVec3) -> DVec3 {
        if self.is_free(p) {
            return p;
        }
        let p = self.between_heights(p);
        let site = self.nearest[self.grid.index(self.grid.voxel(p))];
        let centre = self.grid.centre(self.grid.coordinates(site as usize));
        // A little inside, so that rounding cannot put it into the neighbour.
        let half = 0.499 * self.grid.cell;
        self.between_heights(p.clamp(centre - half, centre + half))
    }

    /// `p` raised or lowered to where the heights allow it.
    fn between_heights(&self, p: DVec3) -> DVec3 {
        self.heights.map_or(p, |[low, high]| p.with_z(p.z.clamp(low, high)))
    }

    /// A position that is free and within the region, uniform over free space but for voxels cut by the region's
    /// boundary, whose outer part is not drawn.
    pub fn sample(&self, seed: u64, stream: u32, index: u32) -> DVec3 {
        let mut words = random::bits(seed, stream, index);
        // At most as many voxels as fit 32 bits.
        let site = self.free[random::below(words[0], self.free.len() as u32) as usize];
        let half = 0.5 * self.grid.cell;
        let centre = self.grid.centre(self.grid.coordinates(site as usize));
        for _ in 0..64 {
            let [_, x, y, z] = words.map(|word| f64::from(random::uniform(word)) - 0.5);
            let mut p = centre + self.grid.cell * DVec3::new(x, y, z);
            if let Some([lowest, highest]) = self.heights {
                // A free voxel reaches into the heights.
                let (low, high) = ((centre.z - half).max(lowest), (centre.z + half).min(highest));
                p.z = low + (high - low) * (z + 0.5);
            }
            if self.is_free(p) && self.region.contains(p) {
                return p;
            }
            words = random::pcg4d(words);
        }
        self.place(site)
    }

    /// The free place whose voxel is nearest to `p`, of the voxels that positions are drawn from.
    pub fn nearest_drawn(&self, p: DVec3) -> DVec3 {
        let away = |i: &u32| self.grid.centre(self.grid.coordinates(*i as usize)).distance_squared(p);
        let nearest = self.free.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
        nearest.map_or(p, |site| self.place(*site))
    }

    /// A place in a free voxel, in the region and between the heights.
    fn place(&self, site: u32) -> DVec3 {
        let voxel = self.grid.coordinates(site as usize);
        let place = place_in(&self.grid, voxel, &self.region, self.heights);
        place.unwrap_or_else(|| self.between_heights(self.region.nearest(self.grid.centre(voxel))))
    }
}

/// A place in a voxel that the region and the heights allow, by alternating projections; none where none is found.
fn place_in(grid: &Grid, voxel: [u32; 3], region: &Region, heights: Option<[f64; 2]>) -> Option<DVec3> {
    let (centre, half) = (grid.centre(voxel), DVec3::splat(0.499 * grid.cell));
    let (mut low, mut high) = (centre - half, centre + half);
    if let Some([lowest, highest]) = heights {
        (low.z, high.z) = (low.z.max(lowest), high.z.min(highest));
    }
    if low.z > high.z {
        return None;
    }
    let mut place = centre.clamp(low, high);
    for _ in 0..PROJECTIONS {
        let in_region = region.nearest(place);
        if in_region.cmpge(low).all() && in_region.cmple(high).all() {
            return Some(in_region);
        }
        place = in_region.clamp(low, high);
    }
    None
}

/// The grid over the region's bounds, widened by the clearance and a voxel so that surfaces just outside count.
fn grid_around(region: &Region, resolution: u32) -> Result<Grid> {
    let (min, max) = region.bounds();
    let cell = (max - min).max_element() / f64::from(resolution.max(1));
    let margin = (region.clearance / cell).ceil() + 1.0;
    let dims = ((max - min) / cell).map(|n| (n - 1e-9).ceil().max(1.0)) + 2.0 * margin;
    if resolution == 0 || dims.element_product() > MAX_VOXELS {
        return Err(Error::request(format!(
            "region: {resolution} voxels along its longest side make a grid of {dims}; give a smaller clearance (`clearance`) or fewer voxels"
        )));
    }
    let size = cell * dims;
    // Below MAX_VOXELS voxels, so each side fits.
    let dims = dims.to_array().map(|n| n as u32);
    Ok(Grid { origin: 0.5 * (min + max) - 0.5 * size, cell, dims })
}

/// From voxel `b` to voxel `a`, in voxels.
fn offset(a: [u32; 3], b: [u32; 3]) -> DVec3 {
    DVec3::from_array(a.map(f64::from)) - DVec3::from_array(b.map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::proxy::{Orientation, Proxy};
    use crate::scene::region::Shape;
    use crate::scene::samples;

    fn spot(i: u32) -> DVec3 {
        let [x, y, z, _] = random::uniforms(3, 0, i);
        DVec3::new(x, y, z)
    }

    /// A unit cube in a box around it: free outside the cube by the clearance.
    fn around_cube(resolution: u32) -> FreeSpace {
        let proxy = Proxy::new(&samples::cube(), Orientation::Trusted).unwrap();
        let shape = Shape::Box { min: DVec3::splat(-1.5), max: DVec3::splat(1.5) };
        let region = Region { shape, up: DVec3::Z, floor: None, clearance: 0.2 };
        FreeSpace::new(&proxy.occluder, &region, resolution).unwrap()
    }

    fn to_cube(p: DVec3) -> f64 {
        (p.abs() - 0.5).max(DVec3::ZERO).length()
    }

    /// Cameras must keep the clearance, to the promised rule, must not be inside a closed piece, and must not be kept from free
    /// space.
    #[test]
    fn free_space_keeps_the_clearance_and_no_more() {
        let space = around_cube(48);
        let diagonal = 3f64.sqrt() * space.grid.cell;
        for i in 0..4000 {
            let p = 3.0 * spot(i) - 1.5;
            if space.is_free(p) {
                assert!(to_cube(p) >= 0.2 - diagonal, "{p} is too near");
            } else {
                assert!(to_cube(p) <= 0.2 + diagonal, "{p} has room");
            }
        }
        let expected = 1.0 - (1.0 + 6.0 * 0.2 + 3.0 * std::f64::consts::PI * 0.04 + 4.2 * 0.008) / 27.0;
        assert!((space.free_fraction - expected).abs() < 0.02, "{} of {expected}", space.free_fraction);
    }

    /// The field drives cameras back: it must vanish in the open, be the distance elsewhere, and point the shortest way.
    #[test]
    fn the_field_is_the_distance_to_free_space() {
        let space = around_cube(48);
        for i in 0..4000 {
            let p = 4.4 * spot(i) - 2.2;
            let (value, gradient) = space.violation(p.as_vec3());
            let truth = (p.abs() - 1.5).max(DVec3::ZERO).length();
            let inside = if truth > 0.0 { truth } else { (0.7 - p.abs().max_element()).max(0.0) };
            // Except at the rounded corners of the clearance, the distance is known.
            if to_cube(p) == 0.0 || truth > 0.0 {
                assert!((f64::from(value) - inside).abs() < 2.0 * space.grid.cell, "{value} for {inside} at {p}");
            }
            if value > 0.0 {
                let shorter = space.violation(p.as_vec3() - 0.2 * space.grid.cell as f32 * gradient).0;
                assert!(shorter <= value + 1e-6);
            }
        }
        assert_eq!(space.violation(Vec3::new(1.1, 0.0, 0.3)), (0.0, Vec3::ZERO));
    }

    /// The gradient must be that of the interpolated value, inside the grid and out.
    #[test]
    fn the_gradient_is_that_of_finite_differences() {
        let space = around_cube(24);
        let h = 1e-3;
        for i in 0..500 {
            let p = (4.4 * spot(i) - 2.2).as_vec3();
            let step = |d: Vec3| (space.violation(p + d).0 - space.violation(p - d).0) / (2.0 * h);
            let difference = Vec3::new(step(Vec3::X * h), step(Vec3::Y * h), step(Vec3::Z * h));
            let scaled = (p - space.grid.origin.as_vec3()) / space.grid.cell as f32 - 0.5;
            // Kinks of the interpolation lie on the planes through voxel centres.
            if (scaled - scaled.round()).abs().min_element() > 0.02 {
                assert!((difference - space.violation(p).1).length() < 5e-3, "{p}");
            }
        }
    }

    /// What the planner draws and repairs must be free, or cameras start inside furniture.
    #[test]
    fn samples_and_projections_are_free() {
        let space = around_cube(32);
        let mut mean = DVec3::ZERO;
        for i in 0..2000 {
            let p = space.sample(1, 0, i);
            assert!(space.is_free(p) && space.region.contains(p));
            mean += p / 2000.0;
            let q = 6.0 * spot(i) - 3.0;
            let projected = space.project(q);
            assert!(space.is_free(projected), "{q} -> {projected}");
            assert!(projected.distance(q) <= f64::from(space.violation(q.as_vec3()).0) + 1.8 * space.grid.cell);
        }
        assert!(mean.length() < 0.1, "samples lean toward {mean}");
    }

    /// The sealed inside of a larger piece of furniture is not feasible, and neither is outside the walls.
    #[test]
    fn sealed_rooms_are_left_out() {
        let Occluder::Triangles(cube) = Proxy::new(&samples::cube(), Orientation::Trusted).unwrap().occluder else {
            unreachable!()
        };
        let walls = cube.iter().map(|t| t.map(|p| 4.0 * p));
        let occluder = Occluder::Triangles(cube.iter().copied().chain(walls).collect());
        let shape = Shape::Box { min: DVec3::splat(-2.2), max: DVec3::splat(2.2) };
        let region = Region { shape, up: DVec3::Z, floor: None, clearance: 0.05 };
        let space = FreeSpace::new(&occluder, &region, 64).unwrap();
        assert!(!space.is_free(DVec3::ZERO) && !space.is_free(DVec3::splat(2.15)));
        assert!(space.is_free(DVec3::ONE));
    }

    /// A clearance larger than the room must end with advice, not with cameras nowhere.
    #[test]
    fn no_free_space_is_an_error_that_says_what_to_change() {
        let proxy = Proxy::new(&samples::cube(), Orientation::Trusted).unwrap();
        let shape = Shape::Box { min: DVec3::splat(-0.4), max: DVec3::splat(0.4) };
        let region = Region { shape, up: DVec3::Z, floor: None, clearance: 0.6 };
        let message = FreeSpace::new(&proxy.occluder, &region, 16).unwrap_err().to_string();
        assert!(message.contains("`clearance`") && !message.contains('\n'), "{message}");
        assert!(FreeSpace::new(&proxy.occluder, &region, 0).is_err());
        assert!(FreeSpace::new(&proxy.occluder, &region, 100_000).is_err());
    }
}

//! Which voxels of a grid a surface touches.

use glam::DVec3;

use super::distances::leg_to_point;
use super::proxy::{Disc, Occluder};

/// An axis-aligned grid of cubic voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Lowest corner of the first voxel.
    pub origin: DVec3,
    /// Side of a voxel.
    pub cell: f64,
    /// Voxels along x, y and z; x runs fastest.
    pub dims: [u32; 3],
}

impl Grid {
    /// The grid over a box with so many voxels along its longest side, and one more around.
    pub(super) fn over(low: DVec3, high: DVec3, resolution: f64) -> Self {
        let cell = (high - low).max_element() / resolution;
        let dims = ((high - low) / cell - 1e-9).ceil().max(DVec3::ONE) + 2.0;
        // Each side is at most the resolution and two more.
        Self { origin: 0.5 * (low + high) - 0.5 * cell * dims, cell, dims: dims.to_array().map(|n| n as u32) }
    }

    /// Indices of the voxels whose centres are within `radius` of the straight way from `a` to `b`, and those that `a` and `b` lie in.
    pub(super) fn around(&self, a: DVec3, b: DVec3, radius: f64) -> impl Iterator<Item = usize> + '_ {
        let ends = [a, b].map(|p| self.index(self.voxel(p)));
        let near = self.overlapping(a.min(b) - radius, a.max(b) + radius);
        near.filter(move |i| leg_to_point(a, b, self.centre(self.coordinates(*i))) <= radius).chain(ends)
    }

    /// Indices of the voxels that a box overlaps; beyond the grid those at its rim.
    pub(super) fn overlapping(&self, low: DVec3, high: DVec3) -> impl Iterator<Item = usize> + '_ {
        let (low, high) = (self.voxel(low), self.voxel(high));
        let rows = (low[2]..=high[2]).flat_map(move |z| (low[1]..=high[1]).map(move |y| (y, z)));
        rows.flat_map(move |(y, z)| (low[0]..=high[0]).map(move |x| self.index([x, y, z])))
    }

    /// Number of voxels.
    pub fn voxels(&self) -> usize {
        self.dims.iter().map(|n| *n as usize).product()
    }

    /// Index of a voxel.
    pub fn index(&self, [x, y, z]: [u32; 3]) -> usize {
        (z as usize * self.dims[1] as usize + y as usize) * self.dims[0] as usize + x as usize
    }

    /// Coordinates of the voxel with an index.
    pub fn coordinates(&self, index: usize) -> [u32; 3] {
        let [nx, ny, _] = self.dims.map(|n| n as usize);
        [index % nx, index / nx % ny, index / (nx * ny)].map(|i| i as u32)
    }

    /// Centre of a voxel.
    pub fn centre(&self, voxel: [u32; 3]) -> DVec3 {
        self.origin + self.cell * (DVec3::from_array(voxel.map(f64::from)) + 0.5)
    }

    /// Whether `p` is in the grid.
    pub fn holds(&self, p: DVec3) -> bool {
        let far = self.origin + self.cell * DVec3::from_array(self.dims.map(f64::from));
        p.cmpge(self.origin).all() && p.cmplt(far).all()
    }

    /// The voxel that holds `p`, or the nearest one where `p` is outside the grid.
    pub fn voxel(&self, p: DVec3) -> [u32; 3] {
        let cell = (p - self.origin) / self.cell;
        // The conversion clamps to zero from below.
        [0, 1, 2].map(|axis| (cell[axis] as u32).min(self.dims[axis] - 1))
    }
}

/// For every voxel, whether the surface touches it. Exact for triangles; a disc may mark a voxel at its rim that it only
/// nearly touches.
pub(super) fn touched(grid: &Grid, occluder: &Occluder) -> Vec<bool> {
    touched_by(grid, occluder, occluder.len())
}

/// The same of the surface's first `count` primitives.
pub(super) fn touched_by(grid: &Grid, occluder: &Occluder, count: usize) -> Vec<bool> {
    let mut occupied = vec![false; grid.voxels()];
    let far = grid.origin + grid.cell * DVec3::from_array(grid.dims.map(f64::from));
    for i in 0..count {
        let (lo, hi) = occluder.primitive_bounds(i);
        if lo.cmpgt(far).any() || hi.cmplt(grid.origin).any() {
            continue;
        }
        let (first, last) = (grid.voxel(lo), grid.voxel(hi));
        match occluder {
            Occluder::Triangles(triangles) => {
                let [a, b, c] = triangles[i];
                let normal = (b - a).cross(c - a);
                slab(grid, first, last, a, normal, |voxel, centre| {
                    if triangle_touches(&triangles[i], centre, 0.5 * grid.cell) {
                        occupied[grid.index(voxel)] = true;
                    }
                });
            }
            Occluder::Discs(discs) => slab(grid, first, last, discs[i].centre, discs[i].normal, |voxel, centre| {
                if disc_touches(&discs[i], centre, 0.5 * grid.cell) {
                    occupied[grid.index(voxel)] = true;
                }
            }),
        }
    }
    occupied
}

/// For every voxel, whether its centre lies within a closed mesh, of which small holes are forgiven: two of three rays along the axes
/// must wind around it. Parts that overlap count as one where they are turned alike.
pub(super) fn enclosed(grid: &Grid, triangles: &[[DVec3; 3]]) -> Vec<bool> {
    let mut votes = vec![0u8; grid.voxels()];
    for main in 0..3 {
        let [u, v] = [(main + 1) % 3, (main + 2) % 3];
        let columns = grid.dims[u] as usize * grid.dims[v] as usize;
        // Where the line through each column's centres crosses the mesh, and which way.
        let mut crossings: Vec<Vec<(f64, i32)>> = vec![Vec::new(); columns];
        for [a, b, c] in triangles {
            let area = (b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u]);
            if area == 0.0 {
                continue;
            }
            let (low, high) = (a.min(*b).min(*c), a.max(*b).max(*c));
            let span = |axis: usize| {
                let of = |x: f64| (x - grid.origin[axis]) / grid.cell - 0.5;
                // The conversion clamps to zero from below.
                (of(low[axis]).floor() as u32)..=(of(high[axis]).ceil().max(-1.0) + 1.0) as u32
            };
            for i in span(u).take_while(|i| *i < grid.dims[u]) {
                for j in span(v).take_while(|j| *j < grid.dims[v]) {
                    // A little beside the centre, so that no line meets an edge of a mesh that lies on the grid.
                    let x = grid.origin[u] + grid.cell * (f64::from(i) + 0.500_137);
                    let y = grid.origin[v] + grid.cell * (f64::from(j) + 0.500_291);
                    let weight =
                        |p: &DVec3, q: &DVec3| ((q[u] - p[u]) * (y - p[v]) - (q[v] - p[v]) * (x - p[u])) / area;
                    let (wc, wa, wb) = (weight(a, b), weight(b, c), weight(c, a));
                    if wa >= 0.0 && wb >= 0.0 && wc >= 0.0 {
                        let at = wa * a[main] + wb * b[main] + wc * c[main];
                        crossings[i as usize * grid.dims[v] as usize + j as usize].push((at, area.signum() as i32));
                    }
                }
            }
        }
        for (column, crossings) in crossings.iter().enumerate().filter(|(_, crossings)| !crossings.is_empty()) {
            let mut voxel = [0; 3];
            (voxel[u], voxel[v]) = ((column / grid.dims[v] as usize) as u32, (column % grid.dims[v] as usize) as u32);
            for k in 0..grid.dims[main] {
                voxel[main] = k;
                let height = grid.origin[main] + grid.cell * (f64::from(k) + 0.5);
                let winding: i32 = crossings.iter().filter(|(at, _)| *at < height).map(|(_, way)| way).sum();
                votes[grid.index(voxel)] += u8::from(winding != 0);
            }
        }
    }
    votes.into_iter().map(|votes| votes >= 2).collect()
}

/// Visits the voxels from `first` to `last` that lie along the plane through `point` with `normal`: a large tilted
/// triangle costs its area, not its volume.
fn slab(
    grid: &Grid,
    first: [u32; 3],
    last: [u32; 3],
    point: DVec3,
    normal: DVec3,
    mut visit: impl FnMut([u32; 3], DVec3),
) {
    let main = normal.abs().max_position();
    let [u, v] = [(main + 1) % 3, (main + 2) % 3];
    // How far the plane strays within a column from its height at the column's centre.
    let reach = grid.cell * (0.5 * (normal[u].abs() + normal[v].abs()) / normal[main].abs() + 1e-6);
    for i in first[u]..=last[u] {
        for j in first[v]..=last[v] {
            let mut column = [0; 3];
            (column[u], column[v]) = (i, j);
            let mut at = grid.centre(column);
            at[main] = point[main];
            let height = point[main] - (at - point).dot(normal) / normal[main];
            at[main] = height - reach;
            let low = grid.voxel(at)[main].max(first[main]);
            at[main] = height + reach;
            let high = grid.voxel(at)[main].min(last[main]);
            for k in low..=high {
                column[main] = k;
                visit(column, grid.centre(column));
            }
        }
    }
}

/// Whether a triangle and a cube of half side `half` around `centre` share a point: separating axes, after Akenine-Moeller,
/// "Fast 3D Triangle-Box Overlap Testing" (2001).
fn triangle_touches(triangle: &[DVec3; 3], centre: DVec3, half: f64) -> bool {
    let [a, b, c] = triangle.map(|p| p - centre);
    let edges = [b - a, c - b, a - c];
    // Touching counts, so rounding must not separate.
    let half = half * (1.0 + 1e-9);
    let overlaps = |axis: DVec3| {
        let [pa, pb, pc] = [a.dot(axis), b.dot(axis), c.dot(axis)];
        let reach = half * axis.abs().element_sum();
        pa.min(pb).min(pc) <= reach && pa.max(pb).max(pc) >= -reach
    };
    DVec3::AXES.into_iter().all(overlaps)
        && overlaps(edges[0].cross(edges[1]))
        && edges.iter().all(|edge| DVec3::AXES.into_iter().all(|axis| overlaps(axis.cross(*edge))))
}

/// Whether the disc's plane cuts the cube and the cube comes within the radius of the disc's centre.
fn disc_touches(disc: &Disc, centre: DVec3, half: f64) -> bool {
    let offset = centre - disc.centre;
    let half = half * (1.0 + 1e-9);
    let cut = offset.dot(disc.normal).abs() <= half * disc.normal.abs().element_sum();
    cut && (offset.abs() - half).max(DVec3::ZERO).length() <= disc.radius
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::proxy::{Orientation, Proxy};
    use crate::scene::{random, samples};

    const GRID: Grid = Grid { origin: DVec3::splat(-1.0), cell: 0.1, dims: [20, 16, 23] };

    fn spot(seed: u64, index: u32, scale: f64) -> DVec3 {
        let [x, y, z, _] = random::uniforms(seed, 0, index);
        scale * (2.0 * DVec3::new(x, y, z) - 1.0)
    }

    fn inside(p: DVec3) -> bool {
        let size = GRID.cell * DVec3::from_array(GRID.dims.map(f64::from));
        (p - GRID.origin).cmpge(DVec3::ZERO).all() && (p - GRID.origin).cmplt(size).all()
    }

    /// If this failed, cameras would be put inside of a volume that they must keep out of, or kept out of its surroundings.
    #[test]
    fn voxels_within_a_closed_mesh_are_found_and_no_others() {
        let Occluder::Triangles(ball) = Proxy::new(&samples::sphere(0.6, 24), Orientation::Trusted).unwrap().occluder
        else {
            unreachable!()
        };
        // One face is missing, and another ball beside it reaches out of the grid.
        let beside = ball.iter().map(|corners| corners.map(|p| p + DVec3::new(0.9, 0.3, 0.0)));
        let solid: Vec<[DVec3; 3]> = ball[1..].iter().copied().chain(beside).collect();
        let found = enclosed(&GRID, &solid);
        let mut counts = [0; 2];
        for (i, found) in found.into_iter().enumerate() {
            let centre = GRID.centre(GRID.coordinates(i));
            let depth = 0.6 - centre.length().min(centre.distance(DVec3::new(0.9, 0.3, 0.0)));
            // Faces cut the ball's corners.
            if !(-0.001..0.02).contains(&depth) {
                assert_eq!(found, depth > 0.0, "{centre}");
                counts[usize::from(found)] += 1;
            }
        }
        assert!(counts[0] > 3000 && counts[1] > 800, "{counts:?}");
    }

    /// A touched voxel that is missed is a hole: free space would leak into a piece of furniture.
    #[test]
    fn every_voxel_with_a_point_of_the_surface_is_marked() {
        for seed in 0..60 {
            let scale = [0.3, 1.0, 8.0][seed as usize % 3];
            let corners = [spot(seed, 0, scale), spot(seed, 1, scale), spot(seed, 2, scale)];
            let triangle = touched(&GRID, &Occluder::Triangles(vec![corners]));
            let disc = Disc { centre: spot(seed, 3, 0.5), normal: spot(seed, 4, 1.0).normalize(), radius: scale };
            let round = touched(&GRID, &Occluder::Discs(vec![disc]));
            let (e, f) = disc.normal.any_orthonormal_pair();
            for i in 0..4000 {
                let [u, v, ..] = random::uniforms(seed, 1, i);
                let p = corners[0] + u.sqrt() * ((1.0 - v) * (corners[1] - corners[0]) + v * (corners[2] - corners[0]));
                assert!(!inside(p) || triangle[GRID.index(GRID.voxel(p))], "seed {seed}: {p}");
                let (s, c) = (std::f64::consts::TAU * v).sin_cos();
                let p = disc.centre + u.sqrt() * disc.radius * (c * e + s * f);
                assert!(!inside(p) || round[GRID.index(GRID.voxel(p))], "seed {seed}: {p}");
            }
        }
    }

    /// A voxel marked far from the surface would take away free space: the work must not simply mark everything.
    #[test]
    fn marked_voxels_are_near_the_surface() {
        for seed in 0..20 {
            let corners = [spot(seed, 0, 1.0), spot(seed, 1, 1.0), spot(seed, 2, 1.0)];
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
            let marked = touched(&GRID, &Occluder::Triangles(vec![corners]));
            for i in (0..GRID.voxels()).filter(|i| marked[*i]) {
                let off = (GRID.centre(GRID.coordinates(i)) - corners[0]).dot(normal).abs();
                assert!(off <= 0.5 * 3f64.sqrt() * GRID.cell * 1.001, "{off}");
            }
        }
    }

    /// A floor that reaches a thousand times beyond the grid costs no more than one within it, and is marked once through.
    #[test]
    fn a_huge_floor_marks_one_layer() {
        let quad = [DVec3::new(-1e3, -1e3, 0.05), DVec3::new(1e3, -1e3, 0.05), DVec3::new(1e3, 1e3, 0.05)];
        let other = [quad[0], quad[2], DVec3::new(-1e3, 1e3, 0.05)];
        let marked = touched(&GRID, &Occluder::Triangles(vec![quad, other]));
        assert_eq!(marked.iter().filter(|m| **m).count(), 20 * 16);
    }
}

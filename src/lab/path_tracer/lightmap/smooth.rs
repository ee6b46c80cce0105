//! The light at the corners of cells: a smooth mean of what is known of the cells around.
//!
//! What surfaces throw back changes the more slowly the farther these are: its mean reaches over a part of their mean distance (Ward
//! and others 1988, "A Ray Tracing Solution for Diffuse Interreflection"). What sources give may change within a cell: its mean
//! reaches as far as it does not differ from nearer ones by more than their noise (Lepski 1991, "On a problem of adaptive
//! estimation in Gaussian white noise"). Both means are of levels of ever larger clusters of cells.

use std::collections::HashMap;

use glam::Vec3;

use super::bake::Found;
use super::layout::{Layout, place_in_part};
use crate::engine::parallel::{in_parallel, mapped};
use crate::lab::path_tracer::assembly::Assembly;
use crate::lab::path_tracer::layout::{Patch, Side};
use crate::scene::colour::LUMA;
use crate::scene::random::pcg4d;
use crate::visibility::bvh::Triangle;
use crate::visibility::raycast::Ray;

/// Reach of a mean in widths of a cell, or of a cluster of its level.
const RADIUS: f32 = 2.5;
/// Reach of the mean of bounced light in harmonic mean distances.
const WARD: f32 = 0.15;
/// Cells count up to so many of their own mean distances away: those in crevices tell nothing of the surface beside.
const OWN_REACH: f32 = 0.5;
const OWN_WARD: f32 = 2.0 * WARD;
/// Standard deviations of nearer means by which a mean of direct light may differ from them.
const CONFIDENCE: f32 = 2.0;
/// Levels up to where the variance of cells is taken from.
const POOL: usize = 2;
/// Standard deviation of direct light, relative to all light, that is not seen.
const UNSEEN: f32 = 4e-3;
/// Levels; each has clusters twice as wide as the one before.
const LEVELS: u32 = 6;
/// Width of a cluster in widths of its level's cells.
const CLUSTER: f32 = 1.0;
/// Cosine between normals below which cells are of another surface.
const ALIKE: f32 = 0.5;
/// How far off the corner's plane a cell may lie, in radii, and in those of the corner's own level.
const OFF_PLANE: f32 = 0.3;
const OFF_PLANE_ALL: f32 = 0.6;
/// Cells of a bucket that are looked at, at most.
const MAX_BUCKET: usize = 32;
/// A cell that no light reaches, or that nobody sees, counts by so much: most are in walls and under furniture.
const DARK: f32 = 1e-4;
/// Brightness of one cell over another's, and the difference in standard deviations of a cell, from which it is looked whether a wall
/// stands between them and the corner.
const CONTRAST: f32 = 3.0;
const SURE: f32 = 6.0;
/// How far towards its corners a cell is looked at.
const INSIDE: f32 = 0.9;
/// How far above the surface that is looked, in radii.
const LIFT: f32 = 0.05;

/// A cell, or a cluster of some.
#[derive(Clone, Copy, Default)]
struct Cell {
    place: Vec3,
    normal: Vec3,
    found: Found,
    weight: f32,
    /// Sum of the squared weights of the cells that it is of.
    squares: f32,
    /// From its place to two of a cell's corners; the third is opposite.
    corners: [Vec3; 2],
}

/// The longest edge of a patch's cells.
pub(super) fn longest_edge(assembly: &Assembly, layout: &Layout, patch: &Patch) -> f32 {
    let Triangle { e1, e2, .. } = &assembly.primitives[patch.side as usize / 2];
    let [e1, e2] = [*e1, *e2].map(Vec3::from);
    e1.length().max(e2.length()).max(e1.distance(e2)) / (layout.sides[patch.side as usize].splits * patch.rows) as f32
}

/// A patch with the normals of its corners.
struct Shape {
    places: [Vec3; 3],
    normals: [Vec3; 3],
    /// The level whose cells are as wide.
    level: u32,
    /// Area of its cells by that of usual ones.
    size: f32,
}

impl Shape {
    fn new(assembly: &Assembly, layout: &Layout, index: usize) -> Self {
        let patch = &layout.patches[index];
        let Side { first, splits } = layout.sides[patch.side as usize];
        let slot = patch.side as usize / 2;
        let triangle = &assembly.primitives[slot];
        let [v0, e1, e2] = [triangle.v0, triangle.e1, triangle.e2].map(Vec3::from);
        let own = e1.cross(e2).normalize_or_zero();
        let turn = if patch.side.is_multiple_of(2) { 1.0 } else { -1.0 };
        let face = &assembly.faces[slot];
        let normals = [face.a, face.b, face.c].map(|v| {
            let normal = Vec3::from(assembly.vertices[v as usize].normal);
            turn * if normal.length_squared() > 1e-6 { normal } else { own }
        });
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|at| place_in_part(splits, index as u32 - first, at));
        let parts = f64::from(splits * patch.rows);
        let area = 0.5 * e1.as_dvec3().cross(e2.as_dvec3()).length() / (parts * parts);
        // Cells of slivers are long.
        let longest = f64::from(longest_edge(assembly, layout, patch));
        let width = (0.5 * longest * longest).max(area) / layout.area;
        let level = (0.5 * width.log2()).round().clamp(0.0, f64::from(LEVELS - 1)) as u32;
        Self {
            places: corners.map(|[x, y]| v0 + x * e1 + y * e2),
            normals: corners.map(|[x, y]| (1.0 - x - y) * normals[0] + x * normals[1] + y * normals[2]),
            level,
            size: (area / layout.area) as f32,
        }
    }

    fn at(&self, [x, y]: [f32; 2]) -> (Vec3, Vec3) {
        let weights = [1.0 - x - y, x, y];
        let sum = |of: &[Vec3; 3]| weights[0] * of[0] + weights[1] * of[1] + weights[2] * of[2];
        (sum(&self.places), sum(&self.normals).normalize_or_zero())
    }
}

/// The cells of the map, with the level of each.
fn cells(assembly: &Assembly, layout: &Layout, found: &[Found]) -> Vec<(u32, Cell)> {
    let by_patch = mapped(&layout.patches, |index, patch| {
        let shape = Shape::new(assembly, layout, index);
        let cell = |within: u32| {
            let at = |at| shape.at(place_in_part(patch.rows, within, at));
            let (place, normal) = at([1.0 / 3.0; 2]);
            let corners = [[1.0, 0.0], [0.0, 1.0]].map(|corner| INSIDE * (at(corner).0 - place));
            let found = found[(patch.cells + within) as usize];
            let is_dark = found.direct + found.bounced == Vec3::ZERO;
            let weight = shape.size * if is_dark || layout.hidden[index] { DARK } else { 1.0 };
            (shape.level, Cell { place, normal, found, weight, squares: weight * weight, corners })
        };
        (0..patch.rows.pow(2)).map(cell).collect::<Vec<_>>()
    });
    by_patch.concat()
}

/// Cells or clusters of one level by where they are.
struct Level {
    /// First cell of each bucket, and their number in the end.
    starts: Vec<u32>,
    cells: Vec<Cell>,
    radius: f32,
}

fn bucket_of(voxel: [i32; 3], mask: u32) -> u32 {
    let [x, y, z] = voxel.map(|v| v as u32);
    pcg4d([x, y, z, 0])[0] & mask
}

impl Level {
    fn new(cells: &[Cell], radius: f32) -> Self {
        // About two cells to a bucket.
        let mask = (cells.len() as u32 / 2).next_power_of_two().max(64) - 1;
        let mut buckets = vec![0u32; cells.len()];
        in_parallel(&mut buckets, 4096, |chunk, buckets| {
            for (bucket, cell) in buckets.iter_mut().zip(&cells[4096 * chunk..]) {
                *bucket = bucket_of((cell.place / (2.0 * radius)).floor().as_ivec3().to_array(), mask);
            }
        });
        let mut starts = vec![0u32; mask as usize + 2];
        buckets.iter().for_each(|bucket| starts[*bucket as usize + 1] += 1);
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut sorted = vec![Cell::default(); cells.len()];
        for (bucket, cell) in buckets.iter().zip(cells) {
            let at = &mut next[*bucket as usize];
            sorted[*at as usize] = *cell;
            *at += 1;
        }
        Self { starts, cells: sorted, radius }
    }

    /// The cells around a place on the same surface, with their weights; `thickness` is how far off its plane they may lie, `own_reach`
    /// how many of their own mean distances away they may be.
    fn around(&self, place: Vec3, normal: Vec3, thickness: f32, own_reach: f32, near: &mut Vec<(f32, Cell)>) {
        near.clear();
        let size = 2.0 * self.radius;
        let mask = self.starts.len() as u32 - 2;
        let low = ((place - self.radius) / size).floor().as_ivec3();
        let mut looked = [u32::MAX; 8];
        for i in 0..8 {
            let bucket = bucket_of([low.x + (i & 1), low.y + (i >> 1 & 1), low.z + (i >> 2)], mask);
            // Two voxels may share a bucket.
            if looked[..i as usize].contains(&bucket) {
                continue;
            }
            looked[i as usize] = bucket;
            let [start, end] = [0, 1].map(|k| self.starts[bucket as usize + k] as usize);
            let step = (end - start).div_ceil(MAX_BUCKET).max(1);
            for cell in self.cells[start..end].iter().step_by(step) {
                let off = cell.place - place;
                let squared = off.length_squared();
                let far = squared / (self.radius * self.radius);
                let aside = normal.dot(off) / thickness;
                let alike = normal.dot(cell.normal);
                if far >= 1.0 || aside.abs() >= 1.0 || alike <= ALIKE {
                    continue;
                }
                let reach = own_reach / cell.found.nearness.max(1e-30);
                let trust = (reach * reach / squared.max(1e-30)).min(1.0);
                near.push(((1.0 - far) * (1.0 - far) * (1.0 - aside * aside) * alike * trust * trust, *cell));
            }
        }
    }
}

/// A mean over cells, each with a factor of its own weight.
fn mean(near: &[(f32, Cell)], of: impl Fn(&Found) -> Vec3) -> Option<Vec3> {
    let weights: f32 = near.iter().map(|(factor, cell)| factor * cell.weight).sum();
    let sum = || near.iter().map(|(factor, cell)| factor * cell.weight * of(&cell.found)).sum::<Vec3>();
    (weights > 0.0).then(|| sum() / weights)
}

/// Standard deviation of such a mean where single cells have a variance.
fn deviation(near: &[(f32, Cell)], variance: f32) -> f32 {
    let weights: f32 = near.iter().map(|(factor, cell)| factor * cell.weight).sum();
    let squares: f32 = near.iter().map(|(factor, cell)| factor * factor * cell.squares).sum();
    (variance * squares).sqrt() / weights.max(f32::MIN_POSITIVE)
}

pub(super) fn luma(light: Vec3) -> f32 {
    light.dot(LUMA.as_vec3())
}

/// Clusters of the cells of a level and of smaller ones: those that lie in one voxel and face the same way.
fn clusters(cells: &[(u32, Cell)], level: u32, width: f32) -> Vec<Cell> {
    let mut clusters: Vec<Cell> = Vec::new();
    let mut known: HashMap<([i32; 3], u8), usize> = HashMap::new();
    for (_, cell) in cells.iter().filter(|(own, _)| *own <= level) {
        let axis = cell.normal.abs().max_position();
        let facing = 2 * axis as u8 + u8::from(cell.normal[axis] < 0.0);
        let voxel = (cell.place / width).floor().as_ivec3().to_array();
        let index = *known.entry((voxel, facing)).or_insert_with(|| {
            clusters.push(Cell::default());
            clusters.len() - 1
        });
        // Cells in crevices and behind boards tell nothing of what is before them.
        let reach = OWN_REACH / cell.found.nearness.max(1e-30);
        let weight = cell.weight * (reach * reach / (width * width)).clamp(DARK, 1.0).powi(2);
        let cluster = &mut clusters[index];
        cluster.place += weight * cell.place;
        cluster.normal += weight * cell.normal;
        cluster.found.direct += weight * cell.found.direct;
        cluster.found.bounced += weight * cell.found.bounced;
        cluster.found.nearness += weight * cell.found.nearness;
        cluster.found.variance += weight * cell.found.variance;
        cluster.weight += weight;
        cluster.squares += weight * weight;
    }
    for Cell { place, normal, found, weight, .. } in &mut clusters {
        *place /= *weight;
        *normal = normal.normalize_or_zero();
        *found = Found {
            direct: found.direct / *weight,
            bounced: found.bounced / *weight,
            nearness: found.nearness / *weight,
            variance: found.variance / *weight,
        };
    }
    clusters
}

/// Leaves out cells that lie behind walls or reach into them, where some are much brighter than others. `spread` is the standard deviation
/// of a cell.
fn leave_out_hidden(
    assembly: &Assembly,
    (place, normal): (Vec3, Vec3),
    radius: f32,
    spread: f32,
    near: &mut Vec<(f32, Cell)>,
) {
    let brightness = |(_, cell): &(f32, Cell)| luma(cell.found.direct + cell.found.bounced);
    let bounds = |(least, most): (f32, f32), v: f32| (least.min(v), most.max(v));
    let (least, most) = near.iter().map(brightness).fold((f32::INFINITY, 0f32), bounds);
    if most <= CONTRAST * least || most - least <= SURE * spread {
        return;
    }
    let origin = place + LIFT * radius * normal;
    let sees = |cell: &Cell| {
        let [a, b] = cell.corners;
        [a, b, -a - b].into_iter().all(|corner| {
            let to = cell.place + corner + LIFT * radius * cell.normal - origin;
            let length = to.length();
            length <= 0.0 || !assembly.bvh.any_hit(&Ray { origin, direction: to / length, t_min: 0.0, t_max: length })
        })
    };
    let seen: Vec<(f32, Cell)> = near.iter().filter(|(_, cell)| sees(cell)).copied().collect();
    if !seen.is_empty() {
        *near = seen;
    }
}

/// All that corners are made of.
struct Surroundings<'s> {
    assembly: &'s Assembly,
    levels: Vec<Level>,
}

impl Surroundings<'_> {
    /// Irradiance at a corner whose cells are of a level; `own` is what is known of one of them, for where no other is near, as on slivers.
    fn at(&self, (place, normal): (Vec3, Vec3), level: u32, own: &Found, near: &mut Vec<(f32, Cell)>) -> Vec3 {
        let first = &self.levels[level as usize];
        let thickness = |of: &Level| (OFF_PLANE * of.radius).min(OFF_PLANE_ALL * first.radius);
        // Where little light was found the rays have little spread: it is taken of cells from farther around.
        let pool = &self.levels[(level as usize + POOL).min(self.levels.len() - 1)];
        pool.around(place, normal, thickness(pool), OWN_REACH, near);
        let variance = mean(near, |found| Vec3::splat(found.variance)).map_or(own.variance, |found| found.x);
        first.around(place, normal, thickness(first), OWN_REACH, near);
        leave_out_hidden(self.assembly, (place, normal), first.radius, variance.sqrt(), near);
        let mut direct = mean(near, |found| found.direct).unwrap_or(own.direct);
        let nearness = mean(near, |found| Vec3::splat(found.nearness)).map_or(own.nearness, |found| found.x);
        let bounced = mean(near, |found| found.bounced).unwrap_or(own.bounced);
        let unseen = UNSEEN * luma(direct + bounced);
        // What nearer means leave of the range in which the mean lies.
        let noise = deviation(near, variance);
        let mut range = [luma(direct) - CONFIDENCE * noise, luma(direct) + CONFIDENCE * noise];
        let mut left = noise;
        for wider in &self.levels[level as usize + 1..] {
            if left <= unseen {
                break;
            }
            wider.around(place, normal, thickness(wider), OWN_REACH, near);
            let Some(mean) =
                mean(near, |found| found.direct).filter(|mean| (range[0]..=range[1]).contains(&luma(*mean)))
            else {
                break;
            };
            direct = mean;
            left = deviation(near, variance);
            range[0] = range[0].max(luma(direct) - CONFIDENCE * left);
            range[1] = range[1].min(luma(direct) + CONFIDENCE * left);
        }
        direct + self.bounced((place, normal), level, nearness, own, near)
    }

    /// Bounced light by the mean between two levels that reach about as far as it is alike.
    fn bounced(
        &self,
        (place, normal): (Vec3, Vec3),
        level: u32,
        nearness: f32,
        own: &Found,
        near: &mut Vec<(f32, Cell)>,
    ) -> Vec3 {
        let first = &self.levels[level as usize];
        let wanted = (WARD / nearness.max(1e-30) / first.radius).log2();
        let wanted = wanted.clamp(0.0, (LEVELS - 1 - level) as f32);
        let mut bounced = Vec3::ZERO;
        for (step, share) in [(0, 1.0 - wanted.fract()), (1, wanted.fract())] {
            if share > 0.0 {
                let of = &self.levels[(level + wanted as u32 + step) as usize];
                let thickness = (OFF_PLANE * of.radius).min(OFF_PLANE_ALL * first.radius);
                of.around(place, normal, thickness, OWN_WARD, near);
                bounced += share * mean(near, |found| found.bounced).unwrap_or(own.bounced);
            }
        }
        bounced
    }
}

/// Irradiance at all corners of cells, in the order of the layout, from what is known of the cells.
pub(super) fn smooth(assembly: &Assembly, layout: &Layout, found: &[Found]) -> Vec<Vec3> {
    let cells = cells(assembly, layout, found);
    let usual = layout.area.sqrt() as f32;
    let numbers: Vec<u32> = (0..LEVELS).collect();
    let levels = mapped(&numbers, |_, &level| {
        let width = usual * (1 << level) as f32;
        let of_level = match level {
            0 => cells.iter().filter(|(own, _)| *own == 0).map(|(_, cell)| *cell).collect(),
            _ => clusters(&cells, level, CLUSTER * width),
        };
        Level::new(&of_level, RADIUS * width)
    });
    let surroundings = Surroundings { assembly, levels };
    let by_patch = mapped(&layout.patches, |index, patch| {
        let shape = Shape::new(assembly, layout, index);
        let mut near = Vec::new();
        let mut corners = Vec::with_capacity(((patch.rows + 1) * (patch.rows + 2) / 2) as usize);
        for j in 0..=patch.rows {
            for i in 0..=patch.rows - j {
                let at = shape.at([i as f32 / patch.rows as f32, j as f32 / patch.rows as f32]);
                let row = j.min(patch.rows - 1);
                let own = &found[(patch.cells + row * (2 * patch.rows - row)) as usize];
                corners.push(surroundings.at(at, shape.level, own, &mut near));
            }
        }
        corners
    });
    by_patch.concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, boards would be stained by the dark of the wall behind them, where both lie in one cluster.
    #[test]
    fn a_cluster_shows_nothing_of_what_lies_behind_a_board() {
        let cell = |z: f32, light: f32, reach: f32| {
            let found = Found { bounced: Vec3::splat(light), nearness: 1.0 / reach, ..Found::default() };
            (0, Cell { place: Vec3::new(0.05, 0.05, z), normal: Vec3::Z, found, weight: 1.0, ..Cell::default() })
        };
        let [board, wall] = [cell(0.06, 1.0, 2.0), cell(0.05, 0.1, 0.01)];
        let clusters = clusters(&[board, wall], 1, 0.1);
        assert_eq!(clusters.len(), 1);
        assert!((clusters[0].found.bounced.x - 1.0).abs() < 0.02, "{}", clusters[0].found.bounced);
        // In a gap in which all is near there is nothing better.
        let [a, b] = [cell(0.06, 0.2, 0.01), cell(0.05, 0.1, 0.01)];
        assert!((super::clusters(&[a, b], 1, 0.1)[0].found.bounced.x - 0.15).abs() < 1e-5);
    }
}

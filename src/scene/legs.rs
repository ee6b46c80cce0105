//! Ways from camera to camera that keep the clearance from the surface and stay within all limits.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use glam::DVec3;

use super::free_space::FreeSpace;
use super::sets::Sets;
use super::voxels::Grid;
use crate::engine::parallel;

/// No place, or no voxel.
const NONE: u32 = u32::MAX;
/// Samples of a straight way, per side of a voxel.
const SAMPLES: f64 = 2.0;
/// Nearest places out of sight to which a way of their own is looked for, where that by other places is so many times as long as the
/// straight line: around something round it is not.
const NEAR: usize = 12;
const DETOUR: f64 = 1.6;

/// The shortest way known between every two of some places: straight where that is clear, around what is between to the nearest
/// places out of sight, otherwise by way of other places.
pub struct Legs {
    places: Vec<DVec3>,
    /// Length of the way from place i to place j at `i * places + j`.
    lengths: Vec<f64>,
    /// The place before j on the way from i, at the same index.
    before: Vec<u32>,
    /// Corners of the ways around something, from the first place to the second, which has the higher index.
    around: BTreeMap<(u32, u32), Vec<DVec3>>,
}

impl Legs {
    /// The ways between `places`, in the frame of the free space. A place that is shut off from all others is reached in a straight line
    /// through whatever is between; see [`Self::blocked`].
    pub fn new(space: &FreeSpace, places: &[DVec3]) -> Self {
        let passages = Passages::new(space);
        let n = places.len();
        let indices: Vec<u32> = (0..n as u32).collect();
        let mut lengths: Vec<f64> = parallel::mapped(&indices, |i, _| {
            (0..n).map(|j| passages.straight(places[i.min(j)], places[i.max(j)])).collect::<Vec<_>>()
        })
        .concat();
        let mut sets = Sets::new(n);
        for i in 0..n {
            (i + 1..n).filter(|j| lengths[i * n + j].is_finite()).for_each(|j| _ = sets.join(i, j));
        }
        let mut around = BTreeMap::new();
        if sets.count() > 1 {
            let found = Distances::from(&passages, places, (&[], f64::INFINITY));
            for (voxel, other, _) in found.meetings(&passages.grid) {
                let [a, b] = [voxel, other].map(|voxel| found.place[voxel as usize]);
                if sets.join(a as usize, b as usize) {
                    let way = passages.pulled_tight(found.way(&passages, places, (voxel, other)));
                    add(&mut lengths, &mut around, n, (a as usize, b as usize, way));
                }
            }
        }
        let all_shortest = |lengths: &[f64]| parallel::mapped(&indices, |i, _| shortest(lengths, n, i));
        let mut rows = all_shortest(&lengths);
        let nearest = parallel::mapped(&indices, |i, _| passages.to_nearest(places, i, &rows[i].0));
        if nearest.iter().any(|ways| !ways.is_empty()) {
            for (i, ways) in nearest.into_iter().enumerate() {
                ways.into_iter().for_each(|(j, way)| add(&mut lengths, &mut around, n, (i, j, way)));
            }
            rows = all_shortest(&lengths);
        }
        let (mut all, mut before) = (Vec::with_capacity(n * n), Vec::with_capacity(n * n));
        for (i, (row, previous)) in rows.into_iter().enumerate() {
            all.extend(row.iter().enumerate().map(|(j, length)| match length.is_finite() {
                true => *length,
                false => places[i].distance(places[j]),
            }));
            before.extend(previous);
        }
        Self { places: places.to_vec(), lengths: all, before, around }
    }

    /// Length of the way from one place to another.
    pub fn length(&self, from: usize, to: usize) -> f64 {
        self.lengths[from * self.places.len() + to]
    }

    /// Whether no way was found from one place to another, and the length is that of a straight line.
    pub fn blocked(&self, from: usize, to: usize) -> bool {
        from != to && self.before[from * self.places.len() + to] == NONE
    }

    /// Corners of the way from one place to another, the second among them and the first not.
    pub fn way(&self, from: usize, to: usize) -> Vec<DVec3> {
        let mut backwards = Vec::new();
        let mut at = to;
        while at != from {
            let before = self.before[from * self.places.len() + at];
            if before == NONE {
                backwards.push(self.places[at]);
                break;
            }
            let (a, b) = (before, at as u32);
            match self.around.get(&(a.min(b), a.max(b))) {
                Some(corners) if a < b => backwards.extend(corners.iter().skip(1).rev()),
                Some(corners) => backwards.extend(corners.iter().take(corners.len() - 1)),
                None => backwards.push(self.places[at]),
            }
            at = before as usize;
        }
        backwards.reverse();
        backwards
    }
}

/// Keeps a way from one place of `n` to another where it is the shortest so far.
fn add(
    lengths: &mut [f64],
    around: &mut BTreeMap<(u32, u32), Vec<DVec3>>,
    n: usize,
    (from, to, mut way): (usize, usize, Vec<DVec3>),
) {
    let length = length(&way);
    if length < lengths[from * n + to] {
        (lengths[from * n + to], lengths[to * n + from]) = (length, length);
        if from > to {
            way.reverse();
        }
        around.insert((from.min(to) as u32, from.max(to) as u32), way);
    }
}

/// Length of a way.
pub(super) fn length(way: &[DVec3]) -> f64 {
    way.windows(2).map(|pair| pair[0].distance(pair[1])).fold(0.0, |sum, leg| sum + leg)
}

/// Shortest lengths from one place along an `n` by `n` table of lengths, and the place before each (Dijkstra).
fn shortest(lengths: &[f64], n: usize, from: usize) -> (Vec<f64>, Vec<u32>) {
    let (mut least, mut before, mut done) = (vec![f64::INFINITY; n], vec![NONE; n], vec![false; n]);
    least[from] = 0.0;
    for _ in 0..n {
        let open = (0..n).filter(|i| !done[*i] && least[*i].is_finite());
        let Some(at) = open.min_by(|a, b| least[*a].total_cmp(&least[*b])) else { break };
        done[at] = true;
        for to in 0..n {
            let length = least[at] + lengths[at * n + to];
            if length < least[to] {
                (least[to], before[to]) = (length, at as u32);
            }
        }
    }
    (least, before)
}

/// Voxels that a camera may pass: as far from the surface as the clearance, not barred by limits, above the floor; the shape of the
/// region does not count.
struct Passages {
    grid: Grid,
    open: Vec<bool>,
    /// Least and greatest height.
    heights: [f64; 2],
}

impl Passages {
    fn new(space: &FreeSpace) -> Self {
        Self { grid: space.grid, open: space.passable(), heights: space.height_range() }
    }

    fn passes(&self, p: DVec3) -> bool {
        self.grid.holds(p) && self.open[self.grid.index(self.grid.voxel(p))]
    }

    /// Length of the straight way, infinite where it is not clear.
    fn straight(&self, a: DVec3, b: DVec3) -> f64 {
        let length = a.distance(b);
        let steps = (SAMPLES * length / self.grid.cell).ceil().max(1.0) as u32;
        let clear = (0..=steps).all(|i| self.passes(a.lerp(b, f64::from(i) / f64::from(steps))));
        if clear { length } else { f64::INFINITY }
    }

    /// The way without corners that it does without: from each on to the last one that is in a straight line.
    fn pulled_tight(&self, way: Vec<DVec3>) -> Vec<DVec3> {
        let mut tight = vec![way[0]];
        let mut at = 0;
        while at + 1 < way.len() {
            at =
                (at + 2..way.len()).rev().find(|next| self.straight(way[at], way[*next]).is_finite()).unwrap_or(at + 1);
            tight.push(way[at]);
        }
        tight
    }

    /// Ways from place `from` to the nearest of those to which the ways known, which are so long, are detours.
    fn to_nearest(&self, places: &[DVec3], from: usize, known: &[f64]) -> Vec<(usize, Vec<DVec3>)> {
        let away = |to: usize| places[from].distance(places[to]);
        let detour = |to: &usize| known[*to].is_finite() && known[*to] > DETOUR * away(*to);
        let mut wanted: Vec<usize> = (0..places.len()).filter(detour).collect();
        wanted.sort_by(|a, b| away(*a).total_cmp(&away(*b)));
        wanted.retain(|to| self.passes(places[*to]));
        wanted.truncate(NEAR);
        if wanted.is_empty() || !self.passes(places[from]) {
            return Vec::new();
        }
        let voxel = |place: usize| self.grid.index(self.grid.voxel(places[place]));
        let most = wanted.iter().map(|to| known[*to]).fold(0.0, f64::max) / self.grid.cell;
        let voxels: Vec<usize> = wanted.iter().map(|to| voxel(*to)).collect();
        let found = Distances::from(self, &places[from..=from], (&voxels, most));
        let reached = wanted.into_iter().filter(|to| found.place[voxel(*to)] != NONE);
        reached
            .map(|to| {
                let mut way = found.back(self, &places[from..=from], voxel(to) as u32);
                way.reverse();
                way.push(places[to]);
                (to, self.pulled_tight(way))
            })
            .collect()
    }

    /// A place to pass in a voxel: its centre, as high as is allowed.
    fn place(&self, voxel: u32) -> DVec3 {
        let centre = self.grid.centre(self.grid.coordinates(voxel as usize));
        centre.with_z(centre.z.clamp(self.heights[0], self.heights[1]))
    }

    /// Open voxels that share a face, an edge or a corner with one, and the distance between the centres in voxels.
    fn neighbours(&self, voxel: u32) -> impl Iterator<Item = (u32, f64)> {
        let [x, y, z] = self.grid.coordinates(voxel as usize).map(i64::from);
        let dims = self.grid.dims.map(i64::from);
        (0..27).filter(|i| *i != 13).filter_map(move |i| {
            let step = [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1];
            let at = [x + step[0], y + step[1], z + step[2]];
            if (0..3).any(|axis| at[axis] < 0 || at[axis] >= dims[axis]) {
                return None;
            }
            let other = self.grid.index(at.map(|n| n as u32));
            let squared = step.iter().map(|n| n * n).sum::<i64>();
            self.open[other].then(|| (other as u32, (squared as f64).sqrt()))
        })
    }
}

/// For every voxel that can be reached the nearest place along the voxels, and how it is reached from there.
struct Distances {
    distance: Vec<f64>,
    place: Vec<u32>,
    before: Vec<u32>,
}

impl Distances {
    /// From `places`, until all voxels of `wanted` are reached where any are, or those at most `most` voxels away; else to all that can be.
    fn from(passages: &Passages, places: &[DVec3], (wanted, most): (&[usize], f64)) -> Self {
        let mut left: Vec<usize> = wanted.to_vec();
        let voxels = passages.grid.voxels();
        let mut found =
            Self { distance: vec![f64::INFINITY; voxels], place: vec![NONE; voxels], before: vec![NONE; voxels] };
        // Distances are not negative, so their bits are in their order.
        let mut next = BinaryHeap::new();
        for (i, place) in places.iter().enumerate().filter(|(_, place)| passages.passes(**place)) {
            let voxel = passages.grid.index(passages.grid.voxel(*place));
            if found.place[voxel] == NONE {
                (found.distance[voxel], found.place[voxel]) = (0.0, i as u32);
                next.push(Reverse((0u64, voxel as u32)));
            }
        }
        while let Some(Reverse((bits, voxel))) = next.pop() {
            let distance = f64::from_bits(bits);
            if distance > found.distance[voxel as usize] {
                continue;
            }
            left.retain(|wanted| *wanted != voxel as usize);
            if distance > most || (left.is_empty() && !wanted.is_empty()) {
                break;
            }
            for (other, step) in passages.neighbours(voxel) {
                let (to, length) = (other as usize, distance + step);
                if length < found.distance[to] {
                    (found.distance[to], found.place[to], found.before[to]) =
                        (length, found.place[voxel as usize], voxel);
                    next.push(Reverse((length.to_bits(), other)));
                }
            }
        }
        found
    }

    /// Neighbouring voxels that are reached from different places, with the length of the way through both in voxels; the shortest first.
    fn meetings(&self, grid: &Grid) -> Vec<(u32, u32, f64)> {
        let [nx, ny, nz] = grid.dims;
        let mut meetings = Vec::new();
        for voxel in 0..grid.voxels() as u32 {
            let [x, y, z] = grid.coordinates(voxel as usize);
            let next = [(x + 1 < nx, [x + 1, y, z]), (y + 1 < ny, [x, y + 1, z]), (z + 1 < nz, [x, y, z + 1])];
            for other in next.into_iter().filter(|(inside, _)| *inside).map(|(_, at)| grid.index(at)) {
                let (a, b) = (self.place[voxel as usize], self.place[other]);
                if a != b && a != NONE && b != NONE {
                    meetings.push((voxel, other as u32, self.distance[voxel as usize] + self.distance[other]));
                }
            }
        }
        meetings.sort_by(|a, b| a.2.total_cmp(&b.2));
        meetings
    }

    /// From the place of one voxel through both to the place of the other.
    fn way(&self, passages: &Passages, places: &[DVec3], (voxel, other): (u32, u32)) -> Vec<DVec3> {
        let mut way = self.back(passages, places, voxel);
        way.reverse();
        way.extend(self.back(passages, places, other));
        way
    }

    /// From a voxel back to its place.
    fn back(&self, passages: &Passages, places: &[DVec3], mut at: u32) -> Vec<DVec3> {
        let mut corners = Vec::new();
        while self.before[at as usize] != NONE {
            corners.push(passages.place(at));
            at = self.before[at as usize];
        }
        corners.push(places[self.place[at as usize] as usize]);
        corners
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::proxy::Occluder;
    use crate::scene::region::{Region, Shape};

    /// If this failed, a photographer would be sent all the way back to the one place that sees both sides of a wall, although its end is
    /// near: one tour was two fifths longer than it had to be.
    #[test]
    fn the_way_around_a_wall_is_not_by_a_place_far_off() {
        let at = |y: f64, z: f64| DVec3::new(0.0, y, z);
        let [a, b, c, d] = [at(-1.9, -2.0), at(0.5, -2.0), at(0.5, 2.0), at(-1.9, 2.0)];
        let region = Region {
            shape: Shape::Box { min: DVec3::splat(-1.9), max: DVec3::splat(1.9) },
            up: DVec3::Z,
            floor: None,
            clearance: 0.1,
        };
        let space = FreeSpace::new(&Occluder::Triangles(vec![[a, b, c], [a, c, d]]), &region, 48).unwrap();
        let places = [DVec3::new(-0.5, 0.2, 0.0), DVec3::new(0.5, 0.2, 0.0), DVec3::new(0.0, 1.8, 0.0)];
        let legs = Legs::new(&space, &places);
        // Around the wall's end, which the clearance makes thicker.
        let best = 2.0 * 0.4f64.hypot(0.4) + 0.2;
        let by_the_other = legs.length(0, 2) + legs.length(2, 1);
        assert!(by_the_other > 3.0 && legs.length(0, 1) < 1.2 * best, "{} for {best}", legs.length(0, 1));
        let mut way = vec![places[1]];
        way.extend(legs.way(1, 0));
        assert!((length(&way) - legs.length(0, 1)).abs() < 1e-9 && way.len() > 2, "{way:?}");
        assert!(!legs.blocked(0, 1));
    }
}

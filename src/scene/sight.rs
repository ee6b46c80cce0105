//! How far each photo shows that there is nothing: between the camera and what it saw.

use glam::{DQuat, DVec2, DVec3};

use super::camera::Camera;

/// Cells along a picture's longer side.
const CELLS: f64 = 40.0;
/// Points around the middle of a cell of which the nearest ends its ray: a lone wrong one proves nothing.
const POINTS: usize = 3;
/// How many cells off these may be.
const AROUND: isize = 5;
/// So many points around a cell without points tell whether it lies between them, or beside all of them, where something plain may be
/// nearer: the length of the mean of their offsets over their mean length is below this.
const SURROUNDING: usize = 8;
const ONE_SIDED: f64 = 0.7;
/// Part of the way to them that counts: points are a little off, and surfaces come nearer between them.
const PROVEN: f64 = 0.95;
/// Tangent of the widest angle from the axis at which rays count; lenses may see more.
const WIDEST: f64 = 3.0;

/// A photo's rays, one for each cell of its picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Sight {
    /// From where it was taken.
    pub position: DVec3,
    /// Median distance of what it saw; zero where that was nothing.
    pub middle: f64,
    /// Distance of the nearest thing that it saw; infinite where that was nothing.
    pub nearest: f64,
    rotation: DQuat,
    /// Upper left corner of the first cell where the picture's plane is at distance one, and the side of a cell.
    low: DVec2,
    cell: f64,
    columns: usize,
    /// Distances up to which rays are free, by row; zero where nothing is known.
    ranges: Vec<f32>,
}

/// A point as a photo sees it: its cell, its place in the plane, its distance.
struct Seen {
    cell: [isize; 2],
    place: DVec2,
    range: f64,
}

impl Sight {
    /// Of a camera that saw the points `seen`, and is surrounded by points of a `surface` of which nobody knows whether it saw them.
    /// A ray is free up to the nearest of the three points seen that lie nearest to it in the picture, if they lie near; where the
    /// surface has points beside it, to the nearest of those.
    pub fn new(camera: &Camera, seen: impl Iterator<Item = DVec3>, surface: &[DVec3]) -> Self {
        let (pose, lens) = (&camera.pose, &camera.intrinsics);
        let [fx, fy] = lens.focal;
        let [cx, cy] = lens.principal;
        let corner = |x: f64, y: f64| {
            DVec2::new((x - cx) / fx, (y - cy) / fy).clamp(DVec2::splat(-WIDEST), DVec2::splat(WIDEST))
        };
        let (low, high) = (corner(0.0, 0.0), corner(f64::from(lens.width), f64::from(lens.height)));
        let cell = (high - low).max_element() / CELLS;
        let [columns, rows] = ((high - low) / cell).to_array().map(|n| n.round().max(1.0) as usize);
        let to_camera = pose.rotation.inverse();
        let project = |p: DVec3| {
            let local = to_camera * (p - pose.position);
            let place = local.truncate() / local.z;
            let cell = ((place - low) / cell).floor();
            let inside = local.z > 0.0 && cell.min_element() >= 0.0 && cell.x < columns as f64 && cell.y < rows as f64;
            inside.then(|| Seen { cell: [cell.x as isize, cell.y as isize], place, range: local.length() })
        };
        let sorted = |points: Vec<Seen>| {
            let mut cells: Vec<Vec<(DVec2, f64)>> = vec![Vec::new(); columns * rows];
            for Seen { cell: [x, y], place, range } in points {
                cells[y as usize * columns + x as usize].push((place, range));
            }
            cells
        };
        let seen: Vec<Seen> = seen.filter_map(project).collect();
        let mut distances: Vec<f64> = seen.iter().map(|point| point.range).collect();
        let seen = sorted(seen);
        let beside = sorted(surface.iter().filter_map(|p| project(*p)).collect());
        let within = |x: isize, y: isize| (0..columns as isize).contains(&x) && (0..rows as isize).contains(&y);
        let at = |x: isize, y: isize| y as usize * columns + x as usize;
        let range = |x: isize, y: isize| {
            let middle = low + cell * (DVec2::new(x as f64, y as f64) + 0.5);
            let mut near: Vec<(DVec2, f64)> = Vec::new();
            // Ring by ring; of a ring farther out no point is nearer than all found.
            for ring in 0..=AROUND {
                for (dx, dy) in ring_of(ring) {
                    if within(x + dx, y + dy) {
                        let points = &seen[at(x + dx, y + dy)];
                        near.extend(points.iter().map(|(place, range)| (*place - middle, *range)));
                    }
                }
                let certain = ring as f64 * cell;
                if near.iter().filter(|(offset, _)| offset.length() <= certain).count() >= SURROUNDING {
                    break;
                }
            }
            near.sort_by(|a, b| a.0.length_squared().total_cmp(&b.0.length_squared()));
            let few = &near[..near.len().min(SURROUNDING)];
            let (sum, lengths) = few
                .iter()
                .fold((DVec2::ZERO, 0.0), |(sum, lengths), (offset, _)| (sum + *offset, lengths + offset.length()));
            let between = !seen[at(x, y)].is_empty() || sum.length() < ONE_SIDED * lengths;
            let nearest = few.get(..POINTS).filter(|_| between);
            let seen = nearest.map(|few| few.iter().map(|(_, range)| *range).fold(f64::INFINITY, f64::min));
            let around = (0..=1).flat_map(ring_of).filter(|(dx, dy)| within(x + dx, y + dy));
            let beside =
                around.flat_map(|(dx, dy)| &beside[at(x + dx, y + dy)]).map(|(_, range)| *range).reduce(f64::min);
            let range = seen.into_iter().chain(beside).reduce(f64::min);
            range.map_or(0.0, |range| (PROVEN * range) as f32)
        };
        let ranges = (0..rows as isize)
            .flat_map(|y| (0..columns as isize).map(move |x| (x, y)))
            .map(|(x, y)| range(x, y))
            .collect();
        if distances.is_empty() {
            distances = beside.iter().flatten().map(|(_, range)| *range).collect();
        }
        let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
        let rank = distances.len() / 2;
        let middle = if distances.is_empty() { 0.0 } else { *distances.select_nth_unstable_by(rank, f64::total_cmp).1 };
        Self { position: pose.position, middle, nearest, rotation: pose.rotation, low, cell, columns, ranges }
    }

    /// Whether it shows that there is nothing within `margin` of `p` on the way to it and behind.
    pub fn proves(&self, p: DVec3, margin: f64) -> bool {
        let local = self.rotation.inverse() * (p - self.position);
        if local.z <= 0.0 {
            return false;
        }
        let cell = ((local.truncate() / local.z - self.low) / self.cell).floor();
        if cell.min_element() < 0.0 || cell.x >= self.columns as f64 {
            return false;
        }
        let range = self.ranges.get(cell.y as usize * self.columns + cell.x as usize);
        range.is_some_and(|range| local.length() + margin <= f64::from(*range))
    }
}

/// The cells at a distance, along the axis where it is greatest, from one.
fn ring_of(ring: isize) -> impl Iterator<Item = (isize, isize)> {
    (-ring..=ring).flat_map(move |dy| {
        let step = if dy.abs() == ring { 1 } else { (2 * ring).max(1) };
        (-ring..=ring).step_by(step as usize).map(move |dx| (dx, dy))
    })
}

//! Many depth maps to one cloud: means over the cells of a grid, less isolated cells.

use std::collections::BTreeMap;

use glam::DVec3;

/// A pixel's point, or the mean of many.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Position in the stereo frame.
    pub position: DVec3,
    /// Unit normal towards the camera.
    pub normal: DVec3,
    /// sRGB colour, 0 to 255.
    pub colour: DVec3,
}

/// A cell of the grid.
type Cell = [i32; 3];

/// Pixels that a cell must hold.
const MIN_SAMPLES: u32 = 2;
/// Cells that must be filled among the 124 around a cell.
const MIN_NEIGHBOURS: usize = 5;
/// A cluster of cells stays where it is at least this part of the largest.
const MIN_CLUSTER: f64 = 0.03;

/// The cell that holds a point.
fn cell(p: DVec3, size: f64) -> Cell {
    (p / size).floor().as_ivec3().to_array()
}

/// Sums and counts of the samples in each cell.
fn sums(samples: &[Sample], size: f64) -> BTreeMap<Cell, (Sample, u32)> {
    let mut cells: BTreeMap<Cell, (Sample, u32)> = BTreeMap::new();
    for sample in samples {
        let nothing = Sample { position: DVec3::ZERO, normal: DVec3::ZERO, colour: DVec3::ZERO };
        let (sum, count) = cells.entry(cell(sample.position, size)).or_insert((nothing, 0));
        sum.position += sample.position;
        sum.normal += sample.normal;
        sum.colour += sample.colour;
        *count += 1;
    }
    cells
}

/// The mean of a sum, with a normal.
fn mean(sum: &Sample, count: u32, normal: DVec3) -> Sample {
    let scale = 1.0 / f64::from(count);
    Sample { position: scale * sum.position, normal: normal.normalize_or(DVec3::Z), colour: scale * sum.colour }
}

/// The means of the samples in each cell of side `size`, in the order of cells.
pub fn means(samples: &[Sample], size: f64) -> Vec<Sample> {
    sums(samples, size).values().map(|(sum, count)| mean(sum, *count, sum.normal)).collect()
}

/// As [`means`], of samples that may be wrong: dropped are cells with less than two of them, with few others around, and in small
/// clusters.
pub(crate) fn fuse(samples: &[Sample], size: f64) -> Vec<Sample> {
    let mut cells = sums(samples, size);
    cells.retain(|_, (_, count)| *count >= MIN_SAMPLES);
    let alone: Vec<Cell> = cells
        .keys()
        .filter(|at| around(**at).filter(|beside| cells.contains_key(beside)).count() < MIN_NEIGHBOURS)
        .copied()
        .collect();
    for at in alone {
        cells.remove(&at);
    }
    let stays = clusters(&cells);
    // Patches of a few pixels tilt by chance: a normal is that of its surroundings, as far as they face the same way.
    let smooth = |at: &Cell, normal: DVec3| {
        let beside = around(*at).filter_map(|beside| cells.get(&beside)).map(|(sum, _)| sum.normal);
        beside.filter(|other| other.dot(normal) > 0.0).fold(normal, |sum, other| sum + other)
    };
    cells
        .iter()
        .zip(stays)
        .filter(|(_, stays)| *stays)
        .map(|((at, (sum, count)), _)| mean(sum, *count, smooth(at, sum.normal)))
        .collect()
}

/// Whether each cell's cluster is large enough, in the order of cells; cells are joined across a gap of one.
fn clusters<T>(cells: &BTreeMap<Cell, T>) -> Vec<bool> {
    let number: BTreeMap<Cell, usize> = cells.keys().zip(0..).map(|(at, i)| (*at, i)).collect();
    let mut cluster = vec![usize::MAX; cells.len()];
    let mut sizes = Vec::new();
    for (start, first) in cells.keys().zip(0..) {
        if cluster[first] != usize::MAX {
            continue;
        }
        let mut size = 0;
        let mut open = vec![*start];
        cluster[first] = sizes.len();
        while let Some(at) = open.pop() {
            size += 1;
            for beside in around(at) {
                if let Some(i) = number.get(&beside).filter(|i| cluster[**i] == usize::MAX) {
                    cluster[*i] = sizes.len();
                    open.push(beside);
                }
            }
        }
        sizes.push(size);
    }
    let largest = sizes.iter().copied().max().unwrap_or(0);
    cluster.into_iter().map(|c| f64::from(sizes[c]) >= MIN_CLUSTER * f64::from(largest)).collect()
}

/// The cells at most two away.
fn around([x, y, z]: Cell) -> impl Iterator<Item = Cell> {
    (-2..=2)
        .flat_map(move |i| (-2..=2).flat_map(move |j| (-2..=2).map(move |k| [x + i, y + j, z + k])))
        .filter(move |at| *at != [x, y, z])
}

/// Those of `fill` that have no point of `points` within about `gap`: what closes the holes.
pub fn holes(points: &[Sample], fill: &[Sample], gap: f64) -> Vec<Sample> {
    let mut near: BTreeMap<Cell, Vec<DVec3>> = BTreeMap::new();
    for point in points {
        near.entry(cell(point.position, gap)).or_default().push(point.position);
    }
    let is_hole = |sample: &&Sample| {
        let [x, y, z] = cell(sample.position, gap);
        !(0..27).any(|i| {
            let beside = [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1];
            near.get(&beside)
                .is_some_and(|points| points.iter().any(|p| p.distance_squared(sample.position) < gap * gap))
        })
    };
    fill.iter().filter(is_hole).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, single wrong depths would float before the surface, or parts of the surface would be lost.
    #[test]
    fn a_sheet_stays_and_what_stands_alone_goes() {
        let at =
            |x: f64, y: f64, z: f64| Sample { position: DVec3::new(x, y, z), normal: DVec3::Z, colour: DVec3::ONE };
        let sheet = (0..400).map(|i| at(0.05 * f64::from(i % 20), 0.05 * f64::from(i / 20), 0.05));
        let mut samples: Vec<Sample> = sheet.collect();
        samples.extend([at(0.5, 0.5, 3.05), at(0.5, 0.5, 3.06)]);
        let fused = fuse(&samples, 0.1);
        assert_eq!(fused.len(), 100);
        assert!(fused.iter().all(|point| (point.position.z - 0.05).abs() < 1e-12 && point.normal == DVec3::Z));
        let fill = [at(0.52, 0.48, 0.07), at(0.5, 0.5, 1.0)];
        assert_eq!(holes(&fused, &fill, 0.1), [fill[1]]);
    }

    /// If this failed, points would not be at the mean of what fell into their cell.
    #[test]
    fn means_are_of_cells() {
        let at = |x: f64| Sample { position: DVec3::new(x, 0.5, 0.5), normal: DVec3::X, colour: DVec3::splat(x) };
        let points = means(&[at(0.2), at(0.6), at(1.5)], 1.0);
        assert_eq!(points.iter().map(|point| point.position.x).collect::<Vec<_>>(), [0.4, 1.5]);
    }
}

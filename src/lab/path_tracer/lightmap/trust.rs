//! Where photographs must not read the map: cells whose smoothed light is off what their own rays brought by more than the noise that a
//! pixel has which follows one more bounce instead (the final gathering of photon maps, Jensen 1996).

use glam::Vec3;

use super::layout::{Layout, corner_at, place_in_part};
use super::smooth::{longest_edge, luma};
use crate::engine::parallel::mapped;
use crate::lab::path_tracer::assembly::Assembly;
use crate::lab::path_tracer::layout::{Patch, Sum};

/// How many times as many samples a pixel has where it follows one more bounce: between one and the tracer's four.
const TIMES_SAMPLES: f32 = 2.0;
/// With fewer samples the noise of a pixel is worse than what the map is off by, which is the same in all views.
const LEAST_SAMPLES: u32 = 8;
/// Rays below which nothing is said of a cell.
const LEAST_RAYS: f32 = 8.0;
/// Standard deviations of a cell's own mean by which smoothed light may be off it.
const CONFIDENCE: f32 = 3.0;
/// Part of a cell's light by which it may.
const UNSEEN: f32 = 0.015;
/// Length in widths of a usual cell from which light may bend between a cell's corners, and the part of their difference by which.
const LONG: f32 = 3.0;
const BEND: f32 = 0.25;

/// The numbers of the corners of a cell in its patch.
fn corners_of(rows: u32, cell: u32) -> [u32; 3] {
    let [x, y] = place_in_part(rows, cell, [1.0 / 3.0; 2]).map(|v| v * rows as f32);
    let (i, j) = (x as u32, y as u32);
    let inverted = x - i as f32 + y - j as f32 > 1.0;
    let opposite = if inverted { [i + 1, j + 1] } else { [i, j] };
    [opposite, [i + 1, j], [i, j + 1]].map(|at| corner_at(rows, at))
}

/// Luma of the light that a cell's rays brought, and its variance from ray to ray; light that was thrown back is taken to come from half
/// of all directions.
fn moments(sum: &Sum) -> [f32; 2] {
    let n = sum.rays.max(1.0);
    let [direct, bounced] = [sum.direct, sum.bounced].map(|light| luma(Vec3::from(light)) / n);
    [direct + bounced, (sum.squares / n - direct * direct).max(0.0) + bounced * bounced]
}

/// Whether a cell's light is to be followed where a pixel has `samples`: `own` is what its rays brought, `smooth` what its corners have,
/// `variance` that of a ray in its patch.
fn is_off(own: &Sum, smooth: [Vec3; 3], variance: f32, is_long: bool, samples: f32) -> bool {
    if own.rays < LEAST_RAYS {
        return false;
    }
    let [light, of_own] = moments(own);
    let variance = variance.max(of_own);
    let smooth = smooth.map(luma);
    let off = (light - smooth.iter().sum::<f32>() / 3.0).abs();
    let range = smooth.iter().copied().fold(0.0, f32::max) - smooth.iter().copied().fold(f32::INFINITY, f32::min);
    let bend = if is_long { BEND * range } else { 0.0 };
    let sure = if off * off > CONFIDENCE * CONFIDENCE * variance / own.rays { off } else { 0.0 };
    let error = sure.max(bend);
    error > UNSEEN * light && error * error > variance / samples
}

/// For each cell, whether photographs of so many samples a pixel follow its light.
pub(super) fn followed(
    assembly: &Assembly,
    layout: &Layout,
    sums: &[Sum],
    corners: &[Vec3],
    samples: u32,
) -> Vec<bool> {
    if samples < LEAST_SAMPLES {
        return vec![false; sums.len()];
    }
    let samples = TIMES_SAMPLES * samples as f32;
    let usual = layout.area.sqrt() as f32;
    let by_patch = mapped(&layout.patches, |_, patch: &Patch| {
        let is_long = longest_edge(assembly, layout, patch) > LONG * usual;
        let own = &sums[patch.cells as usize..(patch.cells + patch.rows.pow(2)) as usize];
        // Rays that seldom find a window say nothing of how seldom.
        let variance = own.iter().map(|sum| moments(sum)[1]).sum::<f32>() / own.len() as f32;
        let cell = |cell: u32| {
            let smooth = corners_of(patch.rows, cell).map(|corner| corners[(patch.corners + corner) as usize]);
            is_off(&own[cell as usize], smooth, variance, is_long, samples)
        };
        // Light is off at corners, and so in all cells around them.
        let mut off = vec![false; ((patch.rows + 1) * (patch.rows + 2) / 2) as usize];
        for at in (0..patch.rows.pow(2)).filter(|at| cell(*at)) {
            corners_of(patch.rows, at).into_iter().for_each(|corner| off[corner as usize] = true);
        }
        let is_near = |at| corners_of(patch.rows, at).into_iter().any(|corner| off[corner as usize]);
        (0..patch.rows.pow(2)).map(is_near).collect::<Vec<_>>()
    });
    by_patch.concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, cells would be judged by corners of others, and smooth light be followed or wrong light be read.
    #[test]
    fn the_corners_of_a_cell_are_around_it() {
        for rows in [1u32, 2, 7, 64] {
            let place = |corner: u32| {
                let j = (0..=rows).rev().find(|j| j * (2 * rows + 3 - j) / 2 <= corner).unwrap();
                [corner - j * (2 * rows + 3 - j) / 2, j].map(|v| v as f32 / rows as f32)
            };
            for cell in 0..rows.pow(2) {
                let corners = corners_of(rows, cell).map(place);
                let middle = place_in_part(rows, cell, [1.0 / 3.0; 2]);
                for axis in 0..2 {
                    let mean = corners.iter().map(|corner| corner[axis]).sum::<f32>() / 3.0;
                    assert!((mean - middle[axis]).abs() < 1e-4 / rows as f32, "{corners:?} around {middle:?}");
                }
            }
        }
    }

    /// If this failed, noise would be taken for an error, or an error that is larger than the noise of a pixel be shown.
    #[test]
    fn light_is_followed_where_it_is_surely_off() {
        let sum = |light: f32, deviation: f32, rays: f32| Sum {
            direct: [rays * light; 3],
            squares: rays * (light * light + deviation * deviation),
            rays,
            ..Sum::default()
        };
        let off = |sum: &Sum, smooth: f32| is_off(sum, [Vec3::splat(smooth); 3], 0.0, false, 128.0);
        assert!(off(&sum(1.0, 0.5, 1000.0), 0.8), "a fifth, of which a fiftieth is noise");
        assert!(!off(&sum(1.0, 0.5, 1000.0), 0.97), "less than a pixel's noise");
        assert!(!off(&sum(1.0, 3.0, 1000.0), 0.8), "within the noise of a pixel");
        assert!(!off(&sum(1.0, 0.5, 4.0), 0.2), "of four rays nothing is said");
        assert!(!off(&sum(1.0, 0.01, 1000.0), 1.005), "nobody would see it");
        assert!(
            !is_off(&sum(1.0, 0.0, 1000.0), [Vec3::splat(0.8); 3], 9.0, false, 128.0),
            "the patch is noisier than the cell"
        );
        let bent = [Vec3::splat(0.4), Vec3::ONE, Vec3::splat(1.6)];
        assert!(is_off(&sum(1.0, 0.5, 1000.0), bent, 0.0, true, 128.0), "light bends along a sliver");
        assert!(!is_off(&sum(1.0, 0.5, 1000.0), bent, 0.0, false, 128.0));
    }
}

//! What a photographed object stands on: a floor or a table, as photos and surface show it.

use std::f64::consts::TAU;

use glam::DVec3;

use super::camera::{Pose, looked_at};

/// Fewest photos, and points around what they look at, from which a floor is found.
const MIN_POSES: usize = 8;
const MIN_POINTS: usize = 100;
/// Lengths in median distances of the photos from what they look at: how far around it points count, and how thick a floor is.
const AROUND: f64 = 0.5;
const THICKNESS: f64 = 0.03;
/// Share of those points that a floor has below it at most: what lies deeper is noise, for nobody photographed it.
const BELOW: f64 = 0.03;
/// Share of those points that it has within its thickness at least.
const WITHIN: f64 = 0.1;

/// Height along `up` of the floor that the surface has below all photos; none where photos look from below it, or no level part of the
/// surface ends it below. `positions` are points of the surface, or the corners of its triangles.
pub fn floor(positions: &[DVec3], photographed: &[Pose], up: DVec3) -> Option<f64> {
    if photographed.len() < MIN_POSES {
        return None;
    }
    let middle = looked_at(photographed, 1e-3)?;
    let mut distances: Vec<f64> = photographed.iter().map(|pose| pose.position.distance(middle)).collect();
    let rank = distances.len() / 2;
    let away = *distances.select_nth_unstable_by(rank, f64::total_cmp).1;
    let around = |p: &&DVec3| (**p - middle).reject_from(up).length() < AROUND * away;
    let mut heights: Vec<f64> = positions.iter().filter(around).map(|p| p.dot(up)).collect();
    if heights.len() < MIN_POINTS {
        return None;
    }
    heights.sort_unstable_by(f64::total_cmp);
    let thickness = THICKNESS * away;
    // The thickest layer with nearly nothing below it: it starts at one of the lowest points.
    let most_below = (BELOW * heights.len() as f64) as usize;
    let end = |start: usize| heights.partition_point(|height| *height <= heights[start] + thickness);
    let start = (0..=most_below).max_by_key(|start| (end(*start) - start, usize::MAX - start))?;
    let layer = &heights[start..end(start)];
    let is_floor = layer.len() as f64 >= WITHIN * heights.len() as f64;
    let floor = layer[layer.len() / 2];
    let above = photographed.iter().filter(|pose| pose.position.dot(up) > floor + thickness).count();
    // A stray pose or two must not hide it.
    (is_floor && 50 * above >= 49 * photographed.len()).then_some(floor)
}

/// The widest angle in radians around what the photos look at, as seen along `up`, in which no photo was taken, and the direction of
/// its middle; none where it is under a third of a turn.
pub fn empty_side(photographed: &[Pose], up: DVec3) -> Option<(f64, DVec3)> {
    if photographed.len() < MIN_POSES {
        return None;
    }
    let middle = looked_at(photographed, 1e-3)?;
    let (x, y) = up.any_orthonormal_pair();
    let angle = |pose: &Pose| (pose.position - middle).dot(y).atan2((pose.position - middle).dot(x));
    let mut angles: Vec<f64> = photographed.iter().map(angle).collect();
    angles.sort_unstable_by(f64::total_cmp);
    let next = angles.iter().skip(1).copied().chain([angles[0] + TAU]);
    let (start, gap) = angles.iter().zip(next).map(|(a, b)| (*a, b - a)).max_by(|a, b| a.1.total_cmp(&b.1))?;
    let (sin, cos) = (start + 0.5 * gap).sin_cos();
    (gap >= TAU / 3.0).then(|| (gap, cos * x + sin * y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    /// A ball of radius 1 whose middle is at the height 1 along `up`, with a table of `share` of the points below it.
    fn points(share: f64, up: DVec3, seed: u64) -> Vec<DVec3> {
        let (across, along) = up.any_orthonormal_pair();
        let point = |i| {
            let [u, v, w, noise] = random::uniforms(seed, 0, i);
            match w < share {
                true => 1.8 * ((2.0 * u - 1.0) * across + (2.0 * v - 1.0) * along) + 0.02 * noise * up,
                false => up + random::direction(u, v),
            }
        };
        (0..4000).map(point).collect()
    }

    /// Photos on a ring that look at the ball, at heights from `low` to `high`.
    fn photos(low: f64, high: f64, up: DVec3) -> Vec<Pose> {
        let (across, along) = up.any_orthonormal_pair();
        let pose = |i: u32| {
            let (sin, cos) = (0.7 * f64::from(i)).sin_cos();
            let position = 4.0 * (cos * across + sin * along) + (low + (high - low) * f64::from(i) / 29.0) * up;
            Pose::looking(position, up - position, up)
        };
        (0..30).map(pose).collect()
    }

    /// If this failed, half of the cameras that are planned for an object on a table would stand below it.
    #[test]
    fn a_table_below_all_photos_is_the_floor() {
        for (seed, up) in [DVec3::Z, DVec3::NEG_Y, DVec3::new(1.0, 2.0, -0.5).normalize()].into_iter().enumerate() {
            for share in [0.2, 0.5, 0.8] {
                let found = floor(&points(share, up, seed as u64), &photos(0.5, 4.0, up), up);
                assert!(found.is_some_and(|height| height.abs() < 0.05), "{found:?}");
            }
        }
    }

    /// If this failed, objects that are photographed from all around would lose half of their region, or a table would cut off the
    /// cameras below which it does not lie.
    #[test]
    fn what_hangs_free_or_is_seen_from_below_has_no_floor() {
        let up = DVec3::Z;
        assert_eq!(floor(&points(0.0, up, 3), &photos(0.5, 4.0, up), up), None);
        assert_eq!(floor(&points(0.5, up, 3), &photos(-3.0, 4.0, up), up), None);
        assert_eq!(floor(&points(0.5, up, 3), &photos(0.5, 4.0, up)[..7], up), None);
        assert_eq!(floor(&points(0.5, up, 3)[..99], &photos(0.5, 4.0, up), up), None);
    }

    /// If this failed, a user would not be asked for the wall that the photos leave room for, or be asked for one where there is none.
    #[test]
    fn the_side_that_no_photo_was_taken_from_is_found() {
        let up = DVec3::NEG_Y;
        let all = photos(0.5, 1.0, up);
        assert_eq!(empty_side(&all, up), None);
        let wall = DVec3::new(0.6, 0.0, 0.8);
        let front: Vec<Pose> = all.into_iter().filter(|pose| pose.position.dot(wall) < 0.0).collect();
        let (gap, direction) = empty_side(&front, up).unwrap();
        assert!((2.9..4.0).contains(&gap) && direction.dot(wall) > 0.9, "{gap} {direction}");
    }
}

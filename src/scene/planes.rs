//! Floors, tables and walls: planes of the surface that have it and all photos on one side.

use glam::{DMat3, DVec3};

use super::camera::{Pose, common_up};
use super::limits::Wall;
use super::random;
use super::stray::Reach;

/// Stream of the points that planes are drawn through.
const STREAM: u32 = 0x706c_616e;
/// Fewest photos and points from which planes are found.
const MIN_POSES: usize = 8;
const MIN_POINTS: usize = 100;
/// Points that are looked at, and planes that are tried for each that is found.
const MAX_POINTS: usize = 5000;
const TRIES: u32 = 4000;
/// Planes that are found at most.
const MAX_PLANES: u32 = 6;
/// Half the thickness of a plane, as a part of the median distance of the photos from the middle of the points.
const THICKNESS: f64 = 0.02;
/// Share of the points that lie in a plane at least, and behind it at most: what lies deeper is noise, for nobody photographed it.
const WITHIN: f64 = 0.08;
const BEHIND: f64 = 0.01;
/// Part of a plane's points that lie within a third of its thickness: of a plane most do, of the cap of something round a third.
const FLAT: f64 = 0.6;
/// A fiftieth of the photos, and so a stray pose or two, may stand behind.
const PHOTOS_BEHIND: f64 = 0.02;
/// Cosines to up of the normal of a floor, at least, and of a wall, at most.
const LEVEL: f64 = 0.82;
const UPRIGHT: f64 = 0.34;

/// The planes of a photographed place.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Planes {
    /// Up: the normal of the floor where there is one; else that of the photos, made parallel to the walls.
    pub up: Option<DVec3>,
    /// What everything stands on.
    pub floor: Option<Wall>,
    /// What ends the place at its sides or above.
    pub walls: Vec<Wall>,
}

impl Planes {
    /// The planes that have a good part of the points in them, and nearly no other point and no photo behind. `positions` are points of the
    /// surface, or the corners of its triangles.
    pub fn of(positions: &[DVec3], photographed: &[Pose]) -> Self {
        let photos_up = common_up(photographed);
        let (Some(held_up), true) = (photos_up, photographed.len() >= MIN_POSES) else {
            return Self { up: photos_up, ..Self::default() };
        };
        let reach = Reach::of(positions);
        let near: Vec<DVec3> = positions.iter().copied().filter(|p| reach.holds(*p)).collect();
        let mut points: Vec<DVec3> = near.iter().copied().step_by(near.len().div_ceil(MAX_POINTS).max(1)).collect();
        if points.len() < MIN_POINTS {
            return Self { up: photos_up, ..Self::default() };
        }
        let places: Vec<DVec3> = photographed.iter().map(|pose| pose.position).collect();
        let mut distances: Vec<f64> = places.iter().map(|place| place.distance(reach.centre)).collect();
        let rank = distances.len() / 2;
        let thickness = THICKNESS * *distances.select_nth_unstable_by(rank, f64::total_cmp).1;
        let all = points.clone();
        let share = |of: &[DVec3], holds: &dyn Fn(f64) -> bool, wall: &Wall| {
            of.iter().filter(|p| holds((**p - wall.point).dot(wall.normal))).count() as f64 / of.len() as f64
        };
        let bounds = |wall: &Wall| {
            share(&places, &|height| height < thickness, wall) <= PHOTOS_BEHIND
                && share(&all, &|height| height < -2.0 * thickness, wall) <= BEHIND
        };
        let mut found: Vec<Wall> = Vec::new();
        for round in 0..MAX_PLANES {
            let drawn = |i: u32| {
                let words = random::bits(0, STREAM + round, i);
                let [a, b, c] = [0, 1, 2].map(|k| points[random::below(words[k], points.len() as u32) as usize]);
                let normal = (b - a).cross(c - a).try_normalize()?;
                Some(facing(Wall { point: a, normal }, &places))
            };
            let weight =
                |wall: &Wall| points.iter().filter(|p| (**p - wall.point).dot(wall.normal).abs() < thickness).count();
            let best = (0..TRIES).filter_map(drawn).filter(|wall| is_placed(wall, held_up)).filter_map(|wall| {
                let weight = weight(&wall);
                // The costly question last.
                (weight as f64 >= WITHIN * all.len() as f64).then_some((weight, wall))
            });
            let mut candidates: Vec<(usize, Wall)> = best.collect();
            candidates.sort_by_key(|(weight, _)| std::cmp::Reverse(*weight));
            let Some((_, rough)) = candidates.into_iter().find(|(_, wall)| bounds(wall)) else { break };
            // The cap of something round has its points and photos on one side as well.
            let own: Vec<DVec3> =
                points.iter().copied().filter(|p| (*p - rough.point).dot(rough.normal).abs() < thickness).collect();
            let fitted = facing(fitted(&own), &places);
            let wall = if bounds(&fitted) && is_placed(&fitted, held_up) { fitted } else { rough };
            let flat = own.iter().filter(|p| (**p - wall.point).dot(wall.normal).abs() < thickness / 3.0).count();
            points.retain(|p| (*p - wall.point).dot(wall.normal).abs() >= 2.0 * thickness);
            if flat as f64 >= FLAT * own.len() as f64 {
                found.push(wall);
            }
            if points.len() < MIN_POINTS {
                break;
            }
        }
        let floor = found.iter().copied().find(|wall| wall.normal.dot(held_up) >= LEVEL);
        let walls: Vec<Wall> = found.iter().copied().filter(|wall| wall.normal.dot(held_up) < LEVEL).collect();
        let along = |up: DVec3, wall: &Wall| up.reject_from(wall.normal).normalize_or(up);
        let upright = walls.iter().filter(|wall| wall.normal.dot(held_up).abs() <= UPRIGHT);
        let up = floor.map_or_else(|| upright.fold(held_up, along), |floor| floor.normal);
        Self { up: Some(up), floor, walls }
    }
}

/// Whether a plane is level with the surface above, or upright, or level with the surface below.
fn is_placed(wall: &Wall, up: DVec3) -> bool {
    let slope = wall.normal.dot(up);
    slope.abs() >= LEVEL || slope.abs() <= UPRIGHT
}

/// The plane with its normal to the side of most photos.
fn facing(wall: Wall, places: &[DVec3]) -> Wall {
    let before = places.iter().filter(|place| (**place - wall.point).dot(wall.normal) > 0.0).count();
    Wall { normal: if 2 * before >= places.len() { wall.normal } else { -wall.normal }, ..wall }
}

/// The plane through points by least squares: across it they spread least.
fn fitted(points: &[DVec3]) -> Wall {
    let point = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let spread =
        points.iter().map(|p| *p - point).fold(DMat3::ZERO, |sum, d| sum + DMat3::from_cols(d * d.x, d * d.y, d * d.z));
    // The inverse's largest eigenvector by powers; a little of the identity keeps exact planes from having none.
    let inverse = (spread
        + DMat3::from_diagonal(DVec3::splat(1e-9 * spread.col(0).x.max(spread.col(1).y).max(spread.col(2).z))))
    .inverse();
    let mut normal = DVec3::new(0.5, 0.6, 0.7);
    for _ in 0..64 {
        normal = (inverse * normal).normalize_or(normal);
    }
    Wall { point, normal: normal.normalize() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball of radius 1 whose middle is at the height 1 along `up`, with a table of `share` of the points below it, and where `wall` is
    /// given a fifth of the points in a wall two behind the ball that faces there.
    fn points(share: f64, up: DVec3, wall: Option<DVec3>, seed: u64) -> Vec<DVec3> {
        let (across, along) = up.any_orthonormal_pair();
        let point = |i| {
            let [u, v, w, noise] = random::uniforms(seed, 0, i);
            match wall {
                Some(facing) if i % 5 == 0 => {
                    (5.0 * u - 2.5) * up.cross(facing) + (3.0 * v) * up - 2.0 * facing + 0.02 * noise * facing
                }
                _ if w < share => 1.8 * ((2.0 * u - 1.0) * across + (2.0 * v - 1.0) * along) + 0.02 * noise * up,
                _ => up + random::direction(u, v),
            }
        };
        (0..4000).map(point).collect()
    }

    /// Photos on a ring, or its part before a wall, that look at the ball from heights of `low` to `high`, with `tilt` radians of roll.
    fn photos(low: f64, high: f64, up: DVec3, wall: Option<DVec3>, tilt: f64) -> Vec<Pose> {
        let (across, along) = up.any_orthonormal_pair();
        let pose = |i: u32| {
            let (sin, cos) = (0.7 * f64::from(i)).sin_cos();
            let position = 4.0 * (cos * across + sin * along) + (low + (high - low) * f64::from(i) / 29.0) * up;
            Pose::looking(position, up - position, (tilt * across + up).normalize())
        };
        (0..30).map(pose).filter(|pose| wall.is_none_or(|facing| pose.position.dot(facing) > -1.0)).collect()
    }

    const UPS: [DVec3; 3] = [DVec3::Z, DVec3::NEG_Y, DVec3::new(0.4364, 0.8729, -0.2182)];

    /// If this failed, half of the cameras that are planned for an object on a table would stand below it, or all of them aslant where
    /// photos were held so.
    #[test]
    fn a_table_below_all_photos_is_the_floor_and_says_what_is_up() {
        for (seed, up) in UPS.into_iter().enumerate() {
            for share in [0.2, 0.5, 0.8] {
                let planes = Planes::of(&points(share, up, None, seed as u64), &photos(0.5, 4.0, up, None, 0.35));
                let floor = planes.floor.unwrap();
                assert!(floor.point.dot(up).abs() < 0.05 && floor.normal.dot(up) > 0.9995, "{floor:?}");
                assert_eq!((planes.up, planes.walls.len()), (Some(floor.normal), 0));
            }
        }
    }

    /// If this failed, cameras would be planned behind the wall that a thing stands before.
    #[test]
    fn a_wall_behind_what_was_photographed_is_found() {
        for (seed, up) in UPS.into_iter().enumerate() {
            let facing = up.any_orthonormal_vector();
            let points = points(0.3, up, Some(facing), 7 + seed as u64);
            let planes = Planes::of(&points, &photos(0.5, 4.0, up, Some(facing), 0.0));
            let [wall] = &planes.walls[..] else { panic!("{planes:?}") };
            assert!(wall.normal.dot(facing) > 0.999 && (wall.point.dot(facing) + 2.0).abs() < 0.05, "{wall:?}");
            assert!(planes.floor.is_some_and(|floor| floor.normal.dot(up) > 0.999));
        }
    }

    /// If this failed, objects that are photographed from all around would lose half of their region, or a table would cut off the
    /// cameras below which it does not lie.
    #[test]
    fn what_hangs_free_or_is_seen_from_below_has_no_planes() {
        let up = DVec3::Z;
        let found = |share, low, count| {
            let planes = Planes::of(&points(share, up, None, 3), &photos(low, 4.0, up, None, 0.0)[..count]);
            (planes.floor, planes.walls)
        };
        let none = (None, Vec::new());
        assert_eq!((found(0.0, 0.5, 30), found(0.5, -3.0, 30), found(0.5, 0.5, 7)), (none.clone(), none.clone(), none));
        assert_eq!(Planes::of(&points(0.5, up, None, 3)[..99], &photos(0.5, 4.0, up, None, 0.0)).floor, None);
    }
}

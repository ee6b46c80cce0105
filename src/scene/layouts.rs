//! Baselines: simple ways to place cameras, against which a plan is measured.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

use super::camera::Pose;
use super::free_space::FreeSpace;
use super::random;
use super::region::{Region, Shape};
use crate::{Error, Result};

/// Separate from the streams of positions, so that a camera's position and direction are independent.
const DIRECTIONS: u32 = 0x8000_0000;

/// Least share of a sphere that an even layout is made of, one of so many.
const SCARCEST: usize = 200;

/// Stream of the rotations of even layouts.
const TURN: u32 = 0x7475_726e;

/// Poses at uniform random positions in free space: looking at the region's centre where `inward`, else in uniform random
/// directions. In the frame of `space`, the image's up along the region's.
pub fn random(space: &FreeSpace, count: usize, seed: u64, inward: bool) -> Vec<Pose> {
    let (up, centre) = (space.region.up, space.region.bounding_sphere().0);
    // Far fewer than 2^32 cameras.
    (0..count as u32)
        .map(|i| {
            let position = space.sample(seed, 0, i);
            let direction = if inward && centre != position {
                centre - position
            } else {
                let [u, v, ..] = random::uniforms(seed, DIRECTIONS, i);
                random::direction(u, v)
            };
            Pose::looking(position, direction, up)
        })
        .collect()
}

/// Poses at spherical Fibonacci points on the sphere halfway through the shell, looking at its centre; where a floor cuts
/// the sphere, on the part above it only. Points are even in area and turn by the golden angle (Swinbank and Purser,
/// "Fibonacci Grids", 2006). The clearance plays no part.
///
/// # Errors
/// [`Error::Request`] where the region is no shell or the floor is above the sphere.
pub fn fibonacci_shell(region: &Region, count: usize) -> Result<Vec<Pose>> {
    even_shell(region, count, 0.5, DQuat::IDENTITY)
}

/// A rotation for an even layout of a region: any, or about the region's up where a floor leaves no other.
pub fn turn(region: &Region, seed: u64, index: u32) -> DQuat {
    let [u, v, w, _] = random::uniforms(seed, TURN, index);
    match region.floor {
        Some(_) => DQuat::from_axis_angle(region.up, TAU * u),
        None => random::rotation([u, v, w]),
    }
}

/// As [`fibonacci_shell`], on the sphere that is `part` of the way from the inner to the outer one, turned by `turn`, which must
/// keep the region's up where it has a floor.
///
/// # Errors
/// As [`fibonacci_shell`].
pub(crate) fn even_shell(region: &Region, count: usize, part: f64, turn: DQuat) -> Result<Vec<Pose>> {
    let Shape::Shell { centre, r_min, r_max } = region.shape else {
        return Err(Error::request("baseline fibonacci: needs a shell to place cameras on; use random in a box"));
    };
    let radius = r_min + part * (r_max - r_min);
    let lowest = region.floor.map_or(-1.0, |floor| ((floor - centre.dot(region.up)) / radius).max(-1.0));
    if lowest >= 1.0 {
        return Err(Error::request("baseline fibonacci: the floor is above the middle of the shell; lower the floor"));
    }
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let (x, y) = region.up.any_orthonormal_pair();
    let pose = |i: usize| {
        let height = lowest + (1.0 - lowest) * (i as f64 + 0.5) / count as f64;
        let (sin, cos) = (TAU * (golden * i as f64).fract()).sin_cos();
        let flat: DVec3 = (1.0 - height * height).sqrt() * (cos * x + sin * y);
        let outward = turn * (flat + height * region.up);
        Pose::looking(centre + radius * outward, -outward, region.up)
    };
    Ok((0..count).map(pose).collect())
}

/// As [`even_shell`], but only where cameras are `allowed`: of an even layout of more, whose points there are as many as
/// requested, or, where none has exactly as many, with evenly spaced ones left out.
///
/// # Errors
/// As [`even_shell`]; also where hardly any of the sphere is allowed.
pub(crate) fn even_where(
    region: &Region,
    count: usize,
    part: f64,
    turn: DQuat,
    allowed: impl Fn(DVec3) -> bool,
) -> Result<Vec<Pose>> {
    let mut all = count;
    while all <= SCARCEST * count.max(1) {
        let mut poses = even_shell(region, all, part, turn)?;
        poses.retain(|pose| allowed(pose.position));
        if poses.len() >= count {
            let found = poses.len();
            return Ok((0..count).map(|i| poses[i * found / count]).collect());
        }
        // Towards the number that the allowed share requires, from below.
        all = (all * count / poses.len().max(1)).clamp(all + 1, 2 * all);
    }
    Err(Error::request(
        "baseline fibonacci: hardly any of the sphere in the middle of the shell is allowed; use random",
    ))
}

/// The poses that are left when each of these places, one after the other, has taken the one nearest to it.
pub(crate) fn left_beside(mut poses: Vec<Pose>, taken: &[DVec3]) -> Vec<Pose> {
    for place in taken {
        let away = |pose: &Pose| pose.position.distance_squared(*place);
        let nearest = (0..poses.len()).min_by(|a, b| away(&poses[*a]).total_cmp(&away(&poses[*b])));
        nearest.map(|nearest| poses.swap_remove(nearest));
    }
    poses
}

/// Poses on three level rings along the walls of a room, a fifth of the way to the middle, at a third, six tenths and five sixths of its
/// height, looking across: how a person walking around photographs a room. In the frame of `space`, at its free places.
pub fn rings(space: &FreeSpace, count: usize) -> Vec<Pose> {
    let up = space.region.up;
    let (low, high) = space.region.bounds();
    let (across, along) = up.any_orthonormal_pair();
    let extent = |axis: DVec3| ((high - low) * axis).element_sum().abs();
    let middle = 0.5 * (low + high);
    let pose = |i: usize| {
        let (ring, height) = (i % 3, [1.0 / 3.0, 0.6, 5.0 / 6.0][i % 3]);
        let in_ring = (count + 2 - ring) / 3;
        // Rings are turned against one another.
        let (sin, cos) = (TAU * ((i / 3) as f64 + ring as f64 / 3.0) / in_ring as f64).sin_cos();
        // Around a rectangle, not an ellipse: corners are seen from.
        let longest = sin.abs().max(cos.abs());
        let out = 0.4 / longest * (extent(across) * cos * across + extent(along) * sin * along);
        let centre = middle + (height - 0.5) * extent(up) * up;
        let position = space.project(centre + out);
        Pose::looking(position, -out, up)
    };
    (0..count).map(pose).collect()
}

/// Poses on an even grid at eye height, six tenths up the region, in four level directions a place, the first of them 45
/// degrees off the region's axes: how a room is photographed from a tripod. In the frame of `space`, at its free places.
pub fn grid(space: &FreeSpace, count: usize) -> Vec<Pose> {
    let up = space.region.up;
    let (low, high) = space.region.bounds();
    let (across, along) = up.any_orthonormal_pair();
    let extent = |axis: DVec3| ((high - low) * axis).element_sum().abs().max(1e-9);
    let (wide, deep) = (extent(across), extent(along));
    let places = count.div_ceil(4);
    let columns = ((places as f64 * wide / deep).sqrt().round() as usize).clamp(1, places.max(1));
    let rows = places.div_ceil(columns);
    let middle = 0.5 * (low + high) + 0.1 * extent(up) * up;
    let pose = |i: usize| {
        let (place, direction) = (i / 4, i % 4);
        let at = |k: usize, of: usize| (k as f64 + 0.5) / of as f64 - 0.5;
        let (x, y) = (wide * at(place % columns, columns), deep * at(place / columns, rows));
        let (sin, cos) = (TAU * (0.125 + 0.25 * direction as f64)).sin_cos();
        Pose::looking(space.project(middle + x * across + y * along), cos * across + sin * along, up)
    };
    (0..count).map(pose).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::proxy::{Orientation, Proxy};
    use crate::scene::samples;

    fn shell(floor: Option<f64>) -> Region {
        let up = DVec3::new(0.0, 0.6, 0.8);
        Region::around_object((DVec3::ONE, 1.0), 0.5, up, floor).unwrap()
    }

    /// A baseline with cameras outside the region, inside the object or looking away would flatter every plan.
    #[test]
    fn random_cameras_are_free_and_look_in_or_anywhere() {
        let proxy = Proxy::new(&samples::sphere(1.0, 12), Orientation::Trusted).unwrap();
        let region = Region::around_object(proxy.sphere, 0.5, DVec3::Z, Some(0.0)).unwrap();
        let space = FreeSpace::new(&proxy.occluder, &region, 40).unwrap();
        let poses = random(&space, 200, 1, true);
        assert_eq!(poses.len(), 200);
        for pose in &poses {
            assert!(space.is_free(pose.position) && region.contains(pose.position));
            assert!(pose.forward().dot(-pose.position.normalize()) > 0.999);
        }
        assert_ne!(poses, random(&space, 200, 2, true));

        let room = Region::inside_room((DVec3::splat(-4.0), DVec3::splat(4.0)), None, DVec3::Z).unwrap();
        let space = FreeSpace::new(&proxy.occluder, &room, 40).unwrap();
        let mean = random(&space, 500, 1, false).iter().map(Pose::forward).sum::<DVec3>() / 500.0;
        assert!(mean.length() < 0.1, "cameras in a room prefer {mean}");
    }

    /// Fibonacci points are the strongest simple baseline: on the sphere, above the floor, evenly spread.
    #[test]
    fn fibonacci_cameras_are_even_on_the_sphere_above_the_floor() {
        for floor in [None, Some(1.4)] {
            let region = shell(floor);
            let poses = fibonacci_shell(&region, 100).unwrap();
            let Shape::Shell { centre, r_min, r_max } = region.shape else { unreachable!() };
            let radius = 0.5 * (r_min + r_max);
            let mut nearest = Vec::new();
            for (i, pose) in poses.iter().enumerate() {
                assert!(region.contains(pose.position));
                assert!((pose.position.distance(centre) - radius).abs() < 1e-9);
                assert!(pose.forward().dot((centre - pose.position).normalize()) > 1.0 - 1e-9);
                let others = poses.iter().enumerate().filter(|(j, _)| *j != i);
                nearest.push(others.map(|(_, o)| o.position.distance(pose.position)).fold(f64::INFINITY, f64::min));
            }
            let (low, high) = nearest.iter().fold((f64::INFINITY, 0f64), |(l, h), d| (l.min(*d), h.max(*d)));
            assert!(high < 1.8 * low, "nearest neighbours between {low} and {high}");
        }
    }

    /// If this failed, the simple layout that a plan is measured against in a corner would be uneven, short of cameras, or partly
    /// at infeasible positions.
    #[test]
    fn even_layouts_of_a_part_are_even_and_whole() {
        let region = shell(None);
        let Shape::Shell { centre, .. } = region.shape else { unreachable!() };
        for (count, wide) in [(20, 2.0), (50, 1.0), (97, 0.6)] {
            let allowed = |p: DVec3| (p - centre).angle_between(DVec3::X) < wide;
            let poses = even_where(&region, count, 0.5, DQuat::from_rotation_y(0.3), allowed).unwrap();
            assert_eq!(poses.len(), count);
            assert!(poses.iter().all(|pose| allowed(pose.position)));
            let nearest = |i: usize| {
                let others = poses.iter().enumerate().filter(|(j, _)| *j != i);
                others.map(|(_, o)| o.position.distance(poses[i].position)).fold(f64::INFINITY, f64::min)
            };
            let nearest: Vec<f64> = (0..count).map(nearest).collect();
            let (low, high) = nearest.iter().fold((f64::INFINITY, 0f64), |(l, h), d| (l.min(*d), h.max(*d)));
            assert!(high < 2.5 * low, "{count}: nearest neighbours between {low} and {high}");
        }
        assert!(even_where(&region, 20, 0.5, DQuat::IDENTITY, |_| false).is_err());
        let all = even_shell(&region, 30, 0.5, DQuat::IDENTITY).unwrap();
        let taken = [all[3].position * 1.01, all[17].position];
        let left = left_beside(all.clone(), &taken);
        assert!(left.len() == 28 && !left.contains(&all[3]) && !left.contains(&all[17]));
    }

    /// If this failed, cameras of the walk around a room would look at the nearest wall, or be inside it.
    #[test]
    fn rings_look_across_the_room() {
        let proxy = Proxy::new(&samples::cube(), Orientation::Trusted).unwrap();
        let (low, high) = (DVec3::new(-4.0, -3.0, -1.5), DVec3::new(4.0, 3.0, 1.5));
        let room = Region::inside_room((low, high), None, DVec3::Z).unwrap();
        let space = FreeSpace::new(&proxy.occluder, &room, 60).unwrap();
        for count in [1, 7, 30] {
            let poses = rings(&space, count);
            assert_eq!(poses.len(), count);
            for pose in &poses {
                let flat = pose.position.with_z(0.0);
                assert!(space.is_free(pose.position) && pose.forward().z.abs() < 1e-9);
                assert!(pose.forward().dot(-flat.normalize()) > 0.9, "{pose:?}");
                assert!(flat.x.abs() > 2.8 || flat.y.abs() > 2.0, "{flat} is in the middle");
            }
        }
    }

    /// In a room there is no sphere, and under a floor none of it is left: both are for the user to fix.
    #[test]
    fn fibonacci_needs_a_shell_above_the_floor() {
        let room = Region::inside_room((DVec3::ZERO, DVec3::ONE), None, DVec3::Z).unwrap();
        assert!(fibonacci_shell(&room, 10).is_err());
        let floor = shell(None).top() - 0.01;
        assert!(fibonacci_shell(&shell(Some(floor)), 10).is_err());
    }
}

//! Controls: simple ways to place cameras, against which a plan is measured.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

use super::camera::Pose;
use super::free_space::FreeSpace;
use super::random;
use super::region::{Region, Shape};
use crate::{Error, Result};

/// Apart from the streams of positions, so that where a camera stands says nothing about where it looks.
const DIRECTIONS: u32 = 0x8000_0000;

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
pub fn even_shell(region: &Region, count: usize, part: f64, turn: DQuat) -> Result<Vec<Pose>> {
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

    /// A control with cameras outside the region, inside the object or looking away would flatter every plan.
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

    /// Fibonacci points are the strongest simple control: on the sphere, above the floor, evenly spread.
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

    /// In a room there is no sphere, and under a floor none of it is left: both are the user's to mend.
    #[test]
    fn fibonacci_needs_a_shell_above_the_floor() {
        let room = Region::inside_room((DVec3::ZERO, DVec3::ONE), None, DVec3::Z).unwrap();
        assert!(fibonacci_shell(&room, 10).is_err());
        let floor = shell(None).top() - 0.01;
        assert!(fibonacci_shell(&shell(Some(floor)), 10).is_err());
    }
}

//! Pictures full of the surface: cameras planned for a capture turn to the middle of what they see, where that costs nothing.
//!
//! What is expected of a camera depends on what is in its picture, and hardly on what part of the picture that fills. Of sparse points
//! much is unknown beside the surface, and a photo that is half of it is half a photo.

use glam::DVec3;

use super::problem::Problem;
use super::reference::Reference;
use crate::Result;
use crate::scene::camera::{Intrinsics, Pose};
use crate::visibility::device_scene::SceneGeometry;
use crate::visibility::raycast::Ray;

/// Rays along a side of the widened picture, and how much wider it is.
const SIDE: u32 = 16;
const WIDER: f64 = 1.5;
/// Share of a picture that shows the surface, from which it is full.
const FULL: f64 = 0.9;
/// Decibels of expected quality that turning may cost.
const COST: f64 = 0.02;
/// Turns of each camera, and cameras up to which each is asked for by itself where all together cost more.
const ROUNDS: u32 = 3;
const ONE_BY_ONE: usize = 64;

/// Turns cameras at `poses`, in the user's world, and says how many are turned.
///
/// # Errors
/// Where the device fails.
pub(super) fn aim(reference: &Reference, problem: &Problem<'_>, poses: &mut [Pose]) -> Result<usize> {
    let geometry = &*problem.geometry;
    let to_internal = geometry.to_internal;
    let mut internal: Vec<Pose> = poses.iter().map(|pose| to_internal.pose(pose)).collect();
    let turned: Vec<Option<Pose>> =
        internal.iter().enumerate().map(|(j, pose)| toward_surface(geometry, &problem.lens_of(j), pose)).collect();
    let wanted: Vec<usize> = (0..poses.len()).filter(|i| turned[*i].is_some()).collect();
    if wanted.is_empty() {
        return Ok(0);
    }
    let most = reference.expect(&internal)?.error_db + COST;
    let all: Vec<Pose> = internal.iter().zip(&turned).map(|(pose, turned)| turned.unwrap_or(*pose)).collect();
    let mut count = 0;
    if reference.expect(&all)?.error_db <= most {
        (internal, count) = (all, wanted.len());
    } else if wanted.len() <= ONE_BY_ONE {
        for i in wanted {
            let before = internal[i];
            internal[i] = all[i];
            match reference.expect(&internal)?.error_db <= most {
                true => count += 1,
                false => internal[i] = before,
            }
        }
    }
    let back = to_internal.inverse();
    poses.iter_mut().zip(&internal).for_each(|(pose, internal)| *pose = back.pose(internal));
    Ok(count)
}

/// The pose turned to the middle of what it sees a little beyond its picture; none where its picture is full, or would not show more.
fn toward_surface(geometry: &SceneGeometry, intrinsics: &Intrinsics, pose: &Pose) -> Option<Pose> {
    let (before, mut middle) = seen(geometry, intrinsics, pose);
    if before >= FULL {
        return None;
    }
    let mut best = (before, None);
    for _ in 0..ROUNDS {
        let turned = Pose::looking(pose.position, middle?, DVec3::Z);
        let (share, next) = seen(geometry, intrinsics, &turned);
        if share > best.0 {
            best = (share, Some(turned));
        }
        middle = next;
    }
    best.1
}

/// The share of a picture that shows the surface, and the mean direction of what the widened picture shows.
fn seen(geometry: &SceneGeometry, intrinsics: &Intrinsics, pose: &Pose) -> (f64, Option<DVec3>) {
    let (mut inside, mut all, mut sum) = (0u32, 0u32, DVec3::ZERO);
    let [width, height] = [intrinsics.width, intrinsics.height].map(f64::from);
    for i in 0..SIDE * SIDE {
        let place = [i % SIDE, i / SIDE].map(|k| 0.5 + WIDER * ((f64::from(k) + 0.5) / f64::from(SIDE) - 0.5));
        let x = (place[0] * width - intrinsics.principal[0]) / intrinsics.focal[0];
        let y = (place[1] * height - intrinsics.principal[1]) / intrinsics.focal[1];
        let direction = pose.rotation * DVec3::new(x, y, 1.0).normalize();
        let ray = Ray { origin: pose.position.as_vec3(), direction: direction.as_vec3(), t_min: 0.0, t_max: f32::MAX };
        let hit = geometry.bvh.any_hit(&ray);
        let is_inside = place.iter().all(|at| (0.0..1.0).contains(at));
        all += u32::from(is_inside);
        inside += u32::from(is_inside && hit);
        if hit {
            sum += direction;
        }
    }
    (f64::from(inside) / f64::from(all.max(1)), sum.try_normalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::proxy::{Orientation, Proxy};
    use crate::scene::region::{Region, Shape};
    use crate::scene::samples;

    /// If this failed, photographers would be sent to take pictures that are half empty, or be turned away from what they see.
    #[test]
    fn a_camera_turns_to_the_middle_of_what_it_sees() {
        let proxy = Proxy::new(&samples::cube(), Orientation::Trusted).unwrap();
        let shape = Shape::Shell { centre: DVec3::ZERO, r_min: 1.0, r_max: 4.0 };
        let region = Region { shape, up: DVec3::Z, floor: None, clearance: 0.05 };
        let geometry = SceneGeometry::new(&proxy, &region).unwrap();
        let intrinsics = Intrinsics::from_fov(300, 200, 0.5);
        let at = geometry.to_internal.point(DVec3::new(-3.0, 0.3, 0.2));
        let middle = geometry.to_internal.point(DVec3::new(-0.5, 0.0, 0.0)) - at;
        let aside = Pose::looking(at, middle + 0.25 * middle.length() * DVec3::Y, DVec3::Z);
        let turned = toward_surface(&geometry, &intrinsics, &aside).unwrap();
        assert!(turned.position == at && turned.forward().angle_between(middle).to_degrees() < 3.0);
        assert!(seen(&geometry, &intrinsics, &turned).0 > seen(&geometry, &intrinsics, &aside).0 + 0.1);
        // Of nothing there is no middle, and a full picture stays.
        assert_eq!(toward_surface(&geometry, &intrinsics, &Pose::looking(at, -middle, DVec3::Z)), None);
        let near = geometry.to_internal.point(DVec3::new(-1.1, 0.0, 0.0));
        assert_eq!(toward_surface(&geometry, &intrinsics, &Pose::looking(near, middle, DVec3::Z)), None);
    }
}

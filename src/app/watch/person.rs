//! What holds of a person with a camera: the ground is level, and hands reach from about the knees to overhead.

use glam::{DMat3, DQuat, DVec3};

use crate::Result;
use crate::files::photos::PhotoSet;
use crate::planner::plan::target::Target;
use crate::scene::limits::Limits;
use crate::scene::planes::Planes;
use crate::scene::region::Shape;

/// Heights of a camera in a room that a person reaches, as parts of the room's.
const REACHED: [f64; 2] = [0.2, 0.85];

/// Photos in a frame whose Z is up and whose X is at right angles to a wall, as far as they and their points show either: the frame of
/// structure from motion is any.
pub fn levelled(set: PhotoSet) -> PhotoSet {
    let poses: Vec<_> = set.photos.iter().map(|photo| photo.camera.pose).collect();
    let planes = Planes::of(&set.points.positions, &poses);
    let Some(up) = planes.up.and_then(DVec3::try_normalize) else { return set };
    let faces = planes.walls.first().map_or(up.any_orthonormal_vector(), |wall| wall.normal);
    let x = faces.reject_from_normalized(up).normalize_or(up.any_orthonormal_vector());
    set.turned(DQuat::from_mat3(&DMat3::from_cols(x, up.cross(x), up)).inverse())
}

/// A room with the cameras at heights that a person reaches, and at those of the photos; others, and rooms that are aslant to up, stay as
/// they are.
///
/// # Errors
/// As [`Target::within`].
pub fn in_reach(target: Target, photos: &PhotoSet) -> Result<Target> {
    let (up, Shape::Box { min, max }) = (target.region.up, target.region.shape) else { return Ok(target) };
    if target.limits.heights.is_some() || up.abs().max_element() < 1.0 - 1e-9 {
        return Ok(target);
    }
    let [a, b] = [min, max].map(|corner| corner.dot(up));
    let (low, high) = (a.min(b), a.max(b));
    let heights = photos.photos.iter().map(|photo| photo.camera.pose.position.dot(up));
    let [least, most] = REACHED.map(|part| low + part * (high - low));
    let heights = heights.fold([least, most], |[least, most], height| [least.min(height), most.max(height)]);
    let limits = Limits { heights: Some(heights), ..target.limits.clone() };
    target.within(limits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::photos::Photo;
    use crate::planner::plan::config::Preset;
    use crate::planner::plan::target::RegionChoice;
    use crate::scene::camera::{Camera, Intrinsics, Pose};
    use crate::scene::lens::Distortion;
    use crate::scene::samples;
    use crate::scene::surface::Surface;

    /// Photos from places that look along directions, up being `up`.
    fn photos(taken: &[(DVec3, DVec3)], up: DVec3) -> PhotoSet {
        let photo = |(i, (place, toward)): (usize, &(DVec3, DVec3))| Photo {
            camera: Camera {
                name: format!("{i}.jpg"),
                pose: Pose::looking(*place, *toward, up),
                intrinsics: Intrinsics::from_fov(64, 48, 1.0),
            },
            distortion: Distortion::default(),
            image: None,
            mask: None,
        };
        PhotoSet { photos: taken.iter().enumerate().map(photo).collect(), ..PhotoSet::default() }
    }

    /// If this failed, a person would be sent below the floor where COLMAP's frame lies aslant.
    #[test]
    fn photos_of_any_frame_become_level() {
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -1.1, 2.3);
        let taken = [(DVec3::ZERO, DVec3::X), (DVec3::Y, DVec3::new(1.0, 0.3, 0.0)), (DVec3::NEG_Y, DVec3::Y)];
        let aslant = photos(&taken.map(|(place, toward)| (turn * place, turn * toward)), turn * DVec3::Z);
        let level = levelled(aslant.clone());
        for ((before, after), (place, _)) in aslant.photos.iter().zip(&level.photos).zip(taken) {
            assert!(after.camera.pose.up().distance(DVec3::Z) < 1e-9, "{:?}", after.camera.pose);
            assert!((after.camera.pose.position.length() - place.length()).abs() < 1e-12);
            assert_eq!(before.camera.name, after.camera.name);
        }
        let angle = |set: &PhotoSet| {
            let [a, b] = [0, 1].map(|i| set.photos[i].camera.pose.forward());
            a.angle_between(b)
        };
        assert!((angle(&aslant) - angle(&level)).abs() < 1e-9, "the photos turned to one another");
    }

    /// If this failed, advice would ask for photos from under the ceiling and from the floor, which a person leaves out.
    #[test]
    fn a_person_reaches_neither_floor_nor_ceiling() {
        let lens = Intrinsics::from_fov(64, 48, 1.0);
        let choice = RegionChoice::default();
        let of = |surface: &Surface, preset: Preset| {
            Target::new(surface, "room", preset, &choice, DVec3::Z, &lens).expect("a target")
        };
        let target = of(&samples::room(), Preset::Room);
        let Shape::Box { min, max } = target.region.shape else { panic!("a room has a box") };
        let at = |part: f64| DVec3::new(2.0, 2.0, min.z + part * (max.z - min.z));
        let usual = photos(&[(at(0.6), DVec3::X)], DVec3::Z);
        let heights = in_reach(target, &usual).unwrap().limits.heights.unwrap();
        assert!((heights[0] - at(0.2).z).abs() < 1e-9 && (heights[1] - at(0.85).z).abs() < 1e-9, "{heights:?}");
        // Who has held it lower reaches that.
        let low = photos(&[(at(0.05), DVec3::X)], DVec3::Z);
        let heights = in_reach(of(&samples::room(), Preset::Room), &low).unwrap().limits.heights.unwrap();
        assert!((heights[0] - at(0.05).z).abs() < 1e-9, "{heights:?}");
        let object = in_reach(of(&samples::object(), Preset::Object), &usual).unwrap();
        assert_eq!(object.limits.heights, None);
    }
}

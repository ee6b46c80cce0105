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
/// Greatest cosine between up and the normal of a wall: ceilings are none.
const SHEER: f64 = 0.2;

/// Photos in a frame whose Z is up and whose X is at right angles to a wall, as far as they and their points show that; none where they do
/// not show up. The frame of structure from motion is any, but stays as more photos come, and so does this one: of the four right angles it
/// takes that whose X is nearest to the X there.
pub fn levelled(set: &PhotoSet) -> Option<PhotoSet> {
    let poses: Vec<_> = set.photos.iter().map(|photo| photo.camera.pose).collect();
    let planes = Planes::of(&set.points.positions, &poses);
    let up = planes.up?.try_normalize()?;
    let level = |axis: DVec3| axis.reject_from_normalized(up).try_normalize();
    let before = level(DVec3::X).filter(|_| up.x.abs() < 0.9).or_else(|| level(DVec3::Y))?;
    let wall = planes.walls.iter().find(|wall| wall.normal.dot(up).abs() < SHEER).and_then(|wall| level(wall.normal));
    let faces = wall.unwrap_or(before);
    let quarters = [faces, up.cross(faces), -faces, -up.cross(faces)];
    let x = quarters.into_iter().max_by(|a, b| a.dot(before).total_cmp(&b.dot(before)))?;
    Some(set.clone().turned(DQuat::from_mat3(&DMat3::from_cols(x, up.cross(x), up)).inverse()))
}

/// A room whose up is an axis, with the cameras at heights that a person reaches, and at those of the photos; others stay as they are.
///
/// # Errors
/// As [`Target::within`].
pub fn in_reach(target: Target, photos: &PhotoSet) -> Result<Target> {
    let (up, Shape::Box { min, max }) = (target.region.up, target.region.shape) else { return Ok(target) };
    if target.limits.heights.is_some() {
        return Ok(target);
    }
    let along = |(a, b): (DVec3, DVec3)| [a.dot(up).min(b.dot(up)), a.dot(up).max(b.dot(up))];
    let [low, high] = along((min, max));
    let [least, most] = REACHED.map(|part| low + part * (high - low));
    let [lowest, highest] = photos.stood().map_or([least, most], along);
    let limits = Limits { heights: Some([least.min(lowest), most.max(highest)]), ..target.limits.clone() };
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
    use crate::scene::surface::{Points, Surface};
    use crate::scene::{random, samples};

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

    /// If this failed, a person would be sent below the floor where COLMAP's frame lies aslant, or the map would turn from photo to photo.
    #[test]
    fn rooms_of_any_frame_become_level() {
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -1.1, 2.3);
        let noise = |i: u32| 0.01 * (random::uniforms(3, 1, i)[0] - 0.5);
        // The floor, the ceiling, which is heavier, and two walls of a room of 6 x 4 x 2.5, turned by 20 degrees about up.
        let walls = DQuat::from_rotation_z(0.35);
        let point = |i: u32| {
            let [u, v, ..] = random::uniforms(3, 0, i);
            let (x, y, z) = (6.0 * u, 4.0 * v, 2.5 * v);
            let at = match i % 6 {
                0 | 1 => DVec3::new(x, y, 0.0),
                2..=3 => DVec3::new(x, y, 2.5),
                4 => DVec3::new(6.0 * u, 0.0, z),
                _ => DVec3::new(0.0, 4.0 * u, z),
            };
            walls * (at + DVec3::new(noise(3 * i), noise(3 * i + 1), noise(3 * i + 2)))
        };
        let taken: Vec<(DVec3, DVec3)> = (0..12)
            .map(|i| {
                let angle = f64::from(i) / 12.0 * std::f64::consts::TAU;
                let place = DVec3::new(3.0 + 1.5 * angle.cos(), 2.0 + angle.sin(), 1.4 + 0.02 * f64::from(i % 3));
                (turn * walls * place, turn * walls * DVec3::new(-angle.cos(), -angle.sin(), -0.1))
            })
            .collect();
        let of = |count: u32| {
            let positions = (0..count).map(|i| turn * point(i)).collect();
            PhotoSet { points: Points { positions, ..Points::default() }, ..photos(&taken, turn * DVec3::Z) }
        };
        let level = levelled(&of(3000)).expect("photos have an up");
        for photo in &level.photos {
            let [forward, up] = [photo.camera.pose.forward(), photo.camera.pose.up()];
            assert!(up.z > 0.98 && forward.z.abs() < 0.15, "{:?}", photo.camera.pose);
        }
        let positions = || level.points.positions.iter().copied();
        let max = positions().fold(DVec3::NEG_INFINITY, DVec3::max);
        let mut sides = (max - positions().fold(DVec3::INFINITY, DVec3::min)).to_array();
        sides.sort_by(f64::total_cmp);
        for (side, length) in sides.into_iter().zip([2.5, 4.0, 6.0]) {
            assert!((side - length).abs() < 0.1, "{sides:?} of a room of 6 x 4 x 2.5: its box is aslant");
        }
        // More points make no other frame.
        let more = levelled(&of(3600)).expect("photos have an up");
        let [a, b] = [&level, &more].map(|set| set.photos[0].camera.pose.forward());
        assert!(a.angle_between(b) < 0.05, "{a} has become {b}");
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
        let low = photos(&[(at(0.05), DVec3::X), (at(0.06), DVec3::X), (at(0.07), DVec3::X)], DVec3::Z);
        let heights = in_reach(of(&samples::room(), Preset::Room), &low).unwrap().limits.heights.unwrap();
        assert!((heights[0] - at(0.05).z).abs() < 1e-9, "{heights:?}");
        let object = in_reach(of(&samples::object(), Preset::Object), &usual).unwrap();
        assert_eq!(object.limits.heights, None);
    }
}

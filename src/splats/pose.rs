//! Corrections of the poses of photos, learnt with the splats. Twin of `splats/pose.glsl` and `splats/pose_apply.comp`.

use glam::{DMat3, DQuat, DVec3};

use super::render::frame::{Frame, View};
use crate::files::photos::Photo;
use crate::scene::camera::Pose;

/// What the pose of a photo is corrected by, in the training frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseCorrection {
    /// How the camera is turned about its own place: a rotation vector in world axes, in radians.
    pub turn: DVec3,
    /// How it is moved, in extents of the cameras.
    pub shift: DVec3,
}

impl PoseCorrection {
    /// From numbers as the device keeps them: turn, then shift.
    pub fn from_device(value: &[f32; 6]) -> Self {
        let [a, b, c, x, y, z] = value.map(f64::from);
        Self { turn: DVec3::new(a, b, c), shift: DVec3::new(x, y, z) }
    }

    /// A pose in the training frame, corrected.
    pub fn of(&self, pose: &Pose) -> Pose {
        let turn = DQuat::from_scaled_axis(self.turn);
        Pose { position: pose.position + self.shift, rotation: (turn * pose.rotation).normalize() }
    }

    /// A photo of the world whose training frame is `frame`, corrected.
    pub fn of_photo(&self, photo: &Photo, frame: &Frame) -> Photo {
        let mut corrected = photo.clone();
        let pose = self.of(&frame.to_training.pose(&photo.camera.pose));
        corrected.camera.pose = frame.to_training.inverse().pose(&pose);
        corrected
    }

    /// A view, corrected.
    pub fn of_view(&self, view: &View) -> View {
        let turn = DMat3::from_quat(DQuat::from_scaled_axis(self.turn));
        let place = DVec3::from(view.position.map(f64::from)) + self.shift;
        let row = |[x, y, z, _]: [f32; 4]| {
            let row = turn * DVec3::new(x.into(), y.into(), z.into());
            row.extend(-row.dot(place)).as_vec4().to_array()
        };
        View {
            row_x: row(view.row_x),
            row_y: row(view.row_y),
            row_z: row(view.row_z),
            position: place.as_vec3().to_array(),
            ..*view
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::camera::{Camera, Intrinsics};

    /// If this failed, poses would be written that nobody has trained with.
    #[test]
    fn views_and_poses_are_corrected_alike() {
        let correction = PoseCorrection { turn: DVec3::new(0.1, -0.2, 0.05), shift: DVec3::new(0.3, 0.1, -0.4) };
        let pose = Pose::looking(DVec3::new(1.0, -2.0, 0.5), DVec3::new(-1.0, 2.0, 0.1), DVec3::Z);
        let intrinsics = Intrinsics::from_fov(64, 48, 1.0);
        let view = |pose: Pose| Frame::new(&[], &[]).view(&Camera { name: "a".into(), pose, intrinsics });
        let (known, found) = (view(correction.of(&pose)), correction.of_view(&view(pose)));
        let rows = |view: &View| [view.row_x, view.row_y, view.row_z].concat();
        let apart = rows(&known).iter().zip(rows(&found)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(apart < 1e-6, "{apart}");
        assert!(known.position.iter().zip(found.position).all(|(a, b)| (a - b).abs() < 1e-6));
        let same = PoseCorrection { turn: DVec3::ZERO, shift: DVec3::ZERO }.of(&pose);
        assert!(same.position == pose.position && same.rotation.dot(pose.rotation) > 1.0 - 1e-12);
    }
}

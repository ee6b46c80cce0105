//! Similarity transforms: the map between the user's world and the planner's normalised frame.

use glam::{DQuat, DVec3};

use super::camera::Pose;

/// `x -> scale * (rotation * x) + translation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// Unit rotation.
    pub rotation: DQuat,
    /// Positive scale.
    pub scale: f64,
    /// Translation, in the target frame's units.
    pub translation: DVec3,
}

impl Similarity {
    /// The transform that leaves everything where it is.
    pub const IDENTITY: Self = Self { rotation: DQuat::IDENTITY, scale: 1.0, translation: DVec3::ZERO };

    /// Maps the sphere around `centre` with `radius` > 0 to the unit sphere around the origin, without rotation: from the
    /// world to the planner's frame, given the region's bounding sphere.
    pub fn to_unit_sphere(centre: DVec3, radius: f64) -> Self {
        let scale = 1.0 / radius;
        Self { rotation: DQuat::IDENTITY, scale, translation: -scale * centre }
    }

    /// The image of a point.
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.scale * (self.rotation * p) + self.translation
    }

    /// The image of a direction; its length is kept.
    pub fn direction(&self, d: DVec3) -> DVec3 {
        self.rotation * d
    }

    /// The image of a length.
    pub fn length(&self, length: f64) -> f64 {
        self.scale * length
    }

    /// The image of a world-from-camera pose.
    pub fn pose(&self, pose: &Pose) -> Pose {
        Pose { position: self.point(pose.position), rotation: (self.rotation * pose.rotation).normalize() }
    }

    /// This transform after another one.
    pub fn after(&self, first: &Self) -> Self {
        Self {
            rotation: (self.rotation * first.rotation).normalize(),
            scale: self.scale * first.scale,
            translation: self.point(first.translation),
        }
    }

    /// The transform that undoes this one.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        let scale = 1.0 / self.scale;
        Self { rotation, scale, translation: -scale * (rotation * self.translation) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::EulerRot;

    /// Plans are made in the normalised frame and reported in the world: the way there and back must lose nothing.
    #[test]
    fn the_inverse_undoes_points_directions_lengths_and_poses() {
        let there = Similarity {
            rotation: DQuat::from_euler(EulerRot::XYZ, 0.3, -1.1, 2.0),
            scale: 0.04,
            translation: DVec3::new(3.0, -70.0, 0.5),
        };
        let back = there.inverse();
        let p = DVec3::new(12.0, 0.1, -5.0);
        let pose = Pose::looking(p, DVec3::new(1.0, 2.0, 0.3), DVec3::Z);
        let round = back.pose(&there.pose(&pose));
        assert!((back.point(there.point(p)) - p).length() < 1e-12);
        assert!((back.direction(there.direction(p)) - p).length() < 1e-12);
        assert!((back.length(there.length(7.0)) - 7.0).abs() < 1e-12);
        assert!((round.position - pose.position).length() < 1e-12);
        assert!((round.forward() - pose.forward()).length() < 1e-12);
    }

    /// A camera must keep looking at the same point after the transform.
    #[test]
    fn a_pose_keeps_what_it_looks_at() {
        let there = Similarity { rotation: DQuat::from_rotation_x(0.7), ..Similarity::to_unit_sphere(DVec3::ONE, 5.0) };
        let (eye, target) = (DVec3::new(4.0, 0.0, 1.0), DVec3::new(-1.0, 2.0, 0.0));
        let pose = there.pose(&Pose::looking(eye, target - eye, DVec3::Z));
        let toward = (there.point(target) - pose.position).normalize();
        assert!((pose.forward() - toward).length() < 1e-12);
    }

    /// The planner's lengths assume that the region's bounding sphere is the unit sphere.
    #[test]
    fn the_bounding_sphere_becomes_the_unit_sphere() {
        let there = Similarity::to_unit_sphere(DVec3::new(1.0, 2.0, 3.0), 4.0);
        assert!((there.point(DVec3::new(5.0, 2.0, 3.0)) - DVec3::X).length() < 1e-15);
    }
}

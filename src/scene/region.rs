//! Feasible regions: where cameras may be placed.

use std::f64::consts::FRAC_PI_2;

use glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::camera::{Pose, looked_at};
use super::similarity::Similarity;
use super::stray::Reach;
use crate::{Error, Result};

/// The shape a camera must stay in, in world units; a clearance around the surface may be cut out of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// Between two concentric spheres.
    Shell {
        /// Centre of both spheres.
        centre: DVec3,
        /// Smallest distance from the centre.
        r_min: f64,
        /// Largest distance from the centre.
        r_max: f64,
    },
    /// An axis-aligned box.
    Box {
        /// Lowest corner.
        min: DVec3,
        /// Highest corner.
        max: DVec3,
    },
}

impl Shape {
    /// The shell that holds cameras which look in from around something: its centre is the point nearest to all
    /// viewing axes in the sense of least squares, its radii are the least and greatest distance from there with a tenth
    /// to spare; stray poses apart. None for fewer than three cameras, or where they do not look at one place.
    pub fn around_cameras(poses: &[Pose]) -> Option<Self> {
        if poses.len() < 3 {
            return None;
        }
        let centre = looked_at(poses, 1e-3)?;
        let facing = poses.iter().filter(|pose| pose.forward().dot(centre - pose.position) > 0.0).count();
        let reach = Reach::of(&poses.iter().map(|pose| pose.position).collect::<Vec<_>>());
        let near = || poses.iter().filter(|pose| reach.holds(pose.position));
        let distances = || near().map(|pose| pose.position.distance(centre));
        let (r_min, r_max) = (0.9 * distances().fold(f64::INFINITY, f64::min), 1.1 * distances().fold(0.0, f64::max));
        (centre.is_finite() && 10 * facing > 9 * poses.len() && r_min > 0.0).then_some(Self::Shell {
            centre,
            r_min,
            r_max,
        })
    }
}

/// A shape, an optional floor plane and the clearance that cameras keep from the surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Region {
    /// The shape.
    pub shape: Shape,
    /// Unit up direction of the scene.
    pub up: DVec3,
    /// Cameras stay at or above this height along `up`, where given.
    pub floor: Option<f64>,
    /// No camera is closer than this to the surface.
    pub clearance: f64,
}

impl Region {
    /// The default shell around an object with the given bounding sphere, for cameras whose image holds a cone of half
    /// angle `half_cone` (radians; see [`super::camera::Intrinsics::inscribed_cone`]).
    ///
    /// At r = radius / sin(half_cone) the object just fills that cone; the shell reaches from 0.9 r to 1.3 r, but never
    /// closer than 1.05 radii to the centre. The clearance is a twentieth of the radius.
    ///
    /// # Errors
    /// [`Error::Request`] where the cone, the sphere, `up` or the floor leave no region.
    pub fn around_object(sphere: (DVec3, f64), half_cone: f64, up: DVec3, floor: Option<f64>) -> Result<Self> {
        let (centre, radius) = sphere;
        if !(half_cone > 0.0 && half_cone < FRAC_PI_2) {
            let degrees = 2.0 * half_cone.to_degrees();
            return Err(Error::request(format!("field of view: {degrees} degrees; give one between 0 and 180")));
        }
        let fill = radius / half_cone.sin();
        let r_min = (0.9 * fill).max(1.05 * radius);
        let r_max = (1.3 * fill).max(1.1 * r_min);
        let shape = Shape::Shell { centre, r_min, r_max };
        Self { shape, up, floor, clearance: 0.05 * radius }.validated()
    }

    /// The outermost fiftieth of a shell; a box as it is.
    pub fn outermost(&self) -> Self {
        let shape = match self.shape {
            Shape::Shell { centre, r_min, r_max } => Shape::Shell { centre, r_min: r_min.max(0.98 * r_max), r_max },
            shape @ Shape::Box { .. } => shape,
        };
        Self { shape, ..*self }
    }

    /// The default box inside a room: its bounds shrunk by the clearance, which is a twentieth of the smallest side where
    /// none is given.
    ///
    /// # Errors
    /// [`Error::Request`] where the bounds or `up` make no sense or the clearance leaves no box.
    pub fn inside_room(bounds: (DVec3, DVec3), clearance: Option<f64>, up: DVec3) -> Result<Self> {
        let (min, max) = bounds;
        let clearance = clearance.unwrap_or(0.05 * (max - min).min_element());
        let shape = Shape::Box { min: min + clearance, max: max - clearance };
        Self { shape, up, floor: None, clearance }.validated()
    }

    /// The region itself, checked, with `up` at unit length.
    ///
    /// # Errors
    /// [`Error::Request`] for numbers that are not finite, an inverted or empty shape, a negative clearance, a zero up
    /// direction, or a floor above everything.
    pub fn validated(self) -> Result<Self> {
        let wrong = |what: String| Err(Error::request(format!("region: {what}")));
        // First, since a box may be made of it.
        if !(self.clearance >= 0.0 && self.clearance.is_finite()) {
            return wrong(format!("clearance {}; give a length of zero or more", self.clearance));
        }
        match self.shape {
            Shape::Shell { centre, r_min, r_max } => {
                if !(centre.is_finite() && r_min.is_finite() && r_max.is_finite()) {
                    return wrong(format!("shell at {centre} with radii {r_min} and {r_max} is not finite"));
                }
                if r_min < 0.0 || r_min >= r_max {
                    return wrong(format!(
                        "shell radii {r_min} and {r_max}; the inner must be positive and the smaller"
                    ));
                }
            }
            Shape::Box { min, max } => {
                if !(min.is_finite() && max.is_finite()) {
                    return wrong(format!("box from {min} to {max} is not finite"));
                }
                if min.cmpge(max).any() {
                    return wrong(format!(
                        "box from {min} to {max} is empty or inverted; give lower then higher corner, or lower `clearance`"
                    ));
                }
            }
        }
        let Some(up) = self.up.try_normalize() else {
            return wrong(format!("up direction {} has no direction; give a vector that is not zero", self.up));
        };
        let valid = Self { up, ..self };
        if matches!(self.shape, Shape::Box { .. }) && self.floor.is_some() && up.abs().max_element() < 1.0 - 1e-9 {
            return wrong(format!("a floor in a box needs an up along an axis, not {up}; give `up`"));
        }
        if let Some(floor) = self.floor {
            let top = valid.top();
            if !floor.is_finite() || floor >= top {
                return wrong(format!(
                    "floor at height {floor} leaves no space below the top at {top}; lower the floor"
                ));
            }
        }
        Ok(valid)
    }

    /// The point of the shape, above the floor, nearest to `p` (nearly so where shape and floor meet).
    pub fn nearest(&self, p: DVec3) -> DVec3 {
        let within = |p: DVec3| match self.shape {
            Shape::Shell { centre, r_min, r_max } => {
                let out = p - centre;
                let r = out.length();
                if r > 0.0 { centre + out * (r.clamp(r_min, r_max) / r) } else { centre + r_min * self.up }
            }
            Shape::Box { min, max } => p.clamp(min, max),
        };
        let p = within(p);
        match self.floor {
            Some(floor) if p.dot(self.up) < floor => {
                let raised = within(p + (floor - p.dot(self.up)) * self.up);
                raised + (floor - raised.dot(self.up)).max(0.0) * self.up
            }
            _ => p,
        }
    }

    /// From the user's world to the planner's frame: the shape's bounding sphere becomes the unit sphere, `up` +Z. For a
    /// box the axis nearest to `up` becomes +Z, so that it stays aligned.
    pub fn to_planner_frame(&self) -> Similarity {
        let (centre, radius) = self.bounding_sphere();
        let up = match self.shape {
            Shape::Shell { .. } => self.up,
            Shape::Box { .. } => nearest_axis(self.up),
        };
        // The world axis most across `up` that comes next after it in cyclic order becomes X.
        let largest = up.abs().max_position();
        let heading = [DVec3::Y, DVec3::Z, DVec3::X][largest];
        let x = (heading - heading.dot(up) * up).normalize();
        let rotation = DQuat::from_mat3(&DMat3::from_cols(x, up.cross(x), up).transpose()).normalize();
        let scale = 1.0 / radius;
        Similarity { rotation, scale, translation: -scale * (rotation * centre) }
    }

    /// Centre and radius of the shape's bounding sphere: the unit of length inside the planner.
    pub fn bounding_sphere(&self) -> (DVec3, f64) {
        match self.shape {
            Shape::Shell { centre, r_max, .. } => (centre, r_max),
            Shape::Box { min, max } => (0.5 * (min + max), 0.5 * (max - min).length()),
        }
    }

    /// Lowest and highest corner of the shape.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        match self.shape {
            Shape::Shell { centre, r_max, .. } => (centre - r_max, centre + r_max),
            Shape::Box { min, max } => (min, max),
        }
    }

    /// Greatest height of the shape along `up`.
    pub fn top(&self) -> f64 {
        match self.shape {
            Shape::Shell { centre, r_max, .. } => centre.dot(self.up) + r_max,
            Shape::Box { min, max } => (min * self.up).max(max * self.up).element_sum(),
        }
    }

    /// Whether `p` is within the shape and not below the floor. The clearance is [`super::free_space`]'s matter.
    pub fn contains(&self, p: DVec3) -> bool {
        let inside = match self.shape {
            Shape::Shell { centre, r_min, r_max } => (r_min..=r_max).contains(&p.distance(centre)),
            Shape::Box { min, max } => p.cmpge(min).all() && p.cmple(max).all(),
        };
        inside && self.floor.is_none_or(|floor| p.dot(self.up) >= floor)
    }

    /// The violation `|a|² + |b|²` and its gradient `2 (a + b)`, where `a` leads from the nearest point of the shape to `p`
    /// and `b` from the floor to `p`; both zero where `p` is feasible.
    pub fn violation(&self, p: DVec3) -> (f64, DVec3) {
        let shape = match self.shape {
            Shape::Shell { centre, r_min, r_max } => {
                let offset = p - centre;
                let radius = offset.length();
                // At the very centre every way out is as short: take the one up.
                let outward = offset.try_normalize().unwrap_or(self.up);
                (radius - radius.clamp(r_min, r_max)) * outward
            }
            Shape::Box { min, max } => p - p.clamp(min, max),
        };
        let below = self.floor.map_or(0.0, |floor| (p.dot(self.up) - floor).min(0.0));
        let floor = below * self.up;
        (shape.length_squared() + floor.length_squared(), 2.0 * (shape + floor))
    }

    /// The region in another frame.
    ///
    /// # Errors
    /// [`Error::Request`] for a box under a rotation, which is no longer axis-aligned.
    pub fn transformed(&self, similarity: &Similarity) -> Result<Self> {
        let shape = match self.shape {
            Shape::Shell { centre, r_min, r_max } => Shape::Shell {
                centre: similarity.point(centre),
                r_min: similarity.length(r_min),
                r_max: similarity.length(r_max),
            },
            Shape::Box { min, max } => {
                // Only a rotation that turns axes into axes keeps the box a box.
                let turned = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| similarity.direction(axis));
                if turned.iter().any(|axis| axis.abs().max_element() < 1.0 - 1e-9) {
                    return Err(Error::request("region: a box cannot be rotated; give it in the rotated frame"));
                }
                let (a, b) = (similarity.point(min), similarity.point(max));
                Shape::Box { min: a.min(b), max: a.max(b) }
            }
        };
        let up = similarity.direction(self.up);
        let floor = self.floor.map(|floor| similarity.point(floor * self.up).dot(up));
        Ok(Self { shape, up, floor, clearance: similarity.length(self.clearance) })
    }
}

/// The signed axis nearest to a direction.
fn nearest_axis(direction: DVec3) -> DVec3 {
    let mut axis = DVec3::ZERO;
    let largest = direction.abs().max_position();
    axis[largest] = direction[largest].signum();
    axis
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    /// Cameras planned for a reconstruction must be where the photographer could be: not where the bounds of some stray
    /// points would put them.
    #[test]
    fn a_shell_holds_the_cameras_that_look_in() {
        let target = DVec3::new(1.0, -2.0, 0.5);
        let poses: Vec<Pose> = (0..12)
            .map(|i| {
                let (sin, cos) = (0.4 * f64::from(i)).sin_cos();
                let eye = target + (2.0 + 0.1 * f64::from(i)) * DVec3::new(cos, sin, 0.3);
                Pose::looking(eye, target - eye, DVec3::Z)
            })
            .collect();
        let Some(Shape::Shell { centre, r_min, r_max }) = Shape::around_cameras(&poses) else { panic!("no shell") };
        assert!(centre.distance(target) < 1e-9);
        assert!(poses.iter().all(|pose| (r_min..r_max).contains(&pose.position.distance(centre))));
        // All looking the same way, or out: no shell.
        let same: Vec<Pose> = poses.iter().map(|p| Pose::looking(p.position, DVec3::X, DVec3::Z)).collect();
        let out: Vec<Pose> = poses.iter().map(|p| Pose::looking(p.position, p.position - target, DVec3::Z)).collect();
        assert_eq!((Shape::around_cameras(&same), Shape::around_cameras(&out)), (None, None));
    }

    fn shell() -> Region {
        let shape = Shape::Shell { centre: DVec3::new(1.0, 0.0, 0.0), r_min: 1.0, r_max: 2.0 };
        Region { shape, up: DVec3::Z, floor: Some(-0.5), clearance: 0.1 }
    }

    fn room() -> Region {
        let shape = Shape::Box { min: DVec3::ZERO, max: DVec3::new(6.0, 4.0, 2.8) };
        Region { shape, up: DVec3::Z, floor: None, clearance: 0.1 }
    }

    fn positions() -> impl Iterator<Item = DVec3> {
        (0..500).map(|i| {
            let [x, y, z, _] = random::uniforms(1, 0, i);
            10.0 * DVec3::new(x, y, z) - 4.0
        })
    }

    /// A wrong gradient drives cameras out of the region instead of back into it.
    #[test]
    fn the_violation_is_zero_inside_and_its_gradient_is_that_of_finite_differences() {
        for region in [shell(), room()] {
            for p in positions() {
                let (value, gradient) = region.violation(p);
                assert_eq!(value == 0.0, region.contains(p), "{p}");
                let h = 1e-6;
                let difference = DVec3::from_array(
                    DVec3::AXES
                        .map(|axis| (region.violation(p + h * axis).0 - region.violation(p - h * axis).0) / (2.0 * h)),
                );
                assert!((difference - gradient).length() < 1e-4 * (1.0 + gradient.length()), "{p}");
            }
        }
        assert!(shell().violation(DVec3::new(1.0, 0.0, 0.0)).1.is_finite());
    }

    /// The planner works in the normalised frame: feasible there must mean feasible in the world.
    #[test]
    fn a_transformed_region_holds_the_transformed_points() {
        for region in [shell(), room()] {
            let (centre, radius) = region.bounding_sphere();
            let mut map = Similarity::to_unit_sphere(centre, radius);
            if matches!(region.shape, Shape::Shell { .. }) {
                map.rotation = DQuat::from_rotation_y(0.4);
            }
            let there = region.transformed(&map).unwrap();
            for p in positions() {
                assert_eq!(there.contains(map.point(p)), region.contains(p));
            }
            assert!((there.clearance - 0.1 / radius).abs() < 1e-12);
        }
        let turned = Similarity { rotation: DQuat::from_rotation_y(0.4), ..Similarity::IDENTITY };
        assert!(room().transformed(&turned).is_err());
    }

    /// Cameras of the default shell must be outside the object and see most of it.
    #[test]
    fn the_default_shell_is_outside_the_object_and_frames_it() {
        for degrees in [10.0f64, 30.0, 60.0, 89.0] {
            let half = degrees.to_radians();
            let region = Region::around_object((DVec3::ONE, 2.0), half, 3.0 * DVec3::Z, None).unwrap();
            let Shape::Shell { centre, r_min, r_max } = region.shape else { unreachable!() };
            assert!(centre == DVec3::ONE && r_min >= 2.1 && r_max > r_min && region.up == DVec3::Z);
            let fill = 2.0 / half.sin();
            assert!(r_max > fill && (r_min < fill || r_min == 2.1));
        }
        assert!(Region::around_object((DVec3::ONE, 2.0), 2.0, DVec3::Z, None).is_err());
        assert!(Region::around_object((DVec3::ONE, 0.0), 0.5, DVec3::Z, None).is_err());
    }

    /// A room's default box keeps cameras off its walls by a twentieth of its lowest side.
    #[test]
    fn the_default_box_keeps_off_the_walls() {
        let bounds = (DVec3::ZERO, DVec3::new(6.0, 4.0, 2.0));
        let region = Region::inside_room(bounds, None, DVec3::Z).unwrap();
        assert!((region.clearance - 0.1).abs() < 1e-12);
        assert!(region.contains(DVec3::splat(0.11)) && !region.contains(DVec3::splat(0.09)));
        let message = Region::inside_room(bounds, Some(1.2), DVec3::Z).unwrap_err().to_string();
        assert!(message.contains("`clearance`"), "{message}");
    }

    /// Invalid input must be refused in one line before anything is computed from it.
    #[test]
    fn nonsense_is_refused_in_one_line() {
        let good = shell();
        let Shape::Shell { centre, .. } = good.shape else { unreachable!() };
        let with = |shape| Region { shape, ..good };
        let bad = [
            with(Shape::Shell { centre, r_min: 2.0, r_max: 1.0 }),
            with(Shape::Shell { centre, r_min: -1.0, r_max: 1.0 }),
            with(Shape::Shell { centre, r_min: 1.0, r_max: f64::INFINITY }),
            with(Shape::Box { min: DVec3::ONE, max: DVec3::ZERO }),
            with(Shape::Box { min: DVec3::ZERO, max: DVec3::new(1.0, 1.0, 0.0) }),
            with(Shape::Box { min: DVec3::NAN, max: DVec3::ONE }),
            Region { up: DVec3::ZERO, ..good },
            Region { clearance: -0.1, ..good },
            Region { floor: Some(2.0), ..good },
            Region { floor: Some(f64::NAN), ..good },
        ];
        for region in bad {
            let message = region.validated().unwrap_err().to_string();
            assert!(message.starts_with("region: ") && !message.contains('\n'), "{message}");
        }
        assert_eq!(good.validated().unwrap(), good);
    }
}

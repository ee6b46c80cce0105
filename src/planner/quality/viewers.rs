//! Viewers: the poses from which the trained model will be viewed.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::scene::camera::{Camera, Intrinsics, Pose};
use crate::scene::connected::Air;
use crate::scene::proxy::SurfacePoint;
use crate::scene::random;
use crate::scene::region::Shape;
use crate::scene::similarity::Similarity;
use crate::visibility::bvh::Primitives;
use crate::visibility::device_scene::SceneGeometry;
use crate::{Error, Result};

/// First stream of the viewers' poses; each try has one of its own, and so has where it looks.
const POSITIONS: u32 = 0x7669_6500;
const DIRECTIONS: u32 = 0x7669_7500;
/// Viewers that points of a surface face.
const FACED: u32 = 128;
/// Tries for each viewer.
const TRIES: u32 = 2000;

/// A distribution of viewers' poses, in the user's world.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Viewers {
    /// By the region. Around an object a third each: at half of its outer radius and at the whole of it, looking at the
    /// centre, and anywhere between with the centre anywhere in the picture. In a box or a room: anywhere in free space,
    /// in any direction. Above the floor where there is one.
    #[default]
    Region,
    /// As around an object, between two spheres.
    Shell {
        /// Their centre.
        centre: DVec3,
        /// The smaller radius.
        r_min: f64,
        /// The larger radius.
        r_max: f64,
    },
    /// Anywhere in a box, in any direction.
    Box {
        /// Lowest corner.
        min: DVec3,
        /// Highest corner.
        max: DVec3,
    },
    /// As by the region, but in a cone about its centre only.
    Cone {
        /// Direction from the centre to the middle of the cone.
        axis: DVec3,
        /// Full opening angle in degrees.
        degrees: f64,
    },
    /// As by the region, but between two heights along up only.
    Heights {
        /// The lower.
        low: f64,
        /// The higher.
        high: f64,
    },
    /// These cameras, each as often as the others.
    Cameras(Vec<Camera>),
}

impl Viewers {
    /// Whether it is the default.
    pub fn is_default(&self) -> bool {
        matches!(self, Self::Region)
    }

    /// Whether viewers look from the direction of a position in the planner's frame, as far as they define one: of the whole
    /// sphere, a cone or heights.
    pub fn face(&self, geometry: &SceneGeometry, place: DVec3) -> bool {
        let up = geometry.to_internal.inverse().direction(geometry.region.up);
        match *self {
            Self::Cone { axis, degrees } => {
                let out = place - geometry.region.bounding_sphere().0;
                out.angle_between(geometry.to_internal.direction(axis)) <= 0.5 * degrees.to_radians() + 1e-9
            }
            Self::Heights { low, high } => {
                let height = geometry.to_internal.inverse().point(place).dot(up);
                (low..=high).contains(&height)
            }
            _ => true,
        }
    }

    /// `count` viewers with the lens `intrinsics` (cameras have their own), in the user's world. `inward`: of an object, seen
    /// from around it. The same seed gives the same viewers, the first of a larger count among them.
    ///
    /// # Errors
    /// Where no position fits the request.
    pub fn sample(
        &self,
        geometry: &SceneGeometry,
        intrinsics: Intrinsics,
        inward: bool,
        seed: u64,
        count: u32,
    ) -> Result<Vec<Camera>> {
        if let Self::Cameras(cameras) = self {
            if cameras.is_empty() {
                return Err(Error::request("viewers: there are no cameras; name a file with some"));
            }
            // Each as often as the others; of more than requested, evenly spaced ones.
            let (count, all) = (count as usize, cameras.len());
            let drawn = if all > count { count } else { all * (count / all) };
            return Ok((0..drawn)
                .map(|i| cameras[if all > count { i * all / count } else { i % all }].clone())
                .collect());
        }
        let draw = Draw::new(self, geometry, intrinsics, inward, seed);
        (0..count).map(|i| draw.viewer(i)).collect::<Option<Vec<_>>>().ok_or_else(|| {
            Error::request(
                "viewers: hardly any place fits what `viewers` says (or the region), above the floor and within `wall` and `keep_out`; give a \
                 larger part",
            )
        })
    }

    /// `points` of the surface, those of its open parts on the side that such viewers see; see [`SceneGeometry::facing`].
    ///
    /// # Errors
    /// As [`Self::sample`].
    pub fn facing(
        &self,
        points: Vec<SurfacePoint>,
        geometry: &SceneGeometry,
        intrinsics: Intrinsics,
        inward: bool,
    ) -> Result<Vec<SurfacePoint>> {
        if !points.iter().any(|point| point.either_side) {
            return Ok(points);
        }
        let viewers = self.sample(geometry, intrinsics, inward, 0, FACED)?;
        let places: Vec<DVec3> =
            viewers.iter().map(|viewer| geometry.to_internal.point(viewer.pose.position)).collect();
        Ok(geometry.facing(points, &places))
    }
}

/// What viewers are drawn by, in the user's world.
struct Draw<'d> {
    viewers: &'d Viewers,
    geometry: &'d SceneGeometry,
    intrinsics: Intrinsics,
    inward: bool,
    seed: u64,
    back: Similarity,
    /// The sphere that they are in.
    centre: DVec3,
    radius: f64,
    up: DVec3,
    /// The middle of the surface.
    middle: DVec3,
    /// Height of the floor along up.
    floor: Option<f64>,
    /// The smaller and the larger distance from the centre, where they stand around it.
    around: Option<[f64; 2]>,
    /// Where an object may reach into the region: what is not inside it.
    air: Option<Air>,
}

impl<'d> Draw<'d> {
    fn new(viewers: &'d Viewers, geometry: &'d SceneGeometry, intrinsics: Intrinsics, inward: bool, seed: u64) -> Self {
        let back = geometry.to_internal.inverse();
        let (centre, radius) = match *viewers {
            Viewers::Shell { centre, r_max, .. } => (centre, r_max),
            _ => {
                let (centre, radius) = geometry.region.bounding_sphere();
                (back.point(centre), back.length(radius))
            }
        };
        let up = back.direction(geometry.region.up);
        let floor = geometry.region.floor.map(|floor| back.point(floor * geometry.region.up).dot(up));
        // No viewer is inside the object: with a wide lens the region can be that near. Where floor, walls or other things reach
        // into the region, the surface does not show where the object ends, and a viewer in free space is not in it.
        let reach = reach(geometry);
        let alone = match geometry.region.shape {
            Shape::Shell { r_min, .. } => reach <= r_min,
            Shape::Box { .. } => true,
        };
        let air = if alone { None } else { Some(geometry.open().air()) };
        let around = match (viewers, geometry.region.shape) {
            (Viewers::Shell { r_min, r_max, .. }, _) => Some([*r_min, *r_max]),
            (Viewers::Box { .. }, _) | (_, Shape::Box { .. }) => None,
            _ if !inward => None,
            _ if !alone => Some([0.5 * radius, radius]),
            _ => Some([(0.5 * radius).max(1.02 * back.length(reach)).min(radius), radius]),
        };
        let middle = back.point(bounds(geometry).iter().map(|corner| 0.5 * corner.as_dvec3()).sum());
        Self { viewers, geometry, intrinsics, inward, seed, back, centre, radius, up, middle, floor, around, air }
    }

    fn viewer(&self, i: u32) -> Option<Camera> {
        let position = self.position(i)?;
        let [u, v, ..] = random::uniforms(self.seed, DIRECTIONS, i);
        let aside = |middle: DVec3| aside(position, middle - position, self.up, &self.intrinsics, [u, v]);
        let pose = match self.around {
            Some(_) if i % 3 < 2 => Pose::looking(position, self.centre - position, self.up),
            Some(_) => aside(self.centre),
            // Around an object in a box every viewer has it in the picture.
            None if self.inward => aside(self.middle),
            None => Pose::looking(position, random::direction(u, v), self.up),
        };
        Some(Camera { name: format!("viewer_{i:05}"), pose, intrinsics: self.intrinsics })
    }

    /// Where the i-th viewer stands; none where no try fits.
    fn position(&self, i: u32) -> Option<DVec3> {
        // Of three kinds: at the smaller radius, at the larger one, between; where limits cover a whole sphere, anywhere between.
        let tries = [i % 3, 2].into_iter().flat_map(|kind| (0..TRIES).map(move |k| (k, kind)));
        let mut places = tries.map(|(k, kind)| self.place(POSITIONS + k, i, kind));
        // Known space may be a small part of what is drawn from.
        let anywhere = || {
            let known = self.geometry.limits.space.is_some() && self.viewers.is_default();
            let drawn = (0..TRIES).map(|k| self.in_region(POSITIONS + k, i));
            drawn.filter(|_| known).find(|place| self.fits(*place))
        };
        places.find(|place| self.fits(*place)).or_else(anywhere)
    }

    fn place(&self, stream: u32, i: u32, kind: u32) -> DVec3 {
        match (self.around, self.viewers) {
            (Some(radii), _) => self.in_shell(radii, kind, random::uniforms(self.seed, stream, i)),
            (None, Viewers::Box { min, max }) => {
                let [u, v, w, _] = random::uniforms(self.seed, stream, i);
                *min + (*max - *min) * DVec3::new(u, v, w)
            }
            (None, _) => self.in_region(stream, i),
        }
    }

    fn in_region(&self, stream: u32, i: u32) -> DVec3 {
        self.back.point(self.geometry.open().sample(self.seed, stream, i))
    }

    /// A place at the nearer radius, at the farther one, or between, by its kind, for four numbers in [0, 1).
    fn in_shell(&self, [near, far]: [f64; 2], kind: u32, [u, v, w, _]: [f64; 4]) -> DVec3 {
        let (centre, up) = (self.centre, self.up);
        // Of a sphere that lies below the floor nothing is left.
        let height = self.floor.map_or(f64::NEG_INFINITY, |floor| floor - centre.dot(up));
        let near = near.max(height.min(far));
        // Even in volume.
        let between = (near.powi(3) + (far.powi(3) - near.powi(3)) * w).cbrt();
        let (low, high) = match *self.viewers {
            Viewers::Heights { low, high } => (height.max(low - centre.dot(up)), high - centre.dot(up)),
            _ => (height, f64::INFINITY),
        };
        let distance = match kind {
            0 if low < near && high > -near => near,
            1 => far,
            _ => between,
        };
        // Even on the part of the sphere that fits: height is even on a sphere (Archimedes), along any axis.
        let (axis, lowest, highest) = match *self.viewers {
            Viewers::Cone { axis, degrees } => (axis.normalize(), (0.5 * degrees.to_radians()).min(PI).cos(), 1.0),
            _ => (up, (low / distance).clamp(-1.0, 1.0), (high / distance).clamp(-1.0, 1.0)),
        };
        let (side, front) = axis.any_orthonormal_pair();
        let z = lowest + (highest - lowest) * u;
        let (sin, cos) = (TAU * v).sin_cos();
        centre + distance * (z * axis + (1.0 - z * z).max(0.0).sqrt() * (cos * side + sin * front))
    }

    fn fits(&self, place: DVec3) -> bool {
        let height = place.dot(self.up);
        let inside = self.geometry.to_internal.point(place);
        if !self.geometry.is_allowed(inside) || self.air.as_ref().is_some_and(|air| !air.holds(inside)) {
            return false;
        }
        // Spheres are cut off at the floor as they are drawn from, but for rounding.
        let slack = 1e-9 * self.radius;
        self.floor.is_none_or(|floor| height >= floor - slack)
            && match *self.viewers {
                Viewers::Cone { axis, degrees } => {
                    (place - self.centre).angle_between(axis) <= 0.5 * degrees.to_radians() + 1e-9
                }
                Viewers::Heights { low, high } => (low - slack..=high + slack).contains(&height),
                _ => true,
            }
    }
}

/// Lowest and highest corner of the surface, in the planner's frame.
fn bounds(geometry: &SceneGeometry) -> [Vec3; 2] {
    let around = |[low, high]: [Vec3; 2], p: Vec3| [low.min(p), high.max(p)];
    let none = [Vec3::INFINITY, Vec3::NEG_INFINITY];
    match &geometry.bvh.primitives {
        Primitives::Triangles(triangles) => triangles.iter().map(|triangle| Vec3::from(triangle.v0)).fold(none, around),
        Primitives::Discs(discs) => discs.iter().map(|disc| Vec3::from(disc.centre)).fold(none, around),
    }
}

/// Distance of the surface's farthest corner from the region's centre, in the planner's frame.
fn reach(geometry: &SceneGeometry) -> f64 {
    let centre = geometry.region.bounding_sphere().0.as_vec3();
    let farthest = match &geometry.bvh.primitives {
        Primitives::Triangles(triangles) => triangles.iter().fold(0.0f32, |most, triangle| {
            let corner = Vec3::from(triangle.v0) - centre;
            let others = [triangle.e1, triangle.e2].map(|edge| (corner + Vec3::from(edge)).length());
            most.max(corner.length()).max(others[0]).max(others[1])
        }),
        Primitives::Discs(discs) => {
            discs.iter().fold(0.0f32, |most, disc| most.max((Vec3::from(disc.centre) - centre).length()))
        }
    };
    f64::from(farthest)
}

/// The pose at `position` that has what lies in `direction` at image position (u, v), each in [0, 1).
fn aside(position: DVec3, direction: DVec3, up: DVec3, intrinsics: &Intrinsics, [u, v]: [f64; 2]) -> Pose {
    let straight = Pose::looking(position, direction, up);
    let [fx, fy] = intrinsics.focal;
    let [cx, cy] = intrinsics.principal;
    let (x, y) = ((u * f64::from(intrinsics.width) - cx) / fx, (v * f64::from(intrinsics.height) - cy) / fy);
    // Turned the other way by the same: nearly so, since the image stays upright.
    let forward = straight.rotation * DVec3::new(-x, -y, 1.0);
    Pose::looking(position, forward, up)
}

//! The empty space of a room: cameras in it that no method chooses, and new positions for those that a method put inside an
//! object it did not see.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::views::camera;
use crate::engine::vulkan::Context;
use crate::lab::baselines;
use crate::lab::baselines::request::BaselineRequest;
use crate::planner::methods::Method;
use crate::planner::plan::config::{Config, Preset};
use crate::planner::plan::problem::Problem;
use crate::planner::plan::target::Target;
use crate::scene::camera::{Camera, Intrinsics, Pose};
use crate::scene::layouts;
use crate::visibility::device_scene::SceneGeometry;
use crate::visibility::raycast::Ray;
use crate::{Error, Result};

/// Seeds of the input and the test cameras: both are the same in all runs.
const INPUT_SEED: u64 = 0x696e_7075;
const TEST_SEED: u64 = 0x7465_7374;
/// Places from which a light map is to be detailed, and their seed.
const EYES: usize = 256;
const EYE_SEED: u64 = 0x6579_6573;
/// Rays along a side of a picture, and the share of all that must end on the surface: a view out of a window tests nothing.
const RAYS: u32 = 8;
const MIN_SEEN: f64 = 0.5;
/// Draws for each camera.
const DRAWS: usize = 50;
/// Points that a surface made from photos is compared with.
const POINTS: usize = 1000;
/// Places that input cameras are chosen from.
const PLACES: u32 = 600;

/// Where a camera can be in the scene itself, whatever methods are shown of it.
pub struct EmptySpace {
    target: Target,
    geometry: SceneGeometry,
}

/// Places anywhere that cameras may stand, in the world.
pub(super) fn eyes(geometry: &SceneGeometry) -> Vec<DVec3> {
    let back = geometry.to_internal.inverse();
    let drawn = layouts::random(geometry.open(), EYES, EYE_SEED, false);
    drawn.into_iter().map(|pose| back.point(pose.position)).collect()
}

impl EmptySpace {
    /// The empty space of the region of a scene.
    ///
    /// # Errors
    /// Where there is none, or the region lies outside of the room.
    pub fn new(target: Target) -> Result<Self> {
        let (min, max) = target.region.bounds();
        let (low, high) = target.proxy.bounds();
        if min.cmpge(high).any() || max.cmple(low).any() {
            return Err(Error::request(format!(
                "region: the box from {min:.3} to {max:.3} lies outside of the scene, which goes from {low:.3} to {high:.3}; \
                 give another --box"
            )));
        }
        let geometry = target.geometry()?;
        Ok(Self { target, geometry })
    }

    /// Input cameras as a person who knows the room would choose them: of random positions those that show most of it, to one
    /// camera first and then to three. As few random cameras leave half of a room unseen, and hardly a point seen by three.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn inputs(&self, context: &Arc<Context>, intrinsics: Intrinsics, count: u32) -> Result<Vec<Camera>> {
        let config = Config { seed: INPUT_SEED, held_out: 1, ..Config::new(Preset::Room, count) };
        let request = BaselineRequest::new(Method::Coverage, Some(PLACES.max(count)), &config)?;
        let problem = Problem::new(&self.target, intrinsics, &[])?;
        let plan = baselines::placing::run(context, &problem, &request, None)?;
        let named = |camera: Camera| Camera { name: format!("input_{}", camera.name), ..camera };
        Ok(plan.record.cameras.into_iter().map(named).collect())
    }

    /// Test cameras at places even in the empty space, in directions even on the sphere, whose picture shows the room.
    ///
    /// # Errors
    /// Where too few of the places drawn show it.
    pub fn tests(&self, intrinsics: Intrinsics, count: u32) -> Result<Vec<Camera>> {
        let back = self.geometry.to_internal.inverse();
        let drawn = layouts::random(self.geometry.open(), DRAWS * count as usize, TEST_SEED, false);
        let shown = drawn.iter().filter(|pose| self.seen(pose, &intrinsics) >= MIN_SEEN).take(count as usize);
        let cameras: Vec<Camera> =
            shown.enumerate().map(|(i, pose)| camera(format!("random_{i:04}"), back.pose(pose), intrinsics)).collect();
        if cameras.len() < count as usize {
            return Err(Error::input(
                &self.target.record.path,
                "nearly nothing is seen from where cameras may stand in it: give another --box, or, where it is no room, --preset object",
            ));
        }
        Ok(cameras)
    }

    /// Places from which all of the empty space is seen.
    pub fn eyes(&self) -> Vec<DVec3> {
        eyes(&self.geometry)
    }

    /// Cameras where a person could hold them: one inside an object, or nearer than the clearance, moves to the nearest empty
    /// position. Also how many moved.
    pub fn settled(&self, cameras: &[Camera]) -> (Vec<Camera>, usize) {
        let to_internal = &self.geometry.to_internal;
        let mut moved = 0;
        let settle = |camera: &Camera| {
            let place = to_internal.point(camera.pose.position);
            let settled = self.geometry.settle(place);
            // At the region's very edge a place is out by the rounding between two frames.
            if settled.distance(place) < 1e-9 {
                return camera.clone();
            }
            moved += 1;
            let pose = Pose { position: to_internal.inverse().point(settled), ..camera.pose };
            Camera { pose, ..camera.clone() }
        };
        (cameras.iter().map(settle).collect(), moved)
    }

    /// How far away from a camera in the region a surface of the room can be.
    pub fn farthest(&self) -> f64 {
        let (min, max) = self.target.region.bounds();
        let (low, high) = self.target.proxy.robust_bounds();
        (high - min).max(max - low).length()
    }

    /// Share of the scene's own surface, also of what no camera in the region sees, that has one of `positions` within the clearance.
    pub fn covered(&self, positions: &[DVec3]) -> f64 {
        let near = self.target.region.clearance;
        let points = self.target.proxy.sample(POINTS, TEST_SEED, 0);
        let is_told = |place: DVec3| positions.iter().any(|position| position.distance_squared(place) < near * near);
        points.iter().filter(|point| is_told(point.position)).count() as f64 / points.len().max(1) as f64
    }

    /// Share of a picture that shows the surface; the pose is in the planner's frame.
    fn seen(&self, pose: &Pose, intrinsics: &Intrinsics) -> f64 {
        let mut hits = 0;
        for i in 0..RAYS * RAYS {
            let cell = DVec2::new(f64::from(i % RAYS), f64::from(i / RAYS)) + 0.5;
            let size = DVec2::new(f64::from(intrinsics.width), f64::from(intrinsics.height));
            let pixel = cell / f64::from(RAYS) * size;
            let ray = (pixel - DVec2::from(intrinsics.principal)) / DVec2::from(intrinsics.focal);
            let direction = (pose.rotation * DVec3::new(ray.x, ray.y, 1.0)).normalize();
            let ray =
                Ray { origin: pose.position.as_vec3(), direction: direction.as_vec3(), t_min: 0.0, t_max: f32::MAX };
            hits += u32::from(self.geometry.bvh.closest_hit(&ray).is_some());
        }
        f64::from(hits) / f64::from(RAYS * RAYS)
    }
}

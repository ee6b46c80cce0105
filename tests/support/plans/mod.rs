//! What the tests of the planner share: a validated context, small scenes on the device, and planners over them.
#![allow(dead_code, reason = "each test binary uses a part")]

use std::sync::Arc;

use camsplat::engine::vulkan::Context;
use camsplat::planner::plan::config::Config;
use camsplat::planner::plan::planner::Planner;
use camsplat::planner::plan::preparation::Preparation;
use camsplat::planner::plan::problem::Problem;
use camsplat::planner::plan::record::SurfaceRecord;
use camsplat::planner::plan::target::Target;
use camsplat::scene::camera::{Camera, Intrinsics};
use camsplat::scene::limits::Limits;
use camsplat::scene::proxy::{Orientation, Proxy};
use camsplat::scene::region::{Region, Shape};
use camsplat::scene::samples;
use camsplat::scene::surface::Surface;
use camsplat::visibility::device_scene::{DeviceScene, SceneGeometry};
use glam::DVec3;

/// A surface with a region, and what the device holds of it.
pub struct Scene {
    pub target: Target,
    pub device: Arc<DeviceScene>,
}

impl Scene {
    /// What is to be planned there, beside cameras that are kept.
    pub fn problem<'s>(&'s self, kept: &'s [Camera]) -> Problem<'s> {
        Problem {
            target: &self.target,
            geometry: self.device.geometry.clone(),
            lens: intrinsics(),
            lenses: Vec::new(),
            viewers_lens: intrinsics(),
            kept,
        }
    }
}

/// The camera of all these plans.
pub fn intrinsics() -> Intrinsics {
    Intrinsics::from_fov(800, 600, 60f64.to_radians())
}

/// A surface and a region, on the device.
pub fn scene(context: &Arc<Context>, surface: &Surface, region: &Region) -> Scene {
    let proxy = Proxy::new(surface, Orientation::Trusted).expect("a good surface");
    let geometry = SceneGeometry::new(&proxy, region).expect("a good region");
    let target = Target { proxy, region: *region, limits: Limits::default(), record: SurfaceRecord::default() };
    Scene { device: Arc::new(DeviceScene::new(context, geometry).expect("room for it")), target }
}

/// The sample object, in a shell above a floor.
pub fn object(context: &Arc<Context>) -> Scene {
    let shape = Shape::Shell { centre: DVec3::ZERO, r_min: 1.2, r_max: 1.8 };
    let region = Region { shape, up: DVec3::Z, floor: Some(-0.3), clearance: 0.05 };
    scene(context, &samples::object(), &region)
}

/// The sample room, in a box a little smaller than it.
pub fn room(context: &Arc<Context>) -> Scene {
    let shape = Shape::Box { min: DVec3::splat(0.2), max: DVec3::new(5.8, 3.8, 2.6) };
    scene(context, &samples::room(), &Region { shape, up: DVec3::Z, floor: None, clearance: 0.15 })
}

/// A run over a scene, with no cameras kept.
pub fn preparation(context: &Context, scene: &Scene, config: Config) -> Preparation {
    Preparation::new(context, &scene.problem(&[]), config).expect("a good configuration")
}

/// The planner of such a run.
pub fn planner(context: &Arc<Context>, scene: &Scene, config: Config) -> Planner {
    Planner::new(context, &scene.device, preparation(context, scene, config)).expect("room for it")
}

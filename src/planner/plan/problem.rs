//! What is to be planned, whoever plans it.

use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use super::config::{Config, Preset};
use super::target::Target;
use crate::Result;
use crate::engine::vulkan::Context;
use crate::scene::camera::{Camera, Intrinsics, Pose, middle_lens};
use crate::scene::proxy::SurfacePoint;
use crate::visibility::device_scene::{DeviceScene, SceneGeometry};

/// Stream of the held-out points: none of them is a probe of the optimiser.
const HELD_OUT_STREAM: u32 = 1;

/// Cameras to be placed: for what, with which lens, beside which others.
#[derive(Clone)]
pub struct Problem<'p> {
    /// The surface, the region and its limits.
    pub target: &'p Target,
    /// These in the planner's frame.
    pub geometry: Arc<SceneGeometry>,
    /// Of all planned cameras that `lenses` does not name.
    pub lens: Intrinsics,
    /// Of the first planned cameras, where these have others. Baselines place cameras as if they all had `lens`.
    pub lenses: Vec<Intrinsics>,
    /// Of viewers that have none of their own.
    pub viewers_lens: Intrinsics,
    /// Cameras that exist already, in the user's world: they count, and never move.
    pub kept: &'p [Camera],
}

impl<'p> Problem<'p> {
    /// Brings a target into the planner's frame. Viewers have the lens in the middle of the kept cameras', whatever the next ones have.
    ///
    /// # Errors
    /// Where region and limits leave no free space, or the surface cannot be represented.
    pub fn new(target: &'p Target, lens: Intrinsics, kept: &'p [Camera]) -> Result<Self> {
        let viewers_lens = middle_lens(kept).unwrap_or(lens);
        Ok(Self { target, geometry: Arc::new(target.geometry()?), lens, lenses: Vec::new(), viewers_lens, kept })
    }

    /// The lens of planned camera `j`.
    pub fn lens_of(&self, j: usize) -> Intrinsics {
        self.lenses.get(j).copied().unwrap_or(self.lens)
    }

    /// The scene on a device.
    ///
    /// # Errors
    /// Where it does not fit the device.
    pub fn on(&self, context: &Arc<Context>) -> Result<DeviceScene> {
        DeviceScene::new(context, self.geometry.clone())
    }

    /// The points that plans are scored at: `config.held_out` of them, by the seed.
    ///
    /// # Errors
    /// Where no position fits the viewers.
    pub fn held_out(&self, config: &Config) -> Result<Vec<SurfacePoint>> {
        self.points(config.held_out as usize, config, HELD_OUT_STREAM)
    }

    /// `count` points of the surface by the seed, on the sides that viewers see.
    ///
    /// # Errors
    /// Where no position fits the viewers.
    pub(super) fn points(&self, count: usize, config: &Config, stream: u32) -> Result<Vec<SurfacePoint>> {
        let points = self.target.proxy.sample(count, config.seed, stream);
        config.viewers.facing(points, &self.geometry, self.viewers_lens, config.preset == Preset::Object)
    }

    /// Planned cameras at poses in the user's world, named "0000", "0001", ..., then the kept ones. No planned name is a kept one with
    /// another ending: new photos may be put beside the old, and be rendered to files of another format.
    pub fn cameras(&self, poses: &[Pose]) -> Vec<Camera> {
        let stem =
            |camera: &Camera| Path::new(&camera.name).file_stem().map(|stem| stem.to_string_lossy().to_lowercase());
        let stems: HashSet<String> = self.kept.iter().filter_map(stem).collect();
        let planned = poses.iter().enumerate().map(|(i, pose)| {
            let mut name = format!("{i:04}");
            while stems.contains(&name) {
                name = format!("planned_{name}");
            }
            Camera { name, pose: *pose, intrinsics: self.lens_of(i) }
        });
        planned.chain(self.kept.iter().cloned()).collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::planner::plan::config::Preset;
    use crate::planner::plan::target::RegionChoice;
    use crate::planner::quality::viewers::Viewers;
    use crate::scene::samples;

    /// If this failed, new photos would take the names of old ones: 0001.png beside 0001.jpg, which a rendering cannot keep apart.
    #[test]
    fn planned_cameras_have_names_that_no_kept_photo_has() {
        let pose = Pose::looking(DVec3::ZERO, DVec3::X, DVec3::Z);
        let lens = Intrinsics::from_fov(64, 48, 1.0);
        let kept = ["0001.jpg", "images/0002.JPEG", "planned_0001.png", "0003"];
        let kept = kept.map(|name| Camera { name: name.into(), pose, intrinsics: lens });
        let choice = RegionChoice::default();
        let target = Target::new(&samples::object(), "object", Preset::Object, &choice, DVec3::Z, &lens).unwrap();
        let problem = Problem::new(&target, lens, &kept).unwrap();
        let names: Vec<String> = problem.cameras(&[pose; 5]).into_iter().map(|camera| camera.name).collect();
        assert_eq!(names[..5], ["0000", "planned_planned_0001", "planned_0002", "planned_0003", "0004"]);
        assert_eq!(names[5..], kept.map(|camera| camera.name));
    }

    /// If this failed, half of a terrain that is looked at from above alone would be said to be unseen, whatever saw it.
    #[test]
    fn points_of_a_sheet_face_its_viewers() {
        let lens = Intrinsics::from_fov(64, 48, 1.0);
        let (sheet, choice) = (samples::plane(1.0, 8), RegionChoice::default());
        let target = Target::new(&sheet, "sheet", Preset::Object, &choice, DVec3::Z, &lens).unwrap();
        let problem = Problem::new(&target, lens, &[]).unwrap();
        for (low, high, normal) in [(0.1, 9.0, DVec3::Z), (-9.0, -0.1, DVec3::NEG_Z)] {
            let config = Config { viewers: Viewers::Heights { low, high }, ..Config::new(Preset::Object, 4) };
            let points = problem.held_out(&config).unwrap();
            assert!(points.iter().all(|point| point.normal == normal), "seen between heights of {low} and {high}");
        }
    }
}

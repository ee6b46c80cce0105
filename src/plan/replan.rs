//! A planner used again: other cameras to keep, other places to begin from, other viewers, without anything being made anew. Command
//! buffers that were recorded before stay valid.

use super::planner::{Planner, Way};
use super::preparation::splat;
use super::shared::Splat;
use crate::quality::look::Viewer;
use crate::scene::camera::{Camera, Pose};
use crate::vulkan::Buffer;
use crate::{Error, Result};

impl Planner {
    /// Keeps other cameras, as many as before or fewer, and puts everything else back to the start of the run. `kept` are in the
    /// user's world. Nothing of this planner may be running on the device.
    ///
    /// # Errors
    /// Where these are more cameras than the planner was made for, or the device fails.
    pub fn keep(&mut self, kept: &[Camera]) -> Result<()> {
        let most = self.most_kept();
        if kept.len() > most {
            return Err(Error::request(format!(
                "{} cameras are to be kept, and the planner was made for {most}; prepare it with as many as there will be",
                kept.len()
            )));
        }
        let planned = self.start.split_off(self.settings.kept as usize);
        self.start = kept.iter().map(|camera| splat(camera, &self.scene.geometry)).chain(planned).collect();
        self.settings.kept = kept.len() as u32;
        self.settings.splats = self.start.len() as u32;
        self.reset()
    }

    /// Begins from other poses, one a planned camera and in the user's world, such as those of an earlier plan.
    ///
    /// # Errors
    /// Where their number is not that of the planned cameras, or the device fails.
    pub fn begin_from(&mut self, poses: &[Pose]) -> Result<()> {
        let planned = &mut self.start[self.settings.kept as usize..];
        if poses.len() != planned.len() {
            let (given, wanted) = (poses.len(), planned.len());
            return Err(Error::request(format!(
                "{given} poses to begin from, and {wanted} cameras are planned; give one each"
            )));
        }
        for (splat, pose) in planned.iter_mut().zip(poses) {
            splat.place(&self.scene.geometry.to_internal.pose(pose));
        }
        self.reset()
    }

    /// Replaces the viewers, in the user's world, each used about equally often, and puts everything back to the start of the run.
    ///
    /// # Errors
    /// Where there are none, the objective has no viewers, or the device fails.
    pub fn look_from(&mut self, viewers: &[Camera]) -> Result<()> {
        let Way::Viewed(viewed) = &self.pipelines.splat else {
            return Err(Error::request("only `objective` quality has viewers"));
        };
        if viewers.is_empty() {
            return Err(Error::request("there are no viewers; give at least one"));
        }
        // Every iteration draws from a pool of this size.
        let pool = viewed.pool();
        let drawn = (0..pool)
            .map(|i| &viewers[if viewers.len() > pool { i * viewers.len() / pool } else { i % viewers.len() }]);
        let drawn: Vec<Viewer> = drawn.map(|viewer| Viewer::new(viewer, &self.scene.geometry)).collect();
        viewed.look_from(&drawn)?;
        self.reset()
    }

    /// The cameras as they are on the device, kept ones first: a [`Splat`] each, in the planner's frame (lengths in units of the
    /// region's radius, +Z up), which `DeviceScene::geometry.to_internal` maps to. For stages of a host's own, after the blocks that
    /// write it; [`Planner::settings`] has their number.
    pub fn device_cameras(&self) -> &Buffer {
        &self.buffers.splats
    }

    /// Capacity for kept cameras.
    fn most_kept(&self) -> usize {
        let room = self.buffers.splats.size() / size_of::<Splat>() as u64;
        room as usize - (self.settings.splats - self.settings.kept) as usize
    }
}

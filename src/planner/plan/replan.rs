//! A planner used again: other cameras to keep, other places to begin from, other viewers, without anything being made anew. Command
//! buffers that were recorded before stay valid after [`Planner::begin_from`] and [`Planner::look_from`]; after [`Planner::keep`] blocks are
//! to be recorded again, since their dispatches are sized by the number of cameras.

use super::expected_quality::QualityPass;
use super::planner::Planner;
use super::preparation::splat;
use super::shared::CameraState;
use crate::engine::vulkan::Buffer;
use crate::files::io::checks;
use crate::planner::quality::look::Viewer;
use crate::scene::camera::{Camera, Pose};
use crate::{Error, Result};

impl Planner {
    /// Keeps other cameras, as many as the planner was made for or fewer, and puts everything else back to the start of the run. `kept`
    /// are in the user's world. Nothing of this planner may be running on the device, and blocks that were recorded before must not be
    /// submitted again. Of the paper's objective, start scale, resolution and the implementation of the pass stay as they were chosen for the
    /// cameras of [`Planner::new`].
    ///
    /// # Errors
    /// Where these are more cameras than the planner was made for, a camera is unusable, or the device fails.
    pub fn keep(&mut self, kept: &[Camera]) -> Result<()> {
        let most = self.most_kept();
        if kept.len() > most {
            return Err(Error::request(format!(
                "{} cameras are to be kept, and the planner was made for {most}; prepare it with as many as there will be",
                kept.len()
            )));
        }
        usable("kept cameras", kept)?;
        let planned = self.start.split_off(self.run.settings.kept as usize);
        self.start = kept.iter().map(|camera| splat(camera, &self.run.scene.geometry)).chain(planned).collect();
        self.run.settings.kept = kept.len() as u32;
        self.run.settings.splats = self.start.len() as u32;
        self.reset()
    }

    /// Begins from other poses, one a planned camera and in the user's world, such as those of an earlier plan. Nothing of this planner may
    /// be running on the device.
    ///
    /// # Errors
    /// Where their number is not that of the planned cameras, a pose is not finite, or the device fails.
    pub fn begin_from(&mut self, poses: &[Pose]) -> Result<()> {
        let planned = &mut self.start[self.run.settings.kept as usize..];
        if poses.len() != planned.len() {
            let (given, wanted) = (poses.len(), planned.len());
            return Err(Error::request(format!(
                "{given} poses to begin from, and {wanted} cameras are planned; give one each"
            )));
        }
        if let Some(bad) = poses.iter().position(|pose| !(pose.position.is_finite() && pose.rotation.is_normalized())) {
            return Err(Error::request(format!("pose {bad} to begin from is not finite or no rotation; remove it")));
        }
        for (splat, pose) in planned.iter_mut().zip(poses) {
            splat.place(&self.run.scene.geometry.to_internal.pose(pose));
        }
        self.reset()
    }

    /// Replaces the viewers, in the user's world, each used about equally often, and puts everything back to the start of the run.
    /// Nothing of this planner may be running on the device.
    ///
    /// # Errors
    /// Where there are none, one is unusable, the objective has no viewers, or the device fails.
    pub fn look_from(&mut self, viewers: &[Camera]) -> Result<()> {
        let Some(viewed) = self.pass::<QualityPass>() else {
            return Err(Error::request("only expected quality has viewers"));
        };
        if viewers.is_empty() {
            return Err(Error::request("there are no viewers; give at least one"));
        }
        usable("viewers", viewers)?;
        // Every iteration draws from a pool of this size.
        let pool = viewed.pool();
        let drawn = (0..pool)
            .map(|i| &viewers[if viewers.len() > pool { i * viewers.len() / pool } else { i % viewers.len() }]);
        let drawn: Vec<Viewer> = drawn.map(|viewer| Viewer::new(viewer, &self.run.scene.geometry)).collect();
        viewed.look_from(&drawn)?;
        self.reset()
    }

    /// The cameras as they are on the device, kept ones first: a [`CameraState`] each, in the planner's frame (lengths in units of the
    /// region's radius, +Z up), which `DeviceScene::geometry.to_internal` maps to. For stages of a host's own, after the blocks that
    /// write it; [`Planner::settings`] has their number.
    pub fn device_cameras(&self) -> &Buffer {
        &self.run.buffers.splats
    }

    /// Capacity for kept cameras.
    fn most_kept(&self) -> usize {
        let capacity = self.run.buffers.splats.size() / size_of::<CameraState>() as u64;
        capacity as usize - (self.run.settings.splats - self.run.settings.kept) as usize
    }
}

/// Refuses cameras that no frame of the device can hold; their names may be the same.
fn usable(what: &str, cameras: &[Camera]) -> Result<()> {
    cameras.iter().try_for_each(|camera| checks::cameras(what.as_ref(), std::iter::once(camera)))
}

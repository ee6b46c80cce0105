//! The request for a training run, prepared and checked before anything is on the device.

use std::path::PathBuf;
use std::sync::Arc;

use sysinfo::System;

use super::evaluate::{Pair, few};
use super::record::{Evaluation, TrainRecord};
use crate::engine::vulkan::Context;
use crate::engine::vulkan::footprint::Footprint;
use crate::files::photos::Photo;
use crate::scene::gaussians::Gaussians;
use crate::splats::config::TrainConfig;
use crate::splats::data::pictures;
use crate::splats::data::split::Split;
use crate::splats::render::frame::{Frame, View};
use crate::splats::render::rasterizer::MAX_SIDE;
use crate::splats::train::memory;
use crate::{Error, Result};

/// Entries of the footprint that cover several buffers.
const SEVERAL: [&str; 4] = ["sort", "scan", "photos", "test poses"];

/// The request.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainRequest {
    /// Path of the capture as the user gave it.
    pub capture: String,
    /// The capture, split into training and test photos.
    pub split: Split,
    /// How to train.
    pub config: TrainConfig,
    /// Each pixel is a square of so many stored pixels.
    pub shrink: u32,
    /// The folder of the run; made when training begins.
    pub folder: PathBuf,
    /// Iterations between checkpoints; none but the last where zero.
    pub save_every: u32,
    /// Iterations between evaluations; none but the last where zero.
    pub evaluate_every: u32,
}

/// Progress events.
pub enum TrainEvent<'a> {
    /// So many photos of so many have been decoded.
    Photos(usize, usize),
    /// So many iterations are done.
    Iterations(u32),
    /// The poses of so many test views of so many have been corrected.
    Tests(usize, usize),
    /// The test views have been evaluated.
    Evaluated(&'a Evaluation),
    /// Something could not be written; the run continues with the previous file.
    NotSaved(&'a Error),
    /// What is to be known of a file that is written.
    Note(&'a str),
    /// The run has ended with these Gaussians, in the capture's frame.
    Trained(&'a Gaussians),
    /// The record has changed, and with it the pictures of the worst test views (worst first).
    Report(&'a TrainRecord, &'a [(String, Pair)]),
}

/// A run that is prepared: nothing is on the device yet.
pub struct Run {
    pub(super) context: Arc<Context>,
    pub(super) request: TrainRequest,
    pub(super) frame: Frame,
    pub(super) views: Vec<View>,
    pub(super) footprint: Footprint,
}

impl Run {
    /// Prepares a run.
    ///
    /// # Errors
    /// Where the configuration makes no sense.
    pub fn new(context: &Arc<Context>, request: TrainRequest) -> Result<Self> {
        request.config.validate()?;
        let sides = request.split.train.photos.iter().chain(&request.split.test).map(|photo| photo.camera.intrinsics);
        if let Some(k) = sides.into_iter().find(|k| k.width.max(k.height) / request.shrink > MAX_SIDE) {
            let what = format!("photos of {} x {} pixels are too large; train with `shrink`", k.width, k.height);
            return Err(Error::input(&request.capture, what));
        }
        let Split { train, test, .. } = &request.split;
        let cameras = pictures::cameras(&train.photos, request.shrink);
        let frame = Frame::new(&cameras, &train.points.positions);
        let mut views: Vec<View> = cameras.iter().map(|camera| frame.view(camera)).collect();
        views.extend(pictures::cameras(test, request.shrink).iter().map(|camera| frame.view(camera)));
        let sizes = memory::sizes(&request.config, &views, memory::first_capacity(request.config.max_splats));
        let mut buffers = memory::footprint(context, &request.config, &sizes, views.len());
        buffers.push(("photos", pictures::picture_bytes(&train.photos, request.shrink)));
        let footprint = Footprint { buffers, several: SEVERAL.to_vec() };
        Ok(Self { context: context.clone(), request, frame, views, footprint })
    }

    /// Device memory that the run takes. Photos that do not fit stay on the host.
    pub fn footprint(&self) -> &Footprint {
        &self.footprint
    }

    /// Instances (pairs of a splat and a tile) in the initial capacity.
    pub fn capacity(&self) -> u32 {
        memory::first_capacity(self.request.config.max_splats)
    }

    /// Bytes of the device's own memory that photos may take: half of what the run itself leaves of it.
    pub(super) fn photos_on_device(&self) -> Result<u64> {
        let announced = self.footprint.total() - self.footprint.bytes_of("photos")?;
        Ok(self.context.memory_available().saturating_sub(announced) / 2)
    }

    /// Checks the footprint against the device, and photos against device and host.
    ///
    /// # Errors
    /// Where they do not fit.
    pub fn check(&self) -> Result<()> {
        let without_photos = self.footprint.buffers.iter().filter(|buffer| buffer.0 != "photos").copied().collect();
        let footprint = Footprint { buffers: without_photos, several: SEVERAL.to_vec() };
        footprint.check(
            &self.context,
            "the training",
            |_| "train with fewer splats (`max_splats`) or smaller photos (`shrink`)",
        )?;
        let Split { train, test, .. } = &self.request.split;
        let few: Vec<Photo> = few(test).cloned().collect();
        let [train, test] = [&train.photos, &few].map(|photos| pictures::picture_bytes(photos, self.request.shrink));
        // The memory of a CPU device is that of the host.
        let on_device = if self.context.physical().is_cpu() { 0 } else { self.photos_on_device()? };
        check_host(train.saturating_sub(on_device) + test, host_memory(), self.request.shrink)
    }
}

/// Bytes of the host's memory that can still be taken, by this process's limits too; none where the system does not say.
fn host_memory() -> Option<u64> {
    let mut system = System::new();
    system.refresh_memory();
    // Of what is taken below the limit, cached files give way.
    let limit = system.cgroup_limits().map_or(u64::MAX, |limits| limits.total_memory.saturating_sub(limits.rss));
    Some(system.available_memory().min(limit)).filter(|bytes| *bytes > 0)
}

/// Refuses photos that would take `wanted` bytes of the host's memory where fewer are available.
fn check_host(wanted: u64, available: Option<u64>, shrink: u32) -> Result<()> {
    let Some(available) = available.filter(|available| wanted > *available) else {
        return Ok(());
    };
    // Pixels are as many as the square of the divisor says.
    let enough = ((wanted as f64 / available as f64).sqrt() * f64::from(shrink.max(1))).ceil();
    Err(Error::request(format!(
        "photos: those that the device has no room for take {wanted} bytes of the host's memory, and {available} are \
         available; train on fewer, or on smaller ones (`shrink` {enough})"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 10,000 photos of 12 megapixels take 480 GB. If they were not refused, decoding them would end with the process killed, hours later.
    #[test]
    fn photos_that_the_host_cannot_hold_are_refused_with_what_would_do() {
        let photos = |shrink: u64| 10_000 * 4 * (4000 / shrink) * (3000 / shrink);
        let free = 64 << 30;
        let refused = check_host(photos(1), Some(free), 1).unwrap_err().to_string();
        assert!(refused.contains("480000000000") && refused.contains("`shrink` 3"), "{refused}");
        assert!(check_host(photos(2), Some(free), 2).unwrap_err().to_string().contains("`shrink` 3"));
        check_host(photos(3), Some(free), 3).expect("a third of the pixels along a side fits");
        check_host(photos(1), None, 1).expect("nothing is known of the host");
    }

    /// A machine that says it has no memory, or all that there is, would refuse every run, or none.
    #[test]
    fn the_host_says_how_much_memory_it_has() {
        let bytes = host_memory().expect("tests run on systems that say so");
        assert!((1 << 20..1 << 50).contains(&bytes), "{bytes}");
    }
}

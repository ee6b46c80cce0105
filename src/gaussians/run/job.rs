//! The request for a training run, prepared and checked before anything is on the device.

use std::path::PathBuf;
use std::sync::Arc;

use super::evaluate::Pair;
use super::record::{Evaluation, TrainRecord};
use crate::gaussians::config::Config;
use crate::gaussians::data::pictures;
use crate::gaussians::data::split::Split;
use crate::gaussians::render::frame::{Frame, View};
use crate::gaussians::render::rasterizer::MAX_SIDE;
use crate::gaussians::train::memory;
use crate::scene::gaussians::Gaussians;
use crate::vulkan::Context;
use crate::vulkan::footprint::Footprint;
use crate::{Error, Result};

/// Entries of the footprint that cover several buffers.
const SEVERAL: [&str; 3] = ["sort", "scan", "photos"];

/// The request.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Path of the capture as the user gave it.
    pub capture: String,
    /// The capture, split into training and test photos.
    pub split: Split,
    /// Configuration.
    pub config: Config,
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
pub enum Event<'a> {
    /// So many photos of so many have been decoded.
    Photos(usize, usize),
    /// So many iterations are done.
    Iterations(u32),
    /// The test views have been evaluated.
    Evaluated(&'a Evaluation),
    /// Something could not be written; the run continues with the previous file.
    NotSaved(&'a Error),
    /// The run has ended with these Gaussians, in the capture's frame.
    Trained(&'a Gaussians),
    /// The record has changed, and with it the pictures of the worst test views (worst first).
    Report(&'a TrainRecord, &'a [(String, Pair)]),
}

/// A run that is prepared: nothing is on the device yet.
pub struct Run {
    pub(super) context: Arc<Context>,
    pub(super) request: Request,
    pub(super) frame: Frame,
    pub(super) views: Vec<View>,
    pub(super) footprint: Footprint,
}

impl Run {
    /// Prepares a run.
    ///
    /// # Errors
    /// Where the configuration makes no sense.
    pub fn new(context: &Arc<Context>, request: Request) -> Result<Self> {
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
        let sizes = memory::sizes(&request.config, &views, memory::first_room(request.config.max_splats));
        let mut buffers = memory::footprint(context, &request.config, &sizes, views.len());
        buffers.push(("photos", pictures::picture_bytes(&train.photos, request.shrink)));
        let footprint = Footprint { buffers, several: &SEVERAL };
        Ok(Self { context: context.clone(), request, frame, views, footprint })
    }

    /// Device memory that the run takes. Photos that do not fit stay on the host.
    pub fn footprint(&self) -> &Footprint {
        &self.footprint
    }

    /// Instances (pairs of a splat and a tile) in the initial capacity.
    pub fn room(&self) -> u32 {
        memory::first_room(self.request.config.max_splats)
    }

    /// Checks the footprint against the device.
    ///
    /// # Errors
    /// Where it does not fit.
    pub fn check(&self) -> Result<()> {
        let without_photos = self.footprint.buffers.iter().filter(|buffer| buffer.0 != "photos").copied().collect();
        let footprint = Footprint { buffers: without_photos, several: &SEVERAL };
        footprint.check(
            &self.context,
            "the training",
            |_| "train with fewer splats (`max_splats`) or smaller photos (`shrink`)",
        )
    }
}

//! The loss of a picture against a photo and its gradient by the pixels: 0.8 L1 + 0.2 (1 - SSIM) (`photo_ssim.comp`,
//! `photo_gradient.comp`, `train_tally.comp`).

use std::sync::Arc;

use crate::Result;
use crate::engine::vulkan::shaders::glsl::splats::photo;
use crate::engine::vulkan::stage::GroupConstants;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder, footprint};
use crate::splats::render::frame::View;
use crate::splats::render::layout::PassPush;
use crate::splats::render::rasterizer::{Size, Sizes};
use crate::splats::render::wanted::Threads;

crate::stage!(
    /// L1 and SSIM, and the derivatives of SSIM by the windowed means.
    pub(crate) PhotoSsimStage = photo_ssim<GroupConstants>(PassPush) { read views, read picture, read photo, write slopes, write tile_losses }
    with [View]
);
crate::stage!(
    /// The gradient by each pixel.
    pub(crate) PhotoGradientStage = photo_gradient<GroupConstants>(PassPush) { read views, read picture, read photo, read slopes, write by_pixel }
    with [View]
);
crate::stage!(
    /// Sums over tiles; whether the iteration counts.
    pub(crate) TrainTallyStage = train_tally(PassPush) {
        read views, read counts, read tile_losses, write control, write history, write mailbox, read population,
    } with [View, Record]
);

crate::gpu_struct! {
    /// Loss terms of an iteration: means over pixels and channels.
    pub struct Record {
        /// Mean |x - y|.
        pub l1: f32,
        /// Mean SSIM.
        pub ssim: f32,
        /// Mean (x - y)^2.
        pub squared: f32,
        /// Pairs of a Gaussian and a tile in the iteration.
        pub instances: u32,
        /// Gaussians, with what adaptive density control keeps of free slots.
        pub splats: u32,
    }
}

impl Record {
    /// The loss, without the regularisers of parameters.
    pub fn loss(&self) -> f64 {
        L1_SHARE * f64::from(self.l1) + (1.0 - L1_SHARE) * (1.0 - f64::from(self.ssim))
    }

    /// PSNR in decibels of the picture as it is, without rounding.
    pub fn psnr(&self) -> f64 {
        -10.0 * f64::from(self.squared).log10()
    }
}

/// Share of L1 in the loss; the rest is 1 - SSIM.
pub(crate) const L1_SHARE: f64 = photo::L1_SHARE;

/// Pipelines and buffers.
pub struct Loss {
    ssim: Pipeline,
    gradient: Pipeline,
    tally: Pipeline,
    slopes: Buffer,
    tile_losses: Buffer,
    /// The photo: a word per pixel.
    pub photo: Buffer,
    /// Gradient of the loss by each pixel, a vec4 each.
    pub by_pixel: Buffer,
}

/// Where the sums go.
pub struct Ledger {
    /// Not zero once a run is halted.
    pub control: Buffer,
    /// A [`Record`] per iteration, in host memory.
    pub history: Buffer,
    /// In host memory: iterations done; instances that an iteration lacked capacity for; whether a loss was NaN.
    pub mailbox: Buffer,
}

impl Ledger {
    /// Of a run of so many iterations; nothing is done yet. What is on the device alone holds anything.
    ///
    /// # Errors
    /// Where there is too little memory.
    pub fn new(context: &Arc<Context>, iterations: u32) -> Result<Self> {
        let mailbox = Buffer::host(context, "mailbox", 16)?;
        mailbox.write(&[0u32; 4])?;
        Ok(Self {
            control: Buffer::device(context, "control", 4)?,
            history: Buffer::host(context, "history", size_of::<Record>() as u64 * u64::from(iterations))?,
            mailbox,
        })
    }
}

/// Words of [`Ledger::mailbox`].
pub mod mailbox {
    /// Iterations done.
    pub const DONE: usize = 0;
    /// Instances that an iteration needed where capacity was lower.
    pub const NEEDED: usize = 1;
    /// A loss that is no number.
    pub const BROKEN: usize = 2;
}

/// Buffers by name and bytes.
pub fn buffers(sizes: &Sizes) -> Vec<(&'static str, u64)> {
    let [pixels, tiles] = [sizes.pixels, sizes.tiles].map(u64::from);
    vec![("photo", 4 * pixels), ("slopes", 36 * pixels), ("tile_losses", 16 * tiles), ("by_pixel", 16 * pixels)]
}

impl Loss {
    /// Allocates for pictures of these sizes.
    ///
    /// # Errors
    /// Where the device has too little memory, or fails.
    pub fn new(context: &Arc<Context>, sizes: &Sizes, threads: Threads) -> Result<Self> {
        let plan = buffers(sizes);
        let buffer = |name: &str| footprint::buffer(context, &plan, name);
        let constants = GroupConstants { local_size_x: threads.loss };
        Ok(Self {
            ssim: Pipeline::new::<PhotoSsimStage>(context, &constants)?,
            gradient: Pipeline::new::<PhotoGradientStage>(context, &constants)?,
            tally: Pipeline::new::<TrainTallyStage>(context, &())?,
            slopes: buffer("slopes")?,
            tile_losses: buffer("tile_losses")?,
            photo: buffer("photo")?,
            by_pixel: buffer("by_pixel")?,
        })
    }

    /// Records loss and gradient of `picture` against [`Loss::photo`], and the entry into the ledger.
    pub fn record<'a>(
        &'a self,
        commands: &mut Recorder,
        [views, picture, counts, population]: [&'a Buffer; 4],
        ledger: &'a Ledger,
        size: Size,
        push: &PassPush,
    ) {
        commands
            .stage(
                &self.ssim,
                PhotoSsimStage {
                    views,
                    picture,
                    photo: &self.photo,
                    slopes: &self.slopes,
                    tile_losses: &self.tile_losses,
                },
            )
            .push(push)
            .linear(size.tiles());
        commands
            .stage(
                &self.tally,
                TrainTallyStage {
                    views,
                    counts,
                    tile_losses: &self.tile_losses,
                    control: &ledger.control,
                    history: &ledger.history,
                    mailbox: &ledger.mailbox,
                    population,
                },
            )
            .push(push)
            .groups([1, 1, 1]);
        commands
            .stage(
                &self.gradient,
                PhotoGradientStage {
                    views,
                    picture,
                    photo: &self.photo,
                    slopes: &self.slopes,
                    by_pixel: &self.by_pixel,
                },
            )
            .push(push)
            .linear(size.tiles());
    }
}

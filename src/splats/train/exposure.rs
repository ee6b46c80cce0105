//! Exposures of the photos that are trained on, learnt with the splats (`exposure_apply.comp`, `exposure_gradient.comp`,
//! `exposure_update.comp`).

use std::sync::Arc;

use crate::Result;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::splats::exposure::Exposure;
use crate::splats::render::frame::View;
use crate::splats::render::layout::PassPush;
use crate::splats::render::rasterizer::{Size, Sizes};

/// Pixels that a workgroup of the first two stages has.
const GROUP: u32 = 256;
/// Numbers of an exposure that are learnt.
const LEARNT: usize = 12;
/// Adam's rate at the start and at the end, as in the published code of 3D Gaussian splatting.
const RATES: [f64; 2] = [1e-2, 1e-3];
/// Weight of no change: what splats can show should not be taken for exposure.
pub const PULL: f32 = 0.01;

crate::gpu_struct! {
    /// The exposure of a view, and what its step needs.
    pub struct ExposureState {
        /// Matrix without the unit matrix and offset, row by row.
        pub value: [f32; LEARNT],
        /// Running means of gradients.
        pub first: [f32; LEARNT],
        /// Running means of their squares.
        pub second: [f32; LEARNT],
        /// Steps so far.
        pub steps: f32,
        /// Unused.
        pub spare0: f32,
        /// Unused.
        pub spare1: f32,
        /// Unused.
        pub spare2: f32,
    }
}

crate::gpu_struct! {
    /// Push constants of [`ExposureUpdateStage`].
    pub struct ExposurePush {
        /// The view's index.
        pub view: u32,
        /// Exposures that the mean is taken of: the first so many.
        pub photos: u32,
        /// Adam's rate.
        pub rate: f32,
        /// Weight of the squares of matrix - 1 and offset in the loss, halved.
        pub pull: f32,
    }
}

crate::stage!(
    /// The picture as the photo's exposure shows it.
    pub(crate) ExposureApplyStage = exposure_apply(PassPush) { read views, read exposures, write picture }
    with [View, ExposureState]
);
crate::stage!(
    /// Gradients by what splats show and by the exposure.
    pub(crate) ExposureGradientStage = exposure_gradient(PassPush) {
        read views, read exposures, write picture, write by_pixel, write exposure_sums,
    } with [View, ExposureState]
);
crate::stage!(
    /// Adam's step of an exposure, and the mean of all taken from each.
    pub(crate) ExposureUpdateStage = exposure_update(ExposurePush) { read views, read control, read exposure_sums, write exposures }
    with [View, ExposureState]
);

/// Pipelines and buffers.
pub struct Exposures {
    apply: Pipeline,
    gradient: Pipeline,
    update: Pipeline,
    states: Buffer,
    sums: Buffer,
    photos: u32,
    iterations: u32,
}

/// Buffers by name and bytes.
pub fn buffers(sizes: &Sizes, views: usize) -> Vec<(&'static str, u64)> {
    let groups = u64::from(sizes.pixels.div_ceil(GROUP));
    vec![("exposures", (size_of::<ExposureState>() * views) as u64), ("exposure_sums", 48 * groups)]
}

impl Exposures {
    /// For so many views, of which the first `photos` are trained on in `iterations`; none changes anything yet.
    ///
    /// # Errors
    /// Where the device has too little memory, or fails.
    pub fn new(context: &Arc<Context>, sizes: &Sizes, views: usize, photos: u32, iterations: u32) -> Result<Self> {
        let plan = buffers(sizes, views);
        let states = Buffer::from_slice(context, "exposures", &vec![ExposureState::default(); views.max(1)])?;
        Ok(Self {
            apply: Pipeline::new::<ExposureApplyStage>(context, &())?,
            gradient: Pipeline::new::<ExposureGradientStage>(context, &())?,
            update: Pipeline::new::<ExposureUpdateStage>(context, &())?,
            states,
            sums: Buffer::device(context, "exposure_sums", plan[1].1)?,
            photos,
            iterations,
        })
    }

    /// Records what a photo's exposure makes of the picture.
    pub fn record_apply<'a>(
        &'a self,
        commands: &mut Recorder,
        [views, picture]: [&'a Buffer; 2],
        size: Size,
        push: &PassPush,
    ) {
        commands
            .stage(&self.apply, ExposureApplyStage { views, exposures: &self.states, picture })
            .push(push)
            .linear(size.pixels().div_ceil(GROUP));
    }

    /// Records the gradients behind the exposure, and its step. The picture is one for the backward pass from here on.
    pub fn record_step<'a>(
        &'a self,
        commands: &mut Recorder,
        [views, picture, by_pixel, control]: [&'a Buffer; 4],
        size: Size,
        push: &PassPush,
    ) {
        commands
            .stage(
                &self.gradient,
                ExposureGradientStage { views, exposures: &self.states, picture, by_pixel, exposure_sums: &self.sums },
            )
            .push(push)
            .linear(size.pixels().div_ceil(GROUP));
        let progress = f64::from(push.iteration) / f64::from(self.iterations.max(1));
        let rate = (RATES[0] * (RATES[1] / RATES[0]).powf(progress)) as f32;
        commands
            .stage(
                &self.update,
                ExposureUpdateStage { views, control, exposure_sums: &self.sums, exposures: &self.states },
            )
            .push(&ExposurePush { view: push.view, photos: self.photos, rate, pull: PULL })
            .groups([1, 1, 1]);
    }

    /// What the next iteration needs, of the photos.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn states(&self) -> Result<Vec<ExposureState>> {
        self.states.download(self.photos as usize)
    }

    /// Takes up what [`Exposures::states`] gave.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn restore(&self, states: &[ExposureState]) -> Result<()> {
        self.states.upload(states)
    }

    /// Exposures of the photos.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn learnt(&self) -> Result<Vec<Exposure>> {
        Ok(self.states()?.iter().map(|state| Exposure::from_device(&state.value)).collect())
    }
}

//! Corrections of the poses that photos are trained from, learnt with the splats (`pose_sum.comp`, `pose_update.comp`, `pose_apply.comp`).

use std::sync::Arc;

use crate::Result;
use crate::engine::vulkan::shaders::glsl::splats::pose as glsl;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder, footprint};
use crate::splats::pose::PoseCorrection;
use crate::splats::render::frame::View;
use crate::splats::render::rasterizer::{Model, Sizes};

/// Numbers of a correction.
pub(super) const LEARNT: usize = glsl::LEARNT as usize;
/// Adam's rate at the start and at the end of a run or of a search for one pose, in radians and extents of the cameras.
const RATES: [f64; 2] = [1e-3, 1e-4];

crate::gpu_struct! {
    /// The correction of a view's pose, and what its step needs.
    pub struct PoseState {
        /// Turn and shift, see [`PoseCorrection`].
        pub value: [f32; LEARNT],
        /// Running means of gradients.
        pub first: [f32; LEARNT],
        /// Running means of their squares.
        pub second: [f32; LEARNT],
        /// Steps so far.
        pub steps: f32,
        /// Unused.
        pub spare0: f32,
    }
}

crate::gpu_struct! {
    /// Push constants of [`PoseSumStage`].
    pub(crate) struct PoseSumPush {
        /// From one plane of forces to the next.
        pub stride: u32,
    }
}

crate::gpu_struct! {
    /// Push constants of [`PoseUpdateStage`].
    pub(crate) struct PosePush {
        /// The view's index.
        pub view: u32,
        /// Corrections that the mean is taken of: the first so many.
        pub photos: u32,
        /// Adam's rate.
        pub rate: f32,
    }
}

crate::gpu_struct! {
    /// Push constants of [`PoseApplyStage`].
    pub(crate) struct PoseApplyPush {
        /// Views.
        pub count: u32,
    }
}

crate::stage!(
    /// Sums over Gaussians of what turning and moving the world change.
    pub(crate) PoseSumStage = pose_sum(PoseSumPush) { read population, read forces, write pose_sums }
);
crate::stage!(
    /// Adam's step of a correction, and the mean of all taken from each.
    pub(crate) PoseUpdateStage = pose_update(PosePush) { read population, read control, read pose_sums, write poses }
    with [PoseState]
);
crate::stage!(
    /// The views with their corrections.
    pub(crate) PoseApplyStage = pose_apply(PoseApplyPush) { read given, read poses, write views }
    with [View, PoseState]
);

/// Pipelines and buffers.
pub struct Poses {
    sum: Pipeline,
    update: Pipeline,
    apply: Pipeline,
    /// The views without corrections.
    given: Buffer,
    states: Buffer,
    sums: Buffer,
    views: u32,
    photos: u32,
}

/// Buffers by name and bytes.
pub fn buffers(sizes: &Sizes, views: usize) -> Vec<(&'static str, u64)> {
    vec![
        ("given", (size_of::<View>() * views) as u64),
        ("poses", (size_of::<PoseState>() * views) as u64),
        ("pose_sums", 4 * LEARNT as u64 * u64::from(sizes.gaussians.div_ceil(glsl::PER_GROUP))),
    ]
}

impl Poses {
    /// For views as they are given, of which the first `photos` are trained on; none is corrected yet.
    ///
    /// # Errors
    /// Where the device has too little memory, or fails.
    pub fn new(context: &Arc<Context>, sizes: &Sizes, views: &[View], photos: u32) -> Result<Self> {
        let plan = buffers(sizes, views.len());
        Ok(Self {
            sum: Pipeline::new::<PoseSumStage>(context, &())?,
            update: Pipeline::new::<PoseUpdateStage>(context, &())?,
            apply: Pipeline::new::<PoseApplyStage>(context, &())?,
            given: Buffer::from_slice(context, "given", views)?,
            states: Buffer::from_slice(context, "poses", &vec![PoseState::default(); views.len()])?,
            sums: footprint::buffer(context, &plan, "pose_sums")?,
            views: views.len() as u32,
            photos,
        })
    }

    /// Begins with other views, as many, none of which is corrected yet.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn begin(&self, views: &[View]) -> Result<()> {
        self.given.upload(views)?;
        self.states.upload(&vec![PoseState::default(); views.len()])
    }

    /// Adam's rate after a share of a run.
    pub fn rate(progress: f64) -> f32 {
        (RATES[0] * (RATES[1] / RATES[0]).powf(progress)) as f32
    }

    /// How far each number of a pose moves at most in so many steps spread over a run, or about so: the sum of their rates.
    pub fn reach(steps: u32) -> f64 {
        f64::from(steps) * (RATES[0] - RATES[1]) / (RATES[0] / RATES[1]).ln()
    }

    /// Records the step of a view's correction, at a rate, after [`super::update::Update::record`] in an iteration, and the views as they are
    /// then.
    pub fn record_step<'a>(
        &'a self,
        commands: &mut Recorder,
        model: &'a Model,
        [views, control, forces]: [&'a Buffer; 3],
        (view, rate): (u32, f32),
    ) {
        let population = &model.population;
        commands
            .stage(&self.sum, PoseSumStage { population, forces, pose_sums: &self.sums })
            .push(&PoseSumPush { stride: model.stride })
            .linear(model.stride.div_ceil(glsl::PER_GROUP));
        commands
            .stage(&self.update, PoseUpdateStage { population, control, pose_sums: &self.sums, poses: &self.states })
            .push(&PosePush { view, photos: self.photos, rate })
            .groups([1, 1, 1]);
        self.record_apply(commands, views);
    }

    /// Records the views with their corrections.
    pub fn record_apply<'a>(&'a self, commands: &mut Recorder, views: &'a Buffer) {
        commands
            .stage(&self.apply, PoseApplyStage { given: &self.given, poses: &self.states, views })
            .push(&PoseApplyPush { count: self.views })
            .linear(self.views.div_ceil(64));
    }

    /// What the next iteration needs, of the photos.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn states(&self) -> Result<Vec<PoseState>> {
        self.states.download(self.photos as usize)
    }

    /// Takes up what [`Poses::states`] gave, and corrects the views so.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn restore(&self, context: &Arc<Context>, states: &[PoseState], views: &Buffer) -> Result<()> {
        self.states.upload(states)?;
        let mut commands = Recorder::new(context)?;
        self.record_apply(&mut commands, views);
        commands.submit_and_wait().map(drop)
    }

    /// Corrections of the photos.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn learnt(&self) -> Result<Vec<PoseCorrection>> {
        Ok(self.states()?.iter().map(|state| PoseCorrection::from_device(&state.value)).collect())
    }
}

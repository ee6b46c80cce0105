//! From the sums of all instances to the parameters: projection backward, Adam and exploration noise in one stage
//! (`splat_update.comp`).

use std::sync::Arc;

use crate::Result;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::splats::config::{HARMONICS_EVERY, Schedule, Strategy, TrainConfig};
use crate::splats::render::frame::View;
use crate::splats::render::layout::{PassPush, Projected};
use crate::splats::render::rasterizer::{Model, Rasterizer};
use crate::splats::render::wanted::Wanted;

crate::gpu_struct! {
    /// Push constants of [`SplatUpdateStage`].
    pub struct UpdatePush {
        /// From one plane of parameters to the next.
        pub stride: u32,
        /// The view's index.
        pub view: u32,
        /// Degree of the harmonics that take a step; others do not show in the gradient of the centre either.
        pub degree: u32,
        /// Iteration, from zero.
        pub iteration: u32,
        /// Seed, low half first.
        pub seed: [u32; 2],
        /// Adam's rate for centres.
        pub centre_rate: f32,
        /// For logarithms of standard deviations.
        pub scale_rate: f32,
        /// For quaternions.
        pub rotation_rate: f32,
        /// For logits of opacities.
        pub opacity_rate: f32,
        /// For the constant harmonic.
        pub colour_rate: f32,
        /// For the other harmonics.
        pub harmonics_rate: f32,
        /// `1 / (1 - 0.9^t)`, t from one.
        pub first_correction: f32,
        /// `1 / (1 - 0.999^t)`.
        pub second_correction: f32,
        /// Weight of the mean opacity in the loss.
        pub opacity_weight: f32,
        /// Weight of the mean standard deviation in the loss.
        pub scale_weight: f32,
        /// Factor of the exploration noise; none where zero.
        pub noise: f32,
    }
}

impl UpdatePush {
    /// Adam's step in the iteration of `pass`.
    pub fn new(config: &TrainConfig, schedule: &Schedule, pass: &PassPush) -> Self {
        let iteration = pass.iteration;
        let t = f64::from(iteration + 1);
        let progress = f64::from(iteration) / f64::from(config.iterations);
        // From 1.6e-4 of the extent to a hundredth of it.
        let centre_rate = 1.6e-4 * 0.01f64.powf(progress);
        let (weight, noise) = match config.strategy {
            Strategy::Mcmc => (schedule.regularisation(iteration, config.suppress_floaters), 5e5 * centre_rate),
            Strategy::Adc => (0.0, 0.0),
        };
        let rate = |at_first: f64| (at_first * schedule.settling(iteration)) as f32;
        Self {
            stride: pass.stride,
            view: pass.view,
            degree: if iteration.is_multiple_of(HARMONICS_EVERY) { pass.degree } else { 0 },
            iteration,
            seed: [config.seed as u32, (config.seed >> 32) as u32],
            centre_rate: centre_rate as f32,
            scale_rate: rate(5e-3),
            rotation_rate: rate(1e-3),
            opacity_rate: rate(5e-2),
            colour_rate: rate(2.5e-3),
            harmonics_rate: rate(1.25e-4 * f64::from(HARMONICS_EVERY)),
            first_correction: (1.0 / (1.0 - 0.9f64.powf(t))) as f32,
            second_correction: (1.0 / (1.0 - 0.999f64.powf(t))) as f32,
            opacity_weight: weight as f32,
            scale_weight: weight as f32,
            noise: noise as f32,
        }
    }
}

crate::specialisation! {
    /// Constants of [`SplatUpdateStage`].
    pub(crate) struct UpdateConstants {
        /// Whether the low-pass filter is compensated for.
        antialiased: bool,
        /// Whether the statistics for densification are gathered.
        statistics: bool,
        /// Whether partials are summed by Gaussian already (`--fast`).
        summed: bool,
        /// Whether the gradient by the camera's pose is wanted.
        poses: bool,
        /// Whether Gaussians stay as they are.
        frozen: bool,
    }
}

crate::stage!(
    /// Gradients by parameters, Adam, noise.
    pub(crate) SplatUpdateStage = splat_update<UpdateConstants>(UpdatePush) {
        read views, read population, read control, read projected, read runs, read partials, write parameters,
        write first, write second, write statistics, write forces,
    } with [View, Projected]
);

/// Adam's memory, and what densification is decided by and poses are corrected by.
pub struct Moments {
    /// Running means of gradients, in planes as the parameters are.
    pub first: Buffer,
    /// Running means of their squares.
    pub second: Buffer,
    /// Sum of lengths of gradients by the mean and number of views, two floats a Gaussian, where they are requested.
    pub statistics: Buffer,
    /// What turning each Gaussian about the camera and moving it change in the loss, in planes, where poses are learnt.
    pub forces: Buffer,
}

impl Moments {
    /// With `bytes` for the planes, `statistics` and `forces` for these; they hold anything.
    ///
    /// # Errors
    /// Where the device has too little memory.
    pub fn new(context: &Arc<Context>, bytes: u64, statistics: u64, forces: u64) -> Result<Self> {
        let buffer = |name, bytes| Buffer::device(context, name, bytes);
        Ok(Self {
            first: buffer("first", bytes)?,
            second: buffer("second", bytes)?,
            statistics: buffer("statistics", statistics)?,
            forces: buffer("forces", forces)?,
        })
    }
}

/// All that a refinement changes, unless the run is halted.
#[derive(Clone, Copy)]
pub struct Trained<'a> {
    /// The Gaussians.
    pub model: &'a Model,
    /// Adam's memory of them.
    pub moments: &'a Moments,
    /// Not zero once the run is halted.
    pub control: &'a Buffer,
}

/// What an iteration learns beside the Gaussians' parameters, or in their place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Learnt {
    /// The parameters alone.
    Gaussians,
    /// They, and the photo's pose.
    GaussiansAndPose,
    /// The photo's pose: Gaussians stay as they are.
    Pose,
}

/// The stage.
pub struct Update {
    pipeline: Pipeline,
}

impl Update {
    /// Compiles it, with or without statistics, for sums of instances or those of the fast way.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn new(context: &Arc<Context>, wanted: Wanted, statistics: bool, learnt: Learnt) -> Result<Self> {
        let (poses, frozen) = (learnt != Learnt::Gaussians, learnt == Learnt::Pose);
        let constants =
            UpdateConstants { antialiased: wanted.antialiased, statistics, summed: wanted.fast, poses, frozen };
        Ok(Self { pipeline: Pipeline::new::<SplatUpdateStage>(context, &constants)? })
    }

    /// Records it after the backward pass.
    pub fn record<'a>(
        &'a self,
        commands: &mut Recorder,
        [views, control]: [&'a Buffer; 2],
        rasterizer: &'a Rasterizer,
        model: &'a Model,
        moments: &'a Moments,
        push: &UpdatePush,
    ) {
        commands
            .stage(
                &self.pipeline,
                SplatUpdateStage {
                    views,
                    population: &model.population,
                    control,
                    projected: &rasterizer.projected,
                    runs: &rasterizer.runs,
                    partials: rasterizer.partials(),
                    parameters: &model.parameters,
                    first: &moments.first,
                    second: &moments.second,
                    statistics: &moments.statistics,
                    forces: &moments.forces,
                },
            )
            .push(push)
            .linear(rasterizer.sizes().gaussians.div_ceil(64));
    }
}

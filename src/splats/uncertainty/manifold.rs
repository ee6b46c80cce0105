//! How far every parameter of a model can be moved before its pictures change, and how much pictures differ under such moves:
//! manifold sampling (Lyu, Tewari, Habermann, Saito, Zollhöfer, Leimkühler and Theobalt, "Manifold Sampling for Differentiable
//! Uncertainty in Radiance Fields", 2024).
//!
//! A parameter is perturbed to `theta + s w`, w even in [-1, 1) by a Sobol sequence of its own. The noise s learns: its gradient is
//! `w dL / d(theta + s w)`, L being the mean square difference of the perturbed picture to the model's own, less a reward. What no view
//! shows is free to move, up to a hundred of its rates.

use std::ops::Range;
use std::sync::Arc;

use crate::engine::primitives::{Count, Operation, Reduce};
use crate::engine::vulkan::shaders::glsl::splats::noise;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::scene::gaussians::Gaussians;
use crate::scene::random;
use crate::splats::render::frame::View;
use crate::splats::render::layout::PassPush;
use crate::splats::render::rasterizer::{Rasterizer, Size};
use crate::splats::render::renderer::Renderer;
use crate::splats::render::wanted::Wanted;
use crate::splats::train::update::{Learnt, Moments, Update, UpdatePush};
use crate::{Error, Result};

crate::gpu_struct! {
    /// Push constants of [`NoisePerturbStage`].
    pub(crate) struct PerturbPush {
        /// Values: planes times Gaussians.
        pub count: u32,
        /// Which of each parameter's draws.
        pub draw: u32,
        /// Seed, low half first.
        pub seed: [u32; 2],
        /// What the noise is multiplied by.
        pub amplitude: f32,
    }
}

crate::gpu_struct! {
    /// Push constants of [`NoiseResidualStage`].
    pub(crate) struct ResidualPush {
        /// Pixels of a picture.
        pub pixels: u32,
    }
}

crate::gpu_struct! {
    /// Push constants of [`NoiseLearnStage`].
    pub(crate) struct LearnPush {
        /// From one plane of parameters to the next.
        pub stride: u32,
        /// Values: planes times Gaussians.
        pub count: u32,
        /// Which of each parameter's draws the picture was of.
        pub draw: u32,
        /// Unused.
        pub spare0: u32,
        /// Seed, low half first.
        pub seed: [u32; 2],
        /// What the noise of a parameter gains.
        pub reward: f32,
        /// `1 / (1 - 0.9^t)`, t from one.
        pub first_correction: f32,
        /// `1 / (1 - 0.999^t)`.
        pub second_correction: f32,
        /// Adam's rate for the noise of centres.
        pub centre_rate: f32,
        /// Of logarithms of standard deviations.
        pub scale_rate: f32,
        /// Of quaternions.
        pub rotation_rate: f32,
        /// Of logits of opacities.
        pub opacity_rate: f32,
        /// Of the constant harmonic.
        pub colour_rate: f32,
        /// Of the other harmonics.
        pub harmonics_rate: f32,
        /// Most noise, in rates.
        pub most: f32,
    }
}

crate::gpu_struct! {
    /// Push constants of [`NoiseSpreadStage`].
    pub(crate) struct SpreadPush {
        /// Pixels of a picture.
        pub pixels: u32,
        /// Which picture.
        pub picture_index: u32,
        /// Of how many.
        pub pictures: u32,
    }
}

crate::stage!(
    /// Every parameter moved by its noise.
    pub(crate) NoisePerturbStage = noise_perturb(PerturbPush) { read base, read scales, write parameters }
);
crate::stage!(
    /// Gradient of the mean square difference of two pictures.
    pub(crate) NoiseResidualStage = noise_residual(ResidualPush) { read picture, read target, write by_pixel }
);
crate::stage!(
    /// Adam's step of the noise.
    pub(crate) NoiseLearnStage = noise_learn(LearnPush) { read tenths, write scales, write means, write squares }
);
crate::stage!(
    /// Variance of each pixel over pictures.
    pub(crate) NoiseSpreadStage = noise_spread(SpreadPush) { read picture, write pivot, write sums, write spread }
);

/// Views that are rendered at once, and pictures of each at most.
pub(crate) const MAX_VIEWS: usize = 4;
/// See [`MAX_VIEWS`].
pub(crate) const MAX_PICTURES: u32 = 64;
/// Most noise of a parameter, in rates.
const MAX_NOISE: f32 = 100.0;
/// Rates of the noise: those of training, centres at their first.
const RATES: [f32; 6] = [1.6e-4, 5e-3, 1e-3, 5e-2, 2.5e-3, 1.25e-4];
const STREAM: u32 = noise::PERTURBATION_STREAM;

/// Accumulators of a view.
struct Look {
    pivot: Buffer,
    sums: Buffer,
    spread: Buffer,
}

/// A model whose parameters have noise.
pub struct Manifold {
    context: Arc<Context>,
    /// Its model is the perturbed one.
    renderer: Renderer,
    perturb: Pipeline,
    residual: Pipeline,
    learn: Pipeline,
    spread: Pipeline,
    update: Update,
    sum: Reduce,
    base: Buffer,
    scales: Buffer,
    means: Buffer,
    squares: Buffer,
    /// Of which the first is a tenth of the gradient, after a step without rates from zero.
    moments: Moments,
    control: Buffer,
    views: Buffer,
    target: Buffer,
    by_pixel: Buffer,
    looks: Vec<Look>,
    /// Instances of each picture of a submission.
    needed: Buffer,
    results: Buffer,
    size: Size,
    count: u32,
    seed: u64,
    reward: f32,
    steps: u32,
}

impl Manifold {
    /// Brings a model, which is in the training frame, to the device, without noise; all views will be of one size. `reward` is
    /// that of a Gaussian's noise, the sum over its parameters, meant over the Gaussians and for each view.
    ///
    /// # Errors
    /// Where the model is empty or the device has not enough memory.
    pub fn new(
        context: &Arc<Context>,
        gaussians: &Gaussians,
        size: Size,
        antialiased: bool,
        (seed, reward): (u64, f32),
    ) -> Result<Self> {
        let wanted = Wanted { antialiased, gradients: true, ..Wanted::default() };
        let renderer = Renderer::new(context, gaussians, size, wanted)?;
        let count = renderer.model.stride * renderer.model.planes;
        let values = |name: &str| Buffer::device(context, name, 4 * u64::from(count));
        let pixels = u64::from(size.pixels());
        let pixel_buffer = |name: &str, bytes: u64| Buffer::device(context, name, bytes * pixels);
        let look = |_| -> Result<Look> {
            Ok(Look {
                pivot: pixel_buffer("pivot", 16)?,
                sums: pixel_buffer("sums", 16)?,
                spread: pixel_buffer("spread", 4)?,
            })
        };
        let manifold = Self {
            perturb: Pipeline::new::<NoisePerturbStage>(context, &())?,
            residual: Pipeline::new::<NoiseResidualStage>(context, &())?,
            learn: Pipeline::new::<NoiseLearnStage>(context, &())?,
            spread: Pipeline::new::<NoiseSpreadStage>(context, &())?,
            update: Update::new(context, wanted, false, Learnt::Gaussians)?,
            sum: Reduce::new(context, Operation::SumF32, size.pixels())?,
            base: values("base")?,
            scales: values("scales")?,
            means: values("means")?,
            squares: values("squares")?,
            moments: Moments {
                first: values("first")?,
                second: values("second")?,
                statistics: Buffer::device(context, "statistics", 16)?,
                forces: Buffer::device(context, "forces", 16)?,
            },
            control: Buffer::from_slice(context, "control", &[0u32])?,
            views: Buffer::host(context, "views", (MAX_VIEWS * size_of::<View>()) as u64)?,
            target: pixel_buffer("target", 16)?,
            by_pixel: pixel_buffer("by_pixel", 16)?,
            looks: (0..MAX_VIEWS).map(look).collect::<Result<_>>()?,
            needed: Buffer::host(context, "needed", 4 * MAX_VIEWS as u64 * u64::from(MAX_PICTURES))?,
            results: Buffer::host(context, "results", 4 * MAX_VIEWS as u64)?,
            context: context.clone(),
            renderer,
            size,
            count,
            seed,
            reward,
            steps: 0,
        };
        let mut commands = Recorder::new(context)?;
        let parameters = &manifold.renderer.model.parameters;
        commands.copy(parameters, &manifold.base, parameters.size());
        for buffer in [&manifold.scales, &manifold.means, &manifold.squares, &manifold.moments.second] {
            commands.fill(buffer, 0);
        }
        commands.submit_and_wait()?;
        drop(commands);
        Ok(manifold)
    }

    /// One step of learning how much noise the model takes without its picture from `view` changing, one of `views` that it
    /// is known from.
    ///
    /// # Errors
    /// Where the device fails or has not enough memory, or the view is of another size.
    pub fn learn(&mut self, view: &View, views: u32) -> Result<()> {
        let draw = self.steps;
        self.look_from(std::slice::from_ref(view))?;
        self.with_room(2, |manifold, commands| {
            let Renderer { model, rasterizer, degree, .. } = &manifold.renderer;
            manifold.record_picture(commands, (draw, 0.0), 0, 0)?;
            commands.copy(&rasterizer.picture, &manifold.target, manifold.target.size());
            let instances = manifold.record_picture(commands, (draw, 1.0), 0, 1)?;
            let pixels = manifold.size.pixels();
            commands
                .stage(
                    &manifold.residual,
                    NoiseResidualStage {
                        picture: &rasterizer.picture,
                        target: &manifold.target,
                        by_pixel: &manifold.by_pixel,
                    },
                )
                .push(&ResidualPush { pixels })
                .linear(pixels.div_ceil(256));
            let push = manifold.push(0);
            rasterizer.backward(commands, &manifold.views, instances, &manifold.by_pixel, &push);
            commands.fill(&manifold.moments.first, 0);
            // Without rates nothing moves, and the first moment becomes a tenth of the gradient.
            let still = UpdatePush { stride: model.stride, degree: *degree, ..UpdatePush::default() };
            let buffers = [&manifold.views, &manifold.control];
            manifold.update.record(commands, buffers, rasterizer, model, &manifold.moments, &still);
            Ok(())
        })?;
        let t = self.steps as i32 + 1;
        let [centre_rate, scale_rate, rotation_rate, opacity_rate, colour_rate, harmonics_rate] = RATES;
        let push = LearnPush {
            stride: self.renderer.model.stride,
            count: self.count,
            draw,
            seed: words(self.seed),
            reward: self.reward / (views.max(1) as f32 * self.renderer.model.stride as f32),
            first_correction: (1.0 / (1.0 - 0.9f64.powi(t))) as f32,
            second_correction: (1.0 / (1.0 - 0.999f64.powi(t))) as f32,
            centre_rate,
            scale_rate,
            rotation_rate,
            opacity_rate,
            colour_rate,
            harmonics_rate,
            most: MAX_NOISE,
            ..LearnPush::default()
        };
        let mut commands = Recorder::new(&self.context)?;
        commands
            .stage(
                &self.learn,
                NoiseLearnStage {
                    tenths: &self.moments.first,
                    scales: &self.scales,
                    means: &self.means,
                    squares: &self.squares,
                },
            )
            .push(&push)
            .linear(self.count.div_ceil(256));
        commands.submit_and_wait()?;
        drop(commands);
        self.steps += 1;
        Ok(())
    }

    /// How much pictures of each view (at most [`MAX_VIEWS`]) differ under the noise: the mean over pixels of the variance over
    /// perturbed models, summed over the colours, over black. `draws` selects the perturbations, at most [`MAX_PICTURES`], the same
    /// for all views.
    ///
    /// # Errors
    /// Where the device fails or has not enough memory, there are more views or draws than that, or a view is of another size.
    pub fn spread(&mut self, views: &[View], draws: Range<u32>) -> Result<Vec<f64>> {
        let pictures = draws.len() as u32;
        if pictures > MAX_PICTURES {
            return Err(Error::request(format!("{pictures} pictures of a view; take at most {MAX_PICTURES}")));
        }
        self.look_from(views)?;
        let pixels = self.size.pixels();
        self.with_room(views.len() * draws.len(), |manifold, commands| {
            let mut slot = 0;
            for (picture_index, draw) in (0..).zip(draws.clone()) {
                if picture_index > 0 {
                    commands.cut()?;
                }
                manifold.record_perturbation(commands, draw, 1.0);
                for (view, look) in (0..views.len() as u32).zip(&manifold.looks) {
                    manifold.record_render(commands, view, slot)?;
                    let picture = &manifold.renderer.rasterizer.picture;
                    commands
                        .stage(
                            &manifold.spread,
                            NoiseSpreadStage { picture, pivot: &look.pivot, sums: &look.sums, spread: &look.spread },
                        )
                        .push(&SpreadPush { pixels, picture_index, pictures })
                        .linear(pixels.div_ceil(256));
                    slot += 1;
                }
            }
            for (view, look) in (0..views.len() as u32).zip(&manifold.looks) {
                let (all, results) = (Count::Host(pixels), &manifold.results);
                manifold.sum.record(commands, &look.spread, all, results, view)?;
            }
            Ok(())
        })?;
        let sums: Vec<f32> = self.results.read(views.len())?;
        Ok(sums.into_iter().map(|sum| f64::from(sum) / f64::from(pixels)).collect())
    }

    /// The noise of every parameter, in planes as they lie ([`crate::splats::render::layout`]).
    ///
    /// # Errors
    /// Where the device fails.
    pub fn scales(&self) -> Result<Vec<f32>> {
        self.scales.download(self.count as usize)
    }

    /// Sets the noise of every parameter.
    ///
    /// # Errors
    /// Where the number of values differs, or the device fails.
    pub fn set_scales(&mut self, scales: &[f32]) -> Result<()> {
        if scales.len() != self.count as usize {
            return Err(Error::request(format!("{} values for {} parameters", scales.len(), self.count)));
        }
        self.scales.upload(scales)
    }

    fn look_from(&mut self, views: &[View]) -> Result<()> {
        let other = |view: &View| (view.width, view.height) != (self.size.width, self.size.height);
        if views.is_empty() || views.len() > MAX_VIEWS || views.iter().any(other) {
            let Size { width, height } = self.size;
            return Err(Error::request(format!("give 1 to {MAX_VIEWS} views of {width} x {height} pixels")));
        }
        let mut all = [View::default(); MAX_VIEWS];
        all[..views.len()].copy_from_slice(views);
        self.views.write(&all)
    }

    /// Submits what `record` records, again with more capacity while one of its pictures lacks it.
    fn with_room(&mut self, pictures: usize, record: impl Fn(&Self, &mut Recorder) -> Result<()>) -> Result<()> {
        loop {
            let mut commands = Recorder::new(&self.context)?;
            record(self, &mut commands)?;
            commands.submit_and_wait()?;
            drop(commands);
            let needed: Vec<u32> = self.needed.read(pictures)?;
            match needed.into_iter().max() {
                Some(most) if most > self.renderer.rasterizer.sizes().capacity => {
                    self.renderer.rasterizer.ensure_capacity(most)?;
                }
                _ => return Ok(()),
            }
        }
    }

    fn push(&self, view: u32) -> PassPush {
        let Renderer { model, rasterizer, degree, .. } = &self.renderer;
        let (stride, capacity) = (model.stride, rasterizer.sizes().capacity);
        PassPush { stride, view, degree: *degree, capacity, ..PassPush::default() }
    }

    fn record_perturbation(&self, commands: &mut Recorder, draw: u32, amplitude: f32) {
        let push = PerturbPush { count: self.count, draw, seed: words(self.seed), amplitude };
        commands
            .stage(
                &self.perturb,
                NoisePerturbStage {
                    base: &self.base,
                    scales: &self.scales,
                    parameters: &self.renderer.model.parameters,
                },
            )
            .push(&push)
            .linear(self.count.div_ceil(256));
    }

    /// Renders the model as it is perturbed; how many instances it took goes to `needed`.
    fn record_render<'a>(
        &'a self,
        commands: &mut Recorder,
        view: u32,
        slot: u64,
    ) -> Result<crate::splats::render::rasterizer::Instances<'a>> {
        let Renderer { model, rasterizer, .. } = &self.renderer;
        let instances = rasterizer.forward(commands, model, &self.views, self.size, &self.push(view))?;
        let Rasterizer { counts, .. } = rasterizer;
        commands.copy_region(counts, 0, &self.needed, 4 * slot, 4);
        Ok(instances)
    }

    fn record_picture<'a>(
        &'a self,
        commands: &mut Recorder,
        (draw, amplitude): (u32, f32),
        view: u32,
        slot: u64,
    ) -> Result<crate::splats::render::rasterizer::Instances<'a>> {
        self.record_perturbation(commands, draw, amplitude);
        self.record_render(commands, view, slot)
    }
}

/// The two halves of a seed, low half first.
fn words(seed: u64) -> [u32; 2] {
    [seed as u32, (seed >> 32) as u32]
}

/// The twin of `perturbation` in `splats/noise.glsl`: what `draw` moves parameter number `parameter` by, in its noise.
pub fn perturbation(seed: u64, parameter: u32, draw: u32) -> f32 {
    let permuted = |x: u32, key: u32| {
        let turned = [0x6c50_b47cu32, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6];
        turned.into_iter().fold(x.wrapping_add(key), |x, factor| x ^ x.wrapping_mul(factor))
    };
    let [order, digits, ..] = random::bits(seed, STREAM, parameter);
    let point = permuted(draw.reverse_bits(), order);
    2.0 * random::uniform(permuted(point.reverse_bits(), digits).reverse_bits()) - 1.0
}

/// The twin of `noise_learn`: the noise after step number `step`, from 1, from the gradient by the perturbed parameter.
pub fn learnt(
    noise: f64,
    by_parameter: f64,
    draw: f64,
    reward: f64,
    moments: &mut [f64; 2],
    rate: f64,
    step: i32,
) -> f64 {
    let moved = crate::splats::twin::optimise::adam(noise, draw * by_parameter - reward, moments, rate, step);
    moved.clamp(0.0, f64::from(MAX_NOISE) * rate)
}

/// The rate of the noise of a plane of parameters.
pub fn rate(plane: usize) -> f32 {
    use crate::splats::render::layout::{HARMONICS, LOG_SCALE, OPACITY, ROTATION};
    let kind = [LOG_SCALE, ROTATION, OPACITY, HARMONICS, HARMONICS + 3].iter().filter(|first| plane >= **first).count();
    RATES[kind]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, few pictures would estimate the spread worse than they could: every sequence must be even, and no two
    /// parameters may be correlated.
    #[test]
    fn every_parameter_has_an_even_sequence_of_its_own() {
        for parameter in [0, 1, 77, u32::MAX] {
            for first in [0u32, 16, 48] {
                let mut sixteenths: Vec<u32> =
                    (first..first + 16).map(|draw| (8.0 * (1.0 + perturbation(9, parameter, draw))) as u32).collect();
                sixteenths.sort_unstable();
                assert_eq!(sixteenths, (0..16).collect::<Vec<_>>(), "parameter {parameter} from {first}");
            }
        }
        // Over 2000 pairs of neighbours and two draws each.
        let product: f32 = (0..2000)
            .flat_map(|i| [0, 1].map(|draw| perturbation(3, 2 * i, draw) * perturbation(3, 2 * i + 1, draw)))
            .sum();
        assert!((product / 4000.0).abs() < 0.03, "{product}");
        assert_ne!(perturbation(3, 5, 0), perturbation(4, 5, 0));
    }
}

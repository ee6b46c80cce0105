//! What a view reveals about a model: the diagonal of its Fisher information, by parameter (FisherRF, Jiang et al. 2024).
//!
//! `H_k = sum over pixels of (d(R + G + B) / d theta_k)^2` over a black background; rotations are left out. The derivatives are
//! squared pixel by pixel, so that they cannot be summed first and carried back through the projection: the derivatives of the
//! projection come first (`fisher_forms.comp`), each pixel is squared (`fisher_squares.comp`), every Gaussian sums what its
//! instances found (`fisher_gather.comp`), and that is weighed by what is known (`fisher_score.comp`). The sums are nine values a
//! Gaussian and view, from which all of its parameters' follow; they are kept while half of the memory that was free lasts.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::engine::primitives::{Count, Operation, Reduce};
use crate::engine::vulkan::shaders::glsl::splats::{fisher as glsl, fisher_score as glsl_score};
use crate::engine::vulkan::stage::GroupConstants;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::scene::camera::Camera;
use crate::scene::gaussians::Gaussians;
use crate::splats::config::TrainConfig;
use crate::splats::render::frame::{Frame, View};
use crate::splats::render::layout::{self, PassPush, Projected, SplatConstants};
use crate::splats::render::rasterizer::{Composited, Rasterizer, Size};
use crate::splats::render::renderer::Renderer;
use crate::splats::render::wanted::{Threads, Wanted};
use crate::splats::train::trainer::Trainer;
use crate::{Error, Result};

crate::gpu_struct! {
    /// How a pixel answers to a parameter (`splats/fisher.glsl`).
    pub(crate) struct Form {
        /// Of the part that the Gaussian has in the pixel.
        pub weight: f32,
        /// Of the part's change with alpha, everywhere alike.
        pub constant: f32,
        /// The same, by the way from the mean to the pixel.
        pub linear: [f32; 2],
        /// By its squares: xx, xy, yy.
        pub quadratic: [f32; 3],
        /// Unused.
        pub spare0: f32,
    }
}

crate::gpu_struct! {
    /// Push constants of [`FisherScoreStage`].
    pub(crate) struct ScorePush {
        /// From one plane of parameters to the next.
        pub stride: u32,
        /// The view's index.
        pub view: u32,
        /// Degree of the harmonics.
        pub degree: u32,
        /// Whether to add to what is known.
        pub learn: u32,
        /// Added to what is known.
        pub lambda: f32,
        /// Which [`Criterion`] a view is worth.
        pub criterion: u32,
    }
}

/// What information is summed up to, by which views are compared; the information is a diagonal matrix.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Criterion {
    /// `sum of H_k / (known_k + lambda)` (FisherRF).
    #[default]
    Ratio = glsl_score::RATIO as isize,
    /// The rise of the logarithm of the determinant, `sum of ln(1 + H_k / (known_k + lambda))` (D-optimality).
    Determinant = glsl_score::DETERMINANT as isize,
    /// The rise of the trace, `sum of H_k` (T-optimality), whatever is known.
    Trace = glsl_score::TRACE as isize,
}

crate::stage!(
    /// Forms of each Gaussian.
    pub(crate) FisherFormsStage = fisher_forms<SplatConstants>(PassPush) {
        read views, read population, read parameters, read projected, write forms,
    } with [View, Projected, Form]
);
crate::stage!(
    /// Squares over pixels, a workgroup per block of instances.
    pub(crate) FisherSquaresStage = fisher_squares<GroupConstants>(PassPush) {
        read views, read projected, read counts, read instance_splats, read tile_keys, read tile_instances, read ranges,
        read picture, read ends, read tile_ends, read checkpoints, read forms, write partials,
    } with [View, Projected, Form]
);
crate::stage!(
    /// Sums of squares of each Gaussian.
    pub(crate) FisherGatherStage = fisher_gather(PassPush) {
        read population, read counts, read projected, read runs, read partials, write squares,
    } with [Projected]
);
crate::stage!(
    /// What a view is worth for each Gaussian, or what is known with it.
    pub(crate) FisherScoreStage = fisher_score(ScorePush) {
        read views, read population, read parameters, read squares, write known, write scores,
    } with [View]
);

/// Forms of a Gaussian: three of its size, three of its place.
const FORMS: u64 = glsl::FORMS as u64;
/// Values of a Gaussian that a view leaves.
const VALUES: u64 = 9;

impl Criterion {
    /// Whether it is the default.
    pub fn is_usual(&self) -> bool {
        *self == Self::default()
    }
}

/// A model, its candidate views, and the information from views already taken.
pub struct Fisher {
    context: Arc<Context>,
    renderer: Renderer,
    forms_pipeline: Pipeline,
    squares: Pipeline,
    gather: Pipeline,
    score: Pipeline,
    sum: Reduce,
    views: Buffer,
    sizes: Vec<Size>,
    forms: Buffer,
    /// What the views leave, in planes; where one is missing it is rendered again.
    seen: Vec<Option<Buffer>>,
    known: Buffer,
    scores: Buffer,
    /// The score.
    results: Buffer,
    lambda: f32,
    criterion: Criterion,
    /// Bytes of these that may still be kept: half of what was free at first.
    spare: u64,
}

/// Sizes of the pictures, and one that is wide and high enough for all.
pub(super) fn sizes(views: &[View]) -> Result<(Vec<Size>, Size)> {
    let sizes: Vec<Size> = views.iter().map(|view| Size { width: view.width, height: view.height }).collect();
    let wider = |a: Size, b: Size| Size { width: a.width.max(b.width), height: a.height.max(b.height) };
    let largest = sizes.iter().copied().reduce(wider);
    let none = || Error::request("there are no cameras to look at the model from");
    Ok((sizes, largest.ok_or_else(none)?))
}

impl Fisher {
    /// Brings a model, in the cameras' world, to the device; nothing is known of it yet. `lambda` is added to what is known.
    ///
    /// # Errors
    /// Where the model is empty, there are no cameras, or the device has not enough memory.
    pub fn new(
        context: &Arc<Context>,
        gaussians: Gaussians,
        cameras: &[Camera],
        antialiased: bool,
        lambda: f32,
    ) -> Result<Self> {
        let frame = Frame::new(cameras, &gaussians.centres);
        let views: Vec<View> = cameras.iter().map(|camera| frame.view(camera)).collect();
        let (sizes, largest) = sizes(&views)?;
        let wanted = Wanted { antialiased, gradients: true, ..Wanted::default() };
        let renderer = Renderer::new(context, &frame.gaussians_to_training(gaussians), largest, wanted)?;
        let spare = context.memory_available() / 2;
        Self::on(context, renderer, (&views, sizes), antialiased, (lambda, spare))
    }

    /// For the model of a trainer as it is whenever [`Fisher::renew`] is called, from all of the trainer's views. Sums are not
    /// kept: for each state of the model, a view is rendered once.
    ///
    /// # Errors
    /// As [`Fisher::new`].
    pub fn of_training(context: &Arc<Context>, trainer: &Trainer, lambda: f32) -> Result<Self> {
        let (sizes, largest) = sizes(trainer.views())?;
        let TrainConfig { antialiased, degree, max_splats, .. } = *trainer.config();
        let wanted = Wanted { antialiased, gradients: true, ..Wanted::default() };
        let renderer = Renderer::empty(context, max_splats, degree, largest, wanted)?;
        Self::on(context, renderer, (trainer.views(), sizes), antialiased, (lambda, 0))
    }

    /// Takes the trainer's splats as they are now, of which nothing is known yet.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn renew(&mut self, trainer: &Trainer) -> Result<()> {
        let (from, to) = (trainer.model(), &self.renderer.model);
        let mut commands = Recorder::new(&self.context)?;
        commands.copy(&from.parameters, &to.parameters, to.parameters.size());
        commands.copy(&from.population, &to.population, 4);
        commands.fill(&self.known, 0);
        commands.submit_and_wait()?;
        drop(commands);
        self.renderer.degree = trainer.degree();
        Ok(())
    }

    fn on(
        context: &Arc<Context>,
        renderer: Renderer,
        (views, sizes): (&[View], Vec<Size>),
        antialiased: bool,
        (lambda, spare): (f32, u64),
    ) -> Result<Self> {
        let count = renderer.model.stride;
        let planes = vec![0f32; layout::planes(renderer.degree) * count as usize];
        Ok(Self {
            forms_pipeline: Pipeline::new::<FisherFormsStage>(context, &SplatConstants { antialiased })?,
            squares: Pipeline::new::<FisherSquaresStage>(
                context,
                &GroupConstants { local_size_x: Threads::of(context).squares },
            )?,
            gather: Pipeline::new::<FisherGatherStage>(context, &())?,
            score: Pipeline::new::<FisherScoreStage>(context, &())?,
            sum: Reduce::new(context, Operation::SumF32, count)?,
            views: Buffer::from_slice(context, "views", views)?,
            forms: Buffer::device(context, "forms", FORMS * size_of::<Form>() as u64 * u64::from(count))?,
            known: Buffer::from_slice(context, "known", &planes)?,
            scores: Buffer::device(context, "scores", 4 * u64::from(count))?,
            results: Buffer::host(context, "results", 4)?,
            seen: sizes.iter().map(|_| None).collect(),
            spare,
            context: context.clone(),
            renderer,
            sizes,
            lambda,
            criterion: Criterion::Ratio,
        })
    }

    /// The same by another criterion than [`Criterion::Ratio`].
    pub fn by(self, criterion: Criterion) -> Self {
        Self { criterion, ..self }
    }

    /// What the view is worth, by the criterion.
    ///
    /// # Errors
    /// Where the device fails or has not enough memory, or there is no such view.
    pub fn worth(&mut self, view: usize) -> Result<f64> {
        self.look(view, false)
    }

    /// Adds the view's information to what is known.
    ///
    /// # Errors
    /// As [`Fisher::worth`].
    pub fn learn(&mut self, view: usize) -> Result<()> {
        self.look(view, true).map(|_| ())
    }

    /// What is known, in planes as the parameters lie ([`layout`]), `gaussians` apart.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn known(&self) -> Result<Vec<f32>> {
        self.known.download((self.known.size() / 4) as usize)
    }

    fn look(&mut self, view: usize, learn: bool) -> Result<f64> {
        let kept = match self.seen.get_mut(view) {
            None => return Err(Error::request(format!("there is no view {view} among {}", self.sizes.len()))),
            Some(seen) => seen.take(),
        };
        let new = kept.is_none();
        let squares = kept.map_or_else(|| self.observe(view), Ok)?;
        let Renderer { model, degree, .. } = &self.renderer;
        let (stride, learn) = (model.stride, u32::from(learn));
        let (lambda, criterion) = (self.lambda, self.criterion as u32);
        let push = ScorePush { stride, view: view as u32, degree: *degree, learn, lambda, criterion };
        let mut commands = Recorder::new(&self.context)?;
        commands
            .stage(
                &self.score,
                FisherScoreStage {
                    views: &self.views,
                    population: &model.population,
                    parameters: &model.parameters,
                    squares: &squares,
                    known: &self.known,
                    scores: &self.scores,
                },
            )
            .push(&push)
            .linear(stride.div_ceil(64));
        self.sum.record(&mut commands, &self.scores, Count::Device(&model.population, 0), &self.results, 0)?;
        commands.submit_and_wait()?;
        drop(commands);
        let bytes = if new { squares.size() } else { 0 };
        if bytes <= self.spare {
            self.spare -= bytes;
            self.seen[view] = Some(squares);
        }
        Ok(f64::from(self.results.read::<f32>(1)?[0]))
    }

    /// Renders the model from a view: sums of squares of each Gaussian.
    fn observe(&mut self, view: usize) -> Result<Buffer> {
        let size = self.sizes[view];
        let out = Buffer::device(&self.context, "squares", 4 * VALUES * u64::from(self.renderer.model.stride))?;
        loop {
            let Renderer { model, rasterizer, degree, .. } = &self.renderer;
            let (stride, capacity) = (model.stride, rasterizer.sizes().capacity);
            let push = PassPush { stride, view: view as u32, degree: *degree, capacity, ..PassPush::default() };
            let mut commands = Recorder::new(&self.context)?;
            let instances = rasterizer.forward(&mut commands, model, &self.views, size, &push)?;
            commands
                .stage(
                    &self.forms_pipeline,
                    FisherFormsStage {
                        views: &self.views,
                        population: &model.population,
                        parameters: &model.parameters,
                        projected: &rasterizer.projected,
                        forms: &self.forms,
                    },
                )
                .push(&push)
                .linear(stride.div_ceil(64));
            let Composited { counts, instance_splats, tile_keys, tile_instances, .. } =
                rasterizer.composited(instances);
            let Composited { ranges, picture, ends, tile_ends, checkpoints, .. } = rasterizer.composited(instances);
            let squared = FisherSquaresStage {
                views: &self.views,
                projected: &rasterizer.projected,
                counts,
                instance_splats,
                tile_keys,
                tile_instances,
                ranges,
                picture,
                ends,
                tile_ends,
                checkpoints,
                forms: &self.forms,
                partials: rasterizer.partials(),
            };
            commands.stage(&self.squares, squared).push(&push).linear(capacity.div_ceil(layout::BLOCK));
            let Rasterizer { counts, projected, runs, .. } = rasterizer;
            commands
                .stage(
                    &self.gather,
                    FisherGatherStage {
                        population: &model.population,
                        counts,
                        projected,
                        runs,
                        partials: rasterizer.partials(),
                        squares: &out,
                    },
                )
                .push(&push)
                .linear(stride.div_ceil(64));
            commands.submit_and_wait()?;
            drop(commands);
            match rasterizer.counts.download::<u32>(1)?[0] {
                needed if needed > capacity => self.renderer.rasterizer.ensure_capacity(needed)?,
                _ => return Ok(out),
            }
        }
    }
}

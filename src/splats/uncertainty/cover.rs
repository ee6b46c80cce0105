//! How much of what a view shows of a model has been seen from near the same direction (COVER).
//!
//! Every Gaussian has 64 bins of directions on a spherical Fibonacci lattice, each seen or not. Its coverage from a direction is
//! `(1 + the largest cosine to a bin seen) / 2`, none where no bin is; a pixel's is composited as a colour is, and a view's is
//! the mean over its pixels, each as much as it shows of the model: of an object, background covers nothing.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::DVec3;

use crate::engine::primitives::{Count, Operation, Reduce};
use crate::engine::vulkan::shaders::glsl::splats::cover_weigh as glsl;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::scene::camera::Camera;
use crate::scene::gaussians::Gaussians;
use crate::splats::render::frame::{Frame, View};
use crate::splats::render::layout::{PassPush, Projected};
use crate::splats::render::rasterizer::Size;
use crate::splats::render::renderer::Renderer;
use crate::splats::render::wanted::Wanted;
use crate::{Error, Result};

crate::gpu_struct! {
    /// Push constants of [`CoverWeighStage`].
    pub(crate) struct CoverPush {
        /// From one plane of parameters to the next.
        pub stride: u32,
        /// The view's index.
        pub view: u32,
        /// Capacity for instances.
        pub capacity: u32,
        /// Whether to remember the directions.
        pub learn: u32,
    }
}

crate::stage!(
    /// Part and coverage of each Gaussian.
    pub(crate) CoverWeighStage = cover_weigh(CoverPush) {
        read views, read population, read counts, read parameters, read projected, read runs, read partials, read bins,
        write seen, write parts, write covered,
    } with [View, Projected]
);

/// Bins of directions.
pub(crate) const BINS: usize = glsl::BINS as usize;

/// Unit vectors of the bins: even in height, turned by the golden angle.
pub fn bins() -> [DVec3; BINS] {
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    std::array::from_fn(|i| {
        let height = 1.0 - (2.0 * i as f64 + 1.0) / BINS as f64;
        let (sin, cos) = (TAU * (golden * i as f64).fract()).sin_cos();
        let flat = (1.0 - height * height).sqrt();
        DVec3::new(flat * cos, flat * sin, height)
    })
}

/// A model, its candidate views, and the directions from which it has been seen.
pub struct Cover {
    context: Arc<Context>,
    renderer: Renderer,
    weigh: Pipeline,
    sum: Reduce,
    views: Buffer,
    sizes: Vec<Size>,
    by_pixel: Buffer,
    bins: Buffer,
    seen: Buffer,
    parts: Buffer,
    covered: Buffer,
    /// Sum of the parts, of what of them is covered, and the instances of the picture.
    results: Buffer,
}

impl Cover {
    /// Brings a model, in the cameras' world, to the device; it has been seen from nowhere yet.
    ///
    /// # Errors
    /// Where the model is empty, there are no cameras, or the device has not enough memory.
    pub fn new(context: &Arc<Context>, gaussians: Gaussians, cameras: &[Camera], antialiased: bool) -> Result<Self> {
        let frame = Frame::new(cameras, &gaussians.centres);
        let views: Vec<View> = cameras.iter().map(|camera| frame.view(camera)).collect();
        let (sizes, largest) = super::fisher::sizes(&views)?;
        let wanted = Wanted { antialiased, gradients: true, ..Wanted::default() };
        let renderer = Renderer::new(context, &frame.gaussians_to_training(gaussians), largest, wanted)?;
        let count = renderer.model.stride;
        let bins = bins().map(|bin| bin.extend(0.0).as_vec4().to_array());
        let words = vec![[0u32; 2]; count as usize];
        let reds = vec![[1f32, 0.0, 0.0, 0.0]; largest.pixels() as usize];
        Ok(Self {
            weigh: Pipeline::new::<CoverWeighStage>(context, &())?,
            sum: Reduce::new(context, Operation::SumF32, count)?,
            views: Buffer::from_slice(context, "views", &views)?,
            by_pixel: Buffer::from_slice(context, "by_pixel", &reds)?,
            bins: Buffer::from_slice(context, "bins", &bins)?,
            seen: Buffer::from_slice(context, "seen", &words)?,
            parts: Buffer::device(context, "parts", 4 * u64::from(count))?,
            covered: Buffer::device(context, "covered", 4 * u64::from(count))?,
            results: Buffer::host(context, "results", 12)?,
            context: context.clone(),
            renderer,
            sizes,
        })
    }

    /// The part of what the view shows that has not been covered, 0 to 1; less where it shows nothing.
    ///
    /// # Errors
    /// Where the device fails or has not enough memory, or there is no such view.
    pub fn worth(&mut self, view: usize) -> Result<f64> {
        let [parts, covered] = self.look(view, false)?;
        Ok(if parts > 0.0 { 1.0 - covered / parts } else { -1.0 })
    }

    /// Remembers from where the view sees what it shows.
    ///
    /// # Errors
    /// As [`Cover::worth`].
    pub fn learn(&mut self, view: usize) -> Result<()> {
        self.look(view, true).map(|_| ())
    }

    fn look(&mut self, view: usize, learn: bool) -> Result<[f64; 2]> {
        let Some(&size) = self.sizes.get(view) else {
            return Err(Error::request(format!("there is no view {view} among {}", self.sizes.len())));
        };
        loop {
            let Renderer { model, rasterizer, degree, .. } = &self.renderer;
            let (stride, view, capacity) = (model.stride, view as u32, rasterizer.sizes().capacity);
            let push = PassPush { stride, view, degree: *degree, capacity, ..PassPush::default() };
            let mut commands = Recorder::new(&self.context)?;
            let instances = rasterizer.forward(&mut commands, model, &self.views, size, &push)?;
            rasterizer.backward(&mut commands, &self.views, instances, &self.by_pixel, &push);
            commands
                .stage(
                    &self.weigh,
                    CoverWeighStage {
                        views: &self.views,
                        population: &model.population,
                        counts: &rasterizer.counts,
                        parameters: &model.parameters,
                        projected: &rasterizer.projected,
                        runs: &rasterizer.runs,
                        partials: rasterizer.partials(),
                        bins: &self.bins,
                        seen: &self.seen,
                        parts: &self.parts,
                        covered: &self.covered,
                    },
                )
                .push(&CoverPush { stride, view, capacity, learn: u32::from(learn) })
                .linear(stride.div_ceil(64));
            for (sums, of) in [&self.parts, &self.covered].into_iter().zip(0..) {
                self.sum.record(&mut commands, sums, Count::Device(&model.population, 0), &self.results, of)?;
            }
            commands.copy_region(&rasterizer.counts, 0, &self.results, 8, 4);
            commands.submit_and_wait()?;
            drop(commands);
            let mut results = [0u32; 3];
            self.results.read_into(&mut results)?;
            match results[2] {
                needed if needed > capacity => self.renderer.rasterizer.ensure_capacity(needed)?,
                _ => return Ok([results[0], results[1]].map(|sum| f64::from(f32::from_bits(sum)))),
            }
        }
    }
}

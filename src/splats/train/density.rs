//! The densification of 3DGS: coarse Gaussians are cloned or split, faint and overlarge ones removed, opacities reset now and
//! then (`density_*.comp`). How many there are is known to the device alone.

use std::sync::Arc;

use super::update::Trained;
use crate::Result;
use crate::engine::primitives::Count;
use crate::engine::vulkan::shaders::glsl::splats::density as glsl;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::splats::config::MIN_OPACITY;
use crate::splats::render::rasterizer::{Model, Rasterizer};

crate::gpu_struct! {
    /// Push constants of the stages.
    pub(crate) struct DensityPush {
        /// From one plane of parameters to the next: the most Gaussians there can be.
        pub stride: u32,
        /// Planes that parameters and moments have.
        pub planes: u32,
        /// Seed, low half first.
        pub seed: [u32; 2],
        /// Iteration, from zero.
        pub iteration: u32,
        /// Mean length of the gradient by the mean, in halves of a picture, from which a Gaussian is too coarse.
        pub coarse: f32,
        /// Standard deviation from which it is split and not cloned.
        pub wide: f32,
        /// Standard deviation from which it is removed.
        pub too_wide: f32,
        /// Opacity under which it is removed; a reset leaves twice that.
        pub least: f32,
    }
}

crate::stage!(
    /// Which Gaussians have a child, and which slots are free.
    pub(crate) DensityMarkStage = density_mark(DensityPush) {
        read population, read parameters, read statistics, write children, write holes, write totals,
    }
);
crate::stage!(
    /// The free slots, in order.
    pub(crate) DensityHolesStage = density_holes(DensityPush) { read holes, read hole_ranks, read totals, write slots }
);
crate::stage!(
    /// Clones, splits, removes.
    pub(crate) DensityGrowStage = density_grow(DensityPush) {
        read control, read children, read child_ranks, read holes, read hole_ranks, read totals, read slots,
        write parameters, write first, write second, write statistics, write population,
    }
);
crate::stage!(
    /// Lowers all opacities.
    pub(crate) DensityResetStage = density_reset(DensityPush) {
        read control, read population, write parameters, write first, write second,
    }
);

/// Logit of the opacity of a free slot.
pub(crate) const FREE: f32 = glsl::FREE as f32;
/// Thresholds of the paper, in the training frame.
const COARSE: f32 = 2e-4;
const WIDE: f32 = 0.01;
const TOO_WIDE: f32 = 0.1;

/// The stages. Their lists are the rasterizer's scratch.
pub(crate) struct AdaptiveDensity {
    mark: Pipeline,
    holes: Pipeline,
    grow: Pipeline,
    reset: Pipeline,
    totals: Buffer,
    budget: u32,
}

impl AdaptiveDensity {
    /// Compiles them for at most `budget` Gaussians.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn new(context: &Arc<Context>, budget: u32) -> Result<Self> {
        Ok(Self {
            mark: Pipeline::new::<DensityMarkStage>(context, &())?,
            holes: Pipeline::new::<DensityHolesStage>(context, &())?,
            grow: Pipeline::new::<DensityGrowStage>(context, &())?,
            reset: Pipeline::new::<DensityResetStage>(context, &())?,
            totals: Buffer::device(context, "totals", 12)?,
            budget,
        })
    }

    fn push(&self, model: &Model, [seed, iteration]: [u64; 2], removes_wide: bool) -> DensityPush {
        DensityPush {
            stride: model.stride,
            planes: model.planes,
            seed: [seed as u32, (seed >> 32) as u32],
            iteration: iteration as u32,
            coarse: COARSE,
            wide: WIDE,
            too_wide: if removes_wide { TOO_WIDE } else { f32::MAX },
            least: MIN_OPACITY,
        }
    }

    /// Records a refinement; overlarge Gaussians are removed where `removes_wide` is set.
    ///
    /// # Errors
    /// None that the budget does not rule out.
    pub fn record(
        &self,
        commands: &mut Recorder,
        Trained { model, moments, control }: Trained<'_>,
        rasterizer: &Rasterizer,
        keys: [u64; 2],
        removes_wide: bool,
    ) -> Result<()> {
        let push = self.push(model, keys, removes_wide);
        let (marked, counted) = (self.budget.div_ceil(64), self.budget.div_ceil(256));
        let ([children, child_ranks, hole_flags, hole_ranks, slots], scan) = rasterizer.scratch();
        let totals = &self.totals;
        commands
            .stage(
                &self.mark,
                DensityMarkStage {
                    population: &model.population,
                    parameters: &model.parameters,
                    statistics: &moments.statistics,
                    children,
                    holes: hole_flags,
                    totals,
                },
            )
            .push(&push)
            .linear(marked);
        let population = || Count::Device(&model.population, 0);
        scan.record(commands, children, child_ranks, population(), (totals, 0))?;
        scan.record(commands, hole_flags, hole_ranks, population(), (totals, 1))?;
        commands
            .stage(&self.holes, DensityHolesStage { holes: hole_flags, hole_ranks, totals, slots })
            .push(&push)
            .linear(counted);
        commands
            .stage(
                &self.grow,
                DensityGrowStage {
                    control,
                    children,
                    child_ranks,
                    holes: hole_flags,
                    hole_ranks,
                    totals,
                    slots,
                    parameters: &model.parameters,
                    first: &moments.first,
                    second: &moments.second,
                    statistics: &moments.statistics,
                    population: &model.population,
                },
            )
            .push(&push)
            .linear(marked);
        Ok(())
    }

    /// Records a reset of the opacities.
    pub fn record_reset(&self, commands: &mut Recorder, Trained { model, moments, control }: Trained<'_>) {
        commands
            .stage(
                &self.reset,
                DensityResetStage {
                    control,
                    population: &model.population,
                    parameters: &model.parameters,
                    first: &moments.first,
                    second: &moments.second,
                },
            )
            .push(&self.push(model, [0; 2], false))
            .linear(self.budget.div_ceil(256));
    }
}

//! A hard budget of Gaussians: dead ones move to where living ones are, and new ones join them, until the budget is spent
//! (`mcmc_*.comp`; Kheradmand et al. 2024, "3D Gaussian Splatting as Markov Chain Monte Carlo").

use std::sync::Arc;

use super::update::Trained;
use crate::Result;
use crate::engine::primitives::Count;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::splats::config::MIN_OPACITY;
use crate::splats::render::rasterizer::Rasterizer;

crate::gpu_struct! {
    /// Push constants of the four stages.
    pub(crate) struct McmcPush {
        /// From one plane of parameters to the next.
        pub stride: u32,
        /// Planes that parameters and moments have.
        pub planes: u32,
        /// Gaussians before.
        pub before: u32,
        /// Gaussians after.
        pub after: u32,
        /// Seed, low half first.
        pub seed: [u32; 2],
        /// Iteration, from zero.
        pub iteration: u32,
        /// Weights are opacities in steps of `1 / steps`.
        pub steps: u32,
        /// Opacity up to which a Gaussian is dead.
        pub least: f32,
    }
}

crate::stage!(
    /// How likely each Gaussian is to be drawn.
    pub(crate) McmcWeighStage = mcmc_weigh(McmcPush) { read parameters, write weights, write picks }
);
crate::stage!(
    /// Which one each dead or new Gaussian draws.
    pub(crate) McmcPickStage = mcmc_pick(McmcPush) { read weights, read cumulative, read total, write picks, write sources }
);
crate::stage!(
    /// Opacity and size of those that were drawn.
    pub(crate) McmcSplitStage = mcmc_split(McmcPush) { read control, read picks, write parameters }
);
crate::stage!(
    /// Dead and new Gaussians become what they drew.
    pub(crate) McmcCopyStage = mcmc_copy(McmcPush) {
        read control, read sources, write parameters, write first, write second, write population,
    }
);

/// How many Gaussians there are after a refinement that multiplies them by `growth`.
pub fn grown(before: u32, growth: f64, budget: u32) -> u32 {
    ((f64::from(before) * growth).ceil() as u32).clamp(before, budget.max(before))
}

/// The stages. Their lists are the rasterizer's scratch.
pub struct Mcmc {
    weigh: Pipeline,
    pick: Pipeline,
    split: Pipeline,
    copy: Pipeline,
    total: Buffer,
    budget: u32,
}

impl Mcmc {
    /// Compiles them for at most `budget` Gaussians.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn new(context: &Arc<Context>, budget: u32) -> Result<Self> {
        Ok(Self {
            weigh: Pipeline::new::<McmcWeighStage>(context, &())?,
            pick: Pipeline::new::<McmcPickStage>(context, &())?,
            split: Pipeline::new::<McmcSplitStage>(context, &())?,
            copy: Pipeline::new::<McmcCopyStage>(context, &())?,
            total: Buffer::device(context, "total", 4)?,
            budget,
        })
    }

    /// Records a refinement of `before` Gaussians, after which there are `after`.
    ///
    /// # Errors
    /// None that the budget does not rule out.
    pub fn record(
        &self,
        commands: &mut Recorder,
        Trained { model, moments, control }: Trained<'_>,
        rasterizer: &Rasterizer,
        [before, after]: [u32; 2],
        [seed, iteration]: [u64; 2],
    ) -> Result<()> {
        debug_assert!(before <= after && after <= self.budget.max(before));
        let push = McmcPush {
            stride: model.stride,
            planes: model.planes,
            before,
            after,
            seed: [seed as u32, (seed >> 32) as u32],
            iteration: iteration as u32,
            steps: (u32::MAX / self.budget.max(1)).min(1 << 20),
            least: MIN_OPACITY,
        };
        let ([weights, cumulative, picks, sources, _], scan) = rasterizer.scratch();
        let (all, moved) = (before.div_ceil(256), after.div_ceil(64));
        commands
            .stage(&self.weigh, McmcWeighStage { parameters: &model.parameters, weights, picks })
            .push(&push)
            .linear(all);
        scan.record(commands, weights, cumulative, Count::Host(before), (&self.total, 0))?;
        commands
            .stage(&self.pick, McmcPickStage { weights, cumulative, total: &self.total, picks, sources })
            .push(&push)
            .linear(after.div_ceil(256));
        commands
            .stage(&self.split, McmcSplitStage { control, picks, parameters: &model.parameters })
            .push(&push)
            .linear(before.div_ceil(64));
        commands
            .stage(
                &self.copy,
                McmcCopyStage {
                    control,
                    sources,
                    parameters: &model.parameters,
                    first: &moments.first,
                    second: &moments.second,
                    population: &model.population,
                },
            )
            .push(&push)
            .linear(moved);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a run would never spend its budget, or pass it.
    #[test]
    fn the_population_grows_to_the_budget_and_stays_there() {
        let (mut n, mut steps) = (1000, 0);
        while n < 100_000 {
            let next = grown(n, 1.05, 100_000);
            assert!(next > n, "{n} grew to {next}");
            (n, steps) = (next, steps + 1);
        }
        assert!((90..110).contains(&steps), "{steps} refinements");
        assert_eq!(grown(n, 1.05, 100_000), 100_000);
        assert_eq!(grown(5, 1.05, 3), 5);
        assert_eq!(grown(1000, 1.83, 100_000), 1830);
    }
}

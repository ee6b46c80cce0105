//! The structs that the stages of the paper's objective share, as `shaders/glsl/planner/plan/paper/paper.glsl` declares them.

use super::config::Kernel;
use crate::gpu_struct;
use crate::planner::plan::gate::Gate;

crate::specialisation! {
    /// Constants of the stages, as in `paper.glsl`, `gate.glsl` and `dense.comp`.
    pub(crate) struct PaperConstants {
        /// Texels of a point camera along a side.
        resolution: u32,
        /// When a point counts as in a splat's picture.
        gate: Gate,
        /// How a splat looks to a point.
        kernel: Kernel,
        /// Whether surfaces hide.
        occlusion: bool,
        /// Threads per workgroup of the dense pass, and of the update its own, a power of two from 64 to 1024.
        threads: u32,
        /// Texels of each thread of the dense pass, up to 4.
        each: u32,
    }
}

gpu_struct! {
    /// Everything that does not change during a run, beside [`crate::planner::plan::shared::Settings`].
    pub struct PaperSettings {
        /// Point cameras a step.
        pub probes: u32,
        /// Point cameras in all.
        pub pool: u32,
        /// Capacity in visible splats of a probe (dense), or pairs in all (binned).
        pub capacity: u32,
        /// Partials from one block of a probe to the next (dense: the capacity; binned: 0).
        pub row: u32,
        /// Capacity in (tile, splat) instances (binned).
        pub instances: u32,
        /// Blocks of texels that a probe's tallies and partials come in.
        pub blocks: u32,
        /// Seed of every random number.
        pub seed: u32,
        /// Relocate every so many iterations; 0 for never.
        pub relocate_every: u32,
        /// Last iteration that relocates.
        pub relocate_until: u32,
        /// 0: every target is the same.
        pub weighted: u32,
        /// 1: every probe weighs the same; 0: by its reachable directions.
        pub equal: u32,
        /// Opacity of a splat.
        pub alpha: f32,
        /// Softness of the gate, in cosines (cone) or sines (frustum).
        pub gate_softness: f32,
        /// Learning rate of log s.
        pub lr_scale: f32,
        /// Weight of the coverage regulariser.
        pub lambda_reg: f32,
        /// Pressure on s squared.
        pub lambda_scale: f32,
        /// Smallest s.
        pub scale_floor: f32,
    }
}

gpu_struct! {
    /// The scale that all splats share.
    pub(crate) struct Scale {
        /// Logarithm of the scale s.
        pub log_scale: f32,
        /// Adam's first moment of log s.
        pub mean: f32,
        /// Adam's second moment of log s.
        pub square: f32,
    }
}

gpu_struct! {
    /// What one block of texels of a probe contributes.
    pub struct Tally {
        /// Its part of the image loss.
        pub image: f32,
        /// Gradient by log s.
        pub log_scale: f32,
        /// Sum over texels of the squared deficit.
        pub short_fall: f32,
        /// Texels from whose direction the region sees the probe.
        pub sky: f32,
        /// Splats that the probe sees, also past the capacity; not counted by the binned pass.
        pub visible: u32,
    }
}

gpu_struct! {
    /// Sums over the texels of one tile for one splat.
    pub(crate) struct InstanceSum {
        /// Sum of the gradient by opacity, times opacity, times direction.
        pub moment: [f32; 3],
        /// Sum of the gradient by opacity, times opacity.
        pub total: f32,
        /// Gradient by log s.
        pub log_scale: f32,
        /// What the instance adds to its camera's utility.
        pub utility: f32,
        /// Unused.
        pub spare0: u32,
        /// Unused.
        pub spare1: u32,
    }
}

//! The structs that the planner's stages share, as `shaders/glsl/plan/plan.glsl` (and `tally.glsl`) declares them.
//!
//! Lengths are in units of the region's bounding radius, in the planner's own frame (see
//! [`crate::scene::similarity`]): up is +Z and a shell is centred on the origin.

use super::config::{Gate, Kernel};
use crate::gpu_struct;

crate::specialisation! {
    /// Constants of the plan's stages, as in `plan/plan.glsl` and `dense.comp`.
    pub(crate) struct PlanConstants {
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
    /// Everything that does not change during a run.
    pub struct Settings {
        /// Splats, kept and planned.
        pub splats: u32,
        /// The first so many never move.
        pub kept: u32,
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
        /// Iterations of the run.
        pub iterations: u32,
        /// Iterations a view in the iterative variant, 0 in the joint one.
        pub round_length: u32,
        /// Seed of every random number.
        pub seed: u32,
        /// Relocate every so many iterations; 0 for never.
        pub relocate_every: u32,
        /// Last iteration that relocates.
        pub relocate_until: u32,
        /// Blocks of texels that a probe's tallies and partials come in.
        pub blocks: u32,
        /// 0: every target is the same.
        pub weighted: u32,
        /// 1: every probe weighs the same; 0: by its reachable directions.
        pub equal: u32,
        /// Opacity of a splat.
        pub alpha: f32,
        /// Softness of the gate, in cosines (cone) or sines (frustum).
        pub gate_softness: f32,
        /// Learning rate of positions.
        pub lr_position: f32,
        /// Learning rate of directions.
        pub lr_direction: f32,
        /// Learning rate of log s.
        pub lr_scale: f32,
        /// What the rates have fallen to at the end.
        pub decay: f32,
        /// Weight of the coverage regulariser.
        pub lambda_reg: f32,
        /// Weight of the region term.
        pub lambda_bound: f32,
        /// Pressure on s squared.
        pub lambda_scale: f32,
        /// Smallest s.
        pub scale_floor: f32,
        /// Widest angle between neighbours (quality), in radians; 0 where none is asked for.
        pub link_angle: f32,
    }
}

gpu_struct! {
    /// What changes from one iteration to the next; written by the update alone.
    pub(crate) struct Control {
        /// Iterations done.
        pub iteration: u32,
        /// Non-zero: nothing is done any more.
        pub halt: u32,
        /// Splats `first..live` move.
        pub first: u32,
        /// Splats `0..live` are seen.
        pub live: u32,
        /// Adam's step, from 1.
        pub step: u32,
        /// Factor on the learning rates.
        pub rate: f32,
        /// Logarithm of the shared scale s.
        pub log_scale: f32,
        /// Adam's first moment of log s.
        pub scale_mean: f32,
        /// Adam's second moment of log s.
        pub scale_square: f32,
        /// Most splats that any probe has seen so far.
        pub most_visible: u32,
    }
}

gpu_struct! {
    /// A camera splat: its centre and viewing direction (unit length).
    pub struct Splat {
        /// Centre.
        pub centre: [f32; 3],
        /// Tangent of half the horizontal field of view.
        pub tan_x: f32,
        /// Unit viewing direction.
        pub direction: [f32; 3],
        /// Tangent of half the vertical field of view.
        pub tan_y: f32,
    }
}

gpu_struct! {
    /// Gradient of the loss by a splat's pose.
    pub struct Gradient {
        /// By its centre.
        pub centre: [f32; 3],
        /// By log s.
        pub log_scale: f32,
        /// By its viewing direction.
        pub direction: [f32; 3],
        /// Rise of the image loss if the splat were not there.
        pub utility: f32,
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
        /// That a viewer's partials are to be multiplied by (`viewed`).
        pub factor: f32,
    }
}

gpu_struct! {
    /// Adam's moments of a splat's pose, and its utility.
    pub struct Moments {
        /// First moment of the centre.
        pub centre_mean: [f32; 3],
        /// Unused.
        pub spare0: u32,
        /// Second moment of the centre.
        pub centre_square: [f32; 3],
        /// Unused.
        pub spare1: u32,
        /// First moment of the direction.
        pub direction_mean: [f32; 3],
        /// Unused.
        pub spare2: u32,
        /// Second moment of the direction.
        pub direction_square: [f32; 3],
        /// Running mean of the utility, decay 0.9.
        pub utility: f32,
    }
}

gpu_struct! {
    /// A point that a camera shares with a neighbour.
    pub struct Anchor {
        /// The point.
        pub point: [f32; 3],
        /// Its weight in the penalty.
        pub weight: f32,
        /// Where the neighbour stood when the links were made.
        pub other: [f32; 3],
        /// Unused.
        pub spare: u32,
    }
}

gpu_struct! {
    /// The loss at an iteration.
    pub struct Record {
        /// Image term, or expected quality.
        pub image: f32,
        /// Regulariser, unweighted; of expected quality the penalty on links.
        pub reg: f32,
        /// Region term, unweighted.
        pub bound: f32,
        /// Logarithm of s.
        pub log_scale: f32,
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
        /// Utility.
        pub utility: f32,
        /// Unused.
        pub spare0: u32,
        /// Unused.
        pub spare1: u32,
    }
}

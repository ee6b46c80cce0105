//! The structs that the stages of expected quality share, as `shaders/glsl/planner/plan/expected_quality` declares them.

use crate::gpu_struct;

gpu_struct! {
    /// Everything that does not change during a run, beside [`crate::planner::plan::shared::Settings`].
    pub struct QualitySettings {
        /// Viewers of an iteration.
        pub viewers: u32,
        /// Softness of the gate, in cosines (cone) or sines (frustum).
        pub gate_softness: f32,
        /// Widest angle between neighbours, in radians; 0 where none is asked for.
        pub link_angle: f32,
    }
}

gpu_struct! {
    /// What a viewer's looks contribute.
    pub(crate) struct ViewerLoss {
        /// Its part of the loss.
        pub loss: f32,
        /// That its partials are to be multiplied by.
        pub factor: f32,
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

//! The structs that the stages of every plan share, whatever its objective, as `shaders/glsl/planner/plan/plan.glsl` (and `finish.glsl`) declares
//! them.
//!
//! Lengths are in units of the region's bounding radius, in the planner's own frame (see
//! [`crate::scene::similarity`]): up is +Z and a shell is centred on the origin.

use crate::gpu_struct;
use crate::scene::camera::Pose;

gpu_struct! {
    /// Everything that does not change during a run.
    pub struct Settings {
        /// Splats, kept and planned.
        pub splats: u32,
        /// The first so many never move.
        pub kept: u32,
        /// Iterations of the run.
        pub iterations: u32,
        /// Iterations a view where views are added one at a time, 0 where all move at once.
        pub round_length: u32,
        /// Learning rate of positions.
        pub lr_position: f32,
        /// Learning rate of directions.
        pub lr_direction: f32,
        /// What the rates have fallen to at the end.
        pub decay: f32,
        /// Weight of the region term.
        pub lambda_bound: f32,
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
    }
}

gpu_struct! {
    /// A camera splat: its centre and viewing direction (unit length).
    pub struct CameraState {
        /// Position of the camera's centre, in the planner's frame.
        pub centre: [f32; 3],
        /// Tangent of half the horizontal field of view.
        pub tan_x: f32,
        /// Unit viewing direction.
        pub direction: [f32; 3],
        /// Tangent of half the vertical field of view.
        pub tan_y: f32,
    }
}

impl CameraState {
    /// Gives it the pose of a camera in the planner's frame.
    pub(crate) fn place(&mut self, pose: &Pose) {
        self.centre = pose.position.as_vec3().to_array();
        self.direction = pose.forward().as_vec3().normalize().to_array();
    }
}

gpu_struct! {
    /// Gradient of the loss by a splat's pose, or a part of it.
    pub struct Gradient {
        /// By its centre.
        pub centre: [f32; 3],
        /// By a number that the objective learns beside the poses.
        pub own: f32,
        /// By its viewing direction.
        pub direction: [f32; 3],
        /// Rise of the loss if the splat were not there, where the objective knows it.
        pub utility: f32,
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
    /// The loss at an iteration.
    pub struct Record {
        /// The objective's own loss.
        pub loss: f32,
        /// Its penalty, unweighted.
        pub penalty: f32,
        /// Region term, unweighted.
        pub bound: f32,
        /// What the objective learns beside the poses, before its step.
        pub state: f32,
    }
}

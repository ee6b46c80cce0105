//! What plans are judged by: photos of scenes rendered by path tracing, the methods that a plan is compared with, evaluations by trained
//! splats, and the fits of what the planner predicts. The product uses none of it; the program offers both.

pub mod baselines;
pub mod benchmark;
pub mod evaluate;
pub mod path_tracer;
pub mod quality_fit;
pub mod vdsf_fit;

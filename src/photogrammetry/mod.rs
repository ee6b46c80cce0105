//! What photos say before a plan: frames worth keeping of a video, a surface by stereo, how much a surface's look changes with the view.

pub mod frames;
pub mod stereo;
pub mod vds;

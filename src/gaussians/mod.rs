//! Gaussian splatting: rendering trained splats, and training them from photos.

pub mod frame;
pub mod pictures;
pub mod split;
pub mod start;
mod undistort;

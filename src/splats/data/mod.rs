//! What training starts from: photos as pictures, which of them are tests, first Gaussians.

pub mod pictures;
pub mod split;
pub mod start;
pub mod store;
mod undistort;

//! Gaussian splatting: rendering trained splats, and training them from photos.

pub mod twin;

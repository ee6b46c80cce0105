//! Gaussian splatting: rendering trained splats, and training them from photos.

pub mod config;
pub mod data;
pub mod render;
pub mod run;
pub mod train;
pub mod twin;
pub mod uncertainty;

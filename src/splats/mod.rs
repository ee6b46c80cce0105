//! Gaussian splatting: rendering trained splats, training them from photos, and how like two images are.

pub mod config;
pub mod data;
pub mod exposure;
pub mod image_metrics;
pub mod pose;
pub mod render;
pub mod run;
pub mod train;
pub mod twin;
pub mod uncertainty;

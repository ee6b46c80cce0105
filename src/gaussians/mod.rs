//! Gaussian splatting: rendering trained splats, and training them from photos.

pub mod config;
pub mod layout;
pub mod loss;
pub mod mcmc;
pub mod rasterizer;
pub mod store;
pub mod trainer;
pub mod twin;
pub mod update;
pub mod view;

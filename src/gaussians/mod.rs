//! Gaussian splatting: rendering trained splats, and training them from photos.

pub mod checkpoint;
pub mod classic;
pub mod config;
mod course;
pub mod cover;
pub mod evaluate;
pub mod fisher;
pub mod frame;
pub mod job;
pub mod layout;
pub mod loss;
pub mod manifold;
pub mod mcmc;
pub mod memory;
pub mod pictures;
pub mod products;
pub mod rasterizer;
pub mod record;
pub mod render;
pub mod renderer;
pub mod split;
pub mod start;
pub mod store;
pub mod trainer;
pub mod twin;
mod undistort;
pub mod update;

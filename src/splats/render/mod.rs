//! Pictures of Gaussians: frames and cameras, projection, tiles, compositing.

pub mod frame;
pub mod layout;
pub mod pictures;
pub mod rasterizer;
pub mod renderer;
pub mod wanted;

//! camsplat answers one question: where should the cameras stand?
//!
//! Given a rough surface of an object or a room, it places N cameras at once by gradient descent, so that a radiance
//! field trained on their photos is as good as it can be. Cameras are Gaussians ("camera splats"), points on the surface
//! look back at them ("point cameras"), and the picture they see must come out evenly bright.
//!
//! The layers look down only: [`cli`] and [`report`] sit on [`evaluate`], that on [`peers`] and [`photograph`], these on [`plan`],
//! [`vds`], [`select`], [`stereo`] and [`gaussians`], these on [`metrics`] and [`visibility`], then [`io`], [`photos`], [`scene`],
//! [`primitives`] and [`vulkan`].

pub mod error;
pub mod evaluate;
pub mod gaussians;
pub mod io;
pub mod metrics;
mod parallel;
pub mod peers;
pub mod photograph;
pub mod photos;
pub mod plan;
pub mod primitives;
pub mod quality;
pub mod report;
pub mod scene;
pub mod select;
pub mod stereo;
pub mod vds;
pub mod visibility;
pub mod vulkan;

pub mod cli;

pub use error::{Error, Result};

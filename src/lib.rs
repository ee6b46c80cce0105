//! camsplat answers one question: where should the cameras be?
//!
//! Given a rough surface of an object or a room, it places N cameras at once by gradient descent, so that a radiance field trained on
//! their photos is as good as it can be. It runs on any Vulkan 1.2 device.
//!
//! ```
//! use camsplat::scene::samples;
//!
//! let surface = samples::object(); // or camsplat::io::read_surface("statue.glb".as_ref())?
//! let plan = camsplat::plan(&surface, 20).up(glam::DVec3::Z).seed(1).run()?;
//! for camera in &plan.record.cameras {
//!     println!("{}: {}", camera.name, camera.pose.position);
//! }
//! let expected = plan.record.expected.as_ref().map_or(0.0, |expected| expected.db);
//! println!("{expected:+.2} dB expected against the best simple layout");
//! # assert_eq!(plan.record.cameras.len(), 20);
//! # assert!(expected >= 0.0);
//! # Ok::<(), camsplat::Error>(())
//! ```
//!
//! [`plan()`] is the front door, and [`PlanRequest`] has its options; [`vulkan::host`] is for applications that own the Vulkan device.
//!
//! The layers look down only: the command line and [`report`] sit on `evaluate`, that on [`baselines`], [`select`] and [`mod@plan`], these on
//! [`vds`], [`photograph`], [`gaussians`], [`stereo`] and [`quality`], then [`metrics`], [`visibility`], [`frames`], [`io`], [`photos`],
//! [`scene`] with [`methods`], [`primitives`] and [`vulkan`].

// What is private is read with `cargo doc --document-private-items`.
#![allow(rustdoc::private_intra_doc_links)]
// Some of it the program alone uses.
#![cfg_attr(not(feature = "cli"), allow(dead_code, unused_imports))]

pub mod baselines;
#[cfg(feature = "capi")]
pub mod capi;
mod error;
#[cfg(feature = "cli")]
pub mod evaluate;
#[cfg(feature = "cli")]
mod export;
pub mod frames;
pub mod gaussians;
pub mod io;
pub mod methods;
pub mod metrics;
mod parallel;
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

#[cfg(feature = "cli")]
pub mod cli;

pub use error::{Error, Result};
pub use plan::request::{PlanRequest, plan};

//! camsplat answers one question: where should the cameras be?
//!
//! Given a rough surface of an object or a room, it places N cameras at once by gradient descent, so that a radiance field trained on
//! their photos is as good as it can be. It runs on any Vulkan 1.2 device.
//!
//! ```
//! use camsplat::scene::samples;
//!
//! let surface = samples::object(); // or camsplat::files::io::read_surface("statue.glb".as_ref())?
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
//! [`plan()`] is the front door, and [`PlanRequest`] has its options; [`engine::vulkan::host`] is for applications that own the Vulkan
//! device.
//!
//! The storeys look down only, from the top: [`app`], `lab` (a feature), [`planner`], [`photogrammetry`], [`splats`], [`visibility`],
//! [`files`], [`scene`], [`engine`].

// What is private is read with `cargo doc --document-private-items`.
#![allow(rustdoc::private_intra_doc_links)]

pub mod app;
pub mod engine;
mod error;
pub mod files;
#[cfg(feature = "lab")]
pub mod lab;
pub mod photogrammetry;
pub mod planner;
pub mod scene;
pub mod splats;
pub mod visibility;

pub use error::{Error, Result};
pub use planner::plan::request::{PlanRequest, plan};

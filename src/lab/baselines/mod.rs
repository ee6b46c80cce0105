//! The methods that a plan is compared with: published ways to place cameras, under the same regions, cameras, scores and
//! files as our own.
//!
//! All but Fibonacci's and [`manifold`] choose from a pool of candidates drawn at random from the region, with what [`crate::planner::select`] chooses
//! photos with.

pub mod job;
pub mod manifold;
pub mod request;

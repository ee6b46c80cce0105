//! The methods that a plan is compared with: published ways to place cameras, under the same regions, cameras, scores and
//! files as our own.
//!
//! All but layouts and [`manifold`] choose from a pool of candidates drawn at random from the region, by the rules that
//! [`crate::planner::select`] chooses photos by.

pub mod manifold;
pub mod placing;
pub mod request;

//! Planning: from a surface and a region to the camera poses that sample it best.

mod aim;
pub(crate) mod binned;
mod buffers;
pub mod config;
pub mod curve;
pub mod dense;
pub mod enough;
pub(crate) mod footprint;
pub mod job;
pub mod links;
pub mod planner;
pub mod preparation;
mod probes;
pub mod record;
pub mod reference;
pub mod relocate;
pub mod replan;
pub(crate) mod request;
pub mod run;
pub mod shared;
pub(crate) mod snapshot;
pub mod start;
pub mod starts;
pub mod tally;
pub mod target;
pub mod update;
pub mod viewed;

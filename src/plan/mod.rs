//! Planning: from a surface and a region to the camera poses that sample it best.

pub mod binned;
mod buffers;
pub mod config;
pub mod curve;
pub mod dense;
pub mod footprint;
pub mod job;
pub mod planner;
pub mod preparation;
mod probes;
pub mod record;
pub mod reference;
pub mod relocate;
pub mod request;
pub mod shared;
pub mod snapshot;
pub mod start;
pub mod starts;
pub mod tally;
pub mod target;
pub mod update;
pub mod viewed;

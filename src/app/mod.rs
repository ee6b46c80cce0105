//! What people and other programs use: the command line, functions for C, reports, and cameras in the formats of other programs.

#[cfg(feature = "capi")]
pub mod capi;
#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "cli")]
mod export;
pub mod report;
#[cfg(feature = "cli")]
mod watch;

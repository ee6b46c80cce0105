//! A whole training run: from a capture to a folder.

pub mod checkpoint;
mod course;
pub(crate) mod evaluate;
pub mod job;
pub(crate) mod products;
pub mod record;

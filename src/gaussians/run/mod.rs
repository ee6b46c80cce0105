//! A whole training run: from a capture to a folder.

pub mod checkpoint;
mod course;
pub mod evaluate;
pub mod job;
pub mod products;
pub mod record;

//! A whole training run: from a capture to a folder.

pub mod checkpoint;
pub mod evaluate;
pub mod job;
pub(crate) mod outputs;
pub mod record;
mod training_loop;

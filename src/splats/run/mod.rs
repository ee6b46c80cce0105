//! A whole training run: from a capture to a folder.

pub mod checkpoint;
pub mod evaluate;
pub(crate) mod outputs;
pub mod record;
pub mod request;
mod training_loop;

//! Expected quality: the predicted quality of splats trained on photographs from a set of cameras, before anything is
//! photographed.

pub mod expected;
pub mod law;
pub mod look;
pub mod map;
pub(crate) mod nearest;
pub mod viewers;

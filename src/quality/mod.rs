//! Expected quality: what splats trained on the photographs of a set of cameras will show, told before anything is
//! photographed.

pub mod expected;
pub mod fit;
pub mod law;
pub mod look;
pub mod map;
pub(crate) mod nearest;
pub mod viewers;

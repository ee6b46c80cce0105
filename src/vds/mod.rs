//! View dependency: how much the radiance of a surface changes with the direction it is seen from.

pub mod fit;
pub mod vdsf;

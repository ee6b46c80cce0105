//! Where the cameras stand: the quality that splats will have, plans that raise it, and choices among photos that exist.

pub mod methods;
pub mod metrics;
pub mod plan;
pub mod quality;
pub mod select;

//! Planning: from a surface and a region to the camera poses that sample it best.

pub mod record;

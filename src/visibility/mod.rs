//! Visibility: the bounding volume hierarchy over the proxy's primitives and rays through it.

pub mod bvh;
pub(crate) mod closing;
pub mod device_scene;
pub(crate) mod exposure;
mod facing;
pub(crate) mod lens_view;
pub mod probe_depth;
pub mod raycast;

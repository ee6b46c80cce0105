//! Who sees what: the bounding volume hierarchy over the proxy's primitives and rays through it.

pub mod bvh;
pub mod closing;
pub mod device_scene;
pub mod exposure;
pub mod lens_view;
pub mod probe_depth;
pub mod raycast;

//! The compute engine: Vulkan driven by explicit command buffers, the primitives that stages are made of, and work over the host's
//! threads. Nothing here knows of cameras or scenes.

pub mod parallel;
pub mod primitives;
pub mod vulkan;

//! Photographs of a scene of triangles with materials and lights, by path tracing on the hierarchy that occlusion uses.
//!
//! [`assembly`] lays a model out for the device, [`lights`] decides where lights are sampled, [`albedo`] has the tables that
//! keep lobes from losing light, [`tracer`] takes the photographs, `metering` exposes them, [`noise`] measures theirs, [`capture`] makes a
//! whole capture of them.
//! `docs/reference/capture.md` lists what is modelled.

pub mod albedo;
pub mod assembly;
pub(crate) mod buffers;
pub mod capture;
pub mod inside;
pub(crate) mod layout;
pub mod lightmap;
pub(crate) mod lights;
pub mod metering;
pub mod noise;
pub mod outputs;
mod pace;
pub mod tracer;

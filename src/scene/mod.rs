//! What is planned for and with: surfaces, the proxy drawn from them, cameras and their conventions, feasible regions.
//!
//! Internal frame: right-handed; cameras in OpenCV axes (X right, Y down, Z forward); poses stored world-from-camera;
//! radians inside, degrees on the command line.

pub(crate) mod bounding_sphere;
pub mod camera;
pub(crate) mod colour;
pub mod connected;
pub mod directions;
mod discs;
mod distance_transform;
pub mod distances;
mod enclosure;
pub mod free_space;
pub mod gaussians;
pub(crate) mod harmonics;
pub mod known;
pub mod layouts;
mod least_spread;
mod legs;

pub mod lens;
pub mod limits;
pub mod model;
pub(crate) mod morton;
pub mod octahedral;
mod orientation;
pub mod planes;
pub mod polygon;
pub mod prism;
pub mod proxy;
pub mod random;
pub mod region;
pub mod samples;
mod sampling;
pub mod sequence;
pub(crate) mod sets;
pub mod sight;
pub mod similarity;
pub mod stray;
pub mod subject;
pub mod surface;
pub mod tour;
pub mod upright;
pub mod volume;
pub mod voxels;
mod walk;

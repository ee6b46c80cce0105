//! What is planned for and with: surfaces, the proxy drawn from them, cameras and their conventions, feasible regions.
//!
//! Internal frame: right-handed; cameras in OpenCV axes (X right, Y down, Z forward); poses stored world-from-camera;
//! radians inside, degrees on the command line.

pub mod camera;
pub mod region;
pub mod surface;

//! Cameras for those who carry a plan out: robots, artists and drones. Cameras come in, texts and bytes of files go out.

pub mod blender;
pub mod check;
pub mod dji;
pub mod flown;
pub mod geojson;
pub mod georeference;
pub mod gltf;
pub mod gps;
pub mod kml;
pub mod litchi;
pub mod mission;
pub mod qgc;
pub mod ros;
pub mod terrain;
pub mod usd;
pub mod written;

use clap::ValueEnum;
use glam::{DQuat, DVec3};

use crate::scene::camera::Camera;
use crate::scene::stray::Reach;

/// What cameras can be written for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// A ROS PoseArray (YAML and JSON).
    Ros,
    /// glTF camera nodes.
    Glb,
    /// A script that makes the cameras in Blender.
    Blender,
    /// USD cameras.
    Usd,
    /// DJI WPML missions (KMZ).
    Dji,
    /// QGroundControl plans.
    Qgc,
    /// Litchi missions (CSV).
    Litchi,
    /// Path and views for Google Earth and others.
    Kml,
    /// Path and places for GIS.
    Geojson,
}

impl Format {
    /// Whether it is of places on Earth.
    pub fn is_geographic(self) -> bool {
        matches!(self, Self::Dji | Self::Qgc | Self::Litchi | Self::Kml | Self::Geojson)
    }
}

/// What cameras are written less where they lie too far from the origin for renderers, which compute in single precision: a whole point amid
/// them; zero where they lie near.
pub fn offset(cameras: &[Camera]) -> DVec3 {
    let reach = reach(cameras);
    if reach.needs_double() { reach.centre.round() } else { DVec3::ZERO }
}

/// Nearest and farthest depth that a renderer draws, in the scene's units, so that scenes of any size are seen whole.
fn clipping(cameras: &[Camera]) -> [f64; 2] {
    [1e-3 * reach(cameras).scale, 1e9]
}

/// Where the cameras lie. Such in one place, but for rounding, say nothing of the scale: theirs is taken to be 10.
fn reach(cameras: &[Camera]) -> Reach {
    let reach = Reach::of(&cameras.iter().map(|camera| camera.pose.position).collect::<Vec<_>>());
    let apart = reach.scale > 1e-9 * (1.0 + reach.centre.abs().max_element());
    Reach { scale: if apart { reach.scale } else { 10.0 }, ..reach }
}

/// The shortest rotation that brings `up` to `axis`.
fn upright(up: DVec3, axis: DVec3) -> DQuat {
    DQuat::from_rotation_arc(up.normalize(), axis)
}

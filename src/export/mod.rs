//! Cameras for those who carry a plan out: robots, artists and drones. Cameras come in, texts and bytes of files go out.

pub mod blender;
pub mod dji;
pub mod geojson;
pub mod georeference;
pub mod gltf;
pub mod gps;
pub mod kml;
pub mod litchi;
pub mod mission;
pub mod qgc;
pub mod ros;
pub mod usd;

use clap::ValueEnum;
use glam::{DQuat, DVec3};

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

/// The shortest rotation that brings `up` to `axis`.
fn upright(up: DVec3, axis: DVec3) -> DQuat {
    DQuat::from_rotation_arc(up.normalize(), axis)
}

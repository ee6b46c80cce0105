//! plan.json: the cameras of a plan that camsplat made before.

use std::path::Path;

use serde::Deserialize;

use super::checks;
use crate::error::{Error, Result};
use crate::scene::camera::Camera;

/// How far rounding leaves the squared length of a rotation from 1.
const ROUNDING: f64 = 1e-14;

/// The part of a plan that is read here.
#[derive(Deserialize)]
struct Plan {
    cameras: Vec<serde_json::Value>,
}

/// Reads the cameras from the bytes of a plan.json, planned ones first, then those kept from before.
///
/// # Errors
/// When the file is no such JSON, or a camera fails the checks that all cameras pass.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Vec<Camera>> {
    let Plan { cameras } = super::json(path, bytes)?;
    let camera = |(i, value): (usize, &serde_json::Value)| {
        Camera::deserialize(value).map_err(|e| {
            let name = value.get("name").and_then(|name| name.as_str()).unwrap_or_default();
            Error::input(path, format!("camera {i} ({name:?}): {}; mend it, or remove it", super::fault(&e)))
        })
    };
    let mut cameras = cameras.iter().enumerate().map(camera).collect::<Result<Vec<Camera>>>()?;
    checks::cameras(path, cameras.iter())?;
    // The checks allow for few digits; code that rotates vectors relies on its unit length. One that was written
    // in full stays as it is, so that a plan's cameras are the same when it is read.
    for camera in &mut cameras {
        let rotation = &mut camera.pose.rotation;
        if (rotation.length_squared() - 1.0).abs() > ROUNDING {
            *rotation = rotation.normalize();
        }
    }
    Ok(cameras)
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::scene::camera::{Intrinsics, Pose};
    use crate::scene::random;

    /// If this failed, a plan could not be extended by a second one, or photographs of it be found again.
    #[test]
    fn cameras_survive_a_round_trip() {
        let camera = |i: u32| {
            let [u, v, w, x] = random::uniforms(3, 0, i);
            Camera {
                name: format!("{i:04}.png"),
                pose: Pose::looking(DVec3::new(u, v, w), random::direction(x, u), DVec3::Y),
                intrinsics: Intrinsics::from_fov(64, 48, 1.0),
            }
        };
        let written: Vec<Camera> = (0..50).map(camera).collect();
        let text = serde_json::json!({ "version": "0", "cameras": written }).to_string();
        assert_eq!(parse(Path::new("plan.json"), text.as_bytes()).unwrap(), written);
        let mut rounded = written.clone();
        for camera in &mut rounded {
            let rotation = camera.pose.rotation.to_array().map(|v| (1e4 * v).round() * 1e-4);
            camera.pose.rotation = DQuat::from_array(rotation);
        }
        let text = serde_json::json!({ "cameras": rounded }).to_string();
        for (read, written) in parse(Path::new("plan.json"), text.as_bytes()).unwrap().iter().zip(&written) {
            let rotation = read.pose.rotation;
            assert!((rotation.length() - 1.0).abs() < 1e-15 && rotation.abs_diff_eq(written.pose.rotation, 2e-4));
        }
    }

    /// If this failed, a plan edited by hand could bring in cameras without size or direction.
    #[test]
    fn cameras_that_cannot_be_are_refused() {
        let text = r#"{"cameras": [{"name": "a", "pose": {"position": [0, 0, 0], "rotation": [0, 0, 0, 0]},
                       "intrinsics": {"width": 1, "height": 1, "focal": [1, 1], "principal": [0, 0]}}]}"#;
        let message = parse(Path::new("plan.json"), text.as_bytes()).unwrap_err().to_string();
        assert!(message.contains("camera 0 (\"a\") has a rotation that is not of unit length"), "{message}");
        let nowhere = text.replace("[0, 0, 0]", "[0, NaN, 0]");
        let message = parse(Path::new("plan.json"), nowhere.as_bytes()).unwrap_err().to_string();
        assert!(message.contains("camera 0 (\"a\"): a value that is no finite number"), "{message}");
    }
}

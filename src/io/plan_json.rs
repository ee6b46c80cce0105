//! plan.json: the cameras of a plan that camsplat made before.

use std::path::Path;

use serde::Deserialize;

use super::checks;
use crate::error::Result;
use crate::scene::camera::Camera;

/// The part of a plan that is read here.
#[derive(Deserialize)]
struct Plan {
    cameras: Vec<Camera>,
}

/// Reads the cameras from the bytes of a plan.json, planned ones first, then those kept from before.
///
/// # Errors
/// When the file is no such JSON, or a camera fails the checks that all cameras pass.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Vec<Camera>> {
    let Plan { mut cameras } = super::json(path, bytes)?;
    checks::cameras(path, cameras.iter())?;
    // The checks allow for few digits; whoever turns vectors with the rotation relies on its unit length.
    for camera in &mut cameras {
        camera.pose.rotation = camera.pose.rotation.normalize();
    }
    Ok(cameras)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::camera::{Intrinsics, Pose};

    /// If this failed, a plan could not be extended by a second one.
    #[test]
    fn cameras_survive_a_round_trip() {
        let written = vec![Camera {
            name: "0000.png".into(),
            pose: Pose::looking(DVec3::new(1.0, 2.0, 3.0), DVec3::NEG_ONE, DVec3::Y),
            intrinsics: Intrinsics::from_fov(64, 48, 1.0),
        }];
        let text = serde_json::json!({ "version": "0", "cameras": written }).to_string();
        let read = parse(Path::new("plan.json"), text.as_bytes()).unwrap();
        assert_eq!((&written[0].name, written[0].intrinsics), (&read[0].name, read[0].intrinsics));
        assert_eq!(written[0].pose.position, read[0].pose.position);
        assert!(written[0].pose.rotation.abs_diff_eq(read[0].pose.rotation, 1e-15));
    }

    /// If this failed, a plan edited by hand could bring in cameras without size or direction.
    #[test]
    fn cameras_that_cannot_be_are_refused() {
        let text = r#"{"cameras": [{"name": "a", "pose": {"position": [0, 0, 0], "rotation": [0, 0, 0, 0]},
                       "intrinsics": {"width": 1, "height": 1, "focal": [1, 1], "principal": [0, 0]}}]}"#;
        let message = parse(Path::new("plan.json"), text.as_bytes()).unwrap_err().to_string();
        assert!(message.contains("camera 0 (\"a\") has a rotation that is not of unit length"), "{message}");
    }
}

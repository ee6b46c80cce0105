//! glTF: a .glb of camera nodes under a root that turns the scene's up to +Y, as glTF has it.
//!
//! Far away from the origin, where readers' single precision would move the cameras, the root carries a whole offset and the cameras stand
//! where they are less that. glTF cameras have a vertical field of view and an aspect ratio; a principal point beside the middle of the
//! image is left out.

use glam::{DMat3, DQuat, DVec3};
use serde_json::{Value, json};

use super::{clipping, offset, upright};
use crate::scene::camera::Camera;
use crate::{Error, Result};

/// Bytes of the .glb; `up` is the scene's.
///
/// # Errors
/// Never in practice: where the numbers cannot be written.
pub fn glb(cameras: &[Camera], up: DVec3) -> Result<Vec<u8>> {
    let [near, _] = clipping(cameras);
    let (offset, turn) = (offset(cameras), upright(up, DVec3::Y));
    let lens = |camera: &Camera| {
        let k = &camera.intrinsics;
        let (width, height) = (f64::from(k.width), f64::from(k.height));
        let perspective = json!({
            "aspectRatio": (width / k.focal[0]) / (height / k.focal[1]),
            "yfov": 2.0 * (0.5 * height / k.focal[1]).atan(),
            "znear": near
        });
        json!({ "name": camera.name, "type": "perspective", "perspective": perspective })
    };
    let node = |(i, camera): (usize, &Camera)| {
        let (position, rotation) = (camera.pose.position - offset, backward(camera.pose.rotation));
        json!({ "name": camera.name, "camera": i, "translation": position.to_array(), "rotation": rotation.to_array() })
    };
    let mut nodes: Vec<Value> = cameras.iter().enumerate().map(node).collect();
    let children: Vec<usize> = (0..nodes.len()).collect();
    let root = nodes.len();
    let [translation, rotation] = [json!((turn * offset).to_array()), json!(turn.to_array())];
    nodes.push(json!({ "name": "cameras", "translation": translation, "rotation": rotation, "children": children }));
    let document = json!({
        "asset": { "version": "2.0", "generator": concat!("camsplat ", env!("CARGO_PKG_VERSION")) },
        "scene": 0,
        "scenes": [{ "nodes": [root] }],
        "nodes": nodes,
        "cameras": cameras.iter().map(lens).collect::<Vec<_>>()
    });
    let mut text =
        serde_json::to_vec(&document).map_err(|e| Error::request(format!("the cameras cannot be written: {e}")))?;
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = |bytes: usize| {
        u32::try_from(bytes).map(u32::to_le_bytes).map_err(|_| Error::request("there are too many cameras for a .glb"))
    };
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend(length(20 + text.len())?);
    bytes.extend(length(text.len())?);
    bytes.extend(b"JSON");
    bytes.extend(text);
    Ok(bytes)
}

/// A rotation from OpenCV's camera axes (Y down, Z forward) as one from OpenGL's (Y up, Z backward).
pub(super) fn backward(rotation: DQuat) -> DQuat {
    (rotation * DQuat::from_mat3(&DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)))).normalize()
}

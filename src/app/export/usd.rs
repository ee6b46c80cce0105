//! USD: cameras as text (.usda), under a transform that turns the scene's up to +Z.

use std::fmt::Write;

use glam::{DMat3, DVec3};

use super::gltf::backward;
use super::{clipping, upright};
use crate::scene::camera::Camera;

/// Width of a camera's sensor; with the focal length it is in tenths of a unit of the scene, and only their ratio shows.
const SENSOR: f64 = 36.0;

/// Text of the .usda; `up` is the scene's. The principal point is kept; a unit of the scene is said to be a metre.
pub fn usda(cameras: &[Camera], up: DVec3) -> String {
    let mut text = String::from(
        "#usda 1.0\n(\n    defaultPrim = \"cameras\"\n    metersPerUnit = 1\n    upAxis = \"Z\"\n)\n\n\
         def Xform \"cameras\"\n{\n",
    );
    let root = matrix(DMat3::from_quat(upright(up, DVec3::Z)), DVec3::ZERO);
    // Writing to a string cannot fail.
    let _ = writeln!(text, "    matrix4d xformOp:transform = {root}");
    let _ = writeln!(text, "    uniform token[] xformOpOrder = [\"xformOp:transform\"]");
    let [near, far] = clipping(cameras);
    for (i, camera) in cameras.iter().enumerate() {
        let k = &camera.intrinsics;
        let (w, h) = (f64::from(k.width), f64::from(k.height));
        let focal = SENSOR * k.focal[0] / w;
        let height = focal * h / k.focal[1];
        let pose = matrix(DMat3::from_quat(backward(camera.pose.rotation)), camera.pose.position);
        let _ = write!(
            text,
            "\n    def Camera \"camera_{i:04}\" (\n        displayName = {}\n    )\n    {{\n        \
             float2 clippingRange = ({near:?}, {far:?})\n        float focalLength = {focal:?}\n        \
             float horizontalAperture = {SENSOR:?}\n        float verticalAperture = {height:?}\n        \
             float horizontalApertureOffset = {:?}\n        float verticalApertureOffset = {:?}\n        \
             matrix4d xformOp:transform = {pose}\n        \
             uniform token[] xformOpOrder = [\"xformOp:transform\"]\n    }}\n",
            serde_json::Value::from(camera.name.as_str()),
            (0.5 * w - k.principal[0]) / w * SENSOR,
            (k.principal[1] - 0.5 * h) / h * height,
        );
    }
    text + "}\n"
}

/// A transform as USD has it: rows of vectors that are multiplied from the left.
fn matrix(rotation: DMat3, position: DVec3) -> String {
    let row = |v: DVec3, last: f64| format!("({:?}, {:?}, {:?}, {last:?})", v.x, v.y, v.z);
    let [x, y, z] = [0, 1, 2].map(|i| row(rotation.col(i), 0.0));
    format!("( {x}, {y}, {z}, {} )", row(position, 1.0))
}

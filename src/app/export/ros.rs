//! ROS: a `geometry_msgs/PoseArray`, as YAML for `ros2 topic pub` and as JSON.
//!
//! Poses are those of the optical frame (REP 103: Z forward, X right, Y down), which is this program's own; lengths are the scene's.

use std::fmt::Write;

use serde::Serialize;

use crate::scene::camera::Camera;
use crate::{Error, Result};

#[derive(Serialize)]
struct PoseArray<'a> {
    header: Header<'a>,
    poses: Vec<Pose>,
}

#[derive(Serialize)]
struct Header<'a> {
    stamp: Stamp,
    frame_id: &'a str,
}

#[derive(Serialize)]
struct Stamp {
    sec: i32,
    nanosec: u32,
}

#[derive(Serialize)]
struct Pose {
    position: Vector,
    orientation: Quaternion,
}

#[derive(Serialize)]
struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Serialize)]
struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

fn pose(camera: &Camera) -> Pose {
    let (p, q) = (camera.pose.position, camera.pose.rotation);
    Pose { position: Vector { x: p.x, y: p.y, z: p.z }, orientation: Quaternion { x: q.x, y: q.y, z: q.z, w: q.w } }
}

/// The message as JSON; `frame` is the frame that poses are in.
///
/// # Errors
/// Never in practice: where the numbers cannot be written.
pub fn json(cameras: &[Camera], frame: &str) -> Result<String> {
    let header = Header { stamp: Stamp { sec: 0, nanosec: 0 }, frame_id: frame };
    let message = PoseArray { header, poses: cameras.iter().map(pose).collect() };
    serde_json::to_string_pretty(&message).map_err(|e| Error::request(format!("the poses cannot be written: {e}")))
}

/// The message as YAML; `frame` is the frame that poses are in.
pub fn yaml(cameras: &[Camera], frame: &str) -> String {
    let mut text = format!(
        "# geometry_msgs/PoseArray; optical frames: Z forward, X right, Y down\n\
         header:\n  stamp: {{sec: 0, nanosec: 0}}\n  frame_id: {}\nposes:\n",
        serde_json::Value::from(frame)
    );
    for camera in cameras {
        let Pose { position: p, orientation: q } = pose(camera);
        // Writing to a string cannot fail. YAML knows numbers with a point only as such.
        let _ = writeln!(text, "- position: {{x: {:?}, y: {:?}, z: {:?}}}", p.x, p.y, p.z);
        let _ = writeln!(text, "  orientation: {{x: {:?}, y: {:?}, z: {:?}, w: {:?}}}", q.x, q.y, q.z, q.w);
    }
    text
}

//! Blender: a script that makes a camera for every view and binds each to a frame of the timeline, so that rendering the animation takes
//! all photos.

use glam::DVec3;
use serde_json::json;

use super::gltf::backward;
use super::{clipping, offset, upright};
use crate::scene::camera::Camera;

/// Text of the script, for Blender 2.93 and later; `up` is the scene's, which becomes Blender's +Z. Positions are less [`offset`], which the
/// script says. Where cameras differ in image size the first one's counts, and pixels are taken to be square.
pub fn script(cameras: &[Camera], up: DVec3) -> String {
    let (turn, offset, [near, far]) = (upright(up, DVec3::Z), offset(cameras), clipping(cameras));
    let rows: Vec<String> = cameras
        .iter()
        .map(|camera| {
            let k = &camera.intrinsics;
            let (w, h) = (f64::from(k.width), f64::from(k.height));
            let (p, q) = (turn * (camera.pose.position - offset), (turn * backward(camera.pose.rotation)).normalize());
            let longer = w.max(h);
            let lens = 36.0 * k.focal[0] / longer;
            let shift = [(0.5 * w - k.principal[0]) / longer, (k.principal[1] - 0.5 * h) / longer];
            json!([camera.name, p.to_array(), [q.w, q.x, q.y, q.z], lens, shift]).to_string()
        })
        .collect();
    let moved = match offset == DVec3::ZERO {
        true => String::new(),
        false => format!(
            "# Blender computes in single precision: the cameras stand where they are less ({}, {}, {}). Move the surface likewise.\n",
            offset.x, offset.y, offset.z
        ),
    };
    let [width, height] =
        cameras.first().map_or([800, 600], |camera| [camera.intrinsics.width, camera.intrinsics.height]);
    format!(
        r#"# Makes the planned cameras: open it in Blender's text editor and run it.
# Frame i of the timeline is camera i: Render > Render Animation takes all photos.
{moved}import bpy

# Name, position, quaternion (w, x, y, z), focal length in millimetres of a 36 mm sensor, shift.
CAMERAS = [
    {}
]

scene = bpy.context.scene
collection = bpy.data.collections.new("camsplat")
scene.collection.children.link(collection)
scene.render.resolution_x, scene.render.resolution_y = {width}, {height}
scene.render.resolution_percentage = 100
scene.frame_start, scene.frame_end = 0, len(CAMERAS) - 1
for frame, (name, position, rotation, lens, shift) in enumerate(CAMERAS):
    data = bpy.data.cameras.new(name)
    data.sensor_fit, data.sensor_width, data.lens = "AUTO", 36.0, lens
    data.shift_x, data.shift_y = shift
    data.clip_start, data.clip_end = {near:?}, {far:?}
    camera = bpy.data.objects.new(name, data)
    camera.rotation_mode = "QUATERNION"
    camera.location, camera.rotation_quaternion = position, rotation
    collection.objects.link(camera)
    scene.timeline_markers.new(name, frame=frame).camera = camera
    if frame == 0:
        scene.camera = camera
"#,
        rows.join(",\n    ")
    )
}

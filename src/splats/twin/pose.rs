//! The gradient by the camera's pose.

use glam::DVec3;

use super::{Rules, Splat, View, composite, project, project_all};

/// The gradient of a function of the picture by the camera's pose, from that by the colour of every pixel: by a turn of the camera about
/// its own place (a rotation vector in world axes, at none) and by its place in the world. Pictures stay as they are where camera and splats
/// turn and move together, harmonics too, so that these are the sums over splats of what turning and moving each would change, negated.
pub fn by_pose(splats: &[Splat], view: &View, rules: &Rules, background: DVec3, by_colour: &[DVec3]) -> [DVec3; 2] {
    let projected = project_all(splats, view, rules);
    let by_projected = composite::backward(&projected, view, rules, background, by_colour);
    let (mut turn, mut shift) = (DVec3::ZERO, DVec3::ZERO);
    for (splat, by) in splats.iter().zip(&by_projected) {
        shift -= project::backward(splat, view, rules, by).centre;
        // What is seen of the harmonics does not change with a turn about the camera.
        let still = project::backward(splat, view, rules, &project::Gradient { colour: DVec3::ZERO, ..*by });
        turn -= (splat.centre - view.centre()).cross(still.centre) + by_turn(splat.rotation, still.rotation);
    }
    [turn, shift]
}

/// The gradient by a rotation vector that the quaternion q = (w, v) is turned by from the left, from that by its components: for a small
/// vector r, q becomes q + (-r.v, w r + r x v) / 2.
fn by_turn([w, x, y, z]: [f64; 4], [by_w, by_x, by_y, by_z]: [f64; 4]) -> DVec3 {
    let (v, by_v) = (DVec3::new(x, y, z), DVec3::new(by_x, by_y, by_z));
    0.5 * (w * by_v - by_w * v + v.cross(by_v))
}

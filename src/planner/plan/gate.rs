//! When a point counts as in a camera's picture (`planner/plan/gate.glsl`), and the twin in float64.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::engine::vulkan::shaders::glsl::planner::plan::gate as glsl;

/// How a camera's field of view is tested while optimising. Metrics always use the hard gate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum Gate {
    /// The cone inscribed in the image, yes or no (the paper).
    Hard = glsl::HARD_CONE as isize,
    /// The same cone with a soft edge, so that directions get a gradient.
    Soft = glsl::SOFT_CONE as isize,
    /// The rectangular image itself, with a soft edge and a roll that keeps the image upright.
    Pinhole = glsl::SOFT_FRUSTUM as isize,
    /// The rectangular image, yes or no.
    PinholeHard = glsl::HARD_FRUSTUM as isize,
}

impl Gate {
    /// Whether the edge is soft.
    pub fn soft(self) -> bool {
        matches!(self, Self::Soft | Self::Pinhole)
    }

    /// Whether the rectangular image is tested.
    pub fn pinhole(self) -> bool {
        matches!(self, Self::Pinhole | Self::PinholeHard)
    }
}

/// The twin of `gate`: how open the gate of a camera is that looks along `r`, with these tangents of half its fields of view, and the
/// gradients of its logarithm by the unit direction `v` from the camera to the point and by the camera's viewing direction.
pub fn gate(kind: Gate, softness: f64, [tan_x, tan_y]: [f64; 2], v: DVec3, r: DVec3) -> (f64, DVec3, DVec3) {
    let sigmoid = |x: f64| 1.0 / (1.0 + (-x).exp());
    let hard = |margin: f64| (if margin >= 0.0 { 1.0 } else { 0.0 }, DVec3::ZERO, DVec3::ZERO);
    if !kind.pinhole() {
        let margin = r.dot(v) - 1.0 / tan_x.min(tan_y).hypot(1.0);
        if !kind.soft() {
            return hard(margin);
        }
        let open = sigmoid(margin / softness);
        let slope = (1.0 - open) / softness;
        return (open, slope * r, slope * v);
    }
    let side = r.cross(DVec3::Z);
    let k = side.length();
    let x_axis = if k > 1e-4 { side / k } else { DVec3::X };
    let y_axis = r.cross(x_axis);
    let (x, y, z) = (v.dot(x_axis), v.dot(y_axis), v.dot(r));
    let (norm_x, norm_y) = (1.0 / tan_x.hypot(1.0), 1.0 / tan_y.hypot(1.0));
    let (margin_x, margin_y) = ((tan_x * z - x.abs()) * norm_x, (tan_y * z - y.abs()) * norm_y);
    if !kind.soft() {
        return hard(margin_x.min(margin_y));
    }
    let (open_x, open_y) = (sigmoid(margin_x / softness), sigmoid(margin_y / softness));
    let (slope_x, slope_y) = (norm_x * (1.0 - open_x) / softness, norm_y * (1.0 - open_y) / softness);
    let (by_x, by_y) = (-x.signum() * slope_x, -y.signum() * slope_y);
    let by_z = tan_x * slope_x + tan_y * slope_y;
    let turn = by_x * v + by_y * v.cross(r);
    let turn = turn - turn.dot(x_axis) * x_axis;
    let by_direction = by_z * v + by_y * x_axis.cross(v) + DVec3::Z.cross(turn) / k.max(1e-4);
    (open_x * open_y, by_x * x_axis + by_y * y_axis + by_z * r, by_direction)
}

/// Tangents of half the fields of view (horizontal, vertical) of camera `j` of a list whose last applies to all that follow.
pub(crate) fn tangents_of(tangents: &[[f64; 2]], j: usize) -> [f64; 2] {
    tangents.get(j).or(tangents.last()).copied().unwrap_or([1.0; 2])
}

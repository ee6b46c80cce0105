//! Feasible regions: where a camera may stand.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// The shape a camera must stay in, in world units; a clearance around the surface may be cut out of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// Between two concentric spheres.
    Shell {
        /// Centre of both spheres.
        centre: DVec3,
        /// Smallest distance from the centre.
        r_min: f64,
        /// Largest distance from the centre.
        r_max: f64,
    },
    /// An axis-aligned box.
    Box {
        /// Lowest corner.
        min: DVec3,
        /// Highest corner.
        max: DVec3,
    },
}

/// A shape, an optional floor plane and the clearance that cameras keep from the surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Region {
    /// The shape.
    pub shape: Shape,
    /// Unit up direction of the scene.
    pub up: DVec3,
    /// Cameras stay at or above this height along `up`, where given.
    pub floor: Option<f64>,
    /// No camera stands closer than this to the surface.
    pub clearance: f64,
}

impl Region {
    /// Centre and radius of the shape's bounding sphere: the unit of length inside the planner.
    pub fn bounding_sphere(&self) -> (DVec3, f64) {
        match self.shape {
            Shape::Shell { centre, r_max, .. } => (centre, r_max),
            Shape::Box { min, max } => (0.5 * (min + max), 0.5 * (max - min).length()),
        }
    }
}

//! Closed volumes.

use std::f64::consts::TAU;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::distances::leg_to_triangle;
use super::proxy::Occluder;
use super::voxels::{Grid, enclosed, touched};

/// Corners of a triangle.
pub type Triangle = [DVec3; 3];

/// A closed volume: one that cameras and viewers keep out of, or what is to be seen.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Volume {
    /// The file that it is from; empty where it is from none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub file: String,
    /// Where the scene lies on Earth, as it was given, where the volume is over areas there; else empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub geo: String,
    /// Outlines of those areas: corners in degrees east and north, the first one not repeated at the end.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub areas: Vec<Vec<[f64; 2]>>,
    /// How near to it is kept out too: what positions may be off by.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub margin: f64,
    /// Its faces.
    #[serde(default)]
    pub triangles: Vec<Triangle>,
    /// Of a subject that is a part of the surface the numbers of its triangles there, in place of faces: from one up to another without it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub part: Vec<[usize; 2]>,
}

fn is_zero(margin: &f64) -> bool {
    *margin == 0.0
}

impl Volume {
    /// Whether a point is inside, or in the margin: by the solid angles of the faces, which add up to a whole turn and more around a point
    /// inside of a closed mesh.
    pub fn holds(&self, p: DVec3) -> bool {
        let angle = |corners: &Triangle| {
            let [a, b, c] = corners.map(|corner| corner - p);
            let [la, lb, lc] = [a, b, c].map(DVec3::length);
            let around = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            2.0 * a.dot(b.cross(c)).atan2(around)
        };
        let near = |corners: &Triangle| leg_to_triangle(p, p, corners) <= self.margin;
        self.triangles.iter().map(angle).sum::<f64>().abs() > TAU
            || self.margin > 0.0 && self.triangles.iter().any(near)
    }

    /// Marks the voxels that it touches or holds, or that reach into its margin.
    pub(super) fn fill(&self, grid: &Grid, marked: &mut [bool]) {
        let on = touched(grid, &Occluder::Triangles(self.triangles.clone()));
        let within = enclosed(grid, &self.triangles);
        for (marked, (on, within)) in marked.iter_mut().zip(on.into_iter().zip(within)) {
            *marked |= on | within;
        }
        if self.margin == 0.0 {
            return;
        }
        let reach = self.margin + 0.5 * 3f64.sqrt() * grid.cell;
        for corners in &self.triangles {
            let [a, b, c] = *corners;
            for i in grid.overlapping(a.min(b).min(c) - reach, a.max(b).max(c) + reach) {
                let centre = grid.centre(grid.coordinates(i));
                marked[i] = marked[i] || leg_to_triangle(centre, centre, corners) <= reach;
            }
        }
    }
}

/// The triangles of an axis-aligned box.
pub(crate) fn box_triangles(min: DVec3, max: DVec3) -> Vec<Triangle> {
    let corner = |bits: usize| {
        DVec3::new(
            if bits & 1 == 0 { min.x } else { max.x },
            if bits & 2 == 0 { min.y } else { max.y },
            if bits & 4 == 0 { min.z } else { max.z },
        )
    };
    // Each face by its corners, outward.
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let halves = |[a, b, c, d]: [usize; 4]| [[a, b, c], [a, c, d]];
    faces.into_iter().flat_map(halves).map(|triangle| triangle.map(corner)).collect()
}

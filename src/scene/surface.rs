//! A surface as a file holds it, before anything is derived from it.

use glam::DVec3;

/// A surface read from a file, in the file's own frame and units.
#[derive(Clone, Debug, PartialEq)]
pub enum Surface {
    /// A mesh of triangles.
    Mesh(Mesh),
    /// Points without connectivity: a scan, a sparse model, the centres of a trained splat.
    Points(Points),
}

/// Triangles with optional attributes per vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions.
    pub positions: Vec<DVec3>,
    /// Vertex indices of each triangle, counter-clockwise from outside; always within `positions`.
    pub triangles: Vec<[u32; 3]>,
    /// Colour per triangle, 8-bit sRGB; empty, or as long as `triangles`.
    pub colours: Vec<[u8; 3]>,
    /// View dependency score per vertex in [1, 2]; empty, or as long as `positions`.
    pub scores: Vec<f32>,
}

/// Points with optional attributes; each attribute is empty or as long as `positions`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// Positions in the world.
    pub positions: Vec<DVec3>,
    /// Unit normals (zero where a file gives none for that point).
    pub normals: Vec<DVec3>,
    /// Radius of the disc that represents the point, in the file's units.
    pub radii: Vec<f32>,
    /// 8-bit sRGB colours.
    pub colours: Vec<[u8; 3]>,
    /// View dependency scores in [1, 2].
    pub scores: Vec<f32>,
    /// Variance of each point's luma (linear, in [0, 1]) over directions: what scores are made of.
    pub variances: Vec<f32>,
    /// Whether the normals' sign can be trusted (from a scan with normals or a reconstruction's cameras, not from the
    /// shape of a splat).
    pub oriented: bool,
    /// Mean direction from each point to the cameras that saw it (unit length, zero where unknown).
    pub toward_cameras: Vec<DVec3>,
}

impl Mesh {
    /// The area of all triangles.
    pub fn area(&self) -> f64 {
        let corners = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|i| self.positions.get(i as usize).copied());
            Some((b? - a?).cross(c? - a?).length())
        };
        0.5 * self.triangles.iter().filter_map(corners).sum::<f64>()
    }
}

impl Points {
    /// The points that `keep`, which is as long, selects.
    pub fn filtered(self, keep: &[bool]) -> Self {
        fn kept<T>(values: Vec<T>, keep: &[bool]) -> Vec<T> {
            values.into_iter().zip(keep).filter(|(_, keep)| **keep).map(|(value, _)| value).collect()
        }
        Self {
            positions: kept(self.positions, keep),
            normals: kept(self.normals, keep),
            radii: kept(self.radii, keep),
            colours: kept(self.colours, keep),
            scores: kept(self.scores, keep),
            variances: kept(self.variances, keep),
            oriented: self.oriented,
            toward_cameras: kept(self.toward_cameras, keep),
        }
    }
}

impl Surface {
    /// Number of points, or of vertices.
    pub fn positions(&self) -> &[DVec3] {
        match self {
            Self::Mesh(mesh) => &mesh.positions,
            Self::Points(points) => &points.positions,
        }
    }

    /// Digits after the point that say where something is in its frame.
    pub fn digits(&self) -> usize {
        let (low, high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let grown = |(low, high): (DVec3, DVec3), p: &DVec3| (low.min(*p), high.max(*p));
        let (low, high) = self.positions().iter().fold((low, high), grown);
        digits((high - low).max_element())
    }
}

/// Digits after the point with which a length is said to a part in a hundred at least: three, and more of a tiny one.
pub fn digits(length: f64) -> usize {
    if length == 0.0 {
        return 3;
    }
    (2.0 - length.abs().log10().floor()).clamp(3.0, 9.0) as usize
}

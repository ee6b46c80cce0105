//! The proxy: what blocks rays, and where point cameras are drawn from.

use glam::DVec3;

pub use super::discs::Disc;
pub use super::orientation::Orientation;
use super::similarity::Similarity;
use super::surface::{Mesh, Surface};
use super::{bounding_sphere, discs, orientation};
use crate::{Error, Result};

/// The primitives that block rays, in one frame. Both sides block.
#[derive(Clone, Debug, PartialEq)]
pub enum Occluder {
    /// Triangles of non-zero area, counter-clockwise from the visible side.
    Triangles(Vec<[DVec3; 3]>),
    /// Discs of a point cloud.
    Discs(Vec<Disc>),
}

impl Occluder {
    /// Number of primitives.
    pub fn len(&self) -> usize {
        match self {
            Self::Triangles(triangles) => triangles.len(),
            Self::Discs(discs) => discs.len(),
        }
    }

    /// Whether nothing blocks anything.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The same primitives in another frame.
    pub fn transformed(&self, similarity: &Similarity) -> Self {
        match self {
            Self::Triangles(triangles) => {
                Self::Triangles(triangles.iter().map(|corners| corners.map(|p| similarity.point(p))).collect())
            }
            Self::Discs(discs) => Self::Discs(
                discs
                    .iter()
                    .map(|disc| Disc {
                        centre: similarity.point(disc.centre),
                        normal: similarity.direction(disc.normal),
                        radius: similarity.length(disc.radius),
                    })
                    .collect(),
            ),
        }
    }

    /// Lowest and highest corner of primitive `index`.
    pub fn primitive_bounds(&self, index: usize) -> (DVec3, DVec3) {
        match self {
            Self::Triangles(triangles) => {
                let [a, b, c] = triangles[index];
                (a.min(b).min(c), a.max(b).max(c))
            }
            Self::Discs(discs) => {
                let disc = discs[index];
                // The extent along an axis is the radius times the sine of the normal's angle to it.
                let extent = disc.radius * (DVec3::ONE - disc.normal * disc.normal).max(DVec3::ZERO).map(f64::sqrt);
                (disc.centre - extent, disc.centre + extent)
            }
        }
    }
}

/// A point of the proxy surface: the place of a point camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position in the proxy's frame.
    pub position: DVec3,
    /// Unit normal toward the visible side.
    pub normal: DVec3,
    /// Radius of the disc whose area is this point's share of the surface.
    pub radius: f64,
    /// How far to step off the surface along the normal before casting rays: 1e-4 of the scene's radius on triangles; the
    /// disc's own radius on discs, whose neighbours overlap them at slightly different tilts and would block everything.
    pub lift: f64,
    /// 8-bit sRGB colour.
    pub colour: [u8; 3],
    /// View dependency score in [1, 2].
    pub score: f32,
    /// Whether the surface leaves it open which side is the visible one, as an open part of a mesh does.
    pub either_side: bool,
}

/// Lift off triangles as a fraction of the proxy's bounding radius.
const TRIANGLE_LIFT: f64 = 1e-4;
/// Colour of surfaces that have none.
const GREY: [u8; 3] = [128; 3];

/// The proxy surface in the frame of the surface it was made from.
#[derive(Clone, Debug)]
pub struct Proxy {
    /// What blocks rays.
    pub occluder: Occluder,
    /// Degenerate triangles or outlying points that were left out.
    pub dropped: usize,
    /// Points that were left out because they lie far away from all others; see [`super::stray`].
    pub stray: usize,
    /// Points that were left out because others stand for them: duplicates, and the excess of a very dense cloud.
    pub thinned: usize,
    /// Centre and radius of the bounding sphere of the vertices or disc centres; of the subject's alone, where there is one.
    pub sphere: (DVec3, f64),
    /// Primitives from which no point is drawn, because nothing outside can see them, they are only assumed, or they are no part of the
    /// subject; empty where none is.
    pub buried: Vec<bool>,
    /// How many discs, the last ones, are only assumed.
    pub assumed: usize,
    /// Colour per primitive.
    pub(super) colours: Vec<[u8; 3]>,
    /// View dependency score at the corners of each primitive (a disc has one, three times).
    pub(super) scores: Vec<[f32; 3]>,
    /// Primitives whose visible side may be either; empty where none's is.
    pub(super) either_side: Vec<bool>,
}

impl Proxy {
    /// The proxy of a surface.
    ///
    /// Triangles without area are dropped. Where the orientation is known, closed parts of a mesh that are inside out are
    /// turned; open parts keep their winding. Points become discs: missing normals and radii come from their
    /// neighbours, outliers and strays are dropped, dense clouds are thinned to at most 200,000 discs, in a spatially coherent order.
    ///
    /// # Errors
    /// [`Error::Request`] where the surface holds numbers that are not finite, attributes of the wrong length, no triangle
    /// with an area, or fewer than four distinct points.
    pub fn new(surface: &Surface, orientation: Orientation) -> Result<Self> {
        let bad = surface.positions().iter().filter(|p| !p.is_finite()).count();
        if bad > 0 {
            let all = surface.positions().len();
            return Err(Error::request(format!("surface: {bad} of {all} positions are not finite; remove them")));
        }
        match surface {
            Surface::Mesh(mesh) => Self::from_mesh(mesh, orientation),
            Surface::Points(points) => {
                let cloud = discs::from_points(points, orientation)?;
                let attribute = |i: &usize| points.scores.get(*i).copied().unwrap_or(1.0);
                Ok(Self {
                    sphere: sphere_around(&cloud.discs.iter().map(|disc| disc.centre).collect::<Vec<_>>()),
                    dropped: cloud.outliers,
                    stray: cloud.stray,
                    thinned: points.positions.len() - cloud.stray - cloud.outliers - cloud.discs.len(),
                    colours: cloud.source.iter().map(|i| points.colours.get(*i).copied().unwrap_or(GREY)).collect(),
                    scores: cloud.source.iter().map(|i| [attribute(i); 3]).collect(),
                    occluder: Occluder::Discs(cloud.discs),
                    buried: Vec::new(),
                    assumed: 0,
                    either_side: Vec::new(),
                })
            }
        }
    }

    fn from_mesh(mesh: &Mesh, orientation: Orientation) -> Result<Self> {
        let vertices = mesh.positions.len();
        if let Some(bad) = mesh.triangles.iter().position(|t| t.iter().any(|v| *v as usize >= vertices)) {
            return Err(Error::request(format!(
                "mesh: triangle {bad} refers to a vertex beyond the {vertices} there are"
            )));
        }
        for (what, length, wanted) in
            [("colours", mesh.colours.len(), mesh.triangles.len()), ("scores", mesh.scores.len(), vertices)]
        {
            if length != 0 && length != wanted {
                return Err(Error::request(format!(
                    "mesh: {length} {what} where {wanted} are needed; give all or none"
                )));
            }
        }
        let corners = |t: &[u32; 3]| t.map(|v| mesh.positions[v as usize]);
        let kept: Vec<usize> = (0..mesh.triangles.len()).filter(|i| has_area(&corners(&mesh.triangles[*i]))).collect();
        if kept.is_empty() {
            return Err(Error::request(
                "mesh: no triangle has an area; give a surface with faces, or its points as a cloud",
            ));
        }
        let mut triangles: Vec<[DVec3; 3]> = kept.iter().map(|i| corners(&mesh.triangles[*i])).collect();
        let mut scores: Vec<[f32; 3]> = kept
            .iter()
            .map(|i| mesh.triangles[*i].map(|v| mesh.scores.get(v as usize).copied().unwrap_or(1.0)))
            .collect();
        let sides = orientation::sides(&triangles, orientation);
        for i in sides.inside_out {
            triangles[i].swap(1, 2);
            scores[i].swap(1, 2);
        }
        Ok(Self {
            sphere: sphere_around(&triangles.iter().flatten().copied().collect::<Vec<_>>()),
            dropped: mesh.triangles.len() - kept.len(),
            stray: 0,
            thinned: 0,
            colours: kept.iter().map(|i| mesh.colours.get(*i).copied().unwrap_or(GREY)).collect(),
            scores,
            occluder: Occluder::Triangles(triangles),
            buried: Vec::new(),
            assumed: 0,
            either_side: sides.either,
        })
    }

    /// Adds discs to those there are, which block rays as these do, but from which no point is drawn.
    pub fn assume(&mut self, assumed: Vec<Disc>) {
        let Occluder::Discs(discs) = &mut self.occluder else { return };
        let all = discs.len() + assumed.len();
        self.buried.resize(discs.len(), false);
        self.buried.resize(all, true);
        self.colours.resize(all, GREY);
        self.scores.resize(all, [1.0; 3]);
        self.assumed += assumed.len();
        discs.extend(assumed);
    }

    /// Takes away what [`Self::assume`] added.
    pub fn forget_assumed(&mut self) {
        let Occluder::Discs(discs) = &mut self.occluder else { return };
        discs.truncate(discs.len() - std::mem::take(&mut self.assumed));
        self.buried.truncate(discs.len());
        self.colours.truncate(discs.len());
        self.scores.truncate(discs.len());
    }

    /// 8-bit sRGB colour of each primitive.
    pub fn colours(&self) -> &[[u8; 3]] {
        &self.colours
    }

    /// Lowest and highest corner of the primitives.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        (0..self.occluder.len())
            .map(|i| self.occluder.primitive_bounds(i))
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), (lo, hi)| (min.min(lo), max.max(hi)))
    }

    /// Bounds that stray points do not move: for discs the 0.5th to 99.5th percentile of the centres along each axis, for
    /// triangles the bounds themselves.
    pub fn robust_bounds(&self) -> (DVec3, DVec3) {
        let Occluder::Discs(discs) = &self.occluder else { return self.bounds() };
        let known = &discs[..discs.len() - self.assumed];
        let percentiles = |axis: usize| {
            let mut values: Vec<f64> = known.iter().map(|disc| disc.centre[axis]).collect();
            values.sort_unstable_by(f64::total_cmp);
            let cut = values.len() / 200;
            (values[cut], values[values.len() - 1 - cut])
        };
        let [x, y, z] = [percentiles(0), percentiles(1), percentiles(2)];
        (DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1))
    }

    /// Lift off the surface at primitive `index`; see [`SurfacePoint::lift`].
    pub(super) fn lift(&self, index: usize) -> f64 {
        match &self.occluder {
            Occluder::Triangles(_) => TRIANGLE_LIFT * self.sphere.1,
            Occluder::Discs(discs) => discs[index].radius,
        }
    }
}

/// Whether a triangle is more than a line: its height is over 1e-9 of its longest edge.
fn has_area(&[a, b, c]: &[DVec3; 3]) -> bool {
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    (b - a).cross(c - a).length() > 1e-9 * longest
}

/// The bounding sphere; callers have made sure that there are points.
fn sphere_around(points: &[DVec3]) -> (DVec3, f64) {
    bounding_sphere::bounding_sphere(points).unwrap_or((DVec3::ZERO, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::samples;

    fn mesh() -> Mesh {
        match samples::cube() {
            Surface::Mesh(mesh) => mesh,
            Surface::Points(_) => unreachable!(),
        }
    }

    /// A degenerate triangle has no normal: a point camera there would look along NaN.
    #[test]
    fn triangles_without_area_are_dropped_and_counted() {
        let mut mesh = mesh();
        let whole = mesh.triangles.len();
        mesh.positions.push(DVec3::new(0.5, 0.5, 0.5));
        mesh.positions.push(DVec3::new(0.0, 0.0, 0.5));
        let spare = mesh.positions.len() as u32 - 2;
        mesh.triangles.push([0, 0, 1]);
        mesh.triangles.push([spare, spare, spare]);
        mesh.colours.clear();
        mesh.scores.clear();
        let proxy = Proxy::new(&Surface::Mesh(mesh), Orientation::Trusted).unwrap();
        assert_eq!((proxy.occluder.len(), proxy.dropped), (whole, 2));
    }

    /// User errors must be reported in one line, not end in a panic deep inside.
    #[test]
    fn broken_surfaces_are_refused_in_one_line() {
        let mut nan = mesh();
        nan.positions[3].y = f64::NAN;
        let mut range = mesh();
        range.triangles[1][2] = 1000;
        let mut short = mesh();
        short.scores = vec![1.0; 2];
        let none = Mesh { positions: vec![DVec3::ZERO; 3], triangles: vec![[0, 1, 2]], ..Mesh::default() };
        for (mesh, word) in [(nan, "not finite"), (range, "vertex beyond"), (short, "scores"), (none, "area")] {
            let message = Proxy::new(&Surface::Mesh(mesh), Orientation::Trusted).unwrap_err().to_string();
            assert!(message.contains(word) && !message.contains('\n'), "{message}");
        }
    }

    /// The default shell is built on these: bounds too small would put cameras inside the object.
    #[test]
    fn bounds_and_sphere_hold_the_surface() {
        let proxy = Proxy::new(&samples::cube(), Orientation::Trusted).unwrap();
        assert_eq!(proxy.bounds(), (DVec3::splat(-0.5), DVec3::splat(0.5)));
        assert_eq!(proxy.robust_bounds(), proxy.bounds());
        assert!((proxy.sphere.1 - 0.75f64.sqrt()).abs() < 1e-9);
        let disc = Occluder::Discs(vec![Disc { centre: DVec3::ONE, normal: DVec3::Z, radius: 2.0 }]);
        assert_eq!(disc.primitive_bounds(0), (DVec3::new(-1.0, -1.0, 1.0), DVec3::new(3.0, 3.0, 1.0)));
    }
}

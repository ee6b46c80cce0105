//! The parts that demo scenes are made of: closed solids that face outward, sheets, and a room that faces inward.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use crate::scene::surface::{Mesh, Surface};

/// What a part is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stuff {
    /// It looks the same from everywhere.
    Matt,
    /// Colour below a clear coat.
    Glazed,
    /// Polished metal.
    Metal,
}

/// Colour, stuff and view dependency score of a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Finish {
    /// 8-bit sRGB.
    pub colour: [u8; 3],
    /// What it is made of.
    pub stuff: Stuff,
    /// View dependency score in [1, 2].
    pub score: f32,
}

impl Finish {
    /// A finish that looks the same from everywhere.
    pub const fn matt(colour: [u8; 3]) -> Self {
        Self { colour, stuff: Stuff::Matt, score: 1.0 }
    }
}

/// A mesh in the making.
#[derive(Debug, Default)]
pub(super) struct Parts {
    pub(super) mesh: Mesh,
    /// Of each triangle.
    pub(super) finishes: Vec<Finish>,
}

impl Parts {
    /// The finished surface.
    pub fn surface(self) -> Surface {
        Surface::Mesh(self.mesh)
    }

    /// A parametric sheet of `cells` quads, two triangles each: `position` and `finish` at parameters in [0, 1]², the
    /// finish taken in the middle of each quad. It faces the side from which u to v turns counter-clockwise.
    fn patch(&mut self, cells: [u32; 2], position: impl Fn(f64, f64) -> DVec3, finish: impl Fn(f64, f64) -> Finish) {
        let [nu, nv] = cells;
        let base = self.mesh.positions.len() as u32;
        let at = |i: f64, j: f64| (i / f64::from(nu), j / f64::from(nv));
        for j in 0..=nv {
            for i in 0..=nu {
                let (u, v) = at(f64::from(i), f64::from(j));
                self.mesh.positions.push(position(u, v));
                self.mesh.scores.push(finish(u, v).score);
            }
        }
        for j in 0..nv {
            for i in 0..nu {
                let (u, v) = at(f64::from(i) + 0.5, f64::from(j) + 0.5);
                let finish = finish(u, v);
                let a = base + j * (nu + 1) + i;
                let (b, c, d) = (a + 1, a + nu + 2, a + nu + 1);
                for triangle in [[a, b, c], [a, c, d]] {
                    // A quad at a pole has one side of no length, and one triangle only.
                    let [p, q, r] = triangle.map(|vertex| self.mesh.positions[vertex as usize]);
                    if p != q && q != r && r != p {
                        self.mesh.triangles.push(triangle);
                        self.mesh.colours.push(finish.colour);
                        self.finishes.push(finish);
                    }
                }
            }
        }
    }

    /// A parallelogram at `corner`, facing `sides[0] x sides[1]`.
    pub fn sheet(&mut self, corner: DVec3, sides: [DVec3; 2], cells: [u32; 2], finish: impl Fn(DVec3) -> Finish) {
        let position = |u: f64, v: f64| corner + u * sides[0] + v * sides[1];
        self.patch(cells, position, |u, v| finish(position(u, v)));
    }

    /// A box around `centre` with three perpendicular half sides (right-handed), `cells` x `cells` quads a side.
    pub fn block(&mut self, centre: DVec3, half: [DVec3; 3], cells: u32, finish: Finish) {
        for axis in 0..3 {
            let [n, u, v] = [0, 1, 2].map(|k| half[(axis + k) % 3]);
            self.sheet(centre + n - u - v, [2.0 * u, 2.0 * v], [cells; 2], |_| finish);
            self.sheet(centre - n - u - v, [2.0 * v, 2.0 * u], [cells; 2], |_| finish);
        }
    }

    /// An axis-aligned box around `centre`.
    pub fn aligned(&mut self, centre: DVec3, half: DVec3, cells: u32, finish: Finish) {
        self.block(centre, [DVec3::X * half.x, DVec3::Y * half.y, DVec3::Z * half.z], cells, finish);
    }

    /// The inside of a box with one corner at the origin, in quads about `cell` long; `colour` of a point on a wall with
    /// a given inward normal.
    pub fn room(&mut self, size: DVec3, cell: f64, colour: impl Fn(DVec3, DVec3) -> [u8; 3]) {
        for axis in 0..3 {
            let [n, u, v] = [0, 1, 2].map(|k| DVec3::AXES[(axis + k) % 3]);
            let [along_n, along_u, along_v] = [n, u, v].map(|d| d * d.dot(size));
            let cells = |side: DVec3| (side.length() / cell).round().max(1.0) as u32;
            let (nu, nv) = (cells(along_u), cells(along_v));
            self.sheet(DVec3::ZERO, [along_u, along_v], [nu, nv], |p| Finish::matt(colour(p, n)));
            self.sheet(along_n, [along_v, along_u], [nv, nu], |p| Finish::matt(colour(p, -n)));
        }
    }

    /// A sphere with `segments` meridians and half as many parallels.
    pub fn sphere(&mut self, centre: DVec3, radius: f64, segments: u32, finish: Finish) {
        let position = |u: f64, v: f64| {
            // The poles and the seam exactly, so that the sphere is closed.
            let (sin, cos) = circle(u);
            let (ring, height) = match v {
                0.0 => (0.0, -1.0),
                1.0 => (0.0, 1.0),
                _ => ((PI * v).sin(), -(PI * v).cos()),
            };
            centre + radius * DVec3::new(ring * cos, ring * sin, height)
        };
        self.patch([segments, (segments / 2).max(2)], position, |_, _| finish);
    }

    /// A ring around `centre` with the given axis: `major` to the middle of the tube, `minor` its radius.
    pub fn torus(&mut self, centre: DVec3, axis: DVec3, major: f64, minor: f64, cells: [u32; 2], finish: Finish) {
        let axis = axis.normalize();
        let (x, y) = axis.any_orthonormal_pair();
        let position = |u: f64, v: f64| {
            let (sin, cos) = circle(u);
            let out = cos * x + sin * y;
            let (sin, cos) = circle(v);
            centre + (major + minor * cos) * out + minor * sin * axis
        };
        self.patch(cells, position, |_, _| finish);
    }

    /// An upright cylinder with both caps, with its base at `foot`.
    pub fn cylinder(&mut self, foot: DVec3, radius: f64, height: f64, segments: u32, finish: Finish) {
        let at = |u: f64, ring: f64, z: f64| {
            let (sin, cos) = circle(u);
            foot + DVec3::new(ring * cos, ring * sin, z)
        };
        self.patch([segments, 4], |u, v| at(u, radius, v * height), |_, _| finish);
        self.patch([segments, 3], |u, v| at(u, radius * (1.0 - v), height), |_, _| finish);
        self.patch([segments, 3], |u, v| at(u, radius * v, 0.0), |_, _| finish);
    }
}

/// Sine and cosine of `u` turns; the same at 0 and 1, so that surfaces of revolution close.
fn circle(u: f64) -> (f64, f64) {
    if u == 1.0 { (0.0, 1.0) } else { (TAU * u).sin_cos() }
}

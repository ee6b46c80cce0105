//! Curved pieces: patches, turned bodies, rods, cushions.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::furnisher::{Finish, Furnisher};
use crate::scene::model::Face;

/// Profiles that bend by more than this have an edge there: its cosine.
const EDGE: f64 = 0.75;

impl Furnisher<'_> {
    /// A patch of `cells` quads, position and place on the texture in metres at parameters in [0, 1]²; smooth, and facing the side from
    /// which u to v turns counter-clockwise.
    pub fn patch(
        &mut self,
        cells: [u32; 2],
        finish: Finish,
        position: impl Fn(f64, f64) -> DVec3,
        place: impl Fn(f64, f64) -> [f64; 2],
    ) {
        let material = self.material(finish);
        let (span, cut) = (Self::span(finish), self.cut(finish));
        let [nu, nv] = cells;
        let row = nu as usize + 1;
        let parameters: Vec<[f64; 2]> = (0..=nv)
            .flat_map(|j| (0..=nu).map(move |i| [f64::from(i) / f64::from(nu), f64::from(j) / f64::from(nv)]))
            .collect();
        let positions: Vec<DVec3> = parameters.iter().map(|[u, v]| position(*u, *v)).collect();
        let quads: Vec<[usize; 4]> = (0..nv as usize)
            .flat_map(|j| (0..nu as usize).map(move |i| j * row + i))
            .map(|a| [a, a + 1, a + row + 1, a + row])
            .collect();
        let mut normals = vec![DVec3::ZERO; positions.len()];
        for [a, b, c, d] in &quads {
            let normal = (positions[*c] - positions[*a]).cross(positions[*d] - positions[*b]);
            [a, b, c, d].into_iter().for_each(|corner| normals[*corner] += normal);
        }
        // Where the patch closes to a tube, the two ends are one.
        for left in (0..positions.len()).step_by(row) {
            let right = left + nu as usize;
            if positions[left].distance_squared(positions[right]) < 1e-16 {
                let both = normals[left] + normals[right];
                (normals[left], normals[right]) = (both, both);
            }
        }
        let first = self.model.vertices.len() as u32;
        for ((p, n), [u, v]) in positions.iter().zip(&normals).zip(&parameters) {
            let [x, y] = place(*u, *v);
            self.vertex(*p, *n, [cut[0] + x / span[0], cut[1] + y / span[1]]);
        }
        for quad in quads {
            let [a, b, c, d] = quad.map(|corner| first + corner as u32);
            let apart = |i: usize, j: usize| positions[quad[i]].distance_squared(positions[quad[j]]) > 1e-16;
            // A quad at a pole has a side of no length, and one triangle only.
            match (apart(0, 1), apart(2, 3)) {
                (true, true) => self.faces([a, b, c, d], material),
                (true, false) => self.triangle([a, b, c], material),
                (false, true) => self.triangle([a, c, d], material),
                (false, false) => {}
            }
        }
    }

    pub(super) fn triangle(&mut self, corners: [u32; 3], material: u32) {
        self.model.faces.push(Face { corners, material });
    }

    /// A body turned about the vertical through the origin, from radii and heights of its outline, which goes up on the outside.
    /// Edges stay sharp; it is closed where the outline begins and ends at radius 0.
    pub fn turned(&mut self, outline: &[[f64; 2]], segments: u32, finish: Finish) {
        let material = self.material(finish);
        let (span, cut) = (Self::span(finish), self.cut(finish));
        let widest = outline.iter().map(|[r, _]| *r).fold(0.0, f64::max);
        // Textures meet themselves after a turn.
        let turns = (TAU * widest / span[1]).round().max(1.0);
        let across = |[a, b]: [[f64; 2]; 2]| {
            let (dr, dy) = (b[0] - a[0], b[1] - a[1]);
            let length = dr.hypot(dy);
            [dy / length, -dr / length]
        };
        let slopes: Vec<[f64; 2]> = outline.windows(2).map(|pair| across([pair[0], pair[1]])).collect();
        let blend = |own: [f64; 2], other: Option<&[f64; 2]>| match other {
            Some(o) if own[0] * o[0] + own[1] * o[1] > EDGE => [own[0] + o[0], own[1] + o[1]],
            _ => own,
        };
        let mut along = cut[0];
        for (i, pair) in outline.windows(2).enumerate() {
            let ends = [
                blend(slopes[i], i.checked_sub(1).and_then(|before| slopes.get(before))),
                blend(slopes[i], slopes.get(i + 1)),
            ];
            let next = along + (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]) / span[0];
            let ring = |add: &mut Self, end: usize, u: f64| -> Vec<u32> {
                let vertex = |k: u32| {
                    let share = f64::from(k) / f64::from(segments);
                    let (sin, cos) = if k == segments { (0.0, 1.0) } else { (TAU * share).sin_cos() };
                    let [r, y] = pair[end];
                    let [out, up] = ends[end];
                    let normal = DVec3::new(out * sin, up, out * cos);
                    add.vertex(DVec3::new(r * sin, y, r * cos), normal, [u, cut[1] + turns * share])
                };
                (0..=segments).map(vertex).collect()
            };
            let (low, high) = (ring(self, 0, along), ring(self, 1, next));
            for k in 0..segments as usize {
                let [a, b, c, d] = [low[k], low[k + 1], high[k + 1], high[k]];
                if pair[0][0] > 0.0 {
                    self.triangle([a, b, c], material);
                }
                if pair[1][0] > 0.0 {
                    self.triangle([a, c, d], material);
                }
            }
            along = next;
        }
    }

    /// A ball.
    pub fn ball(&mut self, centre: DVec3, radius: f64, segments: u32, finish: Finish) {
        let rings = segments / 2;
        let outline: Vec<[f64; 2]> = (0..=rings)
            .map(|i| {
                let polar = PI * f64::from(i) / f64::from(rings);
                let r = if i == 0 || i == rings { 0.0 } else { radius * polar.sin() };
                [r, -radius * polar.cos()]
            })
            .collect();
        self.at(centre, 0.0, |add| add.turned(&outline, segments, finish));
    }

    /// A straight rod with closed ends.
    pub fn rod(&mut self, from: DVec3, to: DVec3, radius: f64, segments: u32, finish: Finish) {
        let axis = (to - from).normalize();
        let (x, y) = axis.any_orthonormal_pair();
        let length = from.distance(to);
        let around = |u: f64| {
            let (sin, cos) = if u == 1.0 { (0.0, 1.0) } else { (TAU * u).sin_cos() };
            radius * (cos * x + sin * y)
        };
        let side = |u: f64, v: f64| from + around(u) + v * length * axis;
        self.patch([segments, 1], finish, side, |u, v| [v * length, TAU * radius * u]);
        for (end, way) in [(to, 1.0), (from, -1.0)] {
            let cap = |u: f64, v: f64| end + (1.0 - v) * around(if way > 0.0 { u } else { 1.0 - u });
            self.patch([segments, 1], finish, cap, |u, v| [radius * v, radius * u]);
        }
    }

    /// A box between two opposite corners with rounded edges, whose faces swell in the middle by `puff`, as of upholstery; `cells` along each side.
    pub fn cushion(&mut self, from: DVec3, to: DVec3, [radius, puff]: [f64; 2], cells: u32, finish: Finish) {
        let (centre, half) = (0.5 * (from + to), 0.5 * (to - from).abs());
        let radius = radius.min(0.98 * half.min_element());
        // Lines in the rounded part lie closer: two of them on either side.
        let line = move |t: f64, h: f64| {
            let at = (t * f64::from(cells)).round() as u32;
            let edge = [-h, -h + 0.4 * radius, -h + radius];
            match at {
                0..=2 => edge[at as usize],
                _ if at + 2 >= cells => -edge[(cells - at) as usize],
                _ => {
                    let inner = f64::from(at - 2) / f64::from(cells - 4);
                    (2.0 * inner - 1.0) * (h - radius)
                }
            }
        };
        for axis in 0..3 {
            let [n, u, v] = [0, 1, 2].map(|k| DVec3::AXES[(axis + k) % 3]);
            let [hn, hu, hv] = [n, u, v].map(|d| d.dot(half));
            for way in [1.0, -1.0] {
                let flat = move |s: f64, t: f64| {
                    let s = if way > 0.0 { s } else { 1.0 - s };
                    [line(s, hu), line(t, hv)]
                };
                let position = |s: f64, t: f64| {
                    let [a, b] = flat(s, t);
                    let p = way * hn * n + a * u + b * v;
                    let inner = p.clamp(radius - half, half - radius);
                    let swell = (1.0 - (a / hu).powi(2)) * (1.0 - (b / hv).powi(2));
                    centre + inner + radius * (p - inner).normalize() + way * puff * swell * n
                };
                let material_place = |s: f64, t: f64| {
                    let [a, b] = flat(s, t);
                    [way * a, -b]
                };
                self.patch([cells; 2], finish, position, material_place);
            }
        }
    }

    /// A pillow around the origin in the plane of X and Y, half as large as said: thick in the middle, with pointed corners.
    pub fn pillow(&mut self, half: DVec3, cells: u32, finish: Finish) {
        for way in [1.0, -1.0] {
            let position = |s: f64, t: f64| {
                let (a, b) = (way * (2.0 * s - 1.0), 2.0 * t - 1.0);
                let bulge = ((1.0 - a.powi(4)) * (1.0 - b.powi(4))).max(0.0).sqrt();
                let pinch = |across: f64| 1.0 - 0.09 * (1.0 - across * across);
                DVec3::new(a * pinch(b) * half.x, b * pinch(a) * half.y, way * half.z * bulge)
            };
            self.patch([cells; 2], finish, position, |s, t| [2.0 * half.x * s, -2.0 * half.y * t]);
        }
    }
}

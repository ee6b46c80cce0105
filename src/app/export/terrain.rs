//! The surface that a mission is flown over and around: what is below a place, and how near a leg comes to it.

use std::f64::consts::TAU;

use glam::DVec3;

use crate::scene::distances::{leg_to_point, leg_to_triangle};
use crate::scene::proxy::Occluder;

/// Directions in which the ground around a place is looked at.
const DIRECTIONS: u32 = 16;

/// A surface in the frame of the cameras, asked in double precision: coordinates may be those of a map.
pub struct Terrain {
    surface: Occluder,
    bounds: Vec<(DVec3, DVec3)>,
    up: DVec3,
}

impl Terrain {
    /// A surface, with the unit direction up on Earth.
    pub fn new(surface: Occluder, up: DVec3) -> Self {
        let bounds = (0..surface.len()).map(|i| surface.primitive_bounds(i)).collect();
        Self { surface, bounds, up }
    }

    /// Height along up of its highest point.
    pub fn top(&self) -> f64 {
        let corner = |(min, max): &(DVec3, DVec3)| (*min * self.up).max(*max * self.up).element_sum();
        self.bounds.iter().map(corner).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Height along up of its lowest point.
    pub fn bottom(&self) -> f64 {
        let corner = |(min, max): &(DVec3, DVec3)| (*min * self.up).min(*max * self.up).element_sum();
        self.bounds.iter().map(corner).fold(f64::INFINITY, f64::min)
    }

    /// Height along up of what is right below a place; none where nothing is.
    pub fn below(&self, place: DVec3) -> Option<f64> {
        let height = place.dot(self.up);
        let reach = |(min, max): &(DVec3, DVec3)| {
            // The line down meets the box around a primitive only if the box, seen from above, covers the place.
            let off = ((0.5 * (*min + *max)) - place).reject_from_normalized(self.up).length();
            off <= 0.5 * min.distance(*max)
        };
        let near = (0..self.bounds.len()).filter(|i| reach(&self.bounds[*i]));
        let met = near.filter_map(|i| match &self.surface {
            Occluder::Triangles(triangles) => height_on(&triangles[i], place, self.up),
            Occluder::Discs(discs) => {
                let disc = &discs[i];
                let off = (disc.centre - place).reject_from_normalized(self.up).length();
                (off <= disc.radius).then(|| disc.centre.dot(self.up))
            }
        });
        met.filter(|met| *met <= height).reduce(f64::max)
    }

    /// Height along up of the ground around a place: the lower quartile of what is below it and within `radius` of it, so that it is neither
    /// a roof nor a hole.
    pub fn ground(&self, place: DVec3, radius: f64) -> Option<f64> {
        let (across, along) = self.up.any_orthonormal_pair();
        let around = (0..DIRECTIONS).flat_map(|i| {
            let (sin, cos) = (TAU * f64::from(i) / f64::from(DIRECTIONS)).sin_cos();
            [0.5, 1.0].map(|share| place + share * radius * (cos * across + sin * along))
        });
        let mut heights: Vec<f64> = std::iter::once(place).chain(around).filter_map(|at| self.below(at)).collect();
        heights.sort_by(f64::total_cmp);
        heights.get(heights.len() / 4).copied()
    }

    /// Distance of the straight leg between two places from the surface, where it is less than `most`; else `most`.
    pub fn clearance(&self, from: DVec3, to: DVec3, most: f64) -> f64 {
        let (low, high) = (from.min(to), from.max(to));
        let mut least = most;
        for (i, (min, max)) in self.bounds.iter().enumerate() {
            let apart = (*min - high).max(low - *max).max(DVec3::ZERO).length();
            if apart < least {
                let distance = match &self.surface {
                    Occluder::Triangles(triangles) => leg_to_triangle(from, to, &triangles[i]),
                    Occluder::Discs(discs) => (leg_to_point(from, to, discs[i].centre) - discs[i].radius).max(0.0),
                };
                least = least.min(distance);
            }
        }
        least
    }
}

/// Height along `up` at which the upright line through a place meets a triangle.
fn height_on([a, b, c]: &[DVec3; 3], place: DVec3, up: DVec3) -> Option<f64> {
    let normal = (*b - *a).cross(*c - *a);
    let slope = normal.dot(up);
    if slope == 0.0 {
        return None;
    }
    let sides = [(a, b), (b, c), (c, a)].map(|(p, q)| (*q - *p).cross(place - *p).dot(up) * slope.signum());
    sides.iter().all(|side| *side >= 0.0).then(|| place.dot(up) + (*a - place).dot(normal) / slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a drone would take off from a roof, from below the ground, or from an altitude of elsewhere.
    #[test]
    fn the_ground_is_the_highest_thing_below() {
        let quad = |half: f64, z: f64| {
            let corner = |x: f64, y: f64| DVec3::new(half * x, half * y, z);
            let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            // Whichever way they are wound.
            [[a, b, c], [a, d, c]]
        };
        let surface = [quad(10.0, 3.0), quad(2.0, 8.0)].concat();
        let terrain = Terrain::new(Occluder::Triangles(surface), DVec3::Z);
        assert_eq!(terrain.below(DVec3::new(5.0, -4.0, 20.0)), Some(3.0));
        assert_eq!(terrain.below(DVec3::new(1.0, 1.5, 20.0)), Some(8.0));
        assert_eq!(terrain.below(DVec3::new(1.0, 1.5, 7.0)), Some(3.0));
        assert_eq!(terrain.below(DVec3::new(1.0, 1.5, 2.0)), None);
        assert_eq!(terrain.below(DVec3::new(11.0, 0.0, 20.0)), None);
        assert_eq!((terrain.top(), terrain.bottom()), (8.0, 3.0));
        // Above the house the ground is beside it; beyond the edge there is some, far away none.
        assert_eq!(terrain.ground(DVec3::new(1.0, 1.5, 20.0), 8.0), Some(3.0));
        assert_eq!(terrain.ground(DVec3::new(11.0, 0.0, 20.0), 8.0), Some(3.0));
        assert_eq!(terrain.ground(DVec3::new(30.0, 0.0, 20.0), 8.0), None);
    }
}

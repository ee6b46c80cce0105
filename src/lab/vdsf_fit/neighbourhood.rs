//! Neighbourhoods: how the normal varies within the footprint of a pixel, and what hides light and views.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::draws::Draws;
use super::quadrature::lattice;

/// Luma that hidden directions send back, as a share of the mean radiance: what a neighbouring part reflects.
const INTERREFLECTION: f64 = 0.3;

/// The surroundings of a point whose mean normal is +Z.
#[derive(Clone, Copy, Debug)]
pub struct Neighbourhood {
    /// Root mean square slope of the normals within the footprint, along X and Y.
    pub slopes: DVec2,
    /// Normal of a wall through the point; behind it neither light nor views come in. None where nothing is hidden.
    pub wall: Option<DVec3>,
}

impl Neighbourhood {
    /// Flat and open.
    pub const FLAT: Self = Self { slopes: DVec2::ZERO, wall: None };

    /// One of the population: flat, convex with two curvatures, concave with a part hidden, or bumpy.
    pub fn draw(draws: &mut Draws) -> Self {
        match draws.count(0, 3) {
            0 => Self::FLAT,
            1 => Self { slopes: DVec2::new(draws.scale(0.01, 0.2), draws.scale(0.01, 0.2)), wall: None },
            2 => {
                // The wall leans over by up to 30 degrees or away by up to 70.
                let lean = draws.between(-30.0, 70.0).to_radians();
                let turn = TAU * draws.unit();
                let level = DVec3::new(libm::cos(turn), libm::sin(turn), 0.0);
                let wall = libm::cos(lean) * level + libm::sin(lean) * DVec3::Z;
                Self { slopes: DVec2::new(draws.scale(0.01, 0.2), draws.scale(0.01, 0.2)), wall: Some(wall) }
            }
            _ => Self { slopes: DVec2::splat(draws.scale(0.03, 0.3)), wall: None },
        }
    }

    /// Whether light and views come in along unit direction `w`.
    pub fn open(&self, w: DVec3) -> bool {
        w.z > 0.0 && self.wall.is_none_or(|wall| wall.dot(w) > 0.0)
    }

    /// Radiance of hidden directions under a lighting of this mean radiance.
    pub fn hidden_radiance(&self, mean: f64) -> f64 {
        INTERREFLECTION * mean
    }

    /// GGX's alpha along X and Y once the footprint is averaged: variances of slopes add, and that of a microfacet
    /// distribution is half of alpha squared (Olano and Baker 2010, "LEAN Mapping").
    pub fn alpha(&self, roughness: f64) -> DVec2 {
        let alpha = roughness * roughness;
        let wide = |slope: f64| (alpha * alpha + 2.0 * slope * slope).sqrt();
        DVec2::new(wide(self.slopes.x), wide(self.slopes.y))
    }

    /// `count` normals within the footprint, equally likely: slopes are normally distributed.
    pub fn normals(&self, count: usize) -> Vec<DVec3> {
        if self.slopes == DVec2::ZERO {
            return vec![DVec3::Z];
        }
        let normal = |[u, turn]: [f64; 2]| {
            // Box and Muller.
            let radius = (-2.0 * libm::log(1.0 - u)).sqrt();
            let (x, y) = (radius * libm::cos(TAU * turn), radius * libm::sin(TAU * turn));
            DVec3::new(self.slopes.x * x, self.slopes.y * y, 1.0).normalize()
        };
        lattice(count).map(normal).collect()
    }
}

//! Lightings: an ambient term with a gradient, and lobes from lamps to windows. Neutral in colour, so radiance is luma.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::draws::Draws;
use super::quadrature::lattice;

/// Radiance that comes in from everywhere, as a function of direction.
#[derive(Clone, Debug)]
pub struct Lighting {
    /// Radiance without the lobes, where the gradient is level.
    pub ambient: f64,
    /// Change of that radiance along a direction; no longer than `ambient`, so that radiance is never negative.
    pub gradient: DVec3,
    /// The lights, each a lobe of directions.
    pub lobes: Vec<Lobe>,
}

/// One light.
#[derive(Clone, Copy, Debug)]
pub struct Lobe {
    /// Unit direction of its middle.
    pub axis: DVec3,
    /// Radiance in its middle.
    pub peak: f64,
    /// How radiance falls off around it.
    pub profile: Profile,
}

/// Radiance around the middle of a light, relative to the middle.
#[derive(Clone, Copy, Debug)]
pub enum Profile {
    /// A von Mises-Fisher lobe, `exp(sharpness (cos - 1))`.
    Round {
        /// How narrow it is, >= 0.
        sharpness: f64,
    },
    /// A disc with a penumbra: 1 where cos > `inner`, 0 where cos < `outer`, a smooth step of the cosine between.
    Disc {
        /// Cosine of the angle within which it is even.
        inner: f64,
        /// Cosine of the angle where it ends.
        outer: f64,
    },
}

impl Lobe {
    /// Radiance from unit direction `l`.
    pub fn radiance(&self, l: DVec3) -> f64 {
        let cos = self.axis.dot(l);
        match self.profile {
            // Beyond 30 the lobe is less than 1e-13 of its peak.
            Profile::Round { sharpness } if sharpness * (1.0 - cos) > 30.0 => 0.0,
            Profile::Round { sharpness } => self.peak * libm::exp(sharpness * (cos - 1.0)),
            Profile::Disc { inner, outer } => {
                let t = ((cos - outer) / (inner - outer)).clamp(0.0, 1.0);
                self.peak * t * t * (3.0 - 2.0 * t)
            }
        }
    }

    /// Angle, in radians, over which radiance changes.
    pub fn width(&self) -> f64 {
        match self.profile {
            Profile::Round { sharpness } => (1.0 / sharpness).sqrt(),
            Profile::Disc { outer, .. } => libm::acos(outer),
        }
    }

    /// Integral of the radiance over the sphere.
    pub fn power(&self) -> f64 {
        self.peak
            * match self.profile {
                Profile::Round { sharpness } => TAU / sharpness * (1.0 - libm::exp(-2.0 * sharpness)),
                // The smooth step is point symmetric about its middle.
                Profile::Disc { inner, outer } => TAU * (1.0 - 0.5 * (inner + outer)),
            }
    }

    /// `count` directions and weights whose sum of `weight * f(direction)` is the integral of radiance times `f`.
    pub fn points(&self, count: usize) -> Vec<(DVec3, f64)> {
        let (side, other) = self.axis.any_orthonormal_pair();
        let point = |[u, turn]: [f64; 2]| {
            let (cos, weight) = match self.profile {
                Profile::Round { sharpness } => {
                    let floor = libm::exp(-2.0 * sharpness);
                    (1.0 + libm::log(1.0 - u * (1.0 - floor)) / sharpness, self.power())
                }
                Profile::Disc { outer, .. } => (1.0 - u * (1.0 - outer), TAU * (1.0 - outer)),
            };
            let across = (1.0 - cos * cos).max(0.0).sqrt();
            let turn = TAU * turn;
            let l = cos * self.axis + across * (libm::cos(turn) * side + libm::sin(turn) * other);
            let radiance = match self.profile {
                Profile::Round { .. } => 1.0,
                Profile::Disc { .. } => self.radiance(l),
            };
            (l, weight * radiance / count as f64)
        };
        lattice(count).map(point).collect()
    }
}

impl Lighting {
    /// Radiance without the lobes.
    pub fn base(&self, l: DVec3) -> f64 {
        self.ambient + self.gradient.dot(l)
    }

    /// Radiance from unit direction `l`.
    pub fn radiance(&self, l: DVec3) -> f64 {
        self.base(l) + self.lobes.iter().map(|lobe| lobe.radiance(l)).sum::<f64>()
    }

    /// Mean radiance over the sphere.
    pub fn mean(&self) -> f64 {
        self.ambient + self.lobes.iter().map(Lobe::power).sum::<f64>() / (4.0 * PI)
    }

    /// One of the population: overcast, sunlit, a room, a studio, or lights all around; with surroundings to reflect.
    /// The surface's normal is +Z; which way is up differs, but surfaces that face straight down are left out.
    pub fn draw(draws: &mut Draws) -> Self {
        let up = draws.direction(DVec3::Z, -0.3, 1.0);
        let kind = draws.count(0, 4);
        let (ambient, tilt) = match kind {
            0 => (1.0, draws.between(0.3, 0.9)),
            1 => (draws.between(0.3, 0.8), draws.between(0.1, 0.7)),
            2 => (draws.between(0.1, 0.4), draws.between(0.0, 0.4)),
            3 => (draws.between(0.03, 0.2), draws.between(0.0, 0.3)),
            _ => (draws.between(0.1, 0.5), draws.between(0.0, 0.5)),
        };
        let mut lobes = Vec::new();
        match kind {
            0 => {}
            // The power of the sun against the sky's; the disc itself, widened by haze to what the grid resolves.
            1 => lobes.push(round(draws, up, [0.1, 0.95], [200.0, 800.0], [1.0, 5.0])),
            2 => {
                let windows = draws.count(1, 2);
                lobes.extend((0..windows).map(|_| disc(draws, up, [-0.2, 0.6], [14.0, 35.0], [0.5, 3.0])));
                let lamps = draws.count(0, 4);
                lobes.extend((0..lamps).map(|_| round(draws, up, [0.4, 1.0], [50.0, 500.0], [0.1, 0.8])));
            }
            3 => {
                let boxes = draws.count(2, 4);
                lobes.extend((0..boxes).map(|_| disc(draws, up, [-0.1, 1.0], [9.0, 35.0], [0.5, 3.0])));
            }
            _ => {
                let lights = draws.count(4, 8);
                lobes.extend((0..lights).map(|_| round(draws, up, [-0.6, 1.0], [5.0, 300.0], [0.1, 1.0])));
            }
        }
        let surroundings = draws.count(0, 6);
        lobes.extend((0..surroundings).map(|_| round(draws, up, [-0.8, 0.5], [5.0, 200.0], [0.02, 0.2])));
        Self { ambient, gradient: tilt * ambient * up, lobes }
    }
}

/// A round light: heights above the horizon, sharpnesses, and powers (in units of a sphere of radiance 1, over pi).
fn round(draws: &mut Draws, up: DVec3, heights: [f64; 2], sharpnesses: [f64; 2], powers: [f64; 2]) -> Lobe {
    let axis = draws.direction(up, heights[0], heights[1]);
    let sharpness = draws.scale(sharpnesses[0], sharpnesses[1]);
    let lobe = Lobe { axis, peak: 1.0, profile: Profile::Round { sharpness } };
    Lobe { peak: PI * draws.scale(powers[0], powers[1]) / lobe.power(), ..lobe }
}

/// A disc: heights above the horizon, radii in degrees, and powers. Its penumbra is a fifth of its radius.
fn disc(draws: &mut Draws, up: DVec3, heights: [f64; 2], radii: [f64; 2], powers: [f64; 2]) -> Lobe {
    let axis = draws.direction(up, heights[0], heights[1]);
    let radius = draws.scale(radii[0], radii[1]).to_radians();
    let profile = Profile::Disc { inner: libm::cos(0.8 * radius), outer: libm::cos(radius) };
    let lobe = Lobe { axis, peak: 1.0, profile };
    Lobe { peak: PI * draws.scale(powers[0], powers[1]) / lobe.power(), ..lobe }
}

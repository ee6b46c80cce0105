//! Outgoing radiance of a sample, by quadrature over whichever is narrower: the reflection or the light.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::lighting::Lighting;
use super::material::{Ggx, Material};
use super::neighbourhood::Neighbourhood;
use super::quadrature::lattice;

/// Points of a quadrature over a reflection, a light, or the hemisphere.
const POINTS: usize = 64;

/// Normals that a footprint is averaged over where the body reflects diffusely.
const NORMALS: usize = 16;

/// A surface under light, made ready to be seen.
pub struct Sample<'a> {
    material: Material,
    neighbourhood: Neighbourhood,
    lighting: &'a Lighting,
    ggx: Ggx,
    /// Radiance that comes from hidden directions.
    hidden: f64,
    /// Normals of the footprint and the diffuse radiance of each.
    diffuse: Vec<(DVec3, f64)>,
    /// Points (direction, weight) of the lights that are narrower than the reflection.
    narrow: Vec<(DVec3, f64)>,
    /// Indices of the other lights.
    wide: Vec<usize>,
    /// The lattice of a reflection: height, and turn as a unit vector.
    reflection: Vec<(f64, DVec2)>,
}

impl<'a> Sample<'a> {
    /// Integrates the diffuse part and chooses the way of each light.
    pub fn new(material: Material, neighbourhood: Neighbourhood, lighting: &'a Lighting) -> Self {
        let ggx = Ggx { alpha: neighbourhood.alpha(material.roughness) };
        let turned = |[height, turn]: [f64; 2]| (height, DVec2::new(libm::cos(TAU * turn), libm::sin(TAU * turn)));
        let reflection: Vec<(f64, DVec2)> = lattice(POINTS).map(turned).collect();
        let open = |points: Vec<(DVec3, f64)>| points.into_iter().filter(|(l, _)| neighbourhood.open(*l));
        let lights: Vec<Vec<(DVec3, f64)>> =
            lighting.lobes.iter().map(|lobe| open(lobe.points(POINTS)).collect()).collect();
        // A reflected direction turns by twice the angle of the facet.
        let width = 2.0 * ggx.alpha.min_element();
        let (wide, narrow): (Vec<usize>, Vec<usize>) =
            (0..lights.len()).partition(|&light| lighting.lobes[light].width() > width);
        let mut sample = Self {
            material,
            neighbourhood,
            lighting,
            ggx,
            hidden: neighbourhood.hidden_radiance(lighting.mean()),
            diffuse: Vec::new(),
            narrow: narrow.iter().flat_map(|&light| lights[light].clone()).collect(),
            wide,
            reflection,
        };
        let all: Vec<(DVec3, f64)> = lights.into_iter().flatten().collect();
        let lit = |normal: DVec3| (normal, material.diffuse * sample.irradiance(normal, &all));
        sample.diffuse = neighbourhood.normals(NORMALS).into_iter().map(lit).collect();
        sample
    }

    /// Light that the body below the coat gets through a facet, over pi.
    fn irradiance(&self, normal: DVec3, lights: &[(DVec3, f64)]) -> f64 {
        let (side, other) = normal.any_orthonormal_pair();
        // Directions by the cosine, so that all weigh the same.
        let ambient = self.reflection.iter().map(|&(u, turn)| {
            let l = u.sqrt() * (turn.x * side + turn.y * other) + (1.0 - u).sqrt() * normal;
            (1.0 - self.material.fresnel(normal.dot(l))) * self.ambient(l) / POINTS as f64
        });
        let lobes = lights.iter().map(|&(l, weight)| {
            let cos = normal.dot(l).max(0.0);
            (1.0 - self.material.fresnel(cos)) * cos * weight / std::f64::consts::PI
        });
        ambient.sum::<f64>() + lobes.sum::<f64>()
    }

    /// Incoming radiance without the lights.
    fn ambient(&self, l: DVec3) -> f64 {
        if self.neighbourhood.open(l) { self.lighting.base(l) } else { self.hidden }
    }

    /// Radiance towards unit direction `v`, which must be above the horizon.
    pub fn radiance(&self, v: DVec3) -> f64 {
        self.body(v) + self.coat(v)
    }

    /// The diffuse part: the normals of the footprint, weighted by the area that they turn to `v`.
    fn body(&self, v: DVec3) -> f64 {
        let (mut sum, mut area) = (0.0, 0.0);
        for &(normal, radiance) in &self.diffuse {
            let cos = normal.dot(v).max(0.0);
            let weight = cos / normal.z;
            sum += weight * (1.0 - self.material.fresnel(cos)) * radiance;
            area += weight;
        }
        if area > 0.0 { sum / area } else { 0.0 }
    }

    /// The glossy part.
    fn coat(&self, v: DVec3) -> f64 {
        let lambda = self.ggx.lambda(v);
        let mut reflected = 0.0;
        for &(height, turn) in &self.reflection {
            let h = self.ggx.visible_normal(v, height, turn);
            let cos = v.dot(h);
            let l = 2.0 * cos * h - v;
            if l.z <= 0.0 {
                continue;
            }
            let mut incoming = self.ambient(l);
            if self.neighbourhood.open(l) {
                incoming += self.wide.iter().map(|&light| self.lighting.lobes[light].radiance(l)).sum::<f64>();
            }
            // The weight of a visible normal is G2 / G1.
            let masking = (1.0 + lambda) / (1.0 + lambda + self.ggx.lambda(l));
            reflected += self.material.fresnel(cos) * masking * incoming;
        }
        let mut lit = 0.0;
        for &(l, weight) in &self.narrow {
            let h = (v + l).normalize();
            let masking = 1.0 / (1.0 + lambda + self.ggx.lambda(l));
            lit += weight * self.material.fresnel(v.dot(h)) * self.ggx.normals(h) * masking;
        }
        reflected / POINTS as f64 + lit / (4.0 * v.z)
    }
}

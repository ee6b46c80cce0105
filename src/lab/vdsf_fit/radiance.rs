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

/// Steps of the table of albedos over the cosine.
const COSINES: usize = 32;

/// A surface under light, made ready to be seen. The coat is single-scatter GGX with the energy of further bounces put back
/// by a factor (Turquin 2019, "Practical multiple scattering compensation for microfacet models"); the body gets and
/// gives what the coat does not reflect (Kelemen and Szirmay-Kalos 2001, "A Microfacet Based Coupled Specular-Matte
/// BRDF Model").
pub struct Sample<'a> {
    material: Material,
    neighbourhood: Neighbourhood,
    lighting: &'a Lighting,
    ggx: Ggx,
    /// Radiance that comes from hidden directions.
    hidden: f64,
    /// Albedo of the coat of a flat facet at the cosines 0 to 1.
    albedo: Vec<f64>,
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
    /// Integrates the diffuse part and chooses the quadrature of each light.
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
            albedo: Vec::new(),
            diffuse: Vec::new(),
            narrow: narrow.iter().flat_map(|&light| lights[light].clone()).collect(),
            wide,
            reflection,
        };
        let facet = Ggx { alpha: Neighbourhood::FLAT.alpha(material.roughness) };
        let cosine = |i: usize| (i as f64 / COSINES as f64).max(1e-3);
        let towards = |cos: f64| DVec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
        sample.albedo = (0..=COSINES)
            .map(|i| sample.reflect(&facet, towards(cosine(i)), |_| 1.0))
            .map(|(r, gain)| r * gain)
            .collect();
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
            self.transmitted(normal.dot(l)) * self.ambient(l) / POINTS as f64
        });
        let lobes = lights.iter().map(|&(l, weight)| {
            let cos = normal.dot(l).max(0.0);
            self.transmitted(cos) * cos * weight / std::f64::consts::PI
        });
        ambient.sum::<f64>() + lobes.sum::<f64>()
    }

    /// Share of the light at this cosine that the coat of a facet lets through.
    fn transmitted(&self, cos: f64) -> f64 {
        let at = cos.clamp(0.0, 1.0) * COSINES as f64;
        let step = (at as usize).min(COSINES - 1);
        let share = at - step as f64;
        1.0 - (self.albedo[step] + share * (self.albedo[step + 1] - self.albedo[step]))
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
            sum += weight * self.transmitted(cos) * radiance;
            area += weight;
        }
        if area > 0.0 { sum / area } else { 0.0 }
    }

    /// What single facets reflect towards `v` of what comes in, and the factor that puts further bounces back.
    fn reflect(&self, ggx: &Ggx, v: DVec3, incoming: impl Fn(DVec3) -> f64) -> (f64, f64) {
        let lambda = ggx.lambda(v);
        let (mut reflected, mut white) = (0.0, 0.0);
        for &(height, turn) in &self.reflection {
            let h = ggx.visible_normal(v, height, turn);
            let cos = v.dot(h);
            let l = 2.0 * cos * h - v;
            if l.z > 0.0 {
                // The weight of a visible normal is G2 / G1.
                let masking = (1.0 + lambda) / (1.0 + lambda + ggx.lambda(l)) / POINTS as f64;
                reflected += self.material.fresnel(cos) * masking * incoming(l);
                white += masking;
            }
        }
        (reflected, 1.0 + self.material.specular * (1.0 / white - 1.0))
    }

    /// The glossy part.
    fn coat(&self, v: DVec3) -> f64 {
        let lambda = self.ggx.lambda(v);
        let (reflected, gain) = self.reflect(&self.ggx, v, |l| {
            if !self.neighbourhood.open(l) {
                return self.hidden;
            }
            self.lighting.base(l) + self.wide.iter().map(|&light| self.lighting.lobes[light].radiance(l)).sum::<f64>()
        });
        let mut lit = 0.0;
        for &(l, weight) in &self.narrow {
            let h = (v + l).normalize();
            let masking = 1.0 / (1.0 + lambda + self.ggx.lambda(l));
            lit += weight * self.material.fresnel(v.dot(h)) * self.ggx.normals(h) * masking;
        }
        gain * (reflected + lit / (4.0 * v.z))
    }
}

#[cfg(test)]
mod tests {
    use super::super::draws::Draws;
    use super::super::lighting::{Lobe, Profile};
    use super::*;
    use crate::scene::random;

    fn lighting() -> Lighting {
        let axis = |x: f64, y: f64, z: f64| DVec3::new(x, y, z).normalize();
        let disc = Profile::Disc { inner: 0.96, outer: 0.92 };
        Lighting {
            ambient: 0.3,
            gradient: DVec3::new(0.1, 0.0, 0.2),
            lobes: vec![
                Lobe { axis: axis(0.5, 0.2, 0.8), peak: 8.0, profile: Profile::Round { sharpness: 200.0 } },
                Lobe { axis: axis(-0.9, 0.3, 0.5), peak: 1.0, profile: Profile::Round { sharpness: 6.0 } },
                Lobe { axis: axis(0.1, -0.8, 0.7), peak: 3.0, profile: disc },
            ],
        }
    }

    /// Radiance by plain Monte Carlo: incoming directions uniform on the hemisphere, the reflection formula written out.
    fn brute_force(sample: &Sample<'_>, v: DVec3) -> f64 {
        let Sample { material, neighbourhood, lighting, .. } = sample;
        let ggx = Ggx { alpha: neighbourhood.alpha(material.roughness) };
        let hidden = neighbourhood.hidden_radiance(lighting.mean());
        let count = 400_000;
        let (mut coat, mut white, mut body) = (0.0, 0.0, 0.0);
        for i in 0..count {
            let [a, b, ..] = random::uniforms(9, 0, i);
            let l = random::direction(0.5 * a, b);
            let h = (v + l).normalize();
            let incoming = if neighbourhood.open(l) { lighting.radiance(l) } else { hidden };
            let masking = 1.0 / (1.0 + ggx.lambda(v) + ggx.lambda(l));
            let facets = ggx.normals(h) * masking / (4.0 * v.z);
            coat += incoming * facets * material.fresnel(v.dot(h));
            white += facets;
            body += incoming * sample.transmitted(l.z) * l.z;
        }
        let mean = |sum: f64| sum * TAU / f64::from(count);
        let gain = 1.0 + material.specular * (1.0 / mean(white) - 1.0);
        gain * mean(coat) + material.diffuse * sample.transmitted(v.z) * mean(body) / std::f64::consts::PI
    }

    /// A quadrature that misses a light or counts it twice would fit the law to wrong radiance.
    #[test]
    fn radiance_is_that_of_brute_force() {
        let lighting = lighting();
        let walled = Neighbourhood { wall: Some(DVec3::new(0.8, 0.0, 0.6)), ..Neighbourhood::FLAT };
        for (metallic, roughness) in [(1.0, 0.4), (1.0, 0.8), (0.0, 0.5), (0.0, 1.0)] {
            let material = Material::new(DVec3::new(0.8, 0.6, 0.4), metallic, roughness, 0.05, 0.5);
            for neighbourhood in [Neighbourhood::FLAT, walled] {
                let sample = Sample::new(material, neighbourhood, &lighting);
                for v in [DVec3::Z, DVec3::new(0.6, 0.0, 0.8), DVec3::new(-0.3, 0.9, 0.3).normalize()] {
                    let (quick, slow) = (sample.radiance(v), brute_force(&sample, v));
                    let message = format!("{quick} for {slow}, {metallic} {roughness} {v}");
                    assert!((quick - slow).abs() < 0.01 + 0.03 * slow, "{message}");
                }
            }
        }
    }

    /// A polished metal is a mirror: what it shows is what lies in the mirrored direction.
    #[test]
    fn a_mirror_shows_the_lights() {
        let lighting = lighting();
        let material = Material::new(DVec3::ONE, 1.0, 0.03, 0.04, 0.0);
        let sample = Sample::new(material, Neighbourhood::FLAT, &lighting);
        let mut draws = Draws::new(3, 0);
        for _ in 0..200 {
            let v = draws.direction(DVec3::Z, 0.15, 1.0);
            let (shown, there) = (sample.radiance(v), lighting.radiance(DVec3::new(-v.x, -v.y, v.z)));
            assert!((shown - there).abs() < 0.02 + 0.02 * there, "{shown} for {there} towards {v}");
        }
    }

    /// In a white room a surface must not send out more than comes in, and a white metal must send out all of it:
    /// else energy is made or lost.
    #[test]
    fn a_white_furnace_is_white() {
        let lighting = Lighting { ambient: 1.0, gradient: DVec3::ZERO, lobes: Vec::new() };
        for roughness in [0.03, 0.3, 0.6, 1.0] {
            for metallic in [0.0, 1.0] {
                let material = Material::new(DVec3::ONE, metallic, roughness, 0.04, 0.0);
                let sample = Sample::new(material, Neighbourhood::FLAT, &lighting);
                for z in [0.1, 0.5, 1.0f64] {
                    let out = sample.radiance(DVec3::new((1.0 - z * z).sqrt(), 0.0, z));
                    let message = format!("{out} at roughness {roughness}, metallic {metallic}, z {z}");
                    match metallic {
                        0.0 => assert!(out < 1.0 + 1e-9 && out > 0.8, "{message}"),
                        _ => assert!((out - 1.0).abs() < 1e-9, "{message}"),
                    }
                }
            }
        }
    }

    /// A bumpy footprint is folded into the roughness. Compared with the mean over facets of the footprint, each a flat
    /// mirror-like surface of its own, the radiance must agree, or the blur by neighbourhoods would be a fiction.
    #[test]
    fn a_footprint_blurs_as_its_facets_do() {
        let lighting = Lighting { lobes: lighting().lobes[1..2].to_vec(), ..lighting() };
        let material = Material::new(DVec3::ONE, 1.0, 0.3, 0.04, 0.0);
        let bumpy = Neighbourhood { slopes: DVec2::splat(0.15), wall: None };
        let sample = Sample::new(material, bumpy, &lighting);
        let flat = Neighbourhood::FLAT;
        for v in [DVec3::Z, DVec3::new(0.6, 0.0, 0.8), DVec3::new(-0.5, -0.5, 0.7).normalize()] {
            let (mut sum, mut area) = (0.0, 0.0);
            for normal in bumpy.normals(400) {
                let turn = glam::DQuat::from_rotation_arc(normal, DVec3::Z);
                let mut turned = lighting.clone();
                turned.gradient = turn * turned.gradient;
                turned.lobes[0].axis = turn * turned.lobes[0].axis;
                let weight = normal.dot(v).max(0.0) / normal.z;
                sum += weight * Sample::new(material, flat, &turned).radiance(turn * v);
                area += weight;
            }
            let (folded, facets) = (sample.radiance(v), sum / area);
            assert!((folded / facets - 1.0).abs() < 0.08, "{folded} for {facets} towards {v}");
        }
    }
}

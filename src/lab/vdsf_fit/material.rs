//! Materials: Lambert under a GGX microfacet coat, dielectric or metal. Only the luma of a colour matters here: lights are
//! neutral and Schlick's Fresnel term is linear in the reflectance, so the luma of the result is the result of the lumas.

use glam::{DVec2, DVec3};

use super::draws::Draws;
use crate::scene::colour::LUMA;

/// The material of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Material {
    /// Luma that the body reflects diffusely, without what the coat takes.
    pub diffuse: f64,
    /// Luma of the coat's reflectance at normal incidence.
    pub specular: f64,
    /// Perceptual roughness; GGX's alpha is its square.
    pub roughness: f64,
}

impl Material {
    /// From the usual parameters: base colour (linear RGB), metallic in [0, 1], perceptual roughness, reflectance of a
    /// dielectric at normal incidence, and how far that is tinted by the base colour.
    pub fn new(base: DVec3, metallic: f64, roughness: f64, reflectance: f64, tint: f64) -> Self {
        let colour = base / base.max_element().max(1e-6);
        let dielectric = reflectance * DVec3::ONE.lerp(colour, tint);
        Self {
            diffuse: (1.0 - metallic) * LUMA.dot(base),
            specular: LUMA.dot(dielectric.lerp(base, metallic)),
            roughness,
        }
    }

    /// One of the population: half dielectrics, 35% metals, the rest in between (worn or dusty); roughness in [0.03, 1].
    pub fn draw(draws: &mut Draws) -> Self {
        let which = draws.unit();
        let metallic = match which {
            _ if which < 0.5 => 0.0,
            _ if which < 0.85 => 1.0,
            _ => draws.unit(),
        };
        let mut base = DVec3::new(draws.unit(), draws.unit(), draws.unit());
        // Metals are bright; diffuse colours go down to near black.
        base = if metallic == 1.0 { 0.5 + 0.48 * base } else { 0.03 + 0.8 * base };
        Self::new(base, metallic, draws.between(0.03, 1.0), draws.between(0.02, 0.08), draws.unit())
    }

    /// Schlick's Fresnel term.
    pub fn fresnel(&self, cos: f64) -> f64 {
        let rest = (1.0 - cos).max(0.0);
        let square = rest * rest;
        self.specular + (1.0 - self.specular) * square * square * rest
    }
}

/// A GGX distribution of microfacets in the frame whose +Z is the normal; `alpha` along X and Y.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ggx {
    /// Root mean square slopes, times the square root of two.
    pub alpha: DVec2,
}

impl Ggx {
    /// Density of normals (Heitz 2014, "Understanding the Masking-Shadowing Function", eq. 85).
    pub fn normals(&self, h: DVec3) -> f64 {
        let (x, y) = (h.x / self.alpha.x, h.y / self.alpha.y);
        let length = x * x + y * y + h.z * h.z;
        1.0 / (std::f64::consts::PI * self.alpha.x * self.alpha.y * length * length)
    }

    /// Smith's Lambda (Heitz 2014, eq. 86 and 72); masking is `1 / (1 + Lambda)`.
    pub fn lambda(&self, w: DVec3) -> f64 {
        let (x, y) = (self.alpha.x * w.x, self.alpha.y * w.y);
        0.5 * ((1.0 + (x * x + y * y) / (w.z * w.z)).sqrt() - 1.0)
    }

    /// A visible normal for unit direction `v` (Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with Spherical
    /// Caps"); `height` uniform in [0, 1), `turn` a uniform unit vector of the plane.
    pub fn visible_normal(&self, v: DVec3, height: f64, turn: DVec2) -> DVec3 {
        let v = DVec3::new(self.alpha.x * v.x, self.alpha.y * v.y, v.z).normalize();
        let z = (1.0 - height) * (1.0 + v.z) - v.z;
        let across = (1.0 - z * z).max(0.0).sqrt();
        let h = DVec3::new(across * turn.x, across * turn.y, z) + v;
        DVec3::new(self.alpha.x * h.x, self.alpha.y * h.y, h.z.max(0.0)).normalize()
    }
}

//! Where lights are looked for: alias tables (Vose 1991) over emitting triangles and lamps, and over the environment.

use glam::{Vec2, Vec3};

use super::layout::{Alias, LIGHT_DIRECTIONAL, LIGHT_POINT, LIGHT_SKY, LIGHT_TRIANGLE, Light};
use crate::scene::colour::linear;
use crate::scene::model::{Environment, LampKind, Map, Model, Wrap};

/// The least share of a light among as many, so that none is forgotten.
const MIN_SHARE: f64 = 0.01;
/// The least share of an environment's light that is looked for apart from the rest.
const MIN_COMPACT: f64 = 0.02;

fn luma(c: Vec3) -> f64 {
    c.as_dvec3().dot(crate::scene::colour::LUMA)
}

/// A source of light before it is laid out.
pub(crate) struct Source {
    pub light: Light,
    /// The triangle in the model, where it is one.
    pub face: Option<u32>,
    /// Its power as far as it is known.
    pub power: f64,
}

/// The emitting triangles and then the lamps. `radius` is that of the scene, `centre` its place in the world.
pub(crate) fn lights(model: &Model, centre: glam::DVec3, radius: f64) -> Vec<Source> {
    let mut sources = Vec::new();
    for (index, face) in model.faces.iter().enumerate() {
        let material = &model.materials[face.material as usize];
        if !material.shines() {
            continue;
        }
        let corners = face.corners.map(|v| &model.vertices[v as usize]);
        let [p, q, r] = corners.map(|corner| corner.position);
        let area = 0.5 * (q - p).cross(r - p).length();
        let shown = material.emission_map.map_or(Vec3::ONE, |map| mean_over(model, &map, corners.map(|c| c.uvs)));
        let sides = if material.double_sided { 2.0 } else { 1.0 };
        let power = std::f64::consts::PI * sides * area * luma(material.emission * shown);
        // Where nothing was found to shine, light is met by chance only.
        if power > 0.0 && area as f32 > 0.0 {
            let light = Light { kind: LIGHT_TRIANGLE, ..Light::default() };
            sources.push(Source { light, face: Some(index as u32), power });
        }
    }
    for lamp in &model.lamps {
        let colour = luma(lamp.colour);
        if colour <= 0.0 {
            continue;
        }
        let mut light = Light {
            kind: LIGHT_POINT,
            position: (lamp.position - centre).as_vec3().to_array(),
            direction: lamp.direction.to_array(),
            colour: lamp.colour.to_array(),
            range: lamp.range.min(1e18),
            cone_offset: 1.0,
            ..Light::default()
        };
        let power = match lamp.kind {
            LampKind::Point => 4.0 * std::f64::consts::PI * colour,
            LampKind::Directional => {
                light.kind = LIGHT_DIRECTIONAL;
                std::f64::consts::PI * radius * radius * colour
            }
            LampKind::Spot { inner, outer } => {
                // KHR_lights_punctual.
                light.cone_scale = 1.0 / (inner.cos() - outer.cos()).max(0.001);
                light.cone_offset = -outer.cos() * light.cone_scale;
                2.0 * std::f64::consts::PI * f64::from(1.0 - outer.cos()) * colour
            }
        };
        sources.push(Source { light, face: None, power });
    }
    sources
}

/// Gives lights their shares among one another, by power.
pub(crate) fn share_out(lights: &mut [Light], powers: &[f64]) {
    let all: f64 = powers.iter().sum();
    let count = powers.len() as f64;
    let shares: Vec<f64> = powers.iter().map(|power| (1.0 - MIN_SHARE) * power / all + MIN_SHARE / count).collect();
    for ((light, share), [threshold, other]) in lights.iter_mut().zip(&shares).zip(aliases(&shares)) {
        (light.share, light.threshold, light.other) = (*share as f32, threshold, other);
    }
}

/// What shines in an environment from so small a part of the sphere that its shadows are sharper than a light map: the limit above
/// which texels belong to it, and the lights that these are above the limit, with their powers in a scene of `radius`. `angle` is
/// the half angle in radians of a disc as large as such a part can be.
pub(crate) fn compact_sky(sky: &[[f32; 4]], width: u32, angle: f64, radius: f64) -> (f32, Vec<(Light, f64)>) {
    let height = sky.len() / width.max(1) as usize;
    let solid = |texel: usize| {
        let polar = std::f64::consts::PI * ((texel / width as usize) as f64 + 0.5) / height as f64;
        2.0 * std::f64::consts::PI.powi(2) * polar.sin() / sky.len() as f64
    };
    let brightest = |texel: &[f32; 4]| texel[0].max(texel[1]).max(texel[2]);
    let mut order: Vec<u32> = (0..sky.len() as u32).collect();
    // The order of equals does not matter: what is above the limit is brighter than all of them.
    order.sort_unstable_by(|a, b| brightest(&sky[*b as usize]).total_cmp(&brightest(&sky[*a as usize])));
    let mut left = std::f64::consts::PI * angle * angle;
    let first_below = order.iter().find(|&&texel| {
        left -= solid(texel as usize);
        left < 0.0
    });
    let limit = first_below.map_or(f32::MAX, |texel| brightest(&sky[*texel as usize]));
    let mut found = Vec::new();
    let mut shares = [0.0; 2];
    for (index, texel) in sky.iter().enumerate() {
        let light = Vec3::new(texel[0], texel[1], texel[2]);
        let above = light * (1.0 - (limit / brightest(texel).max(1e-30)).min(1.0));
        shares[0] += solid(index) * luma(above);
        shares[1] += solid(index) * luma(light);
        if above.max_element() > 0.0 {
            let power = std::f64::consts::PI * radius * radius * solid(index) * luma(above);
            let kind = LIGHT_SKY;
            found.push((Light { kind, slot: index as u32, colour: above.to_array(), ..Light::default() }, power));
        }
    }
    // Glints of a cloud are not worth a ray of their own.
    if shares[0] < MIN_COMPACT * shares[1] { (f32::MAX, Vec::new()) } else { (limit, found) }
}

/// The alias table that draws each number by its weight: a threshold and another number. Sums of many weights, in which small
/// ones would be lost, are never compared with.
fn aliases(weights: &[f64]) -> Vec<Alias> {
    let all: f64 = weights.iter().sum();
    let mut scaled: Vec<f64> = weights.iter().map(|weight| weight / all * weights.len() as f64).collect();
    let mut aliases: Vec<Alias> = (0..weights.len() as u32).map(|i| [u32::MAX, i]).collect();
    let (mut small, mut large): (Vec<u32>, Vec<u32>) =
        (0..weights.len() as u32).partition(|&i| scaled[i as usize] < 1.0);
    while let (Some(low), Some(&high)) = (small.pop(), large.last()) {
        let share = scaled[low as usize];
        aliases[low as usize] = [(share * f64::from(u32::MAX)) as u32, high];
        let rest = &mut scaled[high as usize];
        *rest -= 1.0 - share;
        if *rest < 1.0 {
            large.pop();
            small.push(high);
        }
    }
    aliases
}

/// Mean linear colour of a map over a triangle, from a grid of its texels.
fn mean_over(model: &Model, map: &Map, uvs: [[Vec2; 2]; 3]) -> Vec3 {
    const STEPS: u32 = 8;
    let image = &model.images[map.image as usize];
    let mut sum = Vec3::ZERO;
    let mut count = 0.0;
    for i in 0..STEPS {
        for j in 0..STEPS - i {
            let at = |k: u32| (k as f32 + 1.0 / 3.0) / STEPS as f32;
            let [a, b, c] = uvs.map(|uv| uv[map.set as usize]);
            let uv = a + at(i) * (b - a) + at(j) * (c - a);
            let place = map.transform.transform_point2(uv);
            let texel = |t: f32, size: u32, wrap: Wrap| {
                let t = match wrap {
                    Wrap::Clamp => t.clamp(0.0, 1.0),
                    Wrap::Mirror => 1.0 - (t.rem_euclid(2.0) - 1.0).abs(),
                    Wrap::Repeat => t.rem_euclid(1.0),
                };
                ((t * size as f32) as u32).min(size - 1)
            };
            let [x, y] = [texel(place.x, image.width, map.wrap[0]), texel(place.y, image.height, map.wrap[1])];
            let [r, g, b, _] = image.pixels[(y * image.width + x) as usize].map(|v| linear(v) as f32);
            sum += Vec3::new(r, g, b);
            count += 1.0;
        }
    }
    sum / count
}

/// The environment's texels with the density by area of the map at which each is drawn, and the alias table that draws them: by
/// luma and by the solid angle of their row.
pub(crate) fn sky(environment: &Environment) -> (Vec<[f32; 4]>, Vec<Alias>) {
    sky_of(&environment.radiance, environment.width, f32::MAX)
}

/// As [`sky`]; texels are drawn as if none were brighter than a limit.
pub(crate) fn sky_of(radiance: &[Vec3], width: u32, limit: f32) -> (Vec<[f32; 4]>, Vec<Alias>) {
    let (count, width) = (radiance.len(), width as usize);
    let height = count / width;
    let weight = |i: usize| {
        let polar = std::f64::consts::PI * ((i / width) as f64 + 0.5) / height as f64;
        // The mean of the three keeps pure blues from being forgotten.
        let light = radiance[i] * (limit / radiance[i].max_element().max(1e-30)).min(1.0);
        (luma(light) + f64::from(light.element_sum()) / 3.0) * polar.sin()
    };
    let weights: Vec<f64> = (0..count).map(weight).collect();
    let all: f64 = weights.iter().sum();
    let density = |weight: &f64| (weight / all * count as f64) as f32;
    let texel = |(light, weight): (&Vec3, &f64)| light.extend(density(weight)).to_array();
    (radiance.iter().zip(&weights).map(texel).collect(), aliases(&weights))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::model::{Face, Material, Vertex};

    /// How often each number is drawn, times how many there are.
    fn drawn(aliases: &[Alias]) -> Vec<f64> {
        let mut drawn = vec![0.0f64; aliases.len()];
        for (i, [threshold, other]) in aliases.iter().enumerate() {
            let share = f64::from(*threshold) / f64::from(u32::MAX);
            drawn[i] += share;
            drawn[*other as usize] += 1.0 - share;
        }
        drawn
    }

    /// If this failed, small lights among many would be drawn more or less often than what they give is divided by.
    #[test]
    fn small_lights_are_drawn_by_their_share() {
        let count = 300_000u32;
        let corner = |i: u32| {
            let size = if i < 3 { 100.0 } else { 1e-3 };
            let position = size * glam::DVec3::new(f64::from(i % 3), f64::from(i % 3 * (i % 3)), 0.0);
            Vertex { position, ..Vertex::default() }
        };
        let model = Model {
            vertices: (0..6).map(corner).collect(),
            faces: (0..count)
                .map(|i| Face { corners: if i == 0 { [0, 1, 2] } else { [3, 4, 5] }, material: 0 })
                .collect(),
            materials: vec![Material { emission: Vec3::ONE, ..Material::default() }],
            ..Model::default()
        };
        let sources = lights(&model, glam::DVec3::ZERO, 1.0);
        let powers: Vec<f64> = sources.iter().map(|source| source.power).collect();
        let mut lights: Vec<Light> = sources.into_iter().map(|source| source.light).collect();
        share_out(&mut lights, &powers);
        let aliases: Vec<Alias> = lights.iter().map(|light| [light.threshold, light.other]).collect();
        let drawn = drawn(&aliases);
        assert!(lights[1].share < 6e-8, "{}", lights[1].share);
        for (drawn, light) in drawn.iter().zip(&lights) {
            let share = f64::from(light.share) * f64::from(count);
            assert!((drawn / share - 1.0).abs() < 1e-5, "{drawn} {share}");
        }
    }

    /// If this failed, parts of the sky would be drawn more often than their density implies, and light with them.
    #[test]
    fn the_alias_table_draws_texels_by_their_density() {
        let (width, height) = (16, 8);
        let radiance = (0..128).map(|i| Vec3::new(((i * 37) % 11) as f32, 0.1, ((i * 53) % 7) as f32)).collect();
        let (texels, aliases) = sky(&Environment { width, height, radiance });
        let drawn = drawn(&aliases);
        for (drawn, texel) in drawn.iter().zip(&texels) {
            assert!((drawn - f64::from(texel[3])).abs() < 1e-5, "{drawn} {}", texel[3]);
        }
    }
}

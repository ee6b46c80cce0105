//! A model and its light as flat arrays for the device.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use super::layout::{
    ALPHA_BLEND, ALPHA_MASK, Alias, DOUBLE_SIDED, Face, LIGHT_TRIANGLE, Light, Map, Material, NONE, SECOND_SET, SRGB,
    Setting, UNLIT, VOLUME, Vertex, WRAP,
};
use super::{albedo, lights};
use crate::scene::model::{self, Alpha, Environment, Model, Wrap};
use crate::scene::proxy::Occluder;
use crate::scene::similarity::Similarity;
use crate::visibility::bvh::{Bvh, Node, Primitives, Triangle};
use crate::{Error, Result};

/// Indices of refraction nearer to 1 than this bend nothing, and leave no normal to be found from two directions.
const MIN_IOR: f32 = 1.01;
/// Half angle in radians of a disc as large as what is looked for apart from the rest of an environment: a sun, hazy ones too.
const COMPACT: f64 = 0.1;

/// Everything that the device needs, about the origin.
#[derive(Clone)]
pub struct Assembly {
    /// Place of the origin in the world.
    pub centre: DVec3,
    /// Half the sides of the scene's bounds around it.
    pub half: DVec3,
    /// The hierarchy over the triangles, for rays on the host.
    pub bvh: Bvh,
    pub(super) primitives: Vec<Triangle>,
    pub(super) vertices: Vec<Vertex>,
    pub(super) faces: Vec<Face>,
    pub(super) materials: Vec<Material>,
    pub(super) maps: Vec<Map>,
    pub(super) texels: Vec<[u8; 4]>,
    pub(super) lights: Vec<Light>,
    /// Power of each of the lights.
    powers: Vec<f64>,
    pub(super) sky: Vec<[f32; 4]>,
    pub(super) aliases: Vec<Alias>,
    pub(super) albedo: Vec<f32>,
    pub(super) setting: Setting,
    /// By triangle of the model: whether its back is nothing that a camera should see.
    pub single_sided: Vec<bool>,
}

impl Assembly {
    /// Lays a model out.
    ///
    /// # Errors
    /// Where there is no light at all, no triangle, or coordinates pass single precision.
    pub fn new(model: &Model, environment: Option<&Environment>) -> Result<Self> {
        if model.faces.is_empty() {
            return Err(Error::request("the scene has no triangles; give one that can be seen"));
        }
        let positions =
            || model.faces.iter().flat_map(|face| face.corners).map(|v| model.vertices[v as usize].position);
        let lo = positions().fold(DVec3::INFINITY, DVec3::min);
        let hi = positions().fold(DVec3::NEG_INFINITY, DVec3::max);
        let centre = 0.5 * (lo + hi);
        let radius = (0.5 * (hi - lo).length()).max(f64::from(f32::MIN_POSITIVE));
        let unlit = model.faces.iter().any(|face| model.materials[face.material as usize].unlit);
        let found = lights::lights(model, centre, radius);
        if found.is_empty() && environment.is_none() && !unlit {
            return Err(Error::request(
                "the scene has no light: no lamp, nothing that emits, no environment; give an environment map with `env`",
            ));
        }
        let corner = |face: &model::Face| face.corners.map(|v| model.vertices[v as usize].position);
        let occluder = Occluder::Triangles(model.faces.iter().map(corner).collect());
        let bvh = Bvh::new(&occluder, &Similarity { translation: -centre, ..Similarity::IDENTITY })?;
        let Primitives::Triangles(primitives) = &bvh.primitives else {
            return Err(Error::request("the scene is made of discs; give triangles"));
        };

        let mut light_of = vec![NONE; model.faces.len()];
        for (number, source) in found.iter().enumerate() {
            if let Some(face) = source.face {
                light_of[face as usize] = number as u32;
            }
        }
        let powers: Vec<f64> = found.iter().map(|source| source.power).collect();
        let mut lights: Vec<Light> = found.into_iter().map(|source| source.light).collect();
        lights::share_out(&mut lights, &powers);
        let mut primitives = primitives.clone();
        let mut faces = Vec::with_capacity(primitives.len());
        for (slot, primitive) in primitives.iter_mut().enumerate() {
            let index = primitive.index as usize;
            let model::Face { corners: [a, b, c], material } = model.faces[index];
            let light = light_of[index];
            if let Some(light) = lights.get_mut(light as usize).filter(|light| light.kind == LIGHT_TRIANGLE) {
                light.slot = slot as u32;
            }
            if model.materials[material as usize].alpha != Alpha::Opaque {
                primitive.pad0 = 1f32.to_bits();
            }
            faces.push(Face { a, b, c, material, light });
        }

        let mut texels = Vec::new();
        let mut offsets = Vec::with_capacity(model.images.len());
        for image in &model.images {
            offsets.push(texels.len() as u32);
            texels.extend_from_slice(&image.pixels);
        }
        let mut tables = Tables { albedo: albedo::common().to_vec(), glass: HashMap::new() };
        let mut maps = Maps { model, offsets, maps: Vec::new() };
        let materials = model.materials.iter().map(|material| laid_out(material, &mut maps, &mut tables)).collect();
        let (sky, aliases) = environment.map(lights::sky).unwrap_or_default();
        let setting = Setting {
            sky_width: environment.map_or(0, |sky| sky.width),
            sky_height: environment.map_or(0, |sky| sky.height),
            lights: lights.len() as u32,
            sky_share: match (environment.is_some(), lights.is_empty()) {
                (true, true) => 1.0,
                (true, false) => 0.5,
                (false, _) => 0.0,
            },
            radius: radius as f32,
            compact: 0,
            sky_limit: f32::MAX,
        };
        let vertex = |vertex: &model::Vertex| Vertex {
            normal: vertex.normal.to_array(),
            colour: u32::from_le_bytes(vertex.colour),
            tangent: vertex.tangent.to_array(),
            uv0: vertex.uvs[0].to_array(),
            uv1: vertex.uvs[1].to_array(),
        };
        let single_sided = |face: &model::Face| {
            let material = &model.materials[face.material as usize];
            !material.double_sided && material.transmission == 0.0
        };
        Ok(Self {
            centre,
            half: 0.5 * (hi - lo),
            primitives,
            vertices: model.vertices.iter().map(vertex).collect(),
            faces,
            materials,
            maps: maps.maps,
            texels,
            lights,
            powers,
            sky,
            aliases,
            albedo: tables.albedo,
            setting,
            single_sided: model.faces.iter().map(single_sided).collect(),
            bvh,
        })
    }

    /// Sources of light that are looked for, without the environment.
    pub fn lights(&self) -> usize {
        self.lights.len()
    }

    /// The same scene as it is photographed with a light map: lamps without extent, and what of the environment casts sharp shadows, come
    /// after the other lights and are chosen among one another.
    pub(super) fn for_light_map(&self) -> Self {
        let mut laid_out = self.clone();
        let Setting { sky_width: width, radius, .. } = self.setting;
        let is_lamp = |light: &Light| light.kind != LIGHT_TRIANGLE;
        // Emitting triangles come first as it is, and faces know them by their numbers.
        let wide = self.lights.iter().take_while(|light| !is_lamp(light)).count();
        let mut powers = self.powers.clone();
        let mut limit = f32::MAX;
        if width > 0 {
            let compact = lights::compact_sky(&self.sky, width, COMPACT, f64::from(radius));
            limit = compact.0;
            for (light, power) in compact.1 {
                laid_out.lights.push(light);
                powers.push(power);
            }
            let radiance: Vec<Vec3> = self.sky.iter().map(|texel| Vec3::new(texel[0], texel[1], texel[2])).collect();
            (laid_out.sky, laid_out.aliases) = lights::sky_of(&radiance, width, limit);
        }
        let (emitters, compact) = laid_out.lights.split_at_mut(wide);
        lights::share_out(emitters, &powers[..wide]);
        lights::share_out(compact, &powers[wide..]);
        let sky_share = match (width > 0, wide) {
            (true, 0) => 1.0,
            (true, _) => 0.5,
            (false, _) => 0.0,
        };
        let compact = compact.len() as u32;
        laid_out.setting = Setting { lights: wide as u32, compact, sky_share, sky_limit: limit, ..self.setting };
        laid_out
    }

    /// Whether a place in the world lies within the bounds of the scene.
    pub fn contains(&self, place: DVec3) -> bool {
        (place - self.centre).abs().cmple(self.half).all()
    }

    /// A checksum of everything that photographs depend on.
    pub fn checksum(&self) -> u32 {
        let mut hasher = crc32fast::Hasher::new();
        let parts: [&[u8]; 8] = [
            bytemuck::cast_slice(&self.primitives),
            bytemuck::cast_slice(&self.vertices),
            bytemuck::cast_slice(&self.faces),
            bytemuck::cast_slice(&self.materials),
            bytemuck::cast_slice(&self.maps),
            bytemuck::cast_slice(&self.texels),
            bytemuck::cast_slice(&self.lights),
            bytemuck::cast_slice(&self.sky),
        ];
        parts.iter().for_each(|part| hasher.update(part));
        hasher.update(bytemuck::bytes_of(&self.centre.to_array()));
        hasher.finalize()
    }

    /// The buffers by name and bytes.
    pub fn footprint(&self) -> Vec<(&'static str, u64)> {
        vec![
            ("nodes", size_of_val::<[Node]>(&self.bvh.nodes) as u64),
            ("primitives", size_of_val(&self.primitives[..]) as u64),
            ("vertices", size_of_val(&self.vertices[..]) as u64),
            ("faces", size_of_val(&self.faces[..]) as u64),
            ("materials", size_of_val(&self.materials[..]) as u64),
            ("maps", size_of_val(&self.maps[..]) as u64),
            ("texels", size_of_val(&self.texels[..]) as u64),
            ("lights", size_of_val(&self.lights[..]) as u64),
            ("sky", size_of_val(&self.sky[..]) as u64),
            ("aliases", size_of_val(&self.aliases[..]) as u64),
            ("albedo", size_of_val(&self.albedo[..]) as u64),
            ("setting", size_of::<Setting>() as u64),
        ]
    }
}

/// Tables of albedo; those of glass by the bits of its index of refraction.
struct Tables {
    albedo: Vec<f32>,
    glass: HashMap<u32, u32>,
}

impl Tables {
    fn glass(&mut self, ior: f32) -> u32 {
        *self.glass.entry(ior.to_bits()).or_insert_with(|| {
            let first = self.albedo.len() as u32;
            self.albedo.extend(albedo::glass(ior));
            first
        })
    }
}

/// Maps while they are laid out.
struct Maps<'a> {
    model: &'a Model,
    /// First texel of each image.
    offsets: Vec<u32>,
    maps: Vec<Map>,
}

impl Maps<'_> {
    fn add(&mut self, map: Option<model::Map>, flags: u32) -> u32 {
        let Some(model::Map { image, set, transform, wrap }) = map else { return NONE };
        let wrapped = wrap.iter().zip(WRAP).map(|(wrap, shift)| {
            let mode = match wrap {
                Wrap::Repeat => 0,
                Wrap::Clamp => 1,
                Wrap::Mirror => 2,
            };
            mode << shift
        });
        let picture = &self.model.images[image as usize];
        let set = if set == 1 { SECOND_SET } else { 0 };
        self.maps.push(Map {
            row0: transform.row(0).to_array(),
            offset: self.offsets[image as usize],
            row1: transform.row(1).to_array(),
            flags: flags | set | wrapped.sum::<u32>(),
            width: picture.width,
            height: picture.height,
            ..Map::default()
        });
        self.maps.len() as u32 - 1
    }
}

fn laid_out(material: &model::Material, maps: &mut Maps<'_>, tables: &mut Tables) -> Material {
    let flag = |condition: bool, flag: u32| if condition { flag } else { 0 };
    let (alpha_flag, cutoff) = match material.alpha {
        Alpha::Opaque => (0, 0.0),
        Alpha::Mask(cutoff) => (ALPHA_MASK, cutoff),
        Alpha::Blend => (ALPHA_BLEND, 0.0),
    };
    let refracts = material.volume && material.transmission > 0.0;
    let ior = if refracts { material.ior.max(MIN_IOR) } else { material.ior };
    Material {
        base: material.base.truncate().to_array(),
        alpha: material.base.w,
        emission: material.emission.to_array(),
        cutoff,
        absorption: material.absorption.to_array(),
        ior,
        specular_colour: material.specular_colour.to_array(),
        specular: material.specular,
        sheen: material.sheen.to_array(),
        sheen_roughness: material.sheen_roughness,
        metallic: material.metallic,
        roughness: material.roughness,
        transmission: material.transmission,
        clearcoat: material.clearcoat,
        clearcoat_roughness: material.clearcoat_roughness,
        normal_scale: material.normal_scale,
        clearcoat_normal_scale: material.clearcoat_normal_scale,
        flags: alpha_flag
            | flag(material.double_sided, DOUBLE_SIDED)
            | flag(material.unlit, UNLIT)
            | flag(refracts, VOLUME),
        base_map: maps.add(material.base_map, SRGB),
        metallic_roughness_map: maps.add(material.metallic_roughness_map, 0),
        normal_map: maps.add(material.normal_map, 0),
        emission_map: maps.add(material.emission_map, SRGB),
        transmission_map: maps.add(material.transmission_map, 0),
        clearcoat_map: maps.add(material.clearcoat_map, 0),
        clearcoat_roughness_map: maps.add(material.clearcoat_roughness_map, 0),
        clearcoat_normal_map: maps.add(material.clearcoat_normal_map, 0),
        sheen_map: maps.add(material.sheen_map, SRGB),
        sheen_roughness_map: maps.add(material.sheen_roughness_map, 0),
        specular_map: maps.add(material.specular_map, 0),
        specular_colour_map: maps.add(material.specular_colour_map, SRGB),
        glass: if refracts { tables.glass(ior) } else { NONE },
        ..Material::default()
    }
}

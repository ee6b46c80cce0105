//! A scene to be photographed: triangles with materials, textures and lamps, and the light from far around.

use glam::{DVec3, Mat3, Vec2, Vec3, Vec4};

use super::surface::{Mesh, Surface};

/// A scene to be photographed, in the frame of its file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// Vertices, which triangles name by index.
    pub vertices: Vec<Vertex>,
    /// Triangles, counter-clockwise from their front.
    pub faces: Vec<Face>,
    /// Materials, which triangles name by index.
    pub materials: Vec<Material>,
    /// Pictures that the materials' maps show.
    pub images: Vec<Image>,
    /// Lamps without extent.
    pub lamps: Vec<Lamp>,
    /// Triangles that were left out: without area, or with a corner that is not finite.
    pub dropped: usize,
}

impl Model {
    /// Its triangles alone.
    pub fn surface(&self) -> Surface {
        let positions = self.vertices.iter().map(|vertex| vertex.position).collect();
        let triangles = self.faces.iter().map(|face| face.corners).collect();
        Surface::Mesh(Mesh { positions, triangles, ..Mesh::default() })
    }
}

/// A corner of triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vertex {
    /// Where it is.
    pub position: DVec3,
    /// Unit normal; zero where the triangle's own holds.
    pub normal: Vec3,
    /// Unit tangent along the first texture coordinate of the normal map, and the sign of the bitangent
    /// `w * cross(normal, tangent)`; zero where there is none.
    pub tangent: Vec4,
    /// Two sets of texture coordinates.
    pub uvs: [Vec2; 2],
    /// Linear factor of base colour and alpha.
    pub colour: [u8; 4],
}

/// A triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Face {
    /// Its vertices.
    pub corners: [u32; 3],
    /// Its material.
    pub material: u32,
}

/// What becomes of light where alpha is below 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Alpha {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// There is nothing where alpha is below this.
    Mask(f32),
    /// As much of the light passes as alpha is short of 1.
    Blend,
}

/// A material in the terms of glTF 2.0 and its extensions. Colours are linear; a map's texel is multiplied by its factor.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Base colour and alpha.
    pub base: Vec4,
    /// Map of the base colour, sRGB, and of alpha.
    pub base_map: Option<Map>,
    /// What alpha does.
    pub alpha: Alpha,
    /// Whether the back is lit and shines as the front does.
    pub double_sided: bool,
    /// The base colour is what is seen, whatever the light.
    pub unlit: bool,
    /// Share of a metal.
    pub metallic: f32,
    /// Perceptual roughness, the root of the width of the microfacets' slopes.
    pub roughness: f32,
    /// Map of roughness (green) and metallic (blue).
    pub metallic_roughness_map: Option<Map>,
    /// Normal map in tangent space.
    pub normal_map: Option<Map>,
    /// Factor of its x and y.
    pub normal_scale: f32,
    /// Radiance, strength included.
    pub emission: Vec3,
    /// Its map, sRGB.
    pub emission_map: Option<Map>,
    /// Index of refraction.
    pub ior: f32,
    /// Factor of a dielectric's reflection.
    pub specular: f32,
    /// Its map (alpha).
    pub specular_map: Option<Map>,
    /// Colour of a dielectric's reflection from straight ahead.
    pub specular_colour: Vec3,
    /// Its map, sRGB.
    pub specular_colour_map: Option<Map>,
    /// Share of the light not reflected that passes through.
    pub transmission: f32,
    /// Its map (red).
    pub transmission_map: Option<Map>,
    /// Whether the surface bounds a body that refracts; a thin sheet where it does not.
    pub volume: bool,
    /// Absorption in the body, by world unit.
    pub absorption: Vec3,
    /// Share of a clear coat.
    pub clearcoat: f32,
    /// Its map (red).
    pub clearcoat_map: Option<Map>,
    /// Perceptual roughness of the coat.
    pub clearcoat_roughness: f32,
    /// Its map (green).
    pub clearcoat_roughness_map: Option<Map>,
    /// Normal map of the coat, whose own normal is the vertices' where there is none.
    pub clearcoat_normal_map: Option<Map>,
    /// Factor of its x and y.
    pub clearcoat_normal_scale: f32,
    /// Colour of sheen; black for none.
    pub sheen: Vec3,
    /// Its map, sRGB.
    pub sheen_map: Option<Map>,
    /// Perceptual roughness of the sheen.
    pub sheen_roughness: f32,
    /// Its map (alpha).
    pub sheen_roughness_map: Option<Map>,
}

impl Material {
    /// The grey of scenes that have no materials.
    pub fn grey() -> Self {
        Self { base: Vec4::new(0.5, 0.5, 0.5, 1.0), metallic: 0.0, ..Self::default() }
    }

    /// Whether light comes from it.
    pub fn shines(&self) -> bool {
        self.emission.max_element() > 0.0 && !self.unlit
    }

    /// All images on it.
    pub fn maps(&self) -> impl Iterator<Item = Map> {
        let maps = [
            self.base_map,
            self.metallic_roughness_map,
            self.normal_map,
            self.emission_map,
            self.specular_map,
            self.specular_colour_map,
            self.transmission_map,
            self.clearcoat_map,
            self.clearcoat_roughness_map,
            self.clearcoat_normal_map,
            self.sheen_map,
            self.sheen_roughness_map,
        ];
        maps.into_iter().flatten()
    }
}

impl Default for Material {
    /// The default of glTF: a rough white metal.
    fn default() -> Self {
        Self {
            base: Vec4::ONE,
            base_map: None,
            alpha: Alpha::Opaque,
            double_sided: false,
            unlit: false,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_map: None,
            normal_map: None,
            normal_scale: 1.0,
            emission: Vec3::ZERO,
            emission_map: None,
            ior: 1.5,
            specular: 1.0,
            specular_map: None,
            specular_colour: Vec3::ONE,
            specular_colour_map: None,
            transmission: 0.0,
            transmission_map: None,
            volume: false,
            absorption: Vec3::ZERO,
            clearcoat: 0.0,
            clearcoat_map: None,
            clearcoat_roughness: 0.0,
            clearcoat_roughness_map: None,
            clearcoat_normal_map: None,
            clearcoat_normal_scale: 1.0,
            sheen: Vec3::ZERO,
            sheen_map: None,
            sheen_roughness: 0.0,
            sheen_roughness_map: None,
        }
    }
}

/// How texture coordinates wrap past an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// From the start.
    #[default]
    Repeat,
    /// The edge's colour.
    Clamp,
    /// Back again.
    Mirror,
}

/// An image on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Map {
    /// The image.
    pub image: u32,
    /// Which texture coordinates it takes, 0 or 1.
    pub set: u32,
    /// What they are multiplied by, as (u, v, 1), to be coordinates of the image: (0, 0) is its top left corner.
    pub transform: Mat3,
    /// Past the image in u and v.
    pub wrap: [Wrap; 2],
}

/// Eight bits of red, green, blue and alpha, from the top left, as the file has them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Columns of texels.
    pub width: u32,
    /// Rows of texels.
    pub height: u32,
    /// Texels, row by row: 8-bit RGBA.
    pub pixels: Vec<[u8; 4]>,
}

/// What a lamp without extent does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LampKind {
    /// The same to all sides.
    Point,
    /// A cone; half angles in radians up to which it shines fully, and from which it does not.
    Spot {
        /// Where it begins to fade.
        inner: f32,
        /// Where it ends.
        outer: f32,
    },
    /// Parallel light along its direction.
    Directional,
}

/// A lamp without extent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// What it does.
    pub kind: LampKind,
    /// Where it hangs.
    pub position: DVec3,
    /// Unit direction in which it shines.
    pub direction: Vec3,
    /// Radiant intensity, or irradiance of a directional lamp, in the units of the scene.
    pub colour: Vec3,
    /// Distance at which it has faded; infinite by nature.
    pub range: f32,
}

/// Light from infinitely far, by direction. Up is +Y: row 0 is there, and `u = 0.5 + atan2(z, x) / 2 pi`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Environment {
    /// Columns of texels.
    pub width: u32,
    /// Rows, half as many as there are columns.
    pub height: u32,
    /// Radiance, by row.
    pub radiance: Vec<Vec3>,
}

impl Environment {
    /// The same from everywhere.
    pub fn uniform(radiance: Vec3) -> Self {
        Self { width: 4, height: 2, radiance: vec![radiance; 8] }
    }

    /// Half as wide and high.
    pub fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let at = |x: u32, y: u32| self.radiance[(y * self.width + x) as usize];
        let texel = |i: u32| {
            let (x, y) = (2 * (i % width), 2 * (i / width));
            0.25 * (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1))
        };
        Self { width, height, radiance: (0..width * height).map(texel).collect() }
    }
}

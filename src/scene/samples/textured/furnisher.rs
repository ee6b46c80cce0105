//! A model in the making: finishes, flat pieces and boxes, in frames of their own.

use glam::{DAffine3, DVec3, Mat3, Vec2, Vec3, Vec4};

use super::texture::Texture;
use crate::scene::colour::linear;
use crate::scene::model::{Face, Map, Material, Model, Vertex, Wrap};
use crate::scene::random;

/// Seed of where boards are cut from, so that no two look the same.
const CUTS: u64 = 0x6375_7473;
/// What pieces that lie on one another are apart.
pub(super) const APART: f64 = 0.002;

/// How light leaves a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Gloss {
    /// The same to all sides.
    Matt,
    /// As of painted or oiled wood.
    Satin,
    /// As of a floor.
    Varnished,
    /// Below a clear coat.
    Glazed,
    /// Brushed metal.
    Metal,
    /// It shines itself, by so much where the texture is white.
    Shining(f32),
}

/// What a surface looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Finish {
    texture: Texture,
    tint: [u8; 3],
    gloss: Gloss,
}

impl Finish {
    /// A matt texture in its own colours.
    pub const fn of(texture: Texture) -> Self {
        Self { texture, tint: [255; 3], gloss: Gloss::Matt }
    }

    /// The same, multiplied by an sRGB colour.
    pub const fn tinted(self, r: u8, g: u8, b: u8) -> Self {
        Self { tint: [r, g, b], ..self }
    }

    /// The same with another gloss.
    pub const fn with(self, gloss: Gloss) -> Self {
        Self { gloss, ..self }
    }

    fn material(&self, image: u32) -> Material {
        let tint = Vec3::from(self.tint.map(|v| linear(v) as f32));
        let map = Some(Map { image, set: 0, transform: Mat3::IDENTITY, wrap: [Wrap::Repeat; 2] });
        let matt = Material {
            base: tint.extend(1.0),
            base_map: map,
            metallic: 0.0,
            roughness: 0.95,
            double_sided: true,
            ..Material::default()
        };
        match self.gloss {
            Gloss::Matt => matt,
            Gloss::Satin => Material { roughness: 0.6, ..matt },
            Gloss::Varnished => Material { roughness: 0.42, ..matt },
            Gloss::Glazed => Material { roughness: 0.6, clearcoat: 1.0, clearcoat_roughness: 0.12, ..matt },
            Gloss::Metal => Material { metallic: 1.0, roughness: 0.38, ..matt },
            Gloss::Shining(radiance) => Material {
                base: Vec4::new(0.2, 0.2, 0.2, 1.0),
                base_map: None,
                emission: radiance * tint,
                emission_map: map,
                double_sided: false,
                ..matt
            },
        }
    }
}

/// A model that pieces are added to.
pub(crate) struct Furnisher<'m> {
    pub(super) model: &'m mut Model,
    /// From the piece's frame to the model's.
    frame: DAffine3,
    images: Vec<(Texture, u32)>,
    materials: Vec<(Finish, u32)>,
    pieces: u32,
}

impl<'m> Furnisher<'m> {
    /// Adds to a model what is made in a frame of its own: in metres, +Y up.
    pub fn new(model: &'m mut Model, frame: DAffine3) -> Self {
        Self { model, frame, images: Vec::new(), materials: Vec::new(), pieces: 0 }
    }

    /// Makes something in a frame with its origin at a place, turned about the vertical so that its +Z is at so many degrees from
    /// +Z to +X.
    pub fn at(&mut self, origin: DVec3, degrees: f64, make: impl FnOnce(&mut Self)) {
        // Quarter turns exactly, so that what is flush with walls stays so.
        let quarters = degrees / 90.0;
        let (sin, cos) = if quarters.fract() == 0.0 {
            [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][(quarters as i64).rem_euclid(4) as usize]
        } else {
            degrees.to_radians().sin_cos()
        };
        let axes = [DVec3::new(cos, 0.0, -sin), DVec3::Y, DVec3::new(sin, 0.0, cos)];
        self.moved(DAffine3::from_cols(axes[0], axes[1], axes[2], origin), make);
    }

    /// Makes something in a frame that lies in this one as said.
    pub(super) fn moved(&mut self, frame: DAffine3, make: impl FnOnce(&mut Self)) {
        let outer = self.frame;
        self.frame = outer * frame;
        make(self);
        self.frame = outer;
    }

    /// Where a piece begins on the texture of its finish, in parts of it: each somewhere else, but for textures that are shown once.
    pub(super) fn cut(&mut self, finish: Finish) -> [f64; 2] {
        if finish.texture.span() == [1.0; 2] {
            return [0.0; 2];
        }
        self.pieces += 1;
        let [a, b, ..] = random::uniforms(CUTS, 0, self.pieces);
        [a, b]
    }

    /// A vertex at a place in the frame with a normal, and its texture coordinates.
    pub(super) fn vertex(&mut self, position: DVec3, normal: DVec3, uv: [f64; 2]) -> u32 {
        let uv = Vec2::new(uv[0] as f32, uv[1] as f32);
        self.model.vertices.push(Vertex {
            position: self.frame.transform_point3(position),
            normal: self.frame.transform_vector3(normal).normalize_or_zero().as_vec3(),
            colour: [255; 4],
            uvs: [uv; 2],
            ..Vertex::default()
        });
        self.model.vertices.len() as u32 - 1
    }

    /// Two triangles with a common side, from corners counter-clockwise.
    pub(super) fn faces(&mut self, [a, b, c, d]: [u32; 4], material: u32) {
        self.model.faces.extend([[a, b, c], [a, c, d]].map(|corners| Face { corners, material }));
    }

    /// A parallelogram from a corner along two sides, which faces `sides[0] x sides[1]`, with texture coordinates of its corners
    /// in this order: at the corner, along the first side, along both, along the second.
    pub(super) fn quad(&mut self, corner: DVec3, [u, v]: [DVec3; 2], uvs: [[f64; 2]; 4], material: u32) {
        let normal = u.cross(v).normalize();
        let places = [corner, corner + u, corner + u + v, corner + v];
        let corners = std::array::from_fn(|i| self.vertex(places[i], normal, uvs[i]));
        self.faces(corners, material);
    }

    /// A sheet with a texture that repeats: its u along the first side, its top towards the second.
    pub fn sheet(&mut self, corner: DVec3, [u, v]: [DVec3; 2], finish: Finish) {
        let material = self.material(finish);
        let [wide, high] = finish.texture.span();
        let [a, b] = self.cut(finish);
        let (right, top) = (a + u.length() / wide, b - v.length() / high);
        self.quad(corner, [u, v], [[a, b], [right, b], [right, top], [a, top]], material);
    }

    /// A sheet that shows a piece of a texture, upright where the second side goes up.
    pub fn panel(&mut self, corner: DVec3, sides: [DVec3; 2], finish: Finish, [left, top, right, bottom]: [f64; 4]) {
        let material = self.material(finish);
        self.quad(corner, sides, [[left, bottom], [right, bottom], [right, top], [left, top]], material);
    }

    /// A closed box between two opposite corners, with sides along the axes of the frame; fibres run along the longer sides of its faces.
    pub fn block(&mut self, from: DVec3, to: DVec3, finish: Finish) {
        self.box_but(from, to, finish, DVec3::ZERO);
    }

    /// As [`Furnisher::block`] without the face that looks in a direction, for what covers it.
    pub fn box_but(&mut self, from: DVec3, to: DVec3, finish: Finish, without: DVec3) {
        let (min, max) = (from.min(to), from.max(to));
        let material = self.material(finish);
        let [wide, high] = finish.texture.span();
        let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * (max - min));
        for (u, v) in [(y, x), (z, y), (x, z)] {
            for (corner, [u, v]) in [(min, [u, v]), (max, [-v, -u])] {
                if without != DVec3::ZERO && u.cross(v).normalize().dot(without) > 0.5 {
                    continue;
                }
                let [a, b] = self.cut(finish);
                let (long, short) = (u.length().max(v.length()), u.length().min(v.length()));
                let [right, bottom] = [a + long / wide, b + short / high];
                let uvs = if u.length() >= v.length() {
                    [[a, b], [right, b], [right, bottom], [a, bottom]]
                } else {
                    [[a, b], [a, bottom], [right, bottom], [right, b]]
                };
                self.quad(corner, [u, v], uvs, material);
            }
        }
    }

    /// The material of a finish, made when it is first needed.
    pub(super) fn material(&mut self, finish: Finish) -> u32 {
        if let Some((_, material)) = self.materials.iter().find(|(known, _)| *known == finish) {
            return *material;
        }
        let known = self.images.iter().find(|(texture, _)| *texture == finish.texture).map(|(_, image)| *image);
        let image = known.unwrap_or_else(|| {
            self.model.images.push(finish.texture.image());
            let image = self.model.images.len() as u32 - 1;
            self.images.push((finish.texture, image));
            image
        });
        self.model.materials.push(finish.material(image));
        let index = self.model.materials.len() as u32 - 1;
        self.materials.push((finish, index));
        index
    }

    /// Metres that a finish's texture is wide and high.
    pub(super) fn span(finish: Finish) -> [f64; 2] {
        finish.texture.span()
    }
}

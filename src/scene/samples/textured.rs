//! Textured sheets and blocks, +Y up, which scenes that are photographed are furnished with.

use glam::{DVec3, Mat3, Vec2, Vec3, Vec4};

use crate::scene::model::{Face, Image, Map, Material, Model, Vertex, Wrap};
use crate::scene::random;

/// Side of a texture in pixels.
const SIDE: u32 = 128;
/// Cells of its noise along a side.
const CELLS: u32 = 16;
/// Seed of the textures.
const SEED: u64 = 0x7465_7874;

/// What a sheet or block is covered with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cover {
    /// Planks of many shades.
    Planks,
    /// Plaster with a pattern.
    Plaster,
    /// White boards with dark joints.
    Ceiling,
    /// Squares of two colours; each number has other ones.
    Squares(u32),
}

/// A model that sheets and blocks are added to.
pub(crate) struct Furnisher<'m> {
    model: &'m mut Model,
    /// Length that a texture is wide.
    unit: f64,
    covers: Vec<(Cover, u32)>,
}

impl<'m> Furnisher<'m> {
    /// Adds to a model; textures repeat after `unit`.
    pub fn new(model: &'m mut Model, unit: f64) -> Self {
        Self { model, unit, covers: Vec::new() }
    }

    /// A parallelogram from a corner along two sides, which faces `sides[0] x sides[1]`.
    pub fn sheet(&mut self, corner: DVec3, sides: [DVec3; 2], cover: Cover) {
        let material = self.material(cover);
        self.quad(corner, sides, material);
    }

    /// A sheet that light comes from.
    pub fn lamp(&mut self, corner: DVec3, sides: [DVec3; 2], radiance: Vec3) {
        self.model.materials.push(Material { emission: radiance, ..Material::grey() });
        self.quad(corner, sides, self.model.materials.len() as u32 - 1);
    }

    /// A closed box with sides along the axes.
    pub fn block(&mut self, min: DVec3, max: DVec3, cover: Cover) {
        let material = self.material(cover);
        let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * (max - min));
        for [u, v] in [[y, x], [z, y], [x, z]] {
            self.quad(min, [u, v], material);
            self.quad(max, [-v, -u], material);
        }
    }

    fn quad(&mut self, corner: DVec3, [u, v]: [DVec3; 2], material: u32) {
        let first = self.model.vertices.len() as u32;
        let normal = u.cross(v).normalize().as_vec3();
        for (along, up) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let uv = Vec2::new((along * u.length() / self.unit) as f32, (up * v.length() / self.unit) as f32);
            let position = corner + along * u + up * v;
            self.model.vertices.push(Vertex { position, normal, colour: [255; 4], uvs: [uv; 2], ..Vertex::default() });
        }
        let faces = [[0, 1, 2], [0, 2, 3]];
        self.model.faces.extend(faces.map(|corners| Face { corners: corners.map(|i| first + i), material }));
    }

    fn material(&mut self, cover: Cover) -> u32 {
        if let Some((_, material)) = self.covers.iter().find(|(known, _)| *known == cover) {
            return *material;
        }
        self.model.images.push(texture(cover));
        let image = self.model.images.len() as u32 - 1;
        let base_map = Some(Map { image, set: 0, transform: Mat3::IDENTITY, wrap: [Wrap::Repeat; 2] });
        let roughness = if cover == Cover::Planks { 0.5 } else { 0.9 };
        let material = Material { base: Vec4::ONE, base_map, metallic: 0.0, roughness, ..Material::default() };
        self.model.materials.push(Material { double_sided: true, ..material });
        let index = self.model.materials.len() as u32 - 1;
        self.covers.push((cover, index));
        index
    }
}

fn texture(cover: Cover) -> Image {
    let stream = match cover {
        Cover::Planks => 1,
        Cover::Plaster => 2,
        Cover::Ceiling => 3,
        Cover::Squares(number) => 4 + number,
    };
    let random = |i: u32| random::uniforms(SEED, stream, i);
    // Smooth noise that tiles past the edges.
    let noise = |x: f64, y: f64| {
        let at = |i: u32, j: u32| random(1000 + (j % CELLS) * CELLS + i % CELLS)[0];
        let (x, y) = (x * f64::from(CELLS), y * f64::from(CELLS));
        let (i, j, s, t) = (x as u32, y as u32, x.fract(), y.fract());
        let along = |j: u32| at(i, j) + s * (at(i + 1, j) - at(i, j));
        along(j) + t * (along(j + 1) - along(j))
    };
    let mix = |a: DVec3, b: DVec3, t: f64| a + t * (b - a);
    let colour = |x: f64, y: f64| match cover {
        Cover::Planks => {
            let row = (8.0 * y) as u32;
            let plank = row * 4 + (3.0 * (x + random(row)[1]).fract()) as u32;
            let shade = 0.45 + 0.4 * random(100 + plank)[0] + 0.2 * noise(x, (4.0 * y).fract());
            shade * DVec3::new(0.75, 0.52, 0.34)
        }
        Cover::Plaster => {
            let motif = f64::from(u8::from(((6.0 * x).fract() - 0.5).hypot((6.0 * y).fract() - 0.5) < 0.22));
            mix(DVec3::new(0.78, 0.76, 0.68), DVec3::new(0.42, 0.52, 0.6), 0.6 * motif) * (0.75 + 0.3 * noise(x, y))
        }
        Cover::Ceiling => {
            let joint = (4.0 * x).fract() < 0.06 || (2.0 * y).fract() < 0.03;
            let board = 0.75 + 0.2 * random(200 + (4.0 * x) as u32 + 4 * (2.0 * y) as u32)[0];
            board * if joint { 0.45 } else { 0.9 + 0.1 * noise(x, y) } * DVec3::new(1.0, 0.98, 0.94)
        }
        Cover::Squares(_) => {
            let [r, g, b, _] = random(0);
            let odd = ((6.0 * x) as u32 + (6.0 * y) as u32) % 2;
            let base = DVec3::new(0.25 + 0.6 * r, 0.25 + 0.6 * g, 0.25 + 0.6 * b);
            mix(base, DVec3::ONE - base, 0.55 * f64::from(odd)) * (0.7 + 0.35 * noise(x, y))
        }
    };
    let pixel = |i: u32| {
        let (x, y) = (f64::from(i % SIDE) / f64::from(SIDE), f64::from(i / SIDE) / f64::from(SIDE));
        let [r, g, b] = colour(x, y).to_array().map(|v| (255.0 * v.clamp(0.0, 1.0)).round() as u8);
        [r, g, b, 255]
    };
    Image { width: SIDE, height: SIDE, pixels: (0..SIDE * SIDE).map(pixel).collect() }
}

/// Two furnished rooms with a door between them, lit by panels in their ceilings; +Y up, in metres, the floor at 0. The larger one
/// goes from (0, 0, 0) to (6, 2.6, 5), the smaller one from x = 6.1 to 10.
pub fn two_rooms_model() -> Model {
    let mut model = Model::default();
    let mut add = Furnisher::new(&mut model, 1.6);
    let v = DVec3::new;
    let (height, depth, door) = (2.6, 5.0, 2.05);
    for (low, high) in [(0.0, 6.0), (6.1, 10.0)] {
        let wide = v(high - low, 0.0, 0.0);
        let (up, deep) = (v(0.0, height, 0.0), v(0.0, 0.0, depth));
        add.sheet(v(low, 0.0, 0.0), [deep, wide], Cover::Planks);
        add.sheet(v(low, height, 0.0), [wide, deep], Cover::Ceiling);
        add.sheet(v(low, 0.0, 0.0), [wide, up], Cover::Plaster);
        add.sheet(v(high, 0.0, depth), [-wide, up], Cover::Plaster);
    }
    let (up, deep) = (v(0.0, height, 0.0), v(0.0, 0.0, depth));
    add.sheet(v(0.0, 0.0, depth), [-deep, up], Cover::Squares(1));
    add.sheet(v(10.0, 0.0, 0.0), [deep, up], Cover::Squares(2));
    // The wall between the rooms is a piece on either side of the door and one above it.
    add.block(v(6.0, 0.0, 0.0), v(6.1, height, 2.1), Cover::Plaster);
    add.block(v(6.0, 0.0, 3.0), v(6.1, height, depth), Cover::Plaster);
    add.block(v(6.0, door, 2.1), v(6.1, height, 3.0), Cover::Plaster);
    add.sheet(v(6.0, 0.0, 2.1), [v(0.0, 0.0, 0.9), v(0.1, 0.0, 0.0)], Cover::Planks);
    for (i, (min, max)) in [
        // A sofa, a table, a shelf and a stool; a bed, a wardrobe and a desk.
        (v(0.1, 0.0, 1.2), v(1.0, 0.45, 3.6)),
        (v(0.1, 0.45, 1.2), v(0.35, 0.95, 3.6)),
        (v(2.2, 0.62, 1.7), v(3.5, 0.7, 2.9)),
        (v(2.7, 0.0, 2.2), v(2.95, 0.62, 2.45)),
        (v(3.6, 0.0, 4.55), v(5.4, 1.9, 4.95)),
        (v(4.4, 0.0, 0.9), v(4.85, 0.5, 1.35)),
        (v(8.2, 0.0, 2.9), v(9.9, 0.5, 4.9)),
        (v(9.3, 0.0, 0.1), v(9.95, 2.1, 1.5)),
        (v(6.6, 0.7, 0.1), v(8.2, 0.78, 0.8)),
        (v(7.3, 0.0, 0.3), v(7.5, 0.7, 0.5)),
    ]
    .into_iter()
    .enumerate()
    {
        add.block(min, max, Cover::Squares(10 + i as u32));
    }
    let panel = [v(1.0, 0.0, 0.0), v(0.0, 0.0, 1.0)];
    for corner in [v(1.2, 2.59, 2.0), v(4.0, 2.59, 2.0), v(7.5, 2.59, 2.0)] {
        add.lamp(corner, panel, Vec3::new(22.0, 21.0, 19.0));
    }
    model
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, rooms would be seen from outside, or blocks from inside, and be drawn black or not at all.
    #[test]
    fn blocks_face_out_and_rooms_face_in() {
        let mut model = Model::default();
        Furnisher::new(&mut model, 1.0).block(DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0), Cover::Planks);
        assert_eq!((model.faces.len(), model.images.len(), model.materials.len()), (12, 1, 1));
        let volume = |model: &Model| {
            let tetrahedron = |face: &Face| {
                let [a, b, c] = face.corners.map(|v| model.vertices[v as usize].position);
                a.cross(b).dot(c) / 6.0
            };
            model.faces.iter().map(tetrahedron).sum::<f64>()
        };
        assert!((volume(&model) - 6.0).abs() < 1e-9, "{}", volume(&model));
        let rooms = two_rooms_model();
        // Most of what there is is the air that the walls face.
        assert!(volume(&rooms) < -90.0, "{}", volume(&rooms));
        assert!(rooms.materials.iter().any(Material::shines));
        for image in &rooms.images {
            let shades: std::collections::BTreeSet<[u8; 4]> = image.pixels.iter().copied().collect();
            assert!(shades.len() > 50, "a texture with nothing on it");
        }
    }
}

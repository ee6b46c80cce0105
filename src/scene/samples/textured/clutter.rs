//! What objects are photographed among: floors and walls, and boxes of several kinds.

use glam::{DAffine3, DVec3};

use super::cabinets::book;
use super::furnisher::{APART, Finish, Furnisher, Gloss};
use super::texture::Texture;
use crate::scene::model::Model;
use crate::scene::random;

/// Radius in metres that an object is taken to have beside planks, cartons and books.
const RADIUS: f64 = 0.8;
/// Seed of books in stacks.
const STACKS: u64 = 0x7374_6163;

const FLOOR: Finish = Finish::of(Texture::Planks).with(Gloss::Varnished);
const WALL: Finish = Finish::of(Texture::Plaster).tinted(236, 226, 208);
const CARTON: Finish = Finish::of(Texture::Cardboard);
const CRATE: Finish = Finish::of(Texture::Wood).tinted(214, 178, 136);
const DARK: Finish = Finish::of(Texture::Wood).tinted(120, 92, 70);

/// Short for places.
fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// What is around an object, added to its model in the model's own frame.
pub struct Surroundings<'m> {
    add: Furnisher<'m>,
    scale: f64,
}

impl<'m> Surroundings<'m> {
    /// Adds to the model of an object of a radius.
    pub fn new(model: &'m mut Model, radius: f64) -> Self {
        let scale = radius / RADIUS;
        Self { add: Furnisher::new(model, DAffine3::from_scale(DVec3::splat(scale))), scale }
    }

    /// A floor of planks from a corner along two sides, which faces `sides[0] x sides[1]`.
    pub fn floor(&mut self, corner: DVec3, sides: [DVec3; 2]) {
        self.add.sheet(corner / self.scale, sides.map(|side| side / self.scale), FLOOR);
    }

    /// A wall of plaster, as a floor.
    pub fn wall(&mut self, corner: DVec3, sides: [DVec3; 2]) {
        self.add.sheet(corner / self.scale, sides.map(|side| side / self.scale), WALL);
    }

    /// Something that fills the box between two corners, as its number says: cartons, a crate or books on one another.
    pub fn thing(&mut self, min: DVec3, max: DVec3, number: u32) {
        let (min, max) = (min / self.scale, max / self.scale);
        let size = max - min;
        let middle = 0.5 * (min + max);
        let half = 0.5 * size.with_y(0.0);
        let foot = middle.with_y(min.y);
        self.add.at(foot, 0.0, |add| match number % 3 {
            0 => cartons(add, half, size.y, number),
            1 => crate_of_boards(add, half, size.y),
            _ => books(add, half, size.y, number),
        });
    }
}

/// Cartons on one another, each about as high as it is wide.
fn cartons(add: &mut Furnisher, half: DVec3, height: f64, number: u32) {
    let count = (height / (1.7 * half.x)).round().max(1.0);
    let each = height / count;
    for i in 0..count as u32 {
        let y = each * f64::from(i) + APART;
        let high = each - APART;
        // The upper ones are a little smaller, and shifted.
        let [a, b, c, _] = random::uniforms(STACKS, 0, 8 * number + i);
        let shrink = if i == 0 { 1.0 } else { 0.86 + 0.08 * c };
        let h = shrink * half;
        let centre = v((2.0 * a - 1.0) * (half.x - h.x), y, (2.0 * b - 1.0) * (half.z - h.z));
        carton(add, centre, h, high, number + i);
    }
}

/// A carton with tape along its top and sides; around the vertical are a label, arrows and tape.
fn carton(add: &mut Furnisher, foot: DVec3, half: DVec3, height: f64, turn: u32) {
    let side = |k: u32| Texture::Cardboard.cell([2, 1, 3, 0][((k + turn) % 4) as usize]);
    let up = v(0.0, height, 0.0);
    let (x, z) = (v(2.0 * half.x, 0.0, 0.0), v(0.0, 0.0, 2.0 * half.z));
    let corner = |sx: f64, sz: f64| foot + v(sx * half.x, 0.0, sz * half.z);
    add.panel(corner(-1.0, 1.0), [x, up], CARTON, side(0));
    add.panel(corner(1.0, 1.0), [-z, up], CARTON, side(1));
    add.panel(corner(1.0, -1.0), [-x, up], CARTON, side(2));
    add.panel(corner(-1.0, -1.0), [z, up], CARTON, side(3));
    add.panel(corner(-1.0, 1.0) + up, [x, -z], CARTON, Texture::Cardboard.cell(1));
    add.panel(corner(-1.0, -1.0), [x, z], CARTON, Texture::Cardboard.cell(1));
}

/// A crate: boards with gaps between posts, dark inside.
fn crate_of_boards(add: &mut Furnisher, half: DVec3, height: f64) {
    let thick = 0.025;
    let inner = half - v(thick, 0.0, thick);
    add.block(v(-inner.x, 0.01, -inner.z), v(inner.x, height - thick, inner.z), DARK);
    let boards = (height / 0.17).round().max(2.0);
    for i in 0..boards as u32 {
        let low = APART + (height - APART) * f64::from(i) / boards;
        let high = APART + (height - APART) * f64::from(i + 1) / boards - 0.02;
        let high = if f64::from(i) + 1.5 > boards { height } else { high };
        for side in [-1.0, 1.0] {
            let (a, b) = (side * inner.z, side * (half.z - 0.004));
            add.block(v(-half.x + 0.004, low, a.min(b)), v(half.x - 0.004, high, a.max(b)), CRATE);
            let (a, b) = (side * inner.x, side * (half.x - 0.004));
            add.block(v(a.min(b), low, -inner.z), v(a.max(b), high, inner.z), CRATE);
        }
    }
    // Posts over the ends of the boards.
    let wide = 0.16 * half.x.min(half.z) + 0.02;
    for (sx, sz) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        let (ax, bx) = (sx * (half.x - wide), sx * half.x);
        let (az, bz) = (sz * (half.z - wide), sz * half.z);
        let span = |a: f64, b: f64| [a.min(b), a.max(b)];
        let ([x0, x1], [z0, z1]) = (span(ax, bx), span(az, bz));
        let face = span(sz * (half.z - 0.0035), bz);
        add.block(v(x0, APART, face[0]), v(x1, height - 0.004, face[1]), CRATE);
        let face = span(sx * (half.x - 0.0035), bx);
        let back = if sz > 0.0 { [z0, z1 - 0.0036] } else { [z0 + 0.0036, z1] };
        add.block(v(face[0], APART, back[0]), v(face[1], height - 0.004, back[1]), CRATE);
    }
    // The lid lies between the boards, its own across.
    let lids = (2.0 * inner.x / 0.2).round().max(2.0);
    for i in 0..lids as u32 {
        let x = -inner.x + 2.0 * inner.x * f64::from(i) / lids;
        let until = -inner.x + 2.0 * inner.x * f64::from(i + 1) / lids - 0.012;
        add.block(
            v(x + 0.002, height - thick + APART, -inner.z + 0.002),
            v(until, height - 0.003, inner.z - 0.002),
            CRATE,
        );
    }
}

/// Large books on one another, the spine of each to one of the four sides.
fn books(add: &mut Furnisher, half: DVec3, height: f64, number: u32) {
    let mut y = APART;
    for i in 0.. {
        let [a, b, c, d] = random::uniforms(STACKS, 1, 64 * number + i);
        let rest = height - y;
        let thick = if rest < 0.19 { rest } else { 0.07 + 0.07 * a };
        // The lowest fills the box, the others lie a little inward.
        let shrink = if i == 0 { 1.0 } else { 0.86 + 0.14 * b };
        let (w, z) = (shrink * half.x, shrink * half.z);
        let shift = v((2.0 * c - 1.0) * (half.x - w), y, (2.0 * d - 1.0) * (half.z - z));
        let quarter = 90.0 * (4.0 * c).floor();
        add.at(shift, quarter, |add| {
            let turned = quarter as u32 % 180 == 90;
            let (w, z) = if turned { (z, w) } else { (w, z) };
            let lying = DAffine3::from_translation(v(w, 0.0, -z))
                * DAffine3::from_mat3(glam::DMat3::from_cols(DVec3::Y, -DVec3::X, DVec3::Z));
            add.moved(lying, |add| book(add, DVec3::ZERO, v(thick, 2.0 * w, 2.0 * z), number * 7 + i));
        });
        y += thick + APART;
        if height - y < 0.02 {
            return;
        }
    }
}

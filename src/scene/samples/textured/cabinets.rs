//! What things stand on and in: tables, shelves, chests, wardrobes, doors. Each stands on the floor around the origin and faces +Z.

use glam::{DAffine3, DVec3};

use super::furnisher::{APART, Finish, Furnisher};
use super::palette::{BRASS, DARK_WOOD, OAK, PAPER, SPINES, WALNUT, WHITE};
use super::texture::Texture;
use crate::scene::random;

/// Seed of how books stand.
const BOOKS: u64 = 0x626f_6f6b;

/// Short for places.
fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A table of a size, to the upper side of its top, on four legs.
pub(super) fn table(add: &mut Furnisher, size: DVec3, finish: Finish) {
    let (x, z) = (0.5 * size.x, 0.5 * size.z);
    // The top in boards side by side.
    let boards = (size.z / 0.22).round().max(1.0);
    for i in 0..boards as u32 {
        let from = -z + size.z * f64::from(i) / boards;
        let to = from + size.z / boards - APART;
        add.block(v(-x, size.y - 0.035, from), v(x, size.y, to), finish);
    }
    let (low, high) = (size.y - 0.12, size.y - 0.036);
    for side in [-1.0, 1.0] {
        let (a, b) = (side * (z - 0.075), side * (z - 0.055));
        add.block(v(-x + 0.09, low, a), v(x - 0.09, high, b), finish);
        let (a, b) = (side * (x - 0.075), side * (x - 0.055));
        add.block(v(a, low, -z + 0.09), v(b, high, z - 0.09), finish);
        for end in [-1.0, 1.0] {
            let leg = v(side * (x - 0.065), 0.0, end * (z - 0.065));
            add.block(leg - v(0.03, 0.0, 0.03), leg + v(0.03, high, 0.03), finish);
        }
    }
}

/// A book between two corners, its spine towards +Z.
pub(super) fn book(add: &mut Furnisher, min: DVec3, max: DVec3, number: u32) {
    let size = max - min;
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * size);
    let spine = Texture::Spines.cell(number);
    let [left, top, right, bottom] = spine;
    // The covers are as the spine is below its title.
    let (u, h) = (right - left, bottom - top);
    let cover = [left + 0.3 * u, top + 0.86 * h, left + 0.7 * u, top + 0.91 * h];
    let sheets = [0.0, 0.0, size.z / 0.3, size.x / 0.15];
    add.panel(v(min.x, min.y, max.z), [x, y], SPINES, spine);
    add.panel(min, [z, y], SPINES, cover);
    add.panel(v(max.x, min.y, max.z), [-z, y], SPINES, cover);
    add.panel(v(max.x, min.y, min.z), [-x, y], PAPER, [0.0, 0.0, size.x / 0.3, size.y / 0.15]);
    add.panel(v(min.x, max.y, max.z), [x, -z], PAPER, [0.0, 0.0, size.x / 0.3, size.z / 0.15]);
    add.panel(min, [x, z], PAPER, sheets);
}

/// Books side by side from the origin along +X with their backs at -Z, as many as fit into a length and a height. Numbers say which.
pub(super) fn row_of_books(add: &mut Furnisher, [length, height, depth]: [f64; 3], first: u32) {
    let mut x = 0.0;
    for number in first.. {
        let [a, b, c, _] = random::uniforms(BOOKS, 0, number);
        let (thick, high, deep) = (0.018 + 0.032 * a, height * (0.66 + 0.3 * b), depth * (0.72 + 0.26 * c));
        if x + thick > length {
            // The last one leans on the others where there is space for that.
            let rest = length - x;
            if rest > 0.07 {
                let angle = (0.8 * rest / high).min(0.35);
                let frame = DAffine3::from_translation(v(x + 0.012 + high * angle.sin(), 0.001, 0.0))
                    * DAffine3::from_rotation_z(angle);
                add.moved(frame, |add| book(add, DVec3::ZERO, v(0.02, high, deep), number));
            }
            return;
        }
        book(add, v(x, 0.0, 0.0), v(x + thick, high, deep), number);
        x += thick + 0.0015;
    }
}

/// Books on one another around the origin, each turned a little; from large ones to small ones.
pub(super) fn stack_of_books(add: &mut Furnisher, [width, depth]: [f64; 2], heights: &[f64], first: u32) {
    let mut y = 0.0;
    for (i, thick) in heights.iter().enumerate() {
        let number = first + i as u32;
        let [a, b, ..] = random::uniforms(BOOKS, 1, number);
        let (w, d) = (width * (1.0 - 0.05 * i as f64 - 0.1 * a), depth * (1.0 - 0.04 * i as f64 - 0.1 * b));
        add.at(v(0.0, y, 0.0), 16.0 * (b - 0.5), |add| {
            // Lying: what is up along a standing book goes along X.
            let lying = DAffine3::from_translation(v(0.5 * w, 0.0, -0.5 * d))
                * DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2);
            add.moved(lying, |add| book(add, DVec3::ZERO, v(*thick, w, d), number));
        });
        y += thick + APART;
    }
}

/// An open shelf, 1.8 m wide, 0.36 deep and 1.9 high, full of books and a few other things, which `extra` puts on boards: it is
/// called with the number of each place left free, in a frame on the board.
pub(super) fn shelf(add: &mut Furnisher, extra: impl Fn(&mut Furnisher, u32)) {
    const LEVELS: u32 = 5;
    let (half, depth, height) = (0.9, 0.36, 1.9);
    for x in [-half, -0.0125, half - 0.025] {
        add.block(v(x, 0.0, -0.18), v(x + 0.025, height, 0.18), OAK);
    }
    add.box_but(v(-half + 0.026, 0.07, -0.18), v(-0.0135, height - 0.03, -0.172), OAK, DVec3::NEG_Z);
    add.box_but(v(0.0135, 0.07, -0.18), v(half - 0.026, height - 0.03, -0.172), OAK, DVec3::NEG_Z);
    let step = (height - 0.09) / f64::from(LEVELS);
    let mut free = 0;
    for column in 0..2 {
        let (left, right) = if column == 0 { (-half + 0.026, -0.0135) } else { (0.0135, half - 0.026) };
        for level in 0..=LEVELS {
            let y = 0.06 + step * f64::from(level);
            add.block(v(left, y, -0.171), v(right, y + 0.025, 0.178), OAK);
            if level == LEVELS {
                continue;
            }
            let base = v(left + 0.01, y + 0.025 + APART, -0.165);
            let inside = [right - left - 0.02, step - 0.035, depth - 0.06];
            let first = 29 * (level + LEVELS * column);
            // Some places are half full, and have something beside the books.
            let share = [1.0, 0.58, 0.78, 1.0, 0.5, 0.62, 1.0, 0.52, 0.8, 0.7][(level + LEVELS * column) as usize];
            add.at(base, 0.0, |add| row_of_books(add, [share * inside[0], inside[1], inside[2]], first));
            if share < 0.75 {
                let middle = base + v((0.5 + 0.5 * share) * inside[0] + 0.02, 0.0, 0.16);
                add.at(middle, 0.0, |add| extra(add, free));
                free += 1;
            }
        }
    }
    add.block(v(-half + 0.026, 0.0, 0.14), v(half - 0.026, 0.058, 0.16), OAK);
}

/// A knob at the origin that sticks out towards +Z.
fn knob(add: &mut Furnisher) {
    add.rod(DVec3::ZERO, v(0.0, 0.0, 0.022), 0.007, 6, BRASS);
    add.moved(DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_2), |add| {
        let outline = [[0.0, 0.018], [0.012, 0.02], [0.016, 0.026], [0.012, 0.034], [0.0, 0.036]];
        add.turned(&outline, 8, BRASS);
    });
}

/// A chest of drawers of a size with so many rows of them.
pub(super) fn chest(add: &mut Furnisher, size: DVec3, rows: u32, finish: Finish) {
    let (x, z) = (0.5 * size.x, 0.5 * size.z);
    for (sx, sz) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        add.rod(
            v(sx * (x - 0.05), 0.006, sz * (z - 0.05)),
            v(sx * (x - 0.06), 0.12, sz * (z - 0.06)),
            0.018,
            6,
            DARK_WOOD,
        );
    }
    add.block(v(-x, 0.12, -z), v(x, size.y - 0.026, z - 0.022), finish);
    add.block(v(-x - 0.012, size.y - 0.025, -z), v(x + 0.012, size.y, z + 0.01), WALNUT);
    let high = (size.y - 0.026 - 0.12) / f64::from(rows);
    for row in 0..rows {
        let y = 0.12 + high * f64::from(row);
        add.block(v(-x + 0.012, y + 0.01, z - 0.021), v(x - 0.012, y + high - 0.006, z), finish);
        let knobs: &[f64] = if size.x > 0.7 { &[-0.3, 0.3] } else { &[0.0] };
        for at in knobs {
            add.at(v(at * size.x, y + 0.5 * high, z), 0.0, knob);
        }
    }
}

/// A front with two sunk fields, as of doors: a board between two corners, whose fields are framed by strips on it.
fn panelled(add: &mut Furnisher, from: DVec3, to: DVec3, split: f64, finish: Finish) {
    let (min, max) = (from.min(to), from.max(to));
    add.block(min, max, finish);
    let (wide, deep) = (0.09, 0.012);
    let front = |add: &mut Furnisher, x: [f64; 2], y: [f64; 2]| {
        add.box_but(v(x[0], y[0], max.z), v(x[1], y[1], max.z + deep), finish, DVec3::NEG_Z);
    };
    let middle = min.y + split * (max.y - min.y);
    front(add, [min.x, min.x + wide], [min.y, max.y]);
    front(add, [max.x - wide, max.x], [min.y, max.y]);
    for y in [min.y, middle - 0.5 * wide, max.y - wide] {
        front(add, [min.x + wide, max.x - wide], [y, y + wide]);
    }
}

/// A wardrobe with two doors, 1.4 m wide, 0.6 deep and 2.1 high.
pub(super) fn wardrobe(add: &mut Furnisher, finish: Finish) {
    add.block(v(-0.68, 0.0, -0.28), v(0.68, 0.08, 0.25), finish);
    add.block(v(-0.7, 0.08, -0.3), v(0.7, 2.04, 0.262), finish);
    add.block(v(-0.73, 2.041, -0.3), v(0.73, 2.07, 0.31), finish);
    add.block(v(-0.71, 2.071, -0.3), v(0.71, 2.1, 0.29), finish);
    for side in [-1.0, 1.0] {
        let (a, b) = (side * 0.004, side * 0.69);
        panelled(add, v(a, 0.1, 0.264), v(b, 2.03, 0.282), 0.42, finish);
        let x = side * 0.05;
        add.rod(v(x, 0.97, 0.322), v(x, 1.15, 0.322), 0.007, 6, BRASS);
        for y in [0.985, 1.135] {
            add.rod(v(x, y, 0.293), v(x, y, 0.322), 0.006, 5, BRASS);
        }
    }
}

/// A closed door, 0.9 m wide and 2.05 high with its frame, in front of a wall at z = 0.
pub(super) fn door(add: &mut Furnisher) {
    panelled(add, v(-0.405, 0.008, 0.004), v(0.405, 2.03, 0.018), 0.44, WHITE);
    architrave(add, 0.41, 2.036);
    let (x, y) = (0.345, 1.02);
    add.block(v(x - 0.022, y - 0.1, 0.0305), v(x + 0.022, y + 0.1, 0.036), BRASS);
    add.rod(v(x, y + 0.03, 0.036), v(x, y + 0.03, 0.075), 0.009, 8, BRASS);
    add.rod(v(x + 0.012, y + 0.03, 0.075), v(x - 0.115, y + 0.03, 0.075), 0.0095, 8, BRASS);
}

/// Boards around a doorway, which goes to `half` on either side and to a height, in front of a wall at z = 0.
pub(super) fn architrave(add: &mut Furnisher, half: f64, height: f64) {
    let (wide, deep) = (0.075, 0.022);
    for side in [-1.0, 1.0] {
        let (a, b) = (side * half, side * (half + wide));
        add.box_but(v(a, 0.0, 0.0), v(b, height, deep), WHITE, DVec3::NEG_Z);
    }
    add.box_but(v(-half - wide, height, 0.0), v(half + wide, height + wide, deep), WHITE, DVec3::NEG_Z);
}

//! What rooms have on their walls and ceilings: windows, curtains, radiators, pictures, lamps. What hangs on a wall has it at z = 0
//! and faces +Z.

use std::f64::consts::TAU;

use glam::DVec3;

use super::furnisher::{APART, Finish, Furnisher, Gloss};
use super::palette::{BRASS, CURTAIN, GRAPHITE, OATMEAL, PAPER, WHITE};
use super::texture::Texture;

/// What windows show, where white is so bright.
const OUTSIDE: Finish = Finish::of(Texture::Garden).with(Gloss::Shining(4.5));
/// Cloth with a lamp behind it.
const SHADE: Finish = Finish::of(Texture::Weave).tinted(255, 226, 186).with(Gloss::Shining(4.0));
/// A pane of milky plastic before tubes.
const PANE: Finish = Finish::of(Texture::Paint).tinted(255, 247, 235).with(Gloss::Shining(27.0));
const PICTURE: Finish = Finish::of(Texture::Pictures);
const RUG: Finish = Finish::of(Texture::Rug);
const WOOL: Finish = Finish::of(Texture::Wool);

/// Short for places.
fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A window in an opening around the origin, half as large as said, with two casements; `view` are the left and the right end of what
/// is seen of the garden.
pub(super) fn window(add: &mut Furnisher, [x, y]: [f64; 2], view: [f64; 2]) {
    add.panel(v(-x, -y, 0.0), [v(2.0 * x, 0.0, 0.0), v(0.0, 2.0 * y, 0.0)], OUTSIDE, [view[0], 0.05, view[1], 0.95]);
    let mut bar = |left: f64, low: f64, right: f64, high: f64, deep: f64| {
        add.block(v(left, low, 0.004), v(right, high, deep), WHITE);
    };
    // The frame, the post in the middle, a sash in each half with a glazing bar.
    let (frame, sash) = (0.06, 0.045);
    bar(-x - 0.04, y - 0.02, x + 0.04, y + frame, 0.05);
    bar(-x - 0.04, -y - frame, x + 0.04, -y + 0.02, 0.05);
    for side in [-1.0, 1.0] {
        let (a, b) = (side * (x - 0.02), side * (x + frame - 0.02));
        bar(a, -y + 0.021, b, y - 0.021, 0.05);
    }
    bar(-0.03, -y + 0.021, 0.03, y - 0.021, 0.045);
    for (left, right) in [(-x + 0.021, -0.031), (0.031, x - 0.021)] {
        bar(left, -y + 0.022, right, -y + 0.022 + sash, 0.032);
        bar(left, y - 0.022 - sash, right, y - 0.022, 0.032);
        bar(left, -y + 0.023 + sash, left + sash, y - 0.023 - sash, 0.032);
        bar(right - sash, -y + 0.023 + sash, right, y - 0.023 - sash, 0.032);
        bar(left + sash + 0.001, 0.35 * y - 0.012, right - sash - 0.001, 0.35 * y + 0.012, 0.024);
    }
    add.block(v(-x - 0.1, -y - frame - 0.034, 0.001), v(x + 0.1, -y - frame - 0.004, 0.17), WHITE);
    add.rod(v(0.045, -0.06, 0.052), v(0.045, 0.05, 0.052), 0.009, 6, BRASS);
}

/// Curtains on a rod at a height, drawn aside: from `inner` to `outer` on either side of the middle, down to `low`.
pub(super) fn curtains(add: &mut Furnisher, [inner, outer]: [f64; 2], [low, high]: [f64; 2]) {
    let reach = outer + 0.12;
    add.rod(v(-reach, high + 0.03, 0.1), v(reach, high + 0.03, 0.1), 0.013, 6, BRASS);
    for side in [-1.0, 1.0] {
        add.ball(v(side * reach, high + 0.03, 0.1), 0.026, 8, BRASS);
        add.rod(
            v(side * (outer + 0.05), high + 0.03, 0.001),
            v(side * (outer + 0.05), high + 0.03, 0.088),
            0.008,
            5,
            BRASS,
        );
        let folds = 5.0;
        let position = |s: f64, t: f64| {
            // Folds are deeper below, where the cloth is gathered less.
            let deep = 0.018 + 0.016 * (1.0 - t);
            let turn = TAU * (folds * s + 0.07 * (5.0 * t + 2.0 * s).sin());
            let spread = 1.0 + 0.05 * (1.0 - t);
            let x = inner + (outer - inner) * (if side > 0.0 { s } else { 1.0 - s }) * spread;
            v(side * x, low + (high + 0.012 - low) * t, 0.1 + deep * turn.sin())
        };
        let wide = 2.0 * (outer - inner);
        add.patch([50, 2], CURTAIN, position, |s, t| [wide * s, -(high - low) * t]);
    }
}

/// A radiator of ribs, half as wide as said, up to a height.
pub(super) fn radiator(add: &mut Furnisher, half: f64, height: f64) {
    let count = (2.0 * half / 0.075).round();
    for i in 0..count as u32 {
        let x = -half + 2.0 * half * (f64::from(i) + 0.5) / count;
        add.block(v(x - 0.024, 0.13, 0.035), v(x + 0.024, height - 0.03, 0.115), WHITE);
    }
    for y in [0.16, height - 0.1] {
        add.block(v(-half - 0.01, y, 0.05), v(half + 0.01, y + 0.045, 0.1), WHITE);
    }
    for side in [-0.8, 0.8] {
        add.block(v(side * half - 0.012, 0.3, 0.0), v(side * half + 0.012, 0.33, 0.049), WHITE);
        add.rod(v(side * half, 0.0, 0.075), v(side * half, 0.129, 0.075), 0.011, 6, WHITE);
    }
}

/// A framed picture around the origin, half as large as said with its frame; `mat` is the width of the paper around the picture.
pub(super) fn picture(add: &mut Furnisher, [x, y]: [f64; 2], mat: f64, number: u32, finish: Finish) {
    let wide = 0.028;
    for side in [-1.0, 1.0] {
        let (a, b) = (side * y, side * (y - wide));
        add.block(v(-x, a, APART), v(x, b, 0.03), finish);
        let (a, b) = (side * x, side * (x - wide));
        add.block(v(a, -y + wide, APART), v(b, y - wide, 0.03), finish);
    }
    let (u, w) = (x - wide, y - wide);
    add.sheet(v(-u, -w, 0.011), [v(2.0 * u, 0.0, 0.0), v(0.0, 2.0 * w, 0.0)], PAPER.tinted(250, 248, 244));
    let (u, w) = (u - mat, w - mat);
    let [left, top, right, bottom] = Texture::Pictures.cell(number);
    // What does not fit the shape of the frame is cut off.
    let (cut_u, cut_v) = ((1.0 - u / w).max(0.0) * 0.5, (1.0 - w / u).max(0.0) * 0.5);
    let (width, height) = (right - left, bottom - top);
    let piece = [left + cut_u * width, top + cut_v * height, right - cut_u * width, bottom - cut_v * height];
    add.panel(v(-u, -w, 0.014), [v(2.0 * u, 0.0, 0.0), v(0.0, 2.0 * w, 0.0)], PICTURE, piece);
}

/// A shade that shines: a prism with flat sides around the vertical, from one radius to another, closed.
fn shade(add: &mut Furnisher, sides: u32, [low, high]: [f64; 2], [bottom, top]: [f64; 2], open: bool) {
    let material = add.material(SHADE);
    let corner = |k: u32, r: f64, y: f64| {
        let (sin, cos) = (TAU * (f64::from(k) + 0.5) / f64::from(sides)).sin_cos();
        v(r * sin, y, r * cos)
    };
    let fan = |add: &mut Furnisher, r: f64, y: f64, up: f64| {
        let normal = v(0.0, up, 0.0);
        let ring: Vec<u32> = (0..sides)
            .map(|k| {
                let p = corner(if up > 0.0 { k } else { sides - 1 - k }, r, y);
                add.vertex(p, normal, [p.x / 0.45, p.z / 0.45])
            })
            .collect();
        for k in 1..ring.len() - 1 {
            add.triangle([ring[0], ring[k], ring[k + 1]], material);
        }
    };
    fan(add, low, bottom, -1.0);
    if open {
        fan(add, high, top, 1.0);
    }
    for k in 0..sides {
        let places =
            [corner(k, low, bottom), corner(k + 1, low, bottom), corner(k + 1, high, top), corner(k, high, top)];
        let normal = (places[1] - places[0]).cross(places[3] - places[0]).normalize();
        let width = places[0].distance(places[1]);
        let (from, height) = (f64::from(k) * width / 0.45, (top - bottom) / 0.45);
        let uvs = [[from, height], [from + width / 0.45, height], [from + width / 0.45, 0.0], [from, 0.0]];
        let corners = std::array::from_fn(|i| add.vertex(places[i], normal, uvs[i]));
        add.faces(corners, material);
    }
}

/// A lamp that hangs from a ceiling, at so much below it, which is at the origin.
pub(super) fn pendant(add: &mut Furnisher, below: f64) {
    add.turned(&[[0.0, -0.03], [0.05, -0.028], [0.055, -0.002], [0.0, -0.001]], 16, BRASS);
    add.rod(v(0.0, -below + 0.15, 0.0), v(0.0, -0.03, 0.0), 0.01, 8, GRAPHITE);
    shade(add, 8, [0.27, 0.22], [-below - 0.14, -below + 0.13], false);
    // The lid and rims of cloth.
    let lid = [[0.0, -below + 0.131], [0.226, -below + 0.131], [0.226, -below + 0.141], [0.0, -below + 0.15]];
    add.turned(&lid, 8, OATMEAL);
}

/// A lamp that stands: foot, stem and a square shade, to a height.
pub(super) fn standing_lamp(add: &mut Furnisher, height: f64, half: f64, foot: Finish) {
    let tall = 1.25 * half;
    let wide = 0.9 * half;
    add.turned(
        &[[0.0, APART], [wide, APART], [wide, 0.014], [0.8 * wide, 0.024], [0.016, 0.03], [0.0, 0.031]],
        16,
        foot,
    );
    add.rod(v(0.0, 0.028, 0.0), v(0.0, height - tall + 0.004, 0.0), 0.012, 10, BRASS);
    shade(add, 4, [1.35 * half, 1.05 * half], [height - tall, height + 0.35 * tall], true);
    add.rod(v(0.0, height + 0.35 * tall, 0.0), v(0.0, height + 0.35 * tall + 0.025, 0.0), 0.012, 8, BRASS);
}

/// A flat lamp below a ceiling, which is at the origin, half as large as said.
pub(super) fn ceiling_lamp(add: &mut Furnisher, half: f64) {
    let material = add.material(PANE);
    for side in [-1.0, 1.0] {
        let (a, b) = (side * half, side * (half + 0.02));
        add.block(v(-half - 0.02, -0.1, a), v(half + 0.02, -APART, b), WHITE);
        add.block(v(a, -0.1, -half), v(b, -APART, half), WHITE);
    }
    let s = 2.0 * half / 0.45;
    add.quad(
        v(-half, -0.09, -half),
        [v(2.0 * half, 0.0, 0.0), v(0.0, 0.0, 2.0 * half)],
        [[0.0, 0.0], [s, 0.0], [s, s], [0.0, s]],
        material,
    );
}

/// A rug around the origin, half as large as said.
pub(super) fn rug(add: &mut Furnisher, [x, z]: [f64; 2], long_haired: bool) {
    let thick = 0.014;
    let (top, side) = if long_haired { (WOOL, OATMEAL) } else { (RUG, OATMEAL.tinted(150, 100, 84)) };
    add.box_but(v(-x, APART, -z), v(x, thick, z), side, DVec3::Y);
    add.panel(v(-x, thick, z), [v(2.0 * x, 0.0, 0.0), v(0.0, 0.0, -2.0 * z)], top, [0.0, 0.0, 1.0, 1.0]);
}

//! Small things: crockery, fruit, plants, what lies on a desk. Each stands at the origin.

use glam::{DAffine3, DVec3};

use super::furnisher::{APART, Finish, Furnisher, Gloss};
use super::palette::{BLUE_GLAZE, CLAY, CREAM_GLAZE, GRAPHITE, OAK, STEEL, WHITE};
use super::texture::Texture;
use crate::scene::random;

const LEAF: Finish = Finish::of(Texture::Leaf).with(Gloss::Satin);
const STALK: Finish = Finish::of(Texture::Wood).tinted(132, 140, 96);
const SOIL: Finish = Finish::of(Texture::Stoneware).tinted(104, 84, 70);
const DISPLAY: Finish = Finish::of(Texture::Screen).with(Gloss::Shining(0.85));
/// Seed of how leaves grow.
const GROWTH: u64 = 0x6772_6f77;

/// Short for places.
fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A plate.
pub(super) fn plate(add: &mut Furnisher, finish: Finish) {
    let outline = [
        [0.0, APART],
        [0.07, APART],
        [0.075, 0.006],
        [0.125, 0.02],
        [0.13, 0.026],
        [0.122, 0.026],
        [0.08, 0.014],
        [0.0, 0.012],
    ];
    add.turned(&outline, 20, finish);
}

/// A bowl.
pub(super) fn bowl(add: &mut Furnisher, radius: f64, finish: Finish) {
    let outline = [
        [0.0, 0.02],
        [0.38, 0.02],
        [0.40, 0.06],
        [0.66, 0.20],
        [0.88, 0.42],
        [1.0, 0.66],
        [0.96, 0.68],
        [0.93, 0.66],
        [0.80, 0.43],
        [0.58, 0.24],
        [0.30, 0.15],
        [0.0, 0.13],
    ];
    add.turned(&outline.map(|[r, y]| [radius * r, radius * y]), 16, finish);
}

/// A bowl of fruit.
pub(super) fn fruit(add: &mut Furnisher) {
    bowl(add, 0.15, CREAM_GLAZE);
    let skin = Finish::of(Texture::Skin).with(Gloss::Satin);
    for (x, z, y, r, finish) in [
        (-0.052, 0.03, 0.082, 0.041, skin.tinted(216, 120, 84)),
        (0.045, 0.045, 0.080, 0.038, skin.tinted(232, 196, 110)),
        (0.05, -0.042, 0.082, 0.041, skin.tinted(176, 186, 110)),
        (-0.036, -0.052, 0.080, 0.039, skin.tinted(226, 160, 92)),
        (0.002, 0.002, 0.135, 0.040, skin.tinted(206, 104, 80)),
    ] {
        add.ball(v(x, y, z), r, 10, finish);
        add.rod(v(x, y + 0.9 * r, z), v(x + 0.006, y + r + 0.012, z), 0.005, 4, STALK);
    }
}

/// A cup with a handle, on a saucer.
pub(super) fn cup(add: &mut Furnisher, finish: Finish) {
    let saucer =
        [[0.0, APART], [0.04, APART], [0.072, 0.014], [0.075, 0.018], [0.068, 0.018], [0.036, 0.008], [0.0, 0.008]];
    add.turned(&saucer, 10, finish);
    let outline = [
        [0.0, 0.010],
        [0.026, 0.010],
        [0.036, 0.03],
        [0.041, 0.08],
        [0.041, 0.09],
        [0.036, 0.09],
        [0.034, 0.078],
        [0.0, 0.076],
    ];
    add.turned(&outline, 12, finish);
    for (from, to) in [
        (v(0.038, 0.076, 0.0), v(0.064, 0.07, 0.0)),
        (v(0.063, 0.073, 0.0), v(0.063, 0.042, 0.0)),
        (v(0.064, 0.044, 0.0), v(0.036, 0.034, 0.0)),
    ] {
        add.rod(from, to, 0.006, 5, finish);
    }
}

/// A vase, so high.
pub(super) fn vase(add: &mut Furnisher, height: f64, finish: Finish) {
    let outline = [
        [0.0, 0.004],
        [0.17, 0.004],
        [0.22, 0.05],
        [0.30, 0.25],
        [0.31, 0.38],
        [0.25, 0.60],
        [0.14, 0.80],
        [0.115, 0.90],
        [0.15, 1.0],
        [0.125, 1.0],
        [0.09, 0.90],
        [0.09, 0.74],
        [0.0, 0.72],
    ];
    add.turned(&outline.map(|[r, y]| [height * r, height * y]), 14, finish);
}

/// A leaf from the origin along +Z, so long and half as wide as said: two sides that bulge and meet at the edge.
fn leaf(add: &mut Furnisher, cells: [u32; 2], length: f64, half: f64, droop: f64) {
    for way in [1.0, -1.0] {
        let position = |s: f64, t: f64| {
            let across = way * (1.0 - 2.0 * s);
            let wide = (4.0 * t * (1.0 - t)).max(0.0).sqrt() * (1.1 - 0.45 * t);
            let fold = 0.25 * half * across.abs() * wide;
            let thick = way * 0.005 * (1.0 - across * across) * (4.0 * t * (1.0 - t));
            v(half * wide * across, fold + thick - droop * length * t * t, length * t)
        };
        add.patch(cells, LEAF, position, |s, t| [t, if way > 0.0 { s } else { 1.0 - s }]);
    }
}

/// Twigs with leaves from the origin, so high, as they stand in a vase.
pub(super) fn twigs(add: &mut Furnisher, height: f64, count: u32) {
    for twig in 0..count {
        let [a, b, c, _] = random::uniforms(GROWTH, 1, twig);
        add.at(DVec3::ZERO, 360.0 * (f64::from(twig) + 0.6 * a) / f64::from(count), |add| {
            let top = v(0.0, height * (0.75 + 0.25 * b), height * (0.2 + 0.2 * c));
            add.rod(DVec3::ZERO, top, 0.005, 4, STALK);
            for k in 0..5 {
                let [d, e, ..] = random::uniforms(GROWTH, 2, 8 * twig + k);
                let root = top * (0.45 + 0.55 * f64::from(k) / 4.0);
                let turn = if k % 2 == 0 { 75.0 } else { -75.0 } + 50.0 * (d - 0.5);
                add.at(root, if k == 4 { 0.0 } else { turn }, |add| {
                    add.leaning(-0.5 - 0.4 * e, |add| leaf(add, [2, 3], 0.085 + 0.03 * d, 0.022, 0.25));
                });
            }
        });
    }
}

/// A plant in a pot on the floor, 1.3 m high: stems that bow outward with a broad leaf at the end of each.
pub(super) fn plant(add: &mut Furnisher) {
    let pot = [
        [0.0, 0.004],
        [0.135, 0.004],
        [0.15, 0.02],
        [0.19, 0.30],
        [0.205, 0.305],
        [0.205, 0.345],
        [0.18, 0.345],
        [0.175, 0.315],
        [0.0, 0.312],
    ];
    add.turned(&pot[..8], 18, CLAY);
    add.turned(&[[0.176, 0.316], [0.08, 0.322], [0.0, 0.325]], 12, SOIL);
    const STEMS: u32 = 18;
    for stem in 0..STEMS {
        let [a, b, c, d] = random::uniforms(GROWTH, 3, stem);
        // The golden angle spreads stems evenly around.
        add.at(v(0.0, 0.32, 0.0), 137.5 * f64::from(stem) + 20.0 * a, |add| {
            let share = f64::from(stem) / f64::from(STEMS);
            let high = 0.28 + 0.62 * share + 0.08 * b;
            let out = 0.27 - 0.19 * share + 0.05 * c;
            let root = v(0.0, 0.0, 0.02 + 0.06 * (1.0 - share));
            let (middle, top) = (root + v(0.0, 0.6 * high, 0.35 * out), root + v(0.0, high, out));
            add.rod(root, middle, 0.007, 5, STALK);
            add.rod(middle - v(0.0, 0.004, 0.0), top, 0.0062, 5, STALK);
            add.at(top, 30.0 * (d - 0.5), |add| {
                let lean = -0.15 - 0.9 * share + 0.3 * (c - 0.5);
                add.leaning(lean, |add| leaf(add, [4, 5], 0.23 + 0.09 * b, 0.062 + 0.02 * a, 0.55));
            });
        });
    }
}

/// A monitor on a desk, which faces +Z.
pub(super) fn monitor(add: &mut Furnisher) {
    add.block(v(-0.11, APART, -0.09), v(0.11, 0.014, 0.08), GRAPHITE);
    add.block(v(-0.025, 0.014, -0.045), v(0.025, 0.2, -0.03), GRAPHITE);
    add.box_but(v(-0.29, 0.12, -0.029), v(0.29, 0.48, 0.0), GRAPHITE, DVec3::Z);
    let rim = [(v(-0.29, 0.12, 0.0), v(0.58, 0.0, 0.0), 0.018), (v(-0.29, 0.466, 0.0), v(0.58, 0.0, 0.0), 0.014)];
    for (corner, along, high) in rim {
        add.sheet(corner, [along, v(0.0, high, 0.0)], GRAPHITE);
    }
    for x in [-0.29, 0.276] {
        add.sheet(v(x, 0.138, 0.0), [v(0.014, 0.0, 0.0), v(0.0, 0.328, 0.0)], GRAPHITE);
    }
    add.panel(v(-0.276, 0.138, 0.0), [v(0.552, 0.0, 0.0), v(0.0, 0.328, 0.0)], DISPLAY, [0.0, 0.0, 1.0, 1.0]);
}

/// A keyboard in front of it, keys in rows.
pub(super) fn keyboard(add: &mut Furnisher) {
    add.block(v(-0.21, APART, -0.065), v(0.21, 0.016, 0.065), STEEL);
    for row in 0..4 {
        let z = -0.055 + 0.029 * f64::from(row);
        let keys: &[(f64, f64)] = if row == 3 {
            &[(-0.2, -0.15), (-0.145, -0.095), (-0.09, 0.09), (0.095, 0.145), (0.15, 0.2)]
        } else {
            &[(-0.2, -0.142), (-0.137, -0.079), (-0.074, -0.016), (-0.011, 0.047), (0.052, 0.11), (0.115, 0.2)]
        };
        for (from, to) in keys {
            add.box_but(v(*from, 0.016, z), v(*to, 0.021, z + 0.023), WHITE, DVec3::NEG_Y);
        }
    }
}

/// Pens in a pot.
pub(super) fn pens(add: &mut Furnisher) {
    let pot = [[0.0, APART], [0.038, APART], [0.04, 0.006], [0.04, 0.1], [0.034, 0.1], [0.034, 0.06], [0.0, 0.06]];
    add.turned(&pot, 14, BLUE_GLAZE);
    for (i, finish) in [OAK, GRAPHITE, CLAY, OAK].into_iter().enumerate() {
        let turn = 1.7 * i as f64;
        let (sin, cos) = turn.sin_cos();
        add.rod(
            v(0.012 * sin, 0.06, 0.012 * cos),
            v(0.03 * sin, 0.155 + 0.008 * i as f64, 0.03 * cos),
            0.005,
            5,
            finish,
        );
    }
}

/// A desk lamp with a jointed arm that leans over towards +X.
pub(super) fn desk_lamp(add: &mut Furnisher) {
    add.turned(&[[0.0, APART], [0.08, APART], [0.08, 0.015], [0.07, 0.022], [0.0, 0.024]], 16, GRAPHITE);
    let (elbow, head) = (v(-0.1, 0.3, 0.0), v(0.13, 0.44, 0.0));
    add.rod(v(0.0, 0.022, 0.0), elbow, 0.008, 8, STEEL);
    add.rod(elbow, head, 0.008, 8, STEEL);
    add.ball(elbow, 0.017, 12, GRAPHITE);
    let frame = DAffine3::from_translation(head) * DAffine3::from_rotation_z(0.35);
    add.moved(frame, |add| {
        let outline =
            [[0.0, -0.025], [0.06, -0.07], [0.074, -0.085], [0.08, -0.085], [0.066, -0.055], [0.03, 0.01], [0.0, 0.02]];
        add.turned(&outline, 16, GRAPHITE);
    });
}

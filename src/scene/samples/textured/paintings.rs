//! Pictures that hang on walls: landscapes, abstract ones, plants, posters.

use glam::{Vec2, Vec3};

use super::noise::{Noise, band, fraction, rgb, split, step};
use super::print::Print;

/// Pictures along a side of their texture.
pub(super) const PICTURES: u32 = 3;

/// Colours of ink and paint that go together.
const PAINTS: [Vec3; 8] = [
    rgb(186, 106, 74),
    rgb(72, 96, 112),
    rgb(214, 178, 112),
    rgb(124, 138, 112),
    rgb(222, 208, 184),
    rgb(92, 70, 66),
    rgb(160, 164, 158),
    rgb(204, 150, 130),
];

/// All pictures side by side, in rows.
pub(super) fn pictures() -> impl Fn(f32, f32) -> Vec3 + Sync {
    let noise = Noise::new(18);
    let print = Print::new(19);
    let leaves = [twig(&noise, 0), twig(&noise, 1)];
    let shapes = [shapes(&noise, 0), shapes(&noise, 1)];
    move |x, y| {
        let ((column, u), (row, v)) = (split(x * PICTURES as f32), split(y * PICTURES as f32));
        let canvas = 1.0 + 0.035 * noise.sum([x, y], [256, 256], 1) + 0.03 * noise.sum([x, y], [40, 40], 3);
        // Strokes of the brush drag colours along.
        let drag = [0.012 * noise.sum([x, y], [60, 90], 2), 0.012 * noise.sum([y, x], [90, 60], 2)];
        let (s, t) = (u + drag[0], v + drag[1]);
        let colour = match column.clamp(0, 2) + 3 * row.clamp(0, 2) {
            0 => mountains(&noise, s, t),
            1 => abstraction(&shapes[0], u, v),
            2 => plant(&print, &leaves[0], u, v, 0),
            3 => poster(&print, u, v, 0),
            4 => coast(&noise, s, t),
            5 => plant(&print, &leaves[1], u, v, 1),
            6 => abstraction(&shapes[1], u, v),
            7 => still_life(&noise, s, t),
            _ => poster(&print, u, v, 1),
        };
        colour * canvas
    }
}

/// A lake below mountains, one range behind another.
fn mountains(noise: &Noise, u: f32, v: f32) -> Vec3 {
    let shore = 0.66;
    let mirrored = if v > shore { 2.0 * shore - v + 0.006 * noise.sum([u, v], [8, 90], 2) } else { v };
    let clouds = step(-0.1, 0.5, noise.sum([0.4 * u, mirrored], [6, 9], 4));
    let sky = rgb(132, 160, 186).lerp(rgb(230, 208, 172), step(0.0, 0.55, mirrored));
    let mut colour = sky.lerp(rgb(238, 226, 208), 0.6 * clouds * step(0.6, 0.1, mirrored));
    for (range, (height, rough, tone)) in [
        (0.34, 0.30, rgb(148, 158, 172)),
        (0.46, 0.20, rgb(110, 124, 136)),
        (0.55, 0.12, rgb(84, 102, 98)),
        (0.63, 0.05, rgb(60, 76, 62)),
    ]
    .into_iter()
    .enumerate()
    {
        let ridge = height - rough * noise.sum([0.5 * u + 0.31 * range as f32, 0.13 * range as f32], [8, 8], 5);
        let inside = step(ridge - 0.006, ridge + 0.006, mirrored);
        let light = noise.sum([u + 0.4 * (mirrored - ridge), mirrored], [20, 14], 3);
        let snow = step(0.07, 0.02, mirrored - ridge + 0.05 * light) * f32::from(u8::from(range == 0));
        let slope = (tone * (1.0 + 0.22 * light)).lerp(rgb(226, 226, 226), 0.8 * snow);
        colour = colour.lerp(slope, inside);
    }
    if v > shore {
        let ripples = noise.sum([u, v], [6, 110], 2);
        colour = colour * (0.82 + 0.12 * ripples) + 0.04;
    }
    let bank = shore + 0.26 + 0.05 * noise.sum([u, 0.5], [6, 4], 4);
    let reeds = noise.sum([u, 0.4 * v], [120, 12], 2);
    colour.lerp(rgb(106, 98, 62) * (1.0 + 0.4 * reeds), step(bank, bank + (0.03 + 0.05 * reeds).max(0.01), v))
}

/// Dunes, the sea, a sail, evening.
fn coast(noise: &Noise, u: f32, v: f32) -> Vec3 {
    let sun = (Vec2::new(u, v) - Vec2::new(0.68, 0.34)).length();
    let stripes = noise.sum([0.3 * u, v], [5, 26], 4);
    let mut sky = rgb(120, 138, 160).lerp(rgb(228, 176, 128), step(0.05, 0.48, v + 0.08 * stripes));
    sky = sky.lerp(rgb(244, 222, 176), step(0.075, 0.06, sun).max(0.5 * step(0.3, 0.05, sun)));
    let waves = noise.sum([u, v * v], [10, 120], 3);
    let glitter = step(0.15, 0.0, (u - 0.68).abs() - 0.12 * waves) * step(0.1, 0.35, waves);
    let sea = (rgb(84, 112, 128) * (1.0 + 0.25 * waves)).lerp(rgb(238, 206, 158), 0.7 * glitter);
    let mut colour = sky.lerp(sea, step(0.497, 0.503, v));
    let (a, b) = (u - 0.3, v - 0.3);
    let sail = step(0.0, 0.006, a) * step(0.0, 0.008, 0.55 * b - a) * band(0.0, 0.21, 0.006, b);
    let hull = band(-0.08, 0.13, 0.01, a) * band(0.215, 0.24, 0.006, b);
    colour = colour.lerp(rgb(226, 214, 192), sail).lerp(rgb(74, 56, 52), hull);
    let dune = 0.78 - 0.16 * u + 0.06 * noise.sum([u, 0.2], [5, 4], 3);
    let sand = rgb(198, 170, 128) * (1.0 + 0.1 * noise.sum([u, v], [40, 90], 3));
    let grass = step(0.1, 0.4, noise.sum([u + 0.2 * v, 0.3 * v], [140, 10], 2)) * step(0.12, 0.0, v - dune);
    colour.lerp(sand.lerp(rgb(112, 112, 72), grass), step(dune, dune + 0.012, v))
}

/// A vase with fruit on a cloth.
fn still_life(noise: &Noise, u: f32, v: f32) -> Vec3 {
    let strokes = noise.sum([u, v], [14, 30], 3);
    let wall = rgb(116, 122, 104).lerp(rgb(84, 80, 72), step(0.2, 0.9, u)) * (1.0 + 0.18 * strokes);
    let folds = noise.sum([u + 0.4 * v, v], [9, 4], 3);
    let cloth = rgb(206, 190, 164) * (0.9 + 0.25 * folds + 0.08 * strokes);
    let mut colour = wall.lerp(cloth, step(0.66, 0.675, v + 0.05 * folds));
    let height = v - 0.26;
    if (0.0..0.44).contains(&height) {
        let t = height / 0.44;
        // Lip, neck, belly.
        let half = 0.075 - 0.12 * t + 0.62 * t * t - 0.42 * t * t * t * t;
        let across = (u - 0.36) / half;
        let shade = 0.75 - 0.5 * across - 0.12 * across * across;
        let glaze = rgb(92, 122, 142) * (shade + 0.15 * strokes + 0.3 * step(0.22, 0.02, (across + 0.4).abs()));
        colour = colour.lerp(glaze, step(1.02, 0.97, across.abs()));
    }
    for (x, y, r, skin) in [
        (0.58, 0.68, 0.10, rgb(190, 92, 62)),
        (0.74, 0.71, 0.09, rgb(206, 156, 76)),
        (0.66, 0.79, 0.095, rgb(150, 152, 84)),
        (0.28, 0.80, 0.085, rgb(196, 112, 70)),
    ] {
        let d = (Vec2::new(u, v) - Vec2::new(x, y)) / r;
        let under = (Vec2::new(u, v) - Vec2::new(x + 0.04, y + r)) / Vec2::new(1.2 * r, 0.35 * r);
        colour *= 1.0 - 0.45 * step(1.2, 0.2, under.length_squared());
        let shade = 0.82 - 0.35 * d.x - 0.3 * d.y - 0.15 * d.length_squared() + 0.12 * strokes;
        colour = colour.lerp(skin * shade, step(1.03, 0.97, d.length()));
    }
    colour
}

/// A flat shape of an abstract picture.
struct Shape {
    at: Vec2,
    axis: Vec2,
    half: Vec2,
    kind: u32,
    colour: Vec3,
}

fn shapes(noise: &Noise, number: u32) -> Vec<Shape> {
    let shape = |i: u32| {
        let [a, b, c, d] = noise.random(300 + 20 * number + i);
        let [e, f, g, _] = noise.random(400 + 20 * number + i);
        let turn = Vec2::new(c - 0.5, 0.35 * (d - 0.5)).normalize_or(Vec2::X);
        let size = 0.30 - 0.018 * i as f32;
        Shape {
            at: Vec2::new(0.15 + 0.7 * a, 0.15 + 0.7 * b),
            axis: if number == 0 { turn } else { Vec2::X },
            half: Vec2::new(size * (0.5 + 0.6 * e), size * (0.35 + 0.75 * f)),
            kind: (3.0 * g) as u32,
            colour: PAINTS[((i + 3 * number) % 8) as usize],
        }
    };
    (0..11).map(shape).collect()
}

/// Discs, half discs and blocks over one another, some of them hatched.
fn abstraction(shapes: &[Shape], u: f32, v: f32) -> Vec3 {
    let mut colour = rgb(222, 212, 192);
    for (i, shape) in shapes.iter().enumerate() {
        let d = Vec2::new(u, v) - shape.at;
        let p = Vec2::new(d.dot(shape.axis), d.perp_dot(shape.axis)) / shape.half;
        let inside = match shape.kind {
            0 => step(1.02, 0.98, p.length()),
            1 => step(1.02, 0.98, p.length()) * step(-0.03, 0.03, p.y),
            _ => step(1.02, 0.98, p.x.abs()) * step(1.02, 0.98, p.y.abs()),
        };
        let hatched = if i % 3 == 2 { 0.25 * band(0.25, 0.75, 0.3, fraction(5.0 * p.x + 3.0 * p.y)) } else { 0.0 };
        colour = colour.lerp(shape.colour * (1.0 - hatched), 0.94 * inside);
    }
    colour
}

/// A leaf: its place on the stem, the direction that it grows in, half its length.
fn twig(noise: &Noise, number: u32) -> Vec<(Vec2, Vec2, f32)> {
    let count = 13 - 2 * number;
    let leaf = |i: u32| {
        let [a, b, ..] = noise.random(600 + 40 * number + i);
        let t = i as f32 / count as f32;
        let side = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let direction = Vec2::new(side * (0.9 - 0.5 * t), -0.35 - 0.5 * t - 0.3 * a).normalize();
        (stem(0.72 - 0.54 * t), direction, (0.115 - 0.06 * t) * (0.85 + 0.3 * b))
    };
    (0..=count).map(leaf).collect()
}

fn stem(v: f32) -> Vec2 {
    Vec2::new(0.5 + 0.10 * (v - 0.5) - 0.35 * (v - 0.5) * (v - 0.5), v)
}

/// A plant on paper with its name below, as in old books.
fn plant(print: &Print, leaves: &[(Vec2, Vec2, f32)], u: f32, v: f32, number: u32) -> Vec3 {
    let place = Vec2::new(u, v);
    let mut colour = rgb(226, 216, 194);
    let line = band(0.055, 0.061, 0.006, u.min(1.0 - u).min(v).min(1.0 - v));
    colour = colour.lerp(rgb(150, 136, 112), line * f32::from(u8::from(u.min(1.0 - u).min(v).min(1.0 - v) > 0.05)));
    let bark = band(-0.008, 0.008, 0.006, u - stem(v).x) * band(0.16, 0.80, 0.02, v);
    colour = colour.lerp(rgb(112, 92, 64), bark);
    let green = if number == 0 { rgb(88, 112, 78) } else { rgb(116, 122, 96) };
    for (root, direction, half) in leaves {
        let d = place - (*root + *half * *direction);
        let (a, b) = (d.dot(*direction) / half, d.perp_dot(*direction) / half);
        let wide = 0.36 * (1.0 - a * a) * (1.0 - 0.25 * a);
        let inside = step(0.03, -0.03, b.abs() - wide) * step(1.02, 0.98, a.abs());
        let vein = band(-0.02, 0.02, 0.03, b).max(0.6 * band(0.4, 0.6, 0.2, fraction(5.0 * (a - 1.3 * b.abs()))));
        colour = colour.lerp(green * (1.02 - 0.22 * b.signum() * 0.5 + 0.2 * vein), 0.93 * inside);
    }
    let name = print.page([(u - 0.3) / 0.4, (v - 0.85) / 0.06], [13.0, 1.0], 700 + number);
    colour.lerp(rgb(86, 74, 62), 0.8 * name)
}

/// A poster: a large word, discs or arches, small print.
fn poster(print: &Print, u: f32, v: f32, number: u32) -> Vec3 {
    let (ground, ink, mark) = match number {
        0 => (rgb(206, 190, 156), rgb(60, 66, 78), rgb(184, 98, 66)),
        _ => (rgb(118, 140, 140), rgb(228, 220, 202), rgb(214, 172, 104)),
    };
    let mut colour = ground;
    let d = Vec2::new(u - 0.5, v - 0.38);
    if number == 0 {
        for ring in 0..4 {
            let r = 0.27 - 0.065 * ring as f32;
            let tone = if ring % 2 == 0 { mark } else { ground };
            colour = colour.lerp(tone, step(r + 0.003, r - 0.003, d.length()));
        }
        colour = colour.lerp(ink, band(-0.012, 0.012, 0.006, d.x + 0.3 * d.y) * band(0.07, 0.68, 0.006, v));
    } else {
        for arch in 0..5 {
            let r = 0.32 - 0.06 * arch as f32;
            let out = if d.y > 0.1 { d.x.abs() } else { Vec2::new(d.x, d.y - 0.1).length() };
            let tone = [mark, ink, rgb(176, 104, 80), ink, rgb(74, 96, 104)][arch];
            colour = colour.lerp(tone, step(r + 0.003, r - 0.003, out) * step(0.67, 0.664, v));
        }
    }
    let title = print.page([(u - 0.08) / 0.84, (v - 0.7) / 0.15], [6.0, 1.0], 800 + number);
    let small = print.page([(u - 0.1) / 0.8, (v - 0.855) / 0.1], [24.0, 2.0], 820 + 7 * number);
    colour.lerp(ink, 0.92 * title.max(small))
}

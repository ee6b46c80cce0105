//! What grows: leaves of a plant, the garden that windows look out on, the skin of fruit.

use glam::Vec3;

use super::noise::{Noise, band, fraction, rgb, step};

/// A leaf with veins, its midrib along x in the middle of y.
pub(super) fn leaf() -> impl Fn(f32, f32) -> Vec3 + Sync {
    let noise = Noise::new(20);
    move |x, y| {
        let out = (2.0 * y - 1.0).abs();
        let rib = step(0.10, 0.03, out);
        let vein = band(0.42, 0.58, 0.16, fraction(9.0 * x - 3.2 * out)) * step(1.0, 0.3, out);
        let cells = noise.sum([x, y], [48, 48], 2);
        let patches = noise.sum([x, y], [5, 5], 3);
        let green = rgb(86, 122, 72).lerp(rgb(120, 148, 92), 0.5 + 0.5 * patches);
        green * (1.0 + 0.1 * cells + 0.3 * rib + 0.16 * vein)
    }
}

/// The skin of fruit: streaks along x from one cheek to the other and specks, pale, to be tinted.
pub(super) fn skin() -> impl Fn(f32, f32) -> Vec3 + Sync {
    let noise = Noise::new(21);
    move |x, y| {
        let cheek = step(-0.5, 0.6, noise.sum([x, y], [2, 3], 2));
        let streaks = noise.sum([x, y], [4, 48], 2);
        let specks = step(0.72, 0.9, noise.at([x, y], [40, 40]));
        let ground = Vec3::new(0.95, 0.86, 0.7).lerp(Vec3::new(0.95, 0.62, 0.48), cheek);
        ground * (0.95 + 0.1 * streaks + 0.1 * specks)
    }
}

/// What a window looks out on: clouds, hills, trees and a hedge in the sun. Shown as light, so the sky is close to white.
pub(super) fn garden() -> impl Fn(f32, f32) -> Vec3 + Sync {
    let noise = Noise::new(22);
    // A sky is several times as bright as what lies below it.
    let below = |colour: Vec3| 0.62 * colour;
    move |x, y| {
        let clouds = step(-0.15, 0.45, noise.sum([x, 0.7 * y], [5, 6], 5));
        let sky = rgb(196, 220, 240).lerp(rgb(234, 238, 238), step(0.0, 0.6, y));
        let mut colour = sky.lerp(rgb(250, 248, 244), 0.75 * clouds);
        let line = |at: f32, rough: f32, row: f32, cells: u32| at - rough * noise.sum([x, row], [cells, 8], 4);
        let hills = line(0.56, 0.06, 0.1, 4);
        colour = colour.lerp(below(rgb(196, 214, 220)), step(hills - 0.004, hills + 0.004, y));
        let woods = line(0.60, 0.05, 0.3, 14);
        let tufts = noise.sum([x, 2.0 * y], [90, 60], 2);
        colour = colour.lerp(below(rgb(130, 150, 124)) * (1.0 + 0.2 * tufts), step(woods - 0.006, woods + 0.006, y));
        let meadow = below(rgb(164, 176, 112)) * (1.0 + 0.14 * noise.sum([x, y], [24, 120], 3));
        colour = colour.lerp(meadow, step(0.635, 0.65, y + 0.01 * tufts));
        for (at, foot, top, wide, tone) in [
            (0.09, 0.80, 0.16, 0.10, rgb(86, 112, 62)),
            (0.30, 0.74, 0.40, 0.055, rgb(104, 124, 70)),
            (0.43, 0.78, 0.26, 0.075, rgb(92, 120, 66)),
            (0.62, 0.80, 0.20, 0.085, rgb(84, 108, 64)),
            (0.78, 0.74, 0.42, 0.05, rgb(110, 126, 72)),
            (0.92, 0.78, 0.30, 0.07, rgb(94, 122, 70)),
        ] {
            let trunk = band(-0.006, 0.006, 0.004, x - at) * band(0.5 * (top + foot), foot, 0.01, y);
            colour = colour.lerp(below(rgb(112, 94, 76)), trunk);
            // A crown is a heap of leaves: an ellipse with an edge of noise, lit from the upper left.
            let (a, b) = ((x - at) / wide, (y - 0.5 * (top + foot) + 0.06) / (0.5 * (foot - top) - 0.04));
            let leaves = noise.sum([x, 0.5 * y], [28, 14], 5);
            let crown = step(0.08, -0.08, a * a + b * b - 0.8 + 1.1 * leaves);
            let light = 0.95 - 0.28 * a - 0.34 * b + 0.9 * noise.sum([x, 0.5 * y], [70, 36], 3);
            colour = colour.lerp(below(tone * light.clamp(0.35, 1.6)), crown);
        }
        let hedge = 0.84 - 0.02 * noise.sum([x, 0.6], [30, 4], 3);
        let sprigs = noise.sum([x, 0.5 * y], [110, 56], 3);
        colour = colour.lerp(below(rgb(106, 128, 76)) * (0.9 + 0.7 * sprigs), step(hedge - 0.006, hedge + 0.006, y));
        let flowers = step(0.78, 0.9, noise.at([x, 0.5 * y], [120, 60])) * step(hedge, hedge + 0.03, y);
        colour.lerp(below(rgb(226, 200, 190)), 0.85 * flowers)
    }
}

//! What walls, pots and cartons are covered with: plaster, wallpaper, stoneware, cardboard.

use glam::Vec3;

use super::noise::{Noise, band, fraction, rgb, split, step};
use super::print::Print;

/// Plaster that a trowel left: blotches, short strokes that catch the light, grains. Almost white, to be tinted.
pub(super) fn plaster() -> impl Fn(f32, f32) -> Vec3 + Sync {
    let noise = Noise::new(4);
    move |x, y| {
        let blotches = noise.sum([x, y], [5, 5], 4);
        // Strokes go one way in some places and the other way in others.
        let way = step(-0.25, 0.25, noise.sum([x, y], [7, 7], 2));
        let strokes = (1.0 - way) * noise.sum([x, y], [20, 52], 2) + way * noise.sum([y, x], [20, 52], 2);
        // Light from above: the slope of the relief shows as shade.
        let slope = noise.at([x, y], [90, 90]) - noise.at([x, y + 0.003], [90, 90]);
        let grains = noise.sum([x, y], [180, 180], 1);
        let shade = 0.9 + 0.09 * slope + 0.035 * strokes + 0.025 * grains + 0.05 * blotches;
        shade * Vec3::new(1.0, 0.994 - 0.004 * blotches, 0.985 - 0.012 * blotches)
    }
}

/// Wallpaper with twigs in rows, every second row shifted by half.
pub(super) fn wallpaper() -> impl Fn(f32, f32) -> Vec3 + Sync {
    const COLUMNS: f32 = 4.0;
    let noise = Noise::new(5);
    move |x, y| {
        let (column, _) = split(COLUMNS * x);
        let (row, v) = split(4.0 * y + 0.5 * (column.rem_euclid(2)) as f32);
        let u = fraction(COLUMNS * x);
        let draw = noise.random((column.rem_euclid(4) * 4 + row.rem_euclid(4)) as u32);
        let turned = if draw[0] < 0.5 { u } else { 1.0 - u };
        // A stem that leans, and leaves on either side of it.
        let stem = 0.5 + 0.16 * (v - 0.5) - 0.25 * (v - 0.5) * (v - 0.5);
        let mut ink = 0.8 * band(stem - 0.012, stem + 0.012, 0.02, turned) * band(0.14, 0.86, 0.05, v);
        for leaf in 0..6 {
            let at = 0.2 + 0.11 * leaf as f32;
            let side = if leaf % 2 == 0 { 1.0 } else { -1.0 };
            let (a, b) = (side * (turned - stem), v - at + 0.55 * side * (turned - stem));
            let shape = ((a - 0.13) / 0.11) * ((a - 0.13) / 0.11) + (b / 0.035) * (b / 0.035);
            ink = ink.max(step(1.25, 0.75, shape) * (0.75 + 0.25 * step(0.0, 0.3, (b / 0.035).abs())));
        }
        let fibres = noise.sum([x, y], [128, 64], 3);
        let ground = rgb(216, 208, 192) * (1.0 + 0.035 * fibres + 0.03 * noise.sum([x, y], [4, 4], 3));
        ground.lerp(rgb(142, 152, 132) * (1.0 + 0.08 * fibres), 0.72 * ink)
    }
}

/// Stoneware: speckles in glaze over faint rings of the wheel along x, pale, to be tinted.
pub(super) fn stoneware() -> impl Fn(f32, f32) -> Vec3 + Sync {
    let noise = Noise::new(6);
    move |x, y| {
        let rings = noise.sum([x, y], [48, 2], 2);
        let clouds = noise.sum([x, y], [4, 4], 4);
        let speckle = step(0.74, 0.9, noise.at([x, y], [64, 64]));
        (0.88 + 0.05 * rings + 0.07 * clouds - 0.25 * speckle) * Vec3::new(1.0, 0.985, 0.96)
    }
}

/// Four sides of cartons, a quarter of the square each: plain, with tape, with a label, with arrows.
pub(super) fn cardboard() -> impl Fn(f32, f32) -> Vec3 + Sync {
    let noise = Noise::new(7);
    let print = Print::new(8);
    move |x, y| {
        let (column, u) = split(2.0 * x);
        let (row, v) = split(2.0 * y);
        let flutes = noise.sum([x, y], [128, 4], 1);
        let fibres = noise.sum([x, y], [48, 192], 2);
        let stains = noise.sum([x, y], [6, 6], 4);
        let edge = u.min(1.0 - u).min(v).min(1.0 - v);
        let wear = step(0.05, 0.0, edge + 0.03 * noise.sum([x, y], [40, 40], 2));
        let board = rgb(186, 148, 106) * (1.0 + 0.04 * flutes + 0.07 * fibres + 0.07 * stains - 0.12 * wear);
        match column.clamp(0, 1) + 2 * row.clamp(0, 1) {
            1 => {
                let slit = 0.6 * band(0.496, 0.504, 0.006, v);
                let tape = band(0.42, 0.58, 0.006, v);
                let glue = rgb(206, 182, 138) * (1.0 + 0.06 * stains + 0.05 * flutes);
                (board * (1.0 - slit)).lerp(glue, 0.85 * tape)
            }
            2 => {
                let paper = band(0.3, 0.82, 0.006, u) * band(0.28, 0.68, 0.006, v);
                let lines = print.page([(u - 0.34) / 0.44, (v - 0.33) / 0.3], [20.0, 5.0], 11);
                let bars = f32::from(u8::from(noise.at([u, 0.3], [70, 1]) > 0.5)) * band(0.6, 0.65, 0.006, v);
                let ink = lines.max(bars * band(0.36, 0.6, 0.004, u));
                board.lerp((rgb(226, 222, 212) * (1.0 + 0.03 * fibres)).lerp(rgb(52, 52, 58), ink), paper)
            }
            3 => {
                let mut ink = print.page([(u - 0.2) / 0.6, (v - 0.74) / 0.14], [11.0, 1.0], 40);
                for middle in [0.38, 0.62] {
                    let across = (u - middle).abs();
                    let head = step(0.012, 0.0, across - 0.5 * (v - 0.24)) * band(0.24, 0.4, 0.008, v);
                    ink = ink.max(head).max(band(-0.025, 0.025, 0.008, u - middle) * band(0.38, 0.58, 0.008, v));
                }
                ink = ink.max(band(0.28, 0.72, 0.008, u) * band(0.62, 0.65, 0.008, v));
                board.lerp(rgb(92, 66, 52), 0.8 * ink)
            }
            _ => board,
        }
    }
}

//! Wood: boards of furniture, and planks of a floor.

use glam::Vec3;

use super::noise::{Noise, band, fraction, rgb, split, step, wave};

/// Rows of planks across the texture, and planks along each.
const ROWS: u32 = 16;
const ALONG: u32 = 2;

/// Brightness of wood around 1, fibres along x. Years are the dark lines across a side of the texture, fibres the cells of the finest
/// streaks along either side; `shift` makes boards differ.
fn grain(noise: &Noise, [x, y]: [f32; 2], years: u32, fibres: [u32; 2], shift: f32) -> f32 {
    let slow = noise.sum([x + shift, y + 0.37 * shift], [2, years / 4], 3);
    let year = fraction(years as f32 * y + 2.5 * slow + 7.0 * shift);
    // Early wood darkens slowly into a line of late wood.
    let line = 0.09 * step(0.2, 0.85, year) * step(1.0, 0.88, year);
    let streaks = noise.sum([x + shift, y], fibres, 2);
    let pores = step(0.62, 0.95, noise.at([x + 0.61 * shift, y], [2 * fibres[0], fibres[1]]));
    1.0 - line + 0.05 * streaks + 0.06 * slow - 0.09 * pores
}

/// Boards without joints, pale, to be tinted.
pub(super) fn boards() -> impl Fn(f32, f32) -> Vec3 + Sync {
    let noise = Noise::new(1);
    move |x, y| {
        let shade = grain(&noise, [x, y], 36, [16, 256], 0.0);
        let warm = noise.sum([x, y], [2, 8], 2);
        shade * Vec3::new(0.94, 0.9 + 0.012 * warm, 0.85 + 0.03 * warm)
    }
}

/// Planks with gaps between them; each has a shade of its own, and some have a knot.
pub(super) fn planks() -> impl Fn(f32, f32) -> Vec3 + Sync {
    let noise = Noise::new(2);
    let rows: Vec<f32> = (0..ROWS).map(|row| noise.random(row)[0]).collect();
    let planks: Vec<[[f32; 4]; 2]> =
        (0..ROWS * ALONG).map(|plank| [noise.random(100 + plank), noise.random(200 + plank)]).collect();
    move |x, y| {
        let (row, across) = split(y * ROWS as f32);
        let row = row.clamp(0, ROWS as i32 - 1) as u32;
        let (number, along) = split((x + rows[row as usize]) * ALONG as f32);
        let [draw, knot] = planks[(row * ALONG + number.rem_euclid(ALONG as i32) as u32) as usize];
        // Fibres flow around a knot: the place in the board moves away from it.
        let (dx, dy) = (9.0 * (along - 0.15 - 0.7 * knot[0]), 2.2 * (across - 0.2 - 0.6 * knot[1]));
        let near = if knot[2] < 0.4 { 1.0 / (1.0 + 28.0 * (dx * dx + dy * dy)) } else { 0.0 };
        let bent = [x, y + 0.02 * near * if dy < 0.0 { -1.0 } else { 1.0 }];
        let wood = grain(&noise, bent, 112, [24, 512], draw[0]);
        let shade = (0.86 + 0.2 * draw[1]) * wood * (1.0 - 0.45 * near * near);
        let mild = rgb(190, 154, 120).lerp(rgb(200, 160, 118), draw[2]);
        let colour = shade * mild.lerp(rgb(170, 142, 116), 0.5 * draw[3]);
        // The gap is soft, two texels on either side, with an edge that is worn bright.
        let ends = ALONG as f32 / ROWS as f32;
        let edge = across.min(1.0 - across).min((along.min(1.0 - along)) / ends);
        let worn = noise.at([x, y], [64, 256]);
        let gap = step(0.030, 0.004, edge) * (0.75 + 0.25 * worn);
        let rim = 0.05 * band(0.035, 0.07, 0.03, edge) * worn;
        colour * (1.0 - 0.62 * gap + rim)
    }
}

/// Varnish or paint that a brush put on: streaks along x over dirt and wear, almost white, to be tinted.
pub(super) fn paint() -> impl Fn(f32, f32) -> Vec3 + Sync {
    let noise = Noise::new(3);
    move |x, y| {
        let drift = 0.02 * noise.sum([x, y], [3, 3], 2);
        let streaks = noise.sum([x, y + drift], [4, 64], 2);
        let blotches = noise.sum([x, y], [4, 4], 4);
        let specks = step(0.8, 1.0, noise.at([x, y], [96, 96])) * wave(3.0 * x + 5.0 * y);
        (0.91 + 0.025 * streaks + 0.03 * blotches - 0.05 * specks) * Vec3::new(1.0, 0.99, 0.97)
    }
}

//! Cloth: weave, bed linen, knotted rugs.

use glam::Vec3;

use super::noise::{Noise, band, fraction, rgb, split, step, wave};

/// Threads along a side of the weave.
const THREADS: f32 = 64.0;

/// A weave of threads that go over and under one another, each with a shade of its own; pale, to be tinted.
pub(super) fn weave() -> impl Fn(f32, f32) -> Vec3 + Sync {
    let noise = Noise::new(14);
    move |x, y| {
        let ((i, s), (j, t)) = (split(THREADS * x), split(THREADS * y));
        let is_warp = (i + j).rem_euclid(2) == 0;
        // Across the thread on top its brightness is round, along it it dips where it goes under.
        let (across, along) = if is_warp { (s, t) } else { (t, s) };
        let thread = wave(across) * (0.55 + 0.45 * wave(along));
        let own = if is_warp { noise.at([x, 0.25 + 0.02 * y], [64, 4]) } else { noise.at([0.02 * x, y], [4, 64]) };
        let slubs = noise.sum([x, y], [10, 10], 4);
        let fuzz = noise.sum([x, y], [128, 128], 1);
        (0.66 + 0.2 * thread + 0.1 * own + 0.09 * slubs + 0.04 * fuzz) * Vec3::new(0.98, 0.965, 0.94)
    }
}

/// Bed linen: stripes in pairs and small sprigs on a fine weave with creases; pale, to be tinted.
pub(super) fn linen() -> impl Fn(f32, f32) -> Vec3 + Sync {
    let noise = Noise::new(15);
    move |x, y| {
        let weave = 0.5 * wave(128.0 * x) + 0.5 * wave(128.0 * y);
        let creases = noise.sum([x, y], [6, 6], 4);
        let stripe = fraction(8.0 * x);
        let line = band(0.42, 0.47, 0.03, stripe).max(band(0.53, 0.58, 0.03, stripe));
        let (column, u) = split(8.0 * x + 0.5);
        let v = fraction(8.0 * y + 0.5 * column.rem_euclid(2) as f32);
        let (a, b) = (u - 0.5, v - 0.5);
        // Four petals: far from the axes between them, near the middle.
        let petal = step(0.05, 0.03, (a * b).abs() * 12.0 + (a * a + b * b) * 1.4 - 0.02);
        let dot = step(0.004, 0.002, a * a + b * b);
        let ground = Vec3::new(0.93, 0.92, 0.9) * (0.95 + 0.05 * weave + 0.05 * creases);
        let inked = (0.55 * line).max(0.6 * petal) * (0.85 + 0.15 * weave);
        ground.lerp(rgb(122, 136, 150), inked).lerp(rgb(196, 160, 112), 0.8 * dot)
    }
}

/// Brightness of the knots of a rug, of which there are so many along its sides: each is a bump, rows differ.
fn knots(noise: &Noise, [x, y]: [f32; 2], count: [f32; 2]) -> f32 {
    let bump = wave(count[0] * x) * wave(count[1] * y);
    let yarn = noise.at([x, y], count.map(|n| n as u32));
    let rows = noise.at([0.03 * x, y], [4, count[1] as u32]);
    0.8 + 0.16 * bump + 0.12 * yarn + 0.06 * rows + 0.06 * noise.sum([x, y], [8, 6], 3)
}

/// A large rug with a border, corners and a medallion, all in knots.
pub(super) fn rug() -> impl Fn(f32, f32) -> Vec3 + Sync {
    const COUNT: [f32; 2] = [256.0, 192.0];
    const RED: Vec3 = rgb(150, 78, 62);
    const CREAM: Vec3 = rgb(214, 196, 164);
    const NAVY: Vec3 = rgb(64, 78, 100);
    const OCHRE: Vec3 = rgb(190, 146, 88);
    const SAGE: Vec3 = rgb(134, 142, 116);
    let noise = Noise::new(16);
    move |x, y| {
        // Colours change from knot to knot, as they do where a rug is tied by a chart.
        let at = |t: f32, n: f32| (split(t * n).0 as f32 + 0.5) / n;
        let (kx, ky) = (at(x, COUNT[0]), at(y, COUNT[1]));
        let (u, v) = (((kx - 0.5) * 4.0 / 3.0).abs(), (ky - 0.5).abs());
        let from_edge = (2.0 / 3.0 - u).min(0.5 - v);
        let along = if 2.0 / 3.0 - u < 0.5 - v { ky } else { kx * 4.0 / 3.0 };
        let colour = match from_edge {
            e if e < 0.012 => CREAM,
            e if e < 0.03 => NAVY,
            e if e < 0.045 => OCHRE,
            e if e < 0.105 => {
                // Diamonds in a row, with a smaller one in each.
                let d = (fraction(12.0 * along) - 0.5).abs() + (e - 0.075).abs() / 0.06;
                if d < 0.16 {
                    RED
                } else if d < 0.42 {
                    CREAM
                } else {
                    NAVY
                }
            }
            e if e < 0.12 => OCHRE,
            e if e < 0.13 => CREAM,
            _ => {
                let medallion = u * 0.8 + v + 0.02 * wave(14.0 * (u - v));
                let corner = (0.54 - u).max(0.0) + (0.37 - v).max(0.0);
                let lattice = (fraction(9.0 * u) - 0.5).abs() + (fraction(9.0 * v) - 0.5).abs();
                match medallion {
                    m if m < 0.05 => OCHRE,
                    m if m < 0.09 => NAVY,
                    m if m < 0.15 => CREAM,
                    m if m < 0.165 => RED,
                    m if m < 0.23 && lattice < 0.3 => CREAM,
                    m if m < 0.23 => SAGE,
                    m if m < 0.25 => NAVY,
                    m if m < 0.262 => CREAM,
                    _ if corner < 0.13 => {
                        if lattice < 0.34 {
                            OCHRE
                        } else {
                            NAVY
                        }
                    }
                    _ if corner < 0.145 => CREAM,
                    _ if lattice < 0.14 => OCHRE,
                    _ if lattice < 0.24 => CREAM.lerp(RED, 0.4),
                    _ => RED,
                }
            }
        };
        colour * knots(&noise, [x, y], COUNT)
    }
}

/// A long-haired rug in natural wool with thin lines that cross to lozenges.
pub(super) fn wool() -> impl Fn(f32, f32) -> Vec3 + Sync {
    let noise = Noise::new(17);
    move |x, y| {
        let (wx, wy) = (x + 0.008 * noise.sum([x, y], [40, 40], 1), y + 0.008 * noise.sum([y, x], [40, 40], 1));
        let cross = |t: f32| {
            let f = fraction(t);
            step(0.045, 0.02, f.min(1.0 - f))
        };
        let ink = cross(3.0 * wx + 2.0 * wy).max(cross(3.0 * wx - 2.0 * wy));
        let tufts = noise.sum([x, y], [48, 64], 3);
        let dents = noise.sum([x, y], [5, 5], 3);
        let edge = x.min(1.0 - x).min(0.7 * y).min(0.7 * (1.0 - y));
        let ground = rgb(208, 196, 174) * (0.96 + 0.17 * tufts + 0.06 * dents);
        ground.lerp(rgb(96, 88, 80) * (1.0 + 0.2 * tufts), 0.85 * ink.max(step(0.03, 0.022, edge)))
    }
}

//! Noise that tiles, and the curves that patterns are made of.
//!
//! Only additions, multiplications, divisions and roots are taken, so that textures have the same bits on every machine.

use glam::Vec3;

use crate::scene::random;

/// Seed of all textures; each has a stream of its own.
const SEED: u64 = 0x7465_7874;
/// Values along a side of the lattice.
const LATTICE: u32 = 256;

/// Random numbers of one texture, and noise over the unit square that continues across its edges.
pub(super) struct Noise {
    stream: u32,
    lattice: Vec<f32>,
}

impl Noise {
    /// Numbers of a stream.
    pub fn new(stream: u32) -> Self {
        let draws = (0..LATTICE * LATTICE / 4).flat_map(|i| random::bits(SEED, stream, i));
        Self { stream, lattice: draws.map(random::uniform).collect() }
    }

    /// Four uniform numbers of a thing by its number. Counted from above, so that none of them is in the lattice.
    pub fn random(&self, number: u32) -> [f32; 4] {
        random::bits(SEED, self.stream, u32::MAX - number).map(random::uniform)
    }

    /// Smooth noise in [0, 1] with so many cells along each side.
    pub fn at(&self, [x, y]: [f32; 2], cells: [u32; 2]) -> f32 {
        self.shifted([x, y], cells, 0)
    }

    fn shifted(&self, [x, y]: [f32; 2], cells: [u32; 2], shift: u32) -> f32 {
        let (i, s) = split(x * cells[0] as f32);
        let (j, t) = split(y * cells[1] as f32);
        let ([i0, i1], [j0, j1]) = (around(i, cells[0]), around(j, cells[1]));
        let value = |i: u32, j: u32| {
            let (column, row) = ((i + 71 * shift) % LATTICE, (j + 29 * shift) % LATTICE);
            self.lattice[(row * LATTICE + column) as usize]
        };
        let (s, t) = (s * s * (3.0 - 2.0 * s), t * t * (3.0 - 2.0 * t));
        let top = value(i0, j0) + s * (value(i1, j0) - value(i0, j0));
        let bottom = value(i0, j1) + s * (value(i1, j1) - value(i0, j1));
        top + t * (bottom - top)
    }

    /// A sum of noises, each twice as fine and half as strong as the one before; its mean is 0 and it stays in [-1, 1].
    pub fn sum(&self, place: [f32; 2], cells: [u32; 2], octaves: u32) -> f32 {
        let (mut sum, mut weight, mut all) = (0.0, 1.0, 0.0);
        for octave in 0..octaves {
            let noise = self.shifted(place, cells.map(|n| n << octave), octave + 1);
            sum += weight * (2.0 * noise - 1.0);
            all += weight;
            weight *= 0.5;
        }
        sum / all
    }
}

/// A cell of a row that repeats after `count`, and the next one. Almost all are within the row: divisions take longer than all the rest.
fn around(i: i32, count: u32) -> [u32; 2] {
    let i = if (0..count as i32).contains(&i) { i as u32 } else { i.rem_euclid(count as i32) as u32 };
    [i, if i + 1 == count { 0 } else { i + 1 }]
}

/// Whole part, rounded down, and the rest.
pub(super) fn split(x: f32) -> (i32, f32) {
    let whole = x as i32 - i32::from(x < 0.0);
    (whole, x - whole as f32)
}

/// The part of a number after its point, in [0, 1].
pub(super) fn fraction(x: f32) -> f32 {
    split(x).1
}

/// From 0 at `from` to 1 at `to`, smoothly; the other way round where `to` is the smaller.
pub(super) fn step(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A smooth wave of period 1 in [0, 1], which begins at 0.
pub(super) fn wave(x: f32) -> f32 {
    let t = fraction(x);
    let t = if t < 0.5 { 2.0 * t } else { 2.0 - 2.0 * t };
    t * t * (3.0 - 2.0 * t)
}

/// An sRGB colour.
pub(super) const fn rgb(r: u8, g: u8, b: u8) -> Vec3 {
    Vec3::new(r as f32 / 255.0, g as f32 / 255.0, b as f32 / 255.0)
}

/// 1 within a band from `low` to `high`, 0 outside of it, over an edge that is `soft` wide.
pub(super) fn band(low: f32, high: f32, soft: f32, x: f32) -> f32 {
    step(low - 0.5 * soft, low + 0.5 * soft, x) * step(high + 0.5 * soft, high - 0.5 * soft, x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, every texture would show a seam where it repeats.
    #[test]
    fn noise_continues_across_the_edges() {
        let noise = Noise::new(1);
        for i in 0..100 {
            let y = i as f32 / 100.0;
            for cells in [[4, 4], [16, 256]] {
                assert!((noise.sum([0.0, y], cells, 3) - noise.sum([1.0, y], cells, 3)).abs() < 1e-4);
                assert!((noise.sum([y, 0.0], cells, 3) - noise.sum([y, 1.0], cells, 3)).abs() < 1e-4);
            }
        }
    }

    /// If this failed, patterns would be brighter or darker than their colours say.
    #[test]
    fn noise_has_a_mean_of_zero() {
        let noise = Noise::new(2);
        let all: Vec<f32> =
            (0..10_000).map(|i| noise.sum([(i % 100) as f32 / 100.0, (i / 100) as f32 / 100.0], [32, 32], 3)).collect();
        assert!(all.iter().sum::<f32>().abs() / 1e4 < 0.02 && all.iter().all(|v| v.abs() <= 1.0));
        assert!(all.iter().map(|v| v * v).sum::<f32>() / 1e4 > 0.02);
    }
}

//! Morton order: points sorted along it lie near one another, and equal prefixes share a grid cell.

use glam::DVec3;

/// Bits per axis of a code: the finest grid has 2^21 cells along the longest side of the bounds.
pub(crate) const BITS: u32 = 21;

/// Code of `p` within the cube at `min` with the given side: the bits of the cell's three coordinates, interleaved.
/// Dropping the lowest `3 * k` bits gives the code on a grid with cells 2^k times as long.
pub(crate) fn code(p: DVec3, min: DVec3, side: f64) -> u64 {
    let cells = f64::from(1u32 << BITS);
    let scale = if side > 0.0 { cells / side } else { 0.0 };
    // The clamp keeps the conversion within 21 bits.
    let cell = ((p - min) * scale).clamp(DVec3::ZERO, DVec3::splat(cells - 1.0));
    spread(cell.x as u64) | spread(cell.y as u64) << 1 | spread(cell.z as u64) << 2
}

/// Moves bit i of a 21-bit number to bit 3i.
fn spread(x: u64) -> u64 {
    let x = (x | x << 32) & 0x001f_0000_0000_ffff;
    let x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    let x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    let x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wrong mask would merge points of different cells or split those of one.
    #[test]
    fn codes_interleave_the_cell_coordinates() {
        for x in [0u64, 1, 0x15_5555, 0x0a_aaaa, 0x1f_ffff] {
            let expected = (0..21).fold(0, |acc, i| acc | (x >> i & 1) << (3 * i));
            assert_eq!(spread(x), expected);
        }
        let corner = code(DVec3::ONE, DVec3::ZERO, 1.0);
        assert_eq!(corner, (1 << 63) - 1);
        assert_eq!(code(DVec3::new(0.9, 0.1, 0.1), DVec3::ZERO, 1.0) >> 60, 1);
        assert_eq!(code(DVec3::ONE, DVec3::ONE, 0.0), 0);
    }
}

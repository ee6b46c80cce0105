//! Colours: the sRGB curve and the colour map of exported values.

use glam::DVec3;

/// Weights of linear red, green and blue in the luma (Rec. 709).
pub(crate) const LUMA: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

/// Linear value of an sRGB value in [0, 1] (IEC 61966-2-1).
pub(crate) fn decoded(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// Linear value in [0, 1] of an 8-bit sRGB value.
pub(crate) fn linear(value: u8) -> f64 {
    decoded(f64::from(value) / 255.0)
}

/// 8-bit sRGB values of a linear colour, clamped to [0, 1].
pub(crate) fn srgb(colour: DVec3) -> [u8; 3] {
    colour.to_array().map(|v| (255.0 * encoded(v)).round() as u8)
}

/// sRGB value in [0, 1] of a linear one, clamped to [0, 1].
pub(crate) fn encoded(value: f64) -> f64 {
    let v = value.clamp(0.0, 1.0);
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// Luma of the linear colour of an sRGB colour, clamped to [0, 1].
pub(crate) fn luma(colour: DVec3) -> f64 {
    LUMA.dot(colour.clamp(DVec3::ZERO, DVec3::ONE).map(decoded))
}

/// Nearest 8-bit value of each channel of `colour`, which is sRGB already, clamped to [0, 1].
pub(crate) fn bytes(colour: DVec3) -> [u8; 3] {
    colour.to_array().map(|v| (255.0 * v.clamp(0.0, 1.0)).round() as u8)
}

/// Mean of the 8-bit sRGB colours of a triangle's vertices.
pub(crate) fn mean(colours: [[u8; 3]; 3]) -> [u8; 3] {
    std::array::from_fn(|c| {
        let sum: u16 = colours.iter().map(|colour| u16::from(colour[c])).sum();
        ((sum + 1) / 3) as u8
    })
}

/// The viridis colour map at `t` in [0, 1]: dark blue, green, yellow; even steps of `t` look even, to colour-blind eyes
/// too. Grey where `t` is not finite. Interpolated between 9 even samples of the map of Smith and van der Walt (2015).
pub(crate) fn viridis(t: f32) -> [u8; 3] {
    const SAMPLES: [[u8; 3]; 9] = [
        [68, 1, 84],
        [71, 45, 123],
        [59, 82, 139],
        [44, 114, 142],
        [33, 144, 140],
        [39, 173, 129],
        [93, 200, 99],
        [170, 220, 50],
        [253, 231, 37],
    ];
    if !t.is_finite() {
        return [128; 3];
    }
    let x = t.clamp(0.0, 1.0) * 8.0;
    let i = (x as usize).min(7);
    let f = x - i as f32;
    std::array::from_fn(|c| {
        let [a, b] = [SAMPLES[i][c], SAMPLES[i + 1][c]].map(f32::from);
        (a + f * (b - a)).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, colours would drift with every round trip through a file.
    #[test]
    fn the_srgb_curve_and_its_inverse_agree_on_every_byte() {
        for v in 0..=255 {
            assert_eq!(srgb(DVec3::splat(linear(v))), [v; 3]);
        }
    }

    /// If this failed, the map would not rise in brightness, and high and low values would be indistinguishable.
    #[test]
    fn viridis_grows_brighter() {
        let luma = |c: [u8; 3]| 0.2126 * linear(c[0]) + 0.7152 * linear(c[1]) + 0.0722 * linear(c[2]);
        let values: Vec<f64> = (0..=64).map(|i| luma(viridis(i as f32 / 64.0))).collect();
        assert!(values.windows(2).all(|w| w[1] > w[0]), "{values:?}");
    }
}

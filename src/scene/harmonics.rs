//! Functions of direction: real spherical harmonics of degrees 1 and 2 on top of a constant of one.
//!
//! A lobe is eight coefficients c and stands for `f(w) = 1 + sum c_k B_k(w)`. The basis is the usual real orthonormal
//! one times sqrt(4 pi), so that each function has a mean of zero and a mean square of one over the sphere and f has
//! the mean one. Order: Y1-1, Y10, Y11, Y2-2, Y2-1, Y20, Y21, Y22.

use std::sync::LazyLock;

use glam::DVec3;

use super::octahedral;

/// Coefficients of a function of direction with mean one.
pub type Lobe = [f32; 8];

/// Directions over which the least value of a lobe is looked for: texels along a side of an octahedral map.
const RESOLUTION: u32 = 16;

/// The eight functions in unit direction `w`.
pub fn basis(w: DVec3) -> [f64; 8] {
    let DVec3 { x, y, z } = w;
    let (three, five, fifteen) = (3f64.sqrt(), 5f64.sqrt(), 15f64.sqrt());
    [
        three * y,
        three * z,
        three * x,
        fifteen * x * y,
        fifteen * y * z,
        0.5 * five * (3.0 * z * z - 1.0),
        fifteen * x * z,
        0.5 * fifteen * (x * x - y * y),
    ]
}

/// f in unit direction `w`.
pub fn value(lobe: &Lobe, w: DVec3) -> f64 {
    1.0 + lobe.iter().zip(basis(w)).map(|(c, b)| f64::from(*c) * b).sum::<f64>()
}

/// The lobe with all coefficients scaled by the same factor, at most one, so that f is nowhere below `least` (less than
/// one).
pub fn at_least(lobe: &Lobe, least: f64) -> Lobe {
    static DIRECTIONS: LazyLock<Vec<[f64; 8]>> =
        LazyLock::new(|| octahedral::directions(RESOLUTION).into_iter().map(basis).collect());
    let value = |basis: &[f64; 8]| 1.0 + lobe.iter().zip(basis).map(|(c, b)| f64::from(*c) * b).sum::<f64>();
    let lowest = DIRECTIONS.iter().map(value).fold(f64::INFINITY, f64::min);
    // Between the texels f dips a little lower.
    let dip = 1.05 * (1.0 - lowest);
    let factor = if dip > 1.0 - least { ((1.0 - least) / dip) as f32 } else { 1.0 };
    lobe.map(|c| factor * c)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a lobe would change the mean of what is asked for at a point, or one coefficient would speak for
    /// another's direction.
    #[test]
    fn the_basis_is_orthonormal_and_of_mean_zero() {
        // Midpoints of 128 x 128 texels: exact to some (2/128)^2.
        let directions = octahedral::directions(128);
        let mean = |f: &dyn Fn(&[f64; 8]) -> f64| {
            directions.iter().map(|w| f(&basis(*w))).sum::<f64>() / directions.len() as f64
        };
        for i in 0..8 {
            assert!(mean(&|b| b[i]).abs() < 1e-3, "the mean of function {i} is {}", mean(&|b| b[i]));
            for j in 0..8 {
                let product = mean(&|b| b[i] * b[j]);
                assert!((product - f64::from(i == j)).abs() < 1e-3, "functions {i} and {j}: {product}");
            }
        }
    }

    /// If this failed, files of other programs would be read with axes exchanged.
    #[test]
    fn degree_one_is_ordered_y_z_x() {
        for (axis, k) in [(DVec3::Y, 0), (DVec3::Z, 1), (DVec3::X, 2)] {
            assert!((basis(axis)[k] - 3f64.sqrt()).abs() < 1e-12);
        }
        assert!((basis(DVec3::Z)[5] - 5f64.sqrt()).abs() < 1e-12);
        assert!((basis(DVec3::X)[7] - 0.5 * 15f64.sqrt()).abs() < 1e-12);
    }

    /// A target below zero would ask for light to be taken away.
    #[test]
    fn a_bounded_lobe_falls_nowhere_below_its_floor() {
        let strong = [0.9, -0.4, 0.3, 0.5, -0.8, 0.2, 0.1, -0.6];
        let bounded = at_least(&strong, 0.25);
        let lowest = octahedral::directions(128).iter().map(|w| value(&bounded, *w)).fold(f64::INFINITY, f64::min);
        assert!((0.25..0.35).contains(&lowest), "the least value is {lowest}");
        let weak = [0.05f32; 8];
        assert_eq!(at_least(&weak, 0.25), weak);
    }
}

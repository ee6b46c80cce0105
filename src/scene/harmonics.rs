//! Functions of direction: lobes of surfaces, and the basis that trained splats are stored in.
//!
//! A lobe has real spherical harmonics of degrees 1 and 2 on top of a constant of one: it is eight coefficients c and stands
//! for `f(w) = 1 + sum c_k B_k(w)`. Its basis is the usual real orthonormal one times sqrt(4 pi), so that each function has
//! a mean of zero and a mean square of one over the sphere and f has the mean one. Order: Y1-1, Y10, Y11, Y2-2, Y2-1, Y20,
//! Y21, Y22.

use std::sync::LazyLock;

use glam::DVec3;

use super::octahedral;

/// Coefficients of a function of direction with mean one.
pub type Lobe = [f32; 8];

/// Value of the constant spherical harmonic, 1 / (2 sqrt(pi)).
pub const CONSTANT: f64 = 0.282_094_791_773_878_14;

/// sqrt(3 / (4 pi)), of all functions of degree 1.
const ONE: f64 = 0.488_602_511_902_919_9;
/// sqrt(15 / (4 pi)) and sqrt(5 / (16 pi)), of degree 2.
const TWO: [f64; 2] = [1.092_548_430_592_079_2, 0.315_391_565_252_520_05];
/// sqrt(35 / (32 pi)), sqrt(105 / (4 pi)), sqrt(21 / (32 pi)) and sqrt(7 / (16 pi)), of degree 3.
const THREE: [f64; 4] =
    [0.590_043_589_926_643_5, 2.890_611_442_640_554, 0.457_045_799_464_465_8, 0.373_176_332_590_115_4];

/// Directions over which the least value of a lobe is looked for: texels along a side of an octahedral map.
const RESOLUTION: u32 = 16;

/// The eight functions of a lobe in unit direction `w`.
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

/// Real spherical harmonics of degrees 1 to 3 in unit direction `w`, with the signs and the order of 3D Gaussian splatting
/// (Kerbl et al. 2023, after Sloan, "Efficient Spherical Harmonic Evaluation", JCGT 2013). With [`CONSTANT`] orthonormal.
pub fn above_constant(w: DVec3) -> [f64; 15] {
    let DVec3 { x, y, z } = w;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        -ONE * y,
        ONE * z,
        -ONE * x,
        TWO[0] * x * y,
        -TWO[0] * y * z,
        TWO[1] * (2.0 * zz - xx - yy),
        -TWO[0] * x * z,
        0.5 * TWO[0] * (xx - yy),
        -THREE[0] * y * (3.0 * xx - yy),
        THREE[1] * x * y * z,
        -THREE[2] * y * (4.0 * zz - xx - yy),
        THREE[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -THREE[2] * x * (4.0 * zz - xx - yy),
        0.5 * THREE[1] * z * (xx - yy),
        -THREE[0] * x * (xx - 3.0 * yy),
    ]
}

/// Gradients of the polynomials of [`above_constant`] by x, y and z. On the sphere only what is across `w` has a meaning.
pub fn above_constant_slopes(w: DVec3) -> [DVec3; 15] {
    let DVec3 { x, y, z } = w;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        DVec3::new(0.0, -ONE, 0.0),
        DVec3::new(0.0, 0.0, ONE),
        DVec3::new(-ONE, 0.0, 0.0),
        TWO[0] * DVec3::new(y, x, 0.0),
        -TWO[0] * DVec3::new(0.0, z, y),
        TWO[1] * DVec3::new(-2.0 * x, -2.0 * y, 4.0 * z),
        -TWO[0] * DVec3::new(z, 0.0, x),
        TWO[0] * DVec3::new(x, -y, 0.0),
        -THREE[0] * DVec3::new(6.0 * x * y, 3.0 * (xx - yy), 0.0),
        THREE[1] * DVec3::new(y * z, x * z, x * y),
        -THREE[2] * DVec3::new(-2.0 * x * y, 4.0 * zz - xx - 3.0 * yy, 8.0 * y * z),
        THREE[3] * DVec3::new(-6.0 * x * z, -6.0 * y * z, 6.0 * zz - 3.0 * xx - 3.0 * yy),
        -THREE[2] * DVec3::new(4.0 * zz - 3.0 * xx - yy, -2.0 * x * y, 8.0 * x * z),
        0.5 * THREE[1] * DVec3::new(2.0 * x * z, -2.0 * y * z, xx - yy),
        -THREE[0] * DVec3::new(3.0 * (xx - yy), -6.0 * x * y, 0.0),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, trained splats would show other colours than in every other program, or one coefficient would count
    /// for more than another.
    #[test]
    fn the_basis_of_trained_splats_is_orthonormal() {
        let directions = octahedral::directions(128);
        let values: Vec<[f64; 15]> = directions.iter().map(|w| above_constant(*w)).collect();
        // The mean over the sphere is the integral over 4 pi.
        let integral = |f: &dyn Fn(&[f64; 15]) -> f64| {
            4.0 * std::f64::consts::PI * values.iter().map(f).sum::<f64>() / values.len() as f64
        };
        for i in 0..15 {
            assert!(integral(&|b| b[i] * CONSTANT).abs() < 2e-3, "the mean of function {i}");
            for j in 0..15 {
                let product = integral(&|b| b[i] * b[j]);
                assert!((product - f64::from(i == j)).abs() < 2e-3, "functions {i} and {j}: {product}");
            }
        }
    }

    /// If this failed, colours would turn the wrong way: constants and signs as they stand in the published code.
    #[test]
    fn the_basis_is_that_of_the_published_code() {
        let d = DVec3::new(0.48, -0.6, 0.64);
        let found = above_constant(d);
        let DVec3 { x, y, z } = d;
        let (xx, yy, zz) = (x * x, y * y, z * z);
        let published = [
            -0.488_602_511_9 * y,
            0.488_602_511_9 * z,
            -0.488_602_511_9 * x,
            1.092_548_430_6 * x * y,
            -1.092_548_430_6 * y * z,
            0.315_391_565_3 * (2.0 * zz - xx - yy),
            -1.092_548_430_6 * x * z,
            0.546_274_215_3 * (xx - yy),
            -0.590_043_589_9 * y * (3.0 * xx - yy),
            2.890_611_442_6 * x * y * z,
            -0.457_045_799_5 * y * (4.0 * zz - xx - yy),
            0.373_176_332_6 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
            -0.457_045_799_5 * x * (4.0 * zz - xx - yy),
            1.445_305_721_3 * z * (xx - yy),
            -0.590_043_589_9 * x * (xx - 3.0 * yy),
        ];
        for (k, (a, b)) in found.iter().zip(published).enumerate() {
            assert!((a - b).abs() < 1e-8, "harmonic {k}: {a} against {b}");
        }
    }

    /// If this failed, colours that change with the view would pull the centres of their splats the wrong way.
    #[test]
    fn slopes_are_those_of_the_basis() {
        let w = DVec3::new(0.48, -0.6, 0.64);
        let slopes = above_constant_slopes(w);
        for (axis, step) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
            let (above, below) = (above_constant(w + 1e-5 * step), above_constant(w - 1e-5 * step));
            for k in 0..15 {
                let difference = (above[k] - below[k]) / 2e-5;
                assert!((slopes[k][axis] - difference).abs() < 1e-8, "function {k}, axis {axis}");
            }
        }
    }

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

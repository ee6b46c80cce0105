//! The spherical harmonics that the colours of trained splats are stored in.

use glam::{DQuat, DVec3};

/// Value of the constant spherical harmonic, 1 / (2 sqrt(pi)).
pub(crate) const CONSTANT: f64 = 0.282_094_791_773_878_14;

/// sqrt(3 / (4 pi)), of all functions of degree 1.
const ONE: f64 = 0.488_602_511_902_919_9;
/// sqrt(15 / (4 pi)) and sqrt(5 / (16 pi)), of degree 2.
const TWO: [f64; 2] = [1.092_548_430_592_079_2, 0.315_391_565_252_520_05];
/// sqrt(35 / (32 pi)), sqrt(105 / (4 pi)), sqrt(21 / (32 pi)) and sqrt(7 / (16 pi)), of degree 3.
const THREE: [f64; 4] =
    [0.590_043_589_926_643_5, 2.890_611_442_640_554, 0.457_045_799_464_465_8, 0.373_176_332_590_115_4];

/// Real spherical harmonics of degrees 1 to 3 in unit direction `w`, with the signs and the order of 3D Gaussian splatting
/// (Kerbl et al. 2023, after Sloan, "Efficient Spherical Harmonic Evaluation", JCGT 2013). With [`CONSTANT`] orthonormal.
pub(crate) fn above_constant(w: DVec3) -> [f64; 15] {
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
pub(crate) fn above_constant_slopes(w: DVec3) -> [DVec3; 15] {
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

/// Nodes and weights of Gauss and Legendre's quadrature with four points, exact for polynomials up to degree 7.
const QUADRATURE: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    (-0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
];

/// The matrix that takes the coefficients of [`above_constant`] to those of the function turned by `rotation`: row i has what each adds to
/// coefficient i. By quadrature over the sphere, which is exact for products of degree 6.
pub(crate) fn turned(rotation: DQuat) -> [[f64; 15]; 15] {
    const STEPS: u32 = 8;
    let mut matrix = [[0.0; 15]; 15];
    let back = rotation.inverse();
    for (z, weight) in QUADRATURE {
        for step in 0..STEPS {
            let (sin, cos) = (f64::from(step) * std::f64::consts::TAU / f64::from(STEPS)).sin_cos();
            let across = (1.0 - z * z).sqrt();
            let w = DVec3::new(across * cos, across * sin, z);
            let (own, from) = (above_constant(w), above_constant(back * w));
            let area = weight * std::f64::consts::TAU / f64::from(STEPS);
            for (row, own) in matrix.iter_mut().zip(own) {
                row.iter_mut().zip(from).for_each(|(sum, from)| *sum += area * own * from);
            }
        }
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::octahedral;

    /// If this failed, colours of a model that a scene turns would stay behind, or turn the other way.
    #[test]
    fn a_turned_function_has_its_values_elsewhere() {
        let rotation = DQuat::from_scaled_axis(DVec3::new(0.4, -1.1, 0.7));
        let matrix = turned(rotation);
        let before: [f64; 15] = std::array::from_fn(|k| (1.0 + k as f64).sin());
        let after = matrix.map(|row| row.iter().zip(before).map(|(a, b)| a * b).sum::<f64>());
        let value = |c: &[f64; 15], w: DVec3| c.iter().zip(above_constant(w)).map(|(c, b)| c * b).sum::<f64>();
        for w in octahedral::directions(4) {
            let (a, b) = (value(&after, rotation * w), value(&before, w));
            assert!((a - b).abs() < 1e-12, "{w}: {a} for {b}");
        }
    }

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

    /// If this failed, colours would turn the wrong way: constants and signs as in the published code.
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
}

//! The direction across which something spreads least.

use glam::{DMat3, DVec3};

/// The unit eigenvector of a symmetric matrix with the smallest eigenvalue, by cyclic Jacobi rotations.
pub(super) fn direction_of_least_variance(matrix: DMat3) -> DVec3 {
    let mut a = matrix;
    let trace = a.col(0).x + a.col(1).y + a.col(2).z;
    let mut vectors = DMat3::IDENTITY;
    for _ in 0..12 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = a.col(q)[p];
            // Converged (always so after a few sweeps), or zero to begin with.
            if off.abs() <= 1e-16 * trace {
                continue;
            }
            let theta = 0.5 * (2.0 * off).atan2(a.col(q)[q] - a.col(p)[p]);
            let (sin, cos) = theta.sin_cos();
            let mut rotation = DMat3::IDENTITY;
            rotation.col_mut(p)[p] = cos;
            rotation.col_mut(q)[q] = cos;
            rotation.col_mut(q)[p] = sin;
            rotation.col_mut(p)[q] = -sin;
            a = rotation.transpose() * a * rotation;
            vectors *= rotation;
        }
    }
    let values = [a.col(0).x, a.col(1).y, a.col(2).z];
    let least = (1..3).fold(0, |least, i| if values[i] < values[least] { i } else { least });
    vectors.col(least).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    /// A rotation of the wrong sense would leave the matrix undiagonalised and tilt every normal.
    #[test]
    fn the_direction_of_least_variance_is_that_of_a_known_matrix() {
        for i in 0..100 {
            let [u, v, w, _] = random::uniforms(9, 0, i);
            let n = random::direction(u, v);
            let (a, b) = n.any_orthonormal_pair();
            let outer = |d: DVec3, s: f64| DMat3::from_cols(d * d.x * s, d * d.y * s, d * d.z * s);
            let found = direction_of_least_variance(outer(n, 0.1) + outer(a, 1.0 + w) + outer(b, 0.5));
            assert!(found.dot(n).abs() > 1.0 - 1e-12, "{found} for {n}");
        }
    }
}

//! The cubic that rises: least squares under a constraint, solved exactly.

/// Least rise over the whole range that the slope must promise everywhere, as a share of the range of scores. Without it
/// the curve could be level, and points of different variance would score the same.
const MIN_SLOPE: f64 = 0.01;

/// Roots of the slope that are tried, evenly over the range, before the best is refined.
const ROOTS: u32 = 200;

/// Coefficients a0 to a3 of the cubic in x, for x in [0, 1], that fits `points` (x, y) best in least squares among those
/// whose slope is `MIN_SLOPE` or more all over [0, 1].
///
/// A quadratic is nonnegative on [0, 1] exactly where it is `a (1-x)^2 + 2 b x (1-x) + c x^2` with a, c >= 0 and
/// b >= -sqrt(a c). On the boundary of that cone, where the best one is unless it is free, either a or c is zero and b is
/// not negative, or the quadratic is a square `c (x - r)^2`: so all faces are tried and the best is taken.
pub(crate) fn rising_cubic(points: &[(f64, f64)]) -> [f64; 4] {
    // Cubics whose slopes are (1-x)^2, 2 x (1-x), x^2.
    let bernstein = [[0.0, 1.0, -1.0, 1.0 / 3.0], [0.0, 0.0, 1.0, -2.0 / 3.0], [0.0, 0.0, 0.0, 1.0 / 3.0]];
    let problem = Problem::new(points);
    if let Some((weights, cubic, _)) = problem.solve(&bernstein) {
        let [a, b, c] = [weights[0], weights[1], weights[2]];
        if a >= 0.0 && c >= 0.0 && b >= -(a * c).sqrt() {
            return cubic;
        }
    }
    let mut best = (f64::INFINITY, [problem.mean, MIN_SLOPE, 0.0, 0.0]);
    let mut attempt = |basis: &[[f64; 4]]| match problem.solve(basis) {
        Some((weights, cubic, error)) if weights.iter().all(|weight| *weight >= 0.0) => {
            if error < best.0 {
                best = (error, cubic);
            }
            error
        }
        _ => f64::INFINITY,
    };
    for subset in 0u32..8 {
        let basis: Vec<[f64; 4]> = (0..3).filter(|i| subset >> i & 1 == 1).map(|i| bernstein[i]).collect();
        attempt(&basis);
    }
    // A cubic whose slope is (x - r)^2.
    let square = |r: f64| [[0.0, r * r, -r, 1.0 / 3.0]];
    let step = 1.0 / f64::from(ROOTS);
    let mut middle = (f64::INFINITY, 0.0);
    for i in 0..=ROOTS {
        let r = f64::from(i) * step;
        let error = attempt(&square(r));
        if error < middle.0 {
            middle = (error, r);
        }
    }
    // Thirds, not golden sections: it is quick either way.
    let (mut low, mut high) = ((middle.1 - step).max(0.0), (middle.1 + step).min(1.0));
    for _ in 0..60 {
        let third = (high - low) / 3.0;
        if attempt(&square(low + third)) <= attempt(&square(high - third)) {
            high -= third;
        } else {
            low += third;
        }
    }
    best.1
}

/// Sums of a least-squares problem over the monomials 1, x, x^2, x^3.
struct Problem {
    gram: [[f64; 4]; 4],
    moments: [f64; 4],
    square: f64,
    mean: f64,
}

impl Problem {
    /// The line of the least slope is taken off first and put back by [`Problem::solve`].
    fn new(points: &[(f64, f64)]) -> Self {
        let n = points.len() as f64;
        let (mut gram, mut moments, mut square) = ([[0.0; 4]; 4], [0.0; 4], 0.0);
        for &(x, y) in points {
            let y = y - MIN_SLOPE * x;
            let powers = [1.0, x, x * x, x * x * x];
            for (row, a) in powers.iter().enumerate() {
                for (column, b) in powers.iter().enumerate() {
                    gram[row][column] += a * b / n;
                }
                moments[row] += a * y / n;
            }
            square += y * y / n;
        }
        Self { gram, moments, square, mean: moments[0] }
    }

    /// The best constant plus weighted sum of the cubics in `basis`, without bounds: weights, cubic, mean squared error.
    /// None where the points do not determine the weights.
    fn solve(&self, basis: &[[f64; 4]]) -> Option<(Vec<f64>, [f64; 4], f64)> {
        let all: Vec<[f64; 4]> = std::iter::once([1.0, 0.0, 0.0, 0.0]).chain(basis.iter().copied()).collect();
        let inner = |a: &[f64; 4], b: &[f64; 4]| -> f64 {
            (0..4).map(|i| (0..4).map(|j| a[i] * self.gram[i][j] * b[j]).sum::<f64>()).sum()
        };
        let moment = |a: &[f64; 4]| -> f64 { a.iter().zip(&self.moments).map(|(a, m)| a * m).sum() };
        let mut rows: Vec<Vec<f64>> =
            all.iter().map(|a| all.iter().map(|b| inner(a, b)).chain(std::iter::once(moment(a))).collect()).collect();
        let weights = eliminate(&mut rows)?;
        let mut cubic = [0.0; 4];
        for (weight, a) in weights.iter().zip(&all) {
            (0..4).for_each(|i| cubic[i] += weight * a[i]);
        }
        let error = self.square - 2.0 * moment(&cubic) + inner(&cubic, &cubic);
        cubic[1] += MIN_SLOPE;
        Some((weights[1..].to_vec(), cubic, error))
    }
}

/// Solves the linear system whose rows end in the right-hand side, by Gaussian elimination with row pivots. None where it
/// is singular.
fn eliminate(rows: &mut [Vec<f64>]) -> Option<Vec<f64>> {
    let n = rows.len();
    for column in 0..n {
        let pivot = (column..n).max_by(|a, b| rows[*a][column].abs().total_cmp(&rows[*b][column].abs()))?;
        rows.swap(column, pivot);
        if rows[column][column].abs() < 1e-14 {
            return None;
        }
        let pivot = rows[column].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(row, _)| *row != column) {
            let factor = row[column] / pivot[column];
            row.iter_mut().zip(&pivot).for_each(|(value, pivot)| *value -= factor * pivot);
        }
    }
    Some((0..n).map(|i| rows[i][n] / rows[i][i]).collect())
}

/// Spearman's rank correlation of pairs: that of the ranks, where equal values share their mean rank. Zero where either
/// side is constant.
pub fn spearman(pairs: &[(f64, f64)]) -> f64 {
    let (x, y): (Vec<f64>, Vec<f64>) = pairs.iter().copied().unzip();
    let (x, y) = (ranks(&x), ranks(&y));
    let middle = (pairs.len() as f64 - 1.0) / 2.0;
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - middle) * (b - middle)).sum::<f64>();
    let scale = (product(&x, &x) * product(&y, &y)).sqrt();
    if scale > 0.0 { product(&x, &y) / scale } else { 0.0 }
}

/// The rank of each value from 0; equal values share the mean of theirs.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let mut done = 0;
    for equal in order.chunk_by(|a, b| values[*a] == values[*b]) {
        let shared = done as f64 + (equal.len() as f64 - 1.0) / 2.0;
        equal.iter().for_each(|index| ranks[*index] = shared);
        done += equal.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(points: &[(f64, f64)], [a0, a1, a2, a3]: [f64; 4]) -> f64 {
        points.iter().map(|&(x, y)| (a0 + x * (a1 + x * (a2 + x * a3)) - y).powi(2)).sum()
    }

    fn least_slope([_, a1, a2, a3]: [f64; 4]) -> f64 {
        (0..=10_000)
            .map(|i| f64::from(i) / 1e4)
            .map(|x| a1 + x * (2.0 * a2 + 3.0 * x * a3))
            .fold(f64::INFINITY, f64::min)
    }

    /// Where the best cubic rises anyway, the constraint must not bend it.
    #[test]
    fn a_cubic_that_rises_comes_back_as_it_is() {
        let cubic = |x: f64| 0.2 + 0.5 * x - 0.3 * x * x + 0.4 * x * x * x;
        let points: Vec<(f64, f64)> = (0..50).map(|i| f64::from(i) / 49.0).map(|x| (x, cubic(x))).collect();
        let fitted = rising_cubic(&points);
        for (fitted, wanted) in fitted.iter().zip([0.2, 0.5, -0.3, 0.4]) {
            assert!((fitted - wanted).abs() < 1e-9, "{fitted} for {wanted}");
        }
    }

    /// Where it does not, the fit must rise and none of many nearby cubics that rise may be better: else it is not the
    /// least-squares fit that the file claims to hold.
    #[test]
    fn a_fit_on_the_boundary_is_the_best_that_rises() {
        let shapes: [fn(f64) -> f64; 4] =
            [|x| 1.0 - (-8.0 * x).exp(), |x| (6.0 * x).sin() + x, |x| -x, |x| (x - 0.3).powi(2)];
        for (which, shape) in shapes.iter().enumerate() {
            let points: Vec<(f64, f64)> = (0..60).map(|i| f64::from(i) / 59.0).map(|x| (x, shape(x))).collect();
            let fitted = rising_cubic(&points);
            assert!(least_slope(fitted) > 0.99 * MIN_SLOPE, "shape {which} falls: {fitted:?}");
            let least = error(&points, fitted);
            let mut rising = 0;
            for i in 0..20_000 {
                let step = [1e-1, 1e-2, 1e-3][i as usize % 3];
                let u = crate::scene::random::uniforms(1, which as u32, i);
                let mut near = fitted;
                (0..4).for_each(|k| near[k] += step * (u[k] - 0.5));
                if least_slope_exact(near) >= MIN_SLOPE {
                    rising += 1;
                    assert!(error(&points, near) > least - 1e-9, "shape {which}: {near:?} is better than {fitted:?}");
                }
            }
            assert!(rising > 100, "shape {which}: only {rising} neighbours rise");
        }
    }

    fn least_slope_exact([_, a1, a2, a3]: [f64; 4]) -> f64 {
        let slope = |x: f64| a1 + x * (2.0 * a2 + 3.0 * x * a3);
        slope(0.0).min(slope(1.0)).min(slope((-a2 / (3.0 * a3)).clamp(0.0, 1.0)))
    }

    /// A wrong correlation would make the fit look better or worse than it is.
    #[test]
    fn rank_correlation_is_that_of_the_textbook() {
        let any: Vec<(f64, f64)> = [(1.0, 10.0), (2.0, 1000.0), (3.0, 100.0), (4.0, 1e6)].to_vec();
        // 1 - 6 sum d^2 / (n (n^2 - 1)), d^2 = 0, 1, 1, 0.
        assert!((spearman(&any) - 0.8).abs() < 1e-12);
        let falling: Vec<(f64, f64)> = any.iter().map(|(x, _)| (*x, -x.exp())).collect();
        assert!((spearman(&falling) + 1.0).abs() < 1e-12);
        assert_eq!(ranks(&[2.0, 1.0, 2.0, 5.0]), [1.5, 0.0, 1.5, 3.0]);
        assert_eq!(spearman(&[(1.0, 2.0), (1.0, 3.0)]), 0.0);
    }
}

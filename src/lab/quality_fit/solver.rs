//! Least squares by Levenberg's and Marquardt's method.

use super::MIN_LAYOUTS;
use super::observation::{Layout, Observations};
use crate::engine::parallel::mapped;

/// What is fitted: by the angles of the nearest and the third nearest view, by footprint, the logarithm of the weight beside, and where
/// errors end.
pub const N: usize = 5;
/// Place of the third nearest view's.
pub const THIRD: usize = 1;
/// Place of the footprint's.
pub const FARTHER: usize = 2;
/// Place of the weight's logarithm.
pub const BESIDE: usize = 3;
/// Place of the end.
pub const MOST: usize = 4;
/// Steps at most; a dozen are enough.
const STEPS: u32 = 200;

/// Decibels of a natural logarithm.
const DECIBELS: f64 = 10.0 / std::f64::consts::LN_10;

/// Expected quality of each layout in decibels, the mean over test views.
pub fn expected(scene: &Observations, theta: &[f64; N]) -> Vec<f64> {
    let mean = |views: Vec<Predicted>| views.iter().map(|view| view.0).sum::<f64>() / views.len().max(1) as f64;
    scene.layouts.iter().map(|layout| mean(predict(scene, layout, theta))).collect()
}

/// Expected quality, and its derivatives.
type Predicted = (f64, [f64; N]);

/// What is expected of a layout in each test view.
pub(super) fn predict(scene: &Observations, layout: &Layout, theta: &[f64; N]) -> Vec<Predicted> {
    let mut first = 0;
    let of_view = |end: &usize| {
        let (mut sum, mut moments) = (0.0, [0.0; N]);
        for look in first..*end {
            let near = layout.near[look].map(f64::from);
            let rise: f64 = (0..3).map(|k| theta[k] * near[k]).sum();
            let end = (-theta[MOST]).exp();
            let free = 1.0 / ((-rise).exp() + end);
            let ended = free * end;
            let beside = f64::from(u8::from(scene.beside[look]));
            let error = (theta[BESIDE] * beside).exp() * free;
            sum += error;
            (0..3).for_each(|k| moments[k] += error * (1.0 - ended) * near[k]);
            moments[BESIDE] += error * beside;
            moments[MOST] += error * ended;
        }
        let db = -DECIBELS * (sum / (end - first) as f64).ln();
        first = *end;
        (db, moments.map(|moment| -DECIBELS * moment / sum))
    };
    scene.ends.iter().map(of_view).collect()
}

/// Sum of squares, gradient and matrix of the normal equations.
struct Normal {
    cost: f64,
    gradient: [f64; N],
    matrix: [[f64; N]; N],
}

/// Residuals are centred within each test view, and each scene in a situation counts the same. Those that are not `free` have no part.
fn normal(scenes: &[&Observations], theta: &[f64; N], free: &[bool; N]) -> Normal {
    let mut all = Normal { cost: 0.0, gradient: [0.0; N], matrix: [[0.0; N]; N] };
    for scene in scenes.iter().filter(|scene| scene.layouts.len() >= MIN_LAYOUTS) {
        let predicted = mapped(&scene.layouts, |_, layout| predict(scene, layout, theta));
        let of_layout = 1.0 / scene.layouts.len() as f64;
        let share = of_layout / scene.ends.len() as f64;
        for view in 0..scene.ends.len() {
            let rows = scene.layouts.iter().zip(&predicted).map(|(layout, views)| {
                let (db, slopes) = views[view];
                let slopes: [f64; N] = std::array::from_fn(|k| if free[k] { slopes[k] } else { 0.0 });
                (db - layout.psnr[view], slopes)
            });
            let mean = rows.clone().fold((0.0, [0.0; N]), |(r, s), (residual, slopes)| {
                (r + of_layout * residual, std::array::from_fn(|k| s[k] + of_layout * slopes[k]))
            });
            for (residual, slopes) in rows {
                let residual = residual - mean.0;
                let slopes: [f64; N] = std::array::from_fn(|k| slopes[k] - mean.1[k]);
                all.cost += share * residual * residual;
                for i in 0..N {
                    all.gradient[i] += share * residual * slopes[i];
                    (0..N).for_each(|j| all.matrix[i][j] += share * slopes[i] * slopes[j]);
                }
            }
        }
    }
    let scale = (0..N).map(|k| all.matrix[k][k]).fold(f64::MIN_POSITIVE, f64::max);
    (0..N).filter(|k| !free[*k]).for_each(|k| all.matrix[k][k] = scale);
    all
}

/// The parameters of least squares, those that are not `free` as they start, and the sum of squares; none where the layouts do not determine
/// them.
pub(crate) fn solve(scenes: &[&Observations], start: [f64; N], free: &[bool; N]) -> Option<([f64; N], f64)> {
    let (mut theta, mut damping) = (start, 1e-3);
    let mut at = normal(scenes, &theta, free);
    // Layouts that do not determine a parameter do not do so where the search begins either.
    eliminate(at.matrix, at.gradient)?;
    for _ in 0..STEPS {
        let mut damped = at.matrix;
        (0..N).for_each(|k| damped[k][k] *= 1.0 + damping);
        // A weight that vanishes has no slope any more.
        let Some(step) = eliminate(damped, at.gradient) else { break };
        let next: [f64; N] = std::array::from_fn(|k| theta[k] - step[k]);
        let there = normal(scenes, &next, free);
        if there.cost < at.cost {
            let gained = at.cost - there.cost;
            (theta, damping) = (next, damping * 0.1);
            let done = gained <= 1e-14 * at.cost;
            at = there;
            if done {
                break;
            }
        } else if damping > 1e8 {
            break;
        } else {
            damping *= 10.0;
        }
    }
    theta.iter().all(|value| value.is_finite()).then_some((theta, at.cost))
}

/// Solves linear equations with a symmetric positive matrix by elimination; none where it is singular.
fn eliminate(mut a: [[f64; N]; N], mut b: [f64; N]) -> Option<[f64; N]> {
    let scale = (0..N).map(|k| a[k][k]).fold(0.0, f64::max);
    for k in 0..N {
        if a[k][k].is_nan() || a[k][k] <= 1e-12 * scale {
            return None;
        }
        for i in k + 1..N {
            let factor = a[i][k] / a[k][k];
            (k..N).for_each(|j| a[i][j] -= factor * a[k][j]);
            b[i] -= factor * b[k];
        }
    }
    for k in (0..N).rev() {
        let known: f64 = (k + 1..N).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k][k];
    }
    Some(b)
}

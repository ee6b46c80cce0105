//! What is left between a trained and an expected difference of two layouts.

use super::Pair;
use super::observation::Observations;
use super::solver::{self, N};
use crate::planner::quality::law::Fitted;

/// Fewest pairs of layouts expected to be alike that say what such differ by: of fewer it could come out as next to nothing by chance, and
/// any lead over simple layouts would be believed.
const MIN_PAIRS: usize = 10;

/// Standard deviations of the trained difference of two layouts of a scene with the same lens about the one that a law expects.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Spread {
    /// Of layouts of as many views that are expected to be alike; the built-in law's where fewer than [`MIN_PAIRS`] are.
    pub alike: f64,
    /// Whether it is the built-in law's.
    pub borrowed: bool,
    /// In addition, for each decibel that layouts of any numbers of views are expected to differ by.
    pub per_decibel: f64,
    /// Pairs that are expected to be alike.
    pub alike_pairs: usize,
}

/// The spread of `scenes`, each by its law; `object` says of which built-in law to borrow.
pub(super) fn of(scenes: &[(&Observations, [f64; N])], object: bool) -> Spread {
    let (mut near, mut far): (Vec<f64>, Vec<Pair>) = (Vec::new(), Vec::new());
    for (scene, theta) in scenes {
        let expected = solver::expected(scene, theta);
        for (i, a) in scene.layouts.iter().enumerate() {
            for (j, b) in scene.layouts[..i].iter().enumerate().filter(|(_, b)| a.degrees == b.degrees) {
                let (x, y) = (expected[i] - expected[j], a.trained() - b.trained());
                if a.views == b.views && x.abs() < 0.25 {
                    near.push((y - x).powi(2));
                }
                if x.abs() >= 1.0 {
                    far.push((x, y));
                }
            }
        }
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let borrowed = near.len() < MIN_PAIRS;
    let alike = if borrowed { Fitted::embedded(object).spread[0] } else { mean(&near).sqrt() };
    let far: Vec<f64> = far.into_iter().map(|(x, y)| ((y - x).powi(2) - alike * alike) / (x * x)).collect();
    Spread { alike, borrowed, per_decibel: mean(&far).max(0.0).sqrt(), alike_pairs: near.len() }
}

//! Adam's step, the draws of relocation, and the split of a splat into equal ones.

use super::Splat;
use crate::engine::vulkan::shaders::glsl::shared::adam;
use crate::engine::vulkan::shaders::glsl::splats::mcmc_pick::PICK_STREAM;
use crate::scene::random;

/// Decay of Adam's first and second moment, and what keeps it from dividing by zero.
const DECAYS: [f64; 2] = [adam::ADAM_DECAY, adam::ADAM_SQUARE_DECAY];
const EPSILON: f64 = 1e-15;

/// A value after Adam's step number `step`, from 1 (Kingma and Ba 2015), with correction of the moments' bias; `moments` are
/// the means of the gradient and of its square, zero at the start.
pub fn adam(value: f64, gradient: f64, moments: &mut [f64; 2], rate: f64, step: i32) -> f64 {
    for (k, sample) in [gradient, gradient * gradient].into_iter().enumerate() {
        moments[k] = DECAYS[k] * moments[k] + (1.0 - DECAYS[k]) * sample;
    }
    let [first, second] = std::array::from_fn(|k| moments[k] / (1.0 - DECAYS[k].powi(step)));
    value - rate * first / (second.sqrt() + EPSILON)
}

/// The splat that each dead one of `splats`, and each of as many new ones as `after` has more, draws by opacity; none for those that
/// live, or where nothing does. Opacities count in steps of `1 / steps`; up to `least` a splat is dead. Kheradmand et al. 2024,
/// section 4.
pub fn draws(
    splats: &[Splat],
    after: usize,
    (steps, least): (u32, f64),
    (seed, iteration): (u64, u32),
) -> Vec<Option<usize>> {
    let weight = |splat: &Splat| {
        let opacity = 1.0 / (1.0 + (-splat.opacity).exp());
        if opacity > least { ((opacity * f64::from(steps)) as u64).max(1) } else { 0 }
    };
    let weights: Vec<u64> = splats.iter().map(weight).collect();
    let total: u64 = weights.iter().sum();
    let draw = |i: usize| {
        let word = random::bits(seed, PICK_STREAM + iteration, i as u32)[0];
        let mut left = (u64::from(word) * total) >> 32;
        weights.iter().position(|weight| {
            let here = left < *weight;
            left = left.saturating_sub(*weight);
            here
        })
    };
    (0..after).map(|i| if weights.get(i).is_some_and(|weight| *weight > 0) { None } else { draw(i) }).collect()
}

/// One of `n` (1 or more) equal splats in one place that look like `splat` together: they let as much light through at the
/// centre, and along any line through it they hide as much in all. Kheradmand et al. 2024, "3D Gaussian Splatting as Markov
/// Chain Monte Carlo", equation 9.
pub fn split(splat: &Splat, n: u32) -> Splat {
    // log(1 - o), which is exact where o is all but 1.
    let passed = -softplus(splat.opacity);
    let (old, opacity) = (-passed.exp_m1(), -(passed / f64::from(n)).exp_m1());
    let shrunk = (old / denominator(opacity, n)).ln();
    Splat { log_scale: splat.log_scale + shrunk, opacity: (-passed / f64::from(n)).exp_m1().ln(), ..splat.clone() }
}

/// `sum_{i=1..n} sum_{k=0..i-1} C(i-1, k) (-1)^k / sqrt(k + 1) o^(k + 1)`. The sum over i is `C(n, k + 1)`.
fn denominator(opacity: f64, n: u32) -> f64 {
    let mut term = -1.0;
    let mut sum = 0.0;
    for k in 0..n {
        term *= -opacity * f64::from(n - k) / f64::from(k + 1);
        sum += term / f64::from(k + 1).sqrt();
    }
    sum
}

/// log(1 + exp(x)).
fn softplus(x: f64) -> f64 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// If this failed, rates would mean something else than in every other trainer. The first step is the rate along the
    /// sign, whatever the gradient's size; the second is computed directly.
    #[test]
    fn steps_are_those_of_the_published_method() {
        for gradient in [1e-9, -0.02, 300.0] {
            let mut moments = [0.0; 2];
            let value = adam(1.0, gradient, &mut moments, 0.1, 1);
            assert!((value - (1.0 - 0.1f64.copysign(gradient))).abs() < 1e-6, "{value}");
            let value = adam(value, -2.0 * gradient, &mut moments, 0.1, 2) - value;
            // (0.9 * 0.1 - 2 * 0.1) / (1 - 0.81) over the root of (0.999 + 4) / (1 - 0.999^2) * 0.001.
            let expected = -0.1 * (-0.11 / 0.19) / (0.004_999f64 / 0.001_999).sqrt();
            assert!((value - expected.copysign(expected * gradient)).abs() < 1e-6, "{value} for {expected}");
        }
        assert_eq!(adam(5.0, 0.0, &mut [0.0; 2], 0.1, 1), 5.0);
    }

    /// Integral of what `n` splats of opacity `o` and deviation `s` in one place hide along a line through their middle.
    fn hidden(o: f64, s: f64, n: u32) -> f64 {
        let step = 0.001;
        let at = |x: f64| 1.0 - (1.0 - o * (-0.5 * (x / s).powi(2)).exp()).powi(n as i32);
        (-12_000..=12_000).map(|i| step * at(step * f64::from(i))).sum()
    }

    /// If this failed, relocating splats would change the picture, by more with every relocation.
    #[test]
    fn parts_look_like_the_whole() {
        for logit in [-4.0f64, 0.0, 3.0, 9.0] {
            for n in [1, 2, 3, 7, 20, 51] {
                let splat = Splat {
                    centre: DVec3::ONE,
                    log_scale: DVec3::new(0.0, -1.0, 0.2),
                    rotation: [1.0, 2.0, 3.0, 4.0],
                    opacity: logit,
                    harmonics: vec![DVec3::X],
                };
                let part = split(&splat, n);
                let o = |splat: &Splat| 1.0 / (1.0 + (-splat.opacity).exp());
                let passed = (1.0 - o(&part)).powi(n as i32);
                assert!((passed - (1.0 - o(&splat))).abs() < 1e-12, "opacity of {n} of {logit}");
                let shrunk = part.log_scale - splat.log_scale;
                assert!((shrunk.x - shrunk.y).abs() < 1e-12 && (shrunk.x - shrunk.z).abs() < 1e-12);
                let (whole, parts) = (hidden(o(&splat), 1.0, 1), hidden(o(&part), shrunk.x.exp(), n));
                assert!((whole - parts).abs() < 1e-6 * whole, "{n} of {logit}: {parts} for {whole}");
                assert_eq!(
                    (part.centre, part.rotation, &part.harmonics),
                    (splat.centre, splat.rotation, &splat.harmonics)
                );
            }
        }
    }

    /// If this failed, the short sum would not be the published one, binomials and all, which it replaces.
    #[test]
    fn the_denominator_is_the_published_sum() {
        for (o, n) in [(0.3f64, 5u32), (0.9, 9), (0.01, 30)] {
            let mut sum = 0.0;
            for i in 1..=n {
                let mut binomial = 1.0;
                for k in 0..i {
                    let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
                    sum += binomial * sign / f64::from(k + 1).sqrt() * o.powi(k as i32 + 1);
                    binomial *= f64::from(i - 1 - k) / f64::from(k + 1);
                }
            }
            assert!((denominator(o, n) - sum).abs() < 1e-9 * sum, "{} for {sum}", denominator(o, n));
        }
    }
}

//! The splat pass without binning (`dense.comp`), and its twin in float64: the reference for every other pass.

use glam::DVec3;

use super::config::Kernel;
use super::shared::{PaperConstants, PaperSettings, Scale, Tally};
use crate::engine::vulkan::shaders::glsl::planner::plan::paper::paper;
use crate::planner::plan::gate::{Gate, gate, tangents_of};
use crate::planner::plan::shared::{CameraState, Control, Gradient, Settings};
use crate::visibility::probe_depth::Probe;

crate::stage!(
    /// Loss and gradient partials, a workgroup per block of texels of a point camera.
    pub(crate) DenseStage = dense<PaperConstants>(()) {
        read settings, read control, read splats, read probes, read directions, read depth,
        write visible, write slots, write partials, write tallies, write deficit, read paper, read scale_state, write mailbox,
    } with [Settings, Control, CameraState, Probe, Gradient, Tally, PaperSettings, Scale]
);

/// Where a kernel is cut off: its exponent there.
pub(crate) const KERNEL_CUTOFF: f64 = paper::KERNEL_CUTOFF;
/// A soft gate that lets less than this through is closed.
pub(crate) const GATE_CUTOFF: f64 = paper::GATE_CUTOFF;

/// One batch of the optimisation as the twin sees it, in float64 and the planner's frame.
#[derive(Clone, Copy)]
pub struct Batch<'a> {
    /// Numbers of the run; `probes` and `pool` are not read.
    pub settings: &'a PaperSettings,
    /// The gate.
    pub gate: Gate,
    /// The kernel.
    pub kernel: Kernel,
    /// Whether surfaces hide splats.
    pub occlusion: bool,
    /// Centres and unit viewing directions.
    pub splats: &'a [(DVec3, DVec3)],
    /// Tangents of half the fields of view (horizontal, vertical) of each splat; the last applies to all that follow.
    pub tangents: &'a [[f64; 2]],
    /// Position and score of each probe.
    pub probes: &'a [(DVec3, f64)],
    /// Texel directions, unit length.
    pub directions: &'a [DVec3],
    /// Signed depth, `probes x texels`; negative where the ray misses the region.
    pub depth: &'a [f64],
    /// Logarithm of the shared scale.
    pub log_scale: f64,
}

/// Loss and gradient of the image term.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// The term.
    pub loss: f64,
    /// Its gradient by each splat's centre.
    pub by_centre: Vec<DVec3>,
    /// Its gradient by each splat's direction, as if the direction were a free vector.
    pub by_direction: Vec<DVec3>,
    /// Its gradient by log s.
    pub by_log_scale: f64,
    /// Rise of the term without each splat.
    pub utility: Vec<f64>,
    /// Coverage weight of each probe.
    pub weights: Vec<f64>,
}

fn exponent(batch: &Batch<'_>, w: DVec3, n: DVec3, d: f64, inverse: f64) -> f64 {
    if batch.kernel == Kernel::Angular {
        return 0.5 * (w - n).length_squared() * inverse;
    }
    let h = w.dot(n);
    if h > 0.0 { 0.5 * d * d * (n - h * w).length_squared() * inverse } else { f64::INFINITY }
}

/// Image loss, gradients, utilities and coverage weights of a batch (docs/reference/method.md, Losses).
pub fn dense(batch: &Batch<'_>) -> Image {
    let s = batch.settings;
    let texels = batch.directions.len();
    let all = 1.0 / (texels as f64 * batch.probes.len() as f64);
    let inverse = (-2.0 * batch.log_scale).exp();
    let count = batch.splats.len();
    let mut image = Image {
        by_centre: vec![DVec3::ZERO; count],
        by_direction: vec![DVec3::ZERO; count],
        utility: vec![0.0; count],
        ..Image::default()
    };
    for (i, &(position, score)) in batch.probes.iter().enumerate() {
        let depth = &batch.depth[i * texels..(i + 1) * texels];
        let goal = s.alpha as f64 * score;
        let open_sky = depth.iter().filter(|depth| **depth > 0.0).count() as f64;
        let share = if s.equal != 0 { all * texels as f64 / open_sky.max(1.0) } else { all };
        let mut seen = Vec::new();
        for (j, &(centre, direction)) in batch.splats.iter().enumerate() {
            let ray = centre - position;
            let d = ray.length().max(1e-6);
            let n = ray / d;
            let tangents = tangents_of(batch.tangents, j);
            let (open, by_view, by_direction) = gate(batch.gate, s.gate_softness.into(), tangents, -n, direction);
            if open >= GATE_CUTOFF {
                seen.push((j, n, d, open, by_view, by_direction));
            }
        }
        // a_j of a texel; zero where the kernel is cut off or a surface is in the way.
        let opacity = |t: usize, n: DVec3, d: f64, open: f64| {
            let x = exponent(batch, batch.directions[t], n, d, inverse);
            let blocked = batch.occlusion && d >= depth[t].abs();
            if x < KERNEL_CUTOFF && !blocked { (s.alpha as f64 * open * (-x).exp(), x) } else { (0.0, x) }
        };
        let mut short_fall = 0.0;
        for t in (0..texels).filter(|&t| depth[t] > 0.0) {
            let w = batch.directions[t];
            let parts: Vec<_> = seen.iter().map(|&(_, n, d, open, ..)| opacity(t, n, d, open)).collect();
            let rest: f64 = parts.iter().map(|part| 1.0 - part.0).product();
            let difference = 1.0 - rest - goal;
            image.loss += share * difference * difference;
            short_fall += (-difference).max(0.0).powi(2);
            for (&(j, n, d, _, by_view, by_direction), &(a, x)) in seen.iter().zip(&parts) {
                if a == 0.0 {
                    continue;
                }
                let without = 1.0 - rest / (1.0 - a);
                image.utility[j] += share * ((without - goal).powi(2) - difference * difference);
                let by_a = 2.0 * share * difference * rest * a / (1.0 - a);
                image.by_log_scale += 2.0 * x * by_a;
                let across = |g: DVec3| (g - g.dot(n) * n) / d;
                image.by_centre[j] -= across(by_a * by_view);
                image.by_direction[j] += by_a * by_direction;
                image.by_centre[j] += match batch.kernel {
                    Kernel::Angular => across(by_a * inverse * w),
                    Kernel::Metric => -by_a * inverse * d * (n - w.dot(n) * w),
                };
            }
        }
        image.weights.push(short_fall / open_sky.max(1.0));
    }
    image
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner::plan::paper::regulariser::regulariser;
    use crate::scene::{octahedral, random};

    fn point(seed: u64, index: u32) -> DVec3 {
        let [x, y, z, _] = random::uniforms(seed, 0, index);
        2.0 * DVec3::new(x, y, z) - 1.0
    }

    fn settings() -> PaperSettings {
        PaperSettings { alpha: 0.1, gate_softness: 0.05, ..PaperSettings::default() }
    }

    /// Loss of a batch and the regulariser with frozen weights, as the gradient has it.
    fn loss(batch: &Batch<'_>, weights: &[f64]) -> f64 {
        dense(batch).loss + 3.0 * regulariser(batch, weights).0
    }

    /// A wrong gradient still descends, only badly: nothing but a comparison with differences shows it.
    #[test]
    fn gradients_are_those_of_finite_differences() {
        let directions = octahedral::directions(16);
        let settings = settings();
        for (case, (gate, kernel)) in [
            (Gate::Soft, Kernel::Angular),
            (Gate::Soft, Kernel::Metric),
            (Gate::Pinhole, Kernel::Angular),
            (Gate::Hard, Kernel::Angular),
        ]
        .into_iter()
        .enumerate()
        {
            let seed = 7 + case as u64;
            let probes: Vec<_> = (0..3).map(|i| (0.2 * point(seed, i), 1.0 + 0.3 * i as f64)).collect();
            let splats: Vec<_> = (10..16)
                .map(|j| {
                    let centre = point(seed, j).normalize() * 0.9;
                    (centre, (0.3 * point(seed, 100 + j) - centre).normalize())
                })
                .collect();
            // Some texels see a wall, some miss the region.
            let depth: Vec<f64> = (0..3 * 256u32)
                .map(|t| match t % 7 {
                    0 => -1e30,
                    1 => 0.3,
                    _ => 1e30,
                })
                .collect();
            let tangents = [[0.6, 0.45], [0.7, 0.8], [0.5, 0.65], [0.6, 0.6], [0.55, 0.7], [0.8, 0.5]];
            let base = Batch {
                settings: &settings,
                gate,
                kernel,
                occlusion: true,
                splats: &splats,
                tangents: &tangents,
                probes: &probes,
                directions: &directions,
                depth: &depth,
                log_scale: -1.1,
            };
            let here = dense(&base);
            assert!(here.by_centre.iter().any(|g| g.length() > 1e-6), "case {case} tests nothing");
            let (_, reg_centre, reg_direction) = regulariser(&base, &here.weights);
            let h = 1e-6;
            let close = |analytic: f64, difference: f64, what: &str| {
                let error = (analytic - difference).abs();
                assert!(error < 1e-6 + 1e-4 * difference.abs(), "case {case}, {what}: {analytic} against {difference}");
            };
            for j in 0..splats.len() {
                for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                    let moved = |step: f64, turn: f64| {
                        let mut splats = splats.clone();
                        splats[j].0 += step * axis;
                        // A direction stays a unit vector: only the part across it counts.
                        splats[j].1 = (splats[j].1 + turn * axis).normalize();
                        loss(&Batch { splats: &splats, ..base }, &here.weights)
                    };
                    let by_centre = here.by_centre[j] + 3.0 * reg_centre[j];
                    close(by_centre.dot(axis), (moved(h, 0.0) - moved(-h, 0.0)) / (2.0 * h), "centre");
                    let r = splats[j].1;
                    let by_direction = here.by_direction[j] + 3.0 * reg_direction[j];
                    let across = by_direction - by_direction.dot(r) * r;
                    close(across.dot(axis), (moved(0.0, h) - moved(0.0, -h)) / (2.0 * h), "direction");
                }
                let without: Vec<_> = splats.iter().enumerate().filter(|(k, _)| *k != j).map(|(_, s)| *s).collect();
                let others: Vec<_> = tangents.iter().enumerate().filter(|(k, _)| *k != j).map(|(_, t)| *t).collect();
                let rise = dense(&Batch { splats: &without, tangents: &others, ..base }).loss - here.loss;
                close(here.utility[j], rise, "utility");
            }
            let at = |log_scale| dense(&Batch { log_scale, ..base }).loss;
            close(here.by_log_scale, (at(-1.1 + h) - at(-1.1 - h)) / (2.0 * h), "scale");
        }
    }
}

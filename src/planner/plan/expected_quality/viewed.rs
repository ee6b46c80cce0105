//! The pass of expected quality: looks of fresh viewers each iteration (`look.comp`, for many iterations at once), and the gradients of
//! the splats nearest to them (`viewed.comp`).

use glam::DVec3;

use super::shared::{QualitySettings, ViewerLoss};
use crate::engine::vulkan::physical::Physical;
use crate::engine::vulkan::shaders::glsl::planner::plan::expected_quality::{nearest_together, viewed as glsl};
use crate::planner::plan::gate::{Gate, gate, tangents_of};
use crate::planner::plan::shared::{CameraState, Control, Gradient};
use crate::planner::quality::expected::LOOKS;
use crate::planner::quality::law::Law;
use crate::planner::quality::look::Look;
use crate::planner::quality::nearest::{nearest, toward, vectors};
use crate::visibility::bvh::{Bvh, Node, TraversalConstants};

crate::specialisation! {
    /// Constants of [`ViewedStage`].
    pub(crate) struct ViewedConstants {
        /// When a point counts as in a splat's picture.
        gate: Gate,
        /// Whether the primitives are discs.
        discs: bool,
        /// Threads of a look.
        lanes: u32,
        /// Threads of a workgroup: those of a look, or one for each look of a viewer.
        local_size_x: u32,
    }
}

impl ViewedConstants {
    /// For `lanes` threads a look: 1, or [`TOGETHER`].
    pub(super) fn new(gate: Gate, traversal: TraversalConstants, lanes: u32) -> Self {
        let local_size_x = if lanes == 1 { LOOKS } else { lanes };
        Self { gate, discs: traversal.discs, lanes, local_size_x }
    }
}

crate::gpu_struct! {
    /// Push constants of [`ViewedStage`].
    pub(crate) struct ViewedPush {
        /// First look of the iteration.
        pub first_look: u32,
    }
}

crate::stage!(
    /// Loss and gradient partials: a workgroup per look of the iteration, or a thread.
    pub(crate) ViewedStage = viewed<ViewedConstants>(ViewedPush) {
        read quality, read control, read splats, read nodes, read primitives, read looks, read law, write slots,
        write partials, write viewer_losses, write errors, write arrivals,
    } with [QualitySettings, Control, CameraState, Node, Look, Law, Gradient, ViewerLoss]
);

/// Threads of a look where they share its work.
pub(super) const TOGETHER: u32 = nearest_together::TOGETHER;

/// Threads of a look: a GPU has more than there are looks, and rays that wait for memory are cast at the same time; on a CPU device those
/// that are not needed are not cast.
pub(super) fn lanes(physical: &Physical) -> u32 {
    if physical.is_cpu() { 1 } else { TOGETHER }
}

/// Looks that are drawn at once, unless those of one iteration are more.
const DRAWN: u32 = 1 << 16;

/// Iterations of a block that looks are drawn for at once.
pub(super) fn draws(probes: u32, block: u32) -> u32 {
    (DRAWN / (probes * LOOKS).max(1)).clamp(1, block.max(1))
}

/// Radians that a splat counts as off for each sine by which a point lies outside of its picture.
const TURN: f64 = glsl::TURN;
/// A gate that lets less than this through is closed: its logarithm is meaningless in single precision.
const MIN_OPEN: f64 = 1e-30;
/// Viewers that show the surface in fewer looks than this are ignored.
const MIN_SHOWN: usize = crate::planner::quality::expected::MIN_SHOWN as usize;

/// Expected loss and its gradient.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Expected {
    /// Mean over viewers of the logarithm of the mean expected error of their looks.
    pub loss: f64,
    /// Its gradient by each splat's centre.
    pub by_centre: Vec<DVec3>,
    /// Its gradient by each splat's direction, as if the direction were a free vector.
    pub by_direction: Vec<DVec3>,
}

/// The cameras of an iteration as the twin sees them, in float64 and the planner's frame.
#[derive(Clone, Copy)]
pub struct Cameras<'a> {
    /// When a point counts as in a picture.
    pub gate: Gate,
    /// Softness of the gate.
    pub gate_softness: f64,
    /// Centres and unit viewing directions.
    pub splats: &'a [(DVec3, DVec3)],
    /// Tangents of half the fields of view (horizontal, vertical) of each; the last applies to all that follow.
    pub tangents: &'a [[f64; 2]],
}

impl Cameras<'_> {
    fn gate(&self, j: usize, view: DVec3, direction: DVec3) -> (f64, DVec3, DVec3) {
        gate(self.gate, self.gate_softness, tangents_of(self.tangents, j), view, direction)
    }
}

/// The twin of `viewed`: of `looks`, [`LOOKS`] to a viewer.
pub fn viewed(cameras: &Cameras<'_>, looks: &[Look], bvh: &Bvh, law: &Law) -> Expected {
    let viewers: Vec<&[Look]> = looks.chunks(LOOKS as usize).collect();
    let turn = TURN * cameras.gate_softness;
    let count = cameras.splats.len();
    let mut expected =
        Expected { by_centre: vec![DVec3::ZERO; count], by_direction: vec![DVec3::ZERO; count], loss: 0.0 };
    for looks in &viewers {
        let shown: Vec<&Look> = looks.iter().filter(|look| look.distance > 0.0).collect();
        if shown.iter().filter(|look| look.normal != [0.0; 3]).count() < MIN_SHOWN {
            continue;
        }
        let found: Vec<_> = shown
            .iter()
            .map(|look| {
                let views = cameras.splats.iter().enumerate().filter_map(|(j, (centre, direction))| {
                    let [tan_x, tan_y] = tangents_of(cameras.tangents, j);
                    let mut near = toward(look, j as u32, *centre, tan_x.max(tan_y))?;
                    let open = cameras.gate(j, -near.direction, *direction).0;
                    near.cost -= turn * open.ln();
                    (open > MIN_OPEN).then_some(near)
                });
                nearest(bvh, look, views)
            })
            .collect();
        let error =
            |(look, found): (&&Look, &Vec<_>)| f64::from(look.weight) * law.error(found, f64::from(look.footprint));
        let errors: Vec<f64> = shown.iter().zip(&found).map(error).collect();
        let total: f64 = errors.iter().sum();
        expected.loss += (total / shown.len() as f64).ln() / viewers.len() as f64;
        for ((look, found), error) in shown.iter().zip(&found).zip(&errors) {
            let of_look = f64::from(look.weight);
            let weight = of_look * law.slope(error / of_look) / (total * viewers.len() as f64);
            let [_, to_viewer, _] = vectors(look);
            for (k, near) in found.iter().enumerate() {
                let (n, d, j) = (near.direction, near.distance, near.view as usize);
                let (_, by_view, by_turn) = cameras.gate(j, -n, cameras.splats[j].1);
                let by_cost = weight * f64::from(law.angle[k]);
                let sine = (1.0 - to_viewer.dot(n).powi(2)).max(1e-8).sqrt();
                let by_n = by_cost * (turn * by_view - to_viewer / sine);
                expected.by_centre[j] += (by_n - by_n.dot(n) * n) / d;
                if k == 0 && near.footprint > f64::from(look.footprint) {
                    expected.by_centre[j] += weight * f64::from(law.farther) / d * n;
                }
                expected.by_direction[j] -= by_cost * turn * by_turn;
            }
        }
    }
    expected
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner::quality::expected::expect;
    use crate::planner::quality::look::Surroundings;
    use crate::planner::quality::viewers::Viewers;
    use crate::scene::camera::Intrinsics;
    use crate::scene::layouts;
    use crate::scene::proxy::{Orientation, Proxy};
    use crate::scene::region::{Region, Shape};
    use crate::scene::{random, samples};
    use crate::visibility::device_scene::SceneGeometry;

    /// A wrong gradient still descends, only badly: nothing else would show it.
    #[test]
    fn gradients_are_those_of_finite_differences() {
        let shape = Shape::Box { min: DVec3::splat(0.2), max: DVec3::new(5.8, 3.8, 2.6) };
        let region = Region { shape, up: DVec3::Z, floor: None, clearance: 0.15 };
        let proxy = Proxy::new(&samples::room(), Orientation::Trusted).unwrap();
        let geometry = SceneGeometry::new(&proxy, &region).unwrap();
        let intrinsics = Intrinsics::from_fov(600, 400, 60f64.to_radians());
        let viewers = Viewers::Region.sample(&geometry, intrinsics, false, 1, 6).unwrap();
        // With an end that the errors of most looks are near to, and with lenses that see finer than viewers do, or coarser.
        let law = Law { angle: [1.8, 0.4, 0.8], farther: 1.0, background: 0.3, most: 4.0, ..Law::default() };
        let around = Surroundings::new(&geometry, proxy.sphere, true, &law);
        let (looks, _) = expect(&geometry, around, &viewers, &[], &law, 3);
        let wide = |j: u32| [0.3 + 0.06 * f64::from(j), 0.4];
        let tangents: Vec<[f64; 2]> = (0..12).map(wide).collect();
        for softness in [0.05f32, 0.3] {
            let poses = layouts::random(&geometry.free, 12, 7, false);
            let splats: Vec<_> = poses.iter().map(|pose| (pose.position, pose.forward())).collect();
            let loss = |splats: &[(DVec3, DVec3)]| {
                let gate_softness = f64::from(softness);
                let cameras = Cameras { gate: Gate::Pinhole, gate_softness, splats, tangents: &tangents };
                viewed(&cameras, &looks, &geometry.bvh, &law)
            };
            let exact = loss(&splats);
            let most = |of: &[DVec3]| of.iter().map(|g| g.length()).fold(0.0, f64::max);
            assert!(most(&exact.by_centre) > 1e-3 && most(&exact.by_direction) > 1e-3);
            for j in 0..splats.len() {
                let [u, v, w, x] = random::uniforms(5, softness.to_bits(), j as u32);
                for (step, of_centre) in [(random::direction(u, v), true), (random::direction(w, x), false)] {
                    let h = 1e-6;
                    let moved = |h: f64| {
                        let mut splats = splats.clone();
                        let part = if of_centre { &mut splats[j].0 } else { &mut splats[j].1 };
                        *part += h * step;
                        loss(&splats).loss
                    };
                    let difference = (moved(h) - moved(-h)) / (2.0 * h);
                    let gradient = if of_centre { exact.by_centre[j] } else { exact.by_direction[j] };
                    let off = (difference - gradient.dot(step)).abs();
                    assert!(
                        off < 1e-5 + 1e-3 * gradient.length(),
                        "{softness}, {j}: {difference} of {}",
                        gradient.dot(step)
                    );
                }
            }
        }
    }
}

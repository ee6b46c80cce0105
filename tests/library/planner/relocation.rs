//! Relocation: which splats move, where to, and what it achieves.

use std::ops::ControlFlow;

use crate::support::device::{context, silent};
use crate::support::plans::{Scene, intrinsics, object, planner, room};
use camsplat::engine::vulkan::Recorder;
use camsplat::planner::metrics::Metrics;
use camsplat::planner::metrics::score_point::{Field, Scorer, aggregate};
use camsplat::planner::plan::config::{Config, Preset};
use camsplat::planner::plan::paper::Start;
use camsplat::planner::plan::paper::relocate::rank;
use camsplat::planner::plan::shared::CameraState;
use camsplat::scene::camera::Camera;
use camsplat::visibility::raycast::Ray;
use glam::Vec3;

/// Only cameras whose removal costs little may move, and only to feasible poses: were the order upside down,
/// the best cameras would be thrown away every fifty iterations. With rates of zero nothing moves but what is relocated.
#[test]
fn the_least_useful_are_relocated_and_only_into_the_region() {
    let context = context();
    for (scene, preset) in [(object(&context), Preset::Object), (room(&context), Preset::Room)] {
        let still = Config::paper(preset, 60).with_paper(|own| {
            (own.pool, own.lr_scale) = (128, 0.0);
            (own.relocate_every, own.relocate_until) = (10, 1.0);
        });
        let still = Config { lr_position: 0.0, lr_direction: 0.0, ..still };
        let config = Config { iterations: 40, probes: 16, checkpoint_every: 10, ..still };
        let planner = planner(&context, &scene, config);
        // The running means that the device ranks by, from the utilities of ten iterations.
        let mut utility = vec![0f32; 60];
        let step = |block: bool| {
            let mut commands = Recorder::new(&context).expect("a recorder");
            match block {
                true => planner.record_block(&mut commands),
                false => planner.record_iteration(&mut commands),
            }
            .expect("recorded");
            commands.submit_and_wait().expect("done");
        };
        for _ in 0..planner.block() {
            step(false);
            for (mean, gradient) in utility.iter_mut().zip(planner.gradients().expect("gradients")) {
                *mean = 0.9 * *mean + 0.1 * gradient.utility;
            }
        }
        let before = planner.splats().expect("splats");
        // Centres only: a direction is normalised again each time.
        let elsewhere = |a: &[CameraState], b: &[CameraState], j: usize| a[j].centre != b[j].centre;
        assert!((0..60).all(|j| !elsewhere(&before, planner.start(), j)), "rates of zero, and yet something moved");
        step(true);
        let after = planner.splats().expect("splats");
        let order = rank(&utility, 0);
        let median = utility[order[30] as usize];
        let least = &order[..6];
        let moved: Vec<usize> = (0..60).filter(|&j| elsewhere(&before, &after, j)).collect();
        assert!(!moved.is_empty(), "{preset:?}: nothing was relocated, so that nothing is tested");
        for &j in &moved {
            assert!(least.contains(&(j as u32)), "{preset:?}: splat {j} is not of the least useful tenth");
            assert!(utility[j] < 0.2001 * median, "{preset:?}: splat {j} was of use, {} of {median}", utility[j]);
            may_stand(&scene, &after[j]);
        }
    }
    silent(&context);
}

/// A relocated splat is in the region, to rounding, free, and looks at the surface.
fn may_stand(scene: &Scene, splat: &CameraState) {
    let geometry = &scene.device.geometry;
    let at = Vec3::from(splat.centre);
    assert!(geometry.region.violation(at.as_dvec3()).0 < 1e-10, "relocated out of the region, to {at}");
    assert!(geometry.free.clamped_violation(at).0 < 0.5 * geometry.free.grid.cell as f32 + 1e-6, "{at} is not free");
    let direction = Vec3::from(splat.direction);
    assert!((direction.length() - 1.0).abs() < 1e-5, "{direction} is no direction");
    let ray = Ray { origin: at, direction, t_min: 0.0, t_max: 1e30 };
    assert!(geometry.bvh.any_hit(&ray), "at {at} it looks along {direction}, at nothing");
}

/// Gradient descent on the splat objective does not spread cameras that all start in one place: each sees what the others
/// see. Without relocation the far side stays unseen; with it nearly all that can be seen must be.
#[test]
fn an_identical_start_ends_covered_with_relocation_and_not_without() {
    let context = context();
    let scene = object(&context);
    let score = |relocate_every: u32| -> Metrics {
        let paper = Config::paper(Preset::Object, 30).with_paper(|own| {
            (own.start, own.pool, own.relocate_every) = (Start::Identical, 512, relocate_every);
        });
        let config = Config { iterations: 300, ..paper };
        let outcome = planner(&context, &scene, config).run(None, |_| ControlFlow::Continue(())).expect("a run");
        let cameras: Vec<Camera> = outcome
            .poses
            .iter()
            .map(|pose| Camera { name: String::new(), pose: *pose, intrinsics: intrinsics() })
            .collect();
        let scorer = Scorer::new(&context, &scene.device, &scene.target.proxy.sample(400, 0, 1)).expect("a scorer");
        aggregate(&scorer.score(&cameras, Field::Cone).expect("scores"))
    };
    let [covered, alone] = [10, 0].map(score).map(|metrics| metrics.coverage_1 / metrics.reachable);
    assert!(covered >= 0.95, "{covered} of the reachable points are seen");
    assert!(alone < covered - 0.2, "{alone} are seen without relocation, {covered} with it");
    silent(&context);
}

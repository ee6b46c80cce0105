//! The planner on the device: against its twin, against itself, and on scenes that are moved and turned.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::support::device::{context, silent};
use crate::support::plans::{Scene, intrinsics, object, planner, room, scene};
use camsplat::engine::vulkan::Context;
use camsplat::planner::metrics::score_point::{Field, Scorer, aggregate};
use camsplat::planner::plan::config::{Config, Preset};
use camsplat::planner::plan::gate::Gate;
use camsplat::planner::plan::paper::dense::{Batch, dense};
use camsplat::planner::plan::paper::regulariser::regulariser;
use camsplat::planner::plan::paper::{Kernel, MAX_DENSE, PaperPass, Pass};
use camsplat::planner::plan::planner::Planner;
use camsplat::planner::plan::preparation::Preparation;
use camsplat::planner::plan::run::Outcome;
use camsplat::scene::camera::{Camera, Intrinsics};
use camsplat::scene::octahedral;
use camsplat::scene::proxy::{Orientation, Proxy};
use camsplat::scene::region::{Region, Shape};
use camsplat::scene::samples;
use camsplat::scene::surface::{Points, Surface};
use glam::{DMat3, DQuat, DVec3, Vec3};

fn small(preset: Preset, views: u32) -> Config {
    let paper = Config::paper(preset, views).with_paper(|own| (own.pool, own.relocate_every) = (64, 10));
    Config { iterations: 30, probes: 8, checkpoint_every: 10, ..paper }
}

/// The same by one way through the splat pass.
fn by(pass: Pass, config: &Config) -> Config {
    config.clone().with_paper(|own| own.pass = pass)
}

fn run(context: &Arc<Context>, scene: &Scene, config: Config) -> Outcome {
    planner(context, scene, config).run(None, |_| ControlFlow::Continue(())).expect("a run")
}

/// The shaders are only as correct as what they are tested against: here every formula of the loss, its gradient, the
/// coverage weights and the utilities, with each gate and kernel, with and without occlusion.
#[test]
fn one_iteration_is_that_of_the_twin() {
    let context = context();
    let scenes = [(Preset::Object, object(&context)), (Preset::Room, room(&context))];
    let cases = [
        (Gate::Soft, Kernel::Angular, true),
        (Gate::Soft, Kernel::Metric, true),
        (Gate::Hard, Kernel::Angular, false),
        (Gate::Pinhole, Kernel::Angular, true),
        (Gate::PinholeHard, Kernel::Metric, true),
    ];
    for (preset, scene) in &scenes {
        for (gate, kernel, occlusion) in cases {
            // 48 texels a side take the blocks of texels past one; rates of zero leave the splats where they are.
            for (resolution, seed) in [(16, 1), (48, 2)] {
                let config = small(*preset, 40).with_paper(|own| {
                    (own.kernel, own.occlusion) = (kernel, occlusion);
                    (own.resolution, own.equal_probes) = (Some(resolution), seed == 1);
                });
                let still = Config { lr_position: 0.0, lr_direction: 0.0, ..config };
                let config = Config { gate, gate_softness: 0.02, iterations: 1, seed, ..still };
                compare(&context, scene, by(Pass::Binned, &config));
                compare(&context, scene, by(Pass::Dense, &config));
            }
        }
    }
    silent(&context);
}

fn compare(context: &Arc<Context>, scene: &Scene, config: Config) {
    let own = config.of_paper().expect("the paper's objective");
    let case = format!("{:?} {:?} {:?} {:?}", own.pass, config.gate, own.kernel, own.resolution);
    let planner = planner(context, scene, config.clone());
    let outcome = planner.run(None, |_| ControlFlow::Continue(())).expect("a run");
    let paper = planner.pass::<PaperPass>().expect("the paper's objective");
    let maps = paper.maps();
    let depth: Vec<f64> = maps.download().expect("depths").into_iter().map(f64::from).collect();
    let texels = (maps.resolution * maps.resolution) as usize;
    let splats: Vec<_> =
        planner.start().iter().map(|s| (Vec3::from(s.centre).as_dvec3(), Vec3::from(s.direction).as_dvec3())).collect();
    let probes: Vec<_> = maps.probes[..config.probes as usize]
        .iter()
        .map(|p| (Vec3::from(p.position).as_dvec3(), p.score as f64))
        .collect();
    let batch = Batch {
        settings: paper.settings(),
        gate: config.gate,
        kernel: own.kernel,
        occlusion: own.occlusion,
        splats: &splats,
        tangents: &[camsplat::planner::plan::start::tangents(&intrinsics()).map(f64::from)],
        probes: &probes,
        directions: &octahedral::directions(maps.resolution),
        depth: &depth[..probes.len() * texels],
        log_scale: (paper.start_scale() as f64).ln(),
    };
    let image = dense(&batch);
    let (reg, reg_centre, reg_direction) = regulariser(&batch, &image.weights);
    let lambda = own.lambda_reg as f64;

    // Single texels may fall on either side of a cut-off in float32: the tolerances allow for a few of thousands.
    let close = |device: f64, twin: f64, scale: f64, what: &str| {
        assert!((device - twin).abs() <= 2e-3 * scale, "{case}, {what}: {device} against {twin}");
    };
    let history = outcome.history[0];
    close(history.image as f64, image.loss, image.loss.abs(), "image loss");
    close(history.reg as f64 * lambda, reg * lambda, (reg * lambda).abs(), "regulariser");
    let blocks = paper.settings().blocks as usize;
    for (tallies, weight) in paper.tallies().expect("tallies").chunks(blocks).zip(&image.weights) {
        let (lack, sky) = tallies.iter().fold((0.0, 0.0), |sum, t| (sum.0 + t.short_fall, sum.1 + t.sky));
        close((lack / sky.max(1.0)) as f64, *weight, weight.abs().max(1e-5), "coverage weight");
    }
    let scale: f64 = paper.tallies().expect("tallies").iter().map(|tally| tally.log_scale as f64).sum();
    close(scale, image.by_log_scale, image.by_log_scale.abs().max(1e-4), "gradient by scale");
    let gradients = planner.gradients().expect("gradients");
    let largest = |of: &dyn Fn(usize) -> DVec3| (0..splats.len()).map(|j| of(j).length()).fold(1e-9, f64::max);
    let by_centre = |j: usize| image.by_centre[j] + lambda * reg_centre[j];
    let by_direction = |j: usize| image.by_direction[j] + lambda * reg_direction[j];
    let (most_centre, most_direction) = (largest(&by_centre), largest(&by_direction));
    let most_utility = image.utility.iter().fold(1e-9, |most: f64, u| most.max(u.abs()));
    for (j, gradient) in gradients.iter().enumerate() {
        let centre = (Vec3::from(gradient.centre).as_dvec3() - by_centre(j)).length();
        close(centre, 0.0, most_centre, &format!("gradient by the centre of splat {j}"));
        let direction = (Vec3::from(gradient.direction).as_dvec3() - by_direction(j)).length();
        close(direction, 0.0, most_direction, &format!("gradient by the direction of splat {j}"));
        close(gradient.utility as f64, image.utility[j], most_utility, &format!("utility of splat {j}"));
    }
}

/// The object as a cloud of points with scores, with up along y.
fn scored(context: &Arc<Context>) -> Scene {
    let proxy = Proxy::new(&samples::object(), Orientation::Trusted).expect("a good surface");
    let mut points = Points { oriented: true, ..Points::default() };
    for (i, point) in proxy.sample(2000, 5, 0).iter().enumerate() {
        points.positions.push(point.position);
        points.normals.push(point.normal);
        points.scores.push(1.0 + 0.5 * (i % 3) as f32);
    }
    let shape = Shape::Shell { centre: DVec3::ZERO, r_min: 1.2, r_max: 1.8 };
    scene(context, &Surface::Points(points), &Region { shape, up: DVec3::Y, floor: None, clearance: 0.05 })
}

/// If this failed, points would be planned for as if all were equally matt, or with the scores of others.
#[test]
fn targets_by_score_are_those_of_the_twin() {
    let context = context();
    let scene = scored(&context);
    for pass in [Pass::Dense, Pass::Binned] {
        let still = Config { iterations: 1, lr_position: 0.0, lr_direction: 0.0, ..small(Preset::Object, 40) };
        let fine = still.with_paper(|own| own.resolution = Some(24));
        compare(&context, &scene, Config { gate_softness: 0.02, ..by(pass, &fine) });
    }
    silent(&context);
}

/// A photo that was taken with a longer lens sees less: a plan around it must know.
#[test]
fn kept_cameras_keep_their_field_of_view() {
    let context = context();
    let scene = object(&context);
    let eye = DVec3::new(1.5, 0.0, 0.4);
    let pose = camsplat::scene::camera::Pose::looking(eye, -eye, DVec3::Z);
    let seen = |fov: f64| {
        let kept = Camera { name: "kept".into(), pose, intrinsics: Intrinsics::from_fov(800, 600, fov.to_radians()) };
        let config = Config { gate: Gate::Hard, probes: 64, iterations: 1, ..small(Preset::Object, 1) };
        let preparation = Preparation::new(&context, &scene.problem(&[kept]), config);
        let planner = Planner::new(&context, &scene.device, preparation.expect("a good configuration")).expect("room");
        planner.run(None, |_| ControlFlow::Continue(())).expect("a run");
        let paper = planner.pass::<PaperPass>().expect("the paper's objective");
        let blocks = paper.settings().blocks as usize;
        paper.tallies().expect("tallies").iter().step_by(blocks).map(|tally| tally.visible).sum::<u32>()
    };
    // The planned camera sees the same in both.
    let (wide, narrow) = (seen(60.0), seen(10.0));
    assert!(wide > narrow + 16, "{wide} probes see a wide camera, {narrow} a narrow one");
    silent(&context);
}

/// Large budgets take another way through the splat pass; it must lead to the same place. Past rounding in the first
/// iterations the two may drift apart, so that only few are compared.
#[test]
fn dense_and_binned_passes_take_the_same_steps() {
    let context = context();
    for (preset, scene) in [(Preset::Object, object(&context)), (Preset::Room, room(&context))] {
        let config = small(preset, 80).with_paper(|own| own.relocate_every = 5);
        let config = Config { iterations: 12, checkpoint_every: 5, ..config };
        let dense = run(&context, &scene, by(Pass::Dense, &config));
        let binned = run(&context, &scene, by(Pass::Binned, &config));
        for (a, b) in dense.history.iter().zip(&binned.history) {
            assert!((a.loss - b.loss).abs() < 1e-3 * a.loss, "{a:?} against {b:?}");
        }
        for (a, b) in dense.poses.iter().zip(&binned.poses) {
            let off = (a.position - b.position).length();
            let turned = (a.forward() - b.forward()).length();
            assert!(off < 0.01 && turned < 0.01, "off by {off}, turned by {turned}");
        }
    }
    silent(&context);
}

/// Same input and seed, same bits: no scheduling may show.
#[test]
fn repeats_are_equal_to_the_bit() {
    let context = context();
    for (preset, scene) in [(Preset::Object, object(&context)), (Preset::Room, room(&context))] {
        let first = run(&context, &scene, small(preset, 40));
        for _ in 0..2 {
            let again = run(&context, &scene, small(preset, 40));
            assert_eq!(first.poses, again.poses);
            assert_eq!(first.history, again.history);
        }
        let binned = || run(&context, &scene, by(Pass::Binned, &small(preset, 40)));
        let (first_binned, again) = (binned(), binned());
        assert_eq!(first_binned.poses, again.poses);
        assert_eq!(first_binned.history, again.history);
        let other = run(&context, &scene, Config { seed: 1, ..small(preset, 40) });
        assert_ne!(first.poses, other.poses, "the seed does nothing");
    }
    silent(&context);
}

/// A plan in other units, elsewhere, or with another axis up must be the same plan.
#[test]
fn a_scaled_moved_and_turned_scene_gives_the_plan_scaled_moved_and_turned() {
    let context = context();
    let turn = DQuat::from_mat3(&DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X));
    for (preset, surface, base) in
        [(Preset::Object, samples::object(), object(&context)), (Preset::Room, samples::room(), room(&context))]
    {
        let geometry = &base.device.geometry;
        let region = geometry.region.transformed(&geometry.to_internal.inverse()).expect("the region itself");
        for (scale, shift, turn) in [
            (4.0, DVec3::ZERO, DQuat::IDENTITY),
            (0.01, DVec3::new(100.0, -7.0, 3.0), DQuat::IDENTITY),
            (1.0, DVec3::ZERO, turn),
            (7.3, DVec3::new(-2.0, 0.5, 40.0), turn * turn),
        ] {
            let map = camsplat::scene::similarity::Similarity { rotation: turn, scale, translation: shift };
            let Surface::Mesh(mut mesh) = surface.clone() else { unreachable!("the samples are meshes") };
            mesh.positions.iter_mut().for_each(|p| *p = map.point(*p));
            let moved = scene(&context, &Surface::Mesh(mesh), &region.transformed(&map).expect("still a box"));
            let config = small(preset, 30).with_paper(|own| own.relocate_every = 0);
            let config = Config { iterations: 20, ..config };
            let rates = (config.lr_position as f64, config.lr_direction as f64);
            let (here, there) = (run(&context, &base, config.clone()), run(&context, &moved, config));
            let size = map.length(region.bounding_sphere().1);
            // A scene thousands of its own sizes away has lost digits before it gets here: a corner may come out in the
            // next float32, and what a ray along an edge sees of it on the other side. From there on that camera and,
            // less, those that share its directions drift. Everything else is the same plan but for its last bits.
            let far = shift.length() > 1000.0 * scale;
            let bound = if far { 1e-3 } else { 1e-6 };
            let mut same = 0;
            for (a, b) in here.poses.iter().zip(&there.poses) {
                let off = (map.point(a.position) - b.position).length() / size;
                let turned = (map.direction(a.forward()) - b.forward()).length();
                same += (off < bound && turned < bound) as usize;
                assert!(
                    off < 0.1 * rates.0 && turned < 0.1 * rates.1,
                    "off by {off} of the region, turned by {turned}"
                );
            }
            let least = if far { 9 * here.poses.len() / 10 } else { here.poses.len() };
            assert!(same >= least, "{preset:?}, scaled by {scale}: {same} of {} cameras", here.poses.len());
        }
    }
    silent(&context);
}

/// What the whole is for: held-out gaps must come out well below those of the random start, without losing coverage, and
/// every camera must be feasible.
#[test]
fn a_plan_is_better_than_its_start() {
    let context = context();
    for (preset, scene, views) in [(Preset::Object, object(&context), 40), (Preset::Room, room(&context), 120)] {
        let paper = Config::paper(preset, views).with_paper(|own| own.pool = 512);
        let config = Config { iterations: 300, ..paper };
        let outcome = run(&context, &scene, config);
        let points = scene.target.proxy.sample(300, 0, 1);
        let scorer = Scorer::new(&context, &scene.device, &points).expect("a scorer");
        let score = |poses: &[camsplat::scene::camera::Pose]| {
            let cameras: Vec<Camera> = (0..)
                .zip(poses)
                .map(|(i, pose)| Camera { name: format!("{i}"), pose: *pose, intrinsics: intrinsics() })
                .collect();
            aggregate(&scorer.score(&cameras, Field::Cone).expect("scores"))
        };
        let (before, after) = (score(&outcome.snapshots[0].1), score(&outcome.poses));
        assert!(after.gap_mean_deg < 0.9 * before.gap_mean_deg, "{preset:?}: {before:?} {after:?}");
        assert!(after.coverage_1 > before.coverage_1 - 0.005, "{preset:?}: {before:?} {after:?}");
        let geometry = &scene.device.geometry;
        for pose in &outcome.poses {
            let at = geometry.to_internal.point(pose.position);
            assert!(geometry.region.violation(at).0 < 1e-9, "a camera outside the region, at {}", pose.position);
        }
    }
    silent(&context);
}

/// Lavapipe silently ends the loops of an invocation after 65,535 iterations together: at the most cameras that the
/// dense pass takes, every probe seeing nearly all of them, nothing may be missing. The binned pass loops differently.
#[test]
fn the_dense_pass_takes_as_many_cameras_as_it_says() {
    let context = context();
    let scene = object(&context);
    let paper = Config::paper(Preset::Object, MAX_DENSE).with_paper(|own| {
        // Wide enough that a tile, too, has thousands of instances.
        (own.scale, own.resolution) = (Some(0.4), Some(16));
        (own.pool, own.relocate_every) = (16, 0);
    });
    let config = Config { iterations: 1, probes: 4, checkpoint_every: 1, ..paper };
    let dense = planner(&context, &scene, by(Pass::Dense, &config));
    let binned = planner(&context, &scene, by(Pass::Binned, &config));
    let (a, b) = (
        dense.run(None, |_| ControlFlow::Continue(())).expect("a dense run"),
        binned.run(None, |_| ControlFlow::Continue(())).expect("a binned run"),
    );
    let counted = dense.pass::<PaperPass>().expect("the paper's objective");
    let visible = counted.tallies().expect("tallies").iter().map(|tally| tally.visible).max();
    assert!(visible > Some(MAX_DENSE / 2), "only {visible:?} cameras are seen: this tests nothing");
    let (a, b) = (a.history[0], b.history[0]);
    assert!((a.image - b.image).abs() < 1e-4 * a.image && (a.reg - b.reg).abs() <= 1e-4 * a.reg, "{a:?} against {b:?}");
    let (a, b) = (dense.gradients().expect("gradients"), binned.gradients().expect("gradients"));
    let most = a.iter().map(|g| Vec3::from(g.centre).length()).fold(0.0, f32::max);
    for (a, b) in a.iter().zip(&b) {
        let off = (Vec3::from(a.centre) - Vec3::from(b.centre)).length();
        assert!(off < 1e-3 * most, "{a:?} against {b:?}");
    }
    silent(&context);
}

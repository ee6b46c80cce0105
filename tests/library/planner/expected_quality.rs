//! Expected quality on the device against its twin, and against known values.

use std::ops::ControlFlow;

use crate::support::device::{context, silent};
use crate::support::plans::{Scene, intrinsics, object, planner, preparation, room};
use camsplat::Error;
use camsplat::engine::vulkan::Recorder;
use camsplat::planner::plan::config::{Config, Minimise, Preset};
use camsplat::planner::plan::expected_quality::viewed::{Cameras, viewed};
use camsplat::planner::plan::expected_quality::{QualityConfig, QualityPass};
use camsplat::planner::plan::gate::Gate;
use camsplat::planner::plan::pipeline::{self, Tools};
use camsplat::planner::plan::planner::Planner;
use camsplat::planner::plan::preparation::Preparation;
use camsplat::planner::plan::problem::Problem;
use camsplat::planner::plan::reference::Reference;
use camsplat::planner::plan::simple_layouts;
use camsplat::planner::plan::start::tangents;
use camsplat::planner::plan::target::{RegionChoice, Target};
use camsplat::planner::quality::expected::{Judge, LOOKS, expect};
use camsplat::planner::quality::law::{Coefficients, Law};
use camsplat::planner::quality::look::Surroundings;
use camsplat::planner::quality::viewers::Viewers;
use camsplat::scene::camera::{Camera, Intrinsics};
use camsplat::scene::layouts;
use camsplat::scene::random;
use camsplat::scene::region::Shape;
use camsplat::scene::samples;
use camsplat::scene::surface::{Mesh, Surface};
use camsplat::visibility::device_scene::DeviceScene;
use glam::{DVec3, Vec3};

/// The problem of a target with the camera of these tests.
fn problem_of<'p>(target: &'p Target, kept: &'p [Camera]) -> Problem<'p> {
    Problem::new(target, intrinsics(), kept).expect("a good region")
}

fn cameras(scene: &Scene, count: usize, inward: bool) -> Vec<Camera> {
    let back = scene.device.geometry.to_internal.inverse();
    let poses = layouts::random(&scene.device.geometry.free, count, 5, inward);
    poses.iter().map(|pose| Camera { name: String::new(), pose: back.pose(pose), intrinsics: intrinsics() }).collect()
}

/// What `score` prints, and what a plan is chosen by, rests on this stage. Rays that graze an edge may fall on either side in
/// single precision: two looks in a hundred may differ by that, all others by rounding alone.
#[test]
fn looks_and_errors_are_those_of_the_twin() {
    let context = context();
    for (name, scene, inward) in [("object", object(&context), true), ("room", room(&context), false)] {
        let geometry = &scene.device.geometry;
        let viewers = Viewers::Region.sample(geometry, intrinsics(), inward, 3, 60).expect("viewers");
        let law = Law { most: 2.5, ..Law::embedded(true) };
        let around = Surroundings::new(geometry, scene.target.proxy.sphere, inward, &law);
        let judge = Judge::new(&context, &scene.device, around, viewers.clone(), &law, 9).expect("a judge");
        for count in [1, 7, 40] {
            let mut cameras = cameras(&scene, count, inward);
            // Some see finer than viewers do, some coarser.
            for (camera, fov) in cameras.iter_mut().zip([35f64, 60.0, 90.0].into_iter().cycle()) {
                camera.intrinsics = Intrinsics::from_fov(800, 600, fov.to_radians());
            }
            let found = judge.expect(&cameras).expect("an expectation");
            let (looks, twin) = expect(geometry, around, &viewers, &cameras, &law, 9);
            let drawn = judge.looks().expect("looks");
            let moved = drawn.iter().zip(&looks).filter(|(a, b)| {
                let apart = |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max);
                apart(a.position, b.position).max(apart(a.direction, b.direction)) > 1e-3
            });
            let moved = moved.count();
            assert!(moved * 100 <= 2 * looks.len(), "{name}: {moved} of {} looks differ", looks.len());
            assert!(
                looks.iter().filter(|look| look.normal != [0.0; 3]).count() > 20 * LOOKS as usize,
                "{name}: too few looks"
            );
            assert!(
                (found.error_db - twin.error_db).abs() < 0.02,
                "{name}, {count}: {} of {}",
                found.error_db,
                twin.error_db
            );
            assert!((found.unseen - twin.unseen).abs() < 0.01, "{name}, {count}: {} of {}", found.unseen, twin.unseen);
            assert!(count == 1 || twin.unseen < 0.9, "{name}, {count}: nothing to compare");
        }
    }
    silent(&context);
}

/// The whole iteration: looks, nearest splats, law, gradient by gate, angle and distance, and the sums over looks. If this
/// failed, plans would descend something else than what they are judged by. A ray that grazes an edge may fall on either
/// side in single precision, and a look between two splats may go to either.
#[test]
fn an_iteration_is_that_of_the_twin() {
    let context = context();
    for (name, scene, preset) in [("object", object(&context), Preset::Object), ("room", room(&context), Preset::Room)]
    {
        for (gate, views) in [(Gate::Pinhole, 30), (Gate::Soft, 9), (Gate::PinholeHard, 30)] {
            // An end that most errors are near to.
            let own = QualityConfig::new(preset == Preset::Object);
            let own = QualityConfig { law: Coefficients { most: Some(2.5), ..own.law }, ..own };
            let law = own.law.on_device();
            let minimise = Minimise::Quality(own);
            let config = Config { iterations: 1, gate, seed: 4, minimise, ..Config::new(preset, views) };
            // Cameras that are there already see finer than viewers, or coarser.
            let mut kept = cameras(&scene, 6, preset == Preset::Object);
            for (camera, fov) in kept.iter_mut().zip([30f64, 35.0, 45.0, 80.0, 90.0, 100.0]) {
                camera.intrinsics = Intrinsics::from_fov(800, 600, fov.to_radians());
            }
            // So do half of the planned ones.
            let lenses: Vec<Intrinsics> = kept.iter().cycle().take(views as usize / 2).map(|c| c.intrinsics).collect();
            let problem = Problem { lenses: lenses.clone(), ..scene.problem(&kept) };
            let preparation = Preparation::new(&context, &problem, config.clone()).expect("a good problem");
            let planner = Planner::new(&context, &scene.device, preparation).expect("room for it");
            let outcome = planner.run(None, |_| ControlFlow::Continue(())).expect("a run");
            let vector = |v: [f32; 3]| Vec3::from(v).as_dvec3();
            let splats: Vec<_> = planner.start().iter().map(|s| (vector(s.centre), vector(s.direction))).collect();
            let quality = planner.pass::<QualityPass>().expect("the default objective");
            let of_kept = kept.iter().map(|camera| camera.intrinsics);
            let lenses: Vec<Intrinsics> = of_kept.chain(lenses).chain([intrinsics()]).collect();
            let cameras = Cameras {
                gate,
                gate_softness: quality.settings().gate_softness.into(),
                splats: &splats,
                tangents: &lenses.iter().map(|lens| tangents(lens).map(f64::from)).collect::<Vec<_>>(),
            };
            let looks = quality.looks().expect("looks");
            assert_eq!(looks.len(), (config.probes * LOOKS) as usize);
            let twin = viewed(&cameras, &looks, &scene.device.geometry.bvh, &law);
            let loss = f64::from(outcome.history[0].image);
            assert!((loss - twin.loss).abs() < 2e-3, "{name}, {gate:?}: {loss} of {}", twin.loss);
            let gradients = planner.gradients().expect("gradients");
            let most = |of: &[DVec3]| of.iter().map(|g| g.length()).fold(1e-9, f64::max);
            let (centre, direction) = (most(&twin.by_centre), most(&twin.by_direction));
            for (j, gradient) in gradients.iter().enumerate().skip(kept.len()) {
                let off = (vector(gradient.centre) - twin.by_centre[j]).length();
                assert!(off < 0.02 * centre, "{name}, {gate:?}, centre of {j}: {off} of {centre}");
                let off = (vector(gradient.direction) - twin.by_direction[j]).length();
                assert!(off < 0.02 * direction, "{name}, {gate:?}, direction of {j}: {off} of {direction}");
            }
        }
    }
    silent(&context);
}

/// A single thread tests the views of a look eight at a time, threads that share a look 32. If this failed, plans would depend on the
/// kind of device by more than rounding.
#[test]
fn threads_that_share_a_look_find_what_a_single_one_finds() {
    let context = context();
    let scenes = [(object(&context), Preset::Object), (room(&context), Preset::Room)];
    for (scene, preset) in &scenes {
        // Fewer than one round takes, more than all rounds test, and counts that do not divide.
        for views in [2, 31, 100, 333] {
            let config = Config { iterations: 3, probes: 30, ..Config::new(*preset, views) };
            let [alone, together] = [false, true].map(|shared| {
                let preparation = preparation(&context, scene, config.clone()).with_shared_looks(&context, shared);
                let planner = Planner::new(&context, &scene.device, preparation).expect("room for it");
                let outcome = planner.run(None, |_| ControlFlow::Continue(())).expect("a run");
                let losses: Vec<u32> = outcome.history.iter().map(|record| record.image.to_bits()).collect();
                (losses, planner.gradients().expect("gradients"))
            });
            assert_eq!(alone.0, together.0, "{preset:?}, {views}: losses");
            let [a, b] = [&alone.1, &together.1].map(|gradients| bytemuck::cast_slice::<_, u32>(gradients));
            assert_eq!(a, b, "{preset:?}, {views}: gradients");
            assert!(a.iter().any(|word| *word != 0), "there is something to compare");
        }
    }
    silent(&context);
}

/// Looks of 30 viewers are drawn for 34 iterations and then for 16. If this failed, iterations would look from where others did, or at
/// what no viewer sees.
#[test]
fn looks_that_are_drawn_together_are_those_drawn_one_by_one() {
    let context = context();
    let scene = object(&context);
    let config = Config { iterations: 100, probes: 30, ..Config::new(Preset::Object, 12) };
    let gradients = [true, false].map(|together| {
        let planner = planner(&context, &scene, config.clone());
        assert_eq!(planner.block(), 50);
        let mut commands = Recorder::new(&context).expect("a recorder");
        match together {
            true => planner.record_block(&mut commands).expect("a block"),
            false => (0..50).for_each(|_| planner.record_iteration(&mut commands).expect("an iteration")),
        }
        commands.submit_and_wait().expect("a submission");
        drop(commands);
        planner.gradients().expect("gradients")
    });
    let [together, one_by_one] = gradients.each_ref().map(|gradients| bytemuck::cast_slice::<_, u32>(gradients));
    assert_eq!(together, one_by_one);
    assert!(together.iter().any(|word| *word != 0), "there is something to compare");
    silent(&context);
}

/// A mesh of several, each moved and stretched.
fn together(parts: &[(Surface, DVec3, DVec3)]) -> Surface {
    let mut mesh = Mesh::default();
    for (part, offset, size) in parts {
        let Surface::Mesh(part) = part else { panic!("samples are meshes") };
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(part.positions.iter().map(|p| *p * *size + *offset));
        mesh.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    Surface::Mesh(mesh)
}

fn planned(surface: &Surface, choice: &RegionChoice, config: &Config) -> (Target, pipeline::Plan) {
    let target = Target::new(surface, "sample", config.preset, choice, DVec3::Z, &intrinsics()).expect("a target");
    let go_on = |_: pipeline::PlanEvent| ControlFlow::Continue(());
    let plan = pipeline::run(&context(), &problem_of(&target, &[]), config.clone(), Tools::default(), go_on);
    (target, plan.expect("a plan"))
}

/// If this failed, a stop while simple layouts are looked at would be heard after all of them only, a stopped plan that is wanted would be
/// lost, or one that nobody wants would be scored first.
#[test]
fn a_plan_stops_where_it_is() {
    let config = Config::new(Preset::Object, 6);
    let target =
        Target::new(&samples::object(), "sample", config.preset, &RegionChoice::default(), DVec3::Z, &intrinsics());
    let target = target.expect("a target");
    let run = |whole_only: bool, stops: &dyn Fn(&pipeline::PlanEvent, u32) -> bool| {
        let (mut asked, mut scored) = (0, false);
        let plan = pipeline::run(
            &context(),
            &problem_of(&target, &[]),
            config.clone(),
            Tools { whole_only, ..Tools::default() },
            |event| {
                asked += 1;
                scored |= matches!(event, pipeline::PlanEvent::Scoring);
                if stops(&event, asked) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            },
        );
        (plan, asked, scored)
    };
    for at in [1, 2, 5] {
        let (plan, asked, _) =
            run(false, &|event, asked| matches!(event, pipeline::PlanEvent::Preparing) && asked == at);
        assert!(matches!(plan, Err(Error::Interrupted)) && asked == at, "{asked} of {at}");
    }
    let begun = |event: &pipeline::PlanEvent, _| matches!(event, pipeline::PlanEvent::Iterations(done, _) if *done > 0);
    let (plan, _, scored) = run(false, &begun);
    assert!(plan.is_ok_and(|plan| plan.interrupted() && plan.record.cameras.len() == 6) && scored);
    let (plan, _, scored) = run(true, &begun);
    assert!(matches!(plan, Err(Error::Interrupted)) && !scored);
}

/// A ball on a thin, wide sheet, as a car on a cloth: points even over the surface sent nearly all cameras above it, where
/// viewers look from below as well. If this failed, half of the viewers would look at what no camera has seen.
#[test]
fn a_thin_sheet_is_photographed_from_below_too() {
    let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    let sheet = Mesh {
        positions: vec![corner(-2.0, -2.0), corner(2.0, -2.0), corner(2.0, 2.0), corner(-2.0, 2.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let ball = (samples::sphere(0.5, 12), DVec3::new(0.0, 0.0, 0.5), DVec3::ONE);
    let surface = together(&[(Surface::Mesh(sheet), DVec3::ZERO, DVec3::ONE), ball]);
    let (_, plan) = planned(&surface, &RegionChoice::default(), &Config::new(Preset::Object, 20));
    let below = plan.record.cameras.iter().filter(|camera| camera.pose.position.z < 0.0).count();
    assert!((7..=13).contains(&below), "{below} of 20 cameras are below the sheet");
    let expected = plan.record.expected.expect("an expectation");
    assert!(expected.unseen < 0.02 && expected.db >= 0.0, "{expected:?}");
}

/// Cameras that are there already: what is added goes into the hole that they leave. If this failed, a gain that is small beside what all
/// cameras have in common would be thrown away for places at random.
#[test]
fn views_are_added_where_those_that_are_kept_leave_a_hole() {
    let config = Config::new(Preset::Object, 30);
    let (target, whole) = planned(&samples::object(), &RegionChoice::default(), &config);
    let (centre, _) = target.region.bounding_sphere();
    let beside = |camera: &Camera| (camera.pose.position - centre).normalize().x;
    let mut kept = whole.record.cameras;
    kept.sort_by(|a, b| beside(a).total_cmp(&beside(b)));
    kept.truncate(27);
    let config = Config::new(Preset::Object, 3);
    let go_on = |_: pipeline::PlanEvent| ControlFlow::Continue(());
    let plan = pipeline::run(&context(), &problem_of(&target, &kept), config, Tools::default(), go_on).expect("a plan");
    let added: Vec<f64> = plan.record.cameras[..3].iter().map(beside).collect();
    assert!(added.iter().all(|x| *x > 0.5), "along x they stand at {added:?}");
    assert!(plan.record.expected.expect("an expectation").db >= 0.0);
}

/// What is promised of every plan: whatever the scene, as good as each simple layout, turned at random, in the eyes of viewers that neither the
/// descent nor the choice has seen.
#[test]
fn a_plan_is_never_worse_than_a_simple_layout() {
    let context = context();
    for seed in 0..5u64 {
        let boxes: Vec<_> = (0..4)
            .map(|i| {
                let [x, y, z, a] = random::uniforms(seed, 1, i);
                let [b, c, ..] = random::uniforms(seed, 2, i);
                (samples::cube(), 2.0 * DVec3::new(x, y, z), DVec3::new(0.2 + a, 0.2 + b, 0.2 + c))
            })
            .collect();
        let (preset, shape, floor) = match seed {
            0 | 1 => (Preset::Object, None, None),
            2 => (Preset::Object, None, Some(0.5)),
            _ => (Preset::Room, Some(Shape::Box { min: DVec3::splat(-2.0), max: DVec3::splat(4.0) }), None),
        };
        let surface = match preset {
            Preset::Object => together(&boxes),
            // A shell of walls around the boxes.
            Preset::Room => together(&[&boxes[..], &[(samples::cube(), DVec3::ONE, DVec3::splat(6.5))]].concat()),
        };
        let choice = RegionChoice { shape, floor, clearance: None, stood: None };
        let config = Config { seed, ..Config::new(preset, [6, 20, 14, 24, 40][seed as usize]) };
        let (target, plan) = planned(&surface, &choice, &config);
        let fresh = Config { seed: seed + 100, ..config.clone() };
        let scene = target.geometry().expect("a scene");
        let scene = DeviceScene::new(&context, scene).expect("room for it");
        let reference = Reference::new(&context, &problem_of(&target, &[]), &scene, &fresh).expect("a reference");
        let planned = reference.expect_cameras(&plan.record.cameras).expect("an expectation").error_db;
        for (name, ways) in simple_layouts::layouts(&config, &scene.geometry, &[]) {
            let errors: Vec<f64> =
                ways.iter().map(|poses| reference.expect(poses).expect("an expectation").error_db).collect();
            // Turned at random, as it would be without a plan.
            let simple = errors.iter().sum::<f64>() / errors.len() as f64;
            assert!(planned <= simple, "scene {seed}: {planned}, where {name} has {simple}");
        }
    }
    silent(&context);
}

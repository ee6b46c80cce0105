//! Plans whose photos structure from motion can join: the penalty on neighbours that are too far apart, and what comes of it.

use std::ops::ControlFlow;

use crate::support::device::{context, silent};
use crate::support::plans::{intrinsics, object, planner, room};
use camsplat::planner::plan::config::{Config, Preset};
use camsplat::planner::plan::expected_quality::QualityConfig;
use camsplat::planner::plan::expected_quality::links::{Links, penalty};
use camsplat::planner::plan::pipeline::{self, Plan, Tools};
use camsplat::planner::plan::problem::Problem;
use camsplat::planner::plan::start::tangents;
use camsplat::planner::plan::target::{RegionChoice, Target};
use camsplat::scene::camera::{Camera, Pose};
use camsplat::scene::samples;
use glam::{DVec3, Vec3};

const GO_ON: fn(pipeline::PlanEvent) -> ControlFlow<()> = |_| ControlFlow::Continue(());

/// If this failed, cameras would descend another penalty than the one that their links are made by. Looks and all else being the same,
/// what the gradients of two planners differ by is the penalty's.
#[test]
fn the_penalty_on_the_device_is_that_of_the_twin() {
    let context = context();
    for (scene, preset, views) in [(object(&context), Preset::Object, 30), (room(&context), Preset::Room, 24)] {
        let free = Config { iterations: 1, seed: 4, ..Config::new(preset, views) };
        let linked = Config { iterations: 1, ..free.clone().connected(15.0).expect("expected quality") };
        let [without, with] = [free, linked].map(|config| {
            let planner = planner(&context, &scene, config);
            let outcome = planner.run(None, |_| ControlFlow::Continue(())).expect("a run");
            (planner.gradients().expect("gradients"), outcome.history[0].reg, planner)
        });
        let geometry = &scene.device.geometry;
        let linked = QualityConfig { connect: Some(15.0), ..QualityConfig::new(true) };
        let links = Links::of(&linked, &scene.target.proxy, geometry, 4).expect("cameras are to connect");
        let start = with.2.start();
        let (from, anchors) = links.anchors(&geometry.bvh, start, &[], 0.0);
        let vector = |v: [f32; 3]| Vec3::from(v).as_dvec3();
        let [tan_x, tan_y] = tangents(&intrinsics());
        let half_cone = f64::from(tan_x.min(tan_y)).atan();
        let twins: Vec<_> = (0..start.len())
            .map(|j| {
                let pose = (vector(start[j].centre), vector(start[j].direction));
                let of = &anchors[from[j] as usize..from[j + 1] as usize];
                penalty(pose, of, 15f64.to_radians(), half_cone)
            })
            .collect();
        let loss: f64 = twins.iter().map(|(loss, ..)| loss).sum();
        assert!(loss > 0.0 && (f64::from(with.1) - loss).abs() < 1e-4 * loss, "{} of {loss}", with.1);
        assert_eq!(without.1, 0.0);
        for (j, (_, by_centre, by_direction)) in twins.iter().enumerate() {
            let apart = |of: fn(&camsplat::planner::plan::shared::Gradient) -> [f32; 3]| {
                vector(of(&with.0[j])) - vector(of(&without.0[j]))
            };
            for (name, found, twin) in [
                ("centre", apart(|gradient| gradient.centre), *by_centre),
                ("direction", apart(|gradient| gradient.direction), *by_direction),
            ] {
                // Arc sines on a device have few digits.
                assert!((found - twin).length() < 1e-2 * twin.length() + 1e-4, "{name} of {j}: {found} of {twin}");
            }
        }
    }
    silent(&context);
}

fn planned(config: Config, kept: &[Camera]) -> Plan {
    let ball = samples::sphere(1.0, 24);
    let target = Target::new(&ball, "ball", Preset::Object, &RegionChoice::default(), DVec3::Z, &intrinsics());
    let target = target.expect("a target");
    let problem = Problem::new(&target, intrinsics(), kept).expect("a good region");
    pipeline::run(&context(), &problem, config, Tools::default(), GO_ON).expect("a plan")
}

/// Sizes of the groups of cameras around the unit ball that share three tenths of what either sees at no wider an angle than this: by
/// spherical geometry, without any of the planner's own code.
fn groups(cameras: &[Camera], degrees: f64) -> Vec<usize> {
    let points: Vec<DVec3> = (0..4000)
        .map(|i| {
            let (z, turn) = (1.0 - (2.0 * f64::from(i) + 1.0) / 4000.0, f64::from(i) * 2.399_963_229_728_653);
            DVec3::new((1.0 - z * z).sqrt() * turn.cos(), (1.0 - z * z).sqrt() * turn.sin(), z)
        })
        .collect();
    let cone = 0.5 * intrinsics().width.min(intrinsics().height) as f64 / intrinsics().focal[0];
    let sees = |camera: &Camera, point: &DVec3| {
        let ray = *point - camera.pose.position;
        point.dot(-ray) > 0.0 && ray.normalize().dot(camera.pose.forward()) >= cone.atan().cos()
    };
    let seen: Vec<Vec<bool>> =
        cameras.iter().map(|camera| points.iter().map(|point| sees(camera, point)).collect()).collect();
    let count = |list: &[bool]| list.iter().filter(|seen| **seen).count();
    let joined = |a: usize, b: usize| {
        let near = |point: &DVec3| {
            let [a, b] = [a, b].map(|j| cameras[j].pose.position - *point);
            a.angle_between(b) <= degrees.to_radians()
        };
        let shared = (0..points.len()).filter(|i| seen[a][*i] && seen[b][*i] && near(&points[*i])).count();
        // What is sampled decides where it is close.
        shared as f64 >= 0.25 * count(&seen[a]).min(count(&seen[b])) as f64
    };
    let mut group: Vec<usize> = (0..cameras.len()).collect();
    for a in 0..cameras.len() {
        for b in 0..a {
            let (from, to) = (group[a], group[b]);
            if from != to && joined(a, b) {
                group.iter_mut().filter(|group| **group == from).for_each(|group| *group = to);
            }
        }
    }
    let mut sizes: Vec<usize> = (0..cameras.len()).map(|j| group.iter().filter(|group| **group == j).count()).collect();
    sizes.retain(|size| *size > 0);
    sizes.sort_unstable_by(|a, b| b.cmp(a));
    sizes
}

/// If this failed, photos of a plan that is to connect would leave COLMAP with many small models, or none.
#[test]
fn cameras_that_are_to_connect_do() {
    let config = Config::new(Preset::Object, 24);
    let free = planned(config.clone(), &[]);
    assert!(groups(&free.record.cameras, 20.0).len() > 12, "24 cameras even around a ball are far apart");
    assert_eq!(free.record.connection, None);
    let plan = planned(config.connected(20.0).unwrap(), &[]);
    assert_eq!(groups(&plan.record.cameras, 20.5), [24]);
    let connection = plan.record.connection.expect("it is recorded");
    assert_eq!((connection.degrees, &connection.groups[..]), (20.0, &[24][..]));
    assert!(connection.line().starts_with("24 cameras: all"), "{}", connection.line());
    // Spread out all the same: a cluster would be easier to connect, and worth nothing.
    let expected = plan.record.expected.expect("an expectation");
    assert!(expected.db > -3.0 && expected.unseen < 0.1, "{expected:?}");
}

/// If this failed, photos taken later would not register with those that are there.
#[test]
fn planned_cameras_connect_to_those_that_are_kept() {
    let ring = |i: u32| {
        let turn = f64::from(i) * std::f64::consts::TAU / 18.0;
        let place = 2.6 * DVec3::new(turn.cos(), turn.sin(), 0.0);
        Camera { name: format!("kept{i}"), pose: Pose::looking(place, -place, DVec3::Z), intrinsics: intrinsics() }
    };
    let kept: Vec<Camera> = (0..18).map(ring).collect();
    let plan = planned(Config::new(Preset::Object, 10).connected(25.0).unwrap(), &kept);
    assert_eq!(groups(&plan.record.cameras, 25.5), [28]);
    let connection = plan.record.connection.expect("it is recorded");
    assert_eq!((&connection.groups[..], connection.kept), (&[28][..], 18));
    assert!(connection.line().contains("10 planned cameras and the 18 kept"), "{}", connection.line());
    let above = plan.record.cameras[..10].iter().filter(|camera| camera.pose.position.z.abs() > 1.0).count();
    assert!(above >= 6, "{above} of 10 leave the ring, where everything is seen already");
    // Each to one that is kept, so that any of them may be left out.
    let plan = planned(Config::new(Preset::Object, 10).connected_to_kept(25.0).unwrap(), &kept);
    for camera in &plan.record.cameras[..10] {
        let alone: Vec<Camera> = kept.iter().chain([camera]).cloned().collect();
        assert_eq!(groups(&alone, 25.5)[..], [19], "{} hangs on other planned ones", camera.name);
    }
    let above = plan.record.cameras[..10].iter().filter(|camera| camera.pose.position.z.abs() > 0.5).count();
    assert!(above >= 6, "{above} of 10 leave the ring, as far as that goes");
}

/// If this failed, cameras that cannot connect would be called connected.
#[test]
fn what_cannot_connect_is_said() {
    let plan = planned(Config { iterations: 100, ..Config::new(Preset::Object, 4).connected(3.0).unwrap() }, &[]);
    let connection = plan.record.connection.expect("it is recorded");
    assert!(connection.groups.len() > 1, "{connection:?}");
    assert!(connection.line().contains("plan more views"), "{}", connection.line());
}

//! Held-out metrics: the device against the twin, and both against known values.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use crate::support::device::{context, silent};
use camsplat::engine::vulkan::Context;
use camsplat::planner::metrics::PointMetrics;
use camsplat::planner::metrics::score_point::{Field, Scorer, score_point};
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::proxy::{Orientation, Proxy, SurfacePoint};
use camsplat::scene::random;
use camsplat::scene::region::{Region, Shape};
use camsplat::scene::samples;
use camsplat::scene::surface::Surface;
use camsplat::visibility::device_scene::{DeviceScene, SceneGeometry};
use glam::{DQuat, DVec3};

fn scene(context: &Arc<Context>, surface: &Surface, region: &Region) -> (Proxy, DeviceScene) {
    let proxy = Proxy::new(surface, Orientation::Trusted).expect("a good surface");
    let geometry = SceneGeometry::new(&proxy, region).expect("a good region");
    (proxy, DeviceScene::new(context, geometry).expect("room for it"))
}

fn camera(pose: Pose) -> Camera {
    Camera { name: String::new(), pose, intrinsics: Intrinsics::from_fov(800, 600, 60f64.to_radians()) }
}

/// What the twin makes of the points of a scorer, from the maps that the scorer has.
fn twin(scorer: &Scorer<'_>, scene: &DeviceScene, cameras: &[Camera], field: Field) -> Vec<PointMetrics> {
    let maps = scorer.maps();
    let depth = maps.download().expect("depths");
    let rows = depth.chunks((maps.resolution * maps.resolution) as usize);
    let of = |(probe, row): (&camsplat::visibility::probe_depth::Probe, &[f32])| {
        score_point(&scene.geometry, probe, row, cameras, field)
    };
    maps.probes.iter().zip(rows).map(of).collect()
}

/// All that is claimed of a plan rests on these numbers. A camera on the very edge of its image or of a shadow may fall on
/// either side in float32, and a texel between two views may go to either: one in a hundred points may differ by that, all
/// others only by rounding and by the arcsine, which Vulkan allows 4096 units in the last place (a few 1e-4 rad).
#[test]
fn scores_are_those_of_the_twin() {
    let context = context();
    let shell = Shape::Shell { centre: DVec3::ZERO, r_min: 1.2, r_max: 1.8 };
    let inside = Shape::Box { min: DVec3::splat(0.2), max: DVec3::new(5.8, 3.8, 2.6) };
    for (name, surface, region) in [
        ("object", samples::object(), Region { shape: shell, up: DVec3::Z, floor: Some(-0.3), clearance: 0.05 }),
        ("room", samples::room(), Region { shape: inside, up: DVec3::Z, floor: None, clearance: 0.15 }),
    ] {
        let (proxy, scene) = scene(&context, &surface, &region);
        let scorer = Scorer::new(&context, &scene, &proxy.sample(300, 2, 1)).expect("a scorer");
        let back = scene.geometry.to_internal.inverse();
        let cameras: Vec<Camera> = (0..60)
            .map(|i| {
                let [u, v, ..] = random::uniforms(4, 0, i);
                let position = back.point(scene.geometry.free.sample(4, 1, i));
                let around = random::direction(u, v);
                // Around the object: inward, a little off. In the room: anywhere.
                let direction = if name == "object" { 0.3 * around - position } else { around };
                camera(Pose::looking(position, direction, DVec3::Z))
            })
            .collect();
        for field in [Field::Cone, Field::Frustum] {
            let device = scorer.score(&cameras, field).expect("scores");
            let twin = twin(&scorer, &scene, &cameras, field);
            let close = |a: f32, b: f32, slack: f32| (a - b).abs() <= slack;
            let same = |(a, b): &(&PointMetrics, &PointMetrics)| {
                a.views == b.views
                    && close(a.reachable, b.reachable, 1e-4)
                    && close(a.gap, b.gap, 1e-3)
                    && close(a.voronoi_mean, b.voronoi_mean, 1e-4)
                    && close(a.voronoi_deviation, b.voronoi_deviation, 1e-4)
                    && close(a.triangulation, b.triangulation, 1e-3)
                    && close(a.sampling_distance, b.sampling_distance, 1e-5 * b.sampling_distance)
            };
            let off: Vec<_> = device.iter().zip(&twin).filter(|pair| !same(pair)).collect();
            assert!(100 * off.len() <= twin.len(), "{name}, {field:?}: {} differ, {:?}", off.len(), off[0]);
            let seen = twin.iter().filter(|point| point.views > 1).count();
            assert!(3 * seen > twin.len(), "{name}, {field:?}: {seen} points seen twice test little");
        }
    }
    silent(&context);
}

/// The numbers of one point on a plane are known; were they off, device and twin would share the mistake. The plane is
/// tilted, so that no row of texels lies along its horizon.
#[test]
fn a_point_on_a_plane_gets_what_geometry_says() {
    let context = context();
    let tilt = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -0.7, 0.3);
    let Surface::Mesh(mut mesh) = samples::plane(0.8, 4) else { unreachable!("a mesh") };
    mesh.positions.iter_mut().for_each(|p| *p = tilt * *p);
    let shape = Shape::Shell { centre: DVec3::ZERO, r_min: 1.0, r_max: 1.5 };
    let region = Region { shape, up: DVec3::Z, floor: None, clearance: 0.02 };
    let (_, scene) = scene(&context, &Surface::Mesh(mesh), &region);
    let normal = tilt * DVec3::Z;
    let point = SurfacePoint {
        position: DVec3::ZERO,
        normal,
        radius: 0.1,
        lift: 1e-4,
        colour: [128; 3],
        score: 1.0,
        either_side: false,
    };
    let scorer = Scorer::new(&context, &scene, &[point]).expect("a scorer");
    // A camera at `distance` from the point and `off` radians from the normal, that looks at it or elsewhere.
    let standing = |off: f64, distance: f64, target: DVec3| {
        let position = tilt * (distance * DVec3::new(off.sin(), 0.0, off.cos()));
        camera(Pose::looking(position, tilt * target - position, DVec3::Z))
    };
    let close = |a: f32, b: f64, slack: f64, what: &str| {
        assert!((f64::from(a) - b).abs() <= slack, "{what}: {a}, not {b}");
    };
    let above = || standing(0.0, 1.2, DVec3::ZERO);
    let focal = above().intrinsics.focal[0];
    let score = |cameras: &[Camera], field: Field| {
        let device = scorer.score(cameras, field).expect("scores")[0];
        let twin = twin(&scorer, &scene, cameras, field)[0];
        assert_eq!((device.views, device.reachable > 0.0), (twin.views, twin.reachable > 0.0));
        close(device.gap, f64::from(twin.gap), 1e-3, "the twin's gap");
        close(device.triangulation, f64::from(twin.triangulation), 1e-3, "the twin's triangulation");
        // The region takes the hemisphere above the plane, to the width of a texel's worth of horizon.
        close(device.reachable, TAU, 0.02 * TAU, "solid angle of the hemisphere");
        device
    };

    for field in [Field::Cone, Field::Frustum] {
        let none = score(&[], field);
        assert_eq!((none.views, none.triangulation, none.sampling_distance, none.voronoi_mean), (0, 0.0, 0.0, 0.0));
        close(none.gap, PI, 1e-4, "the gap of a point that nothing sees");

        // The mean angle from uniform directions of a hemisphere to its pole: the integral of t sin t up to pi/2, 1.
        let one = score(&[above()], field);
        assert_eq!((one.views, one.triangulation), (1, 0.0));
        close(one.voronoi_deviation, 0.0, 1e-6, "the deviation of a single cell");
        close(one.gap, 1.0, 0.02, "the gap of a view from above");
        close(one.voronoi_mean, f64::from(one.reachable), 1e-4, "the cell of a single view");
        close(one.sampling_distance, 1.2 / focal, 2e-4 / focal, "the sampling distance");

        // Behind the plane, looking away, looking past by 40 degrees: the point is not seen. Nearer and 50 degrees off:
        // seen, and finer.
        let away = DVec3::new(0.0, 0.0, 9.0);
        let past = DVec3::new(1.2 * 40f64.to_radians().tan(), 0.0, 0.0);
        let cameras = [
            above(),
            standing(PI, 1.2, DVec3::ZERO),
            standing(0.3, 1.2, away),
            standing(0.0, 1.2, past),
            standing(50f64.to_radians(), 1.1, DVec3::ZERO),
            standing(-20f64.to_radians(), 1.4, DVec3::ZERO),
        ];
        let three = score(&cameras, field);
        assert_eq!(three.views, 3);
        close(three.triangulation, 70f64.to_radians(), 1e-3, "the widest angle");
        close(three.sampling_distance, 1.1 / focal, 2e-4 / focal, "the finest sampling distance");
        close(three.voronoi_mean, f64::from(three.reachable) / 3.0, 1e-4, "the mean cell");
        assert!(three.voronoi_deviation > 0.0 && three.gap < one.gap);
    }

    // Two views mirrored about the normal share the hemisphere evenly. The nearest of them is 90 degrees off at most.
    let pair = score(&[standing(0.8, 1.2, DVec3::ZERO), standing(-0.8, 1.2, DVec3::ZERO)], Field::Cone);
    close(pair.voronoi_mean, 0.5 * f64::from(pair.reachable), 1e-4, "half of the hemisphere");
    assert!(f64::from(pair.voronoi_deviation) < 0.02 * TAU && f64::from(pair.gap) < FRAC_PI_2);

    // 30 degrees off its axis along the image's diagonal a point is in the image (half diagonal 35.8 degrees) but not in the
    // cone inscribed in it (23.4 degrees).
    let position = tilt * DVec3::new(0.0, 0.0, 1.2);
    let straight = Pose::looking(position, -position, DVec3::Z);
    let corner = (straight.rotation * DVec3::new(0.8, 0.6, 0.0)).normalize();
    let axis = corner.cross(straight.forward());
    let turned = Pose { rotation: DQuat::from_axis_angle(axis, 30f64.to_radians()) * straight.rotation, ..straight };
    assert_eq!(score(&[camera(turned)], Field::Cone).views, 0);
    assert_eq!(score(&[camera(turned)], Field::Frustum).views, 1);
    silent(&context);
}

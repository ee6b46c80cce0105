//! Expected quality on the device against its twin, and against what is known by hand.

mod planner_support;

use camsplat::quality::expected::{Judge, LOOKS, expect};
use camsplat::quality::law::Law;
use camsplat::quality::viewers::Viewers;
use camsplat::scene::baselines;
use camsplat::scene::camera::Camera;
use planner_support::{Scene, context, intrinsics, object, room, silent};

fn cameras(scene: &Scene, count: usize, inward: bool) -> Vec<Camera> {
    let back = scene.device.geometry.to_internal.inverse();
    let poses = baselines::random(&scene.device.geometry.free, count, 5, inward);
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
        let (law, radius) = (Law::embedded(), scene.proxy.sphere.1);
        let judge = Judge::new(&context, &scene.device, radius, viewers.clone(), &law, 9).expect("a judge");
        for count in [1, 7, 40] {
            let cameras = cameras(&scene, count, inward);
            let found = judge.expect(&cameras).expect("an expectation");
            let (looks, twin) = expect(geometry, radius, &viewers, &cameras, &law, 9);
            let drawn = judge.looks().expect("looks");
            let moved = drawn.iter().zip(&looks).filter(|(a, b)| {
                let apart = |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max);
                apart(a.position, b.position).max(apart(a.direction, b.direction)) > 1e-3
            });
            let moved = moved.count();
            assert!(moved * 100 <= 2 * looks.len(), "{name}: {moved} of {} looks differ", looks.len());
            assert!(looks.iter().filter(|look| look.distance > 0.0).count() > 20 * LOOKS as usize, "{name}: too few looks");
            assert!((found.error_db - twin.error_db).abs() < 0.02, "{name}, {count}: {} of {}", found.error_db, twin.error_db);
            assert!((found.unseen - twin.unseen).abs() < 0.01, "{name}, {count}: {} of {}", found.unseen, twin.unseen);
            assert!(count == 1 || twin.unseen < 0.9, "{name}, {count}: nothing to compare");
        }
    }
    silent(&context);
}

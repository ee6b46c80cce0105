//! Choosing from a pool: the device against the twin, swaps against brute force, and the request against the result.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::support::device::{context, silent};
use camsplat::Error;
use camsplat::engine::vulkan::Context;
use camsplat::files::photos::{Photo, PhotoSet};
use camsplat::planner::methods::Method;
use camsplat::planner::plan::config::Preset;
use camsplat::planner::plan::target::{RegionChoice, Target};
use camsplat::planner::quality::expected::{Judge, expect};
use camsplat::planner::quality::law::Law;
use camsplat::planner::quality::look::Surroundings;
use camsplat::planner::quality::viewers::Viewers;
use camsplat::planner::select::farthest::Distance;
use camsplat::planner::select::interchange::refine;
use camsplat::planner::select::objective::{Objective, Scratch};
use camsplat::planner::select::pool::Pool;
use camsplat::planner::select::request::SelectionRequest;
use camsplat::planner::select::selection::SelectionContext;
use camsplat::planner::select::sight::{Survey, framed, sight};
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::lens::Distortion;
use camsplat::scene::random;
use camsplat::scene::region::Shape;
use camsplat::scene::samples;
use camsplat::visibility::device_scene::DeviceScene;
use glam::DVec3;

/// Photos on rings around the sample object, that look past it a little, through a lens with barrel distortion.
fn pool(count: u32, seed: u64) -> PhotoSet {
    let photo = |i: u32| {
        let [u, v, w, x] = random::uniforms(seed, 77, i);
        let (sin, cos) = (std::f64::consts::TAU * u).sin_cos();
        let position = (1.3 + 0.4 * v) * DVec3::new(cos, sin, 1.4 * w - 0.3).normalize();
        let aim = 0.3 * DVec3::new(x - 0.5, v - 0.5, u - 0.5);
        // Every third has a wider lens and a larger picture.
        let (width, height, fov) = if i % 3 == 2 { (900, 600, 65f64) } else { (640, 480, 45.0) };
        let intrinsics = Intrinsics::from_fov(width, height, fov.to_radians());
        let radial = [-0.1, 0.01, 0.0, 0.0, 0.0, 0.0];
        Photo {
            camera: Camera {
                name: format!("{i:03}.jpg"),
                pose: Pose::looking(position, aim - position, DVec3::Z),
                intrinsics,
            },
            distortion: Distortion { radial, tangential: [1e-3, -1e-3], ..Distortion::default() },
            image: None,
            mask: None,
        }
    };
    PhotoSet { photos: (0..count).map(photo).collect(), ..PhotoSet::default() }
}

fn target() -> Target {
    let shape = Shape::Shell { centre: DVec3::ZERO, r_min: 1.2, r_max: 1.8 };
    let choice = RegionChoice { shape: Some(shape), floor: None, clearance: Some(0.05), stood: None };
    let intrinsics = Intrinsics::from_fov(640, 480, 45f64.to_radians());
    Target::new(&samples::object(), "object", Preset::Object, &choice, DVec3::Z, &intrinsics).expect("a good target")
}

fn device_scene(context: &Arc<Context>) -> DeviceScene {
    let target = target();
    let geometry = target.geometry().expect("a good region");
    DeviceScene::new(context, geometry).expect("room for it")
}

/// What `viewers` viewers around the object look at, and what the pool shows of it.
fn objective(context: &Arc<Context>, set: &PhotoSet, viewers: u32, seed: u64) -> Objective {
    let (scene, law) = (device_scene(context), Law::embedded(true));
    let intrinsics = set.photos[0].camera.intrinsics;
    let viewers = Viewers::Region.sample(&scene.geometry, intrinsics, true, seed, viewers).expect("viewers");
    let around = Surroundings::new(&scene.geometry, target().proxy.sphere, true, &law);
    let judge = Judge::new(context, &scene, around, viewers, &law, seed).expect("a judge");
    let looks = judge.looks().expect("looks");
    Objective::new(context, &scene, &set.photos, looks, judge.viewers().len(), law).expect("an objective")
}

fn survey(context: &Arc<Context>, set: &PhotoSet, points: usize) -> Survey {
    let target = target();
    let geometry = target.geometry().expect("a good region");
    let scene = DeviceScene::new(context, geometry).expect("room for it");
    Survey::new(context, &scene, &set.photos, target.proxy.sample(points, 3, 0)).expect("a survey")
}

/// Every choice depends on visibility. A ray along the very rim of a triangle may fall on either side: one bit
/// in two thousand may differ.
#[test]
fn the_device_sees_what_the_twin_sees() {
    let context = context();
    for photos in [5, 64, 131] {
        let set = pool(photos, 1);
        let target = target();
        let geometry = target.geometry().expect("a good region");
        let scene = DeviceScene::new(&context, geometry).expect("room for it");
        let points = target.proxy.sample(400, 3, 0);
        let twin = sight(&scene.geometry, &set.photos, &points);
        let survey = Survey::new(&context, &scene, &set.photos, points).expect("a survey");
        let device = &survey.sight;
        assert_eq!((device.photos, device.words, device.bits.len()), (twin.photos, twin.words, twin.bits.len()));
        let differ: u32 = device.bits.iter().zip(&twin.bits).map(|(a, b)| (a ^ b).count_ones()).sum();
        let seen: u32 = twin.bits.iter().map(|word| word.count_ones()).sum();
        assert!(2000 * differ <= 400 * photos, "{differ} of {} differ", 400 * photos);
        assert!(10 * seen > 400 * photos && 10 * seen < 9 * 400 * photos, "{seen} seen: the test tests little");
        let listed: usize = device.by_photo().iter().map(Vec::len).sum();
        assert!(listed.abs_diff(seen as usize) <= differ as usize);
    }
    silent(&context);
}

/// What a barrel lens draws into the image from beyond the pinhole's edge is seen, and what a pincushion pushes out is not: if
/// this failed, photos would be chosen for points that they do not show.
#[test]
fn the_image_ends_where_the_lens_puts_its_edge() {
    let intrinsics = Intrinsics { width: 200, height: 100, focal: [100.0; 2], principal: [100.0, 50.0] };
    let seen = |k: f64, x: f64| {
        let pose = Pose::looking(DVec3::ZERO, DVec3::Z, DVec3::Y);
        let camera = Camera { name: "a".into(), pose, intrinsics };
        let distortion = Distortion { radial: [k, 0.0, 0.0, 0.0, 0.0, 0.0], ..Distortion::default() };
        let photo = Photo { camera, distortion, image: None, mask: None };
        let position = pose.position + pose.rotation * DVec3::new(x, 0.0, 1.0);
        framed(&[photo], &[position]).sees(0, 0)
    };
    assert!(seen(0.0, 0.99) && !seen(0.0, 1.05));
    assert!(seen(-0.1, 1.05));
    assert!(!seen(0.1, 0.99));
}

/// If this failed, the greedy baseline would be another than the one it is named after, and planners be compared with less than it is.
#[test]
fn a_greedy_choice_takes_what_lowers_the_cost_most() {
    let context = context();
    let set = pool(40, 2);
    let objective = objective(&context, &set, 30, 5);
    let free: Vec<usize> = (0..40).filter(|photo| *photo != 3).collect();
    let grown = objective.grown(&[3], &free, 12, &mut || ControlFlow::Continue(())).expect("a choice");
    assert_eq!((grown.len(), grown[0]), (12, 3));
    for picked in 1..12 {
        let cost = |photo: usize| objective.choose(&[&grown[..picked], &[photo]].concat()).cost();
        let left = free.iter().filter(|photo| !grown[..picked].contains(photo));
        let best = left.map(|photo| cost(*photo)).fold(f64::INFINITY, f64::min);
        assert!(cost(grown[picked]) < best + 1e-9, "pick {picked}: {} in place of {best}", cost(grown[picked]));
    }
    let stopped = objective.grown(&[3], &free, 12, &mut || ControlFlow::Break(()));
    assert!(matches!(stopped, Err(Error::Interrupted)));
    silent(&context);
}

/// All subsets of so many of `n`.
fn subsets(n: usize, count: usize) -> Vec<Vec<usize>> {
    (0u32..1 << n)
        .filter(|bits| bits.count_ones() as usize == count)
        .map(|bits| (0..n).filter(|i| bits >> i & 1 == 1).collect())
        .collect()
}

/// A swap's change is added up from parts that were kept; were one wrong, photos would be swapped for worse ones.
#[test]
fn a_swap_changes_the_cost_as_foretold_and_no_swap_is_better() {
    let context = context();
    for seed in 0..3 {
        let set = pool(14, seed);
        let blur: Vec<f64> = (0..14).map(|i| 0.01 * f64::from(i % 5)).collect();
        let objective = objective(&context, &set, 12, seed).with_prices(blur);
        let start = [1, 4, 6, 9, 11];
        let choice = objective.choose(&start);
        let mut scratch = Scratch::new(5);
        for photo in [0, 2, 3, 13] {
            let swap = choice.best_swap(photo, &[false; 5], &mut scratch);
            let mut best = (f64::INFINITY, 0);
            for slot in 0..5 {
                let mut other = objective.choose(&start);
                other.replace(slot, photo);
                let change = other.cost() - choice.cost();
                if change < best.0 {
                    best = (change, slot);
                }
                // From scratch, too.
                let mut fresh = start;
                fresh[slot] = photo;
                assert!((objective.choose(&fresh).cost() - other.cost()).abs() < 1e-9);
            }
            assert_eq!(swap.slot, best.1, "photo {photo}");
            assert!((swap.change - best.0).abs() < 1e-6, "photo {photo}: {} foretold, {} come", swap.change, best.0);
        }
        for (slot, loss) in choice.losses().into_iter().enumerate() {
            let mut rest = start.to_vec();
            rest.remove(slot);
            let rise = objective.choose(&rest).cost() - choice.cost();
            assert!((loss - rise).abs() < 1e-6, "slot {slot}: {loss} foretold, {rise} come");
        }
    }
}

/// Swaps must lower what plans and scores are judged by, not something of their own: through plain lenses it is the same number.
#[test]
fn the_cost_is_the_expected_error() {
    let context = context();
    let mut set = pool(30, 2);
    set.photos.iter_mut().for_each(|photo| photo.distortion = Distortion::default());
    let (scene, law) = (device_scene(&context), Law::embedded(true));
    let intrinsics = set.photos[0].camera.intrinsics;
    let viewers = Viewers::Region.sample(&scene.geometry, intrinsics, true, 4, 24).expect("viewers");
    let around = Surroundings::new(&scene.geometry, target().proxy.sphere, true, &law);
    let objective = objective(&context, &set, 24, 4);
    for subset in [vec![0], vec![3, 9, 11, 20], (0..30).collect()] {
        let cameras: Vec<Camera> = subset.iter().map(|photo| set.photos[*photo].camera.clone()).collect();
        let (_, expected) = expect(&scene.geometry, around, &viewers, &cameras, &law, 4);
        let cost = objective.choose(&subset).cost();
        // A ray along the rim of a triangle may fall on either side.
        assert!((cost - expected.error_db).abs() < 0.02, "{subset:?}: {cost}, but {} is expected", expected.error_db);
    }
    silent(&context);
}

/// The best subset of a tiny pool is known by trying all: swaps from either start must come to it, or within a twentieth of a decibel, and
/// never be worse than where they began.
#[test]
fn swaps_find_the_best_subset_of_a_tiny_pool() {
    let context = context();
    for seed in 0..4 {
        let set = pool(12, seed);
        let objective = objective(&context, &set, 12, seed);
        let cost = |subset: &[usize]| objective.choose(subset).cost();
        let best = subsets(12, 4).iter().map(|subset| cost(subset)).fold(f64::INFINITY, f64::min);
        let everything: Vec<usize> = (0..12).collect();
        let mut ends = Vec::new();
        for start in [[0, 1, 2, 3], [8, 9, 10, 11]] {
            let mut choice = objective.choose(&start);
            let costs = refine(&mut choice, &everything, &[false; 4]);
            assert!(costs.is_sorted_by(|a, b| a > b), "a swap made it worse: {costs:?}");
            assert!((choice.cost() - cost(choice.chosen())).abs() < 1e-9);
            ends.push(choice.cost());
        }
        let end = ends.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(end < best + 0.05, "seed {seed}: {end}, where {best} can be had");
    }
}

/// What the user rules in or out must be in or out, whatever the method; no photo twice, and as many as requested.
#[test]
fn must_and_never_hold_for_every_method() {
    let context = context();
    let set = pool(30, 5);
    let target = target();
    for method in Method::BASELINES.into_iter().chain([Method::Ours, Method::Acp]) {
        let request = SelectionRequest {
            method,
            include: vec![3, 17],
            exclude: vec![0, 5, 29],
            points: 150,
            ..SelectionRequest::new(8)
        };
        let selector = SelectionContext::new(&context, &set, &target, request).expect("a pool");
        let selection = selector.select(None, false).expect("a selection");
        let photos: Vec<usize> = selection.chosen.iter().map(|chosen| chosen.photo).collect();
        assert!(photos.is_sorted_by(|a, b| a < b), "{method:?}: {photos:?}");
        // The paper's nearest photo may be nearest to two.
        assert!(photos.len() == 8 || method == Method::Nearest && photos.len() <= 8, "{method:?}: {photos:?}");
        assert!([3, 17].iter().all(|photo| photos.contains(photo)), "{method:?}: {photos:?}");
        assert!(![0, 5, 29].iter().any(|photo| photos.contains(photo)), "{method:?}: {photos:?}");
    }
    silent(&context);
}

/// By the looks that the choice is made for, no baseline may be better by what is minimised: else the search has failed.
#[test]
fn no_control_is_better_by_the_objective() {
    let context = context();
    let set = pool(60, 8);
    let target = target();
    let survey = survey(&context, &set, 300);
    let objective = objective(&context, &set, 40, 8);
    let everything: Vec<usize> = (0..60).collect();
    let pool = Pool {
        set: &set,
        region: &target.region,
        sight: &survey.sight,
        include: &[],
        allowed: &everything,
        count: 10,
        seed: 4,
    };
    let mut choice = objective.choose(&pool.random());
    refine(&mut choice, &everything, &[false; 10]);
    let farthest = [Distance::GreatCircle, Distance::Chord, Distance::Shared].map(|d| pool.farthest(d));
    for baseline in farthest.into_iter().chain([pool.random(), pool.coverage()]) {
        assert_eq!(baseline.len(), 10);
        assert!(choice.cost() <= objective.choose(&baseline).cost());
    }
}

/// The same request must give the same bits.
#[test]
fn the_same_request_gives_the_same_choice() {
    let context = context();
    let set = pool(60, 6);
    let target = target();
    let select = || {
        let request = SelectionRequest { points: 300, ..SelectionRequest::new(10) };
        SelectionContext::new(&context, &set, &target, request)
            .expect("a pool")
            .select(None, true)
            .expect("a selection")
    };
    let (a, b) = (select(), select());
    assert_eq!((&a.chosen, &a.scores, &a.metrics, &a.baselines), (&b.chosen, &b.scores, &b.metrics, &b.baselines));
    silent(&context);
}

/// Of two photos from the same place the sharper one must be taken, where the user requests it.
#[test]
fn of_two_photos_alike_the_sharper_is_taken() {
    let context = context();
    let mut set = pool(60, 6);
    for i in 0..30 {
        let Camera { pose, intrinsics, .. } = set.photos[2 * i].camera;
        let alike = &mut set.photos[2 * i + 1].camera;
        (alike.pose, alike.intrinsics) = (pose, intrinsics);
    }
    let target = target();
    let request = SelectionRequest { points: 300, ..SelectionRequest::new(10) };
    let selector = SelectionContext::new(&context, &set, &target, request).expect("a pool");
    let sharpness: Vec<f64> = (0..60).map(|i| if i % 2 == 0 { 80.0 } else { 300.0 + f64::from(i % 3) }).collect();
    let odd = |sharpness: Option<&[f64]>| {
        let selection = selector.select(sharpness, false).expect("a selection");
        selection.chosen.iter().filter(|chosen| chosen.photo % 2 == 1).count()
    };
    assert!(odd(None) < 10, "the sharper ones are taken anyway: this tests nothing");
    assert_eq!(odd(Some(&sharpness)), 10);
}

/// Suggested poses must go where the choice leaves most to see, the most useful first, and state correctly what they would gain.
#[test]
fn suggested_poses_are_worth_adding() {
    let context = context();
    // All photos from one side.
    let mut set = pool(40, 7);
    set = PhotoSet { photos: set.photos.drain(..).filter(|p| p.camera.pose.position.x > 0.3).collect(), ..set };
    let target = target();
    let request = SelectionRequest { points: 300, ..SelectionRequest::new(6) };
    let selector = SelectionContext::new(&context, &set, &target, request).expect("a pool");
    let selection = selector.select(None, false).expect("a selection");
    let suggested = selector.suggest(&selection.chosen, 6).expect("suggestions");
    assert_eq!(suggested.len(), 6);
    let across = suggested.iter().filter(|one| one.camera.pose.position.x < 0.0).count();
    assert!(across >= 4, "only {across} of 6 go to the side that no photo shows");
    assert!(suggested.is_sorted_by(|a, b| a.gain_db >= b.gain_db), "{suggested:?}");
    let [best, .., last] = &suggested[..] else { panic!("there are six") };
    assert!(best.gain_db > 0.3 && last.gain_db > -0.05, "{} and {} dB", best.gain_db, last.gain_db);
}

/// What is chosen must not be worse than a simple choice in the eyes of viewers that the swaps were not made for.
#[test]
fn a_choice_is_never_worse_than_a_simple_one() {
    let context = context();
    let target = target();
    for seed in 0..4 {
        let set = pool(50, 20 + seed);
        let request = SelectionRequest { points: 200, seed, ..SelectionRequest::new([4, 7, 12, 20][seed as usize]) };
        let selector = SelectionContext::new(&context, &set, &target, request).expect("a pool");
        let selection = selector.select(None, false).expect("a selection");
        assert!(selection.expected.db >= 0.0, "seed {seed}: {:?}", selection.expected);
        assert_eq!(selection.errors_db.first(), Some(&0.0));
    }
}

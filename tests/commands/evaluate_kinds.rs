//! `camsplat evaluate` in rooms and of pools of photos: what it makes, what it holds back, and what it refuses.

use std::collections::HashSet;
use std::fs;

use crate::support::command::gltf::{cube, sky};
use crate::support::command::{Place, assert_refused};
use camsplat::files::io::photos::{self, ReadOptions};
use camsplat::lab::path_tracer::outputs::Record;
use camsplat::planner::plan::record::PlanRecord;
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::splats::config::Background;
use camsplat::splats::run::record::TrainRecord;
use glam::DVec3;
use serde_json::Value;

/// A place with `room.gltf`, a cube of side 2 whose walls glow, seen from both sides.
fn room() -> Place {
    let place = Place::new();
    let material = r#"{"doubleSided": true, "emissiveFactor": [0.4, 0.3, 0.1],
                       "pbrMetallicRoughness": {"baseColorFactor": [0.3, 0.5, 0.5, 1], "metallicFactor": 0}}"#;
    place.write("room.gltf", cube(&format!(", \"materials\": [{material}]")));
    place
}

/// A place with `photos`, a capture of a cube from 20 sides.
fn pool() -> Place {
    let place = Place::new();
    let material = r#"{"pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.4, 0.1, 1], "metallicFactor": 0}}"#;
    place.write("cube.gltf", cube(&format!(", \"materials\": [{material}]")));
    place.write("sky.hdr", sky());
    let camera = |i: usize| {
        let (height, turn) = (0.9 - 0.09 * (i as f64 + 0.5), 2.4 * i as f64);
        let out = DVec3::new(turn.cos(), height, turn.sin()).normalize();
        let pose = Pose::looking(5.0 * out, -out, DVec3::Y);
        Camera { name: format!("photo_{i:02}"), pose, intrinsics: Intrinsics::from_fov(48, 48, 0.8) }
    };
    let cameras: Vec<Camera> = (0..20).map(camera).collect();
    place.write("cameras.json", serde_json::json!({ "cameras": cameras }).to_string());
    place.done("capture cube.gltf cameras.json --out photos --env sky.hdr --spp 2");
    place
}

const TINY_ROOM: &str = "evaluate room.gltf --preset room --quick --methods random,fvs,ours --budgets 4 --seeds 1 --size 32 \
                         --spp 2 --test-spp 4 --inputs 16 --tests 3 --iterations 20 --max-splats 200";
const TINY_POOL: &str = "evaluate --pool photos --quick --methods random,coverage,fisherrf,ours --budgets 5 --seeds 1 --shrink 2 \
                         --inputs 6 --iterations 20 --max-splats 200";

/// Files of this name below a folder.
fn named<T: serde::de::DeserializeOwned>(place: &Place, folder: &str, name: &str) -> Vec<T> {
    let files = place.files(folder).into_iter().filter(|file| file.ends_with(name));
    files.map(|file| serde_json::from_str(&place.read(&format!("{folder}/{file}"))).unwrap()).collect()
}

/// If this failed, a room would be photographed from outside or from within its walls, without what lies behind its windows, or
/// its table would have columns of objects.
#[test]
fn a_room_is_evaluated_from_inside() {
    let place = room();
    place.done(&format!("{TINY_ROOM} --out o"));
    let table = place.read("o/table.md");
    assert!(table.contains("| scene | method | views | random | choice, s |"), "{table}");
    assert!(table.contains("| room | ours | 4 |") && table.contains("--surface true"), "{table}");
    assert!(table.contains("with 2 samples, 3 test views a set with 4 samples"), "{table}");
    let plans: Vec<PlanRecord> = named(&place, "o/room", "plan.json");
    assert_eq!(plans.len(), 3);
    let captures: Vec<String> =
        place.files("o/room").into_iter().filter(|file| file.ends_with("transforms.json")).collect();
    // Inputs, tests and three choices.
    assert_eq!(captures.len(), 5);
    let records: Vec<Record> = named(&place, "o/room", "capture.json");
    let of_tests = |record: &&Record| record.cameras[0].name.starts_with("random_");
    assert_eq!(records.iter().filter(of_tests).map(|record| record.samples).collect::<Vec<_>>(), [4]);
    assert!(records.iter().filter(|record| !of_tests(record)).all(|record| record.samples == 2));
    for capture in captures {
        let folder = capture.trim_end_matches("/transforms.json");
        let set = photos::read(&place.path(&format!("o/room/{folder}")), &ReadOptions::default()).unwrap();
        for photo in set.photos {
            let place = photo.camera.pose.position;
            assert!(place.abs().max_element() < 0.93, "{} stands at {place}", photo.camera.name);
            let picture = image::open(photo.image.unwrap()).unwrap();
            assert!(photo.mask.is_none() && !picture.color().has_alpha());
            let black = picture.to_rgb8().pixels().filter(|pixel| pixel.0 == [0; 3]).count();
            assert_eq!(black, 0, "{} shows what is no wall", photo.camera.name);
        }
    }
    let trained: Vec<TrainRecord> = named(&place, "o/room", "train.json");
    assert_eq!(trained.len(), 3);
    assert!(trained.iter().all(|record| record.config.background == Background::Black));
    let page = place.read("o/report.html");
    assert!(page.contains("/reference/random_0000.png") && !page.contains("<th>half"), "{page}");
    let again = place.done(&format!("{TINY_ROOM} --out o"));
    assert!(again.out.contains("results  0 made"), "{}", again.out);
}

/// If this failed, cameras or tests would be inside what surrounds a room, whose mesh does not define where it ends.
#[test]
fn a_box_holds_the_cameras_of_a_room_and_its_tests() {
    let place = room();
    let tiny = TINY_ROOM.replace("--preset room ", "--light traced ").replace("random,fvs,ours", "random,ours");
    let places = |out: &str| -> Vec<DVec3> {
        let records: Vec<Record> = named(&place, &format!("{out}/room"), "capture.json");
        records.iter().flat_map(|record| &record.cameras).map(|camera| camera.pose.position).collect()
    };
    // The walls are at 1; free space is resolved to a voxel.
    place.done(&format!("{tiny} --box -0.4,-0.5,0.1,0.4,0.6,0.95 --clearance 0.2 --out o"));
    let table = place.read("o/table.md");
    let described = "in the box from [-0.4, -0.5, 0.1] to [0.4, 0.6, 0.95], no camera nearer to things than 0.2";
    assert!(table.contains(described), "{table}");
    let first = places("o");
    assert_eq!(first.len(), 16 + 3 + 2 * 4);
    for place in first {
        let within = place.cmpge(DVec3::new(-0.401, -0.501, 0.099)) & place.cmple(DVec3::new(0.401, 0.601, 0.84));
        assert!(within.all(), "a camera stands at {place}");
    }
    // Of another box nothing is taken over.
    let other = place.done(&format!("{tiny} --box -0.4,-0.5,-0.7,0.4,0.6,-0.1 --out o"));
    assert!(other.out.contains(", 0 reused"), "{}", other.out);
    assert_eq!(places("o").iter().filter(|place| place.z < 0.0).count(), 16 + 3 + 2 * 4);
}

/// If this failed, one test that shows a lamp alone, and comes out as it is, would make the score of all of them infinite.
#[test]
fn tests_of_one_colour_are_left_out() {
    let place = Place::new();
    // Five walls too bright for a picture, and one that they light.
    let materials = r#", "materials": [{"doubleSided": true, "emissiveFactor": [1, 1, 1],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 50}}},
        {"doubleSided": true, "pbrMetallicRoughness": {"baseColorFactor": [0.01, 0.005, 0.003, 1], "metallicFactor": 0}}]"#;
    let whole = r#""indices": 1, "material": 0}"#;
    let [walls, wall] = [(30, 0), (6, 60)].map(|(count, at)| {
        format!(r#"{{"bufferView": 1, "byteOffset": {at}, "componentType": 5123, "count": {count}, "type": "SCALAR"}}"#)
    });
    let all = r#"{"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"}"#;
    let room = cube(materials)
        .replace(whole, &format!(r#"{whole}, {{"attributes": {{"POSITION": 0}}, "indices": 2, "material": 1}}"#))
        .replace(all, &format!("{walls}, {wall}"));
    place.write("room.gltf", room);
    let tiny = TINY_ROOM.replace("random,fvs,ours", "random").replace("--tests 3", "--tests 12");
    // Without grain the wall is of one colour too.
    let ran = place.done(&format!("{tiny} --light traced --out o"));
    let [record]: [TrainRecord; 1] = named(&place, "o/room", "train.json").try_into().unwrap();
    let left = record.test_views.len();
    assert!((1..12).contains(&left), "{left}");
    assert!(ran.out.contains(&format!("{} of 12 test views are of one colour", 12 - left)), "{}", ran.out);
    for view in &record.test_views {
        assert!(view.quality.psnr.is_finite(), "{}", view.name);
    }
}

/// If this failed, an evaluation in the dark would train for hours and score nothing.
#[test]
fn a_room_without_light_is_refused_when_it_is_seen() {
    let place = Place::new();
    place.write("room.gltf", cube(r#", "materials": [{"doubleSided": true}]"#));
    place.write("sky.hdr", sky());
    let ran = place.run(&format!("{} --env sky.hdr --out o", TINY_ROOM.replace("random,fvs,ours", "random")));
    assert_eq!(ran.code, Some(2), "{}{}", ran.out, ran.err);
    assert!(ran.out.contains("3 of 3 photographs are black"), "{}", ran.out);
    assert!(ran.err.contains("room.gltf") && ran.err.contains("--box") && ran.err.lines().count() == 1, "{}", ran.err);
}

/// If this failed, a user would learn late, or never, that photos of a smooth room give no surface.
#[test]
fn a_room_without_a_surface_from_photos_offers_its_own() {
    let place = room();
    let ran = place.run(&format!("{TINY_ROOM} --surface proxy --out o"));
    assert_eq!(ran.code, Some(2), "{}{}", ran.out, ran.err);
    assert!(ran.err.contains("room.gltf") && ran.err.contains("--surface true"), "{}", ran.err);
    assert_eq!(ran.err.lines().count(), 1, "{}", ran.err);
}

/// If this failed, a method could choose photos that it is scored by, or train on photos that it did not choose.
#[test]
fn every_eighth_photo_of_a_pool_is_held_out() {
    let place = pool();
    let ran = place.done(&format!("{TINY_POOL} --out o"));
    assert!(ran.out.contains("3 photos held out, 17 to choose from"), "{}", ran.out);
    let table = place.read("o/table.md");
    assert!(table.contains("| scene | method | views | held-out | choice, s |"), "{table}");
    for method in ["random", "coverage", "fisherrf", "ours"] {
        assert!(table.contains(&format!("| photos | {method} | 5 |")), "{table}");
    }
    let held_out = ["photo_00.png", "photo_08.png", "photo_16.png"];
    let choices: Vec<Value> = named(&place, "o/photos", "chosen.json");
    assert_eq!(choices.len(), 4);
    for choice in &choices {
        let photos: HashSet<&str> = choice["photos"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
        assert_eq!(photos.len(), 5);
        assert!(held_out.iter().all(|name| !photos.contains(name)), "{photos:?}");
    }
    let records: Vec<TrainRecord> = named(&place, "o/photos", "train.json");
    let tested: Vec<_> = records.iter().filter(|record| !record.test_views.is_empty()).collect();
    assert!(tested.len() < records.len(), "the model to choose by is tested on nothing");
    for record in tested {
        assert_eq!((record.photos.train, record.photos.test, record.photos.shrink), (5, 3, 2));
        assert!(record.test_views.iter().all(|view| held_out.contains(&view.name.as_str())));
    }
    assert!(place.read("o/report.html").contains("/reference/photo_00.png"));
    let again = place.done(&format!("{TINY_POOL} --out o"));
    assert!(again.out.contains("results  0 made"), "{}", again.out);

    // Other photos under the same names are another pool.
    let [one, other] = ["photo_01", "photo_02"].map(|name| place.path(&format!("photos/images/{name}.png")));
    fs::copy(one, other).unwrap();
    let changed = place.done(&format!("{TINY_POOL} --out o"));
    // Methods that choose the same photos share a training; of those before nothing is left.
    let made = |out: &str| -> HashSet<String> {
        let keys = out.lines().filter_map(|line| line.strip_prefix("making"));
        keys.filter_map(|line| line.split_whitespace().next().map(str::to_owned)).collect()
    };
    let (before, after) = (made(&ran.out), made(&changed.out));
    assert!(before.is_disjoint(&after), "{}", changed.out);
    assert_eq!(after.iter().filter(|key| key.starts_with("choice-")).count(), 4, "{}", changed.out);
}

/// If this failed, what cannot be evaluated would be detected after hours.
#[test]
fn what_does_not_fit_is_refused_and_nothing_is_written() {
    let place = pool();
    place.write("room.gltf", room().read("room.gltf"));
    let lost = place.path("lost");
    fs::create_dir_all(lost.join("images")).unwrap();
    fs::copy(place.path("photos/transforms.json"), lost.join("transforms.json")).unwrap();
    place.write("hall.gltf", place.read("room.gltf"));
    let cases: [(&str, &[&str]); 15] = [
        (
            "evaluate room.gltf --box -1.5,0,0,-1.2,0.5,0.5 --out o",
            &["room.gltf", "outside of the scene", "[1.000, 1.000"],
        ),
        ("evaluate room.gltf --box 0,0,0,0.5,nan,0.5 --out o", &["box", "not finite"]),
        ("evaluate room.gltf --preset room --clearance nan --out o", &["clearance NaN"]),
        ("evaluate room.gltf --preset object --box 0,0,0,1,1,1 --out o", &["--box", "--preset room"]),
        ("evaluate room.gltf --clearance 0.1 --out o", &["--clearance", "--preset room"]),
        ("evaluate room.gltf hall.gltf --box 0,0,0,1,1,1 --out o", &["--box", "there are 2"]),
        ("evaluate room.gltf --box 0,0,1 --out o", &["--box takes 6 numbers", "not 3"]),
        ("evaluate room.gltf --preset room --out o --methods random,fibonacci", &["--methods fibonacci", "room"]),
        ("evaluate --pool photos --out o", &["photos", "17 of its 20 photos", "--budgets is 20"]),
        ("evaluate --pool photos --out o --budgets 5 --inputs 18", &["photos", "--inputs is 18"]),
        (
            "evaluate --pool photos --out o --budgets 5 --methods paper-iterative",
            &["--methods paper-iterative", "chosen"],
        ),
        ("evaluate --pool lost --out o --budgets 5", &["lost", "missing", "photo_00.png"]),
        ("evaluate --pool none --out o --budgets 5", &["none"]),
        ("evaluate --pool photos photos --out o --budgets 5", &["another subject has this name"]),
        ("evaluate --pool photos --out o --budgets 5 --shrink 0", &["--shrink is 0"]),
    ];
    assert_refused(&place, &cases);
}

//! What real captures bring that made ones do not: stray points and poses, coordinates far from the origin, an object on a table, masks
//! in other formats, names that lead elsewhere.

use std::fs;

use crate::support::command::{Place, SHORT, assert_refused};
use crate::support::splats::capture;
use camsplat::files::io;
use camsplat::files::io::ply::write;
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::random;
use camsplat::scene::surface::Surface;
use camsplat::splats::run::record::TrainRecord;
use glam::DVec3;
use serde_json::{Value, json};

/// Points of a ball of radius 1 whose middle is at the height 1.
fn ball() -> Vec<DVec3> {
    let point = |i| {
        let [u, v, ..] = random::uniforms(5, 0, i);
        DVec3::Z + random::direction(u, v)
    };
    (0..3000).map(point).collect()
}

/// A PLY file of positions in double precision.
fn doubles(positions: &[DVec3]) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         end_header\n",
        positions.len()
    )
    .into_bytes();
    bytes.extend(positions.iter().flat_map(|p| p.to_array()).flat_map(f64::to_le_bytes));
    bytes
}

/// Poses of 30 photos in a ring above a table that look at the ball.
fn above() -> Vec<Camera> {
    let camera = |i: u32| {
        let (sin, cos) = (1.3 * f64::from(i)).sin_cos();
        let position = DVec3::new(5.0 * cos, 5.0 * sin, 1.0 + 0.1 * f64::from(i));
        let pose = Pose::looking(position, DVec3::Z - position, DVec3::Z);
        let intrinsics = Intrinsics { focal: [900.0, 910.0], ..Intrinsics::from_fov(1200, 800, 1.0) };
        Camera { name: format!("{i:03}.png"), pose, intrinsics }
    };
    (0..30).map(camera).collect()
}

/// A place with `capture`: poses above a ball on a table, with its points.
fn table() -> Place {
    let place = Place::new();
    let mut positions = ball();
    positions.extend((0..3000).map(|i| {
        let [u, v, w, _] = random::uniforms(6, 0, i);
        DVec3::new(6.0 * u - 3.0, 6.0 * v - 3.0, 0.01 * w)
    }));
    fs::create_dir(place.path("capture")).unwrap();
    place.write("capture/points.ply", write::points(&positions, &[], None));
    place.write("capture/transforms.json", io::transforms::write(&above(), Some("points.ply")));
    place
}

/// If this failed, one wrong point of a thousand would thin the surface away and move the region, without a word.
#[test]
fn a_stray_point_changes_no_plan() {
    let place = Place::new();
    let mut positions = ball();
    place.write("clean.ply", doubles(&positions));
    place.done(&format!("plan clean.ply {SHORT} --out clean"));
    for (name, far) in [("near", 1e3), ("far", 1e6)] {
        positions.push(DVec3::new(far, -far, 3.0));
        place.write("stray.ply", doubles(&positions));
        let ran = place.done(&format!("plan stray.ply {SHORT} --out {name}"));
        assert!(ran.out.contains("far away from all others, left aside"), "{}", ran.out);
        assert!(!ran.out.contains("thinned"), "{}", ran.out);
        let [stray, clean] = [place.plan(name), place.plan("clean")];
        assert_eq!(stray.surface.primitives, 3000);
        assert_eq!((stray.region, stray.cameras), (clean.region, clean.cameras));
    }
}

/// If this failed, georeferenced clouds would be planned for with a wrong region, or lose their centimetres on the way out.
#[test]
fn coordinates_of_a_map_give_the_same_plan_elsewhere() {
    let place = Place::new();
    let origin = DVec3::new(512_345.0, 5_412_345.0, 231.0);
    let local = ball();
    let mapped: Vec<DVec3> = local.iter().map(|p| *p + origin).collect();
    place.write("local.ply", doubles(&local));
    place.write("mapped.ply", doubles(&mapped));
    for name in ["local", "mapped"] {
        place.done(&format!("plan {name}.ply {SHORT} --out {name}"));
    }
    let (local, mapped) = (place.plan("local"), place.plan("mapped"));
    for (a, b) in local.cameras.iter().zip(&mapped.cameras) {
        let away = (b.pose.position - origin).distance(a.pose.position);
        assert!(away < 1e-3, "{} is {away} away", a.name);
    }
    let Surface::Points(points) = io::read_surface(&place.path("mapped/points.ply")).unwrap() else {
        panic!("no points")
    };
    let off = |p: &DVec3| ((*p - origin - DVec3::Z).length() - 1.0).abs();
    let worst = points.positions.iter().map(off).fold(0.0, f64::max);
    assert!(worst < 0.2, "points lie {worst} off the ball");
    assert!(points.positions.iter().any(|p| p.x.fract() != (p.x as f32 as f64).fract()), "single precision");
}

/// If this failed, half of the cameras for an object on a table would stand below it, and the photos' lens and up would be guessed
/// again; a surface made from the photos would lose all that the capture knows.
#[test]
fn a_capture_gives_floor_lens_and_up() {
    let place = table();
    place.write("ball_only.ply", doubles(&ball()));
    for (options, folder) in [("", "points"), ("--surface ball_only.ply", "surface")] {
        let ran = place.done(&format!("plan capture {options} --keep capture {SHORT} --out {folder}"));
        let plan = place.plan(folder);
        let planned = &plan.cameras[..plan.cameras.len() - plan.kept];
        assert_eq!((planned.len(), plan.kept), (5, 30));
        for camera in planned {
            assert_eq!(camera.intrinsics, above()[0].intrinsics, "{folder}");
        }
        assert!(ran.out.contains("lens     67."), "{}", ran.out);
        assert!(plan.region.up.dot(DVec3::Z) > 0.999, "{}", plan.region.up);
        if folder == "points" {
            assert!(ran.out.contains("--floor none leaves it out"), "{}", ran.out);
            assert!(plan.region.floor.is_some_and(|floor| floor.abs() < 0.05), "{:?}", plan.region.floor);
            assert!(planned.iter().all(|camera| camera.pose.position.z > -0.01));
        }
    }
    let plan = |options: &str| {
        place.done(&format!("plan capture {options} {SHORT} --out again --force"));
        place.plan("again")
    };
    assert_eq!(plan("--floor none").region.floor, None);
    assert_eq!(plan("--floor 0.5").region.floor, Some(0.5));
    assert_eq!(
        plan("--fov 40 --size 200x100").cameras[0].intrinsics,
        Intrinsics::from_fov(200, 100, 40f64.to_radians())
    );
    assert_refused(
        &place,
        &[
            ("plan ball.ply --surface ball_only.ply --views 5 --out o", &["ball.ply", "--surface goes with a capture"]),
            ("plan capture --floor low --views 5 --out o", &["--floor", "a height, auto or none"]),
        ],
    );
}

/// If this failed, one wrong pose would scale the scene away, and training would end in fog.
#[test]
fn a_stray_pose_does_not_spoil_training() {
    let place = Place::new();
    capture::write(&place.path("capture"), 13, 48);
    let options = "--max-splats 200 --sh 1 --iterations 150 --test-every 4 --evaluate-every 0";
    let psnr = |folder: &str| {
        let ran = place.done(&format!("train capture --out {folder} {options}"));
        let record: TrainRecord = serde_json::from_str(&place.read(&format!("{folder}/train.json"))).unwrap();
        (record.evaluations.last().unwrap().quality.psnr, ran.out)
    };
    let (clean, _) = psnr("clean");
    let mut file: Value = serde_json::from_str(&place.read("capture/transforms.json")).unwrap();
    let mut frame = file["frames"][3].clone();
    frame["file_path"] = json!("images/stray.png");
    frame["transform_matrix"][0][3] = json!(1e4);
    file["frames"].as_array_mut().unwrap().push(frame);
    place.write("capture/transforms.json", file.to_string());
    fs::copy(place.path("capture/images/003.png"), place.path("capture/images/stray.png")).unwrap();
    let (stray, out) = psnr("stray");
    assert!(out.contains("stray: stray.png far away from all other cameras"), "{out}");
    assert!((stray - clean).abs() < 1.0, "{clean} dB without and {stray} dB with a stray pose");
}

/// If this failed, a capture whose chosen photos are trained on would start from nothing, though the documentation promises points.
#[test]
fn a_selection_of_poses_alone_has_points() {
    let place = table();
    place.write("capture/transforms.json", io::transforms::write(&above(), None));
    place.write("ball_only.ply", doubles(&ball()));
    place.done("select capture --surface ball_only.ply --count 6 --points 200 --out o");
    let Surface::Points(points) = io::read_surface(&place.path("o/points.ply")).unwrap() else { panic!("no points") };
    assert!(points.positions.len() > 1000 && points.positions.iter().all(|p| (p.distance(DVec3::Z) - 1.0).abs() < 0.2));
    let file: Value = serde_json::from_str(&place.read("o/transforms.json")).unwrap();
    assert_eq!(file["ply_file_path"], "points.ply");
}

/// If this failed, a capture from a stranger could show files of the system, or a file could fill the terminal.
#[test]
fn names_stay_inside_a_capture_and_errors_stay_short() {
    let place = Place::new();
    capture::write(&place.path("capture"), 4, 24);
    place.write("secret.txt", "the secret of the system\n");
    place.write("outside.png", fs::read(place.path("capture/images/000.png")).unwrap());
    let whole: Value = serde_json::from_str(&place.read("capture/transforms.json")).unwrap();
    let absolute = place.path("secret.txt").to_string_lossy().into_owned();
    for name in ["../secret.txt", &absolute] {
        let mut file = whole.clone();
        file["ply_file_path"] = json!(name);
        place.write("capture/transforms.json", file.to_string());
        let ran = place.done("train capture --out o --iterations 5 --max-splats 100 --force");
        let said: Vec<&str> = ran.out.lines().filter(|line| line.contains("the seed cloud")).collect();
        let [line] = said[..] else { panic!("{}", ran.out) };
        assert!(line.contains("outside the capture's folder") && line.contains("--outside-paths"), "{line}");
        assert!(!ran.out.contains("the secret") && !ran.err.contains("the secret"), "{}{}", ran.out, ran.err);
    }
    let mut file = whole.clone();
    file["frames"][0]["file_path"] = json!("../outside.png");
    place.write("capture/transforms.json", file.to_string());
    let refused = place.run("train capture --out outside --iterations 5");
    assert!(refused.err.contains("../outside.png"), "{}", refused.err);
    place.done("train capture --out outside --iterations 5 --max-splats 100 --outside-paths");

    let long = "x".repeat(5_000_000);
    place.write("long.ply", format!("{long}\n"));
    place.write("long.obj", format!("v 0 0 {long}\n"));
    let mut file = whole;
    file["frames"][0]["transform_matrix"] = json!(long);
    place.write("long.json", file.to_string());
    for file in ["long.ply", "long.obj", "long.json"] {
        let ran = place.run(&format!("plan {file} --views 5 --out p"));
        assert_eq!(ran.code, Some(2));
        assert!(
            ran.err.contains(file) && ran.err.len() < 400 && ran.err.lines().count() == 1,
            "{} bytes",
            ran.err.len()
        );
    }
}

/// If this failed, who has photos or a video and no poses yet would learn that a model is missing, and not what to do.
#[test]
fn captures_without_poses_are_given_the_next_step() {
    let place = Place::new();
    let image = image::RgbImage::new(8, 6);
    for folder in ["photos", "set/images", "film", "half/sparse/0", "half/images", "empty"] {
        fs::create_dir_all(place.path(folder)).unwrap();
    }
    for file in ["photos/a.jpg", "photos/b.jpg", "set/images/a.png", "half/images/a.png"] {
        image.save(place.path(file)).unwrap();
    }
    place.write("film/walk.MP4", "film");
    place.write("walk.mov", "film");
    place.write("half/sparse/0/cameras.bin", [0; 8]);
    fs::create_dir(place.path("many")).unwrap();
    (0..500).for_each(|i| place.write(&format!("many/{i}.jpg"), ""));
    assert_refused(
        &place,
        &[
            ("train many --out o", &["many: found 500 images but no camera poses", "`camsplat frames`"]),
            ("train photos --out o", &["photos: found 2 images but no camera poses", "--image_path photos"]),
            (
                "select set --count 3 --out o",
                &["set: found 1 images", "colmap automatic_reconstructor", "--image_path set/images"],
            ),
            (
                "vds film --out o.ply",
                &["film: found a video and no images", "`camsplat frames film/walk.MP4`", "COLMAP"],
            ),
            ("proxy walk.mov --out o.ply", &["walk.mov: this is a video", "`camsplat frames`", "COLMAP"]),
            (
                "plan half --views 5 --out o",
                &["half: its COLMAP model has cameras.bin or cameras.txt and no images.bin"],
            ),
            ("train empty --out o", &["empty: the folder is no capture", "Polycam", "give the folder"]),
        ],
    );
}

/// If this failed, captures of LLFF and of phones could not be planned for, though their readers work.
#[test]
fn captures_of_other_programs_are_read_by_commands() {
    let place = Place::new();
    fs::create_dir_all(place.path("scan/keyframes/cameras")).unwrap();
    for (i, camera) in above().iter().enumerate() {
        let (r, p) = (glam::DMat3::from_quat(camera.pose.rotation), camera.pose.position);
        let (x, y, z) = (r.x_axis, -r.y_axis, -r.z_axis);
        let row = |k: usize| {
            format!("\"t_{k}0\": {}, \"t_{k}1\": {}, \"t_{k}2\": {}, \"t_{k}3\": {}", x[k], y[k], z[k], p[k])
        };
        let lens = "\"fx\": 900, \"fy\": 910, \"cx\": 600, \"cy\": 400, \"width\": 1200, \"height\": 800";
        let text = format!("{{{lens}, {}, {}, {}}}", row(0), row(1), row(2));
        place.write(&format!("scan/keyframes/cameras/{i:03}.json"), text);
    }
    place.write("ball_only.ply", doubles(&ball()));
    for command in ["plan scan --surface ball_only.ply --keep scan --out o", "plan ball_only.ply --keep scan --out p"] {
        let ran = place.done(&format!("{command} {SHORT}"));
        assert!(ran.out.contains("lens     67."), "{}", ran.out);
    }
    let plan = place.plan("o");
    let kept = &plan.cameras[5..];
    for (found, expected) in kept.iter().zip(above()) {
        assert!(found.pose.position.distance(expected.pose.position) < 1e-9);
        assert!(found.pose.forward().distance(expected.pose.forward()) < 1e-9);
    }
}

/// If this failed, an hour of planning would end because a folder was not made beforehand, or a refused command would leave folders.
#[test]
fn outputs_make_the_folders_they_lie_in() {
    let place = Place::new();
    place.done(&format!("plan ball.ply {SHORT} --out new/deep/plan --trace other/t.json"));
    assert!(place.path("new/deep/plan/plan.json").is_file() && place.path("other/t.json").is_file());
    place.done("score ball.ply new/deep/plan --json third/m.json");
    assert!(place.path("third/m.json").is_file());
    assert_refused(&place, &[("plan ball.ply --views 0 --out fourth/a/plan", &["--views is 0"])]);
}

//! `camsplat convert`, `train --format`, and models in other formats wherever one is read.

use camsplat::files::io;
use camsplat::files::io::splats::{self, SplatFormat};
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::gaussians::Gaussians;
use glam::DVec3;

use crate::support::command::Place;
use crate::support::splats::{capture, scene};

/// A folder with a model that was trained with antialiasing, and one camera before it.
fn place_with_model() -> (Place, Gaussians) {
    let place = Place::new();
    let gaussians = Gaussians { antialiased: true, ..scene(5, 300, 2) };
    place.write("model.ply", io::ply::write::gaussians(&gaussians));
    let pose = Pose::looking(DVec3::new(0.0, 0.0, -5.0), DVec3::Z, DVec3::Y);
    let camera = Camera { name: "a.png".into(), pose, intrinsics: Intrinsics::from_fov(64, 48, 1.0) };
    place.write("cameras.json", serde_json::json!({ "cameras": [camera] }).to_string());
    (place, gaussians)
}

fn pixels(place: &Place, folder: &str) -> Vec<u8> {
    image::open(place.path(&format!("{folder}/a.png"))).unwrap().into_rgb8().into_raw()
}

/// If this failed, a model would look different once it is converted, or a command would not take the format.
#[test]
fn a_model_looks_the_same_in_every_format() {
    let (place, _) = place_with_model();
    let whole = place.done("render model.ply cameras.json --out whole");
    assert!(whole.out.contains("was trained with antialiasing"), "{}", whole.out);
    place.done("render model.ply cameras.json --out same --antialiased");
    assert_eq!(pixels(&place, "whole"), pixels(&place, "same"), "the file's own mark counts");
    for (file, most) in [("a.compressed.ply", 12.0), ("a.spz", 12.0), ("a.sog", 12.0), ("a.glb", 0.0)] {
        let ran = place.done(&format!("convert model.ply {file}"));
        assert!(ran.out.contains(&format!("written  {file}: ")), "{}", ran.out);
        // glTF has no mark for the filter.
        let filter = if file == "a.glb" { "--antialiased" } else { "" };
        place.done(&format!("render {file} cameras.json --out back --force {filter}"));
        let (a, b) = (pixels(&place, "whole"), pixels(&place, "back"));
        let square = a.iter().zip(&b).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum::<f64>() / a.len() as f64;
        assert!(square.sqrt() <= most, "{file}: {}", square.sqrt());
    }
    let ran = place.done("convert model.ply a.splat");
    assert!(ran.out.contains("the format has no harmonics") && ran.out.contains("cannot say"), "{}", ran.out);
    // As a surface, and as what others choose by.
    place.done("plan a.spz --views 3 --iterations 2 --out plan");
    assert!(place.done("convert a.sog again.ply").out.contains("SOG: values are rounded"));
}

/// If this failed, a file would be replaced without being asked for, or a name say another format than the file has.
#[test]
fn what_is_there_stays_unless_it_is_to_be_replaced() {
    let (place, gaussians) = place_with_model();
    place.write("kept.spz", "precious");
    let refused = place.run("convert model.ply kept.spz");
    assert!(refused.code == Some(2) && refused.err.contains("a file is already here; pass --force"), "{}", refused.err);
    assert_eq!(place.read("kept.spz"), "precious");
    let unknown = place.run("convert model.ply a.obj");
    assert!(unknown.err.contains("end the name so") && !place.path("a.obj").exists(), "{}", unknown.err);
    place.write("points.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n");
    let other = place.run("convert points.ply a.spz");
    assert!(other.code == Some(2) && !place.path("a.spz").exists(), "{}", other.err);
    place.done("convert model.ply kept.spz --force --format spz4");
    let bytes = std::fs::read(place.path("kept.spz")).unwrap();
    assert_eq!(bytes, splats::write(&gaussians, SplatFormat::Spz4, &mut Vec::new()).unwrap());
    // A model may take its own place.
    place.done("convert model.ply model.ply --force");
    assert_eq!(io::read_gaussians_with_notes(&place.path("model.ply")).unwrap().0, gaussians);
}

/// If this failed, a training would not leave the files that were asked for, or leave those of the training before.
#[test]
fn a_training_writes_the_formats_that_were_asked_for() {
    let place = Place::new();
    capture::write(&place.path("capture"), 4, 32);
    let run = "train capture --iterations 2 --max-splats 100 --test-every 0 --out o";
    place.done(&format!("{run} --format spz,sog --antialiased"));
    let (model, _) = io::read_gaussians_with_notes(&place.path("o/point_cloud.ply")).unwrap();
    assert!(model.antialiased);
    for name in ["spz", "sog"] {
        let (other, _) = io::read_gaussians_with_notes(&place.path(&format!("o/point_cloud.{name}"))).unwrap();
        assert!(other.antialiased && other.len() == model.len(), "{name}");
    }
    place.done(&format!("{run} --force"));
    assert!(!place.path("o/point_cloud.spz").exists(), "that is of another model");
}

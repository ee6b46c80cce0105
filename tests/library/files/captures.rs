//! Reading captures that other programs wrote, in the folder that CAMSPLAT_DATA names.

use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::process::Command;

use crate::support::data::data_folder;
use camsplat::files::io::colmap::{self, NO_POINT, Point, binary};
use camsplat::files::io::photos::{Images, ReadOptions, read};
use camsplat::files::photos::Photo;
use camsplat::scene::camera::Intrinsics;
use camsplat::scene::lens::{Distortion, Lens};
use glam::{DVec2, DVec3};

/// If this failed, typical captures would not be read, or not whole.
#[test]
#[ignore = "needs the folder CAMSPLAT_DATA"]
fn every_capture_reads() {
    let data = data_folder();
    let known = [
        ("photos/fox", 67, 12_528, 0),
        ("photos/fox/transforms.json", 67, 0, 0),
        ("photos/gold-cape", 119, 14_675, 119),
        ("photos/tankard", 69, 9_323, 69),
        ("photos/beer-can", 71, 4_414, 0),
        ("photos/plush", 95, 3_911, 0),
        ("nerf-synthetic/lego", 100, 0, 0),
        ("nerf-synthetic/lego/transforms_test.json", 50, 0, 0),
    ];
    for (name, photos, points, masks) in known {
        let set = read(&data.join(name), &ReadOptions { images: Images::Needed, ..ReadOptions::default() }).unwrap();
        println!("{name}\n  {}", set.notes.join("\n  "));
        assert_eq!((set.photos.len(), set.points.positions.len()), (photos, points), "{name}");
        assert_eq!(set.photos.iter().filter(|photo| photo.mask.is_some()).count(), masks, "{name}");
        assert!(set.photos.iter().all(|photo| photo.image.is_some()) && set.missing.is_empty(), "{name}");
        assert!(set.photos.is_sorted_by(|a, b| a.camera.name < b.camera.name), "{name}");
        assert_eq!(set.tracks.len(), points, "{name}");
        let distorted = set.photos.iter().all(|photo| !photo.distortion.is_none());
        assert_eq!(
            distorted,
            ["photos/fox", "photos/fox/transforms.json", "photos/plush", "photos/beer-can"].contains(&name),
            "{name}"
        );
    }
}

/// Mean distance in pixels from observations to the projections of their points, with the lens and with its pinhole alone,
/// and the mean error that the model itself states.
fn reprojection(folder: &Path) -> (f64, f64, f64) {
    let set = read(folder, &ReadOptions::default()).unwrap();
    let model = folder.join("sparse/0");
    let bytes = |name: &str| std::fs::read(model.join(name)).unwrap();
    let images = binary::observed(&model, &bytes("images.bin"), |_| true).unwrap();
    let points = binary::points(&model, &bytes("points3D.bin")).unwrap();
    let position: HashMap<u64, DVec3> = points.iter().map(|point| (point.id, point.position)).collect();
    let photos: HashMap<&str, &Photo> = set.photos.iter().map(|photo| (photo.camera.name.as_str(), photo)).collect();
    let (mut bent, mut straight, mut count) = (0.0, 0.0, 0);
    for image in &images {
        let photo = photos[image.name.as_str()];
        let pose = photo.camera.pose;
        let lens = photo.lens();
        let pinhole = Lens::new(photo.camera.intrinsics, Distortion::default());
        for observation in image.observations.iter().filter(|o| o.point != NO_POINT) {
            let p = pose.rotation.conjugate() * (position[&observation.point] - pose.position);
            let pixel = DVec2::from(observation.pixel);
            bent += (lens.project(p).unwrap() - pixel).length();
            straight += (pinhole.project(p).unwrap() - pixel).length();
            count += 1;
        }
    }
    // COLMAP's error of a point is the mean over its track.
    let weight: usize = points.iter().map(|point| point.track.len()).sum();
    let stated = points.iter().map(|point| point.error * point.track.len() as f64).sum::<f64>() / weight as f64;
    assert_eq!(weight, count);
    (bent / count as f64, straight / count as f64, stated)
}

/// If this failed, distortion would be read but not honoured, or with a coefficient mistaken for another.
#[test]
#[ignore = "needs the folder CAMSPLAT_DATA"]
fn points_fall_where_they_were_observed() {
    let data = data_folder();
    for name in ["fox", "plush", "beer-can", "gold-cape", "tankard"] {
        let (bent, straight, stated) = reprojection(&data.join("photos").join(name));
        println!("{name}: {bent:.4} pixels, {straight:.4} without distortion, {stated:.4} stated");
        assert!((bent - stated).abs() < 1e-3 * stated, "{name}: {bent} and not {stated} pixels");
        if ["fox", "plush"].contains(&name) {
            // The lens of plush is nearly straight.
            assert!(straight > 1.1 * bent, "{name}: {straight} pixels without distortion, {bent} with it");
        }
    }
}

/// If this failed, one of two readers would have poses or lenses wrong: both files hold the same capture.
#[test]
#[ignore = "needs the folder CAMSPLAT_DATA"]
fn both_files_of_the_fox_agree() {
    let data = data_folder();
    let colmap = read(&data.join("photos/fox"), &ReadOptions::default()).unwrap();
    let transforms = read(&data.join("photos/fox/transforms.json"), &ReadOptions::default()).unwrap();
    for (a, b) in colmap.photos.iter().zip(&transforms.photos) {
        assert_eq!((&a.camera.name, a.image.as_ref()), (&b.camera.name, b.image.as_ref()));
        assert!((a.camera.pose.position - b.camera.pose.position).length() < 2e-6);
        assert!(a.camera.pose.rotation.dot(b.camera.pose.rotation).abs() > 1.0 - 1e-9);
        for pixel in [DVec2::new(1.0, 1.0), DVec2::new(270.0, 480.0), DVec2::new(539.0, 700.0)] {
            let apart = a.lens().unproject(pixel).unwrap().angle_between(b.lens().unproject(pixel).unwrap());
            assert!(apart < 2e-5, "{} at {pixel}: {apart}", a.camera.name);
        }
    }
}

/// If this failed, a trajectory would be inverted, or its default lens be taken for measured.
#[test]
#[ignore = "needs the folder CAMSPLAT_DATA"]
fn the_barn_is_read_as_poses_only() {
    let data = data_folder();
    let file = data.join("photos/barn-poses/Barn_COLMAP_SfM.log");
    let set = read(&file, &ReadOptions::default()).unwrap();
    println!("{}", set.notes.join("\n"));
    assert_eq!((set.photos.len(), set.missing.len()), (410, 410));
    assert!(set.notes.iter().any(|note| note.contains("are a guess")), "{:?}", set.notes);
    let steps: Vec<f64> = set
        .photos
        .windows(2)
        .map(|pair| pair[0].camera.pose.rotation.angle_between(pair[1].camera.pose.rotation))
        .collect();
    let small = steps.iter().filter(|angle| **angle < 0.2).count();
    assert!(small > 380, "neighbours of a video look the same way: {small} of 409");
    let first = set.photos[0].camera.pose.position;
    assert!((first - DVec3::new(3.247106620677, 0.140327149378, 0.557238856010)).length() < 1e-9);
    let intrinsics = Intrinsics::from_fov(1920, 1080, 1.2);
    let set = read(&file, &ReadOptions { intrinsics: Some(intrinsics), ..ReadOptions::default() }).unwrap();
    assert_eq!(set.photos[7].camera.intrinsics, intrinsics);
    assert!(read(&file, &ReadOptions { images: Images::Needed, ..ReadOptions::default() }).is_err());
}

/// If this failed, a subset of another program's model would hold other numbers than the model.
#[test]
#[ignore = "needs the folder CAMSPLAT_DATA"]
fn a_subset_of_the_fox_is_a_part_of_its_model() {
    let data = data_folder();
    let model = data.join("photos/fox/sparse/0");
    let bytes = |name: &str| std::fs::read(model.join(name)).unwrap();
    let all = binary::observed(&model, &bytes("images.bin"), |_| true).unwrap();
    let points: HashMap<u64, Point> =
        binary::points(&model, &bytes("points3D.bin")).unwrap().into_iter().map(|point| (point.id, point)).collect();
    // Cut down to all of itself, a model is what it was, byte for byte.
    let names: Vec<String> = all.iter().map(|image| image.name.clone()).collect();
    for (name, written) in colmap::subset(&model, &names).unwrap().files {
        assert!(written == bytes(name), "{name}");
    }
    let kept: Vec<String> = names.iter().step_by(4).cloned().collect();
    let subset = colmap::subset(&model, &kept).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for (name, written) in &subset.files {
        std::fs::write(folder.path().join(name), written).unwrap();
    }
    let read_back = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    let images = binary::observed(&model, &read_back("images.bin"), |_| true).unwrap();
    assert_eq!(images, all.iter().filter(|image| kept.contains(&image.name)).cloned().collect::<Vec<_>>());
    let ids: Vec<u32> = images.iter().map(|image| image.id).collect();
    let part = binary::points(&model, &read_back("points3D.bin")).unwrap();
    for point in &part {
        let mut whole = points[&point.id].clone();
        whole.track.retain(|[image, _]| ids.contains(image));
        assert_eq!(*point, whole);
    }
    let seen: HashSet<u64> = images.iter().flat_map(|i| &i.observations).map(|o| o.point).collect();
    assert_eq!(part.len(), seen.iter().filter(|id| **id != NO_POINT).count());
    println!("{} images, {} of {} points", images.len(), part.len(), points.len());
    match Command::new("colmap").args(["model_analyzer", "--path"]).arg(folder.path()).output() {
        Err(_) => println!("skipped: colmap is not installed"),
        Ok(output) => {
            let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
            println!("{text}");
            assert!(output.status.success(), "{text}");
            for line in [format!("Registered images: {}", images.len()), format!("Points: {}", part.len())] {
                assert!(text.contains(&line), "{line:?} is not in {text}");
            }
        }
    }
}

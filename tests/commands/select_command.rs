//! `camsplat select` as a user runs it: what it leaves, and what bad input gets.

use std::fs;
use std::path::Path;

use crate::support::browser::{acting, figure, number_after, rendered, write};
use crate::support::command;
use crate::support::command::{Place, ended};
use crate::support::data::data_folder;
use camsplat::files::io;
use camsplat::files::io::camera_files;
use camsplat::files::io::folder::OutputFolder;
use camsplat::files::io::photos::ReadOptions;
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::random;
use camsplat::scene::surface::Points;
use glam::DVec3;

/// ReadOptions that keep a choice small.
const SMALL: &str = "--points 200";

/// A place with `capture`, a COLMAP model of a ball photographed from 24 sides with images and one mask, and `poses.json`, the
/// same poses alone.
fn place() -> Place {
    let place = Place::new();
    let cameras: Vec<Camera> = (0..24)
        .map(|i| {
            let [u, v, ..] = random::uniforms(1, 0, i);
            let position = 4.0 * random::direction(u, v);
            Camera {
                name: format!("photo_{i:02}.png"),
                pose: Pose::looking(position, -position, DVec3::Z),
                intrinsics: Intrinsics::from_fov(64, 48, 50f64.to_radians()),
            }
        })
        .collect();
    let positions: Vec<DVec3> = (0..900)
        .map(|i| {
            let [u, v, ..] = random::uniforms(2, 0, i);
            random::direction(u, v)
        })
        .collect();
    let facing = |p: &DVec3| {
        let seen = (0u32..).zip(&cameras).filter(|(_, camera)| camera.pose.position.dot(*p) > 1.0);
        seen.map(|(i, _)| i).collect::<Vec<u32>>()
    };
    let tracks: Vec<Vec<u32>> = positions.iter().map(facing).collect();
    let colours = vec![[90, 120, 150]; positions.len()];
    let folder = OutputFolder::create(&place.path("capture"), false).unwrap();
    camera_files::capture(&folder, &cameras, &Points { positions, colours, ..Points::default() }, &tracks).unwrap();
    for (i, camera) in (0u8..).zip(&cameras) {
        let image = image::RgbImage::from_fn(64, 48, |x, y| image::Rgb([(x * y) as u8, i, 40]));
        image.save(folder.stage(&format!("images/{}", camera.name)).unwrap()).unwrap();
        let mask = image::GrayImage::from_pixel(64, 48, image::Luma([255]));
        mask.save(folder.stage(&format!("masks/{}.png", camera.name)).unwrap()).unwrap();
    }
    folder.commit().unwrap();
    place.write("poses.json", io::transforms::write(&cameras, None));
    place
}

/// Names in chosen.csv.
fn chosen(place: &Place, folder: &str) -> Vec<String> {
    let text = place.read(&format!("{folder}/chosen.csv"));
    text.lines().skip(1).map(|line| line.split(',').next().unwrap().to_owned()).collect()
}

/// The folder must be a capture that trainers and this program read: images that open, the model and transforms.json cut
/// down, with what is worth adding beside.
#[test]
fn the_folder_is_a_capture_of_the_chosen_photos() {
    let place = place();
    place.write("must.txt", "photo_03.png\n\nphoto_07.png\n");
    place.write("never.txt", "photo_00.png\n");
    let options = "--include must.txt --exclude never.txt --sharpness --suggest 3 --copy";
    let ran = place.done(&format!("select capture --count 6 --out o {SMALL} {options}"));
    for word in ["all photos", "ours", "fibonacci", "coverage", "unseen", "report"] {
        assert!(ran.out.contains(word), "{word:?} is not in {}", ran.out);
    }
    let mut names = chosen(&place, "o");
    names.sort();
    assert_eq!(names.len(), 6);
    assert!(names.contains(&"photo_03.png".into()) && names.contains(&"photo_07.png".into()));
    assert!(!names.contains(&"photo_00.png".into()));

    let set = io::photos::read(&place.path("o"), &ReadOptions::default()).unwrap();
    assert_eq!(set.photos.iter().map(|photo| photo.camera.name.clone()).collect::<Vec<_>>(), names);
    assert!(set.photos.iter().all(|photo| photo.image.is_some() && photo.mask.is_some()));
    assert!(set.points.positions.len() > 100 && set.tracks.iter().all(|track| !track.is_empty()));
    let transforms = io::read_cameras(&place.path("o/transforms.json")).unwrap();
    assert_eq!(transforms.len(), 6);
    assert_eq!(io::read_cameras(&place.path("o/suggested.json")).unwrap().len(), 3);
    assert_eq!(place.read("o/suggested.csv").lines().count(), 4);
    let page = place.read("o/report.html");
    assert!(page.contains("photo left out") && page.contains("Photos worth taking"));
    assert_eq!([page.matches("data:image/jpeg").count(), page.matches(">look through<").count()], [6, 3]);
    assert_eq!(page.matches(", always selected").count(), 2, "the photos of --include");
    photos_are_looked_through(&page);
    let record: serde_json::Value = serde_json::from_str(&place.read("o/select.json")).unwrap();
    assert_eq!(record["chosen"].as_array().unwrap().len(), 6);
    // Binary, where there are points in it.
    assert!(fs::read(place.path("o/unseen.ply")).unwrap().starts_with(b"ply"));

    // Links by default, and a pool of poses alone.
    place.done(&format!("select capture --count 5 --out linked {SMALL} --method coverage"));
    let link = place.path("linked/images").join(&chosen(&place, "linked")[0]);
    assert!(link.is_symlink() && image::open(&link).is_ok(), "{}", link.display());
    place.done(&format!("select poses.json --surface ball.ply --count 5 --out poses {SMALL}"));
    assert_eq!(io::read_cameras(&place.path("poses/transforms.json")).unwrap().len(), 5);
    assert!(!Path::new(&place.path("poses/images")).exists());
    assert_eq!(io::read_cameras(&place.path("poses/sparse/0")).unwrap().len(), 5);
}

/// If this failed, trainers that read COLMAP models alone would refuse a selection from other captures or see other lenses there, and
/// those that want a mask for each photo or none would refuse one where some photos have masks.
#[test]
fn a_selection_from_another_format_has_a_colmap_model_and_all_its_masks() {
    let place = place();
    fs::remove_dir_all(place.path("capture/sparse")).unwrap();
    let mut file: serde_json::Value = serde_json::from_str(&place.read("capture/transforms.json")).unwrap();
    file["k1"] = 0.08.into();
    file["p2"] = (-0.002).into();
    for (i, frame) in file["frames"].as_array_mut().unwrap().iter_mut().enumerate() {
        if i % 2 == 0 {
            let name = frame["file_path"].as_str().unwrap().replace("images/", "masks/");
            frame["mask_path"] = format!("{name}.png").into();
        }
    }
    place.write("capture/transforms.json", file.to_string());
    place.done(&format!("select capture --count 8 --out o {SMALL}"));
    let read = |path: &str| io::photos::read(&place.path(path), &ReadOptions::default()).unwrap();
    let (model, transforms) = (read("o/sparse/0"), read("o/transforms.json"));
    assert_eq!((model.photos.len(), transforms.photos.len()), (8, 8));
    for (a, b) in model.photos.iter().zip(&transforms.photos) {
        assert_eq!((&a.camera.name, a.camera.intrinsics), (&b.camera.name, b.camera.intrinsics));
        assert_eq!((a.distortion, a.distortion.radial[0], a.distortion.tangential[1]), (b.distortion, 0.08, -0.002));
        assert!(a.camera.pose.position.distance(b.camera.pose.position) < 1e-9);
        let mask = image::open(b.mask.as_ref().expect("a mask")).unwrap().into_luma8();
        assert!(mask.dimensions() == (64, 48) && mask.pixels().all(|pixel| pixel.0 == [255]));
    }
    assert_eq!(model.points.positions.len(), transforms.points.positions.len());
}

/// Photos are shown, and a click on one looks through its camera, with the photo over the surface; so it is with a suggested camera,
/// which has none.
fn photos_are_looked_through(page: &str) {
    let script = r#"
        const [photos, suggested] = ["button[data-camera]:has(img)", "td [data-camera]"].map((of) => document.querySelectorAll(of));
        const frame = document.querySelector(".frame"), body = document.body.dataset;
        body.photos = [...photos].filter((photo) => photo.querySelector("img").naturalWidth === 64).length;
        body.legend = document.querySelector(".legend").textContent;
        photos[0].click();
        setTimeout(() => {
            body.over = frame.querySelector("img")?.src === photos[0].querySelector("img").src && !frame.hidden;
            body.remark = document.querySelector(".detail").textContent;
            suggested[0].click();
            setTimeout(() => { body.none = !frame.querySelector("img") && !frame.hidden; }, 50);
        }, 50);"#;
    // Pictures that are not in sight are not decoded otherwise.
    let page = page.replace("loading=\"lazy\"", "");
    let Some(dom) = rendered(&write("selection", &acting(&page, script)), &[]) else { return };
    for part in [r#"data-ready="ok""#, r#"data-photos="6""#, r#"data-over="true""#, r#"data-none="true""#] {
        assert!(dom.contains(part), "{part} is missing");
    }
    assert!(dom.contains("would be lost without it, number 1 of 6"));
    assert!(number_after(figure(&dom, "chart-loss"), "viewBox", "data-values") > Some(0), "the swaps are not plotted");
    let legend = &dom[dom.find("data-legend=").unwrap()..][..200];
    assert!(legend.contains("chosen photo") && legend.contains("suggested photo"), "{legend}");
}

/// If this failed, the model would not be trained on the photos while they are chosen, or the record would not contain for how long.
#[test]
fn photos_are_chosen_by_a_model_that_is_trained_on_them() {
    let place = place();
    let run = "--method fisherrf-retrain --train-every 3 --max-splats 300 --shrink 2 --background white --points 100";
    place.done(&format!("select capture --count 6 --out o {run}"));
    assert_eq!(chosen(&place, "o").len(), 6);
    let record: serde_json::Value = serde_json::from_str(&place.read("o/select.json")).unwrap();
    let retraining = &record["request"]["retraining"];
    assert_eq!((&retraining["every"], &retraining["shrink"]), (&3.into(), &2.into()), "{record}");
    place.done(&format!("select capture --count 6 --out again {run}"));
    assert_eq!(place.read("again/chosen.csv"), place.read("o/chosen.csv"));
}

/// If this failed, a user would lose his photos: links to themselves in their place, and a model of the chosen few.
#[test]
fn a_capture_is_never_written_over() {
    let place = place();
    let before = place.files("capture");
    for out in ["capture", "capture/images", "capture/sparse"] {
        let ran = place.run(&format!("select capture --count 4 --out {out} --force {SMALL}"));
        assert_eq!(ran.code, Some(2), "{out}: {}", ran.err);
        assert!(ran.err.contains("would be written over") && ran.err.lines().count() == 1, "{}", ran.err);
    }
    for photo in before.iter().filter(|name| name.starts_with("images/")) {
        assert!(image::open(place.path("capture").join(photo)).is_ok(), "{photo}");
    }
}

/// If this failed, the chosen folder would list photos that it does not hold.
#[test]
fn photos_that_are_not_there_are_not_chosen() {
    let place = place();
    fs::remove_file(place.path("capture/images/photo_02.png")).unwrap();
    let ran = place.done(&format!("select capture --count 5 --out o {SMALL}"));
    assert!(ran.out.contains("1 photos whose image is missing"), "{}", ran.out);
    assert!(!chosen(&place, "o").contains(&"photo_02.png".into()));
    assert_eq!(place.files("o").iter().filter(|name| name.starts_with("images/")).count(), 5);
}

/// The same bits, whatever the threads of the device do.
#[test]
fn the_choice_is_the_same_for_any_number_of_threads() {
    let place = place();
    let mut first = None;
    for threads in ["0", "1", "2"] {
        let arguments = format!("select capture --count 7 --out o{threads} {SMALL}");
        let ran = ended(place.command(&arguments).env("LP_NUM_THREADS", threads).output().unwrap());
        assert_eq!(ran.code, Some(0), "{}", ran.err);
        let found = fs::read(place.path(&format!("o{threads}/chosen.csv"))).unwrap();
        assert_eq!(first.get_or_insert_with(|| found.clone()), &found, "{threads} threads");
    }
}

/// One line with what is wrong, exit code 2, nothing written.
#[test]
fn what_cannot_be_chosen_is_refused() {
    let place = place();
    place.write("odd.txt", "photo_01.png\nnowhere.png\nneither.png\n");
    place.write("two.txt", "photo_01.png\nphoto_02.png\n");
    place.write("one.txt", "photo_02.png\n");
    place.write("far.ply", command::points(&["900 0 0", "901 0 0", "900 1 0", "900 0 1", "901 1 1", "901 1 0"]));
    let before = place.files("");
    let cases: [(&str, &[&str]); 15] = [
        ("capture --count 25", &["--count is 25", "24 photos", "give fewer"]),
        ("capture --count 0", &["--count is 0", "at least 1"]),
        ("capture --count 24 --exclude one.txt", &["23 photos of 24", "--exclude"]),
        ("capture --count 1 --include two.txt", &["--include names 2", "raise --count"]),
        ("capture --count 5 --include two.txt --exclude one.txt", &["--include and --exclude both name photo_02.png"]),
        ("capture --count 5 --include odd.txt", &["odd.txt", "nowhere.png, neither.png", "such as photo_"]),
        ("capture --count 5 --exclude gone.txt", &["gone.txt: ", "no such file", "a photo on each line"]),
        ("capture --count 5 --points 0", &["--points is 0"]),
        ("poses.json --count 5", &["poses.json", "no points", "--surface"]),
        ("poses.json --count 5 --surface ball.ply --sharpness", &["poses.json", "missing"]),
        ("capture --count 5 --train-every 5", &["--train-every", "--method fisherrf-retrain"]),
        ("capture --count 5 --method fisherrf-retrain --train-every 0", &["--train-every is 0"]),
        ("capture --count 24 --method fisherrf-retrain --train-every 90000", &["--train-every 90000", "24 views"]),
        (
            "poses.json --surface ball.ply --count 5 --method fisherrf-retrain",
            &["poses.json", "poses alone", "fisherrf"],
        ),
        ("capture --count 5 --surface far.ply", &["no point of the surface is seen by two photos"]),
    ];
    for (arguments, fragments) in cases {
        let ran = place.run(&format!("select {arguments} --out o"));
        assert_eq!(ran.code, Some(2), "{arguments}: {}{}", ran.out, ran.err);
        assert_eq!(ran.err.lines().count(), 1, "{arguments}: {}", ran.err);
        for fragment in fragments {
            assert!(ran.err.contains(fragment), "{arguments}: {fragment:?} is not in {}", ran.err);
        }
        assert_eq!(place.files(""), before, "{arguments} left something");
    }
}

/// Real captures (CAMSPLAT_DATA), and poses at the scale of a building with a surface that is given.
#[test]
#[ignore = "needs the folder CAMSPLAT_DATA"]
fn real_pools() {
    let photos = data_folder().join("photos");
    let place = Place::new();
    for (set, total) in [("plush", 95), ("beer-can", 71)] {
        let ran = place.done(&format!("select {} --count 12 --out {set}", photos.join(set).display()));
        assert!(ran.out.contains(&format!("12 of {total} photos")), "{}", ran.out);
        assert_eq!(io::photos::read(&place.path(set), &ReadOptions::default()).unwrap().photos.len(), 12);
    }
    // A ball where the Barn's cameras look.
    let log = photos.join("barn-poses/Barn_COLMAP_SfM.log");
    let set = io::photos::read(&log, &ReadOptions::default()).unwrap();
    let poses: Vec<Pose> = set.photos.iter().map(|photo| photo.camera.pose).collect();
    let centre = poses.iter().map(|pose| pose.position).sum::<DVec3>() / poses.len() as f64;
    let reach = poses.iter().map(|pose| pose.position.distance(centre)).sum::<f64>() / poses.len() as f64;
    let corner = |i: u32| {
        let [u, v, ..] = random::uniforms(3, 0, i);
        let p = centre + 0.4 * reach * random::direction(u, v);
        format!("{} {} {}", p.x, p.y, p.z)
    };
    let cloud: Vec<String> = (0..2000).map(corner).collect();
    place.write("barn.ply", command::points(&cloud.iter().map(String::as_str).collect::<Vec<_>>()));
    let ran = place
        .done(&format!("select {} --surface barn.ply --fov 60 --size 1920x1080 --count 40 --out barn", log.display()));
    assert!(ran.out.contains("40 of 410 photos"), "{}", ran.out);
}

//! `camsplat train` as it is built: what a run leaves, and that it repeats itself to the bit.

use std::collections::BTreeSet;

use crate::support::command::{Place, assert_refused, ended};
use crate::support::splats::capture;
use camsplat::files::io;
use camsplat::splats::config::Background;
use camsplat::splats::run::checkpoint;
use camsplat::splats::run::record::{Status, TrainRecord};

/// Options that keep a run small.
const SMALL: &str = "--max-splats 200 --sh 1 --init-scale 0.5 --init-opacity 0.3";

const STRATEGIES: [&str; 2] = ["mcmc", "adc"];

/// A folder with a capture of nine photos of 48 x 41 pixels in it.
fn place() -> Place {
    let place = Place::new();
    capture::write(&place.path("capture"), 9, 48);
    place
}

fn record(place: &Place, folder: &str) -> TrainRecord {
    serde_json::from_str(&place.read(&format!("{folder}/train.json"))).unwrap()
}

/// If this failed, a user would not find what the documentation promises, or metrics and pictures that are not the model's.
#[test]
fn a_run_leaves_every_product_and_they_agree() {
    let place = place();
    let tests = ["000.png", "004.png", "008.png"];
    for strategy in STRATEGIES {
        let options =
            format!("--strategy {strategy} --iterations 40 --test-every 4 --save-every 15 --evaluate-every 20");
        let ran = place.done(&format!("train capture --out o --force {SMALL} {options}"));
        let mut files: Vec<String> =
            ["checkpoint.bin", "point_cloud.ply", "report.html", "train.json"].map(str::to_owned).into();
        files.extend(["test", "reference"].iter().flat_map(|of| tests.map(|name| format!("{of}/{name}"))));
        files.sort();
        assert_eq!(place.files("o"), files);
        assert!(place.read("o/report.html").trim_end().ends_with("</html>"));
        assert!(ran.out.contains("trained  40 iterations"), "{}", ran.out);

        let record = record(&place, "o");
        let (model, _) = io::read_gaussians_with_notes(&place.path("o/point_cloud.ply")).unwrap();
        assert_eq!(model.len(), record.splats as usize);
        assert!((81..=200).contains(&record.splats), "{} of 80 splats", record.splats);
        assert_eq!((record.status, record.iterations, record.seconds_for), (Status::Complete, 40, 40));
        assert!(record.gpu_seconds.is_some_and(|gpu| gpu > 0.0 && gpu <= 1.01 * record.seconds));
        assert_eq!((record.photos.train, record.photos.test, record.photos.largest), (6, 3, [48, 41]));
        assert_eq!(record.evaluations.iter().map(|e| (e.iteration, e.views)).collect::<Vec<_>>(), [(20, 3), (40, 3)]);
        assert!(record.evaluations[1].quality.psnr > record.evaluations[0].quality.psnr, "{:?}", record.evaluations);
        assert!(record.curve.last().unwrap().iteration == 40 && !record.stages.is_empty() && record.seconds > 0.0);
        assert_eq!(record.memory.announced, record.memory.buffers.iter().map(|buffer| buffer.1).sum::<u64>());
        assert_eq!(checkpoint::read(&place.path("o/checkpoint.bin")).unwrap().header.done, 40);

        // Measured anew, from the files.
        let names: BTreeSet<&str> = record.test_views.iter().map(|view| view.name.as_str()).collect();
        assert_eq!(names, BTreeSet::from(tests));
        let psnr: Vec<f64> = record.test_views.iter().map(|view| view.quality.psnr).collect();
        assert!(psnr.is_sorted(), "the worst comes first: {psnr:?}");
        place.done(&format!("render o/point_cloud.ply capture --out r{strategy}"));
        for view in &record.test_views {
            let read = |folder: &str| image::open(place.path(folder).join(&view.name)).unwrap().into_rgb8();
            let [kept, photo, rendered] = ["o/test", "capture/images", &format!("r{strategy}")].map(read);
            assert_eq!(read("o/reference"), photo, "an opaque photo without distortion is compared with as it is");
            assert_eq!(kept.dimensions(), (48, 41));
            let differences = |other: &image::RgbImage| -> Vec<f64> {
                kept.as_raw().iter().zip(other.as_raw()).map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs()).collect()
            };
            let worst = differences(&rendered).into_iter().fold(0.0, f64::max);
            assert!(worst <= 2.0, "{strategy} {}: the model renders {worst} levels away", view.name);
            let squared = differences(&photo).iter().map(|d| d * d).sum::<f64>() / kept.as_raw().len() as f64;
            let expected = 10.0 * (255.0 * 255.0 / squared).log10();
            assert!((view.quality.psnr - expected).abs() < 1e-6, "{:?}, not {expected}", view.quality);
            assert!(view.quality.lpips.is_some_and(|lpips| lpips > 0.0 && lpips < 1.0), "{:?}", view.quality);
        }
    }
}

/// If this failed, no training run could be repeated, and no difference between two could be attributed to an option: a sum in
/// the order in which threads happen to end, or one by subgroups, would do it. (Other drivers than lavapipe do not read the
/// variables, and this is four times the same run.)
#[test]
fn a_model_is_the_same_to_the_bit_on_any_number_of_threads() {
    let place = place();
    for strategy in STRATEGIES {
        let trained = |options: &str, environment: &[(&str, &str)]| {
            let arguments = format!("train capture --out o --force {SMALL} --strategy {strategy} {options}");
            let arguments = format!("{arguments} --iterations 30 --test-every 0 --evaluate-every 0");
            let ran = ended(place.command(&arguments).envs(environment.iter().copied()).output().unwrap());
            assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""), "camsplat {arguments} with {environment:?}");
            (std::fs::read(place.path("o/point_cloud.ply")).unwrap(), record(&place, "o").curve)
        };
        let (model, curve) = trained("", &[]);
        assert!(curve.last().unwrap().splats > 80, "{strategy}: no refinement was tried");
        for (threads, width) in [("0", "128"), ("1", "256"), ("2", "256")] {
            let again = trained("", &[("LP_NUM_THREADS", threads), ("LP_NATIVE_VECTOR_WIDTH", width)]);
            assert_eq!(again.1, curve, "{strategy}: {threads} threads, vectors of {width} bits");
            assert!(again.0 == model, "{strategy}: {threads} threads, vectors of {width} bits: another model");
        }
        assert!(trained("--seed 1", &[]).0 != model, "{strategy}: the seed is ignored");
    }
}

/// If this failed, a user would learn from an error hours later that the device is too small, or be kept from a run that fits.
#[test]
fn a_dry_run_announces_what_a_run_takes_and_writes_nothing() {
    let place = place();
    for options in ["--strategy mcmc", "--strategy adc", "--exposure --refine-poses"] {
        let run = format!("train capture --max-splats 20000 --iterations 8 --test-every 0 {options}");
        let before = place.files("");
        let dry = place.done(&format!("{run} --out dry --dry-run")).out;
        assert_eq!(place.files(""), before);
        let line = dry.lines().find(|line| line.starts_with("all ")).unwrap_or_else(|| panic!("no sum: {dry}"));
        let announced: f64 = line.split_whitespace().nth(1).unwrap().parse().unwrap();
        assert!(dry.lines().last().unwrap().starts_with("fits "), "{dry}");
        place.done(&format!("{run} --out o --force"));
        let memory = record(&place, "o").memory;
        let [told, peak] = [memory.announced, memory.peak].map(|bytes| bytes as f64 / f64::from(1 << 20));
        assert!((told - announced).abs() < 0.01, "{options}: {announced} MiB, and then {told}");
        assert!((peak / announced - 1.0).abs() < 0.05, "{options}: {announced} MiB were announced and {peak} taken");
    }
}

/// If this failed, other trainers would not find the photos of corrected cameras, or training on these would remove them first.
#[test]
fn corrected_cameras_are_a_capture_that_is_not_replaced() {
    let place = place();
    let run = format!("--iterations 30 --test-every 4 {SMALL}");
    let ran = place.done(&format!("train capture --out o --refine-poses {run}"));
    assert!(ran.out.contains("poses    5 steps for each photo correct 0.1 degrees or so"), "{}", ran.out);
    assert!(ran.out.contains("poses    turned by ") && ran.out.contains("o/refined/transforms.json"), "{}", ran.out);
    let corrected = place.read("o/refined/transforms.json");
    let again = format!("train o/refined --outside-paths --force {run}");
    assert_refused(&place, &[(&format!("{again} --out o"), &["o/refined is in it and might be replaced"])]);
    let test = "train capture --test o/refined --iterations 30 --out o --force";
    assert_refused(&place, &[(test, &["o/refined is in it and might be replaced"])]);
    assert_eq!(place.read("o/refined/transforms.json"), corrected);
    let ran = place.done(&format!("{again} --out next"));
    assert!(ran.out.contains("photos   4 to train on, 2 to test with"), "{}", ran.out);
}

/// If this failed, the driver would be asked for something that Vulkan does not allow: it works here and fails elsewhere.
#[test]
fn the_validation_layers_are_silent_over_a_whole_run() {
    let place = place();
    for options in [
        "--strategy mcmc --antialiased --profile",
        "--strategy adc --background random",
        "--exposure --refine-poses --test-every 4",
    ] {
        let arguments = format!("train capture --out o --force {SMALL} --iterations 24 --save-every 9 {options}");
        let ran = ended(place.command(&arguments).env("CAMSPLAT_VALIDATION", "1").output().unwrap());
        assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""), "camsplat {arguments}");
    }
}

/// If this failed, objects that were cut out would be trained with a black rim, or a user's own choice be overruled.
#[test]
fn photos_with_alpha_or_masks_are_trained_over_white() {
    let place = place();
    capture::write(&place.path("masked"), 3, 48);
    std::fs::create_dir(place.path("masked/masks")).unwrap();
    capture::write(&place.path("cut-out"), 3, 48);
    for name in ["000.png", "001.png", "002.png"] {
        let mask = image::GrayImage::from_fn(48, 41, |x, _| image::Luma([if x < 24 { 255 } else { 0 }]));
        mask.save(place.path("masked/masks").join(name)).unwrap();
        let file = place.path("cut-out/images").join(name);
        let mut picture = image::open(&file).unwrap().into_rgba8();
        picture.pixels_mut().filter(|pixel| pixel.0[..3] == [0; 3]).for_each(|pixel| pixel.0[3] = 0);
        picture.save(&file).unwrap();
    }
    let cases = [
        ("capture", "", Background::Black),
        ("cut-out", "", Background::White),
        ("cut-out", "--background black", Background::Black),
        ("masked", "", Background::White),
        ("capture", "--background white", Background::White),
    ];
    for (capture, options, expected) in cases {
        let run = format!("train {capture} --out o --force {SMALL} --iterations 2 --evaluate-every 0");
        place.done(&format!("{run} --test-every 3 {options}"));
        assert_eq!(record(&place, "o").config.background, expected, "{capture} {options}");
        // The corner shows nothing of the object, only what lies behind.
        let corner = image::open(place.path("o/test/000.png")).unwrap().into_rgb8().get_pixel(47, 40).0;
        let level = if expected == Background::White { 255 } else { 0 };
        assert!(corner.iter().all(|value| value.abs_diff(level) < 40), "{capture} {options}: {corner:?}");
    }
}

/// If this failed, a user who keeps test photos of their own, of another camera, could not test with them.
#[test]
fn test_photos_of_another_capture_may_be_of_another_size() {
    let place = place();
    capture::write(&place.path("others"), 2, 29);
    let options = "--iterations 2 --evaluate-every 1 --test others";
    let ran = place.done(&format!("train capture --out o {SMALL} {options}"));
    assert!(ran.out.contains("photos   9 to train on, 2 to test with"), "{}", ran.out);
    let record = record(&place, "o");
    assert_eq!((record.photos.train, record.test_views.len()), (9, 2));
    // LPIPS needs larger pictures than these; that costs nothing but its column.
    assert!(record.test_views.iter().all(|view| view.quality.psnr > 0.0 && view.quality.lpips.is_none()));
    assert!(record.memory.peak as f64 <= 1.05 * record.memory.announced as f64, "{:?}", record.memory);
    assert_eq!(image::image_dimensions(place.path("o/test/001.png")).unwrap(), (29, 22));
}

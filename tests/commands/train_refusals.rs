//! What bad input gets from `camsplat train`: one line with what is wrong, where, and what to do; nothing written, nothing
//! lost.

use crate::support::command::{Place, assert_refused};
use crate::support::splats::capture;
use std::fs;

const SMALL: &str = "--out o --iterations 2 --max-splats 100";

/// A folder with a capture of six photos in it, and another, `odd`, to be spoilt.
fn place() -> Place {
    let place = Place::new();
    for folder in ["capture", "odd"] {
        capture::write(&place.path(folder), 6, 32);
    }
    place
}

/// As [`assert_refused`], for training with each of the options.
#[track_caller]
fn assert_training_refused(place: &Place, capture: &str, cases: &[(&str, &[&str])]) {
    for (options, fragments) in cases {
        assert_refused(place, &[(&format!("train {capture} {options}"), fragments)]);
    }
}

/// If this failed, a typing error would be trained with, or end in a panic after the photos have been decoded.
#[test]
fn numbers_that_are_none() {
    assert_training_refused(
        &place(),
        "capture",
        &[
            ("--out o --iterations 0", &["--iterations is 0", "give 1 to"]),
            ("--out o --iterations 4294967295", &["--iterations is 4294967295", "give 1 to"]),
            ("--out o --iterations -5", &["'-5' for '--iterations"]),
            ("--out o --max-splats 0", &["--max-splats is 0", "give 1 to"]),
            ("--out o --max-splats 4294967295", &["--max-splats is 4294967295", "give 1 to"]),
            ("--out o --max-splats 60000000", &["bytes of device memory", "--max-splats"]),
            ("--out o --max-splats 60000000 --dry-run", &["bytes of device memory", "--max-splats"]),
            ("--out o --shrink 0", &["--shrink is 0", "give 1 to 64"]),
            ("--out o --shrink 65", &["--shrink is 65", "give 1 to 64"]),
            ("--out o --sh 4", &["--sh is 4", "give 0 to 3"]),
            ("--out o --init-opacity 1", &["--init-opacity is 1", "between 0 and 1"]),
            ("--out o --init-opacity nan", &["--init-opacity is NaN", "between 0 and 1"]),
            ("--out o --init-scale 0", &["--init-scale is 0", "between 0 and 100"]),
            ("--out o --init-scale inf", &["--init-scale is inf", "between 0 and 100"]),
            ("--out o --strategy adc --suppress-floaters", &["suppress", "mcmc"]),
            ("--out o --strategy best", &["'best' for '--strategy", "possible values"]),
            ("--out o --background red", &["'red' for '--background", "possible values"]),
            ("--out o --test-every 1", &["0 of 6 photos are left to train on", "--test-every"]),
            ("--out o --test-every 2 --test odd", &["--test", "cannot be used with"]),
            ("--out o --device abacus", &["no device \"abacus\"", "camsplat devices"]),
            ("", &["not provided", "--out"]),
        ],
    );
}

/// If this failed, hours of training could end in a folder that cannot be written, or overwrite a user's files.
#[test]
fn places_that_cannot_be_written() {
    let place = place();
    fs::create_dir(place.path("full")).unwrap();
    place.write("full/mine.txt", "mine");
    assert_training_refused(
        &place,
        "capture",
        &[
            ("--out full", &["full: ", "not empty", "--force"]),
            ("--out capture/points.ply", &["points.ply: ", "a file is already here", "name a folder"]),
            ("--out capture/points.ply/o", &["points.ply/o: ", "points.ply is no folder", "name another place"]),
            ("--out ..", &["..: ", "capture is in it", "name another folder"]),
            ("--out o --trace capture/points.ply/t.json", &["t.json: ", "is no folder"]),
            ("--out o --trace full", &["full: ", "name a file"]),
        ],
    );
    place.done(&format!("train capture {SMALL} --force").replace("--out o", "--out full"));
    assert_eq!(place.read("full/mine.txt"), "mine");
}

/// If this failed, a model would be trained on half a capture, on rubbish, or on nothing; or the line would have no remedy.
#[test]
fn captures_that_are_none() {
    let place = place();
    capture::write(&place.path("one"), 1, 32);
    fs::create_dir(place.path("empty")).unwrap();
    for (capture, fragments) in [
        ("one", ["one: ", "0 of 1 photos are left to train on", "take more photos"]),
        ("empty", ["empty: ", "no", "give"]),
        ("none", ["none: ", "no such file", "check the path"]),
    ] {
        assert_training_refused(&place, capture, &[(SMALL, &fragments)]);
        let test = format!("{SMALL} --test {capture}");
        if capture != "one" {
            assert_training_refused(&place, "capture", &[(&test, &fragments)]);
        }
    }
    let points = fs::read(place.path("odd/points.ply")).unwrap();
    let header = points.windows(11).position(|bytes| bytes == b"end_header\n").unwrap() + 11;
    let nan = [&points[..header], &f32::NAN.to_le_bytes(), &points[header + 4..]].concat();
    place.write("odd/points.ply", nan);
    // One bad point costs no more than itself.
    let told = place.done("train odd --out without --iterations 2 --max-splats 100").out;
    assert!(told.contains("1 of 80 points are not finite and were left out"), "{told}");
    place.write("odd/points.ply", &points[..points.len() - 7]);
    assert_training_refused(&place, "odd", &[(SMALL, &["odd/points.ply: ", "cut short"])]);
}

/// If this failed, a damaged photo would pass for a black one, or cost the run that was in the folder.
#[test]
fn photos_that_are_damaged() {
    let place = place();
    place.done(&format!("train capture {SMALL}"));
    let kept = |name: &str| fs::read(place.path("o").join(name)).unwrap();
    let products = ["checkpoint.bin", "point_cloud.ply", "train.json", "report.html", "test/000.png"];
    let before = products.map(kept);
    let whole = fs::read(place.path("odd/images/003.png")).unwrap();
    let new = SMALL.replace("--out o", "--out new");
    let anew = format!("{SMALL} --force");

    // Damaged inside: that is seen when it is decoded. Leaving it out is for users who know of it.
    place.write("odd/images/003.png", &whole[..whole.len() / 2]);
    let what: [&str; 3] = ["odd/images/003.png: ", "cannot be decoded", "bring back a whole one"];
    let skipping = format!("{new} --skip-missing");
    assert_training_refused(&place, "odd", &[(&new, &what), (&anew, &what), (&skipping, &what)]);
    // One that is tested with is needed as well.
    place.write("odd/images/003.png", &whole);
    let first = fs::read(place.path("odd/images/000.png")).unwrap();
    place.write("odd/images/000.png", &first[..first.len() / 2]);
    let what: [&str; 2] = ["odd/images/000.png: ", "cannot be decoded"];
    assert_training_refused(&place, "odd", &[(&new, &what), (&anew, &what)]);
    place.write("odd/images/000.png", &first);

    place.write("odd/images/003.png", "an apple");
    let what: [&str; 3] = ["odd: ", "images/003.png", "--skip-missing"];
    assert_training_refused(&place, "odd", &[(&new, &what), (&anew, &what)]);
    assert!(products.map(kept) == before, "a refused run harmed the one that stood there");
    let ran = place.done(&format!("train odd {skipping}"));
    assert!(ran.out.contains("missing or unreadable: odd/images/003.png"), "{}", ran.out);
    assert!(ran.out.contains("photos   4 to train on, 1 to test with"), "{}", ran.out);
}

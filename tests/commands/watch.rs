//! `camsplat watch`: a capture while it is taken.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;

use super::frames::{ffmpeg, filmed, has_ffmpeg};
use super::shots::{capture_wall, row};
use super::view_command::Served;
use crate::support::browser::rendered_at;
use crate::support::command::{Place, assert_refused};
use serde_json::Value;

/// What the page shows.
fn board(served: &Served) -> Value {
    let (status, text) = served.get("/board/-1");
    assert_eq!(status, 200, "{text}");
    serde_json::from_str(&text).unwrap()
}

/// Copies a capture over another, poses and photos.
fn arrive(place: &Place, from: &str, to: &str) {
    for name in place.files(from) {
        let target = place.path(to).join(&name);
        fs::create_dir_all(target.parent().unwrap()).unwrap();
        fs::copy(place.path(from).join(&name), target).unwrap();
    }
}

/// If this failed, a photographer would be advised on photos of before, hear nothing of one that is of no use, or find files in the capture.
#[test]
fn advice_follows_the_photos_as_they_come_and_go() {
    let place = Place::new();
    capture_wall(&place.path("wall"), &row("png")[..5], false);
    capture_wall(&place.path("more"), &row("png")[..8], false);
    // In one and the same region: what viewers see of a larger one is more.
    let mut served = Served::begun(&place, "watch wall --box=-4,-6,0.4,4,-2,3", "page ");
    served.until("photos   5 of 5 have a pose");
    served.until("next 5");
    let first = board(&served);
    let advice = &first["advice"];
    let next = advice["next"].as_array().unwrap();
    let notes = advice["notes"].to_string();
    assert!(notes.contains("5 photos: 5 images found") && notes.contains("region   box"), "{notes}");
    assert_eq!((next.len(), first["photos"].as_u64(), first["flaws"].as_array().unwrap().len()), (5, Some(5), 0));
    assert!(advice["gain_db"].as_f64().unwrap() > 0.3 && advice["map"].as_str().unwrap().contains("url(#unseen)"));
    for place in next {
        let words = place["words"].as_str().unwrap();
        assert!(
            served.said.contains(words) && place["picture"].as_str().unwrap().starts_with("data:image/jpeg"),
            "{words}"
        );
        assert!(place["start"].as_str().unwrap().starts_with("data:image/jpeg"), "{words}");
    }
    // A photo that no program can read is named, and costs nothing else.
    place.write("wall/images/broken.png", "no picture");
    served.until("photo    broken.png: cannot be read");
    arrive(&place, "more", "wall");
    served.until("photos   8 of 9 have a pose");
    served.until("next 5");
    let second = board(&served);
    assert_eq!(second["posed"], 8);
    assert!(second["advice"]["unseen"].as_f64().unwrap() < advice["unseen"].as_f64().unwrap(), "{second}");
    assert_eq!(second["flaws"][0]["name"], "broken.png");
    let version = second["version"].as_u64().unwrap();
    let (_, short) = served.get(&format!("/board/{version}"));
    assert_eq!(serde_json::from_str::<Value>(&short).unwrap(), serde_json::json!({ "version": version }));
    // A photo that is deleted no longer counts.
    fs::remove_file(place.path("wall/images/broken.png")).unwrap();
    fs::remove_file(place.path("wall/images/003.png")).unwrap();
    served.until("photos   7 of 7 have a pose");
    served.until("next 5");
    let url = served.url();
    if let Some(page) = rendered_at(&url, &["--window-size=390,844"]) {
        assert!(page.contains(">7 photos, 7 placed<") && page.matches(">start here<").count() == 5, "{page}");
        assert!(page.contains(">Not yet enough<") || page.contains(">Nearly enough<"), "{page}");
    }
    served.end();
    let mut expected = place.files("more").into_iter().filter(|name| name != "images/003.png").collect::<Vec<_>>();
    expected.extend([".camsplat/lock", ".camsplat/photos.json"].map(str::to_owned));
    expected.sort();
    assert_eq!(place.files("wall"), expected, "something else was written into the capture");
}

/// If this failed, who is on the same network would see the photos without the address, or could change something.
#[test]
fn a_shared_page_is_for_those_who_have_its_address() {
    let place = Place::new();
    capture_wall(&place.path("wall"), &row("png")[..4], false);
    let mut served = Served::begun(&place, "watch wall --share --out state", "page ");
    served.until("photos   4 of 4 have a pose");
    // Where there is no network it says so; else by an address to type and one to scan.
    let phone =
        served.said.contains(&format!("{}/: whoever has this address", served.secret)) && served.said.contains('█');
    assert!(phone || served.said.contains("no local network"), "{}", served.said);
    let here = format!("192.0.2.7:{}", served.url().rsplit(':').next().unwrap().split('/').next().unwrap());
    assert_eq!(served.ask("GET", "/", &here).0, 200, "a phone would be refused");
    assert_eq!(served.ask("GET", "/", "evil.example").0, 403);
    assert_eq!(served.ask("POST", "/board/-1", &here).0, 405);
    for path in ["/none", "/images/000.png", "/../wall/images/000.png", "/board", "/board/1/2", "/board/x"] {
        assert_eq!(served.ask("GET", path, &here).0, 404, "{path}");
    }
    assert_eq!(served.ask("GET", "/board/-1", &here).0, 200);
    served.end();
    assert!(!place.path("wall/.camsplat").exists() && place.path("state/photos.json").exists());
}

/// A program in place of Python, which says that it has pycolmap 9.9 and does `work` where it is asked for poses.
fn python(place: &Place, work: &str) {
    let script = format!("#!/bin/sh\ncase \"$2\" in \"import pycolmap; \"*) echo 9.9; exit;; esac\n{work}\n");
    place.write("python", script);
    fs::set_permissions(place.path("python"), fs::Permissions::from_mode(0o755)).unwrap();
}

/// If this failed, a folder of plain photos would get no advice, one that COLMAP fails on would stop everything, or photos that it does not
/// place would go unnoticed.
#[test]
fn photos_without_poses_are_placed_by_structure_from_motion() {
    let place = Place::new();
    capture_wall(&place.path("wall"), &row("png")[..6], false);
    fs::create_dir(place.path("photos")).unwrap();
    for i in 0..3 {
        fs::copy(place.path(&format!("wall/images/{i:03}.png")), place.path(&format!("photos/{i:03}.png"))).unwrap();
    }
    python(&place, "echo matching >&2; echo no luck >&2; exit 3");
    let options = format!("watch photos --python {}", place.path("python").display());
    let mut served = Served::begun(&place, &options, "page ");
    assert!(served.said.contains("by COLMAP (pycolmap 9.9)"), "{}", served.said);
    let failed = served.until("failed ");
    assert!(failed.contains("pycolmap 9.9 failed: no luck"), "{failed}");
    assert_eq!(board(&served)["fault"].as_str(), failed.strip_prefix("failed   "));
    // The next photo gets another chance, with a program that places all but one.
    let work = place.path("photos/.camsplat/sfm/sparse");
    let names: Vec<String> = (0..5).map(|i| format!("\"{i:03}.png\"")).collect();
    python(
        &place,
        &format!(
            "mkdir -p {0}; cp -r {1} {0}; echo '{{\"posed\": [{2}]}}'",
            work.display(),
            place.path("wall/sparse/0").display(),
            names.join(", ")
        ),
    );
    for i in 3..6 {
        fs::copy(place.path(&format!("wall/images/{i:03}.png")), place.path(&format!("photos/{i:03}.png"))).unwrap();
    }
    served.until("photo    005.png: could not be placed");
    served.until("next 5");
    let shown = board(&served);
    assert_eq!((shown["posed"].as_u64(), &shown["fault"]), (Some(5), &Value::Null), "{shown}");
    served.end();
    assert_eq!(fs::read_dir(place.path("photos")).unwrap().count(), 7, "six photos and one hidden folder");
}

/// If this failed, who films would have to take the video apart first, or a video that cannot be read would go unnoticed.
#[test]
fn frames_of_a_video_are_photos() {
    if !has_ffmpeg() {
        return;
    }
    let place = filmed();
    python(&place, r#"echo '{"posed": []}'"#);
    fs::create_dir(place.path("photos")).unwrap();
    place.write("photos/broken.mp4", "no video");
    fs::create_dir(place.path("photos/state")).unwrap();
    // However it is written, what is worked out is not taken for photos.
    let options = format!("watch photos --out ./photos/../photos/state --python {}", place.path("python").display());
    let mut served = Served::begun(&place, &options, "page ");
    assert!(served.until("photo    broken.mp4: ").contains("ffmpeg finds no video in it"));
    ffmpeg(&place, "-framerate 10 -i walk/%03d.png -pix_fmt yuv420p photos/.part.mp4");
    fs::rename(place.path("photos/.part.mp4"), place.path("photos/walk.mp4")).unwrap();
    let said = served.until("video    walk.mp4: ");
    let frames: u64 = said.split_whitespace().nth(2).unwrap().parse().unwrap();
    let of_walk = |name: &&String| name.starts_with("state/videos/walk.mp4/images/");
    assert!(frames >= 8 && place.files("photos").iter().filter(of_walk).count() as u64 == frames, "{said}");
    await_photos(&served, frames);
    // The next run does not read it again, and a video that is deleted takes its frames along.
    served.end();
    let served = Served::begun(&place, &options, "page ");
    await_photos(&served, frames);
    fs::remove_file(place.path("photos/walk.mp4")).unwrap();
    await_photos(&served, 0);
    let said = served.end();
    assert!(!said.contains("\nvideo "), "{said}");
}

/// Waits until so many photos are shown.
fn await_photos(served: &Served, number: u64) {
    while board(served)["photos"].as_u64() != Some(number) {
        std::thread::yield_now();
    }
}

/// If this failed, poses that come later would be ignored, or a folder that is away for a moment would count as deleted photos.
#[test]
fn poses_may_come_later_and_a_folder_may_go_and_come_back() {
    let place = Place::new();
    capture_wall(&place.path("wall"), &row("png")[..5], false);
    fs::create_dir(place.path("photos")).unwrap();
    fs::rename(place.path("wall/images"), place.path("photos/images")).unwrap();
    place.write("photos/clip.mp4", "no video");
    python(&place, r#"echo '{"posed": []}'"#);
    let options = format!("watch photos --out state --python {}", place.path("python").display());
    let mut served = Served::begun(&place, &options, "page ");
    served.until("photos   0 with a pose");
    fs::rename(place.path("wall/sparse"), place.path("photos/sparse")).unwrap();
    served.until("photos   5 of 5 have a pose");
    served.until("next 5");
    fs::rename(place.path("photos"), place.path("away")).unwrap();
    served.until("failed   photos is gone");
    let shown = board(&served);
    assert!(shown["photos"] == 5 && shown["fault"].as_str().unwrap().contains("when it is back"), "{shown}");
    fs::rename(place.path("away"), place.path("photos")).unwrap();
    served.until("photos   5 of 5 have a pose");
    served.until("next 5");
    // A video has no poses beside it, and is not read where there are any.
    let shown = board(&served);
    assert!(shown["fault"].is_null() && shown["flaws"].as_array().unwrap().is_empty(), "{shown}");
    served.end();
}

/// If this failed, Ctrl-C would wait for minutes of structure from motion, or leave it running.
#[test]
fn a_stop_ends_structure_from_motion_too() {
    let place = Place::new();
    capture_wall(&place.path("wall"), &row("png")[..3], false);
    python(&place, "echo $$ > pid; exec tail -f /dev/null");
    let options = format!("watch wall/images --python {} --out state", place.path("python").display());
    let served = Served::begun(&place, &options, "page ");
    while !place.path("pid").exists() || place.read("pid").trim().is_empty() {
        std::thread::yield_now();
    }
    let process = place.read("pid").trim().to_owned();
    served.end();
    assert!(!Path::new("/proc").join(process).exists(), "it still runs");
}

/// If this failed, a word in the wrong place would be watched for ever.
#[test]
fn what_cannot_be_watched_is_refused() {
    let place = Place::new();
    fs::create_dir(place.path("photos")).unwrap();
    assert_refused(
        &place,
        &[
            ("watch nowhere", &["nowhere: ", "no such file or folder", "check the path"]),
            ("watch ball.ply", &["ball.ply: ", "no folder"]),
            ("watch photos --python none-such", &["none-such cannot be run", "pip install pycolmap", "--python"]),
            ("watch photos --python true", &["true has no pycolmap", "pip install pycolmap"]),
        ],
    );
    // What lies in the folder for its own files is not written over, and nobody else works there.
    capture_wall(&place.path("wall"), &row("png")[..3], false);
    fs::create_dir(place.path("mine")).unwrap();
    place.write("mine/photos.json", r#"{"mine": 1}"#);
    let refused = place.run("watch wall --out mine --no-browser");
    assert!(refused.code == Some(2) && refused.err.contains("photos.json: this is not what"), "{}", refused.err);
    assert_eq!(place.read("mine/photos.json"), r#"{"mine": 1}"#);
    let refused = place.run("watch wall --out wall/../wall --no-browser");
    assert!(refused.code == Some(2) && refused.err.contains("the photos arrive here"), "{}", refused.err);
    let served = Served::begun(&place, "watch wall", "page ");
    let refused = place.run("watch wall --no-browser");
    assert!(refused.code == Some(2) && refused.err.contains("another `camsplat watch` is at work"), "{}", refused.err);
    served.end();
}

//! `camsplat frames`: from a walk, as pictures and as a video, to the frames that structure from motion is run on.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::support::command::{Place, assert_refused, ended, names, read_until, stop};
use camsplat::scene::random;
use image::{Rgb, RgbImage};

const SIZE: [u32; 2] = [240, 136];

/// Smooth noise in [0, 1]: values on a lattice of `size` pixels, blended.
fn noise(seed: u64, size: f64, [x, y]: [f64; 2]) -> f64 {
    let (x, y) = (x / size, y / size);
    let (i, j) = (x.floor(), y.floor());
    let lattice = |i: f64, j: f64| random::uniforms(seed, 1, ((i as i32 & 0xfff) << 12 | (j as i32 & 0xfff)) as u32)[0];
    let row = |j: f64| (1.0 - (x - i)) * lattice(i, j) + (x - i) * lattice(i + 1.0, j);
    (1.0 - (y - j)) * row(j) + (y - j) * row(j + 1.0)
}

/// A long wall with pictures on it, as colours.
fn wall(at: [f64; 2]) -> [f64; 3] {
    let grey = 80.0 * noise(1, 36.0, at) + 90.0 * noise(2, 11.0, at) + 60.0 * noise(3, 3.5, at);
    let tint = 40.0 * noise(4, 60.0, at);
    [grey + tint * 0.5, grey, grey + 20.0 - 0.5 * tint]
}

/// The wall from `x`, smeared over `blur` pixels.
fn view(x: f64, y: f64, blur: f64) -> RgbImage {
    let samples = (2.0 * blur).ceil().max(1.0) as u32;
    RgbImage::from_fn(SIZE[0], SIZE[1], |u, v| {
        let mut sum = [0.0; 3];
        for i in 0..samples {
            let offset = blur * ((f64::from(i) + 0.5) / f64::from(samples) - 0.5);
            let colour = wall([f64::from(u) + x + offset, f64::from(v) + y]);
            sum.iter_mut().zip(colour).for_each(|(sum, value)| *sum += value / f64::from(samples));
        }
        Rgb(sum.map(|value| value.round().clamp(0.0, 255.0) as u8))
    })
}

/// A frame of the walk.
struct Taken {
    /// True position along the wall in pixels.
    x: f64,
    y: f64,
    blur: f64,
}

const FRAMES: usize = 150;
/// Frames in which the camera stands still in a trembling hand.
const PAUSE: std::ops::Range<usize> = 45..85;

/// A walk along the wall: slowly, a pause, fast, slowly again, with blurred frames on the way.
fn walk() -> Vec<Taken> {
    let mut at = 0.0;
    let taken = |i: usize| {
        at += match i {
            _ if PAUSE.contains(&i) => 0.0,
            85..110 => 6.0,
            _ => 2.0,
        };
        let tremble = if PAUSE.contains(&i) { (1.7 * i as f64).sin() } else { 0.0 };
        let blur = if (i + 5) % 12 < 5 { 7.0 } else { 0.0 };
        Taken { x: at + tremble, y: 0.4 * tremble, blur }
    };
    (0..FRAMES).map(taken).collect()
}

/// A place with the walk as `walk/000.png` and so on.
pub fn filmed() -> Place {
    let place = Place::new();
    fs::create_dir(place.path("walk")).unwrap();
    for (i, Taken { x, y, blur }) in walk().into_iter().enumerate() {
        view(x, y, blur).save(place.path(&format!("walk/{i:03}.png"))).unwrap();
    }
    place
}

/// A line of frames.csv.
struct Row {
    name: String,
    time: Option<f64>,
    travel: f64,
    is_chosen: bool,
}

fn rows(place: &Place, folder: &str) -> Vec<Row> {
    let text = place.read(&format!("{folder}/frames.csv"));
    assert!(text.starts_with("frame,name,time_s,sharpness,motion,travel,followed,chosen\n"), "{text}");
    let row = |(i, line): (usize, &str)| {
        let cells: Vec<&str> = line.split(',').collect();
        assert_eq!(cells[0], i.to_string());
        Row {
            name: cells[1].trim_matches('"').to_owned(),
            time: cells[2].parse().ok(),
            travel: cells[5].parse().unwrap(),
            is_chosen: cells[7] == "1",
        }
    };
    text.lines().skip(1).enumerate().map(row).collect()
}

fn chosen(rows: &[Row]) -> Vec<usize> {
    rows.iter().enumerate().filter(|(_, row)| row.is_chosen).map(|(i, _)| i).collect()
}

/// If this failed, frames would crowd where the camera paused, be blurred where sharp ones are beside them, or be other files than those
/// that frames.csv names; and the same walk would give other frames the next time.
#[test]
fn chosen_frames_are_even_in_true_motion_and_sharp() {
    let place = filmed();
    // A step is then about as long as the longest blurred stretch: around longer ones nothing can step.
    let ran = place.done("frames walk --count 12 --out out");
    let rows = rows(&place, "out");
    let (taken, chosen) = (walk(), chosen(&rows));
    assert_eq!((rows.len(), chosen.len()), (FRAMES, 12));
    let travel = rows.last().unwrap().travel;
    let known = taken.last().unwrap().x / f64::from(SIZE[0]);
    assert!((travel / known - 1.0).abs() < 0.03, "{travel} and not {known}");

    let even = known * f64::from(SIZE[0]) / 11.0;
    for pair in chosen.windows(2) {
        let gap = taken[pair[1]].x - taken[pair[0]].x;
        assert!((0.4 * even..1.6 * even).contains(&gap), "{pair:?} are {gap} pixels apart, and even would be {even}");
    }
    let blurred: Vec<_> = chosen.iter().filter(|i| taken[**i].blur > 0.0).collect();
    assert!(blurred.is_empty(), "{blurred:?} of {chosen:?}");
    assert!(chosen.iter().filter(|i| PAUSE.contains(*i)).count() <= 1, "{chosen:?}");

    let files: Vec<String> = chosen.iter().map(|i| format!("images/{i:03}.png")).collect();
    assert_eq!(place.files("out"), [vec!["frames.csv".to_owned()], files].concat());
    for i in &chosen {
        let [from, to] =
            ["walk", "out/images"].map(|folder| fs::read(place.path(&format!("{folder}/{i:03}.png"))).unwrap());
        assert!(from == to, "{i} was changed on its way");
    }
    for line in [
        "found    150 frames",
        "chosen   12 frames, one for each ",
        "colmap feature_extractor --database_path out/database.db --image_path out/images \\",
        "colmap exhaustive_matcher --database_path out/database.db",
        "colmap mapper --database_path out/database.db --image_path out/images --output_path out/sparse",
        "camsplat select out --count 6 --out out-best",
    ] {
        assert!(ran.out.contains(line), "{line} is not in\n{}", ran.out);
    }
    assert_eq!(ran.warnings(), [""; 0]);
    place.done("frames walk --count 12 --out again");
    assert_eq!(place.read("again/frames.csv"), place.read("out/frames.csv"));
}

/// If this failed, a camera on a tripod would give copies of one picture, or users would wonder where their frames are.
#[test]
fn fewer_come_out_where_the_picture_stays_the_same() {
    let place = Place::new();
    fs::create_dir(place.path("still")).unwrap();
    for i in 0..30 {
        let tremble = (1.3 * f64::from(i)).sin();
        view(10.0 + 0.5 * tremble + if i < 15 { 0.0 } else { 20.0 }, 0.0, 0.0)
            .save(place.path(&format!("still/{i}.jpg")))
            .unwrap();
    }
    let ran = place.done("frames still --count 12 --out out");
    let rows = rows(&place, "out");
    let chosen = chosen(&rows);
    assert!(matches!(chosen[..], [a, b] if a < 15 && b >= 15), "{chosen:?}");
    assert!(ran.out.contains("12 were requested: more would be near-duplicates"), "{}", ran.out);
    // COLMAP takes 10.jpg before 9.jpg: the frames are numbered, so that it has them in the order in which they were taken.
    assert_eq!((rows[9].name.as_str(), rows[10].name.as_str()), ("000009_9.jpg", "000010_10.jpg"));
}

/// If this failed, COLMAP would split a walk or lose half of it, and nothing would have said so beforehand.
#[test]
fn gaps_and_cuts_are_reported_with_what_helps() {
    let place = Place::new();
    fs::create_dir(place.path("walk")).unwrap();
    for i in 0..80 {
        let cut = if i < 50 { 0.0 } else { 9000.0 };
        view(cut + 12.0 * f64::from(i), 0.0, 0.0).save(place.path(&format!("walk/{i:02}.png"))).unwrap();
    }
    let ran = place.done("frames walk --count 5 --out few");
    assert!(ran.out.contains("may lose the connection in"), "{}", ran.out);
    let advised: usize = ran.out.split("--count ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    let ran = place.done(&format!("frames walk --count {advised} --out enough"));
    assert!(!ran.out.contains("may lose the connection"), "{}", ran.out);
    assert!(ran.out.contains("may split the walk") && ran.out.contains("slower: 4"), "{}", ran.out);
}

/// If this failed, bad input would leave half of a folder, or be refused without saying what to give.
#[test]
fn what_cannot_be_used_is_refused_in_a_line() {
    let place = Place::new();
    for folder in ["empty", "film", "mixed", "full"] {
        fs::create_dir(place.path(folder)).unwrap();
    }
    place.write("film/walk.MOV", "film");
    place.write("full/mine.txt", "mine");
    RgbImage::new(40, 30).save(place.path("mixed/a.png")).unwrap();
    RgbImage::new(30, 40).save(place.path("mixed/b.png")).unwrap();
    assert_refused(
        &place,
        &[
            ("frames nothing.mp4 --count 9 --out o", &["nothing.mp4: there is no such file"]),
            ("frames empty --count 9 --out o", &["empty: the folder has no pictures", "a video"]),
            ("frames film --count 9 --out o", &["the video \"walk.MOV\"; give that: film/walk.MOV"]),
            ("frames mixed/a.png --count 9 --out o", &["mixed/a.png: this is a single picture", "the folder"]),
            ("frames mixed --count 9 --out o", &["mixed/b.png: it is 30 x 40 pixels", "40 x 30"]),
            ("frames mixed --count 1 --out o", &["--count", "2..=5000"]),
            ("frames mixed --count 9 --out full", &["full: the folder is not empty", "--force"]),
            ("frames mixed --count 9 --out mixed --force", &["mixed", "name another folder"]),
        ],
    );
    place.write("mixed/b.png", "no picture");
    assert_refused(&place, &[("frames mixed --count 9 --out o", &["mixed/b.png", "cannot be decoded"])]);
    let mut command = place.command("frames film/walk.MOV --count 9 --out o");
    let ran = ended(command.env("PATH", "").output().unwrap());
    assert_eq!(ran.code, Some(2), "{}", ran.err);
    assert!(
        ran.err.contains("ffmpeg") && ran.err.contains("install it") && ran.err.lines().count() == 1,
        "{}",
        ran.err
    );
    if has_ffmpeg() {
        assert_refused(
            &place,
            &[("frames film/walk.MOV --count 9 --out o", &["ffmpeg finds no video in it (", "give a video"])],
        );
    }
}

/// If this failed, Ctrl-C would leave a folder that looks finished and is not.
#[test]
fn a_stopped_run_leaves_nothing() {
    let place = Place::new();
    fs::create_dir(place.path("walk")).unwrap();
    let picture = image::imageops::resize(&view(0.0, 0.0, 0.0), 1600, 900, image::imageops::FilterType::Nearest);
    picture.save(place.path("walk/000.png")).unwrap();
    for i in 1..200 {
        fs::hard_link(place.path("walk/000.png"), place.path(&format!("walk/{i:03}.png"))).unwrap();
    }
    let mut child = place.command("frames walk --count 9 --out o").spawn().unwrap();
    let output = read_until(&mut child, "running");
    let stopped = stop(child, output, "-INT");
    assert_eq!((stopped.code, stopped.err.as_str()), (Some(130), ""), "{}", stopped.out);
    assert!(stopped.out.contains("nothing is written"), "{}", stopped.out);
    assert_eq!(names(&place.path("")), ["ball.ply", "walk"]);
}

/// If this failed, pictures of an earlier run would go into COLMAP beside the new ones without a word.
#[test]
fn what_an_earlier_run_left_is_reported() {
    let place = filmed();
    place.done("frames walk --count 20 --out out");
    place.write("out/database.db", "");
    let ran = place.done("frames walk --count 7 --out out --force");
    assert!(
        ran.out.contains("other pictures, which COLMAP takes too")
            && ran.out.contains("database.db is of an earlier run"),
        "{}",
        ran.out
    );
}

pub fn has_ffmpeg() -> bool {
    let found = Command::new("ffmpeg").arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
    if !found {
        println!("skipped: there is no ffmpeg");
    }
    found
}

/// Runs ffmpeg with arguments separated by spaces.
pub fn ffmpeg(place: &Place, arguments: &str) {
    let mut command = Command::new("ffmpeg");
    command.args(["-hide_banner", "-loglevel", "error", "-nostdin"]).args(arguments.split_whitespace());
    let output = command.current_dir(place.path("")).output().unwrap();
    assert!(output.status.success(), "ffmpeg {arguments}: {}", String::from_utf8_lossy(&output.stderr));
}

/// Largest mean difference of a colour between two pictures.
fn difference(a: &Path, b: &Path) -> f64 {
    let [a, b] = [a, b].map(|path| image::open(path).unwrap().to_rgb8());
    assert_eq!(a.dimensions(), b.dimensions());
    let mean = |channel: usize| {
        let values = |image: &RgbImage| image.pixels().map(|pixel| f64::from(pixel[channel])).collect::<Vec<_>>();
        let (a, b) = (values(&a), values(&b));
        a.iter().zip(&b).map(|(a, b)| (a - b).abs()).sum::<f64>() / a.len() as f64
    };
    (0..3).map(mean).fold(0.0, f64::max)
}

/// If this failed, frames of a video would be others than those that were chosen, in other colours, or at other times; or a name
/// would be taken for an option, a pattern or an address.
#[test]
fn a_video_gives_the_frames_that_its_pictures_give() {
    if !has_ffmpeg() {
        return;
    }
    let place = filmed();
    place.done("frames walk --count 20 --out pictures");
    ffmpeg(&place, "-framerate 25 -i walk/%03d.png -c:v ffv1 walk.mkv");
    fs::rename(place.path("walk.mkv"), place.path("-i http:%03d walk.mkv")).unwrap();
    let film = |options: &[&str]| {
        let mut command = place.command("frames");
        let ran = ended(
            command.args(["--count", "20"]).args(options).args(["--", "-i http:%03d walk.mkv"]).output().unwrap(),
        );
        assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""), "{}", ran.out);
        ran.out
    };
    let out = film(&["--out", "jpg %02d"]);
    assert!(out.contains("found    150 frames in 6.0 s") && out.contains("stands still for 1."), "{out}");
    assert!(out.contains("--image_path 'jpg %02d/images'"), "{out}");
    film(&["--png", "--out", "png"]);
    let known = chosen(&rows(&place, "pictures"));
    for (folder, extension, most) in [("png", "png", 0.1), ("jpg %02d", "jpg", 6.0)] {
        let rows = rows(&place, folder);
        assert_eq!((chosen(&rows), rows.len()), (known.clone(), FRAMES));
        assert!((rows[100].time.unwrap() - 4.0).abs() < 0.01);
        let files: Vec<String> = known.iter().map(|i| format!("images/frame_{i:06}.{extension}")).collect();
        assert_eq!(place.files(folder), [vec!["frames.csv".to_owned()], files].concat());
        for i in &known {
            let file = place.path(&format!("{folder}/images/frame_{i:06}.{extension}"));
            let off = difference(&file, &place.path(&format!("walk/{i:03}.png")));
            assert!(off < most, "{} is {off} off", file.display());
        }
    }
    assert_eq!(names(&place.path("")).len(), 6, "{:?}", names(&place.path("")));
}

/// If this failed, upright phone videos would give frames that lie on their side, or frames of a video with uneven times be taken
/// twice.
#[test]
fn turned_videos_and_uneven_times_are_respected() {
    if !has_ffmpeg() {
        return;
    }
    let place = filmed();
    // Two films in one: the second half at a quarter of the rate. Colours as cameras have them.
    ffmpeg(
        &place,
        "-framerate 25 -i walk/%03d.png -vf setpts='if(gt(N,75),75+4*(N-75),N)/25/TB',scale=out_color_matrix=bt709,format=yuv420p \
         -fps_mode vfr -c:v mpeg4 -q:v 1 -colorspace bt709 flat.mp4",
    );
    let turned = Command::new("ffmpeg")
        .args([
            "-hide_banner",
            "-loglevel",
            "error",
            "-nostdin",
            "-i",
            "flat.mp4",
            "-c",
            "copy",
            "-metadata:s:v:0",
            "rotate=90",
        ])
        .arg("turned.mp4")
        .current_dir(place.path(""))
        .status()
        .unwrap();
    place.done("frames flat.mp4 --count 10 --out flat");
    let rows_of_flat = rows(&place, "flat");
    assert_eq!(rows_of_flat.len(), FRAMES);
    assert!((rows_of_flat[FRAMES - 1].time.unwrap() - (75.0 + 4.0 * 74.0) / 25.0).abs() < 0.05);
    for i in chosen(&rows_of_flat) {
        let off =
            difference(&place.path(&format!("flat/images/frame_{i:06}.jpg")), &place.path(&format!("walk/{i:03}.png")));
        assert!(off < 8.0, "frame {i} is {off} off");
    }
    assert!(turned.success());
    place.done("frames turned.mp4 --count 10 --out turned");
    let chosen = chosen(&rows(&place, "turned"));
    let first = image::open(place.path(&format!("turned/images/frame_{:06}.jpg", chosen[0]))).unwrap();
    if first.width() == SIZE[0] {
        println!("skipped: this ffmpeg does not write a turn into the file");
        return;
    }
    assert_eq!([first.height(), first.width()], SIZE);
}

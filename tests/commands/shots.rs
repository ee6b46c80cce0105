//! The shot list: how a person gets from a photo that exists to one that is planned, and what it should show.

use std::fs;
use std::path::Path;

use crate::support::command::{Place, SHORT, ended};
use crate::support::gps::jpeg_at;
use camsplat::files::io;
use camsplat::files::io::camera_files;
use camsplat::files::io::folder::OutputFolder;
use camsplat::files::photos::preview::Previews;
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::random;
use camsplat::scene::surface::Points;
use glam::{DVec2, DVec3};
use image::{Rgb, RgbImage};
use serde_json::Value;

/// The colour of a wall in the plane y = 0, which fills every picture here.
fn painted(x: f64, z: f64) -> Rgb<u8> {
    let wave = |t: f64| (127.5 + 110.0 * t.sin()) as u8;
    Rgb([wave(2.1 * x), wave(1.7 * z + 0.4 * x), wave(1.3 * (x - z))])
}

/// What a camera sees of the wall, in a picture of so many pixels.
fn photographed(camera: &Camera, [width, height]: [u32; 2]) -> RgbImage {
    let lens = camera.intrinsics;
    let scale = f64::from(lens.width) / f64::from(width);
    RgbImage::from_fn(width, height, |x, y| {
        let pixel = scale * (DVec2::new(f64::from(x), f64::from(y)) + 0.5);
        let local = ((pixel - DVec2::from(lens.principal)) / DVec2::from(lens.focal)).extend(1.0);
        let direction = camera.pose.rotation * local;
        let at = camera.pose.position - camera.pose.position.y / direction.y * direction;
        painted(at.x, at.z)
    })
}

fn camera(name: &str, position: DVec3, toward: DVec3) -> Camera {
    let pose = Pose::looking(position, toward - position, DVec3::Z);
    Camera { name: name.into(), pose, intrinsics: Intrinsics::from_fov(320, 240, 1.0) }
}

/// Cameras of twelve photos in a row before the wall.
pub fn row(format: &str) -> Vec<Camera> {
    let photo = |i: u32| {
        let x = 0.6 * f64::from(i) - 3.3;
        camera(
            &format!("{i:03}.{format}"),
            DVec3::new(x, -4.0 - 0.5 * f64::from(i % 2), 1.6),
            DVec3::new(0.7 * x, 0.0, 1.4),
        )
    };
    (0..12).map(photo).collect()
}

/// Writes a capture of the wall as a COLMAP model, with images unless `bare`.
pub fn capture_wall(folder: &Path, cameras: &[Camera], bare: bool) {
    let point = |i: u32| {
        let [u, v, ..] = random::uniforms(4, 0, i);
        DVec3::new(14.0 * u - 7.0, 0.0, 10.0 * v - 3.5)
    };
    let points: Vec<DVec3> = (0..3000).map(point).collect();
    let track = |p: &DVec3| (0..).zip(cameras).filter(|(_, camera)| camera.sees(*p)).map(|(i, _)| i).collect();
    let tracks: Vec<Vec<u32>> = points.iter().map(track).collect();
    let output = OutputFolder::create(folder, false).unwrap();
    let cloud = Points { positions: points, ..Points::default() };
    camera_files::capture(&output, cameras, &cloud, &tracks).unwrap();
    output.commit().unwrap();
    fs::create_dir_all(folder.join("images")).unwrap();
    for camera in cameras.iter().filter(|_| !bare) {
        photographed(camera, [320, 240]).save(folder.join("images").join(&camera.name)).unwrap();
    }
}

/// A place with a capture of the wall: twelve photos in a row, with images unless `bare`.
fn captured(bare: bool) -> Place {
    captured_as("png", bare)
}

/// The same with photos of this file format.
fn captured_as(format: &str, bare: bool) -> Place {
    let place = Place::new();
    capture_wall(&place.path("wall"), &row(format), bare);
    place
}

/// If this failed, a photographer would compare the viewfinder with a picture of something else.
#[test]
fn a_preview_shows_what_the_photo_will() {
    let place = captured(false);
    let set = io::photos::read(&place.path("wall"), &io::photos::ReadOptions::default()).unwrap();
    let previews = Previews::new(&set);
    let aims = [
        camera("a", DVec3::new(0.2, -4.2, 1.9), DVec3::new(0.0, 0.0, 1.5)),
        camera("b", DVec3::new(-2.0, -3.4, 1.2), DVec3::new(-2.4, 0.0, 1.6)),
    ];
    let (pictures, photos) = previews.pictures(&aims).unwrap();
    assert_eq!(photos.len(), 12);
    for (aim, picture) in aims.iter().zip(&pictures) {
        let truth = photographed(aim, [picture.width(), picture.height()]);
        let shown: Vec<_> = picture.pixels().zip(truth.pixels()).filter(|(Rgb(a), _)| *a != [208, 210, 214]).collect();
        let off: f64 = shown
            .iter()
            .map(|(Rgb(a), Rgb(b))| (0..3).map(|c| f64::from(a[c].abs_diff(b[c]))).sum::<f64>() / 3.0)
            .sum();
        let (mean, part) = (off / shown.len() as f64, shown.len() as f64 / truth.pixels().len() as f64);
        assert!(mean < 6.0 && part > 0.97, "{}: {mean} of 255 off, {part} shown", aim.name);
    }
    assert_eq!(set.photos[previews.nearest(&aims[1])[0]].camera.name, "002.png");
}

/// If this failed, words, numbers and pictures of a shot would tell of different places.
#[test]
fn a_plan_for_a_capture_has_a_shot_list_that_leads_to_it() {
    let place = captured(false);
    place.done(&format!("plan wall --keep wall {SHORT} --out o"));
    let plan = place.plan("o");
    let list: Value = serde_json::from_str(&place.read("o/shots.json")).unwrap();
    let shots = list["shots"].as_array().unwrap();
    assert_eq!(shots.len(), 5);
    assert!(list["unit"].as_str().unwrap().starts_with("a step, as far as from 0"), "{list}");
    let page = place.read("o/report.html");
    assert!(page.contains("Shot list") && page.contains("colmap image_registrator"));
    for (shot, camera) in shots.iter().zip(&plan.cameras) {
        assert_eq!(shot["name"], camera.name);
        let from = plan.cameras.iter().find(|kept| shot["from"] == kept.name).unwrap();
        // Level with the ground, as the photo looks.
        let up = plan.region.up;
        let ahead = (from.pose.forward() - from.pose.forward().dot(up) * up).normalize();
        let [right, forward, rise] = ["right", "ahead", "up"].map(|key| shot[key].as_f64().unwrap());
        let led = from.pose.position + right * ahead.cross(up) + forward * ahead + rise * up;
        assert!(led.distance(camera.pose.position) < 1e-6, "{shot}");
        let aim = match shot["pitch_deg"].as_f64().unwrap().round() {
            0.0 => "aim level".to_owned(),
            up if up > 0.0 => format!("aim {up:.0}° up"),
            down => format!("aim {:.0}° down", -down),
        };
        let words = shot["words"].as_str().unwrap();
        let step = list["unit_length"].as_f64().unwrap();
        for (length, positive, negative) in
            [(right, " right", " left"), (forward, " forward", " back"), (rise, " up", " down")]
        {
            if length.abs() > 0.11 * step {
                let moves = words.split("; ").next().unwrap();
                assert_eq!(moves.contains(positive), length > 0.0, "{shot}");
                assert_eq!(moves.contains(negative), length < 0.0, "{shot}");
            }
        }
        assert!(words.ends_with(&aim), "{shot}");
        let picture = image::open(place.path(&format!("o/{}", shot["picture"].as_str().unwrap()))).unwrap();
        assert_eq!(picture.width(), 320);
        assert!(page.contains(words), "{words}");
        // Grey in the file is what no photo shows.
        let grey =
            picture.to_rgb8().pixels().filter(|Rgb(c)| (0..3).all(|i| c[i].abs_diff([208, 210, 214][i]) < 5)).count();
        let share = grey as f64 / f64::from(picture.width() * picture.height());
        assert!((shot["unseen"].as_f64().unwrap() - share).abs() < 0.05, "{share} {shot}");
    }
    // From above: a disc and a line for each camera, and no more than the photos to start from have names.
    let map = page.split("class=\"map\"").nth(1).unwrap().split("</svg>").next().unwrap();
    let part = |class: &str| map.split(&format!("<g class=\"{class}\">")).nth(1).unwrap().split("</g>").next().unwrap();
    let [kept, planned, bar] = ["kept", "planned", "bar"].map(part);
    assert_eq!((kept.matches("<path").count(), planned.matches("<path").count()), (plan.kept, 5));
    assert!((1..=5).all(|number| planned.contains(&format!(">{number}</text>"))), "{planned}");
    // The bar is a step long, by the scale at which photos are drawn.
    let number =
        |text: &str| text.split(|c: char| !c.is_ascii_digit() && c != '.').next().unwrap().parse::<f64>().unwrap();
    let after = |text: &str, name: &str| number(text.split(name).nth(1).unwrap());
    let drawn: Vec<DVec2> =
        kept.split("<circle ").skip(1).map(|of| DVec2::new(after(of, "cx=\""), after(of, "cy=\""))).collect();
    let way = plan.cameras[plan.cameras.len() - 1].pose.position - plan.cameras[5].pose.position;
    let scale = drawn[0].distance(drawn[plan.kept - 1]) / way.reject_from_normalized(plan.region.up).length();
    let step = list["unit_length"].as_f64().unwrap();
    assert!(
        (after(bar.split("d=\"").nth(1).unwrap(), "h") / scale / step - 1.0).abs() < 0.02 && bar.contains(">a step<"),
        "{bar} {scale}"
    );
    let bare = captured(true);
    bare.done(&format!("plan wall --keep wall {SHORT} --out o"));
    assert!(!bare.path("o/shots.json").exists() && !bare.read("o/report.html").contains("Shot list"));
}

/// If this failed, a photographer would not be told whether the photos are enough, or be told the same of a third of them.
#[test]
fn a_capture_is_told_whether_its_photos_are_enough() {
    let place = captured(true);
    let gain = |options: &str| {
        let ran = place.done(&format!("score {options} --held-out 300 --json s.json"));
        let scores: Value = serde_json::from_str(&place.read("s.json")).unwrap();
        (scores["enough"]["gain_db"].as_f64().unwrap(), ran.out)
    };
    let (_, out) = gain("wall");
    assert!(out.contains("enough   ") && out.contains("next     camsplat plan wall --keep wall --views 10"), "{out}");
    assert!(out.lines().any(|line| line.ends_with(" --out next")), "{out}");
    // What was said of places holds for the next photos too.
    place.write("my boxes.json", r#"{"boxes": [[3, 0, 0, 4, 1, 1], [5, 0, 0, 6, 1, 1]]}"#);
    let mut command = place.command("score wall --held-out 300 --preset room --box=-9,-9,-9,9,9,9 --up z --keep-out");
    let out = ended(command.args(["my boxes.json", "--keep-out", "my boxes.json"]).output().unwrap()).out;
    let next = out.lines().find_map(|line| line.strip_prefix("next     ")).expect(&out);
    let both = "--keep-out 'my boxes.json' --keep-out 'my boxes.json'";
    for option in ["--preset room", "--box -9,-9,-9,9,9,9", "--up z", both] {
        assert!(next.contains(option) && !next.contains("held-out"), "{option}: {next}");
    }
    // What a plan holds does not go with it, and that is said.
    assert!(!out.contains("--keep takes neither"), "{out}");
    place.done(&format!("plan wall --keep wall --preset room --box=-9,-9,-9,9,9,9 --up z --out limited {SHORT}"));
    let out = place.done("score wall limited --held-out 300").out;
    assert!(out.contains("--keep takes neither region nor limits from limited"), "{out}");
    // By the same viewers.
    let (all, _) = gain("wall wall --viewers wall");
    place.done("select wall --count 4 --points 300 --out few");
    let (few, _) = gain("few --viewers wall");
    assert!(few > all + 0.2, "ten more photos gain {all} dB beside twelve, {few} beside four of them");
    // Fewer photos are said to be so much worse than all, and a plan beside them better, as the same viewers see them.
    place.done(&format!("plan wall --keep wall {SHORT} --out o"));
    let change = |cameras: &str| {
        let ran = place.done(&format!("score wall {cameras} --held-out 300 --json s.json"));
        let scores: Value = serde_json::from_str(&place.read("s.json")).unwrap();
        let db = scores["enough"]["over_own_db"].as_f64().unwrap();
        assert!(ran.out.contains(&format!("change   {db:+.1} dB against the 12 photos of wall")), "{}", ran.out);
        db
    };
    let (fewer, more) = (change("few"), change("o"));
    assert!(fewer < -0.2 && more > 0.05, "four photos {fewer} dB, five more {more} dB");
    let refused = place.run("score wall/sparse/0/points3D.bin");
    assert!(refused.code == Some(2) && refused.err.lines().count() == 1, "{}", refused.err);
}

/// If this failed, who has GPS would be sent about in steps, or in metres that are wrong where GPS is rougher than the photos are apart.
#[test]
fn lengths_are_in_metres_where_gps_says_how_long_these_are() {
    // A unit is 6 m; photos are 5 cm off, or 5 m.
    for (off, unit) in [(0.05, Some(1.0 / 6.0)), (5.0, None)] {
        let place = captured_as("jpg", true);
        for i in 0..12u32 {
            let x = 6.0 * (0.6 * f64::from(i) - 3.3);
            let [u, v, w, _] = random::uniforms(8, 1, i).map(|u| 2.0 * off * (u - 0.5));
            // Higher every third time, so that they do not lie on a line; on the equator a degree is as long either way.
            let (east, north, up) = (x + u, 6.0 * (-4.0 - 0.5 * f64::from(i % 2)) + v, 9.6 + w);
            let camera = camera("a", DVec3::new(x / 6.0, -4.0, 1.6), DVec3::new(0.1 * x, 0.0, 1.4));
            let picture = photographed(&camera, [320, 240]);
            let bytes = jpeg_at(&picture, north / 110_574.0, east / 111_320.0, up);
            fs::write(place.path(&format!("wall/images/{i:03}.jpg")), bytes).unwrap();
        }
        let told = place.done(&format!("plan wall --keep wall {SHORT} --out o")).out;
        let list: Value = serde_json::from_str(&place.read("o/shots.json")).unwrap();
        let length = list["unit_length"].as_f64().unwrap();
        match unit {
            Some(metre) => {
                assert!((length / metre - 1.0).abs() < 0.05 && list["unit"] == "a metre", "{length} {}", list["unit"]);
                assert!(told.contains("by 12 of 12 photos with GPS"), "{told}");
                let words = list["shots"][0]["words"].as_str().unwrap();
                assert!(words.contains(" m ") || words.contains(" cm "), "{words}");
            }
            None => {
                assert!(list["unit"].as_str().unwrap().starts_with("a step") && told.contains("their GPS is"), "{told}")
            }
        }
    }
}

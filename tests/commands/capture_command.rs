//! `camsplat capture`: what it writes, how it resumes after a stop, and what it refuses.

use crate::support::command::gltf::{cube, sky};
use crate::support::command::{Place, assert_refused, read_until, stop};
use camsplat::files::io;
use camsplat::files::io::photos::{self, Images};
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::surface::Surface;
use exr::prelude::{FlatSamples, read_first_flat_layer_from_file};
use glam::DVec3;

const ORANGE: &str =
    r#", "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.4, 0.1, 1], "metallicFactor": 0}}]"#;

fn cameras(count: usize, size: u32) -> Vec<Camera> {
    let camera = |i: usize| {
        let turn = std::f64::consts::TAU * (i as f64 + 0.3) / count as f64;
        let away = DVec3::new(turn.cos(), 0.4, turn.sin()).normalize();
        let pose = Pose::looking(5.0 * away, -away, DVec3::Y);
        Camera { name: format!("view {i}"), pose, intrinsics: Intrinsics::from_fov(size, size, 0.8) }
    };
    (0..count).map(camera).collect()
}

/// A place with `cube.gltf`, `sky.hdr`, which is as bright everywhere, and `cameras.json`.
fn place(count: usize, size: u32) -> Place {
    let place = Place::new();
    place.write("cube.gltf", cube(ORANGE));
    place.write("sky.hdr", sky());
    place.write("cameras.json", serde_json::json!({ "cameras": cameras(count, size) }).to_string());
    place
}

/// Two folders hold the same files, to the byte.
fn assert_same(place: &Place, one: &str, other: &str) {
    assert_eq!(place.files(one), place.files(other));
    for name in place.files(one) {
        let read = |folder: &str| std::fs::read(place.path(&format!("{folder}/{name}"))).unwrap();
        assert!(read(one) == read(other), "{name} differs");
    }
}

/// If this failed, the folder would not be a capture that trainers read, or its files would not belong together.
#[test]
fn the_folder_is_a_capture_as_it_is() {
    let place = place(3, 32);
    let ran = place.done("capture cube.gltf cameras.json --out o --env sky.hdr --spp 8 --depth --normals --exr");
    assert!(ran.out.contains("12 triangles") && ran.out.contains("alpha and masks"), "{}", ran.out);
    let files = place.files("o");
    for name in
        ["images/view 0.png", "masks/view 1.png.png", "depth/view 2.exr", "normals/view 0.exr", "linear/view 1.exr"]
    {
        assert!(files.contains(&name.to_owned()), "{name} is not in {files:?}");
    }
    for path in ["o", "o/transforms.json"] {
        let options = photos::ReadOptions { images: Images::Needed, ..photos::ReadOptions::default() };
        let set = photos::read(&place.path(path), &options).unwrap();
        assert_eq!(set.photos.len(), 3);
        assert!(set.photos.iter().all(|photo| photo.mask.is_some()), "{path}");
        assert!(set.points.positions.len() > 300, "{}", set.points.positions.len());
    }
    let Surface::Points(points) = io::read_surface(&place.path("o/points.ply")).unwrap() else { panic!("not points") };
    for (p, [r, g, b]) in points.positions.iter().zip(&points.colours) {
        assert!((p.abs().max_element() - 1.0).abs() < 1e-4, "{p} is not on the cube");
        assert!(r > g && g > b, "{p} is not orange");
    }
    // Trainers lay splats along the surface.
    for (p, normal) in points.positions.iter().zip(&points.normals) {
        assert!((p.dot(*normal) - 1.0).abs() < 1e-4, "{normal} is not the normal at {p}");
    }
    assert_eq!(points.normals.len(), points.positions.len());
    // Background, picture, mask and depth agree on where the cube is.
    let picture = image::open(place.path("o/images/view 1.png")).unwrap().into_rgba8();
    let mask = image::open(place.path("o/masks/view 1.png.png")).unwrap().into_luma8();
    let layer = read_first_flat_layer_from_file(place.path("o/depth/view 1.exr")).unwrap().layer_data;
    let FlatSamples::F32(depths) = &layer.channel_data.list[0].sample_data else { panic!("not single precision") };
    assert_eq!(picture.get_pixel(0, 0).0[3], 0);
    for (i, pixel) in picture.pixels().enumerate() {
        assert_eq!(pixel.0[3], mask.as_raw()[i]);
        assert!(pixel.0[3] != 255 || (3.0..6.0).contains(&depths[i]), "{} at {i}", depths[i]);
        assert!(pixel.0[3] != 0 || depths[i] == 0.0, "{} at {i}", depths[i]);
    }
}

/// The noise of two captures that differ by their random numbers alone is half of what they differ by. If this failed, `capture` would
/// call grain clean, or `evaluate` blame noise for what methods make.
#[test]
fn the_noise_that_is_said_is_that_of_the_pictures() {
    let place = place(2, 64);
    let said = |out: &str| {
        let line =
            out.lines().find_map(|line| line.strip_prefix("noise    ")).map(|rest| rest.split(' ').next().unwrap());
        line.unwrap_or_else(|| panic!("{out}")).parse::<f64>().unwrap()
    };
    let mut grain = Vec::new();
    for samples in [8, 64] {
        let taken = |seed: u32| {
            let out = format!("{samples}-{seed}");
            let asked = format!("capture cube.gltf cameras.json --env sky.hdr --spp {samples} --background env");
            place.done(&format!("{asked} --seed {seed} --out {out}")).out
        };
        let noise = said(&taken(1));
        assert!((said(&taken(2)) - noise).abs() < 0.5);
        let mut differ = 0.0;
        for view in 0..2 {
            let picture = |seed: u32| {
                let file = place.path(&format!("{samples}-{seed}/images/view {view}.png"));
                image::open(file).unwrap().into_rgb8().into_raw()
            };
            let squares = picture(1).into_iter().zip(picture(2)).map(|(a, b)| (f64::from(a) - f64::from(b)).powi(2));
            let all: Vec<f64> = squares.collect();
            differ += -10.0 * (all.iter().sum::<f64>() / all.len() as f64 / (2.0 * 255.0 * 255.0)).log10() / 2.0;
        }
        assert!((noise - differ).abs() < 0.5, "{samples} samples: {noise} dB is said, {differ} dB are there");
        grain.push(noise);
    }
    assert!(grain[1] > grain[0] + 6.0, "{grain:?}");
    // Of one sample nothing can be said.
    let ran = place.done("capture cube.gltf cameras.json --env sky.hdr --spp 1 --out one");
    assert!(!ran.out.contains("noise"), "{}", ran.out);
}

/// If this failed, a capture of hours would start over after a stop, or continue with other pictures than it would have made.
#[test]
fn a_stopped_capture_goes_on_at_the_first_missing_picture() {
    let place = place(6, 48);
    let asked = "capture cube.gltf cameras.json --out o --env sky.hdr --spp 200";
    let mut child = place.command(asked).spawn().unwrap();
    let output = read_until(&mut child, "device");
    let first = place.path("o/images/view 0.png");
    while !first.is_file() && child.try_wait().unwrap().is_none() {
        std::thread::yield_now();
    }
    let stopped = stop(child, output, "-INT");
    assert_eq!(stopped.code, Some(130), "{}{}", stopped.out, stopped.err);
    assert!(stopped.out.contains("the same command goes on"), "{}", stopped.out);
    assert!(place.files("o").iter().all(|name| !name.ends_with(".part")), "{:?}", place.files("o"));
    assert!(image::open(&first).is_ok());
    let before = std::fs::metadata(&first).unwrap().modified().unwrap();

    let refused = place.run("capture cube.gltf cameras.json --out o --env sky.hdr --spp 100");
    assert!(refused.code == Some(2) && refused.err.contains("with other settings"), "{}", refused.err);

    let went_on = place.done(asked);
    assert!(went_on.out.contains("kept     "), "{}", went_on.out);
    assert_eq!(std::fs::metadata(&first).unwrap().modified().unwrap(), before);
    place.done(&asked.replace("--out o", "--out whole"));
    assert_same(&place, "o", "whole");
}

/// If this failed, a capture that ended between its light and its first picture would bake again, or only begin anew with `--force`; or
/// one would write over the light of another.
#[test]
fn a_capture_goes_on_from_its_light() {
    let place = place(2, 32);
    let asked = "capture cube.gltf cameras.json --env sky.hdr --light baked --spp 4 --out";
    place.done(&format!("{asked} whole"));
    for folder in ["o", "mine"] {
        std::fs::create_dir(place.path(folder)).unwrap();
        std::fs::copy(place.path("whole/light.map"), place.path(&format!("{folder}/light.map"))).unwrap();
    }
    std::fs::copy(place.path("whole/capture.json"), place.path("o/capture.json")).unwrap();
    let went_on = place.done(&format!("{asked} o"));
    assert!(went_on.out.contains("light    kept from an earlier run"), "{}", went_on.out);
    assert_same(&place, "o", "whole");
    let refused = place.run(&format!("{asked} mine --seed 2"));
    assert!(refused.code == Some(2) && refused.err.contains("not empty"), "{}", refused.err);
    assert_eq!(place.files("mine"), ["light.map"]);
}

/// If this failed, one camera beyond a window would have a whole room photographed as an object, in grain, without a word; or a few
/// cameras within an object's bounds would have it photographed as a room.
#[test]
fn a_room_stays_one_where_a_camera_strays() {
    let place = place(1, 16);
    for (strays, out, is_room) in [(0, "none", true), (1, "one", true), (2, "two", false)] {
        let all = cameras(12, 16).into_iter().enumerate().map(|(i, mut camera)| {
            if i >= strays {
                camera.pose.position *= 0.05;
            }
            camera
        });
        place.write("cameras.json", serde_json::json!({ "cameras": all.collect::<Vec<_>>() }).to_string());
        let ran = place.done(&format!("capture cube.gltf cameras.json --out {out} --env sky.hdr --spp 1"));
        assert_eq!(ran.out.contains("light    "), is_room, "{strays}: {}", ran.out);
        assert_eq!(ran.out.contains("behind   the environment"), is_room, "{strays}: {}", ran.out);
        let said = format!("{strays} of 12 cameras stand outside of the scene");
        assert_eq!(ran.out.contains(&said), strays > 0, "{strays}: {}", ran.out);
    }
}

/// If this failed, pictures of an earlier capture would count as those of one that was stopped, and be trained on as its own.
#[test]
fn a_stopped_capture_takes_no_pictures_of_an_earlier_one() {
    let place = place(4, 32);
    place.done("capture cube.gltf cameras.json --out o --env sky.hdr --spp 1 --depth");
    let asked = "capture cube.gltf cameras.json --out o --env sky.hdr --spp 100";
    let mut child = place.command(&format!("{asked} --force")).spawn().unwrap();
    let output = read_until(&mut child, "device");
    while place.path("o/transforms.json").is_file() && child.try_wait().unwrap().is_none() {
        std::thread::yield_now();
    }
    let stopped = stop(child, output, "-INT");
    assert_eq!(stopped.code, Some(130), "{}{}", stopped.out, stopped.err);
    place.done(asked);
    place.done(&asked.replace("--out o", "--out whole"));
    assert_same(&place, "o", "whole");
}

/// If this failed, bad input would end in a black picture, a panic, or a message without a remedy.
#[test]
fn bad_input_is_refused_and_nothing_is_written() {
    let place = place(1, 16);
    place.write("sky.png", "no map");
    place.write(
        "texture.gltf",
        cube(
            r#", "materials": [{"emissiveTexture": {"index": 0}}], "textures": [{"source": 0}],
        "images": [{"uri": "lost.png"}]"#,
        ),
    );
    place.write("required.gltf", cube(&format!("{ORANGE}, \"extensionsRequired\": [\"EXT_texture_webp\"]")));
    let cases: [(&str, &[&str]); 7] = [
        ("capture cube.gltf cameras.json --out . --env sky.hdr --force", &["cube.gltf is in it"]),
        ("capture cube.gltf cameras.json --out o", &["no light", "--env"]),
        ("capture cube.gltf cameras.json --out o --env sky.png", &["sky.png", "no environment map"]),
        ("capture texture.gltf cameras.json --out o --env sky.hdr", &["image 0 is missing", "lost.png"]),
        ("capture required.gltf cameras.json --out o --env sky.hdr", &["EXT_texture_webp"]),
        ("capture none.gltf cameras.json --out o --env sky.hdr", &["there is no such file"]),
        ("capture cube.gltf cameras.json --out o --env sky.hdr --size 16x9", &["another shape"]),
    ];
    assert_refused(&place, &cases);
}

/// If this failed, a user would wonder why some pictures are dark, or why a scene has lost its colours.
#[test]
fn what_is_doubtful_is_said() {
    let place = place(2, 16);
    let mut cameras = cameras(2, 16);
    cameras[1].pose.position = DVec3::new(0.1, 0.2, 0.3);
    place.write("cameras.json", serde_json::json!({ "cameras": cameras }).to_string());
    place.write("grey.gltf", cube("").replace(r#", "material": 0"#, ""));
    let ran = place.done("capture grey.gltf cameras.json --out o --env sky.hdr --spp 2");
    assert!(ran.out.contains("1 cameras stand inside of something: view 1.png"), "{}", ran.out);
    assert!(ran.out.contains("no materials: it is grey"), "{}", ran.out);
    assert!(ran.out.contains("behind   nothing"), "{}", ran.out);
    assert!(!ran.out.contains("are black") && !ran.out.contains("no points"), "{}", ran.out);
    let veil =
        r#", "materials": [{"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.3]}}]"#;
    place.write("veil.gltf", cube(veil));
    let ran = place.done("capture veil.gltf cameras.json --out veil --env sky.hdr --spp 2");
    assert!(ran.out.contains("12 triangles, 1 materials"), "{}", ran.out);
    assert!(ran.out.contains("the model has no points") && ran.out.contains("with 0 points"), "{}", ran.out);
    // Backs of double-sided triangles are no evidence; seeing nothing is.
    let with = |more: &str| cube(&ORANGE.replace(r#""pbr"#, &format!(r#"{more}, "pbr"#)));
    place.write("closed.gltf", with(r#""doubleSided": true"#));
    let ran = place.done("capture closed.gltf cameras.json --out closed --env sky.hdr --spp 2");
    assert!(!ran.out.contains("1 cameras stand"), "{}", ran.out);
    let black: Vec<&str> = ran.out.lines().filter(|line| line.contains("are black")).collect();
    assert!(
        matches!(black[..], [line] if line.contains("1 pictures") && line.ends_with(": view 1.png")),
        "{}",
        ran.out
    );
    let dark = place.run("capture closed.gltf cameras.json --out dark --spp 2");
    assert!(dark.code == Some(2) && dark.err.contains("no light"), "{}", dark.err);
}

/// If this failed, a scene of which a part is unlit could silently come out black elsewhere.
#[test]
fn lit_things_without_a_light_are_told_of() {
    let place = place(1, 8);
    let unlit =
        r#", "extensionsUsed": ["KHR_materials_unlit"], "materials": [{"extensions": {"KHR_materials_unlit": {}}}]"#;
    place.write("unlit.gltf", cube(unlit));
    let ran = place.done("capture unlit.gltf cameras.json --out unlit --spp 1");
    assert_eq!(ran.warnings(), [""; 0]);
    let second = r#""material": 0}, {"attributes": {"POSITION": 0}, "indices": 1, "material": 1}]"#;
    let both = cube(&unlit.replace("{}}}]", "{}}}, {}]")).replace(r#""material": 0}]"#, second);
    place.write("both.gltf", both);
    let ran = place.done("capture both.gltf cameras.json --out both --spp 1");
    assert!(ran.out.contains("warning  no lamp, nothing that emits and no environment"), "{}", ran.out);
}

/// If this failed, windows of a room would be holes, or exposure would not be what photographers mean by a stop.
#[test]
fn background_exposure_and_size_are_what_they_say() {
    let place = place(1, 16);
    let options = "--background env --exposure -1 --size 8x8 --seed 3 --device 0 --debug-sync --exr";
    place.done(&format!("capture cube.gltf cameras.json --out o --env sky.hdr --spp 4 {options}"));
    let corner = image::open(place.path("o/images/view 0.png")).unwrap();
    assert_eq!((corner.width(), corner.color().channel_count()), (8, 3));
    // Half of the sky's radiance, which is 1, is 188 in sRGB.
    assert!(corner.into_rgb8().get_pixel(0, 0).0.iter().all(|v| v.abs_diff(188) <= 1));
    assert!(!place.files("o").iter().any(|name| name.starts_with("masks")));
    let layer = read_first_flat_layer_from_file(place.path("o/linear/view 0.exr")).unwrap().layer_data;
    let FlatSamples::F32(values) = &layer.channel_data.list[0].sample_data else { panic!("not single precision") };
    assert!((values[0] - 1.0).abs() < 0.01, "{}", values[0]);
    let again = place.run("capture cube.gltf cameras.json --out o --env sky.hdr --spp 4 --background alpha");
    assert!(again.code == Some(2) && again.err.contains("--force"), "{}", again.err);
    place.done("capture cube.gltf cameras.json --out o --env sky.hdr --spp 4 --background alpha --force");
}

/// If this failed, photographs under a bright sky would be white without a word, or metering would give every view another exposure.
#[test]
fn a_bright_sky_is_metered_or_warned_of() {
    let place = place(3, 16);
    let run = |options: &str| {
        place
            .done(&format!(
                "capture cube.gltf cameras.json --out o --force --env sky.hdr --spp 4 --background env {options}"
            ))
            .out
    };
    let bright = run("--exposure 3");
    assert!(bright.contains("of the pixels are brighter than white") && bright.contains("--exposure auto"), "{bright}");
    let metered = run("--exposure auto");
    assert!(!metered.contains("brighter than white") && metered.contains("stops, metered"), "{metered}");
    // The sky, of radiance 1, is the brightest thing there is: it is as bright as a third of a stop allows.
    let brightest = |name: &str| {
        let image = image::open(place.path(&format!("o/images/{name}"))).unwrap().into_rgb8();
        image.as_raw().iter().copied().max().unwrap()
    };
    let levels = ["view 0.png", "view 1.png", "view 2.png"].map(brightest);
    assert!(levels.iter().all(|level| *level >= 228), "{levels:?}");
    // What was stopped continues with the same exposure.
    std::fs::remove_file(place.path("o/images/view 1.png")).unwrap();
    let again = "capture cube.gltf cameras.json --out o --env sky.hdr --spp 4 --background env --exposure auto";
    assert!(place.done(again).out.contains("kept     2 pictures"));
}

/// If this failed, a capture with a damaged picture or a lost mask would count as complete, or would have to be made anew as a
/// whole.
#[test]
fn what_is_damaged_or_lost_is_taken_again() {
    let place = place(4, 16);
    let asked = "capture cube.gltf cameras.json --out o --env sky.hdr --spp 4 --depth";
    place.done(asked);
    let read = |name: &str| std::fs::read(place.path(&format!("o/{name}"))).unwrap();
    let names = place.files("o");
    let whole: Vec<Vec<u8>> = names.iter().map(|name| read(name)).collect();
    let cut = |name: &str| place.write(&format!("o/{name}"), &read(name)[..read(name).len() / 2]);
    cut("images/view 0.png");
    std::fs::remove_file(place.path("o/masks/view 1.png.png")).unwrap();
    cut("depth/view 2.exr");
    let again = place.done(asked);
    assert!(again.out.contains("kept     1 pictures") && again.out.contains("mended   3 pictures"), "{}", again.out);
    for (name, before) in names.iter().zip(&whole) {
        assert!(read(name) == *before, "{name} differs");
    }
    let kept = place.done(asked);
    assert!(kept.out.contains("kept     4 pictures") && !kept.out.contains("mended"), "{}", kept.out);
}

/// If this failed, `--force` would replace or remove files of a folder that a link leads to.
#[cfg(unix)]
#[test]
fn nothing_is_written_through_links() {
    let place = place(1, 16);
    for folder in ["o", "elsewhere"] {
        std::fs::create_dir(place.path(folder)).unwrap();
    }
    place.write("elsewhere/view 0.png", "precious");
    let asked = "capture cube.gltf cameras.json --out o --env sky.hdr --spp 1 --force";
    for link in ["images", "sparse"] {
        std::os::unix::fs::symlink(place.path("elsewhere"), place.path(&format!("o/{link}"))).unwrap();
        let refused = place.run(asked);
        assert!(refused.code == Some(2) && refused.err.contains(&format!("o/{link}")), "{}", refused.err);
        assert!(refused.err.contains("a symbolic link is already here"), "{}", refused.err);
        std::fs::remove_file(place.path(&format!("o/{link}"))).unwrap();
    }
    assert_eq!(
        (place.files("elsewhere"), place.read("elsewhere/view 0.png")),
        (vec!["view 0.png".into()], "precious".into())
    );
    assert!(place.files("o").is_empty());
    // A link in the very place of a file is replaced.
    std::os::unix::fs::symlink(place.path("elsewhere/view 0.png"), place.path("o/capture.json")).unwrap();
    place.done(asked);
    assert_eq!(place.read("elsewhere/view 0.png"), "precious");
}

/// If this failed, a user would look for pictures under names that no file can have.
#[test]
fn names_that_lead_out_of_the_folder_are_told_of() {
    let place = place(2, 16);
    let mut cameras = cameras(2, 16);
    cameras[0].name = "../photos/a.jpg".into();
    cameras[1].name = "./b.jpg".into();
    place.write("cameras.json", serde_json::json!({ "cameras": cameras }).to_string());
    let ran = place.done("capture cube.gltf cameras.json --out o --env sky.hdr --spp 1");
    assert!(ran.out.contains("\"../photos/a.jpg\" is written as \"photos/a\"\n"), "{}", ran.out);
    assert!(place.path("o/images/photos/a.png").is_file() && place.path("o/images/b.png").is_file());
}

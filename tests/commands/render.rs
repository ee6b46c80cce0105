//! `camsplat render`: trained splats from given cameras, against the twin in double precision.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::command::{Place, ended};
use crate::support::data::data_folder;
use crate::support::splats::scene;
use camsplat::files::io;
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::gaussians::Gaussians;
use camsplat::splats::render::frame::{Frame, NEAR};
use camsplat::splats::twin::{self, Picture, Rules};
use exr::prelude::{FlatSamples, read_first_flat_layer_from_file};
use glam::{DMat3, DVec3};

/// Cameras around `centre` that look there, some from above and some from below.
fn around(centre: DVec3, distance: f64, count: usize, (width, height): (u32, u32)) -> Vec<Camera> {
    let camera = |i: usize| {
        let turn = 0.3 + std::f64::consts::TAU * i as f64 / count as f64;
        let away = DVec3::new(turn.cos(), turn.sin(), 0.6 * (1.0 + 2.0 * turn).sin()).normalize();
        let intrinsics = Intrinsics {
            width,
            height,
            focal: [1.1 * f64::from(width), 1.12 * f64::from(width)],
            principal: [0.48 * f64::from(width), 0.53 * f64::from(height)],
        };
        let pose = Pose::looking(centre + distance * away, -away, DVec3::Z);
        Camera { name: format!("views/{i:02}.jpg"), pose, intrinsics }
    };
    (0..count).map(camera).collect()
}

/// A random scene whose splats are so small that parts of the pictures stay empty.
fn small(seed: u64, count: usize, degree: u32) -> Gaussians {
    let mut gaussians = scene(seed, count, degree);
    gaussians.log_scales.as_flattened_mut().iter_mut().for_each(|s| *s -= 1.5);
    gaussians
}

fn write_cameras(place: &Place, cameras: &[Camera]) {
    place.write("cameras.json", serde_json::json!({ "cameras": cameras }).to_string());
}

/// A place with `splats.ply` and `cameras.json`.
fn place_with(gaussians: &Gaussians, cameras: &[Camera]) -> Place {
    let place = Place::new();
    place.write("splats.ply", io::ply::write::gaussians(gaussians));
    write_cameras(&place, cameras);
    place
}

/// What the twin sees of a camera's view, with the near plane that the command takes.
fn seen(gaussians: &Gaussians, cameras: &[Camera], index: usize, rules: Rules, background: DVec3) -> Picture {
    let Camera { pose, intrinsics, .. } = &cameras[index];
    let rotation = DMat3::from_quat(pose.rotation.inverse());
    let view = twin::View {
        rotation,
        translation: -(rotation * pose.position),
        focal: intrinsics.focal,
        principal: intrinsics.principal,
        width: intrinsics.width,
        height: intrinsics.height,
        near: f64::from(NEAR) * Frame::new(cameras, &gaussians.centres).extent(),
    };
    twin::render(&twin::splats(gaussians), &view, &rules, background)
}

/// Values in [0, 1] of a PNG with or without alpha, by pixel.
fn png<const CHANNELS: usize>(path: &Path, (width, height): (u32, u32)) -> Vec<[f64; CHANNELS]> {
    let picture = image::open(path).unwrap();
    assert_eq!((picture.width(), picture.height(), picture.color().channel_count()), (width, height, CHANNELS as u8));
    let values = picture.into_bytes();
    values.chunks_exact(CHANNELS).map(|pixel| std::array::from_fn(|c| f64::from(pixel[c]) / 255.0)).collect()
}

/// The channels of an OpenEXR file in the order of names, by pixel.
fn exr<const CHANNELS: usize>(path: &Path, names: [&str; CHANNELS]) -> Vec<[f64; CHANNELS]> {
    let layer = read_first_flat_layer_from_file(path).unwrap().layer_data;
    let channels = layer.channel_data.list;
    assert_eq!(channels.iter().map(|channel| channel.name.to_string()).collect::<Vec<_>>(), names);
    let value = |channel: usize, at: usize| match &channels[channel].sample_data {
        FlatSamples::F32(values) => f64::from(values[at]),
        _ => panic!("not single precision"),
    };
    (0..layer.size.area()).map(|at| std::array::from_fn(|channel| value(channel, at))).collect()
}

/// Fails where more than one pixel in a thousand is further off than `tolerance`.
#[track_caller]
fn assert_close<const CHANNELS: usize>(what: &str, got: &[[f64; CHANNELS]], want: &[[f64; CHANNELS]], tolerance: f64) {
    assert_eq!(got.len(), want.len(), "{what}");
    let off = |(got, want): (&[f64; CHANNELS], &[f64; CHANNELS])| {
        got.iter().zip(want).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let wrong = got.iter().zip(want).filter(|pair| off(*pair) > tolerance).count();
    assert!(wrong * 1000 <= got.len(), "{what}: {wrong} of {} pixels are off by more than {tolerance}", got.len());
}

const LEVEL: f64 = 1.0 / 255.0;

/// Colours of a picture as a file with 8 bits can hold them.
fn shown(picture: &Picture) -> Vec<[f64; 3]> {
    picture.colour.iter().map(|colour| colour.clamp(DVec3::ZERO, DVec3::ONE).to_array()).collect()
}

/// Colours of a picture over black that are not multiplied by alpha, and alpha.
fn straight(picture: &Picture) -> Vec<(DVec3, f64)> {
    let pixels = picture.colour.iter().zip(&picture.transmittance);
    pixels.map(|(colour, left)| (if *left < 1.0 { colour / (1.0 - left) } else { DVec3::ZERO }, 1.0 - left)).collect()
}

/// The sRGB curve, also beyond 1 (IEC 61966-2-1).
fn linear(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// If this failed, pictures of a trained file would not be what its trainer means by it: colours, alpha, depth or their
/// place would be off.
#[test]
fn every_kind_of_picture_agrees_with_the_twin() {
    let size = (96, 72);
    let (gaussians, cameras) = (small(5, 400, 3), around(DVec3::ZERO, 6.0, 3, size));
    let place = place_with(&gaussians, &cameras);
    let ran = place.done("render splats.ply cameras.json --out png --background 0.2,0.5,0.9");
    assert!(
        ran.out.contains("400 splats with harmonics of degree 3") && ran.out.contains("pictures 3 in"),
        "{}",
        ran.out
    );
    assert_eq!(place.files("png"), ["views/00.png", "views/01.png", "views/02.png"]);
    place.done("render splats.ply cameras.json --out filtered --antialiased --background white");
    place.done("render splats.ply cameras.json --out alpha --alpha");
    place.done("render splats.ply cameras.json --out exr --format exr --background white");
    place.done("render splats.ply cameras.json --out all --format exr --alpha --depth");
    assert_eq!(place.files("all").len(), 6);
    let antialiased = Rules { antialiased: true, ..Rules::default() };
    for i in 0..3 {
        let file = |folder: &str, extension: &str| place.path(&format!("{folder}/views/{i:02}.{extension}"));
        let of = |rules, background| seen(&gaussians, &cameras, i, rules, background);
        let coloured = of(Rules::default(), DVec3::new(0.2, 0.5, 0.9));
        assert_close("png", &png(&file("png", "png"), size), &shown(&coloured), LEVEL);
        let filtered = of(antialiased, DVec3::ONE);
        assert_close("antialiased", &png(&file("filtered", "png"), size), &shown(&filtered), LEVEL);

        let black = of(Rules::default(), DVec3::ZERO);
        let wanted: Vec<[f64; 4]> = straight(&black)
            .iter()
            .map(|(colour, alpha)| colour.clamp(DVec3::ZERO, DVec3::ONE).extend(*alpha).to_array())
            .collect();
        assert_close("alpha", &png(&file("alpha", "png"), size), &wanted, LEVEL);

        let white = of(Rules::default(), DVec3::ONE);
        let wanted: Vec<[f64; 3]> = white.colour.iter().map(|c| [c.z, c.y, c.x].map(linear)).collect();
        assert_close("exr", &exr(&file("exr", "exr"), ["B", "G", "R"]), &wanted, 1e-4);
        let wanted: Vec<[f64; 4]> = straight(&black)
            .iter()
            .map(|(c, alpha)| [*alpha, alpha * linear(c.z), alpha * linear(c.y), alpha * linear(c.x)])
            .collect();
        assert_close("exr with alpha", &exr(&file("all", "exr"), ["A", "B", "G", "R"]), &wanted, 1e-4);
        let expected = |(sum, left): (&f64, &f64)| [if *left < 1.0 { sum / (1.0 - left) } else { 0.0 }];
        let wanted: Vec<[f64; 1]> = black.depth.iter().zip(&black.transmittance).map(expected).collect();
        assert_close("depth", &exr(&file("all", "depth.exr"), ["Z"]), &wanted, 1e-3);
        assert!(wanted.iter().any(|z| z[0] == 0.0) && wanted.iter().any(|z| z[0] > 3.0));
    }
}

/// If this failed, a lone camera, or one among the splats, would see nothing, or another scene.
#[test]
fn one_camera_among_the_splats_sees_them() {
    let gaussians = scene(6, 300, 1);
    for (i, position) in [DVec3::ZERO, DVec3::new(0.4, -0.2, 0.1)].into_iter().enumerate() {
        let mut cameras = around(DVec3::ZERO, 1.0, 1, (64, 64));
        cameras[0].pose.position = position;
        cameras[0].name = "only".into();
        let place = place_with(&gaussians, &cameras);
        place.done("render splats.ply cameras.json --out o");
        let want = seen(&gaussians, &cameras, 0, Rules::default(), DVec3::ZERO);
        assert_close(&format!("camera {i}"), &png(&place.path("o/only.png"), (64, 64)), &shown(&want), LEVEL);
        assert!(want.transmittance.iter().sum::<f64>() < 0.5 * 64.0 * 64.0, "it stands among them");
    }
}

/// If this failed, splats that reach more tiles than were reckoned with would be missing, or pictures of several sizes be mixed
/// up.
#[test]
fn splats_that_fill_pictures_of_several_sizes_are_all_drawn() {
    let mut gaussians = scene(13, 200, 1);
    gaussians.log_scales.as_flattened_mut().iter_mut().for_each(|s| *s += 2.0);
    gaussians.opacities.iter_mut().for_each(|o| *o = o.min(-2.0));
    let sizes = [(31, 47), (800, 600), (450, 750)];
    let mut cameras = around(DVec3::ZERO, 6.0, 3, (0, 0));
    for (camera, (width, height)) in cameras.iter_mut().zip(sizes) {
        camera.intrinsics = Intrinsics::from_fov(width, height, 0.8);
    }
    let place = place_with(&gaussians, &cameras);
    place.done("render splats.ply cameras.json --out o");
    for (i, size) in sizes.into_iter().enumerate() {
        let want = seen(&gaussians, &cameras, i, Rules::default(), DVec3::ZERO);
        let got = png(&place.path(&format!("o/views/{i:02}.png")), size);
        assert_close(&format!("{size:?}"), &got, &shown(&want), LEVEL);
    }
}

/// If this failed, --size would show another part of the scene, or --near would cut at another depth than specified.
#[test]
fn size_and_near_are_what_they_say() {
    let (gaussians, mut cameras) = (small(7, 200, 0), around(DVec3::ZERO, 6.0, 2, (96, 72)));
    let place = place_with(&gaussians, &cameras);
    place.done("render splats.ply cameras.json --out small --size 48x36");
    place.done("render splats.ply cameras.json --out far --near 6 --depth --background white");
    for camera in &mut cameras {
        camera.intrinsics = camera.intrinsics.resized(48, 36).unwrap();
    }
    for i in 0..2 {
        let want = seen(&gaussians, &cameras, i, Rules::default(), DVec3::ZERO);
        let file = place.path(&format!("small/views/{i:02}.png"));
        assert_close("small", &png(&file, (48, 36)), &shown(&want), LEVEL);
        let depths = exr(&place.path(&format!("far/views/{i:02}.depth.exr")), ["Z"]);
        assert!(depths.iter().all(|z| z[0] == 0.0 || z[0] > 6.0 - 1e-5));
        assert!(depths.iter().any(|z| z[0] > 6.0) && depths.iter().any(|z| z[0] == 0.0));
    }
}

/// If this failed, cameras of another frame than the model's would silently give a folder of black pictures.
#[test]
fn pictures_that_show_nothing_are_counted() {
    let mut cameras = around(DVec3::ZERO, 6.0, 3, (32, 24));
    cameras[1].pose.rotation *= glam::DQuat::from_rotation_y(std::f64::consts::PI);
    let place = place_with(&small(12, 50, 0), &cameras);
    let ran = place.done("render splats.ply cameras.json --out o --background 1,0,0 --depth");
    assert!(ran.out.contains("1 show nothing: check that the cameras are in the model's frame"), "{}", ran.out);
    assert!(png(&place.path("o/views/01.png"), (32, 24)).iter().all(|pixel| *pixel == [1.0, 0.0, 0.0]));
    assert!(exr(&place.path("o/views/01.depth.exr"), ["Z"]).iter().all(|z| z[0] == 0.0));
}

/// The bytes of splats of degree 0 whose centres have double precision.
fn precise(gaussians: &Gaussians) -> Vec<u8> {
    let doubles: String = ["x", "y", "z"].map(|name| format!("property double {name}\n")).concat();
    let floats: String = "f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3"
        .split(' ')
        .map(|name| format!("property float {name}\n"))
        .collect();
    let head = format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", gaussians.len());
    let mut bytes = format!("{head}{doubles}{floats}end_header\n").into_bytes();
    for i in 0..gaussians.len() {
        gaussians.centres[i].to_array().iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        let values = gaussians.harmonics[3 * i..3 * i + 3].iter().chain([&gaussians.opacities[i]]);
        values
            .chain(&gaussians.log_scales[i])
            .chain(&gaussians.rotations[i])
            .for_each(|v| bytes.extend(v.to_le_bytes()));
    }
    bytes
}

/// If this failed, scenes in geographic coordinates or other units would be drawn on a coarse grid.
#[test]
fn a_far_away_scene_looks_as_the_near_one() {
    let size = (80, 60);
    let pictures = |scale: f64, offset: DVec3| {
        let mut gaussians = scene(8, 250, 0);
        gaussians.centres.iter_mut().for_each(|centre| *centre = offset + scale * *centre);
        gaussians.log_scales.as_flattened_mut().iter_mut().for_each(|s| *s = (f64::from(*s) + scale.ln()) as f32);
        let place = Place::new();
        place.write("splats.ply", precise(&gaussians));
        write_cameras(&place, &around(offset, 4.0 * scale, 2, size));
        place.done("render splats.ply cameras.json --out o --alpha --depth");
        let of = |name: &str, i: usize| place.path(&format!("o/views/{i:02}.{name}"));
        [0, 1].map(|i| {
            let depths: Vec<[f64; 1]> = exr(&of("depth.exr", i), ["Z"]).iter().map(|z| [z[0] / scale]).collect();
            (png::<4>(&of("png", i), size), depths)
        })
    };
    let near = pictures(1.0, DVec3::ZERO);
    for scale in [1e-2, 1.0, 1e3] {
        let far = pictures(scale, DVec3::new(1e6, -1e6, 3e5));
        for ((want, want_depths), (got, depths)) in near.iter().zip(&far) {
            assert_close(&format!("scale {scale}"), got, want, LEVEL);
            assert_close(&format!("depths at scale {scale}"), depths, want_depths, 1e-3);
        }
    }
}

/// If this failed, bad input would end in a panic, in half a folder, or in a message without a remedy.
#[test]
fn bad_input_is_refused_and_nothing_is_written() {
    let gaussians = scene(9, 20, 0);
    let cameras = around(DVec3::ZERO, 4.0, 2, (32, 32));
    let place = place_with(&gaussians, &cameras);
    let spoilt = |spoil: &dyn Fn(&mut Gaussians)| {
        let mut gaussians = gaussians.clone();
        spoil(&mut gaussians);
        io::ply::write::gaussians(&gaussians)
    };
    place.write("nan.ply", spoilt(&|g| g.harmonics.fill(f32::NAN)));
    place.write("none.ply", io::ply::write::gaussians(&Gaussians::default()));
    place.write("cut.ply", &io::ply::write::gaussians(&gaussians)[..900]);
    place.write("empty.json", r#"{"cameras": []}"#);
    let named = |name: &str, at: usize, change: &dyn Fn(&mut Camera)| {
        let mut cameras = cameras.clone();
        change(&mut cameras[at]);
        place.write(name, serde_json::json!({ "cameras": cameras }).to_string());
    };
    named("clash.json", 1, &|camera| camera.name = "views/00.png".into());
    named("nameless.json", 1, &|camera| camera.name = "..".into());
    named("huge.json", 1, &|camera| camera.intrinsics.width = 100_000);
    named("large.json", 1, &|camera| (camera.intrinsics.width, camera.intrinsics.height) = (65_535, 65_535));
    let long: Vec<Camera> = (0..9).map(|i| Camera { name: "x".repeat(300 + i), ..cameras[0].clone() }).collect();
    place.write("long.json", serde_json::json!({ "cameras": long }).to_string());
    std::fs::create_dir(place.path("full")).unwrap();
    place.write("full/mine.txt", "mine");
    let before = place.files("");
    let cases: [(&str, &[&str]); 21] = [
        ("missing.ply cameras.json --out o", &["missing.ply", "no such file"]),
        ("ball.ply cameras.json --out o", &["ball.ply", "has no property f_dc_0"]),
        ("nan.ply cameras.json --out o", &["none of its splats can be drawn", "colour that is not finite"]),
        ("none.ply cameras.json --out o", &["holds no splats"]),
        ("cut.ply cameras.json --out o", &["cut short"]),
        ("splats.ply empty.json --out o", &["holds no cameras"]),
        ("splats.ply missing.json --out o", &["missing.json", "no such file"]),
        ("splats.ply ball.ply --out o", &["ball.ply"]),
        ("splats.ply clash.json --out o", &["views/00.jpg", "would both be views/00.png"]),
        ("splats.ply nameless.json --out o", &["names no file"]),
        ("splats.ply huge.json --out o", &["100000 x 32 pixels", "--size"]),
        ("splats.ply large.json --out o", &["the picture", "bytes of device memory", "smaller pictures"]),
        ("splats.ply long.json --out o", &["xxx.png: File name too long"]),
        ("splats.ply cameras.json --out full", &["not empty", "--force"]),
        ("splats.ply cameras.json --out ball.ply/b", &["ball.ply is no folder"]),
        ("splats.ply cameras.json --out o --size 32x16", &["another shape", "take 32x32"]),
        ("splats.ply cameras.json --out o --near 0", &["--near is 0"]),
        ("splats.ply cameras.json --out o --near NaN", &["--near is NaN"]),
        ("splats.ply cameras.json --out o --background 0.5,2,0", &["--background", "black, white"]),
        ("splats.ply cameras.json --out o --background 1,1,1,1", &["--background", "black, white"]),
        ("splats.ply cameras.json --out o --alpha --background white", &["cannot be used with"]),
    ];
    for (arguments, fragments) in cases {
        let ran = place.run(&format!("render {arguments}"));
        assert_eq!((ran.code, ran.err.lines().count()), (Some(2), 1), "{arguments}: {}{}", ran.out, ran.err);
        for fragment in fragments {
            assert!(ran.err.contains(fragment), "{arguments}: {fragment:?} is not in {}", ran.err);
        }
        assert_eq!(place.files(""), before, "{arguments} left something");
    }
    place.done("render splats.ply cameras.json --out full --force");
    assert_eq!(place.files("full"), ["mine.txt", "views/00.png", "views/01.png"]);
}

/// If this failed, Ctrl-C would lose the pictures that are finished, leave one that is half written, or a hidden folder.
#[test]
#[cfg(unix)]
fn a_stopped_run_leaves_what_is_finished() {
    let place = place_with(&scene(10, 50, 0), &around(DVec3::ZERO, 4.0, 20_000, (64, 64)));
    let before = place.files("").len();
    let mut child = place.command("render splats.ply cameras.json --out o --depth").spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(lines.any(|line| line.unwrap().starts_with("running ")), "the run ended before it could be stopped");
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    let ran = ended(child.wait_with_output().unwrap());
    assert_eq!((ran.code, ran.err.as_str()), (Some(130), ""), "{rest:?}");
    let said = rest.iter().find_map(|line| line.strip_prefix("stopped after ")).unwrap();
    let count: usize = said.split(' ').next().unwrap().parse().unwrap();
    assert!((1..20_000).contains(&count) && said.contains("which are written"), "{said}");
    let files = place.files("o");
    assert_eq!((files.len(), place.files("").len()), (2 * count, before + 2 * count));
    for name in files.iter().filter(|name| name.ends_with(".png")) {
        let picture = image::open(place.path(&format!("o/{name}"))).unwrap();
        assert_eq!((picture.width(), picture.height()), (64, 64), "{name}");
    }
}

/// If this failed, the driver would be asked for something that Vulkan does not allow.
#[test]
fn the_validation_layers_are_silent() {
    let place = place_with(&scene(11, 3000, 2), &around(DVec3::ZERO, 4.0, 2, (96, 72)));
    let arguments = "render splats.ply cameras.json --out o --depth --alpha --antialiased";
    let ran = ended(place.command(arguments).env("CAMSPLAT_VALIDATION", "1").output().unwrap());
    assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""));
}

/// A trained file of the data folder, its path, and views of its middle from `distance` times its size.
fn trained(name: &str, distance: f64) -> (PathBuf, Gaussians, Vec<Camera>) {
    let data = data_folder();
    let path = data.join("splats").join(name);
    let (gaussians, _) = io::read_gaussians_with_notes(&path).unwrap();
    let along = |axis: usize| {
        let mut values: Vec<f64> = gaussians.centres.iter().map(|centre| centre[axis]).collect();
        values.sort_by(f64::total_cmp);
        [0.05, 0.5, 0.95].map(|part| values[(part * (values.len() - 1) as f64) as usize])
    };
    let [x, y, z] = [0, 1, 2].map(along);
    let size = [x, y, z].iter().map(|[low, _, high]| high - low).fold(0.0, f64::max);
    let cameras = around(DVec3::new(x[1], y[1], z[1]), distance * size, 3, (400, 400));
    (path, gaussians, cameras)
}

/// If this failed, files that other programs trained would be shown otherwise than they show them.
#[test]
#[ignore = "needs the folder CAMSPLAT_DATA"]
fn trained_files_of_others_agree_with_the_twin() {
    for (name, distance) in [("donut_3dgs_dc_45624.ply", 1.4), ("tnt_train_1000_sh3.ply", 0.6)] {
        let (path, gaussians, cameras) = trained(name, distance);
        let place = Place::new();
        write_cameras(&place, &cameras);
        place.done(&format!("render {} cameras.json --out o --background white", path.display()));
        for i in 0..cameras.len() {
            let want = seen(&gaussians, &cameras, i, Rules::default(), DVec3::ONE);
            let got = png(&place.path(&format!("o/views/{i:02}.png")), (400, 400));
            // Where nothing is seen there is nothing to get wrong.
            let pairs = got.into_iter().zip(shown(&want)).zip(&want.transmittance).filter(|(_, left)| **left < 1.0);
            let (got, want): (Vec<[f64; 3]>, Vec<[f64; 3]>) = pairs.map(|(pair, _)| pair).unzip();
            let off = got.iter().flatten().zip(want.iter().flatten()).map(|(a, b)| 255.0 * (a - b).abs());
            let most = off.fold(0.0, f64::max);
            println!("{name}, view {i}: {most:.2} levels off at most on {} pixels", got.len());
            assert!(got.len() > 30_000);
            assert_close(&format!("{name}, view {i}"), &got, &want, LEVEL);
        }
    }
}

/// If this failed, packed files would come out empty, transparent or grey.
#[test]
#[ignore = "needs the folder CAMSPLAT_DATA"]
fn a_packed_file_is_an_opaque_thing_of_many_colours() {
    let (path, _, cameras) = trained("guitar.compressed.ply", 1.0);
    let place = Place::new();
    write_cameras(&place, &cameras);
    let ran = place.done(&format!("render {} cameras.json --out o --alpha", path.display()));
    assert!(ran.out.contains("90854 splats") && ran.out.contains("packed"), "{}", ran.out);
    for i in 0..cameras.len() {
        let pixels = png::<4>(&place.path(&format!("o/views/{i:02}.png")), (400, 400));
        let opaque: Vec<_> = pixels.iter().filter(|pixel| pixel[3] > 0.9).collect();
        let clear = pixels.iter().filter(|pixel| pixel[3] == 0.0).count();
        let middle = (180..220).flat_map(|y| (180..220).map(move |x| 400 * y + x));
        let filled = middle.filter(|at| pixels[*at][3] > 0.9).count();
        let mean = opaque.iter().map(|pixel| pixel[0]).sum::<f64>() / opaque.len() as f64;
        let spread = opaque.iter().map(|pixel| (pixel[0] - mean).powi(2)).sum::<f64>() / opaque.len() as f64;
        println!(
            "view {i}: {} opaque, {clear} clear, {filled} of 1600 in the middle, deviation {:.2}",
            opaque.len(),
            spread.sqrt()
        );
        assert!(clear > 80_000 && opaque.len() > 4000 && filled > 800 && spread.sqrt() > 0.05);
    }
}

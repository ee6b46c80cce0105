//! The command `proxy` on depth maps that users have: of LiDAR, with confidence, and of models whose scale is unknown.

use std::path::Path;

use crate::support::ball_scene::{BALL, HEIGHT, TABLE, WIDTH, cameras, photograph, ray, true_depth};
use crate::support::command::Place;
use crate::support::device::context;
use camsplat::files::io;
use camsplat::files::io::depth_maps::DepthMaps;
use camsplat::files::photos::PhotoSet;
use camsplat::photogrammetry::stereo::{Reconstruction, StereoOptions, reconstruct};
use camsplat::scene::camera::Camera;
use camsplat::scene::surface::{Points, Surface};
use glam::{DVec2, DVec3};
use image::{GrayImage, ImageBuffer, Luma};

/// Pixels of the maps: fewer than the photos have, as those of phones.
const MAP: [u32; 2] = [WIDTH / 2, HEIGHT / 2];

/// A camera with pixels of the map's size.
fn coarse(camera: &Camera) -> Camera {
    Camera { intrinsics: camera.intrinsics.resized(MAP[0], MAP[1]).unwrap(), ..camera.clone() }
}

/// Writes a depth map in millimetres.
fn write_png(folder: &Path, camera: &Camera, depth: impl Fn(&Camera, u32, u32) -> f64) {
    let camera = coarse(camera);
    let image = ImageBuffer::<Luma<u16>, _>::from_fn(MAP[0], MAP[1], |x, y| {
        Luma([(1000.0 * depth(&camera, x, y)).round() as u16])
    });
    image.save(folder.join(&camera.name)).unwrap();
}

/// Writes a depth map as numpy does, in single precision.
fn write_npy(folder: &Path, camera: &Camera, depth: impl Fn(&Camera, u32, u32) -> f64) {
    let camera = coarse(camera);
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}", MAP[1], MAP[0]);
    let header = format!("{header:<117}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    for i in 0..MAP[0] * MAP[1] {
        bytes.extend((depth(&camera, i % MAP[0], i / MAP[0]) as f32).to_le_bytes());
    }
    std::fs::write(folder.join(&camera.name).with_extension("npy"), bytes).unwrap();
}

/// Part of the points that are neither on the ball nor on the table.
fn astray(found: &Reconstruction) -> f64 {
    let off = |p: &&DVec3| ((**p - BALL.0).length() - BALL.1).abs().min((p.z - TABLE).abs()) > 0.03;
    let positions = &found.points.positions;
    positions.iter().filter(off).count() as f64 / positions.len() as f64
}

/// If this failed, the scale of a model's depths would be lost where the capture's points know it, depths without points would be scaled by
/// something else, or maps whose
/// depths fall where others rise would bend the surface.
#[test]
fn depths_of_unknown_scale_are_brought_to_the_points() {
    let context = context();
    let folder = tempfile::tempdir().unwrap();
    let maps = folder.path().join("depths");
    std::fs::create_dir(&maps).unwrap();
    let all = cameras(12);
    let photos = photograph(folder.path(), &all, false);
    for (i, camera) in (0..).zip(&all) {
        let factor = 0.5 + 0.02 * f64::from(i);
        write_npy(&maps, camera, |camera, x, y| match (true_depth(camera, x, y, false), i) {
            (depth, 3) if depth > 0.0 => 20.0 - depth,
            (depth, _) => factor * depth,
        });
    }
    let seen = all.iter().flat_map(|camera| {
        (0..192).filter_map(move |i| {
            let [x, y] = [8 * (i % 16), 8 * (i / 16)];
            let depth = Some(true_depth(camera, x, y, false)).filter(|depth| *depth > 0.0)?;
            Some(camera.pose.position + depth * ray(camera, DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)))
        })
    });
    let points = Points { positions: seen.collect(), ..Points::default() };
    let options = StereoOptions { maps: Some(DepthMaps::new(maps)), hull: false, ..StereoOptions::default() };
    let set = PhotoSet { photos, points, ..PhotoSet::default() };
    let found = reconstruct(&context, &set, &options).unwrap();
    assert!(astray(&found) < 0.05, "{} of the points are off", astray(&found));
    assert!(found.from_depths > 500 && found.photos.len() == 11 && found.pairs == 0, "{:?}", found.photos);
    assert!(
        found.skipped.len() == 1 && found.skipped[0].contains("03.png: its depth map is nearer where"),
        "{:?}",
        found.skipped
    );
    assert!(found.notes.iter().any(|note| note.contains("multiplied by 1.6")), "{:?}", found.notes);

    let without = PhotoSet { points: Points::default(), ..set };
    let found = reconstruct(&context, &without, &options).unwrap();
    assert!(
        found.notes.iter().any(|note| note.contains("no points: depths are taken as they are")),
        "{:?}",
        found.notes
    );
    assert!(astray(&found) > 0.5, "wrong depths made a right surface: {}", astray(&found));
    assert_eq!(context.messages(), [""; 0], "the validation layers found fault");
}

/// If this failed, depths that a sensor itself does not trust would become surface or hollow out what others saw: here half of the maps show
/// a smaller ball, and the others one side of the true one. With low confidence the wrong ones do no harm and the hull stands for the other
/// side; with high confidence they do.
#[test]
fn depths_of_low_confidence_neither_build_nor_carve() {
    let context = context();
    let folder = tempfile::tempdir().unwrap();
    let [depths, confidence] = ["depth", "confidence"].map(|name| folder.path().join(name));
    [&depths, &confidence].into_iter().for_each(|folder| std::fs::create_dir(folder).unwrap());
    let all = cameras(12);
    let photos = photograph(folder.path(), &all, true);
    let (centre, radius) = BALL;
    for (i, camera) in all.iter().enumerate() {
        write_png(&depths, camera, |camera, x, y| {
            let direction = ray(camera, DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
            let depth = true_depth(camera, x, y, true);
            if i % 2 == 0 {
                let at = camera.pose.position + depth * direction;
                return if depth > 0.0 && at.x < centre.x { depth } else { 0.0 };
            }
            let (from, unit) = (camera.pose.position - centre, direction.normalize());
            let (b, c) = (from.dot(unit), from.length_squared() - (0.8 * radius).powi(2));
            if b * b > c { (-b - (b * b - c).sqrt()) / direction.length() } else { 0.0 }
        });
        let sure = if i % 2 == 0 { 127 } else { 0 };
        GrayImage::from_pixel(MAP[0], MAP[1], Luma([sure])).save(confidence.join(&camera.name)).unwrap();
    }
    let set = PhotoSet { photos, ..PhotoSet::default() };
    let made = |maps: DepthMaps| {
        let found =
            reconstruct(&context, &set, &StereoOptions { maps: Some(maps), ..StereoOptions::default() }).unwrap();
        let positions = &found.points.positions;
        let upper: Vec<DVec3> = positions.iter().copied().filter(|p| p.z > centre.z - 0.3 * radius).collect();
        let off = upper.iter().filter(|p| (p.distance(centre) / radius - 1.0).abs() > 0.06).count();
        let holes = (0..300)
            .map(|i| {
                let z = 1.0 - 1.2 * (f64::from(i) + 0.5) / 300.0;
                let (sin, cos) = (2.4 * f64::from(i)).sin_cos();
                centre + radius * DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
            })
            .filter(|p| positions.iter().all(|q| q.distance(*p) > 0.15 * radius))
            .count();
        println!(
            "{} points, {} from depths, {off} of {} off, {holes} holes",
            positions.len(),
            found.from_depths,
            upper.len()
        );
        (found.from_depths, off as f64 / upper.len() as f64, holes)
    };
    let careful = DepthMaps::new(depths.clone());
    assert_eq!(careful.confidence.as_deref(), Some(confidence.as_path()));
    let (from_depths, off, holes) = made(careful.clone());
    assert!(from_depths > 200 && off < 0.03 && holes == 0, "{from_depths} points, {off} off, {holes} holes");
    for trusting in
        [DepthMaps { confidence: None, ..careful.clone() }, DepthMaps { min_confidence: Some(0.0), ..careful.clone() }]
    {
        let (_, off, holes) = made(trusting);
        assert!(off > 0.2 && holes > 30, "wrong depths that count do no harm: {off} off, {holes} holes");
    }
    assert_eq!(context.messages(), [""; 0], "the validation layers found fault");
}

/// A raw export of Polycam of the ball, with maps of its true depth.
fn polycam(place: &Place) {
    let folders = ["corrected_cameras", "corrected_images", "depth", "confidence"];
    let [posed, images, depth, confidence] = folders.map(|name| place.path(&format!("scan/keyframes/{name}")));
    [&posed, &images, &depth, &confidence].into_iter().for_each(|folder| std::fs::create_dir_all(folder).unwrap());
    let all = cameras(8);
    photograph(&images, &all, true);
    for camera in &all {
        let [x, y, z] = [DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z].map(|axis| camera.pose.rotation * axis);
        let row = |i: usize| {
            let p = camera.pose.position;
            format!(r#""t_{i}0": {}, "t_{i}1": {}, "t_{i}2": {}, "t_{i}3": {}"#, x[i], y[i], z[i], p[i])
        };
        let ([fx, fy], [cx, cy]) = (camera.intrinsics.focal, camera.intrinsics.principal);
        let lens = format!(r#""fx": {fx}, "fy": {fy}, "cx": {cx}, "cy": {cy}, "width": {WIDTH}, "height": {HEIGHT}"#);
        let text = format!("{{{lens}, {}, {}, {}}}", row(0), row(1), row(2));
        std::fs::write(posed.join(&camera.name).with_extension("json"), text).unwrap();
        write_png(&depth, camera, |camera, x, y| true_depth(camera, x, y, true));
        GrayImage::from_pixel(MAP[0], MAP[1], Luma([255])).save(confidence.join(&camera.name)).unwrap();
    }
}

/// If this failed, users of Polycam would get a surface by stereo though their scan has depths, or could not ask for one; and maps that do
/// not belong to the photos would be laid over them.
#[test]
fn the_command_takes_the_maps_of_polycam_and_refuses_others() {
    let place = Place::new();
    polycam(&place);
    let ran = place.done("proxy scan --out p.ply");
    for line in
        ["with confidence above 85: 0% are left out", "depths are taken as they are, PNG in metres", "from depth maps"]
    {
        assert!(ran.out.contains(line), "{line:?} is not in {}", ran.out);
    }
    let Surface::Points(points) = io::read_surface(&place.path("p.ply")).unwrap() else { panic!("no points") };
    let off = |p: &&DVec3| (p.distance(BALL.0) - BALL.1).abs() > 0.06 * BALL.1 && p.z > BALL.0.z;
    let off = points.positions.iter().filter(off).count();
    assert!(50 * off < points.positions.len(), "{off} of {} points off", points.positions.len());
    let ran = place.done("proxy scan --out q.ply --no-depths --resolution 64 --photos 6");
    assert!(ran.out.contains("from stereo"), "{}", ran.out);

    std::fs::create_dir_all(place.path("other")).unwrap();
    for camera in cameras(8) {
        GrayImage::new(48, 64).save(place.path("other").join(&camera.name)).unwrap();
    }
    std::fs::create_dir(place.path("half")).unwrap();
    for camera in cameras(8) {
        write_npy(&place.path("half"), &camera, |_, _, _| 1.0);
        let file = place.path("half").join(&camera.name).with_extension("npy");
        let bytes = std::fs::read(&file).unwrap();
        let at = bytes.windows(3).position(|part| part == b"<f4").unwrap();
        std::fs::write(&file, [&bytes[..at], b"<f2", &bytes[at + 3..]].concat()).unwrap();
    }
    let keyframes = "scan/keyframes";
    std::fs::create_dir(place.path("empty")).unwrap();
    let shape = format!("--depths {keyframes}/depth --confidence other");
    let cases: [(&str, &[&str]); 10] = [
        ("--min-confidence 300", &["--min-confidence", "next to nothing"]),
        ("--depths nowhere", &["nowhere", "no folder"]),
        ("--depths other", &["16 bits"]),
        ("--depths half", &["neither float64 nor float32", "astype(numpy.float32)"]),
        (&shape, &["48 x 64", "another shape"]),
        ("--depths empty", &["0 of 8 photos", "depth maps of their names"]),
        ("--depths empty --min-confidence 1", &["confidence"]),
        ("--no-depths --min-confidence 1", &["--no-depths"]),
        ("--min-confidence nan", &["--min-confidence is NaN"]),
        ("--depths empty --hypotheses 32", &["--hypotheses", "--depths"]),
    ];
    for (arguments, fragments) in cases {
        let ran = place.run(&format!("proxy scan --out r.ply {arguments}"));
        assert_eq!(ran.code, Some(2), "{arguments}: {}{}", ran.out, ran.err);
        fragments.iter().for_each(|f| assert!(ran.err.contains(f), "{arguments}: {f:?} is not in {}", ran.err));
        assert!(!place.path("r.ply").exists(), "{arguments} wrote");
    }
}

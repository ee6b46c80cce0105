//! `export`: cameras as robots, artists and drones take them.

use std::f64::consts::TAU;
use std::fs;
use std::io::{Cursor, Read as _};

use crate::support::command::{Place, SHORT, assert_refused};
use crate::support::gps::jpeg_at;
use camsplat::files::io;
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::similarity::Similarity;
use glam::{DQuat, DVec2, DVec3};
use serde_json::Value;

/// Metres in a degree of latitude and of longitude at 50 degrees north (WGS 84).
const METRES: DVec2 = DVec2::new(111_229.03, 71_695.75);
/// Where the scenes of these tests lie.
const ANCHOR: DVec3 = DVec3::new(50.0, 10.0, 300.0);

/// Cameras in a ring at height 20 that look at the origin, in metres, +z up; the lens is off its middle.
fn ring(count: u32) -> Vec<Camera> {
    let camera = |i: u32| {
        let (sin, cos) = (TAU * f64::from(i) / f64::from(count)).sin_cos();
        let position = DVec3::new(30.0 * cos, 30.0 * sin, 20.0);
        Camera {
            name: format!("{i:03}.jpg"),
            pose: Pose::looking(position, -position, DVec3::Z),
            intrinsics: Intrinsics { principal: [310.0, 260.0], ..Intrinsics::from_fov(640, 480, 1.0) },
        }
    };
    (0..count).map(camera).collect()
}

fn with_ring(count: u32) -> Place {
    let place = Place::new();
    place.write("transforms.json", io::transforms::write(&ring(count), None));
    place
}

fn json(place: &Place, name: &str) -> Value {
    serde_json::from_str(&place.read(name)).unwrap()
}

/// Pixel of a point in one of the cameras.
fn seen(camera: &Camera, point: DVec3) -> DVec2 {
    let p = camera.pose.rotation.inverse() * (point - camera.pose.position);
    let k = &camera.intrinsics;
    DVec2::new(k.focal[0] * p.x / p.z + k.principal[0], k.focal[1] * p.y / p.z + k.principal[1])
}

fn vector(value: &Value) -> DVec3 {
    let at = |i: usize| value[i].as_f64().unwrap();
    DVec3::new(at(0), at(1), at(2))
}

fn rotation(value: &Value) -> DQuat {
    DQuat::from_xyzw(
        value[0].as_f64().unwrap(),
        value[1].as_f64().unwrap(),
        value[2].as_f64().unwrap(),
        value[3].as_f64().unwrap(),
    )
}

/// If this failed, a robot or a renderer would look elsewhere than the plan: what each format says shows a point at the pixel that the
/// camera itself shows it at (glTF knows no principal point, so there at the distance from its own middle).
#[test]
fn robots_and_renderers_get_the_same_views() {
    let place = with_ring(5);
    let ran = place.done("export transforms.json --out out --frame odom");
    assert!(ran.out.contains("5 from transforms.json"), "{}", ran.out);
    assert_eq!(
        place.files("out"),
        ["blender_cameras.py", "cameras.glb", "cameras.usda", "pose_array.json", "pose_array.yaml"]
    );
    let cameras = ring(5);
    let point = DVec3::new(2.0, -1.0, 3.0);

    let ros = json(&place, "out/pose_array.json");
    assert_eq!(ros["header"]["frame_id"], "odom");
    for (pose, camera) in ros["poses"].as_array().unwrap().iter().zip(&cameras) {
        let at = |what: &str, axis: &str| pose[what][axis].as_f64().unwrap();
        let q = DQuat::from_xyzw(
            at("orientation", "x"),
            at("orientation", "y"),
            at("orientation", "z"),
            at("orientation", "w"),
        );
        let position = DVec3::new(at("position", "x"), at("position", "y"), at("position", "z"));
        let copy = Camera { pose: Pose { position, rotation: q }, ..camera.clone() };
        assert!(seen(&copy, point).distance(seen(camera, point)) < 1e-6);
    }
    let yaml = place.read("out/pose_array.yaml");
    assert!(yaml.matches("- position: {x: ").count() == 5 && yaml.contains("frame_id: \"odom\""), "{yaml}");

    let glb = fs::read(place.path("out/cameras.glb")).unwrap();
    assert!(
        glb.len().is_multiple_of(4) && glb[8..12] == (glb.len() as u32).to_le_bytes(),
        "the .glb's own length is wrong"
    );
    let document: Value = serde_json::from_slice(&glb[20..]).unwrap();
    let nodes = document["nodes"].as_array().unwrap();
    let root = rotation(&nodes[5]["rotation"]);
    assert!((root * DVec3::Z).distance(DVec3::Y) < 1e-12, "glTF has +Y up");
    for (i, camera) in cameras.iter().enumerate() {
        let lens = &document["cameras"][nodes[i]["camera"].as_u64().unwrap() as usize]["perspective"];
        let (yfov, aspect) = (lens["yfov"].as_f64().unwrap(), lens["aspectRatio"].as_f64().unwrap());
        let turn = root * rotation(&nodes[i]["rotation"]);
        // OpenGL's axes: Y up, looking along -Z.
        let p = turn.inverse() * (root * (point - vector(&nodes[i]["translation"])));
        let slope = (0.5 * yfov).tan();
        let at = DVec2::new(p.x / (slope * aspect), -p.y / slope) / -p.z;
        let pixel = (0.5 + 0.5 * at) * DVec2::new(640.0, 480.0);
        let centred =
            Camera { intrinsics: Intrinsics { principal: [320.0, 240.0], ..camera.intrinsics }, ..camera.clone() };
        let off = pixel.distance(seen(&centred, point));
        assert!(off < 1e-6, "glTF camera {i} is {off} pixels off");
    }

    // A USD frustum reaches from -1/2 to 1/2 of its aperture, moved by the offset.
    let usd = place.read("out/cameras.usda");
    let number = |name: &str| -> f64 {
        let (_, rest) = usd.split_once(&format!("float {name} = ")).unwrap();
        rest.lines().next().unwrap().parse().unwrap()
    };
    let left = (-0.5 * number("horizontalAperture") + number("horizontalApertureOffset")) / number("focalLength");
    let top = (0.5 * number("verticalAperture") + number("verticalApertureOffset")) / number("focalLength");
    let k = cameras[0].intrinsics;
    assert!((left + k.principal[0] / k.focal[0]).abs() < 1e-9 && (top - k.principal[1] / k.focal[1]).abs() < 1e-9);
    assert_eq!(usd.matches("def Camera ").count(), 5);
    // Blender's shift is in parts of the longer side: 10 pixels of 640 to the right, 20 up.
    let script = place.read("out/blender_cameras.py");
    assert!(script.matches("[0.015625,0.03125]],").count() >= 4, "{script}");
}

/// If this failed, Blender and other readers in single precision would place the cameras of a scene in UTM up to half a metre away, and a
/// scene of millimetres, or one of kilometres, would be cut away by the cameras' planes.
#[test]
fn far_and_small_scenes_stay_whole_in_renderers() {
    for (scale, shift) in [(1.0, DVec3::new(500_000.0, 5_000_000.0, 100.0)), (1e-4, DVec3::ZERO)] {
        let place = Place::new();
        let mut cameras = ring(12);
        cameras.iter_mut().for_each(|camera| camera.pose.position = scale * camera.pose.position + shift);
        place.write("transforms.json", io::transforms::write(&cameras, None));
        let told = place.done("export transforms.json --out out").out;
        assert_eq!(told.contains("positions in blender_cameras.py are less (500"), shift != DVec3::ZERO, "{told}");

        let document: Value = serde_json::from_slice(&fs::read(place.path("out/cameras.glb")).unwrap()[20..]).unwrap();
        let nodes = document["nodes"].as_array().unwrap();
        let (root, moved) = (rotation(&nodes[12]["rotation"]), vector(&nodes[12]["translation"]));
        let script = place.read("out/blender_cameras.py");
        let rows: Vec<Value> = script
            .lines()
            .filter(|line| line.starts_with("    [\""))
            .map(|line| serde_json::from_str(line.trim().trim_end_matches(',')).unwrap())
            .collect();
        let offset = root.inverse() * moved;
        for (camera, (node, row)) in cameras.iter().zip(nodes.iter().zip(&rows)) {
            for position in [vector(&node["translation"]), vector(&row[1])] {
                let single = position.as_vec3().as_dvec3() + offset;
                assert!(
                    single.distance(camera.pose.position) < 1e-5 * scale,
                    "{single} is not {}",
                    camera.pose.position
                );
            }
        }
        // The cameras stand 36 units from the middle.
        let near = document["cameras"][0]["perspective"]["znear"].as_f64().unwrap();
        assert!(
            near < 0.1 * scale && script.contains(&format!("data.clip_start, data.clip_end = {near:?}, ")),
            "{near}"
        );
        assert!(place.read("out/cameras.usda").contains(&format!("clippingRange = ({near:?}, ")));
    }
}

/// If this failed, a panorama's cameras, in one place but for rounding, would draw nothing at all.
#[test]
fn cameras_in_one_place_draw_the_scene_around_them() {
    let place = Place::new();
    let mut cameras = ring(6);
    for (i, camera) in cameras.iter_mut().enumerate() {
        camera.pose.position = DVec3::new(3.0, 4.0, 2.0 + 1e-15 * i as f64);
    }
    place.write("transforms.json", io::transforms::write(&cameras, None));
    place.done("export transforms.json --out out --up z");
    assert!(place.read("out/cameras.usda").contains("clippingRange = (0.01, 1000000000.0)"));
    let script = place.read("out/blender_cameras.py");
    assert!(script.contains("[\"000.jpg\",[3.0,4.0,2.0],") && !script.contains("single precision"), "{script}");
}

/// If this failed, a drone would fly or look elsewhere than the plan, more waypoints than an app takes would be in one mission, or a photo
/// would be missing.
#[test]
fn drones_get_every_photo_at_its_place() {
    let place = with_ring(130);
    let told = place.done("export transforms.json --geo 50,10,300,90 --takeoff 295 --out out").out;
    assert!(
        told.contains("2 missions, 130 photos, 187 m") && told.contains("25.0 to 25.0 m above the take-off at 295.0 m"),
        "{told}"
    );
    assert!(told.contains("never flown"), "{told}");
    // With a heading of 90 degrees the scene's +y is east and its +x south.
    let place_of = |i: usize| {
        let p = ring(130)[i].pose.position;
        (ANCHOR.x - p.x / METRES.x, ANCHOR.y + p.y / METRES.y)
    };
    let near = |(lat, lon): (f64, f64), i: usize| {
        let (lat0, lon0) = place_of(i);
        DVec2::new((lat - lat0) * METRES.x, (lon - lon0) * METRES.y).length() < 0.02
    };
    // The camera looks to the middle: at (-x, -y), which is to the heading of its own place turned around.
    let heading = |i: usize| {
        let p = ring(130)[i].pose.position;
        (-p.y).atan2(p.x).to_degrees().rem_euclid(360.0)
    };
    let turned = |a: f64, b: f64| ((a - b + 180.0).rem_euclid(360.0) - 180.0).abs();
    let pitch = (-20.0f64).atan2(30.0).to_degrees();

    let features = json(&place, "out/mission.geojson");
    let photos: Vec<&Value> =
        features["features"].as_array().unwrap().iter().filter(|f| f["geometry"]["type"] == "Point").collect();
    assert_eq!(photos.len(), 130);
    for (i, photo) in photos.iter().enumerate() {
        let at = vector(&photo["geometry"]["coordinates"]);
        assert!(near((at.y, at.x), i) && (at.z - 320.0).abs() < 0.01, "{photo}");
        let says = |what: &str| photo["properties"][what].as_f64().unwrap();
        assert!(turned(says("heading"), heading(i)) < 0.01 && (says("pitch") - pitch).abs() < 0.01, "{photo}");
    }

    let mut taken = 0;
    for (mission, waypoints) in [(1, 99), (2, 31)] {
        let csv = place.read(&format!("out/mission-{mission}.csv"));
        let columns: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
        assert_eq!((columns.len(), csv.lines().count()), (46, waypoints + 1));
        for line in csv.lines().skip(1) {
            let values: Vec<f64> = line.split(',').map(|value| value.parse().unwrap()).collect();
            assert!(near((values[0], values[1]), taken) && (values[2] - 25.0).abs() < 0.01, "{line}");
            assert!(turned(values[3], heading(taken)) < 0.1 && (values[7] - pitch).abs() < 0.1, "{line}");
            taken += 1;
        }
        let plan = json(&place, &format!("out/mission-{mission}.plan"));
        let items = plan["mission"]["items"].as_array().unwrap();
        let count = |command: u64| items.iter().filter(|item| item["command"] == command).count();
        assert_eq!([count(22), count(16), count(205), count(2000), count(20)], [1, waypoints, waypoints, waypoints, 1]);
        assert!(
            items
                .iter()
                .zip(1..)
                .all(|(item, id)| item["doJumpId"] == id && item["params"].as_array().unwrap().len() == 7)
        );
        let kmz = fs::read(place.path(&format!("out/mission-{mission}.kmz"))).unwrap();
        let mut archive = zip::ZipArchive::new(Cursor::new(kmz)).unwrap();
        for (name, height) in
            [("wpmz/template.kml", "<wpml:height>25.00<"), ("wpmz/waylines.wpml", "<wpml:executeHeight>25.00<")]
        {
            let mut text = String::new();
            archive.by_name(name).unwrap().read_to_string(&mut text).unwrap();
            for part in [height, "takePhoto", &format!("<wpml:gimbalPitchRotateAngle>{pitch:.1}<")] {
                assert_eq!(text.matches(part).count(), waypoints, "{part} in {name}");
            }
        }
    }
    let kml = place.read("out/mission.kml");
    assert!(
        kml.matches("<Camera>").count() == 130 && kml.contains(&format!("<tilt>{:.2}</tilt>", pitch + 90.0)),
        "{kml}"
    );
    // The same input gives the same files.
    place.done("export transforms.json --geo 50,10,300,90 --takeoff 295 --out again");
    for name in place.files("out") {
        assert_eq!(
            fs::read(place.path(&format!("out/{name}"))).unwrap(),
            fs::read(place.path(&format!("again/{name}"))).unwrap()
        );
    }
}

/// If this failed, a drone would fly straight through what its tour goes around, take off from an altitude that nobody meant, or photograph
/// what was photographed before.
#[test]
fn a_plan_gives_its_tour_and_no_kept_cameras() {
    let place = Place::new();
    place.done(&format!("plan ball.ply {SHORT} --out first"));
    place.done(&format!("plan ball.ply {SHORT} --keep first --floor -1.2 --out plan"));
    let mut record = place.plan("plan");
    // A way around something, between the first two cameras.
    let tour = record.tour.as_mut().unwrap();
    tour.path.insert(1, DVec3::new(9.0, 9.0, 9.0));
    place.write("plan/plan.json", serde_json::to_string(&record).unwrap());
    let told = place.done("export plan --geo 50,10,300 --lowest -1 --out out").out;
    assert!(
        told.contains("5 kept cameras are left out")
            && told.contains("5 photos")
            && told.contains("at 299.0 m, the lowest point of the surface"),
        "{told}"
    );
    let csv = place.read("out/mission.csv");
    let passed = csv.lines().nth(2).unwrap();
    assert!(csv.lines().count() == 7 && passed.contains(",10.00,") && !passed.contains(",1,0,"), "{csv}");
    // A tour of other cameras is not followed, and that is said.
    record.tour.as_mut().unwrap().path.reverse();
    place.write("other.json", serde_json::to_string(&record).unwrap());
    let told = place.done("export other.json --geo 50,10,300 --lowest -1 --out other").out;
    assert!(
        told.contains("no tour goes through these cameras") && !place.read("other/mission.csv").contains(",10.00,"),
        "{told}"
    );
    // A plan that was spoilt by hand gives no cameras that look nowhere.
    record.region.up = DVec3::ZERO;
    place.write("spoilt.json", serde_json::to_string(&record).unwrap());
    assert_refused(&place, &[("export spoilt.json --out no", &["up direction"])]);
    // What is lower than allowed is refused, and nothing is written.
    let low = "export plan --geo 50,10,300 --takeoff 305 --out no";
    assert_refused(&place, &[(low, &["--lowest", "above the take-off"])]);
}

/// If this failed, a drone would fly past a photo, or a plan count on others than it keeps, and nobody would know.
#[test]
fn cameras_that_are_left_out_are_counted() {
    let place = Place::new();
    place.done(&format!("plan ball.ply {SHORT} --out first"));
    let mut broken = json(&place, "first/transforms.json");
    broken["frames"][2]["transform_matrix"][0][3] = Value::Null;
    place.write("broken.json", broken.to_string());
    let plan = |option: &str| format!("plan ball.ply --{option} broken.json {SHORT} --out {option}");
    for command in ["export broken.json --out views".into(), plan("keep"), plan("viewers")] {
        let told = place.done(&command).out;
        assert_eq!(told.matches("frames left out: 1").count(), 1, "{command}: {told}");
    }
}

/// If this failed, photos with GPS could not say where a reconstruction of any scale and turn lies, or would say it south of the equator or
/// below the sea wrongly.
#[test]
fn photos_with_gps_place_the_scene() {
    let place = Place::new();
    let truth = ring(12);
    let hidden = Similarity {
        rotation: DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 1.1),
        scale: 0.05,
        translation: DVec3::new(4.0, 5.0, 6.0),
    };
    fs::create_dir_all(place.path("capture/images")).unwrap();
    let mut cameras = Vec::new();
    let picture = image::RgbImage::from_pixel(64, 48, image::Rgb([90, 120, 60]));
    for (i, camera) in truth.iter().enumerate() {
        // Twelve cameras in a ring are level; every other one is taken higher, so that all axes show.
        let position = camera.pose.position + DVec3::new(0.0, 0.0, if i % 2 == 0 { -30.0 } else { 5.0 });
        let pose = Pose::looking(position, -position, DVec3::Z);
        // 33 degrees south: a degree is 110,911 m north and 93,453 m east there.
        let (latitude, longitude) = (-33.0 + position.y / 110_911.0, -70.0 + position.x / 93_453.0);
        place.write(&format!("capture/images/{}", camera.name), jpeg_at(&picture, latitude, longitude, position.z));
        let intrinsics = Intrinsics::from_fov(64, 48, 1.0);
        cameras.push(Camera { pose: hidden.pose(&pose), intrinsics, ..camera.clone() });
    }
    place.write("capture/transforms.json", io::transforms::write(&cameras, None));
    let told = place.done("export capture --geo capture --takeoff -20 --lowest -5 --to geojson,kml --out out").out;
    assert!(told.contains("12 of 12 photos with GPS"), "{told}");
    let unit = told.split("a unit is ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
    assert!((unit.parse::<f64>().unwrap() - 20.0).abs() < 0.01, "{told}");
    assert_eq!(place.files("out"), ["mission.geojson", "mission.kml"]);
    let features = json(&place, "out/mission.geojson");
    for (feature, camera) in features["features"].as_array().unwrap().iter().zip(&cameras) {
        let at = vector(&feature["geometry"]["coordinates"]);
        let local = hidden.inverse().point(camera.pose.position);
        let off = DVec3::new((at.x + 70.0) * 93_453.0, (at.y + 33.0) * 110_911.0, at.z) - local;
        assert!(off.length() < 0.3, "{off} beside {}", camera.name);
        let direction = -local;
        let heading = direction.x.atan2(direction.y).to_degrees().rem_euclid(360.0);
        let turned = (feature["properties"]["heading"].as_f64().unwrap() - heading + 180.0).rem_euclid(360.0) - 180.0;
        assert!(turned.abs() < 0.5, "{turned}");
    }
}

/// If this failed, bad input would give missions to nowhere, or half a folder.
#[test]
fn what_cannot_be_flown_is_refused() {
    let place = with_ring(4);
    for (options, what) in [
        ("--to dji", "needs a place on Earth"),
        ("--geo 50,10", "LAT,LON,ALT"),
        ("--geo 50,500,0 --takeoff 0", "no place"),
        ("--geo 50,10,0", "--takeoff"),
        ("--geo nowhere --takeoff 0", "a capture, which this is not"),
        ("--geo utm:77N --takeoff 0 --up z", "no UTM zone"),
        ("--geo utm:33N --takeoff 0 --up z", "not in a UTM zone"),
        ("--geo utm:33N --takeoff 0 --up y", "--up z"),
        ("--geo ecef --takeoff 0", "no place"),
        ("--geo 50,10,0 --takeoff 0 --gimbal 10,-20", "the lower one first"),
        ("--geo 50,10,0 --takeoff 0 --speed 0", "above zero"),
        ("--geo 50,10,0 --takeoff 0 --speed 0.5", "from 1 to 15 m/s"),
        ("--takeoff 5", "--geo"),
        ("--geo transforms.json --takeoff 0", "no photo has an image"),
    ] {
        assert_refused(&place, &[(&format!("export transforms.json --out no {options}"), &[what])]);
    }
    let told = place.done("export transforms.json --geo 50,10,0 --takeoff 0 --gimbal -20,10 --out out").out;
    assert!(told.contains("4 of 4 cameras look farther") && told.contains("turned by 14 degrees"), "{told}");
    assert!(place.read("out/mission.csv").contains(",2,-20.0,"));
}

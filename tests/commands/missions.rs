//! Missions as they are flown: take-off, areas to keep out of, and files that are held against the plan.

use std::fs;
use std::io::{Cursor, Read as _, Write as _};

use crate::support::command::{Place, assert_refused};
use glam::{DVec2, DVec3};
use serde_json::Value;
use zip::write::SimpleFileOptions;

/// Metres in a degree of latitude and of longitude at 50 degrees north (WGS 84).
const METRES: DVec2 = DVec2::new(111_229.03, 71_695.75);
/// +y is north there, and the scene's origin is at an altitude of 300 m.
const GEO: &str = "--geo 50,10,300";
/// Height of the ground and of the house on it, and half of the house's side.
const GROUND: f64 = 1.5;
const TOP: f64 = 9.5;
const HALF: f64 = 5.0;

/// A house of 10 x 10 x 8 m in the middle of level ground, 60 m wide.
fn house() -> String {
    let box_of = |half: f64, low: f64, high: f64| {
        let corner = |i: usize| {
            let side = |bit: usize| if i >> bit & 1 == 0 { -half } else { half };
            format!("{} {} {}", side(0), side(1), if i >> 2 & 1 == 0 { low } else { high })
        };
        (0..8).map(corner).collect::<Vec<_>>()
    };
    let vertices = [box_of(30.0, GROUND - 1.0, GROUND), box_of(HALF, GROUND, TOP)].concat();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let face = |offset: usize| faces.map(|face| format!("4 {}", face.map(|i| (i + offset).to_string()).join(" ")));
    format!(
        "ply\nformat ascii 1.0\nelement vertex 16\nproperty float x\nproperty float y\nproperty float z\nelement face 12\n\
         property list uchar int vertex_indices\nend_header\n{}\n{}\n",
        vertices.join("\n"),
        [face(0), face(8)].concat().join("\n")
    )
}

/// An area to the north-east of the house.
const ZONE: [[f64; 2]; 4] = [[12.0, 12.0], [60.0, 12.0], [60.0, 60.0], [12.0, 60.0]];

fn on_earth([x, y]: [f64; 2]) -> [f64; 2] {
    [10.0 + x / METRES.y, 50.0 + y / METRES.x]
}

/// A plan around the house that keeps out of the area, and its missions.
fn planned() -> Place {
    let place = Place::new();
    place.write("house.ply", house());
    let ring = ZONE.map(|corner| format!("[{:.10}, {:.10}]", on_earth(corner)[0], on_earth(corner)[1])).join(", ");
    place.write("zone.geojson", format!(r#"{{"type": "Polygon", "coordinates": [[{ring}]]}}"#));
    place.done(&format!(
        "plan house.ply --out plan --shell 0,0,3,12,30 --floor 8 --clearance 6 --views 24 --held-out 60 --iterations 40 \
         --checkpoint-every 20 --keep-out zone.geojson {GEO}"
    ));
    let told = place.done(&format!("export plan --out flight {GEO}")).out;
    assert!(told.contains("take-off at 301.5 m, the ground around the first waypoint"), "{told}");
    place
}

fn waypoints(place: &Place, name: &str) -> Vec<DVec3> {
    let csv = place.read(name);
    let line = |line: &str| {
        let values: Vec<f64> = line.split(',').map(|value| value.parse().unwrap()).collect();
        DVec3::new((values[1] - 10.0) * METRES.y, (values[0] - 50.0) * METRES.x, values[2])
    };
    csv.lines().skip(1).map(line).collect()
}

/// If this failed, a drone would fly 8 m too low, as it did when heights counted from the plan's floor, or into an area where it drifts.
#[test]
fn heights_count_from_the_ground_and_areas_have_a_margin() {
    let place = planned();
    let cameras = place.plan("plan").cameras;
    let flown = waypoints(&place, "flight/mission.csv");
    for camera in &cameras {
        let p = camera.pose.position;
        let near = flown.iter().map(|at| (at.truncate() - p.truncate()).length()).fold(f64::INFINITY, f64::min);
        let at = flown.iter().find(|at| (at.truncate() - p.truncate()).length() == near).unwrap();
        assert!(near < 0.02 && (at.z - (p.z - GROUND)).abs() < 0.011, "{p} is flown at {at}");
    }
    // The area and three metres around it: on whole legs.
    let depth = |p: DVec2| (p.x.min(ZONE[2][0]) - ZONE[0][0]).min(p.y.min(ZONE[2][1]) - ZONE[0][1]);
    for leg in flown.windows(2) {
        for i in 0..=50 {
            let p = leg[0].lerp(leg[1], f64::from(i) / 50.0);
            assert!(depth(p.truncate()) < -2.9, "{p} is in the margin");
            let wall = p.truncate().abs().max_element() - HALF;
            assert!(wall > 5.4 || p.z + GROUND > TOP + 5.4, "{p} is near the house");
        }
    }
    let plan: Value = serde_json::from_str(&place.read("flight/mission.plan")).unwrap();
    let fence = &plan["geoFence"]["polygons"][0];
    assert_eq!((&fence["inclusion"], fence["polygon"].as_array().unwrap().len()), (&Value::Bool(false), 4));
    assert!((fence["polygon"][0][0].as_f64().unwrap() - on_earth(ZONE[0])[1]).abs() < 1e-9, "latitude comes first");
    let params =
        plan["mission"]["items"].as_array().unwrap().iter().flat_map(|item| item["params"].as_array().unwrap());
    assert!(params.into_iter().all(Value::is_number), "ArduPilot takes no null");
    assert!((plan["mission"]["plannedHomePosition"][2].as_f64().unwrap() - 301.5).abs() < 0.01);
    assert!(place.read("flight/mission.kml").contains("keep out: zone.geojson"));
    assert!(place.read("flight/mission.geojson").contains(r#""keep_out":true"#));
    // Take-offs below a tall house clear it before the way to the first waypoint.
    let (_, waylines) = wpml(&fs::read(place.path("flight/mission.kmz")).unwrap());
    assert!(waylines.contains("<wpml:takeOffSecurityHeight>20<"), "{waylines}");
    let told = place.done(&format!("export plan --out deep {GEO} --takeoff 200")).out;
    assert!(told.contains("24 photos") && told.contains("above the take-off at 200.0 m"), "{told}");
    let (_, waylines) = wpml(&fs::read(place.path("deep/mission.kmz")).unwrap());
    assert!(waylines.contains("<wpml:takeOffSecurityHeight>115<"), "{waylines}");
}

/// Both texts of a .kmz.
fn wpml(bytes: &[u8]) -> (String, String) {
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
    let mut text = |name: &str| {
        let mut text = String::new();
        archive.by_name(name).unwrap().read_to_string(&mut text).unwrap();
        text
    };
    (text("wpmz/template.kml"), text("wpmz/waylines.wpml"))
}

fn packed(template: &str, waylines: &str) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, text) in [("wpmz/template.kml", template), ("wpmz/waylines.wpml", waylines)] {
        archive.start_file(name, SimpleFileOptions::default()).unwrap();
        archive.write_all(text.as_bytes()).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

/// A value of the first item of a command, changed.
fn changed(plan: &str, command: u32, number: usize, by: f64) -> String {
    let mut plan: Value = serde_json::from_str(plan).unwrap();
    let items = plan["mission"]["items"].as_array_mut().unwrap();
    let item = items.iter_mut().find(|item| item["command"] == command).unwrap();
    let value = item["params"][number].as_f64().unwrap() + by;
    item["params"][number] = value.into();
    if number == 6 {
        item["Altitude"] = value.into();
    }
    plan.to_string()
}

/// If this failed, a mission that was spoilt in an editor, or by a mistake of ours, would be flown as it is.
#[test]
fn every_planted_fault_is_found() {
    let place = planned();
    let all = ["kmz", "plan", "csv", "kml", "geojson"].map(|extension| format!("--check flight/mission.{extension}"));
    let told = place.done(&format!("export plan {GEO} {}", all.join(" "))).out;
    assert_eq!(told.matches(": as planned").count(), 5, "{told}");

    let (csv, plan) = (place.read("flight/mission.csv"), place.read("flight/mission.plan"));
    let (kml, geojson) = (place.read("flight/mission.kml"), place.read("flight/mission.geojson"));
    let (template, waylines) = wpml(&fs::read(place.path("flight/mission.kmz")).unwrap());
    let lines: Vec<&str> = csv.lines().collect();
    let joined = |lines: &[&str]| lines.join("\n").into_bytes();
    let with = |at: usize, column: usize, value: &str| {
        let mut values: Vec<&str> = lines[at].split(',').collect();
        values[column] = value;
        let line = values.join(",");
        let mut lines = lines.clone();
        lines[at] = &line;
        joined(&lines)
    };
    let swapped = {
        let mut lines = lines.clone();
        lines.swap(3, 4);
        joined(&lines)
    };
    let twice = [&lines[..3], &lines[2..]].concat();
    // Through the house, from one side to the other.
    let through = {
        let west = lines[1].replace(lines[1].split(',').next().unwrap(), "50.0000000");
        let at = |x: f64| {
            let mut values: Vec<String> = west.split(',').map(str::to_owned).collect();
            values[1] = format!("{:.8}", 10.0 + x / METRES.y);
            values[2] = "3.00".into();
            values.join(",")
        };
        [lines[0].to_owned(), at(-20.0), at(20.0)].join("\n").into_bytes()
    };
    let number = lines[2].split(',').nth(2).unwrap().parse::<f64>().unwrap();
    let edited = |name: &str, edit: &dyn Fn(&mut Value)| {
        let mut value: Value = serde_json::from_str(&place.read(name)).unwrap();
        edit(&mut value);
        value.to_string().into_bytes()
    };
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("a.csv", with(2, 2, &format!("{:.2}", number + 0.02)), "waypoint 2 is 0.00 m beside and +0.02 m above"),
        ("b.csv", with(2, 0, "50.0005"), "waypoint 2 is"),
        ("c.csv", with(2, 3, "12.5"), "degrees, not to"),
        ("d.csv", with(2, 7, "-1.5"), "degrees, not to"),
        ("e.csv", with(2, 10, "-1"), "it takes 23 photos, not 24"),
        ("f.csv", with(2, 38, "1"), "its altitude is not above the take-off"),
        ("g.csv", with(2, 39, "9.0"), "its speed is another one"),
        ("h.csv", with(2, 2, "NaN"), "is no number"),
        ("i.csv", joined(&lines[..lines.len() - 1]), "waypoints, not"),
        ("j.csv", joined(&twice), "waypoints, not"),
        ("k.csv", swapped, "waypoint 3 is"),
        ("l.csv", through, "passes the surface at 0.00 m"),
        ("m.plan", changed(&plan, 16, 6, 0.5).into_bytes(), "+0.50 m above"),
        ("n.plan", changed(&plan, 16, 3, 20.0).into_bytes(), "degrees, not to"),
        ("o.plan", changed(&plan, 205, 0, 7.0).into_bytes(), "degrees, not to"),
        ("p.plan", changed(&plan, 22, 6, -1.0).into_bytes(), "m first, not to"),
        (
            "q.plan",
            edited("flight/mission.plan", &|plan| plan["geoFence"]["polygons"] = Value::Array(Vec::new())),
            "areas to keep out",
        ),
        (
            "r.plan",
            edited("flight/mission.plan", &|plan| plan["mission"]["items"][0]["params"][3] = Value::Null),
            "is null",
        ),
        (
            "s.plan",
            edited("flight/mission.plan", &|plan| plan["mission"]["plannedHomePosition"][2] = 310.0.into()),
            "its take-off is",
        ),
        (
            "t.plan",
            edited("flight/mission.plan", &|plan| plan["mission"]["items"][2]["frame"] = 0.into()),
            "not above the take-off",
        ),
        ("u.plan", plan.as_bytes()[..plan.len() / 2].to_vec(), "it is no JSON"),
        ("v.kmz", packed(&template, &waylines.replacen("takePhoto", "startRecord", 1)), "it takes 23 photos"),
        ("w.kmz", packed(&template, &waylines.replace(">relativeToStartPoint<", ">WGS84<")), "not above the take-off"),
        (
            "x.kmz",
            packed(&template.replacen("<wpml:height>", "<wpml:height>1", 1), &waylines),
            "its template says another flight",
        ),
        (
            "y.kmz",
            packed(&template, &waylines.replace("SecurityHeight>20<", "SecurityHeight>5<")),
            "it climbs to 5.0 m first",
        ),
        ("z.kmz", waylines.clone().into_bytes(), "it is no archive"),
        ("a.kml", kml.replacen("<tilt>", "<tilt>1", 1).into_bytes(), "degrees, not to"),
        ("b.kml", kml.replacen(">absolute<", ">relativeToGround<", 1).into_bytes(), "an altitude is not absolute"),
        ("c.geojson", geojson.replacen("\"pitch\":-", "\"pitch\":-1", 1).into_bytes(), "degrees, not to"),
    ];
    for (name, bytes, fault) in &cases {
        place.write(name, bytes);
        let ran = place.run(&format!("export plan {GEO} --check {name}"));
        assert!(ran.code == Some(2) && ran.out.contains(fault), "{name}, {fault}: {}{}", ran.out, ran.err);
        assert!(ran.err.contains("do not fly it"), "{name}: {}", ran.err);
    }
    assert_refused(
        &place,
        &[
            ("export plan --check flight/mission.csv", &["--check", "--geo"]),
            (
                &format!("export plan {GEO} --check flight/none.csv"),
                &["none.csv", "no such file or folder", "check the path"],
            ),
            (&format!("export plan {GEO} --check house.ply"), &["it is no mission"]),
            (&format!("export plan {GEO} --check flight/mission.csv --out o"), &["--out"]),
        ],
    );
}

/// If this failed, a plan whose tour leads through a house would still be written as a mission: those for apps are refused, and what shows it
/// on a map says so.
#[test]
fn a_way_through_the_house_is_not_written() {
    let place = planned();
    let mut record = place.plan("plan");
    let tour = record.tour.as_mut().unwrap();
    tour.path.insert(1, DVec3::new(0.0, 0.0, 4.0));
    place.write("through.json", serde_json::to_string(&record).unwrap());
    let options = format!("export through.json {GEO}");
    assert_refused(
        &place,
        &[(&format!("{options} --out bad"), &["cannot be flown", "passes the surface at 0.00 m", "--to kml,geojson"])],
    );
    let told = place.done(&format!("{options} --to kml --out map")).out;
    assert!(told.contains("warning  mission.kml: the leg from waypoint 1 to 2 passes the surface"), "{told}");
    // Without the surface nothing can be held against it, and that is said.
    record.surface.path = "gone.ply".into();
    place.write("gone.json", serde_json::to_string(&record).unwrap());
    let told = place.done(&format!("export gone.json {GEO} --takeoff 300 --out blind")).out;
    assert!(told.contains("warning  the plan's surface gone.ply is not there"), "{told}");
    assert_refused(
        &place,
        &[(&format!("export gone.json {GEO} --surface house.ply --out no"), &["passes the surface"])],
    );
}

/// If this failed, a mission of a hall would have the drone climb through its roof, as one of a room did.
#[test]
fn a_mission_under_a_roof_is_not_written() {
    let place = planned();
    // The same cameras under a roof that reaches over all of them.
    let roofed =
        house().replace("element vertex 16", "element vertex 20").replace("element face 12", "element face 13");
    let (head, rest) = roofed.split_once("end_header\n").unwrap();
    let lines: Vec<&str> = rest.lines().collect();
    let corners = ["-40 -40 60", "40 -40 60", "40 40 60", "-40 40 60"];
    let lines = [&lines[..16], &corners, &lines[16..], &["4 16 17 18 19"]].concat();
    place.write("hall.ply", format!("{head}end_header\n{}\n", lines.join("\n")));
    let words = ["the surface lies above a mission's first waypoint", "begin and end in the open"];
    assert_refused(&place, &[(&format!("export plan {GEO} --surface hall.ply --out no"), &words)]);
}

/// If this failed, cameras would stand around the middle of a lawn, a hundred metres from the house that they are for, and below the ground;
/// or a reconstruction with +z up would lie on its side.
#[test]
fn a_house_on_its_lawn_is_the_subject() {
    let place = Place::new();
    let wide = house().replace("30 ", "200 ");
    place.write("house.ply", &wide);
    let mut lines = wide.lines().skip_while(|line| *line != "end_header").skip(1);
    let vertices: Vec<String> = lines.by_ref().take(16).map(|line| format!("v {line}")).collect();
    let face = |line: &str| {
        line.split(' ').skip(1).map(|i| (i.parse::<u32>().unwrap() + 1).to_string()).collect::<Vec<_>>().join(" ")
    };
    let faces: Vec<String> = lines.map(|line| format!("f {}", face(line))).collect();
    place.write("house.obj", format!("{}\n{}\n", vertices.join("\n"), faces.join("\n")));
    place.write("box.json", r#"{"boxes": [[-6, -6, 1.5, 6, 6, 10]]}"#);
    // The house alone, open at its bottom, as one object of the whole.
    let own: Vec<&String> =
        faces.iter().filter(|line| line[2..].split(' ').all(|i| i.parse::<u32>().unwrap() > 8)).collect();
    let own: Vec<&str> = own.iter().skip(1).map(|line| line.as_str()).collect();
    place.write("part.obj", format!("{}\n{}\n", vertices.join("\n"), own.join("\n")));
    let short = "--views 8 --held-out 60 --iterations 20 --checkpoint-every 10";
    let distances = |name: &str| -> Vec<f64> {
        let cameras = place.plan(name).cameras;
        assert!(name == "all" || cameras.iter().all(|camera| camera.pose.position.z > GROUND), "{cameras:?}");
        cameras.iter().map(|camera| camera.pose.position.distance(DVec3::new(0.0, 0.0, 5.5))).collect()
    };
    place.done(&format!("plan house.ply --out all {short}"));
    assert!(distances("all").iter().all(|distance| *distance > 200.0));
    for (name, options) in [
        ("largest", "house.ply --subject largest"),
        ("box", "house.ply --subject=-6,-6,1.5,6,6,10"),
        ("file", "house.ply --subject box.json"),
        ("obj", "house.obj --subject largest"),
        ("part", "house.obj --subject part.obj"),
    ] {
        let told = place.done(&format!("plan {options} --out {name} {short}")).out;
        assert!(told.contains("subject  ") && told.contains("block rays and are not planned for"), "{told}");
        assert!(distances(name).iter().all(|distance| *distance < 40.0), "{name}: {:?}", distances(name));
        assert_eq!(told.contains("up       +z, by the ground of house.obj"), name == "obj" || name == "part", "{told}");
    }
    // A score of the plan is of the same subject.
    let told = place.done("score house.ply file --held-out 60").out;
    assert!(told.contains("subject  ") && told.contains("floor at 1.5"), "{told}");
    place.write("cube.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
    assert_refused(
        &place,
        &[
            (&format!("plan cube.obj --out no {short}"), &["which way is up", "--up y or --up z"]),
            (&format!("plan house.ply --subject 1,2,3 --out no {short}"), &["--subject", "largest"]),
            (&format!("plan house.ply --subject 0,0,5,1,1,4 --out no {short}"), &["the lower corner"]),
            (
                &format!("plan house.ply --subject 50,50,50,60,60,60 --out no {short}"),
                &["--subject", "nothing of the surface"],
            ),
            (&format!("plan ball.ply --subject largest --out no {short} --up z --subject none.json"), &["--subject"]),
        ],
    );
}

/// If this failed, cameras that look straight down would be flown tilted, at heights that none of them has.
#[test]
fn cameras_that_look_down_keep_their_headings_and_height() {
    let place = Place::new();
    // Image axes in OpenGL's way: right, up, back; headings from +y, which is north.
    let frame = |i: usize, heading: f64, pitch: f64| {
        let (sin, cos) = f64::to_radians(heading).sin_cos();
        let (down, level) = f64::to_radians(-pitch).sin_cos();
        let right = [cos, -sin, 0.0];
        let (up, back) = ([down * sin, down * cos, level], [-level * sin, -level * cos, down]);
        let row = |k: usize, at: f64| format!("[{}, {}, {}, {at}]", right[k], up[k], back[k]);
        let rows = [row(0, 10.0 * i as f64), row(1, 0.0), row(2, 30.0)].join(", ");
        format!(r#"{{"file_path": "{i}.png", "transform_matrix": [{rows}, [0, 0, 0, 1]]}}"#)
    };
    let write = |name: &str, poses: &[(f64, f64)]| {
        let frames: Vec<String> =
            poses.iter().enumerate().map(|(i, (heading, pitch))| frame(i, *heading, *pitch)).collect();
        let text = format!(r#"{{"camera_angle_x": 1.0, "w": 640, "h": 480, "frames": [{}]}}"#, frames.join(", "));
        place.write(name, text);
    };
    let poses = [(0.0, -90.0), (90.0, -90.0), (200.0, -90.0), (90.0, -89.9), (90.0, -60.0), (0.0, -90.0)];
    write("down.json", &poses);
    place.done(&format!("export down.json {GEO} --takeoff 300 --to litchi --out o"));
    for (line, (heading, pitch)) in place.read("o/mission.csv").lines().skip(1).zip(poses) {
        let values: Vec<f64> = line.split(',').map(|value| value.parse().unwrap()).collect();
        assert_eq!((values[2], values[3], values[7]), (30.0, heading, pitch), "{line}");
    }
    // With one heading they could as well look at a wall.
    write("same.json", &[(90.0, -90.0); 3]);
    let export = format!("export same.json {GEO} --takeoff 300 --to litchi");
    assert_refused(&place, &[(&format!("{export} --out no"), &["give --up"])]);
    place.done(&format!("{export} --up z --out same"));
    assert!(place.read("same/mission.csv").lines().skip(1).all(|line| line.contains(",30.00,90.0,0,0,2,-90.0,")));
}

/// If this failed, a mission that turns corners, points the camera or ends otherwise than planned would pass for the planned one; or one that
/// an app has only saved again would not.
#[test]
fn a_mission_says_all_that_was_planned_and_may_be_saved_again() {
    let place = planned();
    let (csv, plan) = (place.read("flight/mission.csv"), place.read("flight/mission.plan"));
    let (template, waylines) = wpml(&fs::read(place.path("flight/mission.kmz")).unwrap());
    let waypoints = csv.lines().count() - 1;
    let in_kmz = |from: &str, to: &str| {
        assert!(waylines.contains(from), "{from}");
        packed(&template, &waylines.replacen(from, to, 1))
    };
    let json = |edit: &dyn Fn(&mut Value)| {
        let mut value: Value = serde_json::from_str(&plan).unwrap();
        edit(&mut value);
        value.to_string().into_bytes()
    };
    let cell = |column: usize, value: &str| {
        let mut lines: Vec<String> = csv.lines().map(str::to_owned).collect();
        let mut values: Vec<&str> = lines[2].split(',').collect();
        values[column] = value;
        lines[2] = values.join(",");
        lines.join("\n").into_bytes()
    };
    for (name, bytes, fault) in [
        (
            "a.kmz",
            in_kmz("toPointAndStopWithDiscontinuityCurvature", "coordinateTurn"),
            "waypointTurnMode is coordinateTurn",
        ),
        (
            "b.kmz",
            in_kmz("<wpml:gimbalPitchRotateEnable>1", "<wpml:gimbalPitchRotateEnable>0"),
            "gimbalPitchRotateEnable is 0",
        ),
        ("c.kmz", in_kmz("<wpml:finishAction>goHome", "<wpml:finishAction>autoLand"), "finishAction is autoLand"),
        ("d.kmz", in_kmz(">reachPoint<", ">multipleDistance<"), "actionTriggerType is multipleDistance"),
        ("e.kmz", in_kmz("<wpml:waypointSpeed>3.0", "<wpml:waypointSpeed>15.0"), "waypointSpeed is 15.0"),
        (
            "f.plan",
            json(&|plan| plan["geoFence"]["breachReturn"] = serde_json::json!([51.0, 10.0, 5.0])),
            "has breachReturn",
        ),
        ("g.plan", json(&|plan| plan["mission"]["items"][1]["params"][6] = 1.into()), "/params/6 is 1, not 2"),
        ("h.plan", json(&|plan| plan["mission"]["items"][2]["autoContinue"] = false.into()), "autoContinue is false"),
        ("i.plan", json(&|plan| plan["mission"]["items"][0]["params"][4] = 50.01.into()), "not at the planned home"),
        ("j.csv", cell(4, "8"), "line 3, curvesize(m) is 8, not 0"),
        ("k.csv", cell(8, "4"), "line 3, actiontype1 is 4, not 0"),
    ] {
        place.write(name, bytes);
        let ran = place.run(&format!("export plan {GEO} --check {name}"));
        assert!(ran.code == Some(2) && ran.out.contains(fault), "{name}, {fault}: {}{}", ran.out, ran.err);
    }
    // Saved by an app: packed, with other spaces, numbers, order and words of its own.
    let mut deflated = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
    for (name, text) in [("wpmz/res/x.txt", "x"), ("wpmz/template.kml", &template), ("wpmz/waylines.wpml", &waylines)] {
        deflated.start_file(name, options).unwrap();
        deflated
            .write_all(
                text.replace("<wpml:index>", "\n  <wpml:executeTime>5</wpml:executeTime>\n<wpml:index> ").as_bytes(),
            )
            .unwrap();
    }
    let saved = json(&|plan| {
        plan["mission"]["cruiseSpeed"] = 3.into();
        plan["mission"]["items"].as_array_mut().unwrap().iter_mut().for_each(|item| {
            item["AMSLAltAboveTerrain"] = 320.5.into();
            if item["command"] == 2000 {
                (4..7).for_each(|i| item["params"][i] = Value::Null);
            }
        });
    });
    place.write("house.kmz", deflated.finish().unwrap().into_inner());
    place.write("house.plan", serde_json::to_string_pretty(&serde_json::from_slice::<Value>(&saved).unwrap()).unwrap());
    place.write(
        "house.csv",
        format!("\u{feff}{}\r\n\r\n", csv.trim_end().replace('\n', "\r\n").replace(",0,0,2,", ",\"0\",0,2,")),
    );
    let told = place.done(&format!("export plan {GEO} --check house.kmz --check house.plan --check house.csv")).out;
    assert!(told.matches(": as planned").count() == 3 && waypoints >= 24, "{told}");
    // A place that is nowhere is a fault of the file, and the next file is read all the same.
    place.write("nowhere.csv", cell(0, "95"));
    let ran = place.run(&format!("export plan {GEO} --check nowhere.csv --check house.csv"));
    assert!(
        ran.out.contains("there is no place at 95") && ran.out.contains("house.csv: as planned"),
        "{}{}",
        ran.out,
        ran.err
    );
    // From another folder the plan's surface is found beside the plan.
    let told = place.done("export plan --geo 50.0,10.00,300 --to litchi --out again").out;
    assert!(!told.contains("warning  the plan's surface"), "{told}");
    let mut broken: Value = serde_json::from_str(&place.read("plan/plan.json")).unwrap();
    broken["limits"]["moats"] = 1.into();
    place.write("broken.json", broken.to_string());
    assert_refused(&place, &[(&format!("export broken.json {GEO} --out no"), &["broken.json", "moats"])]);
}

//! Areas on Earth that cameras and missions keep out of: polygons of GeoJSON and KML.

use crate::support::command::{Place, SHORT, assert_refused};
use camsplat::scene::region::Region;
use glam::{DVec2, DVec3};
use serde_json::Value;

/// Metres in a degree of latitude and of longitude at 50 degrees north (WGS 84).
const METRES: DVec2 = DVec2::new(111_229.03, 71_695.75);
/// Where the scene lies: its +Y points 30 degrees to the east of north.
const GEO: &str = "--geo 50,10,300,30";
/// Areas as they are.
const EXACT: &str = "--geo 50,10,300,30 --margin 0";
const SHELL: &str = "--shell 0,0,0,2,3 --up z";

const SMALL: &str = "--views 12 --held-out 60 --iterations 20 --checkpoint-every 10";

/// Longitude and latitude of a place of the scene.
fn on_earth([x, y]: [f64; 2]) -> [f64; 2] {
    let (sin, cos) = 30f64.to_radians().sin_cos();
    [10.0 + (x * cos + y * sin) / METRES.y, 50.0 + (y * cos - x * sin) / METRES.x]
}

/// The inverse of [`on_earth`].
fn in_scene(longitude: f64, latitude: f64) -> DVec2 {
    let (sin, cos) = 30f64.to_radians().sin_cos();
    let (east, north) = ((longitude - 10.0) * METRES.y, (latitude - 50.0) * METRES.x);
    DVec2::new(east * cos - north * sin, east * sin + north * cos)
}

/// The corners of an L: nobody is where x is above 0.5 or y above 0.5 with x above -1.
const ZONE: [[f64; 2]; 6] = [[0.5, -5.0], [5.0, -5.0], [5.0, 5.0], [-1.0, 5.0], [-1.0, 0.5], [0.5, 0.5]];

fn in_zone(p: DVec2) -> bool {
    p.x > 0.5 + 0.01 || p.y > 0.5 + 0.01 && p.x > -1.0 + 0.01
}

fn corners(separator: &str, form: impl Fn([f64; 2]) -> String) -> String {
    let around = ZONE.iter().chain(&ZONE[..1]).map(|corner| form(on_earth(*corner)));
    around.collect::<Vec<_>>().join(separator)
}

/// If this failed, a drone would be sent into a zone that it may not enter: to take a photo, or on its way from one to the next.
#[test]
fn plans_and_missions_keep_out_of_areas() {
    let place = Place::new();
    let ring = corners(", ", |[longitude, latitude]| format!("[{longitude:.10}, {latitude:.10}]"));
    place.write("zone.geojson", format!(r#"{{"type": "Polygon", "coordinates": [[{ring}]]}}"#));
    let tuples = corners(" ", |[longitude, latitude]| format!("{longitude:.10},{latitude:.10},0"));
    let polygon = format!(
        "<Polygon><outerBoundaryIs><LinearRing><coordinates>{tuples}</coordinates></LinearRing></outerBoundaryIs></Polygon>"
    );
    place.write(
        "zone.kml",
        format!("<kml xmlns=\"http://www.opengis.net/kml/2.2\"><Placemark>{polygon}</Placemark></kml>"),
    );
    let plan = |name: &str, limits: &str| {
        let ran = place.done(&format!("plan ball.ply --out {name} {SHELL} {SMALL} {limits}"));
        assert_eq!(ran.out.contains("outline is 0.5 m from the middle"), !limits.is_empty(), "{}", ran.out);
        place.plan(name).cameras.iter().map(|camera| camera.pose.position).collect::<Vec<DVec3>>()
    };
    let inside = |cameras: &[DVec3]| cameras.iter().filter(|p| in_zone(p.truncate())).count();
    assert!(inside(&plan("free", "")) > 3, "the zone is where no camera would stand anyhow");
    let cameras = plan("o", &format!("--keep-out zone.geojson {EXACT}"));
    assert_eq!(inside(&cameras), 0, "{cameras:?}");
    let same = plan("kml", &format!("--keep-out zone.kml {EXACT}"));
    assert!(cameras.iter().zip(&same).all(|(a, b)| a.distance(*b) < 1e-3), "{cameras:?} and {same:?}");
    let region: Region = place.plan("o").region;
    assert!(cameras.iter().all(|p| region.contains(*p)));

    place.done(&format!("export o --out e {GEO} --takeoff 290 --to geojson"));
    let mission: Value = serde_json::from_str(&place.read("e/mission.geojson")).unwrap();
    let way =
        mission["features"].as_array().unwrap().iter().find(|feature| feature["geometry"]["type"] == "LineString");
    let way: Vec<DVec2> = way.unwrap()["geometry"]["coordinates"]
        .as_array()
        .unwrap()
        .iter()
        .map(|at| in_scene(at[0].as_f64().unwrap(), at[1].as_f64().unwrap()))
        .collect();
    assert!(way.len() >= 12, "{way:?}");
    for leg in way.windows(2) {
        let through = (0..=50).map(|i| leg[0].lerp(leg[1], f64::from(i) / 50.0)).find(|p| in_zone(*p));
        assert_eq!(through, None, "the leg {leg:?} leads through the zone");
    }
    // From another place the same plan would lead through it.
    let refused = place.run("export o --geo 50,10,300,210 --out e2");
    assert!(refused.err.contains("keeps out of zone.geojson by --geo 50,10,300,30"), "{}", refused.err);
    place.write("e/mission-2.plan", "of a longer flight");
    let refused = place.run(&format!("export o --out e {GEO} --takeoff 290 --force"));
    assert!(refused.err.contains("mission-2.plan: it is of an earlier export"), "{}", refused.err);
    // A plan holds its areas itself.
    std::fs::remove_file(place.path("zone.geojson")).unwrap();
    assert!(place.done("score ball.ply o").out.contains("no camera in zone.geojson"));
}

/// A border along a parallel, 20 km long: straight in degrees, it is 8 m off the straight line between its ends. If this failed, cameras
/// would stand within large areas.
#[test]
fn long_borders_are_where_they_are_on_earth() {
    let place = Place::new();
    let south = 50.0 + 0.5 / METRES.x;
    place.write(
        "wide.geojson",
        format!(r#"{{"type": "Polygon", "coordinates": [[[9.86, {south:.10}], [10.14, {south:.10}], [10.14, 50.05], [9.86, 50.05]]]}}"#),
    );
    let ran = place.done(&format!("plan ball.ply --out o {SHELL} {SMALL} --keep-out wide.geojson {EXACT}"));
    assert!(ran.out.contains("outline is 0.5 m from the middle"), "{}", ran.out);
    let (sin, cos) = 30f64.to_radians().sin_cos();
    for camera in place.plan("o").cameras {
        let north = camera.pose.position.y * cos - camera.pose.position.x * sin;
        assert!(north < 0.51, "{north} m to the north of the middle");
    }
    place.write(
        "swapped.geojson",
        r#"{"type": "Polygon", "coordinates": [[[50, 10], [50.001, 10], [50.001, 10.001]]]}"#,
    );
    assert_refused(
        &place,
        &[(
            &format!("plan ball.ply --out s {SHELL} {SHORT} --keep-out swapped.geojson {GEO}"),
            &["km from the scene", "check --geo"],
        )],
    );
}

/// If this failed, an area would be left out in silence: for want of a place on Earth, or because it is no area.
#[test]
fn areas_that_are_not_understood_are_refused() {
    let place = Place::new();
    let polygon = |rings: &str| format!(r#"{{"type": "Polygon", "coordinates": {rings}}}"#);
    let square = "[[10, 50], [10.001, 50], [10.001, 50.001], [10, 50.001]]";
    place.write("zone.geojson", polygon(&format!("[{square}]")));
    place.write("hole.json", polygon(&format!("[{square}, {square}]")));
    place.write("bow.geojson", polygon("[[[10, 50], [10.001, 50.001], [10.001, 50], [10, 50.001]]]"));
    place.write("boxes.json", r#"{"boxes": [[2, 2, 2, 3, 3, 3]]}"#);
    let base = format!("plan ball.ply --out o {SHELL} {SHORT}");
    for (arguments, fragment) in [
        ("--keep-out zone.geojson", "--geo LAT,LON,ALT"),
        ("--keep-out zone.geojson --geo here", "--geo here"),
        (&format!("--keep-out hole.json {GEO}")[..], "hole"),
        (&format!("--keep-out bow.geojson {GEO}")[..], "polygon 1 crosses itself"),
        (&format!("--keep-out boxes.json {GEO}")[..], "polygons"),
        (&format!("--keep-out ball.kml {GEO}")[..], "ball.kml"),
    ] {
        assert_refused(&place, &[(&format!("{base} {arguments}"), &[fragment])]);
        assert!(!place.path("o").exists(), "{arguments} wrote");
    }
}

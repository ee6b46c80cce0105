//! `camsplat next`: which photos a capture needs, for programs that fly or drive there.

use std::process::Output;

use super::shots::{capture_wall, row};
use crate::support::command::{Place, assert_refused};
use camsplat::scene::camera::{Camera, Pose};
use glam::DVec3;
use serde_json::Value;

/// The first photos of the row before the wall.
fn captured(count: usize) -> (Place, Vec<Camera>) {
    let place = Place::new();
    let cameras = row("png")[..count].to_vec();
    capture_wall(&place.path("wall"), &cameras, true);
    (place, cameras)
}

/// What is printed with `--json`, which is nothing else.
fn answered(place: &Place, arguments: &str) -> Value {
    let Output { status, stdout, stderr } = place.command(&format!("next {arguments} --json")).output().unwrap();
    assert!(status.success(), "{}", String::from_utf8_lossy(&stderr));
    serde_json::from_slice(&stdout).unwrap()
}

fn poses(answer: &Value) -> Vec<Pose> {
    let next = answer["next"].as_array().unwrap();
    next.iter().map(|photo| serde_json::from_value(photo["pose"].clone()).unwrap()).collect()
}

/// If this failed, a robot would be sent to the farthest place first, or to other places than a person reads of, or the answer would be
/// another each time that it is asked.
#[test]
fn the_next_photos_are_said_nearest_first() {
    let (place, cameras) = captured(6);
    let before = place.files("wall");
    let answer = answered(&place, "wall --views 4");
    let places = poses(&answer);
    assert_eq!((places.len(), answer["more"].as_u64(), answer["photos"].as_u64()), (4, Some(4), Some(6)));
    let last = cameras[5].pose.position;
    let away: Vec<f64> = places.iter().map(|pose| pose.position.distance(last)).collect();
    assert!(away.is_sorted(), "{away:?}");
    let said = place.done("next wall --views 4 --json a.json").out;
    for (photo, pose) in answer["next"].as_array().unwrap().iter().zip(&places) {
        assert!(said.contains(&format!(
            "from {}: {}",
            photo["from"].as_str().unwrap(),
            photo["words"].as_str().unwrap()
        )));
        let from = cameras.iter().find(|camera| photo["from"] == camera.name).unwrap();
        let others = cameras.iter().map(|camera| camera.pose.position.distance(pose.position));
        let near = from.pose.position.distance(pose.position);
        assert!(others.fold(f64::INFINITY, f64::min) > 0.3 * near, "{photo} starts from a photo far away");
    }
    assert_eq!(serde_json::from_str::<Value>(&place.read("a.json")).unwrap(), answer);
    assert_eq!(answered(&place, "wall --views 4"), answer);
    // From the other end of the row, the same places in another order.
    let other = poses(&answered(&place, "wall --views 4 --from 000.png"));
    let first = cameras[0].pose.position;
    assert!(other.is_sorted_by_key(|pose| pose.position.distance(first)));
    let listed = |poses: &[Pose]| {
        let mut sorted: Vec<DVec3> = poses.iter().map(|pose| pose.position).collect();
        sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.z.total_cmp(&b.z)));
        sorted
    };
    assert_eq!(listed(&places), listed(&other));
    assert_eq!(place.files("wall"), before, "something was written into the capture");
}

/// If this failed, a room of which the first photos show one wall would have no free space, as these stand beside all that they show.
#[test]
fn a_room_holds_the_places_where_photos_were_taken() {
    let (place, cameras) = captured(6);
    let answer = answered(&place, "wall --views 4 --preset room");
    let places = poses(&answer);
    let off =
        |pose: &Pose| cameras.iter().map(|c| c.pose.position.distance(pose.position)).fold(f64::INFINITY, f64::min);
    assert!(places.len() == 4 && places.iter().all(|pose| pose.position.y < 0.0 && off(pose) < 5.0), "{places:?}");
}

/// If this failed, COLMAP could not place the photos that it is asked for, since they show too little of what others show.
#[test]
fn photos_that_are_to_connect_stay_near_others() {
    let (place, cameras) = captured(6);
    let points: Vec<DVec3> =
        (0..600).map(|i| DVec3::new(f64::from(i % 30) * 0.48 - 7.0, 0.0, f64::from(i / 30) * 0.5 - 3.5)).collect();
    // The least angle between two cameras at sixteen points that both see, the mean.
    let apart = |a: &Camera, b: &Camera| {
        let both = points.iter().filter(|p| a.sees(**p) && b.sees(**p));
        let mut angles: Vec<f64> =
            both.map(|p| (a.pose.position - p).angle_between(b.pose.position - p).to_degrees()).collect();
        angles.sort_by(f64::total_cmp);
        if angles.len() < 16 { f64::INFINITY } else { angles[..16].iter().sum::<f64>() / 16.0 }
    };
    // Of each place to the photo that is nearest in this sense, the widest: another place may be left out.
    let widest = |options: &str| {
        let places = poses(&answered(&place, &format!("wall --views 5 {options}")));
        let all: Vec<Camera> = places.iter().map(|pose| Camera { pose: *pose, ..cameras[0].clone() }).collect();
        let nearest = |place: &Camera| cameras.iter().map(|photo| apart(place, photo)).fold(f64::INFINITY, f64::min);
        all.iter().map(nearest).fold(0.0, f64::max)
    };
    let (free, connected) = (widest(""), widest("--connect 12"));
    assert!(connected < 12.5 && free > 15.0, "{connected} and {free} degrees");
}

/// If this failed, a program that follows the advice would take photo after photo without the capture getting better.
#[test]
fn advice_that_is_followed_gains_less_and_less() {
    let (place, mut cameras) = captured(6);
    let mut gains = Vec::new();
    for round in 0..3 {
        let name = format!("round{round}");
        capture_wall(&place.path(&name), &cameras, true);
        let answer = answered(&place, &format!("{name} --views 5 --viewers wall"));
        gains.push(answer["gain_db"].as_f64().unwrap());
        for (i, pose) in poses(&answer).into_iter().enumerate() {
            let name = format!("1{round}{i}.png");
            cameras.push(Camera { name, pose, intrinsics: cameras[0].intrinsics });
        }
    }
    assert!(gains[0] > 0.3 && gains[1] < gains[0] && gains[2] < gains[0], "{gains:?}");
}

/// A camera as a frame of transforms.json, with a lens of so many times its focal length.
fn frame(camera: &Camera, longer: f64) -> Value {
    let m = camera.pose.rotation;
    let (right, up, back) = (m * DVec3::X, m * DVec3::NEG_Y, m * DVec3::NEG_Z);
    let position = camera.pose.position;
    let rows: Vec<[f64; 4]> =
        (0..3).map(|k| [right[k], up[k], back[k], position[k]]).chain([[0.0, 0.0, 0.0, 1.0]]).collect();
    let lens = &camera.intrinsics;
    serde_json::json!({
        "file_path": format!("{}.png", camera.name), "transform_matrix": rows, "fl_x": longer * lens.focal[0], "fl_y": longer * lens.focal[1],
        "cx": lens.principal[0], "cy": lens.principal[1], "w": lens.width, "h": lens.height
    })
}

/// If this failed, someone who changed the lens would be sent to places that are for the one before.
#[test]
fn the_next_photos_have_the_lens_of_the_last() {
    let place = Place::new();
    place.done("plan ball.ply --views 6 --iterations 5 --held-out 60 --out all");
    let record = place.plan("all");
    let longer = |i: usize| if i == 5 { 2.0 } else { 1.0 };
    let frames: Vec<Value> = record.cameras.iter().enumerate().map(|(i, camera)| frame(camera, longer(i))).collect();
    place.write("two.json", serde_json::json!({ "frames": frames }).to_string());
    let wide = record.cameras[0].intrinsics.focal[0];
    let found = |arguments: &str| {
        let answer = answered(&place, &format!("ball.ply two.json --views 3 {arguments}"));
        let away = poses(&answer).iter().map(|pose| pose.position.length()).sum::<f64>() / 3.0;
        (answer["intrinsics"]["focal"][0].as_f64().unwrap() / wide, away)
    };
    let (last, first) = (found(""), found(&format!("--from {}.png", record.cameras[0].name)));
    assert!((last.0 - 2.0).abs() < 1e-9 && (first.0 - 1.0).abs() < 1e-9, "{last:?} {first:?}");
    // A lens that shows half as much stands farther off.
    assert!(last.1 > 1.4 * first.1, "{last:?} {first:?}");
}

/// If this failed, a robot with a mesh and poses but no photos could not ask, or would be sent where it has been.
#[test]
fn cameras_beside_a_surface_do_as_well_as_a_capture() {
    let place = Place::new();
    place.done("plan ball.ply --views 12 --iterations 5 --held-out 60 --out all");
    let record = place.plan("all");
    // Those on one side of the ball.
    let front: Vec<&Camera> = record.cameras.iter().filter(|camera| camera.pose.position.y < 0.0).collect();
    assert!((3..10).contains(&front.len()), "{}", front.len());
    let frames: Vec<Value> = front.iter().map(|camera| frame(camera, 1.0)).collect();
    let file = serde_json::json!({ "frames": frames });
    place.write("front.json", file.to_string());
    let answer = answered(&place, "ball.ply front.json --views 4");
    let behind = poses(&answer).iter().filter(|pose| pose.position.y > 0.0).count();
    assert!(behind >= 3 && answer["gain_db"].as_f64().unwrap() > 0.5, "{behind} of 4 are behind: {answer}");
    let uncovered = answer["uncovered"].as_array().unwrap();
    let of = uncovered.iter().filter(|point| point[1].as_f64().unwrap() > 0.0).count();
    assert!(uncovered.len() > 100 && of as f64 > 0.9 * uncovered.len() as f64, "{of} of {}", uncovered.len());
}

/// If this failed, a program would be answered about something else than it asked.
#[test]
fn what_has_no_next_photos_is_refused() {
    let (place, _) = captured(6);
    assert_refused(
        &place,
        &[
            ("next ball.ply", &["ball.ply: ", "name their cameras", "camsplat plan"]),
            ("next ball.ply nowhere", &["nowhere: ", "o such file"]),
            ("next wall wall --surface ball.ply", &["--surface", "cannot be used with"]),
            ("next nowhere", &["nowhere: ", "no such file or folder", "check the path"]),
            ("next wall --from nobody.png", &["wall: ", "no photo \"nobody.png\"", "--from"]),
            ("next wall --views 0", &["views", "0"]),
            ("next wall --views 100000000", &["--views is 100000000", "give at most"]),
            ("next wall --json wall/points.ply", &["points.ply: ", "would be replaced"]),
        ],
    );
}

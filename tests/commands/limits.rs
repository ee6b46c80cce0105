//! Where cameras may not be: how plans, other methods and scores treat walls, volumes to keep out of, heights and ground.

use crate::support::command::{Place, SHORT, assert_refused};
use camsplat::files::io;
use glam::DVec3;

const SHELL: &str = "--shell 0,0,0,2,3 --up z";
const BOXES: &str = r#"{"boxes": [[-4, -4, 1, 4, -0.5, 4], [3.5, 3.5, 3.5, 0.5, 0.5, -4]]}"#;

fn in_boxes(p: DVec3) -> bool {
    p.z > 1.0 && p.y < -0.5 || p.x > 0.5 && p.y > 0.5
}

/// If this failed, a photographer would be sent behind a wall, into a cabinet, or up a ladder: by our plan or by a method that it is
/// compared with, which would flatter one of them.
#[test]
fn whoever_places_cameras_keeps_the_limits() {
    let place = Place::new();
    place.write("boxes.json", BOXES);
    let limits =
        format!("{SHELL} --keep-out boxes.json --wall 0,0,-1.5,0,0,2 --wall -1,0,0,1,0,0.5 --heights -1.2,2.4");
    for method in ["ours", "random", "fibonacci", "fvs", "coverage"] {
        let ran = place.done(&format!("plan ball.ply --out {method} --method {method} {limits} {}", short(method)));
        assert!(
            ran.out.contains("no camera in boxes.json") && ran.out.contains("heights -1.200 to 2.400"),
            "{}",
            ran.out
        );
        let plan = place.plan(method);
        assert_eq!((plan.cameras.len(), plan.limits.walls.len(), plan.limits.heights), (5, 2, Some([-1.2, 2.4])));
        for camera in &plan.cameras {
            let p = camera.pose.position;
            assert!(!in_boxes(p), "{method}: {p} is in a box");
            assert!((-1.2 - 1e-9..=2.4 + 1e-9).contains(&p.z), "{method}: {p} is too high or too low");
            assert!((p + DVec3::X).dot(DVec3::new(1.0, 0.0, 0.5)) >= -1e-9, "{method}: {p} is behind a wall");
        }
    }
    // Layouts that a plan is measured against keep them too, so that the plan's own limits are those of its score.
    let scored = place.done("score ball.ply ours");
    assert!(scored.out.contains("no camera in boxes.json") && scored.out.contains("wall at"), "{}", scored.out);
    std::fs::remove_file(place.path("boxes.json")).unwrap();
    // A plan holds its limits itself.
    let again = place.done("score ball.ply ours").out;
    assert_eq!(again, scored.out);
}

/// If this failed, a user would not learn that a wall of boxes had cut off half of the feasible positions.
#[test]
fn space_that_is_cut_off_is_reported() {
    let place = Place::new();
    place.write("slab.json", r#"{"boxes": [[-9, -9, -0.5, 9, 9, 0.5]]}"#);
    let cut = place.done(&format!("plan ball.ply --out cut {SHELL} --keep-out slab.json {SHORT}")).out;
    assert!(cut.contains("% of the free space is not connected with the rest"), "{cut}");
    let sides: Vec<bool> = place.plan("cut").cameras.iter().map(|camera| camera.pose.position.z > 0.0).collect();
    assert!(sides.iter().all(|side| *side == sides[0]), "cameras on both sides of the slab");
    let whole = place.done(&format!("plan ball.ply --out whole {SHELL} {SHORT}")).out;
    assert!(!whole.contains("not connected"), "{whole}");
}

/// A room as wide as an L: walls of sheets a metre wide with a door in each of the two that the corner cut out of its box lies behind.
fn l_shaped_room() -> String {
    let corners: [[i32; 2]; 6] = [[0, 0], [6, 0], [6, 3], [3, 3], [3, 6], [0, 6]];
    let (mut vertices, mut faces) = (String::new(), String::new());
    let mut sheet = |corners: [[f64; 3]; 4]| {
        let first = 4 * faces.lines().count() + 1;
        corners.iter().for_each(|[x, y, z]| vertices += &format!("v {x} {y} {z}\n"));
        faces += &format!("f {first} {} {} {}\n", first + 1, first + 2, first + 3);
    };
    for height in [0.0, 2.5] {
        for [low, high] in [[[0.0, 0.0], [6.0, 3.0]], [[0.0, 3.0], [3.0, 6.0]]] {
            let [[x0, y0], [x1, y1]] = [low, high];
            sheet([[x0, y0, height], [x1, y0, height], [x1, y1, height], [x0, y1, height]]);
        }
    }
    for (i, from) in corners.iter().enumerate() {
        let to = corners[(i + 1) % corners.len()];
        let [dx, dy] = [0, 1].map(|axis| (to[axis] - from[axis]).signum());
        for step in 0..(to[0] - from[0] + to[1] - from[1]).abs() {
            let ([ax, ay], is_door) =
                ([from[0] + step * dx, from[1] + step * dy].map(f64::from), [2, 3].contains(&i) && step == 1);
            let [bx, by] = [ax + f64::from(dx), ay + f64::from(dy)];
            if !is_door {
                sheet([[ax, ay, 0.0], [bx, by, 0.0], [bx, by, 2.5], [ax, ay, 2.5]]);
            }
        }
    }
    vertices + &faces
}

/// Points on the quads of an OBJ file, as PLY.
fn cloud_of(obj: &str) -> Vec<u8> {
    let numbers = |line: &str| line.split(' ').skip(1).map(|word| word.parse().unwrap()).collect::<Vec<f64>>();
    let lines = |kind: char| obj.lines().filter(move |line| line.starts_with(kind)).map(numbers);
    let vertices: Vec<DVec3> = lines('v').map(|v| DVec3::from_slice(&v)).collect();
    let mut positions = Vec::new();
    for face in lines('f') {
        let [a, b, _, d] = [0, 1, 2, 3].map(|i| vertices[face[i] as usize - 1]);
        let [u, v] = [b - a, d - a];
        let [nu, nv] = [u, v].map(|side| (side.length() / 0.1) as u32);
        let place = |i: u32| a + f64::from(i % nu) / f64::from(nu) * u + f64::from(i / nu) / f64::from(nv) * v;
        positions.extend((0..nu * nv).map(place));
    }
    io::ply::write::points(&positions, &[], None)
}

/// If this failed, a plan for a scanned room would stand outside of its walls, in the void of the box around it.
#[test]
fn nobody_stands_beyond_the_walls_of_a_room() {
    let place = Place::new();
    place.write("room.obj", l_shaped_room());
    for method in ["ours", "random"] {
        let options =
            format!("{} --preset room --up z --clearance 0.2", short(method).replace("--views 5", "--views 40"));
        let ran = place.done(&format!("plan room.obj --out {method} --method {method} {options}"));
        assert!(ran.out.contains("of the free space lies beyond the walls of the room"), "{}", ran.out);
        for camera in &place.plan(method).cameras {
            let p = camera.pose.position;
            // In a door is not outside.
            assert!(p.x < 3.15 || p.y < 3.15, "{method}: {p} is outside");
        }
    }
    // Of points of its sheets alone, where walls that nobody saw are assumed on the bounds of the box.
    place.write("cloud.ply", cloud_of(&l_shaped_room()));
    let options = "--method random --views 40 --held-out 60 --preset room --up z --clearance 0.2";
    place.done(&format!("plan cloud.ply --out cloud {options}"));
    for camera in &place.plan("cloud").cameras {
        let p = camera.pose.position;
        assert!(p.x < 3.3 || p.y < 3.3, "{p} is outside");
    }
    // Who says where one can be has said it.
    place.write("all.json", r#"{"boxes": [[0, 0, 0, 6, 6, 2.5]]}"#);
    let options = "--method random --views 40 --held-out 60 --preset room --up z --clearance 0.2 --space all.json";
    place.done(&format!("plan room.obj --out all {options}"));
    let outside =
        place.plan("all").cameras.iter().filter(|c| c.pose.position.cmpgt(DVec3::new(3.2, 3.2, 0.0)).all()).count();
    assert!(outside > 0, "nobody is where the file allows it");
    // In a box that is mostly outside nobody knows which part is meant.
    let ran = place.done(&format!("plan room.obj --out wide --box=-12,-12,0.2,12,12,2.3 --up z {SHORT}"));
    let doubt = "these cameras stand outside of what walls enclose, from";
    assert!(ran.out.contains(doubt) && place.read("wide/report.html").contains(doubt), "{}", ran.out);
    let ran = place.done(&format!("plan room.obj --out near --box 0.2,0.2,0.2,2.8,5.8,2.3 --up z {SHORT}"));
    assert!(!ran.out.contains("enclose") && !ran.out.contains("beyond"), "{}", ran.out);
}

/// If this failed, a plan whose limits leave half of the thing unseen would look as good as any other.
#[test]
fn what_no_camera_can_see_is_reported() {
    let place = Place::new();
    let plan = |out: &str, limits: &str| {
        place.done(&format!("plan ball.ply --out {out} {SHELL} --views 16 --held-out 60 --iterations 20 {limits}")).out
    };
    let warning = "warning  much of what viewers look at is seen by no camera";
    assert!(!plan("free", "").contains(warning));
    assert!(plan("above", "--heights 2.2,2.6").contains(warning));
}

/// If this failed, cameras of a room that are scored as if around an object would get a bad score without explanation, and cameras in another
/// frame be planned around.
#[test]
fn cameras_outside_of_the_region_are_reported() {
    let place = Place::new();
    place.done(&format!("plan ball.ply --out o {SHELL} {SHORT}"));
    let score = |shell: &str| place.done(&format!("score ball.ply o/transforms.json --up z --shell {shell}")).out;
    assert!(score("0,0,0,8,9").contains("warning  5 of 5 cameras are outside of the region"));
    assert!(!score("0,0,0,2,3").contains("outside of the region"));
    let keep =
        |shell: &str| place.done(&format!("plan ball.ply --keep o --up z --shell {shell} {SHORT} --out p --force")).out;
    assert!(keep("0,0,0,8,9").contains("warning  5 of 5 kept cameras are outside of the region"));
    assert!(!keep("0,0,0,2,3").contains("outside of the region"));
}

/// If this failed, the simple layouts of a room would be below its floor or outside of its limits, where a plan may not.
#[test]
fn layouts_of_a_room_keep_the_limits() {
    let place = Place::new();
    place.write("boxes.json", r#"{"boxes": [[1.5, -3, -3, 3, 0, 3]]}"#);
    let limits = "--preset room --box=-3,-3,-1.5,3,3,3 --up z --floor 1.2 --keep-out boxes.json --heights 1.1,1.6";
    for method in ["grid", "rings", "random", "acp"] {
        place.done(&format!("plan ball.ply --out {method} --method {method} {limits} --views 20 --held-out 60"));
        for camera in &place.plan(method).cameras {
            let p = camera.pose.position;
            assert!((1.2 - 1e-9..=1.6 + 1e-9).contains(&p.z), "{method}: {p} is below the floor or too high");
            assert!(p.x < 1.5 || p.y > 0.0, "{method}: {p} is in a box");
        }
    }
}

/// If this failed, a robot would be sent where it cannot get to.
#[test]
fn cameras_stand_where_somebody_can_walk() {
    let place = Place::new();
    // A fence across x = 0, from the ground to above the head.
    place.write("fence.json", r#"{"boxes": [[-0.1, -9, -3, 0.1, 9, 3]]}"#);
    let walk = format!("{SHELL} --keep-out fence.json --walk 2.4,0.5,-1,0.2,1.6 --heights -1,1.5");
    for method in ["ours", "random"] {
        place.done(&format!("plan ball.ply --out {method} --method {method} {walk} {}", short(method)));
        let plan = place.plan(method);
        assert!(plan.cameras.iter().all(|camera| camera.pose.position.x > 0.2), "{method}: somebody climbed the fence");
        assert_eq!(plan.limits.walk.map(|walk| walk.height), Some(1.6));
    }
}

/// If this failed, a barrier around an exhibit would leave no viewers, since some of the usual ones are within.
#[test]
fn a_barrier_within_the_region_is_planned_with() {
    let place = Place::new();
    place.write("rope.json", r#"{"boxes": [[-1.6, -1.6, -1.6, 1.6, 1.6, 1.6]]}"#);
    place.done(&format!("plan ball.ply --out o {SHELL} --keep-out rope.json {SHORT}"));
    // What such a plan was made for is in its file, and cameras that do not keep it are counted.
    let scored = place.done("score ball.ply o --heights=-2.9,-2.6").out;
    assert!(scored.contains(" of 5 cameras are outside of the limits"), "{scored}");
    assert_eq!(place.done("score ball.ply o").warnings(), [""; 0]);
    let kept = place.run("score ball.ply o --json rope.json");
    assert!(kept.code == Some(2) && place.read("rope.json").contains("boxes"), "{}", kept.err);
}

fn short(method: &str) -> &'static str {
    if method == "ours" { SHORT } else { "--views 5 --held-out 60" }
}

/// If this failed, a mistake in a limit would be planned with, or leave a folder.
#[test]
fn limits_that_make_no_sense_are_refused() {
    let place = Place::new();
    place.write("flat.json", r#"{"boxes": [[0, 0, 0, 1, 0, 1]]}"#);
    place.write("none.json", r#"{"boxes": []}"#);
    place.write("seven.json", r#"{"boxes": [[1, 2, 3, 4, 5, 6, 7]]}"#);
    place.write("huge.json", r#"{"boxes": [[-1e300, 0, 0, 1e300, 1, 1]]}"#);
    place.write("open.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
    let points = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 1 1";
    let properties = "property float x\nproperty float y\nproperty float z";
    place.write("cloud.ply", format!("ply\nformat ascii 1.0\nelement vertex 5\n{properties}\nend_header\n{points}\n"));
    let cases = [
        ("--keep-out nowhere.obj", "nowhere.obj"),
        ("--keep-out flat.json", "box 0"),
        ("--keep-out none.json", "list of boxes is empty"),
        ("--keep-out cloud.ply", "closed mesh"),
        ("--heights 2,1", "the lower one"),
        ("--heights 40,50", "--heights"),
        ("--wall 0,0,0,0,0,0", "not zero"),
        ("--walk 2,0,0,-1,1", "above zero"),
        ("--walk 0.95,0,0,0.2,0.5", "--walk"),
        ("--walk 90,0,0,0.2,0.5", "--walk"),
        ("--walk 0.3,0,2.4,0.1,0.5", "no ground under its start"),
        ("--walk 2.4,0,90,0.2,0.5", "no ground under its start"),
        ("--wall 0,0,0,1e200,0,0", "below 1e18"),
        ("--keep-out open.obj", "not closed"),
        ("--keep-out seven.json", "six numbers"),
        ("--keep-out huge.json", "1e18"),
        ("--walk 2.4,0,-1,0.2,1e9", "too high"),
        ("--walk 2.4,0,-1,0.01,0.01", "too low"),
    ];
    for (given, says) in cases {
        assert_refused(&place, &[(&format!("plan ball.ply --out o {SHELL} {given} {SHORT}"), &[says])]);
    }
    for (given, says) in [
        ("--wall 0,0,0,1,0", "X,Y,Z,NX,NY,NZ"),
        ("--heights 1", "LOW,HIGH"),
        ("--walk 2,0,0,0.2", "X,Y,Z,RADIUS,HEIGHT"),
    ] {
        let ran = place.run(&format!("plan ball.ply --out o {SHELL} {given} {SHORT}"));
        assert!(ran.code == Some(2) && ran.err.contains(says) && !place.path("o").exists(), "{}", ran.err);
    }
}

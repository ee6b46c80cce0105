//! `camsplat evaluate` in situations of practice and in two passes: what is photographed there, and what does not fit.

use crate::support::command::gltf::lit_cube;
use crate::support::command::{Place, assert_refused};
use camsplat::planner::plan::record::PlanRecord;
use glam::DVec3;

/// An evaluation of seconds.
const TINY: &str =
    "--env sky.hdr --quick --seeds 1 --size 32 --spp 2 --inputs 8 --tests 2 --iterations 10 --max-splats 200";

/// The choices of an evaluation, by method.
fn choices(place: &Place, folder: &str) -> Vec<PlanRecord> {
    let files = place.files(folder).into_iter().filter(|file| file.contains("choice-") && file.ends_with("plan.json"));
    files.map(|file| serde_json::from_str(&place.read(&format!("{folder}/{file}"))).unwrap()).collect()
}

/// How many photographs of each kind there are.
fn photographs(place: &Place, folder: &str, name: &str) -> usize {
    place.files(folder).iter().filter(|file| file.contains("/images/") && file.contains(name)).count()
}

/// If this failed, methods would be compared on other scenes than the command names: cameras behind the walls of a corner, or tests all
/// around an object that is seen from the front.
#[test]
fn a_corner_has_walls_for_everybody() {
    let place = lit_cube();
    let methods = "ours,fibonacci,fvs";
    place.done(&format!("evaluate cube.gltf --situation corner --methods {methods} --budgets 4 {TINY} --out o"));
    let plans = choices(&place, "o/cube");
    assert_eq!(plans.len(), 3);
    for plan in &plans {
        assert_eq!((plan.limits.walls.len(), plan.cameras.len()), (2, 4));
        let low = plan.region.floor.unwrap();
        for camera in &plan.cameras {
            let p = camera.pose.position;
            assert!(!plan.limits.behind_a_wall(p) && p.y >= low - 1e-9, "{}: {p}", plan.method);
        }
    }
    assert_eq!(photographs(&place, "o", "viewers_"), 2);
    let table = place.read("o/table.md");
    assert!(table.contains("in a corner") && table.contains("| viewers |") && !table.contains("| half |"), "{table}");
}

/// If this failed, photos that exist would not be trained on, would be counted as planned, or be others for each method.
#[test]
fn photos_from_one_side_are_kept_by_all() {
    let place = lit_cube();
    place.done(&format!("evaluate cube.gltf --situation one-side --methods ours,random --budgets 4 {TINY} --out o"));
    let plans = choices(&place, "o/cube");
    let kept = |plan: &PlanRecord| -> Vec<DVec3> {
        plan.cameras[plan.cameras.len() - plan.kept..].iter().map(|camera| camera.pose.position).collect()
    };
    assert!(plans.iter().all(|plan| (plan.cameras.len(), plan.kept) == (8, 4)));
    assert_eq!(kept(&plans[0]), kept(&plans[1]));
    assert_eq!(photographs(&place, "o", "kept_"), 8);
    // Tests are the protocol's, all around.
    assert!(place.read("o/table.md").contains("| half | full | random |"), "{}", place.read("o/table.md"));
}

/// If this failed, two rooms would be one, or need a file.
#[test]
fn two_rooms_are_a_scene_by_themselves() {
    let place = lit_cube();
    let tiny = TINY.replace("--env sky.hdr ", "");
    place.done(&format!(
        "evaluate --situation two-rooms --methods ours,grid,rings --budgets 8 --light traced {tiny} --out o"
    ));
    let plans = choices(&place, "o/two-rooms");
    assert_eq!(plans.len(), 3);
    let ours = plans.iter().find(|plan| plan.method == "ours").unwrap();
    let beyond = ours.cameras.iter().filter(|camera| camera.pose.position.x > 6.0).count();
    assert!((1..8).contains(&beyond), "{beyond} of 8 cameras are in the smaller room");
    assert!(place.read("o/table.md").contains("two rooms with a door"));
}

/// If this failed, the benchmark would compare methods by other scenes than it names, or a method would have to be put on the board by hand.
#[test]
fn the_benchmark_writes_a_board() {
    let place = lit_cube();
    let done = place.done("benchmark --scenes bare-room --quick --methods random --budgets 4 --out o").out;
    assert!(done.contains("bare-room (validation): camsplat evaluate --situation=bare-room"), "{done}");
    assert!(done.contains("| random | 1 |  |"), "{done}");
    let csv = place.read("o/board.csv");
    let line = csv.lines().nth(1).unwrap_or_default();
    assert!(line.starts_with("validation,room,bare-room,4,random,1,") && csv.lines().count() == 2, "{csv}");
    let page = place.read("o/board.html");
    assert!(page.contains("Rooms of the validation split, 4 views") && page.contains("say nothing of methods"));
    let mut results: serde_json::Value = serde_json::from_str(&place.read("o/bare-room/results.json")).unwrap();
    let before = place.files("o");
    assert_refused(
        &place,
        &[
            ("benchmark --scenes nowhere --out o", &["--scenes", "\"nowhere\"", "crowded-room"]),
            ("benchmark --scenes ToyCar --out o", &["ToyCar", "folder of data"]),
            ("benchmark nodata --scenes ToyCar --out o", &["ToyCar.glb", "there is no such file"]),
            ("benchmark --scenes bare-room --methods nonsense --out o", &["nonsense", "--methods"]),
            ("benchmark --scenes bare-room --devices 0 --prepare --out o", &["--devices", "--prepare"]),
            ("benchmark --scenes bare-room --devices 0,nowhere --out o", &["nowhere"]),
            ("benchmark --scenes bare-room --quick --full --out o", &["--quick", "--full"]),
            ("benchmark --scenes bare-room --methods fibonacci --out o", &["fibonacci", "a room has none"]),
            ("benchmark --scenes bare-room,two-rooms --methods a=cameras:a.json --out o", &["one scene", "{scene}"]),
            ("benchmark --scenes bare-room,two-rooms --methods a=lenses:a.json --out o", &["one scene", "{scene}"]),
        ],
    );
    assert_eq!(place.files("o"), before, "a request that was refused left something");
    // Results of other settings are no neighbours on the board, nor are cameras of one scene those of another.
    results["request"]["settings"]["iterations"] = 7.into();
    std::fs::create_dir(place.path("o/crowded-room")).unwrap();
    place.write("o/crowded-room/results.json", results.to_string());
    let again = place.done("benchmark --scenes bare-room --quick --methods random --budgets 4 --out o").out;
    assert!(again.contains("crowded-room is left off the board: its settings are not those of bare-room"), "{again}");
    assert_eq!(place.read("o/board.csv"), csv);
}

/// If this failed, the second pass would not go by the photographs of the first, or not have as many views as requested.
#[test]
fn the_second_pass_stands_beside_the_first() {
    let place = lit_cube();
    let run = format!("evaluate cube.gltf --methods ours-two-passes --budgets 7 {TINY} --out o");
    place.done(&run);
    let plans = choices(&place, "o/cube");
    assert_eq!((plans.len(), plans[0].cameras.len(), plans[0].kept), (1, 7, 3));
    // The first pass, what is trained on, and nothing twice.
    let sets = place.folders("o/cube").into_iter().filter(|name| name.starts_with("photos-")).count();
    assert_eq!(sets, 4, "inputs, tests, the first pass, all seven");
    let again = place.done(&run);
    assert!(!again.out.contains("making"), "{}", again.out);
}

/// If this failed, `--space known` would hold only one method, or none, or results of one space be taken for those of the other.
#[test]
fn input_photos_prove_where_all_methods_may_stand() {
    let place = lit_cube();
    let run = format!("evaluate cube.gltf --inputs-from biased --methods ours,random --budgets 6 {TINY} --out o");
    place.done(&run);
    place.done(&format!("{run} --space known"));
    let plans = choices(&place, "o/cube");
    let (known, open): (Vec<_>, Vec<_>) = plans.iter().partition(|plan| plan.limits.space.is_some());
    assert_eq!((known.len(), open.len()), (2, 2));
    for plan in &known {
        let space = plan.limits.space.as_ref().unwrap();
        assert!(plan.cameras.iter().all(|camera| space.holds(camera.pose.position)), "{}", plan.method);
        // Photos are from one side, and so is what they prove.
        let others = open.iter().flat_map(|plan| &plan.cameras);
        assert!(others.filter(|camera| !space.holds(camera.pose.position)).count() > 2);
    }
    assert!(place.read("o/table.md").contains("`--space known`"));
}

/// If this failed, an invalid request would be detected after hours.
#[test]
fn what_does_not_fit_is_refused() {
    let place = lit_cube();
    let cases: [(&str, &[&str]); 9] = [
        ("--situation two-rooms cube.gltf", &["two-rooms", "leave the scenes out"]),
        ("--situation corner", &["there are no scenes"]),
        ("--situation corner cube.gltf --preset room", &["corner", "of objects"]),
        ("--situation wall cube.gltf --baselines-from sphere", &["--baselines-from"]),
        ("cube.gltf --methods grid", &["grid", "fibonacci"]),
        ("cube.gltf --methods ours-two-passes --surface true", &["--surface proxy"]),
        ("cube.gltf --methods ours-two-passes --budgets 3", &["4 or more"]),
        ("cube.gltf --wall 0,0,0,0,0,0", &["--wall"]),
        ("cube.gltf --surface true --space known", &["--space known", "--surface proxy"]),
    ];
    for (given, says) in cases {
        assert_refused(&place, &[(&format!("evaluate {given} {TINY} --out o"), says)]);
    }
}

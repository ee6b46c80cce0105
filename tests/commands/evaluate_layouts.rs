//! `camsplat evaluate` of cameras from files: layouts of one's own, and methods of other programs.

use std::fs;

use super::evaluate_command::{TINY, on_the_mesh, qualities, results};
use crate::support::command::assert_refused;
use crate::support::command::gltf::lit_cube;
use camsplat::planner::quality::law::Coefficients;
use serde_json::{Value, json};

/// If this failed, a layout of one's own could not be compared, or would be compared with other cameras than those of the file.
#[test]
fn cameras_of_a_file_are_a_method() {
    let place = lit_cube();
    let tiny = |methods: &str, out: &str| format!("{} --out {out}", on_the_mesh(methods));
    place.done(&tiny("random", "o"));
    let plan = place.files("o").into_iter().find(|file| file.ends_with("plan.json")).unwrap();
    let mut mine: Value = serde_json::from_str(&place.read(&format!("o/{plan}"))).unwrap();
    // Another lens, which does not count.
    let lens = json!({ "width": 640, "height": 480, "focal": [300.0, 300.0], "principal": [320.0, 240.0] });
    mine["cameras"].as_array_mut().unwrap().iter_mut().for_each(|camera| camera["intrinsics"] = lens.clone());
    place.write("mine.json", mine.to_string());

    // The same places: photographed and trained already.
    let given = place.done(&tiny("random,cameras:mine.json", "o"));
    let made = |out: &str| -> Vec<String> {
        out.lines().filter(|line| line.starts_with("making")).map(|line| line[9..].replace("-", " ")).collect()
    };
    assert!(matches!(&made(&given.out)[..], [choice] if choice.starts_with("choice ")), "{}", given.out);
    let results = results(&place, "o");
    let qualities = qualities(&results);
    assert_eq!((qualities[1].0, qualities[0].1), (&Value::from("cameras:mine.json"), qualities[1].1));
    assert!(place.read("o/report.html").contains("cameras:mine.json"));
    assert!(place.read("o/table.md").contains("cameras:FILE are where the file has them"));
    assert!(results["runs"][1]["seconds"].is_null() && results["runs"][0]["seconds"].is_f64(), "no time to choose");
    // Their own lenses, where these are asked for, at the size of all pictures; tests keep the lens of all methods.
    place.done(&tiny("own=lenses:mine.json", "own"));
    let camera = |name: &str, begins: &str| -> Value {
        let files = place.files("own").into_iter().filter(|file| file.ends_with(name));
        let cameras = files.map(|file| serde_json::from_str::<Value>(&place.read(&format!("own/{file}"))).unwrap());
        let cameras = cameras.flat_map(|read| read["cameras"].as_array().unwrap().clone());
        cameras.into_iter().find(|camera| camera["name"].as_str().unwrap().starts_with(begins)).unwrap()
    };
    assert!(place.read("own/table.md").contains("lenses:FILE with the lenses of the file"));
    let [planned, photo, test] =
        [("plan.json", "0000"), ("capture.json", "0000"), ("capture.json", "half_")].map(|(a, b)| camera(a, b));
    assert_eq!((&planned["intrinsics"]["height"], &planned["intrinsics"]), (&json!(36), &photo["intrinsics"]));
    assert_eq!((&planned["intrinsics"]["focal"], &test["intrinsics"]["height"]), (&json!([22.5, 22.5]), &json!(48)));
    // As many as they are alone, whatever else is requested, and chosen once for all seeds.
    let forget = || fs::remove_file(place.path("o/results.json")).unwrap();
    forget();
    let budgets = tiny("cameras:mine.json", "o").replace("--budgets 4 --seeds 1", "--budgets 4,5 --seeds 2");
    let given = place.done(&budgets);
    assert_eq!(given.out.matches("complete cube").count(), 2, "{}", given.out);
    assert!(matches!(&made(&given.out)[..], [training] if training.starts_with("training ")), "{}", given.out);
    // Others under the same name are another choice.
    mine["cameras"].as_array_mut().unwrap().reverse();
    place.write("mine.json", mine.to_string());
    forget();
    assert!(made(&place.done(&tiny("cameras:mine.json", "o")).out).len() == 3);

    fs::create_dir_all(place.path("other")).unwrap();
    place.write("other/second.gltf", place.read("cube.gltf"));
    place.write("mine.txt", "no cameras");
    mine["cameras"].as_array_mut().unwrap().truncate(1);
    place.write("one.json", mine.to_string());
    // Of three frames one has no pose.
    let frame = |name: &str, pose: &str| format!(r#"{{"file_path": "{name}"{pose}}}"#);
    let pose = r#", "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]"#;
    let frames = [frame("a.png", pose), frame("b.png", ""), frame("c.png", pose)].join(", ");
    let broken = format!(r#"{{"fl_x": 50, "w": 48, "h": 48, "frames": [{frames}]}}"#);
    ["broken.json", "broken-4.json"].iter().for_each(|name| place.write(name, &broken));
    let why = "(frames left out: 1; frame 1 (\"b.png\"): it has no transform_matrix";
    let given = tiny("cameras:mine.json", "p");
    let cases: [(String, &[&str]); 9] = [
        (given.replace("mine.json", "broken.json"), &["these are 2 cameras; give --budgets 2", why]),
        (given.replace("mine.json", "broken-{views}.json"), &["these are 2 cameras, and its name says 4", why]),
        (given.replace("--budgets 4", "--budgets 5,6"), &["cameras:mine.json", "4 cameras", "give --budgets 4"]),
        (given.replace("mine.json", "one.json"), &["cameras:one.json", "1 cameras; give 2 to 1000"]),
        (given.replace("mine.json", "mine.json,cameras:./mine.json"), &["--methods", "twice"]),
        (given.replace("cube.gltf", "cube.gltf other/second.gltf"), &["cameras:mine.json", "one scene"]),
        (given.replace("mine.json", "none.json"), &["none.json"]),
        (given.replace("mine.json", "mine.txt"), &["mine.txt"]),
        (
            "evaluate --pool cube.gltf --methods cameras:mine.json --out p".into(),
            &["cameras:mine.json", "places cameras"],
        ),
    ];
    let cases: Vec<(&str, &[&str])> = cases.iter().map(|(arguments, said)| (arguments.as_str(), *said)).collect();
    assert_refused(&place, &cases);
}

/// If this failed, a lens would be said to be worth what another is, or tests would be taken with it too.
#[test]
fn a_method_is_compared_with_another_lens() {
    let place = lit_cube();
    place.done(&format!("{} --out o", on_the_mesh("random,random@80,ours@80")));
    assert!(place.read("o/table.md").contains("METHOD@DEGREES with a field of view of so many degrees in place of 50"));
    let (mut wide, mut usual, mut others) = (0, 0, 0);
    for file in place.files("o").into_iter().filter(|file| file.ends_with("capture.json")) {
        let capture: Value = serde_json::from_str(&place.read(&format!("o/{file}"))).unwrap();
        for camera in capture["cameras"].as_array().unwrap() {
            let degrees = 2.0 * (24.0 / camera["intrinsics"]["focal"][0].as_f64().unwrap()).atan().to_degrees();
            // Planned photos have numbers for names; tests and inputs say what they are.
            let planned = camera["name"].as_str().unwrap().starts_with('0');
            match degrees.round() {
                80.0 if planned => wide += 1,
                50.0 if planned => usual += 1,
                50.0 => others += 1,
                _ => panic!("{camera} has {degrees} degrees"),
            }
        }
    }
    assert!((wide, usual) == (8, 4) && others > 0, "{wide}, {usual} planned and {others} others");
    let methods = |names: &str| format!("{} --out p", on_the_mesh(names));
    // The law that a plan was made by stands in it.
    place.done(&methods("ours:law.nearest=3:law.most=4@80"));
    let plan = place.files("p").into_iter().find(|file| file.ends_with("plan.json")).unwrap();
    let plan: Value = serde_json::from_str(&place.read(&format!("p/{plan}"))).unwrap();
    let law: Coefficients = serde_json::from_value(plan["config"]["law"].clone()).unwrap();
    assert_eq!(law, Coefficients { nearest: 3.0, most: Some(4.0), ..Coefficients::embedded(true) });
    assert_refused(
        &place,
        &[
            (&methods("random@wide"), &["random@wide", "no field of view"]),
            (&methods("random@80,random@080"), &["--methods", "twice"]),
            (&methods("random,random@50"), &["--methods", "twice"]),
            (&methods("ours:law.nearest=-1"), &["ours:law.nearest=-1", "\"nearest\" is -1"]),
            (&methods("random@80@50"), &["two lenses"]),
            ("evaluate --pool cube.gltf --methods ours@80 --out p", &["ours@80", "with their lenses"]),
        ],
    );
}

/// If this failed, a method of another program could not be compared as ours are: it would not get what they choose by, its cameras would be
/// taken for another scene's, or the table would not say where they break the rules. And scenes would not be summed up.
#[test]
fn a_method_of_another_program_is_compared_on_several_scenes() {
    let place = lit_cube();
    let other = place.read("cube.gltf").replace("0.8, 0.4, 0.1", "0.1, 0.4, 0.8");
    place.write("blue_cube.gltf", other);
    let of = |methods: &str| {
        format!("{} --out o", TINY.replace("cube.gltf", "cube.gltf blue_cube.gltf").replace("random,ours", methods))
    };
    let prepared = place.done(&format!("{} --prepare", of("random")));
    assert!(prepared.out.contains("o/blue_cube/task") && !place.path("o/table.md").exists(), "{}", prepared.out);
    // Machines may share what was prepared, whatever they compare.
    let apart = of("random").replace("--out o", "--out apart");
    place.done(&format!("{apart} --prepare"));
    place.done(&format!("{} --shard 1/4", apart.replace("random", "fvs")));
    fs::create_dir(place.path("mine")).unwrap();
    for (scene, distance) in [("cube", 1.0), ("blue_cube", 9.0)] {
        let task: Value = serde_json::from_str(&place.read(&format!("o/{scene}/task/task.json"))).unwrap();
        let folder = format!("o/{scene}/task/{}", task["photos"].as_str().unwrap());
        assert!(place.path(&format!("{folder}/transforms.json")).is_file(), "{task}");
        assert!(place.path(&format!("o/{scene}/task/surface.ply")).is_file() && task["mesh"].is_null(), "{task}");
        let shell = &task["region"]["shape"]["shell"];
        let [near, far] = ["r_min", "r_max"].map(|key| shell[key].as_f64().unwrap_or_else(|| panic!("{task}")));
        let radius = near + (far - near) * distance;
        let cameras: Vec<Value> = (0..task["budgets"][0].as_u64().unwrap())
            .map(|i| {
                let turn = i as f64 * std::f64::consts::FRAC_PI_2;
                // A camera looks along its z, here at the centre.
                let half = 0.5 * (turn + std::f64::consts::PI);
                let rotation = [0.0, half.sin(), 0.0, half.cos()];
                json!({ "name": format!("{i}.png"), "intrinsics": task["camera"],
                    "pose": { "position": [radius * turn.sin(), 0.0, radius * turn.cos()], "rotation": rotation } })
            })
            .collect();
        place.write(&format!("mine/{scene}-4.json"), json!({ "cameras": cameras }).to_string());
    }
    let ran = place.done(&of("random,ring=cameras:mine/{scene}-{views}.json"));
    assert!(!ran.out.contains("making   surface"), "the surface was there: {}", ran.out);
    let table = place.read("o/table.md");
    let row = |line: &str| table.lines().find(|row| row.starts_with(line)).unwrap_or_else(|| panic!("{line}: {table}"));
    assert!(row("| blue_cube | ring | 4 |").ends_with(" – |"), "{table}");
    assert!(row("Given cameras that stand outside").contains("blue_cube, ring, 4 views (4 of 4)."), "{table}");
    assert!(!row("Given cameras that stand outside").contains(" cube, ring"), "{table}");
    // The mean of the two scenes, and the difference from the first method.
    let results = results(&place, "o");
    let psnr = |row: usize| results["rows"][row]["measured"][0][3]["mean"].as_f64().unwrap();
    let difference = 0.5 * ((psnr(1) - psnr(0)) + (psnr(3) - psnr(2)));
    let mean = format!("| ring | 4 | 2 | {:.2} | ", 0.5 * (psnr(1) + psnr(3)));
    assert!(row(&mean).contains(&format!("| {difference:.2} ± ")), "{table}");
    assert!(row("| random | 4 | 2 |").contains("| – |"), "{table}");
    let latex = place.read("o/table.tex");
    assert!(latex.contains("blue\\_cube & ring & 4 & $") && latex.contains("\\mathbf{"), "{latex}");
    assert_eq!((latex.matches("\\begin{tabular}").count(), latex.matches("\\end{tabular}").count()), (2, 2));
    assert!(place.read("o/report.html").contains("mean over scenes"));
}

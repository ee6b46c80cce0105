//! `camsplat quality fit`: from folders of evaluations to a law, and what it refuses.

use crate::support::command::Place;
use crate::support::command::gltf::cube;
use camsplat::lab::evaluate::layouts::Trained;
use camsplat::lab::quality_fit::{Agreement, Correlation, Fit, Layout, Observations};
use camsplat::planner::quality::law::{Coefficients, Fitted};
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::random;
use glam::DVec3;
use serde_json::{Value, json};

const SCENES: [&str; 4] = ["a", "b", "c", "d"];
const LAYOUTS: u32 = 12;
const VIEWS: u32 = 8;
const TESTS: u32 = 13;
/// A test view that shows nothing.
const AWAY: u32 = 5;

fn camera(name: String, position: DVec3) -> Camera {
    let intrinsics = Intrinsics::from_fov(64, 64, 50f64.to_radians());
    Camera { name, pose: Pose::looking(position, -position, DVec3::Y), intrinsics }
}

/// Cameras on one side of the cube or all around it, near or far, by `layout`.
fn layout(seed: u64, layout: u32) -> Vec<Camera> {
    let [wide, far, x, y] = random::uniforms(seed, 1, layout);
    let axis = random::direction(x, y);
    let position = |i: u32| {
        let [u, v, ..] = random::uniforms(seed, 2 + layout, i);
        (axis + (0.3 + 2.0 * wide) * random::direction(u, v)).normalize() * (4.0 + 4.0 * far)
    };
    (0..VIEWS).map(|i| camera(format!("{i:04}.png"), position(i))).collect()
}

/// Writes what an evaluation leaves, with `psnr` of a scene's layout in a test view.
fn evaluation(place: &Place, folder: &str, psnr: impl Fn(usize, u32, usize) -> f64) {
    let write = |name: String, value: Value| {
        let path = place.path(&format!("{folder}/{name}"));
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, value.to_string()).unwrap();
    };
    let mut runs = Vec::new();
    for (index, scene) in SCENES.into_iter().enumerate() {
        let test = |i: u32| {
            let [u, v, w, _] = random::uniforms(9, 77, i - u32::from(i > AWAY));
            let mut test = camera(format!("half_{i:04}.png"), (4.0 + 2.0 * w) * random::direction(u, v));
            if i == AWAY {
                test.pose = Pose::looking(test.pose.position, test.pose.position, DVec3::Y);
            }
            test
        };
        let tests: Vec<Camera> = (0..TESTS).map(test).collect();
        write(format!("{scene}/photos-t/capture.json"), json!({ "cameras": tests }));
        for of in 0..LAYOUTS {
            let cameras = layout(index as u64, of);
            write(format!("{scene}/photos-{of}/capture.json"), json!({ "cameras": cameras }));
            write(
                format!("{scene}/training-{of}/done.json"),
                json!({ "inputs": { "photos": format!("photos-{of}"), "tests": "photos-t" } }),
            );
            let view = |(view, test): (usize, &Camera)| json!({ "name": test.name, "quality": { "psnr": psnr(index, of, view), "ssim": 0.5, "lpips": null } });
            // In another order than they were captured in.
            write(
                format!("{scene}/training-{of}/train.json"),
                json!({ "test_views": tests.iter().enumerate().rev().map(view).collect::<Vec<_>>() }),
            );
            runs.push(json!({ "scene": scene, "method": format!("cameras:l{of}.json"), "seed": 0, "folder": format!("training-{of}") }));
        }
    }
    let region = json!({ "shape": null, "floor": null, "clearance": null });
    write(
        "results.json".into(),
        json!({ "request": { "kind": "object", "settings": { "region": region } }, "runs": runs }),
    );
}

/// If this failed, the published law could not be made again from evaluations, or would not be the one that they follow.
#[test]
fn a_law_comes_back_from_the_evaluations_that_follow_it() {
    let place = Place::new();
    for scene in SCENES {
        place.write(&format!("{scene}.gltf"), cube(", \"materials\": [{}]"));
    }
    evaluation(&place, "flat", |_, _, _| 20.0);
    let coefficients = Coefficients { nearest: 1.1, third: 0.5, farther: 0.9, background: 0.06, most: Some(3.0) };
    let law = Fitted { coefficients, ..Fitted::embedded(true) };
    let nothing = Correlation { groups: 0, layouts: 0, pearson: 0.0, least: 0.0, slope: 0.0 };
    let nothing = Agreement { whole: nothing, of_budgets: None };
    let known = Fit { law, fitted: nothing, held_out: None, alike_pairs: 0 };
    // Of each scene and test view, as if it were the only one.
    let expected: Vec<Vec<Vec<f64>>> = SCENES
        .iter()
        .map(|scene| {
            let runs = Trained::read(&place.path(&format!("{scene}.gltf")), &[place.path("flat")]).unwrap();
            let all = runs[0].observations();
            assert_eq!(all.shown, (0..TESTS as usize).filter(|view| *view != AWAY as usize).collect::<Vec<_>>());
            let starts = std::iter::once(&0).chain(&all.ends);
            let of_view = |(start, end): (&usize, &usize)| {
                let near = |layout: &Layout| layout.near[*start..*end].to_vec();
                let layouts =
                    all.layouts.iter().map(|layout| Layout { near: near(layout), ..layout.clone() }).collect();
                let (name, beside) = (all.name.clone(), all.beside[*start..*end].to_vec());
                known.expected(&Observations { name, beside, shown: vec![0], ends: vec![end - start], layouts })
            };
            let mut views: Vec<_> = starts.zip(&all.ends).map(of_view).collect();
            views.insert(AWAY as usize, vec![0.0; LAYOUTS as usize]);
            views
        })
        .collect();
    evaluation(&place, "o", |scene, layout, view| {
        20.0 + (scene + view) as f64 + expected[scene][view][layout as usize]
    });

    let fit = "quality fit a.gltf b.gltf c.gltf d.gltf --evaluations o --held-out d";
    let ran = place.done(&format!("{fit} --out law.json --layouts layouts.csv"));
    let found = serde_json::from_str::<Fitted>(&place.read("law.json")).unwrap().coefficients;
    for (found, wanted) in [found.nearest, found.third, found.farther, found.background, found.most.unwrap_or(0.0)]
        .into_iter()
        .zip([1.1, 0.5, 0.9, 0.06, 3.0])
    {
        assert!((found / wanted - 1.0).abs() < 1e-3, "{found} is not {wanted}: {}", ran.out);
    }
    assert!(ran.out.contains("held out Pearson 1.000"), "{}", ran.out);
    assert!(ran.out.contains("expected to be alike (35 pairs), and 0.00 for each"), "{}", ran.out);
    let table = place.read("layouts.csv");
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 1 + SCENES.len() * LAYOUTS as usize);
    assert!(
        lines[1].starts_with("a,free,0,8,l0; seed 0,") && lines[48].starts_with("d,free,1,8,l11; seed 0,"),
        "{table}"
    );
    // What `score` judges by agrees with what was trained, though by viewers of its own.
    let of = |line: &&str, column: usize| line.split(',').nth(column).unwrap().parse::<f64>().unwrap();
    let sorted = |column: usize| {
        let mut rows: Vec<usize> = (1..=12).collect();
        rows.sort_by(|a, b| of(&lines[*a], column).total_cmp(&of(&lines[*b], column)));
        rows
    };
    assert_eq!(sorted(6)[0], sorted(7)[0], "the worst layout: {table}");
    place.done(&format!("{fit} --out again.json"));
    assert_eq!(place.read("law.json"), place.read("again.json"));
}

/// If this failed, a fit to nothing or to something else would be taken for the law.
#[test]
fn what_cannot_be_fitted_is_refused_and_writes_nothing() {
    let place = Place::new();
    for scene in SCENES.iter().chain(&["other"]) {
        place.write(&format!("{scene}.gltf"), cube(", \"materials\": [{}]"));
    }
    // Cameras on one side train best: no law has error rise with angle and distance.
    evaluation(&place, "o", |scene, layout, _| 20.0 - random::uniforms(scene as u64, 1, layout)[0]);
    let refused = |arguments: &str, words: &[&str]| {
        let ran = place.run(&format!("quality fit {arguments} --out law.json"));
        assert_eq!((ran.code, ran.err.lines().count()), (Some(2), 1), "{arguments}: {}", ran.err);
        assert!(words.iter().all(|word| ran.err.contains(word)), "{arguments}: {}", ran.err);
        assert!(!place.path("law.json").exists(), "{arguments}");
    };
    refused("a.gltf b.gltf --evaluations none", &["none/results.json", "no such file or folder", "check the path"]);
    refused("other.gltf --evaluations o", &["other.gltf", "none of the evaluations"]);
    refused("a.gltf --evaluations o --held-out zebra", &["--held-out names zebra"]);
    refused("a.gltf --evaluations o --held-out a", &["train more layouts"]);
    refused("a.gltf ./a.gltf --evaluations o", &["./a.gltf", "another scene has this name"]);
    refused("a.gltf --evaluations o,o", &["names this folder twice"]);
    refused("a.gltf --evaluations o --device 7", &["--device is for what --layouts writes"]);
    refused("a.gltf b.gltf --evaluations o", &["error must rise"]);
    place.write("o/a/training-3/train.json", "{");
    refused("a.gltf b.gltf --evaluations o", &["training-3/train.json", "no file of a complete evaluation"]);
}

/// If this failed, what was trained on floors and against walls would be fitted as if it had been trained around free objects.
#[test]
fn what_an_evaluation_was_photographed_in_is_part_of_what_is_looked_at() {
    let place = Place::new();
    for scene in SCENES {
        place.write(&format!("{scene}.gltf"), cube(", \"materials\": [{}]"));
    }
    evaluation(&place, "o", |_, _, _| 20.0);
    let free: Value = serde_json::from_str(&place.read("o/results.json")).unwrap();
    let looks = |said: Value| {
        let mut results = free.clone();
        results["request"].as_object_mut().unwrap().extend(said.as_object().unwrap().clone());
        place.write("o/results.json", results.to_string());
        Trained::read(&place.path("a.gltf"), &[place.path("o")]).map(|runs| runs[0].observations())
    };
    let surface = |said: Value| looks(said).unwrap().beside.iter().filter(|beside| !**beside).count();
    let (alone, floor) = (surface(json!({})), surface(json!({ "situation": "floor" })));
    assert!(2 * alone < floor, "looks at the surface: {alone} without a floor, {floor} with it");
    // Both together: a part for each, in which layouts are compared.
    evaluation(&place, "p", |_, _, _| 20.0);
    let both = Trained::read(&place.path("a.gltf"), &[place.path("o"), place.path("p")]).unwrap();
    let parts: Vec<_> = both.iter().map(|part| (part.situation.name(), part.observations().layouts.len())).collect();
    assert_eq!(parts, [("floor", LAYOUTS as usize), ("free", LAYOUTS as usize)]);
}

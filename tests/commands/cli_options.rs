//! What the help shows, the built command accepts.

use std::collections::{BTreeMap, BTreeSet};

use crate::support::command::{Place, SHORT};
use crate::support::splats::capture;
use camsplat::files::io;
use camsplat::scene::gaussians::Gaussians;
use glam::DVec3;

/// Options in the help of a subcommand, each with the values that it lists.
fn options(place: &Place, subcommand: &str) -> BTreeMap<String, Vec<String>> {
    let help = place.done(&format!("{subcommand} --help")).out;
    let mut options = BTreeMap::new();
    let mut last = String::new();
    for line in help.lines().map(str::trim) {
        if let Some(at) = line.find("--").filter(|at| *at == 0 || line.starts_with('-')) {
            last = line[at + 2..].split([' ', ',', '=']).next().unwrap().to_owned();
            options.insert(last.clone(), Vec::new());
        }
        let values = line.split_once("[possible values: ").map(|(_, rest)| rest.trim_end_matches(']').split(", "));
        if let Some(values) = values {
            options.insert(last.clone(), values.map(str::to_owned).collect());
        } else if let Some(value) = line.strip_prefix("- ") {
            options.entry(last.clone()).or_default().push(value.split(':').next().unwrap().to_owned());
        }
    }
    options
}

/// If this failed, an option that the help shows would be refused, or stop a run that it should only change; or one has
/// been added that nothing tests.
#[test]
fn every_option_of_the_help_is_accepted() {
    let place = Place::new();
    place.done(&format!("plan ball.ply --out first {SHORT}"));
    let runs = [
        "--preset object --shell 0,0,0,2,3 --floor -2.5 --up +z --clearance 0.1 --connect 40 --fov 60 --size 640x480 --device 0 \
         --debug-sync --profile --trace t.json",
        "--box -3,-3,-3,3,3,3 --preset object --keep first --seed 7 --gate-softness 0.01",
        "--method paper-iterative --equal-directions --no-occlusion --dry-run",
        "--method paper-no-vds --relocate-every 5 --lambda-reg 2 --lambda-scale 0.1 --alpha 0.2 --scale 0.3 --pool 64",
        "--method paper --lr-scale 0 --lr-position 0.01 --lr-direction 0.03 --probes 8 --resolution 24 --lambda-bound 3",
        "--viewers shell:0,0,0,2,4",
        "--viewers box:-4,-4,2,4,4,5",
        "--viewers cone:120,0,-1,0",
        "--viewers heights:-0.5,1.5",
        "--viewers first",
        "--wall 0,0,-2.5,0,0,1 --keep-out boxes.json --heights -2,2.5 --walk 2.4,0.5,-1,0.2,1.6",
        "--keep-out zone.json --geo 0,0,0 --margin 0.2 --subject whole.json",
    ];
    let zone = "[[[-0.00001, 0.00001], [0.00001, 0.00001], [0, 0.00005]]]";
    place.write("zone.json", format!(r#"{{"type": "Polygon", "coordinates": {zone}}}"#));
    place.write("whole.json", r#"{"boxes": [[-2, -2, -2, 2, 2, 2]]}"#);
    place.write("boxes.json", r#"{"boxes": [[-4, -4, 1, 4, -0.5, 4]]}"#);
    let known = options(&place, "plan");
    let mut tried: BTreeSet<String> = BTreeSet::new();
    // Capturing, the baselines, --surface and known space have their own tests, and help ends every run.
    tried.extend(
        ["renderdoc", "curve", "help", "method", "candidates", "nodes", "model", "surface", "space", "reach"]
            .map(str::to_owned),
    );
    tried.extend(["renders", "steps", "look-size", "noise-steps", "antialiased"].map(str::to_owned));
    let mut try_with = |given: &str| {
        let arguments = format!("plan ball.ply --out o --force {SHORT} {given}");
        place.done(&arguments);
        tried.extend(arguments.split_whitespace().filter_map(|word| word.strip_prefix("--")).map(str::to_owned));
    };
    runs.iter().for_each(|given| try_with(given));
    // The first value of every option in one run, the second ones in another, and so on.
    let listed = || known.iter().filter(|(option, _)| option.as_str() != "method");
    for turn in 0..listed().map(|(_, values)| values.len()).max().unwrap_or(0) {
        let given = listed().filter_map(|(option, values)| Some(format!("--{option} {}", values.get(turn)?)));
        try_with(&format!("--method paper {}", given.collect::<Vec<_>>().join(" ")));
    }
    assert_eq!(known.keys().filter(|option| !tried.contains(*option)).collect::<Vec<_>>(), [""; 0]);
    assert!(known["gate"].len() >= 4 && known["preset"].len() == 2, "the help was misread: {known:?}");

    let given = "--preset room --box -0.9,-0.9,-0.9,0.9,0.9,0.9 --floor -0.5 --up z --clearance 0.1 \
                 --device 0 --debug-sync --held-out 50 --seed 4 --cone --all --viewers heights:-0.9,0.5 --json m.json \
                 --wall 0,0,-0.7,0,0,1 --keep-out small.json --keep-out zone.json --geo -0.001,0,0 --margin 0.01 --subject=-1,-1,-1,1,1,1 --heights -0.4,0.4 \
                 --walk 0.5,0.5,-0.5,0.05,0.3 --space open";
    place.write("small.json", r#"{"boxes": [[-0.9, -0.9, 0.2, -0.6, -0.6, 0.4]]}"#);
    place.done(&format!("score ball.ply first/plan.json {given}"));
    place.done("score ball.ply first/plan.json --shell 0,0,0,2,3");
    // A plan's own region is taken, from its folder as from its file; one that cannot be read is reported.
    place.done(&format!("plan ball.ply --out own {SHORT} --shell 0,0,0,2.25,3"));
    for cameras in ["own", "own/plan.json"] {
        let scored = place.done(&format!("score ball.ply {cameras}"));
        assert!(scored.out.contains("radii 2.250 to 3.000"), "{cameras}: {}", scored.out);
    }
    place.write("other.json", place.read("first/plan.json").replace("\"clearance\"", "\"clarity\""));
    let scored = place.done("score ball.ply other.json --shell 0,0,0,2,3");
    assert!(
        scored.out.contains("the region in other.json cannot be read") && scored.out.contains("clearance"),
        "{}",
        scored.out
    );
    let untried: Vec<String> =
        options(&place, "score").into_keys().filter(|name| !given.contains(name) && name != "shell").collect();
    assert_eq!(untried, ["help", "reach"]);

    place.write("splats.ply", io::ply::write::gaussians(&one_splat()));
    let given = "--out r --format exr --alpha --depth --antialiased --size 64x64 --near 0.1 --device 0 --debug-sync";
    place.done(&format!("render splats.ply first {given}"));
    place.done("render splats.ply first --out r --force --format png --background 0.2,0.5,1 --size 32x32");
    let untried: Vec<String> = options(&place, "render").into_keys().filter(|name| !given.contains(name)).collect();
    assert_eq!(untried, ["background", "force", "help"]);

    for name in ["a.png", "b.png"] {
        image::RgbImage::from_fn(40, 32, |x, y| image::Rgb([x as u8, y as u8, 9])).save(place.path(name)).unwrap();
    }
    let assets = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/lpips/alex_f16.safetensors");
    let given = format!("--lpips-alex {assets} --lpips-vgg none --json m.json --device 0 --debug-sync");
    let known = options(&place, "metrics");
    let untried: Vec<&String> = known.keys().filter(|name| !given.contains(&format!("--{name} "))).collect();
    assert_eq!(untried, ["background", "debug-sync", "help", "lpips"]);
    place.done(&format!("metrics a.png b.png {given}"));
    // What needs the weights of VGG16 is tried where they are at hand.
    for (option, values) in [("background", &["black", "white"][..]), ("lpips", &["alex", "none"])] {
        values.iter().for_each(|value| drop(place.done(&format!("metrics a.png b.png --{option} {value}"))));
    }
}

/// As above, for training: the options given must take effect, too.
#[test]
fn every_option_of_train_is_accepted_and_counts() {
    let place = Place::new();
    capture::write(&place.path("capture"), 6, 32);
    capture::write(&place.path("more"), 2, 32);
    let given = "--max-splats 100 --strategy adc --sh 1 --background random --antialiased --exposure --refine-poses --masks ignore \
                 --init-opacity 0.2 --init-scale 0.7 --shrink 2 --skip-missing --seed 3 --save-every 1 --evaluate-every 1 --profile \
                 --preset fast --trace t.json --device 0 --debug-sync --iterations 3 --format splat,glb --out o";
    let ran = place.done(&format!("train capture --test-every 3 {given}"));
    let record: serde_json::Value = serde_json::from_str(&place.read("o/train.json")).unwrap();
    let expected = serde_json::json!({
        "iterations": 3, "max_splats": 100, "strategy": "adc", "degree": 1, "background": "random",
        "antialiased": true, "suppress_floaters": false, "exposure": true, "refine_poses": true, "masks": "ignore", "fast": false, "seed": 3,
        "init_opacity": 0.2, "init_scale": 0.7,
    });
    assert_eq!(record["config"], expected);
    assert_eq!((&record["photos"]["largest"], &record["photos"]["test"]), (&serde_json::json!([16, 12]), &2.into()));
    assert_eq!(record["evaluations"].as_array().unwrap().len(), 3);
    assert!(ran.out.contains("splat_backward") && place.read("t.json").contains("splat_backward"), "{}", ran.out);
    place.done(&format!("train capture --test-every 3 {given} --resume"));
    place.done("train capture --test more --iterations 2 --max-splats 100 --out o --force");
    place.done("train capture --out none --dry-run");
    place.done("train capture --iterations 2 --max-splats 100 --out o --force --suppress-floaters");
    assert!(place.read("o/train.json").contains("\"suppress_floaters\": true"));
    // Not on every device.
    let ran = place.run("train capture --iterations 2 --max-splats 100 --out o --force --fast");
    assert!(ran.code == Some(0) || ran.err.contains("--fast"), "{}", ran.err);
    assert!(!place.path("none").exists());
    let known = options(&place, "train");
    for (option, values) in &known {
        for value in values {
            let run = "train capture --iterations 2 --max-splats 100 --test-every 0 --out o --force";
            place.done(&format!("{run} --{option} {value}"));
        }
    }
    let untried: Vec<&String> = known.keys().filter(|name| !given.contains(&format!("--{name} "))).collect();
    assert_eq!(
        untried,
        ["dry-run", "fast", "force", "help", "outside-paths", "resume", "suppress-floaters", "test", "test-every"]
    );
    assert!(known["strategy"].len() == 2 && known["background"].len() == 3, "the help was misread: {known:?}");
}

fn one_splat() -> Gaussians {
    Gaussians {
        centres: vec![DVec3::ZERO],
        log_scales: vec![[-1.0; 3]],
        rotations: vec![[1.0, 0.0, 0.0, 0.0]],
        opacities: vec![2.0],
        degree: 0,
        harmonics: vec![0.5; 3],
        antialiased: false,
    }
}

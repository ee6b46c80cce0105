//! The built command: what a plan leaves, how a run is watched and stopped.

use std::collections::{BTreeMap, BTreeSet};

use crate::support::command::{FILES, Place, SHORT, SMALL, ended, read_until, stop};
use camsplat::files::io;
use camsplat::planner::metrics::Metrics;
use camsplat::planner::plan::record::Status;
use camsplat::scene::camera::Camera;
use camsplat::scene::region::Shape;

/// Asserts that two camera sets are the same up to what a round trip through another format costs.
#[track_caller]
fn assert_same_cameras(left: &[Camera], right: &[Camera]) {
    assert_eq!(left.len(), right.len());
    for (a, b) in left.iter().zip(right) {
        assert!(a.pose.position.distance(b.pose.position) < 1e-9, "{a:?} {b:?}");
        assert!(a.pose.rotation.dot(b.pose.rotation).abs() > 1.0 - 1e-9, "{a:?} {b:?}");
        assert!((a.intrinsics.focal[0] - b.intrinsics.focal[0]).abs() < 1e-6, "{a:?} {b:?}");
    }
}

/// If this failed, a user would not find what the documentation promises, or find another plan in one file than in the
/// next.
#[test]
fn a_plan_leaves_every_file_and_they_agree() {
    let place = Place::new();
    let ran = place.done(&format!("plan ball.ply --out o {SHORT} --method paper --relocate-every 5 --size 640x480"));
    assert_eq!(place.files("o"), FILES);
    assert_eq!(
        place.files(""),
        [&["ball.ply"], &FILES.map(|file| format!("o/{file}")).each_ref().map(String::as_str)[..]].concat()
    );
    for line in ["surface  ball.ply: ", "region   shell around", "device   ", "plan     5 views, 20 iterations"] {
        assert!(ran.out.contains(line), "{line:?} is not in {}", ran.out);
    }
    let plan = place.plan("o");
    assert_eq!((plan.status, plan.cameras.len(), plan.kept, plan.history.len()), (Status::Complete, 5, 0, 20));
    assert_eq!(plan.checkpoints.iter().map(|c| c.iteration).collect::<Vec<_>>(), [0, 10, 20]);
    assert!(plan.metrics.coverage_1 > 0.0 && plan.history.iter().all(|row| row.loss.is_finite()));
    for file in ["plan.json", "transforms.json", "sparse/0", ""] {
        assert_same_cameras(&io::read_cameras(&place.path("o").join(file)).unwrap(), &plan.cameras);
    }
    assert_eq!(place.read("o/cameras.csv").lines().count(), 6);
    assert!(place.read("o/report.html").trim_end().ends_with("</html>"));
    // The exports are surfaces themselves: the reader refuses what is damaged.
    for file in ["points.ply", "coverage.ply", "frusta.ply", "sparse/0"] {
        assert!(io::read_surface(&place.path("o").join(file)).is_ok(), "{file}");
    }
}

/// If this failed, cameras would be scored for viewers and against layouts that stand on a wall, where a file's up was taken wrong.
#[test]
fn score_warns_where_the_cameras_stand_by_another_up() {
    let place = Place::new();
    place.done("plan ball.ply --out o --views 20 --method fibonacci --up y");
    let warns = |options: &str| {
        place.done(&format!("score ball.ply {options}")).out.contains("the cameras stand upright along")
    };
    assert!(warns("o/transforms.json") && warns("o/transforms.json --up -y"), "up is z where nobody says it");
    assert!(!warns("o/transforms.json --up y") && !warns("o"));
    // A flight that looks straight down holds its pictures' up northwards, and nothing is wrong.
    let frames: Vec<String> = (-2..=2)
        .map(|x| {
            let pose = format!("[[1,0,0,{}],[0,1,0,0],[0,0,1,3],[0,0,0,1]]", f64::from(x) / 4.0);
            format!(r#"{{"file_path": "{x}.png", "transform_matrix": {pose}}}"#)
        })
        .collect();
    place.write("flight.json", format!(r#"{{"w": 64, "h": 64, "fl_x": 64, "frames": [{}]}}"#, frames.join(",")));
    assert!(!warns("flight.json --up z"));
}

/// If this failed, `score` would score a plan by another measure than `plan` did, or an export would have moved the
/// cameras.
#[test]
fn score_of_our_own_files_gives_the_metrics_of_the_plan() {
    let place = Place::new();
    for (options, field) in [("", ""), ("--gate soft", "--cone")] {
        place.done(&format!("plan ball.ply --out o --force {SHORT} --seed 3 {options}"));
        let plan = place.plan("o");
        let expected = plan.metrics;
        for file in ["plan.json", "transforms.json", "sparse/0"] {
            place.done(&format!("score ball.ply o/{file} --held-out 60 --seed 3 --json m.json {field}"));
            let found: Metrics = serde_json::from_str(&place.read("m.json")).unwrap();
            if file == "plan.json" {
                assert_eq!(found, expected, "{field}");
                let scores: serde_json::Value = serde_json::from_str(&place.read("m.json")).unwrap();
                let db = |expected: &serde_json::Value| expected["db"].as_f64().unwrap();
                let planned = serde_json::to_value(&plan.expected).unwrap();
                assert!((db(&scores["expected"]) - db(&planned)).abs() < 0.02, "{} was {planned}", scores["expected"]);
            }
            let numbers = |m: &Metrics| -> BTreeMap<String, f64> {
                serde_json::from_value(serde_json::to_value(m).unwrap()).unwrap()
            };
            for ((name, a), (_, b)) in numbers(&found).iter().zip(&numbers(&expected)) {
                assert!((a - b).abs() <= 1e-5 * b.abs(), "{file} {field}: {name} is {a} and was {b}");
            }
        }
    }
}

/// If this failed, cameras that a user has already would be moved, lost, or be mistaken for planned ones.
#[test]
fn kept_cameras_stay_where_they_are() {
    let place = Place::new();
    place.done(&format!("plan ball.ply --out first {SHORT}"));
    let kept = place.plan("first").cameras;
    for file in ["plan.json", "transforms.json", "sparse/0", ""] {
        place.done(&format!("plan ball.ply --out second --force {SHORT} --seed 1 --keep first/{file}"));
        let plan = place.plan("second");
        assert_eq!((plan.cameras.len(), plan.kept), (10, 5), "{file}");
        assert_same_cameras(&plan.cameras[5..], &kept);
        let names: BTreeSet<&str> = plan.cameras.iter().map(|camera| camera.name.as_str()).collect();
        assert_eq!(names.len(), 10, "{file}: {names:?}");
        assert_same_cameras(&io::read_cameras(&place.path("second/transforms.json")).unwrap(), &plan.cameras);
    }
    // Planned around the kept ones: without them the same seed gives another plan.
    place.done(&format!("plan ball.ply --out alone {SHORT} --seed 1"));
    assert_ne!(place.plan("alone").cameras[0].pose, place.plan("second").cameras[0].pose);
}

/// If this failed, an option would be accepted and then ignored.
#[test]
fn what_is_asked_for_is_what_runs() {
    let place = Place::new();
    place.done(&format!(
        "plan ball.ply --out o {SMALL} --seed 9 --iterations 12 --method paper --pool 64 --gate pinhole-hard --kernel metric \
         --start identical --no-occlusion --relocate-every 0 --equal-directions --probes 7 --alpha 0.25 --lr-scale 0 --size 320x200"
    ));
    let plan = place.plan("o");
    let expected = serde_json::json!({
        "views": 5, "seed": 9, "iterations": 12, "objective": "paper", "gate": "pinhole_hard", "kernel": "metric",
        "start": "identical", "occlusion": false, "vds": true, "relocate_every": 0, "probes": 7, "pool": 64,
        "held_out": 60, "equal_probes": false, "alpha": 0.25, "lr_scale": 0.0, "preset": "object",
    });
    for (name, value) in expected.as_object().unwrap() {
        assert_eq!(&plan.config[name], value, "{name}");
    }
    assert_eq!((plan.cameras[0].intrinsics.width, plan.cameras[0].intrinsics.height), (320, 200));
    assert_eq!(plan.history.len(), 12);
    assert!(plan.history.windows(2).all(|pair| pair[0].scale == pair[1].scale), "a rate of 0 holds the scale");
}

/// If this failed, a run could not be repeated: the promised determinism would end at the command line.
#[test]
fn the_same_command_gives_the_same_plan() {
    let place = Place::new();
    let poses = |out: &str, options: &str| {
        place.done(&format!("plan ball.ply --out {out} {SHORT} {options}"));
        place.plan(out)
    };
    let first = poses("a", "");
    let again = poses("b", "");
    let other = poses("c", "--seed 1");
    assert_eq!((&first.cameras, &first.history, &first.metrics), (&again.cameras, &again.history, &again.metrics));
    assert_ne!(first.cameras, other.cameras);
}

/// If this failed, waiting after every stage, or timing every stage, would change what is computed: a missing barrier would stay
/// hidden from the tools meant to find it.
#[test]
fn watching_a_run_does_not_change_it() {
    let place = Place::new();
    let plan = |out: &str, options: &str| {
        place.done(&format!("plan ball.ply --out {out} {SHORT} {options}"));
        let plan = place.plan(out);
        (plan.cameras, plan.history, plan.checkpoints, plan.metrics)
    };
    for way in ["--method ours", "--method paper --relocate-every 5"] {
        let plan = |out: &str, options: &str| plan(out, &format!("--force {way} {options}"));
        let plain = plan("plain", "");
        assert_eq!(plain, plan("synced", "--debug-sync"));
        assert_eq!(plain, plan("profiled", "--profile"));
        assert_eq!(plain, plan("both", "--debug-sync --profile"));
    }
}

/// If this failed, the curve would not show how many photos to take: more views must be expected to give more, by ever less.
#[test]
fn the_curve_rises_with_the_views_and_flattens() {
    let place = Place::new();
    let ran = place.done("plan ball.ply --curve --iterations 4 --probes 4 --out c");
    assert!(ran.out.contains("each further ten gain") && ran.out.contains("from 50 to 100 views"), "{}", ran.out);
    let points: serde_json::Value = serde_json::from_str(&place.read("c/curve.json")).unwrap();
    let points: Vec<(f64, f64)> =
        points.as_array().unwrap().iter().map(|p| (p["views"].as_f64().unwrap(), p["db"].as_f64().unwrap())).collect();
    assert_eq!((points[0].0, points[points.len() - 1]), (5.0, (300.0, 0.0)));
    assert!(points.windows(2).all(|pair| pair[0].1 < pair[1].1), "{points:?}");
    let gain = |pair: &[(f64, f64)]| (pair[1].1 - pair[0].1) / (pair[1].0 - pair[0].0);
    assert!(gain(&points[..2]) > 10.0 * gain(&points[points.len() - 2..]), "{points:?}");
    assert!(place.read("c/curve.svg").starts_with("<svg"));
    let refused = place.run("plan ball.ply --curve --views 5 --out d");
    assert_eq!(refused.code, Some(2), "{}", refused.err);
}

/// If this failed, a user would look at times that leave a stage out, or at a trace that no viewer opens.
#[test]
fn profile_and_trace_name_every_stage() {
    let place = Place::new();
    let ran = place
        .done(&format!("plan ball.ply --out o {SHORT} --method paper --relocate-every 5 --profile --trace t.json"));
    let own = place.done(&format!("plan ball.ply --out q {SHORT} --profile"));
    for stage in ["look", "viewed", "update_quality", "snapshot"] {
        assert!(
            own.out.lines().any(|line| line.split_whitespace().next() == Some(stage)),
            "no row for {stage}: {}",
            own.out
        );
    }
    let stages = ["dense", "update_paper", "rank", "relocate", "snapshot"];
    let mut share = 0.0;
    for stage in stages {
        let row = ran.out.lines().find(|line| line.split_whitespace().next() == Some(stage));
        let row: Vec<&str> =
            row.unwrap_or_else(|| panic!("no row for {stage}: {}", ran.out)).split_whitespace().collect();
        assert!(row[1].parse::<u32>().unwrap() > 0, "{row:?}");
        share += row[4].trim_end_matches('%').parse::<f64>().unwrap();
    }
    assert!((share - 100.0).abs() < 1.0, "the stages take {share} % of the time");

    let trace: serde_json::Value = serde_json::from_str(&place.read("t.json")).unwrap();
    let events = trace["traceEvents"].as_array().unwrap();
    let spans = |name: &str| events.iter().filter(|e| e["ph"] == "X" && e["name"] == name).collect::<Vec<_>>();
    for name in stages.iter().chain(&["preparation", "set-up", "optimisation", "metrics"]) {
        assert!(!spans(name).is_empty(), "{name}");
    }
    assert!(spans("dense").len() >= 20, "one span an iteration");
    for event in events.iter().filter(|event| event["ph"] == "X") {
        assert!(event["ts"].as_f64().unwrap() >= 0.0 && event["dur"].as_f64().unwrap() >= 0.0, "{event}");
    }
    assert!(events.iter().any(|event| event["ph"] == "M" && event["args"]["name"] == "device"));
}

/// If this failed, `--dry-run` would not report what a plan takes, or would touch the disk.
#[test]
fn a_dry_run_prints_the_footprint_and_writes_nothing() {
    let place = Place::new();
    let before = place.files("");
    let ran = place.done(&format!("plan ball.ply --out o {SHORT} --dry-run"));
    let mebibytes = |name: &str| -> f64 {
        let line = ran.out.lines().find(|line| line.starts_with(name)).unwrap_or_else(|| panic!("{name}: {}", ran.out));
        line.split_whitespace().rev().nth(1).unwrap().parse().unwrap()
    };
    let buffers = ["looks", "splats", "partials", "moments", "history", "snapshots"];
    assert!(buffers.into_iter().map(mebibytes).sum::<f64>() <= mebibytes("all ") + 0.05);
    assert!(ran.out.lines().last().unwrap().starts_with("fits "), "{}", ran.out);
    assert_eq!(place.files(""), before);
}

/// If this failed, a scene of a millimetre in metres would have a region from 0.000 to 0.000.
#[test]
fn figures_of_a_tiny_scene_are_no_zeros() {
    let place = Place::new();
    let smaller = |line: &str| {
        let numbers: Option<Vec<f64>> = line.split(' ').map(|word| word.parse().ok()).collect();
        match numbers.as_deref() {
            Some([x, y, z]) => format!("{} {} {}\n", 5e-4 * x, 5e-4 * y, 5e-4 * z),
            _ => format!("{line}\n"),
        }
    };
    place.write("tiny.ply", place.read("ball.ply").lines().map(smaller).collect::<String>());
    let out = place.done(&format!("plan tiny.ply --floor -0.0004 --out o {SHORT}")).out;
    let plan = place.plan("o");
    let Shape::Shell { r_min, r_max, .. } = plan.region.shape else { panic!("{:?}", plan.region) };
    let tour = plan.tour.unwrap().length;
    let written = [
        ("radii ", r_min),
        (" to ", r_max),
        ("floor at ", -4e-4),
        ("clearance ", plan.region.clearance),
        ("tour     ", tour),
    ];
    let region = &out[out.find("region  ").unwrap()..];
    for (name, value) in written {
        let said: f64 = region.split(name).nth(1).unwrap().split([' ', ',']).next().unwrap().parse().unwrap();
        assert!((said / value - 1.0).abs() < 0.01, "{name} {said}, not {value}: {region}");
    }
    assert!(out.contains("to [0.00050, 0.00050, 0.00050]"), "{out}");
}

/// If this failed, the driver would be asked for something that Vulkan does not allow: it works here and fails elsewhere.
#[test]
fn the_validation_layers_are_silent() {
    let place = Place::new();
    let validated = |arguments: &str| {
        let ran = ended(place.command(arguments).env("CAMSPLAT_VALIDATION", "1").output().unwrap());
        assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""), "camsplat {arguments}");
    };
    validated(&format!("plan ball.ply --out a {SHORT} --method paper --relocate-every 5"));
    validated(&format!("plan ball.ply --out b {SHORT} --box -0.9,-0.9,-0.9,0.9,0.9,0.9 --method paper --debug-sync"));
    validated(&format!("plan ball.ply --out c {SHORT} --keep a --gate pinhole --method paper-iterative --profile"));
    validated(&format!("plan ball.ply --out d {SHORT} --method paper --pass binned --relocate-every 5"));
    validated(&format!("plan ball.ply --out e {SHORT}"));
    validated(&format!("plan ball.ply --out f {SHORT} --box -0.9,-0.9,-0.9,0.9,0.9,0.9 --debug-sync"));
    validated("score ball.ply a/plan.json --held-out 1000 --all");
}

/// If this failed, the silence above could be that of layers which were never switched on.
#[test]
fn validation_is_refused_where_the_layers_are_missing() {
    let place = Place::new();
    let mut command = place.command(&format!("plan ball.ply --out o {SHORT}"));
    command.env("CAMSPLAT_VALIDATION", "1").env("VK_LAYER_PATH", place.path("none"));
    let ran = ended(command.output().unwrap());
    assert_eq!((ran.code, ran.err.lines().count()), (Some(2), 1), "{}", ran.err);
    assert!(ran.err.contains("vulkan-validationlayers"), "{}", ran.err);
}

/// If this failed, a user could not list the available devices.
#[test]
fn devices_are_listed_with_what_they_have() {
    let place = Place::new();
    let ran = place.done("devices");
    assert!(
        ran.out.starts_with("0: ") && ran.out.contains("largest plan with 200 probes a step: about"),
        "{}",
        ran.out
    );
    let lavapipe = ["x86_64", "aarch64"]
        .iter()
        .any(|machine| std::path::Path::new(&format!("/usr/share/vulkan/icd.d/lvp_icd.{machine}.json")).exists());
    if lavapipe {
        assert!(ran.out.contains("llvmpipe") && ran.out.contains("(CPU, Vulkan 1."), "{}", ran.out);
    } else {
        println!("skipped: lavapipe is not installed");
    }
}

/// If this failed, a plan would take minutes on the CPU, and nobody would say that the GPU's driver is missing.
#[test]
fn software_in_place_of_a_gpu_is_a_warning_unless_asked_for() {
    let place = Place::new();
    if !place.done("devices").out.starts_with("0: llvmpipe") {
        println!("skipped: there is a GPU");
        return;
    }
    let plan = format!("plan ball.ply --out o {SHORT} --dry-run");
    let warning = "warning: this runs on llvmpipe";
    let said = |out: &str| out.lines().filter(|line| line.starts_with(warning)).count();
    let ran = place.done(&plan);
    assert!(said(&ran.out) == 1 && ran.out.contains("no GPU with a Vulkan driver"), "{}", ran.out);
    assert_eq!(said(&place.done(&format!("{plan} --device 0")).out), 0);
}

/// If this failed, `camsplat plan ... | head -1` would lose the plan: writing to a closed pipe fails.
#[test]
fn a_reader_that_goes_away_costs_nothing() {
    let place = Place::new();
    let mut child = place.command(&format!("plan ball.ply --out o {SHORT} --profile")).spawn().unwrap();
    drop(child.stdout.take());
    drop(child.stderr.take());
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(place.files("o"), FILES);
    let mut child = place.command("plan none.ply --out p --views 3").spawn().unwrap();
    drop(child.stderr.take());
    assert_eq!(child.wait().unwrap().code(), Some(2));
}

/// If this failed, stopping a run would throw its work away, pass half a plan off as a whole one, or have no effect.
#[test]
#[cfg(unix)]
fn an_interrupted_run_leaves_the_plan_so_far() {
    let place = Place::new();
    for (signal, out, options) in [("-INT", "a", ""), ("-TERM", "b", ""), ("-INT", "c", "--profile")] {
        let arguments = format!("plan ball.ply --out {out} {SMALL} --iterations 50000 {options}");
        let mut child = place.command(&arguments).spawn().unwrap();
        let output = read_until(&mut child, "running ");
        let ran = stop(child, output, signal);
        assert_eq!((ran.code, ran.err.as_str()), (Some(130), ""), "{}", ran.out);
        assert_eq!(place.files(out), FILES);
        let plan = place.plan(out);
        let done = plan.history.len();
        assert_eq!((plan.status, plan.cameras.len()), (Status::Interrupted, 5));
        assert!(done > 0 && done < 50_000, "{done} iterations");
        assert_eq!(plan.checkpoints.last().unwrap().iteration as usize, done);
        assert!(ran.out.contains(&format!("stopped after {done} iterations")), "{}", ran.out);
        assert!(place.read(&format!("{out}/plan.json")).contains("\"interrupted\""));
    }
}

/// If this failed, there would be a moment at which Ctrl-C leaves half a folder, or hidden rubbish beside it.
#[test]
#[cfg(unix)]
fn a_stop_at_any_time_leaves_all_or_nothing() {
    let place = Place::new();
    for (i, line) in ["surface ", "region ", "device ", "running "].iter().enumerate() {
        let out = format!("o{i}");
        let mut child =
            place.command(&format!("plan ball.ply --out {out} {SMALL} --iterations 50000")).spawn().unwrap();
        let output = read_until(&mut child, line);
        // Not -INT, which shells make background processes ignore.
        let ran = stop(child, output, "-TERM");
        // Before the work begins the signal itself ends the process, and there is no exit code.
        assert!([None, Some(130)].contains(&ran.code), "{line}: {:?} {}", ran.code, ran.err);
        match place.path(&out).exists() {
            true => assert_eq!(place.files(&out), FILES, "{line}"),
            false => assert_eq!(ran.code, None, "{line}"),
        }
        let names = std::fs::read_dir(place.path("")).unwrap().map(|entry| entry.unwrap().file_name());
        let hidden: Vec<_> = names.filter(|name| name.to_string_lossy().starts_with('.')).collect();
        assert!(hidden.is_empty(), "{line}: {hidden:?}");
    }
}

//! `camsplat plan --method`: what each baseline leaves, and what bad input gets.

use crate::support::command::{FILES, Place, assert_refused, read_until, stop};
use camsplat::files::io;
use camsplat::scene::camera::Camera;
use camsplat::scene::gaussians::Gaussians;
use camsplat::scene::random;

/// Methods that need nothing but a region.
const METHODS: [&str; 8] = ["random", "fibonacci", "fvs", "fvs-chord", "fvs-shared", "coverage", "greedy", "acp"];

fn cameras(place: &Place, folder: &str) -> Vec<Camera> {
    io::read_cameras(&place.path(&format!("{folder}/plan.json"))).unwrap()
}

/// If this failed, a table could not be made of the baselines' plans, a baseline's cameras would be where ours may not, or two runs
/// would give two tables.
#[test]
fn every_peer_leaves_a_plan_in_its_region_and_the_same_twice() {
    let place = Place::new();
    let region = "--views 12 --held-out 50 --shell 0,0,0,2,3 --floor -0.5";
    for method in METHODS {
        let chooses = !matches!(method, "random" | "fibonacci");
        let more = if chooses { "--candidates 60" } else { "" };
        let ran = place.done(&format!("plan ball.ply --out {method} --method {method} {region} {more} --seed 3"));
        assert!(ran.out.contains(&format!("12 views, chosen by {method} in ")), "{}", ran.out);
        assert_eq!(place.files(method), FILES);
        let record = place.plan(method);
        assert_eq!((record.method.as_str(), &record.config["method"]), (method, &method.into()));
        assert_eq!(record.config["candidates"].as_u64(), chooses.then_some(60));
        assert!(record.baselines.iter().all(|baseline| baseline.name != method) && !record.baselines.is_empty());
        assert!(record.metrics.coverage_1 > 0.5 && record.seconds > 0.0);
        let planned = cameras(&place, method);
        assert_eq!(planned.len(), 12);
        for camera in &planned {
            let position = camera.pose.position;
            assert!(
                (2.0 - 1e-6..3.0 + 1e-6).contains(&position.length()) && position.z > -0.5 - 1e-6,
                "{method}: {position}"
            );
            assert!(camera.pose.forward().dot(-position.normalize()) > 0.99, "{method}");
        }
        place.done(&format!("plan ball.ply --out again --force --method {method} {region} {more} --seed 3"));
        assert_eq!(place.read("again/transforms.json"), place.read(&format!("{method}/transforms.json")), "{method}");
        place.done(&format!("plan ball.ply --out other --force --method {method} {region} {more} --seed 4"));
        let other = place.read("other/transforms.json");
        assert_ne!(other, place.read(&format!("{method}/transforms.json")), "{method}: the seed changes nothing");
    }
}

/// If this failed, a row of the evaluation could not be planned by itself under its name.
#[test]
fn variants_of_the_planner_are_methods_too() {
    let place = Place::new();
    let region = "--views 3 --iterations 20 --held-out 50 --shell 0,0,0,2,3";
    let methods = [
        ("ours", "quality", None, None),
        ("paper", "paper", Some(true), Some(false)),
        ("paper-no-vds", "paper", Some(false), Some(false)),
        ("paper-iterative", "paper", Some(false), Some(true)),
    ];
    let mut poses = Vec::new();
    for (method, objective, vds, iterative) in methods {
        place.done(&format!("plan ball.ply --out a --force --method {method} {region}"));
        let plan = place.plan("a");
        let of = |key: &str| plan.config[key].as_bool();
        assert_eq!((plan.method.as_str(), plan.config["objective"].as_str()), (method, Some(objective)));
        assert_eq!((of("vds"), of("iterative")), (vds, iterative), "{method}");
        poses.push(place.read("a/transforms.json"));
    }
    // Nothing of the ball has a score.
    assert!(poses[1] == poses[2] && poses[0] != poses[1] && poses[2] != poses[3], "methods give the wrong plans");
    let refused = place.run(&format!("plan ball.ply --out c --method paper-no-vds --candidates 9 {region}"));
    assert!(
        refused.code == Some(2) && refused.err.contains("--candidates is for methods that choose"),
        "{}",
        refused.err
    );
}

/// If this failed, Ctrl-C would end a choice by a signal without reporting the outcome, or leave half of a folder.
#[test]
fn a_stopped_choice_writes_nothing_and_says_so() {
    let place = Place::new();
    let asked = "plan ball.ply --out o --method acp --views 2000 --candidates 4000 --nodes 32 --held-out 50";
    let mut child = place.command(asked).spawn().unwrap();
    let output = read_until(&mut child, "device");
    let before = place.files("");
    let stopped = stop(child, output, "-INT");
    assert_eq!(stopped.code, Some(130), "{}{}", stopped.out, stopped.err);
    assert!(stopped.out.contains("nothing is written"), "{}", stopped.out);
    assert_eq!(place.files(""), before);
}

/// If this failed, baselines would look at the middle of a room, be inside its furniture, or ignore existing cameras.
#[test]
fn peers_stand_in_rooms_and_beside_kept_cameras() {
    let place = Place::new();
    let room = "--box -3,-3,-3,3,3,3 --clearance 0.3 --views 8 --held-out 50";
    place.done(&format!("plan ball.ply --out first --method random {room}"));
    for method in ["fvs", "acp --nodes 8", "acp-hidden", "coverage", "greedy"] {
        place.done(&format!("plan ball.ply --out o --force --method {method} --candidates 40 --keep first {room}"));
        let all = cameras(&place, "o");
        assert_eq!((all.len(), place.plan("o").kept), (16, 8));
        let near = |(a, b): (&Camera, &Camera)| a.pose.position.distance(b.pose.position) < 1e-9;
        assert!(all[8..].iter().zip(&cameras(&place, "first")).all(near), "{method}");
        assert!(all.iter().all(|camera| camera.pose.position.length() > 1.2), "{method}");
        let inward = all.iter().filter(|camera| camera.pose.forward().dot(-camera.pose.position.normalize()) > 0.99);
        assert!(inward.count() < 3, "{method} looks in");
        for (i, camera) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|other| other.pose != camera.pose), "{method} gives a camera twice");
        }
    }
}

/// Opaque splats on the ball.
fn model() -> Gaussians {
    let mut gaussians = Gaussians { degree: 0, ..Gaussians::default() };
    for i in 0..150 {
        let [u, v, w, x] = random::uniforms(8, 0, i);
        gaussians.centres.push(random::direction(u, v));
        gaussians.log_scales.push([-2.0; 3]);
        gaussians.rotations.push([1.0, 0.0, 0.0, 0.0]);
        gaussians.opacities.push(3.0);
        gaussians.harmonics.extend([w, x, u].map(|colour| (2.0 * colour - 1.0) as f32));
    }
    gaussians
}

/// If this failed, methods that choose by a model would not see it, would take uninformative views, or need another try.
#[test]
fn peers_that_look_at_a_model_choose_by_it() {
    let place = Place::new();
    place.write("model.ply", io::ply::write::gaussians(&model()));
    for method in ["fisherrf", "pop-d", "pop-t", "cover"] {
        let run =
            format!("--method {method} --model model.ply --candidates 30 --size 64x48 --held-out 50 --shell 0,0,0,2,3");
        place.done(&format!("plan ball.ply --views 9 --out {method} {run}"));
        let record = place.plan(method);
        assert_eq!((record.method.as_str(), &record.config["model"]), (method, &"model.ply".into()));
        assert_eq!(record.config["model_based"]["first"], 4);
        assert!(record.metrics.coverage_1 > 0.8, "{method}: {}", record.metrics.coverage_1);
        place.done(&format!("plan ball.ply --views 9 --out again --force {run}"));
        assert_eq!(place.read("again/transforms.json"), place.read(&format!("{method}/transforms.json")), "{method}");
        // Fewer views are the first of more.
        place.done(&format!("plan ball.ply --views 6 --out again --force {run}"));
        let centres = |folder: &str| cameras(&place, folder).iter().map(|c| c.pose.position).collect::<Vec<_>>();
        assert_eq!(centres("again"), centres(method)[..6], "{method}");
        // What one side has been seen from is left to the end.
        place.done(&format!("plan ball.ply --views 5 --out more --force --keep {method} {run} --antialiased"));
        let away = |a: &Camera, b: &Camera| a.pose.position.angle_between(b.pose.position);
        let all = cameras(&place, "more");
        // The trace knows nothing of what has been seen, and the logarithm of the determinant little.
        let pop = method.starts_with("pop");
        assert!(pop || all[..5].iter().all(|new| all[5..].iter().all(|old| away(new, old) > 0.05)), "{method}");
        let criterion = &record.config["model_based"]["criterion"];
        assert_eq!(
            criterion.as_str(),
            [("pop-d", "determinant"), ("pop-t", "trace")]
                .iter()
                .find_map(|(name, of)| (*name == method).then_some(*of))
        );

        let chosen = place.done(&format!(
            "select {method}/transforms.json --surface ball.ply --count 5 --points 100 --out s --force --method {method} --model model.ply"
        ));
        assert!(chosen.out.contains("chosen   5 of 9 photos"), "{}", chosen.out);
    }
    let plan = |options: &str| format!("plan ball.ply --out o --views 9 --size 64x48 {options}");
    let cases: [(String, &[&str]); 5] = [
        (plan("--method fisherrf"), &["--method fisherrf needs trained splats", "--model"]),
        (plan("--method cover"), &["--method cover needs trained splats", "--model"]),
        (plan("--method fvs --model model.ply"), &["--method fvs looks at no model"]),
        (plan("--model model.ply"), &["--method ours looks at no model"]),
        (plan("--method cover --model ball.ply"), &["ball.ply"]),
    ];
    for (arguments, fragments) in &cases {
        assert_refused(&place, &[(arguments.as_str(), *fragments)]);
    }
}

/// If this failed, cameras would leave the middle of the shell, ignore existing views, or differ between two runs.
#[test]
fn cameras_climb_to_where_a_model_is_least_certain() {
    let place = Place::new();
    place.write("model.ply", io::ply::write::gaussians(&model()));
    let few = "--renders 2 --steps 4 --look-size 32 --noise-steps 20";
    let run = format!("--method manifold --model model.ply --size 64x48 --held-out 50 {few} --seed 3");
    let shell = "--shell 0,0,0,2,3 --floor -0.5";
    place.done(&format!("plan ball.ply --views 6 --out o {run} {shell}"));
    let settings = &place.plan("o").config["manifold"];
    assert_eq!((&settings["steps"], &settings["side"], &settings["learn"]), (&4.into(), &32.into(), &20.into()));
    let all = cameras(&place, "o");
    assert_eq!(all.len(), 6);
    for camera in &all {
        let position = camera.pose.position;
        assert!((position.length() - 2.5).abs() < 1e-6 && position.z > -0.5 - 1e-6, "{position}");
        assert!(camera.pose.forward().dot(-position.normalize()) > 0.999, "{position}");
    }
    place.done(&format!("plan ball.ply --views 6 --out again {run} {shell}"));
    assert_eq!(place.read("again/transforms.json"), place.read("o/transforms.json"));
    // With existing views, no initial four are taken.
    place.done(&format!("plan ball.ply --views 2 --out more --keep o {run} {shell}"));
    let more = cameras(&place, "more");
    assert_eq!(more.len(), 8);
    assert!(more[..2].iter().all(|new| more[2..].iter().all(|old| new.pose != old.pose)));
    let cases: [(String, &[&str]); 3] = [
        (
            format!("plan ball.ply --views 6 --out r {run} --box -3,-3,-3,3,3,3"),
            &["--method manifold", "none in a room"],
        ),
        ("plan ball.ply --views 6 --out r --method manifold".into(), &["--method manifold needs trained splats"]),
        (format!("plan ball.ply --views 6 --out r {run} --candidates 50"), &["--method manifold", "--candidates"]),
    ];
    for (arguments, fragments) in &cases {
        assert_refused(&place, &[(arguments.as_str(), *fragments)]);
    }
}

/// If this failed, an option would be accepted and then ignored.
#[test]
fn options_that_do_not_fit_the_method_are_refused() {
    let place = Place::new();
    let plan = |options: &str| format!("plan ball.ply --out o --views 9 {options}");
    let cases: [(String, &[&str]); 14] = [
        (plan("--candidates 20"), &["--candidates", "--method"]),
        (plan("--method fvs --candidates 8"), &["--candidates is 8 for 9 views", "give 9 to"]),
        (plan("--method random --candidates 20"), &["--method random", "leave --candidates out"]),
        (plan("--method fvs --iterations 20"), &["--method fvs", "--seed, --gate, --viewers and --held-out only"]),
        (plan("--method acp --dry-run"), &["--method acp", "--dry-run"]),
        (plan("--method fvs --nodes 9"), &["--nodes", "--method acp"]),
        (plan("--method fvs-shared --candidates 5000"), &["--method fvs-shared", "up to 4000", "use fvs"]),
        (plan("--method greedy --candidates 20001"), &["--method greedy", "up to 20000", "take fewer"]),
        (plan("--method fibonacci --box -3,-3,-3,3,3,3"), &["fibonacci", "use random"]),
        (plan("--method acp --nodes 0"), &["--nodes"]),
        (plan("--method fvs --renders 4"), &["--renders", "--method manifold"]),
        (plan("--method manifold --renders 1 --model m.ply"), &["--renders"]),
        (plan("--method fisherrf-retrain"), &["--method fisherrf-retrain", "camsplat evaluate", "camsplat select"]),
        (plan("--method acp --nodes 64 --candidates 3000"), &["--method acp", "3000 views", "give fewer"]),
    ];
    for (arguments, fragments) in &cases {
        assert_refused(&place, &[(arguments.as_str(), *fragments)]);
    }
}

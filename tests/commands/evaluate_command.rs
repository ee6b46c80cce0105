//! `camsplat evaluate`: from a scene to tables, how it resumes after a stop, and what it refuses.

use std::fs;

use crate::support::browser::{acting, number_after, rendered, write_to};
use crate::support::command::gltf::lit_cube;
use crate::support::command::{Place, assert_refused, ended, read_until, stop};
use crate::support::data::data_folder;
use crate::support::lpips_weights;
use serde_json::Value;

/// An evaluation of seconds.
pub const TINY: &str = "evaluate cube.gltf --env sky.hdr --quick --methods random,ours --budgets 4 --seeds 1 --size 48 --spp 2 \
                    --inputs 8 --tests 2 --iterations 20 --max-splats 200";

/// The same by these methods on the scene's own mesh, without making one of the input photos: where it does not matter
/// what they choose on.
pub fn on_the_mesh(methods: &str) -> String {
    format!("{} --surface true", TINY.replace("random,ours", methods))
}

pub fn results(place: &Place, folder: &str) -> Value {
    serde_json::from_str(&place.read(&format!("{folder}/results.json"))).unwrap()
}

/// Method and qualities of every run.
pub fn qualities(results: &Value) -> Vec<(&Value, &Value)> {
    results["runs"].as_array().unwrap().iter().map(|run| (&run["method"], &run["quality"])).collect()
}

/// The page shows the object with the cameras of each method, and the pictures beside it.
fn layouts_are_seen(place: &Place) {
    let script = r#"
        const form = document.querySelector("form"), canvas = document.querySelector("canvas"), before = pixels(canvas);
        const body = document.body.dataset;
        body.layouts = [...form.layout.options].map((option) => option.textContent).join();
        body.cameras = form.camera.options.length;
        body.pictures = [...document.images].filter((image) => image.naturalWidth === 48).length;
        form.layout.value = 1;
        form.layout.dispatchEvent(new Event("change"));
        setTimeout(() => { body.changed = pixels(canvas) !== before; }, 50);"#;
    let page = acting(&place.read("whole/report.html"), script);
    let Some(dom) = rendered(&write_to(place.path("whole/acted.html"), &page), &[]) else { return };
    let drawn = number_after(&dom, "<canvas", "data-drawn").expect("the 3D view counts its pixels");
    assert!(drawn > 10_000, "only {drawn} pixels are not background");
    // Of each of the three sets of tests the photograph and what two methods make of it.
    let expected =
        [r#"data-ready="ok""#, r#"data-layouts="random,ours""#, r#"data-cameras="5""#, r#"data-pictures="9""#];
    for part in expected.into_iter().chain([r#"data-changed="true""#]) {
        assert!(dom.contains(part), "{part} is not in {:?}", dom.split("<body").nth(1).map(|body| &body[..400]));
    }
}

/// If this failed, a run that was stopped would be lost or end with other numbers than one spread over two workers, one that is complete would be made again, or
/// a method more would make all the others run again.
#[test]
fn a_stopped_evaluation_goes_on_and_a_complete_one_makes_nothing() {
    let place = lit_cube();
    let mut child = place.command(&format!("{TINY} --out o")).spawn().unwrap();
    let output = read_until(&mut child, "making   training");
    let stopped = stop(child, output, "-INT");
    assert_eq!(stopped.code, Some(130), "{}{}", stopped.out, stopped.err);
    assert!(stopped.out.contains("the same command goes on"), "{}", stopped.out);
    assert!(!place.path("o/table.md").exists());

    // What is complete by the next stop is in the tables.
    let mut child = place.command(&format!("{TINY} --out o")).spawn().unwrap();
    let output = read_until(&mut child, "complete cube, random");
    let stopped = stop(child, output, "-INT");
    assert_eq!(stopped.code, Some(130), "{}{}", stopped.out, stopped.err);
    let table = place.read("o/table.md");
    assert!(table.contains("runs still to come: 1.") && table.contains("| cube | random | 4 |"), "{table}");
    assert!(!table.contains("| ours |") && place.read("o/report.html").contains("runs still to come: 1."), "{table}");

    let went_on = place.done(&format!("{TINY} --out o"));
    // Inputs, surface, tests; choice, photographs and training of the first method: nothing of that is made again.
    let (before, after) = went_on.out.split_once("complete cube, random").unwrap();
    assert!(!before.contains("making") && after.contains("complete cube, ours, 4 views, seed 0"), "{}", went_on.out);
    let made: Vec<&str> = after.lines().filter(|line| line.starts_with("making")).collect();
    assert!(
        made.len() == 3 && made.iter().all(|line| line.contains(" for cube, ours, 4 views, seed 0, after")),
        "{made:?}"
    );
    let whole = place.done(&format!("{TINY} --devices 0,0 --out whole"));
    assert_eq!(whole.out.matches(" for all runs of cube, after").count(), 3, "{}", whole.out);
    assert_eq!(qualities(&results(&place, "o")), qualities(&results(&place, "whole")));
    let table = place.read("o/table.md");
    assert!(table.contains("| cube | random | 4 |") && table.contains("| cube | ours | 4 |"), "{table}");
    assert!(!table.contains("still to come"), "{table}");
    assert!(place.read("o/table.csv").contains("\"cube\",ours,4,1,full,PSNR,"));
    layouts_are_seen(&place);
    for run in results(&place, "o")["runs"].as_array().unwrap() {
        let (folder, psnr) = (run["folder"].as_str().unwrap(), &run["quality"][1]["psnr"]);
        assert!(psnr.as_f64().is_some_and(|psnr| psnr > 10.0 && psnr < 60.0), "{psnr}");
        assert!(place.path(&format!("o/cube/{folder}/test/random_0001.png")).is_file());
    }

    let changed = |folder: &str| -> Vec<_> {
        let when = |name: &String| fs::metadata(place.path(&format!("o/{folder}/{name}"))).unwrap().modified().unwrap();
        place.files(&format!("o/{folder}")).iter().map(when).collect()
    };
    let before = changed("cube");
    let again = place.done(&format!("{TINY} --out o"));
    assert!(again.out.contains("results  0 made, 9 reused"), "{}", again.out);
    assert_eq!(changed("cube"), before);
    let three = format!("{} --out o", TINY.replace("random,ours", "random,fvs,ours"));
    let more = place.done(&three);
    assert!(more.out.contains("results  3 made, 9 reused"), "{}", more.out);

    // A picture that the page shows is missed.
    let training = results(&place, "o")["runs"][0]["folder"].as_str().unwrap().to_owned();
    let picture = place.path(&format!("o/cube/{training}/reference/full_0000.png"));
    let bytes = fs::read(&picture).unwrap();
    fs::remove_file(&picture).unwrap();
    let lost = place.run(&three);
    assert_eq!(lost.code, Some(2), "{}{}", lost.out, lost.err);
    assert!(lost.err.contains(&training) && lost.err.contains("missing: reference/full_0000.png"), "{}", lost.err);
    fs::write(&picture, bytes).unwrap();

    // A lost input photograph is reported with a remedy, and nothing is made from the others.
    let inputs = place.files("o/cube").into_iter().find(|name| name.ends_with("images/input_0000.png")).unwrap();
    fs::remove_file(place.path(&format!("o/cube/{inputs}"))).unwrap();
    let inputs = inputs.split('/').next().unwrap();
    for name in place.folders("o/cube").iter().filter(|name| name.starts_with("surface-")) {
        fs::remove_dir_all(place.path(&format!("o/cube/{name}"))).unwrap();
    }
    let damaged = place.run(&three);
    assert_eq!(damaged.code, Some(2), "{}{}", damaged.out, damaged.err);
    let reported = [inputs, "input_0000.png", "remove the folder"].iter().all(|part| damaged.err.contains(part));
    assert!(reported && damaged.err.lines().count() == 1, "{}", damaged.err);
    fs::remove_dir_all(place.path(&format!("o/cube/{inputs}"))).unwrap();
    place.done(&three);
    let made_again = results(&place, "o");
    let two: Vec<_> = qualities(&made_again).into_iter().filter(|(method, _)| **method != "fvs").collect();
    assert_eq!(two, qualities(&results(&place, "whole")));
}

/// If this failed, what trains while it chooses would have no photographs to train on, take them again after a stop, not record
/// how long it trained, or train otherwise than all others.
#[test]
fn a_method_that_trains_while_it_chooses_photographs_its_choices() {
    let place = lit_cube();
    let run = TINY.replace("random,ours --budgets 4", "fisherrf-retrain --antialiased --budgets 6");
    place.done(&format!("{run} --out o"));
    let folders = place.folders("o/cube");
    let choice = folders.iter().find(|name| name.starts_with("choice-")).unwrap();
    let photos = place.folders(&format!("o/cube/{choice}"));
    assert_eq!(photos.len(), 5, "{photos:?}");
    assert!(photos.iter().all(|name| place.path(&format!("o/cube/{choice}/{name}/images")).is_dir()), "{photos:?}");
    let plan: Value = serde_json::from_str(&place.read(&format!("o/cube/{choice}/plan.json"))).unwrap();
    let retraining = &plan["config"]["retraining"];
    assert_eq!((&retraining["every"], &retraining["max_splats"]), (&1.into(), &40.into()), "{retraining}");
    assert_eq!(retraining["antialiased"], true);
    let again = place.done(&format!("{run} --out o"));
    assert!(again.out.contains("results  0 made, 6 reused"), "{}", again.out);
}

/// If this failed, some of the splats that are compared, or that methods choose by, would be trained without the filter, the
/// table would not record it, or what has nothing to do with training would be made again.
#[test]
fn the_filter_against_aliasing_is_of_all_training_and_of_nothing_else() {
    let place = lit_cube();
    let run = TINY.replace("random,ours --budgets 4", "cover,ours --budgets 6");
    place.done(&format!("{} --out o", run.replace("cover,", "")));
    let plain = place.folders("o/cube");
    assert!(!place.read("o/table.md").contains("--antialiased"));
    place.done(&format!("{run} --antialiased --out o"));
    let made: Vec<String> = place.folders("o/cube").into_iter().filter(|name| !plain.contains(name)).collect();
    assert!(place.read("o/table.md").contains("20 iterations of training with the filter against aliasing"));
    let read = |file: String| -> Value { serde_json::from_str(&place.read(&file)).unwrap() };
    let trained: Vec<&String> = made.iter().filter(|name| name.starts_with("training-")).collect();
    // The model that COVER chooses by and one of each method.
    assert_eq!(trained.len(), 3, "{made:?}");
    for name in trained {
        assert_eq!(read(format!("o/cube/{name}/train.json"))["config"]["antialiased"], true, "{name}");
    }
    // A plan needs no model.
    let choices: Vec<&String> = made.iter().filter(|name| name.starts_with("choice-")).collect();
    assert_eq!(choices.len(), 1, "{made:?}");
    assert_eq!(read(format!("o/cube/{}/plan.json", choices[0]))["method"], "cover");
    assert!(!made.iter().any(|name| name.starts_with("surface-")), "{made:?}");
}

/// If this failed, an evaluation could not be made in parts on several machines: a seed would be left out or made twice, or would
/// come out otherwise there.
#[test]
fn seeds_that_were_made_apart_are_put_together() {
    let place = lit_cube();
    let run = on_the_mesh("random");
    place.done(&format!("{run} --out here"));
    let there = place.done(&format!("{run} --first-seed 1 --out there"));
    assert!(there.out.contains("complete cube, random, 4 views, seed 1"), "{}", there.out);
    assert!(place.read("there/table.md").contains(", seed 1. Mean"), "{}", place.read("there/table.md"));
    let both = run.replace("--seeds 1", "--seeds 2");
    place.done(&format!("{both} --out both"));
    for folder in place.folders("there/cube") {
        if !place.folders("here/cube").contains(&folder) {
            fs::rename(place.path(&format!("there/cube/{folder}")), place.path(&format!("here/cube/{folder}")))
                .unwrap();
        }
    }
    let put = place.done(&format!("{both} --out here"));
    // Inputs, surface, tests; choice, photographs and training of each.
    assert!(put.out.contains("results  0 made, 9 reused"), "{}", put.out);
    let seeds: Vec<_> =
        results(&place, "here")["runs"].as_array().unwrap().iter().map(|run| run["seed"].as_u64()).collect();
    assert_eq!(seeds, [Some(0), Some(1)]);
    assert_eq!(qualities(&results(&place, "here")), qualities(&results(&place, "both")));
}

/// If this failed, machines that share a folder would refuse or overwrite each other's, one that was killed would lose the others' work, or
/// what they made together would not be what one makes alone.
#[test]
fn shards_are_put_together() {
    let place = lit_cube();
    let run = on_the_mesh("random,ours").replace("--seeds 1", "--seeds 2");
    place.done(&format!("{run} --out alone"));
    // Two begin in one new folder at once, and the third is killed elsewhere.
    let begin = |shard: &str, out: &str| place.command(&format!("{run} --shard {shard} --out {out}")).spawn().unwrap();
    let [first, second] = ["1/3", "2/3"].map(|shard| begin(shard, "shared"));
    for child in [first, second] {
        let ran = ended(child.wait_with_output().unwrap());
        assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""), "{}", ran.out);
        assert!(ran.out.contains("the same command without --shard writes the tables"), "{}", ran.out);
    }
    assert!(!place.path("shared/table.md").exists() && !place.path("shared/report.html").exists());
    let mut third = begin("3/3", "elsewhere");
    let output = read_until(&mut third, "making   training");
    stop(third, output, "-KILL");
    for folder in place.folders("elsewhere/cube") {
        if !place.folders("shared/cube").contains(&folder) {
            let [from, to] = ["elsewhere", "shared"].map(|of| place.path(&format!("{of}/cube/{folder}")));
            fs::rename(from, to).unwrap();
        }
    }
    // Only what the killed one had not finished is made: a training, and choice, photos and training of the last run.
    let put = place.done(&format!("{run} --out shared"));
    let made = put.out.lines().filter(|line| line.starts_with("making")).count();
    assert!((1..=4).contains(&made) && put.out.contains("making   training"), "{}", put.out);
    assert_eq!(qualities(&results(&place, "shared")), qualities(&results(&place, "alone")));
    let again = place.done(&format!("{run} --shard 2/3 --out shared"));
    assert!(again.out.contains("results  0 made") && place.path("shared/table.md").exists(), "{}", again.out);
    assert_refused(
        &place,
        &[
            (&format!("{run} --shard 4/3 --out o"), &["--shard", "such as 2/8"]),
            (
                &format!("{} --shard 2/3 --out shared", run.replace("--seeds 2", "--seeds 3")),
                &["shared/evaluation.json", "another --out"],
            ),
        ],
    );
}

/// If this failed, LPIPS of VGG16 would be listed beside other views than its own, training would be done again for it, or it
/// would be in tables without being requested.
#[test]
fn lpips_of_vgg_is_measured_of_what_is_trained() {
    let place = lit_cube();
    // The network is slow on two cores.
    let tiny = TINY.replace("random,ours", "ours").replace("--size 48", "--size 32").replace("--tests 2", "--tests 1");
    place.done(&format!("{tiny} --out o"));
    place.write("vgg.safetensors", lpips_weights::vgg());
    let added = place.done(&format!("{tiny} --out o --lpips-vgg vgg.safetensors"));
    assert!(added.out.contains("results  1 made, 6 reused"), "{}", added.out);
    assert!(place.read("o/table.md").contains("## LPIPS of VGG16 (lower is better)"));
    let results = results(&place, "o");
    let (run, weights) = (&results["runs"][0], &results["lpips_vgg"]);
    assert!(weights.is_u64(), "{weights}");
    let [rendered, reference] =
        ["test", "reference"].map(|of| format!("o/cube/{}/{of}", run["folder"].as_str().unwrap()));
    place.done(&format!("metrics {rendered} {reference} --lpips vgg --lpips-vgg vgg.safetensors --json m.json"));
    let metrics: Value = serde_json::from_str(&place.read("m.json")).unwrap();
    let pairs = metrics["pairs"].as_array().unwrap();
    for (set, quality) in ["half", "full", "random"].iter().zip(run["quality"].as_array().unwrap()) {
        let pair = pairs.iter().find(|pair| pair["name"].as_str().unwrap().starts_with(set)).unwrap();
        let [mine, theirs] = [&quality["lpips_vgg"], &pair["lpips_vgg"]].map(|distance| distance.as_f64().unwrap());
        assert!((mine - theirs).abs() < 1e-9 && mine > 1e-3, "{set}: {mine}, not {theirs}");
    }

    let again = place.done(&format!("{tiny} --out o --lpips-vgg vgg.safetensors"));
    assert!(again.out.contains("results  0 made, 7 reused"), "{}", again.out);
    let folder = place.folders("o/cube").into_iter().find(|name| name.starts_with("lpips-")).unwrap();
    place.write(&format!("o/cube/{folder}/lpips.json"), "{}");
    let damaged = place.run(&format!("{tiny} --out o --lpips-vgg vgg.safetensors"));
    assert_eq!(damaged.code, Some(2), "{}{}", damaged.out, damaged.err);
    assert!(damaged.err.contains(&folder) && damaged.err.contains("remove the folder"), "{}", damaged.err);

    // What is no longer requested is dropped from the next tables.
    place.done(&format!("{} --out o", tiny.replace("ours", "ours,fvs")));
    assert!(!place.read("o/table.md").contains("VGG16") && !place.read("o/report.html").contains("VGG16"));
}

/// If this failed, input photos would be taken from all around whatever the request, or the table would not record from where.
#[test]
fn inputs_can_be_taken_from_one_side() {
    let place = lit_cube();
    place.done(&format!("{} --inputs-from biased --out o", TINY.replace("random,ours", "random")));
    assert!(place.read("o/table.md").contains("8 input photos from one side"), "{}", place.read("o/table.md"));
    let inputs = place.files("o/cube").into_iter().find(|name| name.ends_with("images/input_0000.png")).unwrap();
    let cameras = format!("o/cube/{}/transforms.json", inputs.split('/').next().unwrap());
    let cameras: Value = serde_json::from_str(&place.read(&cameras)).unwrap();
    let places = cameras["frames"]
        .as_array()
        .unwrap()
        .iter()
        .map(|frame| [0, 1, 2].map(|axis| frame["transform_matrix"][axis][3].as_f64().unwrap()));
    let places: Vec<[f64; 3]> = places.collect();
    let far = places.iter().map(|place| place.iter().map(|x| x * x).sum::<f64>().sqrt()).sum::<f64>();
    let sum = [0, 1, 2].map(|axis| places.iter().map(|place| place[axis]).sum::<f64>());
    let sum = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
    assert!(places.len() == 8 && sum > 0.55 * far, "{places:?}");
}

/// If this failed, manifold sampling would have no model in an evaluation, or not record how far its cameras went.
#[test]
fn manifold_sampling_takes_steps_in_proportion() {
    let place = lit_cube();
    let run = TINY.replace("random,ours --budgets 4", "manifold --budgets 5");
    place.done(&format!("{run} --out o"));
    let choice = place.folders("o/cube").into_iter().find(|name| name.starts_with("choice-")).unwrap();
    let plan: Value = serde_json::from_str(&place.read(&format!("o/cube/{choice}/plan.json"))).unwrap();
    assert_eq!((&plan["method"], &plan["config"]["manifold"]["steps"]), (&"manifold".into(), &1.into()));
    assert!(place.read("o/table.md").contains("| cube | manifold | 5 |"));
}

/// If this failed, bad input would be detected after hours, or leave something behind.
#[test]
fn bad_input_is_refused_and_nothing_is_written() {
    let place = lit_cube();
    place.write("broken.glb", "no scene");
    fs::create_dir_all(place.path("other")).unwrap();
    place.write("other/cube.gltf", place.read("cube.gltf"));
    place.write("table.md.gltf", place.read("cube.gltf"));
    let alex = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/lpips/alex_f16.safetensors");
    fs::copy(alex, place.path("alex.safetensors")).unwrap();
    place.write("vgg.safetensors", lpips_weights::vgg());
    let cases: [(&str, &[&str]); 20] = [
        ("evaluate cube.gltf --env sky.hdr --out o --methods random,nobodys", &["nobodys", "no such method", "ours"]),
        ("evaluate cube.gltf broken.glb --env sky.hdr --out o", &["broken.glb"]),
        ("evaluate none.glb --env sky.hdr --out o", &["none.glb", "there is no such file"]),
        ("evaluate cube.gltf --preset room --out o", &["cube.gltf", "no light", "--env"]),
        ("evaluate cube.gltf --env sky.hdr --out o --budgets 20,20", &["--budgets", "twice"]),
        ("evaluate cube.gltf --env sky.hdr --out o --budgets 1", &["--budgets is 1"]),
        ("evaluate cube.gltf --env sky.hdr --out o --seeds 0", &["--seeds is 0"]),
        ("evaluate cube.gltf --env sky.hdr --out o --first-seed 1000001", &["--first-seed is 1000001"]),
        ("evaluate cube.gltf --env sky.hdr --out o --test-spp 0", &["--test-spp is 0"]),
        ("evaluate cube.gltf other/cube.gltf --env sky.hdr --out o", &["other/cube.gltf", "this name"]),
        ("evaluate cube.gltf --env sky.hdr --out other", &["other", "holds no evaluation"]),
        ("evaluate table.md.gltf --env sky.hdr --out o", &["table.md.gltf", "rename"]),
        (
            "evaluate cube.gltf --env sky.hdr --out o --methods ours:seed=3",
            &["ours:seed=3", "seed is the evaluation's"],
        ),
        (
            "evaluate cube.gltf --env sky.hdr --out o --methods ours:lambda_bound=-1",
            &["method ours:lambda_bound=-1: ", "is -1"],
        ),
        ("evaluate cube.gltf --env sky.hdr --out o --lpips-vgg none", &["none: ", "there is no such file"]),
        (
            "evaluate cube.gltf --env sky.hdr --out o --lpips-vgg alex.safetensors",
            &["alex.safetensors: ", "weights of VGG16"],
        ),
        (
            // Its largest layer is larger than any buffer.
            "evaluate cube.gltf --env sky.hdr --out o --size 4096 --lpips-vgg vgg.safetensors",
            &["VGG16 of 4096 x 4096", "leave out --lpips-vgg"],
        ),
        ("evaluate cube.gltf --env sky.hdr --out o --devices 0,,0", &["--devices", "an empty name"]),
        (
            "evaluate cube.gltf --env sky.hdr --out o --preset room --inputs-from random --methods random",
            &["--inputs-from", "objects"],
        ),
        (
            "evaluate cube.gltf --env sky.hdr --out o --preset room --baselines-from sphere --methods random",
            &["--baselines-from sphere", "objects"],
        ),
    ];
    assert_refused(&place, &cases);
    assert_eq!(place.files("other"), ["cube.gltf"]);
}

/// If this failed, an hour's table of many runs would be replaced by one of fewer, without a word.
#[test]
fn fewer_runs_never_replace_a_larger_table() {
    let place = lit_cube();
    let run = |methods: &str, more: &str| format!("{} {more} --out o", on_the_mesh(methods));
    place.done(&run("random,fvs", "").replace("--seeds 1", "--seeds 2"));
    let before = place.read("o/table.md");
    assert_refused(
        &place,
        &[
            (&run("random,fvs", ""), &["o/results.json", "cube, random, 4 views, seed 1 and 1 more", "another --out"]),
            (&run("random", "").replace("--seeds 1", "--seeds 2"), &["cube, fvs, 4 views, seed 0 and 1 more"]),
        ],
    );
    assert_eq!(place.read("o/table.md"), before);
    // Nor does a part of a larger evaluation, where that is stopped.
    let larger = run("random,ours,fvs", "").replace("--seeds 1", "--seeds 2");
    let mut child = place.command(&larger).spawn().unwrap();
    let output = read_until(&mut child, "complete cube, ours");
    let stopped = stop(child, output, "-INT");
    assert_eq!((stopped.code, place.read("o/table.md")), (Some(130), before), "{}", stopped.err);
    // What is made otherwise is another evaluation, and more runs keep what there is.
    place.done(&run("random,fvs,ours", "").replace("--seeds 1", "--seeds 2"));
    assert_eq!(place.read("o/table.md").matches("| cube | fvs | 4 |").count(), 3);
    place.done(&run("random", "--antialiased"));
}

/// If this failed, an object without lamps would be photographed in the dark, where every method looks good.
#[test]
fn an_object_without_a_lamp_stands_in_a_studio() {
    let place = lit_cube();
    // A display that glows is no lamp.
    let glowing = place.read("cube.gltf").replace(r#"{"pbrM"#, r#"{"emissiveFactor": [0.02, 0, 0], "pbrM"#);
    place.write("cube.gltf", glowing);
    let run = TINY.replace("random,ours", "random").replace(" --env sky.hdr", "");
    let ran = place.done(&format!("{run} --out o"));
    assert!(ran.out.contains("cube.gltf: no lamps and no --env: the built-in studio lights it"), "{}", ran.out);
    let table = place.read("o/table.md");
    assert!(table.contains("No lamps and no `--env`: a built-in studio lights cube."), "{table}");
    let photos = place.files("o/cube").into_iter().find(|name| name.ends_with("images/input_0000.png")).unwrap();
    let photo = image::open(place.path(&format!("o/cube/{photos}"))).unwrap().into_rgba8();
    let shown: Vec<u8> = photo.pixels().filter(|pixel| pixel[3] == 255).map(|pixel| pixel[0]).collect();
    let mean = shown.iter().map(|red| f64::from(*red)).sum::<f64>() / shown.len() as f64;
    assert!(!shown.is_empty() && mean > 60.0, "{mean} of {} pixels", shown.len());
    place.done(&format!("{} --out lit", on_the_mesh("random")));
    assert!(!place.read("lit/table.md").contains("studio"));
}

/// If this failed, the quick evaluation would be meaningless: a plan must be worth more than views at random even there.
#[test]
#[ignore = "takes minutes"]
fn the_quick_evaluation_ranks_random_below_ours() {
    let data = data_folder();
    let place = Place::new();
    let [scene, sky] = ["objects/DamagedHelmet.glb", "hdri/studio_small_03_1k.hdr"].map(|file| data.join(file));
    let mut command = place.command("evaluate --quick --out o --methods random,ours");
    let ran = ended(command.arg(scene).arg("--env").arg(sky).output().unwrap());
    assert_eq!(ran.code, Some(0), "{}", ran.err);
    let results = results(&place, "o");
    let [random, ours] = [0, 1].map(|row| results["rows"][row]["measured"][0][3]["mean"].as_f64().unwrap());
    assert!(random < ours, "random {random} dB, ours {ours} dB");
}

//! `camsplat train` stopped, killed, resumed and short of disk: no work is lost and no bit is another.
#![cfg(unix)]

use std::fs;
use std::io::Read;
use std::process::{Child, Command};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use crate::support::command::{Place, assert_refused, ended, read_until, stop};
use crate::support::splats::capture;
use camsplat::files::io;
use camsplat::scene::random;
use camsplat::splats::run::checkpoint::{self, Checkpoint};
use camsplat::splats::run::record::{Status, TrainRecord};
use glam::DVec3;

/// Options of the runs; each refines on the way.
const SMALL: &str = "--max-splats 200 --sh 1 --iterations 40 --evaluate-every 5";
/// Iterations between checkpoints.
const SAVE: u32 = 10;

/// A folder with a capture of nine photos in it.
fn place() -> Place {
    let place = Place::new();
    capture::write(&place.path("capture"), 9, 48);
    place
}

fn record(place: &Place, folder: &str) -> TrainRecord {
    serde_json::from_str(&place.read(&format!("{folder}/train.json"))).unwrap()
}

fn saved(place: &Place, folder: &str) -> Checkpoint {
    checkpoint::read(&place.path(folder).join("checkpoint.bin")).unwrap()
}

fn model(place: &Place, folder: &str) -> Vec<u8> {
    fs::read(place.path(folder).join("point_cloud.ply")).unwrap()
}

/// Every file of a folder with what is in it.
fn contents(place: &Place, folder: &str) -> Vec<(String, Vec<u8>)> {
    let of = |name: String| (name.clone(), fs::read(place.path(folder).join(name)).unwrap());
    place.files(folder).into_iter().map(of).collect()
}

/// What a killed run leaves must be whole, file by file, or hidden.
fn assert_whole(place: &Place, folder: &str) {
    for name in place.files(folder) {
        let path = place.path(folder).join(&name);
        let hidden = path.file_name().unwrap().to_string_lossy().strip_prefix('.').map(str::to_owned);
        match (hidden, name.as_str()) {
            (Some(hidden), _) => assert!(hidden.ends_with(".part"), "{name} would pile up"),
            (_, "checkpoint.bin") => drop(saved(place, folder)),
            (_, "train.json") => drop(record(place, folder)),
            (_, "point_cloud.ply") => drop(io::read_gaussians_with_notes(&path).unwrap()),
            (_, "report.html") => assert!(fs::read_to_string(&path).unwrap().trim_end().ends_with("</html>")),
            _ => drop(image::open(&path).unwrap()),
        }
    }
}

/// Kills a run after so long, unless it has ended.
fn kill_after(mut child: Child, delay: Duration) {
    let (mut output, (ended, end)) = (child.stdout.take().unwrap(), mpsc::channel());
    // The output ends with the run.
    let reader = std::thread::spawn(move || {
        output.read_to_end(&mut Vec::new()).unwrap();
        ended.send(())
    });
    let _ = end.recv_timeout(delay);
    kill(child);
    let _ = reader.join();
}

fn kill(mut child: Child) {
    child.kill().unwrap();
    let mut err = String::new();
    child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
    assert_eq!(err, "");
    child.wait().unwrap();
}

/// If this failed, a power cut would cost hours of training, leave half a file under a product's name, or end in another model
/// than the seed's.
#[test]
fn a_run_that_is_killed_again_and_again_ends_as_if_it_had_not_been() {
    let place = place();
    let run = format!("train capture {SMALL} --test-every 4 --save-every {SAVE}");
    let begun = Instant::now();
    place.done(&format!("{run} --out whole"));
    let took = begun.elapsed();

    let mut child = place.command(&format!("{run} --out o")).spawn().unwrap();
    while !place.path("o/checkpoint.bin").exists() && child.try_wait().unwrap().is_none() {
        std::thread::yield_now();
    }
    kill(child);
    // As a run leaves it that is killed while it writes, should this one not have been.
    place.write("o/.checkpoint.bin.part", "half");
    for i in 0..4 {
        assert_whole(&place, "o");
        let (told, kept) = (record(&place, "o").iterations, saved(&place, "o").header.done);
        assert!(kept >= SAVE && told <= kept + SAVE, "{told} iterations were done and {kept} are kept");
        let child = place.command(&format!("{run} --out o --resume")).spawn().unwrap();
        kill_after(child, took.mul_f64(random::uniforms(5, 0, i)[0]));
    }
    assert_whole(&place, "o");
    // Outputs may have been on their way as well, and not all of them there.
    for name in ["train.json", "report.html", "point_cloud.ply", "test/000.png"] {
        fs::create_dir_all(place.path("o/test")).unwrap();
        let (folder, name) = name.rsplit_once('/').unwrap_or((".", name));
        place.write(&format!("o/{folder}/.{name}.part"), "half");
    }
    fs::remove_file(place.path("o/train.json")).unwrap();
    place.done(&format!("{run} --out o --resume"));
    assert_eq!(place.files("o"), place.files("whole"), "something hidden was left behind");
    assert!(model(&place, "o") == model(&place, "whole"), "the models differ");
    let [killed, whole] = ["o", "whole"].map(|folder| record(&place, folder));
    assert_eq!((killed.curve, killed.evaluations), (whole.curve, whole.evaluations));
    assert_eq!((killed.test_views, killed.status), (whole.test_views, Status::Complete));
}

/// If this failed, Ctrl-C would throw work away, pass half a model off as a whole one, or change the final result.
#[test]
fn a_stopped_run_can_be_resumed_to_the_bit() {
    let place = place();
    for (signal, strategy) in [("-INT", "mcmc"), ("-TERM", "adc")] {
        let run = format!("train capture {SMALL} --iterations 60 --save-every 0 --test-every 0 --strategy {strategy}");
        let run = run.replace("--iterations 40 ", "");
        place.done(&format!("{run} --out whole --force"));
        let mut child = place.command(&format!("{run} --out o --force")).spawn().unwrap();
        let output = read_until(&mut child, "running ");
        let ran = stop(child, output, signal);
        assert_eq!((ran.code, ran.err.as_str()), (Some(130), ""), "{}", ran.out);
        let stopped = record(&place, "o");
        let done = stopped.iterations;
        assert!((1..60).contains(&done), "{done} iterations");
        assert_eq!((stopped.status, saved(&place, "o").header.done), (Status::Interrupted, done));
        let (kept, _) = io::read_gaussians_with_notes(&place.path("o/point_cloud.ply")).unwrap();
        assert_eq!(kept.len(), stopped.splats as usize);
        assert!(ran.out.contains(&format!("stopped after {done} iterations; go on with --resume")), "{}", ran.out);
        let ran = place.done(&format!("{run} --out o --resume"));
        assert!(ran.out.contains(&format!("trained  {} iterations", 60 - done)), "{}", ran.out);
        assert!(model(&place, "o") == model(&place, "whole"), "{strategy}: the models differ after {done}");
        assert_eq!(record(&place, "o").curve, record(&place, "whole").curve);
    }
}

/// If this failed, there would be a moment at which Ctrl-C leaves an empty folder, or harms the run that was there.
#[test]
fn a_stop_before_training_writes_nothing() {
    let place = place();
    place.done(&format!("train capture {SMALL} --out o --test-every 0 --iterations 2").replace("--iterations 40 ", ""));
    let mut before = contents(&place, "o");
    for line in ["poses", "device ", "photos "] {
        for out in ["n", "o"] {
            let mut child = place.command(&format!("train capture {SMALL} --out {out} --force")).spawn().unwrap();
            let output = read_until(&mut child, line);
            let ran = stop(child, output, "-INT");
            // Before photos are decoded the signal itself ends the process, and there is no exit code.
            let late = ran.out.contains("model ");
            assert!(late || [None, Some(130)].contains(&ran.code), "{line}: {:?} {}", ran.code, ran.err);
            if late {
                // The signal was late: what there is by then is written.
                before = contents(&place, "o");
                place.path("n").exists().then(|| fs::remove_dir_all(place.path("n")).unwrap());
            }
            assert!(!place.path("n").exists(), "{line}: {}", ran.out);
            assert!(contents(&place, "o") == before, "{line}: {}", ran.out);
        }
    }
}

/// If this failed, a resumed run would continue with other options than it began with, and its model would be of unknown origin;
/// or a refusal would cost the checkpoint.
#[test]
fn resuming_as_another_run_is_refused_and_changes_nothing() {
    let place = place();
    capture::write(&place.path("fewer"), 8, 48);
    capture::write(&place.path("larger"), 9, 50);
    let run = "--out o --resume --test-every 0";
    place.done("train capture --out o --iterations 4 --max-splats 200 --test-every 0 --save-every 2");
    let before = contents(&place, "o");
    let usual = "--iterations 4 --max-splats 200";
    let cases: [(&str, &str, &[&str]); 14] = [
        ("capture", "--iterations 8 --max-splats 200", &["--iterations 4, not 8"]),
        ("capture", "--iterations 4 --max-splats 300", &["--max-splats 200, not 300"]),
        ("capture", &format!("{usual} --sh 1"), &["--sh 3, not 1"]),
        ("capture", &format!("{usual} --seed 7"), &["--seed 0, not 7"]),
        ("capture", &format!("{usual} --strategy adc"), &["--strategy mcmc, not adc"]),
        ("capture", &format!("{usual} --background white"), &["--background black, not white"]),
        ("capture", &format!("{usual} --antialiased"), &["--antialiased false, not true"]),
        ("capture", &format!("{usual} --suppress-floaters"), &["--suppress-floaters false, not true"]),
        ("capture", &format!("{usual} --init-scale 0.2"), &["--init-scale 1.0, not 0.2"]),
        ("capture", &format!("{usual} --shrink 2"), &["--shrink 1, not 2"]),
        ("fewer", usual, &["another capture", "photos: 9, not 8", "train anew (--force)"]),
        ("larger", usual, &["another capture", "cameras", "train anew (--force)"]),
        ("capture", &format!("{usual} --force"), &["cannot be used with"]),
        ("capture", &format!("{usual} --out none"), &["cannot be used multiple times"]),
    ];
    for (capture, options, fragments) in cases {
        assert_refused(&place, &[(&format!("train {capture} {run} {options}"), fragments)]);
        assert!(contents(&place, "o") == before, "{capture} {options}: something was changed");
    }
    place.done(&format!("train capture --out t {usual} --test fewer"));
    let tested = contents(&place, "t");
    let fragments = &["another capture", "tests: 8, not 9", "train anew (--force)"];
    assert_refused(&place, &[(&format!("train capture --out t --resume {usual} --test larger"), fragments)]);
    assert!(contents(&place, "t") == tested, "pictures of other tests came among those of the run");
    let none = format!("train capture --out none --resume {usual}");
    assert_refused(&place, &[(&none, &["none/checkpoint.bin: ", "no checkpoint", "without --resume"])]);

    // A run that is complete stays as it is, with its times.
    let ran = place.done(&format!("train capture {run} {usual}"));
    assert!(ran.out.contains("complete 4 iterations were trained already"), "{}", ran.out);
    assert!(contents(&place, "o") == before, "a complete run was changed");
    // One whose model was damaged since has it again.
    let (_, model) = before.iter().find(|(name, _)| name.ends_with("point_cloud.ply")).unwrap();
    place.write("o/point_cloud.ply", &model[..model.len() / 2]);
    place.done(&format!("train capture {run} {usual}"));
    assert!(fs::read(place.path("o/point_cloud.ply")).unwrap() == *model, "the model is another");
    before.iter().for_each(|(name, bytes)| place.write(&format!("o/{name}"), bytes));

    for (bytes, fragments) in [
        (before[0].1[..before[0].1.len() / 2].to_vec(), ["checkpoint is damaged", "--force"]),
        (b"a checkpoint".to_vec(), ["no checkpoint of camsplat", "--force"]),
        (Vec::new(), ["no checkpoint of camsplat", "--force"]),
    ] {
        fs::remove_file(place.path("o/train.json")).unwrap();
        place.write("o/checkpoint.bin", bytes);
        let damaged = contents(&place, "o");
        let what = [&["o/checkpoint.bin: "], &fragments[..]].concat();
        assert_refused(&place, &[(&format!("train capture {run} {usual}"), &what)]);
        assert!(contents(&place, "o") == damaged, "{fragments:?}");
        place.write("o/train.json", &before.last().unwrap().1);
    }
}

/// If this failed, a disk that fills up would cost the checkpoint that was there, or the run. A limit on the size of files
/// simulates the full disk: the first checkpoint is below it, later ones, of more splats, are above.
#[test]
fn a_checkpoint_that_cannot_be_written_costs_nothing() {
    let place = place();
    let points: Vec<DVec3> = (0..1000)
        .map(|i| {
            let [x, y, z, _] = random::uniforms(6, 0, i);
            DVec3::new(x, y, z) - 0.5
        })
        .collect();
    place.write("capture/points.ply", io::ply::write::points(&points, &[[128; 3]; 1000], None));
    let options = "--max-splats 2000 --iterations 14 --save-every 6 --evaluate-every 0 --test-every 0";
    let camsplat = place.command(&format!("train capture --out o {options}"));
    let mut limited = Command::new("sh");
    // In blocks of 512 bytes. Writing more is an error, as on a full disk, once the signal is ignored. A splat takes 708.
    limited.args(["-c", "trap '' XFSZ; ulimit -f 1420; exec \"$0\" \"$@\""]);
    limited.arg(camsplat.get_program()).args(camsplat.get_args()).current_dir(place.path(""));
    let ran = ended(limited.output().unwrap());
    assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""), "{}", ran.out);
    let warnings = ran.out.lines().filter(|line| line.starts_with("warning: no checkpoint was written: ")).count();
    assert_eq!(warnings, 2, "{}", ran.out);
    let kept = saved(&place, "o").header;
    assert_eq!((kept.done, kept.population), (6, 1000));
    assert_eq!(place.files("o"), ["checkpoint.bin", "point_cloud.ply", "report.html", "train.json"]);
    let record = record(&place, "o");
    assert_eq!((record.status, record.splats), (Status::Complete, 1050));
}

//! `camsplat benchmark`.

use std::path::PathBuf;

use clap::{Args, Parser};

use super::evaluate;
use super::session::Ended;
use super::shell;
use crate::app::report;
use crate::files::io::folder::write_files;
use crate::lab::benchmark::board::{self, Table};
use crate::lab::benchmark::{BenchmarkScene, Split, scenes};
use crate::lab::evaluate::given::Given;
use crate::{Error, Result};

/// Arguments of `camsplat benchmark`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Folder of the scenes' files, `objects`, `rooms` and `hdri`; built-in scenes need none
    data: Option<PathBuf>,
    /// Folder for a folder of results for each scene, and for the board. A benchmark that was stopped continues there
    #[arg(long)]
    out: PathBuf,
    /// Scenes of this split [default: all; with --scenes, these]
    #[arg(long, value_enum, conflicts_with = "scenes")]
    split: Option<Split>,
    /// Some of the scenes, by name
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    scenes: Vec<String>,
    /// Methods, as of `camsplat evaluate`: NAME=cameras:FILE or NAME=lenses:FILE for one of your own, METHOD@DEGREES for another lens
    /// [default: random, fvs, acp, ours; quick: random, fvs, ours]
    #[arg(long, value_name = "NAMES")]
    methods: Option<String>,
    /// Numbers of views [default: 20,50,100,200,300; quick: 20; rooms 30]
    #[arg(long, value_name = "NUMBERS")]
    budgets: Option<String>,
    /// Runs of each method
    #[arg(long, default_value_t = 1)]
    seeds: u32,
    /// Small images and short training, to try it: results say nothing of methods
    #[arg(long)]
    quick: bool,
    /// Train 1,000,000 splats around objects and 2,000,000 in rooms for 30,000 iterations, in place of 300,000 and 500,000 for 10,000:
    /// three to six times as long
    #[arg(long, conflicts_with = "quick")]
    full: bool,
    /// Make what methods choose on and nothing else, for methods of other programs: files in OUT/SCENE/SCENE/task
    #[arg(long, conflicts_with_all = ["shard", "devices"])]
    prepare: bool,
    /// Device to use, as of `camsplat evaluate`
    #[arg(long, value_name = "NAME")]
    device: Option<String>,
    /// Devices to spread the runs of each scene over, as of `camsplat evaluate`
    #[arg(long, value_name = "NAMES", conflicts_with = "device")]
    devices: Option<String>,
    /// Make part I of N of each scene's runs; the board is written by the same command without this option
    #[arg(long, value_name = "I/N")]
    shard: Option<String>,
}

/// Settings of all scenes: photos are clean.
const SETTINGS: &str = "--surface true --light baked --size 512 --spp 64 --test-spp 256 --input-spp 64 --inputs 10";
/// What is compared without `--quick`, where nothing else is named.
const METHODS: &str = "random,fvs,acp,ours";
const BUDGETS: &str = "20,50,100,200,300";
/// With `--quick`.
const QUICK: &str = "--quick --surface true --light traced";

/// `camsplat evaluate` and its arguments.
#[derive(Parser)]
#[command(name = "camsplat evaluate")]
struct Evaluate {
    #[command(flatten)]
    arguments: evaluate::Arguments,
}

impl Arguments {
    /// The scenes that are run.
    fn chosen(&self, all: &[BenchmarkScene]) -> Result<Vec<BenchmarkScene>> {
        let unknown = self.scenes.iter().find(|name| all.iter().all(|scene| scene.name != **name));
        if let Some(name) = unknown {
            let names: Vec<&str> = all.iter().map(|scene| scene.name.as_str()).collect();
            return Err(Error::request(format!("--scenes: there is no {name:?}; there are {}", names.join(", "))));
        }
        let named = |scene: &&BenchmarkScene| self.scenes.is_empty() || self.scenes.contains(&scene.name);
        let of_split = |scene: &&BenchmarkScene| self.split.is_none_or(|split| scene.split == split);
        Ok(all.iter().filter(named).filter(of_split).cloned().collect())
    }

    /// What is the same for all objects, or for all rooms.
    fn settings(&self, room: bool) -> String {
        if self.quick {
            return QUICK.to_owned();
        }
        let tests = if room { 80 } else { 40 };
        let iterations = if self.full { 30_000 } else { 10_000 };
        let splats = match (room, self.full) {
            (false, false) => 300_000,
            (false, true) => 1_000_000,
            (true, false) => 500_000,
            (true, true) => 2_000_000,
        };
        format!("{SETTINGS} --tests {tests} --max-splats {splats} --iterations {iterations}")
    }

    /// What the board says of trainings that are not of the usual size.
    fn note(&self) -> Option<&'static str> {
        match (self.quick, self.full) {
            (true, _) => Some(report::board::QUICK),
            (_, true) => Some(report::board::FULL),
            _ => None,
        }
    }

    /// What `camsplat evaluate` is called with for a scene.
    fn words(&self, scene: &BenchmarkScene) -> Result<Vec<String>> {
        let file = |name: &String| match &self.data {
            Some(folder) => Ok(folder.join(name).to_string_lossy().into_owned()),
            None => {
                let what =
                    format!("{} is in {name} of the folder of data; name that, or leave the scene out", scene.name);
                Err(Error::request(what))
            }
        };
        let mut words: Vec<String> = Vec::new();
        if let Some(name) = &scene.file {
            words.push(file(name)?);
        }
        let mut option = |name: &str, value: Option<String>| {
            words.extend(value.map(|value| format!("--{name}={value}")));
        };
        option("situation", scene.situation.clone());
        option("env", scene.env.as_ref().map(file).transpose()?);
        let numbers = |numbers: &[f64]| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        option("box", scene.corners.map(|corners| numbers(&corners)));
        option("viewers", scene.heights.map(|heights| format!("heights:{}", numbers(&heights))));
        let usual = |text: &str| (!self.quick).then(|| text.to_owned());
        option("methods", self.methods.clone().or_else(|| usual(METHODS)));
        option("budgets", self.budgets.clone().or_else(|| usual(BUDGETS)));
        option("seeds", Some(self.seeds.to_string()));
        option("out", Some(self.out.join(&scene.name).to_string_lossy().into_owned()));
        option("device", self.device.clone());
        option("devices", self.devices.clone());
        option("shard", self.shard.clone());
        words.extend(self.settings(scene.is_room()).split(' ').map(str::to_owned));
        words.extend(self.prepare.then(|| "--prepare".to_owned()));
        Ok(words)
    }
}

/// Evaluates scene after scene, and writes the board.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let all = scenes()?;
    let chosen = arguments.chosen(&all)?;
    let methods = arguments.methods.as_deref().unwrap_or_default().split(',');
    let of_one = |name: &&str| matches!(Given::parse(name), Some(Ok(given)) if !given.of_each_scene());
    if let Some(same) = methods.filter(|_| chosen.len() > 1).find(of_one) {
        let what = format!(
            "--methods {same}: these cameras stand in one scene; put {{scene}} into the file's name, or name one scene"
        );
        return Err(Error::request(what));
    }
    let mut evaluations = Vec::new();
    // All are understood before the first takes hours.
    for scene in &chosen {
        let words = arguments.words(scene)?;
        let of_program = std::iter::once("camsplat evaluate".to_owned()).chain(words.iter().cloned());
        let parsed = Evaluate::try_parse_from(of_program).map_err(|e| {
            let text = e.to_string();
            Error::request(text.lines().next().unwrap_or_default().trim_start_matches("error: "))
        })?;
        parsed.arguments.checked()?;
        evaluations.push((scene, words, parsed.arguments));
    }
    for (scene, words, evaluation) in &evaluations {
        say!(
            "scene    {} ({}): camsplat evaluate {}",
            scene.name,
            scene.split,
            words.iter().map(|word| shell::quoted(word)).collect::<Vec<_>>().join(" ")
        );
        if evaluate::run(evaluation)? == Ended::Stopped {
            return Ok(Ended::Stopped);
        }
    }
    if arguments.shard.is_some() || arguments.prepare {
        return Ok(Ended::Done);
    }
    // Those of this call first, which others are held against.
    let others = all.iter().filter(|scene| !chosen.contains(scene));
    let (reached, notes) = board::read(&arguments.out, chosen.iter().chain(others))?;
    notes.iter().for_each(|note| say!("note     {note}"));
    let tables: Vec<Table> = board::tables(&reached);
    let [csv, page] = ["board.csv", "board.html"].map(|name| arguments.out.join(name));
    let (text, html) = (board::csv(&reached), report::board::html(&tables, arguments.note()));
    write_files(&[(&csv, text.as_bytes()), (&page, html.as_bytes())])?;
    say!("{}", board::markdown(&tables).trim_end());
    if let Some(note) = arguments.note() {
        say!("note     {note}");
    }
    say!("written  {}, {}", page.display(), csv.display());
    Ok(Ended::Done)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Parser)]
    struct Benchmark {
        #[command(flatten)]
        arguments: Arguments,
    }

    /// If this failed, results of full trainings would differ from those of usual ones by their photos or tests, or not by their size.
    #[test]
    fn full_trainings_differ_from_usual_ones_in_size_alone() {
        let words = |scene: &str, more: &[&str]| {
            let given = ["benchmark", "data", "--out", "o", "--scenes", scene].into_iter().chain(more.iter().copied());
            let arguments = Benchmark::try_parse_from(given).unwrap().arguments;
            let [scene] = &arguments.chosen(&scenes().unwrap()).unwrap()[..] else { panic!("one scene") };
            arguments.words(scene).unwrap()
        };
        for (scene, splats) in [("ToyCar", ["300000", "1000000"]), ("bare-room", ["500000", "2000000"])] {
            let (usual, full) = (words(scene, &[]), words(scene, &["--full"]));
            assert_eq!(usual.len(), full.len());
            let other: Vec<_> = usual.iter().zip(&full).filter(|(usual, full)| usual != full).collect();
            assert_eq!(other, [(&splats[0].to_owned(), &splats[1].to_owned()), (&"10000".into(), &"30000".into())]);
        }
    }
}

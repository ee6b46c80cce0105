//! `camsplat quality`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};

use super::options::{DeviceOptions, print_messages};
use super::overwrite_guard::check_output_file;
use super::session::Ended;
use crate::files::io::folder::{check_file, write_files};
use crate::lab::evaluate::layouts::Trained;
use crate::lab::quality_fit::{self, Agreement, Correlation};
use crate::planner::quality::law::{Coefficients, Fitted};
use crate::{Error, Result};

/// Arguments of `camsplat quality`.
#[derive(Args, Debug)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Fit the law of expected error to layouts of cameras that `camsplat evaluate` has trained
    Fit(FitArguments),
}

/// Arguments of `camsplat quality fit`.
#[derive(Args, Debug)]
struct FitArguments {
    /// The scenes that were evaluated: glTF or GLB
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Folders that `camsplat evaluate` has written; layouts are compared where region, situation, viewers and tests are the same
    #[arg(long, required = true, value_delimiter = ',', value_name = "FOLDER,...")]
    evaluations: Vec<PathBuf>,
    /// Scenes that the law is only compared with, by name
    #[arg(long, value_delimiter = ',', value_name = "NAME,...")]
    held_out: Vec<String>,
    /// JSON file to write: coefficients, their deviations and the spread of what they predict
    #[arg(long)]
    out: PathBuf,
    /// CSV file to write: every layout with its expected and its trained quality
    #[arg(long)]
    layouts: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceOptions,
}

/// Fits and writes.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let Command::Fit(arguments) = &arguments.command;
    let FitArguments { scenes, evaluations, held_out, out, layouts, device } = arguments;
    if layouts.as_ref() == Some(out) {
        return Err(Error::input(out, "both the law and the layouts would be written here; name two files"));
    }
    for file in std::iter::once(out).chain(layouts) {
        check_file(file)?;
        check_output_file(file, scenes.iter().chain(evaluations))?;
    }
    let stem = |scene: &PathBuf| scene.file_stem().map(std::ffi::OsStr::to_os_string);
    if let Some(scene) = (1..scenes.len()).find(|i| scenes[..*i].iter().any(|other| stem(other) == stem(&scenes[*i]))) {
        return Err(Error::input(
            &scenes[scene],
            "another scene has this name, and evaluations tell them by their names; leave one out",
        ));
    }
    if let Some(folder) = (1..evaluations.len()).find(|i| evaluations[..*i].contains(&evaluations[*i])) {
        return Err(Error::input(&evaluations[folder], "--evaluations names this folder twice; name it once"));
    }
    if layouts.is_none() && device.device.is_some() {
        return Err(Error::request("--device is for what --layouts writes; give both or neither"));
    }
    let named =
        |name: &&String| !scenes.iter().any(|scene| scene.file_stem().is_some_and(|stem| stem == name.as_str()));
    if let Some(name) = held_out.iter().find(named) {
        return Err(Error::request(format!("--held-out names {name}, which is none of the scenes")));
    }
    let context = layouts.as_ref().map(|_| device.open()).transpose()?;
    let mut trained = Vec::new();
    for scene in scenes {
        trained.extend(Trained::read(scene, evaluations)?);
    }
    let observed: Vec<_> = trained.iter().map(Trained::observations).collect();
    for (part, seen) in trained.iter().zip(&observed) {
        say!("layouts  {}, {}: {}", part.name, part.situation.name(), seen.layouts.len());
    }
    let fit = quality_fit::fit(&observed, held_out)?;
    let text = fit.law.text()?;
    let mut written: Vec<(&Path, String)> = vec![(out, text)];
    if let (Some(file), Some(context)) = (layouts, &context) {
        let mut csv = String::from("scene,situation,held_out,views,layout,expected_db,score_db,trained_psnr\n");
        for (runs, scene) in trained.into_iter().zip(&observed) {
            let held = u8::from(held_out.contains(&scene.name));
            let of_scene = scene.name.replace([',', '"', '\n'], ";");
            let expected = fit.expected(scene);
            let situation = runs.situation.name();
            let scored = runs.scored(context, &fit.law.coefficients.on_device())?;
            for ((layout, expected), scored) in scene.layouts.iter().zip(expected).zip(scored) {
                let (name, of, psnr) = (layout.name.replace([',', '"', '\n'], ";"), layout.views, layout.trained());
                // Writing to a string cannot fail.
                let _ = writeln!(csv, "{of_scene},{situation},{held},{of},{name},{expected:.3},{scored:.3},{psnr:.3}");
            }
        }
        print_messages(context);
        written.push((file, csv));
    }
    let files: Vec<(&Path, &[u8])> = written.iter().map(|(path, text)| (*path, text.as_bytes())).collect();
    write_files(&files)?;
    print_law(&fit.law, fit.alike_pairs);
    print_agreement("fitted", &fit.fitted);
    if let Some(held_out) = &fit.held_out {
        print_agreement("held out", held_out);
    }
    written.iter().for_each(|(path, _)| say!("wrote    {}", path.display()));
    Ok(Ended::Done)
}

fn print_law(fitted: &Fitted, pairs: usize) {
    let Fitted { coefficients, spread: [alike, per], deviation, layouts, scenes, .. } = fitted;
    let Coefficients { nearest, third, farther, most, background } = coefficients;
    let beside = if *background > 0.0 { format!(", weight beside objects {background:.4}") } else { String::new() };
    let ending = most.map_or("without an end".into(), |most| format!("ending at {most:.2}"));
    say!("law      z = {nearest:.3} g1 + {third:.3} g3 + {farther:.3} max(ln r, 0), {ending}{beside}");
    if let Some([a, b, c, weight, end]) = deviation {
        let of_end = most.map_or(String::new(), |_| format!(", of the end {end:.2}"));
        let of_weight =
            if *background > 0.0 { format!(", of the weight {:.0}%", 100.0 * weight) } else { String::new() };
        say!("sd       {a:.3}, {b:.3}, {c:.3}{of_end}{of_weight}");
    }
    let of = if fitted.borrowed { "the built-in law's, for want of such".into() } else { format!("{pairs} pairs") };
    say!(
        "spread   {alike:.2} dB of layouts that are expected to be alike ({of}), and {per:.2} for each decibel expected"
    );
    say!("of       {layouts} layouts of {} scenes", scenes.len());
}

fn print_agreement(which: &str, agreement: &Agreement) {
    let line = |correlation: &Correlation, of: &str| {
        let Correlation { groups, layouts, pearson, least, slope } = correlation;
        say!(
            "{which:<8} Pearson {pearson:.3} in the mean of {groups} {of} ({layouts} layouts), least {least:.2}; {slope:.2} dB trained for one expected"
        );
    };
    line(&agreement.whole, "scenes and situations");
    if let Some(of_budgets) = &agreement.of_budgets {
        line(of_budgets, "scenes, situations, budgets and lenses");
    }
}

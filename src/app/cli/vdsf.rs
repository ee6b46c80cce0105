//! `camsplat vdsf`.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};

use super::session::Ended;
use crate::files::io::folder::{check_file, write_files};
use crate::lab::vdsf_fit;
use crate::photogrammetry::vds::vdsf::Vdsf;
use crate::{Error, Result};

/// Arguments of `camsplat vdsf`.
#[derive(Args, Debug)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Fit the cubic to a synthetic population of materials, lightings and neighbourhoods
    Fit(FitArguments),
}

/// Arguments of `camsplat vdsf fit`.
#[derive(Args, Debug)]
struct FitArguments {
    /// Number of surfaces in the population
    #[arg(long, default_value_t = vdsf_fit::SAMPLES)]
    samples: usize,
    /// Seed of the population
    #[arg(long, default_value_t = vdsf_fit::SEED)]
    seed: u64,
    /// JSON file to write: coefficients, range and the fit's quality
    #[arg(long)]
    out: PathBuf,
    /// SVG file to write: the points and the curve
    #[arg(long)]
    plot: Option<PathBuf>,
}

/// Fits and writes.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let Command::Fit(arguments) = &arguments.command;
    let files = || std::iter::once(&arguments.out).chain(&arguments.plot);
    if arguments.plot.as_ref() == Some(&arguments.out) {
        return Err(Error::input(&arguments.out, "both the fit and its plot would be written here; name two files"));
    }
    files().try_for_each(|file| check_file(file))?;
    let (vdsf, observations) = vdsf_fit::fit(arguments.samples, arguments.seed)?;
    let text = vdsf.text()?;
    // What would be refused when read, a cubic that falls among it, is not written.
    Vdsf::parse(&arguments.out, &text)?;
    let plot = arguments.plot.as_ref().map(|path| (path, vdsf_fit::plot::svg(&vdsf, &observations)));
    let mut written: Vec<(&Path, &[u8])> = vec![(&arguments.out, text.as_bytes())];
    written.extend(plot.iter().map(|(path, svg)| (path.as_path(), svg.as_bytes())));
    write_files(&written)?;
    let [a0, a1, a2, a3] = vdsf.coefficients;
    say!("vdsf     s = {a0} {a1:+} v {a2:+} v^2 {a3:+} v^3 for v in [{}, {}]", vdsf.range[0], vdsf.range[1]);
    let quality = &vdsf.quality;
    say!(
        "fit      {} samples, R^2 {:.3}, Spearman {:.3} (expected variance {:.3}), {:.1}% at the most views tried",
        vdsf.samples,
        quality.r_squared,
        quality.spearman,
        quality.spearman_expected,
        100.0 * quality.saturated
    );
    files().for_each(|file| say!("wrote    {}", file.display()));
    Ok(Ended::Done)
}

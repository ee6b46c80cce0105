//! `camsplat vds`.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use clap::Args;

use super::options::{DeviceOptions, ImageOptions, print_messages};
use super::overwrite_guard::check_output_file;
use super::progress::Progress;
use super::session::Ended;
use crate::engine::vulkan::Context;
use crate::files::io;
use crate::files::io::folder::{check_file, write_files};
use crate::files::photos::PhotoSet;
use crate::photogrammetry::vds::scoring::{self, ScoringEvent, ScoringSettings};
use crate::photogrammetry::vds::{Estimate, picture, quantile};
use crate::scene::surface::Surface;
use crate::{Error, Result};

/// Arguments of `camsplat vds`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Capture: posed photos, as COLMAP, transforms.json or NSVF have them
    capture: PathBuf,
    /// Surface to score and to block rays, in the capture's frame [default: the capture's sparse points]
    #[arg(long)]
    surface: Option<PathBuf>,
    /// Points to score [default: all of a cloud, 100000 on triangles]
    #[arg(long)]
    points: Option<usize>,
    /// PLY to write; a picture of it goes beside it, as .png
    #[arg(long)]
    out: PathBuf,
    /// Do not correct differences in exposure between photos
    #[arg(long)]
    no_exposure: bool,
    #[command(flatten)]
    images: ImageOptions,
    /// Memory for photos that are being decoded, in MiB
    #[arg(long, default_value_t = 1024)]
    memory: u64,
    /// Seed of the points that are drawn
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    device: DeviceOptions,
}

/// Most points that are scored.
const MAX_POINTS: usize = 4_000_000;

/// Scores the points of a surface from photos and writes them.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    if let Some(points) = arguments.points.filter(|points| !(4..=MAX_POINTS).contains(points)) {
        return Err(Error::request(format!("--points is {points}; give 4 to {MAX_POINTS}")));
    }
    let picture_file = arguments.out.with_extension("png");
    if picture_file == arguments.out {
        return Err(Error::input(&arguments.out, "the points are written as PLY; name a file that ends in .ply"));
    }
    check_file(&arguments.out)?;
    check_file(&picture_file)?;
    check_output_file(&arguments.out, [Some(&arguments.capture), arguments.surface.as_ref()].into_iter().flatten())?;
    if picture_file.exists() && !arguments.out.exists() {
        let what = "this picture is already here without points of an earlier run, and would be replaced; give --out another name";
        return Err(Error::input(&picture_file, what));
    }
    let capture = io::photos::read(&arguments.capture, &arguments.images.options())?;
    for note in &capture.notes {
        say!("{note}");
    }
    let surface = match &arguments.surface {
        Some(path) => io::read_surface_with_notes(path)?.0,
        None => sparse_points(&capture)?,
    };
    let settings = ScoringSettings {
        points: arguments.points,
        seed: arguments.seed,
        exposure: !arguments.no_exposure,
        memory: arguments.memory.saturating_mul(1 << 20),
        skip_unreadable: arguments.images.skip_missing,
        ..ScoringSettings::default()
    };
    let context = arguments.device.open()?;
    let estimate = score(&context, &capture, &surface, &settings)?;
    print_messages(&context);
    let png = picture::scores(&estimate.points, &capture.photos)?;
    let bytes = io::ply::write::surface_points(&estimate.points);
    write_files(&[(&arguments.out, &bytes), (&picture_file, &png)])?;
    say!("written  {}, {}", arguments.out.display(), picture_file.display());
    Ok(Ended::Done)
}

/// The sparse points of a capture as a surface.
fn sparse_points(capture: &PhotoSet) -> Result<Surface> {
    if capture.points.positions.is_empty() {
        let what = "the capture holds no points; give a surface with --surface, or make one with `camsplat proxy`";
        return Err(Error::input(&capture.path, what));
    }
    Ok(Surface::Points(capture.points.clone()))
}

/// Scores a surface from the photos of a capture, with a bar for the photos, and prints what came out.
pub fn score(
    context: &Arc<Context>,
    capture: &PhotoSet,
    surface: &Surface,
    settings: &ScoringSettings,
) -> Result<Estimate> {
    let start = Instant::now();
    let all = capture.photos.len() as u32;
    let progress = Progress::over("photos", all, "photos");
    let estimate = scoring::run(context, capture, surface, settings, |event| match event {
        ScoringEvent::Done(done) => progress.set(done as u32, all),
        ScoringEvent::Skipped(error) => progress.line(&format!("left out: {error}")),
    });
    progress.finish();
    let estimate = estimate?;
    print(&estimate, start.elapsed().as_secs_f64());
    Ok(estimate)
}

fn print(estimate: &Estimate, seconds: f64) {
    let Estimate { points, views, variances, ends, gains, level } = estimate;
    let of = |values: &[f64], part: f64| quantile(values.to_vec(), part);
    let quantiles = |values: &[f64]| [0.1, 0.5, 0.9].map(|part| of(values, part));
    let (all, photos) = (views.len(), gains.gains.len());
    let seen: Vec<f64> = views.iter().map(|v| f64::from(*v)).collect();
    let [low, middle, high] = quantiles(&seen);
    let mean = seen.iter().sum::<f64>() / all as f64;
    say!("vds      {all} points, {photos} photos in {seconds:.2} s");
    say!("views    {mean:.1} a point (10% {low}, median {middle}, 90% {high})");
    let few = variances.iter().filter(|v| v.is_none()).count();
    if few > 0 {
        say!("         {few} of the points are seen in fewer than two photos: their score is 1");
    }
    if let Some(level) = level {
        let ends = |values: &[f64]| [of(values, 0.0), of(values, 1.0)];
        let ([low, high], [under, over]) = (ends(&gains.gains), ends(&gains.offsets));
        let unfitted = match gains.unfitted {
            0 => String::new(),
            n => format!("; {n} photos share too little to tell"),
        };
        say!(
            "exposure gains {low:.2} to {high:.2}, offsets {under:+.3} to {over:+.3}, median luma {level:.3}{unfitted}"
        );
    } else {
        say!("exposure taken as it is");
    }
    let varied: Vec<f64> = variances.iter().flatten().copied().collect();
    let [low, middle, high] = quantiles(&varied);
    say!("variance 10% {low:.2e}, median {middle:.2e}, 90% {high:.2e}");
    let scores: Vec<f64> = points.scores.iter().map(|s| f64::from(*s)).collect();
    let [low, middle, high] = quantiles(&scores);
    say!("score    10% {low:.2}, median {middle:.2}, 90% {high:.2}; VDSF {:.3} is 1, {:.3} is 2", ends[0], ends[1]);
}

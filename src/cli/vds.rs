//! `camsplat vds`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

use clap::Args;

use super::options::{DeviceOptions, print_messages};
use crate::io;
use crate::io::folder::check_file;
use crate::photos::PhotoSet;
use crate::scene::camera::Pose;
use crate::scene::proxy::{Occluder, Orientation, Proxy};
use crate::scene::region::Shape;
use crate::scene::surface::Surface;
use crate::vds::observe::Scene;
use crate::vds::{self, Estimate, images, picture, quantile};
use crate::visibility::exposure;
use crate::vulkan::Context;
use crate::{Error, Result};

/// Arguments of `camsplat vds`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Capture folder: posed photos, as COLMAP or transforms.json has them
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
    /// Take the photos' exposures as they are
    #[arg(long)]
    no_exposure: bool,
    /// Seed of the points drawn on triangles
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    device: DeviceOptions,
}

/// Points drawn on triangles where none are asked for.
const DEFAULT_POINTS: usize = 100_000;
/// Most points that are scored.
const MOST_POINTS: usize = 10_000_000;

/// Scores the points of a surface from photos and writes them.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    if let Some(points @ ..4 | points @ MOST_POINTS..) = arguments.points {
        return Err(Error::request(format!("--points is {points}; give 4 to {MOST_POINTS}")));
    }
    let picture_file = arguments.out.with_extension("png");
    if picture_file == arguments.out {
        return Err(Error::input(&arguments.out, "the points are written as PLY; name a file that ends in .ply"));
    }
    check_file(&arguments.out)?;
    check_file(&picture_file)?;
    let capture = io::photos::read(&arguments.capture)?;
    for note in &capture.notes {
        say!("{note}");
    }
    let surface = match &arguments.surface {
        Some(path) => io::read_surface_with_notes(path)?.0,
        None => sparse_points(&capture)?,
    };
    let context = arguments.device.open()?;
    let scored = Scored::new(&context, &capture, &surface, arguments.points, arguments.seed, !arguments.no_exposure)?;
    print_messages(&context);
    let bytes = io::ply::write::surface_points(&scored.estimate.points);
    let png = picture::scores(&scored.estimate.points, &capture.photos)?;
    std::fs::write(&arguments.out, bytes).map_err(|source| Error::io(&arguments.out, source))?;
    std::fs::write(&picture_file, png).map_err(|source| Error::io(&picture_file, source))?;
    scored.print();
    say!("points   {}", arguments.out.display());
    say!("picture  {}", picture_file.display());
    Ok(ExitCode::SUCCESS)
}

/// The sparse points of a capture as a surface.
pub fn sparse_points(capture: &PhotoSet) -> Result<Surface> {
    if capture.points.positions.is_empty() {
        let what = "the capture holds no points; give a surface with --surface, or make one with `camsplat proxy`";
        return Err(Error::input(&capture.path, what));
    }
    Ok(Surface::Points(capture.points.clone()))
}

/// Points of a surface, scored from photos.
pub struct Scored {
    /// The points, their scores and what led to them.
    pub estimate: Estimate,
    /// Seconds that observing took, decoding included, and all else.
    pub seconds: [f64; 2],
}

impl Scored {
    /// Scores points of `surface` from the photos of `capture`.
    pub fn new(
        context: &Arc<Context>,
        capture: &PhotoSet,
        surface: &Surface,
        points: Option<usize>,
        seed: u64,
        exposure: bool,
    ) -> Result<Self> {
        let photos = &capture.photos;
        let proxy = proxy(capture, surface)?;
        let count = points.unwrap_or(match &proxy.occluder {
            Occluder::Triangles(_) => DEFAULT_POINTS,
            Occluder::Discs(discs) => discs.len() - proxy.buried.iter().filter(|buried| **buried).count(),
        });
        let points = proxy.sample(count, seed, 0);
        let start = Instant::now();
        let scene = Scene::new(&proxy, &points, photos)?.with_tracks(&points, capture);
        let observations = images::decoded(photos, |next| scene.observe(context, next))?;
        let observing = start.elapsed().as_secs_f64();
        let estimate = vds::estimate(&points, photos, &observations, exposure, |v| v.clamp(0.0, 0.1));
        Ok(Self { estimate, seconds: [observing, start.elapsed().as_secs_f64() - observing] })
    }

    /// Prints what came out.
    pub fn print(&self) {
        let Estimate { points, views, variances, ends, gains, level } = &self.estimate;
        let all = views.len();
        let of = |values: &[f64], part: f64| quantile(values.to_vec(), part);
        let quantiles = |values: &[f64]| [0.1, 0.5, 0.9].map(|part| of(values, part));
        let seen: Vec<f64> = views.iter().map(|v| f64::from(*v)).collect();
        let few = variances.iter().filter(|v| v.is_none()).count();
        let [low, middle, high] = quantiles(&seen);
        let mean = seen.iter().sum::<f64>() / all as f64;
        say!("points   {all}, seen in {mean:.1} photos on average (10% {low}, median {middle}, 90% {high})");
        if few > 0 {
            say!("         {few} are seen in fewer than two photos: their score is 1");
        }
        if let Some(level) = level {
            let ends = |values: &[f64]| [of(values, 0.0), of(values, 1.0)];
            let ([low, high], [under, over]) = (ends(&gains.gains), ends(&gains.offsets));
            let unfitted = match gains.unfitted {
                0 => String::new(),
                n => format!(", {n} photos share too little to tell"),
            };
            say!(
                "exposure gains {low:.2} to {high:.2}, offsets {under:+.3} to {over:+.3}{unfitted}; median luma {level:.3}"
            );
        } else {
            say!("exposure taken as it is");
        }
        let varied: Vec<f64> = variances.iter().flatten().copied().collect();
        let [low, middle, high] = quantiles(&varied);
        say!("variance 10% {low:.2e}, median {middle:.2e}, 90% {high:.2e}");
        let scores: Vec<f64> = points.scores.iter().map(|s| f64::from(*s)).collect();
        let [low, middle, high] = quantiles(&scores);
        say!("score    10% {low:.2}, median {middle:.2}, 90% {high:.2}; VDSF {:.3e} to {:.3e}", ends[0], ends[1]);
        say!("time     {:.2} s for decoding and observing, {:.2} s for the rest", self.seconds[0], self.seconds[1]);
    }
}

/// The proxy of a surface that photos look at.
fn proxy(capture: &PhotoSet, surface: &Surface) -> Result<Proxy> {
    let poses: Vec<Pose> = capture.photos.iter().map(|photo| photo.camera.pose).collect();
    let positions = surface.positions();
    let mean = positions.iter().sum();
    let mean: glam::DVec3 = mean;
    let mean = mean / positions.len().max(1) as f64;
    let around = Shape::around_cameras(&poses).is_some();
    let orientation = if around { Orientation::Outward(mean) } else { Orientation::Inward(mean) };
    let mut proxy = Proxy::new(surface, orientation)?;
    if let Surface::Points(points) = surface
        && around
        && !points.oriented
        && points.toward_cameras.is_empty()
    {
        exposure::expose(&mut proxy)?;
    }
    Ok(proxy)
}

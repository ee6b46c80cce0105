//! `camsplat select`.

use std::collections::HashMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;

use super::options::{
    CameraOptions, DeviceOptions, ModelOptions, method_parser, parse_size, print_messages, read_surface,
};
use super::outcome::table;
use super::overwrite_guard::check_output_folder;
use super::progress::{leave_on_interrupt, stop_on_interrupt};
use super::region::RegionOptions;
use super::retraining::RetrainingOptions;
use super::session::Ended;
use super::viewers::ViewerOptions;
use crate::app::report::selection::{self, Written};
use crate::files::io;
use crate::files::io::folder::OutputFolder;
use crate::files::io::photos::Images;
use crate::files::photos::PhotoSet;
use crate::planner::methods::Method;
use crate::planner::metrics::Metrics;
use crate::planner::plan::target::Target;
use crate::planner::select::request::SelectionRequest;
use crate::planner::select::selection::{Selection, SelectionContext};
use crate::planner::select::sharpness;
use crate::scene::surface::Surface;
use crate::{Error, Result};

/// Arguments of `camsplat select`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Capture: a folder with a COLMAP model, a transforms.json, an NSVF folder, or a .log of poses
    capture: PathBuf,
    /// Photos to select
    #[arg(long)]
    count: usize,
    /// Folder to write
    #[arg(long)]
    out: PathBuf,
    /// Write into a folder that is not empty; files of the same names are replaced, all others stay
    #[arg(long)]
    force: bool,
    /// The surface, in the capture's frame, in any format that `camsplat plan` reads [default: the capture's own points]
    #[arg(long)]
    surface: Option<PathBuf>,
    #[command(flatten)]
    region: RegionOptions,
    #[command(flatten)]
    viewers: ViewerOptions,
    /// Horizontal field of view in degrees, for a file of poses without lenses
    #[arg(long)]
    fov: Option<f64>,
    /// Image size in pixels, for a file of poses without lenses
    #[arg(long, value_parser = parse_size, value_name = "WxH")]
    size: Option<(u32, u32)>,
    /// How to choose
    #[arg(long, value_parser = method_parser(|entry| entry.chooses), default_value = "ours")]
    method: Method,
    #[command(flatten)]
    model: ModelOptions,
    /// Always select the photos named in this file, one name per line
    #[arg(long, value_name = "FILE")]
    include: Option<PathBuf>,
    /// Never select the photos named in this file, one name per line
    #[arg(long, value_name = "FILE")]
    exclude: Option<PathBuf>,
    /// Prefer sharper photos among nearly equal choices
    #[arg(long)]
    sharpness: bool,
    /// Number of additional poses to suggest
    #[arg(long, value_name = "N", default_value_t = 0)]
    suggest: usize,
    /// Read files that a transforms.json names outside its own folder too
    #[arg(long)]
    outside_paths: bool,
    /// Copy images and masks instead of making symbolic links
    #[arg(long)]
    copy: bool,
    /// Seed of every random number
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Points of the surface that coverage-based methods choose by, and as many others for geometric metrics
    #[arg(long, default_value_t = 4000)]
    points: u32,
    #[command(flatten)]
    device: DeviceOptions,
    // The last, since its heading would stand above whatever follows.
    #[command(flatten)]
    retraining: RetrainingOptions,
}

/// Chooses, writes the folder and prints what came out.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let folder = OutputFolder::create(&arguments.out, arguments.force)?;
    let inputs = [&arguments.surface, &arguments.include, &arguments.exclude, &arguments.model.model];
    check_output_folder(&arguments.out, inputs.into_iter().flatten().chain(&arguments.region.limits.keep_out))?;
    let set = capture(arguments)?;
    check_apart(&arguments.out, &set)?;
    for note in &set.notes {
        say!("{note}");
    }
    let request = request(arguments, &set)?;
    request.validate(set.photos.len())?;
    let model = arguments.model.read(request.method.name(), request.method.needs_model())?;
    let target = target(arguments, &set)?;
    let sharpness = arguments.sharpness.then(|| sharpness::of_photos(&set)).transpose()?;
    leave_on_interrupt()?;
    let context = arguments.device.open()?;
    let selector = SelectionContext::new(&context, &set, &target, request.clone())?.with_model(model);
    let selection = selector.select(sharpness.as_deref(), true)?;
    let suggested = match arguments.suggest {
        0 => Vec::new(),
        count => selector.suggest(&selection.chosen, count)?,
    };
    drop(selector);
    print_messages(&context);
    let physical = context.physical();
    let written = Written {
        set: &set,
        target: &target,
        request: &request,
        selection: &selection,
        suggested: &suggested,
        device: physical.title(),
        copy: arguments.copy,
    };
    // From here on the first Ctrl-C is not heard, so that no half of a folder is left.
    stop_on_interrupt()?;
    let start = Instant::now();
    let path = folder.path().to_owned();
    for note in selection::write(&written, folder)? {
        say!("{note}");
    }
    print_selection(&selection, &set, request.method);
    if let [best, ..] = &suggested[..] {
        let worth = suggested.iter().filter(|one| one.gain_db > 0.0).count();
        say!(
            "suggest  {worth} of {} photos would help by themselves, the best by {:.2} dB; suggested.csv has each one's gain",
            suggested.len(),
            best.gain_db
        );
    }
    say!("written  in {:.2} s", start.elapsed().as_secs_f64());
    say!("report   {}", path.join("report.html").display());
    Ok(Ended::Done)
}

fn capture(arguments: &Arguments) -> Result<PhotoSet> {
    let intrinsics = match (arguments.fov, arguments.size) {
        (Some(fov), Some(size)) => Some(CameraOptions { fov: Some(fov), size: Some(size) }.intrinsics(&[])?),
        (None, None) => None,
        _ => return Err(Error::request("--fov and --size belong together; give both or none")),
    };
    let options =
        io::photos::ReadOptions { images: Images::Optional, intrinsics, outside_paths: arguments.outside_paths };
    let set = io::photos::read(&arguments.capture, &options)?;
    // A pool of poses alone is one to choose from; a photo that is not there among others that are is none.
    let there = set.photos.iter().filter(|photo| photo.image.is_some()).count();
    if there == 0 || there == set.photos.len() {
        return Ok(set);
    }
    let missing = set.photos.len() - there;
    let mut set = set.filtered(|photo| photo.image.is_some());
    set.notes.push(format!("{missing} photos whose image is missing or unreadable are left out of the pool"));
    Ok(set)
}

fn request(arguments: &Arguments, set: &PhotoSet) -> Result<SelectionRequest> {
    let number: HashMap<&str, usize> =
        set.photos.iter().enumerate().map(|(i, photo)| (photo.camera.name.as_str(), i)).collect();
    let read = |file: &Option<PathBuf>| file.as_deref().map_or(Ok(Vec::new()), |file| listed(file, &number));
    let (include, exclude) = (read(&arguments.include)?, read(&arguments.exclude)?);
    let both: Vec<&str> = include
        .iter()
        .filter(|photo| exclude.binary_search(photo).is_ok())
        .map(|photo| set.photos[*photo].camera.name.as_str())
        .collect();
    if !both.is_empty() {
        let what = format!("--include and --exclude both name {}; take them out of one", both.join(", "));
        return Err(Error::request(what));
    }
    let trains = arguments.method == Method::FisherRetrain;
    Ok(SelectionRequest {
        method: arguments.method,
        retraining: arguments.retraining.settings(arguments.method.name(), trains, set)?,
        include,
        exclude,
        seed: arguments.seed,
        points: arguments.points,
        preset: arguments.region.preset(),
        viewers: arguments.viewers.given()?,
        ..SelectionRequest::new(arguments.count)
    })
}

/// Indices, ascending, of the photos that a file names.
fn listed(file: &Path, number: &HashMap<&str, usize>) -> Result<Vec<usize>> {
    let text = std::fs::read_to_string(file).map_err(|source| match source.kind() {
        ErrorKind::NotFound | ErrorKind::InvalidData => {
            let is_there = source.kind() == ErrorKind::InvalidData;
            let what = if is_there { "this is no text" } else { "there is no such file" };
            let takes = "--include and --exclude take a text file with the name of a photo on each line";
            Error::input(file, format!("{what}; {takes}"))
        }
        _ => io::unreadable(file, source),
    })?;
    let names = || text.lines().map(str::trim).filter(|name| !name.is_empty());
    let unknown: Vec<&str> = names().filter(|name| !number.contains_key(name)).collect();
    if !unknown.is_empty() {
        let first = number.keys().min().copied().unwrap_or_default();
        let what = format!("the capture has no photo called {}; its names are such as {first}", unknown.join(", "));
        return Err(Error::input(file, what));
    }
    let mut photos: Vec<usize> = names().filter_map(|name| number.get(name).copied()).collect();
    photos.sort_unstable();
    photos.dedup();
    Ok(photos)
}

/// Refuses to write over the capture that is chosen from: its photos and model would be replaced by what was chosen.
fn check_apart(out: &Path, set: &PhotoSet) -> Result<()> {
    let real = |path: &Path| std::fs::canonicalize(path).ok();
    let Some(out) = real(out) else { return Ok(()) };
    let sources = set.photos.iter().flat_map(|photo| photo.image.iter().chain(&photo.mask)).map(PathBuf::as_path);
    let inside = |path: &Path| path.parent().and_then(real).is_some_and(|folder| folder.starts_with(&out));
    // A capture may be a file, or a model two folders down.
    let model = io::colmap::model_folder(&set.path);
    let capture = [Some(set.path.clone()), model]
        .into_iter()
        .flatten()
        .any(|path| real(&path).is_some_and(|path| path.starts_with(&out)));
    if capture || sources.into_iter().any(inside) {
        return Err(Error::input(out, "the capture itself lies here and would be written over; name another folder"));
    }
    Ok(())
}

fn target(arguments: &Arguments, set: &PhotoSet) -> Result<Target> {
    let Some(first) = set.photos.first() else { return Err(Error::input(&set.path, "it holds no posed photos")) };
    let (surface, path) = match &arguments.surface {
        Some(path) => (read_surface(path)?, path.as_path()),
        None if set.points.positions.is_empty() => {
            return Err(Error::input(
                &set.path,
                "the capture has no points; give its surface with --surface, or make one with `camsplat proxy`",
            ));
        }
        None => (Surface::Points(set.points.clone()), set.path.as_path()),
    };
    arguments.region.target_of(&surface, path, Some(set), &first.camera.intrinsics, None)
}

fn print_selection(selection: &Selection, set: &PhotoSet, method: Method) {
    let [seeing, planning, choosing] = selection.seconds;
    say!(
        "chosen   {} of {} photos; {} swaps; visibility {seeing:.2} s, plan {planning:.2} s, choice {choosing:.2} s",
        selection.chosen.len(),
        set.photos.len(),
        selection.errors_db.len().saturating_sub(1)
    );
    let mut rows: Vec<(&str, &Metrics)> = vec![("all photos", &selection.pool), (method.name(), &selection.metrics)];
    rows.extend(selection.baselines.iter().map(|baseline| (baseline.name.as_str(), &baseline.metrics)));
    say!("{}", table(&rows).trim_end());
    say!("expected {}", selection.expected.line());
    let reached =
        |count: u32| selection.scores.iter().filter(|score| score.reachable > 0.0 && score.views <= count).count();
    say!(
        "unseen   {:.1}% of what the pool shows; {:.1}% of all points no photo shows",
        100.0 * reached(0) as f64 / selection.scores.len().max(1) as f64,
        100.0 * (1.0 - selection.pool.reachable)
    );
}

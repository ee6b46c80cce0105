//! `camsplat next`.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::options::{DeviceOptions, print_messages};
use super::overwrite_guard::check_output_file;
use super::photographed;
use super::progress::leave_on_interrupt;
use super::region::RegionOptions;
use super::session::{self, Ended};
use super::viewers::ViewerOptions;
use crate::app::report::way::{self, Way};
use crate::files::io;
use crate::files::io::folder::{check_file, write_files};
use crate::files::photos::PhotoSet;
use crate::planner::plan::config::Config;
use crate::planner::plan::enough::{Advice, Enough};
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::directions::Unit;
use crate::scene::region::Region;
use crate::{Error, Result};

/// Arguments of `camsplat next`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Capture folder or COLMAP model: photos with poses, with or without their images
    capture: PathBuf,
    /// Photos to place
    #[arg(long, default_value_t = 5)]
    views: u32,
    /// Photo that was taken last: the place nearest to it comes first [default: the last by name]
    #[arg(long, value_name = "PHOTO")]
    from: Option<String>,
    /// Surface in place of the capture's own points, in its frame, such as one that `camsplat proxy` made
    #[arg(long, value_name = "FILE")]
    surface: Option<PathBuf>,
    #[command(flatten)]
    region: RegionOptions,
    #[command(flatten)]
    viewers: ViewerOptions,
    #[command(flatten)]
    device: DeviceOptions,
    /// Seed of every random number
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Write the answer as JSON into a file; without one print it, and everything else to standard error
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "-")]
    json: Option<PathBuf>,
}

/// Points of the surface at which the photos are judged.
const HELD_OUT: u32 = 1000;

/// What `--json` writes.
#[derive(Serialize)]
struct Answer {
    /// Photos that there are.
    photos: usize,
    /// What the next ones gain, and where those that there are leave error.
    #[serde(flatten)]
    enough: Enough,
    /// What lengths in words are said in.
    unit: String,
    /// Its length in units of the scene.
    unit_length: f64,
    /// The intrinsics of the next photos.
    intrinsics: Intrinsics,
    /// The next photos, the nearest first.
    next: Vec<Next>,
}

/// A photo to take.
#[derive(Serialize)]
struct Next {
    /// Name of its camera.
    name: String,
    #[serde(flatten)]
    way: Way,
    /// Distance from the photo that was taken last, in units of the scene.
    distance: f64,
}

/// Judges the photos, places the next and prints where they are.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let printed = arguments.json.as_deref() == Some(Path::new("-"));
    if printed {
        session::current().set_aside();
    }
    if let (Some(file), false) = (&arguments.json, printed) {
        check_file(file)?;
        let inputs = std::iter::once(&arguments.capture).chain(&arguments.surface);
        check_output_file(file, inputs.chain(&arguments.region.limits.keep_out))?;
    }
    let path = &arguments.capture;
    std::fs::metadata(path).map_err(|source| Error::io(path, source))?;
    if !io::may_be_capture(path) {
        let what = "this is no capture, whose photos the next ones are beside; `camsplat plan` takes a surface alone";
        return Err(Error::input(path, what));
    }
    arguments.region.choice()?;
    let viewers = arguments.viewers.viewers()?;
    let (surface, photos) = photographed::read(path, arguments.surface.as_deref(), true)?;
    let cameras = photos.cameras();
    let last = last(path, &cameras, arguments.from.as_deref())?;
    let file = arguments.surface.as_ref().unwrap_or(path);
    let region = arguments.region.clone().explored();
    let target = region.target_of(&surface, file, Some(&photos), &last.intrinsics, None)?;
    let preset = region.preset.unwrap_or_else(|| target.preset());
    let plain = Config::new(preset, arguments.views);
    let config = Config { seed: arguments.seed, held_out: HELD_OUT, viewers, ..plain };
    config.validate()?;
    leave_on_interrupt()?;
    let context = arguments.device.open()?;
    let advice = Advice::new(&context, &target, &cameras, None, &config, &mut || ControlFlow::Continue(()))?;
    print_messages(&context);
    let (unit, said) = way::unit(&photos, target.region.up);
    let next = in_order(advice.further, last, &photos, &target.region, &unit);
    let enough = advice.enough;
    say!("photos   {}; no photo shows {:.1}% of what viewers look at", cameras.len(), 100.0 * enough.unseen);
    say!("gain     {:+.2} dB (sd {:.2}) are expected of {} more", enough.gain_db, enough.gain_sd_db, next.len());
    if matches!(unit, Unit::Step(_)) {
        say!("lengths  in steps: {said}");
    }
    for (number, next) in (1..).zip(&next) {
        say!("next {number:<4}from {}: {}", next.way.from, next.way.words);
    }
    if let Some(file) = &arguments.json {
        let intrinsics = last.intrinsics;
        let (photos, unit_length) = (cameras.len(), unit.length());
        let answer = Answer { photos, enough, unit: said, unit_length, intrinsics, next };
        let text = serde_json::to_string_pretty(&answer)
            .map_err(|e| Error::request(format!("the answer cannot be written: {e}")))?;
        match printed {
            true => session::current().answer(&text),
            false => write_files(&[(file, text.as_bytes())])?,
        }
    }
    Ok(Ended::Done)
}

/// The photo that was taken last.
fn last<'c>(path: &Path, cameras: &'c [Camera], name: Option<&str>) -> Result<&'c Camera> {
    let Some(name) = name else {
        return cameras.last().ok_or_else(|| Error::input(path, "it holds no photos; take some first"));
    };
    let is_named = |camera: &&Camera| camera.name == name || Path::new(&camera.name).ends_with(name);
    let found = cameras.iter().find(is_named);
    found.ok_or_else(|| {
        Error::input(path, format!("it has no photo {name:?}; --from takes the name of one with a pose"))
    })
}

/// Photos to take, the nearest to `last` first, each with the way from the photo that is nearest to it.
fn in_order(mut further: Vec<Camera>, last: &Camera, photos: &PhotoSet, region: &Region, unit: &Unit) -> Vec<Next> {
    let distance = |camera: &Camera| camera.pose.position.distance(last.pose.position);
    let mut names: Vec<String> = further.iter().map(|camera| camera.name.clone()).collect();
    names.sort();
    further.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    let step = photos.step();
    let way = |camera: &Camera| {
        let nearest = photos.nearest(camera, step, |_| true);
        Some(Way::new(&photos.photos[*nearest.first()?].camera, camera, region, unit))
    };
    let next = further.iter().zip(names);
    next.filter_map(|(camera, name)| Some(Next { name, way: way(camera)?, distance: distance(camera) })).collect()
}

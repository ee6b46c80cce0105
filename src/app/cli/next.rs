//! `camsplat next`.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use clap::Args;
use glam::DVec3;
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
use crate::files::photos::{Photo, PhotoSet};
use crate::planner::plan::config::{Config, Preset};
use crate::planner::plan::enough::{Advice, Enough};
use crate::planner::plan::target::Target;
use crate::planner::quality::expected::decibels;
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::directions::Unit;
use crate::scene::lens::Distortion;
use crate::scene::region::Region;
use crate::{Error, Result};

/// Arguments of `camsplat next`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Capture folder or COLMAP model: photos with poses, with or without their images; or a surface, as `plan` takes it, with CAMERAS
    #[arg(value_name = "CAPTURE")]
    scene: PathBuf,
    /// Cameras of the photos that there are: COLMAP or NSVF folder, transforms.json, plan.json or .log [default: those of the capture]
    cameras: Option<PathBuf>,
    /// Photos to place
    #[arg(long, default_value_t = 5)]
    views: u32,
    /// Photo that was taken last: the place nearest to it comes first [default: the last by name]
    #[arg(long, value_name = "PHOTO")]
    from: Option<String>,
    /// Place the photos so that structure from motion can join them to those that there are: each sees much of what one of these sees, at no
    /// wider an angle than this, in degrees
    #[arg(long, value_name = "DEGREES")]
    connect: Option<f32>,
    /// Surface in place of the capture's own points, in its frame, such as one that `camsplat proxy` made
    #[arg(long, value_name = "FILE", conflicts_with = "cameras")]
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
    /// Points of the surface that no photo shows, of a thousand on it.
    uncovered: Vec<DVec3>,
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
        let inputs = std::iter::once(&arguments.scene).chain(&arguments.surface).chain(&arguments.cameras);
        check_output_file(file, inputs.chain(&arguments.region.limits.keep_out))?;
    }
    arguments.region.choice()?;
    let viewers = arguments.viewers.viewers()?;
    let (photos, target, preset) = taken(arguments)?;
    let cameras = photos.cameras();
    let last = last(&photos.path, &cameras, arguments.from.as_deref())?;
    let plain = Config::beside_photos(preset, arguments.views);
    let plain = arguments.connect.map_or(Ok(plain.clone()), |degrees| plain.connected_to_kept(degrees))?;
    let config = Config { seed: arguments.seed, held_out: HELD_OUT, viewers, ..plain };
    config.validate()?;
    leave_on_interrupt()?;
    let context = arguments.device.open()?;
    let mut advice =
        Advice::new(&context, &target, last.intrinsics, &cameras, None, &config, &mut || ControlFlow::Continue(()))?;
    print_messages(&context);
    let (unit, said) = way::unit(&photos, target.region.up);
    advice.nearest_first(last.pose.position);
    let next = ways(&advice.further, last, &photos, &target.region, &unit);
    let (enough, points) = (advice.enough, advice.points.into_iter().zip(advice.unseen));
    let uncovered = points.filter_map(|(point, unseen)| unseen.then_some(point)).collect();
    say!("photos   {}; no photo shows {:.1}% of what viewers look at", cameras.len(), 100.0 * enough.unseen);
    let gain = decibels(enough.gain_db, 2);
    say!("gain     {gain} (sd {:.2}) are expected of {} more", enough.gain_sd_db, next.len());
    if matches!(unit, Unit::Step(_)) {
        say!("lengths  in steps: {said}");
    }
    for (number, next) in (1..).zip(&next) {
        say!("next {number:<4}from {}: {}", next.way.from, next.way.words);
    }
    if let Some(file) = &arguments.json {
        let intrinsics = last.intrinsics;
        let (photos, unit_length) = (cameras.len(), unit.length());
        let answer = Answer { photos, enough, unit: said, unit_length, uncovered, intrinsics, next };
        let text = serde_json::to_string_pretty(&answer)
            .map_err(|e| Error::request(format!("the answer cannot be written: {e}")))?;
        match printed {
            true => session::current().answer(&text),
            false => write_files(&[(file, text.as_bytes())])?,
        }
    }
    Ok(Ended::Done)
}

/// The photos that there are, what the next ones are for, and the kind of scene that it is.
fn taken(arguments: &Arguments) -> Result<(PhotoSet, Target, Preset)> {
    let (scene, region) = (&arguments.scene, arguments.region.clone());
    io::check_there(scene)?;
    if let Some(path) = &arguments.cameras {
        let (cameras, notes) = io::read_cameras_with_notes(&io::plan_file(path))?;
        notes.iter().for_each(|note| say!("{note}"));
        let lens = last(path, &cameras, arguments.from.as_deref())?.intrinsics;
        let photo = |camera| Photo { camera, distortion: Distortion::default(), image: None, mask: None };
        let photos = cameras.into_iter().map(photo).collect();
        let photos = PhotoSet { path: path.clone(), photos, ..PhotoSet::default() };
        let region = region.explored(&photos);
        let target = region.target(scene, &lens, None)?;
        let preset = region.preset_of(&target);
        return Ok((photos, target, preset));
    }
    if !io::may_be_capture(scene) {
        let what = "a surface has no photos that the next ones are beside; name their cameras as well, or `camsplat plan` without any";
        return Err(Error::input(scene, what));
    }
    let (surface, photos) = photographed::read(scene, arguments.surface.as_deref(), true)?;
    let lens = last(scene, &photos.cameras(), arguments.from.as_deref())?.intrinsics;
    let file = arguments.surface.as_ref().unwrap_or(scene);
    let region = region.explored(&photos);
    let target = region.target_of(&surface, file, Some(&photos), &lens, None)?;
    let preset = region.preset_of(&target);
    Ok((photos, target, preset))
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

/// Photos to take, named in their order, each with the way from the photo that is nearest to it.
fn ways(further: &[Camera], last: &Camera, photos: &PhotoSet, region: &Region, unit: &Unit) -> Vec<Next> {
    let mut names: Vec<String> = further.iter().map(|camera| camera.name.clone()).collect();
    names.sort();
    let step = photos.step();
    let next = |(camera, name): (&Camera, String)| {
        let nearest = photos.nearest(camera, step, |_| true);
        let way = Way::new(&photos.photos[*nearest.first()?].camera, camera, region, unit);
        Some(Next { name, way, distance: camera.pose.position.distance(last.pose.position) })
    };
    further.iter().zip(names).filter_map(next).collect()
}

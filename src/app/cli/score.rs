//! `camsplat score`.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::options::{DeviceOptions, print_messages};
use super::outcome::table;
use super::overwrite_guard::check_output_file;
use super::region::{RegionOptions, Stored};
use super::session::{self, Ended};
use super::shell;
use super::viewers::ViewerOptions;
use crate::files::io;
use crate::files::io::folder::{check_file, write_files};
use crate::planner::metrics::Metrics;
use crate::planner::plan::config::{Config, Preset};
use crate::planner::plan::enough::{Advice, Enough, MORE};
use crate::planner::plan::gate::Gate;
use crate::planner::plan::pipeline::{self};
use crate::planner::plan::record::Expected;
use crate::planner::plan::target::Target;
use crate::planner::quality::expected::decibels;
use crate::scene::camera::{Camera, Pose, common_up, parallel};
use crate::scene::limits::Limits;
use crate::{Error, Result};

/// Arguments of `camsplat score`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// PLY points, mesh or trained splat; OBJ; glTF or GLB; COLMAP model or capture folder
    surface: PathBuf,
    /// COLMAP or NSVF folder, transforms.json, plan.json or .log [default: the photos of the capture]
    cameras: Option<PathBuf>,
    #[command(flatten)]
    region: RegionOptions,
    #[command(flatten)]
    device: DeviceOptions,
    #[command(flatten)]
    viewers: ViewerOptions,
    /// Print the geometric metrics too: coverage, angular gaps, Voronoi cells, triangulation, ground sampling
    #[arg(long)]
    all: bool,
    /// Surface points for the geometric metrics
    #[arg(long, default_value_t = 1000)]
    held_out: u32,
    /// Seed of viewers, layouts and held-out points
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Geometric metrics by the cone inscribed in the image, not by the whole image
    #[arg(long)]
    cone: bool,
    /// Write the metrics here too
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What `--json` writes.
#[derive(Serialize)]
struct Scores {
    #[serde(skip_serializing_if = "Option::is_none")]
    enough: Option<Enough>,
    expected: Expected,
    #[serde(flatten)]
    metrics: Metrics,
}

/// Scores and prints.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    if !(1..=1 << 20).contains(&arguments.held_out) {
        return Err(Error::request(format!("--held-out is {}; give 1 to {}", arguments.held_out, 1 << 20)));
    }
    let of_capture = io::may_be_capture(&arguments.surface);
    let cameras = match &arguments.cameras {
        Some(cameras) => cameras,
        None if of_capture => &arguments.surface,
        None => {
            io::check_there(&arguments.surface)?;
            return Err(Error::input(&arguments.surface, "a surface has no photos; name the cameras to score as well"));
        }
    };
    if let Some(file) = &arguments.json {
        check_file(file)?;
        let inputs = [&arguments.surface, cameras];
        check_output_file(file, inputs.into_iter().chain(&arguments.region.limits.keep_out))?;
    }
    let (path, file) = (cameras, io::plan_file(cameras));
    let (cameras, notes) = io::read_cameras_with_notes(&file)?;
    for note in notes {
        say!("{note}");
    }
    // A default region follows from the cameras that are there, as far as they agree.
    let first = cameras.first().ok_or_else(|| Error::input(path, "it holds no cameras"))?;
    let (stored, kept) = stored(&file).unwrap_or_else(|note| {
        say!("{note}");
        (None, 0)
    });
    if let (Some(file), Some(stored)) = (&arguments.json, &stored) {
        let files: Vec<PathBuf> = stored.limits.keep_out.iter().map(|volume| PathBuf::from(&volume.file)).collect();
        check_output_file(file, files.iter().filter(|file| file.exists()))?;
    }
    let has_own_region = stored.is_some();
    let target = arguments.region.target(&arguments.surface, &first.intrinsics, stored)?;
    note_outside(&target, &cameras, arguments.region.preset_of(&target))?;
    note_tilted(&target, &cameras);
    let own = if of_capture && path != &arguments.surface { Some(io::read_cameras(&arguments.surface)?) } else { None };
    let context = arguments.device.open()?;
    let viewers = arguments.viewers.viewers()?;
    let config = Config {
        seed: arguments.seed,
        held_out: arguments.held_out,
        viewers,
        gate: if arguments.cone { Gate::Soft } else { Gate::Pinhole },
        ..Config::new(arguments.region.preset_of(&target), cameras.len() as u32)
    };
    let (expected, metrics) = pipeline::score(&context, &target, &cameras, kept, &config)?;
    let further = Config { views: MORE, ..config };
    let judged = || {
        Advice::new(&context, &target, first.intrinsics, &cameras, own.as_deref(), &further, &mut || {
            ControlFlow::Continue(())
        })
    };
    let advice = of_capture.then(judged).transpose()?;
    let enough = advice.map(|advice| advice.enough);
    print_messages(&context);
    if let Some(enough) = &enough {
        say!("enough   {}", enough.line());
        for part in &enough.weak {
            say!("weak     {}", part.line());
        }
        let [surface, path] = [&arguments.surface, path].map(|path| shell::quoted(&path.to_string_lossy()));
        if let (Some(own), Some(db)) = (&own, enough.over_own_db) {
            say!("change   {} against the {} photos of {surface}", decibels(db, 1), own.len());
        }
        // What both commands have says where cameras and viewers are, and on which device.
        let shared = ViewerOptions::augment_args(DeviceOptions::augment_args(RegionOptions::augment_args(
            clap::Command::default(),
        )));
        let given = session::current().given(&shared);
        say!("next     camsplat plan {surface} --keep {path} --views {MORE} --out next{given}");
        if has_own_region {
            say!(
                "         (--keep takes neither region nor limits from {path}: give those that are not the usual ones)"
            );
        }
    }
    say!("expected {}", expected.line());
    if expected.unseen >= 1.0 {
        say!("warning  no camera sees anything that viewers look at: are both in one frame?");
    }
    if arguments.all {
        say!("{}", table(&[("cameras", &metrics)]).trim_end());
        say!("voronoi cell    {:.4} sr, deviation {:.4} sr", metrics.voronoi_mean, metrics.voronoi_deviation);
        say!("triangulation   {:.1}° between the two views farthest apart", metrics.triangulation_mean_deg);
        say!("ground sampling {:.6} units a pixel", metrics.sampling_distance_mean);
    }
    if let Some(file) = &arguments.json {
        let text = serde_json::to_string_pretty(&Scores { enough, expected, metrics })
            .map_err(|e| Error::request(format!("the metrics cannot be written: {e}")))?;
        write_files(&[(file, text.as_bytes())])?;
    }
    Ok(Ended::Done)
}

/// Says how many cameras are outside of the limits or the region, which baselines respect.
fn note_outside(target: &Target, cameras: &[Camera], preset: Preset) -> Result<()> {
    if target.limits.is_empty() {
        if let Some(count) = mostly_outside(target, cameras) {
            let all = cameras.len();
            let other = if preset == Preset::Room {
                "give its --box"
            } else {
                "for a room give --preset room or --box, else --shell"
            };
            say!(
                "warning  {count} of {all} cameras are outside of the region that the simple layouts stand in; {other}"
            );
        }
        return Ok(());
    }
    let geometry = target.geometry()?;
    let outside = |camera: &&Camera| !geometry.keeps_limits(geometry.to_internal.point(camera.pose.position));
    let count = cameras.iter().filter(outside).count();
    if count > 0 {
        say!(
            "warning  {count} of {} cameras are outside of the limits, which the simple layouts respect",
            cameras.len()
        );
    }
    Ok(())
}

/// Says that cameras stand upright by another axis than the scene, which viewers and simple layouts go by.
fn note_tilted(target: &Target, cameras: &[Camera]) {
    let poses: Vec<Pose> = cameras.iter().map(|camera| camera.pose).collect();
    // Up in a picture says nothing where all look the same way, as a flight does straight down, nor where few agree on it.
    let Some(held) = common_up(&poses).filter(|_| !parallel(&poses)) else { return };
    let upright = poses.iter().filter(|pose| pose.up().dot(held) > 0.5).count();
    if 2 * upright > poses.len() && held.dot(target.region.up) < 0.5 {
        let [held, up] = [held, target.region.up].map(|up| format!("[{:.2}, {:.2}, {:.2}]", up.x, up.y, up.z));
        say!(
            "warning  the cameras stand upright along {held}, the scene along {up}; give --up where the cameras are right"
        );
    }
}

/// How many cameras are outside of the region, where these are most.
pub(super) fn mostly_outside(target: &Target, cameras: &[Camera]) -> Option<usize> {
    let count = cameras.iter().filter(|camera| !target.region.contains(camera.pose.position)).count();
    (2 * count > cameras.len()).then_some(count)
}

/// What a plan.json was made for, which is what its cameras are fairly measured by, and how many of these were kept.
///
/// # Errors
/// A note where there is one that cannot be read.
fn stored(cameras: &Path) -> Result<(Option<Stored>, usize), String> {
    #[derive(serde::Deserialize)]
    struct Plan {
        #[serde(default)]
        surface: serde_json::Value,
        region: serde_json::Value,
        #[serde(default)]
        limits: serde_json::Value,
        #[serde(default)]
        kept: usize,
    }
    // Whether there is a file that can be read has been settled by whoever read its cameras; those of others have no region.
    let plan = io::json_file(cameras)
        .and_then(|file| io::json::<Plan>(&file, &std::fs::read(&file).map_err(|e| Error::io(&file, e))?));
    let Ok(Plan { surface, region, limits, kept }) = plan else { return Ok((None, 0)) };
    let file = cameras.display();
    let region = serde_json::from_value(region).map_err(|error| {
        format!("the region in {file} cannot be read ({error}), and that of the options, or the usual one, is taken")
    })?;
    let limits = match limits {
        serde_json::Value::Null => Limits::default(),
        limits if limits.is_object() => serde_json::from_value(limits).map_err(|error| {
            format!("the limits in {file} cannot be read ({error}), and its region is not taken either")
        })?,
        _ => return Err(format!("the limits in {file} are no object, and its region is not taken either")),
    };
    let surrounded = surface["assumed"].as_u64().map(|count| count > 0);
    let subject = serde_json::from_value(surface["subject"].clone()).map_err(|error| {
        format!("the subject in {file} cannot be read ({error}), and its region is not taken either")
    })?;
    Ok((Some(Stored { region, limits, subject, surrounded }), kept))
}

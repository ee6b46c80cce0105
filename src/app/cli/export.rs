//! `camsplat export`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum as _};
use glam::DVec3;

use super::missions::{MissionOptions, Plan, Source};
use super::options::{parse_up, read_cameras};
use super::overwrite_guard::check_output_folder;
use super::session::Ended;
use crate::app::export::{self, Format, blender, gltf, ros, usd};
use crate::files::io;
use crate::files::io::folder::OutputFolder;
use crate::scene::camera::{Camera, Pose, common_up};
use crate::{Error, Result};

/// Arguments of `camsplat export`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Cameras to export, of a plan only the planned ones: folder of a plan, plan.json, transforms.json, COLMAP or NSVF folder, .xml of Metashape,
    /// .csv of RealityCapture, or .log
    cameras: PathBuf,
    /// Formats to write [default: ros, glb, blender and usd; with --geo all]
    #[arg(long, value_enum, value_delimiter = ',')]
    to: Vec<Format>,
    /// Folder to write
    #[arg(long, required_unless_present = "check")]
    out: Option<PathBuf>,
    /// Write into a folder that is not empty; files of the same names are replaced, all others stay
    #[arg(long)]
    force: bool,
    /// Up direction: x, -x, +y, ... [default: the plan's, else what the cameras hold up]
    #[arg(long, value_parser = parse_up, allow_hyphen_values = true)]
    up: Option<DVec3>,
    /// Name of the frame that ROS poses are in
    #[arg(long, default_value = "map")]
    frame: String,
    #[command(flatten)]
    missions: MissionOptions,
}

/// Writes the cameras in the formats and prints what came out.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let missions = &arguments.missions;
    missions.validate()?;
    let place = missions.geo.as_deref();
    if let (Some(place), None) = (place, &arguments.out) {
        let (cameras, plan) = read(arguments)?;
        let source = Source { path: &arguments.cameras, cameras: &cameras, up: arguments.up };
        return missions.check(place, source, plan.as_ref()).map(|()| Ended::Done);
    }
    let out = arguments.out.as_ref().ok_or_else(|| Error::request("give a folder to write with --out"))?;
    let folder = OutputFolder::create(out, arguments.force)?;
    check_output_folder(out, [&arguments.cameras])?;
    let (cameras, plan) = read(arguments)?;
    let poses: Vec<Pose> = cameras.iter().map(|camera| camera.pose).collect();
    let up = arguments.up.or(plan.as_ref().map(|plan| plan.region.up)).or(common_up(&poses)).unwrap_or(DVec3::Z);
    let wanted = formats(arguments)?;
    if wanted.contains(&Format::Dji) && !(1.0..=15.0).contains(&missions.speed) {
        return Err(Error::request("DJI's missions take a --speed from 1 to 15 m/s; give one, or --to without dji"));
    }
    for format in wanted.iter().filter(|format| !format.is_geographic()) {
        write(&folder, *format, &cameras, up, &arguments.frame)?;
    }
    let offset = export::offset(&cameras);
    if wanted.contains(&Format::Blender) && offset != DVec3::ZERO {
        say!(
            "note     far from the origin: positions in blender_cameras.py are less ({}, {}, {}); move the surface likewise in Blender",
            offset.x,
            offset.y,
            offset.z
        );
    }
    if let Some(place) = place {
        let source = Source { path: &arguments.cameras, cameras: &cameras, up: arguments.up };
        missions.write(place, (&folder, &wanted), source, plan.as_ref())?;
    }
    let path = folder.path().to_owned();
    folder.commit()?;
    say!("written  {}", path.display());
    Ok(Ended::Done)
}

/// The cameras, without those that a plan kept, and the plan beside them, where there is one.
fn read(arguments: &Arguments) -> Result<(Vec<Camera>, Option<Plan>)> {
    let file = io::plan_file(&arguments.cameras);
    let mut cameras = read_cameras(&file)?;
    let plan = plan(&file)?;
    if let Some(kept) = plan.as_ref().map(|plan| plan.kept).filter(|kept| (1..cameras.len()).contains(kept)) {
        cameras.truncate(cameras.len() - kept);
        say!("note     the {kept} kept cameras are left out: their photos are there");
    }
    say!("cameras  {} from {}", cameras.len(), arguments.cameras.display());
    Ok((cameras, plan))
}

fn formats(arguments: &Arguments) -> Result<Vec<Format>> {
    let missions = &arguments.missions;
    let all = Format::value_variants().iter().copied();
    if arguments.to.is_empty() {
        return Ok(all.filter(|format| missions.geo.is_some() || !format.is_geographic()).collect());
    }
    if missions.geo.is_none()
        && let Some(format) = arguments.to.iter().find(|format| format.is_geographic())
    {
        let name = format.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned());
        return Err(Error::request(format!("--to {name} needs a place on Earth; give one with --geo")));
    }
    Ok(all.filter(|format| arguments.to.contains(format)).collect())
}

/// The plan beside the cameras, where there is one.
///
/// # Errors
/// Where there is one that cannot be read: its limits would not be kept.
fn plan(cameras: &Path) -> Result<Option<Plan>> {
    let Ok(file) = io::json_file(cameras) else { return Ok(None) };
    let bytes = std::fs::read(&file).map_err(|source| Error::io(&file, source))?;
    // Cameras of others have no region.
    match io::json::<serde_json::Value>(&file, &bytes) {
        Ok(value) if value.get("region").is_some() => {
            let plan: Plan = io::json(&file, &bytes)?;
            Ok(Some(Plan { region: plan.region.validated()?, limits: plan.limits.validated()?, ..plan }))
        }
        _ => Ok(None),
    }
}

fn write(folder: &OutputFolder, format: Format, cameras: &[Camera], up: DVec3, frame: &str) -> Result<()> {
    match format {
        Format::Ros => {
            folder.write("pose_array.yaml", ros::yaml(cameras, frame))?;
            folder.write("pose_array.json", ros::json(cameras, frame)?)
        }
        Format::Glb => folder.write("cameras.glb", gltf::glb(cameras, up)?),
        Format::Blender => folder.write("blender_cameras.py", blender::script(cameras, up)),
        Format::Usd => folder.write("cameras.usda", usd::usda(cameras, up)),
        Format::Dji | Format::Qgc | Format::Litchi | Format::Kml | Format::Geojson => Ok(()),
    }
}

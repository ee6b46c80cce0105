//! `camsplat export`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum as _};
use glam::DVec3;
use serde::Deserialize;

use super::overwrite_guard::check_output_folder;
use super::place::georeference;
use super::region::parse_up;
use super::session::Ended;
use crate::app::export::georeference::Georeference;
use crate::app::export::mission::{Flight, Mission, Rules};
use crate::app::export::{self, Format, blender, dji, geojson, gltf, kml, litchi, qgc, ros, usd};
use crate::files::io;
use crate::files::io::folder::OutputFolder;
use crate::scene::camera::{Camera, Pose, common_up};
use crate::scene::limits::Limits;
use crate::scene::region::Region;
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
    #[arg(long)]
    out: PathBuf,
    /// Write into a folder that is not empty; files of the same names are replaced, all others stay
    #[arg(long)]
    force: bool,
    /// Up direction: x, -x, +y, ... [default: the plan's, else what the cameras hold up]
    #[arg(long, value_parser = parse_up, allow_hyphen_values = true)]
    up: Option<DVec3>,
    /// Name of the frame that ROS poses are in
    #[arg(long, default_value = "map")]
    frame: String,
    /// Where the scene lies on Earth: LAT,LON,ALT[,HEADING] of its origin, in metres, its +Y (-Z where Y is up) pointing to HEADING degrees
    /// from north; utm:ZONE[,EAST,NORTH[,ALT]], such as utm:33N, for coordinates in UTM, with the offset to add to them; ecef for geocentric
    /// ones; or a capture in the same frame whose photos have GPS positions
    #[arg(long, value_name = "PLACE", allow_hyphen_values = true)]
    geo: Option<String>,
    /// Altitude of the place that the drone takes off from, in metres as those of --geo [default: that of the plan's floor, or of the
    /// lowest point of its surface]
    #[arg(long, value_name = "ALTITUDE", allow_hyphen_values = true)]
    takeoff: Option<f64>,
    /// Lowest height of a drone above the take-off, in metres: missions with a lower waypoint are refused
    #[arg(long, value_name = "METRES", default_value_t = 2.0, allow_hyphen_values = true)]
    lowest: f64,
    /// Pitch of the drone's gimbal, in degrees above the horizon
    #[arg(long, value_name = "LOW,HIGH", default_value = "-90,30", value_parser = parse_gimbal, allow_hyphen_values = true)]
    gimbal: [f64; 2],
    /// Speed of the drone in metres per second
    #[arg(long, default_value_t = 3.0)]
    speed: f64,
}

/// What a plan says beside its cameras.
#[derive(Deserialize)]
struct Plan {
    region: Region,
    #[serde(default)]
    kept: usize,
    #[serde(default)]
    tour: Option<Tour>,
    #[serde(default)]
    limits: Limits,
    surface: Option<Bounds>,
}

#[derive(Deserialize)]
struct Tour {
    path: Vec<DVec3>,
    #[serde(default)]
    blocked: usize,
}

#[derive(Deserialize)]
struct Bounds {
    min: DVec3,
    max: DVec3,
}

/// Writes the cameras in the formats and prints what came out.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let folder = OutputFolder::create(&arguments.out, arguments.force)?;
    check_output_folder(&arguments.out, [&arguments.cameras])?;
    check(arguments)?;
    let file = io::plan_file(&arguments.cameras);
    let mut cameras = io::read_cameras(&file)?;
    let plan = match plan(&file) {
        Some(plan) => Some(Plan { region: plan.region.validated()?, ..plan }),
        None => None,
    };
    if let Some(kept) = plan.as_ref().map(|plan| plan.kept).filter(|kept| (1..cameras.len()).contains(kept)) {
        cameras.truncate(cameras.len() - kept);
        say!("note     the {kept} kept cameras are left out: their photos are there");
    }
    say!("cameras  {} from {}", cameras.len(), arguments.cameras.display());
    let poses: Vec<Pose> = cameras.iter().map(|camera| camera.pose).collect();
    let up = arguments.up.or(plan.as_ref().map(|plan| plan.region.up)).or(common_up(&poses)).unwrap_or(DVec3::Z);
    let wanted = formats(arguments)?;
    if wanted.contains(&Format::Dji) && !(1.0..=15.0).contains(&arguments.speed) {
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
    if let Some(place) = &arguments.geo {
        check_areas(plan.as_ref(), place)?;
        let middle = poses.iter().map(|pose| pose.position).sum::<DVec3>() / poses.len() as f64;
        let earth = georeference(place, middle, up)?;
        let rules = Rules {
            takeoff: takeoff(arguments, plan.as_ref(), &earth, middle, up)?,
            lowest: arguments.lowest,
            gimbal: arguments.gimbal,
            speed: arguments.speed,
        };
        let tour = plan.and_then(|plan| plan.tour).unwrap_or(Tour { path: Vec::new(), blocked: 0 });
        let flight = Flight::new(&cameras, &tour.path, &earth, &rules)?;
        check_older(&arguments.out, &flight)?;
        for format in wanted.iter().filter(|format| format.is_geographic()) {
            write_flight(&folder, *format, &flight)?;
        }
        print(&flight);
        if tour.blocked > 0 {
            say!(
                "warning  {} legs of the tour lead through the surface or a limit: do not fly them as they are",
                tour.blocked
            );
        }
    }
    let path = folder.path().to_owned();
    folder.commit()?;
    say!("written  {}", path.display());
    Ok(Ended::Done)
}

fn check(arguments: &Arguments) -> Result<()> {
    let numbers = [Some(arguments.lowest), Some(arguments.speed), arguments.takeoff];
    if numbers.into_iter().flatten().any(|number| !number.is_finite()) || arguments.speed <= 0.0 {
        return Err(Error::request("--takeoff, --lowest and --speed take numbers, and --speed one above zero"));
    }
    if arguments.geo.is_none() && arguments.takeoff.is_some() {
        return Err(Error::request("--takeoff is for missions, which need a place on Earth; give one with --geo"));
    }
    Ok(())
}

fn formats(arguments: &Arguments) -> Result<Vec<Format>> {
    let all = Format::value_variants().iter().copied();
    if arguments.to.is_empty() {
        return Ok(all.filter(|format| arguments.geo.is_some() || !format.is_geographic()).collect());
    }
    if arguments.geo.is_none()
        && let Some(format) = arguments.to.iter().find(|format| format.is_geographic())
    {
        let name = format.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned());
        return Err(Error::request(format!("--to {name} needs a place on Earth; give one with --geo")));
    }
    Ok(all.filter(|format| arguments.to.contains(format)).collect())
}

/// The plan beside the cameras, where there is one.
fn plan(cameras: &Path) -> Option<Plan> {
    let file = io::json_file(cameras).ok()?;
    io::json(&file, &std::fs::read(&file).ok()?).ok()
}

fn parse_gimbal(text: &str) -> Result<[f64; 2], String> {
    let [low, high] = super::options::numbers::<2>(text, "the lowest and the highest pitch, LOW,HIGH")?;
    let valid = -90.0 <= low && low < high && high <= 90.0;
    if valid { Ok([low, high]) } else { Err("give degrees from -90 (down) to 90 (up), the lower one first".into()) }
}

/// Altitude of the take-off.
fn takeoff(arguments: &Arguments, plan: Option<&Plan>, earth: &Georeference, middle: DVec3, up: DVec3) -> Result<f64> {
    let lowest = |bounds: &Bounds| (bounds.min * up).min(bounds.max * up).element_sum();
    let height = plan.and_then(|plan| plan.region.floor.or(plan.surface.as_ref().map(lowest)));
    match (arguments.takeoff, height) {
        (Some(altitude), _) => Ok(altitude),
        (None, Some(height)) => Ok(earth.place(middle + (height - middle.dot(up)) * up)?.altitude),
        (None, None) => Err(Error::request(
            "nothing says how high the drone takes off: give --takeoff ALTITUDE, or cameras of a plan, whose floor or surface says it",
        )),
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

/// Refuses another place on Earth than that by which the plan keeps out of areas there.
fn check_areas(plan: Option<&Plan>, place: &str) -> Result<()> {
    let areas = plan.into_iter().flat_map(|plan| &plan.limits.keep_out).filter(|volume| !volume.geo.is_empty());
    match areas.into_iter().find(|volume| volume.geo != place) {
        Some(area) => Err(Error::request(format!(
            "--geo {place}: the plan keeps out of {} by --geo {}; give that, or plan again",
            area.file, area.geo
        ))),
        None => Ok(()),
    }
}

/// Refuses a folder that holds missions which this flight does not replace: somebody would fly them.
fn check_older(out: &Path, flight: &Flight) -> Result<()> {
    let stems: Vec<String> = (0..flight.missions.len()).map(|i| stem(flight, i)).collect();
    let mut names: Vec<PathBuf> =
        std::fs::read_dir(out).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
    names.sort();
    let older = names.into_iter().find(|path| {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let is_mission =
            ["kmz", "plan", "csv"].iter().any(|extension| path.extension().is_some_and(|of| of == *extension));
        let number =
            stem.strip_prefix("mission-").is_some_and(|number| number.bytes().all(|digit| digit.is_ascii_digit()));
        is_mission && (stem == "mission" || number) && !stems.contains(&stem)
    });
    match older {
        Some(path) => Err(Error::input(
            &path,
            "it is of an earlier export and would stay beside this one; remove it, or name another folder",
        )),
        None => Ok(()),
    }
}

/// Name of a mission's files, but for the extension.
fn stem(flight: &Flight, mission: usize) -> String {
    match flight.missions.len() {
        1 => "mission".to_owned(),
        _ => format!("mission-{}", mission + 1),
    }
}

fn write_flight(folder: &OutputFolder, format: Format, flight: &Flight) -> Result<()> {
    let each = |extension: &str, bytes: &dyn Fn(&Mission) -> Result<Vec<u8>>| {
        for (i, mission) in flight.missions.iter().enumerate() {
            folder.write(&format!("{}.{extension}", stem(flight, i)), bytes(mission)?)?;
        }
        Ok(())
    };
    match format {
        Format::Dji => each("kmz", &dji::kmz),
        Format::Qgc => each("plan", &|mission| Ok(qgc::plan(mission).into_bytes())),
        Format::Litchi => each("csv", &|mission| Ok(litchi::csv(mission).into_bytes())),
        Format::Kml => folder.write("mission.kml", kml::kml(&flight.missions)),
        Format::Geojson => folder.write("mission.geojson", geojson::geojson(&flight.missions)),
        Format::Ros | Format::Glb | Format::Blender | Format::Usd => Ok(()),
    }
}

fn print(flight: &Flight) {
    let waypoints = || flight.missions.iter().flat_map(|mission| &mission.waypoints);
    let photos = waypoints().filter(|waypoint| waypoint.photo.is_some()).count();
    let heights = |fold: fn(f64, f64) -> f64| waypoints().map(|waypoint| waypoint.height).reduce(fold).unwrap_or(0.0);
    if let Some(first) = waypoints().next() {
        say!("flight   from {} looking to {:.0} degrees", first.place, first.heading);
    }
    say!(
        "         {} mission{}, {photos} photos, {:.0} m, about {:.0} min; {:.1} to {:.1} m above the take-off at {:.1} m",
        flight.missions.len(),
        if flight.missions.len() == 1 { "" } else { "s" },
        flight.length,
        (flight.seconds() / 60.0).ceil(),
        heights(f64::min),
        heights(f64::max),
        flight.missions.first().map_or(0.0, |mission| mission.takeoff)
    );
    for note in &flight.notes {
        say!("note     {note}");
    }
    say!(
        "warning  missions were never flown, and the ways to their first waypoint and home are not planned: check each in your app, and what \
         stands in its way, before you fly"
    );
}

//! Missions of `camsplat export`: written, read back, and held against the plan.

use std::path::{Path, PathBuf};

use clap::Args;
use glam::DVec3;
use serde::Deserialize;

use super::place::georeference;
use crate::app::export::check::{Surroundings, faults, format_of, read, shorten};
use crate::app::export::georeference::Georeference;
use crate::app::export::mission::{Flight, Mission, Rules, Zone};
use crate::app::export::terrain::Terrain;
use crate::app::export::written::differences;
use crate::app::export::{Format, dji, geojson, kml, litchi, qgc};
use crate::files::io;
use crate::files::io::folder::OutputFolder;
use crate::scene::camera::{Camera, Pose, common_up, parallel};
use crate::scene::limits::Limits;
use crate::scene::proxy::{Orientation, Proxy};
use crate::scene::region::Region;
use crate::{Error, Result};

/// Metres around the first waypoint within which the ground is looked for, and above it from which on something is no ground.
const AROUND: f64 = 12.0;
const RAISED: f64 = 1.0;

/// How cameras are flown.
#[derive(Args, Debug)]
pub struct MissionOptions {
    /// Where the scene lies on Earth: LAT,LON,ALT[,HEADING] of its origin, in metres, its +Y (-Z where Y is up) pointing to HEADING degrees
    /// from north; utm:ZONE[,EAST,NORTH[,ALT]], such as utm:33N, for coordinates in UTM, with the offset to add to them; ecef for geocentric
    /// ones; or a capture in the same frame whose photos have GPS positions
    #[arg(long, value_name = "PLACE", allow_hyphen_values = true)]
    pub geo: Option<String>,
    /// Altitude of the place that the drone takes off from, in metres as those of --geo [default: that of the ground around the
    /// first waypoint]
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
    pub speed: f64,
    /// Surface that the drone flies over and around, in the frame of the cameras [default: the plan's, where it still is]
    #[arg(long, value_name = "FILE")]
    surface: Option<PathBuf>,
    /// Only hold a mission that was written before (.kmz, .plan, .csv, .kml or .geojson), perhaps edited since, against the cameras, the
    /// surface and the areas to keep out of, with the same options as for writing it; repeatable
    #[arg(long, value_name = "FILE", conflicts_with_all = ["out", "force", "to"])]
    check: Vec<PathBuf>,
}

/// What a plan says beside its cameras.
#[derive(Deserialize)]
pub struct Plan {
    /// Where cameras may stand.
    pub region: Region,
    /// How many cameras, the last ones, were there before.
    #[serde(default)]
    pub kept: usize,
    /// The way along all cameras.
    #[serde(default)]
    pub tour: Option<Tour>,
    /// What cameras keep to.
    #[serde(default)]
    pub limits: Limits,
    /// The surface that it was made for.
    pub surface: Option<PlannedSurface>,
}

/// A way along all cameras.
#[derive(Deserialize)]
pub struct Tour {
    path: Vec<DVec3>,
    #[serde(default)]
    blocked: usize,
}

/// A surface that a plan was made for.
#[derive(Deserialize)]
pub struct PlannedSurface {
    #[serde(default)]
    path: PathBuf,
    min: DVec3,
    max: DVec3,
}

impl PlannedSurface {
    /// The file, by its path or by its name in the plan's folder or that above.
    fn found(&self, plan: &Path) -> Option<PathBuf> {
        let name = self.path.file_name()?;
        let folders = plan.ancestors().take(3).map(|folder| folder.join(name));
        std::iter::once(self.path.clone()).chain(folders).find(|file| file.exists())
    }
}

/// Where cameras were read from, which cameras, and up if it is given.
#[derive(Clone, Copy)]
pub struct Source<'s> {
    /// The file or folder.
    pub path: &'s Path,
    /// The cameras.
    pub cameras: &'s [Camera],
    /// Up in their frame.
    pub up: Option<DVec3>,
}

/// A flight and what it is held against.
struct Planned {
    flight: Flight,
    earth: Georeference,
    terrain: Option<Terrain>,
    limits: Limits,
    clearance: f64,
}

impl MissionOptions {
    /// Whether the options make sense together.
    ///
    /// # Errors
    /// Where they do not.
    pub fn validate(&self) -> Result<()> {
        let numbers = [Some(self.lowest), Some(self.speed), self.takeoff];
        // A tenth of a metre per second is the least that formats write.
        if numbers.into_iter().flatten().any(|number| !number.is_finite()) || self.speed < 0.1 {
            return Err(Error::request(
                "--takeoff, --lowest and --speed take numbers, and --speed one above zero, 0.1 at least",
            ));
        }
        let of_missions = [
            ("--takeoff", self.takeoff.is_some()),
            ("--surface", self.surface.is_some()),
            ("--check", !self.check.is_empty()),
        ];
        match (&self.geo, of_missions.iter().find(|(_, given)| *given)) {
            (None, Some((option, _))) => Err(Error::request(format!(
                "{option} is for missions, which need a place on Earth; give one with --geo"
            ))),
            _ => Ok(()),
        }
    }

    /// Writes missions in those of the formats that are geographic, holds each against the plan, and prints what came out.
    ///
    /// # Errors
    /// Where they cannot be flown.
    pub fn write(
        &self,
        place: &str,
        (folder, formats): (&OutputFolder, &[Format]),
        source: Source<'_>,
        plan: Option<&Plan>,
    ) -> Result<()> {
        let planned = self.planned(place, source, plan)?;
        check_older(folder.path(), &planned.flight)?;
        for format in formats.iter().filter(|format| format.is_geographic()) {
            for file in files(*format, &planned.flight)? {
                let found = planned.faults(&file, &file.bytes)?;
                // What is looked at on a map shows what is wrong; what is flown must not be.
                let flown = matches!(format, Format::Dji | Format::Qgc | Format::Litchi);
                if let (Some(fault), true) = (found.first(), flown) {
                    return Err(Error::request(format!(
                        "{} cannot be flown: {fault}; plan again, or look at it on a map with --to kml,geojson",
                        file.name
                    )));
                }
                for fault in found {
                    say!("warning  {}: {fault}", file.name);
                }
                folder.write(&file.name, file.bytes)?;
            }
        }
        print(&planned);
        let blocked = plan.and_then(|plan| plan.tour.as_ref()).map_or(0, |tour| tour.blocked);
        if blocked > 0 {
            say!(
                "warning  {blocked} legs of the tour lead through the surface or a limit: do not fly them as they are"
            );
        }
        Ok(())
    }

    /// Holds missions that were written before against the plan.
    ///
    /// # Errors
    /// Where one is not as it should be.
    pub fn check(&self, place: &str, source: Source<'_>, plan: Option<&Plan>) -> Result<()> {
        let planned = self.planned(place, source, plan)?;
        let mut wrong = Vec::new();
        for file in &self.check {
            let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let extension = file.extension().unwrap_or_default().to_string_lossy().into_owned();
            let Some(format) = format_of(&extension) else {
                return Err(Error::input(file, "it is no mission; give a .kmz, .plan, .csv, .kml or .geojson"));
            };
            let bytes = std::fs::read(file).map_err(|source| io::unreadable(file, source))?;
            let (mission, found) = planned.best(format, &name, &bytes)?;
            let which =
                if planned.flight.missions.len() > 1 { format!(", held against {mission}") } else { String::new() };
            let verdict = if found.is_empty() { "as planned" } else { "not as planned" };
            say!("check    {}: {verdict}{which}", file.display());
            found.iter().for_each(|fault| say!("         {fault}"));
            wrong.extend((!found.is_empty()).then_some(file));
        }
        print(&planned);
        match wrong[..] {
            [] => Ok(()),
            [file, ..] => Err(Error::input(file, "it is not as planned (above); do not fly it, export it again")),
        }
    }

    fn planned(&self, place: &str, source: Source<'_>, plan: Option<&Plan>) -> Result<Planned> {
        let Source { path: beside, cameras, up } = source;
        check_areas(plan, place)?;
        let poses: Vec<Pose> = cameras.iter().map(|camera| camera.pose).collect();
        let middle = poses.iter().map(|pose| pose.position).sum::<DVec3>() / poses.len().max(1) as f64;
        let earth = georeference(place, middle, upward(place, &poses, up.or(plan.map(|plan| plan.region.up)))?)?;
        let limits = plan.map_or_else(Limits::default, |plan| plan.limits.clone());
        let zone = |name: &str, ring: &Vec<[f64; 2]>| Zone { name: name.to_owned(), ring: ring.clone() };
        let zones: Vec<Zone> = limits
            .keep_out
            .iter()
            .flat_map(|volume| volume.areas.iter().map(|ring| zone(&volume.file, ring)))
            .collect();
        let path = plan.and_then(|plan| plan.tour.as_ref()).map_or(&[][..], |tour| &tour.path);
        let terrain = self.terrain(plan, beside, &earth)?;
        let first = path.first().copied().or(poses.first().map(|pose| pose.position)).unwrap_or(middle);
        let rules = Rules {
            takeoff: self.takeoff_altitude(first, &earth, terrain.as_ref(), plan)?,
            top: top(first, &earth, terrain.as_ref(), plan)?,
            lowest: self.lowest,
            gimbal: self.gimbal,
            speed: self.speed,
        };
        let flight = Flight::new(cameras, path, &earth, terrain.as_ref(), &zones, &rules)?;
        let clearance = plan.map_or(0.0, |plan| plan.region.clearance);
        Ok(Planned { flight, earth, terrain, limits, clearance })
    }

    /// The surface: that which is given, or the plan's, where it can still be read.
    fn terrain(&self, plan: Option<&Plan>, beside: &Path, earth: &Georeference) -> Result<Option<Terrain>> {
        let surface = match (&self.surface, plan.and_then(|plan| plan.surface.as_ref())) {
            (Some(file), _) => io::read_surface(file)?,
            // From where the plan was made; else beside it.
            (None, Some(planned)) => match planned.found(beside).map(|file| io::read_surface(&file)) {
                Some(Ok(surface)) => surface,
                _ => {
                    say!(
                        "warning  the plan's surface {} is not there: legs are not held against it; give it with --surface",
                        planned.path.display()
                    );
                    return Ok(None);
                }
            },
            (None, None) => {
                say!("warning  no surface is known: legs are not held against one; give it with --surface");
                return Ok(None);
            }
        };
        Ok(Some(Terrain::new(Proxy::new(&surface, Orientation::Trusted)?.occluder, earth.up())))
    }

    /// Altitude of the take-off: that which is given, of the ground around the first waypoint, or of the lowest point of the plan's surface.
    fn takeoff_altitude(
        &self,
        first: DVec3,
        earth: &Georeference,
        terrain: Option<&Terrain>,
        plan: Option<&Plan>,
    ) -> Result<f64> {
        if let Some(altitude) = self.takeoff {
            return Ok(altitude);
        }
        let up = earth.up();
        let lowest = |bounds: &PlannedSurface| (bounds.min * up).min(bounds.max * up).element_sum();
        let below = terrain.and_then(|terrain| terrain.below(first));
        let ground = terrain.and_then(|terrain| terrain.ground(first, AROUND / earth.scale()));
        let bottom = terrain.map(Terrain::bottom).or(plan.and_then(|plan| plan.surface.as_ref()).map(lowest));
        match ground.or(bottom) {
            Some(height) => {
                let altitude = earth.place(first + (height - first.dot(up)) * up)?.altitude;
                let by = match ground {
                    Some(_) => "the ground around the first waypoint",
                    None => "the lowest point of the surface, as nothing is below the first waypoint",
                };
                say!("take-off at {altitude:.1} m, {by} (--takeoff gives another altitude)");
                let above = earth.scale() * below.map_or(0.0, |below| below - height);
                if above > RAISED {
                    say!(
                        "note     the first waypoint is over something {above:.1} m high: take off beside it, on the ground"
                    );
                }
                Ok(altitude)
            }
            None => Err(Error::request(
                "nothing says how high the drone takes off: give --takeoff ALTITUDE, or --surface, whose ground says it",
            )),
        }
    }
}

impl Planned {
    /// The mission that a file is of, by its name or, where an app has given it another, by what fits best; and what is wrong with it.
    fn best(&self, format: Format, name: &str, bytes: &[u8]) -> Result<(String, Vec<String>)> {
        let mut tried = files(format, &self.flight)?;
        if tried.iter().any(|file| file.name == name) {
            tried.retain(|file| file.name == name);
        }
        let mut found = Vec::new();
        for file in tried {
            let faults = self.faults(&file, bytes)?;
            found.push((file.name, faults));
        }
        let fewest = found.into_iter().min_by_key(|(_, faults)| faults.len());
        Ok(fewest.unwrap_or_else(|| (name.to_owned(), vec!["the plan has no such mission".to_owned()])))
    }

    /// What is wrong with bytes that should be those of a file.
    fn faults(&self, file: &MissionFile<'_>, bytes: &[u8]) -> Result<Vec<String>> {
        let around = Surroundings {
            earth: &self.earth,
            terrain: self.terrain.as_ref(),
            limits: &self.limits,
            clearance: self.clearance,
        };
        let flown = match read(file.format, bytes) {
            Ok(flown) => flown,
            Err(what) => return Ok(vec![what]),
        };
        // Places, photos and legs first, in words; then whatever else would be flown otherwise.
        let mut found = faults(&flown, file.missions, &around)?;
        if found.is_empty() {
            let others = differences(file.format, &file.bytes, bytes);
            shorten(&mut found, others.unwrap_or_else(|what| vec![what]));
        }
        Ok(found)
    }
}

/// Up in the frame of the scene: as it is given, as the place on Earth implies it, or as cameras hold it.
fn upward(place: &str, poses: &[Pose], given: Option<DVec3>) -> Result<DVec3> {
    let implied = place.starts_with("utm:").then_some(DVec3::Z);
    let anchored = place.split(',').all(|number| number.trim().parse::<f64>().is_ok());
    if given.is_none() && anchored && parallel(poses) {
        return Err(Error::request(
            "--geo: all cameras look the same way, ahead or down, and nothing says which; give --up",
        ));
    }
    Ok(given.or(implied).or_else(|| common_up(poses)).unwrap_or(DVec3::Z))
}

/// Altitude of the highest point of the surface.
fn top(near: DVec3, earth: &Georeference, terrain: Option<&Terrain>, plan: Option<&Plan>) -> Result<Option<f64>> {
    let up = earth.up();
    let highest = |bounds: &PlannedSurface| (bounds.min * up).max(bounds.max * up).element_sum();
    let height = terrain.map(Terrain::top).or(plan.and_then(|plan| plan.surface.as_ref()).map(highest));
    height.map(|height| Ok(earth.place(near + (height - near.dot(up)) * up)?.altitude)).transpose()
}

fn parse_gimbal(text: &str) -> Result<[f64; 2], String> {
    let [low, high] = super::options::numbers::<2>(text, "the lowest and the highest pitch, LOW,HIGH")?;
    let valid = -90.0 <= low && low < high && high <= 90.0;
    if valid { Ok([low, high]) } else { Err("give degrees from -90 (down) to 90 (up), the lower one first".into()) }
}

/// Refuses another place on Earth than that by which the plan keeps out of areas there.
fn check_areas(plan: Option<&Plan>, place: &str) -> Result<()> {
    let areas = plan.into_iter().flat_map(|plan| &plan.limits.keep_out).filter(|volume| !volume.geo.is_empty());
    let numbers = |text: &str| text.split(',').map(|number| number.trim().parse().ok()).collect::<Option<Vec<f64>>>();
    let same = |geo: &str| geo == place || numbers(geo).is_some_and(|numbers_of| numbers(place) == Some(numbers_of));
    match areas.into_iter().find(|volume| !same(&volume.geo)) {
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

/// A file of missions, as it is written.
struct MissionFile<'f> {
    name: String,
    format: Format,
    /// One, or all where the format holds all.
    missions: &'f [Mission],
    bytes: Vec<u8>,
}

/// The files of a format; none of one that is not geographic.
fn files(format: Format, flight: &Flight) -> Result<Vec<MissionFile<'_>>> {
    let all = &flight.missions[..];
    let whole = |name: &str, text: String| {
        Ok(vec![MissionFile { name: name.into(), format, missions: all, bytes: text.into_bytes() }])
    };
    let each = |extension: &str, bytes: fn(&Mission) -> Result<Vec<u8>>| {
        let file = |i: usize| {
            let name = format!("{}.{extension}", stem(flight, i));
            Ok(MissionFile { name, format, missions: &all[i..=i], bytes: bytes(&all[i])? })
        };
        (0..all.len()).map(file).collect()
    };
    match format {
        Format::Dji => each("kmz", dji::kmz),
        Format::Qgc => each("plan", |mission| Ok(qgc::plan(mission).into_bytes())),
        Format::Litchi => each("csv", |mission| Ok(litchi::csv(mission).into_bytes())),
        Format::Kml => whole("mission.kml", kml::kml(all)),
        Format::Geojson => whole("mission.geojson", geojson::geojson(all)),
        Format::Ros | Format::Glb | Format::Blender | Format::Usd => Ok(Vec::new()),
    }
}

fn print(Planned { flight, .. }: &Planned) {
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
        flight.missions.first().map_or(0.0, |mission| mission.home.altitude)
    );
    for note in &flight.notes {
        say!("note     {note}");
    }
    say!(
        "warning  missions were never flown, and the ways to their first waypoint and home are not planned: check each in your app, and what \
         stands in its way, before you fly"
    );
}

//! Missions for drones: where to fly, where to look, and where to take a photo.

use glam::DVec3;

use super::georeference::{Geodetic, Georeference};
use super::terrain::Terrain;
use crate::scene::camera::Camera;
use crate::{Error, Result};

/// Waypoints of a mission at most, which every app takes.
pub const MAX_WAYPOINTS: usize = 99;
/// Seconds at a waypoint for a photo: to stop, to let the gimbal settle, and to take it.
const PHOTO_SECONDS: f64 = 4.0;
/// Roll in degrees from which on it is mentioned that drones have none.
const ROLLED: f64 = 5.0;
/// Metres above the ground from which on heights are mentioned: the limit of the open category in the EU, and of Part 107 in the US (400 feet).
const HIGHEST: f64 = 120.0;
/// Metres that the drone climbs to before it flies to the first waypoint, at least, and above what stands on the way.
const CLIMB: f64 = 20.0;
const ABOVE_ALL: f64 = 5.0;

/// What a flight must keep to.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    /// Altitude of the place of the take-off, in metres.
    pub takeoff: f64,
    /// Altitude of the highest point of the surface, in metres.
    pub top: Option<f64>,
    /// No waypoint is lower above the take-off than so many metres.
    pub lowest: f64,
    /// Least and greatest pitch of the gimbal, in degrees above the horizon.
    pub gimbal: [f64; 2],
    /// Metres per second.
    pub speed: f64,
}

/// A place on the way.
#[derive(Clone, Debug, PartialEq)]
pub struct Waypoint {
    /// Where it is.
    pub place: Geodetic,
    /// Metres above the take-off.
    pub height: f64,
    /// Where the nose points: degrees clockwise from true north in [0, 360).
    pub heading: f64,
    /// Where the gimbal points: degrees above the horizon.
    pub pitch: f64,
    /// Name of the photo that is taken; none where the drone only passes.
    pub photo: Option<String>,
}

/// Waypoints that are flown in one go, after a take-off of its own.
#[derive(Clone, Debug)]
pub struct Mission {
    /// In their order.
    pub waypoints: Vec<Waypoint>,
    /// Metres per second.
    pub speed: f64,
    /// The place of the take-off: that below the first waypoint of the flight.
    pub home: Geodetic,
    /// Metres above the take-off to which the drone climbs before it flies to the first waypoint: above all of the surface.
    pub climb: f64,
    /// Areas on Earth that are not to be flown over.
    pub zones: Vec<Zone>,
}

/// An area on Earth that a plan keeps out of.
#[derive(Clone, Debug, PartialEq)]
pub struct Zone {
    /// The file that it is from.
    pub name: String,
    /// Corners in degrees east and north, the first one not repeated at the end.
    pub ring: Vec<[f64; 2]>,
}

/// All missions of a plan.
pub struct Flight {
    /// One after the other.
    pub missions: Vec<Mission>,
    /// Length of the way in metres, from the first waypoint to the last.
    pub length: f64,
    /// What the user should know.
    pub notes: Vec<String>,
}

impl Flight {
    /// The flight that takes all photos along `path` (corners in the frame of the cameras, all cameras among them in their order; empty for
    /// straight legs from camera to camera).
    ///
    /// # Errors
    /// Where a waypoint would be lower than allowed, or is not on Earth.
    pub fn new(
        cameras: &[Camera],
        path: &[DVec3],
        earth: &Georeference,
        terrain: Option<&Terrain>,
        zones: &[Zone],
        rules: &Rules,
    ) -> Result<Self> {
        let (stops, toured) = stops(cameras, path);
        let (mut high, mut highest) = (0, 0.0f64);
        let mut waypoints = Vec::with_capacity(stops.len());
        let (mut beyond, mut farthest, mut rolled) = (0, 0.0f64, 0);
        for (i, (position, photo)) in stops.iter().enumerate() {
            let looks = photo.or_else(|| stops[i..].iter().find_map(|(_, photo)| *photo)).or(cameras.last());
            let Some(camera) = looks else { continue };
            let (heading, wanted) = heading_and_pitch(earth, camera);
            let pitch = wanted.clamp(rules.gimbal[0], rules.gimbal[1]);
            if photo.is_some() {
                beyond += usize::from(pitch != wanted);
                farthest = farthest.max((pitch - wanted).abs());
                rolled += usize::from(roll(earth, camera).abs() > ROLLED);
            }
            let place = earth.place(*position)?;
            let height = place.altitude - rules.takeoff;
            if height < rules.lowest {
                let name = photo.map_or("the way to a camera".to_owned(), |camera| format!("camera {:?}", camera.name));
                return Err(Error::request(format!(
                    "{name} is {height:.1} m above the take-off, and `lowest` is {:.1} m: plan with a floor or `heights` above that",
                    rules.lowest
                )));
            }
            let below = terrain.and_then(|terrain| terrain.below(*position));
            let above = below.map_or(height, |below| earth.scale() * (position.dot(earth.up()) - below));
            high += usize::from(above > HIGHEST);
            highest = highest.max(above);
            waypoints.push(Waypoint { place, height, heading, pitch, photo: photo.map(|camera| camera.name.clone()) });
        }
        let mut notes = Vec::new();
        if !toured {
            notes.push("no tour goes through these cameras: legs are straight, whatever is between".into());
        }
        if beyond > 0 {
            notes.push(format!(
                "{beyond} of {} cameras look farther up or down than the gimbal turns ({:.0} to {:.0} degrees); they are turned by {farthest:.0} \
                 degrees at most, and what is expected of the plan is not of these",
                cameras.len(),
                rules.gimbal[0],
                rules.gimbal[1]
            ));
        }
        if rolled > 0 {
            notes.push(format!(
                "{rolled} of {} cameras are rolled, which drones are not: they are taken level",
                cameras.len()
            ));
        }
        if high > 0 {
            notes.push(format!(
                "{high} of {} waypoints are more than {HIGHEST:.0} m above the ground, the highest {highest:.0} m: most countries allow no more",
                waypoints.len()
            ));
        }
        let Some(first) = waypoints.first() else {
            return Err(Error::request("there are no cameras; a mission needs one at least"));
        };
        let home = Geodetic { altitude: rules.takeoff, ..first.place };
        let climb = rules.top.map_or(0.0, |top| top - rules.takeoff + ABOVE_ALL).max(CLIMB);
        let way: Vec<DVec3> = stops.iter().map(|(position, _)| *position).collect();
        let length = 0.0 + earth.scale() * way.windows(2).map(|pair| pair[0].distance(pair[1])).sum::<f64>();
        let mission = |waypoints: &[Waypoint]| Mission {
            waypoints: waypoints.to_vec(),
            speed: rules.speed,
            home,
            climb,
            zones: zones.to_vec(),
        };
        Ok(Self { missions: waypoints.chunks(MAX_WAYPOINTS).map(mission).collect(), length, notes })
    }

    /// Seconds that it takes, without take-offs and landings.
    pub fn seconds(&self) -> f64 {
        let photos =
            self.missions.iter().flat_map(|mission| &mission.waypoints).filter(|at| at.photo.is_some()).count();
        let speed = self.missions.first().map_or(1.0, |mission| mission.speed);
        self.length / speed + PHOTO_SECONDS * photos as f64
    }
}

/// Places in their order, those of photos with the camera; and whether the path goes through all cameras, which are in straight legs where
/// it does not.
fn stops<'c>(cameras: &'c [Camera], path: &[DVec3]) -> (Vec<(DVec3, Option<&'c Camera>)>, bool) {
    let photo = |camera: &'c Camera| (camera.pose.position, Some(camera));
    let mut left = cameras.iter().peekable();
    let mut stops = Vec::new();
    for corner in path {
        let near = 1e-9 * (1.0 + corner.length());
        match left.next_if(|camera| camera.pose.position.distance(*corner) <= near) {
            Some(camera) => stops.push(photo(camera)),
            None => stops.push((*corner, None)),
        }
    }
    match left.peek() {
        Some(_) => (cameras.iter().map(photo).collect(), false),
        None => (stops, true),
    }
}

/// Where a camera looks. One that looks straight up or down has the heading of its image's up.
fn heading_and_pitch(earth: &Georeference, camera: &Camera) -> (f64, f64) {
    let (heading, pitch) = earth.heading_and_pitch(camera.pose.forward());
    match pitch.abs() > 89.0 {
        true => (earth.heading_and_pitch(-pitch.signum() * camera.pose.up()).0, pitch),
        false => (heading, pitch),
    }
}

/// By how many degrees the camera's horizon is off the level.
fn roll(earth: &Georeference, camera: &Camera) -> f64 {
    earth.heading_and_pitch(camera.pose.rotation * DVec3::X).1
}

//! Missions that were read back, held against the flight that they should be, its surface and its areas.

use glam::DVec3;

use super::flown::{Flown, Height, Place};
use super::georeference::{Geodetic, Georeference};
use super::mission::{Mission, Waypoint};
use super::terrain::Terrain;
use super::{Format, dji, geojson, kml, litchi, qgc};
use crate::Result;
use crate::scene::distances::leg_to_triangle;
use crate::scene::limits::Limits;

/// Metres that a place may be off, beside and in height: formats have centimetres.
const OFF: f64 = 0.02;
const OFF_HEIGHT: f64 = 0.0101;
/// Degrees that a heading and a pitch may be off: DJI has whole and tenth ones.
const OFF_HEADING: f64 = 0.51;
const OFF_PITCH: f64 = 0.051;
/// Metres per second that the speed may be off: formats have tenths.
const OFF_SPEED: f64 = 0.051;
/// Part of a clearance by which a leg may fall short of it: a tour keeps it from cell to cell.
const SHORT: f64 = 0.1;
/// Degrees by which corners of areas may be off, a centimetre.
const OFF_DEGREES: f64 = 1e-7;
/// Faults that are named of each kind.
const NAMED: usize = 3;

/// What missions are held against beside the flight itself.
pub struct Surroundings<'s> {
    /// Where the scene is on Earth.
    pub earth: &'s Georeference,
    /// The surface, if it is known.
    pub terrain: Option<&'s Terrain>,
    /// What the plan keeps out of.
    pub limits: &'s Limits,
    /// How far legs stay from the surface, in units of the scene.
    pub clearance: f64,
}

/// Reads a file of a format.
///
/// # Errors
/// In words, where it cannot be read.
pub fn read(format: Format, bytes: &[u8]) -> Result<Flown, String> {
    match format {
        Format::Dji => dji::read(bytes),
        Format::Qgc => qgc::read(bytes),
        Format::Litchi => litchi::read(bytes),
        Format::Kml => kml::read(bytes),
        Format::Geojson => geojson::read(bytes),
        Format::Ros | Format::Glb | Format::Blender | Format::Usd => Err("it is no mission".into()),
    }
}

/// The format of a mission's file, by its extension.
pub fn format_of(extension: &str) -> Option<Format> {
    match extension.to_lowercase().as_str() {
        "kmz" => Some(Format::Dji),
        "plan" => Some(Format::Qgc),
        "csv" => Some(Format::Litchi),
        "kml" => Some(Format::Kml),
        "geojson" => Some(Format::Geojson),
        _ => None,
    }
}

/// What is wrong with what a file says of a mission, or, in formats that hold all missions, of the flight; nothing where it is right.
pub fn faults(flown: &Flown, missions: &[Mission], around: &Surroundings<'_>) -> Result<Vec<String>> {
    let Some(first) = missions.first() else { return Ok(vec!["the plan has no such mission".into()]) };
    let mut faults = flown.faults.clone();
    let nowhere = |place: &&Place| geodetic(place, first.home.altitude).validated().is_err();
    let places = flown.way.iter().chain(flown.photos.iter().map(|photo| &photo.place));
    if let Some(Place { latitude, longitude, .. }) = places.into_iter().find(nowhere) {
        return Ok(vec![format!("there is no place at {latitude}, {longitude} on Earth, or not at that height")]);
    }
    compare(&mut faults, flown, missions, around)?;
    if let Some(speed) = flown.speed
        && (speed - first.speed).abs() > OFF_SPEED
    {
        faults.push(format!("it flies at {speed} m/s, not at {:.1}", first.speed));
    }
    if let Some(home) = flown.home {
        let (aside, above) = apart(around.earth, &home, &first.home)?;
        if aside > OFF || above.abs() > OFF {
            faults.push(format!("its take-off is {}", misplaced(aside, above)));
        }
    }
    if let Some(found) = flown.climb
        && found < first.climb - OFF_HEIGHT
    {
        faults.push(format!("it climbs to {found:.1} m first, not to {:.1}", first.climb));
    }
    if let Some(zones) = &flown.zones {
        let wanted: Vec<_> = first.zones.iter().map(|zone| &zone.ring).collect();
        let alike =
            zones.len() == wanted.len() && zones.iter().zip(wanted).all(|(found, wanted)| same_ring(found, wanted));
        if !alike {
            faults.push("its areas to keep out of are not those of the plan".into());
        }
    }
    faults.extend(legs(flown, first.home.altitude, around)?);
    faults.extend(roofed(missions, around)?);
    Ok(faults)
}

/// Holds all missions of a flight, or one, against what a file says, place by place.
fn compare(faults: &mut Vec<String>, flown: &Flown, missions: &[Mission], around: &Surroundings<'_>) -> Result<()> {
    let waypoints: Vec<&Waypoint> = missions.iter().flat_map(|mission| &mission.waypoints).collect();
    let photos: Vec<&Waypoint> = waypoints.iter().copied().filter(|waypoint| waypoint.photo.is_some()).collect();
    let takeoff = missions.first().map_or(0.0, |mission| mission.home.altitude);
    let off = |place: &Place, wanted: &Waypoint| -> Result<Option<String>> {
        let (aside, above) = apart(around.earth, &geodetic(place, takeoff), &wanted.place)?;
        Ok((aside > OFF || above.abs() > OFF_HEIGHT).then(|| misplaced(aside, above)))
    };
    if flown.way.len() != waypoints.len() {
        faults.push(format!("it has {} waypoints, not {}", flown.way.len(), waypoints.len()));
    }
    if flown.photos.len() != photos.len() {
        faults.push(format!("it takes {} photos, not {}", flown.photos.len(), photos.len()));
    }
    let mut wrong = Vec::new();
    for (i, (place, wanted)) in flown.way.iter().zip(&waypoints).enumerate() {
        wrong.extend(off(place, wanted)?.map(|off| format!("waypoint {} is {off}", i + 1)));
    }
    for (photo, wanted) in flown.photos.iter().zip(&photos) {
        let name = wanted.photo.as_deref().unwrap_or_default();
        let turned = (photo.heading - wanted.heading + 180.0).rem_euclid(360.0) - 180.0;
        if let Some(off) = off(&photo.place, wanted)? {
            wrong.push(format!("photo {name:?} is {off}"));
        } else if turned.abs() > OFF_HEADING || (photo.pitch - wanted.pitch).abs() > OFF_PITCH {
            wrong.push(format!(
                "photo {name:?} looks to {:.1} and {:.1} degrees, not to {:.1} and {:.1}",
                photo.heading, photo.pitch, wanted.heading, wanted.pitch
            ));
        }
    }
    shorten(faults, wrong);
    Ok(())
}

/// What legs between the places of a file come too near to.
fn legs(flown: &Flown, takeoff: f64, around: &Surroundings<'_>) -> Result<Vec<String>> {
    let place = |place: &Place| around.earth.scene_point(&geodetic(place, takeoff));
    let places = flown.way.iter().map(place).collect::<Result<Vec<DVec3>>>()?;
    let scale = around.earth.scale();
    // What touches is too near, whatever the clearance.
    let wanted = ((1.0 - SHORT) * around.clearance).max(1e-9);
    let (mut near, mut within) = (Vec::new(), Vec::new());
    // A single place is a leg to itself.
    let ends = (1..places.len()).map(|i| [i - 1, i]).chain((places.len() == 1).then_some([0, 0]));
    for [from, to] in ends {
        let leg = [places[from], places[to]];
        let name = format!("the leg from waypoint {} to {}", from + 1, to + 1);
        if let Some(terrain) = around.terrain {
            let distance = terrain.clearance(leg[0], leg[1], wanted);
            if distance < wanted {
                near.push(format!(
                    "{name} passes the surface at {:.2} m, where {:.2} are to be kept",
                    scale * distance,
                    scale * around.clearance
                ));
            }
        }
        if leg.iter().any(|end| around.limits.behind_a_wall(*end)) {
            within.push(format!("{name} leads behind a wall"));
        }
        for volume in &around.limits.keep_out {
            let distance = volume
                .triangles
                .iter()
                .map(|corners| leg_to_triangle(leg[0], leg[1], corners))
                .fold(f64::INFINITY, f64::min);
            let kept = (1.0 - SHORT) * volume.margin;
            if distance < kept || distance == 0.0 || volume.holds(leg[0]) || volume.holds(leg[1]) {
                within.push(format!(
                    "{name} leads into {}, or its margin of {:.1} m",
                    volume.file,
                    scale * volume.margin
                ));
            }
        }
    }
    let mut faults = Vec::new();
    shorten(&mut faults, near);
    shorten(&mut faults, within);
    Ok(faults)
}

/// Whether the surface is in the way between the height that the drone climbs to and the first waypoint of a mission, which it comes down to,
/// or the last one, from which it goes home.
fn roofed(missions: &[Mission], around: &Surroundings<'_>) -> Result<Option<String>> {
    let Some(terrain) = around.terrain else { return Ok(None) };
    for mission in missions {
        let (first, last) = (mission.waypoints.first(), mission.waypoints.last());
        for (waypoint, name) in [(first, "first"), (last, "last")] {
            let Some(Waypoint { place, .. }) = waypoint else { continue };
            let high = Geodetic { altitude: place.altitude.max(mission.home.altitude + mission.climb), ..*place };
            if terrain.clearance(around.earth.scene_point(place)?, around.earth.scene_point(&high)?, 1e-9) < 1e-9 {
                return Ok(Some(format!(
                    "the surface lies above a mission's {name} waypoint, through which the drone would pass on its way from or to {:.0} m above \
                     the take-off: begin and end in the open; indoors nothing finds its way by GPS",
                    mission.climb
                )));
            }
        }
    }
    Ok(None)
}

/// A few of many alike, and how many more there are.
pub fn shorten(faults: &mut Vec<String>, mut more: Vec<String>) {
    let left = more.len().saturating_sub(NAMED);
    more.truncate(NAMED);
    faults.append(&mut more);
    if left > 0 {
        faults.push(format!("and {left} more like that"));
    }
}

fn geodetic(place: &Place, takeoff: f64) -> Geodetic {
    let altitude = match place.height {
        Height::AboveTakeoff(height) => takeoff + height,
        Height::Altitude(altitude) => altitude,
    };
    Geodetic { latitude: place.latitude, longitude: place.longitude, altitude }
}

/// How far a place is beside another, and above it, in metres.
fn apart(earth: &Georeference, found: &Geodetic, wanted: &Geodetic) -> Result<(f64, f64)> {
    let level = Geodetic { altitude: wanted.altitude, ..*found };
    let across = (earth.scene_point(&level)? - earth.scene_point(wanted)?).reject_from_normalized(earth.up());
    Ok((earth.scale() * across.length(), found.altitude - wanted.altitude))
}

fn misplaced(aside: f64, above: f64) -> String {
    format!("{aside:.2} m beside and {above:+.2} m above where it should be")
}

/// Whether two rings have the same corners, from whichever one and either way around.
fn same_ring(a: &[[f64; 2]], b: &[[f64; 2]]) -> bool {
    let near = |p: &[f64; 2], q: &[f64; 2]| (p[0] - q[0]).abs().max((p[1] - q[1]).abs()) < OFF_DEGREES;
    let (count, reversed) = (a.len(), a.iter().rev().copied().collect::<Vec<_>>());
    count == b.len()
        && [a, &reversed]
            .iter()
            .any(|a| (0..count.max(1)).any(|shift| (0..count).all(|i| near(&a[(i + shift) % count], &b[i]))))
}

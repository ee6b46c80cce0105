//! Litchi: a mission as the Mission Hub imports it, a line per waypoint.

use std::fmt::Write;

use super::flown::{Flown, Height, Photo, Place, number};
use super::mission::Mission;

/// Actions that a line has room for.
const ACTIONS: usize = 15;
/// Codes of actions, by Litchi's own numbers.
const STAY: i32 = 0;
const TAKE_PHOTO: i32 = 1;
const NO_ACTION: i32 = -1;
/// Milliseconds for the gimbal to settle before a photo.
const SETTLE: i32 = 2000;
/// The gimbal's pitch goes evenly from waypoint to waypoint.
const INTERPOLATE: i32 = 2;

/// Text of the CSV. Heights are above the take-off.
pub fn csv(mission: &Mission) -> String {
    let mut text = String::from(
        "latitude,longitude,altitude(m),heading(deg),curvesize(m),rotationdir,gimbalmode,gimbalpitchangle",
    );
    // Writing to a string cannot fail.
    (1..=ACTIONS).for_each(|i| _ = write!(text, ",actiontype{i},actionparam{i}"));
    text += ",altitudemode,speed(m/s),poi_latitude,poi_longitude,poi_altitude(m),poi_altitudemode,photo_timeinterval,photo_distinterval\n";
    for waypoint in &mission.waypoints {
        let place = &waypoint.place;
        let _ = write!(
            text,
            "{:.8},{:.8},{:.2},{:.1},0,0,{INTERPOLATE},{:.1}",
            place.latitude, place.longitude, waypoint.height, waypoint.heading, waypoint.pitch
        );
        let wanted: &[(i32, i32)] = if waypoint.photo.is_some() { &[(STAY, SETTLE), (TAKE_PHOTO, 0)] } else { &[] };
        for i in 0..ACTIONS {
            let (action, parameter) = wanted.get(i).copied().unwrap_or((NO_ACTION, 0));
            let _ = write!(text, ",{action},{parameter}");
        }
        let _ = writeln!(text, ",0,{:.1},0,0,0,0,-1,-1", mission.speed);
    }
    text
}

/// What a mission says.
///
/// # Errors
/// In words, where a line cannot be read.
pub fn read(bytes: &[u8]) -> Result<Flown, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "it is no text".to_owned())?;
    let (names, rows) = cells(text);
    let column = |name: &str| names.iter().position(|of| of == name).ok_or(format!("it has no column {name}"));
    let [latitude, longitude, altitude, heading, pitch, mode, speed] =
        ["latitude", "longitude", "altitude(m)", "heading(deg)", "gimbalpitchangle", "altitudemode", "speed(m/s)"]
            .map(column);
    let [latitude, longitude, altitude] = [latitude?, longitude?, altitude?];
    let [heading, pitch, mode, speed] = [heading?, pitch?, mode?, speed?];
    let actions: Vec<usize> = (1..=ACTIONS).map(|i| column(&format!("actiontype{i}"))).collect::<Result<_, _>>()?;
    let mut flown = Flown::default();
    for (i, row) in rows.iter().enumerate() {
        let values = row.iter().map(|cell| number(cell)).collect::<Result<Vec<f64>, _>>();
        let values = values.map_err(|e| format!("line {}: {e}", i + 2))?;
        if values.len() != names.len() {
            return Err(format!("line {} has {} values where {} are named", i + 2, values.len(), names.len()));
        }
        flown.require(values[mode] == 0.0, || format!("line {}: its altitude is not above the take-off", i + 2));
        let height = Height::AboveTakeoff(values[altitude]);
        let place = Place { latitude: values[latitude], longitude: values[longitude], height };
        flown.way.push(place);
        let photos = actions.iter().filter(|action| values[**action] == f64::from(TAKE_PHOTO)).count();
        let photo = Photo { place, heading: values[heading], pitch: values[pitch] };
        flown.photos.extend(std::iter::repeat_n(photo, photos));
        flown.require(flown.speed.is_none_or(|speed_before| speed_before == values[speed]), || {
            format!("line {}: its speed is another one", i + 2)
        });
        flown.speed = Some(values[speed]);
    }
    Ok(flown)
}

/// The names of the columns, and the cells of each line that is not empty, without quotation marks around them.
pub(super) fn cells(text: &str) -> (Vec<String>, Vec<Vec<String>>) {
    let row = |line: &str| line.split(',').map(|cell| cell.trim().trim_matches('"').to_owned()).collect::<Vec<_>>();
    let mut lines = text.trim_start_matches('\u{feff}').lines().filter(|line| !line.trim().is_empty()).map(row);
    (lines.next().unwrap_or_default(), lines.collect())
}

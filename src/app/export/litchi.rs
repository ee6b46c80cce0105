//! Litchi: a mission as the Mission Hub imports it, a line per waypoint.

use std::fmt::Write;

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

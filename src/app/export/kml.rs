//! KML 2.2: the way, and for every photo the view that it will have. Altitudes are given as they are.

use std::fmt::Write;

use super::georeference::Geodetic;
use super::mission::{Mission, Waypoint};
use crate::app::report::escape;

/// Text of the document.
pub fn kml(missions: &[Mission]) -> String {
    let waypoints: Vec<&Waypoint> = missions.iter().flat_map(|mission| &mission.waypoints).collect();
    let mut text = String::from(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<kml xmlns=\"http://www.opengis.net/kml/2.2\">\n<Document>\n\
         <name>camsplat</name>\n",
    );
    let at = |place: &Geodetic| format!("{:.8},{:.8},{:.3}", place.longitude, place.latitude, place.altitude);
    if waypoints.len() > 1 {
        let way: Vec<String> = waypoints.iter().map(|waypoint| at(&waypoint.place)).collect();
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "<Placemark>\n<name>way</name>\n<LineString>\n<altitudeMode>absolute</altitudeMode>\n\
             <coordinates>{}</coordinates>\n</LineString>\n</Placemark>\n",
            way.join(" ")
        );
    }
    for waypoint in waypoints {
        let Some(name) = &waypoint.photo else { continue };
        let Geodetic { latitude, longitude, altitude } = waypoint.place;
        let _ = write!(
            text,
            "<Placemark>\n<name>{}</name>\n<Camera>\n<longitude>{longitude:.8}</longitude>\n<latitude>{latitude:.8}</latitude>\n\
             <altitude>{altitude:.3}</altitude>\n<heading>{:.2}</heading>\n<tilt>{:.2}</tilt>\n<roll>0</roll>\n\
             <altitudeMode>absolute</altitudeMode>\n</Camera>\n\
             <Point>\n<altitudeMode>absolute</altitudeMode>\n<coordinates>{}</coordinates>\n</Point>\n</Placemark>\n",
            escape(&name.replace(char::is_control, "?")),
            waypoint.heading,
            waypoint.pitch + 90.0,
            at(&waypoint.place)
        );
    }
    text + "</Document>\n</kml>\n"
}

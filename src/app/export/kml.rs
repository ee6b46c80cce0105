//! KML 2.2: the way, and for every photo the view that it will have. Altitudes are given as they are.

use std::fmt::Write;

use super::flown::{Flown, Height, Photo, Place, number};
use super::georeference::Geodetic;
use super::mission::{Mission, Waypoint, Zone};
use crate::app::report::escape;
use crate::files::io::xml;

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
    for Zone { name, ring } in missions.first().map_or(&[][..], |mission| &mission.zones) {
        let corners = ring.iter().chain(&ring[..1]).map(|[east, north]| format!("{east:.8},{north:.8}"));
        let _ = write!(
            text,
            "<Placemark>\n<name>keep out: {}</name>\n<Polygon>\n<outerBoundaryIs>\n<LinearRing>\n<coordinates>{}</coordinates>\n\
             </LinearRing>\n</outerBoundaryIs>\n</Polygon>\n</Placemark>\n",
            escape(&name.replace(char::is_control, "?")),
            corners.collect::<Vec<_>>().join(" ")
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

/// What a document says.
///
/// # Errors
/// In words, where it cannot be read.
pub fn read(bytes: &[u8]) -> Result<Flown, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "it is no text".to_owned())?;
    let document = xml::document(text).map_err(|e| format!("it is no XML: {e}"))?;
    let inner = |node: roxmltree::Node<'_, '_>, name: &str| {
        let found = node.descendants().find(|inner| inner.tag_name().name() == name);
        found.and_then(|found| found.text().map(str::to_owned)).ok_or(format!("it has no {name}"))
    };
    let places = |text: &str| -> Result<Vec<Place>, String> {
        let place = |tuple: &str| match tuple.split(',').map(number).collect::<Result<Vec<_>, _>>()?[..] {
            [longitude, latitude, altitude] => Ok(Place { latitude, longitude, height: Height::Altitude(altitude) }),
            _ => Err(format!("{tuple} is not three coordinates")),
        };
        text.split_whitespace().map(place).collect()
    };
    let mut flown = Flown { zones: Some(Vec::new()), ..Flown::default() };
    for mark in document.descendants().filter(|node| node.tag_name().name() == "Placemark") {
        let has = |name: &str| mark.descendants().any(|inner| inner.tag_name().name() == name);
        let coordinates = inner(mark, "coordinates")?;
        if has("Polygon") {
            let corner = |tuple: &str| match tuple.split(',').map(number).collect::<Result<Vec<_>, _>>()?[..] {
                // Google Earth adds an altitude, which says nothing of an area.
                [east, north, ..] => Ok([east, north]),
                _ => Err(format!("{tuple} is not two coordinates")),
            };
            let mut ring = coordinates.split_whitespace().map(corner).collect::<Result<Vec<_>, String>>()?;
            ring.pop();
            flown.zones.get_or_insert_default().push(ring);
            continue;
        }
        flown.require(inner(mark, "altitudeMode")? == "absolute", || "an altitude is not absolute".into());
        if has("LineString") {
            flown.require(flown.way.is_empty(), || "it has more than one way".into());
            flown.way.extend(places(&coordinates)?);
            continue;
        }
        let [longitude, latitude, altitude, heading, tilt] = ["longitude", "latitude", "altitude", "heading", "tilt"]
            .map(|name| inner(mark, name).and_then(|text| number(&text)));
        let place = Place { latitude: latitude?, longitude: longitude?, height: Height::Altitude(altitude?) };
        flown.require(places(&coordinates)? == [place], || "the point of a photo is not where its camera is".into());
        flown.photos.push(Photo { place, heading: heading?, pitch: tilt? - 90.0 });
    }
    if flown.way.is_empty() {
        flown.way = flown.photos.iter().map(|photo| photo.place).collect();
    }
    Ok(flown)
}

//! GeoJSON (RFC 7946): a point for every photo and the way as a line.

use serde_json::{Value, json};

use super::flown::{Flown, Height, Photo, Place};
use super::georeference::Geodetic;
use super::mission::{Mission, Waypoint, Zone};

/// Text of the collection.
pub fn geojson(missions: &[Mission]) -> String {
    let at = |place: &Geodetic| json!([place.longitude, place.latitude, place.altitude]);
    let photo = |waypoint: &Waypoint| {
        waypoint.photo.as_ref().map(|name| {
            json!({
                "type": "Feature",
                "geometry": { "type": "Point", "coordinates": at(&waypoint.place) },
                "properties": {
                    "name": name,
                    "heading": waypoint.heading,
                    "pitch": waypoint.pitch,
                    "height_above_takeoff": waypoint.height
                }
            })
        })
    };
    let waypoints: Vec<&Waypoint> = missions.iter().flat_map(|mission| &mission.waypoints).collect();
    let mut features: Vec<Value> = waypoints.iter().filter_map(|waypoint| photo(waypoint)).collect();
    // A line has two ends.
    if waypoints.len() > 1 {
        let way: Vec<Value> = waypoints.iter().map(|waypoint| at(&waypoint.place)).collect();
        features.push(json!({
            "type": "Feature",
            "geometry": { "type": "LineString", "coordinates": way },
            "properties": { "name": "way" }
        }));
    }
    for Zone { name, ring } in missions.first().map_or(&[][..], |mission| &mission.zones) {
        // RFC 7946 has outlines go round to the left, and end where they begin.
        let mut ring = ring.clone();
        let turn = |i: usize| {
            let ([x0, y0], [x1, y1]) = (ring[i], ring[(i + 1) % ring.len()]);
            x0 * y1 - x1 * y0
        };
        if (0..ring.len()).map(turn).sum::<f64>() < 0.0 {
            ring.reverse();
        }
        ring.extend_from_within(..1);
        features.push(json!({
            "type": "Feature",
            "geometry": { "type": "Polygon", "coordinates": [ring] },
            "properties": { "name": name, "keep_out": true }
        }));
    }
    json!({ "type": "FeatureCollection", "features": features }).to_string()
}

/// What a collection says.
///
/// # Errors
/// In words, where it cannot be read.
pub fn read(bytes: &[u8]) -> Result<Flown, String> {
    let collection: Value = serde_json::from_slice(bytes).map_err(|e| format!("it is no JSON: {e}"))?;
    let place =
        |at: &Value| match at.as_array().map(|at| at.iter().filter_map(Value::as_f64).collect::<Vec<_>>()).as_deref() {
            Some(&[longitude, latitude, altitude]) => {
                Ok(Place { latitude, longitude, height: Height::Altitude(altitude) })
            }
            _ => Err(format!("{at} is not three coordinates")),
        };
    let mut flown = Flown { zones: Some(Vec::new()), ..Flown::default() };
    for feature in collection["features"].as_array().ok_or("it has no features")? {
        let (coordinates, says) = (&feature["geometry"]["coordinates"], &feature["properties"]);
        match feature["geometry"]["type"].as_str() {
            Some("Point") => {
                let of = |name: &str| says[name].as_f64().ok_or(format!("a photo has no {name}"));
                flown.photos.push(Photo { place: place(coordinates)?, heading: of("heading")?, pitch: of("pitch")? });
            }
            Some("LineString") => {
                let corners = coordinates.as_array().ok_or("its way has no corners")?;
                flown.require(flown.way.is_empty(), || "it has more than one way".into());
                flown.way.extend(corners.iter().map(place).collect::<Result<Vec<_>, _>>()?);
            }
            Some("Polygon") => {
                let corner = |at: &Value| Some([at[0].as_f64()?, at[1].as_f64()?]);
                let ring = coordinates[0].as_array().into_iter().flatten();
                let mut ring =
                    ring.map(corner).collect::<Option<Vec<_>>>().ok_or("an area has a corner without numbers")?;
                ring.pop();
                flown.zones.get_or_insert_default().push(ring);
            }
            _ => return Err("it has a feature that is no photo, way or area".into()),
        }
    }
    if flown.way.is_empty() {
        flown.way = flown.photos.iter().map(|photo| photo.place).collect();
    }
    Ok(flown)
}

//! GeoJSON (RFC 7946): a point for every photo and the way as a line.

use serde_json::{Value, json};

use super::georeference::Geodetic;
use super::mission::{Mission, Waypoint};

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
    json!({ "type": "FeatureCollection", "features": features }).to_string()
}

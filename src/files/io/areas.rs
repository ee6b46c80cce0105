//! Areas on Earth that are kept out of: polygons of GeoJSON (RFC 7946) and KML, in degrees east and north. Everything else in such a file
//! is passed over; heights count for nothing.

use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::{json, read_file, xml};
use crate::error::{Error, Result};

/// Corners of a polygon without holes: degrees east and north, the first one not repeated at the end.
pub type Ring = Vec<[f64; 2]>;

/// Corners of a polygon at most: free space is computed from all of them.
const MAX_CORNERS: usize = 1000;

/// Whether a file is of areas: .kml, .geojson, or .json that has a type as GeoJSON does.
pub fn is_areas(path: &Path) -> bool {
    #[derive(Deserialize)]
    struct Kind {
        r#type: Option<String>,
    }
    match path.extension().map(|extension| extension.to_string_lossy().to_lowercase()).as_deref() {
        Some("kml" | "geojson") => true,
        Some("json") => {
            read_file(path).and_then(|bytes| json::<Kind>(path, &bytes)).is_ok_and(|kind: Kind| kind.r#type.is_some())
        }
        _ => false,
    }
}

/// The polygons of a file.
///
/// # Errors
/// As [`parse`], and where it cannot be read.
pub fn read(path: &Path) -> Result<Vec<Ring>> {
    parse(path, &read_file(path)?)
}

/// The polygons of a file, KML where it begins like XML.
///
/// # Errors
/// Where the file is damaged or has no polygons; where a polygon has a hole, fewer than three corners or too many, or one that is not on
/// Earth.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Vec<Ring>> {
    let refuse = |what: String| Error::input(path, what);
    let text = bytes.trim_ascii_start();
    let polygons = match text.starts_with(b"<") || text.starts_with(b"\xef\xbb\xbf<") {
        true => kml(bytes).map_err(refuse)?,
        false => {
            let mut polygons = Vec::new();
            geojson(&json(path, bytes)?, &mut polygons).map_err(refuse)?;
            polygons
        }
    };
    if polygons.is_empty() {
        return Err(refuse("it has no polygons; draw the area as a polygon, not as a line or points".into()));
    }
    let numbered = (1..).zip(polygons);
    numbered.map(|(number, ring)| sound(ring).map_err(|what| refuse(format!("polygon {number} {what}")))).collect()
}

/// A ring whose last corner is its first, without it.
fn sound(mut ring: Ring) -> Result<Ring, String> {
    ring.dedup();
    if ring.len() > 1 && ring.first() == ring.last() {
        ring.pop();
    }
    let on_earth = |[east, north]: &[f64; 2]| east.abs() <= 180.0 && north.abs() < 89.9;
    match ring.len() {
        0..3 => Err("has fewer than three corners; give the corners of an area".into()),
        count if count > MAX_CORNERS => Err(format!("has {count} corners; simplify it to {MAX_CORNERS} at most")),
        _ => match ring.iter().find(|corner| !on_earth(corner)) {
            Some([east, north]) => {
                Err(format!("has a corner at {east}, {north}; give longitude and latitude in degrees, longitude first"))
            }
            None => Ok(ring),
        },
    }
}

const HOLE: &str = "a polygon has a hole; cut it into polygons without";

/// Adds the polygons of a GeoJSON object. Depth is bounded by that which the JSON parser allows.
fn geojson(object: &Value, polygons: &mut Vec<Ring>) -> Result<(), String> {
    let ring = |ring: &Value| -> Option<Ring> {
        let corner = |at: &Value| Some([at.get(0)?.as_f64()?, at.get(1)?.as_f64()?]);
        ring.as_array()?.iter().map(corner).collect()
    };
    let mut polygon = |rings: &Value| match rings.as_array().map(Vec::as_slice) {
        Some([outer]) => {
            polygons.push(ring(outer).ok_or("the coordinates of a polygon are not a list of positions of numbers")?);
            Ok(())
        }
        Some([_, _, ..]) => Err(HOLE.to_owned()),
        _ => Err("a polygon has no coordinates; export it again".to_owned()),
    };
    let each = |name: &str| {
        let list = object.get(name).and_then(Value::as_array);
        list.map(|list| list.iter())
            .ok_or_else(|| format!("it has no list of {name} where one should be; export it again"))
    };
    match object.get("type").and_then(Value::as_str) {
        Some("Polygon") => polygon(&object["coordinates"]),
        Some("MultiPolygon") => each("coordinates")?.try_for_each(polygon),
        Some("Feature") => object.get("geometry").map_or(Ok(()), |geometry| geojson(geometry, polygons)),
        Some("FeatureCollection") => each("features")?.try_for_each(|feature| geojson(feature, polygons)),
        Some("GeometryCollection") => each("geometries")?.try_for_each(|geometry| geojson(geometry, polygons)),
        Some("Point" | "MultiPoint" | "LineString" | "MultiLineString") => Ok(()),
        _ if object.is_null() => Ok(()),
        _ => Err("something in it is of no type that GeoJSON knows; export it again".to_owned()),
    }
}

/// The polygons of a KML document, wherever they are in it.
fn kml(bytes: &[u8]) -> Result<Vec<Ring>, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "it is no text; export it again")?;
    let document = xml::document(text).map_err(|e| format!("{e}; export it again"))?;
    let mut polygons = Vec::new();
    for polygon in document.descendants().filter(|node| node.tag_name().name() == "Polygon") {
        let find = |name: &str| polygon.descendants().find(|node| node.tag_name().name() == name);
        if find("innerBoundaryIs").is_some() {
            return Err(HOLE.into());
        }
        let corner = |tuple: &str| -> Option<[f64; 2]> {
            let mut numbers = tuple.split(',').map(|number| number.trim().parse().ok());
            Some([numbers.next()??, numbers.next()??])
        };
        // In pieces where there is a comment between.
        let texts = find("coordinates").into_iter().flat_map(|node| node.descendants()).filter(|node| node.is_text());
        let tuples: String = texts.filter_map(|node| node.text()).collect();
        let ring: Option<Ring> = tuples.split_whitespace().map(corner).collect();
        polygons.push(
            ring.ok_or("the coordinates of a polygon are not longitude,latitude and blanks between; export it again")?,
        );
    }
    Ok(polygons)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = "[[8.0, 47.0], [8.1, 47.0, 500], [8.1, 47.1], [8.0, 47.1], [8.0, 47.0]]";

    fn read(text: &str) -> Result<Vec<Ring>> {
        parse(Path::new("area"), text.as_bytes())
    }

    fn document(polygon: &str) -> String {
        let space = "http://www.opengis.net/kml/2.2";
        format!(
            "<?xml version=\"1.0\"?>\n<kml xmlns=\"{space}\"><Document><Placemark>{polygon}</Placemark></Document></kml>"
        )
    }

    /// If this failed, a no-fly zone would be left out, or taken for one elsewhere.
    #[test]
    fn polygons_are_found_in_both_formats() {
        let wanted = vec![[8.0, 47.0], [8.1, 47.0], [8.1, 47.1], [8.0, 47.1]];
        let polygon = format!(r#"{{"type": "Polygon", "coordinates": [{SQUARE}]}}"#);
        let feature = format!(r#"{{"type": "Feature", "properties": null, "geometry": {polygon}}}"#);
        let point = r#"{"type": "Feature", "geometry": {"type": "Point", "coordinates": [8, 47]}}"#;
        let multi = format!(r#"{{"type": "MultiPolygon", "coordinates": [[{SQUARE}], [{SQUARE}]]}}"#);
        for (text, count) in [
            (polygon.clone(), 1),
            (format!(r#"{{"type": "FeatureCollection", "features": [{point}, {feature}]}}"#), 1),
            (format!(r#"{{"type": "GeometryCollection", "geometries": [{multi}, {polygon}]}}"#), 3),
            (
                document(
                    "<Polygon><outerBoundaryIs><LinearRing><coordinates>\n 8.0,47.0,0 8.1,47.0,0\n<!-- a corner -->8.1,47.1 8.0,47.1,3 8.0,47.0,0 \
                     </coordinates></LinearRing></outerBoundaryIs></Polygon>",
                ),
                1,
            ),
        ] {
            let found = read(&text).unwrap();
            assert!(found.len() == count && found.iter().all(|ring| *ring == wanted), "{text}: {found:?}");
        }
    }

    /// If this failed, an area that is not understood would be flown through.
    #[test]
    fn what_is_no_area_is_refused() {
        let polygon = |rings: &str| format!(r#"{{"type": "Polygon", "coordinates": [{rings}]}}"#);
        let many: Vec<String> = (0..1001).map(|i| format!("[8.{i:04}, 47]")).collect();
        for (text, fragment) in [
            (r#"{"type": "LineString", "coordinates": [[8, 47], [9, 47]]}"#.into(), "no polygons"),
            (polygon(&format!("{SQUARE}, {SQUARE}")), "hole"),
            (polygon("[[8, 47], [9, 47], [8, 47]]"), "polygon 1 has fewer than three"),
            (polygon("[[47, 8], [9, 470], [8, 47]]"), "longitude first"),
            (polygon("[[\"8\", 47]]"), "positions of numbers"),
            (polygon(""), "no coordinates"),
            (polygon(&format!("[{}]", many.join(", "))), "1001 corners"),
            ("{".into(), "EOF"),
            (r#"{"type": "polygon", "coordinates": []}"#.into(), "no type that GeoJSON knows"),
            (r#"{"type": "MultiPolygon"}"#.into(), "no list of coordinates"),
            (document("<Polygon>"), "again"),
            (document("<Polygon><innerBoundaryIs/></Polygon>"), "hole"),
            (document("<Polygon><coordinates>8.0;47.0</coordinates></Polygon>"), "longitude,latitude"),
            (document("<Point/>"), "no polygons"),
        ] {
            let message = read(&text).unwrap_err().to_string();
            assert!(message.contains(fragment), "{fragment:?} is not in {message}");
        }
    }
}

//! Where a scene lies on Earth, as `--geo` says it, and the areas on Earth that cameras keep out of.

use std::path::Path;

use glam::DVec3;

use crate::export::georeference::{Fit, Geodetic, Georeference};
use crate::export::gps;
use crate::io::{areas, photos};
use crate::scene::limits::Volume;
use crate::scene::prism::prism;
use crate::scene::region::Region;
use crate::{Error, Result};

/// Where the scene is on Earth, as --geo says it; around `middle` the map is best.
///
/// # Errors
/// Where the text is no place, or the photos of a capture say none.
pub fn georeference(text: &str, middle: DVec3, up: DVec3) -> Result<Georeference> {
    let wrong = |what: &str| Error::request(format!("--geo {text}: {what}"));
    let read = |text: &str| -> Option<Vec<f64>> { text.split(',').map(|number| number.trim().parse().ok()).collect() };
    if text == "ecef" {
        return Georeference::geocentric(middle);
    }
    if let Some(rest) = text.strip_prefix("utm:") {
        let (zone, offset) = rest.split_once(',').map_or((rest, Some(Vec::new())), |(zone, rest)| (zone, read(rest)));
        let offset = match offset.as_deref() {
            Some([]) => DVec3::ZERO,
            Some(&[east, north]) => DVec3::new(east, north, 0.0),
            Some(&[east, north, altitude]) => DVec3::new(east, north, altitude),
            _ => return Err(wrong("give utm:ZONE[,EAST,NORTH[,ALT]]")),
        };
        if up.dot(DVec3::Z) < 0.99 {
            return Err(wrong("coordinates in UTM have +z up; give --up z"));
        }
        return Georeference::utm(zone, offset, middle);
    }
    if let Some(numbers) = read(text) {
        let (latitude, longitude, altitude, heading) = match numbers[..] {
            [latitude, longitude, altitude] => (latitude, longitude, altitude, 0.0),
            [latitude, longitude, altitude, heading] => (latitude, longitude, altitude, heading),
            _ => return Err(wrong("give LAT,LON,ALT or LAT,LON,ALT,HEADING")),
        };
        return Georeference::anchored(Geodetic { latitude, longitude, altitude }, heading, up);
    }
    if !Path::new(text).exists() {
        return Err(wrong("give LAT,LON,ALT[,HEADING], utm:ZONE, ecef, or a capture, which this is not"));
    }
    let capture = photos::read(Path::new(text), &photos::Options::from(photos::Images::SkipMissing))?;
    let (mut positions, mut places) = (Vec::new(), Vec::new());
    for photo in &capture.photos {
        if let Some(image) = &photo.image
            && let Some(place) = gps::of_photo(image)?
        {
            positions.push(photo.camera.pose.position);
            places.push(place);
        }
    }
    let (earth, Fit { used, photos, rms }) = Georeference::fitted(&positions, &places)?;
    say!(
        "place    by {used} of {photos} photos with GPS, which are {rms:.2} m off (root mean square); a unit is {:.4} m",
        earth.scale()
    );
    Ok(earth)
}

/// The areas of a file as upright prisms that reach over all heights of a region, in the frame of the scene.
///
/// # Errors
/// Where nothing says where the scene lies on Earth, or the file has no sound polygons.
pub fn areas(file: &Path, geo: Option<&str>, region: &Region) -> Result<Volume> {
    let Some(geo) = geo else {
        let what = "its polygons are in degrees; say where the scene lies on Earth with --geo LAT,LON,ALT[,HEADING]";
        return Err(Error::input(file, what));
    };
    let rings = areas::read(file)?;
    let (centre, radius) = region.bounding_sphere();
    let earth = georeference(geo, centre, region.up)?;
    let altitude = earth.place(centre)?.altitude;
    // What is upright on Earth may lean in the scene: beyond the region on all sides.
    let up = earth.up();
    let heights = [-2.0, 2.0].map(|beyond| centre.dot(up) + beyond * radius);
    let mut triangles = Vec::new();
    let mut nearest = f64::INFINITY;
    for (number, ring) in (1..).zip(rings) {
        let corner = |[longitude, latitude]: &[f64; 2]| {
            earth.scene_point(&Geodetic { latitude: *latitude, longitude: *longitude, altitude })
        };
        let corners = ring.iter().map(corner).collect::<Result<Vec<DVec3>>>()?;
        let from = |i: usize| (corners[i % corners.len()] - centre).reject_from(up);
        nearest = (0..corners.len()).map(|i| to_segment(from(i), from(i + 1))).fold(nearest, f64::min);
        let faces = prism(&corners, up, heights);
        triangles.extend(faces.map_err(|what| Error::input(file, format!("polygon {number} {what}")))?);
    }
    say!(
        "area     {}: its outline is {:.1} m from the middle of the region at the nearest",
        file.display(),
        earth.scale() * nearest
    );
    Ok(Volume { file: file.to_string_lossy().into_owned(), triangles })
}

/// Distance of the origin from the straight line between two points.
fn to_segment(a: DVec3, b: DVec3) -> f64 {
    let along = b - a;
    let share = (-a.dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (a + share * along).length()
}

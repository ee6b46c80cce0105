//! Where a scene lies on Earth, as `--geo` says it, and the areas on Earth that cameras keep out of.

use std::path::Path;

use glam::DVec3;

use crate::app::export::georeference::{Fit, Geodetic, Georeference};
use crate::app::export::gps;
use crate::files::io::{areas, photos};
use crate::files::photos::PhotoSet;
use crate::scene::distances::leg_to_point;
use crate::scene::prism::prism;
use crate::scene::region::Region;
use crate::scene::volume::Volume;
use crate::{Error, Result};

/// Metres from the scene within which areas are.
const FARTHEST: f64 = 500e3;
/// Metres from which on an area is most likely one of somewhere else.
const REMOTE: f64 = 50e3;
/// Longest straight side of an area, in metres.
const STEP: f64 = 2e3;
/// Corners of an area so divided.
const MAX_CORNERS: f64 = 2000.0;
/// Part of how far photos are spread that their GPS may be off by for lengths in metres, which are then off by some percent.
const ROUGH: f64 = 0.2;
/// Of a degree of latitude.
const METRES_A_DEGREE: f64 = 111_320.0;

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
    let capture = photos::read(Path::new(text), &photos::ReadOptions::from(photos::Images::SkipMissing))?;
    let (positions, places) = with_gps(&capture)?;
    let (earth, Fit { used, photos, rms }) = Georeference::fitted(&positions, &places)?;
    say!(
        "place    by {used} of {photos} photos with GPS, which are {rms:.2} m off (root mean square); a unit is {:.4} m",
        earth.scale()
    );
    Ok(earth)
}

/// Where photos that say where on Earth they were taken stand in the scene, and those places.
fn with_gps(capture: &PhotoSet) -> Result<(Vec<DVec3>, Vec<Geodetic>)> {
    let (mut positions, mut places) = (Vec::new(), Vec::new());
    for photo in &capture.photos {
        if let Some(image) = &photo.image
            && let Some(place) = gps::of_photo(image)?
        {
            positions.push(photo.camera.pose.position);
            places.push(place);
        }
    }
    Ok((positions, places))
}

/// How long a metre is in units of a capture, by the GPS of its photos; none where few have any, or where it is too rough for that.
///
/// # Errors
/// Where an image cannot be opened.
pub fn metre(capture: &PhotoSet) -> Result<Option<f64>> {
    let (positions, places) = with_gps(capture)?;
    if places.is_empty() {
        return Ok(None);
    }
    let Ok((earth, Fit { used, photos, rms })) = Georeference::fitted(&positions, &places) else {
        say!("scale    in steps between photos: {} of them have GPS, too few, or in a line", places.len());
        return Ok(None);
    };
    let middle = positions.iter().sum::<DVec3>() / positions.len() as f64;
    let square = positions.iter().map(|place| place.distance_squared(middle)).sum::<f64>() / positions.len() as f64;
    let spread = earth.scale() * square.sqrt();
    if rms > ROUGH * spread {
        say!("scale    in steps between photos: their GPS is {rms:.1} m off, and they stand within {spread:.1} m");
        return Ok(None);
    }
    say!("scale    a unit is {:.3} m by {used} of {photos} photos with GPS, {rms:.2} m off", earth.scale());
    Ok(Some(1.0 / earth.scale()))
}

/// The areas of a file as upright prisms that reach over all heights of a region, in the frame of the scene, with a margin in metres.
///
/// # Errors
/// Where nothing says where the scene lies on Earth, or the file has no sound polygons.
pub fn areas(file: &Path, geo: Option<&str>, margin: f64, region: &Region) -> Result<Volume> {
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
    for (number, ring) in (1..).zip(&rings) {
        let refuse = |what: &str| Error::input(file, format!("polygon {number} {what}"));
        let reach = |[longitude, latitude]: &[f64; 2]| -> Result<f64> {
            let place = Geodetic { latitude: *latitude, longitude: *longitude, altitude };
            Ok(along_ground(&place, &earth.place(centre)?))
        };
        let far = ring.iter().map(reach).collect::<Result<Vec<f64>>>()?.into_iter().fold(0.0, f64::max);
        if far > FARTHEST {
            let what = format!(
                "reaches {:.0} km from the scene; cut it to what is within {:.0} km, and check --geo",
                far / 1e3,
                FARTHEST / 1e3
            );
            return Err(refuse(&what));
        }
        let ring = in_steps(ring)
            .ok_or_else(|| refuse("is too long around for its corners; cut it to what is near the scene"))?;
        let corner = |[longitude, latitude]: &[f64; 2]| {
            earth.scene_point(&Geodetic { latitude: *latitude, longitude: *longitude, altitude })
        };
        let corners = ring.iter().map(corner).collect::<Result<Vec<DVec3>>>()?;
        let from = |i: usize| (corners[i % corners.len()] - centre).reject_from(up);
        nearest = (0..corners.len()).map(|i| leg_to_point(from(i), from(i + 1), DVec3::ZERO)).fold(nearest, f64::min);
        let faces = prism(&corners, up, heights);
        triangles.extend(faces.map_err(refuse)?);
    }
    if earth.scale() * nearest > REMOTE {
        say!(
            "warning  {} is {:.0} km off and bars nothing here: is its longitude first, and --geo right?",
            file.display(),
            earth.scale() * nearest / 1e3
        );
    }
    say!(
        "area     {}: its outline is {:.1} m from the middle of the region at the nearest",
        file.display(),
        earth.scale() * nearest
    );
    Ok(Volume {
        file: file.to_string_lossy().into_owned(),
        geo: geo.to_owned(),
        areas: rings,
        margin: margin / earth.scale(),
        triangles,
        ..Volume::default()
    })
}

/// A ring with corners between its own where these are far apart: its sides are straight in degrees, and a map bends them by 0.1 m on
/// [`STEP`] at 60 degrees of latitude. None where that would be too many.
fn in_steps(ring: &areas::Ring) -> Option<areas::Ring> {
    let mut stepped = Vec::new();
    for (i, [east, north]) in ring.iter().enumerate() {
        let [next_east, next_north] = ring[(i + 1) % ring.len()];
        let degrees = (next_east - east).hypot(next_north - north);
        let steps = (degrees * METRES_A_DEGREE / STEP).ceil().max(1.0);
        if stepped.len() as f64 + steps > MAX_CORNERS {
            return None;
        }
        let at = |step: f64| [east + (next_east - east) * step / steps, north + (next_north - north) * step / steps];
        stepped.extend((0..steps as u32).map(|step| at(f64::from(step))));
    }
    Some(stepped)
}

/// Metres along the ground between two places, of an Earth that is a sphere (haversine).
fn along_ground(a: &Geodetic, b: &Geodetic) -> f64 {
    let half = |a: f64, b: f64| (0.5 * (b - a).to_radians()).sin().powi(2);
    let cosines = a.latitude.to_radians().cos() * b.latitude.to_radians().cos();
    let square = half(a.latitude, b.latitude) + cosines * half(a.longitude, b.longitude);
    2.0 * square.min(1.0).sqrt().asin() * METRES_A_DEGREE.to_degrees()
}

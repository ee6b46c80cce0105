//! The binary files of a COLMAP model.

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;

use super::{Image, Lens, Observation, PROJECTIONS, Point, pose};
use crate::error::Result;
use crate::files::io::binary::Cursor;

/// Fewest bytes of a camera: id, model, width, height and three parameters.
const CAMERA: usize = 4 + 4 + 8 + 8 + 3 * 8;
/// Fewest bytes of an image: id, pose, camera, a name of one byte with its end, number of observations.
const IMAGE: usize = 4 + 7 * 8 + 4 + 2 + 8;
/// Bytes of an observation in an image: x, y, number of the point.
const OBSERVATION: usize = 3 * 8;
/// Fewest bytes of a point: id, position, colour, error, length of its track.
const POINT: usize = 8 + 3 * 8 + 3 + 8 + 8;
/// Bytes of an entry of a track: number of the image, number of the observation in it.
const TRACK: usize = 2 * 4;

/// Parses cameras.bin: lenses by their number.
pub fn cameras(path: &Path, bytes: &[u8]) -> Result<BTreeMap<u32, Lens>> {
    let mut cursor = Cursor::new(path, bytes, 0);
    let mut lenses = BTreeMap::new();
    for i in 0..cursor.count(CAMERA, "cameras")? {
        let what = format!("camera {i}");
        let id = cursor.u32(&what)?;
        let model = cursor.u32(&what)?;
        let Some(&projection) = PROJECTIONS.iter().find(|p| p.id == model) else {
            return Err(cursor.error(format!("{what} has the unknown model {model}; convert it to PINHOLE or OPENCV")));
        };
        let (width, height) = (cursor.u64(&what)?, cursor.u64(&what)?);
        let (Ok(width), Ok(height)) = (width.try_into(), height.try_into()) else {
            return Err(cursor.error(format!("{what} has an image of {width} x {height} pixels; export it again")));
        };
        let parameters: Vec<f64> = (0..projection.parameters).map(|_| cursor.f64(&what)).collect::<Result<_>>()?;
        let Some(lens) = Lens::new(projection, [width, height], &parameters) else {
            return Err(cursor.error(format!("{what} has {} parameters", parameters.len())));
        };
        if lenses.insert(id, lens).is_some() {
            return Err(cursor.error(format!("{what} has the number {id} of another one; export the model again")));
        }
    }
    Ok(lenses)
}

/// Parses images.bin, without the observations.
pub fn images(path: &Path, bytes: &[u8]) -> Result<Vec<Image>> {
    observed(path, bytes, |_| false)
}

/// Parses images.bin, with the observations of the images whose name `wanted` accepts.
pub fn observed(path: &Path, bytes: &[u8], wanted: impl Fn(&str) -> bool) -> Result<Vec<Image>> {
    let mut cursor = Cursor::new(path, bytes, 0);
    let count = cursor.count(IMAGE, "images")?;
    let mut images = Vec::with_capacity(count);
    for i in 0..count {
        let what = format!("image {i}");
        let id = cursor.u32(&what)?;
        let mut numbers = [0.0; 7];
        for number in &mut numbers {
            *number = cursor.f64(&what)?;
        }
        let [w, x, y, z, tx, ty, tz] = numbers;
        let Some(pose) = pose([w, x, y, z], [tx, ty, tz]) else {
            return Err(cursor.error(format!("{what} has a pose that is not finite or no rotation; remove it")));
        };
        let lens = cursor.u32(&what)?;
        let length = cursor.rest().iter().position(|&b| b == 0).unwrap_or(cursor.rest().len());
        let name = cursor.take(length + 1, format!("the name of {what}"))?;
        let name = String::from_utf8_lossy(&name[..length]).into_owned();
        let count = cursor.count(OBSERVATION, format!("observations in {what}"))?;
        let mut observations = Vec::new();
        if wanted(&name) {
            observations.reserve_exact(count);
            for _ in 0..count {
                let pixel = [cursor.f64(&what)?, cursor.f64(&what)?];
                observations.push(Observation { pixel, point: cursor.u64(&what)? });
            }
        } else {
            cursor.take(count * OBSERVATION, format!("the observations in {what}"))?;
        }
        images.push(Image { id, lens, pose, name, stored: ([w, x, y, z], [tx, ty, tz]), observations });
    }
    Ok(images)
}

/// Parses points3D.bin.
pub fn points(path: &Path, bytes: &[u8]) -> Result<Vec<Point>> {
    let mut cursor = Cursor::new(path, bytes, 0);
    let count = cursor.count(POINT, "points")?;
    let mut points = Vec::with_capacity(count);
    for i in 0..count {
        let what = format!("point {i}");
        let id = cursor.u64(&what)?;
        let position = DVec3::new(cursor.f64(&what)?, cursor.f64(&what)?, cursor.f64(&what)?);
        let colour = cursor.array(&what)?;
        let error = cursor.f64(&what)?;
        let length = cursor.count(TRACK, format!("entries in the track of {what}"))?;
        let mut track = Vec::with_capacity(length);
        for _ in 0..length {
            track.push([cursor.u32(&what)?, cursor.u32(&what)?]);
        }
        points.push(Point { id, position, colour, error, track });
    }
    Ok(points)
}

//! The binary files of a COLMAP model.

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;

use super::rigs::{Frame, Rig, Sensor};
use super::{Image, Lens, Observation, PROJECTIONS, Point};
use crate::error::Result;
use crate::files::io::binary::Cursor;
use crate::files::io::left_out::LeftOut;

/// Fewest bytes of a camera: id, model, width, height and two parameters.
const CAMERA: usize = 4 + 4 + 8 + 8 + 2 * 8;
/// Fewest bytes of an image: id, pose, camera, a name of one byte with its end, number of observations.
const IMAGE: usize = 4 + 7 * 8 + 4 + 2 + 8;
/// Bytes of an observation in an image: x, y, number of the point.
const OBSERVATION: usize = 3 * 8;
/// Fewest bytes of a point: id, position, colour, error, length of its track.
const POINT: usize = 8 + 3 * 8 + 3 + 8 + 8;
/// Bytes of an entry of a track: number of the image, number of the observation in it.
const TRACK: usize = 2 * 4;

/// Fewest bytes of a rig: number, number of sensors.
const RIG: usize = 2 * 4;
/// Fewest bytes of a frame: number, number of its rig, pose, number of images.
const FRAME: usize = 2 * 4 + 7 * 8 + 4;
/// The kind of a sensor that is a camera.
const IS_CAMERA: u32 = 0;

/// Parses cameras.bin: lenses by their number.
///
/// # Errors
/// Where the file is cut short, or a model is not known, so that what follows it cannot be found.
pub fn cameras(path: &Path, bytes: &[u8], left_out: &mut LeftOut) -> Result<BTreeMap<u32, Lens>> {
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
        let parameters: Vec<f64> = (0..projection.parameters).map(|_| cursor.f64(&what)).collect::<Result<_>>()?;
        let lens = match (width.try_into(), height.try_into()) {
            (Ok(width), Ok(height)) => Lens::new(projection, [width, height], &parameters),
            _ => Err(format!("its images have {width} x {height} pixels")),
        };
        match lens {
            Ok(_) if lenses.contains_key(&id) => left_out.add(format!("camera {id} is given twice")),
            Ok(lens) => _ = lenses.insert(id, lens),
            Err(what) => left_out.add(format!("camera {id}: {what}")),
        }
    }
    Ok(lenses)
}

/// Parses images.bin, without the observations.
///
/// # Errors
/// Where the file is cut short.
pub fn images(path: &Path, bytes: &[u8]) -> Result<Vec<Image>> {
    observed(path, bytes, |_| false)
}

/// Parses images.bin, with the observations of the images whose name `wanted` accepts.
///
/// # Errors
/// Where the file is cut short.
pub fn observed(path: &Path, bytes: &[u8], wanted: impl Fn(&str) -> bool) -> Result<Vec<Image>> {
    let mut cursor = Cursor::new(path, bytes, 0);
    let count = cursor.count(IMAGE, "images")?;
    let mut images = Vec::with_capacity(count);
    for i in 0..count {
        let what = format!("image {i}");
        let id = cursor.u32(&what)?;
        let stored = cursor.motion(&what)?;
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
        images.push(Image { id, lens, name, stored, observations });
    }
    Ok(images)
}

/// Parses points3D.bin.
///
/// # Errors
/// Where the file is cut short.
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

/// Parses rigs.bin.
///
/// # Errors
/// Where the file is cut short.
pub fn rigs(path: &Path, bytes: &[u8]) -> Result<Vec<Rig>> {
    let mut cursor = Cursor::new(path, bytes, 0);
    let mut rigs = Vec::new();
    for i in 0..cursor.count(RIG, "rigs")? {
        let what = format!("rig {i}");
        let (id, count) = (cursor.u32(&what)?, cursor.u32(&what)?);
        let mut sensors = Vec::new();
        for i in 0..count {
            let sensor = cursor.sensor(&what)?;
            // The first is what the rig's pose is of.
            let pose = match i {
                0 => Some(Rig::REFERENCE),
                _ if cursor.array(&what)? == [0u8] => None,
                _ => Some(cursor.motion(&what)?),
            };
            sensors.push((sensor, pose));
        }
        rigs.push(Rig { id, sensors });
    }
    Ok(rigs)
}

/// Parses frames.bin.
///
/// # Errors
/// Where the file is cut short.
pub fn frames(path: &Path, bytes: &[u8]) -> Result<Vec<Frame>> {
    let mut cursor = Cursor::new(path, bytes, 0);
    let mut frames = Vec::new();
    for i in 0..cursor.count(FRAME, "frames")? {
        let what = format!("frame {i}");
        let (_, rig) = (cursor.u32(&what)?, cursor.u32(&what)?);
        let pose = cursor.motion(&what)?;
        let mut images = Vec::new();
        for _ in 0..cursor.u32(&what)? {
            images.push((cursor.sensor(&what)?, cursor.u64(&what)?));
        }
        frames.push(Frame { rig, pose, images });
    }
    Ok(frames)
}

impl Cursor<'_> {
    /// Quaternion (w, x, y, z) and translation.
    fn motion(&mut self, what: &str) -> Result<([f64; 4], [f64; 3])> {
        let mut numbers = [0.0; 7];
        for number in &mut numbers {
            *number = self.f64(what)?;
        }
        let [w, x, y, z, tx, ty, tz] = numbers;
        Ok(([w, x, y, z], [tx, ty, tz]))
    }

    /// The kind and number of a sensor.
    fn sensor(&mut self, what: &str) -> Result<Sensor> {
        Ok(Sensor { is_camera: self.u32(what)? == IS_CAMERA, id: self.u32(what)? })
    }
}

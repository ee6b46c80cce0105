//! A whole capture: every camera's photograph, and what trainers need beside them.

use std::ops::ControlFlow;
use std::path::Path;
use std::thread;

use glam::{DVec3, Vec3};

use super::metering;
use super::noise::{self, Noise};
use super::outputs::{Found, Outputs, Record};
use super::tracer::{Exposure, Tracer};
use crate::files::io::camera_files;
use crate::files::io::folder::OutputFolder;
use crate::scene::sequence::sequence_pair;
use crate::scene::surface::Points;
use crate::{Error, Result};

/// Points of the surface that trainers start from, by all cameras together, and by one at least.
const POINTS: u32 = 60_000;
const MIN_POINTS: u32 = 200;
/// Stream of the pixels whose surface they are.
const POINT_STREAM: u32 = 0x706f_696e;

/// The result of a capture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Photographs that are there.
    pub pictures: u32,
    /// Of these, photographs that an earlier run had taken.
    pub kept: u32,
    /// Photographs of this run in the place of damaged ones.
    pub mended: u32,
    /// Photographs of this run that show nothing of the scene.
    pub empty: u32,
    /// Cameras whose photographs of this run show something that no light comes from, in any pixel.
    pub dark: Vec<String>,
    /// Pixels of this run that are brighter than white, and all that show something.
    pub brighter: [u64; 2],
    /// Points of the surface that were written.
    pub points: usize,
    /// The noise of the pictures, of which some are measured.
    pub noise: Noise,
}

/// Takes the photographs that are not there yet, and writes everything into `folder`; `observe` receives their number, changed or
/// not, and returns whether to continue. Stopped early, what is finished stays, and the same call continues from there.
///
/// # Errors
/// Where the device fails or the system refuses a file; finished photographs stay.
pub fn run(
    tracer: &Tracer,
    record: &Record,
    outputs: &Outputs,
    folder: &Path,
    observe: impl Fn(Option<u32>) -> ControlFlow<()>,
) -> Result<Outcome> {
    let found: Vec<Found> = record.cameras.iter().map(|camera| outputs.found(record, camera)).collect();
    outputs.begin(record, found.iter().all(|found| *found == Found::Whole))?;
    let exposure = Exposure { samples: record.samples, seed: record.seed, show_sky: record.show_sky };
    let mut outcome = Outcome::default();
    let all = record.cameras.len() as u32;
    let mut noise = outputs.noise();
    thread::scope(|scope| {
        // One picture is written while the next is taken.
        let mut writing = None;
        for ((number, camera), found) in (0..).zip(&record.cameras).zip(&found) {
            if *found == Found::Whole {
                outcome.kept += 1;
                outcome.pictures += 1;
            } else {
                let taken = if number % all.div_ceil(noise::PICTURES) == 0 {
                    match tracer.photograph_and_error(camera, number, exposure, || observe(None)) {
                        Ok((taken, Some(error))) => {
                            noise.add(&camera.name, error);
                            outputs.write_noise(&noise).map(|()| taken)
                        }
                        taken => taken.map(|(taken, _)| taken),
                    }
                } else {
                    tracer.photograph(camera, number, exposure, || observe(None))
                };
                let taken = match taken {
                    Err(Error::Interrupted) => break,
                    taken => taken?,
                };
                let hits = (record.depth || record.normals).then(|| tracer.first_hits(camera, None)).transpose()?;
                let is_empty = taken.pixels.iter().all(|pixel| pixel[3] == 0.0);
                outcome.empty += u32::from(is_empty);
                if !is_empty && taken.pixels.iter().all(|pixel| pixel[..3] == [0.0; 3]) {
                    outcome.dark.push(camera.name.clone());
                }
                let brighter = metering::brighter(&taken, record.exposure, !record.show_sky);
                outcome.brighter = [0, 1].map(|i| outcome.brighter[i] + brighter[i]);
                joined(writing.take())?;
                writing = Some(scope.spawn(move || outputs.picture(record, camera, &taken, hits.as_ref())));
                outcome.pictures += 1;
                outcome.mended += u32::from(*found == Found::Damaged);
            }
            if observe(Some(outcome.pictures)).is_break() {
                break;
            }
        }
        joined(writing)
    })?;
    if outcome.pictures == all {
        let (points, tracks) = surface(tracer, record, outputs)?;
        outcome.points = points.positions.len();
        outcome.noise = noise;
        let staged = OutputFolder::create(folder, true)?;
        camera_files::capture(&staged, &record.cameras, &points, &tracks)?;
        staged.commit()?;
    }
    Ok(outcome)
}

/// The result of a writer thread.
fn joined(writing: Option<thread::ScopedJoinHandle<'_, Result<()>>>) -> Result<()> {
    let wait = |writer: thread::ScopedJoinHandle<'_, Result<()>>| {
        writer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    };
    writing.map_or(Ok(()), wait)
}

/// Points where the middles of pixels lie on the surface, spread evenly over each picture, with its normals and in the colours of the
/// photographs, and the camera that each was seen by.
fn surface(tracer: &Tracer, record: &Record, outputs: &Outputs) -> Result<(Points, Vec<Vec<u32>>)> {
    let each = (POINTS / record.cameras.len().max(1) as u32).max(MIN_POINTS);
    let mut points = Points::default();
    let mut tracks = Vec::new();
    for (number, camera) in (0u32..).zip(&record.cameras) {
        let k = camera.intrinsics;
        let count = k.width * k.height;
        let within = |word: u32, length: u32| ((u64::from(word) * u64::from(length)) >> 32) as u32;
        let mut chosen: Vec<u32> = (0..each.min(count))
            .map(|i| {
                let [x, y] = sequence_pair(record.seed as u32, POINT_STREAM.wrapping_add(number), i, 0);
                within(y, k.height) * k.width + within(x, k.width)
            })
            .collect();
        chosen.sort_unstable();
        chosen.dedup();
        let picture = outputs.read(camera)?;
        if picture.dimensions() != (k.width, k.height) {
            let what = format!("images/{} has another size than its camera; remove it and run again", camera.name);
            return Err(Error::request(what));
        }
        let hits = tracer.first_hits(camera, Some(&chosen))?;
        for (&pixel, hit) in chosen.iter().zip(hits) {
            let (x, y) = (pixel % k.width, pixel / k.width);
            let [r, g, b, alpha] = picture.get_pixel(x, y).0;
            if hit[3] <= 0.0 || alpha < 255 {
                continue;
            }
            let ray = DVec3::new(
                (f64::from(x) + 0.5 - k.principal[0]) / k.focal[0],
                (f64::from(y) + 0.5 - k.principal[1]) / k.focal[1],
                1.0,
            );
            points.positions.push(camera.pose.position + camera.pose.rotation * (f64::from(hit[3]) * ray));
            points.normals.push(Vec3::from_slice(&hit[..3]).as_dvec3());
            points.colours.push([r, g, b]);
            tracks.push(vec![number]);
        }
    }
    Ok((points, tracks))
}

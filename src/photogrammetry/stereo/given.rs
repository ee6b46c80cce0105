//! Depths of files in place of stereo: brought to the frames' pixels, less those that are not sure, scaled to the capture's points.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use glam::{DVec2, DVec3, Vec2};

use super::consistency;
use super::cost::{NO_MATCH, Plane};
use super::depth::DepthMap;
use super::frame::{Frame, device_views};
use super::{Measured, range};
use crate::engine::vulkan::{Buffer, Context};
use crate::files::io::depth_maps::{self, DepthMaps, Raster};
use crate::files::photos::{Photo, PhotoSet};
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::lens::{Distortion, Lens};
use crate::scene::similarity::Similarity;
use crate::{Error, Result};

/// Difference of depth at which two views still agree, as a fraction of depth: sensors and models are less precise than stereo.
const TOLERANCE: f32 = 0.03;
/// How far the shape of a map may differ from its photo's, as a fraction: models round sides to whole patches.
const SHAPE: f64 = 0.03;
/// Difference of neighbouring pixels, as a fraction of depth, up to which a map is a surface between them.
const STEP: f32 = 0.05;
/// Part of the largest value of a PNG that confidence must exceed where nothing else is given: ARKit's low is 0, medium half of high.
const SURE: f32 = 1.0 / 3.0;
/// Points on a map that determine its scale at least.
const MIN_POINTS: usize = 30;
/// Largest distance between the quartiles of the ratios of points to a map, as a fraction of their median: beyond, no scale makes it fit.
const SPREAD: f64 = 0.3;
/// Correlation of a map with the points on it below which it is inverse: of something far off all ratios are alike either way.
const INVERSE: f64 = -0.3;
/// Cells along a picture's longer side, of which the nearest point counts where nothing says which photos see it.
const CELLS: f64 = 48.0;

/// The depth maps of frames, at their pixels.
pub(super) struct Given {
    /// Depths along the optical axis in the capture's units, 0 where there is none; by frame.
    depths: Vec<Vec<f32>>,
    /// What was understood, a line each.
    pub notes: Vec<String>,
    /// Why photos were left out, a line each.
    pub skipped: Vec<String>,
}

/// A frame's map and how sure it is.
struct Map {
    depths: Vec<f32>,
    confidence: Option<(Vec<f32>, bool)>,
}

impl Given {
    /// The maps of frames whose poses are still those of the capture. Frames without one that can be used are removed.
    ///
    /// # Errors
    /// Where a map cannot be read or is of another shape than its photo, or no depth counts.
    pub fn read(maps: &DepthMaps, set: &PhotoSet, photos: &[Photo], frames: &mut Vec<Frame>) -> Result<Self> {
        let mut given = Self { depths: Vec::new(), notes: Vec::new(), skipped: Vec::new() };
        let by_name: HashMap<&str, &Photo> = photos.iter().map(|photo| (&photo.camera.name[..], photo)).collect();
        let mut read = Vec::with_capacity(frames.len());
        let mut kept = Vec::with_capacity(frames.len());
        for frame in frames.drain(..) {
            let name = &frame.camera.name;
            let (Some(photo), Some(file)) = (by_name.get(&name[..]), maps.depth_of(name)) else { continue };
            let sure = maps.confidence_of(name);
            if maps.confidence.is_some() && sure.is_none() {
                given.skipped.push(format!("{name}: it has a depth map and none of confidence"));
                continue;
            }
            let places = places(photo, &frame);
            let shaped = |raster: Raster, file| shaped(raster, &photo.camera.intrinsics, file);
            let raster = shaped(depth_maps::read_depths(&file)?, &file)?;
            let depths = places.iter().map(|place| place.map_or(0.0, |place| between(&raster, place))).collect();
            let confidence = match &sure {
                Some(file) => {
                    let raster = shaped(depth_maps::read_confidence(file)?, file)?;
                    let value = |place: &Option<[f64; 2]>| place.map_or(0.0, |place| raster.at(place));
                    Some((places.iter().map(value).collect(), raster.is_png))
                }
                None => None,
            };
            read.push(Map { depths, confidence });
            kept.push(frame);
        }
        *frames = kept;
        given.depths = given.sure(maps, read);
        if given.depths.iter().flatten().all(|depth| *depth <= 0.0) && !given.depths.is_empty() {
            return Err(none_count());
        }
        given.scale(set, frames);
        Ok(given)
    }

    /// The maps' depths without those whose confidence is too low.
    fn sure(&mut self, maps: &DepthMaps, read: Vec<Map>) -> Vec<Vec<f32>> {
        let folder = maps.folder.display();
        // Of pixels without a depth, such as the sky, nothing follows.
        let of_depths = |map: &Map| -> Vec<f32> {
            let values = map.confidence.iter().flat_map(|(values, _)| values);
            let with_depth = values.zip(&map.depths).filter(|(value, depth)| value.is_finite() && **depth > 0.0);
            with_depth.map(|(value, _)| *value).collect()
        };
        let values: Vec<f32> = read.iter().flat_map(of_depths).collect();
        if read.iter().all(|map| map.confidence.is_none()) {
            self.notes.push(format!("depths   of {folder}, without confidence: all of them count"));
            return read.into_iter().map(|map| map.depths).collect();
        }
        let is_png = read.iter().all(|map| map.confidence.as_ref().is_none_or(|(_, is_png)| *is_png));
        let (least, stated): (Box<dyn Fn(f32) -> bool>, String) = match maps.min_confidence {
            Some(least) => (Box::new(move |value| f64::from(value) >= least), format!("of at least {least}")),
            None if is_png => {
                let bound = SURE * values.iter().copied().fold(0.0, f32::max);
                (Box::new(move |value| value > bound), format!("above {bound:.0}"))
            }
            None if values.is_empty() => (Box::new(|_| false), "that is a number".to_owned()),
            None => {
                let mut sorted = values;
                let middle = sorted.len() / 2;
                let median = *sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
                (Box::new(move |value| value >= median), format!("of at least {median:.3} (the median)"))
            }
        };
        let (mut all, mut dropped) = (0, 0);
        let mut keep = |mut map: Map| {
            for (depth, value) in map.depths.iter_mut().zip(map.confidence.into_iter().flat_map(|(values, _)| values)) {
                all += usize::from(*depth > 0.0);
                if *depth > 0.0 && !(value.is_finite() && least(value)) {
                    dropped += 1;
                    *depth = 0.0;
                }
            }
            map.depths
        };
        let depths = read.into_iter().map(&mut keep).collect();
        let percent = 100.0 * f64::from(dropped) / all.max(1) as f64;
        self.notes.push(format!("depths   of {folder}, with confidence {stated}: {percent:.0}% are left out"));
        depths
    }

    /// Scales the maps to the capture's points, each by the median of the points on it, or of all where these are few; maps that no scale
    /// fits to the points are left out with their frames.
    fn scale(&mut self, set: &PhotoSet, frames: &mut Vec<Frame>) {
        let seen = points_of(set, frames);
        let pairs = |((frame, depths), points): ((&Frame, &Vec<f32>), &Vec<DVec3>)| -> Vec<[f64; 2]> {
            let on_map = projected(&frame.camera, points, set.tracks.is_empty()).into_iter();
            let pair = |(pixel, depth): (usize, f64)| (depths[pixel] > 0.0).then(|| [f64::from(depths[pixel]), depth]);
            on_map.filter_map(pair).collect()
        };
        let pairs: Vec<Vec<[f64; 2]>> = frames.iter().zip(&self.depths).zip(&seen).map(pairs).collect();
        let inverse: Vec<bool> = pairs.iter().map(|pairs| correlation(pairs) < INVERSE).collect();
        let mut ratios: Vec<Vec<f64>> =
            pairs.iter().map(|pairs| pairs.iter().map(|[map, point]| point / map).collect()).collect();
        let all = ratios.concat().len();
        if all < MIN_POINTS {
            let points = match set.points.positions.len() {
                0 => "the capture has no points".to_owned(),
                _ => format!("only {all} of the capture's points are on the maps"),
            };
            self.notes.push(format!("scale    {points}: depths are taken as they are, PNG in metres"));
            return;
        }
        let mut factors = Vec::with_capacity(ratios.len());
        for ((frame, ratios), inverse) in frames.iter().zip(&mut ratios).zip(inverse) {
            ratios.sort_unstable_by(f64::total_cmp);
            let quantile = |quarters: usize| ratios[ratios.len() * quarters / 4];
            factors.push(match ratios.len() {
                0..MIN_POINTS => None,
                _ if inverse => {
                    self.skipped.push(format!(
                        "{}: its depth map is nearer where the points are farther; depths that are inverse have to be converted",
                        frame.camera.name
                    ));
                    Some(f64::NAN)
                }
                _ if quantile(3) - quantile(1) > SPREAD * quantile(2) => {
                    self.skipped.push(format!(
                        "{}: no scale makes its depth map fit the points (half of the ratios are from {:.3} to {:.3}); depths that are \
                         inverse or known up to an offset have to be converted",
                        frame.camera.name,
                        quantile(1),
                        quantile(3)
                    ));
                    Some(f64::NAN)
                }
                _ => Some(quantile(2)),
            });
        }
        let mut own: Vec<f64> = factors.iter().flatten().copied().filter(|factor| factor.is_finite()).collect();
        own.sort_unstable_by(f64::total_cmp);
        // Where all maps have few points, these together; else the maps that have enough.
        let usual = match own.len() {
            0 => median(ratios.into_iter().flatten().collect()),
            _ => own[own.len() / 2],
        };
        let factors: Vec<f64> = factors.into_iter().map(|factor| factor.unwrap_or(usual)).collect();
        let mut unfit = factors.iter().map(|factor| factor.is_nan());
        frames.retain(|_| unfit.next() != Some(true));
        let scaled = std::mem::take(&mut self.depths).into_iter().zip(factors).filter(|(_, factor)| !factor.is_nan());
        self.depths = scaled
            .map(|(mut depths, factor)| {
                depths.iter_mut().for_each(|depth| *depth *= factor as f32);
                depths
            })
            .collect();
        let each = match own[..] {
            [low, .., high] => format!(", by map from {low:.4} to {high:.4}"),
            _ => String::new(),
        };
        self.notes.push(format!(
            "scale    depths are multiplied by {usual:.4}{each}, to fit {all} places of the capture's points"
        ));
    }

    /// The last reason why a photo was left out.
    pub fn left_out(&self) -> String {
        self.skipped.last().cloned().unwrap_or_else(|| "the others have none of their name".into())
    }

    /// Smallest and largest depth, with something to spare.
    ///
    /// # Errors
    /// Where there are next to no depths.
    pub fn range(&self) -> Result<[f64; 2]> {
        let depths = self.depths.iter().flatten().filter(|depth| **depth > 0.0).map(|depth| f64::from(*depth));
        range::of_depths(depths.collect()).ok_or_else(none_count)
    }

    /// What the maps measure, in the frame that `to_internal` leads to: depths within `ranges` of what no mask hides, less those that more
    /// views see through than agree with.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn measured(
        &self,
        context: &Arc<Context>,
        frames: &[Frame],
        ranges: &[[f64; 2]],
        to_internal: &Similarity,
    ) -> Result<Measured> {
        let cameras: Vec<Camera> = frames.iter().map(|frame| frame.camera.clone()).collect();
        let views = device_views(&cameras, ranges);
        let internal = |((frame, given), [near, far]): ((&Frame, &Vec<f32>), &[f64; 2])| -> Vec<f32> {
            let depth = |(pixel, depth): (usize, &f32)| {
                let depth = to_internal.length(f64::from(*depth));
                if (*near..=*far).contains(&depth) && !frame.hides(pixel) { depth as f32 } else { 0.0 }
            };
            given.iter().enumerate().map(depth).collect()
        };
        let mut depths: Vec<f32> = frames.iter().zip(&self.depths).zip(ranges).flat_map(internal).collect();
        let view_buffer = Buffer::from_slice(context, "views", &views)?;
        let support = consistency::check(context, &views, &view_buffer, &depths, TOLERANCE)?;
        depths
            .iter_mut()
            .zip(support)
            .filter(|(_, support)| support.through > support.agree)
            .for_each(|(depth, _)| *depth = 0.0);
        let map = |(frame, view): (&Frame, &super::frame::StereoView)| {
            planes(view.width as usize, &depths[view.first as usize..view.first as usize + frame.len()])
        };
        let maps = frames.iter().zip(&views).map(map).collect();
        Ok(Measured { maps, depths, views, pairs: 0 })
    }
}

fn none_count() -> Error {
    Error::request(
        "next to nothing of the depth maps counts; give maps with more depths, or a lower `min_confidence` where it is that",
    )
}

/// Where each pixel of a frame is in its photo, in shares of width and height; none where the lens shows nothing or the photo ends.
fn places(photo: &Photo, frame: &Frame) -> Vec<Option<[f64; 2]>> {
    let lens = Lens::new(photo.camera.intrinsics, photo.distortion);
    let straight = Lens::new(frame.camera.intrinsics, Distortion::default());
    let Intrinsics { width, height, .. } = photo.camera.intrinsics;
    let across = frame.camera.intrinsics.width;
    let place = |pixel: u32| {
        let at = DVec2::new(f64::from(pixel % across), f64::from(pixel / across)) + 0.5;
        let share = lens.project(straight.unproject(at)?)? / DVec2::new(f64::from(width), f64::from(height));
        (share.min_element() >= 0.0 && share.max_element() < 1.0).then(|| share.to_array())
    };
    (0..frame.len() as u32).map(place).collect()
}

/// Passes a map on that has the shape of its photo.
fn shaped(raster: Raster, photo: &Intrinsics, file: &std::path::Path) -> Result<Raster> {
    let shape = |width: u32, height: u32| f64::from(width) / f64::from(height);
    let off = shape(raster.width, raster.height) / shape(photo.width, photo.height) - 1.0;
    if off.abs() > SHAPE {
        let what = format!(
            "the map is {} x {} pixels and its photo {} x {}, which is another shape; give the maps of these photos, neither cut nor turned",
            raster.width, raster.height, photo.width, photo.height
        );
        return Err(Error::input(file, what));
    }
    Ok(raster)
}

/// Depth at a place: between four pixels of one surface, or else that of the pixel there.
fn between(raster: &Raster, [x, y]: [f64; 2]) -> f32 {
    let nearest = raster.at([x, y]);
    let at = |share: f64, side: u32| (share * f64::from(side) - 0.5).clamp(0.0, f64::from(side - 1));
    let (x, y) = (at(x, raster.width), at(y, raster.height));
    let (left, above) = (x as u32, y as u32);
    let (right, below) = ((left + 1).min(raster.width - 1), (above + 1).min(raster.height - 1));
    let value = |x: u32, y: u32| raster.values[(y * raster.width + x) as usize];
    let four = [value(left, above), value(right, above), value(left, below), value(right, below)];
    if four.iter().any(|depth| (depth - nearest).abs() > STEP * nearest) {
        return nearest;
    }
    let (u, v) = ((x - f64::from(left)) as f32, (y - f64::from(above)) as f32);
    let [a, b, c, d] = four;
    (1.0 - v) * (a + u * (b - a)) + v * (c + u * (d - c))
}

/// The points that each frame sees: by their tracks, or all where there are none.
fn points_of(set: &PhotoSet, frames: &[Frame]) -> Vec<Vec<DVec3>> {
    if set.tracks.is_empty() {
        return vec![set.points.positions.clone(); frames.len()];
    }
    let number: HashMap<&str, usize> = frames.iter().map(|frame| &frame.camera.name[..]).zip(0..).collect();
    let frame_of: Vec<Option<usize>> =
        set.photos.iter().map(|photo| number.get(&photo.camera.name[..]).copied()).collect();
    let mut seen = vec![Vec::new(); frames.len()];
    for (point, track) in set.points.positions.iter().zip(&set.tracks) {
        track.iter().filter_map(|photo| frame_of[*photo as usize]).for_each(|frame| seen[frame].push(*point));
    }
    seen
}

/// Pixels and depths of the points in a camera's picture; of those in each cell only the nearest, where the others may be hidden.
fn projected(camera: &Camera, points: &[DVec3], nearest: bool) -> Vec<(usize, f64)> {
    let Intrinsics { width, height, .. } = camera.intrinsics;
    let lens = Lens::new(camera.intrinsics, Distortion::default());
    let to_camera = camera.pose.rotation.inverse();
    let seen = points.iter().filter_map(|point| {
        let p = to_camera * (*point - camera.pose.position);
        Some((lens.pixel(p)?, p.z))
    });
    let pixel = |at: DVec2| at.y as usize * width as usize + at.x as usize;
    if !nearest {
        return seen.map(|(at, depth)| (pixel(at), depth)).collect();
    }
    let cell = f64::from(width.max(height)) / CELLS;
    let mut cells: BTreeMap<[i32; 2], (usize, f64)> = BTreeMap::new();
    for (at, depth) in seen {
        let first = cells.entry((at / cell).as_ivec2().to_array()).or_insert((pixel(at), depth));
        if depth < first.1 {
            *first = (pixel(at), depth);
        }
    }
    cells.into_values().collect()
}

/// Correlation of the logarithms of pairs; 0 where either is the same in all.
fn correlation(pairs: &[[f64; 2]]) -> f64 {
    let logs: Vec<[f64; 2]> = pairs.iter().map(|pair| pair.map(f64::ln)).collect();
    let mean = |k: usize| logs.iter().map(|log| log[k]).sum::<f64>() / logs.len().max(1) as f64;
    let means = [mean(0), mean(1)];
    let product = |a: usize, b: usize| logs.iter().map(|log| (log[a] - means[a]) * (log[b] - means[b])).sum::<f64>();
    let scale = (product(0, 0) * product(1, 1)).sqrt();
    if scale > 0.0 { product(0, 1) / scale } else { 0.0 }
}

fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// A map of depths, 0 where there is none, with the slopes of its surface; across an edge that of the side that goes on.
fn planes(width: usize, depths: &[f32]) -> DepthMap {
    let inverse = |at: Option<usize>| at.and_then(|at| depths.get(at)).filter(|d| **d > 0.0).map(|d| 1.0 / d);
    let plane = |at: usize| {
        let own = if depths[at] > 0.0 { 1.0 / depths[at] } else { 0.0 };
        let slope = |before: Option<usize>, after: Option<usize>| {
            let goes_on = |change: &f32| change.abs() <= STEP * own;
            let before = inverse(before).map(|before| own - before).filter(goes_on);
            let after = inverse(after).map(|after| after - own).filter(goes_on);
            match (before, after) {
                (Some(before), Some(after)) => 0.5 * (before + after),
                (one, other) => one.or(other).unwrap_or(0.0),
            }
        };
        let x = at % width;
        let across = slope((x > 0).then(|| at - 1), (x + 1 < width).then_some(at + 1));
        let down = slope(at.checked_sub(width), Some(at + width));
        Plane { slope: Vec2::new(across, down), inverse_depth: own }
    };
    let cost = |depth: &f32| if *depth > 0.0 { 0.0 } else { NO_MATCH };
    DepthMap { planes: (0..depths.len()).map(plane).collect(), costs: depths.iter().map(cost).collect() }
}

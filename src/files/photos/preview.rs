//! What a camera should see, before a photo is taken: photos nearby, moved over a surface between the points that they saw.
//!
//! It is a picture to stand by, not one to train on: depths between points are interpolated.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use image::{Rgb, RgbImage};

use super::orientation::quarter_turn;
use super::{Photo, PhotoSet};
use crate::engine::parallel;
use crate::scene::camera::Camera;
use crate::scene::lens::Lens;
use crate::{Error, Result};

/// Longest side of a preview in pixels.
const LONGEST: u32 = 320;
/// Photos that one is made of at most: what the nearest does not show, the next may.
const SOURCES: usize = 6;
/// Cells of depth along a photo's longer side, points that set the depth of one, and points that are looked at at most.
const CELLS: usize = 64;
const POINTS: usize = 4;
const MOST_POINTS: usize = 2000;
/// Pixels of a picture that a pixel of a photo becomes at most, along a side.
const LARGEST: f64 = 4.0;
/// Photos that are shown at most beside those that previews are made of.
const MOST_SHOWN: usize = 150;
/// Rounds in which holes are filled from their neighbours.
const ROUNDS: u32 = 3;
/// What nobody has photographed.
const UNSEEN: Rgb<u8> = Rgb([208, 210, 214]);

/// A small photo with a depth at each pixel.
struct Relief<'a> {
    photo: &'a Photo,
    picture: RgbImage,
    /// Points seen: undistorted places in the plane at distance one, and depths along the axis.
    points: Vec<(DVec2, f64)>,
}

/// The photos of a capture, by how near they are to a camera, and pictures of what it should see.
pub struct Previews<'a> {
    set: &'a PhotoSet,
    seen: Vec<Vec<u32>>,
    /// See [`PhotoSet::step`].
    step: f64,
}

impl<'a> Previews<'a> {
    /// Of the photos of a capture.
    pub fn new(set: &'a PhotoSet) -> Self {
        Self { set, seen: set.seen(), step: set.step() }
    }

    /// Indices of the photos with an image that were taken nearest to a camera and most as it looks, the nearest first.
    pub fn nearest(&self, camera: &Camera) -> Vec<usize> {
        let mut photos = self.set.nearest(camera, self.step, |photo| photo.image.is_some());
        photos.truncate(SOURCES);
        photos
    }

    /// What each camera should see, and the photos nearest to them and some others, small, by index.
    ///
    /// # Errors
    /// Where an image cannot be read.
    pub fn pictures(&self, cameras: &[Camera]) -> Result<(Vec<RgbImage>, HashMap<usize, RgbImage>)> {
        let sources: Vec<Vec<usize>> = cameras.iter().map(|camera| self.nearest(camera)).collect();
        let there: Vec<usize> = (0..self.set.photos.len()).filter(|i| self.set.photos[*i].image.is_some()).collect();
        let others = there.iter().step_by(there.len().div_ceil(MOST_SHOWN).max(1));
        let mut needed: Vec<usize> = sources.iter().flatten().chain(others).copied().collect();
        needed.sort_unstable();
        needed.dedup();
        let read: Result<Vec<Relief>> = parallel::mapped(&needed, |_, photo| self.relief(*photo)).into_iter().collect();
        let reliefs: HashMap<usize, Relief> = needed.into_iter().zip(read?).collect();
        let pictures = parallel::mapped(cameras, |i, camera| {
            let of = sources[i].iter().map(|photo| &reliefs[photo]);
            warped(camera, of)
        });
        Ok((pictures, reliefs.into_iter().map(|(photo, relief)| (photo, relief.picture)).collect()))
    }

    fn relief(&self, index: usize) -> Result<Relief<'a>> {
        let photo = &self.set.photos[index];
        let pose = photo.camera.pose;
        let to_camera = pose.rotation.inverse();
        let tells = !self.seen[index].is_empty();
        let all = || &self.set.points.positions;
        let local = |p: DVec3| to_camera * (p - pose.position);
        let mut points: Vec<(DVec2, f64)> = if tells {
            let of = |point: &u32| local(all()[*point as usize]);
            self.seen[index].iter().map(of).filter(|p| p.z > 0.0).map(|p| (p.truncate() / p.z, p.z)).collect()
        } else {
            nearest_by_cell(&photo.camera, all().iter().map(|p| local(*p)))
        };
        let stride = points.len().div_ceil(MOST_POINTS).max(1);
        points = points.into_iter().step_by(stride).collect();
        Ok(Relief { photo, picture: small(photo)?, points })
    }
}

/// Share of a preview that no photo shows.
pub fn unseen(picture: &RgbImage) -> f64 {
    let unseen = picture.pixels().filter(|pixel| **pixel == UNSEEN).count();
    unseen as f64 / picture.pixels().len().max(1) as f64
}

/// A photo's image, small.
///
/// # Errors
/// Where it cannot be read.
pub fn small(photo: &Photo) -> Result<RgbImage> {
    let path = photo.image.as_ref().ok_or_else(|| Error::request(format!("{} has no image", photo.camera.name)))?;
    let mut whole = image::open(path).map_err(|e| Error::input(path, e.to_string()))?;
    if let Some(orientation) = quarter_turn(path, (whole.width(), whole.height()), &photo.camera.intrinsics) {
        whole.apply_orientation(orientation);
    }
    Ok(whole.thumbnail(LONGEST, LONGEST).into_rgb8())
}

/// Of points in camera axes the nearest in each cell of the picture: others may be hidden.
fn nearest_by_cell(camera: &Camera, points: impl Iterator<Item = DVec3>) -> Vec<(DVec2, f64)> {
    let lens = &camera.intrinsics;
    let mut cells: HashMap<(u32, u32), (DVec2, f64)> = HashMap::new();
    let cell = f64::from(lens.width.max(lens.height)) / CELLS as f64;
    for p in points.filter(|p| p.z > 0.0) {
        let place = p.truncate() / p.z;
        let pixel = DVec2::from(lens.focal) * place + DVec2::from(lens.principal);
        if pixel.min_element() >= 0.0 && pixel.x < f64::from(lens.width) && pixel.y < f64::from(lens.height) {
            let key = ((pixel.x / cell) as u32, (pixel.y / cell) as u32);
            let nearest = cells.entry(key).or_insert((place, p.z));
            if p.z < nearest.1 {
                *nearest = (place, p.z);
            }
        }
    }
    let mut sorted: Vec<_> = cells.into_iter().collect();
    sorted.sort_unstable_by_key(|(key, _)| *key);
    sorted.into_iter().map(|(_, point)| point).collect()
}

/// Depth along the axis at a place in the plane at distance one: that of the nearest points, weighted by how near they are, in inverse
/// depth.
fn depth_at(points: &[(DVec2, f64)], place: DVec2) -> f64 {
    let mut near = [(f64::INFINITY, 0.0); POINTS];
    for (other, depth) in points {
        let away = other.distance_squared(place);
        if away < near[POINTS - 1].0 {
            near[POINTS - 1] = (away, *depth);
            near.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
    }
    let known = near.iter().filter(|(away, _)| away.is_finite());
    let (sum, weights) = known.fold((0.0, 0.0), |(sum, weights), (away, depth)| {
        let weight = 1.0 / (away + 1e-8);
        (sum + weight / depth, weights + weight)
    });
    weights / sum
}

impl Relief<'_> {
    /// Position in the world and colour of each pixel, and the side of a pixel there.
    fn surface(&self) -> Vec<(DVec3, f64, Rgb<u8>)> {
        let (width, height) = self.picture.dimensions();
        let camera = &self.photo.camera;
        let longest = f64::from(width.max(height));
        let (columns, rows) =
            ([width, height]).map(|side| (f64::from(side) / longest * CELLS as f64).ceil() as usize + 1).into();
        let lens: Lens = self.photo.lens();
        let scale = f64::from(camera.intrinsics.width) / f64::from(width);
        let direction = |x: f64, y: f64| lens.unproject(scale * DVec2::new(x, y)).map(|d| d.truncate() / d.z);
        let step = longest / CELLS as f64;
        let grid: Vec<Option<f64>> = (0..rows)
            .flat_map(|y| (0..columns).map(move |x| (x, y)))
            .map(|(x, y)| {
                let place =
                    direction((step * x as f64).min(f64::from(width)), (step * y as f64).min(f64::from(height)))?;
                Some(depth_at(&self.points, place))
            })
            .collect();
        let mut surface = Vec::with_capacity((width * height) as usize);
        for (x, y, colour) in self.picture.enumerate_pixels() {
            let (u, v) = ((f64::from(x) + 0.5) / step, (f64::from(y) + 0.5) / step);
            let (i, j) = ((u as usize).min(columns - 2), (v as usize).min(rows - 2));
            let corner = |i: usize, j: usize| grid[j * columns + i];
            let [Some(a), Some(b), Some(c), Some(d)] =
                [corner(i, j), corner(i + 1, j), corner(i, j + 1), corner(i + 1, j + 1)]
            else {
                continue;
            };
            let (u, v) = (u - i as f64, v - j as f64);
            // In inverse depth, in which planes are straight.
            let inverse = (1.0 - v) * ((1.0 - u) / a + u / b) + v * ((1.0 - u) / c + u / d);
            if let Some(place) = direction(f64::from(x) + 0.5, f64::from(y) + 0.5) {
                let depth = 1.0 / inverse;
                let local = depth * place.extend(1.0);
                let side = scale * depth / camera.intrinsics.focal[0];
                surface.push((camera.pose.rotation * local + camera.pose.position, side, *colour));
            }
        }
        surface
    }
}

/// What a camera sees of photos, the first before the others.
fn warped<'a>(camera: &Camera, sources: impl Iterator<Item = &'a Relief<'a>>) -> RgbImage {
    let lens = &camera.intrinsics;
    let scale = f64::from(LONGEST) / f64::from(lens.width.max(lens.height));
    let [width, height] = [lens.width, lens.height].map(|side| (scale * f64::from(side)).round().max(1.0) as u32);
    let to_camera = camera.pose.rotation.inverse();
    let mut picture = RgbImage::from_pixel(width, height, UNSEEN);
    let mut taken = vec![false; (width * height) as usize];
    for relief in sources.filter(|relief| relief.points.len() >= POINTS) {
        let mut depths = vec![f64::INFINITY; taken.len()];
        let mut colours = vec![UNSEEN; taken.len()];
        for (position, side, colour) in relief.surface() {
            let p = to_camera * (position - camera.pose.position);
            if p.z <= 0.0 {
                continue;
            }
            let pixel = scale * (DVec2::from(lens.focal) * p.truncate() / p.z + DVec2::from(lens.principal));
            let half = (0.5 * scale * lens.focal[0] * side / p.z).clamp(0.5, 0.5 * LARGEST);
            let (low, high) = (pixel - half, pixel + half);
            for y in (low.y.round().max(0.0) as u32)..(high.y.round().clamp(0.0, f64::from(height)) as u32) {
                for x in (low.x.round().max(0.0) as u32)..(high.x.round().clamp(0.0, f64::from(width)) as u32) {
                    let i = (y * width + x) as usize;
                    if p.z < depths[i] {
                        (depths[i], colours[i]) = (p.z, colour);
                    }
                }
            }
        }
        for (i, pixel) in picture.pixels_mut().enumerate() {
            if !taken[i] && depths[i].is_finite() {
                (*pixel, taken[i]) = (colours[i], true);
            }
        }
    }
    for _ in 0..ROUNDS {
        fill(&mut picture, &mut taken);
    }
    picture
}

/// Gives pixels that are not taken the mean of their neighbours, where most of these are.
fn fill(picture: &mut RgbImage, taken: &mut [bool]) {
    let (width, height) = picture.dimensions();
    let before = (picture.clone(), taken.to_vec());
    for y in 0..height {
        for x in 0..width {
            let i = (y * width + x) as usize;
            if before.1[i] {
                continue;
            }
            let around = (y.saturating_sub(1)..=(y + 1).min(height - 1))
                .flat_map(|y| (x.saturating_sub(1)..=(x + 1).min(width - 1)).map(move |x| (x, y)))
                .filter(|(x, y)| before.1[(y * width + x) as usize]);
            let (sum, count) = around.fold(([0u32; 3], 0u32), |(sum, count), (x, y)| {
                let Rgb(colour) = *before.0.get_pixel(x, y);
                ([0, 1, 2].map(|c: usize| sum[c] + u32::from(colour[c])), count + 1)
            });
            if count >= 4 {
                picture.put_pixel(x, y, Rgb(sum.map(|sum| (sum / count) as u8)));
                taken[i] = true;
            }
        }
    }
}

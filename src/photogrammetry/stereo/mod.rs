//! A coarse surface from posed photos: plane-sweep stereo, or depth maps that there are already, and visual hull.
//!
//! Photos are shrunk and taken as pinholes ([`frame`]), those that spread best are chosen and paired ([`choose`]), the cameras
//! determine where to look ([`volume`]), masks carve a hull ([`hull`]), planes are swept through it and refined for each view
//! ([`depth`]), depths that no other view agrees with go ([`consistency`]), gaps between the others are closed where a wall is
//! too smooth to be matched ([`smooth`]; `sweep` is all of this), and the rest is fused into oriented points, with the hull's own surface
//! where stereo sees nothing ([`fusion`]). All of it happens in a frame in which the scene's ball is the unit ball. Depth maps of files
//! (`given`) take the place of the sweep.

pub mod choose;
pub mod consistency;
pub mod cost;
pub mod depth;
pub mod frame;
pub(crate) mod fusion;
mod given;
pub mod hull;
mod range;
pub(crate) mod smooth;
mod sweep;

use std::sync::Arc;
use std::time::Instant;

use glam::{DVec3, Vec3};

use self::depth::DepthMap;
use self::frame::{Frame, StereoView, device_views};
use self::fusion::Sample;
use self::given::Given;
use self::hull::{Evidence, Hull};
use crate::engine::vulkan::Context;
use crate::files::io::depth_maps::DepthMaps;
use crate::files::photos::volume::{self, Volume};
use crate::files::photos::{Photo, PhotoSet};
use crate::scene::camera::Camera;
use crate::scene::similarity::Similarity;
use crate::scene::surface::Points;
use crate::scene::voxels::Grid;
use crate::{Error, Result};

/// Fewest photos that a surface is made from.
pub const MIN_PHOTOS: usize = 5;
/// Voxels along the longest side of the hull.
const HULL_CELLS: u32 = 128;

/// What to make a surface from, and how finely.
#[derive(Clone, Debug, PartialEq)]
pub struct StereoOptions {
    /// Photos to use at most, those that spread best.
    pub photos: usize,
    /// Longest side in pixels that photos are shrunk to.
    pub resolution: u32,
    /// Planes of the sweep, 16 to 256.
    pub hypotheses: u32,
    /// Whether masks carve a hull.
    pub hull: bool,
    /// Whether the set's sparse points determine where the scene is; else the cameras do.
    pub use_points: bool,
    /// Smallest and largest depth, in the capture's units, where they are known.
    pub depths: Option<[f64; 2]>,
    /// Depth maps to take in place of stereo; photos without one are left out then.
    pub maps: Option<DepthMaps>,
    /// Bytes that photos take together while they are decoded.
    pub memory: u64,
    /// Whether photos that cannot be decoded are left out; else they are errors.
    pub skip_unreadable: bool,
    /// Seed of the choice of photos and of the refinement.
    pub seed: u64,
}

impl Default for StereoOptions {
    fn default() -> Self {
        Self {
            photos: 30,
            resolution: 320,
            hypotheses: 64,
            hull: true,
            use_points: false,
            depths: None,
            maps: None,
            memory: 1 << 30,
            skip_unreadable: false,
            seed: 0,
        }
    }
}

/// A surface and how it was made.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// Oriented points in the capture's frame, with normals, radii and colours: first those from depths.
    pub points: Points,
    /// How many of the points are from depths, of stereo or of maps.
    pub from_depths: usize,
    /// Names of the photos used.
    pub photos: Vec<String>,
    /// Why photos were left out, a line each.
    pub skipped: Vec<String>,
    /// What was understood of depth maps and done with them, a line each.
    pub notes: Vec<String>,
    /// Pairs of photos compared; 0 with depth maps.
    pub pairs: usize,
    /// Smallest and largest depth searched, in the capture's units.
    pub depths: [f64; 2],
    /// Part of the pixels that kept a depth, of those that masks leave.
    pub kept: f64,
    /// Seconds of each stage.
    pub seconds: Vec<(&'static str, f64)>,
}

/// What each view measures: its depths, at all views' pixels.
struct Measured {
    views: Vec<StereoView>,
    /// Depths of all views' pixels, 0 where there is none.
    depths: Vec<f32>,
    /// The same by view, with slopes.
    maps: Vec<DepthMap>,
    /// Pairs of photos compared.
    pairs: usize,
}

/// Makes a surface from photos, by stereo or from the depth maps that the options name.
///
/// # Errors
/// Where there are fewer than [`MIN_PHOTOS`] with images (and depth maps), where images or maps cannot be read, where the cameras do not
/// determine where to look, where no two photos overlap, where nothing was found, and where the device fails.
pub fn reconstruct(context: &Arc<Context>, set: &PhotoSet, options: &StereoOptions) -> Result<Reconstruction> {
    let mut clock = Clock { last: Instant::now(), seconds: Vec::new() };
    let chosen = choose_photos(set, options)?;
    let cameras: Vec<Camera> = chosen.iter().map(|photo| photo.camera.clone()).collect();
    let mut skipped = Vec::new();
    let mut frames = Frame::read(&chosen, options.resolution, options.memory, &Similarity::IDENTITY, |error| {
        skipped.push(error.to_string());
        if options.skip_unreadable { Ok(()) } else { Err(error) }
    })?;
    let enough = |frames: &[Frame], what: &str| match frames.len() {
        MIN_PHOTOS.. => Ok(()),
        count => Err(Error::input(&set.path, format!("{count} photos {what}; a surface needs at least {MIN_PHOTOS}"))),
    };
    enough(&frames, "can be decoded")?;
    clock.stage("photos");
    let mut given = None;
    if let Some(maps) = &options.maps {
        let found = Given::read(maps, set, &chosen, &mut frames)?;
        enough(&frames, &format!("have depth maps that can be used ({})", found.left_out()))?;
        given = Some(found);
        clock.stage("depth maps");
    }

    let (range, volume) = match find_volume(set, &cameras, options) {
        Some(volume) => (options.depths, volume),
        None if options.use_points => return Err(no_points()),
        None => {
            let range = match &given {
                Some(given) => given.range()?,
                None => range::of_walk(context, set, options)?,
            };
            (Some(range), around_cameras(&cameras, Some(range)))
        }
    };
    let to_internal = Similarity::to_unit_sphere(volume.centre, volume.radius);
    frames.iter_mut().for_each(|frame| frame.camera.pose = to_internal.pose(&frame.camera.pose));
    let cameras: Vec<Camera> = frames.iter().map(|frame| frame.camera.clone()).collect();
    let ball = Volume { centre: DVec3::ZERO, radius: 1.0 };
    let mut ranges = match range {
        Some(range) => vec![range.map(|depth| to_internal.length(depth)); cameras.len()],
        None => ball_depths(&cameras, &ball),
    };
    let masks = masks(&frames);
    let masked = options.hull && frames.iter().any(|frame| frame.mask.is_some());
    let mut hull = Hull::none(context)?;
    if masked {
        hull = first_hull(context, &device_views(&cameras, &ranges), &masks)?;
        if range.is_none() {
            let (low, high) = hull.bounds().unwrap_or((DVec3::NEG_ONE, DVec3::ONE));
            ranges = cameras.iter().map(|camera| box_depths(camera, low, high)).collect();
        }
        clock.stage("hull");
    }
    let Measured { views, depths, maps, pairs } = match &given {
        Some(given) => given.measured(context, &frames, &ranges, &to_internal)?,
        None => sweep::measured(context, &frames, &ranges, &hull, options, &mut clock)?,
    };

    let searched = masks.iter().filter(|mask| **mask >= 0.5).count().max(1);
    let kept = depths.iter().filter(|depth| **depth > 0.0).count() as f64 / searched as f64;
    let inside = |p: DVec3| range.is_some() || p.length() <= 1.0;
    let (samples, footprint) = samples(&frames, &views, &maps, &depths, inside);
    let cell = if hull.exists() { FUSED_VOXELS * hull.grid().cell } else { FUSED_PIXELS * footprint };
    let stereo = fusion::fuse(&samples, cell);
    clock.stage("fusion");
    let mut filling = Vec::new();
    if hull.exists() {
        let behind = 2.0 * hull.grid().cell as f32;
        let evidence = Evidence { views: &views, masks: &masks, depths: &depths, least: least(&views), behind };
        let carved = Hull::carve(context, *hull.grid(), &evidence)?;
        filling = coloured(&carved, &frames, &views, &depths);
        clock.stage("filling");
    }
    let holes = fusion::holes(&stereo, &fusion::means(&filling, cell), cell);
    let from_depths = stereo.len();
    let all: Vec<Sample> = stereo.into_iter().chain(holes).collect();
    if all.len() < MIN_POINTS {
        let remedy = match given {
            Some(_) => "check the scale of the depth maps, or give `near` and `far`",
            None => "give photos with more overlap (`photos`), `near` and `far`, or masks",
        };
        return Err(Error::request(format!("only {} points were found; {remedy}", all.len())));
    }
    let out = to_internal.inverse();
    let near = ranges.iter().map(|range| range[0]).fold(f64::INFINITY, f64::min);
    let far = ranges.iter().map(|range| range[1]).fold(0.0, f64::max);
    let mut notes = Vec::new();
    if let Some(given) = given {
        notes = given.notes;
        if kept < FEW_KEPT {
            notes.push(
                "warning  hardly any depth of the maps is where the cameras look: their scale may be wrong".into(),
            );
        }
        skipped.extend(given.skipped);
    }
    Ok(Reconstruction {
        points: Points {
            positions: all.iter().map(|sample| out.point(sample.position)).collect(),
            normals: all.iter().map(|sample| sample.normal).collect(),
            radii: vec![out.length(COVER * cell) as f32; all.len()],
            colours: all.iter().map(|sample| sample.colour.round().to_array().map(|c| c as u8)).collect(),
            oriented: true,
            ..Points::default()
        },
        from_depths,
        photos: cameras.into_iter().map(|camera| camera.name).collect(),
        skipped,
        notes,
        pairs,
        depths: [near, far].map(|depth| out.length(depth)),
        kept,
        seconds: clock.seconds,
    })
}

/// The visual hull of the chosen photos alone, as oriented points in the capture's frame.
///
/// # Errors
/// As [`reconstruct`], and where no photo has a mask.
pub fn hull_of(context: &Arc<Context>, set: &PhotoSet, options: &StereoOptions) -> Result<Points> {
    let chosen = choose_photos(set, options)?;
    let cameras: Vec<Camera> = chosen.iter().map(|photo| photo.camera.clone()).collect();
    let volume = find_volume(set, &cameras, options).ok_or_else(no_points)?;
    let to_internal = Similarity::to_unit_sphere(volume.centre, volume.radius);
    let frames = Frame::read(&chosen, options.resolution, options.memory, &to_internal, Err)?;
    let cameras: Vec<Camera> = frames.iter().map(|frame| frame.camera.clone()).collect();
    let views = device_views(&cameras, &vec![[0.5, 1.0]; cameras.len()]);
    let hull = first_hull(context, &views, &masks(&frames))?;
    let out = to_internal.inverse();
    let (positions, normals) = hull.surface().into_iter().map(|(p, n)| (out.point(p), n)).unzip();
    Ok(Points { positions, normals, oriented: true, ..Points::default() })
}

/// Masks of all frames' pixels; 1 where a frame has none.
fn masks(frames: &[Frame]) -> Vec<f32> {
    frames.iter().flat_map(|frame| frame.mask.clone().unwrap_or_else(|| vec![1.0; frame.len()])).collect()
}

/// Views that must hold a voxel of a hull.
fn least(views: &[StereoView]) -> u32 {
    (views.len() as u32).div_ceil(3).max(2)
}

/// The hull of the masks in the unit ball's cube, carved twice: the second grid is as tight as the first hull allows.
fn first_hull(context: &Arc<Context>, views: &[StereoView], masks: &[f32]) -> Result<Hull> {
    let depths = vec![0f32; masks.len()];
    let evidence = Evidence { views, masks, depths: &depths, least: least(views), behind: 0.0 };
    let bounds = |hull: &Hull| {
        hull.bounds().ok_or_else(|| {
            Error::request("the masks of the photos have nothing in common; check that poses and masks belong together")
        })
    };
    let coarse = Hull::carve(context, grid(DVec3::NEG_ONE, DVec3::ONE), &evidence)?;
    let (low, high) = bounds(&coarse)?;
    let margin = DVec3::splat(coarse.grid().cell);
    let hull = Hull::carve(context, grid(low - margin, high + margin), &evidence)?;
    bounds(&hull)?;
    Ok(hull)
}

/// Side of a cell that points are fused in, in voxels of the hull or else in pixels at the median depth: wider than depths are
/// off, so that a surface is one layer.
const FUSED_VOXELS: f64 = 2.0;
const FUSED_PIXELS: f64 = 2.5;
/// Radius of a point's disc in cells: points lie anywhere in theirs, and a surface of discs should have no gaps.
const COVER: f64 = 1.25;
/// Part of the pixels with a depth below which depth maps are likely to have another scale than the capture.
const FEW_KEPT: f64 = 0.05;
/// Fewest points that are a surface.
const MIN_POINTS: usize = 100;

/// Times the stages.
struct Clock {
    last: Instant,
    seconds: Vec<(&'static str, f64)>,
}

impl Clock {
    fn stage(&mut self, name: &'static str) {
        self.seconds.push((name, self.last.elapsed().as_secs_f64()));
        self.last = Instant::now();
    }
}

fn choose_photos(set: &PhotoSet, options: &StereoOptions) -> Result<Vec<Photo>> {
    let reach = set.reach();
    let near = |photo: &&Photo| reach.holds(photo.camera.pose.position);
    let measured =
        |photo: &&Photo| options.maps.as_ref().is_none_or(|maps| maps.depth_of(&photo.camera.name).is_some());
    let usable = set.photos.iter().filter(|photo| photo.image.is_some()).filter(measured);
    let usable: Vec<&Photo> = usable.filter(near).collect();
    let count = options.photos.min(usable.len());
    if count < MIN_PHOTOS {
        let what = format!(
            "{} of {} photos have images{} and {} are asked for; a surface needs at least {MIN_PHOTOS}",
            usable.len(),
            set.photos.len(),
            if options.maps.is_some() { " and depth maps of their names (.png or .npy)" } else { "" },
            options.photos
        );
        return Err(Error::input(&set.path, what));
    }
    let directions: Vec<DVec3> = usable.iter().map(|photo| photo.camera.pose.forward()).collect();
    Ok(choose::spread(&directions, count, options.seed).into_iter().map(|i| usable[i].clone()).collect())
}

/// The ball that the scene is in; none where the cameras look at no one place and no depths are given.
fn find_volume(set: &PhotoSet, cameras: &[Camera], options: &StereoOptions) -> Option<Volume> {
    let found =
        if options.use_points { volume::around_points(&set.points.positions) } else { volume::around_focus(cameras) };
    found.or_else(|| options.depths.map(|depths| around_cameras(cameras, Some(depths))))
}

fn no_points() -> Error {
    Error::request("the capture has no points to use; leave `use_points` out")
}

/// The ball about all cameras that reaches as far as they see.
fn around_cameras(cameras: &[Camera], depths: Option<[f64; 2]>) -> Volume {
    let centre = cameras.iter().map(|camera| camera.pose.position).sum::<DVec3>() / cameras.len() as f64;
    Volume { centre, radius: depths.map_or(1.0, |[_, far]| far) }
}

/// The grid of cubes over a box, [`HULL_CELLS`] along its longest side.
fn grid(low: DVec3, high: DVec3) -> Grid {
    let cell = (high - low).max_element() / f64::from(HULL_CELLS);
    let along = |side: f64| ((side / cell).ceil() as u32).clamp(1, HULL_CELLS);
    Grid { origin: low, cell, dims: (high - low).to_array().map(along) }
}

/// Depths, near and far, between which each camera looks for the ball. None is nearer than a tenth of its far end.
pub fn ball_depths(cameras: &[Camera], volume: &Volume) -> Vec<[f64; 2]> {
    let of = |camera: &Camera| {
        let along = (volume.centre - camera.pose.position).dot(camera.pose.forward());
        let far = (along + volume.radius).max(0.5 * volume.radius);
        [(along - volume.radius).max(0.1 * far), far]
    };
    cameras.iter().map(of).collect()
}

/// Depths between which a camera sees a box: something small, where it looks away from it.
fn box_depths(camera: &Camera, low: DVec3, high: DVec3) -> [f64; 2] {
    let depth = |i: usize| {
        let part = DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64);
        (low + part * (high - low) - camera.pose.position).dot(camera.pose.forward())
    };
    let (near, far) = (0..8).map(depth).fold((f64::INFINITY, 0f64), |(near, far), d| (near.min(d), far.max(d)));
    let far = far.max(1e-3 * (high - low).length());
    [near.clamp(0.1 * far, 0.9 * far), far]
}

/// The points of all depths, and the median width of a pixel at them.
fn samples(
    frames: &[Frame],
    views: &[StereoView],
    maps: &[DepthMap],
    depths: &[f32],
    inside: impl Fn(DVec3) -> bool,
) -> (Vec<Sample>, f64) {
    let mut samples = Vec::new();
    let mut widths = Vec::new();
    for ((frame, view), map) in frames.iter().zip(views).zip(maps) {
        let Camera { pose, intrinsics, .. } = &frame.camera;
        for pixel in 0..frame.len() as u32 {
            let depth = depths[(view.first + pixel) as usize];
            if depth <= 0.0 {
                continue;
            }
            let [x, y] = [pixel % view.width, pixel / view.width];
            let position = view.unproject(x as f32 + 0.5, y as f32 + 0.5, depth).as_dvec3();
            if !inside(position) {
                continue;
            }
            let normal = pose.rotation * map.normal(intrinsics, [x, y]);
            let colour = DVec3::from_array(frame.colours[pixel as usize].map(f64::from));
            samples.push(Sample { position, normal, colour });
            widths.push(f64::from(depth) / intrinsics.focal[0]);
        }
    }
    widths.sort_unstable_by(f64::total_cmp);
    (samples, widths.get(widths.len() / 2).copied().unwrap_or(1.0))
}

/// The hull's surface, each point with its colour in the view that sees it most squarely, as far as depths show.
fn coloured(hull: &Hull, frames: &[Frame], views: &[StereoView], depths: &[f32]) -> Vec<Sample> {
    let slack = 2.0 * hull.grid().cell as f32;
    let colour = |p: Vec3, normal: Vec3| {
        let mut best = (f32::NEG_INFINITY, DVec3::splat(128.0));
        for (frame, view) in frames.iter().zip(views) {
            let Some((texel, depth)) = view.texel(p) else { continue };
            let square = normal.dot((Vec3::from(view.centre) - p).normalize());
            let hidden = depths[texel] > 0.0 && depths[texel] < depth - slack;
            if square > best.0 && !hidden {
                best = (square, DVec3::from_array(frame.colours[texel - view.first as usize].map(f64::from)));
            }
        }
        best.1
    };
    let sample = |(position, normal): (DVec3, DVec3)| Sample {
        position,
        normal,
        colour: colour(position.as_vec3(), normal.as_vec3()),
    };
    hull.surface().into_iter().map(sample).collect()
}

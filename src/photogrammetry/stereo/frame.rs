//! Frames: photos at the size that stereo works at, as pinholes, in a normalised world; and what the device holds of them.

use glam::{DMat3, DVec2, DVec3, DVec4, Vec3};

use crate::engine::vulkan::shaders::glsl::photogrammetry::stereo::zncc;
use crate::files::photos::Photo;
use crate::files::photos::decode::{DecodeSettings, Decoded, Decoder};
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::colour;
use crate::scene::lens::{Distortion, Lens};
use crate::scene::similarity::Similarity;
use crate::{Error, Result};

/// Neighbours of a view at most.
pub const MAX_PAIRS: usize = zncc::MAX_PAIRS as usize;

/// A photo at working size without distortion. Pixels run row by row.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Pose and pinhole.
    pub camera: Camera,
    /// 8-bit sRGB colours.
    pub colours: Vec<[u8; 3]>,
    /// Brightness in [0, 1], sRGB-encoded.
    pub brightness: Vec<f32>,
    /// How much of each pixel the object covers; none where nothing is known of it.
    pub mask: Option<Vec<f32>>,
}

crate::gpu_struct! {
    /// A posed picture. Pixel (0, 0) is the picture's corner: centres are at halves.
    pub struct StereoView {
        /// Unprojection: `centre + z (across x + along y + corner)` is the point of pixel (x, y) at depth z.
        pub across: [f32; 3],
        /// Pixels in a row.
        pub width: u32,
        /// See `across`.
        pub along: [f32; 3],
        /// Rows of pixels.
        pub height: u32,
        /// See `across`.
        pub corner: [f32; 3],
        /// Place of its first pixel in the buffers of all views.
        pub first: u32,
        /// Camera centre.
        pub centre: [f32; 3],
        /// Neighbours that it is compared with.
        pub pairs: u32,
        /// Projection: `(row_x . p + shift_x, row_y . p + shift_y) / (row_z . p + shift_z)` is the pixel of point p.
        pub row_x: [f32; 3],
        /// See `row_x`.
        pub shift_x: f32,
        /// See `row_x`.
        pub row_y: [f32; 3],
        /// See `row_x`.
        pub shift_y: f32,
        /// The depth of p is `row_z . p + shift_z`.
        pub row_z: [f32; 3],
        /// See `row_z`.
        pub shift_z: f32,
        /// Smallest depth that is searched.
        pub near: f32,
        /// Largest depth that is searched.
        pub far: f32,
        /// Unused.
        pub spare0: u32,
        /// Unused.
        pub spare1: u32,
    }
}

crate::gpu_struct! {
    /// How pixels of a view map to a neighbour.
    pub struct StereoPair {
        /// Pixel q with inverse depth w is at `(row_x . (q, 1) + shift_x w, row_y . (q, 1) + shift_y w) / (row_z . (q, 1) + shift_z w)`.
        pub row_x: [f32; 3],
        /// See `row_x`.
        pub shift_x: f32,
        /// See `row_x`.
        pub row_y: [f32; 3],
        /// See `row_x`.
        pub shift_y: f32,
        /// See `row_x`.
        pub row_z: [f32; 3],
        /// See `row_x`.
        pub shift_z: f32,
        /// The neighbour.
        pub view: u32,
        /// Unused.
        pub spare0: u32,
        /// Unused.
        pub spare1: u32,
        /// Unused.
        pub spare2: u32,
    }
}

/// The matrix of a pinhole: pixel from camera axes, times depth.
fn pinhole(intrinsics: &Intrinsics) -> DMat3 {
    let Intrinsics { focal: [fx, fy], principal: [cx, cy], .. } = *intrinsics;
    DMat3::from_cols(DVec3::new(fx, 0.0, 0.0), DVec3::new(0.0, fy, 0.0), DVec3::new(cx, cy, 1.0))
}

fn narrow(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}

impl StereoView {
    /// A camera whose first pixel is at `first`, searched from depth `near` to `far`.
    pub fn new(camera: &Camera, first: u32, [near, far]: [f64; 2]) -> Self {
        let k = pinhole(&camera.intrinsics);
        let to_world = DMat3::from_quat(camera.pose.rotation);
        let unproject = to_world * k.inverse();
        let project = (k * to_world.transpose()).transpose();
        let shift = -project.transpose() * camera.pose.position;
        Self {
            across: narrow(unproject.x_axis),
            width: camera.intrinsics.width,
            along: narrow(unproject.y_axis),
            height: camera.intrinsics.height,
            corner: narrow(unproject.z_axis),
            first,
            centre: narrow(camera.pose.position),
            pairs: 0,
            row_x: narrow(project.x_axis),
            shift_x: shift.x as f32,
            row_y: narrow(project.y_axis),
            shift_y: shift.y as f32,
            row_z: narrow(project.z_axis),
            shift_z: shift.z as f32,
            near: near as f32,
            far: far as f32,
            spare0: 0,
            spare1: 0,
        }
    }

    /// The point of a pixel at a depth; the twin of `unproject` in `stereo.glsl`.
    pub fn unproject(&self, x: f32, y: f32, depth: f32) -> Vec3 {
        let ray = x * Vec3::from(self.across) + y * Vec3::from(self.along) + Vec3::from(self.corner);
        Vec3::from(self.centre) + depth * ray
    }

    /// Pixel and depth of a point; the twin of `project` in `stereo.glsl`.
    pub fn project(&self, p: Vec3) -> Vec3 {
        let depth = Vec3::from(self.row_z).dot(p) + self.shift_z;
        let x = Vec3::from(self.row_x).dot(p) + self.shift_x;
        let y = Vec3::from(self.row_y).dot(p) + self.shift_y;
        Vec3::new(x / depth, y / depth, depth)
    }

    /// Place, in the buffers of all views, of the pixel that shows a point, and the point's depth; none behind the camera
    /// or outside the picture.
    pub fn texel(&self, p: Vec3) -> Option<(usize, f32)> {
        let at = self.project(p);
        let inside = at.z > 0.0 && at.x >= 0.0 && at.y >= 0.0 && at.x < self.width as f32 && at.y < self.height as f32;
        inside.then(|| ((self.first + at.y as u32 * self.width + at.x as u32) as usize, at.z))
    }
}

impl StereoPair {
    /// How pixels of `from` map to `to`, which is view number `view`.
    pub fn new(from: &Camera, to: &Camera, view: u32) -> Self {
        let into = pinhole(&to.intrinsics) * DMat3::from_quat(to.pose.rotation).transpose();
        let out = DMat3::from_quat(from.pose.rotation) * pinhole(&from.intrinsics).inverse();
        let rows = (into * out).transpose();
        let shift = into * (from.pose.position - to.pose.position);
        Self {
            row_x: narrow(rows.x_axis),
            shift_x: shift.x as f32,
            row_y: narrow(rows.y_axis),
            shift_y: shift.y as f32,
            row_z: narrow(rows.z_axis),
            shift_z: shift.z as f32,
            view,
            ..Self::default()
        }
    }
}

/// The views as the device takes them, their pixels one view after the other, each searched in its range of depths; without
/// neighbours.
pub fn device_views(cameras: &[Camera], ranges: &[[f64; 2]]) -> Vec<StereoView> {
    let mut first = 0;
    let view = |(camera, range): (&Camera, &[f64; 2])| {
        let view = StereoView::new(camera, first, *range);
        first += view.width * view.height;
        view
    };
    cameras.iter().zip(ranges).map(view).collect()
}

/// [`MAX_PAIRS`] pairs for each view, of which as many count as it has neighbours.
pub fn device_pairs(cameras: &[Camera], neighbours: &[Vec<usize>]) -> Vec<StereoPair> {
    let row = |(camera, near): (&Camera, &Vec<usize>)| {
        let mut row = [StereoPair::default(); MAX_PAIRS];
        row.iter_mut().zip(near).for_each(|(pair, i)| *pair = StereoPair::new(camera, &cameras[*i], *i as u32));
        row
    };
    cameras.iter().zip(neighbours).flat_map(row).collect()
}

impl Frame {
    /// Photos at the size that stereo works at: their longer side is at most `longest` pixels, what their lenses bend is
    /// straightened, and `to_internal` maps their poses. Decoding takes at most `memory` bytes at once, or a photo's own. A photo
    /// that cannot be decoded is passed to `unreadable`, which skips it or fails.
    ///
    /// # Errors
    /// Where a photo cannot be decoded and `unreadable` fails; see [`Decoder`].
    pub fn read(
        photos: &[Photo],
        longest: u32,
        memory: u64,
        to_internal: &Similarity,
        mut unreadable: impl FnMut(Error) -> Result<()>,
    ) -> Result<Vec<Self>> {
        // Integer factors while decoding; the remaining factor is applied to each photo.
        let shrink = photos.iter().map(|photo| longer(&photo.camera.intrinsics) / longest).min().unwrap_or(1).max(1);
        let settings = DecodeSettings { shrink, memory, ..DecodeSettings::default() };
        let decoder = Decoder::new(photos, settings)?;
        photos
            .iter()
            .zip(decoder)
            .filter_map(|(photo, decoded)| match decoded {
                Ok(decoded) => Some(Ok(Self::new(photo, &decoded, shrink, longest, to_internal))),
                Err(error) => unreadable(error).err().map(Err),
            })
            .collect()
    }

    /// A photo that was decoded with its pixels `shrink` times as wide.
    fn new(photo: &Photo, decoded: &Decoded, shrink: u32, longest: u32, to_internal: &Similarity) -> Self {
        let stored = photo.camera.intrinsics.shrunk(shrink);
        let scale = (f64::from(longest) / f64::from(longer(&stored))).min(1.0);
        let [w, h] = [stored.width, stored.height].map(|side| ((f64::from(side) * scale).round() as u32).max(1));
        let sides = DVec2::new(f64::from(w) / f64::from(stored.width), f64::from(h) / f64::from(stored.height));
        let intrinsics = Intrinsics {
            width: w,
            height: h,
            focal: (DVec2::from(stored.focal) * sides).to_array(),
            principal: (DVec2::from(stored.principal) * sides).to_array(),
        };
        let lens = Lens::new(stored, photo.distortion);
        let straight = Lens::new(intrinsics, Distortion::default());
        let camera = Camera { name: photo.camera.name.clone(), pose: to_internal.pose(&photo.camera.pose), intrinsics };
        let mut frame = Self {
            camera,
            colours: Vec::new(),
            brightness: Vec::new(),
            mask: decoded.mask.as_ref().map(|_| Vec::new()),
        };
        // Colours under an alpha of zero are whatever the renderer left there; what a mask hides is a picture like the rest.
        let cut_out = photo.mask.is_none();
        let sample = |at: DVec2| {
            between(decoded.width, decoded.height, at, |index| {
                let cover = decoded.mask.as_ref().map_or(1.0, |mask| f64::from(mask[index]) / 255.0);
                let colour =
                    DVec3::from_array([0, 1, 2].map(|channel| f64::from(decoded.values.linear(3 * index + channel))));
                let shown = if cut_out { BEHIND.lerp(colour, cover) } else { colour };
                shown.extend(cover)
            })
        };
        // As many samples in a pixel as it has stored pixels, or nearly.
        let across = (1.0 / scale).ceil() as u32;
        let offsets = (0..across * across)
            .map(|i| (DVec2::new(f64::from(i % across), f64::from(i / across)) + 0.5) / f64::from(across));
        let offsets: Vec<DVec2> = offsets.collect();
        for (y, x) in (0..h).flat_map(|y| (0..w).map(move |x| (y, x))) {
            let mean = offsets.iter().map(|offset| {
                let pixel = DVec2::new(f64::from(x), f64::from(y)) + offset;
                // Where the lens shows nothing, the picture continues without its distortion.
                sample(straight.unproject(pixel).and_then(|ray| lens.project(ray)).unwrap_or(pixel / sides))
            });
            let mean = mean.sum::<DVec4>() / offsets.len() as f64;
            frame.colours.push(colour::srgb(mean.truncate()));
            let luminance = mean.truncate().dot(colour::LUMA);
            frame.brightness.push(colour::encoded(luminance) as f32);
            if let Some(mask) = &mut frame.mask {
                mask.push(mean.w as f32);
            }
        }
        frame
    }

    /// Whether a mask hides a pixel.
    pub(super) fn hides(&self, pixel: usize) -> bool {
        self.mask.as_ref().is_some_and(|mask| mask[pixel] < 0.5)
    }

    /// Pixels of all frames together.
    pub fn len(&self) -> usize {
        self.brightness.len()
    }

    /// Whether it has no pixels.
    pub fn is_empty(&self) -> bool {
        self.brightness.is_empty()
    }
}

/// Linear colour behind pictures with alpha: mid grey.
const BEHIND: DVec3 = DVec3::splat(0.2);

/// The longer side in pixels.
fn longer(intrinsics: &Intrinsics) -> u32 {
    intrinsics.width.max(intrinsics.height)
}

/// Bilinear value between pixel centres, of what pixels with an index hold; clamped at the edge.
fn between(w: u32, h: u32, at: DVec2, value: impl Fn(usize) -> DVec4) -> DVec4 {
    let at = (at - 0.5).clamp(DVec2::ZERO, DVec2::new(f64::from(w - 1), f64::from(h - 1)));
    let (x, y) = (at.x as u32, at.y as u32);
    let (u, v) = (at.x - f64::from(x), at.y - f64::from(y));
    let (right, below) = ((x + 1).min(w - 1), (y + 1).min(h - 1));
    let at = |x: u32, y: u32| value((y * w + x) as usize);
    at(x, y).lerp(at(right, y), u).lerp(at(x, below).lerp(at(right, below), u), v)
}

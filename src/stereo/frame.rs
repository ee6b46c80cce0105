//! Frames: photos at the size that stereo works at, as pinholes, in a normalised world; and what the device holds of them.

use glam::{DMat3, DVec2, DVec3, Vec3};
use image::imageops;

use crate::photos::Photo;
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::lens::Lens;
use crate::scene::similarity::Similarity;
use crate::{Error, Result};

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
        /// Rows.
        pub height: u32,
        /// See `across`.
        pub corner: [f32; 3],
        /// Place of its first pixel in the buffers of all views.
        pub first: u32,
        /// Where the camera stands.
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

impl Frame {
    /// Reads a photo, shrinks it so that its longer side is at most `longest`, and takes the distortion out. Its mask, or
    /// else its alpha, says where the object is. The pose is mapped by `to_internal`.
    ///
    /// # Errors
    /// Where the image or its mask cannot be read, or is of another size than the camera says.
    pub fn read(photo: &Photo, longest: u32, to_internal: &Similarity) -> Result<Self> {
        let Some(path) = &photo.image else {
            return Err(Error::request(format!("{} has no image", photo.camera.name)));
        };
        let open = |path: &std::path::Path| {
            image::open(path)
                .map_err(|e| Error::input(path, format!("the image cannot be read ({e}); export it again")))
        };
        let mut whole = open(path)?.into_rgba8();
        let Intrinsics { width, height, focal, principal } = photo.camera.intrinsics;
        let check = |path: &std::path::Path, (w, h): (u32, u32)| match (w, h) == (width, height) {
            true => Ok(()),
            false => Err(Error::input(
                path,
                format!("the image is {w}x{h} and its camera {width}x{height}; give the images that were posed"),
            )),
        };
        check(path, whole.dimensions())?;
        let mut masked = whole.pixels().any(|pixel| pixel.0[3] < 255);
        if let Some(mask) = &photo.mask {
            let cover = open(mask)?.into_luma8();
            check(mask, cover.dimensions())?;
            whole.pixels_mut().zip(cover.pixels()).for_each(|(pixel, cover)| pixel.0[3] = cover.0[0]);
            masked = true;
        }
        let scale = f64::from(longest.min(width.max(height))) / f64::from(width.max(height));
        let [w, h] = [width, height].map(|side| ((f64::from(side) * scale).round() as u32).max(1));
        // Alpha is no colour: what a mask hides may be the background, which stays in the picture as it is.
        let (colours, cover) = if photo.mask.is_some() || !masked {
            (imageops::thumbnail(&image::DynamicImage::ImageRgba8(whole.clone()).into_rgb8(), w, h), {
                let cover = image::GrayImage::from_fn(width, height, |x, y| image::Luma([whole.get_pixel(x, y).0[3]]));
                imageops::thumbnail(&cover, w, h)
            })
        } else {
            over_grey(&whole, w, h)
        };
        let sides = DVec2::new(f64::from(w) / f64::from(width), f64::from(h) / f64::from(height));
        let intrinsics = Intrinsics {
            width: w,
            height: h,
            focal: (DVec2::from(focal) * sides).to_array(),
            principal: (DVec2::from(principal) * sides).to_array(),
        };
        let lens = Lens::new(intrinsics, photo.distortion);
        let straight = Lens::new(intrinsics, Default::default());
        let mut frame = Self {
            camera: Camera { name: photo.camera.name.clone(), pose: to_internal.pose(&photo.camera.pose), intrinsics },
            colours: Vec::with_capacity((w * h) as usize),
            brightness: Vec::with_capacity((w * h) as usize),
            mask: masked.then(|| Vec::with_capacity((w * h) as usize)),
        };
        for y in 0..h {
            for x in 0..w {
                let centre = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let at = match photo.distortion.is_none() {
                    true => centre,
                    // Where the lens shows nothing the picture's rim goes on.
                    false => straight.unproject(centre).and_then(|d| lens.project(d)).unwrap_or(centre),
                };
                let colour = between(w, h, at, |x, y| DVec3::from_array(colours.get_pixel(x, y).0.map(f64::from)));
                frame.colours.push(colour.round().to_array().map(|c| c as u8));
                // Rec. 601 luma of the encoded colours: what 8-bit pictures are even in.
                frame.brightness.push((colour.dot(DVec3::new(0.299, 0.587, 0.114)) / 255.0) as f32);
                if let Some(mask) = &mut frame.mask {
                    let covered = between(w, h, at, |x, y| DVec3::splat(f64::from(cover.get_pixel(x, y).0[0])));
                    mask.push((covered.x / 255.0) as f32);
                }
            }
        }
        Ok(frame)
    }

    /// Pixels.
    pub fn len(&self) -> usize {
        self.brightness.len()
    }

    /// Whether it has no pixels.
    pub fn is_empty(&self) -> bool {
        self.brightness.is_empty()
    }
}

/// Shrinks a picture with alpha: its colours over mid grey, and its alpha.
fn over_grey(whole: &image::RgbaImage, w: u32, h: u32) -> (image::RgbImage, image::GrayImage) {
    let (width, height) = whole.dimensions();
    let mixed = image::RgbImage::from_fn(width, height, |x, y| {
        let [r, g, b, a] = whole.get_pixel(x, y).0.map(u32::from);
        image::Rgb([r, g, b].map(|c| ((c * a + 128 * (255 - a) + 127) / 255) as u8))
    });
    let alpha = image::GrayImage::from_fn(width, height, |x, y| image::Luma([whole.get_pixel(x, y).0[3]]));
    (imageops::thumbnail(&mixed, w, h), imageops::thumbnail(&alpha, w, h))
}

/// Bilinear value between pixel centres; the rim goes on beyond it.
fn between(w: u32, h: u32, at: DVec2, value: impl Fn(u32, u32) -> DVec3) -> DVec3 {
    let at = (at - 0.5).clamp(DVec2::ZERO, DVec2::new(f64::from(w - 1), f64::from(h - 1)));
    let (x, y) = (at.x as u32, at.y as u32);
    let (u, v) = (at.x - f64::from(x), at.y - f64::from(y));
    let (right, below) = ((x + 1).min(w - 1), (y + 1).min(h - 1));
    let upper = value(x, y).lerp(value(right, y), u);
    upper.lerp(value(x, below).lerp(value(right, below), u), v)
}

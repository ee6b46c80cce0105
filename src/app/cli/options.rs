//! Options that several commands share: lens, photos, device, methods and models.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use glam::DVec3;

use crate::engine::vulkan::{self, Context};
use crate::files::io;
use crate::files::io::photos::Images;
use crate::photogrammetry::vds;
use crate::planner::methods::{Entry, METHODS, Method};
use crate::planner::select::information::Model;
use crate::scene::camera::{Camera, Intrinsics, middle_lens};
use crate::scene::surface::Surface;
use crate::{Error, Result};

/// Parses the names of those methods that `fits`, each with what it does in the help.
pub fn method_parser(fits: fn(&Entry) -> bool) -> impl TypedValueParser<Value = Method> {
    let named = |entry: &Entry| PossibleValue::new(entry.name).help(entry.about).aliases(entry.alias);
    let names = PossibleValuesParser::new(METHODS.iter().filter(|entry| fits(entry)).map(named));
    names.try_map(|name| Method::named(&name).ok_or(format!("no such method: {name}")))
}

/// So many numbers with commas between them.
pub fn numbers<const N: usize>(text: &str, form: &str) -> Result<[f64; N], String> {
    let read: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let numbers = read.and_then(|numbers| <[f64; N]>::try_from(numbers).ok());
    numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite())).ok_or_else(|| format!("give {form}"))
}

/// Field of view in degrees and image size where nothing gives others.
const FOV: f64 = 50.0;
const SIZE: (u32, u32) = (800, 800);

/// What cameras there are.
#[derive(Args, Clone, Debug)]
pub struct CameraOptions {
    /// Horizontal field of view in degrees [default: that of the capture or of the cameras to keep, else 50]
    #[arg(long)]
    pub fov: Option<f64>,
    /// Image size in pixels [default: that of the capture or of the cameras to keep, else 800x800]
    #[arg(long, value_parser = parse_size, value_name = "WxH")]
    pub size: Option<(u32, u32)>,
}

/// How a capture's images are read.
#[derive(Args, Clone, Copy, Debug)]
pub struct ImageOptions {
    /// Continue without images that are missing or cannot be read
    #[arg(long)]
    pub skip_missing: bool,
    /// Read files that a transforms.json names outside its own folder too
    #[arg(long)]
    pub outside_paths: bool,
}

impl ImageOptions {
    /// The library's options.
    pub fn options(self) -> io::photos::ReadOptions {
        let images = if self.skip_missing { Images::SkipMissing } else { Images::Needed };
        io::photos::ReadOptions { images, outside_paths: self.outside_paths, ..io::photos::ReadOptions::default() }
    }
}

/// The device to run on.
#[derive(Args, Clone, Debug)]
pub struct DeviceOptions {
    /// Device, by index or part of its name (see `camsplat devices`) [default: the best]
    #[arg(long)]
    pub device: Option<String>,
    /// Wait after every stage, so that a device-lost error names the stage that failed; no effect while stages are timed
    #[arg(long)]
    pub debug_sync: bool,
}

/// A model of the scene, for the methods that choose by one.
#[derive(Args, Clone, Debug)]
pub struct ModelOptions {
    /// Trained splats of the scene (.ply, .spz, .sog, .splat, .glb) in the frame of the cameras, for methods that need them
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// The model was trained with antialiasing [default: as its file says]
    #[arg(long, requires = "model")]
    pub antialiased: bool,
}

impl ModelOptions {
    /// Reads the model, which `method` must have if `needed` and must not have otherwise; prints what was understood.
    pub fn read(&self, method: &str, needed: bool) -> Result<Option<Model>> {
        let wrong = |what: &str| Err(Error::request(format!("--method {method} {what}")));
        let path = match (&self.model, needed) {
            (Some(path), true) => path,
            (None, true) => return wrong("needs trained splats; give them with --model"),
            (Some(_), false) => return wrong("looks at no model; leave --model out"),
            (None, false) => return Ok(None),
        };
        let (gaussians, notes) = io::read_gaussians_with_notes(path)?;
        for note in notes {
            say!("{note}");
        }
        let path = path.to_string_lossy().into_owned();
        let antialiased = self.antialiased || gaussians.antialiased;
        Ok(Some(Model { path, gaussians, antialiased }))
    }
}

impl DeviceOptions {
    /// Opens several devices, each by index or part of its name; the same one may be opened twice.
    pub fn open_each(&self, names: &[String]) -> Result<Vec<Arc<Context>>> {
        let named = |name: &String| Self { device: Some(name.clone()), ..*self }.open();
        names.iter().map(named).collect()
    }

    /// Opens the device. With the environment variable CAMSPLAT_VALIDATION set, the validation layers watch it.
    pub fn open(&self) -> Result<Arc<Context>> {
        self.open_to_capture(false)
    }

    /// The same; RenderDoc takes captures of it if `capture` is set.
    pub fn open_to_capture(&self, capture: bool) -> Result<Arc<Context>> {
        let context = Context::new(&vulkan::ContextOptions {
            device: self.device.clone(),
            validation: std::env::var_os("CAMSPLAT_VALIDATION").is_some(),
            debug_sync: self.debug_sync,
            capture,
            ..vulkan::ContextOptions::default()
        })?;
        for note in context.notes() {
            say!("{note}");
        }
        Ok(context)
    }
}

impl CameraOptions {
    /// The intrinsics. What is not given is that of the middle one of `photos` by field of view, and the usual one where there are none;
    /// prints what is taken from photos.
    pub fn intrinsics(&self, photos: &[Camera]) -> Result<Intrinsics> {
        if let Some(fov) = self.fov.filter(|fov| !(*fov > 1.0 && *fov < 170.0)) {
            return Err(Error::request(format!("--fov is {fov}; give more than 1 and less than 170 degrees")));
        }
        let photo = middle_lens(photos);
        let intrinsics = match (self.fov, self.size, photo) {
            (None, None, Some(photo)) => photo,
            _ => {
                let (width, height) = self.size.or(photo.map(|photo| (photo.width, photo.height))).unwrap_or(SIZE);
                let fov = self.fov.map(f64::to_radians).or(photo.map(|photo| photo.fov()[0]));
                Intrinsics::from_fov(width, height, fov.unwrap_or(FOV.to_radians()))
            }
        };
        if photo.is_some() && (self.fov.is_none() || self.size.is_none()) {
            let Intrinsics { width, height, .. } = intrinsics;
            say!(
                "lens     {:.1} degrees across, {width} x {height} pixels; as that of the photos where --fov and --size give no other",
                intrinsics.fov()[0].to_degrees()
            );
        }
        Ok(intrinsics)
    }
}

/// Reads cameras, and prints what was understood of them or left out.
///
/// # Errors
/// As [`io::read_cameras`].
pub fn read_cameras(path: &Path) -> Result<Vec<Camera>> {
    let (cameras, notes) = io::read_cameras_with_notes(path)?;
    notes.iter().for_each(|note| say!("{note}"));
    Ok(cameras)
}

/// Reads a surface, prints what was understood of it, and scores the points of trained splats.
///
/// # Errors
/// As [`io::read_surface`].
pub fn read_surface(path: &Path) -> Result<Surface> {
    let (mut surface, notes) = io::read_surface_with_notes(path)?;
    for note in notes {
        say!("{note}");
    }
    if let Surface::Points(points) = &mut surface
        && vds::score_by_variances(points)
    {
        say!("scores of view dependency are made from the splats' harmonics");
    }
    Ok(surface)
}

/// Prints what the validation layers said; nothing where they are off.
pub fn print_messages(context: &Context) {
    for message in context.messages() {
        complain!("validation: {message}");
    }
}

/// Reads an image size, such as 800x600.
pub fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let parsed = text.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    match parsed {
        Some((w, h)) if (1..=65_535).contains(&w) && (1..=65_535).contains(&h) => Ok((w, h)),
        _ => Err("give width and height in pixels, such as 1920x1080".into()),
    }
}

/// Reads an axis that is up, such as -y.
pub fn parse_up(text: &str) -> Result<DVec3, String> {
    let (sign, axis) = match text.strip_prefix('-') {
        Some(axis) => (-1.0, axis),
        None => (1.0, text.strip_prefix('+').unwrap_or(text)),
    };
    let axis = match axis {
        "x" => DVec3::X,
        "y" => DVec3::Y,
        "z" => DVec3::Z,
        _ => return Err("give one of x, y, z, -x, -y, -z".into()),
    };
    Ok(sign * axis)
}

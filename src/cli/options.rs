//! Options that several commands share: region, camera, device.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use glam::DVec3;

use super::place;
use crate::io;
use crate::io::areas::is_areas;
use crate::io::photos::Images;
use crate::io::volume::read_volume;
use crate::methods::{Entry, METHODS, Method};
use crate::plan::config::Preset;
use crate::plan::record::SurfaceRecord;
use crate::plan::target::{RegionChoice, Target};
use crate::scene::camera::{Camera, Intrinsics, Pose, common_up};
use crate::scene::limits::{Limits, Volume, Walk, Wall};
use crate::scene::region::{Region, Shape};
use crate::scene::support;
use crate::scene::surface::Surface;
use crate::select::information::Model;
use crate::vds;
use crate::vulkan::{self, Context};
use crate::{Error, Result};

/// Parses the names of those methods that `fits`, each with what it does in the help.
pub fn method_parser(fits: fn(&Entry) -> bool) -> impl TypedValueParser<Value = Method> {
    let named = |entry: &Entry| PossibleValue::new(entry.name).help(entry.about).aliases(entry.alias);
    let names = PossibleValuesParser::new(METHODS.iter().filter(|entry| fits(entry)).map(named));
    names.try_map(|name| Method::named(&name).ok_or(format!("no such method: {name}")))
}

/// Where cameras may stand, and what kind of scene it is.
#[derive(Args, Clone, Debug)]
pub struct RegionOptions {
    /// Kind of scene: an object seen from around it, or a room seen from inside [default: room with --box, else object]
    #[arg(long, value_enum)]
    pub preset: Option<Preset>,
    /// Region of the cameras between two spheres: centre and radii CX,CY,CZ,RMIN,RMAX
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true, value_name = "NUMBERS", conflicts_with = "box_")]
    pub shell: Option<Vec<f64>>,
    /// Region of the cameras in a box: corners X0,Y0,Z0,X1,Y1,Z1
    #[arg(long = "box", value_delimiter = ',', allow_hyphen_values = true, value_name = "NUMBERS")]
    pub box_: Option<Vec<f64>>,
    /// Cameras stay at or above this height along --up; `auto` finds what an object stands on below all photos of a capture, `none` is
    /// no floor
    #[arg(long, allow_hyphen_values = true, default_value = "auto", value_name = "HEIGHT", value_parser = parse_floor)]
    pub floor: FloorOption,
    /// Up direction: x, -x, +y, ... [default: the photos' own for captures, +y for glTF and OBJ, else +z]
    #[arg(long, allow_hyphen_values = true, value_parser = parse_up)]
    pub up: Option<DVec3>,
    /// Minimum distance between cameras and the surface [default: a twentieth of the object's radius or of the room's
    /// smallest side]
    #[arg(long)]
    pub clearance: Option<f64>,
    #[command(flatten)]
    pub limits: LimitOptions,
    /// Where the scene lies on Earth, for polygons of --keep-out: LAT,LON,ALT[,HEADING] of its origin, utm:ZONE[,EAST,NORTH[,ALT]], ecef, or
    /// a capture with GPS, as for `export`
    #[arg(long, value_name = "PLACE", allow_hyphen_values = true)]
    pub geo: Option<String>,
}

/// The height of the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FloorOption {
    /// As photos and surface show it, where there are photos.
    Auto,
    /// None.
    None,
    /// At this height along up.
    At(f64),
}

/// What limits where cameras stand beside the region.
#[derive(Args, Clone, Debug)]
pub struct LimitOptions {
    /// Keep cameras and viewers out of a volume, which itself blocks no view: a closed mesh (.obj, .glb, .gltf, .ply), boxes, .json with
    /// {"boxes": [[X0,Y0,Z0,X1,Y1,Z1], ...]}, or, at all heights, polygons of GeoJSON or KML (needs --geo); repeatable
    #[arg(long, value_name = "FILE")]
    pub keep_out: Vec<PathBuf>,
    /// Keep cameras and viewers on one side of a plane, given by a point and the direction to the free side; repeatable
    #[arg(long, value_name = "X,Y,Z,NX,NY,NZ", allow_hyphen_values = true, value_parser = parse_wall)]
    pub wall: Vec<Wall>,
    /// Restrict cameras to heights that a tripod or drone reaches: coordinates along --up, not distances from the floor
    #[arg(long, value_name = "LOW,HIGH", allow_hyphen_values = true, value_parser = parse_heights)]
    pub heights: Option<[f64; 2]>,
    /// Restrict cameras to level ground that a person or robot of this radius and height can walk to from a start: coordinates of the
    /// feet on open floor, in the frame of the surface
    #[arg(long, value_name = "X,Y,Z,RADIUS,HEIGHT", allow_hyphen_values = true, value_parser = parse_walk)]
    pub walk: Option<Walk>,
}

impl LimitOptions {
    /// The limits; of each kind that is not given, those of an earlier plan. `area` is the volume of a file of areas on Earth.
    ///
    /// # Errors
    /// Where a file holds no volume, or numbers make no sense.
    pub fn read(&self, stored: Limits, area: impl Fn(&Path) -> Result<Volume>) -> Result<Limits> {
        let given_limits = Limits {
            walls: self.wall.clone(),
            keep_out: self
                .keep_out
                .iter()
                .map(|file| Volume { file: file.to_string_lossy().into(), ..Volume::default() })
                .collect(),
            heights: self.heights,
            walk: self.walk,
        };
        let either = |given: bool| if given { &given_limits } else { &stored };
        let mut limits = Limits {
            walls: either(!given_limits.walls.is_empty()).walls.clone(),
            keep_out: either(!given_limits.keep_out.is_empty()).keep_out.clone(),
            heights: given_limits.heights.or(stored.heights),
            walk: given_limits.walk.or(stored.walk),
        };
        for volume in limits.keep_out.iter_mut().filter(|volume| volume.triangles.is_empty()) {
            let file = Path::new(&volume.file);
            *volume = if is_areas(file) { area(file)? } else { read_volume(file)? };
        }
        limits.validated()
    }
}

/// So many numbers with commas between them.
pub fn numbers<const N: usize>(text: &str, form: &str) -> Result<[f64; N], String> {
    let read: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let numbers = read.and_then(|numbers| <[f64; N]>::try_from(numbers).ok());
    numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite())).ok_or_else(|| format!("give {form}"))
}

fn parse_floor(text: &str) -> Result<FloorOption, String> {
    match text {
        "auto" => Ok(FloorOption::Auto),
        "none" => Ok(FloorOption::None),
        height => numbers::<1>(height, "a height, auto or none").map(|[height]| FloorOption::At(height)),
    }
}

fn parse_wall(text: &str) -> Result<Wall, String> {
    let [x, y, z, nx, ny, nz] = numbers(text, "six numbers: X,Y,Z,NX,NY,NZ")?;
    Ok(Wall { point: DVec3::new(x, y, z), normal: DVec3::new(nx, ny, nz) })
}

fn parse_heights(text: &str) -> Result<[f64; 2], String> {
    numbers(text, "two numbers: LOW,HIGH")
}

fn parse_walk(text: &str) -> Result<Walk, String> {
    let [x, y, z, radius, height] = numbers(text, "five numbers: X,Y,Z,RADIUS,HEIGHT")?;
    Ok(Walk { start: DVec3::new(x, y, z), radius, height })
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
    pub fn options(self) -> io::photos::Options {
        let images = if self.skip_missing { Images::SkipMissing } else { Images::Needed };
        io::photos::Options { images, outside_paths: self.outside_paths, ..io::photos::Options::default() }
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
    /// Trained splats of the scene (.ply) in the frame of the cameras, for methods that need them
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// The model was trained with antialiasing
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
        Ok(Some(Model { path, gaussians, antialiased: self.antialiased }))
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
        Context::new(&vulkan::Options {
            device: self.device.clone(),
            validation: std::env::var_os("CAMSPLAT_VALIDATION").is_some(),
            debug_sync: self.debug_sync,
        })
    }
}

impl CameraOptions {
    /// The intrinsics. What is not given is that of the middle one of `photos` by field of view, and the usual one where there are none;
    /// prints what is taken from photos.
    pub fn intrinsics(&self, photos: &[Camera]) -> Result<Intrinsics> {
        if let Some(fov) = self.fov.filter(|fov| !(*fov > 1.0 && *fov < 170.0)) {
            return Err(Error::request(format!("--fov is {fov}; give degrees between 1 and 170")));
        }
        let mut lenses: Vec<&Intrinsics> = photos.iter().map(|camera| &camera.intrinsics).collect();
        lenses.sort_by(|a, b| a.fov()[0].total_cmp(&b.fov()[0]));
        let photo = lenses.get(lenses.len() / 2);
        let intrinsics = match (self.fov, self.size, photo) {
            (None, None, Some(photo)) => **photo,
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

impl RegionOptions {
    /// The preset that was asked for, or follows from the region.
    pub fn preset(&self) -> Preset {
        self.preset.unwrap_or(if self.box_.is_some() { Preset::Room } else { Preset::Object })
    }

    /// Reads a surface and settles its region; prints what was understood. What the options leave out is taken from
    /// `stored`, the region and the limits of an earlier plan, where there is one.
    pub fn target(&self, path: &Path, intrinsics: &Intrinsics, stored: Option<(Region, Limits)>) -> Result<Target> {
        self.choice()?;
        let surface = read_surface(path)?;
        // A reconstruction knows where cameras could stand: where they did.
        let photographed =
            if io::may_be_capture(path) { io::read_cameras(path).unwrap_or_default() } else { Vec::new() };
        let poses: Vec<Pose> = photographed.iter().map(|camera| camera.pose).collect();
        self.target_of(&surface, path, &poses, intrinsics, stored)
    }

    /// As [`RegionOptions::target`], of a surface that has been read from `path`, around cameras that stand in
    /// `photographed`.
    pub fn target_of(
        &self,
        surface: &Surface,
        path: &Path,
        photographed: &[Pose],
        intrinsics: &Intrinsics,
        stored: Option<(Region, Limits)>,
    ) -> Result<Target> {
        let mut choice = self.choice()?;
        let mut preset = self.preset();
        let (stored, limits) = stored.map_or((None, Limits::default()), |(region, limits)| (Some(region), limits));
        if let (None, Some(region)) = (choice.shape, stored) {
            choice.shape = Some(region.shape);
            choice.floor = if self.floor == FloorOption::None { None } else { choice.floor.or(region.floor) };
            choice.clearance = choice.clearance.or(Some(region.clearance));
            if self.preset.is_none() && matches!(region.shape, Shape::Box { .. }) {
                preset = Preset::Room;
            }
        }
        let up = self.up.or(stored.map(|region| region.up)).unwrap_or_else(|| default_up(path, photographed));
        if preset == Preset::Object {
            choice.shape = choice.shape.or_else(|| Shape::around_cameras(photographed));
            if self.floor == FloorOption::Auto && stored.is_none() {
                choice.floor = support::floor(surface.positions(), photographed, up);
                if let Some(floor) = choice.floor {
                    say!(
                        "floor    at {floor:.3} along up: what the object stands on, below all photos (--floor none leaves it out)"
                    );
                }
            }
            if let (Some((gap, side)), true) =
                (support::empty_side(photographed, up), self.limits.wall.is_empty() && limits.walls.is_empty())
            {
                say!(
                    "note     no photo was taken within {:.0} degrees around {side:.2}; where a wall is there, give it with --wall",
                    gap.to_degrees()
                );
            }
        }
        let target = Target::new(surface, &path.to_string_lossy(), preset, &choice, up, intrinsics)?;
        let limits = self.limits.read(limits, |file| place::areas(file, self.geo.as_deref(), &target.region))?;
        let target = target.within(limits)?;
        print_target(&target);
        Ok(target)
    }

    /// What the options say of the region.
    ///
    /// # Errors
    /// Where they say it with too many or too few numbers, or a place on Earth that nothing needs.
    pub fn choice(&self) -> Result<RegionChoice> {
        if self.geo.is_some() && !self.limits.keep_out.iter().any(|file| is_areas(file)) {
            return Err(Error::request(
                "--geo is for polygons of --keep-out (.geojson or .kml), of which there are none; `export` takes it for missions",
            ));
        }
        let shape = match (&self.shell, &self.box_) {
            (Some(numbers), _) => {
                let &[x, y, z, r_min, r_max] = &numbers[..] else {
                    return Err(count("--shell", "CX,CY,CZ,RMIN,RMAX", 5, numbers.len()));
                };
                Some(Shape::Shell { centre: DVec3::new(x, y, z), r_min, r_max })
            }
            (None, Some(numbers)) => Some(box_of(numbers)?),
            (None, None) => None,
        };
        let floor = match self.floor {
            FloorOption::At(height) => Some(height),
            FloorOption::Auto | FloorOption::None => None,
        };
        Ok(RegionChoice { shape, floor, clearance: self.clearance })
    }
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

/// The box of its two corners.
///
/// # Errors
/// Where there are too many or too few numbers.
pub fn box_of(numbers: &[f64]) -> Result<Shape> {
    let &[x0, y0, z0, x1, y1, z1] = numbers else {
        return Err(count("--box", "X0,Y0,Z0,X1,Y1,Z1", 6, numbers.len()));
    };
    Ok(Shape::Box { min: DVec3::new(x0, y0, z0), max: DVec3::new(x1, y1, z1) })
}

fn count(option: &str, form: &str, wanted: usize, given: usize) -> Error {
    Error::request(format!("{option} takes {wanted} numbers {form}, not {given}"))
}

/// Prints a surface and its region.
pub fn print_target(target: &Target) {
    let SurfaceRecord { path, kind, primitives, min, max } = &target.record;
    say!("surface  {path}: {primitives} {kind}, from {min:.3} to {max:.3}");
    if target.proxy.dropped + target.proxy.thinned > 0 {
        say!("         {} dropped, {} thinned out", target.proxy.dropped, target.proxy.thinned);
    }
    if target.proxy.stray > 0 {
        say!("         {} far away from all others, left aside", target.proxy.stray);
    }
    let assumed = target.proxy.assumed;
    if assumed > 0 {
        say!("         {assumed} of them stand for walls that nothing shows, where the room ends");
    }
    let buried = target.proxy.buried.iter().filter(|buried| **buried).count() - assumed;
    if buried > 0 {
        say!("         {buried} buried under others: they block rays and are not planned for");
    }
    let region = &target.region;
    let shape = match region.shape {
        Shape::Shell { centre, r_min, r_max } => format!("shell around {centre:.3}, radii {r_min:.3} to {r_max:.3}"),
        Shape::Box { min, max } => format!("box from {min:.3} to {max:.3}"),
    };
    let floor = region.floor.map(|floor| format!(", floor at {floor:.3}")).unwrap_or_default();
    say!("region   {shape}{floor}, clearance {:.4}, up {:.3}", region.clearance, region.up);
    for limit in target.limits.lines() {
        say!("         {limit}");
    }
}

/// Up where the user names none: a capture's from its cameras, glTF's by its standard, OBJ's by custom.
fn default_up(path: &Path, photographed: &[Pose]) -> DVec3 {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let usual = if matches!(extension.as_str(), "glb" | "gltf" | "obj") { DVec3::Y } else { DVec3::Z };
    common_up(photographed).unwrap_or(usual)
}

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

/// Reads an image size, such as 800x600.
pub fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let parsed = text.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    match parsed {
        Some((w, h)) if (1..=65_535).contains(&w) && (1..=65_535).contains(&h) => Ok((w, h)),
        _ => Err("give width and height in pixels, such as 1920x1080".into()),
    }
}

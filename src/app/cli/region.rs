//! Options of where cameras may stand: region, floor, walls, volumes, heights, ground, known space.

use std::path::{Path, PathBuf};

use clap::Args;
use glam::DVec3;

use super::options::{numbers, parse_up, read_surface};
use super::outcome::print_target;
use super::place;
use super::subject::{SubjectOption, parse_subject, subject_of};
use crate::files::io;
use crate::files::io::areas::is_areas;
use crate::files::io::volume::{read_space, read_volume};
use crate::files::photos::PhotoSet;
use crate::planner::plan::config::Preset;
use crate::planner::plan::target::{RegionChoice, Target};
use crate::scene::camera::{Intrinsics, Pose};
use crate::scene::known::KnownSpace;
use crate::scene::limits::{Limits, Walk, Wall};
use crate::scene::planes::Planes;
use crate::scene::region::{Region, Shape};
use crate::scene::surface::Surface;
use crate::scene::upright::upright;
use crate::scene::volume::Volume;
use crate::{Error, Result};

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
    /// Up direction: x, -x, +y, ... [default: the photos' own for captures, +y for glTF, as the ground of an OBJ shows it, else +z]
    #[arg(long, allow_hyphen_values = true, value_parser = parse_up)]
    pub up: Option<DVec3>,
    /// Minimum distance between cameras and the surface [default: a twentieth of the object's radius or of the room's
    /// smallest side]
    #[arg(long)]
    pub clearance: Option<f64>,
    #[command(flatten)]
    pub limits: LimitOptions,
    /// Where cameras and viewers can be: `known`, where the photos of a capture prove it, connected with where they were taken; `open`,
    /// wherever nothing is known to be; the inside of a closed mesh or of boxes (as for --keep-out), or the space of a plan.json
    /// [default: known for captures, else open; of `next` and `watch` open around an object, and known as far as photos see in a room]
    #[arg(long, value_name = "SPACE", value_parser = parse_space)]
    pub space: Option<SpaceOption>,
    /// How far from the nearest photo known space reaches, half of it up or down [default: two of a photographer's steps, as the spacing
    /// of the photos shows them]
    #[arg(long, value_name = "LENGTH")]
    pub reach: Option<f64>,
    /// Where the scene lies on Earth, for polygons of --keep-out: LAT,LON,ALT[,HEADING] of its origin, utm:ZONE[,EAST,NORTH[,ALT]], ecef, or
    /// a capture with GPS, as for `export`
    #[arg(long, value_name = "PLACE", allow_hyphen_values = true)]
    pub geo: Option<String>,
    /// What of the surface is to be seen, where it holds more: a box X0,Y0,Z0,X1,Y1,Z1, a closed mesh or boxes as for --keep-out, a mesh
    /// that is a part of the surface, or `largest`, the largest thing that stands on the ground; the rest blocks views, and its ground is
    /// the floor [default: all of the surface]
    #[arg(long, value_name = "SUBJECT", value_parser = parse_subject, allow_hyphen_values = true)]
    pub subject: Option<SubjectOption>,
    /// Metres that cameras and the tour keep from polygons of --keep-out: GPS drifts [default: 3]
    #[arg(long, value_name = "METRES", allow_hyphen_values = true)]
    pub margin: Option<f64>,
}

/// Metres by which GPS drifts.
const DRIFT: f64 = 3.0;

/// Photos below which what they look at does not yet say that they are of a room.
const FEW: usize = 10;

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
    /// Keep cameras and viewers on one side of a plane, given by a point and the direction to the free side; repeatable; `none` leaves out
    /// the walls that points and photos of a capture show
    #[arg(long, value_name = "X,Y,Z,NX,NY,NZ", allow_hyphen_values = true, value_parser = parse_wall)]
    pub wall: Vec<WallOption>,
    /// Restrict cameras to heights that a tripod or drone reaches: coordinates along --up, not distances from the floor
    #[arg(long, value_name = "LOW,HIGH", allow_hyphen_values = true, value_parser = parse_heights)]
    pub heights: Option<[f64; 2]>,
    /// Restrict cameras to level ground that a person or robot of this radius and height can walk to from a start: coordinates of the
    /// feet on open floor, in the frame of the surface
    #[arg(long, value_name = "X,Y,Z,RADIUS,HEIGHT", allow_hyphen_values = true, value_parser = parse_walk)]
    pub walk: Option<Walk>,
}

/// A wall, or none of those that are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WallOption {
    /// None.
    None,
    /// This one.
    At(Wall),
}

/// Where cameras and viewers can be.
#[derive(Clone, Debug, PartialEq)]
pub enum SpaceOption {
    /// Where photos prove it.
    Known,
    /// Wherever nothing is.
    Open,
    /// As a file has it.
    File(PathBuf),
}

/// What an earlier plan was made for.
pub struct Stored {
    /// Its region.
    pub region: Region,
    /// Its limits.
    pub limits: Limits,
    /// What was to be seen.
    pub subject: Option<Volume>,
    /// Whether surroundings were assumed that no point shows, if it says so.
    pub surrounded: Option<bool>,
}

impl LimitOptions {
    /// The limits; of each kind that is not given, those of an earlier plan or those that a capture shows. `area` is the volume of a file
    /// of areas on Earth.
    ///
    /// # Errors
    /// Where a file holds no volume, or numbers make no sense.
    pub fn read(&self, stored: Limits, area: impl Fn(&Path) -> Result<Volume>) -> Result<Limits> {
        let walls: Vec<Wall> = self
            .wall
            .iter()
            .filter_map(|wall| match wall {
                WallOption::None => None,
                WallOption::At(wall) => Some(*wall),
            })
            .collect();
        if !walls.is_empty() && walls.len() < self.wall.len() {
            return Err(Error::request(
                "--wall none: it goes with no other --wall; a wall that is given leaves out those that are found",
            ));
        }
        let given_limits = Limits {
            walls,
            keep_out: self
                .keep_out
                .iter()
                .map(|file| Volume { file: file.to_string_lossy().into(), ..Volume::default() })
                .collect(),
            heights: self.heights,
            walk: self.walk,
            space: None,
        };
        let either = |given: bool| if given { &given_limits } else { &stored };
        let mut limits = Limits {
            walls: either(!self.wall.is_empty()).walls.clone(),
            keep_out: either(!given_limits.keep_out.is_empty()).keep_out.clone(),
            heights: given_limits.heights.or(stored.heights),
            walk: given_limits.walk.or(stored.walk),
            space: stored.space,
        };
        for volume in limits.keep_out.iter_mut().filter(|volume| volume.triangles.is_empty()) {
            let file = Path::new(&volume.file);
            *volume = if is_areas(file) { area(file)? } else { read_volume(file)? };
        }
        limits.validated()
    }
}

fn parse_floor(text: &str) -> Result<FloorOption, String> {
    match text {
        "auto" => Ok(FloorOption::Auto),
        "none" => Ok(FloorOption::None),
        height => numbers::<1>(height, "a height, auto or none").map(|[height]| FloorOption::At(height)),
    }
}

fn parse_wall(text: &str) -> Result<WallOption, String> {
    if text == "none" {
        return Ok(WallOption::None);
    }
    let [x, y, z, nx, ny, nz] = numbers(text, "six numbers, X,Y,Z,NX,NY,NZ, or none")?;
    Ok(WallOption::At(Wall { point: DVec3::new(x, y, z), normal: DVec3::new(nx, ny, nz) }))
}

fn parse_space(text: &str) -> Result<SpaceOption, String> {
    Ok(match text {
        "known" => SpaceOption::Known,
        "open" => SpaceOption::Open,
        file => SpaceOption::File(file.into()),
    })
}

fn parse_heights(text: &str) -> Result<[f64; 2], String> {
    numbers(text, "two numbers: LOW,HIGH")
}

fn parse_walk(text: &str) -> Result<Walk, String> {
    let [x, y, z, radius, height] = numbers(text, "five numbers: X,Y,Z,RADIUS,HEIGHT")?;
    Ok(Walk { start: DVec3::new(x, y, z), radius, height })
}

impl RegionOptions {
    /// The preset that was asked for, or follows from the region.
    pub fn preset(&self) -> Preset {
        self.preset.unwrap_or(if self.box_.is_some() { Preset::Room } else { Preset::Object })
    }

    /// For advice on where to go: unless the options say otherwise, space is all that photos prove free where they are of a room, however
    /// far from them, and open around an object, whose other sides photos of one prove nothing of. Within the usual two steps of
    /// photos advice would lead around nothing.
    pub fn explored(mut self, photos: &PhotoSet) -> Self {
        // A few photos of one side look at no one thing yet.
        let poses: Vec<Pose> = photos.photos.iter().map(|photo| photo.camera.pose).collect();
        let around = self.shell.is_some() || Shape::around_cameras(&poses).is_some();
        if self.preset.is_none() && self.box_.is_none() && !around && poses.len() < FEW {
            say!(
                "region   as of an object, since fewer than {FEW} photos do not show what they look at (--preset room for a room)"
            );
            self.preset = Some(Preset::Object);
        }
        if self.space.is_some() || self.reach.is_some() {
            return self;
        }
        let of_object = self.preset == Some(Preset::Object) || self.preset() == Preset::Object && around;
        match photos.depth().filter(|_| !of_object) {
            Some(depth) => self.reach = Some(depth),
            None => self.space = Some(SpaceOption::Open),
        }
        self
    }

    /// The kind of scene that was asked for, or that the region is of.
    pub fn preset_of(&self, target: &Target) -> Preset {
        self.preset.unwrap_or_else(|| target.preset())
    }

    /// Reads a surface and settles its region; prints what was understood. What the options leave out is taken from
    /// an earlier plan, where there is one.
    pub fn target(&self, path: &Path, intrinsics: &Intrinsics, stored: Option<Stored>) -> Result<Target> {
        self.choice()?;
        let surface = read_surface(path)?;
        // A reconstruction knows where cameras could stand: where they did.
        let capture = if io::may_be_capture(path) {
            io::photos::read(path, &io::photos::ReadOptions::default()).ok()
        } else {
            None
        };
        self.target_of(&surface, path, capture.as_ref(), intrinsics, stored)
    }

    /// As [`RegionOptions::target`], of a surface that has been read from `path`, photographed by a capture.
    pub fn target_of(
        &self,
        surface: &Surface,
        path: &Path,
        capture: Option<&PhotoSet>,
        intrinsics: &Intrinsics,
        stored: Option<Stored>,
    ) -> Result<Target> {
        let mut choice = self.choice()?;
        let mut preset = self.preset();
        let photographed: Vec<Pose> =
            capture.iter().flat_map(|set| &set.photos).map(|photo| photo.camera.pose).collect();
        let surrounded = stored.as_ref().and_then(|stored| stored.surrounded);
        let mut subject = stored.as_ref().and_then(|stored| stored.subject.clone());
        let (stored, mut limits) =
            stored.map_or((None, Limits::default()), |stored| (Some(stored.region), stored.limits));
        if let (None, Some(region)) = (choice.shape, stored) {
            choice.shape = Some(region.shape);
            choice.floor = if self.floor == FloorOption::None { None } else { choice.floor.or(region.floor) };
            choice.clearance = choice.clearance.or(Some(region.clearance));
            if self.preset.is_none() && matches!(region.shape, Shape::Box { .. }) {
                preset = Preset::Room;
            }
        }
        // A surface may be of the object alone, of whose surroundings the capture's points know more.
        let planes = match capture {
            Some(set) if path != set.path => {
                Planes::of(&[surface.positions(), &set.points.positions].concat(), &photographed)
            }
            _ => Planes::of(surface.positions(), &photographed),
        };
        let up = self.up.or(stored.map(|region| region.up)).or(planes.up);
        let up = up.map_or_else(|| usual_up(path, surface), Ok)?;
        limits.space = self.space(surface, path, capture, up, stored.is_some(), limits.space.take())?;
        if preset == Preset::Object && choice.shape.is_none() {
            choice.shape = Shape::around_cameras(&photographed);
            if !photographed.is_empty()
                && let (None, None, Some(space)) = (choice.shape, self.preset, &limits.space)
            {
                say!(
                    "region   around the photos, which look at no one thing: planned as a room (--preset object plans around the surface)"
                );
                let (min, max) = space.bounds();
                (preset, choice.shape) = (Preset::Room, Some(Shape::Box { min, max }));
            }
        }
        if let Some(asked) = &self.subject {
            let (volume, base) = subject_of(asked, surface, up)?;
            match (preset, self.floor, choice.floor, base) {
                (Preset::Object, FloorOption::Auto, None, Some(at)) => {
                    let digits = surface.digits();
                    say!(
                        "floor    at {at:.digits$} along {up:.3}: what the subject stands on (--floor none leaves it out)"
                    );
                    choice.floor = Some(at);
                }
                (Preset::Object, FloorOption::Auto, None, None) if planes.floor.is_none() => {
                    say!("floor    none: the surface shows no ground that the subject stands on (--floor gives one)");
                }
                _ => {}
            }
            subject = Some(volume);
        }
        if stored.is_none() {
            self.take_planes(&planes, surface, up, preset, &mut choice, &mut limits);
        }
        let name = path.to_string_lossy();
        // What photos prove free begins where they were taken.
        choice.stood = capture.filter(|_| limits.space.is_some()).and_then(PhotoSet::stood);
        let target = Target::of_subject(surface, &name, preset, &choice, up, intrinsics, subject.as_ref())?;
        let limits = self.limits.read(limits, |file| {
            place::areas(file, self.geo.as_deref(), self.margin.unwrap_or(DRIFT), &target.region)
        })?;
        let mut target = target.within(limits)?;
        if target.limits.space.as_ref().is_some_and(|space| space.reach().is_some()) {
            match capture.filter(|set| 2 * set.cut_out() > set.photos.len()) {
                Some(_) => say!("         surroundings are left out, as photos are cut out by masks or alpha"),
                None if surrounded == Some(false) => {}
                None => target = target.with_surroundings()?,
            }
        }
        print_target(&target);
        Ok(target)
    }

    /// The space of cameras and viewers, if it is limited: as the options say; else that of an earlier plan, where there is one, or what
    /// the photos of a capture prove free.
    fn space(
        &self,
        surface: &Surface,
        path: &Path,
        capture: Option<&PhotoSet>,
        up: DVec3,
        replanned: bool,
        stored: Option<KnownSpace>,
    ) -> Result<Option<KnownSpace>> {
        if self.reach.is_some() && matches!(self.space, Some(SpaceOption::Open | SpaceOption::File(_))) {
            return Err(Error::request("--reach is how far known space reaches; leave it or --space out"));
        }
        let asked = self.space == Some(SpaceOption::Known) || self.reach.is_some();
        let capture = capture.filter(|set| set.photos.len() > 1);
        match (&self.space, capture) {
            (Some(SpaceOption::Open), _) => Ok(None),
            (Some(SpaceOption::File(file)), _) => read_space(file).map(Some),
            (_, None) if asked => Err(Error::request(
                "--space known and --reach need a capture, whose photos prove where cameras can be; leave them out",
            )),
            (_, Some(set)) if asked || (!replanned && (set.has_surface_points() || path != set.path)) => {
                let beside = if path == set.path { &[] } else { surface.positions() };
                set.known_space(beside, self.reach, up).map(Some)
            }
            _ => Ok(stored),
        }
    }

    /// Takes the floor and the walls of a capture where the user gives no others, and says so.
    fn take_planes(
        &self,
        planes: &Planes,
        surface: &Surface,
        up: DVec3,
        preset: Preset,
        choice: &mut RegionChoice,
        limits: &mut Limits,
    ) {
        let digits = surface.digits();
        // A user's own up makes another floor, or none, of what is level with the photos'.
        let floor = planes.floor.filter(|floor| self.floor == FloorOption::Auto && floor.normal.dot(up) > 0.99);
        if let Some(floor) = floor {
            let height = floor.point.dot(up);
            say!(
                "floor    at {height:.digits$} along {up:.3}: the points and all photos are above (--floor none leaves it out)"
            );
            match preset {
                Preset::Object => choice.floor = Some(height),
                // A box may be aslant to it.
                Preset::Room => limits.walls.push(floor),
            }
        }
        if self.limits.wall.is_empty() {
            for wall in &planes.walls {
                say!(
                    "wall     at {:.digits$}, facing {:.3}: the points and all photos are before it (--wall none leaves it out)",
                    wall.point,
                    wall.normal
                );
            }
            limits.walls.extend(&planes.walls);
        }
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
        if self.margin.is_some_and(|margin| !(0.0..1e5).contains(&margin)) {
            return Err(Error::request("--margin takes metres from 0"));
        }
        if self.margin.is_some() && self.geo.is_none() {
            return Err(Error::request("--margin is of polygons of --keep-out, which need --geo; leave it out"));
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
        Ok(RegionChoice { shape, floor, clearance: self.clearance, stood: None })
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

/// Up where neither the user nor photos name it: +y in glTF, by its standard; in OBJ, which both kinds of programs write, as its ground
/// shows it.
///
/// # Errors
/// Where nothing shows it.
fn usual_up(path: &Path, surface: &Surface) -> Result<DVec3> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    match (extension.as_str(), surface) {
        ("glb" | "gltf", _) => Ok(DVec3::Y),
        // A mesh without any area is refused for that.
        ("obj", Surface::Mesh(mesh)) if mesh.area() > 0.0 => match upright(mesh) {
            Some(up) => {
                let sign = if up.element_sum() > 0.0 { "+" } else { "-" };
                let axis = if up.y == 0.0 { "z" } else { "y" };
                say!("up       {sign}{axis}, by the ground of {} (--up says another)", path.display());
                Ok(up)
            }
            None => Err(Error::input(
                path,
                "an OBJ does not say which way is up, and this one has no ground that shows it; give --up y or --up z",
            )),
        },
        _ => Ok(DVec3::Z),
    }
}

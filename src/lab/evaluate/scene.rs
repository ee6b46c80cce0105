//! A scene that is photographed: an object from around it, or a room from inside.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;

use super::room::{self, EmptySpace};
use super::settings::EvaluationSettings;
use super::situation::Situation;
use super::views;
use crate::engine::vulkan::Context;
use crate::files::io;
use crate::files::io::gltf::read_model;
use crate::lab::path_tracer::assembly::Assembly;
use crate::planner::plan::config::Preset;
use crate::planner::plan::target::{RegionChoice, Target};
use crate::planner::quality::viewers::Viewers;
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::limits::Limits;
use crate::scene::model::{Environment, Model};
use crate::scene::region::Region;
use crate::scene::samples::studio;
use crate::scene::surface::Surface;
use crate::visibility::device_scene::SceneGeometry;
use crate::{Error, Result};

/// Up in glTF.
pub(crate) const UP: DVec3 = DVec3::Y;
/// Seed of test views where the user specifies the viewers.
const TESTS: u64 = 0x7465_7374;
/// Of the region's radius: by so much a camera on its boundary may stand outside, as decimals are rounded.
const TOLERANCE: f64 = 1e-6;
/// Points of the surface that test views of an object are checked against.
const POINTS: usize = 256;

/// A scene, read and checked.
pub struct Scene {
    /// Where it was read from.
    pub path: PathBuf,
    /// Name in tables and of its folder.
    pub name: String,
    /// As it is photographed.
    pub assembly: Assembly,
    /// Its mesh.
    pub surface: Surface,
    /// Where cameras may be placed: the same for every method, seed and budget.
    pub region: Region,
    /// Its limits.
    pub limits: Limits,
    /// The situation in which it is photographed.
    pub situation: Situation,
    /// Whether the built-in studio lights it.
    pub in_studio: bool,
    /// Where input and test cameras come from.
    pub views: Around,
}

/// Where a scene is photographed from, as far as the user specifies it.
#[derive(Clone, Debug, Default)]
pub struct Setting {
    /// Kind of scene.
    pub preset: Preset,
    /// The region as far as it is specified.
    pub choice: RegionChoice,
    /// The situation in which an object is photographed.
    pub situation: Situation,
    /// Further limits on camera positions.
    pub limits: Limits,
}

/// Where input and test cameras come from.
pub enum Around {
    /// Around an object, of whose surface these are points.
    Object(Vec<DVec3>),
    /// Anywhere in the empty space of a room.
    Room(Box<EmptySpace>),
}

impl Setting {
    /// What methods choose on: puts what the situation has into the model, of which the surface then is the mesh, and takes the
    /// region and the limits. Errors and records call it by its path.
    ///
    /// # Errors
    /// Where no free space is left for cameras.
    pub fn target(
        &self,
        path: &Path,
        model: &mut Model,
        surface: &mut Surface,
        intrinsics: &Intrinsics,
    ) -> Result<Target> {
        let Self { preset, situation, .. } = *self;
        let of = |surface: &Surface, choice: &RegionChoice| {
            Target::new(surface, &path.to_string_lossy(), preset, choice, UP, intrinsics)
        };
        let alone = of(surface, &self.choice)?;
        if preset != Preset::Object || situation == Situation::Free {
            return alone.within(self.limits.clone());
        }
        let mut limits = self.limits.clone();
        let (region, more) = situation.furnish(model, alone.proxy.bounds(), alone.proxy.sphere.1, alone.region);
        limits.walls.extend(more.walls);
        limits.keep_out.extend(more.keep_out);
        *surface = model.surface();
        of(surface, &region.into())?.within(limits)
    }
}

impl Scene {
    /// Reads a glTF scene; the notes report what was left out. What the choice leaves out of the region follows from its bounds.
    ///
    /// # Errors
    /// Where it cannot be read, has no light, or leaves cameras no free space.
    pub fn read(
        path: &Path,
        setting: &Setting,
        environment: Option<&Environment>,
        intrinsics: &Intrinsics,
        notes: &mut Vec<String>,
    ) -> Result<Self> {
        let model = read_model(path, notes)?;
        Self::new(path, setting, (model, environment), io::read_surface(path)?, intrinsics)
    }

    /// Makes one of a model under an environment and its mesh, +Y up; errors and tables call it by its path. An object without lamps under
    /// no environment stands in the built-in studio: what it emits itself, like a display, leaves the rest of it black.
    ///
    /// # Errors
    /// Where a room has no light, or cameras have no free space.
    pub fn new(
        path: &Path,
        setting: &Setting,
        (mut model, environment): (Model, Option<&Environment>),
        mut surface: Surface,
        intrinsics: &Intrinsics,
    ) -> Result<Self> {
        let named = |error| match error {
            Error::Request(what) => Error::input(path, what),
            other => other,
        };
        let Setting { preset, situation, .. } = *setting;
        let target = setting.target(path, &mut model, &mut surface, intrinsics).map_err(named)?;
        let unlit = model.faces.iter().all(|face| model.materials[face.material as usize].unlit);
        let is_lit = environment.is_some() || !model.lamps.is_empty() || unlit;
        let studio = (preset == Preset::Object && !is_lit).then(studio);
        let assembly = Assembly::new(&model, environment.or(studio.as_ref())).map_err(named)?;
        let (region, limits) = (target.region, target.limits.clone());
        let views = match preset {
            Preset::Object => {
                // A scene without feasible camera positions is refused before anything is written.
                target.geometry().map_err(named)?;
                let points = target.proxy.sample(POINTS, 0, 0).into_iter().map(|point| point.position);
                Around::Object(points.collect())
            }
            Preset::Room => Around::Room(Box::new(EmptySpace::new(target).map_err(named)?)),
        };
        let name = Self::name_of(path);
        Ok(Self {
            path: path.to_owned(),
            name,
            assembly,
            surface,
            region,
            limits,
            situation,
            in_studio: studio.is_some(),
            views,
        })
    }

    /// What a scene in this file is called in tables.
    pub fn name_of(path: &Path) -> String {
        path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
    }

    /// How many of these cameras stand outside of the region, or of the limits within which methods choose in `space`.
    pub fn outside(&self, space: &SceneGeometry, cameras: &[Camera]) -> usize {
        let tolerance = TOLERANCE * self.region.bounding_sphere().1;
        let is_outside = |p: DVec3| {
            self.region.nearest(p).distance(p) > tolerance || !space.keeps_limits(space.to_internal.point(p))
        };
        cameras.iter().filter(|camera| is_outside(camera.pose.position)).count()
    }

    /// Its mesh in its region, within its limits.
    fn target(&self, intrinsics: &Intrinsics) -> Result<Target> {
        let choice = self.region.into();
        let path = self.path.to_string_lossy();
        Target::new(&self.surface, &path, self.preset(), &choice, UP, intrinsics)?.within(self.limits.clone())
    }

    /// The photos that exist already where `views` more may be taken.
    ///
    /// # Errors
    /// Where the region leaves no place for them.
    pub fn kept(&self, intrinsics: Intrinsics, views: u32, seed: u64) -> Result<Vec<Camera>> {
        if self.situation != Situation::OneSide {
            return Ok(Vec::new());
        }
        self.situation.kept(&self.target(&intrinsics)?.geometry()?, intrinsics, views, seed)
    }

    /// Places from which the scene is photographed, by whatever method.
    ///
    /// # Errors
    /// Where the region leaves no place for cameras.
    pub fn eyes(&self, intrinsics: &Intrinsics) -> Result<Vec<DVec3>> {
        match &self.views {
            Around::Object(_) => Ok(room::eyes(&self.target(intrinsics)?.geometry()?)),
            Around::Room(space) => Ok(space.eyes()),
        }
    }

    fn preset(&self) -> Preset {
        match self.views {
            Around::Object(_) => Preset::Object,
            Around::Room(_) => Preset::Room,
        }
    }

    /// The input cameras.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn inputs(&self, context: &Arc<Context>, settings: &EvaluationSettings) -> Result<Vec<Camera>> {
        let (intrinsics, count) = (settings.intrinsics(), settings.inputs);
        match &self.views {
            Around::Object(_) => {
                let geometry = self.target(&intrinsics)?.geometry()?;
                views::inputs((&self.region, &geometry), intrinsics, settings.inputs_from, count)
            }
            Around::Room(space) => space.inputs(context, intrinsics, count),
        }
    }

    /// The test cameras, `count` of each set: the protocol's, or, where viewers are given, of those.
    ///
    /// # Errors
    /// Where too few places show the scene, or no place fits the viewers.
    pub fn tests(&self, intrinsics: Intrinsics, count: u32, viewers: Option<&Viewers>) -> Result<Vec<Camera>> {
        if let Some(viewers) = viewers {
            let preset = self.preset();
            let geometry = self.target(&intrinsics)?.geometry()?;
            // Cameras of a file are tests once each.
            let count = if let Viewers::Cameras(all) = viewers { count.min(all.len() as u32) } else { count };
            let tests = viewers.sample(&geometry, intrinsics, preset == Preset::Object, TESTS, count)?;
            // A file's cameras count with their places and directions; all viewers have the same lens.
            let named = |(i, camera): (usize, Camera)| Camera { name: format!("viewers_{i:04}"), intrinsics, ..camera };
            return Ok(tests.into_iter().take(count as usize).enumerate().map(named).collect());
        }
        match &self.views {
            Around::Object(points) => Ok(views::tests(&self.region, points, intrinsics, count)),
            Around::Room(space) => space.tests(intrinsics, count),
        }
    }
}

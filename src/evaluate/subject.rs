//! A scene that is evaluated on.

use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::io;
use crate::io::gltf::read_model;
use crate::photograph::assembly::Assembly;
use crate::scene::camera::Intrinsics;
use crate::scene::model::{Environment, Model};
use crate::scene::proxy::{Orientation, Proxy};
use crate::scene::region::Region;
use crate::scene::surface::Surface;
use crate::{Error, Result};

/// Points of the surface that test views are held against.
const POINTS: usize = 256;

/// An object, read and checked.
pub struct Subject {
    /// Where it was read from.
    pub path: PathBuf,
    /// Name in tables and of its folder.
    pub name: String,
    /// As it is photographed.
    pub assembly: Assembly,
    /// Its mesh.
    pub surface: Surface,
    /// Where cameras may stand, by its true bounds: the same for every method, seed and budget.
    pub region: Region,
    /// Points of its surface.
    pub points: Vec<DVec3>,
}

impl Subject {
    /// Reads a glTF scene; the notes say what was left out.
    ///
    /// # Errors
    /// Where it cannot be read, has no light, or leaves cameras no room.
    pub fn read(
        path: &Path,
        environment: Option<&Environment>,
        intrinsics: &Intrinsics,
        notes: &mut Vec<String>,
    ) -> Result<Self> {
        let model = read_model(path, notes)?;
        Self::new(path, &model, environment, io::read_surface(path)?, intrinsics)
    }

    /// Makes one of a scene and its mesh, +Y up; errors and tables call it by its path.
    ///
    /// # Errors
    /// Where it has no light, or leaves cameras no room.
    pub fn new(
        path: &Path,
        model: &Model,
        environment: Option<&Environment>,
        surface: Surface,
        intrinsics: &Intrinsics,
    ) -> Result<Self> {
        let named = |error| match error {
            Error::Request(what) => Error::input(path, what),
            other => other,
        };
        let assembly = Assembly::new(model, environment).map_err(named)?;
        let positions = surface.positions();
        let middle = positions.iter().sum::<DVec3>() / positions.len().max(1) as f64;
        let proxy = Proxy::new(&surface, Orientation::Outward(middle)).map_err(named)?;
        // glTF is Y up.
        let region =
            Region::around_object(proxy.sphere, 0.5 * intrinsics.inscribed_cone(), DVec3::Y, None).map_err(named)?;
        let points = proxy.sample(POINTS, 0, 0).into_iter().map(|point| point.position).collect();
        let name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        Ok(Self { path: path.to_owned(), name, assembly, surface, region, points })
    }
}

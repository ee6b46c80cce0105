//! What is planned for: a surface with the region around or within it, and its limits.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::config::Preset;
use super::record::SurfaceRecord;
use crate::scene::camera::Intrinsics;
use crate::scene::limits::Limits;
use crate::scene::proxy::{Occluder, Orientation, Proxy};
use crate::scene::region::{Region, Shape};
use crate::scene::stray::Reach;
use crate::scene::subject::focus;
use crate::scene::surface::Surface;
use crate::scene::volume::Volume;
use crate::visibility::device_scene::SceneGeometry;
use crate::visibility::{closing, exposure};
use crate::{Error, Result};

/// The user's settings of the region; what is left out follows from the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RegionChoice {
    /// The shape itself.
    pub shape: Option<Shape>,
    /// Height of the floor along up.
    pub floor: Option<f64>,
    /// Clearance around the surface.
    pub clearance: Option<f64>,
    /// Bounds of the places where photos were taken, which the default box of a room holds: they may lie beside all that photos show.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stood: Option<(DVec3, DVec3)>,
}

impl From<Region> for RegionChoice {
    fn from(Region { shape, floor, clearance, .. }: Region) -> Self {
        Self { shape: Some(shape), floor, clearance: Some(clearance), stood: None }
    }
}

/// A surface, ready to plan for.
pub struct Target {
    /// What blocks rays and where probes lie.
    pub proxy: Proxy,
    /// The region of the cameras.
    pub region: Region,
    /// Further limits on camera positions.
    pub limits: Limits,
    /// The surface as the record describes it.
    pub record: SurfaceRecord,
}

impl Target {
    /// Makes proxy and region of a surface that was read from `path`.
    ///
    /// # Errors
    /// Where surface or region make no sense.
    pub fn new(
        surface: &Surface,
        path: &str,
        preset: Preset,
        choice: &RegionChoice,
        up: DVec3,
        intrinsics: &Intrinsics,
    ) -> Result<Self> {
        Self::of_subject(surface, path, preset, choice, up, intrinsics, None)
    }

    /// The kind of scene that its region is of.
    pub fn preset(&self) -> Preset {
        match self.region.shape {
            Shape::Box { .. } => Preset::Room,
            Shape::Shell { .. } => Preset::Object,
        }
    }

    /// As [`Self::new`], of what lies in a volume: the rest blocks views, and nothing is planned for it.
    ///
    /// # Errors
    /// As there, and where nothing lies in it.
    pub fn of_subject(
        surface: &Surface,
        path: &str,
        preset: Preset,
        choice: &RegionChoice,
        up: DVec3,
        intrinsics: &Intrinsics,
        subject: Option<&Volume>,
    ) -> Result<Self> {
        let positions = surface.positions();
        let reach = Reach::of(positions);
        let near = || positions.iter().filter(|p| reach.holds(**p));
        let mean = near().sum::<DVec3>() / near().count().max(1) as f64;
        let centre = match choice.shape {
            Some(Shape::Box { min, max }) => 0.5 * (min + max),
            Some(Shape::Shell { centre, .. }) => centre,
            None => mean,
        };
        let orientation = match preset {
            Preset::Object => Orientation::Outward(centre),
            Preset::Room => Orientation::Inward(centre),
        };
        let mut proxy = Proxy::new(surface, orientation).map_err(|error| match error {
            Error::Request(what) => Error::input(path, what),
            other => other,
        })?;
        if let (Surface::Points(points), Preset::Object) = (surface, preset)
            && !points.oriented
            && points.toward_cameras.is_empty()
        {
            exposure::expose(&mut proxy)?;
        }
        let subject = subject.map(|subject| focus(&mut proxy, subject)).transpose()?.map(|(_, subject)| subject);
        let region = match (choice.shape, preset) {
            (Some(shape), _) => {
                // As in the default regions: by the object's radius, or the smallest side of the room itself.
                let scale = match preset {
                    Preset::Object => proxy.sphere.1,
                    Preset::Room => {
                        let (min, max) = proxy.robust_bounds();
                        (max - min).min_element()
                    }
                };
                Region { shape, up, floor: choice.floor, clearance: choice.clearance.unwrap_or(0.05 * scale) }
            }
            (None, Preset::Object) => {
                let region = Region::around_object(proxy.sphere, 0.5 * intrinsics.inscribed_cone(), up, choice.floor)?;
                Region { clearance: choice.clearance.unwrap_or(region.clearance), ..region }
            }
            (None, Preset::Room) => {
                let (min, max) = proxy.robust_bounds();
                let (low, high) = choice.stood.unwrap_or((min, max));
                let sides = max.max(high) - min.min(low);
                let clearance = choice.clearance.unwrap_or(0.05 * sides.min_element());
                // The box is shrunk by the clearance, and yet to hold them.
                let margin = if choice.stood.is_some() { clearance } else { 0.0 };
                let bounds = (min.min(low - margin), max.max(high + margin));
                let region = Region::inside_room(bounds, Some(clearance), up)?;
                Region { floor: choice.floor, ..region }
            }
        }
        .validated()?;
        let (min, max) = proxy.bounds();
        if preset == Preset::Room {
            closing::close(&mut proxy, &region, &Limits::default())?;
        }
        let kind = match proxy.occluder {
            Occluder::Triangles(_) => "triangles",
            Occluder::Discs(_) => "discs",
        };
        let record = SurfaceRecord {
            path: path.to_owned(),
            kind: kind.into(),
            primitives: proxy.occluder.len() - proxy.assumed,
            assumed: Some(proxy.assumed),
            subject,
            min,
            max,
        };
        Ok(Self { proxy, region, limits: Limits::default(), record })
    }

    /// The same within limits.
    ///
    /// # Errors
    /// Where the limits make no sense, or heights are limited in a box that is aslant to them.
    pub fn within(self, limits: Limits) -> Result<Self> {
        let oblique = self.region.up.abs().max_element() < 1.0 - 1e-9;
        if limits.narrows() && oblique && matches!(self.region.shape, Shape::Box { .. }) {
            let up = self.region.up;
            return Err(Error::request(format!(
                "`heights` and `walk` in a box need an up along an axis, not {up}; give `up`"
            )));
        }
        Ok(Self { limits: limits.validated()?, ..self })
    }

    /// The same with something all around known space, where rays from it meet nothing: viewers of a capture look past what its points
    /// show, and splats are to be right there too. A target without known space stays as it is; of a room what was assumed before makes
    /// place.
    ///
    /// # Errors
    /// Where region and limits leave no free space, or the surface cannot be represented.
    pub fn with_surroundings(mut self) -> Result<Self> {
        if self.limits.space.is_some() {
            self.proxy.forget_assumed();
            closing::close(&mut self.proxy, &self.region, &self.limits)?;
            self.record.assumed = Some(self.proxy.assumed);
        }
        Ok(self)
    }

    /// The scene in the planner's frame.
    ///
    /// # Errors
    /// Where region and limits leave no free space, or the surface cannot be represented.
    pub fn geometry(&self) -> Result<SceneGeometry> {
        SceneGeometry::among(&self.proxy, &self.region, &self.limits)
    }
}

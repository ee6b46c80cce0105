//! One self-contained HTML page per plan: what was planned, how good it is beside the baselines, the optimiser's progress, and a
//! 3D view of the cameras around the surface. The page makes no network requests.
//!
//! A training run has a page of the same make ([`training`]).
//!
//! Text and the table are made here; plots and the 3D view are drawn in the browser, from numbers embedded as JSON and
//! geometry embedded as base64.

#[cfg(feature = "cli")]
pub(crate) mod board;
mod choice;
mod data;
mod decimate;
#[cfg(feature = "cli")]
pub mod demo;
mod document;
#[cfg(feature = "cli")]
pub(crate) mod evaluation;
pub mod folder;
mod geometry;
#[cfg(feature = "cli")]
mod layouts;
pub(crate) mod pictures;
#[cfg(feature = "cli")]
mod plots;
mod scene_data;
pub mod selection;
pub(crate) mod shot_map;
pub mod shots;
mod splats;
mod text;
pub mod training;
#[cfg(feature = "cli")]
pub(crate) mod view;
pub mod way;

use glam::DVec3;

#[cfg(feature = "cli")]
pub(crate) use self::text::escape;

use self::choice::Choice;
use self::document::{Document, SCENE3D};
use self::shots::Shots;
use crate::planner::plan::record::PlanRecord;
use crate::planner::quality::map::Worst;
use crate::scene::proxy::{Disc, Occluder, Proxy};
use crate::{Error, Result};

/// A held-out point of the surface and what the plan gives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position in the world.
    pub position: DVec3,
    /// Own colour, 8-bit sRGB.
    pub colour: [u8; 3],
    /// Mean angle in radians from a reachable direction to the nearest view that sees the point: pi where no view does,
    /// NaN where the region does not reach the point at all.
    pub gap: f32,
    /// Cameras that see the point.
    pub views: u32,
    /// View dependency score in [1, 2].
    pub score: f32,
    /// Expected error in decibels against its median; NaN where it is not known.
    pub error: f32,
}

/// The surface as loose triangles, for display only: decimate it to 60,000 or fewer to keep the page under 4 MB.
#[derive(Clone, Copy, Debug)]
pub struct Triangles<'a> {
    /// Corners of each triangle, counter-clockwise from outside.
    pub corners: &'a [[DVec3; 3]],
    /// Colour of each triangle, 8-bit sRGB; empty where the mesh has none.
    pub colours: &'a [[u8; 3]],
}

/// The surface as discs, for display only.
#[derive(Clone, Copy, Debug)]
pub struct Cloud<'a> {
    /// The discs.
    pub discs: &'a [Disc],
    /// Colour of each, 8-bit sRGB.
    pub colours: &'a [[u8; 3]],
}

impl<'a> Cloud<'a> {
    /// What a proxy blocks rays with, where that is discs, but for what is only assumed.
    pub(crate) fn of(proxy: &'a Proxy) -> Option<Self> {
        match &proxy.occluder {
            Occluder::Triangles(_) => None,
            Occluder::Discs(discs) => {
                let known = discs.len() - proxy.assumed;
                Some(Self { discs: &discs[..known], colours: &proxy.colours()[..known] })
            }
        }
    }
}

/// Geometry the page draws. Triangles take their heat from the nearest point, so points should lie densely on them.
#[derive(Clone, Copy)]
pub struct ReportScene<'a> {
    /// Held-out points; all of them enter the histograms, some 20,000 at most are embedded.
    pub points: &'a [SurfacePoint],
    /// The surface, if it is a mesh.
    pub triangles: Option<Triangles<'a>>,
    /// The surface, if it is made of points.
    pub cloud: Option<Cloud<'a>>,
    /// Viewers that see most error, the worst first.
    pub worst: &'a [Worst],
    /// Photos to take, where there are photos to start from.
    pub shots: Option<&'a Shots>,
}

/// The subject of the page, which decides its wording.
#[derive(Clone, Copy, Debug)]
enum Kind<'a> {
    /// Cameras planned, beside those kept.
    Plan,
    /// Photos chosen, beside those left out.
    Selection(&'a Choice<'a>),
}

/// The page of a plan.
///
/// # Errors
/// [`Error::Request`] if the triangles' colours are neither absent nor as many as the triangles, or if more cameras are
/// kept than there are.
pub fn html(record: &PlanRecord, scene: &ReportScene) -> Result<String> {
    html_of(record, scene, Kind::Plan)
}

fn html_of(record: &PlanRecord, scene: &ReportScene, kind: Kind<'_>) -> Result<String> {
    if let Some(triangles) = scene.triangles
        && !triangles.colours.is_empty()
        && triangles.colours.len() != triangles.corners.len()
    {
        return Err(Error::request(format!(
            "the report got {} colours for {} triangles; give one each or none",
            triangles.colours.len(),
            triangles.corners.len()
        )));
    }
    if record.kept > record.cameras.len() {
        return Err(Error::request(format!(
            "the plan claims {} kept cameras among {}",
            record.kept,
            record.cameras.len()
        )));
    }
    let data = data::data(record, scene, kind);
    let worst = pictures::worst(scene.worst)?;
    let choice = match kind {
        Kind::Plan => String::new(),
        Kind::Selection(choice) => choice.html(record.cameras.len()),
    };
    let body = text::fill(include_str!("plan.html"), |slot| match slot {
        "scene" => include_str!("scene.html").into(),
        "choice" => choice.as_str().into(),
        "worst" => worst.as_str().into(),
        "shots" => scene.shots.map_or_else(String::new, |shots| shots.html(&record.cameras)).into(),
        slot => text::slot(slot, record, kind).into(),
    });
    let document = Document {
        kind: text::kind(kind),
        pictures: false,
        refresh: None,
        title: &text::title(record),
        style: "",
        heading: &text::heading(record, kind),
        body: &body,
        scripts: &[include_str!("plan.js"), SCENE3D],
        draw: "drawCharts, drawScene",
    };
    document.html(&data)
}

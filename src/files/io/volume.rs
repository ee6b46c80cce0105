//! Volumes that cameras and viewers keep out of: closed meshes, or boxes.

use std::path::Path;

use glam::DVec3;
use serde::Deserialize;

use super::{json, json_file, read_file, read_surface};
use crate::scene::known::KnownSpace;
use crate::scene::limits::{FARTHEST, Limits};
use crate::scene::proxy::{Occluder, Orientation, Proxy};
use crate::scene::surface::Surface;
use crate::scene::volume::{Triangle, Volume, box_triangles};
use crate::{Error, Result};

/// Reads a space that cameras stay in: that of a plan.json (or its folder), or the inside of a volume.
///
/// # Errors
/// As [`read_volume`], and where a plan was made without known space.
pub fn read_space(path: &Path) -> Result<KnownSpace> {
    /// What of a plan is read.
    #[derive(Deserialize)]
    struct Plan {
        limits: Limits,
    }
    let wrong = |what: String| Error::input(path, what);
    if let Ok(file) = json_file(path)
        && let Ok(plan) = json::<serde_json::Value>(&file, &read_file(&file)?)
        && plan.get("cameras").is_some()
    {
        let plan = serde_json::from_value::<Plan>(plan).ok().and_then(|plan| plan.limits.space);
        return plan
            .ok_or_else(|| wrong("this plan has no known space; name one that was made with it, or a volume".into()));
    }
    KnownSpace::inside(&read_volume(path)?.triangles).map_err(|error| wrong(error.to_string()))
}

/// A file of boxes: `{"boxes": [[X0, Y0, Z0, X1, Y1, Z1], ...]}`, two opposite corners each.
#[derive(Deserialize)]
struct Boxes {
    boxes: Vec<[f64; 6]>,
}

/// Part of a mesh's area that may be open: scans have small holes.
const MAX_OPENING: f64 = 0.1;

/// What a mesh lacks to be closed, as a part of its area: area vectors of a closed mesh add up to zero.
fn opening(triangles: &[Triangle]) -> f64 {
    let areas = triangles.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a));
    let (sum, all) = areas.fold((DVec3::ZERO, 0.0), |(sum, all), area| (sum + area, all + area.length()));
    if all > 0.0 { sum.length() / all } else { 1.0 }
}

/// Reads the mesh of a .ply, .obj, .glb or .gltf file, which should be closed, or the boxes of a .json file.
///
/// # Errors
/// Where the file cannot be read, holds points instead of faces, or a box has no volume.
pub fn read_volume(path: &Path) -> Result<Volume> {
    closed(read_faces(path)?)
}

/// The same volume, where it is closed.
///
/// # Errors
/// Where more of it than a tenth is open.
pub fn closed(volume: Volume) -> Result<Volume> {
    let open = opening(&volume.triangles);
    if open > MAX_OPENING {
        let what = format!(
            "it is not closed: {:.0}% of it is open; close the mesh, or give boxes in a .json file",
            100.0 * open
        );
        return Err(Error::input(&volume.file, what));
    }
    Ok(volume)
}

/// As [`read_volume`], of meshes that need not be closed.
///
/// # Errors
/// As there.
pub fn read_faces(path: &Path) -> Result<Volume> {
    let triangles = if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json")) {
        let text = read_file(path)?;
        let Boxes { boxes } = json(path, &text).map_err(|error| match error {
            Error::Input { path, what } => {
                Error::input(path, format!("it holds no boxes, {{\"boxes\": [[six numbers], ...]}}: {what}"))
            }
            other => other,
        })?;
        let mut triangles = Vec::new();
        if boxes.is_empty() {
            return Err(Error::input(path, "its list of boxes is empty; give a box, or leave the file out"));
        }
        for (i, [x0, y0, z0, x1, y1, z1]) in boxes.into_iter().enumerate() {
            let (a, b) = (DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1));
            let (min, max) = (a.min(b), a.max(b));
            if !(min.abs().max_element() < FARTHEST && max.abs().max_element() < FARTHEST) {
                return Err(Error::input(path, format!("box {i} has coordinates of {FARTHEST:.0e} or more")));
            }
            if !min.cmplt(max).all() {
                let what = format!("box {i} from {a} to {b} has no volume; give two opposite corners");
                return Err(Error::input(path, what));
            }
            triangles.extend(box_triangles(min, max));
        }
        triangles
    } else {
        let surface = read_surface(path)?;
        if matches!(surface, Surface::Points(_)) {
            return Err(Error::input(
                path,
                "it holds points, which enclose no volume; give a closed mesh, or boxes in a .json file",
            ));
        }
        match Proxy::new(&surface, Orientation::Trusted)
            .map_err(|_| {
                Error::input(
                    path,
                    "it has no faces that enclose a volume; give a closed mesh, or boxes in a .json file",
                )
            })?
            .occluder
        {
            Occluder::Triangles(triangles) => triangles,
            // Only points become discs.
            Occluder::Discs(_) => Vec::new(),
        }
    };
    Ok(Volume { file: path.to_string_lossy().into_owned(), triangles, ..Volume::default() })
}

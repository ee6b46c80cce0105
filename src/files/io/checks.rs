//! What every surface and every set of cameras must satisfy, whichever file it came from.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use glam::DVec3;

use super::left_out::LeftOut;
use crate::error::{Error, Result};
use crate::files::photos::Photo;
use crate::scene::camera::Camera;
use crate::scene::surface::Surface;

/// Largest coordinate: its square is still finite in the single precision that devices compute with.
pub(crate) const LARGEST: f64 = 1e18;

/// Whether `p` can be computed with.
pub(crate) fn usable(p: DVec3) -> bool {
    p.is_finite() && p.abs().max_element() <= LARGEST
}

/// What is said of cameras with lens distortion where it plays no part.
pub(crate) fn taken_as_pinholes(distorted: usize, all: usize) -> String {
    format!(
        "{distorted} of {all} images have lens distortion, which placing cameras ignores: it takes them as pinholes (training honours it)"
    )
}

/// Refuses positions that are not finite, with their count and the first one; `what` names one ("vertex").
pub(crate) fn finite(path: &Path, positions: &[DVec3], what: &str) -> Result<()> {
    let bad = positions.iter().filter(|p| !usable(**p)).count();
    match positions.iter().position(|p| !usable(*p)) {
        None => Ok(()),
        Some(first) => Err(Error::input(
            path,
            format!(
                "{bad} of {} positions are not finite (or beyond {LARGEST:e}); first at {what} {first}; remove them",
                positions.len()
            ),
        )),
    }
}

/// Passes a surface on when [`sound`] accepts it, without its points that are not finite, and the triangles at such vertices; a note says
/// how many.
pub(crate) fn surface(path: &Path, surface: Surface, notes: &mut Vec<String>) -> Result<Surface> {
    let positions = surface.positions();
    let keep: Vec<bool> = positions.iter().map(|p| usable(*p)).collect();
    let bad = keep.iter().filter(|keep| !**keep).count();
    let surface = match keep.iter().position(|keep| !keep) {
        // Where none is left the refusal says so.
        Some(first) if bad < positions.len() => {
            let (what, all) =
                (if matches!(surface, Surface::Mesh(_)) { "vertices" } else { "points" }, positions.len());
            let (surface, triangles) = without(surface, &keep);
            let with = if triangles > 0 { format!(", with {triangles} triangles") } else { String::new() };
            notes.push(format!(
                "{bad} of {all} {what} are not finite and were left out{with}; the first is number {first}, from 0"
            ));
            surface
        }
        _ => surface,
    };
    sound(path, &surface).map(|()| surface)
}

/// What `keep` selects of the points or vertices, and how many triangles go with the others.
fn without(surface: Surface, keep: &[bool]) -> (Surface, usize) {
    let mut mesh = match surface {
        Surface::Points(points) => return (Surface::Points(points.filtered(keep)), 0),
        Surface::Mesh(mesh) => mesh,
    };
    let mut next = 0;
    let count = |keep: &bool| {
        let number = next;
        next += u32::from(*keep);
        number
    };
    let number: Vec<u32> = keep.iter().map(count).collect();
    let stays: Vec<bool> =
        mesh.triangles.iter().map(|t| t.iter().all(|v| keep.get(*v as usize).is_none_or(|keep| *keep))).collect();
    let all = mesh.triangles.len();
    let mut kept = stays.iter();
    mesh.triangles.retain(|_| *kept.next().unwrap_or(&true));
    let mut kept = stays.iter();
    mesh.colours.retain(|_| *kept.next().unwrap_or(&true));
    for corner in mesh.triangles.iter_mut().flatten() {
        *corner = number.get(*corner as usize).copied().unwrap_or(*corner);
    }
    let mut kept = keep.iter();
    mesh.positions.retain(|_| *kept.next().unwrap_or(&true));
    let mut kept = keep.iter();
    mesh.scores.retain(|_| *kept.next().unwrap_or(&true));
    let gone = all - mesh.triangles.len();
    (Surface::Mesh(mesh), gone)
}

/// Accepts a surface when it can be planned for: two distinct finite positions or more, indices in range, scores in [1, 2], and
/// triangles where it is a mesh.
pub(crate) fn sound(path: &Path, surface: &Surface) -> Result<()> {
    let refuse = |what: String| Err(Error::input(path, what));
    let (what, scores) = match surface {
        Surface::Mesh(mesh) => ("vertex", &mesh.scores),
        Surface::Points(points) => ("point", &points.scores),
    };
    let positions = surface.positions();
    match positions {
        [] => return refuse("it holds no points; export the surface again".into()),
        [_] => return refuse("it holds only one point; a surface needs four distinct points, or triangles".into()),
        _ => finite(path, positions, what)?,
    }
    if positions.iter().all(|p| *p == positions[0]) {
        return refuse(format!("all {} points are equal; a surface needs some extent", positions.len()));
    }
    if let Some(i) = scores.iter().position(|s| !(1.0..=2.0).contains(s)) {
        return refuse(format!(
            "{what} {i} has the view dependency score {}; scores lie between 1 and 2, so rescale them",
            scores[i]
        ));
    }
    if let Surface::Mesh(mesh) = surface {
        if mesh.triangles.is_empty() {
            return refuse("it holds no triangles; export the mesh with its faces".into());
        }
        let outside = |t: &[u32; 3]| t.iter().any(|&v| v as usize >= positions.len());
        if let Some(i) = mesh.triangles.iter().position(outside) {
            return refuse(format!(
                "triangle {i} refers to the vertices {:?} and there are only {}; export the mesh again",
                mesh.triangles[i],
                positions.len()
            ));
        }
    }
    Ok(())
}

/// Accepts a camera when its pose is finite with a unit rotation, and image and focal lengths have a size.
///
/// # Errors
/// What is wrong, as a continuation of its name.
pub(crate) fn camera(camera: &Camera) -> Result<(), String> {
    let k = &camera.intrinsics;
    if !usable(camera.pose.position) || !camera.pose.rotation.is_finite() {
        return Err("has a pose that is not finite; remove it".into());
    }
    if (camera.pose.rotation.length() - 1.0).abs() > 1e-3 {
        return Err("has a rotation that is not of unit length; normalise it".into());
    }
    if k.width == 0 || k.height == 0 {
        return Err(format!("has an image of {} x {} pixels; give its size", k.width, k.height));
    }
    if !k.focal.iter().all(|f| f.is_finite() && *f > 0.0) || !k.principal.iter().all(|c| c.is_finite()) {
        return Err(format!(
            "has the focal lengths {:?} and the principal point {:?}; give both in pixels",
            k.focal, k.principal
        ));
    }
    Ok(())
}

/// Accepts cameras when there is at least one, [`camera`] accepts each, and names are unique.
pub(crate) fn cameras<'a>(path: &Path, cameras: impl ExactSizeIterator<Item = &'a Camera>) -> Result<()> {
    if cameras.len() == 0 {
        return Err(Error::input(path, "it holds no cameras; export the poses again"));
    }
    let mut seen = HashMap::with_capacity(cameras.len());
    for (i, one) in cameras.enumerate() {
        let refuse = |what: String| Err(Error::input(path, format!("camera {i} ({:?}) {what}", one.name)));
        if let Err(what) = camera(one) {
            return refuse(what);
        }
        if let Some(first) = seen.insert(&one.name, i) {
            return refuse(format!("has the name of camera {first}; names must differ"));
        }
    }
    Ok(())
}

/// Leaves out the photos of cameras that [`cameras`] would refuse, names that come again among them.
///
/// # Errors
/// Where none is left, with what is wrong with the first.
pub(crate) fn usable_photos(path: &Path, photos: &mut Vec<Photo>, left_out: &mut LeftOut) -> Result<()> {
    let mut seen = HashSet::with_capacity(photos.len());
    photos.retain(|photo| {
        let name = &photo.camera.name;
        let sound = camera(&photo.camera).and_then(|()| match seen.insert(name.clone()) {
            true => Ok(()),
            false => Err("has the name of another one; names must differ".into()),
        });
        if let Err(what) = &sound {
            left_out.add(format!("camera {name:?} {what}"));
        }
        sound.is_ok()
    });
    match (photos.is_empty(), left_out.first()) {
        (true, Some(why)) => Err(Error::input(path, format!("none of its cameras can be used: {why}"))),
        (true, None) => Err(Error::input(path, "it holds no cameras; export the poses again")),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::surface::{Mesh, Points};

    fn points(positions: Vec<DVec3>) -> Result<Surface> {
        surface(Path::new("a"), Surface::Points(Points { positions, ..Points::default() }), &mut Vec::new())
    }

    /// If this failed, a NaN would reach the planner and silently corrupt every camera, or one bad point lose a scan of millions.
    #[test]
    fn positions_that_are_not_finite_are_left_out_and_counted() {
        let mut positions: Vec<DVec3> = (0..10).map(|i| DVec3::splat(f64::from(i))).collect();
        positions[3].x = f64::NAN;
        positions[7].y = f64::INFINITY;
        let scores = (0..10).map(|i| 1.0 + 0.1 * i as f32).collect();
        let mut notes = Vec::new();
        let cloud = Points { positions: positions.clone(), scores, ..Points::default() };
        let Ok(Surface::Points(left)) = surface(Path::new("a"), Surface::Points(cloud.clone()), &mut notes) else {
            panic!("not points")
        };
        assert_eq!((left.positions.len(), left.positions[3], left.scores[3]), (8, DVec3::splat(4.0), 1.4));
        assert_eq!(notes, ["2 of 10 points are not finite and were left out; the first is number 3, from 0"]);
        // A program that hands over such points itself has a mistake to find.
        let message = sound(Path::new("a"), &Surface::Points(cloud)).unwrap_err().to_string();
        assert!(message.contains("2 of 10 positions are not finite") && message.contains("at point 3"), "{message}");
        assert!(points(vec![DVec3::NAN; 4]).unwrap_err().to_string().contains("4 of 4 positions are not finite"));

        let mesh = Mesh {
            positions,
            triangles: vec![[0, 1, 2], [2, 3, 4], [4, 5, 6], [9, 8, 7], [9, 8, 6]],
            colours: (0..5).map(|i| [i; 3]).collect(),
            ..Mesh::default()
        };
        let mut notes = Vec::new();
        let Ok(Surface::Mesh(left)) = surface(Path::new("a"), Surface::Mesh(mesh), &mut notes) else {
            panic!("no mesh")
        };
        assert_eq!(left.triangles, [[0, 1, 2], [3, 4, 5], [7, 6, 5]]);
        assert_eq!((left.colours, left.positions[7]), (vec![[0; 3], [2; 3], [4; 3]], DVec3::splat(9.0)));
        assert!(notes[0].contains("2 of 10 vertices are not finite and were left out, with 2 triangles"), "{notes:?}");
    }

    /// If this failed, surfaces without extent would be planned for, with a region of size zero.
    #[test]
    fn surfaces_without_extent_are_refused() {
        assert!(points(vec![]).unwrap_err().to_string().contains("no points"));
        assert!(points(vec![DVec3::ONE]).unwrap_err().to_string().contains("only one point"));
        assert!(points(vec![DVec3::ONE; 3]).unwrap_err().to_string().contains("all 3 points are equal"));
        assert!(points(vec![DVec3::ONE, DVec3::ZERO]).is_ok());
    }

    /// If this failed, a triangle could index past its vertices and panic far from the file that caused it.
    #[test]
    fn triangles_out_of_range_are_refused() {
        let mesh = Mesh { positions: vec![DVec3::ZERO, DVec3::X], triangles: vec![[0, 1, 2]], ..Mesh::default() };
        assert!(
            surface(Path::new("a"), Surface::Mesh(mesh), &mut Vec::new())
                .unwrap_err()
                .to_string()
                .contains("triangle 0")
        );
    }
}

//! The layouts of an evaluation in 3D: the cameras of every method around what they photograph.

use glam::DVec3;

use super::decimate::decimate;
use super::geometry::{bounds, robust_bounds};
use super::scene_data::{
    CameraData, Layout, MAX_POINTS, PointData, RegionData, Role, SceneData, TriangleData, Words, thin,
};
use super::{SurfacePoint, Triangles};
use crate::lab::evaluate::results::Entry;
use crate::lab::evaluate::scene::{Scene, UP};
use crate::lab::evaluate::subject::Subject;
use crate::scene::camera::{Camera, Pose, common_up};
use crate::scene::region::Region;
use crate::scene::surface::{Points, Surface};

/// Colour of points without one.
const GREY: [u8; 3] = [150; 3];

/// What the 3D view of a subject is drawn from: the cameras of some runs, a layout each, and at most so many triangles of its
/// surface. None where there is nothing to show.
pub fn scene<'a>(subject: &'a Subject, runs: &[&'a Entry], triangles: usize) -> Option<SceneData<'a>> {
    let layouts = runs.iter().filter(|entry| !entry.cameras.is_empty());
    let layouts: Vec<_> = layouts.map(|entry| (entry.method.name(), &entry.cameras[..])).collect();
    match subject {
        Subject::Scene(scene) => of_scene(scene, &layouts, triangles),
        Subject::Pool(pool) => {
            let poses: Vec<Pose> = pool.candidates.photos.iter().map(|photo| photo.camera.pose).collect();
            let points = cloud(&pool.candidates.points.positions, &pool.candidates.points.colours);
            drawn(None, common_up(&poses).unwrap_or(DVec3::Z), (&points, &[], &[]), &layouts)
        }
    }
}

/// What the 3D view of a scene is drawn from: named layouts of cameras, and at most so many triangles of its surface. None without
/// cameras.
pub fn of_scene<'a>(scene: &Scene, layouts: &[(&'a str, &'a [Camera])], triangles: usize) -> Option<SceneData<'a>> {
    let (points, corners, colours) = shown(&scene.surface, triangles);
    drawn(Some(scene.region), UP, (&points, &corners, &colours), layouts)
}

/// What the 3D view of a capture is drawn from: its cameras, and its points where there are any. None without cameras.
pub fn capture<'a>(cameras: &'a [Camera], points: &Points) -> Option<SceneData<'a>> {
    let poses: Vec<Pose> = cameras.iter().map(|camera| camera.pose).collect();
    let points = cloud(&points.positions, &points.colours);
    drawn(None, common_up(&poses).unwrap_or(DVec3::Z), (&points, &[], &[]), &[("", cameras)])
}

/// Named layouts of cameras around points or triangles with their colours.
fn drawn<'a>(
    region: Option<Region>,
    up: DVec3,
    (points, corners, colours): (&[SurfacePoint], &[[DVec3; 3]], &[[u8; 3]]),
    layouts: &[(&'a str, &'a [Camera])],
) -> Option<SceneData<'a>> {
    let positions = layouts.iter().flat_map(|(_, cameras)| *cameras).map(|camera| camera.pose.position);
    let low_high = bounds(positions)?;
    let bulk = robust_bounds(points).or_else(|| bounds(corners.iter().flatten().copied())).unwrap_or(low_high);
    let origin = 0.5 * (bulk.0 + bulk.1);
    let layout = |(name, cameras): &(&'a str, &'a [Camera])| Layout {
        name,
        cameras: cameras.iter().map(|camera| CameraData::new(camera, origin, Role::Own)).collect(),
    };
    Some(SceneData {
        words: Words { own: "camera", other: "", suggested: "" },
        origin,
        up,
        region: region.map(|region| RegionData::new(&region, origin)),
        bulk: [bulk.0 - origin, bulk.1 - origin],
        layouts: layouts.iter().map(layout).collect(),
        tour: Vec::new(),
        triangles: TriangleData::new(&Triangles { corners, colours }, points, origin),
        cloud: None,
        walls: Vec::new(),
        zones: Vec::new(),
        points: PointData::new(points, origin),
    })
}

/// A surface as points, or as triangles with their colours.
fn shown(surface: &Surface, most: usize) -> (Vec<SurfacePoint>, Vec<[DVec3; 3]>, Vec<[u8; 3]>) {
    match surface {
        Surface::Points(points) => (cloud(&points.positions, &points.colours), Vec::new(), Vec::new()),
        Surface::Mesh(mesh) => {
            let corner = |index: u32| mesh.positions[index as usize];
            let corners: Vec<[DVec3; 3]> = mesh.triangles.iter().map(|triangle| triangle.map(corner)).collect();
            let (corners, colours) = decimate(&corners, &mesh.colours, most);
            (Vec::new(), corners, colours)
        }
    }
}

/// Points with nothing but their colours.
fn cloud(positions: &[DVec3], colours: &[[u8; 3]]) -> Vec<SurfacePoint> {
    let numbers: Vec<usize> = (0..positions.len()).filter(|i| positions[*i].is_finite()).collect();
    let point = |i: usize| SurfacePoint {
        position: positions[i],
        colour: colours.get(i).copied().unwrap_or(GREY),
        gap: f32::NAN,
        views: 0,
        score: 1.0,
        error: f32::NAN,
    };
    thin(&numbers, MAX_POINTS).map(point).collect()
}

//! What a 3D view is drawn from, as JSON: surface, region and cameras. Lengths are in world units from `origin`, angles in degrees;
//! what is not finite becomes `null`.

use glam::DVec3;
use serde::Serialize;

use super::geometry::{bounds, nearest, pack, split};
use super::{Cloud, SurfacePoint, Triangles};
use crate::scene::camera::Camera;
use crate::scene::limits::Limits;
use crate::scene::region::{Region, Shape};
use crate::scene::volume::Triangle;

/// Points embedded at most: index of the nearest point must fit 16 bits, and the page 4 MB.
pub const MAX_POINTS: usize = 20_000;
/// Discs of a cloud, and triangles of volumes, embedded at most.
const MAX_DISCS: usize = 40_000;
const MAX_ZONE_TRIANGLES: usize = 2000;

/// A scene.
#[derive(Serialize)]
pub struct SceneData<'a> {
    /// What cameras of each role are called.
    pub words: Words,
    /// What all positions are relative to.
    pub origin: DVec3,
    /// Unit vector that points up in the world.
    pub up: DVec3,
    /// Where cameras may be, where that is known.
    pub region: Option<RegionData>,
    /// Bounds of the bulk of the surface.
    pub bulk: [DVec3; 2],
    /// Layouts of cameras, of which one is shown at a time.
    pub layouts: Vec<Layout<'a>>,
    /// Corners of the way along the cameras; empty where they are in no order.
    pub tour: Vec<DVec3>,
    /// Points of the surface.
    pub points: PointData,
    /// Its triangles, where it is a mesh.
    pub triangles: Option<TriangleData>,
    /// Its discs, where it is made of points.
    pub cloud: Option<CloudData>,
    /// Planes that nobody is behind.
    pub walls: Vec<WallData>,
    /// Edges of the volumes that nobody is in.
    pub zones: Vec<[DVec3; 2]>,
}

/// A plane that nobody is behind.
#[derive(Serialize)]
pub struct WallData {
    point: DVec3,
    normal: DVec3,
}

/// A layout of cameras.
#[derive(Serialize)]
pub struct Layout<'a> {
    /// Its name, where there are several.
    pub name: &'a str,
    /// Its cameras.
    pub cameras: Vec<CameraData<'a>>,
}

/// Where cameras may be.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum RegionData {
    Shell { centre: DVec3, r_min: f64, r_max: f64, floor: Option<f64> },
    Box { min: DVec3, max: DVec3, floor: Option<f64> },
}

/// What cameras are called, by [`Role`].
#[derive(Serialize)]
pub struct Words {
    /// Those of [`Role::Own`].
    pub own: &'static str,
    /// Those of [`Role::Other`].
    pub other: &'static str,
    /// Those of [`Role::Suggested`].
    pub suggested: &'static str,
}

/// What a camera is to the page.
#[derive(Clone, Copy, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Planned or chosen.
    Own,
    /// Kept by a plan, left out by a selection.
    Other,
    /// Worth adding to a selection.
    Suggested,
}

/// A camera.
#[derive(Serialize)]
pub struct CameraData<'a> {
    name: &'a str,
    role: Role,
    /// What it is called in the picture, where that is not its name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub label: Option<String>,
    /// What is known of it beside its pose.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
    #[serde(flatten)]
    view: View,
}

/// From where a camera looks, and through which lens.
#[derive(Serialize)]
pub(super) struct View {
    position: DVec3,
    /// Camera axes (right, down, forward) in the world.
    axes: [DVec3; 3],
    size: [u32; 2],
    focal: [f64; 2],
    principal: [f64; 2],
}

impl View {
    /// That of a camera, relative to `origin`.
    pub fn new(camera: &Camera, origin: DVec3) -> Self {
        let Camera { pose, intrinsics, .. } = camera;
        Self {
            position: pose.position - origin,
            axes: [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| pose.rotation * axis),
            size: [intrinsics.width, intrinsics.height],
            focal: intrinsics.focal,
            principal: intrinsics.principal,
        }
    }
}

/// Points of the surface.
#[derive(Serialize)]
pub struct PointData {
    count: usize,
    /// f32, three per point.
    positions: String,
    /// u8, three per point.
    colours: String,
    /// f32 degrees; NaN where unreachable.
    gap: String,
    /// u16, saturated.
    views: String,
    /// f32.
    score: String,
    /// f32 decibels; NaN where it is not known, empty where it is nowhere.
    error: String,
}

/// Places on the surface.
#[derive(Serialize)]
struct Placed {
    low: DVec3,
    /// World units per step of `positions`.
    step: DVec3,
    /// u16, three per place.
    positions: String,
    /// u16, the point nearest to each place.
    nearest: String,
}

/// The surface, where it is made of points.
#[derive(Serialize)]
pub struct CloudData {
    count: usize,
    #[serde(flatten)]
    placed: Placed,
    /// u8, three per disc.
    colours: String,
    /// Usual diameter of a disc.
    diameter: f64,
}

/// The surface.
#[derive(Serialize)]
pub struct TriangleData {
    count: usize,
    /// Three corners per triangle.
    #[serde(flatten)]
    placed: Placed,
    /// u8, three per triangle; empty where the mesh has no colours.
    colours: String,
}

impl RegionData {
    /// A region, relative to `origin`.
    pub fn new(region: &Region, origin: DVec3) -> Self {
        let floor = region.floor.map(|floor| floor - origin.dot(region.up));
        match region.shape {
            Shape::Shell { centre, r_min, r_max } => Self::Shell { centre: centre - origin, r_min, r_max, floor },
            Shape::Box { min, max } => Self::Box { min: min - origin, max: max - origin, floor },
        }
    }
}

impl<'a> CameraData<'a> {
    /// A camera, relative to `origin`.
    pub fn new(camera: &'a Camera, origin: DVec3, role: Role) -> Self {
        Self { name: &camera.name, role, label: None, remark: None, view: View::new(camera, origin) }
    }
}

impl PointData {
    /// Points, relative to `origin`.
    pub fn new(points: &[SurfacePoint], origin: DVec3) -> Self {
        Self {
            count: points.len(),
            positions: pack(points.iter().flat_map(|p| (p.position - origin).as_vec3().to_array()), f32::to_le_bytes),
            colours: pack(points.iter().map(|p| p.colour), |c| c),
            gap: pack(points.iter().map(|p| p.gap.to_degrees()), f32::to_le_bytes),
            views: pack(points.iter().map(|p| p.views.min(u32::from(u16::MAX)) as u16), u16::to_le_bytes),
            score: pack(points.iter().map(|p| p.score), f32::to_le_bytes),
            error: match points.iter().any(|p| p.error.is_finite()) {
                true => pack(points.iter().map(|p| p.error), f32::to_le_bytes),
                false => String::new(),
            },
        }
    }
}

impl Placed {
    /// Places, relative to `origin`, and the points nearest to them; none where there are none.
    fn new(places: &[DVec3], points: &[SurfacePoint], origin: DVec3) -> Option<Self> {
        let (low, high) = bounds(places.iter().copied())?;
        let step = ((high - low) / f64::from(u16::MAX)).max(DVec3::splat(f64::MIN_POSITIVE));
        let quantised = places.iter().flat_map(|p| ((p - low) / step).round().to_array());
        Some(Self {
            low: low - origin,
            step,
            // A cast from NaN or beyond the range saturates, so that no place can panic.
            positions: pack(quantised.map(|v| v as u16), u16::to_le_bytes),
            nearest: pack(nearest(points, places.iter().copied()), u16::to_le_bytes),
        })
    }
}

impl TriangleData {
    /// Triangles, relative to `origin`, with the points that they take their colours from; none where there are none.
    pub fn new(triangles: &Triangles, points: &[SurfacePoint], origin: DVec3) -> Option<Self> {
        let (corners, sources) = split(triangles.corners, points.len());
        let placed = Placed::new(corners.as_flattened(), points, origin)?;
        let colours = if triangles.colours.is_empty() {
            String::new()
        } else {
            pack(sources.iter().map(|s| triangles.colours[*s]), |c| c)
        };
        Some(Self { count: corners.len(), placed, colours })
    }
}

impl CloudData {
    /// Discs, relative to `origin`, with the points that they take their colours from; none where there are none.
    pub fn new(cloud: &Cloud, points: &[SurfacePoint], origin: DVec3) -> Option<Self> {
        let discs: Vec<(DVec3, f64, [u8; 3])> = thin(cloud.discs, MAX_DISCS)
            .zip(thin(cloud.colours, MAX_DISCS))
            .filter(|(disc, _)| disc.centre.is_finite())
            .map(|(disc, colour)| (disc.centre, disc.radius, colour))
            .collect();
        let centres: Vec<DVec3> = discs.iter().map(|(centre, ..)| *centre).collect();
        let placed = Placed::new(&centres, points, origin)?;
        let mut radii: Vec<f64> = discs.iter().map(|(_, radius, _)| *radius).collect();
        let rank = radii.len() / 2;
        Some(Self {
            count: discs.len(),
            placed,
            colours: pack(discs.iter().map(|(.., colour)| *colour), |c| c),
            diameter: 2.0 * *radii.select_nth_unstable_by(rank, f64::total_cmp).1,
        })
    }
}

/// Walls of limits, relative to `origin`.
pub fn walls(limits: &Limits, origin: DVec3) -> Vec<WallData> {
    limits.walls.iter().map(|wall| WallData { point: wall.point - origin, normal: wall.normal }).collect()
}

/// Edges of the volumes of limits, relative to `origin`, so many at most.
pub fn zones(limits: &Limits, origin: DVec3) -> Vec<[DVec3; 2]> {
    let triangles: Vec<_> = limits.keep_out.iter().flat_map(|volume| &volume.triangles).copied().collect();
    let edges = |[a, b, c]: Triangle| [[a, b], [b, c], [c, a]];
    let edges = thin(&triangles, MAX_ZONE_TRIANGLES).flat_map(edges);
    edges.map(|edge| edge.map(|corner| corner - origin)).collect()
}

/// JSON that is safe inside a `<script>` element: no `</script>` or `<!--` may end it early.
pub fn in_script(json: &str) -> String {
    json.replace('<', "\\u003c")
}

/// Every so many-th item, `limit` at most, always with the last one.
pub fn thin<T: Copy>(items: &[T], limit: usize) -> impl Iterator<Item = T> {
    let stride = items.len().div_ceil(limit).max(1);
    items.iter().rev().step_by(stride).rev().copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_the_order_and_the_last_item() {
        assert_eq!(thin(&[1, 2, 3, 4, 5, 6, 7], 3).collect::<Vec<_>>(), [1, 4, 7]);
        assert_eq!(thin(&[1, 2], 3).collect::<Vec<_>>(), [1, 2]);
        assert_eq!(thin::<u8>(&[], 3).count(), 0);
    }
}

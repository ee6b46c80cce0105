//! The numbers the page draws from, as JSON. Lengths are in world units from `origin`, angles in degrees; what is not
//! finite becomes `null`.

use glam::DVec3;
use serde::Serialize;

use super::geometry::{bounds, nearest, pack, robust_bounds, split};
use super::{Kind, ReportScene, SurfacePoint, Triangles, choice};
use crate::plan::record::PlanRecord;
use crate::scene::camera::Camera;
use crate::scene::region::Shape;
use crate::{Error, Result};

/// Points embedded at most: index of the nearest point must fit 16 bits, and the page 4 MB.
const MAX_POINTS: usize = 20_000;
/// Iterations embedded at most; a plot is some 500 pixels wide.
const MAX_ITERATIONS: usize = 1000;

#[derive(Serialize)]
struct Data<'a> {
    /// What cameras of each role are called.
    words: Words,
    origin: DVec3,
    up: DVec3,
    history: History,
    checkpoints: Checkpoints,
    histograms: Histograms,
    region: RegionData,
    /// Bounds of the bulk of the surface.
    bulk: [DVec3; 2],
    cameras: Vec<CameraData<'a>>,
    /// Corners of the way along the cameras; empty where they are in no order.
    tour: Vec<DVec3>,
    points: PointData,
    triangles: Option<TriangleData>,
}

#[derive(Serialize)]
struct History {
    iteration: Vec<u32>,
    loss: Vec<f32>,
    image: Vec<f32>,
    reg: Vec<f32>,
    bound: Vec<f32>,
    scale: Vec<f32>,
}

#[derive(Serialize)]
struct Checkpoints {
    iteration: Vec<u32>,
    reachable: Vec<f64>,
    coverage_1: Vec<f64>,
    coverage_3: Vec<f64>,
    gap: Vec<f64>,
    voronoi: Vec<f64>,
    voronoi_low: Vec<Option<f64>>,
    voronoi_high: Vec<Option<f64>>,
}

/// Counts of the values in `[start + i step, start + (i + 1) step)`.
#[derive(Debug, PartialEq, Serialize)]
struct Histogram {
    start: f64,
    step: f64,
    counts: Vec<usize>,
}

#[derive(Serialize)]
struct Histograms {
    views: Histogram,
    gap: Histogram,
    /// Points that no feasible position sees, in neither histogram.
    unreachable: usize,
    /// Points that could be seen and are not; their gap is pi by definition, so that histogram leaves them out.
    unseen: usize,
}

#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum RegionData {
    Shell { centre: DVec3, r_min: f64, r_max: f64, floor: Option<f64> },
    Box { min: DVec3, max: DVec3, floor: Option<f64> },
}

/// What cameras are called, by [`Role`].
#[derive(Serialize)]
struct Words {
    own: &'static str,
    other: &'static str,
    suggested: &'static str,
}

/// What a camera is to the page.
#[derive(Clone, Copy, Serialize)]
#[serde(rename_all = "snake_case")]
enum Role {
    /// Planned or chosen.
    Own,
    /// Kept by a plan, left out by a selection.
    Other,
    /// Worth adding to a selection.
    Suggested,
}

#[derive(Serialize)]
struct CameraData<'a> {
    name: &'a str,
    role: Role,
    /// What it is called in the picture, where that is not its name.
    #[serde(skip_serializing_if = "Option::is_none")]
    label: Option<String>,
    /// What is known of it beside its pose.
    #[serde(skip_serializing_if = "Option::is_none")]
    remark: Option<String>,
    position: DVec3,
    /// Camera axes (right, down, forward) in the world.
    axes: [DVec3; 3],
    size: [u32; 2],
    focal: [f64; 2],
    principal: [f64; 2],
}

#[derive(Serialize)]
struct PointData {
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

#[derive(Serialize)]
struct TriangleData {
    count: usize,
    low: DVec3,
    /// World units per step of `positions`.
    step: DVec3,
    /// u16, nine per triangle.
    positions: String,
    /// u8, three per triangle; empty where the mesh has no colours.
    colours: String,
    /// u16, the point nearest to each corner.
    nearest: String,
}

/// The JSON text, safe inside a `<script>` element.
pub fn json(record: &PlanRecord, scene: &ReportScene, kind: Kind<'_>) -> Result<String> {
    let region = &record.region;
    let origin = region.bounding_sphere().0;
    let floor = region.floor.map(|floor| floor - origin.dot(region.up));
    let shape = match region.shape {
        Shape::Shell { centre, r_min, r_max } => RegionData::Shell { centre: centre - origin, r_min, r_max, floor },
        Shape::Box { min, max } => RegionData::Box { min: min - origin, max: max - origin, floor },
    };
    let bulk = robust_bounds(scene.points)
        .or_else(|| bounds(scene.triangles?.corners.iter().flatten().copied()))
        .unwrap_or((record.surface.min, record.surface.max));
    let points: Vec<SurfacePoint> = thin(scene.points, MAX_POINTS).filter(|p| p.position.is_finite()).collect();
    let data = Data {
        words: match kind {
            Kind::Plan => Words { own: "planned camera", other: "kept camera", suggested: "" },
            Kind::Selection(_) => Words { own: "chosen photo", other: "photo left out", suggested: "suggested photo" },
        },
        origin,
        up: region.up,
        history: history(record),
        checkpoints: checkpoints(record),
        histograms: histograms(scene.points),
        region: shape,
        bulk: [bulk.0 - origin, bulk.1 - origin],
        cameras: cameras(record, kind, origin),
        tour: record.tour.iter().flat_map(|tour| &tour.path).map(|corner| *corner - origin).collect(),
        triangles: scene.triangles.and_then(|triangles| triangle_data(&triangles, &points, origin)),
        points: point_data(&points, origin),
    };
    let json = serde_json::to_string(&data).map_err(|e| Error::request(format!("the report's data: {e}")))?;
    // No `</script>` or `<!--` may end the element early.
    Ok(json.replace('<', "\\u003c"))
}

/// Every so many-th item, `limit` at most, always with the last one.
fn thin<T: Copy>(items: &[T], limit: usize) -> impl Iterator<Item = T> {
    let stride = items.len().div_ceil(limit).max(1);
    items.iter().rev().step_by(stride).rev().copied()
}

fn history(record: &PlanRecord) -> History {
    let rows: Vec<_> = thin(&record.history, MAX_ITERATIONS).collect();
    let column = |get: fn(&crate::plan::record::IterationRecord) -> f32| rows.iter().map(get).collect();
    History {
        iteration: rows.iter().map(|r| r.iteration).collect(),
        loss: column(|r| r.loss),
        image: column(|r| r.image),
        reg: column(|r| r.reg),
        bound: column(|r| r.bound),
        scale: column(|r| r.scale),
    }
}

fn checkpoints(record: &PlanRecord) -> Checkpoints {
    let rows = &record.checkpoints;
    Checkpoints {
        iteration: rows.iter().map(|r| r.iteration).collect(),
        reachable: rows.iter().map(|r| r.metrics.reachable).collect(),
        coverage_1: rows.iter().map(|r| r.metrics.coverage_1).collect(),
        coverage_3: rows.iter().map(|r| r.metrics.coverage_3).collect(),
        gap: rows.iter().map(|r| r.metrics.gap_mean_deg).collect(),
        voronoi: rows.iter().map(|r| r.metrics.voronoi_mean).collect(),
        voronoi_low: rows.iter().map(|r| r.voronoi_low_vds).collect(),
        voronoi_high: rows.iter().map(|r| r.voronoi_high_vds).collect(),
    }
}

/// Histograms over the points that can be reached at all, as the metrics are.
fn histograms(points: &[SurfacePoint]) -> Histograms {
    let reached = || points.iter().filter(|p| p.gap.is_finite());
    let seen = || reached().filter(|p| p.views > 0);
    Histograms {
        // Views are whole numbers, so a step is one too.
        views: histogram(reached().map(|p| f64::from(p.views)), |step| step.ceil().max(1.0)),
        gap: histogram(seen().map(|p| f64::from(p.gap).to_degrees()), |step| step),
        unreachable: points.len() - reached().count(),
        unseen: reached().count() - seen().count(),
    }
}

/// About 30 steps of a round width from zero to the highest value.
fn histogram(values: impl Iterator<Item = f64> + Clone, round: impl Fn(f64) -> f64) -> Histogram {
    let top = values.clone().fold(0.0, f64::max);
    let raw = (top / 30.0).max(1e-3);
    let power = 10f64.powf(raw.log10().floor());
    let step = round([1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= raw).unwrap_or(raw));
    let mut counts = vec![0; (top / step) as usize + 1];
    let last = counts.len() - 1;
    for value in values {
        counts[((value / step) as usize).min(last)] += 1;
    }
    Histogram { start: 0.0, step, counts }
}

/// The record's cameras, and those that a selection suggests.
fn cameras<'a>(record: &'a PlanRecord, kind: Kind<'a>, origin: DVec3) -> Vec<CameraData<'a>> {
    let own = record.cameras.len() - record.kept;
    let role = |i| if i < own { Role::Own } else { Role::Other };
    let mut cameras: Vec<_> = record.cameras.iter().enumerate().map(|(i, one)| camera(one, origin, role(i))).collect();
    if let Kind::Selection(choice) = kind {
        for (camera, photo) in cameras.iter_mut().zip(choice.photos) {
            camera.remark = Some(photo.remark());
        }
        cameras.extend(choice.suggested.iter().map(|suggested| CameraData {
            label: Some(choice::gain(suggested)),
            remark: Some(format!("it would add {} by itself", choice::gain(suggested))),
            ..camera(&suggested.camera, origin, Role::Suggested)
        }));
    }
    cameras
}

fn camera(camera: &Camera, origin: DVec3, role: Role) -> CameraData<'_> {
    let intrinsics = &camera.intrinsics;
    CameraData {
        name: &camera.name,
        role,
        label: None,
        remark: None,
        position: camera.pose.position - origin,
        axes: [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| camera.pose.rotation * axis),
        size: [intrinsics.width, intrinsics.height],
        focal: intrinsics.focal,
        principal: intrinsics.principal,
    }
}

fn point_data(points: &[SurfacePoint], origin: DVec3) -> PointData {
    PointData {
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

fn triangle_data(triangles: &Triangles, points: &[SurfacePoint], origin: DVec3) -> Option<TriangleData> {
    let (corners, sources) = split(triangles.corners, points.len());
    let (low, high) = bounds(corners.iter().flatten().copied())?;
    let step = ((high - low) / f64::from(u16::MAX)).max(DVec3::splat(f64::MIN_POSITIVE));
    let quantised = corners.iter().flatten().flat_map(|p| ((p - low) / step).round().to_array());
    let colours = if triangles.colours.is_empty() {
        String::new()
    } else {
        pack(sources.iter().map(|s| triangles.colours[*s]), |c| c)
    };
    Some(TriangleData {
        count: corners.len(),
        low: low - origin,
        step,
        // A cast from NaN or beyond the range saturates, so that no corner can panic.
        positions: pack(quantised.map(|v| v as u16), u16::to_le_bytes),
        colours,
        nearest: pack(nearest(points, &corners), u16::to_le_bytes),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_falls_in_a_step_of_the_histogram() {
        let gap = histogram([0.0, 12.0, 29.9, 90.0].into_iter(), |s| s);
        assert_eq!(gap.step, 5.0);
        assert_eq!(gap.counts.iter().sum::<usize>(), 4);
        assert_eq!((gap.counts[0], gap.counts[2], gap.counts[5], gap.counts[18]), (1, 1, 1, 1));
        let views = histogram([0.0, 1.0, 1.0, 7.0].into_iter(), |s| s.ceil().max(1.0));
        assert_eq!((views.step, views.counts), (1.0, vec![1, 2, 0, 0, 0, 0, 0, 1]));
        assert_eq!(histogram(std::iter::empty(), |s| s).counts, [0]);
    }

    #[test]
    fn thinning_keeps_the_order_and_the_last_item() {
        assert_eq!(thin(&[1, 2, 3, 4, 5, 6, 7], 3).collect::<Vec<_>>(), [1, 4, 7]);
        assert_eq!(thin(&[1, 2], 3).collect::<Vec<_>>(), [1, 2]);
        assert_eq!(thin::<u8>(&[], 3).count(), 0);
    }
}

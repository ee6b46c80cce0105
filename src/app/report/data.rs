//! The numbers the page draws from, as JSON. Lengths are in world units from `origin`, angles in degrees; what is not
//! finite becomes `null`.

use glam::DVec3;
use serde::Serialize;

use super::geometry::{bounds, robust_bounds};
use super::scene_data::{
    CameraData, CloudData, Layout, MAX_POINTS, PointData, RegionData, Role, SceneData, TriangleData, Words, thin,
    walls, zones,
};
use super::{Kind, ReportScene, SurfacePoint, choice};
use crate::planner::plan::record::PlanRecord;

/// Iterations embedded at most; a plot is some 500 pixels wide.
const MAX_ITERATIONS: usize = 1000;

/// What the page of a plan or a selection draws.
#[derive(Serialize)]
pub struct Data<'a> {
    history: History,
    checkpoints: Checkpoints,
    histograms: Histograms,
    #[serde(flatten)]
    scene: SceneData<'a>,
}

#[derive(Serialize)]
struct History {
    iteration: Vec<u32>,
    loss: Vec<f32>,
    image: Vec<f32>,
    reg: Vec<f32>,
    bound: Vec<f32>,
    scale: Vec<Option<f32>>,
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

/// What the page of a plan or a selection draws.
pub fn data<'r>(record: &'r PlanRecord, scene: &ReportScene, kind: Kind<'r>) -> Data<'r> {
    let region = &record.region;
    let origin = region.bounding_sphere().0;
    let bulk = robust_bounds(scene.points)
        .or_else(|| bounds(scene.triangles?.corners.iter().flatten().copied()))
        .unwrap_or((record.surface.min, record.surface.max));
    let points: Vec<SurfacePoint> = thin(scene.points, MAX_POINTS).filter(|p| p.position.is_finite()).collect();
    Data {
        history: history(record),
        checkpoints: checkpoints(record),
        histograms: histograms(scene.points),
        scene: SceneData {
            words: match kind {
                Kind::Plan => Words { own: "planned camera", other: "kept camera", suggested: "" },
                Kind::Selection(_) => {
                    Words { own: "chosen photo", other: "photo left out", suggested: "suggested photo" }
                }
            },
            origin,
            up: region.up,
            region: Some(RegionData::new(region, origin)),
            bulk: [bulk.0 - origin, bulk.1 - origin],
            layouts: vec![Layout { name: "", cameras: cameras(record, kind, origin) }],
            tour: record.tour.iter().flat_map(|tour| &tour.path).map(|corner| *corner - origin).collect(),
            triangles: scene.triangles.and_then(|triangles| TriangleData::new(&triangles, &points, origin)),
            cloud: scene.cloud.and_then(|cloud| CloudData::new(&cloud, &points, origin)),
            walls: walls(&record.limits, origin),
            zones: zones(&record.limits, origin),
            points: PointData::new(&points, origin),
        },
    }
}

fn history(record: &PlanRecord) -> History {
    let rows: Vec<_> = thin(&record.history, MAX_ITERATIONS).collect();
    let column = |get: fn(&crate::planner::plan::record::IterationRecord) -> f32| rows.iter().map(get).collect();
    History {
        iteration: rows.iter().map(|r| r.iteration).collect(),
        loss: column(|r| r.loss),
        image: column(|r| r.image),
        reg: column(|r| r.reg),
        bound: column(|r| r.bound),
        scale: rows.iter().map(|r| r.scale).collect(),
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
    let mut cameras: Vec<_> =
        record.cameras.iter().enumerate().map(|(i, one)| CameraData::new(one, origin, role(i))).collect();
    if let Kind::Selection(choice) = kind {
        for (camera, photo) in cameras.iter_mut().zip(choice.photos) {
            camera.remark = Some(photo.remark());
        }
        cameras.extend(choice.suggested.iter().map(|suggested| {
            let mut camera = CameraData::new(&suggested.camera, origin, Role::Suggested);
            camera.label = Some(choice::gain(suggested));
            camera.remark = Some(format!("it would add {} by itself", choice::gain(suggested)));
            camera
        }));
    }
    cameras
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
}

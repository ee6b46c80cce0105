//! Held-out metrics on the device (`score_point.comp`) and their twin: hard gate, exact occlusion, points that no
//! optimiser has used.

use std::sync::{Arc, Mutex};

use glam::{DVec3, Vec3};

use super::{Metrics, PointMetrics};
use crate::Result;
use crate::engine::parallel::lock;
use crate::engine::vulkan::pace::{Pace, in_parts};
use crate::engine::vulkan::{Buffer, Context, Pipeline};
use crate::scene::camera::Camera;
use crate::scene::octahedral;
use crate::scene::proxy::SurfacePoint;
use crate::visibility::bvh::{Node, TraversalConstants};
use crate::visibility::device_scene::{DeviceScene, SceneGeometry};
use crate::visibility::probe_depth::{Probe, ProbeMaps};
use crate::visibility::raycast::Ray;

crate::gpu_struct! {
    /// Push constants of `score_point`.
    pub(crate) struct ScorePush {
        /// Point of the first workgroup.
        pub first: u32,
        /// Cameras that are scored.
        pub views: u32,
        /// Texels along a side.
        pub resolution: u32,
        /// 1: the rectangular image, 0: the cone inscribed in it.
        pub frustum: u32,
    }
}

crate::gpu_struct! {
    /// A camera: position and image axes, the latter over the tangents of the half fields of view.
    pub struct View {
        /// Position in the planner's frame.
        pub position: [f32; 3],
        /// Focal length in pixels.
        pub focal: f32,
        /// Unit viewing direction.
        pub forward: [f32; 3],
        /// Cosine of half the inscribed cone.
        pub cone_cos: f32,
        /// The image's x axis.
        pub right: [f32; 3],
        /// Unused.
        pub spare0: f32,
        /// The image's y axis.
        pub down: [f32; 3],
        /// Unused.
        pub spare1: f32,
    }
}

crate::gpu_struct! {
    /// What a point gets, in the planner's lengths.
    pub(crate) struct Score {
        /// Cameras that see it.
        pub views: u32,
        /// Solid angle of its reachable directions.
        pub reachable: f32,
        /// Mean angle from those to the nearest view.
        pub gap: f32,
        /// Mean Voronoi cell area.
        pub voronoi_mean: f32,
        /// Deviation of the cell areas.
        pub voronoi_deviation: f32,
        /// Widest angle between two views.
        pub triangulation: f32,
        /// Smallest distance over focal length.
        pub sampling_distance: f32,
        /// Unused.
        pub spare0: f32,
    }
}

crate::stage!(
    /// A workgroup per held-out point.
    pub(crate) ScorePointStage = score_point<TraversalConstants>(ScorePush) {
        read nodes, read primitives, read probes, read depth, read cameras, write rays, write cells, write scores,
    } with [Node, Probe, View, Score]
);

/// Texels along a side of the maps that the gap is averaged over: 7.5 degrees wide.
pub const RESOLUTION: u32 = 24;
/// Bytes of the list of directions; larger camera sets take the points in several dispatches.
const RAYS_BYTES: u64 = 64 << 20;
/// Pairs of point and camera of the first submission.
const FIRST_PAIRS: u32 = 1 << 13;

/// Bytes of device memory that scoring so many cameras on so many points takes.
pub fn footprint(points: u64, cameras: u64) -> u64 {
    let rays = RAYS_BYTES.min(16 * points * cameras).max(16 * cameras);
    let maps = 4 * points * (RESOLUTION * RESOLUTION) as u64;
    maps + rays + rays / 4 + size_of::<View>() as u64 * cameras + size_of::<Score>() as u64 * points
}

/// How a camera's field of view is tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// The cone inscribed in the image.
    Cone,
    /// The image itself.
    Frustum,
}

/// Held-out points, ready to score camera sets.
pub struct Scorer<'a> {
    context: Arc<Context>,
    scene: &'a DeviceScene,
    maps: ProbeMaps,
    pipeline: Pipeline,
    // Of pairs of point and camera.
    pace: Mutex<Pace>,
}

impl<'a> Scorer<'a> {
    /// Prepares to score on `points`, given in the user's world.
    ///
    /// # Errors
    /// Where device memory runs out or the device fails.
    pub fn new(context: &Arc<Context>, scene: &'a DeviceScene, points: &[SurfacePoint]) -> Result<Self> {
        Ok(Self {
            context: context.clone(),
            scene,
            maps: ProbeMaps::new(context, scene, points, RESOLUTION)?,
            pipeline: Pipeline::new::<ScorePointStage>(context, &scene.constants())?,
            pace: Mutex::new(Pace::new(context, FIRST_PAIRS)),
        })
    }

    /// The points as probes, and what each of them sees.
    pub fn maps(&self) -> &ProbeMaps {
        &self.maps
    }

    /// Scores cameras, given in the user's world; one result per point.
    ///
    /// # Errors
    /// Where device memory runs out or the device fails.
    pub fn score(&self, cameras: &[Camera], field: Field) -> Result<Vec<PointMetrics>> {
        let views: Vec<View> = cameras.iter().map(|camera| view(&self.scene.geometry, camera)).collect();
        let points = self.maps.probes.len();
        let rows = ((RAYS_BYTES / (16 * views.len().max(1) as u64)) as usize).clamp(1, points.max(1));
        let rows = rows.min(self.context.physical().groups[0] as usize);
        let camera_buffer = Buffer::from_slice(&self.context, "cameras", &views)?;
        let rays = Buffer::device(&self.context, "rays", (16 * rows * views.len()) as u64)?;
        let cells = Buffer::device(&self.context, "cells", (4 * rows * views.len()) as u64)?;
        let scores = Buffer::device(&self.context, "scores", (size_of::<Score>() * points) as u64)?;
        in_parts(&self.context, &mut lock(&self.pace), [points as u32, views.len() as u32], |commands, part| {
            let (scene, maps) = (self.scene, &self.maps);
            for first in part.clone().step_by(rows) {
                commands
                    .stage(
                        &self.pipeline,
                        ScorePointStage {
                            nodes: &scene.nodes,
                            primitives: &scene.primitives,
                            probes: &maps.probe_buffer,
                            depth: &maps.depth,
                            cameras: &camera_buffer,
                            rays: &rays,
                            cells: &cells,
                            scores: &scores,
                        },
                    )
                    .push(&ScorePush {
                        first,
                        views: views.len() as u32,
                        resolution: maps.resolution,
                        frustum: (field == Field::Frustum) as u32,
                    })
                    .groups([(rows as u32).min(part.end - first), 1, 1]);
            }
            Ok(())
        })?;
        let world = 1.0 / self.scene.geometry.to_internal.scale as f32;
        let scores: Vec<Score> = scores.download(points)?;
        Ok(scores
            .into_iter()
            .map(|s| PointMetrics {
                views: s.views,
                reachable: s.reachable,
                gap: s.gap,
                voronoi_mean: s.voronoi_mean,
                voronoi_deviation: s.voronoi_deviation,
                triangulation: s.triangulation,
                sampling_distance: s.sampling_distance * world,
            })
            .collect())
    }
}

/// A camera, given in the user's world, as the device has it.
pub fn view(geometry: &SceneGeometry, camera: &Camera) -> View {
    let pose = geometry.to_internal.pose(&camera.pose);
    let rotation = pose.rotation;
    let intrinsics = &camera.intrinsics;
    let [fov_x, fov_y] = intrinsics.fov();
    let axis = |axis: DVec3, fov: f64| (rotation * axis / (0.5 * fov).tan()).as_vec3().to_array();
    View {
        position: pose.position.as_vec3().to_array(),
        focal: (0.5 * (intrinsics.focal[0] + intrinsics.focal[1])) as f32,
        forward: pose.forward().as_vec3().to_array(),
        cone_cos: (0.5 * intrinsics.inscribed_cone()).cos() as f32,
        right: axis(DVec3::X, fov_x),
        down: axis(DVec3::Y, fov_y),
        ..View::default()
    }
}

/// What a point gets from a set of cameras, given in the user's world: the twin of `score_point`, in f64 but for the rays.
/// `position` is the point, lifted, in the planner's frame and `depth` the signed depths of its map, row by row.
pub fn score_point(
    geometry: &SceneGeometry,
    probe: &Probe,
    depth: &[f32],
    cameras: &[Camera],
    field: Field,
) -> PointMetrics {
    let position = Vec3::from(probe.position);
    let mut finest = f64::INFINITY;
    let mut rays: Vec<DVec3> = Vec::new();
    for camera in cameras {
        let view = view(geometry, camera);
        let ray = (Vec3::from(view.position) - position).as_dvec3();
        let distance = ray.length().max(1e-6);
        let direction = ray / distance;
        let along = |axis: [f32; 3]| -direction.dot(Vec3::from(axis).as_dvec3());
        let forward = along(view.forward);
        let inside = match field {
            Field::Cone => forward >= f64::from(view.cone_cos),
            Field::Frustum => forward > 0.0 && along(view.right).abs() <= forward && along(view.down).abs() <= forward,
        };
        let segment = Ray { origin: position, direction: direction.as_vec3(), t_min: 0.0, t_max: distance as f32 };
        if inside && probe.faces(segment.direction) && !geometry.bvh.any_hit(&segment) {
            rays.push(direction);
            finest = finest.min(distance / f64::from(view.focal));
        }
    }
    let directions = octahedral::directions(depth.len().isqrt() as u32);
    let reachable =
        directions.into_iter().zip(depth).filter(|(_, depth)| **depth > 0.0).map(|(direction, _)| direction);
    of_rays(&rays, finest / geometry.to_internal.scale, reachable, depth.len())
}

/// What a point gets from views in the unit directions `rays`, the finest of which resolves `finest` world units a pixel;
/// `reachable` are the directions that count, of `texels` that share the sphere evenly.
pub(crate) fn of_rays(
    rays: &[DVec3],
    finest: f64,
    reachable: impl Iterator<Item = DVec3>,
    texels: usize,
) -> PointMetrics {
    let angle = |chord: f64| 2.0 * (0.5 * chord.sqrt()).min(1.0).asin();
    let (mut counted, mut gap, mut cells) = (0.0, 0.0, vec![0.0f64; rays.len()]);
    for direction in reachable {
        let chords = rays.iter().map(|ray| ray.distance_squared(direction)).enumerate();
        let nearest = chords.min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((view, _)) = nearest {
            cells[view] += 1.0;
        }
        counted += 1.0;
        gap += nearest.map_or(std::f64::consts::PI, |(_, chord)| angle(chord));
    }
    let area = 4.0 * std::f64::consts::PI / texels as f64;
    let views = rays.len() as f64;
    let mean = if rays.is_empty() { 0.0 } else { counted * area / views };
    let variance = cells.iter().map(|cell| (cell * area - mean).powi(2)).sum::<f64>() / views.max(1.0);
    let pairs = rays.iter().take(1024).enumerate().flat_map(|(k, a)| rays[..k].iter().map(move |b| (*a, *b)));
    PointMetrics {
        views: rays.len() as u32,
        reachable: (counted * area) as f32,
        gap: if counted > 0.0 { (gap / counted) as f32 } else { 0.0 },
        voronoi_mean: mean as f32,
        voronoi_deviation: variance.sqrt() as f32,
        triangulation: angle(pairs.map(|(a, b)| a.distance_squared(b)).fold(0.0, f64::max)) as f32,
        sampling_distance: if rays.is_empty() { 0.0 } else { finest as f32 },
    }
}

/// Metrics over points (docs/reference/method.md, Metrics). Points that no feasible position sees count in the coverage alone.
pub fn aggregate(points: &[PointMetrics]) -> Metrics {
    let all = points.len().max(1) as f64;
    // A view may see a point between the directions that reachability is sampled at.
    let reachable: Vec<&PointMetrics> =
        points.iter().filter(|point| point.reachable > 0.0 || point.views > 0).collect();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let of = |keep: &dyn Fn(&PointMetrics) -> bool, value: &dyn Fn(&PointMetrics) -> f32| -> Vec<f64> {
        reachable.iter().filter(|point| keep(point)).map(|point| value(point) as f64).collect()
    };
    let every = |_: &PointMetrics| true;
    let seen = |point: &PointMetrics| point.views > 0;
    let views = of(&every, &|point| point.views as f32);
    let views_mean = mean(&views);
    let variance = mean(&views.iter().map(|v| (v - views_mean).powi(2)).collect::<Vec<_>>());
    let mut gaps = of(&|point: &PointMetrics| point.reachable > 0.0, &|point| point.gap.to_degrees());
    gaps.sort_unstable_by(f64::total_cmp);
    let at_least = |n| points.iter().filter(|point| point.views >= n).count() as f64 / all;
    Metrics {
        points: points.len(),
        reachable: reachable.len() as f64 / all,
        coverage_1: at_least(1),
        coverage_3: at_least(3),
        views_mean,
        views_variation: if views_mean > 0.0 { variance.sqrt() / views_mean } else { 0.0 },
        gap_mean_deg: mean(&gaps),
        gap_p95_deg: gaps.get((0.95 * gaps.len() as f64) as usize).copied().unwrap_or(0.0),
        voronoi_mean: mean(&of(&seen, &|point| point.voronoi_mean)),
        voronoi_deviation: mean(&of(&seen, &|point| point.voronoi_deviation)),
        triangulation_mean_deg: mean(&of(&|point| point.views > 1, &|point| point.triangulation.to_degrees())),
        sampling_distance_mean: mean(&of(&seen, &|point| point.sampling_distance)),
    }
}

//! The table of docs/directional.md: what scores are worth that say along which directions radiance varies.
//!
//! ```text
//! cargo run --release --example directional [-- --seeds N --views N --input N]
//! ```
//!
//! Everything is known here: points on the demo's object reflect four lights with lobes about the mirror directions, wide on
//! one side of the object and narrow on the other, and half of it is matt. A few input views give variances and lobes, as
//! photos would; plans are made with them, and are judged by how well the radiance of other points, in every direction
//! from which cameras could stand, is interpolated from the views that see them.

use std::ops::ControlFlow;
use std::sync::Arc;

use camsplat::Result;
use camsplat::metrics::score_point::{Field, Scorer, aggregate};
use camsplat::plan::config::{Config, Objective, Preset};
use camsplat::plan::planner::Planner;
use camsplat::plan::preparation::Preparation;
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::proxy::{Orientation, Proxy, SurfacePoint};
use camsplat::scene::region::Region;
use camsplat::scene::surface::{Points, Surface};
use camsplat::scene::{baselines, octahedral, samples};
use camsplat::vds::vdsf::Vdsf;
use camsplat::vds::{self, lobes, variance};
use camsplat::visibility::device_scene::{DeviceScene, SceneGeometry};
use camsplat::visibility::raycast::Ray;
use camsplat::vulkan::{Context, Options};
use clap::Parser;
use glam::DVec3;

#[derive(Parser)]
struct Arguments {
    /// Seeds of each entry
    #[arg(long, default_value_t = 5)]
    seeds: u64,
    /// Cameras planned
    #[arg(long, default_value_t = 50)]
    views: u32,
    /// Views that variances and lobes are estimated from
    #[arg(long, default_value_t = 30)]
    input: usize,
    #[arg(long)]
    device: Option<String>,
}

/// Directions to the lights; the last is behind the object as seen from the others.
const LIGHTS: [DVec3; 4] =
    [DVec3::new(0.6, 0.3, 0.74), DVec3::new(-0.5, 0.7, 0.5), DVec3::new(0.1, -0.8, 0.6), DVec3::new(-0.9, -0.3, 0.3)];

/// Matt where y < 0; elsewhere lobes that narrow from left to right.
fn radiance(point: &SurfacePoint, w: DVec3) -> f64 {
    let gloss = if point.position.y < 0.0 { 0.0 } else { 0.6 };
    let sharpness = if point.position.x < 0.0 { 6.0 } else { 40.0 };
    let mut sum = 0.08;
    for light in LIGHTS {
        let light = light.normalize();
        let cos = point.normal.dot(light);
        if cos > 0.0 {
            let mirrored = 2.0 * cos * point.normal - light;
            sum += 0.15 * cos + gloss * (sharpness * (w.dot(mirrored) - 1.0)).exp();
        }
    }
    sum.min(1.0)
}

/// A surface on the device.
struct Scene {
    proxy: Proxy,
    device: DeviceScene,
}

impl Scene {
    fn new(context: &Arc<Context>, surface: &Surface, region: Option<Region>) -> Result<Self> {
        let proxy = Proxy::new(surface, Orientation::Trusted)?;
        let around = || Region::around_object(proxy.sphere, 0.5 * intrinsics().inscribed_cone(), DVec3::Z, None);
        let region = region.map_or_else(around, Ok)?;
        Ok(Self { device: DeviceScene::new(context, SceneGeometry::new(&proxy, &region)?)?, proxy })
    }

    /// Unit directions from a point to the cameras that see it.
    fn seen(&self, point: &SurfacePoint, cameras: &[Camera]) -> Vec<DVec3> {
        let geometry = &self.device.geometry;
        let lifted = point.position + point.lift * point.normal;
        let sees = |camera: &Camera| {
            let ray = camera.pose.position - lifted;
            let cone = (0.5 * camera.intrinsics.inscribed_cone()).cos();
            if -ray.normalize().dot(camera.pose.forward()) < cone || ray.dot(point.normal) <= 0.0 {
                return None;
            }
            let (from, to) = (geometry.to_internal.point(lifted), geometry.to_internal.point(camera.pose.position));
            let segment = Ray {
                origin: from.as_vec3(),
                direction: (to - from).normalize().as_vec3(),
                t_min: 0.0,
                t_max: (to - from).length() as f32,
            };
            (!geometry.bvh.any_hit(&segment)).then(|| ray.normalize())
        };
        cameras.iter().filter_map(sees).collect()
    }
}

fn intrinsics() -> Intrinsics {
    Intrinsics::from_fov(800, 800, 50f64.to_radians())
}

fn cameras(poses: &[Pose]) -> Vec<Camera> {
    let camera = |(i, pose): (usize, &Pose)| Camera { name: format!("{i}"), pose: *pose, intrinsics: intrinsics() };
    poses.iter().enumerate().map(camera).collect()
}

/// The object as points with the scores and lobes that the input views tell of.
fn photographed(mesh: &Scene, input: usize, seed: u64) -> Result<Points> {
    let geometry = &mesh.device.geometry;
    let back = geometry.to_internal.inverse();
    let taken = baselines::fibonacci_shell(&geometry.region, input)?;
    let taken = cameras(&taken.iter().map(|pose| back.pose(pose)).collect::<Vec<_>>());
    let mut points = Points { oriented: true, ..Points::default() };
    let mut variances = Vec::new();
    for point in mesh.proxy.sample(6000, seed, 2) {
        let toward = mesh.seen(&point, &taken);
        let intensities: Vec<f64> = toward.iter().map(|w| radiance(&point, *w)).collect();
        let estimate = variance::variance(&intensities, &toward);
        variances.push(estimate.map(|(variance, _)| variance));
        points.lobes.push(estimate.map(|(_, mean)| lobes::lobe(&intensities, &toward, mean)).unwrap_or_default());
        points.positions.push(point.position);
        points.normals.push(point.normal);
    }
    points.scores = vds::scores(&variances, |v| Vdsf::embedded().apply(v)).0;
    Ok(points)
}

/// Mean angular gap in degrees, and the root of the mean squared error of radiance on the glossy and on the matt half.
fn judge(context: &Arc<Context>, mesh: &Scene, poses: &[Pose], seed: u64) -> Result<[f64; 4]> {
    let held_out = mesh.proxy.sample(1000, 1000 + seed, 1);
    let scorer = Scorer::new(context, &mesh.device, &held_out)?;
    let depth = scorer.maps().download()?;
    let resolution = scorer.maps().resolution;
    let gap = aggregate(&scorer.score(&cameras(poses), Field::Cone)?).gap_mean_deg;
    let back = mesh.device.geometry.to_internal.inverse();
    let directions: Vec<DVec3> = octahedral::directions(resolution).iter().map(|w| back.direction(*w)).collect();
    let all = cameras(poses);
    // Squared errors and their number: glossy and wide, glossy and narrow, matt.
    let mut errors = [(0.0, 0.0); 3];
    for (point, depth) in held_out.iter().zip(depth.chunks(directions.len())) {
        let seen = mesh.seen(point, &all);
        let values: Vec<f64> = seen.iter().map(|w| radiance(point, *w)).collect();
        let half = if point.position.y < 0.0 { 2 } else { usize::from(point.position.x >= 0.0) };
        for (w, _) in directions.iter().zip(depth).filter(|(_, depth)| **depth > 0.0) {
            // The three nearest views, weighted by how near they are.
            let mut near: Vec<(f64, f64)> = seen.iter().zip(&values).map(|(v, l)| (v.dot(*w), *l)).collect();
            near.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
            let weigh = |cos: f64| 1.0 / (1.0 - cos + 1e-3);
            let (sum, weight) =
                near.iter().take(3).fold((0.0, 0.0), |(s, n), (c, l)| (s + weigh(*c) * l, n + weigh(*c)));
            let guess = if weight > 0.0 { sum / weight } else { 0.0 };
            errors[half].0 += (guess - radiance(point, *w)).powi(2);
            errors[half].1 += 1.0;
        }
    }
    let [wide, narrow, matt] = errors.map(|(sum, count)| (sum / f64::max(count, 1.0)).sqrt());
    Ok([gap, wide, narrow, matt])
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    let context = Context::new(&Options { device: arguments.device, ..Options::default() })?;
    let mesh = Scene::new(&context, &samples::object(), None)?;
    let region = Region::around_object(mesh.proxy.sphere, 0.5 * intrinsics().inscribed_cone(), DVec3::Z, None)?;
    println!(
        "| {} views, {} input views | gap | RMS error, wide lobes | narrow lobes | matt |",
        arguments.views, arguments.input
    );
    println!("|---|---|---|---|---|");
    for (name, vds, directional) in
        [("no scores", false, false), ("scores", true, false), ("scores with directions", true, true)]
    {
        let mut all = [const { Vec::new() }; 4];
        for seed in 0..arguments.seeds {
            let points = photographed(&mesh, arguments.input, seed)?;
            let scene = Scene::new(&context, &Surface::Points(points), Some(region))?;
            let config =
                Config { seed, vds, directional, ..Config::of(Objective::Splat, Preset::Object, arguments.views) };
            let geometry = &scene.device.geometry;
            let preparation = Preparation::new(&context, geometry, &scene.proxy, &intrinsics(), &[], config)?;
            let planner = Planner::new(&context, &scene.device, preparation)?;
            let outcome = planner.run(None, |_| ControlFlow::Continue(()))?;
            for (column, value) in all.iter_mut().zip(judge(&context, &mesh, &outcome.poses, seed)?) {
                column.push(value);
            }
        }
        let entry = |values: &Vec<f64>, digits: usize| {
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            let deviation = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0)).sqrt();
            format!("{mean:.digits$} ± {deviation:.digits$}")
        };
        let [gap, wide, narrow, matt] = &all;
        println!("| {name} | {} | {} | {} | {} |", entry(gap, 2), entry(wide, 4), entry(narrow, 4), entry(matt, 4));
    }
    Ok(())
}

//! Time of the choice by the methods that a plan is compared with: farthest view sampling, ACP, FisherRF, COVER and manifold
//! sampling.
//!
//! On a CPU device FisherRF and COVER render smaller pictures of fewer splats, and manifold sampling takes 20 steps per camera
//! instead of 401. Wall time of one run, candidates drawn before.

use camsplat::baselines::job;
use camsplat::baselines::request::Request;
use camsplat::methods::Method;
use camsplat::plan::config::{Config, Preset};
use camsplat::plan::target::{RegionChoice, Target};
use camsplat::scene::camera::Intrinsics;
use camsplat::scene::gaussians::Gaussians;
use camsplat::scene::random;
use camsplat::scene::samples;
use camsplat::select::information::Model;
use camsplat::vulkan::{Context, Options};
use camsplat::{Error, Result};
use glam::DVec3;

fn main() -> Result<()> {
    let device = std::env::var("CAMSPLAT_DEVICE").ok();
    let context = Context::new(&Options { device, ..Options::default() })?;
    let physical = context.physical();
    println!("{}, {}", physical.name, physical.driver.trim());
    let small = physical.kind == "CPU";
    let (side, splats, candidates) = if small { (160, 5000, 60) } else { (800, 200_000, 300) };
    let (object, room) = ((samples::object(), Preset::Object), (samples::room(), Preset::Room));
    let rows = [
        (Method::Fvs, 100, None, &object),
        (Method::FvsChord, 100, None, &object),
        (Method::Acp, 300, None, &room),
        (Method::Fisher, 20, Some(candidates), &object),
        (Method::Cover, 20, Some(candidates), &object),
        (Method::Manifold, 20, None, &object),
    ];
    let mut report = Vec::new();
    for (method, views, candidates, (surface, preset)) in rows {
        let intrinsics = Intrinsics::from_fov(side, side, 40f64.to_radians());
        let target = Target::new(surface, "sample", *preset, &RegionChoice::default(), DVec3::Z, &intrinsics)?;
        let model = method.needs_model().then(|| model(&target, splats));
        let mut request = Request::new(method, candidates, &Config { held_out: 100, ..Config::new(*preset, views) })?;
        if let (Some(manifold), true) = (&mut request.manifold, small) {
            manifold.steps = 20;
        }
        let plan = job::run(&context, &target, intrinsics, &[], &request, model.as_ref())?;
        let (name, of) = (method.name(), request.candidates.unwrap_or_default());
        println!("{name}: {views} of {of} in {:.4} s", plan.record.seconds);
        report.push(serde_json::json!({
            "name": name, "views": views, "candidates": of, "seconds": plan.record.seconds,
        }));
    }
    let path = std::env::var("CAMSPLAT_BENCH_OUT").unwrap_or_else(|_| "target/bench/baselines.json".into());
    let folder = std::path::Path::new(&path).parent().unwrap_or(std::path::Path::new("."));
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    let report = serde_json::json!({ "device": physical.name, "driver": physical.driver, "rows": report });
    std::fs::write(&path, format!("{report:#}\n")).map_err(|e| Error::io(&path, e))
}

/// Splats on the surface, with harmonics of degree 1.
fn model(target: &Target, count: usize) -> Model {
    let points = target.proxy.sample(count, 1, 9);
    let size = (target.proxy.sphere.1 * (12.0 / count as f64).sqrt()).ln() as f32;
    let harmonic = |i: usize, k: u32| random::uniforms(4, k, i as u32)[0] as f32 - 0.5;
    let gaussians = Gaussians {
        centres: points.iter().map(|point| point.position).collect(),
        log_scales: vec![[size - 1.0; 3]; points.len()],
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; points.len()],
        opacities: vec![1.0; points.len()],
        degree: 1,
        harmonics: (0..points.len()).flat_map(|i| (0..12).map(move |k| harmonic(i, k))).collect(),
    };
    Model { path: "sample".into(), gaussians, antialiased: false }
}

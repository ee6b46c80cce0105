//! Time of the choice by the methods that a plan is compared with: farthest view sampling, ACP, FisherRF, COVER and manifold
//! sampling.
//!
//! On a CPU device FisherRF and COVER render smaller pictures of fewer splats, and manifold sampling takes 20 steps per camera
//! instead of 401. Wall time of one run, candidates drawn before.

mod report;

use std::process::ExitCode;
use std::sync::Arc;

use camsplat::Result;
use camsplat::engine::vulkan::Context;
use camsplat::lab::baselines::placing;
use camsplat::lab::baselines::request::BaselineRequest;
use camsplat::planner::methods::Method;
use camsplat::planner::plan::config::{Config, Preset};
use camsplat::planner::plan::problem::Problem;
use camsplat::planner::plan::target::{RegionChoice, Target};
use camsplat::planner::select::information::Model;
use camsplat::scene::camera::Intrinsics;
use camsplat::scene::gaussians::Gaussians;
use camsplat::scene::random;
use camsplat::scene::samples;
use glam::DVec3;
use report::Report;

fn main() -> ExitCode {
    report::run("baselines", rows)
}

fn rows(context: Arc<Context>, report: &mut Report) -> Result<()> {
    let small = context.physical().is_cpu();
    let (side, splats, candidates) = if small { (160, 5000, 60) } else { (800, 200_000, 300) };
    let (object, room) = ((samples::object(), Preset::Object), (samples::room(), Preset::Room));
    let choices = [
        (Method::Fvs, 100, None, &object),
        (Method::FvsChord, 100, None, &object),
        (Method::Acp, 300, None, &room),
        (Method::Fisher, 20, Some(candidates), &object),
        (Method::Cover, 20, Some(candidates), &object),
        (Method::Manifold, 20, None, &object),
    ];
    for (method, views, candidates, (surface, preset)) in choices {
        let name = method.name();
        if !report.wants(name, views.into()) {
            continue;
        }
        let intrinsics = Intrinsics::from_fov(side, side, 40f64.to_radians());
        let target = Target::new(surface, "sample", *preset, &RegionChoice::default(), DVec3::Z, &intrinsics)?;
        let model = method.needs_model().then(|| model(&target, splats));
        let mut request =
            BaselineRequest::new(method, candidates, &Config { held_out: 100, ..Config::new(*preset, views) })?;
        if let (Some(manifold), true) = (&mut request.manifold, small) {
            manifold.steps = 20;
        }
        let plan = placing::run(&context, &Problem::new(&target, intrinsics, &[])?, &request, model.as_ref())?;
        report.wall(name, views.into(), plan.record.seconds);
        report.facts(serde_json::json!({ "name": name, "count": views, "candidates": request.candidates }));
    }
    Ok(())
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
        antialiased: false,
    };
    Model { path: "sample".into(), gaussians, antialiased: false }
}

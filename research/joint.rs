//! What joint descent is worth by the law: against the greedy choice by the same law, and from where that ends.
//!
//! ```text
//! cargo run --release --example joint -- SURFACE X0,Y0,Z0,X1,Y1,Z1|object VIEWS,... SEEDS [LOW,HIGH]
//! ```
//!
//! For each number of views and seed, decibels of expected quality over the best simple layout, by viewers that none of them saw (between
//! two heights where these are given): of the greedy choice among 2,000 random poses, of the descent from that layout, and of the descent
//! from the greedy choice; and the seconds of the first two.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use camsplat::engine::vulkan::{Context, ContextOptions};
use camsplat::files::io::read_surface;
use camsplat::lab::baselines::placing;
use camsplat::lab::baselines::request::BaselineRequest;
use camsplat::planner::methods::Method;
use camsplat::planner::plan::config::{Config, Preset};
use camsplat::planner::plan::pipeline::optimise;
use camsplat::planner::plan::preparation::Preparation;
use camsplat::planner::plan::problem::Problem;
use camsplat::planner::plan::reference::Reference;
use camsplat::planner::plan::target::{RegionChoice, Target};
use camsplat::planner::quality::viewers::Viewers;
use camsplat::scene::camera::{Intrinsics, Pose};
use camsplat::scene::region::Shape;
use glam::DVec3;

/// So many numbers with commas between them.
fn numbers(text: &str) -> Result<Vec<f64>, std::num::ParseFloatError> {
    text.split(',').map(str::parse).collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [surface, shape, views, seeds, heights @ ..] = &arguments[..] else {
        return Err("give SURFACE BOX|object VIEWS SEEDS [LOW,HIGH]".into());
    };
    let (preset, shape) = match &numbers(shape).unwrap_or_default()[..] {
        &[x0, y0, z0, x1, y1, z1] => {
            (Preset::Room, Some(Shape::Box { min: DVec3::new(x0, y0, z0), max: DVec3::new(x1, y1, z1) }))
        }
        [] if shape == "object" => (Preset::Object, None),
        _ => return Err(format!("{shape} is no box and not \"object\"").into()),
    };
    let viewers = match heights.first().map(|text| numbers(text)).transpose()?.as_deref() {
        Some(&[low, high]) => Viewers::Heights { low, high },
        _ => Viewers::Region,
    };
    let lens = Intrinsics::from_fov(512, 512, 50f64.to_radians());
    let choice = RegionChoice { shape, ..RegionChoice::default() };
    let target = Target::new(&read_surface(Path::new(surface))?, surface, preset, &choice, DVec3::Y, &lens)?;
    let context = Context::new(&ContextOptions::default())?;
    let problem = Problem::new(&target, lens, &[])?;
    let scene = std::sync::Arc::new(problem.on(&context)?);
    println!("views seed greedy descent from_greedy greedy_s descent_s");
    for views in numbers(views)? {
        for seed in 0..seeds.parse::<u64>()? {
            let config = Config { seed, viewers: viewers.clone(), ..Config::new(preset, views as u32) };
            let reference = Reference::new(&context, &problem, &scene, &config)?;
            let to_internal = scene.geometry.to_internal;
            let over_simple = |poses: &[Pose]| -> camsplat::Result<f64> {
                Ok(reference.best().expectation.error_db - reference.expect(poses)?.error_db)
            };
            let descended = |start: &[Pose]| -> camsplat::Result<(Vec<Pose>, f64)> {
                let preparation = Preparation::new(&context, &problem, config.clone())?.starting_from(start);
                let begun = Instant::now();
                let (_, outcome) = optimise(&context, &scene, preparation, None, |_, _| ControlFlow::Continue(()))?;
                let seconds = begun.elapsed().as_secs_f64();
                Ok((outcome.poses.iter().map(|pose| to_internal.pose(pose)).collect(), seconds))
            };
            let request = BaselineRequest::new(Method::Greedy, None, &config)?;
            let record = placing::run(&context, &problem, &request, None)?.record;
            let greedy: Vec<Pose> = record.cameras.iter().map(|camera| to_internal.pose(&camera.pose)).collect();
            let (descent, seconds) = descended(&reference.start())?;
            let (from_greedy, _) = descended(&greedy)?;
            println!(
                "{views} {seed} {:.2} {:.2} {:.2} {:.1} {seconds:.1}",
                over_simple(&greedy)?,
                over_simple(&descent)?,
                over_simple(&from_greedy)?,
                record.seconds
            );
        }
    }
    Ok(())
}

//! The tables whose mean is in docs/results/selection.md: subsets of 20 and 40 photos from each pool, ours against every baseline, over
//! seeds.
//!
//! ```text
//! CAMSPLAT_DATA=... cargo run --release --example selection -- [--seeds 5] [--counts 20,40] [POOL ...]
//! ```

use std::path::Path;

use camsplat::engine::vulkan::{Context, ContextOptions};
use camsplat::files::io;
use camsplat::planner::methods::Method;
use camsplat::planner::metrics::Metrics;
use camsplat::planner::plan::config::Preset;
use camsplat::planner::plan::target::{RegionChoice, Target};
use camsplat::planner::select::request::SelectionRequest;
use camsplat::planner::select::selection::SelectionContext;
use camsplat::scene::camera::Pose;
use camsplat::scene::region::Shape;
use camsplat::scene::surface::Surface;
use camsplat::{Error, Result};
use glam::DVec3;

const POOLS: [&str; 5] = ["gold-cape", "tankard", "fox", "beer-can", "plush"];

fn main() -> Result<()> {
    let (mut seeds, mut counts, mut pools) = (5, vec![20, 40], Vec::new());
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut number = || arguments.next().ok_or_else(|| Error::request(format!("{argument} wants a value")));
        let parsed = |text: &str| text.parse::<usize>().map_err(|e| Error::request(format!("{text}: {e}")));
        match argument.as_str() {
            "--seeds" => seeds = parsed(&number()?)? as u64,
            "--counts" => counts = number()?.split(',').map(parsed).collect::<Result<_>>()?,
            pool => pools.push(pool.to_owned()),
        }
    }
    if pools.is_empty() {
        pools = POOLS.map(str::to_owned).to_vec();
    }
    let data = std::env::var("CAMSPLAT_DATA").map_err(|_| Error::request("CAMSPLAT_DATA names no folder"))?;
    let context = Context::new(&ContextOptions::default())?;
    for pool in pools {
        let set = io::photos::read(&Path::new(&data).join("photos").join(&pool), &io::photos::ReadOptions::default())?;
        let poses: Vec<Pose> = set.photos.iter().map(|photo| photo.camera.pose).collect();
        let up = poses.iter().map(Pose::up).sum::<DVec3>().normalize();
        let choice = RegionChoice { shape: Shape::around_cameras(&poses), ..RegionChoice::default() };
        let surface = Surface::Points(set.points.clone());
        let intrinsics = &set.photos[0].camera.intrinsics;
        let target = Target::new(&surface, &pool, Preset::Object, &choice, up, intrinsics)?;
        for &count in &counts {
            let mut rows: Vec<(String, Vec<Metrics>)> = Vec::new();
            let mut note = |name: &str, metrics: Metrics| match rows.iter_mut().find(|row| row.0 == name) {
                Some(row) => row.1.push(metrics),
                None => rows.push((name.to_owned(), vec![metrics])),
            };
            let mut seconds = 0.0;
            for seed in 0..seeds {
                let request = SelectionRequest { seed, ..SelectionRequest::new(count) };
                let selection = SelectionContext::new(&context, &set, &target, request)?.select(None, true)?;
                seconds += selection.seconds.iter().sum::<f64>() / seeds as f64;
                note("all photos", selection.pool);
                note(Method::Ours.name(), selection.metrics);
                selection.baselines.iter().for_each(|baseline| note(&baseline.name, baseline.metrics));
            }
            println!("### {pool}: {count} of {} photos, {seconds:.1} s\n", set.photos.len());
            println!("| | seen >= 1, % | seen >= 3, % | gap, mean | gap, p95 |\n|---|---|---|---|---|");
            for (name, metrics) in &rows {
                let column = |get: fn(&Metrics) -> f64| spread(&metrics.iter().map(get).collect::<Vec<_>>());
                println!(
                    "| {name} | {} | {} | {} | {} |",
                    column(|m| 100.0 * m.coverage_1),
                    column(|m| 100.0 * m.coverage_3),
                    column(|m| m.gap_mean_deg),
                    column(|m| m.gap_p95_deg)
                );
            }
            println!();
        }
    }
    Ok(())
}

/// Mean and sample deviation.
fn spread(values: &[f64]) -> String {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    format!("{mean:.2} ± {:.2}", square.sqrt())
}

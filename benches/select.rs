//! Time and memory of selection: 40 of 300 and 1,000 of 20,000 poses around the sample object, no images.
//!
//! Poses lie on a Fibonacci sphere, jittered, and look in. Wall time in whole, and its parts; memory is what the matrices of
//! visibility and the swaps take, and the peak of the process. On a CPU device the large pool is left out unless a filter
//! names it: `cargo bench --bench select -- 20000`.

mod report;

use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

use camsplat::Result;
use camsplat::engine::vulkan::Context;
use camsplat::files::photos::{Photo, PhotoSet};
use camsplat::planner::methods::Method;
use camsplat::planner::plan::config::Preset;
use camsplat::planner::plan::target::{RegionChoice, Target};
use camsplat::planner::select::request::SelectionRequest;
use camsplat::planner::select::selection::SelectionContext;
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::layouts;
use camsplat::scene::lens::Distortion;
use camsplat::scene::random;
use camsplat::scene::samples;
use glam::DVec3;
use report::Report;

fn main() -> ExitCode {
    report::run("select", rows)
}

fn rows(context: Arc<Context>, report: &mut Report) -> Result<()> {
    let on_cpu = context.physical().is_cpu();
    for (count, photos, points) in [(40, 300, 4000), (1000, 20_000, 1000)] {
        let name = |method: Method| format!("select_{count}_of_{photos}_{}", method.name());
        let wanted = |method: &Method| {
            let (name, photos) = (name(*method), photos as u64);
            report.names(&name, photos) || report.wants(&name, photos) && !(on_cpu && photos > 1000)
        };
        let methods: Vec<Method> = [Method::Ours, Method::Coverage].into_iter().filter(wanted).collect();
        if methods.is_empty() {
            continue;
        }
        let intrinsics = Intrinsics::from_fov(800, 800, 40f64.to_radians());
        let target =
            Target::new(&samples::object(), "object", Preset::Object, &RegionChoice::default(), DVec3::Z, &intrinsics)?;
        let set = PhotoSet { photos: pool(&target, photos, intrinsics)?, ..PhotoSet::default() };
        for method in methods {
            let start = Instant::now();
            let request = SelectionRequest { points, method, ..SelectionRequest::new(count) };
            let selection = SelectionContext::new(&context, &set, &target, request)?.select(None, false)?;
            let wall = start.elapsed().as_secs_f64();
            let [seeing, planning, choosing] = selection.seconds;
            let mib = |bytes: f64| bytes / f64::from(1 << 20);
            let peak = peak_bytes().map(mib);
            let metrics = &selection.metrics;
            let name = name(method);
            report.wall(&name, photos as u64, wall);
            println!(
                "  visibility {seeing:.2} s, plan {planning:.2}, choice {choosing:.2}, {} swaps; gap {:.2}, seen >= 3 {:.1}%; \
                 {:.0} MiB of matrices, peak {:.0} MiB",
                selection.errors_db.len().saturating_sub(1),
                metrics.gap_mean_deg,
                100.0 * metrics.coverage_3,
                mib(selection.bytes as f64),
                peak.unwrap_or(f64::NAN),
            );
            report.facts(serde_json::json!({
                "name": name, "count": photos, "visibility_seconds": seeing, "plan_seconds": planning,
                "choice_seconds": choosing, "bytes": selection.bytes, "peak_mib": peak,
                "gap_mean_deg": metrics.gap_mean_deg, "coverage_3": metrics.coverage_3,
            }));
        }
    }
    Ok(())
}

/// Photos around a target.
fn pool(target: &Target, count: usize, intrinsics: Intrinsics) -> Result<Vec<Photo>> {
    let poses = layouts::fibonacci_shell(&target.region, count)?;
    let jittered = |(i, pose): (usize, Pose)| {
        let [u, v, w, x] = random::uniforms(1, 0, i as u32);
        let position = pose.position * (0.85 + 0.3 * u) + 0.2 * random::direction(v, w);
        let aim = 0.4 * (random::direction(x, u) * w);
        let name = format!("{i:05}.jpg");
        let camera = Camera { name, pose: Pose::looking(position, aim - position, DVec3::Z), intrinsics };
        Photo { camera, distortion: Distortion::default(), image: None, mask: None }
    };
    Ok(poses.into_iter().enumerate().map(jittered).collect())
}

/// Most memory that the process has held, where the system reports it.
fn peak_bytes() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kib| 1024.0 * kib)
}

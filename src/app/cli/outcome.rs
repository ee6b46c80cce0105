//! What the terminal shows of a plan, and of what it is for.

use crate::planner::metrics::Metrics;
use crate::planner::plan::pipeline::Plan;
use crate::planner::plan::record::SurfaceRecord;
use crate::planner::plan::target::Target;
use crate::scene::region::Shape;
use crate::scene::surface::digits;

/// Unconnected part of the free space from which on it is mentioned: insides of furniture are less.
const NOTEWORTHY: f64 = 0.2;

/// The same of what is beyond the walls of a room: surfaces are not as straight as a box.
const MARGIN: f64 = 0.02;
/// Part of the cameras around an object that see a point of it at least, in the mean. Of a room they see the outside of its walls.
const INSIDE: f64 = 0.1;

/// Prints the metrics of a plan beside those of its baselines.
pub fn print_plan(plan: &Plan) {
    let record = &plan.record;
    let how = match record.history.len() {
        0 => format!("chosen by {} in {:.4} s", record.method, record.seconds),
        iterations => format!("{iterations} iterations in {:.2} s", record.seconds),
    };
    if plan.geometry.free.unconnected > NOTEWORTHY {
        let part = 100.0 * plan.geometry.free.unconnected;
        say!("note     {part:.0}% of the free space is not connected with the rest, and no camera is placed there");
    }
    if plan.geometry.free.beyond > MARGIN {
        let part = 100.0 * plan.geometry.free.beyond;
        say!(
            "note     {part:.0}% of the free space lies beyond the walls of the room in the box, and no camera is placed there"
        );
    }
    let kept = if record.kept > 0 { format!(", {} kept", record.kept) } else { String::new() };
    say!("plan     {} views{kept}, {how}", record.cameras.len() - record.kept);
    if let Some(connection) = record.connection.as_ref().filter(|connection| connection.is_whole()) {
        say!("connect  {}", connection.line());
    }
    if let Some(tour) = &record.tour {
        say!("tour     {}", tour.line());
    }
    let mut rows = vec![("plan", &record.metrics)];
    rows.extend(record.baselines.iter().map(|baseline| (baseline.name.as_str(), &baseline.metrics)));
    say!("{}", table(&rows).trim_end());
    let around = matches!(record.region.shape, Shape::Shell { .. });
    let seeing = record.metrics.views_mean / record.cameras.len().max(1) as f64;
    if around && seeing < INSIDE {
        say!(
            "note     a point of the surface is seen by {:.0}% of the cameras only; if this is a room, give --preset room or --box",
            100.0 * seeing
        );
    }
    if let Some(expected) = &record.expected {
        say!("expected {}", expected.line());
        if let Some(reason) = &expected.reason {
            say!("         {reason}");
        }
    }
    if let Some(hidden) = record.out_of_sight() {
        say!("note     {hidden}");
    }
    for doubt in record.doubts() {
        say!("warning  {doubt}");
    }
}

/// What the columns of [`table`] mean.
const LEGEND: &str = "limit: what these or any other cameras in the region could see; gap: angle to the nearest view that sees a point, 180° where none does";

/// Metrics, a row per camera set.
pub fn table(rows: &[(&str, &Metrics)]) -> String {
    let mut text = format!(
        "{:<10} {:>8} {:>8} {:>8} {:>9} {:>9} {:>11} {:>10}\n",
        "", "seen >=1", "(limit)", "seen >=3", "gap mean", "gap p95", "views/point", "variation"
    );
    for (name, m) in rows {
        text += &format!(
            "{:<10} {:>7.1}% {:>7.1}% {:>7.1}% {:>8.2}° {:>8.2}° {:>11.1} {:>10.2}\n",
            name,
            100.0 * m.coverage_1,
            100.0 * m.reachable,
            100.0 * m.coverage_3,
            m.gap_mean_deg,
            m.gap_p95_deg,
            m.views_mean,
            m.views_variation
        );
    }
    text + LEGEND
}

/// Prints a surface and its region.
pub fn print_target(target: &Target) {
    let SurfaceRecord { path, kind, primitives, min, max, .. } = &target.record;
    let digits = digits((max - min).max_element());
    say!("surface  {path}: {primitives} {kind}, from {min:.digits$} to {max:.digits$}");
    if target.proxy.dropped + target.proxy.thinned > 0 {
        say!("         {} dropped, {} thinned out", target.proxy.dropped, target.proxy.thinned);
    }
    if target.proxy.stray > 0 {
        say!("         {} far away from all others, left aside", target.proxy.stray);
    }
    let assumed = target.proxy.assumed;
    if assumed > 0 {
        say!("         {assumed} more stand for surroundings that no point shows");
    }
    let buried = target.proxy.buried.iter().filter(|buried| **buried).count() - assumed;
    if target.record.subject.is_some() {
        let (centre, radius) = target.proxy.sphere;
        say!(
            "subject  {} {kind} within {radius:.digits$} of {centre:.digits$}; the other {buried} block rays and are not planned for",
            primitives - buried
        );
    } else if buried > 0 {
        say!("         {buried} buried under others: they block rays and are not planned for");
    }
    let region = &target.region;
    let shape = match region.shape {
        Shape::Shell { centre, r_min, r_max } => {
            format!("shell around {centre:.digits$}, radii {r_min:.digits$} to {r_max:.digits$}")
        }
        Shape::Box { min, max } => format!("box from {min:.digits$} to {max:.digits$}"),
    };
    let floor = region.floor.map(|floor| format!(", floor at {floor:.digits$}")).unwrap_or_default();
    say!("region   {shape}{floor}, clearance {:.*}, up {:.3}", digits + 1, region.clearance, region.up);
    for limit in target.limits.lines() {
        say!("         {limit}");
    }
}

//! What the terminal shows of a plan.

use crate::planner::metrics::Metrics;
use crate::planner::plan::pipeline::Plan;
use crate::scene::region::Shape;

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

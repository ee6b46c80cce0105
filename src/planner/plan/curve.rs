//! How many views? Expected quality against the number of views, before the first photo.

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::sync::Arc;

use serde::Serialize;

use super::config::{Config, Preset};
use super::pipeline;
use super::problem::Problem;
use crate::engine::vulkan::Context;
use crate::{Error, Result};

/// Numbers of views that are tried.
pub(crate) const BUDGETS: [u32; 11] = [5, 8, 12, 20, 30, 50, 70, 100, 150, 200, 300];
/// What ten further views must gain to be recommended, in decibels.
const WORTH: f64 = 0.1;

/// A point of the curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Planned views.
    pub views: u32,
    /// Expected quality in decibels against that of the most views.
    pub db: f64,
    /// Share of what viewers look at that no camera sees.
    pub unseen: f64,
}

/// Plans with each of [`BUDGETS`] and predicts its quality; all are judged by the same looks. `observe` receives every
/// number of views before it is planned, and may stop the run.
///
/// # Errors
/// As [`pipeline::run`]; [`Error::Interrupted`] where it was stopped.
pub fn curve(
    context: &Arc<Context>,
    problem: &Problem<'_>,
    config: &Config,
    mut observe: impl FnMut(u32) -> ControlFlow<()>,
) -> Result<Vec<Point>> {
    let mut errors = Vec::new();
    for views in BUDGETS {
        Error::unless_stopped(observe(views))?;
        let config = Config { views, ..config.clone() };
        let (expectation, _) = pipeline::expected_plan(context, problem, config)?;
        errors.push((views, expectation.error_db, expectation.unseen));
    }
    let last = errors.last().map_or(0.0, |(_, error, _)| *error);
    Ok(errors.into_iter().map(|(views, error, unseen)| Point { views, db: last - error, unseen }).collect())
}

/// The curve in a sentence; beside `kept` views.
pub fn sentence(points: &[Point], kept: usize) -> String {
    let views = counted(kept);
    let gain = |pair: &[Point]| 10.0 * (pair[1].db - pair[0].db) / f64::from(pair[1].views - pair[0].views);
    let enough = points.windows(2).rposition(|pair| gain(pair) >= WORTH).map_or(0, |last| last + 1);
    match points.get(enough) {
        Some(point) if enough + 1 < points.len() => {
            format!("beyond {} {views} each further ten gain less than {WORTH} dB", point.views)
        }
        Some(point) => format!("up to {} {views} each further ten gain {WORTH} dB or more", point.views),
        None => String::new(),
    }
}

/// How much of what the curve expects trainings gained; those of 10,000 iterations also had fewer splats (docs/results/law.md, of the
/// test split).
pub fn caution(preset: Preset) -> &'static str {
    match preset {
        Preset::Object => {
            "three objects gained this from 50 to 100 views in 30,000 iterations (from 100 to 200 two thirds of it), half of it in 10,000"
        }
        Preset::Room => {
            "six rooms gained this and a sixth more from 100 to 300 views in 30,000 iterations, and three quarters of it in 10,000"
        }
    }
}

/// What is counted: all views, or those on top of the kept ones.
fn counted(kept: usize) -> String {
    if kept > 0 { format!("views on top of the {kept} kept") } else { "views".into() }
}

/// The curve as an SVG picture: across the number of views beside `kept`, logarithmic; upwards decibels.
pub fn svg(points: &[Point], kept: usize, preset: Preset) -> String {
    let (left, top, right, bottom) = (80.0, 50.0, 760.0, 430.0);
    let (first, last) = (points.first().map_or(1, |p| p.views), points.last().map_or(2, |p| p.views));
    let low = points.iter().map(|point| point.db).fold(0.0, f64::min).floor().min(-1.0);
    let high = points.iter().map(|point| point.db).fold(0.0, f64::max).ceil();
    let x = |views: u32| {
        let part = (f64::from(views) / f64::from(first)).ln() / (f64::from(last) / f64::from(first)).ln();
        left + (right - left) * part
    };
    let y = |db: f64| bottom - (bottom - top) * (db - low) / (high - low).max(1.0);
    let mut svg = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 800 520\" width=\"800\" height=\"520\" font-family=\"sans-serif\" \
         font-size=\"14\">\n<rect width=\"800\" height=\"520\" fill=\"white\"/>\n",
    );
    // Writing to a string cannot fail.
    let mut add = |line: std::fmt::Arguments<'_>| _ = writeln!(svg, "{line}");
    add(format_args!(
        "<text x=\"420\" y=\"28\" text-anchor=\"middle\" font-size=\"17\">Expected quality: {}</text>",
        sentence(points, kept)
    ));
    add(format_args!("<text x=\"{left}\" y=\"{}\" font-size=\"12\">less that of {last} views</text>", top - 6.0));
    let step = if high - low > 6.0 { 2.0 } else { 1.0 };
    for db in (0..).map(|i| low + step * f64::from(i)).take_while(|db| *db <= high) {
        let at = y(db);
        add(format_args!("<line x1=\"{left}\" y1=\"{at:.1}\" x2=\"{right}\" y2=\"{at:.1}\" stroke=\"#ddd\"/>"));
        add(format_args!("<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{db:+.0} dB</text>", left - 8.0, at + 5.0));
    }
    for point in points {
        let at = x(point.views);
        add(format_args!("<text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>", bottom + 22.0, point.views));
        add(format_args!("<circle cx=\"{at:.1}\" cy=\"{:.1}\" r=\"4\" fill=\"#2060c0\"/>", y(point.db)));
    }
    let line: Vec<String> = points.iter().map(|point| format!("{:.1},{:.1}", x(point.views), y(point.db))).collect();
    add(format_args!("<polyline points=\"{}\" fill=\"none\" stroke=\"#2060c0\" stroke-width=\"2\"/>", line.join(" ")));
    add(format_args!("<text x=\"420\" y=\"{}\" text-anchor=\"middle\">{}</text>", bottom + 48.0, counted(kept)));
    add(format_args!(
        "<text x=\"420\" y=\"{}\" text-anchor=\"middle\" font-size=\"12\">{}</text>",
        bottom + 74.0,
        caution(preset)
    ));
    svg + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, the sentence would advise more photos than help, or to stop too soon.
    #[test]
    fn the_sentence_names_the_last_gain_that_counts() {
        let of = |db: [f64; 4]| {
            let points = [10, 20, 40, 100].into_iter().zip(db);
            points.map(|(views, db)| Point { views, db, unseen: 0.0 }).collect::<Vec<_>>()
        };
        // Gains for ten views: 1.0, 0.15, 0.05.
        assert_eq!(sentence(&of([-1.6, -0.6, -0.3, 0.0]), 0), "beyond 40 views each further ten gain less than 0.1 dB");
        assert_eq!(
            sentence(&of([-0.4, -0.35, -0.3, 0.0]), 0),
            "beyond 10 views each further ten gain less than 0.1 dB"
        );
        let all = of([-9.0, -6.0, -3.0, 0.0]);
        assert_eq!(sentence(&all, 0), "up to 100 views each further ten gain 0.1 dB or more");
        // Beside photos that are there, nobody takes the count for that of all.
        assert_eq!(sentence(&all, 67), "up to 100 views on top of the 67 kept each further ten gain 0.1 dB or more");
        assert!(
            svg(&all, 67, Preset::Room).contains(">views on top of the 67 kept</text>")
                && svg(&all, 0, Preset::Object).contains(">views</text>")
        );
    }
}

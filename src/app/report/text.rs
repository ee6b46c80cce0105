//! The parts of the page that are text: heading, summary, figures and the table of metrics.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::Path;

use super::Kind;
use crate::planner::metrics::Metrics;
use crate::planner::plan::record::{PlanRecord, Status};
use crate::planner::quality::expected::decibels;
use crate::scene::region::Shape;

/// Replaces each `{{slot}}` of `template` by what `value` gives for it. What is put in is not searched for slots again,
/// so a path named `{{data}}` stays a path.
pub fn fill<'a>(template: &str, value: impl Fn(&str) -> Cow<'a, str>) -> String {
    let mut page = String::with_capacity(template.len());
    let mut rest = template;
    while let Some((before, after)) = rest.split_once("{{") {
        let Some((slot, after)) = after.split_once("}}") else { break };
        page.push_str(before);
        page.push_str(&value(slot));
        rest = after;
    }
    page.push_str(rest);
    page
}

/// Title of a plan's page.
pub fn title(record: &PlanRecord) -> String {
    format!("{}: {}", escape(surface_name(record)), views(record.cameras.len()))
}

/// Kind of page.
pub fn kind(kind: Kind<'_>) -> &'static str {
    match kind {
        Kind::Plan => "plan",
        Kind::Selection(_) => "selection",
    }
}

/// The HTML for one of the template's text slots; empty for a slot it does not know.
pub fn slot(name: &str, record: &PlanRecord, kind: Kind<'_>) -> String {
    let selection = matches!(kind, Kind::Selection(_));
    let either = |plan: &str, chosen: &str| if selection { chosen } else { plan }.to_owned();
    match name {
        "subject" => either("Plan", "Choice"),
        "deed" => either("planned", "chosen"),
        "loss" => {
            either("the total is weighted, its terms are not", "expected error in dB against the first, swap by swap")
        }
        "summary" => summary(record, kind),
        "figures" => figures(record),
        "metrics" => metrics_table(record, kind),
        "config" => escape(&serde_json::to_string_pretty(&record.config).unwrap_or_default()),
        _ => String::new(),
    }
}

/// The path of a file, relative to the page, as a quoted attribute; a name with a colon is no scheme of an address, and a
/// backslash no slash.
#[cfg(feature = "cli")]
pub fn address(path: &str) -> String {
    escape(&path.replace('%', "%25").replace('#', "%23").replace('?', "%3F").replace(':', "%3A").replace('\\', "%5C"))
}

/// `text` with everything escaped that means something in HTML, in an element or in a quoted attribute.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

fn surface_name(record: &PlanRecord) -> &str {
    telling_name(&record.surface.path)
}

/// The most informative name in a path: a COLMAP model's folder is `capture/sparse/0`, and the capture has a name.
pub(crate) fn telling_name(path: &str) -> &str {
    let names = Path::new(path).iter().rev().filter_map(|name| name.to_str());
    let mut telling = names.filter(|name| !matches!(*name, "0" | "sparse" | "." | ".." | "/"));
    telling.next().unwrap_or(path)
}

fn views(count: usize) -> String {
    format!("{} {}", grouped(count), if count == 1 { "view" } else { "views" })
}

/// What stands above all.
pub fn heading(record: &PlanRecord, kind: Kind<'_>) -> String {
    let doubts = if matches!(kind, Kind::Plan) { record.doubts() } else { Vec::new() };
    let status = match (record.status, doubts.len()) {
        (Status::Interrupted, _) => r#"<span class="badge warn">INTERRUPTED</span>"#,
        (Status::Complete, 0) => "",
        (Status::Complete, _) => r#"<span class="badge warn">look before you follow it</span>"#,
    };
    let mut html = format!("<h1>{} {status}</h1>\n", escape(surface_name(record)));
    let planned = record.cameras.len().saturating_sub(record.kept);
    let _ = match kind {
        Kind::Plan => write!(html, r#"<p class="lead">{}"#, views(record.cameras.len())),
        Kind::Selection(_) => {
            let (chosen, out) = (grouped(planned), grouped(record.kept));
            write!(html, r#"<p class="lead">{chosen} photos chosen; {out} left out are shown"#)
        }
    };
    if record.kept > 0 && matches!(kind, Kind::Plan) {
        let _ = write!(html, ": {} planned, {} kept", grouped(planned), grouped(record.kept));
    }
    let line = format!(
        "{}; {}; seed {}; {}; camsplat {}",
        region(record),
        record.device,
        record.seed,
        duration(record.seconds),
        record.version
    );
    let _ = write!(html, "</p>\n<p class=\"line\">{}</p>", escape(&line));
    if let Some(hidden) = record.out_of_sight().filter(|_| matches!(kind, Kind::Plan)) {
        let _ = write!(html, "\n<p class=\"line\">{}</p>", escape(&format!("{hidden}.")));
    }
    for doubt in doubts {
        let _ = write!(html, "\n<p class=\"notice\">{}</p>", escape(&doubt));
    }
    if record.status == Status::Interrupted {
        let _ = write!(
            html,
            "\n<p class=\"notice\" role=\"status\">The run was interrupted after {}. This is the plan of the last \
             finished iteration; more iterations would likely improve it.</p>",
            iterations(record)
        );
    }
    html
}

fn iterations(record: &PlanRecord) -> String {
    let done = record.history.last().map_or(0, |last| last.iteration as usize + 1);
    format!("{} {}", grouped(done), if done == 1 { "iteration" } else { "iterations" })
}

fn summary(record: &PlanRecord, kind: Kind<'_>) -> String {
    let surface = &record.surface;
    let size = surface.max - surface.min;
    let primitives = grouped(surface.primitives);
    let mut rows = vec![
        ("Surface", surface.path.clone()),
        (
            "Geometry",
            format!(
                "{}, {primitives} primitives, {} × {} × {}",
                surface.kind,
                number(size.x),
                number(size.y),
                number(size.z)
            ),
        ),
        ("Region", region(record)),
    ];
    rows.extend(record.began_from.iter().map(|layout| ("Began from", layout.clone())));
    rows.extend(record.connection.iter().map(|connection| ("Connected", connection.line())));
    rows.extend(record.tour.iter().map(|tour| ("Tour", tour.line())));
    if let Some(first) = record.cameras.first() {
        let same = record.cameras.iter().all(|c| c.intrinsics == first.intrinsics);
        let [x, y] = first.intrinsics.fov().map(f64::to_degrees);
        rows.push((
            "Cameras",
            if same {
                format!("{} × {} pixels, {x:.1}° × {y:.1}°", first.intrinsics.width, first.intrinsics.height)
            } else {
                "with intrinsics of their own".into()
            },
        ));
    }
    rows.extend([
        ("Device", record.device.clone()),
        ("Run", run(record, kind)),
        ("Version", format!("camsplat {}", record.version)),
    ]);
    if let Kind::Selection(choice) = kind {
        let whole = ROWS.iter().take(4).map(|row| format!("{} {}", row.name, row.text(row.value(choice.pool))));
        rows.push(("Whole pool", whole.collect::<Vec<_>>().join("; ")));
    }
    rows.iter().map(|(term, text)| format!("<div><dt>{term}</dt><dd>{}</dd></div>\n", escape(text))).collect()
}

fn run(record: &PlanRecord, kind: Kind<'_>) -> String {
    let done = match kind {
        Kind::Plan if record.history.is_empty() => record.method.clone(),
        Kind::Plan => iterations(record),
        Kind::Selection(_) => format!("{} swaps", grouped(record.history.len().saturating_sub(1))),
    };
    format!("{done} in {}, seed {}", duration(record.seconds), record.seed)
}

fn region(record: &PlanRecord) -> String {
    let region = &record.region;
    let vector = |v: glam::DVec3| format!("({}, {}, {})", number(v.x), number(v.y), number(v.z));
    let mut text = match region.shape {
        Shape::Shell { centre, r_min, r_max } => {
            format!("Shell around {}, radius {} to {}", vector(centre), number(r_min), number(r_max))
        }
        Shape::Box { min, max } => format!("Box from {} to {}", vector(min), vector(max)),
    };
    if let Some(floor) = region.floor {
        let _ = write!(text, ", at or above height {}", number(floor));
    }
    if region.clearance > 0.0 {
        let _ = write!(text, ", {} clear of the surface", number(region.clearance));
    }
    for limit in record.limits.lines() {
        let _ = write!(text, "; {limit}");
    }
    text
}

/// Which way a metric improves.
#[derive(Clone, Copy, PartialEq)]
enum Better {
    Higher,
    Lower,
    /// Not a matter of good or bad.
    Neither,
}

/// A row of the table.
struct Row {
    name: &'static str,
    note: &'static str,
    unit: &'static str,
    better: Better,
    /// Digits after the point; four significant digits where the scale is the scene's own.
    decimals: Option<usize>,
    /// The value in `unit`.
    get: fn(&Metrics) -> f64,
}

const fn row(
    name: &'static str,
    note: &'static str,
    unit: &'static str,
    better: Better,
    decimals: Option<usize>,
    get: fn(&Metrics) -> f64,
) -> Row {
    Row { name, note, unit, better, decimals, get }
}

const ROWS: [Row; 10] = [
    row("Seen by one view or more", "of all points", "%", Better::Higher, Some(1), |m| 100.0 * m.coverage_1),
    row("Seen by three views or more", "of all points", "%", Better::Higher, Some(1), |m| 100.0 * m.coverage_3),
    row("Angular gap, mean", "from a reachable direction to the nearest view", "°", Better::Lower, Some(1), |m| {
        m.gap_mean_deg
    }),
    row("Angular gap, 95th percentile", "over points", "°", Better::Lower, Some(1), |m| m.gap_p95_deg),
    row("Voronoi cell area, mean", "of the views around a point", " sr", Better::Lower, Some(3), |m| m.voronoi_mean),
    row("Voronoi cell area, deviation", "how uneven the cells are", " sr", Better::Lower, Some(3), |m| {
        m.voronoi_deviation
    }),
    row("Views per point, mean", "over reachable points", "", Better::Higher, Some(1), |m| m.views_mean),
    row("Views per point, variation", "deviation over mean", "", Better::Lower, Some(2), |m| m.views_variation),
    row("Triangulation angle, mean", "largest angle between two views", "°", Better::Higher, Some(1), |m| {
        m.triangulation_mean_deg
    }),
    row("Ground sampling distance, mean", "world units per pixel", "", Better::Neither, None, |m| {
        m.sampling_distance_mean
    }),
];

impl Row {
    fn value(&self, metrics: &Metrics) -> Option<f64> {
        Some((self.get)(metrics)).filter(|v| v.is_finite())
    }

    fn text(&self, value: Option<f64>) -> String {
        match (value, self.decimals) {
            (Some(v), Some(decimals)) => format!("{v:.decimals$}{}", self.unit),
            (Some(v), None) => format!("{}{}", number(v), self.unit),
            (None, _) => "–".into(),
        }
    }

    /// How the plan compares with a baseline: whether it is better, and by how much in words of the table. Fractions
    /// differ by points, everything else by percent of the baseline. `None` where they do not differ significantly.
    fn verdict(&self, plan: Option<f64>, baseline: Option<f64>) -> Option<(bool, String)> {
        let (plan, baseline) = (plan?, baseline?);
        let higher = match self.better {
            Better::Higher => true,
            Better::Lower => false,
            Better::Neither => return None,
        };
        let (difference, unit) =
            if self.unit == "%" { (plan - baseline, "pt") } else { (100.0 * (plan - baseline) / baseline.abs(), "%") };
        let shown = format!("{:.1}", difference.abs());
        if !difference.is_finite() || shown == "0.0" {
            return None;
        }
        let better = (difference > 0.0) == higher;
        Some((better, format!("{shown} {unit} {}", if difference > 0.0 { "higher" } else { "lower" })))
    }
}

/// The four most important numbers: the expected quality, where there is one, and geometry, each with the best baseline's.
fn figures(record: &PlanRecord) -> String {
    let expected = record.expected.iter().map(|expected| {
        format!(
            "<div class=\"figure\"><span class=\"name\">Expected quality</span><strong>{}</strong><span>against {} with as many views, \
             standard deviation {:.2} dB; no camera sees {:.1}% of what viewers look at{}</span></div>\n",
            decibels(expected.db, 2),
            escape(&expected.against),
            expected.sd,
            100.0 * expected.unseen,
            expected.reason.as_ref().map_or_else(String::new, |reason| format!("; {}", escape(reason)))
        )
    });
    let geometry = ROWS.iter().take(if record.expected.is_some() { 3 } else { 4 }).map(|row| {
        let best = record
            .baselines
            .iter()
            .filter_map(|c| row.value(&c.metrics).map(|v| (v, c.name.as_str())))
            .reduce(|a, b| if (b.0 > a.0) == (row.better == Better::Higher) { b } else { a });
        let beside = match best {
            Some((value, name)) => format!("best baseline: {} ({})", row.text(Some(value)), escape(name)),
            None => row.note.into(),
        };
        format!(
            "<div class=\"figure\"><span class=\"name\">{}</span><strong>{}</strong><span>{beside}</span></div>\n",
            row.name,
            row.text(row.value(&record.metrics))
        )
    });
    expected.chain(geometry).collect()
}

fn metrics_table(record: &PlanRecord, kind: Kind<'_>) -> String {
    let (subject, reaches) = match kind {
        Kind::Plan => ("plan", "the region reaches"),
        Kind::Selection(_) => ("choice", "the pool shows"),
    };
    let mut html = format!(
        "<thead><tr><th scope=\"col\">Metric</th><th scope=\"col\">{}{}</th>",
        subject[..1].to_uppercase(),
        &subject[1..]
    );
    for baseline in &record.baselines {
        let _ = write!(html, "<th scope=\"col\">{}</th>", escape(&baseline.name));
    }
    html.push_str("</tr></thead>\n<tbody>\n");
    for row in &ROWS {
        let plan = row.value(&record.metrics);
        let verdicts: Vec<_> = record.baselines.iter().map(|c| row.verdict(plan, row.value(&c.metrics))).collect();
        let best = !verdicts.is_empty() && verdicts.iter().all(|v| v.as_ref().is_some_and(|(better, _)| *better));
        let _ = write!(
            html,
            "<tr><th scope=\"row\">{}<small>{}{}</small></th><td class=\"plan{}\">{}</td>",
            row.name,
            row.note,
            match row.better {
                Better::Higher => "; higher is better",
                Better::Lower => "; lower is better",
                Better::Neither => "",
            },
            if best { " best" } else { "" },
            row.text(plan)
        );
        for (baseline, verdict) in record.baselines.iter().zip(verdicts) {
            let _ = write!(html, "<td>{}", row.text(row.value(&baseline.metrics)));
            if let Some((better, difference)) = verdict {
                let (class, mark) = if better { ("better", '✓') } else { ("worse", '✗') };
                let _ = write!(html, "<small class=\"{class}\">{mark} {subject} {difference}</small>");
            }
            html.push_str("</td>");
        }
        html.push_str("</tr>\n");
    }
    let _ = write!(
        html,
        "</tbody>\n<caption>Scored on {} held-out points of which {reaches} {}, with exact occlusion. {}</caption>",
        grouped(record.metrics.points),
        ROWS[0].text(Some(100.0 * record.metrics.reachable).filter(|v| v.is_finite())),
        if record.baselines.is_empty() {
            "No baselines were scored.".into()
        } else {
            format!("Small print compares the {subject} with the baseline: ✓ better, ✗ worse.")
        }
    );
    html
}

/// Four significant digits, without trailing zeros.
pub fn number(value: f64) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    if value == 0.0 {
        return "0".into();
    }
    let power = value.abs().log10().floor() as i32;
    if !(-4..15).contains(&power) {
        return format!("{value:.3e}");
    }
    let text = format!("{value:.*}", (3 - power).max(0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// A whole number with thin spaces between thousands.
pub(crate) fn grouped(value: usize) -> String {
    let digits = value.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out
}

/// A duration in the units that suit it.
pub(crate) fn duration(seconds: f64) -> String {
    if !seconds.is_finite() {
        return "unknown time".into();
    }
    if seconds < 60.0 {
        return format!("{} s", number(seconds));
    }
    let whole = seconds.round() as u64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, minutes, seconds) => format!("{minutes} min {seconds} s"),
        (hours, minutes, _) => format!("{hours} h {minutes} min"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_that_looks_like_a_slot_is_not_filled() {
        let page = fill("<p>{{a}} {{b}}</p>", |slot| if slot == "a" { "{{b}}".into() } else { "x".into() });
        assert_eq!(page, "<p>{{b}} x</p>");
    }

    #[test]
    fn numbers_read_as_a_person_would_write_them() {
        let cases =
            [(0.0, "0"), (2.5, "2.5"), (12345.6, "12346"), (0.012346, "0.01235"), (-3.0, "-3"), (f64::NAN, "–")];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
        assert_eq!(grouped(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(duration(75.2), "1 min 15 s");
    }

    /// Lower gap, higher coverage: both must read as better.
    #[test]
    fn a_verdict_knows_which_way_is_better() {
        assert_eq!(ROWS[0].verdict(Some(95.1), Some(91.6)), Some((true, "3.5 pt higher".into())));
        assert_eq!(ROWS[2].verdict(Some(13.8), Some(27.6)), Some((true, "50.0 % lower".into())));
        assert_eq!(ROWS[2].verdict(Some(27.6), Some(13.8)), Some((false, "100.0 % higher".into())));
        assert_eq!(ROWS[2].verdict(Some(1.0), Some(0.0)), None);
        assert_eq!(ROWS[0].verdict(None, Some(1.0)), None);
    }
}

//! The tables as LaTeX, for papers: `\input{table}` with the package booktabs.

use std::fmt::Write;

use super::request::EvaluationRequest;
use super::results::{Interval, Outcome, Row, measured};
use super::scene_means::means_over_scenes;
use super::table::{DECIMALS, description, warnings};
use crate::planner::quality::expected::or_zero;

/// The tables: every row, of the best of a scene and budget in bold, and the means over scenes where there are several.
pub(crate) fn latex(request: &EvaluationRequest, outcome: &Outcome) -> String {
    let Outcome { rows, left, .. } = outcome;
    let metrics: Vec<(usize, &str)> = measured(rows).collect();
    let column = request.columns().last().copied().unwrap_or_default();
    let comment = |line: String| format!("% {}\n", line.replace(['\n', '\r'], " "));
    let mut text: String = std::iter::once(description(request, *left)).chain(warnings(outcome)).map(comment).collect();
    let _ = write!(
        text,
        "% Column: {column}. Needs \\usepackage{{booktabs}}.\n\\begin{{tabular}}{{llr{}}}\n\\toprule\nScene & Method & Views",
        "r".repeat(metrics.len())
    );
    heads(&mut text, &metrics, |name| vec![name.to_owned()]);
    let mut before: Option<&Row> = None;
    for row in rows {
        if before.is_some_and(|before| before.scene != row.scene) {
            text += "\\midrule\n";
        }
        before = Some(row);
        // Braces: a line end takes a star or a bracket behind it for its own.
        let _ = write!(text, "{{}}{} & {} & {}", escaped(&row.scene), escaped(row.method.name()), row.views);
        let rivals = || rows.iter().filter(|other| other.scene == row.scene && other.views == row.views);
        for (metric, name) in &metrics {
            let last = |row: &Row| row.measured[*metric].last().copied().flatten();
            let best = best(name, rivals().filter_map(last));
            let _ = write!(text, " & {}", cell(last(row), DECIMALS[*metric], best));
        }
        text += " \\\\\n";
    }
    text += "\\bottomrule\n\\end{tabular}\n";
    let means = means_over_scenes(rows);
    let Some(first) = means.first() else { return text };
    let _ = write!(
        text,
        "\n\\medskip\n\n% Means over scenes; differences from {} on the same scenes.\n\\begin{{tabular}}{{lr{}}}\n\\toprule\nMethod & Views",
        first.reference,
        "rr".repeat(metrics.len())
    );
    heads(&mut text, &metrics, |name| vec![name.to_owned(), "Difference".into()]);
    for mean in &means {
        let _ = write!(text, "{{}}{} & {}", escaped(mean.method.name()), mean.views);
        let rivals = || means.iter().filter(|other| other.views == mean.views);
        for (metric, name) in &metrics {
            let best = best(name, rivals().filter_map(|other| other.measured[*metric][0]));
            let [of, difference] = mean.shown(*metric);
            let decimals = DECIMALS[*metric];
            let _ = write!(text, " & {} & {}", cell(of, decimals, best), cell(difference, decimals, None));
        }
        text += " \\\\\n";
    }
    text + "\\bottomrule\n\\end{tabular}\n"
}

/// The rest of a heading: a metric's columns, with an arrow that shows which way is better.
fn heads(text: &mut String, metrics: &[(usize, &str)], columns: impl Fn(&str) -> Vec<String>) {
    for (_, name) in metrics {
        let arrow = if is_lower_better(name) { "\\downarrow" } else { "\\uparrow" };
        *text += &format!(" & {}", columns(&format!("{name} ${arrow}$")).join(" & "));
    }
    *text += " \\\\\n\\midrule\n";
}

fn is_lower_better(metric: &str) -> bool {
    metric.starts_with("LPIPS")
}

fn best(metric: &str, all: impl Iterator<Item = Interval>) -> Option<f64> {
    let means = all.map(|interval| interval.mean);
    if is_lower_better(metric) { means.reduce(f64::min) } else { means.reduce(f64::max) }
}

fn cell(of: Option<Interval>, decimals: usize, best: Option<f64>) -> String {
    let Some(Interval { mean, half }) = of else { return "--".into() };
    let half = half.map_or_else(String::new, |half| format!(" \\pm {half:.decimals$}"));
    let is_best = best == Some(mean);
    let mean = or_zero(mean, decimals);
    if is_best { format!("$\\mathbf{{{mean:.decimals$}}}{half}$") } else { format!("${mean:.decimals$}{half}$") }
}

/// Text without LaTeX's signs.
fn escaped(text: &str) -> String {
    let sign = |c: char| match c {
        '&' | '%' | '$' | '#' | '_' | '{' | '}' => format!("\\{c}"),
        '~' => "\\textasciitilde{}".into(),
        '^' => "\\textasciicircum{}".into(),
        '\\' => "\\textbackslash{}".into(),
        '|' => "\\textbar{}".into(),
        '<' => "\\textless{}".into(),
        '>' => "\\textgreater{}".into(),
        c => c.into(),
    };
    text.chars().map(sign).collect()
}

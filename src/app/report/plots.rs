//! Plots of an evaluation as inline SVG: means with their intervals, by method or against the number of views.

use std::fmt::Write as _;

use super::text::{escape, number};
use crate::lab::evaluate::competitor::Competitor;
use crate::lab::evaluate::results::{Interval, Row};

/// Size of a plot's inner part, and what is around it: numbers, names of the axes, names of the methods, in CSS pixels.
const INNER: [f64; 2] = [300.0, 200.0];
const NUMBERS: f64 = 58.0;
const BELOW: f64 = 40.0;
const NAMES: f64 = 170.0;
/// Characters of a method's name that fit.
const LABEL: usize = 24;
/// Height of a method's line.
const LINE: f64 = 18.0;
/// Half the length of the strokes at an interval's ends.
const CAP: f64 = 3.5;
/// Colours of the methods, distinguishable by most people with colour vision deficiencies (Okabe and Ito, 2008).
const COLOURS: [&str; 8] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#888888", "var(--ink)"];

/// What is plotted: a number of [`Row::measured`], what it is called, and its name with the unit, for the axis.
#[derive(Clone, Copy, Debug)]
pub struct Metric<'a> {
    /// Which of the measured ones it is.
    pub number: usize,
    /// What heads the plot.
    pub title: &'a str,
    /// What the axis is labelled with.
    pub axis: &'a str,
}

/// Everything that is different, in the order in which it comes first.
pub fn in_order<T: PartialEq>(items: impl Iterator<Item = T>) -> Vec<T> {
    let mut seen = Vec::new();
    for item in items {
        if !seen.contains(&item) {
            seen.push(item);
        }
    }
    seen
}

/// A metric's mean over the sets, which the last column has.
fn over_sets(row: &Row, metric: usize) -> Option<Interval> {
    row.measured[metric].last().copied().flatten().filter(|interval| interval.mean.is_finite())
}

/// A method's name in a plot: of a long one the end, which distinguishes files.
fn label_of(method: &Competitor) -> String {
    let name = method.name();
    match name.chars().count().checked_sub(LABEL) {
        None | Some(0) => escape(name),
        Some(more) => {
            let end: String = name.chars().skip(more + 1).collect();
            format!("<title>{}</title>…{}", escape(name), escape(&end))
        }
    }
}

fn ends(interval: Interval) -> [f64; 2] {
    [-1.0, 1.0].map(|side| interval.mean + side * interval.half.unwrap_or(0.0))
}

/// The least and the greatest; around one value alone, some margin.
fn span(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if high > low { (low, high) } else { (low - 0.5, high + 0.5) }
}

/// Round numbers from `low` to `high`, some four of them.
fn ticks(low: f64, high: f64) -> Vec<f64> {
    let raw = (high - low) / 4.0;
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 2.5, 5.0, 10.0].map(|m| m * power).into_iter().find(|step| *step >= 0.999 * raw);
    let step = step.unwrap_or(raw);
    let first = (low / step - 1e-9).ceil();
    (0..12).map(|i| (first + f64::from(i)) * step).take_while(|tick| *tick <= high + 1e-9 * step).collect()
}

/// The head of a plot of some size, with what it shows for those who do not see it.
fn begun(title: &str, [width, height]: [f64; 2]) -> String {
    format!(
        "<figure><figcaption>{title}</figcaption><svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{title}\">"
    )
}

/// A tooltip with the mean and its interval.
fn tooltip(method: &Competitor, interval: Interval) -> String {
    let half = interval.half.map_or(String::new(), |half| format!(" ± {}", number(half)));
    format!("<title>{}: {}{half}</title>", escape(method.name()), number(interval.mean))
}

/// A metric of each method at the only number of views: a line of its own with mean and interval; empty where it was not measured.
pub fn intervals(rows: &[&Row], metric: Metric<'_>) -> String {
    let measured: Vec<_> = rows.iter().filter_map(|row| Some((&row.method, over_sets(row, metric.number)?))).collect();
    if measured.is_empty() {
        return String::new();
    }
    let (low, high) = span(measured.iter().flat_map(|(_, interval)| ends(*interval)));
    let x = |value: f64| NAMES + INNER[0] * (value - low) / (high - low);
    let (bottom, edge) = (LINE * measured.len() as f64, NAMES + INNER[0]);
    let mut text = begun(metric.title, [edge + 24.0, bottom + BELOW]);
    for tick in ticks(low, high) {
        let _ = write!(
            text,
            "<path class=\"grid\" d=\"M{0:.1} 0V{bottom}\"/><text x=\"{0:.1}\" y=\"{1}\" text-anchor=\"middle\">{2}</text>",
            x(tick),
            bottom + 15.0,
            number(tick)
        );
    }
    let _ = write!(
        text,
        "<path class=\"axis\" d=\"M{NAMES} {bottom}H{edge}\"/><text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
        NAMES + 0.5 * INNER[0],
        bottom + 33.0,
        metric.axis
    );
    for (i, (method, interval)) in measured.into_iter().enumerate() {
        let (y, [from, to]) = (LINE * (i as f64 + 0.5), ends(interval).map(x));
        let colour = COLOURS[0];
        let (names, label, above, below) = (NAMES - 8.0, y + 4.0, y - CAP, y + CAP);
        let _ = write!(text, "<text x=\"{names}\" y=\"{label}\" text-anchor=\"end\">{}</text>", label_of(method));
        if interval.half.is_some() {
            let _ = write!(
                text,
                "<path class=\"interval\" d=\"M{from:.1} {above}V{below}M{from:.1} {y}H{to:.1}M{to:.1} {above}V{below}\" \
                 stroke=\"{colour}\"/>"
            );
        }
        let _ = write!(
            text,
            "<circle cx=\"{:.1}\" cy=\"{y}\" r=\"3.5\" fill=\"{colour}\">{}</circle>",
            x(interval.mean),
            tooltip(method, interval)
        );
    }
    text + "</svg></figure>\n"
}

/// A metric's mean over the sets against the number of views, a line for each method; empty where it was not measured.
pub fn curves(rows: &[&Row], metric: Metric<'_>) -> String {
    let value = |row: &Row| over_sets(row, metric.number);
    let values: Vec<f64> = rows.iter().filter_map(|row| value(row)).flat_map(ends).collect();
    if values.is_empty() {
        return String::new();
    }
    let (left, right) = span(rows.iter().map(|row| f64::from(row.views)));
    let (low, high) = span(values.into_iter());
    let methods = in_order(rows.iter().map(|row| &row.method));
    let top = 8.0;
    let bottom = top + INNER[1].max(LINE * methods.len() as f64);
    let edge = NUMBERS + INNER[0];
    let x = |views: u32| NUMBERS + 12.0 + (INNER[0] - 36.0) * (f64::from(views) - left) / (right - left);
    let y = |value: f64| bottom - (bottom - top) * (value - low) / (high - low);
    let mut text = begun(metric.title, [edge + NAMES, bottom + BELOW]);
    for tick in ticks(low, high) {
        let _ = write!(
            text,
            "<path class=\"grid\" d=\"M{NUMBERS} {0:.1}H{edge}\"/><text x=\"{1}\" y=\"{2:.1}\" text-anchor=\"end\">{3}</text>",
            y(tick),
            NUMBERS - 6.0,
            y(tick) + 4.0,
            number(tick)
        );
    }
    for views in in_order(rows.iter().map(|row| row.views)) {
        let _ = write!(
            text,
            "<path class=\"axis\" d=\"M{0:.1} {bottom}v4\"/><text x=\"{0:.1}\" y=\"{1}\" text-anchor=\"middle\">{views}</text>",
            x(views),
            bottom + 17.0
        );
    }
    let middle = 0.5 * (top + bottom);
    let _ = write!(
        text,
        "<path class=\"axis\" d=\"M{NUMBERS} {bottom}H{edge}\"/>\
         <text x=\"{}\" y=\"{}\" text-anchor=\"middle\">number of views</text>\
         <text x=\"12\" y=\"{middle}\" text-anchor=\"middle\" transform=\"rotate(-90 12 {middle})\">{}</text>",
        0.5 * (NUMBERS + edge),
        bottom + 35.0,
        metric.axis
    );
    for (i, method) in methods.into_iter().enumerate() {
        let colour = COLOURS[i % COLOURS.len()];
        // Colours that come again have broken lines.
        let dashes = 3 * (i / COLOURS.len());
        let own = rows.iter().filter(|row| &row.method == method).filter_map(|row| Some((row.views, value(row)?)));
        let mut own: Vec<(u32, Interval)> = own.collect();
        own.sort_by_key(|(views, _)| *views);
        let line: Vec<String> = own.iter().map(|(views, v)| format!("{:.1},{:.1}", x(*views), y(v.mean))).collect();
        let style = format!("fill=\"none\" stroke=\"{colour}\" stroke-dasharray=\"{dashes}\"");
        let _ = write!(text, "<polyline points=\"{}\" {style}/>", line.join(" "));
        for (views, interval) in own {
            // Side by side, so that the bars of all methods are seen.
            let (at, [from, to]) = (x(views) + 3.0 * i as f64, ends(interval).map(y));
            if interval.half.is_some() {
                let (before, after) = (at - CAP, at + CAP);
                let _ = write!(
                    text,
                    "<path class=\"interval\" d=\"M{before:.1} {from:.1}H{after:.1}M{at:.1} {from:.1}V{to:.1}M{before:.1} \
                     {to:.1}H{after:.1}\" stroke=\"{colour}\"/>"
                );
            }
            let _ = write!(
                text,
                "<circle cx=\"{at:.1}\" cy=\"{:.1}\" r=\"3\" fill=\"{colour}\">{}</circle>",
                y(interval.mean),
                tooltip(method, interval)
            );
        }
        let (at, next, label) = (edge + 4.0, edge + 20.0, LINE * (i as f64 + 0.5));
        let _ = write!(
            text,
            "<path d=\"M{at} {label}H{next}\" {style}/><text x=\"{}\" y=\"{}\">{}</text>",
            next + 4.0,
            label + 4.0,
            label_of(method)
        );
    }
    text + "</svg></figure>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, an axis would have no numbers, or so many that none could be read.
    #[test]
    fn axes_have_a_few_round_numbers() {
        assert_eq!(ticks(0.0, 10.0), [0.0, 2.5, 5.0, 7.5, 10.0]);
        assert_eq!(ticks(20.13, 21.9), [20.5, 21.0, 21.5]);
        for (low, high) in [(0.17, 0.171), (-3.0, 250.0), (1e5, 1e5 + 3.0), (0.0, 1e-9)] {
            let found = ticks(low, high);
            assert!((2..=6).contains(&found.len()), "{low} to {high}: {found:?}");
        }
    }
}

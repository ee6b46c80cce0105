//! The page of an evaluation: tables, charts, camera positions, test views side by side.
//!
//! Pictures are not embedded: the page lies in the evaluation's folder and shows the files that the runs left there.

use std::fmt::Write;

use glam::DVec3;

use super::text::{address, escape, number};
use crate::evaluate::competitor::Competitor;
use crate::evaluate::job::Outcome;
use crate::evaluate::request::Request;
use crate::evaluate::results::{Entry, Interval, Row, measured};
use crate::evaluate::table::{DECIMALS, apart, cell, description};

/// Size of a chart, its margin, and what names of methods take beside it, in CSS pixels.
const CHART: [f64; 2] = [300.0, 220.0];
const MARGIN: f64 = 40.0;
const NAMES: f64 = 170.0;
/// Characters of a name that fit there.
const LABEL: usize = 26;
/// Height of a method's line.
const LINE: f64 = 18.0;
/// Colours of the methods, distinguishable by most people with colour vision deficiencies (Okabe and Ito, 2008).
const COLOURS: [&str; 8] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#888888", "#000000"];

/// How pages with tables and rows of pictures look.
pub(super) const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:75em;padding:0 1em}\
     table{border-collapse:collapse;margin:1em 0}td,th{padding:.2em .8em;text-align:right;border-bottom:1px solid #ddd}\
     td:first-child,th:first-child{text-align:left}figure{display:inline-block;margin:.5em}\
     img{width:12em;image-rendering:pixelated}svg{max-width:100%}";

/// The page.
pub fn html(request: &Request, outcome: &Outcome) -> String {
    let Outcome { rows, entries, left, .. } = outcome;
    let columns = request.columns();
    let mut page = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>camsplat evaluation</title>\n\
         <style>{STYLE}</style>\n<h1>Evaluation</h1>\n<p>{}</p>\n",
        with_code(&description(request, *left))
    );
    if let Some(apart) = apart(rows) {
        let _ = writeln!(page, "<p>{}</p>", escape(&apart));
    }
    for scene in in_order(rows.iter().map(|row| row.scene.as_str())) {
        let rows: Vec<&Row> = rows.iter().filter(|row| row.scene == scene).collect();
        let _ = writeln!(page, "<h2>{}</h2>", escape(scene));
        for (metric, name) in measured(rows.iter().copied()) {
            page += &table(&rows, metric, name, &columns);
        }
        let of = match request.sets() {
            [set] => format!("{set} views"),
            _ => "mean over the sets".into(),
        };
        for (metric, name) in measured(rows.iter().copied()) {
            let name = format!("{name}, {of}");
            page += &match in_order(rows.iter().map(|row| row.views))[..] {
                [_] => intervals(&rows, metric, &name),
                _ => curves(&rows, metric, &name),
            };
        }
        let of_scene: Vec<&Entry> = entries.iter().filter(|entry| entry.scene == scene).collect();
        page += &layouts(&of_scene);
        page += &pictures(scene, &of_scene, request.sets());
    }
    page
}

/// Everything that is different, in the order in which it comes first.
fn in_order<T: PartialEq>(items: impl Iterator<Item = T>) -> Vec<T> {
    let mut seen = Vec::new();
    for item in items {
        if !seen.contains(&item) {
            seen.push(item);
        }
    }
    seen
}

/// A metric, a row for each method and budget.
pub(super) fn table(rows: &[&Row], metric: usize, name: &str, columns: &[&str]) -> String {
    let mut text = format!("<table><tr><th>{name}</th><th>views</th>");
    columns.iter().for_each(|column| text += &format!("<th>{column}</th>"));
    text += "<th>choice, s</th></tr>\n";
    let cell = |interval: Option<Interval>, decimals: usize| {
        format!("<td>{}</td>", interval.map_or_else(|| "–".to_owned(), |interval| cell(interval, decimals)))
    };
    for row in rows {
        let _ = write!(text, "<tr><td>{}</td><td>{}</td>", escape(row.method.name()), row.views);
        row.measured[metric].iter().for_each(|measured| text += &cell(*measured, DECIMALS[metric]));
        let _ = writeln!(text, "{}</tr>", cell(Some(row.seconds), 2));
    }
    text + "</table>\n"
}

/// A metric's mean over the sets, which the last column has.
fn over_sets(row: &Row, metric: usize) -> Option<Interval> {
    row.measured[metric].last().copied().flatten().filter(|interval| interval.mean.is_finite())
}

/// Text of Markdown whose only marks are those of code.
fn with_code(text: &str) -> String {
    let parts = escape(text);
    let parts = parts.split('`').enumerate();
    parts.map(|(i, part)| if i % 2 == 1 { format!("<code>{part}</code>") } else { part.into() }).collect()
}

/// A method's name in a chart: of a long one the end, which distinguishes files.
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

/// A metric of each method at the only number of views: a line of its own with mean and interval; empty where it was not measured.
fn intervals(rows: &[&Row], metric: usize, name: &str) -> String {
    let measured: Vec<_> = rows.iter().filter_map(|row| Some((&row.method, over_sets(row, metric)?))).collect();
    if measured.is_empty() {
        return String::new();
    }
    let (low, high) = span(measured.iter().flat_map(|(_, interval)| ends(*interval)));
    let inner = CHART[0] - MARGIN;
    let x = |value: f64| NAMES + inner * (value - low) / (high - low);
    let (bottom, edge) = (LINE * measured.len() as f64, NAMES + inner);
    let (width, height) = (edge + MARGIN, bottom + LINE);
    let mut text = format!(
        "<figure><figcaption>{name}</figcaption>\
         <svg viewBox=\"0 0 {width} {height}\" width=\"{width}\" font-size=\"11\">\
         <path d=\"M{NAMES} 0V{bottom}H{edge}\" fill=\"none\" stroke=\"#999\"/>\
         <text x=\"{NAMES}\" y=\"{height}\" text-anchor=\"middle\">{}</text>\
         <text x=\"{edge}\" y=\"{height}\" text-anchor=\"middle\">{}</text>",
        number(low),
        number(high)
    );
    for (i, (method, interval)) in measured.into_iter().enumerate() {
        let (y, [from, to]) = (LINE * (i as f64 + 0.5), ends(interval).map(x));
        let colour = COLOURS[0];
        let (names, label) = (NAMES - 8.0, y + 4.0);
        let _ = write!(
            text,
            "<text x=\"{names}\" y=\"{label}\" text-anchor=\"end\">{}</text><path d=\"M{from} {y}H{to}\" stroke=\"{colour}\"/>\
             <circle cx=\"{}\" cy=\"{y}\" r=\"3\" fill=\"{colour}\"/>",
            label_of(method),
            x(interval.mean)
        );
    }
    text + "</svg></figure>\n"
}

/// A metric's mean over the sets against the number of views, a line for each method; empty where it was not measured.
fn curves(rows: &[&Row], metric: usize, name: &str) -> String {
    let value = |row: &Row| over_sets(row, metric);
    let values: Vec<f64> = rows.iter().filter_map(|row| value(row)).flat_map(ends).collect();
    if values.is_empty() {
        return String::new();
    }
    let (left, right) = span(rows.iter().map(|row| f64::from(row.views)));
    let (low, high) = span(values.into_iter());
    let methods = in_order(rows.iter().map(|row| &row.method));
    let [width, height] = [CHART[0] + NAMES, CHART[1].max(LINE * methods.len() as f64)];
    let x = |views: u32| MARGIN + (CHART[0] - 2.0 * MARGIN) * (f64::from(views) - left) / (right - left);
    let y = |value: f64| height - MARGIN - (height - 2.0 * MARGIN) * (value - low) / (high - low);
    let (bottom, edge) = (height - MARGIN, CHART[0] - MARGIN);
    let mut text = format!(
        "<figure><figcaption>{name} against the number of views</figcaption>\
         <svg viewBox=\"0 0 {width} {height}\" width=\"{width}\" font-size=\"11\">\
         <path d=\"M{MARGIN} {MARGIN}V{bottom}H{edge}\" fill=\"none\" stroke=\"#999\"/>\
         <text x=\"2\" y=\"{MARGIN}\">{}</text><text x=\"2\" y=\"{bottom}\">{}</text>",
        number(high),
        number(low)
    );
    for views in in_order(rows.iter().map(|row| row.views)) {
        let _ = write!(text, "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{views}</text>", x(views), bottom + 14.0);
    }
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
            let (at, [from, to]) = (x(views) + 2.0 * i as f64, ends(interval).map(y));
            let _ = write!(text, "<path d=\"M{at} {from}V{to}\" stroke=\"{colour}\"/>");
            let _ = write!(text, "<circle cx=\"{at}\" cy=\"{}\" r=\"2.5\" fill=\"{colour}\"/>", y(interval.mean));
        }
        let (at, next, label) = (CHART[0] + 4.0, CHART[0] + 24.0, LINE * (i as f64 + 0.5));
        let _ = write!(
            text,
            "<path d=\"M{at} {label}H{next}\" {style}/><text x=\"{}\" y=\"{}\" fill=\"{colour}\">{}</text>",
            next + 4.0,
            label + 4.0,
            label_of(method)
        );
    }
    text + "</svg></figure>\n"
}

/// The first run of each method at the largest budget, and that budget; none where nothing is complete.
fn first_runs<'e>(entries: &[&'e Entry]) -> Option<(u32, Vec<&'e Entry>)> {
    let most = entries.iter().map(|entry| entry.views).max()?;
    let of_most = || entries.iter().copied().filter(|entry| entry.views == most);
    let first = of_most().map(|entry| entry.seed).min()?;
    Some((most, of_most().filter(|entry| entry.seed == first).collect()))
}

/// Cameras of each method's first run at the largest budget, from above and from the side of a scene that is Y up.
fn layouts(entries: &[&Entry]) -> String {
    let Some((most, shown)) = first_runs(entries) else { return String::new() };
    let places = || shown.iter().flat_map(|entry| &entry.places);
    let (low, high) = places().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), at| (l.min(*at), h.max(*at)));
    let side = (high - low).max_element();
    if !(side.is_finite() && side > 0.0) {
        return String::new();
    }
    let mut text = format!("<h3>Cameras, {most} views chosen: from above and from the side</h3>\n");
    for entry in shown {
        text += "<figure><svg width=\"250\" height=\"125\" viewBox=\"-5 -5 250 125\">";
        for place in &entry.places {
            let at = 115.0 * (*place - 0.5 * (low + high)) / side + 57.5;
            for (left, x, y) in [(0.0, at.x, at.z), (125.0, at.x, 115.0 - at.y)] {
                let _ = write!(text, "<circle cx=\"{:.1}\" cy=\"{y:.1}\" r=\"2\" fill=\"{}\"/>", left + x, COLOURS[0]);
            }
        }
        let _ = writeln!(text, "</svg><figcaption>{}</figcaption></figure>", escape(entry.method.name()));
    }
    text
}

/// The first test view of each set, as it is and as each method's first run at the largest budget shows it.
pub(super) fn pictures(scene: &str, entries: &[&Entry], sets: &[&str]) -> String {
    let Some((most, shown)) = first_runs(entries) else { return String::new() };
    let mut text = format!("<h3>Test views, {most} views chosen</h3>\n");
    for (i, set) in sets.iter().enumerate() {
        let picture = |entry: &Entry, of: &str, caption: &str| {
            let [scene, file] = [scene, entry.pictures[i].as_str()].map(address);
            let path = format!("{scene}/{}/{of}/{file}", entry.folder);
            format!("<figure><img src=\"{path}\" alt=\"\"><figcaption>{}</figcaption></figure>", escape(caption))
        };
        let reference = shown.first().map(|entry| picture(entry, "reference", &format!("{set}: the photograph")));
        text += &reference.unwrap_or_default();
        shown.iter().for_each(|entry| text += &picture(entry, "test", entry.method.name()));
        text += "<br>\n";
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::competitor::Given;
    use crate::evaluate::kind::Kind;
    use crate::evaluate::settings::{Settings, Shown};
    use crate::evaluate::situation::Situation;
    use crate::gaussians::run::record::Quality;
    use crate::methods::Method;
    use crate::quality::viewers::Viewers;
    use crate::scene::limits::Limits;

    /// If this failed, the name of a file could break the page or inject scripts, or could not be read in a chart.
    #[test]
    fn names_of_files_are_text() {
        let name = "cameras:a folder with a long name/<img src=x>.json";
        let given = Given { name: name.into(), poses: Vec::new(), notes: Vec::new() };
        let entry = Entry {
            scene: "cup".into(),
            method: Competitor::Cameras(std::sync::Arc::new(given)),
            views: 4,
            seed: 0,
            seconds: 0.0,
            quality: vec![Quality { psnr: 20.0, ssim: 0.5, ..Quality::default() }; 3],
            diverged: Some([20.0, 15.0]),
            folder: "training-1".into(),
            pictures: ["half", "full", "random"].map(|set| format!("{set}_0000.png")).to_vec(),
            places: vec![DVec3::ZERO, DVec3::new(2.0, 1.0, 0.0)],
        };
        let request = Request {
            kind: Kind::Object,
            methods: vec![entry.method.clone()],
            budgets: vec![4],
            seeds: 1,
            first_seed: 0,
            settings: Settings::QUICK,
            viewers: Viewers::Region,
            situation: Situation::Free,
            limits: Limits::default(),
        };
        let page = html(&request, &Outcome::new(Kind::Object, vec![entry], 1));
        assert!(!page.contains("<img src=x>"), "{page}");
        // That its training diverged, three tables, the layout, three pictures; in two charts its end, with all of it to be
        // pointed at.
        assert_eq!(page.matches("cameras:a folder with a long name/&lt;img src=x&gt;.json").count(), 1 + 3 + 1 + 3 + 2);
        assert_eq!(page.matches("</title>…ong name/&lt;img src=x&gt;.json</text>").count(), 2, "{page}");
    }

    /// If this failed, a method or a budget would be missing from the page, or all where seeds do not begin at zero, or a scene's name
    /// would break it.
    #[test]
    fn every_method_has_its_line_and_its_pictures() {
        let entry = |method, views| Entry {
            scene: "a<b#1".into(),
            method,
            views,
            seed: 3,
            seconds: 0.1,
            quality: vec![Quality { psnr: 20.0 + f64::from(views), ssim: 0.5, ..Quality::default() }; 3],
            diverged: None,
            folder: format!("training-{views}"),
            pictures: ["half", "full", "random"].map(|set| format!("{set}_0000.png")).to_vec(),
            places: vec![DVec3::ZERO, DVec3::new(2.0, 1.0, 0.0)],
        };
        let request = |budgets: &[u32]| Request {
            kind: Kind::Object,
            methods: vec![Competitor::Method(Method::Ours), Competitor::Method(Method::OursNoVds)],
            budgets: budgets.to_vec(),
            seeds: 1,
            first_seed: 3,
            settings: Settings::QUICK,
            viewers: Viewers::Region,
            situation: Situation::Free,
            limits: Limits::default(),
        };
        let entries: Vec<Entry> = [Competitor::Method(Method::Ours), Competitor::Method(Method::OursNoVds)]
            .into_iter()
            .flat_map(|m| [entry(m.clone(), 10), entry(m, 20)])
            .collect();
        let page = html(&request(&[10, 20]), &Outcome::new(Kind::Object, entries.clone(), 5));
        assert_eq!(page.matches("<polyline").count(), 4, "LPIPS was not measured");
        assert_eq!(page.matches("<img").count(), 3 * 3);
        assert!(page.contains("a&lt;b%231/training-20/test/random_0000.png") && !page.contains("a<b"));
        assert_eq!(page.matches("<figcaption>ours</figcaption>").count(), 1 + 3);
        assert!(page.contains("cx=\"240.0\"") && !page.contains("NaN"), "{page}");
        assert!(page.contains("Not complete: runs still to come: 1.") && page.contains("300 iterations"), "{page}");

        // Of one number of views there is no curve, but a line with mean and interval for each method and metric.
        let entries: Vec<Entry> = entries.into_iter().filter(|entry| entry.views == 10).collect();
        let page = html(&request(&[10]), &Outcome::new(Kind::Object, entries.clone(), 2));
        assert!(!page.contains("<polyline") && !page.contains("NaN") && !page.contains("Not complete"), "{page}");
        assert_eq!(page.matches("r=\"3\"").count(), 4, "{page}");
        assert!(page.contains("<figcaption>PSNR, mean over the sets</figcaption>"), "{page}");

        // A room has one set of tests, and a mean over none.
        let first = |entry: Entry| Entry {
            quality: entry.quality[..1].to_vec(),
            pictures: entry.pictures[..1].to_vec(),
            ..entry
        };
        let rooms = entries.into_iter().map(first).collect();
        let settings = Settings { shown: Shown::True, ..Settings::QUICK };
        let request = Request { kind: Kind::Room, settings, ..request(&[10]) };
        let page = html(&request, &Outcome::new(Kind::Room, rooms, 2));
        assert!(page.contains("<figcaption>PSNR, random views</figcaption>"), "{page}");
        assert!(page.contains("own mesh (<code>--surface true</code>), scored"), "{page}");
    }
}

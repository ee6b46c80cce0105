//! The page of an evaluation: tables, plots, camera positions in 3D, test views side by side.
//!
//! Pictures are not embedded: the page lies in the evaluation's folder and shows the files that the runs left there.

use std::fmt::Write;

use serde::Serialize;

use super::document::{Document, SCENE3D};
use super::layouts;
use super::plots::{Metric, curves, in_order, intervals};
use super::scene_data::SceneData;
use super::text::{address, escape};
use crate::Result;
use crate::lab::evaluate::request::EvaluationRequest;
use crate::lab::evaluate::results::{Entry, Interval, Outcome, Row, measured};
use crate::lab::evaluate::scene_means::means_over_scenes;
use crate::lab::evaluate::subject::Subject;
use crate::lab::evaluate::table::{DECIMALS, cell, description, facts, paired, warnings};

/// Triangles of all 3D views of a page together, of one of them, and views at most: browsers draw no more.
const MAX_TRIANGLES: usize = 120_000;
const TRIANGLES: usize = 30_000;
const MAX_VIEWS: usize = 12;
/// Units of [`METRICS`](crate::lab::evaluate::results::METRICS).
const UNITS: [&str; 4] = [" (dB)", "", "", ""];

/// What the page draws from.
#[derive(Serialize)]
struct Data<'a> {
    scenes: Vec<SceneData<'a>>,
}

/// The page; layouts are shown of the subjects that are given.
///
/// # Errors
/// [`Error::Request`] if the layouts cannot be put into it.
pub fn html(request: &EvaluationRequest, outcome: &Outcome, subjects: &[Subject]) -> Result<String> {
    let Outcome { rows, entries, .. } = outcome;
    let mut data = Data { scenes: Vec::new() };
    let names = in_order(rows.iter().map(|row| row.scene.as_str()));
    let triangles = TRIANGLES.min(MAX_TRIANGLES / names.len().max(1));
    let mut sections = String::new();
    for scene in names {
        let rows: Vec<&Row> = rows.iter().filter(|row| row.scene == scene).collect();
        let of_scene: Vec<&Entry> = entries.iter().filter(|entry| entry.scene == scene).collect();
        let _ = writeln!(sections, "<section>\n<h2>{}</h2>", escape(scene));
        sections += &measurements(request, &rows);
        if let (Some((most, runs)), Some(subject)) =
            (first_runs(&of_scene), subjects.iter().find(|subject| subject.name() == scene))
            && data.scenes.len() < MAX_VIEWS
            && let Some(shown) = layouts::scene(subject, &runs, triangles)
        {
            let _ = writeln!(sections, "<h3>Cameras, {most} views chosen</h3>\n{}", include_str!("scene.html"));
            data.scenes.push(shown);
        }
        sections += &pictures(scene, &of_scene, request.sets());
        sections += "</section>\n";
    }
    sections = over_scenes(rows) + &sections;
    let document = Document {
        kind: "evaluation",
        pictures: true,
        refresh: None,
        title: "camsplat evaluation",
        style: include_str!("evaluation.css"),
        heading: &heading(request, outcome),
        body: &sections,
        scripts: &[SCENE3D],
        draw: "({ scenes }) => scenes.forEach((scene, i) => drawScene(scene, document.querySelectorAll(\".scene\")[i]))",
    };
    document.html(&data)
}

fn heading(request: &EvaluationRequest, outcome: &Outcome) -> String {
    let left = &outcome.left;
    let badge = match left {
        0 => "<span class=\"badge\">complete</span>".into(),
        left => format!("<span class=\"badge warn\">{left} runs to come</span>"),
    };
    let mut html =
        format!("<h1>Evaluation {badge}</h1>\n<p class=\"line\">{}</p>\n", with_code(&description(request, *left)));
    for line in facts(outcome) {
        let _ = writeln!(html, "<p class=\"line\">{}</p>", with_code(&line));
    }
    for notice in warnings(outcome) {
        let _ = writeln!(html, "<p class=\"notice\" role=\"status\">{}</p>", with_code(&notice));
    }
    html
}

/// Tables and plots of a scene.
fn measurements(request: &EvaluationRequest, rows: &[&Row]) -> String {
    let columns = request.columns();
    let mut html = String::new();
    for (metric, name) in measured(rows.iter().copied()) {
        html += &table(rows, metric, name, &columns);
    }
    let of = match request.sets() {
        [set] => format!("{set} views"),
        _ => "mean over the sets".into(),
    };
    html += "<div class=\"charts\">\n";
    for (number, name) in measured(rows.iter().copied()) {
        let (title, axis) = (format!("{name}, {of}"), format!("{name}{}", UNITS[number]));
        html += &match in_order(rows.iter().map(|row| row.views))[..] {
            [_] => intervals(rows, Metric { number, title: &title, axis: &axis }),
            _ => {
                let title = format!("{title} against the number of views");
                curves(rows, Metric { number, title: &title, axis: &axis })
            }
        };
    }
    html + "</div>\n<p class=\"hint\">Points are means over seeds, strokes their 95% intervals; one seed alone has none.</p>\n"
}

/// A metric, a row for each method and budget.
pub(super) fn table(rows: &[&Row], metric: usize, name: &str, columns: &[&str]) -> String {
    let mut text = format!("<div class=\"scroll\"><table><thead><tr><th>{name}</th><th>views</th>");
    columns.iter().for_each(|column| text += &format!("<th>{column}</th>"));
    text += "<th>choice, s</th></tr></thead>\n";
    for row in rows {
        let _ = write!(text, "<tr><th scope=\"row\">{}</th><td>{}</td>", escape(row.method.name()), row.views);
        row.measured[metric].iter().for_each(|measured| text += &cell_of(*measured, DECIMALS[metric]));
        let _ = writeln!(text, "{}</tr>", cell_of(row.seconds, 2));
    }
    text + "</table></div>\n"
}

fn cell_of(interval: Option<Interval>, decimals: usize) -> String {
    format!("<td>{}</td>", interval.map_or_else(|| "–".to_owned(), |interval| cell(interval, decimals)))
}

/// The means over scenes; nothing of one scene.
fn over_scenes(rows: &[Row]) -> String {
    let means = means_over_scenes(rows);
    let Some(first) = means.first() else { return String::new() };
    let mut text = format!("<section>\n<h2>All scenes</h2>\n<p class=\"hint\">{}</p>\n", escape(&paired(first)));
    text += "<div class=\"scroll\"><table><thead><tr><th>mean over scenes</th><th>views</th><th>scenes</th>";
    let metrics: Vec<(usize, &str)> = measured(rows).collect();
    metrics.iter().for_each(|(_, name)| text += &format!("<th>{name}</th><th>difference</th>"));
    text += "</tr></thead>\n";
    for mean in &means {
        let name = escape(mean.method.name());
        let _ = write!(text, "<tr><th scope=\"row\">{name}</th><td>{}</td><td>{}</td>", mean.views, mean.scenes);
        for (metric, _) in &metrics {
            mean.shown(*metric).into_iter().for_each(|value| text += &cell_of(value, DECIMALS[*metric]));
        }
        text += "</tr>\n";
    }
    text + "</table></div>\n</section>\n"
}

/// Text of Markdown whose only marks are those of code.
fn with_code(text: &str) -> String {
    let parts = escape(text);
    let parts = parts.split('`').enumerate();
    parts.map(|(i, part)| if i % 2 == 1 { format!("<code>{part}</code>") } else { part.into() }).collect()
}

/// The first run of each method at the largest budget, and that budget; none where nothing is complete.
fn first_runs<'e>(entries: &[&'e Entry]) -> Option<(u32, Vec<&'e Entry>)> {
    let most = entries.iter().map(|entry| entry.views).max()?;
    let of_most = || entries.iter().copied().filter(|entry| entry.views == most);
    let first = of_most().map(|entry| entry.seed).min()?;
    Some((most, of_most().filter(|entry| entry.seed == first).collect()))
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
        text += "<div class=\"row\">";
        let reference = shown.first().map(|entry| picture(entry, "reference", &format!("{set}: the photograph")));
        text += &reference.unwrap_or_default();
        shown.iter().for_each(|entry| text += &picture(entry, "test", entry.method.name()));
        text += "</div>\n";
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::evaluate::competitor::Competitor;
    use crate::lab::evaluate::kind::Kind;
    use crate::lab::evaluate::settings::{EvaluationSettings, Shown};
    use crate::planner::methods::Method;
    use crate::splats::run::record::Quality;

    /// The page without its data and scripts.
    fn before_scripts(page: &str) -> &str {
        page.split("<script").next().unwrap_or_default()
    }

    /// If this failed, the name of a file could break the page or inject scripts, or could not be read in a chart.
    #[test]
    fn names_of_files_are_text() {
        let name = "cameras:a folder with a long name/<img src=x>.json";
        let entry = Entry {
            scene: "cup".into(),
            method: name.parse().unwrap(),
            views: 4,
            seed: 0,
            seconds: None,
            outside: 0,
            quality: vec![Quality { psnr: 20.0, ssim: 0.5, ..Quality::default() }; 3],
            diverged: Some([20.0, 15.0]),
            folder: "training-1".into(),
            pictures: ["half", "full", "random"].map(|set| format!("{set}_0000.png")).to_vec(),
            cameras: Vec::new(),
        };
        let request = EvaluationRequest::quick(Kind::Object, vec![entry.method.clone()], vec![4]);
        let page = html(&request, &Outcome::new(Kind::Object, vec![entry], 1), &[]).unwrap();
        assert!(!page.contains("<img src=x>"), "{page}");
        // That its training diverged, three tables, three pictures; in two charts its end, and twice all of it to be pointed at.
        assert_eq!(page.matches("cameras:a folder with a long name/&lt;img src=x&gt;.json").count(), 1 + 3 + 3 + 2 * 2);
        assert_eq!(page.matches("</title>…g name/&lt;img src=x&gt;.json</text>").count(), 2, "{page}");
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
            seconds: Some(0.1),
            outside: 0,
            quality: vec![Quality { psnr: 20.0 + f64::from(views), ssim: 0.5, ..Quality::default() }; 3],
            diverged: None,
            folder: format!("training-{views}"),
            pictures: ["half", "full", "random"].map(|set| format!("{set}_0000.png")).to_vec(),
            cameras: Vec::new(),
        };
        let request = |budgets: &[u32]| EvaluationRequest {
            first_seed: 3,
            ..EvaluationRequest::quick(
                Kind::Object,
                vec![Competitor::Method(Method::Ours), Competitor::Method(Method::PaperNoVds)],
                budgets.to_vec(),
            )
        };
        let entries: Vec<Entry> = [Competitor::Method(Method::Ours), Competitor::Method(Method::PaperNoVds)]
            .into_iter()
            .flat_map(|m| [entry(m.clone(), 10), entry(m, 20)])
            .collect();
        let page = html(&request(&[10, 20]), &Outcome::new(Kind::Object, entries.clone(), 5), &[]).unwrap();
        assert_eq!(page.matches("<polyline").count(), 4, "LPIPS was not measured");
        assert_eq!(page.matches("<img").count(), 3 * 3);
        assert!(page.contains("a&lt;b%231/training-20/test/random_0000.png") && !page.contains("a<b"));
        assert_eq!(page.matches("<figcaption>ours</figcaption>").count(), 3);
        assert!(page.contains(">PSNR (dB)</text>") && page.contains(">number of views</text>"), "axes have names");
        assert!(!before_scripts(&page).contains("NaN"), "{page}");
        assert!(page.contains("Not complete: runs still to come: 1.") && page.contains("300 iterations"), "{page}");

        // Of one number of views there is no curve, but a line with mean and interval for each method and metric.
        let entries: Vec<Entry> = entries.into_iter().filter(|entry| entry.views == 10).collect();
        let page = html(&request(&[10]), &Outcome::new(Kind::Object, entries.clone(), 2), &[]).unwrap();
        assert!(
            !page.contains("<polyline") && !before_scripts(&page).contains("NaN") && !page.contains("Not complete"),
            "{page}"
        );
        assert_eq!(page.matches("r=\"3.5\"").count(), 4, "{page}");
        assert!(page.contains("<figcaption>PSNR, mean over the sets</figcaption>"), "{page}");

        // A room has one set of tests, and a mean over none.
        let first = |entry: Entry| Entry {
            quality: entry.quality[..1].to_vec(),
            pictures: entry.pictures[..1].to_vec(),
            ..entry
        };
        let rooms = entries.into_iter().map(first).collect();
        let settings = EvaluationSettings { shown: Shown::True, ..EvaluationSettings::QUICK };
        let request = EvaluationRequest { kind: Kind::Room, settings, ..request(&[10]) };
        let page = html(&request, &Outcome::new(Kind::Room, rooms, 2), &[]).unwrap();
        assert!(page.contains("<figcaption>PSNR, random views</figcaption>"), "{page}");
        assert!(page.contains("own mesh (<code>--surface true</code>), scored"), "{page}");
    }
}

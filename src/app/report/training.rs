//! The page of a training run: how far it is, how good the test views are and which are worst, its training curves, and its cost
//! in time and memory. During the run, the page reloads itself.

use std::fmt::Write as _;

use serde::Serialize;

use super::document::{Document, SPLATS};
pub use super::pictures::Comparison;
use super::pictures::{GAIN, shown};
pub use super::splats::Model;
use super::splats::ModelData;
use super::text::{duration, escape, fill, grouped, number, telling_name};
use crate::Result;
use crate::splats::config::{Background, Masks, Strategy, TrainConfig};
use crate::splats::run::record::{CurvePoint, Evaluation, PhotoExposure, Quality, Status, TrainRecord};

/// Seconds after which the page of a running run reloads itself.
const REFRESH: u32 = 30;
/// Stages and buffers that have a bar of their own.
const MAX_BARS: usize = 12;

/// What the plots are drawn from; what is not finite becomes `null`.
#[derive(Serialize)]
struct Data<'a> {
    curve: &'a [CurvePoint],
    evaluations: &'a [Evaluation],
    /// Of each photo whose exposure was learnt, how much brighter than the model it shows a grey of one half: red, green, blue.
    gains: Vec<[f64; 3]>,
    model: Option<ModelData<'a>>,
}

/// Test views as the page shows them: shrunk, encoded, ready to be put into one page after the other.
pub struct Shown(String);

impl Default for Shown {
    /// No views yet.
    fn default() -> Self {
        Self(nothing("No test view was rendered yet."))
    }
}

impl Shown {
    /// Views in their order, with the metrics that the record has of them. Pictures are shrunk to 640 pixels; with eight
    /// views the page stays under 4 MB.
    ///
    /// # Errors
    /// [`crate::Error::Request`] if a picture has not the bytes that its size implies.
    pub fn new(record: &TrainRecord, views: &[Comparison]) -> Result<Self> {
        match views {
            [] => Ok(Self(nothing(untested(record, "No test view was rendered yet.")))),
            views => comparisons(record, views).map(Self),
        }
    }
}

/// The page of a run, self-contained, with its worst test views and, once it has ended, the model in 3D.
///
/// # Errors
/// [`crate::Error::Request`] if the record cannot be put into it.
pub fn html(record: &TrainRecord, worst: &Shown, model: Option<&Model>) -> Result<String> {
    let data = Data {
        curve: &record.curve,
        evaluations: &record.evaluations,
        gains: record.exposures.iter().map(PhotoExposure::gains).collect(),
        model: model.map(|model| model.data(record)),
    };
    let scene = match model {
        Some(_) => include_str!("splats.html").into(),
        None => nothing("The trained splats are shown here once the run has ended."),
    };
    let body = fill(include_str!("training.html"), |slot| match slot {
        "worst" => worst.0.as_str().into(),
        "scene" => scene.as_str().into(),
        slot => text(slot, record).into(),
    });
    let document = Document {
        kind: "training",
        pictures: false,
        refresh: (record.status == Status::Running).then_some(REFRESH),
        title: &title(record),
        style: include_str!("training.css"),
        heading: &heading(record),
        body: &body,
        scripts: &[include_str!("training.js"), SPLATS],
        draw: "drawTraining, drawSplats",
    };
    document.html(&data)
}

/// The HTML for one of the template's text slots; empty for a slot it does not know.
fn text(slot: &str, record: &TrainRecord) -> String {
    match slot {
        "figures" => figures(record),
        "test-views" => views(record),
        "evaluations" => evaluations(record),
        "stages" => stages(record),
        "memory" => memory(record),
        "summary" => summary(record),
        "gains" if !record.exposures.is_empty() => {
            "<figure id=\"chart-gains\"><figcaption>Exposures <span>learnt of the photos that were trained on, by name</span></figcaption>\
             </figure>\n"
                .into()
        }
        _ => String::new(),
    }
}

fn count(value: u32) -> String {
    grouped(value as usize)
}

/// `1 photo` or `20 photos`.
fn counted(value: usize, what: &str) -> String {
    format!("{} {what}{}", grouped(value), if value == 1 { "" } else { "s" })
}

/// A measure with so many digits after the point. Equal pictures have an infinite PSNR.
fn measure(value: Option<f64>, decimals: usize, unit: &str) -> String {
    match value {
        Some(v) if v.is_finite() => format!("{v:.decimals$}{unit}"),
        Some(v) if v == f64::INFINITY => format!("∞{unit}"),
        _ => "–".into(),
    }
}

fn bytes(value: u64) -> String {
    let mib = value as f64 / f64::from(1 << 20);
    if mib < 1024.0 { format!("{mib:.1} MiB") } else { format!("{:.2} GiB", mib / 1024.0) }
}

/// Seconds in words, to the second where they are many.
fn spent(seconds: f64) -> String {
    duration(if seconds < 10.0 { seconds } else { seconds.round() })
}

/// Iterations a second on the wall clock; none before there is data.
fn rate(record: &TrainRecord) -> Option<f64> {
    Some(f64::from(record.seconds_for) / record.seconds).filter(|rate| rate.is_finite() && *rate > 0.0)
}

fn left(record: &TrainRecord) -> Option<String> {
    let iterations = record.config.iterations.saturating_sub(record.iterations);
    rate(record).map(|rate| spent(f64::from(iterations) / rate))
}

/// `12 000 of 30 000 iterations`, or how many where all are done.
fn progress(record: &TrainRecord) -> String {
    match record.status {
        Status::Complete => counted(record.iterations as usize, "iteration"),
        _ => format!("{} of {}", count(record.iterations), counted(record.config.iterations as usize, "iteration")),
    }
}

fn title(record: &TrainRecord) -> String {
    let name = escape(telling_name(&record.photos.capture));
    match record.status {
        Status::Running => {
            let share = f64::from(record.iterations) / f64::from(record.config.iterations.max(1));
            format!("{:.0} % of {name}", (100.0 * share).floor())
        }
        _ => format!("{name}: {}", counted(record.splats as usize, "splat")),
    }
}

fn heading(record: &TrainRecord) -> String {
    let badge = match record.status {
        Status::Running => r#"<span class="badge running">running</span>"#.into(),
        Status::Complete => r#"<span class="badge">complete</span>"#.into(),
        Status::Interrupted => {
            format!(r#"<span class="badge warn">stopped after {}</span>"#, count(record.iterations))
        }
        Status::Failed => format!(r#"<span class="badge warn">failed after {}</span>"#, count(record.iterations)),
    };
    let line = format!(
        "{}; {}; seed {}; camsplat {}",
        record.photos.capture, record.device, record.config.seed, record.version
    );
    let mut html = format!(
        "<h1>{} {badge}</h1>\n<p class=\"lead\">{} after {}</p>\n<p class=\"line\">{}</p>\n",
        escape(telling_name(&record.photos.capture)),
        counted(record.splats as usize, "splat"),
        progress(record),
        escape(&line)
    );
    let (class, notice) = match record.status {
        Status::Complete => {
            for line in [record.diverged_line(), record.overfitted_line(), record.short_line()].into_iter().flatten() {
                let _ = writeln!(html, "<p class=\"notice\" role=\"status\">Warning: {}.</p>", escape(&line));
            }
            return html;
        }
        Status::Running => (
            "line",
            format!(
                "This page reloads itself every {REFRESH} s while the run goes on. Where nothing changes any more, its \
                 process was killed."
            ),
        ),
        Status::Interrupted => (
            "notice",
            format!("The run was stopped after {}. This is its state then; it can be resumed.", progress(record)),
        ),
        Status::Failed => (
            "notice",
            format!(
                "The device failed or its memory ran out, some time after {}. The run can be resumed from its last \
                 checkpoint, where it has one.",
                progress(record)
            ),
        ),
    };
    let _ = write!(
        html,
        "<progress max=\"{}\" value=\"{}\" aria-label=\"Iterations\"></progress>\n\
         <p class=\"{class}\" role=\"status\">{notice}</p>\n",
        record.config.iterations, record.iterations
    );
    html
}

/// Why there is nothing of test views: because none will come, or because of `so_far`.
fn untested<'a>(record: &TrainRecord, so_far: &'a str) -> &'a str {
    if record.photos.test == 0 { "No photos were kept back to test with." } else { so_far }
}

/// The most important numbers.
fn figures(record: &TrainRecord) -> String {
    let last = record.evaluations.last();
    let quality = last.map(|evaluation| evaluation.quality);
    let unmeasured = if record.photos.test == 0 { "no photos kept back" } else { "not measured yet" };
    let tested = last.map_or(unmeasured.into(), |evaluation| {
        format!("{} after {}", counted(evaluation.views, "test view"), count(evaluation.iteration))
    });
    let beside = |text: &str| if quality.is_some() { text.into() } else { unmeasured.into() };
    let lpips = quality.and_then(|q| q.lpips);
    let done = format!("{:.1} %", 100.0 * f64::from(record.iterations) / f64::from(record.config.iterations.max(1)));
    let spent = spent(record.seconds);
    let time = match record.status {
        Status::Running => ("Time left", left(record).unwrap_or("–".into()), format!("after {spent}")),
        _ => ("Training time", spent, format!("for {}", counted(record.seconds_for as usize, "iteration"))),
    };
    let [peak, announced] =
        [record.memory.peak, record.memory.announced].map(|size| Some(size).filter(|size| *size > 0));
    let announced = announced.map_or("not announced yet".into(), |size| format!("{} announced", bytes(size)));
    let figures: [(&str, String, String); 8] = [
        ("Test PSNR", measure(quality.map(|q| q.psnr), 2, " dB"), tested),
        ("Test SSIM", measure(quality.map(|q| q.ssim), 4, ""), beside("1 is the best")),
        (
            "Test LPIPS",
            measure(lpips, 4, ""),
            if quality.is_some() && lpips.is_none() { "not measured".into() } else { beside("AlexNet; 0 is the best") },
        ),
        ("Splats", count(record.splats), format!("{} at most", count(record.config.max_splats))),
        ("Iterations", count(record.iterations), format!("{done} of {}", count(record.config.iterations))),
        ("Rate", rate(record).map_or("–".into(), number), "iterations a second".into()),
        time,
        ("Peak of device memory", peak.map_or("–".into(), bytes), announced),
    ];
    let figure = |(name, value, beside): &(&str, String, String)| {
        format!(
            "<div class=\"figure\"><span class=\"name\">{name}</span><strong>{value}</strong><span>{beside}</span></div>\n"
        )
    };
    figures.iter().map(figure).collect()
}

fn nothing(what: &str) -> String {
    format!("<p class=\"nothing\">{what}</p>\n")
}

/// The three metrics as text.
fn metrics(quality: &Quality) -> [String; 3] {
    [measure(Some(quality.psnr), 2, ""), measure(Some(quality.ssim), 4, ""), measure(quality.lpips, 4, "")]
}

fn comparisons(record: &TrainRecord, worst: &[Comparison]) -> Result<String> {
    let mut html = String::new();
    for (comparison, shown) in worst.iter().zip(shown(worst)?) {
        let name = escape(comparison.name);
        let view = record.test_views.iter().find(|view| view.name == comparison.name);
        let _ = write!(html, "<article class=\"comparison\" data-view=\"{name}\">\n<h3>{name}");
        if let Some(view) = view {
            let [psnr, ssim, lpips] = metrics(&view.quality);
            let _ = write!(html, "<span>PSNR {psnr} dB</span><span>SSIM {ssim}</span><span>LPIPS {lpips}</span>");
        }
        html.push_str("</h3>\n<div>\n");
        let difference = format!("absolute difference × {GAIN}");
        let [width, height] = shown.size;
        for (what, url) in ["rendered", "photo", &difference].iter().zip(&shown.urls) {
            let _ = writeln!(
                html,
                "<figure><img src=\"{url}\" width=\"{width}\" height=\"{height}\" alt=\"{name}, {what}\">\
                 <figcaption>{what}</figcaption></figure>"
            );
        }
        html.push_str("</div>\n</article>\n");
    }
    Ok(html)
}

/// A table of metrics, whose first column is headed `what`.
fn quality_table<'a>(what: &str, rows: impl Iterator<Item = (String, &'a Quality)>) -> String {
    let mut html =
        format!("<div class=\"scroll tall\" tabindex=\"0\"><table>\n<thead><tr><th scope=\"col\">{what}</th>");
    for metric in ["PSNR (dB)", "SSIM", "LPIPS"] {
        let _ = write!(html, "<th scope=\"col\">{metric}</th>");
    }
    html.push_str("</tr></thead>\n<tbody>\n");
    for (name, quality) in rows {
        let [psnr, ssim, lpips] = metrics(quality);
        let name = escape(&name);
        let _ = writeln!(html, "<tr><th scope=\"row\">{name}</th><td>{psnr}</td><td>{ssim}</td><td>{lpips}</td></tr>");
    }
    html + "</tbody></table></div>\n"
}

fn views(record: &TrainRecord) -> String {
    if record.test_views.is_empty() {
        return nothing(untested(record, "No test view was looked at yet."));
    }
    quality_table("Photo", record.test_views.iter().map(|view| (view.name.clone(), &view.quality)))
}

fn evaluations(record: &TrainRecord) -> String {
    if record.evaluations.is_empty() {
        return nothing(untested(record, "No evaluation was made yet."));
    }
    let after = |evaluation: &Evaluation| count(evaluation.iteration);
    quality_table("After", record.evaluations.iter().map(|evaluation| (after(evaluation), &evaluation.quality)))
}

/// A row of a table of bars.
struct Bar {
    class: &'static str,
    name: String,
    value: f64,
    /// The value with its unit.
    text: String,
}

/// Bars of the largest of `parts`, and one of all the others; `show` gives a value its unit.
fn largest(parts: impl Iterator<Item = (String, f64)>, show: impl Fn(f64) -> String) -> Vec<Bar> {
    let mut parts: Vec<_> = parts.filter(|(_, value)| value.is_finite()).collect();
    parts.sort_by(|a, b| b.1.total_cmp(&a.1));
    let rest = parts.split_off(parts.len().min(MAX_BARS));
    let bar = |(name, value): (String, f64)| Bar { class: "", name, text: show(value), value };
    let mut bars: Vec<_> = parts.into_iter().map(bar).collect();
    if !rest.is_empty() {
        let others = if rest.len() == 1 { "1 other".into() } else { format!("{} others", rest.len()) };
        bars.push(Bar { class: "rest", ..bar((others, rest.iter().map(|(_, value)| value).sum())) });
    }
    bars
}

/// A table of bars on one scale, each with its share of `whole`.
fn bar_table(bars: &[Bar], whole: f64, caption: &str) -> String {
    let longest = bars.iter().map(|bar| bar.value).fold(0.0, f64::max);
    let percent = |value: f64, of: f64| if of > 0.0 { 100.0 * value / of } else { 0.0 };
    let mut html = String::from("<div class=\"scroll\"><table class=\"bars\"><tbody>\n");
    for Bar { class, name, value, text } in bars {
        let _ = writeln!(
            html,
            "<tr class=\"{class}\"><th scope=\"row\">{}</th><td><i style=\"width:{:.2}%\"></i></td><td>{text}</td>\
             <td>{:.1} %</td></tr>",
            escape(name),
            percent(*value, longest),
            percent(*value, whole)
        );
    }
    let _ = writeln!(html, "</tbody><caption>{caption}</caption></table></div>");
    html
}

fn stages(record: &TrainRecord) -> String {
    if record.stages.is_empty() {
        return nothing("No stage was timed yet.");
    }
    let show = |ms: f64| format!("{ms:.3} ms");
    let bars = largest(record.stages.iter().map(|stage| (stage.name.clone(), stage.ms)), show);
    let sum: f64 = bars.iter().map(|bar| bar.value).sum();
    let mut caption = format!("{} in all.", show(sum));
    if let Some(rate) = rate(record).filter(|_| sum > 0.0) {
        let wall = 1000.0 / rate;
        let gap = if wall > sum {
            format!("{} of {}, {:.1} %, the GPU waits", show(wall - sum), show(wall), 100.0 * (1.0 - sum / wall))
        } else {
            "the GPU hardly waits".into()
        };
        let (alone, rate) = (number(1000.0 / sum), number(rate));
        let _ = write!(
            caption,
            " The GPU alone would make {alone} iterations a second; the run makes {rate}: {gap} for the host."
        );
    }
    bar_table(&bars, sum, &caption)
}

fn memory(record: &TrainRecord) -> String {
    let memory = &record.memory;
    if memory.announced == 0 && memory.peak == 0 && memory.buffers.is_empty() {
        return nothing("No memory was announced yet.");
    }
    let total =
        |name: &str, value: u64| Bar { class: "total", name: name.into(), value: value as f64, text: bytes(value) };
    let mut bars = vec![total("announced", memory.announced), total("peak", memory.peak)];
    let buffers = memory.buffers.iter().map(|(name, size)| (name.clone(), *size as f64));
    bars.extend(largest(buffers, |size| bytes(size as u64)));
    bar_table(&bars, memory.announced as f64, "Shares are of what the dry run announces, buffer by buffer.")
}

fn summary(record: &TrainRecord) -> String {
    let TrainRecord { photos, config, .. } = record;
    let [width, height] = photos.largest;
    let shrunk = match photos.shrink {
        0 | 1 => String::new(),
        shrink => format!(", shrunk {shrink} times"),
    };
    let start = match photos.points {
        0 => "random splats".into(),
        points => format!("{} of the capture", counted(points, "point")),
    };
    let schedule = config.schedule(photos.train);
    let refinements = format!(
        "every {}, from {} to {}",
        counted(schedule.refine_every as usize, "iteration"),
        count(schedule.refine_from),
        count(schedule.refine_until)
    );
    let rows = [
        ("Capture", photos.capture.clone()),
        ("Photos", format!("{} to train on, {} to test with", grouped(photos.train), grouped(photos.test))),
        ("Largest picture", format!("{width} × {height} pixels{shrunk}")),
        ("Start", start),
        ("Extent of the cameras", format!("{}, in units of the capture", number(photos.extent))),
        ("Iterations", count(config.iterations)),
        ("Splats", format!("{} at most", count(config.max_splats))),
        ("Strategy", strategy(config).into()),
        ("Refinements", refinements),
        ("Harmonics", format!("degree {}", config.degree)),
        ("Background", background(config).into()),
        ("Anti-aliasing", if config.antialiased { "on" } else { "off" }.into()),
        (
            "What masks leave out",
            if config.masks == Masks::Ignore { "counts for nothing" } else { "is background" }.into(),
        ),
        ("Exposures of photos", exposures(config).into()),
        ("Poses of photos", poses(record)),
        ("Suppression of floaters", if config.suppress_floaters { "on" } else { "off" }.into()),
        ("Seed", config.seed.to_string()),
        ("Device", record.device.clone()),
        ("Version", format!("camsplat {}", record.version)),
    ];
    let row = |(term, text): &(&str, String)| format!("<div><dt>{term}</dt><dd>{}</dd></div>\n", escape(text));
    rows.iter().map(row).collect()
}

fn exposures(config: &TrainConfig) -> &'static str {
    match config.exposure {
        true => "learnt; each half of a test view is shown with the one that fits its other half",
        false => "taken as they are",
    }
}

fn poses(record: &TrainRecord) -> String {
    match record.poses_line() {
        Some(line) => format!("{line}; in the last evaluation those of test views are corrected too"),
        None if record.config.refine_poses => "corrected".into(),
        None => "taken as they are".into(),
    }
}

fn strategy(config: &TrainConfig) -> &'static str {
    match config.strategy {
        Strategy::Mcmc => "MCMC: dead splats move to living ones",
        Strategy::Adc => "adaptive density control: clone, split and prune by gradients",
    }
}

fn background(config: &TrainConfig) -> &'static str {
    match config.background {
        Background::Black => "black",
        Background::White => "white",
        Background::Random => "another colour in every iteration; black in tests",
    }
}

//! Pages of what has no report of its own: a capture, trained splats, a folder of runs.

use std::fmt::Write;

use glam::DVec3;
use serde::Serialize;

use super::choice::pictures;
use super::document::{Document, SCENE3D, SPLATS};
use super::layouts;
use super::scene_data::SceneData;
use super::splats::{Model, ModelData};
use super::text::{address, escape, grouped};
use crate::files::photos::PhotoSet;
use crate::scene::gaussians::Gaussians;
use crate::{Error, Result};

/// A page that a run has left.
pub struct Run {
    /// Path of its report, relative to the page that lists it.
    pub report: String,
    /// Title of its report.
    pub title: String,
    /// When it was written, in seconds since 1970.
    pub written: u64,
}

/// What the page draws from.
#[derive(Default, Serialize)]
struct Data<'a> {
    scene: Option<SceneData<'a>>,
    model: Option<ModelData<'a>>,
}

/// The page of a capture: cameras and points in 3D, and its photos.
///
/// # Errors
/// [`Error::Request`] if the capture has no photos.
pub fn capture(title: &str, set: &PhotoSet) -> Result<String> {
    let cameras = set.cameras();
    let scene = layouts::capture(&cameras, &set.points);
    let scene = scene.ok_or_else(|| Error::request(format!("{title}: there are no photos to show")))?;
    let points = match set.points.positions.len() {
        0 => "no points".into(),
        count => format!("{} points", grouped(count)),
    };
    let mut body = format!("<section>\n<h2>Cameras and points</h2>\n{}</section>\n", include_str!("scene.html"));
    let shown: Vec<(usize, String)> =
        pictures(&set.photos)?.into_iter().enumerate().filter_map(|(i, url)| Some((i, url?))).collect();
    if !shown.is_empty() {
        body +=
            "<section>\n<h2>Photos</h2>\n<p>Click a photo to look through its camera.</p>\n<div class=\"photos\">\n";
        for (camera, url) in &shown {
            let name = escape(&cameras[*camera].name);
            let _ = writeln!(
                body,
                "<button type=\"button\" data-camera=\"{camera}\"><img src=\"{url}\" alt=\"{name}\" loading=\"lazy\"><small>{name}\
                 </small></button>"
            );
        }
        body += "</div>\n</section>\n";
    }
    let missing = match cameras.len() - shown.len() {
        0 => String::new(),
        missing => {
            format!("; {missing} have no picture on this page: their images are missing, or would make it too large")
        }
    };
    let line = format!("{} photos, {points}{missing}", grouped(cameras.len()));
    page(title, &line, &body, &Data { scene: Some(scene), model: None })
}

/// The page of trained splats from any program, upright along `up`.
///
/// # Errors
/// [`Error::Request`] if there are none.
pub fn model(title: &str, gaussians: &Gaussians, up: DVec3) -> Result<String> {
    if gaussians.is_empty() {
        return Err(Error::request(format!("{title}: there are no splats to show")));
    }
    let model = Model::new(gaussians, &[], &[]);
    let body = format!("<section>\n<h2>Trained splats</h2>\n{}</section>\n", include_str!("splats.html"));
    let line = format!(
        "{} splats; colours are shown without their change with the direction of view",
        grouped(gaussians.len())
    );
    page(title, &line, &body, &Data { scene: None, model: Some(model.alone(up)) })
}

/// The page of the expected quality of ever more views, with the curve as it was drawn.
///
/// # Errors
/// None that can be met: what is on the page is text.
pub fn curve(title: &str, svg: &str) -> Result<String> {
    let body = format!("<section>\n<h2>How many views are worth taking</h2>\n{svg}</section>\n");
    page(title, "The expected quality of plans with ever more views", &body, &Data::default())
}

/// The page that lists the reports of runs.
///
/// # Errors
/// None that can be met: what is on the page is text.
pub fn runs(title: &str, runs: &[Run]) -> Result<String> {
    let mut body = String::from(
        "<section>\n<h2>Runs</h2>\n<div class=\"scroll\"><table>\n<thead><tr><th scope=\"col\">Folder</th><th scope=\"col\">What it shows</th>\
         <th scope=\"col\">Written</th></tr></thead>\n<tbody>\n",
    );
    for Run { report, title, written } in runs {
        let folder = report.rsplit_once('/').map_or(report.as_str(), |(folder, _)| folder);
        let (folder, link) = (escape(folder), address(report));
        let _ = writeln!(
            body,
            "<tr><th scope=\"row\"><a href=\"{link}\">{folder}</a></th><td>{}</td><td><time data-seconds=\"{written}\"></time></td></tr>",
            escape(title)
        );
    }
    body += "</tbody></table></div>\n</section>\n";
    page(title, &format!("{}, the newest first", reports(runs.len())), &body, &Data::default())
}

/// So many reports, in words.
pub fn reports(count: usize) -> String {
    format!("{} report{}", grouped(count), if count == 1 { "" } else { "s" })
}

fn page(title: &str, line: &str, body: &str, data: &Data) -> Result<String> {
    let title = escape(title);
    let document = Document {
        kind: "view",
        pictures: false,
        refresh: None,
        title: &title,
        style: concat!(
            include_str!("training.css"),
            "[data-kind=\"view\"] th, [data-kind=\"view\"] td { text-align: left; }\n"
        ),
        heading: &format!("<h1>{title}</h1>\n<p class=\"line\">{}</p>", escape(line)),
        body,
        scripts: &[SCENE3D, SPLATS, include_str!("view.js")],
        draw: "drawView",
    };
    document.html(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a folder named like markup would run scripts in the browser of whoever lists it, or its link lead nowhere.
    #[test]
    fn names_of_runs_are_text() {
        let run = Run { report: "<b>50%#1/report.html".into(), title: "<script>alert(1)</script>".into(), written: 0 };
        let page = runs("a<b", &[run]).unwrap();
        let body = page.split("<main>").nth(1).and_then(|rest| rest.split("</main>").next()).unwrap();
        assert!(body.contains("href=\"&lt;b&gt;50%25%231/report.html\">&lt;b&gt;50%#1</a>"), "{body}");
        assert!(!body.contains("<b>50") && !body.contains("<script>"), "{body}");
        assert!(page.contains("<title>a&lt;b</title>"));
    }
}

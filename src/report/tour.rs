//! The page of a demo: what was done, step by step, with its photographs, the surface, and the scores.
//!
//! Pictures are not embedded: the page lies in the demo's folder and shows the files that the steps left there.

use std::fmt::Write;
use std::path::Path;

use super::evaluation::{STYLE, pictures, table};
use super::folder;
use super::text::{address, escape};
use crate::Result;
use crate::evaluate::results::measured;
use crate::evaluate::tour::{Step, Tour};
use crate::io::folder::{OutputFolder, write_files};

/// Where the plan's own folder and the picture of the scores lie in the scene's folder.
const PLAN: &str = "plan";
const SCORES: &str = "scores.png";

/// Writes the page into `out`, the folder that holds the scene's, and into this one the plan's own folder and a picture of the
/// scores. `plans` are folders in `out` with reports of other plans, and what these are of.
///
/// # Errors
/// When the files cannot be written.
pub fn write(tour: &Tour, out: &Path, plans: &[(&str, &str)]) -> Result<()> {
    let scene = out.join(&tour.name);
    folder::write(&tour.plan, &tour.target, OutputFolder::create(&scene.join(PLAN), true)?)?;
    let page = html(tour, plans);
    write_files(&[(&scene.join(SCORES), &tour.scores), (&out.join("report.html"), page.as_bytes())])
}

fn html(tour: &Tour, plans: &[(&str, &str)]) -> String {
    let name = escape(&tour.name);
    let mut page = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>camsplat demo</title>\n\
         <style>{STYLE} .small img{{width:6.5em}} .small figure{{margin:.15em}} .wide img{{width:100%}}</style>\n\
         <h1>camsplat demo</h1>\n<p>From a few photographs of an object to the places where cameras should stand, and what splats \
         are worth that are trained on photographs from there. Object, light and photographs are made by camsplat itself.</p>\n"
    );
    page += &steps(&tour.steps);
    let views = tour.photos.len();
    let _ = write!(
        page,
        "<h2>1. A few photographs</h2>\n<div class=\"small\">{}</div>\n\
         <h2>2. A surface of these photographs, and how much it changes with the view</h2>\n\
         <div class=\"wide\"><img src=\"{name}/{SCORES}\" alt=\"\"></div>\n\
         <p>Three views; dark looks the same from everywhere, bright shines. The bar is the scale of scores from 1 to 2.</p>\n\
         <h2>3. The plan: {views} views</h2>\n<p><a href=\"{name}/{PLAN}/report.html\">Surface and cameras in 3D, and how the \
         plan came about</a></p>\n\
         <h2>4. Photographs from the planned places</h2>\n<div class=\"small\">{}</div>\n\
         <h2>5. Splats trained on them, and on views at random</h2>\n\
         <p>Scores on views that nobody chose, nearer than all photographs (half), on the outer sphere (full) and in between in \
         any direction (random); PSNR in dB and SSIM are better when higher, LPIPS when lower. Training is short and there is one \
         run of each: see <code>camsplat evaluate</code> for a comparison that means something.</p>\n",
        gallery(&tour.name, &tour.inputs),
        gallery(&tour.name, &tour.photos),
    );
    let rows: Vec<_> = tour.outcome.rows.iter().collect();
    let (columns, sets) = (tour.outcome.kind.columns(), tour.outcome.kind.sets());
    measured(&tour.outcome.rows).for_each(|(metric, name)| page += &table(&rows, metric, name, &columns));
    page += &pictures(&tour.name, &tour.outcome.entries.iter().collect::<Vec<_>>(), sets);
    page += "<h2>Other plans</h2>\n<ul>\n";
    for (folder, of) in plans {
        let _ = writeln!(page, "<li><a href=\"{folder}/report.html\">{}</a></li>", escape(of));
    }
    page + "</ul>\n"
}

fn steps(steps: &[Step]) -> String {
    let mut text = String::from("<table><tr><th>step</th><th style=\"text-align:left\">what</th><th>s</th></tr>\n");
    for Step { name, what, seconds } in steps {
        let what = escape(what);
        let _ =
            writeln!(text, "<tr><td>{name}</td><td style=\"text-align:left\">{what}</td><td>{seconds:.1}</td></tr>");
    }
    text + "</table>\n"
}

/// Small pictures of the scene's folder.
fn gallery(scene: &str, files: &[String]) -> String {
    let picture =
        |file: &String| format!("<figure><img src=\"{}/{}\" alt=\"\"></figure>", address(scene), address(file));
    files.iter().map(picture).collect()
}

//! The page of a demo: the result in a sentence, the photographs of all methods side by side, what was trained on them, and the plan.
//!
//! Pictures are not embedded: the page lies in the demo's folder and shows the files that the steps left there.

use std::fmt::Write;
use std::path::Path;

use super::evaluation::{pictures, table};
use super::folder;
use super::text::{address, escape};
use crate::Result;
use crate::evaluate::demo::{Demo, METHODS, Step};
use crate::evaluate::results::measured;
use crate::io::folder::{OutputFolder, write_files};
use crate::methods::Method;

/// How the page looks.
const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:75em;padding:0 1em}\
     table{border-collapse:collapse;margin:1em 0}td,th{padding:.2em .8em;text-align:right;border-bottom:1px solid #ddd}\
     td:first-child,th:first-child{text-align:left}figure{display:inline-block;margin:.5em}\
     img{width:12em;image-rendering:pixelated}svg{max-width:100%}";

/// Where the plan's own folder lies in the scene's folder.
const PLAN: &str = "plan";

/// Writes the page into `out`, the folder that holds the scene's, and into this one the plan's own folder. `plans` are folders in `out`
/// with reports of other plans, and what these are of.
///
/// # Errors
/// When the files cannot be written.
pub fn write(demo: &Demo, out: &Path, plans: &[(&str, &str)]) -> Result<()> {
    folder::write(&demo.plan, &demo.target, OutputFolder::create(&out.join(&demo.name).join(PLAN), true)?)?;
    write_files(&[(&out.join("report.html"), html(demo, plans).as_bytes())])
}

fn html(demo: &Demo, plans: &[(&str, &str)]) -> String {
    let name = escape(&demo.name);
    let views = demo.plan.record.cameras.len();
    let mut page = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>camsplat demo</title>\n\
         <style>{STYLE} .small img{{width:6em}} .small figure{{margin:.15em}} .side{{display:flex;gap:1.5em}} \
         .side>div{{flex:1}} .main{{font-size:1.2em}}</style>\n\
         <h1>camsplat demo: two rooms, {views} photographs</h1>\n<p class=\"main\">{}</p>\n\
         <p>Rooms, light and photographs are made by camsplat itself. Training is short and there is one run of each: see \
         <code>camsplat evaluate</code> for a comparison that means something.</p>\n",
        escape(&demo.sentence())
    );
    page += "<h2>What was photographed</h2>\n<div class=\"side\">\n";
    for (placing, photos) in METHODS.iter().zip(&demo.photos) {
        let title = match placing {
            Method::Ours => "planned",
            Method::Grid => "on a grid at eye height",
            _ => "at random",
        };
        let _ = writeln!(page, "<div><h3>{title}</h3><div class=\"small\">{}</div></div>", gallery(&demo.name, photos));
    }
    let _ = write!(
        page,
        "</div>\n<p><a href=\"{name}/{PLAN}/report.html\">The plan: rooms and cameras in 3D, and where error is expected</a></p>\n\
         <h2>What splats show that were trained on it</h2>\n<p>Held-out views, anywhere in the rooms and in any direction. \
         PSNR in dB and SSIM are better when higher, LPIPS when lower.</p>\n"
    );
    let rows: Vec<_> = demo.outcome.rows.iter().collect();
    let columns = demo.outcome.kind.columns();
    let shown = demo.outcome.entries.first().map_or(0, |entry| entry.pictures.len());
    page += &pictures(&demo.name, &demo.outcome.entries.iter().collect::<Vec<_>>(), &vec!["held-out view"; shown]);
    measured(&demo.outcome.rows).for_each(|(metric, name)| page += &table(&rows, metric, name, &columns));
    page += "<h2>What was done</h2>\n";
    page += &steps(&demo.steps);
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

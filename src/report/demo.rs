//! The page of a demo: what the tool is for, held-out views as photographed and as splats show them, the figures, where the cameras
//! stood in 3D, and what they photographed.
//!
//! Pictures are not embedded: the page lies in the demo's folder and shows the files that the steps left there.

use std::fmt::Write;
use std::path::Path;

use image::GrayImage;
use serde::Serialize;

use super::folder;
use super::layouts;
use super::scene_data::{SceneData, in_script};
use super::text::{address, escape, fill};
use crate::evaluate::demo::{Demo, METHODS, Step, title};
use crate::evaluate::results::Entry;
use crate::evaluate::scene::Scene;
use crate::evaluate::table::DECIMALS;
use crate::io::folder::{OutputFolder, write_files};
use crate::scene::camera::Camera;
use crate::{Error, Result};

/// Where the plan's own folder lies in the scene's folder.
const PLAN: &str = "plan";
/// Held-out views that are shown.
const SHOWN: usize = 3;
/// Triangles of the 3D view.
const TRIANGLES: usize = 60_000;
/// A crop is this share of a picture's side, at the best of so many places a side.
const CROP: f64 = 0.375;
const PLACES: u32 = 6;

/// What the page draws from.
#[derive(Serialize)]
struct Data<'a> {
    scene: Option<SceneData<'a>>,
}

/// A held-out view that is shown.
struct View {
    /// Its file in the folders `test` and `reference` of each training.
    file: String,
    /// Upper left corner of the crop, in shares of the picture's sides.
    crop: [f64; 2],
    /// Mean difference of neighbouring pixels.
    detail: f64,
}

/// Writes the page into `out`, the folder that holds the scene's, and into this one the plan's own folder.
///
/// # Errors
/// When a test picture cannot be read any more, or the files cannot be written.
pub fn write(demo: &Demo, scene: &Scene, out: &Path) -> Result<()> {
    folder::write(&demo.plan, &demo.target, OutputFolder::create(&out.join(&demo.name).join(PLAN), true)?)?;
    write_files(&[(&out.join("report.html"), html(demo, scene, out)?.as_bytes())])
}

fn html(demo: &Demo, scene: &Scene, out: &Path) -> Result<String> {
    let entries = &demo.outcome.entries;
    let cameras: Vec<(&str, &[Camera])> =
        METHODS.iter().zip(entries).map(|(method, entry)| (title(*method), &entry.cameras[..])).collect();
    let data = Data { scene: layouts::of_scene(scene, &cameras, TRIANGLES) };
    let data = serde_json::to_string(&data).map_err(|e| Error::request(format!("the report's data: {e}")))?;
    let views = views(demo, out)?;
    Ok(fill(include_str!("demo.html"), |slot| match slot {
        "css" => include_str!("page.css").into(),
        "demo-css" => include_str!("demo.css").into(),
        "heading" => heading(demo).into(),
        "views" => views.as_str().into(),
        "figures" => figures(demo).into(),
        "scene" => include_str!("scene.html").into(),
        "plan" => format!("{}/{PLAN}/report.html", address(&demo.name)).into(),
        "photos" => photos(demo).into(),
        "steps" => steps(&demo.steps).into(),
        "data" => in_script(&data).into(),
        "charts" => include_str!("charts.js").into(),
        "vectors" => include_str!("vectors.js").into(),
        "views-js" => include_str!("views.js").into(),
        "webgl" => include_str!("webgl.js").into(),
        "scene3d" => include_str!("scene3d.js").into(),
        "fault" => include_str!("fault.js").into(),
        _ => String::new().into(),
    }))
}

fn heading(demo: &Demo) -> String {
    let count = demo.plan.record.cameras.len();
    format!(
        "<h1>Where should the cameras stand?</h1>\n\
         <p class=\"lead\">camsplat takes the rough shape of a place and a number of photos, and says where to take them so that a 3D model \
         trained on them looks right from everywhere. Here, two rooms were photographed {count} times in each of three ways, a model was \
         trained on each set of photos, and all three were asked for views that nobody photographed.</p>\n\
         <p class=\"lead\">{}</p>\n",
        escape(&demo.sentence())
    )
}

/// The held-out views with the most detail, which does not depend on what was trained.
fn views(demo: &Demo, out: &Path) -> Result<String> {
    let entries = &demo.outcome.entries;
    let Some(first) = entries.first() else { return Ok(String::new()) };
    let path = |entry: &Entry, of: &str, file: &str| format!("{}/{}/{of}/{file}", demo.name, entry.folder);
    let mut views = Vec::new();
    for file in &first.pictures {
        let place = out.join(path(first, "reference", file));
        let picture = image::open(&place).map_err(|e| Error::input(&place, e.to_string()))?;
        views.push(view(file.clone(), &picture.into_luma8()));
    }
    views.sort_by(|a, b| b.detail.total_cmp(&a.detail));
    let mut text = format!(
        "<section>\n<h2>Views that nobody photographed</h2>\n<p class=\"line\">Of {} held-out views the {} with the most detail; below \
         each, a part enlarged, and how far it is from the photo.</p>\n",
        views.len(),
        SHOWN.min(views.len())
    );
    for View { file, crop, .. } in views.iter().take(SHOWN) {
        let photo = address(&path(first, "reference", file));
        let _ = write!(
            text,
            "<div class=\"view\">\n<figure><figcaption>photo</figcaption><img src=\"{photo}\" alt=\"a held-out view, photographed\">{}\
             <p class=\"error\">Right: the difference to this photo. Black is none.</p></figure>\n",
            cropped(&photo, *crop)
        );
        for (method, entry) in METHODS.iter().zip(entries) {
            let (shown, title) = (address(&path(entry, "test", file)), title(*method));
            let _ = writeln!(
                text,
                "<figure><figcaption>{title}</figcaption><img src=\"{shown}\" alt=\"the same view by the model of photos: {title}\">{}\
                 <div class=\"error\"><img src=\"{photo}\" alt=\"\"><img src=\"{shown}\" alt=\"\"></div></figure>",
                cropped(&shown, *crop)
            );
        }
        text += "</div>\n";
    }
    Ok(text + "</section>\n")
}

/// A part of a picture at the size of the whole.
fn cropped(picture: &str, [x, y]: [f64; 2]) -> String {
    // A position in percent is of what the picture is larger than its frame.
    let at = |share: f64| 100.0 * share / (1.0 - CROP);
    format!(
        "<div class=\"crop\" style=\"background-image:url('{}');background-size:{:.1}%;background-position:{:.1}% {:.1}%\"></div>",
        picture.replace('\'', "%27"),
        100.0 / CROP,
        at(x),
        at(y)
    )
}

/// How much there is to see in a picture, and where the most of it is.
fn view(file: String, picture: &GrayImage) -> View {
    let (width, height) = picture.dimensions();
    let level = |x: u32, y: u32| f64::from(picture.get_pixel(x, y).0[0]);
    let step = |x: u32, y: u32| {
        let (right, below) = ((x + 1).min(width - 1), (y + 1).min(height - 1));
        (level(right, y) - level(x, y)).abs() + (level(x, below) - level(x, y)).abs()
    };
    let detail = |left: u32, top: u32, right: u32, bottom: u32| {
        let sum: f64 = (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y))).map(|(x, y)| step(x, y)).sum();
        sum / f64::from(((right - left) * (bottom - top)).max(1))
    };
    let side = |length: u32| ((f64::from(length) * CROP) as u32).max(1);
    let (crop_width, crop_height) = (side(width), side(height));
    let corner = |i: u32| {
        let part = |place: u32, room: u32| room * place / (PLACES - 1);
        [part(i % PLACES, width - crop_width), part(i / PLACES, height - crop_height)]
    };
    let of = |[x, y]: [u32; 2]| detail(x, y, x + crop_width, y + crop_height);
    let best = (0..PLACES * PLACES).map(corner).max_by(|a, b| of(*a).total_cmp(&of(*b))).unwrap_or_default();
    let crop = [f64::from(best[0]) / f64::from(width), f64::from(best[1]) / f64::from(height)];
    View { file, crop, detail: detail(0, 0, width, height) }
}

/// What was measured of the planned photos and, smaller, of the others.
fn figures(demo: &Demo) -> String {
    let mut text = String::new();
    let mut figure = |name: &str, value: &str, beside: &str| {
        let _ = writeln!(
            text,
            "<div class=\"figure\"><span>{name}</span><strong>{value}</strong><span>{beside}</span></div>"
        );
    };
    let metrics = [("PSNR, higher is better", " dB"), ("SSIM, higher is better", ""), ("LPIPS, lower is better", "")];
    for (metric, (name, unit)) in metrics.into_iter().enumerate() {
        let of = |row: usize| {
            let measured = demo.outcome.rows.get(row).and_then(|row| row.measured[metric].first().copied().flatten());
            measured.map_or_else(|| "–".into(), |value| format!("{:.*}{unit}", DECIMALS[metric].min(3), value.mean))
        };
        figure(name, &of(0), &format!("{} {}, {} {}", title(METHODS[1]), of(1), title(METHODS[2]), of(2)));
    }
    if let Some(expected) = &demo.plan.record.expected {
        let reference = escape(&expected.against);
        figure("Expected before a photo was taken", &format!("{:+.1} dB", expected.db), &format!("over {reference}"));
    }
    text
}

/// All photos, a column for each way to take them.
fn photos(demo: &Demo) -> String {
    let mut text = String::from("<div class=\"taken\">\n");
    for (method, photos) in METHODS.iter().zip(&demo.photos) {
        let _ = write!(text, "<div><h3>{}</h3><div>", title(*method));
        for file in photos {
            let _ = write!(text, "<img src=\"{}\" alt=\"\">", address(&format!("{}/{file}", demo.name)));
        }
        text += "</div></div>\n";
    }
    text + "</div>\n"
}

fn steps(steps: &[Step]) -> String {
    let mut text = String::from("<div class=\"scroll\"><table><tbody>\n");
    for Step { name, what, seconds } in steps {
        let _ =
            writeln!(text, "<tr><th scope=\"row\">{name}</th><td>{}</td><td>{seconds:.1} s</td></tr>", escape(what));
    }
    text + "</tbody></table></div>\n\
            <p class=\"line\">Rooms, light and photos are made by camsplat itself. Training is short and there is one run of each: \
            <code>camsplat evaluate</code> makes a comparison that means something.</p>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, plain walls would be shown enlarged, or a crop reach out of its picture.
    #[test]
    fn the_crop_lies_where_there_is_most_to_see() {
        let picture = |busy: [u32; 2]| {
            GrayImage::from_fn(64, 64, |x, y| {
                let inside = [x, y].iter().zip(busy).all(|(v, low)| (low..low + 16).contains(v));
                image::Luma([if inside && (x + y) % 2 == 0 { 255 } else { 90 }])
            })
        };
        let plain = view(String::new(), &GrayImage::new(64, 64));
        for busy in [[0, 0], [48, 0], [20, 44], [48, 48]] {
            let View { crop, detail, .. } = view(String::new(), &picture(busy));
            assert!(detail > plain.detail);
            for (low, busy) in crop.into_iter().zip(busy) {
                let (low, high) = (64.0 * low, 64.0 * (low + CROP));
                assert!(low >= 0.0 && high <= 64.0 && low <= f64::from(busy + 4) && high >= f64::from(busy + 12));
            }
        }
        assert!(
            cropped("a'b.png", [0.0, 1.0 - CROP])
                .contains("url('a%27b.png');background-size:266.7%;background-position:0.0% 100.0%")
        );
    }
}

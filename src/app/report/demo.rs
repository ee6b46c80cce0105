//! The page of a demo: what the tool is for, held-out views as photographed and as splats show them, the figures, where the cameras
//! stood in 3D, and what they photographed.
//!
//! Pictures are not embedded: the page lies in the demo's folder and shows the files that the steps left there.

use std::fmt::Write;
use std::path::Path;

use image::RgbImage;
use serde::Serialize;

use super::document::{Document, SCENE3D};
use super::folder;
use super::layouts;
use super::scene_data::SceneData;
use super::text::{address, escape, fill};
use crate::files::io::folder::{OutputFolder, write_files};
use crate::lab::evaluate::demo::{Demo, METHODS, Step, title};
use crate::lab::evaluate::results::Entry;
use crate::lab::evaluate::scene::Scene;
use crate::lab::evaluate::table::DECIMALS;
use crate::planner::methods::Method;
use crate::planner::quality::expected::decibels;
use crate::scene::camera::Camera;
use crate::{Error, Result};

/// Where the plan's own folder lies in the scene's folder.
const PLAN: &str = "plan";
/// Which held-out views are shown, in the order of what planning gains in them, and how they are called.
const SHOWN: [&str; 3] = ["Where planning helps most", "A typical view", "Where planning helps least"];
/// Triangles of the 3D view.
const TRIANGLES: usize = 60_000;
/// A crop is this share of a picture's side, at the best of so many places a side.
const CROP: f64 = 0.375;
const PLACES: u32 = 6;
/// Pictures of fewer pixels a side are small.
const SMALL: u32 = 400;

/// What the page draws from.
#[derive(Serialize)]
struct Data<'a> {
    scene: Option<SceneData<'a>>,
}

/// A held-out view.
struct View {
    /// Its file in the folders `test` and `reference` of each training.
    file: String,
    /// How much there is to see in the photo.
    detail: f64,
    /// PSNR of each method's model.
    psnr: Vec<f64>,
    /// Upper left corner of the crop, in shares of the picture's sides.
    crop: [f64; 2],
}

impl View {
    /// Decibels of the planned photos over the best others.
    fn gain(&self) -> f64 {
        self.psnr[0] - self.psnr[1..].iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }
}

/// Writes the page into `out`, the folder that holds the scene's, and into this one the plan's own folder.
///
/// # Errors
/// When a test picture cannot be read any more, or the files cannot be written.
pub fn write(demo: &Demo, scene: &Scene, out: &Path) -> Result<()> {
    folder::write(&demo.plan, &demo.target, None, OutputFolder::create(&out.join(&demo.name).join(PLAN), true)?)?;
    write_files(&[(&out.join("report.html"), html(demo, scene, out)?.as_bytes())])
}

fn html(demo: &Demo, scene: &Scene, out: &Path) -> Result<String> {
    let entries = &demo.outcome.entries;
    let cameras: Vec<(&str, &[Camera])> =
        METHODS.iter().zip(entries).map(|(method, entry)| (title(*method), &entry.cameras[..])).collect();
    let data = Data { scene: layouts::of_scene(scene, &cameras, TRIANGLES) };
    let views = views(demo, out)?;
    let body = fill(include_str!("demo.html"), |slot| match slot {
        "views" => views.as_str().into(),
        "figures" => figures(demo).into(),
        "scene" => include_str!("scene.html").into(),
        "plan" => format!("{}/{PLAN}/report.html", address(&demo.name)).into(),
        "photos" => photos(demo).into(),
        "steps" => steps(&demo.steps).into(),
        _ => String::new().into(),
    });
    let document = Document {
        kind: "demo",
        pictures: true,
        refresh: None,
        title: "camsplat: where should the cameras stand?",
        style: include_str!("demo.css"),
        heading: &heading(demo),
        body: &body,
        scripts: &[SCENE3D],
        draw: "({ scene }) => scene && drawScene(scene, document.querySelector(\".scene\"))",
    };
    document.html(&data)
}

fn heading(demo: &Demo) -> String {
    let cameras = &demo.plan.record.cameras;
    let small = match cameras.first() {
        Some(camera) if camera.intrinsics.width < SMALL => {
            "<p class=\"line\">Photos are small and training is short here, so that it takes a minute or two without a GPU: all three models \
             are blurred. Look for holes and smears.</p>\n"
        }
        _ => "",
    };
    format!(
        "<h1>Where should the cameras stand?</h1>\n\
         <p class=\"lead\">camsplat takes the rough shape of a place and a number of photos, and says where to take them so that a 3D model \
         trained on them looks right from everywhere. Here, two rooms were photographed {} times in each of three ways, a model was \
         trained on each set of photos, and all three were asked for views that none of them was trained on.</p>\n\
         <p class=\"lead\">{}</p>\n{small}",
        cameras.len(),
        escape(&demo.sentence())
    )
}

/// What the columns of models are called.
fn column(method: Method, views: usize) -> String {
    match method {
        Method::Ours => format!("{views} planned photos"),
        Method::Grid => format!("{views} on a grid"),
        _ => format!("{views} random photos"),
    }
}

/// Of the views with much to see, those in which planning gains most, a middling amount and least.
fn views(demo: &Demo, out: &Path) -> Result<String> {
    let entries = &demo.outcome.entries;
    let Some(first) = entries.first() else { return Ok(String::new()) };
    let count = demo.plan.record.cameras.len();
    let path = |entry: &Entry, of: &str, file: &str| format!("{}/{}/{of}/{file}", demo.name, entry.folder);
    let read = |entry: &Entry, of: &str, file: &str| {
        let place = out.join(path(entry, of, file));
        image::open(&place).map(|picture| picture.into_rgb8()).map_err(|e| Error::input(&place, e.to_string()))
    };
    let mut views = Vec::new();
    for (i, file) in first.pictures.iter().enumerate() {
        let photo = read(first, "reference", file)?;
        let models: Vec<RgbImage> = entries.iter().map(|entry| read(entry, "test", file)).collect::<Result<_>>()?;
        let psnr = demo.psnr.iter().map(|of_method| of_method[i]).collect();
        views.push(View { file: file.clone(), detail: detail(&photo), psnr, crop: crop(&models) });
    }
    // Nobody recognises a plain wall.
    views.sort_by(|a, b| b.detail.total_cmp(&a.detail));
    views.truncate(views.len().div_ceil(2).max(SHOWN.len()));
    views.sort_by(|a, b| b.gain().total_cmp(&a.gain()));
    let mut text = format!(
        "<section>\n<h2>Held-out test views</h2>\n<p class=\"line\">Views that no model was trained on: three of the {} with the most detail, of {}.</p>\n",
        views.len(),
        first.pictures.len()
    );
    let last = views.len().saturating_sub(1);
    for (name, View { file, psnr, crop, .. }) in
        SHOWN.iter().zip([0, last / 2, last].iter().filter_map(|i| views.get(*i)))
    {
        let photo = address(&path(first, "reference", file));
        let _ = write!(
            text,
            "<h3>{name}</h3>\n<div class=\"view\">\n<figure><figcaption>the truth</figcaption>\
             <img src=\"{photo}\" alt=\"a held-out view, photographed\">{}\
             <p class=\"error\">Above: where the models differ most, enlarged. Beside: how far the whole of each is from the truth. Black is \
             equal, white a quarter of full scale or more.</p></figure>\n",
            cropped(&photo, *crop)
        );
        for ((method, entry), psnr) in METHODS.iter().zip(entries).zip(psnr) {
            let (shown, title) = (address(&path(entry, "test", file)), column(*method, count));
            let _ = writeln!(
                text,
                "<figure><figcaption>{title}<span>{psnr:.1} dB</span></figcaption>\
                 <img src=\"{shown}\" alt=\"the same view by the model of {title}\">{}\
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

/// Mean difference of pixels side by side, over all channels.
fn detail(picture: &RgbImage) -> f64 {
    let (width, height) = picture.dimensions();
    let step = |x: u32, y: u32| -> u32 {
        let [a, b] = [x - 1, x].map(|x| picture.get_pixel(x, y).0);
        a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(b))).sum()
    };
    let sum: f64 = (0..height).flat_map(|y| (1..width).map(move |x| (x, y))).map(|(x, y)| f64::from(step(x, y))).sum();
    sum / f64::from(width * height)
}

/// Where pictures of one size differ most from each other.
fn crop(pictures: &[RgbImage]) -> [f64; 2] {
    let Some((width, height)) = pictures.first().map(RgbImage::dimensions) else { return [0.0; 2] };
    let spread = |x: u32, y: u32| {
        (0..3).map(move |c| {
            let values = || pictures.iter().map(|picture| picture.get_pixel(x, y).0[c]);
            f64::from(values().max().unwrap_or_default() - values().min().unwrap_or_default())
        })
    };
    let side = |length: u32| ((f64::from(length) * CROP) as u32).max(1);
    let (across, down) = (side(width), side(height));
    let corner = |i: u32| {
        let part = |place: u32, room: u32| room * place / (PLACES - 1);
        [part(i % PLACES, width - across), part(i / PLACES, height - down)]
    };
    let of = |[x, y]: [u32; 2]| -> f64 {
        (y..y + down).flat_map(|y| (x..x + across).map(move |x| (x, y))).flat_map(|(x, y)| spread(x, y)).sum()
    };
    let best = (0..PLACES * PLACES).map(corner).max_by(|a, b| of(*a).total_cmp(&of(*b))).unwrap_or_default();
    [f64::from(best[0]) / f64::from(width), f64::from(best[1]) / f64::from(height)]
}

/// What was measured over all held-out views, and what was expected before.
fn figures(demo: &Demo) -> String {
    let count = demo.plan.record.cameras.len();
    let mut text = String::from("<div class=\"scroll\"><table><thead><tr><th></th>");
    for method in METHODS {
        let _ = write!(text, "<th>{}</th>", column(method, count));
    }
    text += "</tr></thead>\n<tbody>\n";
    let metrics = [
        ("PSNR", "how close to the truth, in dB; 3 dB halve the squared error"),
        ("SSIM", "likeness of structure; 1 is equal"),
        ("LPIPS", "unlikeness as people see it; 0 is equal"),
    ];
    let of = |row: usize, metric: usize| {
        demo.outcome
            .rows
            .get(row)
            .and_then(|row| row.measured[metric].first().copied().flatten())
            .map(|value| value.mean)
    };
    for (metric, (name, words)) in metrics.into_iter().enumerate() {
        let _ = write!(text, "<tr><th scope=\"row\">{name}<small>{words}</small></th>");
        for row in 0..METHODS.len() {
            let value =
                of(row, metric).map_or_else(|| "–".into(), |value| format!("{:.*}", DECIMALS[metric].min(3), value));
            let class = if row == 0 { " class=\"plan\"" } else { "" };
            let _ = write!(text, "<td{class}>{value}</td>");
        }
        text += "</tr>\n";
    }
    text += "</tbody>";
    if let Some(expected) = &demo.plan.record.expected {
        let against = METHODS.iter().position(|method| expected.against.starts_with(method.name()));
        let measured = against.and_then(|row| Some(of(0, 0)? - of(row, 0)?));
        let measured = measured.map_or_else(String::new, |db| format!("; measured {}", decibels(db, 1)));
        let _ = write!(
            text,
            "<caption>Expected before a photo was taken: {} (standard deviation {:.1}) over the {}{measured}.</caption>",
            decibels(expected.db, 1),
            expected.sd,
            escape(&expected.against)
        );
    }
    text + "</table></div>\n"
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
    let mut text = String::from("<div class=\"scroll steps\"><table><tbody>\n");
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

    /// If this failed, what is enlarged would be where all models agree, or a crop reach out of its picture.
    #[test]
    fn the_crop_lies_where_pictures_differ() {
        for busy in [[0, 0], [48, 0], [20, 44], [48, 48]] {
            let other = RgbImage::from_fn(64, 64, |x, y| {
                let inside = [x, y].iter().zip(busy).all(|(v, low)| (low..low + 16).contains(v));
                image::Rgb([if inside { 255 } else { 90 }; 3])
            });
            let plain = RgbImage::from_pixel(64, 64, image::Rgb([90; 3]));
            for (low, busy) in crop(&[plain.clone(), plain, other]).into_iter().zip(busy) {
                let (low, high) = (64.0 * low, 64.0 * (low + CROP));
                assert!(low >= 0.0 && high <= 64.0 && low <= f64::from(busy + 4) && high >= f64::from(busy + 12));
            }
        }
        assert!(
            cropped("a'b.png", [0.0, 1.0 - CROP])
                .contains("url('a%27b.png');background-size:266.7%;background-position:0.0% 100.0%")
        );
        let grey = |level: u8| RgbImage::from_pixel(2, 2, image::Rgb([level; 3]));
        assert_eq!(detail(&grey(100)), 0.0);
        let steps = RgbImage::from_fn(4, 2, |x, _| image::Rgb([if x % 2 == 0 { 0 } else { 10 }; 3]));
        assert!((detail(&steps) - 3.0 * 30.0 / 4.0).abs() < 1e-9);
    }
}

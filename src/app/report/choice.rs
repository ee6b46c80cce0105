//! What the page of a selection has beside that of a plan: the chosen photos with what each is worth, and photos worth taking.

use std::fmt::Write as _;

use image::RgbImage;

use super::pictures::{MAX_BYTES, jpeg, jpeg_url, shrunk};
use super::text::{escape, number};
use crate::Result;
use crate::files::photos::Photo;
use crate::planner::metrics::Metrics;
use crate::planner::quality::expected::decibels;
use crate::planner::select::selection::Suggested;
use crate::splats::data::pictures::{self, Picture};

/// Photos that have a picture on the page at most.
const MAX_PICTURES: usize = 300;
/// Longest side of the pictures in pixels, by the number of photos up to which they are so large.
const SIDES: [(usize, u32); 3] = [(12, 480), (48, 320), (MAX_PICTURES, 160)];
/// Quality of their JPEG files.
const QUALITY: u8 = 75;

/// A choice as the page shows it.
#[derive(Clone, Copy, Debug)]
pub struct Choice<'a> {
    /// Metrics of the whole pool.
    pub pool: &'a Metrics,
    /// The chosen photos, in the order of the record's cameras.
    pub photos: &'a [ChosenPhoto],
    /// Poses worth adding.
    pub suggested: &'a [Suggested],
}

/// A chosen photo as the page shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct ChosenPhoto {
    /// Name of the photo.
    pub name: String,
    /// Its place among the chosen, from 1 on: the one that the choice would miss most comes first.
    pub rank: usize,
    /// How many are chosen.
    pub of: usize,
    /// Decibels of expected quality that would be lost without it.
    pub contribution_db: f64,
    /// Its sharpness, where it counted.
    pub sharpness: Option<f64>,
    /// Whether the request names it as one to choose.
    pub included: bool,
    /// Data URL of the photo, small; none where there is no image that can be read, or no room for it.
    pub picture: Option<String>,
}

impl ChosenPhoto {
    /// Why it was chosen, in a line.
    pub fn remark(&self) -> String {
        let Self { rank, of, contribution_db, sharpness, included, .. } = self;
        let mut text = format!("{contribution_db:.2} dB would be lost without it, number {rank} of {of}");
        if let Some(sharpness) = sharpness {
            let _ = write!(text, "; sharpness {}", number(*sharpness));
        }
        if *included {
            text.push_str("; always selected");
        }
        text
    }
}

/// Decibels that a suggested photo would add, with sign and unit.
pub fn gain(suggested: &Suggested) -> String {
    decibels(suggested.gain_db, 2)
}

/// Data URLs of photos, small and without distortion, in their order; none where there is no image that can be read, and of those
/// that would make the page too large.
///
/// # Errors
/// Where the system gives no threads.
pub fn pictures(photos: &[Photo]) -> Result<Vec<Option<String>>> {
    let side =
        SIDES.iter().find(|(count, _)| photos.len() <= *count).map_or(SIDES[SIDES.len() - 1].1, |(_, side)| *side);
    // Photos are shown whole: what a mask hides belongs to what their camera saw.
    let whole: Vec<Photo> =
        photos.iter().take(MAX_PICTURES).map(|photo| Photo { mask: None, ..photo.clone() }).collect();
    let longest = |photo: &Photo| photo.camera.intrinsics.width.max(photo.camera.intrinsics.height);
    let shrink = (whole.iter().map(longest).min().unwrap_or(side) / side).max(1);
    let settings = pictures::PictureSettings { shrink, ..pictures::PictureSettings::default() };
    let mut urls = vec![None; photos.len()];
    let mut left = MAX_BYTES;
    for (url, decoded) in urls.iter_mut().zip(pictures::pictures(&whole, &settings)?) {
        // A photo that is damaged is still one to choose: only its picture is missing.
        let Some(picture) = decoded.ok().and_then(on_white) else { continue };
        let file = jpeg(&shrunk(picture, side), QUALITY)?;
        let Some(rest) = left.checked_sub(file.len()) else { break };
        left = rest;
        *url = Some(jpeg_url(&file));
    }
    Ok(urls)
}

/// A picture laid over white where it is transparent.
fn on_white(picture: Picture) -> Option<RgbImage> {
    let over = |colour: u8, alpha: u8| {
        let alpha = f64::from(alpha) / 255.0;
        (f64::from(colour) * alpha + 255.0 * (1.0 - alpha)).round() as u8
    };
    let pixel = |pixel: &u32| {
        let [r, g, b, alpha] = pixel.to_le_bytes();
        [r, g, b].map(|colour| over(colour, alpha))
    };
    RgbImage::from_raw(picture.width, picture.height, picture.pixels.iter().flat_map(pixel).collect())
}

impl Choice<'_> {
    /// The sections of the page; `first` is the number of the first suggested camera there.
    pub fn html(&self, first: usize) -> String {
        self.chosen() + &self.suggestions(first)
    }

    fn chosen(&self) -> String {
        let mut order: Vec<(usize, &ChosenPhoto)> = self.photos.iter().enumerate().collect();
        order.sort_by_key(|(_, photo)| photo.rank);
        let mut html = String::from(
            "<section aria-labelledby=\"chosen-title\">\n<h2 id=\"chosen-title\">Chosen photos</h2>\n<p>The photo that the choice \
             would miss most comes first: without it, the expected error would rise by so many decibels. Click a photo to look \
             through its camera.</p>\n<div class=\"photos\">\n",
        );
        for (camera, photo) in order {
            let ChosenPhoto { name, rank, contribution_db, sharpness, included, picture, .. } = photo;
            let name = escape(name);
            let _ = write!(html, "<button type=\"button\" data-camera=\"{camera}\">");
            if let Some(url) = picture {
                let _ = write!(html, "<img src=\"{url}\" alt=\"{name}\" loading=\"lazy\">");
            }
            let _ = write!(html, "<small>{rank}. <b>{contribution_db:.2} dB</b>");
            if let Some(sharpness) = sharpness {
                let _ = write!(html, ", sharpness {}", number(*sharpness));
            }
            if *included {
                html.push_str(", always selected");
            }
            let _ = writeln!(html, "</small><small>{name}</small></button>");
        }
        html.push_str("</div>\n");
        let missing = self.photos.iter().filter(|photo| photo.picture.is_none()).count();
        if missing > 0 {
            let _ = writeln!(
                html,
                "<p class=\"hint\">{missing} of them have no picture here: their images are missing or cannot be read, or would make \
                 this page too large.</p>"
            );
        }
        html + "</section>\n"
    }

    fn suggestions(&self, first: usize) -> String {
        if self.suggested.is_empty() {
            return String::new();
        }
        let mut html = String::from(
            "<section aria-labelledby=\"suggested-title\">\n<h2 id=\"suggested-title\">Photos worth taking</h2>\n<div class=\"scroll\">\
             <table>\n<thead><tr><th scope=\"col\">Photo</th><th scope=\"col\">Gain</th><th scope=\"col\">Position</th>\
             <th scope=\"col\">Looking along</th><th></th></tr></thead>\n<tbody>\n",
        );
        for (camera, suggested) in (first..).zip(self.suggested) {
            let pose = suggested.camera.pose;
            let vector =
                |v: glam::DVec3, digits: usize| format!("({:.*}, {:.*}, {:.*})", digits, v.x, digits, v.y, digits, v.z);
            let _ = writeln!(
                html,
                "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td><td><button type=\"button\" \
                 data-camera=\"{camera}\">look through</button></td></tr>",
                escape(&suggested.camera.name),
                gain(suggested),
                vector(pose.position, 3),
                vector(pose.forward(), 2)
            );
        }
        html + "</tbody>\n<caption>The gain is the expected quality that each would add to the choice by itself. suggested.json has \
                their cameras.</caption></table></div>\n</section>\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::camera::{Camera, Intrinsics, Pose};
    use glam::DVec3;

    fn photo(image: Option<std::path::PathBuf>, side: u32) -> Photo {
        let camera = Camera {
            name: "a".into(),
            pose: Pose::looking(DVec3::X, DVec3::NEG_X, DVec3::Z),
            intrinsics: Intrinsics::from_fov(side, side / 2, 1.0),
        };
        Photo { camera, distortion: Default::default(), image, mask: None }
    }

    /// If this failed, a damaged photo would end a selection, or a page would hold photos at their full size.
    #[test]
    fn pictures_are_small_and_what_cannot_be_read_has_none() {
        let folder = tempfile::tempdir().unwrap();
        let (large, broken) = (folder.path().join("large.png"), folder.path().join("broken.png"));
        RgbImage::from_fn(1000, 500, |x, y| image::Rgb([x as u8, y as u8, 9])).save(&large).unwrap();
        std::fs::write(&broken, b"no image").unwrap();
        let given = [photo(Some(large), 1000), photo(None, 1000), photo(Some(broken), 1000)];
        let urls = pictures(&given).unwrap();
        assert_eq!(urls.iter().map(Option::is_some).collect::<Vec<_>>(), [true, false, false]);
        let base64 = urls[0].as_ref().unwrap().strip_prefix("data:image/jpeg;base64,").unwrap();
        let file = base64::Engine::decode(&base64::engine::general_purpose::STANDARD, base64).unwrap();
        let shown = image::load_from_memory(&file).unwrap();
        assert_eq!((shown.width(), shown.height()), (480, 240));
    }
}

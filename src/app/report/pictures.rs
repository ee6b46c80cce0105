//! Pictures made small enough to embed: photos shrunk, as JPEG, and those of the worst viewers, in base64.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::codecs::jpeg::JpegEncoder;
use image::imageops::{FilterType, resize};
use image::{Rgb, RgbImage};

use crate::files::io::picture::rgb;
use crate::planner::quality::expected::decibels;
use crate::planner::quality::map::Worst;
use crate::{Error, Result};

/// Longest side on the page, in pixels.
const LONGEST: u32 = 640;
/// Bytes of all pictures that leave the page under 4 MB, since base64 makes four of three.
pub(super) const MAX_BYTES: usize = 2_700_000;
/// Qualities that are tried until the pictures are small enough; the last one is taken as it is.
const QUALITIES: [u8; 5] = [90, 80, 70, 60, 50];
/// Differences are multiplied by this, so that an eye sees them.
pub(crate) const GAIN: u8 = 4;

/// A test view as it was rendered, beside its photo.
#[derive(Clone, Copy, Debug)]
pub struct Comparison<'a> {
    /// Name of the photo, as in [`crate::splats::run::record::TrainRecord::test_views`].
    pub name: &'a str,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The rendering: 8-bit RGB, row by row.
    pub rendered: &'a [u8],
    /// The photo, likewise.
    pub reference: &'a [u8],
}

/// A comparison as the page shows it.
pub struct Shown {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Data URLs of the rendering, the photo, and `GAIN` times the absolute difference of the two.
    pub urls: [String; 3],
}

/// Shrinks and encodes all comparisons, in one quality.
///
/// # Errors
/// [`Error::Request`] where a picture has no pixels or not as many as its size implies.
pub fn shown(comparisons: &[Comparison]) -> Result<Vec<Shown>> {
    let triples = comparisons.iter().map(triple).collect::<Result<Vec<_>>>()?;
    let mut encoded = Vec::new();
    for quality in QUALITIES {
        encoded = triples
            .iter()
            .map(|pictures| pictures.each_ref().map(|picture| jpeg(picture, quality)).into_iter().collect())
            .collect::<Result<Vec<Vec<Vec<u8>>>>>()?;
        if encoded.iter().flatten().map(Vec::len).sum::<usize>() <= MAX_BYTES {
            break;
        }
    }
    let shown = triples.iter().zip(&encoded).map(|(pictures, bytes)| Shown {
        size: pictures[0].dimensions().into(),
        urls: [0, 1, 2].map(|i| jpeg_url(&bytes[i])),
    });
    Ok(shown.collect())
}

/// The section of the page that shows what the worst viewers see; nothing where there are none.
///
/// # Errors
/// As [`shown`].
pub fn worst(viewers: &[Worst]) -> Result<String> {
    let Some(Worst { span_db, .. }) = viewers.first() else { return Ok(String::new()) };
    let mut html = format!(
        "<section aria-labelledby=\"worst-title\">\n<h2 id=\"worst-title\">The worst viewers</h2>\n<p>Viewers who are \
         expected to see most error on the surface, and where in their pictures it lies: red is {span_db:.0} dB or more above the median of all that viewers see, blue as far below, grey \
         beside the surface.</p>\n<div class=\"worst\">\n",
    );
    for Worst { camera, db, size: [width, height], picture, .. } in viewers {
        let url = format!("data:image/png;base64,{}", STANDARD.encode(rgb(*width, picture)?));
        let [x, y, z] = camera.pose.position.to_array();
        let _ = writeln!(
            html,
            "<figure><img src=\"{url}\" width=\"{}\" height=\"{}\" alt=\"what the viewer looks at, by expected error\"><figcaption>\
             <strong>{}</strong> at ({x:.3}, {y:.3}, {z:.3})</figcaption></figure>",
            2 * width,
            2 * height,
            decibels((*db).into(), 1)
        );
    }
    Ok(html + "</div>\n</section>\n")
}

/// Rendering, photo and difference, shrunk. The difference is taken before: shrinking would hide what is wrong with details.
fn triple(comparison: &Comparison) -> Result<[RgbImage; 3]> {
    let Comparison { name, width, height, rendered, reference } = *comparison;
    let picture = |bytes: &[u8]| {
        RgbImage::from_raw(width, height, bytes.to_vec())
            .filter(|_| width > 0 && height > 0 && bytes.len() == 3 * width as usize * height as usize)
            .ok_or_else(|| {
                let held = bytes.len();
                Error::request(format!("the report got {held} bytes for the {width} x {height} RGB pixels of {name}"))
            })
    };
    let (rendered, reference) = (picture(rendered)?, picture(reference)?);
    let difference = RgbImage::from_fn(width, height, |x, y| {
        let (Rgb(a), Rgb(b)) = (rendered.get_pixel(x, y), reference.get_pixel(x, y));
        Rgb([0, 1, 2].map(|c: usize| a[c].abs_diff(b[c]).saturating_mul(GAIN)))
    });
    Ok([rendered, reference, difference].map(|picture| shrunk(picture, LONGEST)))
}

/// The picture with a longest side of so many pixels at most.
pub(super) fn shrunk(picture: RgbImage, most: u32) -> RgbImage {
    let (width, height) = picture.dimensions();
    let longest = width.max(height);
    if longest <= most {
        return picture;
    }
    let side = |side: u32| (f64::from(side) * f64::from(most) / f64::from(longest)).round().max(1.0) as u32;
    resize(&picture, side(width), side(height), FilterType::Triangle)
}

/// The data URL of a JPEG file.
pub(crate) fn jpeg_url(file: &[u8]) -> String {
    format!("data:image/jpeg;base64,{}", STANDARD.encode(file))
}

/// A JPEG file of a picture.
///
/// # Errors
/// Where it cannot be encoded.
pub(super) fn jpeg(picture: &RgbImage, quality: u8) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality)
        .encode_image(picture)
        .map_err(|e| Error::request(format!("the report's picture cannot be encoded: {e}")))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn comparison<'a>(size: [u32; 2], rendered: &'a [u8], reference: &'a [u8]) -> Comparison<'a> {
        Comparison { name: "a.png", width: size[0], height: size[1], rendered, reference }
    }

    /// Were it signed, clamped at zero or taken of one channel, half of what is wrong would not show.
    #[test]
    fn the_difference_is_absolute_and_magnified() {
        let (rendered, reference) = ([10, 0, 200, 0, 0, 0], [20, 100, 190, 0, 0, 0]);
        let [_, _, difference] = triple(&comparison([2, 1], &rendered, &reference)).unwrap();
        assert_eq!(difference.into_raw(), [40, 255, 40, 0, 0, 0]);
    }

    /// A tall picture must not become wider than it was, nor a thin one vanish.
    #[test]
    fn pictures_shrink_by_their_longest_side_and_are_never_enlarged() {
        for (size, expected) in
            [([1280, 320], [640, 160]), ([320, 1280], [160, 640]), ([30, 20], [30, 20]), ([3000, 1], [640, 1])]
        {
            let pixels = vec![7; 3 * (size[0] * size[1]) as usize];
            let shown = shown(&[comparison(size, &pixels, &pixels)]).unwrap();
            assert_eq!(shown[0].size, expected);
        }
    }

    /// A mistaken size must be an error that names the view, not a sheared picture.
    #[test]
    fn pixels_must_be_as_many_as_the_size_says() {
        for (size, bytes) in [([2, 2], 11), ([2, 2], 15), ([0, 0], 0)] {
            let pixels = vec![0; bytes];
            let error = shown(&[comparison(size, &pixels, &pixels)]).err().unwrap();
            assert!(error.to_string().contains("a.png"), "{error}");
        }
    }
}

//! Positions of photos on Earth, from their EXIF data.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use exif::{Exif, In, Rational, Tag, Value};

use super::georeference::Geodetic;
use crate::{Error, Result};

/// Where a photo was taken, as its EXIF data say; none where they do not, or cannot be read.
///
/// # Errors
/// Where the file cannot be opened.
pub fn of_photo(path: &Path) -> Result<Option<Geodetic>> {
    let file = File::open(path).map_err(|source| Error::io(path, source))?;
    Ok(exif::Reader::new().read_from_container(&mut BufReader::new(file)).ok().and_then(|exif| position(&exif)))
}

fn position(exif: &Exif) -> Option<Geodetic> {
    let latitude = degrees(exif, Tag::GPSLatitude)? * sign(exif, Tag::GPSLatitudeRef, b'S');
    let longitude = degrees(exif, Tag::GPSLongitude)? * sign(exif, Tag::GPSLongitudeRef, b'W');
    let below =
        exif.get_field(Tag::GPSAltitudeRef, In::PRIMARY).is_some_and(|field| field.value.get_uint(0) == Some(1));
    let altitude = match &exif.get_field(Tag::GPSAltitude, In::PRIMARY)?.value {
        Value::Rational(numbers) => number(numbers.first()?)?,
        _ => return None,
    };
    Geodetic { latitude, longitude, altitude: if below { -altitude } else { altitude } }.validated().ok()
}

/// Degrees from degrees, minutes and seconds.
fn degrees(exif: &Exif, tag: Tag) -> Option<f64> {
    match &exif.get_field(tag, In::PRIMARY)?.value {
        Value::Rational(numbers) => {
            numbers.iter().zip([1.0, 60.0, 3600.0]).map(|(n, part)| Some(number(n)? / part)).sum()
        }
        _ => None,
    }
}

/// A number of EXIF data; none where it is divided by nothing.
pub fn number(rational: &Rational) -> Option<f64> {
    (rational.denom != 0).then(|| rational.to_f64())
}

/// -1 where the reference is `negative`, as south and west are.
fn sign(exif: &Exif, tag: Tag, negative: u8) -> f64 {
    match exif.get_field(tag, In::PRIMARY).map(|field| &field.value) {
        Some(Value::Ascii(texts)) if texts.first().and_then(|text| text.first()) == Some(&negative) => -1.0,
        _ => 1.0,
    }
}

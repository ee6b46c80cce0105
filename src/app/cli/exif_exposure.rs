//! How much the exposures of photos differ, by what the camera wrote into them.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use exif::{Exif, In, Tag, Value};

use crate::app::export::gps;
use crate::files::photos::Photo;

/// Stops between photos from which on their colours differ visibly.
const VISIBLE: f64 = 0.5;

/// A line on photos whose EXIF data say that their exposures differ; none where they are alike, or fewer than two say anything.
pub fn note(photos: &[Photo]) -> Option<String> {
    let stops: Vec<f64> = photos.iter().filter_map(|photo| stops(photo.image.as_deref()?)).collect();
    let range = stops.iter().copied().reduce(f64::max)? - stops.iter().copied().reduce(f64::min)?;
    let of = stops.len();
    (of > 1 && range > VISIBLE).then(|| {
        format!("EXIF data of {of} photos say exposures {range:.1} stops apart: --exposure learns what that does to their colours")
    })
}

/// The exposure in stops: of time, sensitivity and aperture (as APEX counts them, from some zero).
fn stops(path: &Path) -> Option<f64> {
    let exif = exif::Reader::new().read_from_container(&mut BufReader::new(File::open(path).ok()?)).ok()?;
    let (time, aperture) = (rational(&exif, Tag::ExposureTime)?, rational(&exif, Tag::FNumber)?);
    let sensitivity = f64::from(exif.get_field(Tag::PhotographicSensitivity, In::PRIMARY)?.value.get_uint(0)?);
    Some((time * sensitivity / aperture.powi(2)).log2()).filter(|stops| stops.is_finite())
}

fn rational(exif: &Exif, tag: Tag) -> Option<f64> {
    match &exif.get_field(tag, In::PRIMARY)?.value {
        Value::Rational(numbers) => gps::number(numbers.first()?),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::files::photos::orientation::with_exif;
    use crate::scene::camera::{Camera, Intrinsics, Pose};
    use crate::scene::lens::Distortion;

    /// A JPEG that was exposed for 1/`time` s at f/2 and a sensitivity of 100 (TIFF, big-endian: an entry that leads to the EXIF directory
    /// at 26, whose three entries have their rationals at 68).
    fn jpeg(path: &Path, time: u32) {
        let entry = |tag: u16, kind: u16, value: u32| {
            [&tag.to_be_bytes()[..], &kind.to_be_bytes(), &1u32.to_be_bytes(), &value.to_be_bytes()].concat()
        };
        let mut tiff = b"MM\0*\0\0\0\x08\0\x01".to_vec();
        tiff.extend(entry(0x8769, 4, 26));
        tiff.extend([0; 4]);
        tiff.extend(3u16.to_be_bytes());
        tiff.extend(entry(0x829a, 5, 68));
        tiff.extend(entry(0x829d, 5, 76));
        tiff.extend(entry(0x8827, 3, 100 << 16));
        tiff.extend([0; 4]);
        [1, time, 2, 1].iter().for_each(|value: &u32| tiff.extend(value.to_be_bytes()));
        image::RgbImage::new(8, 8).save(path).unwrap();
        std::fs::write(path, with_exif(&std::fs::read(path).unwrap(), &tiff)).unwrap();
    }

    /// If this failed, who has photos of an automatic exposure would not learn what makes them dull, or everybody would be told.
    #[test]
    fn exposures_that_differ_are_said() {
        let folder = tempfile::tempdir().unwrap();
        let photo = |name: &str, time: Option<u32>| {
            let path: PathBuf = folder.path().join(name);
            match time {
                Some(time) => jpeg(&path, time),
                None => image::RgbImage::new(8, 8).save(&path).unwrap(),
            }
            let pose = Pose::looking(glam::DVec3::ZERO, glam::DVec3::Z, glam::DVec3::Y);
            let camera = Camera { name: name.into(), pose, intrinsics: Intrinsics::from_fov(8, 8, 1.0) };
            Photo { camera, distortion: Distortion::default(), image: Some(path), mask: None }
        };
        let [bright, dark, plain] = [photo("a.jpg", Some(30)), photo("b.jpg", Some(120)), photo("c.jpg", None)];
        assert!((stops(&folder.path().join("a.jpg")).unwrap() - (100.0f64 / 30.0 / 4.0).log2()).abs() < 1e-9);
        let said = note(&[bright.clone(), dark, plain.clone()]).unwrap();
        assert!(said.contains("of 2 photos say exposures 2.0 stops apart") && said.contains("--exposure"), "{said}");
        assert_eq!((note(&[bright.clone(), bright, plain.clone()]), note(&[plain])), (None, None));
    }
}

//! The text files of a COLMAP model.

use std::collections::BTreeMap;
use std::path::Path;
use std::str::FromStr;

use glam::DVec3;

use super::{Image, Lens, NO_POINT, Observation, PROJECTIONS, Point, pose};
use crate::error::{Error, Result};

/// A line of a file, for its words and for messages about it.
struct Line<'a> {
    path: &'a Path,
    /// From 1.
    number: usize,
    words: Vec<&'a str>,
}

impl Line<'_> {
    fn error(&self, what: impl std::fmt::Display) -> Error {
        Error::input(self.path, format!("line {}: {what}", self.number))
    }

    /// Word `i` as a number; `what` names it in the message.
    fn number<T: FromStr>(&self, i: usize, what: &str) -> Result<T> {
        match self.words.get(i) {
            None => Err(self.error(format!("{what} is missing; export the model again"))),
            Some(word) => word.parse().map_err(|_| self.error(format!("{what} is {word:?}, which is no such number"))),
        }
    }

    /// `N` numbers from word `i` on.
    fn numbers<T: FromStr + Copy + Default, const N: usize>(&self, i: usize, what: &str) -> Result<[T; N]> {
        let mut numbers = [T::default(); N];
        for (k, number) in numbers.iter_mut().enumerate() {
            *number = self.number(i + k, what)?;
        }
        Ok(numbers)
    }
}

/// The file as text; names that are not UTF-8 keep a replacement character.
fn decode(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The lines of a file.
fn lines<'a>(path: &'a Path, text: &'a str) -> impl Iterator<Item = Line<'a>> {
    text.lines().enumerate().map(move |(i, line)| Line {
        path,
        number: i + 1,
        words: line.split_ascii_whitespace().collect(),
    })
}

/// Whether a line outside of an image's second line has content.
fn speaks(line: &Line) -> bool {
    line.words.first().is_some_and(|word| !word.starts_with('#'))
}

/// Parses cameras.txt: lenses by their number.
pub fn cameras(path: &Path, bytes: &[u8]) -> Result<BTreeMap<u32, Lens>> {
    let text = decode(bytes);
    let mut lenses = BTreeMap::new();
    for line in lines(path, &text).filter(speaks) {
        let id: u32 = line.number(0, "the camera's number")?;
        let model = line.words.get(1).copied().unwrap_or_default();
        let Some(&projection) = PROJECTIONS.iter().find(|p| p.name == model) else {
            return Err(line.error(format!("{model:?} is no known camera model; convert it to PINHOLE or OPENCV")));
        };
        let size = line.numbers(2, "the image size")?;
        let parameters: Vec<f64> =
            (4..line.words.len()).map(|i| line.number(i, "a camera parameter")).collect::<Result<_>>()?;
        let Some(lens) = Lens::new(projection, size, &parameters) else {
            return Err(line.error(format!(
                "{model} takes {} parameters and there are {}; export the model again",
                projection.parameters,
                parameters.len()
            )));
        };
        if lenses.insert(id, lens).is_some() {
            return Err(line.error(format!("camera {id} is given twice; export the model again")));
        }
    }
    Ok(lenses)
}

/// Parses images.txt, without the observations. Each image has two lines; the second, of observations, may be empty
/// but must be there.
pub fn images(path: &Path, bytes: &[u8]) -> Result<Vec<Image>> {
    observed(path, bytes, |_| false)
}

/// Parses images.txt, with the observations of the images whose name `wanted` accepts.
pub fn observed(path: &Path, bytes: &[u8], wanted: impl Fn(&str) -> bool) -> Result<Vec<Image>> {
    let text = decode(bytes);
    let mut lines = lines(path, &text);
    let mut images = Vec::new();
    while let Some(line) = lines.next() {
        if !speaks(&line) {
            continue;
        }
        let id = line.number(0, "the image's number")?;
        let rotation = line.numbers(1, "the rotation")?;
        let translation = line.numbers(5, "the translation")?;
        let lens = line.number(8, "the camera's number")?;
        let name = line.words.get(9..).unwrap_or_default().join(" ");
        if name.is_empty() {
            return Err(line.error("the image's name is missing; export the model again"));
        }
        let Some(pose) = pose(rotation, translation) else {
            return Err(line.error(format!("image {name:?} has a pose that is not finite or no rotation; remove it")));
        };
        let is_observations =
            |line: &Line| line.words.len().is_multiple_of(3) && line.words.iter().all(|w| w.parse::<f64>().is_ok());
        let Some(second) = lines.next().filter(is_observations) else {
            return Err(line.error(format!(
                "image {name:?} is not followed by its line of observations; each image has two lines, the second may \
                 be empty but must be there"
            )));
        };
        let mut observations = Vec::new();
        if wanted(&name) {
            for i in (0..second.words.len()).step_by(3) {
                let point: i64 = second.number(i + 2, "the point of an observation")?;
                let pixel = second.numbers(i, "an observation")?;
                observations.push(Observation { pixel, point: u64::try_from(point).unwrap_or(NO_POINT) });
            }
        }
        images.push(Image { id, lens, pose, name, stored: (rotation, translation), observations });
    }
    Ok(images)
}

/// Parses points3D.txt.
pub fn points(path: &Path, bytes: &[u8]) -> Result<Vec<Point>> {
    let text = decode(bytes);
    let mut points = Vec::new();
    for line in lines(path, &text).filter(speaks) {
        let id = line.number(0, "the point's number")?;
        let position = DVec3::from_array(line.numbers(1, "the position")?);
        let colour = line.numbers(4, "the colour")?;
        let error = line.number(7, "the reprojection error")?;
        if line.words.len() % 2 != 0 {
            return Err(line.error("the track is no list of pairs; export the model again"));
        }
        let track = (8..line.words.len()).step_by(2).map(|i| line.numbers(i, "an entry of the track"));
        points.push(Point { id, position, colour, error, track: track.collect::<Result<_>>()? });
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;
    use crate::scene::surface::Surface;

    const CAMERAS: &str = "# Camera list\n# Number of cameras: 2\n\
                           1 SIMPLE_RADIAL 640 480 500 320 240 0.1\n2 OPENCV 100 200 90 91 50 100 1 2 3 4\n";
    /// The second camera is at (0, 0, -2) turned by 180 degrees about y, and its name holds a blank.
    const IMAGES: &str = "# Image list\n\n\
                          7 1 0 0 0 1 2 3 1 b.jpg\n10 20 -1 30 40 5\n\
                          8 0 0 2 0 0 0 -2 2 a 1.jpg\n\n";
    const POINTS: &str = "# points\n5 0 0 5 10 20 30 0.5 7 0 8 0\n6 1 0 5 10 20 30 0.5\n";

    fn path() -> &'static Path {
        Path::new("model.txt")
    }

    /// If this failed, poses would be inverted or mirrored, or parameters would be mistaken for each other.
    #[test]
    fn a_model_by_hand_is_read_as_written() {
        let lenses = cameras(path(), CAMERAS.as_bytes()).unwrap();
        let images = images(path(), IMAGES.as_bytes()).unwrap();
        let mut notes = Vec::new();
        let cameras = super::super::join(path(), &lenses, images.clone(), &mut notes).unwrap();
        assert_eq!(cameras.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["a 1.jpg", "b.jpg"]);
        assert!((cameras[1].pose.position - DVec3::new(-1.0, -2.0, -3.0)).length() < 1e-12);
        assert!((cameras[0].pose.forward() - DVec3::NEG_Z).length() < 1e-12);
        assert!((cameras[0].pose.position - DVec3::new(0.0, 0.0, -2.0)).length() < 1e-12);
        assert_eq!((cameras[0].intrinsics.focal, cameras[0].intrinsics.principal), ([90.0, 91.0], [50.0, 100.0]));
        assert_eq!((cameras[1].intrinsics.focal, cameras[1].intrinsics.principal), ([500.0; 2], [320.0, 240.0]));
        assert_eq!(lenses[&1].distortion, [0.1]);
        assert!(notes[0].contains("2 of 2 images have lens distortion"), "{notes:?}");

        let points = points(path(), POINTS.as_bytes()).unwrap();
        let centres: HashMap<_, _> = images.iter().map(|i| (i.id, i.pose.position)).collect();
        let Surface::Points(surface) = super::super::points_surface(path(), &points, &centres).unwrap() else {
            panic!("not points")
        };
        assert!(surface.toward_cameras[0].z < -0.9, "{:?}", surface.toward_cameras);
        assert_eq!(surface.toward_cameras[1], DVec3::ZERO);
        assert_eq!(surface.colours[1], [10, 20, 30]);
        assert!(!surface.oriented && surface.normals.is_empty());
    }

    /// If this failed, a model without its empty lines would lose every other image.
    #[test]
    fn a_missing_second_line_is_named() {
        for bad in ["7 1 0 0 0 1 2 3 1 b.jpg\n8 0 0 2 0 0 0 -2 2 a.jpg\n\n", "7 1 0 0 0 1 2 3 1 b.jpg\n"] {
            let message = images(path(), bad.as_bytes()).unwrap_err().to_string();
            assert!(message.contains("line 1") && message.contains("two lines"), "{message}");
        }
    }

    /// If this failed, an image could be given the lens of another camera, or none.
    #[test]
    fn references_that_lead_nowhere_are_named() {
        let lenses = cameras(path(), b"1 PINHOLE 10 10 5 5 5 5\n").unwrap();
        let images = images(path(), IMAGES.as_bytes()).unwrap();
        let message = super::super::join(path(), &lenses, images, &mut Vec::new()).unwrap_err().to_string();
        assert!(message.contains("was taken with camera 2, which is not among"), "{message}");
        let points = points(path(), POINTS.as_bytes()).unwrap();
        let message = super::super::points_surface(path(), &points, &HashMap::new()).unwrap_err().to_string();
        assert!(message.contains("point 0 was seen in image 7"), "{message}");
    }

    /// If this failed, a wrong number of parameters would shift focal lengths into principal points.
    #[test]
    fn a_wrong_number_of_parameters_is_refused() {
        let message = cameras(path(), b"1 PINHOLE 10 10 5 5 5\n").unwrap_err().to_string();
        assert!(message.contains("line 1: PINHOLE takes 4 parameters and there are 3"), "{message}");
    }
}

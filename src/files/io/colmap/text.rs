//! The text files of a COLMAP model. A line that cannot be read is left out; so no file is refused here.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::str::FromStr;

use glam::DVec3;

use super::rigs::{Frame, Rig, Sensor};
use super::{Image, Lens, NO_POINT, Observation, PROJECTIONS, Point};
use crate::files::io::left_out::LeftOut;

/// A line of a file, for its words and for messages about it.
struct Line<'a> {
    /// From 1.
    number: usize,
    text: &'a str,
    words: Vec<&'a str>,
}

impl<'a> Line<'a> {
    fn error(&self, what: impl std::fmt::Display) -> String {
        format!("line {}: {what}", self.number)
    }

    /// Word `i` as a number; `what` names it in the message.
    fn number<T: FromStr>(&self, i: usize, what: &str) -> Result<T, String> {
        match self.words.get(i) {
            None => Err(self.error(format!("{what} is missing"))),
            Some(word) => word.parse().map_err(|_| self.error(format!("{what} is {word:?}, which is no such number"))),
        }
    }

    /// `N` numbers from word `i` on.
    fn numbers<T: FromStr + Copy + Default, const N: usize>(&self, i: usize, what: &str) -> Result<[T; N], String> {
        let mut numbers = [T::default(); N];
        for (k, number) in numbers.iter_mut().enumerate() {
            *number = self.number(i + k, what)?;
        }
        Ok(numbers)
    }

    /// Quaternion (w, x, y, z) and translation from word `i` on.
    fn motion(&self, i: usize) -> Result<([f64; 4], [f64; 3]), String> {
        Ok((self.numbers(i, "the rotation")?, self.numbers(i + 4, "the translation")?))
    }

    /// What follows the first `count` words, with the spaces in it.
    fn after(&self, count: usize) -> &'a str {
        let mut rest = self.text.trim_ascii();
        for _ in 0..count {
            let end = rest.find(|c: char| c.is_ascii_whitespace()).unwrap_or(rest.len());
            rest = rest[end..].trim_ascii_start();
        }
        rest
    }

    /// Whether a line outside of an image's second line has content.
    fn speaks(&self) -> bool {
        self.words.first().is_some_and(|word| !word.starts_with('#'))
    }

    /// Whether this can be the second line of an image: triples of numbers, also such as `-nan(ind)`.
    fn holds_observations(&self) -> bool {
        let is_number = |word: &&str| word.parse::<f64>().is_ok() || word.trim_start_matches('-').starts_with("nan");
        self.words.len().is_multiple_of(3) && self.words.iter().all(is_number)
    }
}

/// The file as text; names that are not UTF-8 keep a replacement character.
fn decode(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)).into_owned()
}

/// The lines of a file.
fn lines(text: &str) -> impl Iterator<Item = Line<'_>> {
    text.lines().enumerate().map(move |(i, line)| Line {
        number: i + 1,
        text: line,
        words: line.split_ascii_whitespace().collect(),
    })
}

/// What `read` makes of the lines with content.
fn items<T>(bytes: &[u8], left_out: &mut LeftOut, read: impl Fn(&Line) -> Result<T, String>) -> Vec<T> {
    let mut items = Vec::new();
    for line in lines(&decode(bytes)).filter(Line::speaks) {
        match read(&line) {
            Ok(item) => items.push(item),
            Err(what) => left_out.add(what),
        }
    }
    items
}

/// Parses cameras.txt: lenses by their number.
pub fn cameras(bytes: &[u8], left_out: &mut LeftOut) -> BTreeMap<u32, Lens> {
    let mut lenses = BTreeMap::new();
    for (line, id, lens) in
        items(bytes, left_out, |line| Ok((line.number, line.number(0, "the camera's number")?, lens(line)?)))
    {
        match lenses.entry(id) {
            Entry::Vacant(free) => _ = free.insert(lens),
            Entry::Occupied(_) => left_out.add(format!("line {line}: camera {id} is given twice")),
        }
    }
    lenses
}

fn lens(line: &Line) -> Result<Lens, String> {
    let model = line.words.get(1).copied().unwrap_or_default();
    let Some(&projection) = PROJECTIONS.iter().find(|p| p.name == model) else {
        return Err(line.error(format!("{model:?} is no known camera model; convert it to PINHOLE or OPENCV")));
    };
    let size = line.numbers(2, "the image size")?;
    let parameters: Vec<f64> =
        (4..line.words.len()).map(|i| line.number(i, "a camera parameter")).collect::<Result<_, _>>()?;
    Lens::new(projection, size, &parameters).map_err(|what| line.error(what))
}

/// Parses images.txt, without the observations. Each image has a second line, of observations; where that is missing, there are none.
pub fn images(bytes: &[u8], left_out: &mut LeftOut) -> Vec<Image> {
    observed(bytes, |_| false, left_out)
}

/// Parses images.txt, with the observations of the images whose name `wanted` accepts.
pub fn observed(bytes: &[u8], wanted: impl Fn(&str) -> bool, left_out: &mut LeftOut) -> Vec<Image> {
    let text = decode(bytes);
    let mut lines = lines(&text).peekable();
    let mut images = Vec::new();
    while let Some(line) = lines.next() {
        if !line.speaks() {
            continue;
        }
        let second = lines.next_if(Line::holds_observations);
        match image(&line, second.as_ref(), &wanted) {
            Ok(image) => images.push(image),
            Err(what) => left_out.add(what),
        }
    }
    images
}

fn image(line: &Line, second: Option<&Line>, wanted: impl Fn(&str) -> bool) -> Result<Image, String> {
    let id = line.number(0, "the image's number")?;
    let stored = line.motion(1)?;
    let lens = line.number(8, "the camera's number")?;
    let name = line.after(9).to_owned();
    if name.is_empty() {
        return Err(line.error("the image's name is missing"));
    }
    let mut observations = Vec::new();
    if let Some(second) = second.filter(|_| wanted(&name)) {
        for i in (0..second.words.len()).step_by(3) {
            let point: i64 = second.number(i + 2, "the point of an observation")?;
            // A pixel that is no number keeps its place, since tracks count observations.
            let pixel = [i, i + 1].map(|i| second.number(i, "an observation").unwrap_or(f64::NAN));
            observations.push(Observation { pixel, point: u64::try_from(point).unwrap_or(NO_POINT) });
        }
    }
    Ok(Image { id, lens, name, stored, observations })
}

/// Parses points3D.txt.
pub fn points(bytes: &[u8], left_out: &mut LeftOut) -> Vec<Point> {
    items(bytes, left_out, |line| {
        let id = line.number(0, "the point's number")?;
        let position = DVec3::from_array(line.numbers(1, "the position")?);
        let colour = line.numbers(4, "the colour")?;
        let error = line.number(7, "the reprojection error")?;
        if line.words.len() % 2 != 0 {
            return Err(line.error("the track is no list of pairs"));
        }
        let track = (8..line.words.len()).step_by(2).map(|i| line.numbers(i, "an entry of the track"));
        Ok(Point { id, position, colour, error, track: track.collect::<Result<_, _>>()? })
    })
}

/// Parses rigs.txt.
pub fn rigs(bytes: &[u8], left_out: &mut LeftOut) -> Vec<Rig> {
    items(bytes, left_out, |line| {
        let (id, count) = (line.number(0, "the rig's number")?, line.number::<u32>(1, "the number of sensors")?);
        let mut sensors = Vec::new();
        let mut at = 2;
        for i in 0..count {
            let sensor = line.sensor(at)?;
            at += 2;
            // The first is what the rig's pose is of.
            let pose = match i {
                0 => Some(Rig::REFERENCE),
                _ => {
                    at += 1;
                    let known = line.number::<u32>(at - 1, "whether the sensor has a pose")? == 1;
                    known.then(|| line.motion(at)).transpose()?
                }
            };
            at += if i > 0 && pose.is_some() { 7 } else { 0 };
            sensors.push((sensor, pose));
        }
        Ok(Rig { id, sensors })
    })
}

/// Parses frames.txt.
pub fn frames(bytes: &[u8], left_out: &mut LeftOut) -> Vec<Frame> {
    items(bytes, left_out, |line| {
        let rig = line.number(1, "the rig's number")?;
        let count = line.number::<u32>(9, "the number of images")?;
        let image =
            |i: u32| Ok((line.sensor(10 + 3 * i as usize)?, line.number(12 + 3 * i as usize, "an image's number")?));
        let images = (0..count).map(image).collect::<Result<_, String>>()?;
        Ok(Frame { rig, pose: line.motion(2)?, images })
    })
}

impl Line<'_> {
    /// The kind and number of a sensor.
    fn sensor(&self, i: usize) -> Result<Sensor, String> {
        let is_camera = self.words.get(i).is_some_and(|word| *word == "CAMERA");
        Ok(Sensor { is_camera, id: self.number(i + 1, "a sensor's number")? })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{cameras_of, surface_points, usable};
    use super::*;

    const CAMERAS: &str = "# Camera list\n# Number of cameras: 2\n\
                           1 SIMPLE_RADIAL 640 480 500 320 240 0.1\n2 OPENCV 100 200 90 91 50 100 1 2 3 4\n";
    /// The second camera is at (0, 0, -2) turned by 180 degrees about y, and its name holds blanks.
    const IMAGES: &str = "# Image list\n\n\
                          7 1 0 0 0 1 2 3 1 b.jpg\n10 20 -1 30 40 5\n\
                          8 0 0 2 0 0 0 -2 2 a  1.jpg\n\n";
    const POINTS: &str = "# points\n5 0 0 5 10 20 30 0.5 7 0 8 0\n6 1 0 5 10 20 30 0.5\n";

    /// What is read where nothing is left out.
    fn whole<T>(read: impl Fn(&mut LeftOut) -> T) -> T {
        let mut left_out = LeftOut::default();
        let read = read(&mut left_out);
        assert!(left_out.is_empty(), "{left_out:?}");
        read
    }

    /// What is read, and what is wrong with the one item that is left out.
    fn without<T>(read: impl Fn(&mut LeftOut) -> T) -> (T, String) {
        let (mut left_out, mut notes) = (LeftOut::default(), Vec::new());
        let read = read(&mut left_out);
        left_out.note("items", &mut notes);
        assert!(notes[0].starts_with("items left out: 1;"), "{notes:?}");
        (read, notes.remove(0))
    }

    /// If this failed, poses would be inverted or mirrored, or parameters would be mistaken for each other.
    #[test]
    fn a_model_by_hand_is_read_as_written() {
        let lenses = whole(|left_out| cameras(CAMERAS.as_bytes(), left_out));
        let images = whole(|left_out| images(IMAGES.as_bytes(), left_out));
        let cameras = cameras_of(&lenses, &images);
        assert_eq!(cameras.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["b.jpg", "a  1.jpg"]);
        assert!((cameras[0].pose.position - DVec3::new(-1.0, -2.0, -3.0)).length() < 1e-12);
        assert!((cameras[1].pose.forward() - DVec3::NEG_Z).length() < 1e-12);
        assert!((cameras[1].pose.position - DVec3::new(0.0, 0.0, -2.0)).length() < 1e-12);
        assert_eq!((cameras[1].intrinsics.focal, cameras[1].intrinsics.principal), ([90.0, 91.0], [50.0, 100.0]));
        assert_eq!((cameras[0].intrinsics.focal, cameras[0].intrinsics.principal), ([500.0; 2], [320.0, 240.0]));
        assert_eq!(lenses[&1].distortion, [0.1]);

        let points = whole(|left_out| points(POINTS.as_bytes(), left_out));
        let surface = surface_points(&points, &images);
        assert!(surface.toward_cameras[0].z < -0.9, "{:?}", surface.toward_cameras);
        assert_eq!(surface.toward_cameras[1], DVec3::ZERO);
        assert_eq!(surface.colours[1], [10, 20, 30]);
        assert!(!surface.oriented && surface.normals.is_empty());
    }

    /// If this failed, a model that an editor took the empty lines from would lose every other image, or the last.
    #[test]
    fn an_image_may_lack_its_second_line() {
        let names = |text: &str| {
            let images = whole(|left_out| observed(text.as_bytes(), |_| true, left_out));
            images.iter().map(|image| (image.name.clone(), image.observations.len())).collect::<Vec<_>>()
        };
        let b = "7 1 0 0 0 1 2 3 1 b.jpg\n";
        assert_eq!(
            names(&format!("{b}8 0 0 2 0 0 0 -2 2 a.jpg\n1 2 -1\n")),
            [("b.jpg".into(), 0), ("a.jpg".into(), 1)]
        );
        assert_eq!(names(b), [("b.jpg".into(), 0)]);
        assert_eq!(names(&format!("{b}10 -nan(ind) 5 1 2 -1\n")), [("b.jpg".into(), 2)]);
    }

    /// If this failed, one bad line would lose a whole model, or a good one go with it.
    #[test]
    fn a_bad_line_is_left_out_and_named() {
        let (read, note) = without(|left_out| cameras(b"1 PINHOLE 10 10 5 5 5\n2 PINHOLE 9 9 5 5 5 5\n", left_out));
        assert!(read.contains_key(&2) && note.contains("line 1: PINHOLE takes 4 parameters and there are 3"), "{note}");
        let twice = b"2 PINHOLE 9 9 5 5 5 5\n2 PINHOLE 7 7 5 5 5 5\n";
        let (read, note) = without(|left_out| cameras(twice, left_out));
        assert!(read[&2].intrinsics.width == 9 && note.contains("line 2: camera 2 is given twice"), "{note}");
        let (read, note) =
            without(|left_out| images(format!("7 1 0 0 0 1 x 3 1 c.jpg\n\n{IMAGES}").as_bytes(), left_out));
        assert!(read.len() == 2 && note.contains("line 1: the translation is \"x\""), "{note}");
        let (read, note) = without(|left_out| images(format!("{IMAGES}9 1 0 0").as_bytes(), left_out));
        assert!(read.len() == 2 && note.contains("line 7: the rotation is missing"), "{note}");
        let (read, note) = without(|left_out| points(format!("{POINTS}7 1 0 5 1 2").as_bytes(), left_out));
        assert!(read.len() == 2 && note.contains("line 4: the colour is missing"), "{note}");
    }

    /// If this failed, an image could be given the lens of another camera, or none, or a place that is none.
    #[test]
    fn images_that_cannot_be_used_are_left_out_and_named() {
        let lenses = whole(|left_out| cameras(b"1 PINHOLE 10 10 5 5 5 5\n", left_out));
        let with = |line: &str| {
            let images =
                whole(|left_out| images(format!("7 1 0 0 0 1 2 3 1 b.jpg\n\n{line}\n\n").as_bytes(), left_out));
            let (images, note) = without(|left_out| usable(&lenses, images.clone(), left_out));
            assert!(images.len() == 1 && images[0].name == "b.jpg", "{images:?}");
            note
        };
        assert!(with("8 1 0 0 0 1 2 3 2 c.jpg").contains("image \"c.jpg\" was taken with camera 2"));
        assert!(
            with("8 0 0 0 0 1 2 3 1 c.jpg").contains("image \"c.jpg\" has a pose that is not finite or no rotation")
        );
        assert!(with("8 1 0 0 0 1 nan 3 1 c.jpg").contains("image \"c.jpg\" has a pose that is not finite"));
        assert!(with("7 1 0 0 0 1 2 3 1 c.jpg").contains("has the number 7 of another one"));
        assert!(with("8 1 0 0 0 1 2 3 1 b.jpg").contains("image \"b.jpg\" is there twice"));
    }
}

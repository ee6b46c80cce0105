//! A model cut down to some of its images.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::Path;

use super::{Image, Lens, NO_POINT, Point};
use crate::error::{Error, Result};

/// The binary files of a model that was cut down, and what is in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Subset {
    /// Names and bytes: cameras.bin, images.bin and points3D.bin (the last only where the model has points).
    pub files: Vec<(&'static str, Vec<u8>)>,
    /// Images kept.
    pub images: usize,
    /// Points kept: those that an image that was kept still sees.
    pub points: usize,
}

/// Cuts the model in or under `folder` (as [`super::model_folder`] finds it) down to the images named in `keep`. Numbers,
/// poses, camera models and their parameters, observations, positions, colours and errors stay what they are, bit for
/// bit; tracks lose the images that are gone and observations that are not there, and points that no image sees any more are dropped.
/// Images and points keep their order, whatever that of `keep`. Files of rigs and frames are left out, as older versions of COLMAP do;
/// newer ones read the model without them, and images have the poses of theirs.
///
/// # Errors
/// When the model cannot be read, or lacks an image that is named.
pub fn subset(folder: &Path, keep: &[String]) -> Result<Subset> {
    let Some(folder) = super::model_folder(folder) else {
        return Err(Error::input(folder, "the folder holds no COLMAP model (cameras and images as .bin or .txt)"));
    };
    let names: HashSet<&str> = keep.iter().map(String::as_str).collect();
    let wanted = |name: &str| names.contains(name);
    // Whoever chose the images read the model before, and has its notes.
    let (lenses, mut images) = super::views(&folder, wanted, &mut Vec::new())?;
    images.retain(|image| wanted(&image.name));
    let there: HashSet<&str> = images.iter().map(|image| image.name.as_str()).collect();
    if let Some(name) = keep.iter().find(|name| !there.contains(name.as_str())) {
        return Err(Error::input(folder, format!("the model has no image {name:?}; name images as the model does")));
    }
    let used: BTreeSet<u32> = images.iter().map(|image| image.lens).collect();
    let kept_lenses: Vec<(u32, &Lens)> = used.into_iter().filter_map(|id| Some((id, lenses.get(&id)?))).collect();
    let mut files = vec![("cameras.bin", cameras_bin(&kept_lenses))];

    let points = super::points(&folder, &mut Vec::new())?.map(|points| cut(points, &images));
    let kept: HashSet<u64> = points.iter().flatten().map(|point| point.id).collect();
    for observation in images.iter_mut().flat_map(|image| &mut image.observations) {
        if !kept.contains(&observation.point) {
            observation.point = NO_POINT;
        }
    }
    files.push(("images.bin", images_bin(&images)));
    if let Some(points) = &points {
        files.push(("points3D.bin", points_bin(points)));
    }
    Ok(Subset { files, images: images.len(), points: points.map_or(0, |points| points.len()) })
}

/// The points that `images` still see.
fn cut(mut points: Vec<Point>, images: &[Image]) -> Vec<Point> {
    let counts: HashMap<u32, usize> = images.iter().map(|image| (image.id, image.observations.len())).collect();
    for point in &mut points {
        point.track.retain(|[image, at]| counts.get(image).is_some_and(|count| (*at as usize) < *count));
    }
    points.retain(|point| !point.track.is_empty());
    points
}

fn cameras_bin(lenses: &[(u32, &Lens)]) -> Vec<u8> {
    let mut bytes = (lenses.len() as u64).to_le_bytes().to_vec();
    for (id, lens) in lenses {
        bytes.extend(id.to_le_bytes());
        bytes.extend(lens.projection.id.to_le_bytes());
        bytes.extend(u64::from(lens.intrinsics.width).to_le_bytes());
        bytes.extend(u64::from(lens.intrinsics.height).to_le_bytes());
        lens.parameters().iter().for_each(|parameter| bytes.extend(parameter.to_le_bytes()));
    }
    bytes
}

fn images_bin(images: &[Image]) -> Vec<u8> {
    let mut bytes = (images.len() as u64).to_le_bytes().to_vec();
    for image in images {
        bytes.extend(image.id.to_le_bytes());
        let (rotation, translation) = &image.stored;
        rotation.iter().chain(translation).for_each(|number| bytes.extend(number.to_le_bytes()));
        bytes.extend(image.lens.to_le_bytes());
        bytes.extend(image.name.as_bytes());
        bytes.push(0);
        bytes.extend((image.observations.len() as u64).to_le_bytes());
        for observation in &image.observations {
            observation.pixel.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
            bytes.extend(observation.point.to_le_bytes());
        }
    }
    bytes
}

fn points_bin(points: &[Point]) -> Vec<u8> {
    let mut bytes = (points.len() as u64).to_le_bytes().to_vec();
    for point in points {
        bytes.extend(point.id.to_le_bytes());
        point.position.to_array().iter().for_each(|number| bytes.extend(number.to_le_bytes()));
        bytes.extend(point.colour);
        bytes.extend(point.error.to_le_bytes());
        bytes.extend((point.track.len() as u64).to_le_bytes());
        point.track.iter().flatten().for_each(|number| bytes.extend(number.to_le_bytes()));
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::super::{binary, text};
    use super::*;
    use crate::files::io::left_out::LeftOut;

    const CAMERAS: &str = "1 SIMPLE_RADIAL 640 480 500.25 320 240 0.1\n2 OPENCV 100 200 90 91 50 100 1 2 3 4\n";
    const IMAGES: &str = "7 1 0 0 0 1 2 3 1 b.jpg\n10.5 20 5 30 40 -1 50 60 6\n\
                          8 0 0 2 0 0 0 -2 2 a 1.jpg\n1 2 5\n9 1 0 0 0 0 0 0 1 c.jpg\n\n";
    const POINTS: &str = "5 0 0.1 5 10 20 30 0.5 7 0 8 0\n6 1 0 5 40 50 60 0.25 7 2\n";

    fn model(points: &str) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in [("cameras.txt", CAMERAS), ("images.txt", IMAGES), ("points3D.txt", points)] {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        folder
    }

    fn file<'a>(subset: &'a Subset, name: &str) -> &'a [u8] {
        &subset.files.iter().find(|file| file.0 == name).unwrap().1
    }

    /// If this failed, a trainer that starts from a subset would see other poses, lenses or points than the whole model has.
    #[test]
    fn what_is_kept_stays_what_it_was() {
        let folder = model(POINTS);
        let subset = subset(folder.path(), &["a 1.jpg".into(), "c.jpg".into()]).unwrap();
        assert_eq!((subset.images, subset.points), (2, 1));
        let path = Path::new("subset.bin");
        let left_out = &mut LeftOut::default();
        let lenses = binary::cameras(path, file(&subset, "cameras.bin"), left_out).unwrap();
        assert_eq!(lenses, text::cameras(CAMERAS.as_bytes(), left_out));
        let images = binary::observed(path, file(&subset, "images.bin"), |_| true).unwrap();
        assert_eq!(images, text::observed(IMAGES.as_bytes(), |_| true, left_out)[1..]);
        let points = binary::points(path, file(&subset, "points3D.bin")).unwrap();
        let mut known = text::points(POINTS.as_bytes(), left_out).remove(0);
        known.track = vec![[8, 0]];
        assert_eq!(points, [known]);
    }

    /// If this failed, a subset would hold cameras that nothing was taken with, or silently less than was requested.
    #[test]
    fn only_what_is_used_is_kept_and_names_must_be_there() {
        let folder = model(POINTS);
        let subset_of = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(|name| name.to_string()).collect();
            subset(folder.path(), &names)
        };
        let first = subset_of(&["b.jpg"]).unwrap();
        let path = Path::new("subset.bin");
        let lenses = binary::cameras(path, file(&first, "cameras.bin"), &mut LeftOut::default()).unwrap();
        assert_eq!(lenses.keys().collect::<Vec<_>>(), [&1]);
        assert_eq!(first.points, 2);
        let images = binary::observed(path, file(&first, "images.bin"), |_| true).unwrap();
        assert_eq!(images[0].observations[1].point, NO_POINT);
        assert!(subset_of(&["b.jpg", "B.jpg"]).unwrap_err().to_string().contains("no image \"B.jpg\""));
    }

    /// If this failed, a contradiction in a model would be passed on to programs that read the subset, and crash them.
    #[test]
    fn a_track_that_leads_nowhere_is_left_out() {
        let folder = model("5 0 0 5 10 20 30 0.5 8 3\n6 1 0 5 10 20 30 0.5 8 3 8 0 77 0\n");
        let subset = subset(folder.path(), &["a 1.jpg".into()]).unwrap();
        let points = binary::points(Path::new("points3D.bin"), file(&subset, "points3D.bin")).unwrap();
        assert_eq!(points.iter().map(|point| (point.id, &point.track[..])).collect::<Vec<_>>(), [(6, &[[8, 0]][..])]);
    }
}

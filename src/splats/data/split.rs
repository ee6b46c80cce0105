//! Which photos are trained on, and which are kept back to test with.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use crate::files::io;
use crate::files::photos::{Convention, Photo, PhotoSet};
use crate::splats::config::Background;
use crate::splats::render::frame::Frame;
use crate::{Error, Result};

/// Every how many photos one is for testing, as in 3DGS and gsplat.
pub(crate) const TEST_EVERY: u32 = 8;

/// Least photos that can be trained on.
const MIN_PHOTOS: usize = 2;

/// Extents of the training cameras within which those of a test in the same frame are expected.
const NEARBY: f64 = 3.0;

/// Where the test photos come from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Test {
    /// The transforms_test.json beside a transforms_train.json, else one of every [`TEST_EVERY`] photos.
    #[default]
    Default,
    /// One of every so many photos, by name, from the first on; none for 0.
    Every(u32),
    /// All photos of another capture, in the same frame.
    Capture(PathBuf),
}

/// A capture split into training and test photos.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// The capture with the photos to train on only; its points are all there.
    pub train: PhotoSet,
    /// The photos to test with, by name.
    pub test: Vec<Photo>,
    /// What a user should know of the test: one line each.
    pub notes: Vec<String>,
}

impl Split {
    /// Splits `set`. Another capture is read with `options`.
    ///
    /// # Errors
    /// Where fewer than two photos are left to train on, or the other capture cannot be read.
    pub fn new(set: PhotoSet, test: &Test, options: io::photos::ReadOptions) -> Result<Self> {
        let beside = || test_file(&set).map_or(Test::Every(TEST_EVERY), Test::Capture);
        let test = if *test == Test::Default { beside() } else { test.clone() };
        let path = set.path.clone();
        let split = match test {
            Test::Default | Test::Every(0) => Self { train: set, test: Vec::new(), notes: Vec::new() },
            Test::Every(every) => Self::every(set, every as usize),
            Test::Capture(path) => Self::against(set, &path, options)?,
        };
        let left = split.train.photos.len();
        if left < MIN_PHOTOS {
            let what = format!(
                "{left} of {} photos are left to train on, which takes at least {MIN_PHOTOS}; take more photos, or fewer for testing (`test_every`)",
                left + split.test.len()
            );
            return Err(Error::input(path, what));
        }
        Ok(split)
    }

    /// The default background: white where photos mark what belongs to the object, else black.
    pub fn usual_background(&self) -> Background {
        if self.train.cut_out() > 0 { Background::White } else { Background::Black }
    }

    fn every(set: PhotoSet, every: usize) -> Self {
        let test: Vec<Photo> = set.photos.iter().step_by(every).cloned().collect();
        let kept_back: HashSet<&str> = test.iter().map(|photo| photo.camera.name.as_str()).collect();
        let train = set.filtered(|photo| !kept_back.contains(photo.camera.name.as_str()));
        Self { train, test, notes: Vec::new() }
    }

    fn against(train: PhotoSet, path: &Path, options: io::photos::ReadOptions) -> Result<Self> {
        let test = io::photos::read(path, &options)?.photos;
        let mut notes = vec![format!("tested with the {} photos of {}", test.len(), path.display())];
        let frame = Frame::new(&train.cameras(), &train.points.positions);
        let is_near = |photo: &Photo| frame.to_training.point(photo.camera.pose.position).length() < NEARBY;
        if !test.iter().any(is_near) {
            let what =
                "no test camera is anywhere near the training cameras: check that both captures are in one frame";
            notes.push(what.into());
        }
        let trained: HashSet<&Path> = train.photos.iter().filter_map(|photo| photo.image.as_deref()).collect();
        let both =
            test.iter().filter_map(|photo| photo.image.as_deref()).filter(|image| trained.contains(image)).count();
        if both > 0 {
            notes.push(format!("{both} of the test photos are trained on as well: they test nothing"));
        }
        Ok(Self { train, test, notes })
    }
}

/// The transforms_test.json beside the transforms_train.json that a capture was read from.
fn test_file(set: &PhotoSet) -> Option<PathBuf> {
    const TRAIN: &str = "transforms_train.json";
    let is_folder = set.path.is_dir();
    let is_train = match is_folder {
        // A transforms.json takes precedence.
        true => set.path.join(TRAIN).is_file() && !set.path.join("transforms.json").is_file(),
        false => set.path.ends_with(TRAIN),
    };
    let folder = if is_folder { &set.path } else { set.path.parent()? };
    let file = folder.join("transforms_test.json");
    (set.convention == Convention::Transforms && is_train && file.is_file()).then_some(file)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use image::RgbImage;

    use super::*;
    use crate::files::io::photos::Images;
    use crate::scene::camera::{Camera, Intrinsics, Pose};
    use crate::scene::lens::Distortion;
    use crate::scene::surface::Points;

    fn set(count: u32) -> PhotoSet {
        let photo = |i: u32| {
            let pose = Pose::looking(DVec3::new(f64::from(i), 0.0, 0.0), DVec3::Y, DVec3::Z);
            let camera = Camera { name: format!("{i:02}.png"), pose, intrinsics: Intrinsics::from_fov(8, 6, 1.0) };
            Photo { camera, distortion: Distortion::default(), image: None, mask: None }
        };
        PhotoSet {
            path: "capture".into(),
            photos: (0..count).map(photo).collect(),
            points: Points { positions: vec![DVec3::Y; 3], ..Points::default() },
            tracks: vec![(0..count).collect(); 3],
            ..PhotoSet::default()
        }
    }

    fn names(photos: &[Photo]) -> Vec<&str> {
        photos.iter().map(|photo| photo.camera.name.as_str()).collect()
    }

    /// If this failed, figures would not compare with those of other trainers, or come from photos that were trained on.
    #[test]
    fn every_eighth_photo_from_the_first_is_for_testing() {
        let split = |count, test| Split::new(set(count), &test, Images::Optional.into()).unwrap();
        let usual = split(20, Test::Default);
        assert_eq!(usual, split(20, Test::Every(8)));
        assert_eq!(names(&usual.test), ["00.png", "08.png", "16.png"]);
        assert_eq!(usual.train.photos.len(), 17);
        assert!(usual.train.photos.iter().all(|photo| !usual.test.contains(photo)));
        assert_eq!((usual.train.points.positions.len(), usual.train.tracks[0].len()), (3, 17));
        let none = split(20, Test::Every(0));
        assert_eq!((none.train.photos.len(), none.test.len()), (20, 0));
        assert_eq!(names(&split(5, Test::Every(2)).train.photos), ["01.png", "03.png"]);
    }

    /// If this failed, a run would start without training photos.
    #[test]
    fn too_few_photos_are_refused() {
        for (count, test) in [(2, Test::Default), (20, Test::Every(1)), (1, Test::Every(0)), (0, Test::Default)] {
            let error = Split::new(set(count), &test, Images::Optional.into()).unwrap_err().to_string();
            assert!(error.starts_with("capture: ") && error.contains("`test_every`"), "{error}");
        }
    }

    /// A capture of transforms, `offset` away from the origin.
    fn write(folder: &Path, file: &str, offset: f64) {
        let frames: Vec<String> = (0..4)
            .map(|i| {
                let x = f64::from(i) + offset;
                let matrix = format!("[[1,0,0,{x}],[0,1,0,0],[0,0,1,{}],[0,0,0,1]]", i % 2);
                format!("{{\"file_path\": \"{file}_{i}.png\", \"transform_matrix\": {matrix}}}")
            })
            .collect();
        for i in 0..4 {
            RgbImage::new(8, 6).save(folder.join(format!("{file}_{i}.png"))).unwrap();
        }
        let text = format!("{{\"camera_angle_x\": 0.8, \"frames\": [{}]}}", frames.join(","));
        std::fs::write(folder.join(format!("{file}.json")), text).unwrap();
    }

    /// If this failed, the test views of a synthetic scene would not be used, or one in another frame would pass for a bad
    /// result of the training.
    #[test]
    fn another_capture_is_for_testing() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for (file, offset) in [("transforms_train", 0.0), ("transforms_test", 0.5), ("far", 1e3)] {
            write(folder.path(), file, offset);
        }
        let split = |from: &Path, test: &Test| {
            let set = io::photos::read(from, &io::photos::ReadOptions::default()).unwrap();
            Split::new(set, test, Images::Needed.into()).unwrap()
        };
        let given = split(folder.path(), &Test::Capture(path("transforms_test.json")));
        assert_eq!((given.train.photos.len(), given.test.len(), given.notes.len()), (4, 4, 1), "{:?}", given.notes);
        assert_eq!(split(folder.path(), &Test::Default), given);
        assert_eq!(split(&path("transforms_train.json"), &Test::Default).test, given.test);
        assert_eq!(split(folder.path(), &Test::Every(2)).test.len(), 2);
        let far = split(folder.path(), &Test::Capture(path("far.json")));
        assert!(far.notes.iter().any(|note| note.contains("one frame")), "{:?}", far.notes);
        let same = split(folder.path(), &Test::Capture(path("transforms_train.json")));
        assert!(same.notes.iter().any(|note| note.starts_with("4 of the test photos")), "{:?}", same.notes);
        std::fs::copy(path("transforms_train.json"), path("transforms.json")).unwrap();
        assert_eq!(split(folder.path(), &Test::Default).test.len(), 1);
        let error = Split::new(set(4), &Test::Capture(path("none.json")), Images::Needed.into()).unwrap_err();
        assert!(error.to_string().contains("none.json"), "{error}");
    }
}

//! Scenes on which methods are compared, split once into those that laws and settings are fitted to, those that they are chosen by, and those
//! that results are of; and the [`board`] of what methods reached on them. `docs/reference/benchmark.md` says how a method gets its place.

pub mod board;

use std::fmt;

use serde::Deserialize;

use crate::{Error, Result};

/// The scenes, in files of a folder of data or built in.
const SCENES: &str = include_str!("scenes.json");

/// What a scene may be used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Split {
    /// Laws and settings are fitted to it
    Fit,
    /// They are chosen by it
    Validation,
    /// Results are reported of it
    Test,
}

impl fmt::Display for Split {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Fit => "fit",
            Self::Validation => "validation",
            Self::Test => "test",
        })
    }
}

/// A scene of the benchmark.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BenchmarkScene {
    /// What it is called in tables.
    pub name: String,
    /// What it may be used for.
    pub split: Split,
    /// Its file in the folder of data; none where it is built in.
    pub file: Option<String>,
    /// What `evaluate` calls it, where it is built in.
    pub situation: Option<String>,
    /// The file of its light, +Y up.
    pub env: Option<String>,
    /// Corners of the box in which cameras and viewers stand in a room, in the file's units.
    #[serde(rename = "box")]
    pub corners: Option<[f64; 6]>,
    /// Between which heights viewers look in a room.
    pub heights: Option<[f64; 2]>,
}

impl BenchmarkScene {
    /// Whether it is a room, seen from inside.
    pub fn is_room(&self) -> bool {
        self.heights.is_some()
    }
}

/// All scenes in a fixed order.
///
/// # Errors
/// None: the text is a constant of this crate, which a test parses.
pub fn scenes() -> Result<Vec<BenchmarkScene>> {
    serde_json::from_str(SCENES).map_err(|e| Error::request(format!("the built-in scenes cannot be read: {e}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::evaluate::situation::Situation;

    /// If this failed, a scene could not be run, or be fitted to and tested on at once.
    #[test]
    fn every_scene_is_of_one_split_and_has_what_it_is_made_of() {
        let scenes = scenes().unwrap();
        for (i, scene) in scenes.iter().enumerate() {
            assert!(scenes[..i].iter().all(|other| other.name != scene.name), "{} twice", scene.name);
            match (&scene.file, &scene.situation) {
                (Some(file), None) => {
                    assert!(file.contains(&scene.name) && (!scene.is_room() || scene.corners.is_some()))
                }
                (None, Some(name)) => {
                    let situation: Situation = serde_json::from_value(name.as_str().into()).unwrap();
                    assert!(situation.is_room() && *name == scene.name);
                }
                _ => panic!("{} is made of nothing, or of two things", scene.name),
            }
        }
        let count = |split, room| scenes.iter().filter(|scene| scene.split == split && scene.is_room() == room).count();
        assert_eq!(
            [Split::Fit, Split::Validation, Split::Test].map(|split| (count(split, false), count(split, true))),
            [(5, 4), (2, 1), (5, 6)]
        );
    }
}

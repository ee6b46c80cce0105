//! Layouts of the user's, compared as a method: cameras that were placed by other means, in files.

use std::collections::BTreeMap;
use std::path::Path;

use crate::files::io;
use crate::planner::methods::Method;
use crate::scene::camera::{Intrinsics, Pose};
use crate::{Error, Result};

/// What stands before the files of a layout: one whose cameras have the lens of all methods, and one whose cameras have those of the file.
const FILES: [(&str, bool); 2] = [("cameras:", false), ("lenses:", true)];
/// What a file's name may contain for each of many: `{scene}`, `{views}` and `{seed}`.
const PLACEHOLDERS: [&str; 3] = ["scene", "views", "seed"];

/// A method whose cameras lie in files: `cameras:FILE`, or `NAME=cameras:FILE` with a name for the tables; `lenses:` in place of `cameras:`
/// where they keep their lenses. In FILE, `{scene}`, `{views}` and `{seed}` stand for those of a run.
#[derive(Debug)]
pub struct Given {
    /// What it is called in tables.
    pub name: String,
    /// The file's path, with placeholders.
    pattern: String,
    /// Whether cameras have the lenses of the file.
    own_lenses: bool,
    /// What was read, by the path it was read from: poses and lenses.
    layouts: BTreeMap<String, Vec<(Pose, Intrinsics)>>,
    /// What was understood of the files, for the user to check.
    pub notes: Vec<String>,
}

/// The files of a layout's method that has no name of its own; none of another method.
pub(super) fn files_of(method: &str) -> Option<&str> {
    FILES.iter().find_map(|(files, _)| method.strip_prefix(files))
}

/// What readers of files say that they left out, to follow a number of cameras.
pub(super) fn left_out(notes: &[String]) -> String {
    notes.iter().filter(|note| note.contains(" left out: ")).map(|note| format!(" ({note})")).collect()
}

/// Independent of their names.
impl PartialEq for Given {
    fn eq(&self, other: &Self) -> bool {
        self.layouts.values().eq(other.layouts.values())
            && self.own_lenses == other.own_lenses
            && (!self.layouts.is_empty() || self.pattern == other.pattern)
    }
}

// Poses that were read are numbers.
impl Eq for Given {}

impl Given {
    /// Understands the name of a layout's method; none where it names something else. Its files are read by [`Given::read`].
    ///
    /// # Errors
    /// What is wrong with the name.
    pub fn parse(name: &str) -> Option<Result<Self, String>> {
        let (label, pattern, own_lenses) = FILES.iter().find_map(|(files, own)| match name.strip_prefix(files) {
            Some(pattern) => Some((name, pattern, *own)),
            None => name.split_once(&format!("={files}")).map(|(label, pattern)| (label, pattern, *own)),
        })?;
        let unknown = pattern
            .split('{')
            .skip(1)
            .map(|part| part.split('}').next().unwrap_or_default())
            .find(|placeholder| !PLACEHOLDERS.contains(placeholder));
        Some(match unknown {
            Some(unknown) => Err(format!("{{{unknown}}} stands for nothing; give {{scene}}, {{views}} or {{seed}}")),
            None if pattern.is_empty() => Err("name a file behind the colon".into()),
            None if label.trim().is_empty() || label != name && label.contains(':') => {
                Err("give a name without a colon before the equals sign".into())
            }
            None if Method::named(label).is_some() => Err(format!("{label} is a method here; give another name")),
            None => Ok(Self {
                name: label.to_owned(),
                pattern: pattern.to_owned(),
                own_lenses,
                layouts: BTreeMap::new(),
                notes: Vec::new(),
            }),
        })
    }

    /// Reads every file that runs of these scenes, budgets and seeds need.
    ///
    /// # Errors
    /// Where a file cannot be read, or holds another number of cameras than its name says or than the others.
    pub fn read(&self, scenes: &[String], budgets: &[u32], seeds: impl Iterator<Item = u64> + Clone) -> Result<Self> {
        let mut layouts = BTreeMap::new();
        let mut notes: Vec<String> = Vec::new();
        for scene in scenes {
            for views in budgets {
                for seed in seeds.clone() {
                    let file = self.file(scene, *views, seed);
                    if layouts.contains_key(&file) {
                        continue;
                    }
                    let (cameras, said) = io::read_cameras_with_notes(Path::new(&file))?;
                    let count = cameras.len();
                    if self.has("views") && count != *views as usize {
                        let what = format!("these are {count} cameras, and its name says {views}{}", left_out(&said));
                        return Err(Error::input(Path::new(&file), what));
                    }
                    if let Some((other, poses)) =
                        layouts.iter().find(|(_, poses): &(_, &Vec<_>)| !self.has("views") && poses.len() != count)
                    {
                        let what = format!(
                            "these are {count} cameras, and {other} has {}; give one number, or {{views}} in the name{}",
                            poses.len(),
                            left_out(&said)
                        );
                        return Err(Error::input(Path::new(&file), what));
                    }
                    notes.extend(said.into_iter().filter(|note| !notes.contains(note)).collect::<Vec<_>>());
                    layouts.insert(file, cameras.into_iter().map(|camera| (camera.pose, camera.intrinsics)).collect());
                }
            }
        }
        Ok(Self { name: self.name.clone(), pattern: self.pattern.clone(), own_lenses: self.own_lenses, layouts, notes })
    }

    /// The poses of a run, in the scene's frame, and the lenses that the cameras have in place of the usual one, for pictures whose longer
    /// side has `size` pixels; none where none were read for it.
    pub fn cameras(&self, scene: &str, views: u32, seed: u64, size: u32) -> (Vec<Pose>, Vec<Intrinsics>) {
        let read = self.layouts.get(&self.file(scene, views, seed)).map_or(&[][..], Vec::as_slice);
        let lenses = read.iter().filter(|_| self.own_lenses).map(|(_, lens)| lens.with_longest(size));
        (read.iter().map(|(pose, _)| *pose).collect(), lenses.collect())
    }

    /// Whether its cameras have the lenses of the files.
    pub fn has_own_lenses(&self) -> bool {
        self.own_lenses
    }

    /// Whether it has layouts of so many cameras.
    pub fn takes(&self, views: u32) -> bool {
        self.layouts.values().any(|poses| poses.len() == views as usize)
    }

    /// How many cameras the first of the files holds; none before they are read.
    pub fn count(&self) -> Option<usize> {
        self.layouts.values().next().map(Vec::len)
    }

    /// Whether each scene has cameras of its own.
    pub fn of_each_scene(&self) -> bool {
        self.has("scene")
    }

    fn has(&self, placeholder: &str) -> bool {
        self.pattern.contains(&format!("{{{placeholder}}}"))
    }

    fn file(&self, scene: &str, views: u32, seed: u64) -> String {
        self.pattern
            .replace("{views}", &views.to_string())
            .replace("{seed}", &seed.to_string())
            .replace("{scene}", scene)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given(name: &str) -> Given {
        Given::parse(name).unwrap().unwrap()
    }

    /// If this failed, a layout would be taken for another scene's or seed's, or a wrong name would fail after hours.
    #[test]
    fn each_run_has_the_cameras_of_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, xs: &[f64]| {
            let camera = |x: &f64| {
                serde_json::json!({ "name": format!("{x}.png"), "pose": { "position": [x, 0.0, 0.0],
                    "rotation": [1.0, 0.0, 0.0, 0.0] }, "intrinsics": { "width": 8, "height": 8, "focal": [8.0, 8.0],
                    "principal": [4.0, 4.0] } })
            };
            let cameras: Vec<_> = xs.iter().map(camera).collect();
            std::fs::write(folder.path().join(name), serde_json::json!({ "cameras": cameras }).to_string()).unwrap();
        };
        for (scene, x) in [("cup", 1.0), ("jug", 5.0)] {
            for seed in 0..2 {
                let x = x + f64::from(seed);
                write(&format!("{scene}-2-{seed}.json"), &[x, -x]);
                write(&format!("{scene}-3-{seed}.json"), &[x, -x, 0.5]);
            }
        }
        let scenes = ["cup".to_owned(), "jug".to_owned()];
        let all = given(&format!("mine=cameras:{}/{{scene}}-{{views}}-{{seed}}.json", folder.path().display()));
        let read = all.read(&scenes, &[2, 3], 0..2).unwrap();
        let first = |scene: &str, views, seed| read.cameras(scene, views, seed, 8).0[0].position.x;
        assert_eq!((first("cup", 2, 0), first("cup", 3, 1), first("jug", 2, 1)), (1.0, 2.0, 6.0));
        assert!(read.takes(2) && read.takes(3) && !read.takes(4) && read.of_each_scene());
        assert_eq!((&*read.name, read.cameras("cup", 4, 0, 8)), ("mine", (Vec::new(), Vec::new())));
        // The files' lenses count where they are asked for, at the size of all pictures.
        assert!(read.cameras("cup", 2, 0, 16).1.is_empty());
        let own = given(&format!("mine=lenses:{}/{{scene}}-{{views}}-{{seed}}.json", folder.path().display()));
        let lenses = own.read(&scenes, &[2], 0..2).unwrap().cameras("cup", 2, 0, 16).1;
        assert_eq!((lenses.len(), lenses[0].width, lenses[0].focal), (2, 16, [16.0, 16.0]));

        let missing = all.read(&scenes, &[2], 0..3).unwrap_err().to_string();
        assert!(missing.contains("cup-2-2.json"), "{missing}");
        write("jug-2-1.json", &[0.0, 1.0, 2.0]);
        let other = all.read(&scenes, &[2], 0..2).unwrap_err().to_string();
        assert!(other.contains("jug-2-1.json: these are 3 cameras, and its name says 2"), "{other}");
        let fixed = given(&format!("cameras:{}/{{scene}}-2-{{seed}}.json", folder.path().display()));
        let other = fixed.read(&scenes, &[2], 0..2).unwrap_err().to_string();
        assert!(other.contains("these are 3 cameras, and ") && other.contains("has 2"), "{other}");
        for (wrong, what) in [
            ("cameras:", "name a file"),
            ("lenses:", "name a file"),
            ("mine=cameras:", "name a file"),
            ("cameras:{object}.json", "{object} stands for nothing"),
            ("=cameras:a.json", "without a colon"),
            ("ours:x=cameras:a.json", "without a colon"),
            ("ours=cameras:a.json", "ours is a method here"),
        ] {
            let error = Given::parse(wrong).unwrap().unwrap_err();
            assert!(error.contains(what), "{wrong}: {error}");
        }
        assert!(Given::parse("ours:alpha=1").is_none());
    }
}

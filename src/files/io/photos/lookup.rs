//! Where the files lie that a capture names: captures are copied between systems that write paths otherwise, do not tell upper from lower
//! case, or had the folder elsewhere.

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::files::{EXTENSIONS, is_picture, within};

/// Looks for files, and lists each folder once at most.
#[derive(Default)]
pub(crate) struct Lookup {
    /// Names in a folder, in their order.
    listed: RefCell<HashMap<PathBuf, Vec<String>>>,
}

impl Lookup {
    /// The image `name` in the first of `folders` that has it, as [`Lookup::picture`] finds it.
    pub fn image(&self, folders: &[PathBuf], name: &str) -> Option<PathBuf> {
        folders.iter().find_map(|folder| self.picture(folder, name))
    }

    /// The picture `name` below `folder`: as it is spelt, or with another extension of a picture (shrunk copies are often stored in
    /// another format, and some programs name none), or in other letter case, or with the separators of Windows.
    pub fn picture(&self, folder: &Path, name: &str) -> Option<PathBuf> {
        let spelt = within(folder, name)?;
        if spelt.is_file() {
            return Some(spelt);
        }
        let others = EXTENSIONS.iter().flat_map(|extension| {
            let replaced = is_picture(&spelt).then(|| spelt.with_extension(extension));
            [Some(PathBuf::from(format!("{}.{extension}", spelt.display()))), replaced]
        });
        if let Some(found) = others.flatten().find(|path| path.is_file()) {
            return Some(found);
        }
        self.below(folder, &parts(name)?)
    }

    /// The picture that a path of another system or place leads to, by its last parts: `images/a.jpg` of `C:\me\images\a.jpg` where
    /// `folder` has that, or else `a.jpg`. None for a path that leads into the folder, which says where the file is.
    pub fn tail(&self, folder: &Path, name: &str) -> Option<PathBuf> {
        let parts: Vec<&str> = name.split(['/', '\\']).filter(|part| !matches!(*part, "" | "." | "..")).collect();
        is_elsewhere(name).then(|| (0..parts.len()).find_map(|from| self.below(folder, &parts[from..]))).flatten()
    }

    /// The picture at `parts` below `folder`, whatever its case.
    fn below(&self, folder: &Path, parts: &[&str]) -> Option<PathBuf> {
        let (last, folders) = parts.split_last()?;
        let mut place = folder.to_owned();
        for part in folders {
            let exact = place.join(part);
            place = if exact.is_dir() {
                exact
            } else {
                place.join(self.named(&place, |name| folded(name) == folded(part))?)
            };
        }
        let wanted = folded(last);
        let stem = if is_picture(Path::new(last)) {
            wanted.rsplit_once('.').map_or(&*wanted, |(stem, _)| stem)
        } else {
            &wanted
        };
        let same_stem = |name: &str| {
            is_picture(Path::new(name)) && folded(name).rsplit_once('.').is_some_and(|(own, _)| own == stem)
        };
        let name = self.named(&place, |name| folded(name) == wanted).or_else(|| self.named(&place, same_stem))?;
        Some(place.join(name)).filter(|path| path.is_file())
    }

    /// The first name in `folder` that `is_it`.
    fn named(&self, folder: &Path, is_it: impl Fn(&str) -> bool) -> Option<String> {
        let mut listed = self.listed.borrow_mut();
        let names = listed.entry(folder.to_owned()).or_insert_with(|| {
            let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
            let mut names: Vec<String> =
                entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
            names.sort();
            names
        });
        names.iter().find(|name| is_it(name)).cloned()
    }
}

/// A name without its case.
fn folded(name: &str) -> String {
    name.to_lowercase()
}

/// Whether a path begins at the root of some system, or leads out of the folder that it starts from.
fn is_elsewhere(name: &str) -> bool {
    let drive = matches!(name.as_bytes(), [letter, b':', ..] if letter.is_ascii_alphabetic());
    drive || name.starts_with(['/', '\\']) || parts(name).is_none()
}

/// The parts of a relative path without `.` and `..`; none where it leads out.
fn parts(name: &str) -> Option<Vec<&str>> {
    let mut parts = Vec::new();
    for part in name.split(['/', '\\']) {
        match part {
            "" | "." => {}
            ".." => _ = parts.pop()?,
            _ => parts.push(part),
        }
    }
    Some(parts)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        folder
    }

    /// If this failed, captures from other systems would be said to have no images.
    #[test]
    fn other_spellings_lead_to_the_file() {
        let folder =
            folder(&["images/A.JPG", "images/Left/b.webp", "images/r_0.5.png", "images/c.jpg", "images/C.png"]);
        let found = |name: &str| {
            let path = Lookup::default().picture(folder.path(), name)?;
            Some(path.strip_prefix(folder.path()).unwrap().to_string_lossy().into_owned())
        };
        let cases = [
            ("images/a.jpg", "images/A.JPG"),
            ("Images\\left\\B.png", "images/Left/b.webp"),
            ("images/r_0.5", "images/r_0.5.png"),
            ("images/c.jpg", "images/c.jpg"),
            ("images/C.PNG", "images/C.png"),
            ("./images/Left/../a", "images/A.JPG"),
        ];
        for (name, path) in cases {
            assert_eq!(found(name).as_deref(), Some(path), "{name}");
        }
        // Another picture, whose name begins alike; and one outside.
        for name in ["images/r_0.7", "images/a.txt", "../images/a.jpg", ""] {
            assert_eq!(found(name), None, "{name}");
        }
    }

    /// If this failed, a capture that was made elsewhere could not be read, or a file outside the folder would be.
    #[test]
    fn the_tail_of_a_foreign_path_is_looked_for_in_the_folder() {
        let folder = folder(&["images/left/a.jpg", "images/right/a.jpg", "b.png"]);
        let found = |name: &str| {
            let path = Lookup::default().tail(folder.path(), name)?;
            Some(path.strip_prefix(folder.path()).unwrap().to_string_lossy().into_owned())
        };
        assert_eq!(found("C:\\me\\images\\right\\a.jpg").as_deref(), Some("images/right/a.jpg"));
        assert_eq!(found("/home/me/x/images/left/A.jpg").as_deref(), Some("images/left/a.jpg"));
        assert_eq!(found("../b.png").as_deref(), Some("b.png"));
        assert_eq!(found("/etc/c.png"), None);
        assert_eq!(found("right/a.jpg"), None, "a path from here says where the file is");
    }
}

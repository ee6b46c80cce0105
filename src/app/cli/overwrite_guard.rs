//! Outputs that would take the place of what a command reads.

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// Folders in which captures keep what is read of them.
const OF_CAPTURES: [&str; 3] = ["images", "masks", "sparse"];
/// Files of captures and plans that are read, and endings of more.
const NAMES: [&str; 8] = [
    "plan.json",
    "cameras.json",
    "transforms.json",
    "transforms_train.json",
    "transforms_test.json",
    "transforms_val.json",
    "points.ply",
    "points3d.ply",
];
const TEXTS: [&str; 2] = ["txt", "log"];
/// Endings of files that are read and never written where a user names a file.
const READ: [&str; 11] = ["png", "jpg", "jpeg", "exr", "hdr", "bin", "glb", "gltf", "obj", "stl", "npy"];

/// Refuses a file to write that is an input or a known part of an input folder, or at whose path something of another kind
/// exists.
///
/// # Errors
/// In a line that names the file.
pub(crate) fn check_output_file<'a>(file: &Path, inputs: impl IntoIterator<Item = &'a PathBuf>) -> Result<()> {
    let Some(at) = real(file) else { return Ok(()) };
    let refuse = |what: &str| Err(Error::input(file, format!("{what} and would be replaced; name another file")));
    let name = at.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let kind = name.rsplit('.').next().unwrap_or_default();
    let is_part = NAMES.contains(&name.as_str()) || TEXTS.contains(&kind);
    for read in inputs.into_iter().filter_map(|input| real(input)) {
        if at == read || at.starts_with(&read) && is_part {
            return refuse("this is what is read,");
        }
    }
    if READ.contains(&kind) { refuse("a file of another kind is already here,") } else { Ok(()) }
}

/// Refuses a folder to write that contains an input, or which is a part of an input that is a capture.
///
/// # Errors
/// In a line that names the folder and the input.
pub(crate) fn check_output_folder<'a>(folder: &Path, inputs: impl IntoIterator<Item = &'a PathBuf>) -> Result<()> {
    let Some(out) = real(folder) else { return Ok(()) };
    for (input, read) in inputs.into_iter().filter_map(|input| Some((input, real(input)?))) {
        if read.starts_with(&out) {
            let what = format!("{} is in it and might be replaced; name another folder", input.display());
            return Err(Error::input(folder, what));
        }
        let part = out.strip_prefix(&read).ok().and_then(|within| within.iter().next());
        if part.is_some_and(|part| OF_CAPTURES.iter().any(|name| part == *name)) {
            let what = format!("it is a part of {}, which is read; name another folder", input.display());
            return Err(Error::input(folder, what));
        }
    }
    Ok(())
}

/// Where a path leads, links followed; none where nothing exists there.
fn real(path: &Path) -> Option<PathBuf> {
    path.canonicalize().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a command would replace the photographs, poses or surface that it was given, or an earlier result
    /// would be in the way of a new one.
    #[test]
    fn what_is_read_is_not_written_over() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        for folder in ["cap/images", "cap/plan", "cap/sparse/0", "out"] {
            std::fs::create_dir_all(at(folder)).unwrap();
        }
        let files = "cap/images/0.png cap/cameras.json cap/points3D.ply cap/transforms_test.json cap/sparse/0/images.txt \
                     cap/score.json s.ply out/s.ply out/trace.txt";
        files.split_whitespace().for_each(|file| std::fs::write(at(file), "x").unwrap());
        let file = |file: &str, input: &str| check_output_file(&at(file), [&at(input)]);
        for (out, input) in [
            ("s.ply", "s.ply"),
            ("cap/../s.ply", "s.ply"),
            ("cap/images/0.png", "cap"),
            ("cap/images/0.png", "cap/cameras.json"),
            ("cap/cameras.json", "cap"),
            ("cap/points3D.ply", "cap"),
            ("cap/transforms_test.json", "cap"),
            ("cap/sparse/0/images.txt", "cap"),
        ] {
            assert!(file(out, input).unwrap_err().to_string().contains("would be replaced"), "{out}");
        }
        for (out, input) in [
            ("t.ply", "s.ply"),
            ("cap/new.png", "cap"),
            ("cap/score.json", "cap"),
            ("out/s.ply", "s.ply"),
            ("out/trace.txt", "cap"),
        ] {
            assert!(file(out, input).is_ok(), "{out}");
        }
        let folder = |out: &str, input: &str| check_output_folder(&at(out), [&at(input)]);
        for (out, input) in [("cap", "cap"), ("cap", "cap/cameras.json"), ("out", "out/s.ply"), ("cap/images", "cap")] {
            assert!(folder(out, input).unwrap_err().to_string().contains("name another folder"), "{out}");
        }
        assert!(folder("cap/plan", "cap").is_ok() && folder("new", "cap").is_ok() && folder("out", "s.ply").is_ok());
    }
}

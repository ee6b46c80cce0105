//! Outputs that would take the place of what a command reads.

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// Folders in which captures keep what is read of them.
const OF_CAPTURES: [&str; 3] = ["images", "masks", "sparse"];

/// What is read of folders beside: kinds of files, and how names of others begin.
const KINDS: [&str; 8] = ["png", "jpg", "jpeg", "exr", "bin", "txt", "log", "gltf"];
const NAMES: [&str; 4] = ["plan.json", "cameras.json", "transforms", "points"];

/// Refuses files that are an input, or are there already and a part of an input folder by their names.
///
/// # Errors
/// In a line that names the file and the input.
pub fn check_files(files: &[&Path], inputs: &[&Path]) -> Result<()> {
    for (file, at) in files.iter().filter_map(|file| Some((file, real(file)?))) {
        for (input, read) in inputs.iter().filter_map(|input| Some((input, real(input)?))) {
            if at == read {
                return Err(Error::input(file, "this is what is read, and would be replaced; name another file"));
            }
            if at.starts_with(&read) && is_part(&at) {
                let what = format!(
                    "it stands in {}, which is read, and would be replaced; name another file",
                    input.display()
                );
                return Err(Error::input(file, what));
            }
        }
    }
    Ok(())
}

/// Refuses a folder in which an input stands, or which is a part of an input that is a capture.
///
/// # Errors
/// In a line that names the folder and the input.
pub fn check_folder(folder: &Path, inputs: &[&Path]) -> Result<()> {
    let Some(out) = real(folder) else { return Ok(()) };
    for (input, read) in inputs.iter().filter_map(|input| Some((input, real(input)?))) {
        if read.starts_with(&out) {
            let what = format!("{} stands in it and might be replaced; name another folder", input.display());
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

/// Whether a file in a folder that is read may be what is read of it.
fn is_part(file: &Path) -> bool {
    let name = file.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let kind = name.rsplit('.').next().unwrap_or_default();
    KINDS.contains(&kind) || NAMES.iter().any(|start| name.starts_with(start))
}

/// Where a path leads, links followed; none where nothing stands there.
fn real(path: &Path) -> Option<PathBuf> {
    path.canonicalize().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a command would replace the photographs, poses or surface that it was given.
    #[test]
    fn what_is_read_is_not_written_over() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        for folder in ["cap/images", "cap/plan", "out"] {
            std::fs::create_dir_all(at(folder)).unwrap();
        }
        for file in ["cap/images/0.png", "cap/cameras.json", "cap/points3D.ply", "cap/score.json", "s.ply", "out/s.ply"]
        {
            std::fs::write(at(file), "x").unwrap();
        }
        let files = |file: &str, input: &str| check_files(&[&at(file)], &[&at(input)]);
        for (file, input) in [
            ("s.ply", "s.ply"),
            ("cap/../s.ply", "s.ply"),
            ("cap/images/0.png", "cap"),
            ("cap/cameras.json", "cap"),
            ("cap/points3D.ply", "cap"),
        ] {
            assert!(files(file, input).unwrap_err().to_string().contains("would be replaced"), "{file}");
        }
        // What an earlier run has left there is not what is read.
        for (file, input) in [("t.ply", "s.ply"), ("cap/new.png", "cap"), ("cap/score.json", "cap")] {
            assert!(files(file, input).is_ok(), "{file}");
        }
        let folder = |out: &str, input: &str| check_folder(&at(out), &[&at(input)]);
        for (out, input) in [("cap", "cap"), ("cap", "cap/cameras.json"), ("out", "out/s.ply"), ("cap/images", "cap")] {
            assert!(folder(out, input).unwrap_err().to_string().contains("name another folder"), "{out}");
        }
        assert!(folder("cap/plan", "cap").is_ok() && folder("new", "cap").is_ok() && folder("out", "s.ply").is_ok());
    }
}

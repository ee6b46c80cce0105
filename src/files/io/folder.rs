//! An output folder that is written whole or not at all.

use std::cell::OnceCell;
use std::ffi::OsStr;
use std::fs;
use std::hash::{BuildHasher as _, RandomState};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Component, Path, PathBuf};

use tempfile::TempDir;

use crate::error::{Error, Result};

/// Files on their way into a folder. They are written into a hidden folder beside it and moved into place by
/// [`OutputFolder::commit`]; dropped before that, nothing is left behind and the folder is as it was.
#[derive(Debug)]
pub struct OutputFolder {
    path: PathBuf,
    force: bool,
    /// Beside `path`, so that moving is renaming. Made with the first file, so that a process that is killed while it
    /// computes leaves nothing behind; removed when dropped.
    hidden: OnceCell<TempDir>,
}

impl OutputFolder {
    /// Prepares to write the folder `path`, whose parent must exist. With `force`, a folder that holds something already
    /// is accepted: files of the same names are replaced, all others stay.
    ///
    /// # Errors
    /// Before anything has been computed: when the folder is not empty and `force` is not given, is a file, or cannot be
    /// written.
    pub fn create(path: &Path, force: bool) -> Result<Self> {
        check_named(path)?;
        check_parent(path)?;
        check_free(path, force)?;
        if path.is_dir() {
            check_writable(path)?;
        }
        Ok(Self { path: path.to_owned(), force, hidden: OnceCell::new() })
    }

    /// Where the folder will be.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The hidden folder. Files are in `new` in it until they are committed: the hidden folder itself is for its owner's
    /// eyes only, and one made inside has the permissions a user expects.
    fn hidden(&self) -> Result<&Path> {
        if self.hidden.get().is_none() {
            make_parent(&self.path)?;
            let parent = parent(&self.path);
            let name = self.path.file_name().unwrap_or_default().to_string_lossy();
            let hidden = tempfile::Builder::new()
                .prefix(&format!(".{name}-"))
                .tempdir_in(parent)
                .map_err(|source| Error::io(parent, source))?;
            let staged = hidden.path().join("new");
            fs::create_dir(&staged).map_err(|source| Error::io(staged, source))?;
            return Ok(self.hidden.get_or_init(|| hidden).path());
        }
        Ok(self.hidden.get().map_or(&self.path, |hidden| hidden.path()))
    }

    fn staged(&self) -> Result<PathBuf> {
        Ok(self.hidden()?.join("new"))
    }

    /// Writes one file; `name` is relative to the folder, with `/` between the folders in it.
    ///
    /// # Errors
    /// When the name leads out of the folder, or the system refuses.
    pub fn write(&self, name: &str, contents: impl AsRef<[u8]>) -> Result<()> {
        fs::write(self.stage(name)?, contents).map_err(|source| self.failed(name, source))
    }

    /// The path to write one file to for callers that write it themselves, with its parent folders made; `name` as in
    /// [`OutputFolder::write`].
    ///
    /// # Errors
    /// When the name leads out of the folder, or the system refuses.
    pub fn stage(&self, name: &str) -> Result<PathBuf> {
        let is_inside = Path::new(name).components().all(|c| matches!(c, Component::Normal(_)));
        if name.is_empty() || !is_inside {
            return Err(Error::request(format!("{name:?} does not name a file in the output folder")));
        }
        let file = self.staged()?.join(name);
        fs::create_dir_all(parent(&file)).map_err(|source| self.failed(name, source))?;
        Ok(file)
    }

    /// A failure to write a file, by the name that the user knows it by.
    pub(crate) fn failed(&self, name: &str, source: std::io::Error) -> Error {
        Error::io(self.path.join(name), source)
    }

    /// Moves everything into place. A folder that does not exist yet appears at once, complete. In one that does, files
    /// are moved one by one; when one fails, those before it are put back.
    ///
    /// # Errors
    /// When the folder has been filled since by another process and `force` was not given, or the system refuses.
    pub fn commit(self) -> Result<()> {
        check_free(&self.path, self.force)?;
        if !self.path.exists() {
            return fs::rename(self.staged()?, &self.path).map_err(|source| Error::io(&self.path, source));
        }
        let mut names = Vec::new();
        let staged = self.staged()?;
        list(&staged, Path::new(""), &mut names)?;
        names.iter().try_for_each(|name| check_no_links(&self.path, &self.path.join(name)))?;
        let mut moves = Moves { replaced: self.hidden()?.join("old"), done: Vec::new() };
        for name in names {
            let (from, to) = (staged.join(&name), self.path.join(&name));
            if let Err(source) = moves.replace(&from, &to) {
                moves.undo();
                return Err(Error::io(to, source));
            }
        }
        Ok(())
    }
}

/// Checks, before anything has been computed, that files can be written one by one into the folder `path`, and leaves nothing
/// there. A folder that is there must be empty, unless `force` is given; the folders that one lies in which is not are made on writing.
///
/// # Errors
/// When it is a file, not empty, or cannot be written.
pub fn check_folder(path: &Path, force: bool) -> Result<()> {
    check_named(path)?;
    check_free(path, force)?;
    if path.is_dir() { check_writable(path) } else { check_parent(path) }
}

/// Checks that no symbolic link between `folder` and the place of `file` in it leads elsewhere. A link in the very place of the file is
/// replaced, not followed.
///
/// # Errors
/// In a line that names the link.
pub(crate) fn check_no_links(folder: &Path, file: &Path) -> Result<()> {
    let mut between = file.ancestors().skip(1).take_while(|above| *above != folder && above.starts_with(folder));
    match between.find(|above| above.is_symlink()) {
        Some(link) => {
            let what =
                "a symbolic link is already here, and nothing is written through it; remove it, or name another folder";
            Err(Error::input(link, what))
        }
        None => Ok(()),
    }
}

/// Checks, before anything has been computed, that a file can be written at `path`, and leaves nothing there.
///
/// # Errors
/// When the path is a folder or a device, or lies where nothing can be written.
pub fn check_file(path: &Path) -> Result<()> {
    if path.is_dir() {
        return Err(Error::input(path, "a folder is already here; name a file"));
    }
    // Moving a file onto a device would replace the device.
    if path.exists() && !path.is_file() {
        return Err(Error::input(path, "what is here is no regular file; name another"));
    }
    check_parent(path)
}

/// Writes files, all or none: each beside its place first, under a hidden name, then all are moved there.
///
/// # Errors
/// When the system refuses; nothing is left behind then but files that had been moved already.
pub fn write_files(files: &[(&Path, &[u8])]) -> Result<()> {
    // Containers that share a folder may have equal process numbers.
    let token = RandomState::new().hash_one(0);
    let hidden = |path: &Path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        parent(path).join(format!(".{name}-{}-{token:016x}", std::process::id()))
    };
    files.iter().try_for_each(|(path, _)| make_parent(path))?;
    let written = files
        .iter()
        .try_for_each(|(path, bytes)| fs::write(hidden(path), bytes).map_err(|source| Error::io(path, source)));
    let moved = written.and_then(|()| {
        files.iter().try_for_each(|(path, _)| fs::rename(hidden(path), path).map_err(|source| Error::io(path, source)))
    });
    if moved.is_err() {
        // What cannot be removed either is not worth a second error.
        files.iter().for_each(|(path, _)| drop(fs::remove_file(hidden(path))));
    }
    moved
}

/// Writes a file that may be too large to hold twice in memory: `write` fills it beside its place, under a hidden name that
/// the next attempt takes as well, then it is moved there. Until then the old file stays.
///
/// # Errors
/// When the system refuses, a full disk among others; the unfinished file is removed.
pub(crate) fn replace_file(path: &Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    replace(path, |file| {
        let mut file = BufWriter::with_capacity(1 << 20, file);
        write(&mut file)?;
        file.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()
    })
}

/// As [`replace_file`] for one of many small files: it is not forced to the disk, which takes longer than writing it. A caller
/// that relies on them forces them after the last.
///
/// # Errors
/// As [`replace_file`].
pub(crate) fn replace_unforced(path: &Path, bytes: &[u8]) -> Result<()> {
    replace(path, |mut file| file.write_all(bytes))
}

fn replace(path: &Path, fill: impl FnOnce(fs::File) -> std::io::Result<()>) -> Result<()> {
    make_parent(path)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let hidden = parent(path).join(format!(".{name}.part"));
    let moved = fs::File::create(&hidden).and_then(fill).and_then(|()| fs::rename(&hidden, path));
    if moved.is_err() {
        // What cannot be removed either is not worth a second error.
        drop(fs::remove_file(&hidden));
    }
    moved.map_err(|source| Error::io(path, source))
}

/// The folder that `path` lies in.
fn parent(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Refuses a path whose parents are no folders, cannot be made, or cannot be written to.
fn check_parent(path: &Path) -> Result<()> {
    let there = parent(path).ancestors().find(|folder| folder.symlink_metadata().is_ok());
    let there = there.filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !there.is_dir() {
        return Err(Error::input(path, format!("{} is no folder; name another place", there.display())));
    }
    check_writable(there)
}

/// Makes the folders that `path` is to lie in.
///
/// # Errors
/// Where the system refuses.
pub(crate) fn make_parent(path: &Path) -> Result<()> {
    fs::create_dir_all(parent(path)).map_err(|source| Error::io(path, source))
}

/// Refuses a folder without a name of its own.
fn check_named(path: &Path) -> Result<()> {
    match path.components().next_back() {
        Some(Component::Normal(_)) => Ok(()),
        _ => Err(Error::input(path, "this names no folder to write to; give one with a name of its own")),
    }
}

/// Refuses a folder that takes no files.
fn check_writable(folder: &Path) -> Result<()> {
    match tempfile::tempfile_in(folder) {
        Ok(_) => Ok(()),
        Err(e) => {
            let what = format!("nothing can be written here ({}); name another folder", e.kind());
            Err(Error::input(folder, what))
        }
    }
}

/// Refuses a path that is taken.
fn check_free(path: &Path, force: bool) -> Result<()> {
    if path.is_symlink() && !path.exists() {
        return Err(Error::input(path, "a link that leads nowhere is here; remove it, or name another folder"));
    }
    let mut entries = match fs::read_dir(path) {
        Ok(entries) => entries,
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(()),
        // Where a file is among its parents, `check_parent` says so.
        Err(e) if e.kind() == ErrorKind::NotADirectory && !path.exists() => return Ok(()),
        Err(e) if e.kind() == ErrorKind::NotADirectory => {
            return Err(Error::input(path, "a file is already here; name a folder"));
        }
        Err(e) => return Err(Error::io(path, e)),
    };
    if entries.next().is_some() && !force {
        return Err(Error::NotEmpty { path: path.to_path_buf() });
    }
    Ok(())
}

/// Appends the files under `root` by their path from there, in the order of names.
fn list(root: &Path, below: &Path, names: &mut Vec<PathBuf>) -> Result<()> {
    let folder = root.join(below);
    let entries = fs::read_dir(&folder).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
    let mut entries = entries.map_err(|source| Error::io(&folder, source))?;
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let name = below.join(AsRef::<OsStr>::as_ref(&entry.file_name()));
        if entry.path().is_dir() {
            list(root, &name, names)?;
        } else {
            names.push(name);
        }
    }
    Ok(())
}

/// Files moved so far, to be undone when a later one fails.
struct Moves {
    /// Folder that replaced files are kept in meanwhile.
    replaced: PathBuf,
    /// New places, and where the file that was there is kept.
    done: Vec<(PathBuf, Option<PathBuf>)>,
}

impl Moves {
    /// Moves `from` to `to`, and the file that was there aside.
    fn replace(&mut self, from: &Path, to: &Path) -> std::io::Result<()> {
        if to.is_dir() {
            return Err(std::io::Error::new(ErrorKind::IsADirectory, "a folder is where a file is to be written"));
        }
        if let Some(parent) = to.parent() {
            fs::create_dir_all(parent)?;
        }
        let mut aside = None;
        if to.exists() {
            fs::create_dir_all(&self.replaced)?;
            let kept = self.replaced.join(self.done.len().to_string());
            fs::rename(to, &kept)?;
            aside = Some(kept);
        }
        if let Err(e) = fs::rename(from, to) {
            // The old file goes back first; the error that counts is the one above.
            if let Some(kept) = &aside {
                let _ = fs::rename(kept, to);
            }
            return Err(e);
        }
        self.done.push((to.to_owned(), aside));
        Ok(())
    }

    /// Puts everything back as far as the system lets it: further errors cannot be reported.
    fn undo(self) {
        for (to, aside) in self.done.into_iter().rev() {
            let _ = match aside {
                Some(kept) => fs::rename(kept, to),
                None => fs::remove_file(to),
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(path: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(path).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// If this failed, `--force` would replace files of another folder, to which a link leads.
    #[cfg(unix)]
    #[test]
    fn nothing_is_committed_through_a_link() {
        let root = tempfile::tempdir().unwrap();
        let [path, elsewhere] = ["out", "elsewhere"].map(|name| root.path().join(name));
        [&path, &elsewhere].iter().for_each(|folder| fs::create_dir(folder).unwrap());
        fs::write(elsewhere.join("a.png"), "precious").unwrap();
        std::os::unix::fs::symlink(&elsewhere, path.join("images")).unwrap();
        let folder = OutputFolder::create(&path, true).unwrap();
        folder.write("a.json", "new").unwrap();
        folder.write("images/a.png", "new").unwrap();
        let refused = folder.commit().unwrap_err().to_string();
        assert!(refused.contains("out/images") && refused.contains("symbolic link"), "{refused}");
        assert_eq!(fs::read_to_string(elsewhere.join("a.png")).unwrap(), "precious");
        assert_eq!(entries(&path), ["images"]);
    }

    /// If this failed, a full disk would leave points without their picture, or hidden files for ever.
    #[test]
    fn files_are_written_all_or_none() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        assert!(write_files(&[(&a, b"1"), (&file.join("c"), b"2")]).is_err());
        assert_eq!(entries(folder.path()), ["file"]);
        fs::remove_file(&file).unwrap();
        write_files(&[(&a, b"1"), (&b, b"2")]).unwrap();
        assert_eq!(entries(folder.path()), ["a", "b"]);
    }

    /// If this failed, a process that is killed while it computes would leave a hidden folder for ever.
    #[test]
    fn nothing_is_there_before_the_first_file() {
        let parent = tempfile::tempdir().unwrap();
        let _folder = OutputFolder::create(&parent.path().join("out"), false).unwrap();
        assert!(entries(parent.path()).is_empty());
    }

    /// If this failed, a run could end, after all its work, in a file that cannot be written.
    #[test]
    fn files_are_checked_up_front_and_not_made() {
        let parent = tempfile::tempdir().unwrap();
        assert!(check_file(parent.path()).unwrap_err().to_string().contains("name a file"));
        assert!(check_file(&parent.path().join("a/b")).is_ok() && !parent.path().join("a").exists());
        check_file(&parent.path().join("b")).unwrap();
        assert!(entries(parent.path()).is_empty());
    }

    /// If this failed, a stopped run would leave half a plan, or hidden rubbish, behind.
    #[test]
    fn a_dropped_folder_leaves_nothing_behind() {
        let parent = tempfile::tempdir().unwrap();
        let folder = OutputFolder::create(&parent.path().join("out"), false).unwrap();
        folder.write("sparse/0/cameras.bin", b"x").unwrap();
        assert_eq!(entries(parent.path()).len(), 1);
        drop(folder);
        assert!(entries(parent.path()).is_empty());
    }

    /// If this failed, a full disk would be reported for a hidden file that the user has never heard of.
    #[test]
    fn a_file_that_cannot_be_written_is_named_as_the_user_knows_it() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("out");
        let folder = OutputFolder::create(&path, false).unwrap();
        folder.write("sparse", b"x").unwrap();
        fs::create_dir_all(folder.stage("taken").unwrap()).unwrap();
        for name in ["sparse/0", "taken"] {
            let message = folder.write(name, b"x").unwrap_err().to_string();
            assert!(message.contains(&path.join(name).display().to_string()), "{message}");
        }
    }

    /// If this failed, a finished plan would not be where the user requested it.
    #[test]
    fn a_committed_folder_is_whole() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("out");
        let folder = OutputFolder::create(&path, false).unwrap();
        folder.write("sparse/0/cameras.bin", b"x").unwrap();
        fs::write(folder.stage("plan.json").unwrap(), "{}").unwrap();
        assert!(!path.exists());
        folder.commit().unwrap();
        assert_eq!(entries(parent.path()), ["out"]);
        assert_eq!(entries(&path), ["plan.json", "sparse"]);
        assert_eq!(fs::read(path.join("sparse/0/cameras.bin")).unwrap(), b"x");
    }

    /// If this failed, a user's own files could be lost, or be overwritten without `--force`.
    #[test]
    fn a_full_folder_needs_force_and_keeps_the_users_files() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("out");
        fs::create_dir(&path).unwrap();
        fs::write(path.join("notes.txt"), "mine").unwrap();
        fs::write(path.join("plan.json"), "old").unwrap();
        assert!(OutputFolder::create(&path, false).unwrap_err().to_string().contains("pass `force`"));
        let folder = OutputFolder::create(&path, true).unwrap();
        folder.write("plan.json", "new").unwrap();
        assert_eq!(fs::read_to_string(path.join("plan.json")).unwrap(), "old");
        folder.commit().unwrap();
        assert_eq!(fs::read_to_string(path.join("plan.json")).unwrap(), "new");
        assert_eq!(fs::read_to_string(path.join("notes.txt")).unwrap(), "mine");
        assert_eq!(entries(parent.path()), ["out"]);
    }

    /// If this failed, a failure halfway would leave files of two plans side by side.
    #[test]
    fn a_failed_commit_puts_everything_back() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("out");
        fs::create_dir_all(path.join("report.html")).unwrap();
        fs::write(path.join("plan.json"), "old").unwrap();
        let folder = OutputFolder::create(&path, true).unwrap();
        folder.write("a.csv", "new").unwrap();
        folder.write("plan.json", "new").unwrap();
        folder.write("report.html", "new").unwrap();
        assert!(folder.commit().unwrap_err().to_string().contains("report.html"));
        assert_eq!(fs::read_to_string(path.join("plan.json")).unwrap(), "old");
        assert_eq!(entries(&path), ["plan.json", "report.html"]);
    }

    /// If this failed, hours of computing could end in a path that cannot be written, or files land elsewhere.
    #[test]
    fn paths_are_checked_up_front() {
        let parent = tempfile::tempdir().unwrap();
        let file = parent.path().join("file");
        fs::write(&file, "").unwrap();
        assert!(OutputFolder::create(&file, true).is_err());
        assert!(
            OutputFolder::create(&parent.path().join("new/b"), false).is_ok() && !parent.path().join("new").exists()
        );
        assert!(OutputFolder::create(Path::new("/"), true).is_err());
        let folder = OutputFolder::create(&parent.path().join("out"), false).unwrap();
        assert!(folder.write("../escape", "x").is_err() && folder.write("", "x").is_err());
    }
}

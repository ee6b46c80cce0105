//! What an evaluation makes once and reuses: each in a folder named by a key of all of its inputs, complete once `done.json` exists.

use std::cell::RefCell;
use std::fs::{self, File, TryLockError};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use crate::files::io::folder::replace_file;
use crate::{Error, Result};

/// The file that is written last, with the inputs.
const DONE: &str = "done.json";

/// Version of the code that makes artifacts: raise it with every change of results under the same options, so that artifacts of
/// earlier programs are made anew, and whatever is made from them.
const REVISIONS: [(&str, u32); 6] =
    [("light", 3), ("photos", 4), ("surface", 1), ("choice", 7), ("training", 6), ("lpips", 1)];

/// Time between two checks whether another process has made an artifact.
const BETWEEN_TRIES: Duration = Duration::from_millis(20);

/// Progress events.
pub enum ArtifactEvent<'e> {
    /// An artifact is being made: its key; the evaluation adds what for.
    Begins(&'e str),
    /// An artifact was there from an earlier run.
    Kept,
    /// An artifact is still being made.
    Working,
    /// Something that the user should know.
    Note(String),
}

/// Receives progress events and returns whether to continue.
pub(crate) type Observe<'o> = &'o mut (dyn FnMut(ArtifactEvent<'_>) -> ControlFlow<()> + Send);

/// An artifact that is there or is to be made.
#[derive(Debug)]
pub(crate) struct Artifact {
    folder: PathBuf,
    key: String,
    inputs: Value,
    /// A file beside the folder, locked while the artifact is made: several workers may need it at once. Network file systems lock files
    /// only, and only for those who may write them.
    making: RefCell<Option<File>>,
}

impl Artifact {
    /// The artifact of this name with these inputs, below `root`. Inputs that are artifacts themselves are given by their
    /// [`Artifact::key`].
    pub fn new(root: &Path, name: &str, inputs: Value) -> Self {
        let revision = REVISIONS.iter().find(|(artifact, _)| *artifact == name).map_or(1, |(_, revision)| *revision);
        let inputs = json!({ "stage": name, "revision": revision, "inputs": inputs });
        let key = format!("{name}-{:016x}", fnv1a(inputs.to_string().as_bytes()));
        Self { folder: root.join(&key), key, inputs, making: RefCell::default() }
    }

    /// Its name among the inputs of others.
    pub fn key(&self) -> &str {
        &self.key
    }

    /// Where it lies.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// A file of it.
    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Whether it is complete, and of exactly these inputs.
    pub fn is_done(&self) -> bool {
        let text = fs::read(self.file(DONE)).unwrap_or_default();
        serde_json::from_slice(&text).is_ok_and(|inputs: Value| inputs == self.inputs)
    }

    /// Whether it is to be made; its folder then exists, and others wait until [`Artifact::finish`] or the end of `self`. Where
    /// another worker is making it, this waits.
    ///
    /// # Errors
    /// Where the system refuses, or `observe` requests a stop.
    pub fn begins(&self, observe: Observe) -> Result<bool> {
        let mut is_done = self.is_done();
        if !is_done {
            self.begin()?;
            let path = self.lock_file();
            let refused = |source| Error::io(&path, source);
            let file = File::options().write(true).create(true).truncate(false).open(&path).map_err(refused)?;
            loop {
                match file.try_lock() {
                    Ok(()) => break,
                    Err(TryLockError::Error(source)) => return Err(refused(source)),
                    Err(TryLockError::WouldBlock) => {
                        Error::unless_stopped(observe(ArtifactEvent::Working))?;
                        thread::sleep(BETWEEN_TRIES);
                    }
                }
            }
            is_done = self.is_done();
            if is_done {
                self.remove_lock_file();
            }
            *self.making.borrow_mut() = (!is_done).then_some(file);
        }
        // A stop requested here takes effect while it is made, or before the next.
        let _ = observe(if is_done { ArtifactEvent::Kept } else { ArtifactEvent::Begins(self.key()) });
        Ok(!is_done)
    }

    fn lock_file(&self) -> PathBuf {
        self.folder.with_file_name(format!(".{}.lock", self.key))
    }

    /// Removes the file that was locked. Whoever waits for it, or makes it anew, finds the artifact complete.
    fn remove_lock_file(&self) {
        // One that stays, or that another worker has removed, does no harm.
        let _ = fs::remove_file(self.lock_file());
    }

    /// Makes the folder.
    ///
    /// # Errors
    /// Where the system refuses.
    pub fn begin(&self) -> Result<()> {
        fs::create_dir_all(&self.folder).map_err(|source| Error::io(&self.folder, source))
    }

    /// Writes a file of it, whole.
    ///
    /// # Errors
    /// Where the system refuses.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        replace_file(&self.file(name), |file| file.write_all(bytes))
    }

    /// The error where a file of it, which was complete once, is damaged or missing.
    pub fn damaged(&self, what: &str) -> Error {
        Error::input(&self.folder, format!("this product is damaged ({what}); remove the folder and run again"))
    }

    /// Reads a file of it back, as JSON.
    ///
    /// # Errors
    /// Where it is missing or damaged.
    pub fn read<T: DeserializeOwned>(&self, name: &str) -> Result<T> {
        let wrong = |error: &dyn std::fmt::Display| self.damaged(&format!("{name}: {error}"));
        let text = fs::read(self.file(name)).map_err(|error| wrong(&error))?;
        serde_json::from_slice(&text).map_err(|error| wrong(&error))
    }

    /// Writes a file of it, as JSON.
    ///
    /// # Errors
    /// Where the system refuses.
    pub fn write_json(&self, name: &str, value: &impl Serialize) -> Result<()> {
        let wrong = |e| Error::input(self.file(name), format!("it cannot be written: {e}"));
        self.write(name, &serde_json::to_vec_pretty(value).map_err(wrong)?)
    }

    /// Marks it complete.
    ///
    /// # Errors
    /// Where the system refuses.
    pub fn finish(&self) -> Result<()> {
        self.write(DONE, format!("{:#}\n", self.inputs).as_bytes())?;
        if self.making.borrow().is_some() {
            self.remove_lock_file();
        }
        self.making.take();
        Ok(())
    }
}

/// The 64-bit FNV-1a hash (Fowler, Noll and Vo).
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a run could take another's artifact for its own, or make an existing one again.
    #[test]
    fn a_product_counts_when_it_is_finished_and_for_its_inputs_only() {
        let root = tempfile::tempdir().unwrap();
        let artifact = |seed: f32| Artifact::new(root.path(), "plan", json!({ "seed": seed, "of": [0.1f32, 1e-7] }));
        let one = artifact(1.0);
        one.begin().unwrap();
        one.write("plan.json", b"{}").unwrap();
        assert!(!one.is_done());
        one.finish().unwrap();
        assert!(one.is_done() && artifact(1.0).is_done() && !artifact(2.0).is_done());
        fs::write(one.file(DONE), "{}").unwrap();
        assert!(!one.is_done());
    }

    /// If this failed, two workers would make one artifact at once, or a worker that waits for another could not be stopped.
    #[test]
    fn who_waits_for_a_product_hears_a_stop_and_gets_it_when_it_is_done() {
        let root = tempfile::tempdir().unwrap();
        let artifact = || Artifact::new(root.path(), "photos", json!(1));
        let (one, other) = (artifact(), artifact());
        assert!(one.begins(&mut |_| ControlFlow::Continue(())).unwrap());
        let mut asked = 0;
        let stopped = other.begins(&mut |event| {
            asked += 1;
            assert!(matches!(event, ArtifactEvent::Working));
            if asked == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert!(matches!(stopped, Err(Error::Interrupted)) && asked == 3);
        let waited = other.begins(&mut move |event| {
            if matches!(event, ArtifactEvent::Working) {
                one.finish().unwrap();
            }
            ControlFlow::Continue(())
        });
        assert!(!waited.unwrap());
        let left: Vec<_> = fs::read_dir(root.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
        assert_eq!(left, [other.folder()], "locks that nobody holds are removed");
    }

    /// If this failed, artifacts of earlier runs would not be found again. Values from the hash's authors.
    #[test]
    fn the_hash_is_that_of_its_authors() {
        assert_eq!((fnv1a(b""), fnv1a(b"foobar")), (0xcbf2_9ce4_8422_2325, 0x8594_4171_f739_67e8));
    }
}

//! Poses of photos by structure from motion: COLMAP, as the Python package `pycolmap` has it.

use std::io::{Read, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;

use serde::Deserialize;

use super::inbox::Arrival;
use crate::{Error, Result};

/// What runs in Python.
const SCRIPT: &str = include_str!("register.py");
/// Between two looks at whether it has ended or is to be stopped.
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);
/// Widest angle, in degrees, between neighbours that it is to join, where it placed all of the last photos and where none.
pub const CONNECTED: [f32; 2] = [20.0, 5.0];
/// How many these are.
const RECENT: usize = 10;
/// Characters of what it complains of that are kept.
const COMPLAINT: usize = 300;

/// Structure from motion that goes on from photo to photo.
pub struct Sfm {
    python: PathBuf,
    /// Folder of its database and model.
    work: PathBuf,
    /// Version of COLMAP.
    pub version: String,
}

#[derive(Deserialize)]
struct Answer {
    posed: Vec<String>,
}

impl Sfm {
    /// With the Python program at `python`, keeping what it has in the folder `work`.
    ///
    /// # Errors
    /// Where there is no such program, or it has no `pycolmap`.
    pub fn find(python: &Path, work: &Path) -> Result<Self> {
        let missing = |what: &str| {
            Error::request(format!(
                "{} {what}: poses of photos need it; `pip install pycolmap`, and name that Python with `python`; or give a folder with poses",
                python.display()
            ))
        };
        let asked = Command::new(python).args(["-c", "import pycolmap; print(pycolmap.__version__)"]).output();
        let output = asked.map_err(|e| missing(&format!("cannot be run ({e})")))?;
        let version = String::from_utf8_lossy(&output.stdout).trim().to_owned();
        if !output.status.success() || version.is_empty() {
            return Err(missing("has no pycolmap"));
        }
        Ok(Self { python: python.to_owned(), work: work.to_owned(), version })
    }

    /// Where the model is.
    pub fn model(&self) -> PathBuf {
        self.work.join("sparse").join("0")
    }

    /// Finds poses of photos, in the order in which they were taken, and returns the names of those that have one. What an earlier call
    /// found is where it begins.
    ///
    /// # Errors
    /// Where it fails, and [`Error::Interrupted`] where `go_on` stops it.
    pub fn pose<'p>(
        &self,
        photos: impl IntoIterator<Item = &'p Arrival>,
        mut go_on: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Vec<String>> {
        let failed = |what: &str| Error::request(format!("pycolmap {} failed: {what}", self.version));
        let asked = |photo: &Arrival| {
            let file = std::path::absolute(&photo.file).map_err(|source| Error::io(&photo.file, source))?;
            Ok((photo.name.clone(), file, photo.lens.clone(), photo.checksum))
        };
        let photos: Vec<_> = photos.into_iter().map(asked).collect::<Result<_>>()?;
        let request = serde_json::json!({ "work": self.work, "photos": photos });
        let mut child = Command::new(&self.python)
            .args(["-c", SCRIPT])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| failed(&e.to_string()))?;
        // It ends where this end of its input is closed, with this process at the latest.
        let (mut input, output, complaints) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        // Both ends are drained while it runs: it would wait on a pipe that is full.
        let drained = |pipe: Option<Box<dyn Read + Send>>| {
            thread::spawn(move || {
                let mut bytes = Vec::new();
                if let Some(mut pipe) = pipe {
                    let _ = pipe.read_to_end(&mut bytes);
                }
                String::from_utf8_lossy(&bytes).into_owned()
            })
        };
        let printed = drained(output.map(|pipe| Box::new(pipe) as Box<dyn Read + Send>));
        let complained = drained(complaints.map(|pipe| Box::new(pipe) as Box<dyn Read + Send>));
        if let Some(input) = &mut input {
            // Where it has ended already, its complaint says why.
            let _ = writeln!(input, "{request}").and_then(|()| input.flush());
        }
        let status = loop {
            if let Some(status) = child.try_wait().map_err(|e| failed(&e.to_string()))? {
                break status;
            }
            if go_on().is_break() {
                let _ = child.kill();
                let _ = child.wait();
                return Err(Error::Interrupted);
            }
            thread::sleep(BETWEEN_LOOKS);
        };
        let (printed, complained) = (printed.join().unwrap_or_default(), complained.join().unwrap_or_default());
        drop(input);
        // Frames of a crash are no message.
        let says = |line: &&str| !line.trim().is_empty() && !line.trim_start().starts_with(['@', '*']);
        let last = |text: &str| text.lines().rev().find(says).map(str::to_owned);
        let answer = last(&printed).and_then(|line| serde_json::from_str::<Answer>(&line).ok());
        match answer.filter(|_| status.success()) {
            Some(answer) => Ok(answer.posed),
            None => {
                let why = last(&complained).map_or_else(|| status.to_string(), |line| format!("{line} ({status})"));
                Err(failed(&why.chars().take(COMPLAINT).collect::<String>()))
            }
        }
    }
}

/// Widest angle, in degrees, between the next photos and those that there are; `placed` says of each of these whether it has a pose.
pub fn connected(placed: impl DoubleEndedIterator<Item = bool>) -> f32 {
    let recent: Vec<bool> = placed.rev().take(RECENT).collect();
    let share = recent.iter().filter(|placed| **placed).count() as f32 / recent.len().max(1) as f32;
    CONNECTED[1] + share * (CONNECTED[0] - CONNECTED[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a scene in which photos are lost would be asked for more photos that are lost.
    #[test]
    fn the_next_photos_are_nearer_where_the_last_were_lost() {
        let of = |placed: &[bool]| connected(placed.iter().copied());
        assert_eq!((of(&[true; 12]), of(&[false; 12]), of(&[])), (20.0, 5.0, 5.0));
        let (lost, found) = ([false; 20], [true; 10]);
        assert_eq!(of(&[&lost[..], &found].concat()), 20.0, "what was lost long ago counts");
        assert_eq!(of(&[true, false, true, false]), 12.5);
    }
}

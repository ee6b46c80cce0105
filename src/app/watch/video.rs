//! Videos in the folder: frames that are chosen of them are photos like others.

use std::collections::BTreeMap;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::inbox::{Stamp, inside, is_seen};
use crate::files::io::folder::OutputFolder;
use crate::files::io::photos::files::files_in;
use crate::files::io::photos::is_video;
use crate::photogrammetry::frames::{self, Format, Source, choice};
use crate::{Error, Result};

/// Frames that are asked for at first, and at most: as many as a connected walk needs are taken.
const FEW: usize = 12;
const MOST: usize = 200;
/// After which a video that could not be read is tried again: a disk may have been full.
const AGAIN: Duration = Duration::from_secs(60);
/// What the folder of a video's frames notes of the video.
const SOURCE: &str = "video.json";
/// Where the frames are in that folder.
const IMAGES: &str = "images";

/// A video that may have arrived.
#[derive(Clone, Debug)]
struct Video {
    stamp: Stamp,
    /// Whether it has not grown since the last look.
    whole: bool,
    /// Why it has no frames, and when that was found.
    fault: Option<(String, Instant)>,
}

/// The videos of a folder, and their frames.
pub struct Videos {
    folder: PathBuf,
    /// Folder of the frames.
    frames: PathBuf,
    /// By path from the folder, with `/` between folders.
    videos: BTreeMap<String, Video>,
    /// The one that was to be read at the last look.
    next: Option<String>,
}

impl Videos {
    /// Of a folder; frames go to a folder in `work`.
    pub fn new(folder: &Path, work: &Path) -> Self {
        Self { folder: folder.to_owned(), frames: work.join("videos"), videos: BTreeMap::new(), next: None }
    }

    /// Folder of the frames.
    pub fn frames(&self) -> &Path {
        &self.frames
    }

    /// Looks for videos that are new, changed or gone; whether another one is to be read than at the last look.
    pub fn scan(&mut self) -> bool {
        let ends = |path: &Path| is_video(&path.to_string_lossy());
        let mine = self.frames.parent().and_then(|work| inside(&self.folder, work));
        let mut found = BTreeMap::new();
        for name in files_in(&self.folder, ends).into_iter().filter(|name| is_seen(name, mine.as_deref())) {
            let Some(stamp) = Stamp::of(&self.folder.join(&name)) else { continue };
            let same = self.videos.remove(&name).filter(|before| before.stamp == stamp);
            let video =
                same.map_or(Video { stamp, whole: false, fault: None }, |before| Video { whole: true, ..before });
            found.insert(name, video);
        }
        self.videos = found;
        let next = self.unread();
        let before = std::mem::replace(&mut self.next, next);
        self.next.is_some() && self.next != before
    }

    /// Folders of frames of the videos that are there, from the folder of the frames.
    pub fn folders(&self) -> Vec<String> {
        let read = self.videos.iter().filter(|(name, video)| self.is_read(name, video));
        read.map(|(name, _)| format!("{name}/{IMAGES}")).collect()
    }

    /// Videos that cannot be read, with the reason.
    pub fn faults(&self) -> Vec<(String, String)> {
        self.videos.iter().filter_map(|(name, video)| Some((name.clone(), video.fault.clone()?.0))).collect()
    }

    /// A video that is whole and has not been read, or not for a while where it could not be.
    pub fn unread(&self) -> Option<String> {
        let waits = |video: &Video| video.fault.as_ref().is_some_and(|(_, since)| since.elapsed() < AGAIN);
        let unread = |(name, video): &(&String, &Video)| video.whole && !waits(video) && !self.is_read(name, video);
        self.videos.iter().find(unread).map(|(name, _)| name.clone())
    }

    fn is_read(&self, name: &str, video: &Video) -> bool {
        let noted = fs::read(self.frames.join(name).join(SOURCE)).ok();
        noted.and_then(|text| serde_json::from_slice::<Stamp>(&text).ok()) == Some(video.stamp)
    }

    /// What [`read`] of a video needs: the file, what is noted of it, and where its frames go.
    pub fn task(&self, name: &str) -> Option<(PathBuf, Stamp, PathBuf)> {
        Some((self.folder.join(name), self.videos.get(name)?.stamp, self.frames.join(name)))
    }

    /// Notes that a video cannot be read as it was at `stamp`.
    pub fn failed(&mut self, name: &str, stamp: Stamp, why: String) {
        if let Some(video) = self.videos.get_mut(name).filter(|video| video.stamp == stamp) {
            video.fault = Some((why, Instant::now()));
        }
    }
}

/// Chooses frames of a video, sharp ones and as many as keep it connected, writes them, and returns how many; `go_on` may stop it.
///
/// # Errors
/// Where it cannot be read, or the frames not be written, and [`Error::Interrupted`] where it was stopped.
pub fn read(video: &Path, stamp: Stamp, out: &Path, mut go_on: impl FnMut() -> ControlFlow<()>) -> Result<usize> {
    // Frames of what was there before under its name are others.
    if out.exists() {
        fs::remove_dir_all(out).map_err(|source| Error::io(out, source))?;
    }
    if let Some(parent) = out.parent() {
        fs::create_dir_all(parent).map_err(|source| Error::io(parent, source))?;
    }
    let folder = OutputFolder::create(out, false)?;
    let source = Source::Video(video.to_owned());
    let analysis = frames::analyse(&source, Format::Jpeg, |_| go_on())?;
    let few = choice::choose(&analysis.frames, FEW);
    let choice = few.enough.map_or(few, |enough| choice::choose(&analysis.frames, enough.min(MOST)));
    frames::write(&source, &analysis, &choice, Format::Jpeg, &folder, &mut go_on)?;
    let noted = serde_json::to_vec(&stamp).map_err(|e| Error::request(format!("{SOURCE} cannot be written: {e}")))?;
    folder.write(SOURCE, noted)?;
    folder.commit()?;
    Ok(choice.frames.len())
}

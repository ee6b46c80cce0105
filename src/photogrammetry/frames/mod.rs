//! Frames of a walk for structure from motion: from a video or a folder of pictures those that are sharp, evenly spread in motion and
//! not alike.
//!
//! [`analyse`] reads every frame once, small, and keeps a few numbers of each: how sharp it is ([`sharpness`]) and how far the picture has
//! moved since the first ([`motion`], [`travel`]). [`choice::choose`] works on these numbers, and [`write()`] writes the chosen frames
//! in full size. Nothing here is drawn at random: the same file gives the same frames.

pub mod choice;
mod ffmpeg;
pub mod grey;
pub mod motion;
mod pictures;
pub mod sharpness;
pub mod travel;

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use self::choice::{Choice, Frame};
use self::grey::Grey;
use self::motion::Pyramid;
pub use self::pictures::{Pictures, by_number};
use self::travel::{Step, Traveller};
use crate::error::{Error, Result};
use crate::files::io::folder::OutputFolder;
use crate::files::photos::Header;

/// How frames of a video are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Format {
    /// JPEG of high quality.
    #[default]
    Jpeg,
    /// PNG: what the video holds, without further loss, several times as large.
    Png,
}

impl Format {
    fn extension(self) -> &'static str {
        match self {
            Self::Jpeg => "jpg",
            Self::Png => "png",
        }
    }
}

/// Where frames come from.
#[derive(Clone, Debug)]
pub enum Source {
    /// A video, read by the program ffmpeg.
    Video(PathBuf),
    /// A folder of pictures.
    Pictures(Pictures),
}

/// How far the analysis is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// Seconds of a video, of all as its header has them.
    Seconds(f64, f64),
    /// Pictures of a folder, of all.
    Pictures(usize, usize),
}

/// What is known of all frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Analysis {
    /// The frames in their order.
    pub frames: Vec<Frame>,
    /// The name of each frame's file, whether it is written or not.
    pub names: Vec<String>,
    /// What the user should know.
    pub notes: Vec<String>,
}

impl Source {
    /// The source at a path: a folder of pictures, or a file that is taken for a video.
    ///
    /// # Errors
    /// Where nothing is there, or a folder holds no pictures.
    pub fn open(path: &Path) -> Result<Self> {
        match std::fs::metadata(path) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                Err(Error::input(path, "there is no such file or folder; check the path"))
            }
            Err(source) => Err(Error::io(path, source)),
            Ok(found) if found.is_dir() => Ok(Self::Pictures(Pictures::find(path)?)),
            Ok(_) if Header::read(path).is_ok() => {
                Err(Error::input(path, "this is a single picture; give the folder of them, or a video"))
            }
            Ok(_) => Ok(Self::Video(path.to_owned())),
        }
    }
}

/// Reads all frames.
///
/// # Errors
/// Where the source cannot be read; [`Error::Interrupted`] where `observe` asks for a stop.
pub fn analyse(
    source: &Source,
    format: Format,
    mut observe: impl FnMut(Progress) -> ControlFlow<()>,
) -> Result<Analysis> {
    let mut analyst = Analyst::default();
    match source {
        Source::Video(path) => {
            let (times, notes) = ffmpeg::analyse(path, |frame, [done, all]| {
                analyst.take(&frame);
                observe(Progress::Seconds(done, all))
            })?;
            let mut frames = analyst.frames;
            for (frame, time) in frames.iter_mut().zip(times.into_iter().flatten()) {
                frame.time = Some(time);
            }
            let names = (0..frames.len()).map(|i| format!("frame_{i:06}.{}", format.extension())).collect();
            Ok(Analysis { frames, names, notes })
        }
        Source::Pictures(pictures) => {
            let all = pictures.names.len();
            pictures.analyse(|frame| {
                analyst.take(&frame);
                observe(Progress::Pictures(analyst.frames.len(), all))
            })?;
            Ok(Analysis { frames: analyst.frames, names: pictures.written(), notes: Vec::new() })
        }
    }
}

/// What goes from frame to frame.
#[derive(Default)]
struct Analyst {
    traveller: Traveller,
    frames: Vec<Frame>,
}

impl Analyst {
    fn take(&mut self, frame: &Grey) {
        let Step { travel, followed } = self.traveller.next(Pyramid::new(frame));
        self.frames.push(Frame { time: None, sharpness: sharpness::of(frame), travel, followed });
    }
}

/// Writes the chosen frames in full size as `images/NAME`, and `frames.csv` about all.
///
/// # Errors
/// Where they cannot be read any more or written; [`Error::Interrupted`] where `go_on` asks for a stop. The folder is not committed.
pub fn write(
    source: &Source,
    analysis: &Analysis,
    choice: &Choice,
    format: Format,
    folder: &OutputFolder,
    mut go_on: impl FnMut() -> ControlFlow<()>,
) -> Result<()> {
    let place = |frame: usize| folder.stage(&format!("images/{}", analysis.names[frame]));
    match source {
        Source::Video(path) => {
            let Some(first) = choice.frames.first() else { return Err(Error::input(path, "no frame was chosen")) };
            let first = place(*first)?;
            let images = first.parent().unwrap_or(Path::new("."));
            ffmpeg::extract(path, &choice.frames, images, format, go_on)?;
            for (i, frame) in choice.frames.iter().enumerate() {
                let (from, to) = (images.join(format!("{i:06}.{}", format.extension())), place(*frame)?);
                std::fs::rename(&from, &to).map_err(|source| Error::io(&to, source))?;
            }
        }
        Source::Pictures(pictures) => {
            for frame in &choice.frames {
                let from = pictures.folder.join(&pictures.names[*frame]);
                std::fs::copy(&from, place(*frame)?).map_err(|source| Error::io(&from, source))?;
                Error::unless_stopped(go_on())?;
            }
        }
    }
    folder.write("frames.csv", csv(analysis, choice))
}

/// A line per frame: number, file, seconds, sharpness, motion from the frame before and from the first, and whether it was chosen.
fn csv(analysis: &Analysis, choice: &Choice) -> String {
    let mut text = String::from("frame,name,time_s,sharpness,motion,travel,followed,chosen\n");
    let mut before = 0.0;
    for (i, (frame, name)) in analysis.frames.iter().zip(&analysis.names).enumerate() {
        let time = frame.time.map_or(String::new(), |time| format!("{time:.4}"));
        let is_chosen = u8::from(choice.frames.binary_search(&i).is_ok());
        let (name, followed) = (name.replace('"', "\"\""), u8::from(frame.followed));
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "{i},\"{name}\",{time},{:.5},{:.5},{:.5},{followed},{is_chosen}",
            frame.sharpness,
            frame.travel - before,
            frame.travel
        );
        before = frame.travel;
    }
    text
}

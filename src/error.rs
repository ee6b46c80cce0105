//! The one error type of the crate. Every message is a single line with what is wrong, where, and what to do. Settings are in
//! backquotes, by the names of their fields; the command line puts its options there.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Shorthand for results of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Everything that can go wrong, by who can fix it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder is not what it should be: the user can fix the input.
    #[error("{}: {what}", shown(path))]
    Input {
        /// The offending file or folder.
        path: PathBuf,
        /// What is wrong, at which place in the file, and what to do about it, in one line.
        what: String,
    },
    /// Outputs would go where there are files already.
    #[error("{}: the folder is not empty; pass `force` to replace the files in it, or name another", shown(path))]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// The request makes no sense (an inverted box, zero views, no point in sight of the region).
    #[error("{0}")]
    Request(String),
    /// The file system refused.
    #[error("{}: {source}", shown(path))]
    Io {
        /// The file or folder that was read or written.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// No usable Vulkan device, or not the one requested.
    #[error("{0}")]
    NoDevice(String),
    /// A plan or a buffer does not fit the device.
    #[error("{what} needs {wanted} bytes of device memory and {available} are available; {remedy}")]
    OutOfMemory {
        /// What was to be allocated.
        what: String,
        /// Bytes required.
        wanted: u64,
        /// Bytes available.
        available: u64,
        /// What the user can do.
        remedy: String,
    },
    /// The caller requested a stop; finished results are kept.
    #[error("stopped, as it was asked to; what is finished stays")]
    Interrupted,
    /// The device was lost while running a stage.
    #[error("the device was lost; the last stage that started was {stage}")]
    DeviceLost {
        /// The stage's name, as in `--profile`.
        stage: String,
    },
    /// A submission took longer than it may: the device hangs, or others use it. What was submitted stays in memory.
    #[error(
        "the device has not finished what was submitted in {seconds} s, stages from {first} to {last}; free the device of other work, or \
         find the stage with `debug_sync`"
    )]
    Unfinished {
        /// The first stage, as in `--profile`.
        first: &'static str,
        /// The last one.
        last: &'static str,
        /// How long was waited.
        seconds: f64,
    },
    /// A Vulkan call failed in a way that none of the above explains.
    #[error("Vulkan: {what}: {code:?}")]
    Vulkan {
        /// The call.
        what: &'static str,
        /// What the driver returned.
        code: ash::vk::Result,
    },
}

impl Error {
    /// An [`Error::Input`] for `path`.
    pub fn input(path: impl AsRef<Path>, what: impl Into<String>) -> Self {
        Self::Input { path: path.as_ref().to_path_buf(), what: bounded(what.into()) }
    }

    /// An [`Error::Io`] for `path`.
    pub fn io(path: impl AsRef<Path>, source: std::io::Error) -> Self {
        Self::Io { path: path.as_ref().to_path_buf(), source }
    }

    /// An [`Error::Request`].
    pub fn request(what: impl Into<String>) -> Self {
        Self::Request(bounded(what.into()))
    }

    /// [`Error::Interrupted`] where an observer requests a stop.
    ///
    /// # Errors
    /// Where `flow` breaks.
    pub fn unless_stopped(flow: ControlFlow<()>) -> Result<()> {
        if flow.is_break() { Err(Self::Interrupted) } else { Ok(()) }
    }

    /// Process exit code: 1 where a device failed while it ran, 130 after an interruption, 2 where the request or the input must
    /// change.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::DeviceLost { .. } | Self::Unfinished { .. } | Self::Vulkan { .. } => 1,
            Self::Interrupted => 130,
            _ => 2,
        }
    }
}
/// Most characters of a piece of a file that a message quotes, of a path, and of a message.
const MAX_QUOTE: usize = 80;
const MAX_PATH: usize = 300;
const MAX_MESSAGE: usize = 1200;

/// A message in which what stands between double quotes, and the whole, is no longer than a line that can be read: files may hold names
/// of any length. Of the whole the beginning, which says what is wrong, and the end, which says what to do, are kept.
pub(crate) fn bounded(message: String) -> String {
    if message.len() <= MAX_QUOTE {
        return message;
    }
    let mut short = String::with_capacity(message.len().min(2 * MAX_MESSAGE));
    let (mut quoted, mut escaped) = (None, false);
    for c in message.chars() {
        if c == '"' && !escaped {
            quoted = if quoted.is_none() { Some(0) } else { None };
            short.push(c);
        } else if let Some(length) = &mut quoted {
            *length += 1;
            match *length {
                ..=MAX_QUOTE => short.push(c),
                length if length == MAX_QUOTE + 1 => short.push('…'),
                _ => {}
            }
        } else {
            short.push(c);
        }
        escaped = c == '\\' && !escaped;
    }
    // A name with a lone quotation mark in it leaves a quotation open: what follows is no name.
    middle_cut(if quoted.is_some() { message } else { short }, MAX_MESSAGE)
}

/// A path as messages show it.
fn shown(path: &Path) -> String {
    middle_cut(path.display().to_string(), MAX_PATH)
}

/// At most about `most` characters of a text: its beginning and its end.
fn middle_cut(text: String, most: usize) -> String {
    let count = text.chars().count();
    if count <= most {
        return text;
    }
    let half = most / 2;
    let (start, end) = (text.chars().take(half), text.chars().skip(count - half));
    start.chain(" … ".chars()).chain(end).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a file of five megabytes without a line break would be printed as its own error, or the remedy would be lost.
    #[test]
    fn messages_quote_little_and_keep_the_remedy() {
        let long = "x\\\"y".repeat(1_000_000);
        for what in [
            format!("line 1: {long:?} is not `ply`; this is not a PLY file"),
            format!("images {long} are missing; this is not a PLY file"),
            format!("{long:?} and {long:?} differ: {long}; this is not a PLY file"),
            format!("shelf of 12\" {}; this is not a PLY file", "with a long name ".repeat(30)),
        ] {
            let message = Error::input(Path::new(&long), &what).to_string();
            assert!(message.chars().count() < 1600 && message.ends_with("; this is not a PLY file"), "{message}");
        }
        let whole = "frame 3 (\"a \\\" b\"): it has no transform_matrix; give the camera's pose or remove the frame";
        assert_eq!(Error::request(whole).to_string(), whole);
    }
}

//! `camsplat view`.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use clap::Args;
use glam::DVec3;

use super::options::parse_up;
use super::progress::close_on_interrupt;
use super::server::Server;
use super::session::Ended;
use crate::io;
use crate::report::view::{self, Run};
use crate::{Error, Result};

/// Arguments of `camsplat view`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Folder of a plan, selection, training or evaluation; folder of such folders; capture; or .ply of trained splats
    path: PathBuf,
    /// Port to serve on; only this machine can connect [default: any that is free]
    #[arg(long, default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Print the address without opening a browser
    #[arg(long)]
    no_browser: bool,
    /// Up direction of trained splats that lie in no training's folder: x, -x, +y, ...
    #[arg(long, default_value = "+z", allow_hyphen_values = true, value_parser = parse_up)]
    up: DVec3,
}

/// The page that every run leaves.
const REPORT: &str = "report.html";
/// Folders below the one that is named in which reports are looked for.
const DEPTH: usize = 4;
/// Reports that are listed at most.
const MAX_RUNS: usize = 10_000;
/// Bytes of a page in which its title is.
const TITLE_WITHIN: usize = 4096;

/// Serves a page until the user stops it.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let Arguments { path, port, no_browser, up } = arguments;
    let (root, page) = content(path, *up)?;
    close_on_interrupt()?;
    let server = Server::bind(*port, root.as_deref(), page)?;
    let url = server.url();
    say!("view     {url}, until Ctrl-C");
    if !no_browser && let Err(error) = open::that_detached(&url) {
        say!("note     no browser could be opened ({error}); open the address in one");
    }
    server.serve();
    Ok(Ended::Done)
}

/// What to show of a path: a folder to serve, and the page where the folder's report is not it.
fn content(path: &Path, up: DVec3) -> Result<(Option<PathBuf>, Option<String>)> {
    let metadata = fs::metadata(path).map_err(|source| Error::io(path, source))?;
    let title = title_of(path);
    if !metadata.is_dir() && path.extension().is_some_and(|extension| extension == "ply") {
        let (gaussians, notes) = io::read_gaussians_with_notes(path)?;
        notes.iter().for_each(|note| say!("{note}"));
        return Ok((None, Some(view::model(&title, &gaussians, up)?)));
    }
    if path.join(REPORT).is_file() {
        return Ok((Some(path.to_owned()), None));
    }
    let not_capture = match io::photos::read(path, &io::photos::Options::default()) {
        Ok(set) => {
            set.notes.iter().for_each(|note| say!("{note}"));
            return Ok((None, Some(view::capture(&title, &set)?)));
        }
        Err(error) => error,
    };
    let mut runs = Vec::new();
    if metadata.is_dir() {
        find_runs(path, Path::new(""), DEPTH, &mut runs)?;
    }
    if runs.is_empty() {
        return Err(not_capture);
    }
    // The newest first; those of the same second by name.
    runs.sort_by(|a, b| b.0.cmp(&a.0).then_with(|| a.1.report.cmp(&b.1.report)));
    let runs: Vec<Run> = runs.into_iter().map(|(_, run)| run).collect();
    say!("found    {} reports below {}", runs.len(), path.display());
    Ok((Some(path.to_owned()), Some(view::runs(&title, &runs)?)))
}

/// The name of a file or folder, also of `.`.
fn title_of(path: &Path) -> String {
    let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    whole.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

/// Reports in folders below `root`, with the seconds since 1970 when each was written. Hidden folders and links are left out.
fn find_runs(root: &Path, below: &Path, depth: usize, runs: &mut Vec<(u64, Run)>) -> Result<()> {
    let folder = root.join(below);
    let entries = fs::read_dir(&folder).map_err(|source| Error::io(&folder, source))?;
    for entry in entries.flatten() {
        let name = entry.file_name();
        let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
        if !is_folder || name.to_string_lossy().starts_with('.') || runs.len() >= MAX_RUNS {
            continue;
        }
        let inner = below.join(&name);
        let report = root.join(&inner).join(REPORT);
        if let Ok(metadata) = fs::metadata(&report) {
            let written = metadata.modified().ok().and_then(|time| time.duration_since(SystemTime::UNIX_EPOCH).ok());
            let seconds = written.unwrap_or_default().as_secs();
            let parts: Vec<_> = inner.iter().map(|part| part.to_string_lossy()).collect();
            let run = Run {
                report: format!("{}/{REPORT}", parts.join("/")),
                title: page_title(&report).unwrap_or_default(),
                written: seconds,
            };
            runs.push((seconds, run));
        } else if depth > 1 {
            find_runs(root, &inner, depth - 1, runs)?;
        }
    }
    Ok(())
}

/// The title of a page, as text.
fn page_title(report: &Path) -> Option<String> {
    use std::io::Read as _;
    let mut head = Vec::new();
    fs::File::open(report).ok()?.take(TITLE_WITHIN as u64).read_to_end(&mut head).ok()?;
    let head = String::from_utf8_lossy(&head).into_owned();
    let title = head.split_once("<title>")?.1.split_once("</title>")?.0;
    let entities = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&#39;", "'"), ("&amp;", "&")];
    Some(entities.iter().fold(title.to_owned(), |title, (entity, character)| title.replace(entity, character)))
}

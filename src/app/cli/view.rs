//! `camsplat view`.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use clap::Args;
use glam::DVec3;

use super::options::parse_up;
use super::progress::close_on_interrupt;
use super::server::{Access, Served, Server, Site};
use super::session::Ended;
use crate::app::report::view::{self, Run};
use crate::files::io;
use crate::files::io::splats::SplatFormat;
use crate::{Error, Result};

/// Arguments of `camsplat view`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Folder of a plan, selection, training or evaluation; folder of such folders; capture; or trained splats (.ply, .spz,
    /// .sog, .splat, .glb)
    path: PathBuf,
    /// Port to serve on; only this machine can connect [default: any that is free]
    #[arg(long, default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Print the address without opening a browser
    #[arg(long)]
    no_browser: bool,
    /// Up direction of trained splats: x, -x, +y, ...
    #[arg(long, default_value = "+z", allow_hyphen_values = true, value_parser = parse_up)]
    up: DVec3,
}

/// What `plan --curve` leaves.
const CURVE: &str = "curve.svg";
/// The page that every other run leaves.
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
    let server = Server::bind(Access { port: *port, ..Access::default() }, root.as_deref(), site_of(page))?;
    let url = server.url();
    say!("view     {url}, until Ctrl-C");
    if !no_browser && open::that_detached(&url).is_err() {
        say!("note     no browser could be opened; open the address in one");
    }
    server.serve();
    Ok(Ended::Done)
}

/// Makes the page, each time that it is asked for.
type Page = Box<dyn Fn() -> Result<String> + Send + Sync>;

/// A page and nothing else.
fn site_of(page: Page) -> Site {
    Box::new(move |path| path.is_empty().then(|| page().map(Served::Html)))
}

/// What to show of a path: a folder whose files the page needs, and the page.
fn content(path: &Path, up: DVec3) -> Result<(Option<PathBuf>, Page)> {
    let metadata = fs::metadata(path).map_err(|source| io::unreadable(path, source))?;
    let title = title_of(path);
    if !metadata.is_dir() && SplatFormat::of(path).is_ok() {
        let (gaussians, notes) = io::read_gaussians_with_notes(path)?;
        notes.iter().for_each(|note| say!("{note}"));
        return Ok((None, fixed(view::model(&title, &gaussians, up)?)));
    }
    let report = path.join(REPORT);
    if report.is_file() {
        let page = move || fs::read_to_string(&report).map_err(|source| Error::io(&report, source));
        return Ok((Some(path.to_owned()), Box::new(page)));
    }
    let not_capture = match io::photos::read(path, &io::photos::ReadOptions::default()) {
        Ok(set) => {
            set.notes.iter().for_each(|note| say!("{note}"));
            return Ok((None, fixed(view::capture(&title, &set)?)));
        }
        Err(error) => error,
    };
    let found = if metadata.is_dir() { Found::below(path)? } else { Found::default() };
    if found.runs.is_empty() {
        let curve = fs::read_to_string(path.join(CURVE)).map_err(|_| not_capture)?;
        return Ok((None, fixed(view::curve(&title, &curve)?)));
    }
    if io::photos::is_capture(path) {
        say!("note     the capture here cannot be shown: {not_capture}");
    }
    say!("found    {} below {}", view::reports(found.runs.len()), path.display());
    if found.left_out > 0 {
        say!("note     folders that cannot be read, or whose name is no text, are left out: {}", found.left_out);
    }
    let root = path.to_owned();
    // Runs that end meanwhile are in the list when it is loaded again.
    let page = move || view::runs(&title, &Found::below(&root)?.runs);
    Ok((Some(path.to_owned()), Box::new(page)))
}

/// A page that stays as it is.
fn fixed(page: String) -> Page {
    Box::new(move || Ok(page.clone()))
}

/// The name of a file or folder, also of `.`.
fn title_of(path: &Path) -> String {
    let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    whole.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

/// Reports in folders below one.
#[derive(Default)]
struct Found {
    /// The newest first, those of the same second by name; [`MAX_RUNS`] at most.
    runs: Vec<Run>,
    /// Folders that could not be read or named.
    left_out: usize,
}

impl Found {
    /// # Errors
    /// Where the folder itself cannot be read.
    fn below(root: &Path) -> Result<Self> {
        let mut found = Self::default();
        let entries = fs::read_dir(root).map_err(|source| Error::io(root, source))?;
        found.add(root, "", entries, DEPTH);
        found.runs.sort_by(|a, b| b.written.cmp(&a.written).then_with(|| a.report.cmp(&b.report)));
        found.runs.truncate(MAX_RUNS);
        Ok(found)
    }

    /// Adds reports in the folders among `entries`, which are those of `below` in `root`. Hidden folders and links are left out.
    fn add(&mut self, root: &Path, below: &str, entries: fs::ReadDir, depth: usize) {
        for entry in entries.flatten() {
            let name = entry.file_name();
            if !entry.file_type().is_ok_and(|kind| kind.is_dir()) || name.as_encoded_bytes().starts_with(b".") {
                continue;
            }
            let Some(name) = name.to_str() else {
                self.left_out += 1;
                continue;
            };
            let inner = format!("{below}{name}/");
            let report = root.join(&inner).join(REPORT);
            match fs::symlink_metadata(&report) {
                Ok(metadata) if metadata.is_file() => {
                    let written =
                        metadata.modified().ok().and_then(|time| time.duration_since(SystemTime::UNIX_EPOCH).ok());
                    self.runs.push(Run {
                        report: format!("{inner}{REPORT}"),
                        title: page_title(&report).unwrap_or_default(),
                        written: written.unwrap_or_default().as_secs(),
                    });
                }
                _ if depth > 1 => match fs::read_dir(root.join(&inner)) {
                    Ok(entries) => self.add(root, &inner, entries, depth - 1),
                    Err(_) => self.left_out += 1,
                },
                _ => {}
            }
        }
    }
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

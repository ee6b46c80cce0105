//! The folder that an evaluation is written into: what may be in it already.

use std::fmt;
use std::fs;
use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::request::EvaluationRequest;
use super::results::Entry;
use super::subject::Subject;
use crate::files::io::folder::check_folder;
use crate::{Error, Result};

/// The file that marks a folder as an evaluation's.
pub const ASKED: &str = "evaluation.json";
/// What that file has where only what methods choose on was made: any evaluation may go on from there.
pub(super) const PREPARED: &str = "{\"prepared\": true}\n";
/// The file of all runs and means.
pub(crate) const RESULTS: &str = "results.json";
/// Files beside the folders of subjects.
const WRITTEN: [&str; 6] = [ASKED, "table.md", "table.csv", "table.tex", RESULTS, "report.html"];
/// What of a request says which runs there are; all else says how they are made.
const WHICH: [&str; 4] = ["methods", "budgets", "seeds", "first_seed"];

/// Checks, before anything is computed, that an evaluation can be written into `folder`, which is empty, new or an earlier
/// evaluation's; that no two subjects would share a folder there; that methods and box fit so many
/// subjects; and, where it writes tables, that these do not replace tables of more runs.
///
/// # Errors
/// In a line that names the folder, the subject, the method or the option.
pub fn check(folder: &Path, request: &EvaluationRequest, subjects: &[Subject], has_tables: bool) -> Result<()> {
    request.check_subjects(subjects.len())?;
    for (i, subject) in subjects.iter().enumerate() {
        if subjects[..i].iter().any(|other| other.name().eq_ignore_ascii_case(subject.name())) {
            let what = "another subject has this name, and tables tell them by their names; rename it";
            return Err(Error::input(subject.path(), what));
        }
    }
    let bad = |name: &str| WRITTEN.contains(&name) || name.starts_with('.') || name.contains(char::is_control);
    if let Some(subject) = subjects.iter().find(|subject| bad(subject.name())) {
        let what = "its name cannot name a folder among the tables; rename it";
        return Err(Error::input(subject.path(), what));
    }
    match check_folder(folder, false) {
        Err(Error::NotEmpty { .. }) if holds_evaluation(folder) => {
            check_folder(folder, true)?;
            let names: Vec<&str> = subjects.iter().map(Subject::name).collect();
            let mut before = if has_tables { earlier(folder, request) } else { Vec::new() };
            let made = |run: &Earlier| {
                let same = |own: super::request::Run<'_>| {
                    (own.method.name(), own.views, own.seed) == (run.method.as_str(), run.views, run.seed)
                };
                names.contains(&run.scene.as_str()) && request.runs().any(same)
            };
            before.retain(|run| !made(run));
            let Some(lost) = listed(&before) else { return Ok(()) };
            let what = format!(
                "these tables have runs that would be lost ({lost}); ask for them too, or give another `out`, or remove this file"
            );
            Err(Error::input(folder.join(RESULTS), what))
        }
        Err(Error::NotEmpty { path }) => {
            Err(Error::input(path, "the folder is not empty and holds no evaluation; name another"))
        }
        checked => checked,
    }
}

/// Checks that tables in `folder` lose no runs to those of `entries`: another evaluation may have written them since [`check`].
///
/// # Errors
/// In a line that names the folder and the runs.
pub(super) fn check_again<'e>(
    folder: &Path,
    request: &EvaluationRequest,
    entries: impl Iterator<Item = &'e Entry> + Clone,
) -> Result<()> {
    let mut lost = earlier(folder, request);
    lost.retain(|run| !entries.clone().any(|entry| run.is(entry)));
    let Some(lost) = listed(&lost) else { return Ok(()) };
    let what = format!(
        "these tables have runs that would be lost ({lost}), and stay as they are; what is finished is kept: ask for these runs too"
    );
    Err(Error::input(folder.join(RESULTS), what))
}

/// The first of some runs, and how many more there are.
fn listed(runs: &[Earlier]) -> Option<String> {
    match runs {
        [] => None,
        [first] => Some(first.to_string()),
        [first, others @ ..] => Some(format!("{first} and {} more", others.len())),
    }
}

/// Whether a folder is an evaluation's, or another process is about to make it one.
fn holds_evaluation(folder: &Path) -> bool {
    let begun = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut begun = begun.map(|entry| entry.file_name().to_string_lossy().into_owned());
    begun.any(|name| name.starts_with(&format!(".{ASKED}"))) || folder.join(ASKED).is_file()
}

/// The part of `results.json` that is needed here.
#[derive(Deserialize)]
struct Before {
    request: Value,
    runs: Vec<Earlier>,
}

/// A run that tables have.
#[derive(Deserialize)]
struct Earlier {
    scene: String,
    method: String,
    views: u32,
    seed: u64,
}

impl Earlier {
    /// Whether this is that run.
    fn is(&self, entry: &Entry) -> bool {
        (&*self.scene, &*self.method, self.views, self.seed)
            == (&*entry.scene, entry.method.name(), entry.views, entry.seed)
    }
}

impl fmt::Display for Earlier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { scene, method, views, seed } = self;
        write!(f, "{scene}, {method}, {views} views, seed {seed}")
    }
}

/// The runs of the tables in a folder. Tables that were made otherwise, or cannot be read, are those of another evaluation.
fn earlier(folder: &Path, request: &EvaluationRequest) -> Vec<Earlier> {
    let before = fs::read(folder.join(RESULTS)).ok().and_then(|text| serde_json::from_slice::<Before>(&text).ok());
    let Some(mut before) = before else { return Vec::new() };
    // An object, as requests are.
    let mut now = serde_json::to_value(request).unwrap_or_default();
    for side in [&mut now, &mut before.request] {
        WHICH.into_iter().for_each(|key| _ = side.as_object_mut().and_then(|object| object.remove(key)));
    }
    if now == before.request { before.runs } else { Vec::new() }
}

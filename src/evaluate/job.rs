//! A whole evaluation: every scene, method, budget and seed.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use serde_json::json;

use super::bench::Bench;
use super::choices::Choices;
use super::kind::Kind;
use super::pool::Pool;
use super::request::{Method, Request};
use super::results::{self, Entry, Row};
use super::scene::Scene;
use super::stage::{Event, Observe, Stage};
use super::subject::Subject;
use super::table;
use crate::gaussians::record::TrainRecord;
use crate::io::folder::{check_folder, write_files};
use crate::vulkan::Context;
use crate::{Error, Result};

/// The file that says that a folder is of an evaluation.
pub const ASKED: &str = "evaluation.json";

/// What an evaluation came to.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// What it is on.
    pub kind: Kind,
    /// Every run that is complete.
    pub entries: Vec<Entry>,
    /// Their means.
    pub rows: Vec<Row>,
}

/// Checks, before anything is computed, that an evaluation can be written into `folder`, which is empty, new or an earlier
/// evaluation's; and that no two subjects would share a folder there.
///
/// # Errors
/// In a line that names the folder or the subject.
pub fn check(folder: &Path, subjects: &[Subject]) -> Result<()> {
    for (i, subject) in subjects.iter().enumerate() {
        if subjects[..i].iter().any(|other| other.name().eq_ignore_ascii_case(subject.name())) {
            let what = "another subject has this name, and tables tell them by their names; rename it";
            return Err(Error::input(subject.path(), what));
        }
    }
    let earlier = folder.join(ASKED).is_file();
    check_folder(folder, earlier).map_err(|error| match error {
        Error::Input { path, what } if path.is_dir() && what.contains("--force") => {
            Error::input(path, "the folder is not empty and holds no evaluation; name another")
        }
        other => other,
    })
}

/// Runs what is asked for and writes tables into `folder`; products that are there are taken as they are. None where `observe`
/// broke it off; the same call goes on from there.
///
/// # Errors
/// Where a stage fails; what is finished stays.
pub fn run(
    context: &Arc<Context>,
    request: &Request,
    subjects: Vec<Subject>,
    folder: &Path,
    observe: Observe,
) -> Result<Option<Outcome>> {
    fs::create_dir_all(folder).map_err(|source| Error::io(folder, source))?;
    let names: Vec<String> = subjects.iter().map(|subject| subject.name().to_owned()).collect();
    let asked = format!("{:#}\n", json!({ "scenes": names, "request": request }));
    write_files(&[(&folder.join(ASKED), asked.as_bytes())])?;
    let mut entries = Vec::new();
    for subject in subjects {
        let folder = folder.join(subject.name());
        let whole = match subject {
            Subject::Scene(of) => scene(context, request, *of, &folder, &mut entries, observe)?,
            Subject::Pool(of) => pool(context, request, *of, &folder, &mut entries, observe)?,
        };
        if !whole {
            return Ok(None);
        }
    }
    let rows = results::rows(&entries);
    let written = json!({ "request": request, "rows": rows, "runs": entries });
    write_files(&[
        (&folder.join("table.md"), table::markdown(request, &rows).as_bytes()),
        (&folder.join("table.csv"), table::csv(request.kind, &rows).as_bytes()),
        (&folder.join("results.json"), format!("{written:#}\n").as_bytes()),
    ])?;
    Ok(Some(Outcome { kind: request.kind, entries, rows }))
}

/// Evaluates on one scene, with products in `folder`; false where it was broken off.
fn scene(
    context: &Arc<Context>,
    request: &Request,
    scene: Scene,
    folder: &Path,
    entries: &mut Vec<Entry>,
    observe: Observe,
) -> Result<bool> {
    let (settings, name) = (request.settings, scene.name.clone());
    let intrinsics = settings.intrinsics();
    let inputs = scene.inputs(context, intrinsics, settings.inputs)?;
    let tests = scene.tests(intrinsics, settings.tests)?;
    let bench = Bench::new(context, folder, request, scene)?;
    let Some(inputs) = bench.photographs(&inputs, observe)? else { return Ok(false) };
    let Some(shown) = bench.shown(&inputs, observe)? else { return Ok(false) };
    let Some(tests) = bench.photographs(&tests, observe)? else { return Ok(false) };
    let mut model = None;
    if request.needs_model() {
        let Some((trained, _)) = bench.training(&inputs, None, 0, observe)? else { return Ok(false) };
        model = Some(trained);
    }
    for run @ (method, _, seed) in request.runs() {
        if observe(Event::Working).is_break() {
            return Ok(false);
        }
        let model = model.as_ref().filter(|_| method.needs_model());
        let Some(plan) = bench.choice(run, &shown, model, observe)? else { return Ok(false) };
        let cameras = bench.standing(&plan.cameras, observe);
        let Some(photos) = bench.photographs(&cameras, observe)? else { return Ok(false) };
        let Some(trained) = bench.training(&photos, Some(&tests), seed, observe)? else { return Ok(false) };
        entries.push(entry(request.kind, &name, run, plan.seconds, &trained));
    }
    Ok(true)
}

/// Evaluates on one pool, with products in `folder`; false where it was broken off.
fn pool(
    context: &Arc<Context>,
    request: &Request,
    pool: Pool,
    folder: &Path,
    entries: &mut Vec<Entry>,
    observe: Observe,
) -> Result<bool> {
    let name = pool.name.clone();
    let choices = Choices::new(context, folder, request, pool, observe)?;
    let mut model = None;
    if request.needs_model() {
        model = choices.model(observe)?;
        if model.is_none() {
            return Ok(false);
        }
    }
    for run @ (method, _, seed) in request.runs() {
        if observe(Event::Working).is_break() {
            return Ok(false);
        }
        let model = model.as_ref().filter(|_| method.needs_model());
        let Some(chosen) = choices.choice(run, model, observe)? else { return Ok(false) };
        let Some(trained) = choices.training(&chosen, seed, observe)? else { return Ok(false) };
        entries.push(entry(request.kind, &name, run, chosen.seconds, &trained));
    }
    Ok(true)
}

/// What a run came to.
fn entry(
    kind: Kind,
    scene: &str,
    (method, views, seed): (Method, u32, u64),
    seconds: f64,
    (trained, record): &(Stage, TrainRecord),
) -> Entry {
    Entry {
        scene: scene.to_owned(),
        method,
        views,
        seed,
        seconds,
        quality: results::by_set(record, kind.sets()),
        folder: trained.key().to_owned(),
        pictures: results::first_pictures(record, kind.sets()),
    }
}

//! A whole evaluation: every scene, method, budget and seed.

use std::fs;
use std::ops::ControlFlow;
use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use glam::DVec3;
use serde_json::json;

use super::bench::Bench;
use super::choices::Choices;
use super::kind::Kind;
use super::pool::Pool;
use super::request::{Method, Request, Settings};
use super::results::{self, Entry, Row};
use super::scene::Scene;
use super::stage::{Event, Observe, Stage};
use super::subject::Subject;
use super::table;
use crate::gaussians::record::TrainRecord;
use crate::io::folder::{check_folder, write_files};
use crate::parallel::on_a_share;
use crate::vulkan::Context;
use crate::{Error, Result};

/// The file that says that a folder is of an evaluation.
pub const ASKED: &str = "evaluation.json";
/// Files beside the folders of subjects.
const WRITTEN: [&str; 5] = [ASKED, "table.md", "table.csv", "results.json", "report.html"];

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
    let bad = |name: &str| WRITTEN.contains(&name) || name.starts_with('.') || name.contains(char::is_control);
    if let Some(subject) = subjects.iter().find(|subject| bad(subject.name())) {
        let what = "its name cannot name a folder among the tables; rename it";
        return Err(Error::input(subject.path(), what));
    }
    let earlier = folder.join(ASKED).is_file();
    check_folder(folder, earlier).map_err(|error| match error {
        Error::Input { path, what } if path.is_dir() && what.contains("--force") => {
            Error::input(path, "the folder is not empty and holds no evaluation; name another")
        }
        other => other,
    })
}

/// Runs what is asked for on all of the devices and writes tables into `folder`; products that are there are taken as they are.
/// None where `observe` broke it off; the same call goes on from there. Tables do not depend on the number of devices where
/// these are alike, but for the seconds that choices take.
///
/// # Errors
/// Where a stage fails; what is finished stays.
pub fn run(
    contexts: &[Arc<Context>],
    request: &Request,
    subjects: &[Subject],
    folder: &Path,
    observe: Observe,
) -> Result<Option<Outcome>> {
    fs::create_dir_all(folder).map_err(|source| Error::io(folder, source))?;
    let names: Vec<&str> = subjects.iter().map(Subject::name).collect();
    let asked = format!("{:#}\n", json!({ "scenes": names, "request": request }));
    write_files(&[(&folder.join(ASKED), asked.as_bytes())])?;
    let Some(entries) = spread(contexts, request, subjects, folder, observe)? else { return Ok(None) };
    let rows = results::rows(&entries);
    let written = json!({ "request": request, "rows": rows, "runs": entries });
    write_files(&[
        (&folder.join("table.md"), table::markdown(request, &rows).as_bytes()),
        (&folder.join("table.csv"), table::csv(request.kind, &rows).as_bytes()),
        (&folder.join("results.json"), format!("{written:#}\n").as_bytes()),
    ])?;
    Ok(Some(Outcome { kind: request.kind, entries, rows }))
}

/// The runs of one subject, handed out one by one.
struct Runs<'a> {
    request: &'a Request,
    folder: PathBuf,
    subject: &'a Subject,
    next: AtomicUsize,
    /// Those that are complete, with their numbers.
    entries: Mutex<Vec<(usize, Entry)>>,
}

impl Runs<'_> {
    fn take(&self) -> Option<(usize, (Method, u32, u64))> {
        let number = self.next.fetch_add(1, Ordering::Relaxed);
        self.request.runs().nth(number).map(|run| (number, run))
    }

    fn complete(
        &self,
        (number, (method, views, seed)): (usize, (Method, u32, u64)),
        (places, seconds): (Vec<DVec3>, f64),
        trained: &(Stage, TrainRecord),
    ) {
        let ((stage, record), sets) = (trained, self.request.kind.sets());
        let entry = Entry {
            scene: self.subject.name().to_owned(),
            method,
            views,
            seed,
            seconds,
            quality: results::by_set(record, sets),
            folder: stage.key().to_owned(),
            pictures: results::first_pictures(record, sets),
            places,
        };
        self.entries.lock().unwrap_or_else(PoisonError::into_inner).push((number, entry));
    }

    /// Works on what is left of the subject on one device; what all runs share is made by who comes first. False where it was
    /// broken off.
    fn work(&self, context: &Arc<Context>, observe: Observe) -> Result<bool> {
        match self.subject {
            Subject::Scene(scene) => self.photographed(context, scene, observe),
            Subject::Pool(pool) => self.chosen(context, pool, observe),
        }
    }

    fn photographed(&self, context: &Arc<Context>, scene: &Scene, observe: Observe) -> Result<bool> {
        let Settings { inputs, tests, .. } = self.request.settings;
        let intrinsics = self.request.settings.intrinsics();
        let inputs = scene.inputs(context, intrinsics, inputs)?;
        let tests = scene.tests(intrinsics, tests)?;
        let bench = Bench::new(context, &self.folder, self.request, scene)?;
        let Some(inputs) = bench.photographs(&inputs, observe)? else { return Ok(false) };
        let Some(shown) = bench.shown(&inputs, observe)? else { return Ok(false) };
        let Some(tests) = bench.photographs(&tests, observe)? else { return Ok(false) };
        let mut model = None;
        if self.request.needs_model() {
            let Some((trained, _)) = bench.training(&inputs, None, 0, observe)? else { return Ok(false) };
            model = Some(trained);
        }
        while let Some((number, run @ (method, _, seed))) = self.take() {
            if observe(Event::Working).is_break() {
                return Ok(false);
            }
            let model = model.as_ref().filter(|_| method.needs_model());
            let Some(plan) = bench.choice(run, &shown, model, observe)? else { return Ok(false) };
            let cameras = bench.standing(&plan.cameras, observe);
            let Some(photos) = bench.photographs(&cameras, observe)? else { return Ok(false) };
            let Some(trained) = bench.training(&photos, Some(&tests), seed, observe)? else { return Ok(false) };
            let places = cameras.iter().map(|camera| camera.pose.position).collect();
            self.complete((number, run), (places, plan.seconds), &trained);
        }
        Ok(true)
    }

    fn chosen(&self, context: &Arc<Context>, pool: &Pool, observe: Observe) -> Result<bool> {
        let choices = Choices::new(context, &self.folder, self.request, pool, observe)?;
        let mut model = None;
        if self.request.needs_model() {
            model = choices.model(observe)?;
            if model.is_none() {
                return Ok(false);
            }
        }
        while let Some((number, run @ (method, _, seed))) = self.take() {
            if observe(Event::Working).is_break() {
                return Ok(false);
            }
            let model = model.as_ref().filter(|_| method.needs_model());
            let Some(chosen) = choices.choice(run, model, observe)? else { return Ok(false) };
            let Some(trained) = choices.training(&chosen, seed, observe)? else { return Ok(false) };
            self.complete((number, run), (choices.places(&chosen), chosen.seconds), &trained);
        }
        Ok(true)
    }
}

/// Ends all workers where one panics.
struct EndOfAll<'a>(&'a AtomicBool);

impl Drop for EndOfAll<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.store(true, Ordering::Relaxed);
        }
    }
}

/// A stage that stops where nobody asked it to must not look like a stop.
fn ended_early(product: &str) -> Error {
    Error::request(format!("{product} was not finished, and nobody stopped it; what is finished stays, run again"))
}

/// All runs, a worker for each device; none where it was broken off. Entries come in the order of subjects and runs.
fn spread(
    contexts: &[Arc<Context>],
    request: &Request,
    subjects: &[Subject],
    folder: &Path,
    observe: Observe,
) -> Result<Option<Vec<Entry>>> {
    let runs: Vec<Runs> = subjects
        .iter()
        .map(|subject| Runs {
            request,
            folder: folder.join(subject.name()),
            subject,
            next: AtomicUsize::new(0),
            entries: Mutex::default(),
        })
        .collect();
    // What one worker meets ends all of them.
    let (observe, over) = (Mutex::new(observe), AtomicBool::new(false));
    let work = |context: &Arc<Context>| {
        on_a_share(contexts.len(), || {
            let _end = EndOfAll(&over);
            let (mut asked, mut product) = (false, String::new());
            let mut hear = |event: Event<'_>| {
                if let Event::Begins(key) = event {
                    product = key.to_owned();
                }
                let heard = observe.lock().unwrap_or_else(PoisonError::into_inner)(event);
                asked |= heard.is_break() || over.load(Ordering::Relaxed);
                if asked { ControlFlow::Break(()) } else { heard }
            };
            for runs in &runs {
                let worked = runs.work(context, &mut hear);
                if !matches!(worked, Ok(true)) {
                    over.store(true, Ordering::Relaxed);
                    return if asked { worked } else { worked.and_then(|_| Err(ended_early(&product))) };
                }
            }
            Ok(true)
        })
    };
    let worked: Vec<Result<bool>> = thread::scope(|scope| {
        let others: Vec<_> = contexts.iter().skip(1).map(|context| scope.spawn(|| work(context))).collect();
        let first = contexts.first().map(&work);
        let others = others.into_iter().map(|other| other.join().unwrap_or_else(|panic| resume_unwind(panic)));
        first.into_iter().chain(others).collect()
    });
    let worked: Vec<bool> = worked.into_iter().collect::<Result<_>>()?;
    if worked.contains(&false) {
        return Ok(None);
    }
    let entries = runs.into_iter().flat_map(|runs| {
        let mut entries = runs.entries.into_inner().unwrap_or_else(PoisonError::into_inner);
        entries.sort_by_key(|(number, _)| *number);
        entries
    });
    Ok(Some(entries.map(|(_, entry)| entry).collect()))
}

//! A whole evaluation: every scene, method, budget and seed.

use std::collections::BTreeMap;
use std::fs;
use std::ops::{ControlFlow, Range};
use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;

use serde_json::json;

use super::artifact::{Artifact, ArtifactEvent, Observe};
use super::competitor::Competitor;
use super::destination::{self, ASKED, PREPARED, RESULTS};
use super::latex::latex;
use super::perceptual;
use super::pool::Pool;
use super::pool_artifacts::PoolArtifacts;
use super::request::{EvaluationRequest, Run};
use super::results::{self, Entry, Outcome};
use super::scene::Scene;
use super::scene_artifacts::{MethodInputs, SceneArtifacts};
use super::scene_means::means_over_scenes;
use super::shard::Shard;
use super::subject::Subject;
use super::table;
use crate::engine::parallel::{lock, on_a_share};
use crate::engine::vulkan::Context;
use crate::files::io::folder::write_files;
use crate::scene::camera::Camera;
use crate::splats::image_metrics::Weights;
use crate::splats::run::outputs::PICTURES;
use crate::splats::run::record::TrainRecord;
use crate::{Error, Result};

/// Progress events.
pub enum EvaluationEvent<'e> {
    /// An event of an artifact.
    Artifact(ArtifactEvent<'e>),
    /// A run is complete, with the number complete and the total.
    Complete(&'e Entry, [usize; 2]),
    /// The tables of the complete runs have been written.
    Written(&'e Outcome),
}

/// Receives progress events and returns whether to continue.
pub(crate) type Observer<'h> = &'h mut (dyn FnMut(EvaluationEvent<'_>) -> ControlFlow<()> + Send + 'h);

/// Runs the request on all devices; whenever a new run is complete, the tables of all complete runs are written into `folder`. Of a shard
/// only its runs are made, and no tables are written: the whole request does that in the folder that holds the results of all shards.
/// Outputs that are there are taken as they are. With the weights of a network, LPIPS is measured with it too. Tables do not
/// depend on the number of devices where these are alike, except for the seconds that selection takes.
///
/// # Errors
/// Where an artifact fails, or `observe` stopped it; what is finished stays, and the same call continues from there. Where `folder` has
/// another request than a shard's.
pub fn run(
    contexts: &[Arc<Context>],
    request: &EvaluationRequest,
    subjects: &[Subject],
    shard: Shard,
    folder: &Path,
    weights: Option<&Weights>,
    observe: Observer<'_>,
) -> Result<Outcome> {
    if let Some(weights) = weights {
        subjects.iter().try_for_each(|subject| perceptual::check(contexts, weights, subject, &request.settings))?;
    }
    fs::create_dir_all(folder).map_err(|source| Error::io(folder, source))?;
    let names: Vec<&str> = subjects.iter().map(Subject::name).collect();
    let asked = json!({ "scenes": names, "request": request, "lpips_vgg": weights.map(Weights::fingerprint) });
    let asked = format!("{asked:#}\n");
    // Existing tables belong to the earlier request until they are rewritten.
    match fs::read_to_string(folder.join(ASKED)) {
        Ok(before) if before == PREPARED => write_files(&[(&folder.join(ASKED), asked.as_bytes())])?,
        Ok(before) if before != asked && !shard.is_whole() => {
            let what =
                "another evaluation is in this folder; give the shard the options of the others, or another `out`";
            return Err(Error::input(folder.join(ASKED), what));
        }
        Ok(_) => {}
        Err(_) => write_files(&[(&folder.join(ASKED), asked.as_bytes())])?,
    }
    let runs = shard.runs(subjects.len() * request.runs().count());
    let board = SharedProgress {
        request,
        folder,
        weights,
        asked,
        has_tables: shard.is_whole(),
        runs,
        observe: Mutex::new(observe),
        stopped: AtomicBool::new(false),
        made: AtomicBool::new(false),
        entries: Mutex::default(),
        ceilings: Mutex::default(),
        studio: subjects
            .iter()
            .filter(|subject| subject.in_studio())
            .map(|subject| subject.name().to_owned())
            .collect(),
    };
    spread(contexts, &board, subjects)?;
    board.finish()
}

/// What all workers share: the observer, and what is complete.
struct SharedProgress<'b> {
    request: &'b EvaluationRequest,
    folder: &'b Path,
    /// Of the network that LPIPS is measured with beside AlexNet.
    weights: Option<&'b Weights>,
    /// The request, as it is written.
    asked: String,
    /// Whether tables are written.
    has_tables: bool,
    /// The runs that are made, by their numbers among those of all subjects.
    runs: Range<usize>,
    observe: Mutex<Observer<'b>>,
    /// Whether a stop has been requested.
    stopped: AtomicBool,
    /// Whether anything has been made since the tables were written.
    made: AtomicBool,
    /// What is complete, in the order of subjects and runs: the numbers of both.
    entries: Mutex<Vec<([usize; 2], Entry)>>,
    /// As [`Outcome::ceilings`].
    ceilings: Mutex<BTreeMap<String, f64>>,
    /// As [`Outcome::studio`].
    studio: Vec<String>,
}

impl SharedProgress<'_> {
    /// Reports an event; once a stop was requested, every call returns it.
    fn report(&self, event: EvaluationEvent<'_>) -> ControlFlow<()> {
        if matches!(event, EvaluationEvent::Artifact(ArtifactEvent::Begins(_))) {
            self.made.store(true, Ordering::Relaxed);
        }
        if lock(&self.observe)(event).is_break() {
            self.stopped.store(true, Ordering::Relaxed);
        }
        if self.stopped.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Adds a run. The tables are written where they are out of date: those of a complete evaluation stay while it is checked again.
    fn add(&self, place: [usize; 2], entry: Entry) -> Result<()> {
        let mut entries = lock(&self.entries);
        let at = entries.partition_point(|(other, _)| *other < place);
        entries.insert(at, (place, entry));
        // A stop requested here takes effect before the next run.
        let _ = self.report(EvaluationEvent::Complete(&entries[at].1, [entries.len(), self.runs.len()]));
        // Tables of more are not replaced by those of what is passed so far.
        if self.made.load(Ordering::Relaxed) && self.loses_nothing(&entries).is_ok() {
            self.made.store(false, Ordering::Relaxed);
            self.write(&entries)?;
        }
        Ok(())
    }

    /// Writes the tables of all runs, unless another evaluation has written tables of others meanwhile.
    fn finish(&self) -> Result<Outcome> {
        let entries = lock(&self.entries);
        self.loses_nothing(&entries)?;
        self.write(&entries)
    }

    /// Whether all runs of the tables that are there are among these.
    fn loses_nothing(&self, entries: &[([usize; 2], Entry)]) -> Result<()> {
        match self.has_tables {
            true => destination::check_again(self.folder, self.request, entries.iter().map(|(_, entry)| entry)),
            false => Ok(()),
        }
    }

    /// Writes the tables of what is complete.
    fn write(&self, entries: &[([usize; 2], Entry)]) -> Result<Outcome> {
        let Self { request, folder, .. } = self;
        let mut outcome =
            Outcome::new(request.kind, entries.iter().map(|(_, entry)| entry.clone()).collect(), self.runs.len());
        outcome.ceilings.clone_from(&lock(&self.ceilings));
        outcome.studio.clone_from(&self.studio);
        if !self.has_tables {
            return Ok(outcome);
        }
        let Outcome { rows, entries: runs, left, ceilings, studio, .. } = &outcome;
        let vgg = self.weights.map(Weights::fingerprint);
        let written = json!({ "request": request, "lpips_vgg": vgg, "rows": rows, "scene_means": means_over_scenes(rows), "runs": runs,
            "left": left, "ceilings": ceilings, "studio": studio });
        write_files(&[
            (&folder.join(ASKED), self.asked.as_bytes()),
            (&folder.join("table.md"), table::markdown(request, &outcome).as_bytes()),
            (&folder.join("table.csv"), table::csv(request, rows).as_bytes()),
            (&folder.join("table.tex"), latex(request, &outcome).as_bytes()),
            (&folder.join(RESULTS), format!("{written:#}\n").as_bytes()),
        ])?;
        let _ = self.report(EvaluationEvent::Written(&outcome));
        Ok(outcome)
    }
}

/// The runs of one subject, handed out one by one.
struct Runs<'r, 'b> {
    board: &'r SharedProgress<'b>,
    folder: PathBuf,
    number: usize,
    subject: &'r Subject,
    /// The subject's runs that are made.
    own: Range<usize>,
    next: AtomicUsize,
}

impl Runs<'_, '_> {
    fn take(&self) -> Option<Run<'_>> {
        let number = self.next.fetch_add(1, Ordering::Relaxed);
        if self.own.contains(&number) { self.board.request.runs().nth(number) } else { None }
    }

    fn complete(
        &self,
        run: Run<'_>,
        cameras: Vec<Camera>,
        (seconds, outside): (Option<f64>, usize),
        (artifact, record): &(Artifact, TrainRecord),
    ) -> Result<()> {
        let sets = self.board.request.sets();
        let pictures = results::first_pictures(record, sets);
        let shown = pictures.iter().flat_map(|picture| PICTURES.map(|of| format!("{of}/{picture}")));
        if let Some(lost) = shown.into_iter().find(|name| !artifact.file(name).is_file()) {
            return Err(artifact.damaged(&format!("missing: {lost}")));
        }
        let entry = Entry {
            scene: self.subject.name().to_owned(),
            method: run.method.clone(),
            views: run.views,
            seed: run.seed,
            seconds,
            outside,
            quality: results::by_set(record, sets),
            diverged: record.diverged(),
            folder: artifact.key().to_owned(),
            pictures,
            cameras,
        };
        self.board.add([self.number, run.number], entry)
    }

    /// Works on what is left of the subject on one device; what all runs share is made by the first worker that needs it.
    fn work(&self, context: &Arc<Context>, observe: Observe) -> Result<()> {
        match self.subject {
            Subject::Scene(scene) => self.photographed(context, scene, observe),
            Subject::Pool(pool) => self.chosen(context, pool, observe),
        }
    }

    /// Measures LPIPS with the network whose weights are given.
    fn measured(
        &self,
        context: &Arc<Context>,
        (artifact, record): &mut (Artifact, TrainRecord),
        observe: Observe,
    ) -> Result<()> {
        let Some(weights) = self.board.weights else { return Ok(()) };
        perceptual::measure(context, weights, &self.folder, artifact, record, observe)
    }

    fn photographed(&self, context: &Arc<Context>, scene: &Scene, observe: Observe) -> Result<()> {
        let request = self.board.request;
        let intrinsics = request.settings.intrinsics();
        let inputs = scene.inputs(context, &request.settings)?;
        let tests = scene.tests(intrinsics, request.settings.tests, request.test_viewers())?;
        let mut shared = made_for(format!("all runs of {}", self.subject.name()), &mut *observe);
        let artifacts = SceneArtifacts::new(context, &self.folder, request, scene, &mut shared)?;
        let inputs = artifacts.input_photographs(&inputs, &mut shared)?;
        let shown = artifacts.shown(&inputs, &mut shared)?;
        let tests = artifacts.test_photographs(&tests, &mut shared)?;
        if let Some(ceiling) = tests.ceiling() {
            lock(&self.board.ceilings).insert(self.subject.name().to_owned(), ceiling);
        }
        let model = match request.needs_model() {
            true => Some(artifacts.training(&inputs, None, 0, &mut shared)?.0),
            false => None,
        };
        drop(shared);
        while let Some(run) = self.take() {
            let observe = &mut made_for(format!("{}, {run}", self.subject.name()), &mut *observe);
            Error::unless_stopped(observe(ArtifactEvent::Working))?;
            let model = model.as_ref().filter(|_| run.method.needs_model());
            let plan = artifacts.choice(run, MethodInputs { inputs: &inputs, shown: &shown }, model, observe)?;
            let cameras = artifacts.settled(&plan.cameras, observe);
            let photos = artifacts.photographs(&cameras, observe)?;
            let mut trained = artifacts.training(&photos, Some(&tests), run.seed, observe)?;
            self.measured(context, &mut trained, observe)?;
            let of_choice = match run.method {
                Competitor::Cameras(_) => {
                    let given = MethodInputs { inputs: &inputs, shown: &shown };
                    let space = artifacts.target(given, &scene.region, false)?.geometry()?;
                    (None, scene.outside(&space, &plan.cameras))
                }
                _ => (Some(plan.seconds), 0),
            };
            self.complete(run, cameras, of_choice, &trained)?;
        }
        Ok(())
    }

    fn chosen(&self, context: &Arc<Context>, pool: &Pool, observe: Observe) -> Result<()> {
        let mut shared = made_for(format!("all runs of {}", self.subject.name()), &mut *observe);
        let artifacts = PoolArtifacts::new(context, &self.folder, self.board.request, pool, &mut shared)?;
        let model = match self.board.request.needs_model() {
            true => Some(artifacts.model(&mut shared)?),
            false => None,
        };
        drop(shared);
        while let Some(run) = self.take() {
            let observe = &mut made_for(format!("{}, {run}", self.subject.name()), &mut *observe);
            Error::unless_stopped(observe(ArtifactEvent::Working))?;
            let model = model.as_ref().filter(|_| run.method.needs_model());
            let chosen = artifacts.choice(run, model, observe)?;
            let mut trained = artifacts.training(&chosen, run.seed, observe)?;
            self.measured(context, &mut trained, observe)?;
            self.complete(run, artifacts.cameras(&chosen), (Some(chosen.seconds), 0), &trained)?;
        }
        Ok(())
    }
}

/// Forwards events; adds to every artifact and note what it is for.
pub(super) fn made_for<'o>(
    what: String,
    observe: Observe<'o>,
) -> impl FnMut(ArtifactEvent<'_>) -> ControlFlow<()> + Send + 'o {
    move |event| match event {
        ArtifactEvent::Begins(product) => observe(ArtifactEvent::Begins(&format!("{product} for {what}"))),
        ArtifactEvent::Note(note) => observe(ArtifactEvent::Note(format!("{note} ({what})"))),
        event => observe(event),
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

/// An artifact that ends early without a requested stop must not look like a stop.
fn ended_early(product: &str) -> Error {
    Error::request(format!("{product} was not finished, and nobody stopped it; what is finished stays, run again"))
}

/// All runs, a worker for each device. Every worker begins with another subject, since all that
/// come to one have to wait for what its runs share.
fn spread(contexts: &[Arc<Context>], board: &SharedProgress<'_>, subjects: &[Subject]) -> Result<()> {
    let each = board.request.runs().count();
    let runs: Vec<Runs> = subjects
        .iter()
        .enumerate()
        .map(|(number, subject)| {
            let folder = board.folder.join(subject.name());
            let [start, end] =
                [board.runs.start, board.runs.end].map(|run| run.clamp(number * each, (number + 1) * each));
            let own = start - number * each..end - number * each;
            Runs { board, folder, number, subject, next: AtomicUsize::new(own.start), own }
        })
        // What the runs of a subject share is not made for none of them.
        .filter(|runs| !runs.own.is_empty())
        .collect();
    // An error of one worker ends all of them.
    let over = AtomicBool::new(false);
    let work = |first: usize, context: &Arc<Context>| {
        let _end = EndOfAll(&over);
        let (mut asked, mut product) = (false, String::new());
        let mut observe = |event: ArtifactEvent<'_>| {
            if let ArtifactEvent::Begins(key) = event {
                product = key.to_owned();
            }
            let flow = board.report(EvaluationEvent::Artifact(event));
            asked |= flow.is_break() || over.load(Ordering::Relaxed);
            if asked { ControlFlow::Break(()) } else { flow }
        };
        for runs in runs.iter().cycle().skip(first).take(runs.len()) {
            if let Err(error) = runs.work(context, &mut observe) {
                over.store(true, Ordering::Relaxed);
                return Err(match error {
                    Error::Interrupted if !asked => ended_early(&product),
                    error => error,
                });
            }
        }
        Ok(())
    };
    let work = |(first, context)| on_a_share(contexts.len(), || work(first, context));
    let worked: Vec<Result<()>> = thread::scope(|scope| {
        let mut workers = contexts.iter().enumerate();
        let first = workers.next();
        let others: Vec<_> = workers.map(|worker| scope.spawn(move || work(worker))).collect();
        let first = first.map(work);
        let others = others.into_iter().map(|other| other.join().unwrap_or_else(|panic| resume_unwind(panic)));
        first.into_iter().chain(others).collect()
    });
    // The others stopped because of one worker's error.
    let (stopped, failed): (Vec<Error>, Vec<Error>) =
        worked.into_iter().filter_map(Result::err).partition(|error| matches!(error, Error::Interrupted));
    failed.into_iter().chain(stopped).next().map_or(Ok(()), Err)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::evaluate::kind::Kind;
    use crate::planner::methods::Method;
    use crate::splats::run::record::Quality;

    fn entry(method: Method) -> Entry {
        Entry {
            scene: "s".into(),
            method: Competitor::Method(method),
            views: 4,
            seed: 0,
            seconds: Some(0.1),
            outside: 0,
            quality: vec![Quality { psnr: 20.0, ssim: 0.5, ..Quality::default() }; 3],
            diverged: None,
            folder: String::new(),
            pictures: Vec::new(),
            cameras: Vec::new(),
        }
    }

    fn request(methods: &[Method]) -> EvaluationRequest {
        EvaluationRequest::quick(Kind::Object, methods.iter().copied().map(Competitor::Method).collect(), vec![4])
    }

    fn board<'b>(request: &'b EvaluationRequest, folder: &'b Path, observe: Observer<'b>) -> SharedProgress<'b> {
        SharedProgress {
            request,
            folder,
            weights: None,
            asked: "{}".into(),
            has_tables: true,
            runs: 0..request.methods.len(),
            observe: Mutex::new(observe),
            stopped: AtomicBool::new(false),
            made: AtomicBool::new(false),
            entries: Mutex::default(),
            ceilings: Mutex::default(),
            studio: Vec::new(),
        }
    }

    /// If this failed, a complete evaluation would lose its tables when a repeated call is stopped, runs would be in the order in
    /// which devices finished, or a stop would be forgotten.
    #[test]
    fn tables_are_written_where_they_are_out_of_date_and_a_stop_stays() {
        let folder = tempfile::tempdir().unwrap();
        let table = folder.path().join("table.md");
        fs::write(&table, "of an earlier run").unwrap();
        let request = request(&[Method::Ours, Method::PaperNoVds]);
        let mut observe = |event: EvaluationEvent<'_>| match event {
            EvaluationEvent::Complete(..) => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        };
        let board = board(&request, folder.path(), &mut observe);
        let product = |event| board.report(EvaluationEvent::Artifact(event));
        assert!(product(ArtifactEvent::Kept).is_continue());
        board.add([0, 1], entry(Method::PaperNoVds)).unwrap();
        assert_eq!(fs::read_to_string(&table).unwrap(), "of an earlier run");
        assert!(product(ArtifactEvent::Working).is_break(), "the stop was forgotten");
        let _ = product(ArtifactEvent::Begins("k"));
        board.add([0, 0], entry(Method::Ours)).unwrap();
        let written = fs::read_to_string(&table).unwrap();
        let at = |method: &str| written.find(&format!("| s | {method} |")).unwrap();
        assert!(at("ours") < at("paper-no-vds") && !written.contains("still to come"), "{written}");
    }

    /// If this failed, the later one of two evaluations in a folder at the same time would drop the rows of the other without a word.
    #[test]
    fn tables_written_meanwhile_lose_no_rows() {
        let folder = tempfile::tempdir().unwrap();
        let run = |methods: &[Method], meanwhile: &dyn Fn()| {
            let (request, mut observe) = (request(methods), |_: EvaluationEvent<'_>| ControlFlow::Continue(()));
            let board = board(&request, folder.path(), &mut observe);
            meanwhile();
            board.made.store(true, Ordering::Relaxed);
            methods.iter().enumerate().for_each(|(i, method)| board.add([0, i], entry(*method)).unwrap());
            board.finish().map(|_| fs::read_to_string(folder.path().join("table.md")).unwrap())
        };
        let other = || _ = run(&[Method::Ours], &|| {}).unwrap();
        let refused = run(&[Method::PaperNoVds], &other).unwrap_err().to_string();
        assert!(refused.contains("(s, ours, 4 views, seed 0)"), "{refused}");
        assert!(!fs::read_to_string(folder.path().join("table.md")).unwrap().contains("paper-no-vds"));
        let written = run(&[Method::PaperNoVds, Method::Ours], &|| {}).unwrap();
        assert!(written.contains("| s | ours |") && written.contains("| s | paper-no-vds |"), "{written}");
    }
}

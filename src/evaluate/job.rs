//! A whole evaluation: every scene, method, budget and seed.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use serde_json::json;

use super::bench::{Bench, Event, Observe};
use super::request::Request;
use super::results::{self, Entry, Row};
use super::subject::Subject;
use super::{table, views};
use crate::io::folder::{check_folder, write_files};
use crate::vulkan::Context;
use crate::{Error, Result};

/// The file that says that a folder is of an evaluation.
pub const ASKED: &str = "evaluation.json";

/// What an evaluation came to.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Every run that is complete.
    pub entries: Vec<Entry>,
    /// Their means.
    pub rows: Vec<Row>,
}

/// Checks, before anything is computed, that an evaluation can be written into `folder`, which is empty, new or an earlier
/// evaluation's; and that no two scenes would share a folder there.
///
/// # Errors
/// In a line that names the folder or the scene.
pub fn check(folder: &Path, subjects: &[Subject]) -> Result<()> {
    for (i, subject) in subjects.iter().enumerate() {
        if subjects[..i].iter().any(|other| other.name.eq_ignore_ascii_case(&subject.name)) {
            let what = "another scene has this name, and tables tell scenes by their names; rename the file";
            return Err(Error::input(&subject.path, what));
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
    let names: Vec<String> = subjects.iter().map(|subject| subject.name.clone()).collect();
    let asked = format!("{:#}\n", json!({ "scenes": names, "request": request }));
    write_files(&[(&folder.join(ASKED), asked.as_bytes())])?;
    let mut entries = Vec::new();
    for subject in subjects {
        if !scene(context, request, subject, folder, &mut entries, observe)? {
            return Ok(None);
        }
    }
    let rows = results::rows(&entries);
    let written = json!({ "request": request, "rows": rows, "runs": entries });
    write_files(&[
        (&folder.join("table.md"), table::markdown(request, &rows).as_bytes()),
        (&folder.join("table.csv"), table::csv(&rows).as_bytes()),
        (&folder.join("results.json"), format!("{written:#}\n").as_bytes()),
    ])?;
    Ok(Some(Outcome { entries, rows }))
}

/// Evaluates on one scene; false where it was broken off.
fn scene(
    context: &Arc<Context>,
    request: &Request,
    subject: Subject,
    folder: &Path,
    entries: &mut Vec<Entry>,
    observe: Observe,
) -> Result<bool> {
    let (settings, name) = (request.settings, subject.name.clone());
    let intrinsics = settings.intrinsics();
    let inputs = views::inputs(&subject.region, intrinsics, settings.inputs)?;
    let tests = views::tests(&subject.region, &subject.points, intrinsics, settings.tests);
    let bench = Bench::new(context, &folder.join(&name), settings, subject)?;
    let Some(inputs) = bench.photographs(&inputs, observe)? else { return Ok(false) };
    let Some(shown) = bench.shown(&inputs, observe)? else { return Ok(false) };
    let Some(tests) = bench.photographs(&tests, observe)? else { return Ok(false) };
    let mut model = None;
    if request.methods.iter().any(|method| method.needs_model()) {
        let Some((trained, _)) = bench.training(&inputs, None, 0, observe)? else { return Ok(false) };
        model = Some(trained);
    }
    for &views in &request.budgets {
        for seed in 0..u64::from(request.seeds) {
            for method in &request.methods {
                if observe(Event::Working).is_break() {
                    return Ok(false);
                }
                let model = model.as_ref().filter(|_| method.needs_model());
                let Some(plan) = bench.choice((method, views, seed), &shown, model, observe)? else { return Ok(false) };
                let Some(photos) = bench.photographs(&plan.cameras, observe)? else { return Ok(false) };
                let Some((trained, record)) = bench.training(&photos, Some(&tests), seed, observe)? else {
                    return Ok(false);
                };
                entries.push(Entry {
                    scene: name.clone(),
                    method: method.clone(),
                    views,
                    seed,
                    seconds: plan.seconds,
                    quality: results::by_set(&record),
                    folder: trained.key().to_owned(),
                });
            }
        }
    }
    Ok(true)
}

//! Scores of single runs, and their means with intervals over seeds.

use std::collections::BTreeMap;

use serde::Serialize;

use super::competitor::Competitor;
use super::kind::Kind;
use crate::scene::camera::Camera;
use crate::splats::run::evaluate::mean;
use crate::splats::run::outputs::picture_names;
use crate::splats::run::record::{Quality, TestView, TrainRecord};

/// One run: a method's views, trained on with one seed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Entry {
    /// The scene.
    pub scene: String,
    /// The method that chose the views.
    pub method: Competitor,
    /// How many.
    pub views: u32,
    /// Seed of choice and training.
    pub seed: u64,
    /// Seconds that the choice took, without its preparation; none where cameras were given.
    pub seconds: Option<f64>,
    /// Of given cameras the ones that stand outside of the region and the limits of all other methods.
    #[serde(skip_serializing_if = "is_zero")]
    pub outside: usize,
    /// Means over each set of tests.
    pub quality: Vec<Quality>,
    /// Where the training diverged, what [`TrainRecord::diverged`] reports.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diverged: Option<[f64; 2]>,
    /// Folder of the trained splats and the test pictures, in the scene's.
    pub folder: String,
    /// Picture of the first test view of each set: its path in the folders `test` and `reference` of `folder`.
    pub pictures: Vec<String>,
    /// The cameras, in the scene's world.
    #[serde(skip)]
    pub cameras: Vec<Camera>,
}

/// A mean and half of its 95% interval; no interval of one value, or where a value is infinite.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// The mean.
    pub mean: f64,
    /// Half of the interval's width.
    pub half: Option<f64>,
}

/// What is measured, in the order of [`Row::measured`].
pub(crate) const METRICS: [&str; 4] = ["PSNR", "SSIM", "LPIPS", "LPIPS of VGG16"];

/// A row of the table: all seeds of a method at a budget on a scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The scene.
    pub scene: String,
    /// The method that chose the views.
    pub method: Competitor,
    /// How many.
    pub views: u32,
    /// Runs (seeds) that the mean is over.
    pub seeds: usize,
    /// Of these the ones whose training diverged.
    pub diverged: usize,
    /// Seconds of the choice; none where cameras were given.
    pub seconds: Option<Interval>,
    /// Given cameras of all runs that stand outside of the region and the limits.
    #[serde(skip_serializing_if = "is_zero")]
    pub outside: usize,
    /// [`METRICS`] by [`Kind::columns`](super::kind::Kind::columns); none where one was not measured.
    pub measured: [Vec<Option<Interval>>; METRICS.len()],
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// The results of an evaluation, so far or in the end.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The kind of its subjects.
    pub kind: Kind,
    /// Every run that is complete.
    pub entries: Vec<Entry>,
    /// Their means.
    pub rows: Vec<Row>,
    /// Runs still to come.
    pub left: usize,
    /// Decibels that a perfect model would have for the noise of a scene's test photographs, where that is known.
    pub ceilings: BTreeMap<String, f64>,
    /// Names of scenes that the built-in studio lights, as they have no lamps and no environment was given.
    pub studio: Vec<String>,
}

impl Outcome {
    /// Of these runs out of `all`.
    pub fn new(kind: Kind, entries: Vec<Entry>, all: usize) -> Self {
        let (rows, left) = (rows(&entries), all.saturating_sub(entries.len()));
        Self { kind, rows, left, entries, ceilings: BTreeMap::new(), studio: Vec::new() }
    }
}

/// Views of each set of tests, by the beginnings of their names; of one set alone all are.
fn of_sets<'r>(record: &'r TrainRecord, sets: &[&str]) -> Vec<Vec<&'r TestView>> {
    let is_of = |view: &TestView, set: &str| sets.len() == 1 || view.name.split('_').next() == Some(set);
    sets.iter().map(|set| record.test_views.iter().filter(|view| is_of(view, set)).collect()).collect()
}

/// Means over the sets of a run's test views.
pub(crate) fn by_set(record: &TrainRecord, sets: &[&str]) -> Vec<Quality> {
    of_sets(record, sets).into_iter().map(|views| mean(&views.into_iter().cloned().collect::<Vec<_>>())).collect()
}

/// The picture of the first view by name of each set.
pub(crate) fn first_pictures(record: &TrainRecord, sets: &[&str]) -> Vec<String> {
    let names: Vec<String> = record.test_views.iter().map(|view| view.name.clone()).collect();
    let picture = |first: &TestView| {
        let files = picture_names(&names);
        let place = names.iter().position(|name| *name == first.name);
        place.map(|place| files[place].to_string_lossy().into_owned()).unwrap_or_default()
    };
    let first = |views: Vec<&TestView>| views.into_iter().min_by(|a, b| a.name.cmp(&b.name)).map(picture);
    of_sets(record, sets).into_iter().map(|views| first(views).unwrap_or_default()).collect()
}

/// The pictures of all views with their PSNR, ordered by name.
pub(crate) fn pictures(record: &TrainRecord) -> Vec<(String, f64)> {
    let names: Vec<String> = record.test_views.iter().map(|view| view.name.clone()).collect();
    let mut pictures: Vec<_> = record.test_views.iter().zip(picture_names(&names)).collect();
    pictures.sort_by(|(a, _), (b, _)| a.name.cmp(&b.name));
    pictures.into_iter().map(|(view, file)| (file.to_string_lossy().into_owned(), view.quality.psnr)).collect()
}

/// Number and name of the metrics that tables have: VGG16's, which is optional, only where some row has it.
pub fn measured<'r>(rows: impl IntoIterator<Item = &'r Row> + Clone) -> impl Iterator<Item = (usize, &'static str)> {
    const ALWAYS: usize = METRICS.len() - 1;
    let of = move |metric: usize| rows.clone().into_iter().any(|row| row.measured[metric].iter().any(Option::is_some));
    (0..METRICS.len()).filter(move |metric| *metric < ALWAYS || of(*metric)).map(|metric| (metric, METRICS[metric]))
}

/// A row for each scene, method and budget, in the order in which they come first.
pub fn rows(entries: &[Entry]) -> Vec<Row> {
    let mut groups: Vec<Vec<&Entry>> = Vec::new();
    for entry in entries {
        let same = |group: &&mut Vec<&Entry>| {
            let first = group[0];
            (&first.scene, &first.method, first.views) == (&entry.scene, &entry.method, entry.views)
        };
        match groups.iter_mut().find(same) {
            Some(group) => group.push(entry),
            None => groups.push(vec![entry]),
        }
    }
    groups.iter().map(|group| row(group)).collect()
}

fn row(group: &[&Entry]) -> Row {
    let of = |value: &dyn Fn(&Entry) -> Option<f64>| {
        group.iter().map(|entry| value(entry)).collect::<Option<Vec<f64>>>().map(|values| interval(&values))
    };
    let metric = |value: fn(&Quality) -> Option<f64>| {
        let sets = group[0].quality.len();
        let whole = |entry: &Entry| entry.quality.iter().map(value).sum::<Option<f64>>().map(|sum| sum / sets as f64);
        let mut columns: Vec<_> = (0..sets).map(|set| of(&|entry: &Entry| value(&entry.quality[set]))).collect();
        if sets > 1 {
            columns.push(of(&whole));
        }
        columns
    };
    let first = group[0];
    Row {
        scene: first.scene.clone(),
        method: first.method.clone(),
        views: first.views,
        seeds: group.len(),
        diverged: group.iter().filter(|entry| entry.diverged.is_some()).count(),
        seconds: of(&|entry: &Entry| entry.seconds),
        outside: group.iter().map(|entry| entry.outside).sum(),
        measured: [metric(|q| Some(q.psnr)), metric(|q| Some(q.ssim)), metric(|q| q.lpips), metric(|q| q.lpips_vgg)],
    }
}

/// The mean and half the 95% interval of independent values, by Student's t.
pub fn interval(values: &[f64]) -> Interval {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let half = student(values.len() - 1).map(|t| t * (variance / n).sqrt());
    Interval { mean, half: half.filter(|half| half.is_finite()) }
}

/// The 97.5% quantile of Student's t by degrees of freedom, from one on; the last three are of 40, 60 and 120.
const QUANTILES: [f64; 33] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131, 2.120,
    2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042, 2.021, 2.000,
    1.980,
];

/// The quantile of these degrees of freedom, or of the next fewer in the table.
fn student(freedom: usize) -> Option<f64> {
    let at = match freedom {
        0 => return None,
        1..=30 => freedom - 1,
        31..40 => 29,
        40..60 => 30,
        60..120 => 31,
        _ => 32,
    };
    Some(QUANTILES[at])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner::methods::Method;

    /// If this failed, a difference could look significant that is not. The example: mean 10, deviation 1, three values.
    #[test]
    fn intervals_are_student_s() {
        let Interval { mean, half } = interval(&[9.0, 10.0, 11.0]);
        assert!((mean - 10.0).abs() < 1e-12 && (half.unwrap() - 4.303 / 3f64.sqrt()).abs() < 1e-12);
        assert_eq!(interval(&[2.0]), Interval { mean: 2.0, half: None });
        assert_eq!(interval(&[f64::INFINITY; 2]).half, None);
        assert_eq!([1, 30, 35, 200].map(student), [Some(12.706), Some(2.042), Some(2.042), Some(1.98)]);
    }

    /// If this failed, a table would mix methods, budgets or scenes, or silently lack a metric.
    #[test]
    fn rows_hold_the_seeds_of_one_method_at_one_budget() {
        let entry = |method, views, seed, psnr| Entry {
            scene: "cup".into(),
            method,
            views,
            seed,
            seconds: Some(0.5),
            outside: 0,
            quality: [0.0, 3.0, 6.0]
                .map(|more| Quality { psnr: psnr + more, ssim: 0.5, ..Quality::default() })
                .to_vec(),
            diverged: (seed == 1).then_some([20.0, 15.0]),
            folder: String::new(),
            pictures: Vec::new(),
            cameras: Vec::new(),
        };
        let entries = [
            entry(Competitor::Method(Method::Ours), 20, 0, 20.0),
            entry(Competitor::Method(Method::PaperNoVds), 20, 0, 10.0),
            entry(Competitor::Method(Method::Ours), 20, 1, 22.0),
            entry(Competitor::Method(Method::Ours), 40, 0, 30.0),
        ];
        let rows = rows(&entries);
        let means = |row: &Row| row.measured[0].iter().map(|i| i.unwrap().mean).collect::<Vec<_>>();
        let summary = |row: &Row| (row.method.clone(), row.views, [row.seeds, row.diverged], means(row));
        assert_eq!(summary(&rows[0]), (Competitor::Method(Method::Ours), 20, [2, 1], vec![21.0, 24.0, 27.0, 24.0]));
        assert_eq!(
            summary(&rows[1]),
            (Competitor::Method(Method::PaperNoVds), 20, [1, 0], vec![10.0, 13.0, 16.0, 13.0])
        );
        assert_eq!((rows.len(), rows[2].views), (3, 40));
        assert_eq!(rows[0].measured[2], [None; 4]);
        assert_eq!(measured(&rows).collect::<Vec<_>>(), [(0, "PSNR"), (1, "SSIM"), (2, "LPIPS")]);
        let one = |entry: &Entry| Entry { quality: entry.quality[..1].to_vec(), ..entry.clone() };
        assert_eq!(means(&super::rows(&[one(&entries[0]), one(&entries[2])])[0]), [21.0], "one set is the whole");
        assert!((rows[0].measured[0][0].unwrap().half.unwrap() - 12.706).abs() < 1e-9);
    }
}

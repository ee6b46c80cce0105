//! What methods reached on the benchmark's scenes, side by side: read from the results of one evaluation a scene.

use std::fmt::Write as _;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::{BenchmarkScene, Split};
use crate::lab::evaluate::destination::RESULTS;
use crate::lab::evaluate::results::{Interval, interval};
use crate::planner::quality::expected::or_zero;
use crate::{Error, Result};

/// The method that others are compared with, where it is among them.
const OURS: &str = "ours";
/// The setting that differs from scene to scene.
const OWN: &str = "region";

#[derive(Deserialize)]
struct Results {
    request: Request,
    rows: Vec<Row>,
    left: usize,
}

#[derive(Deserialize)]
struct Request {
    settings: serde_json::Map<String, Value>,
}

#[derive(Deserialize)]
struct Row {
    method: String,
    views: u32,
    seeds: usize,
    #[serde(default)]
    diverged: usize,
    measured: Vec<Vec<Option<Mean>>>,
}

#[derive(Clone, Copy, Deserialize)]
struct Mean {
    mean: f64,
}

/// A method's mean over seeds on one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Reached {
    /// What the scene may be used for.
    pub split: Split,
    /// Whether it is a room.
    pub room: bool,
    /// The scene.
    pub scene: String,
    /// The method.
    pub method: String,
    /// How many views.
    pub views: u32,
    /// Seeds that it is the mean of.
    pub seeds: usize,
    /// Of these the ones whose training diverged.
    pub diverged: usize,
    /// PSNR in dB, SSIM, LPIPS (AlexNet): the mean over all sets of tests; none where it was not measured.
    pub measured: [Option<f64>; 3],
}

/// A method's place at a number of views on scenes of one kind and split.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// The method.
    pub method: String,
    /// Scenes that it and the reference have.
    pub scenes: usize,
    /// Trainings on these that diverged.
    pub diverged: usize,
    /// Means over these scenes, as [`Reached::measured`].
    pub means: [Option<f64>; 3],
    /// PSNR less the reference's on the same scene: mean and 95% interval over scenes; none of the reference.
    pub less: Option<Interval>,
}

/// The places at a number of views on scenes of one kind and split: the best first, and behind them methods that lack some of the scenes.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// What the scenes may be used for, whether they are rooms, and the number of views.
    pub of: (Split, bool, u32),
    /// The method that differences are from.
    pub reference: String,
    /// All methods.
    pub places: Vec<Place>,
}

/// Reads the evaluations of `scenes` that there are in folders of their names in `folder`; notes say which are left off, since runs are
/// missing, or since their settings are not those of the first of their kind.
///
/// # Errors
/// Where one cannot be read.
pub fn read<'s>(
    folder: &Path,
    scenes: impl Iterator<Item = &'s BenchmarkScene>,
) -> Result<(Vec<Reached>, Vec<String>)> {
    let (mut all, mut notes) = (Vec::new(), Vec::new());
    let mut settings: [Option<(String, serde_json::Map<String, Value>)>; 2] = [None, None];
    for scene in scenes {
        let file = folder.join(&scene.name).join(RESULTS);
        let text = match fs::read(&file) {
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            text => text.map_err(|source| Error::io(&file, source))?,
        };
        let Results { mut request, rows, left } = serde_json::from_slice(&text)
            .map_err(|e| Error::input(&file, format!("no results of an evaluation: {e}")))?;
        request.settings.remove(OWN);
        let known = &mut settings[usize::from(scene.is_room())];
        let off = match known {
            _ if left > 0 => Some(format!("{left} of its runs are not complete")),
            Some((first, others)) if *others != request.settings => {
                Some(format!("its settings are not those of {first}"))
            }
            Some(_) => None,
            None => {
                *known = Some((scene.name.clone(), request.settings));
                None
            }
        };
        if let Some(off) = off {
            notes.push(format!("{} is left off the board: {off}", scene.name));
            continue;
        }
        all.extend(rows.into_iter().map(|row| Reached {
            split: scene.split,
            room: scene.is_room(),
            scene: scene.name.clone(),
            method: row.method,
            views: row.views,
            seeds: row.seeds,
            diverged: row.diverged,
            // The last column is the mean over the sets, or the only set.
            measured: std::array::from_fn(|k| row.measured.get(k)?.last().copied().flatten().map(|of| of.mean)),
        }));
    }
    Ok((all, notes))
}

/// The tables of what was reached, by split, kind and number of views.
pub fn tables(all: &[Reached]) -> Vec<Table> {
    let mut of: Vec<(Split, bool, u32)> = all.iter().map(|one| (one.split, one.room, one.views)).collect();
    of.sort_unstable();
    of.dedup();
    of.into_iter().filter_map(|of| table(all, of)).collect()
}

fn table(all: &[Reached], of: (Split, bool, u32)) -> Option<Table> {
    let here: Vec<&Reached> = all.iter().filter(|one| (one.split, one.room, one.views) == of).collect();
    let mut methods: Vec<&str> = Vec::new();
    for one in &here {
        if !methods.contains(&one.method.as_str()) {
            methods.push(&one.method);
        }
    }
    let reference = methods.iter().find(|method| **method == OURS).or(methods.first())?;
    let at = |scene: &str, method: &str| here.iter().find(|one| one.scene == scene && one.method == method).copied();
    let place = |method: &&str| {
        let pairs: Vec<(&Reached, &Reached)> = here
            .iter()
            .filter(|one| one.method == *method)
            .filter_map(|one| Some((*one, at(&one.scene, reference)?)))
            .collect();
        let mean =
            |values: Option<Vec<f64>>| values.filter(|v| !v.is_empty()).map(|v| v.iter().sum::<f64>() / v.len() as f64);
        let less: Option<Vec<f64>> =
            pairs.iter().map(|(one, other)| Some(one.measured[0]? - other.measured[0]?)).collect();
        Place {
            method: (*method).to_owned(),
            scenes: pairs.len(),
            diverged: pairs.iter().map(|(one, _)| one.diverged).sum(),
            means: std::array::from_fn(|k| mean(pairs.iter().map(|(one, _)| one.measured[k]).collect())),
            less: less.filter(|less| method != reference && !less.is_empty()).map(|less| interval(&less)),
        }
    };
    let mut places: Vec<Place> = methods.iter().map(place).collect();
    let most = places.iter().map(|place| place.scenes).max();
    let order = |place: &Place| place.less.map_or(0.0, |less| less.mean);
    places.sort_by(|a, b| (Some(a.scenes) < most).cmp(&(Some(b.scenes) < most)).then(order(b).total_cmp(&order(a))));
    Some(Table { of, reference: (*reference).to_owned(), places })
}

impl Table {
    /// What it is of, in words.
    pub fn title(&self) -> String {
        let (split, room, views) = self.of;
        format!("{} of the {split} split, {views} views", if room { "Rooms" } else { "Objects" })
    }

    /// Its columns.
    pub fn header(&self) -> [String; 6] {
        let [method, scenes, less] = ["method".into(), "scenes".into(), format!("PSNR less {}, dB", self.reference)];
        [method, scenes, less, "PSNR".into(), "SSIM".into(), "LPIPS".into()]
    }

    /// Its rows.
    pub fn rows(&self) -> impl Iterator<Item = [String; 6]> {
        self.places.iter().map(|place| {
            let less = match place.less {
                Some(Interval { mean, half: Some(half) }) => format!("{:+.2} ± {half:.2}", or_zero(mean, 2)),
                Some(Interval { mean, half: None }) => format!("{:+.2}", or_zero(mean, 2)),
                None => String::new(),
            };
            let [psnr, ssim, lpips] = [(0, 2), (1, 3), (2, 3)]
                .map(|(k, digits)| place.means[k].map_or_else(|| "–".to_owned(), |value| format!("{value:.digits$}")));
            let method = match place.diverged {
                0 => place.method.clone(),
                count => format!("{} ({count} diverged)", place.method),
            };
            [method, place.scenes.to_string(), less, psnr, ssim, lpips]
        })
    }
}

/// Tables in Markdown.
pub fn markdown(tables: &[Table]) -> String {
    let mut text = String::new();
    for table in tables {
        let line = |cells: [String; 6]| format!("| {} |\n", cells.join(" | "));
        let rows: String = table.rows().map(line).collect();
        // Writing to a string cannot fail.
        let _ = write!(text, "## {}\n\n{}|---|---|---|---|---|---|\n{rows}\n", table.title(), line(table.header()));
    }
    text
}

/// What was reached as CSV: a line for each scene, number of views and method.
pub fn csv(all: &[Reached]) -> String {
    let mut text = String::from("split,kind,scene,views,method,seeds,diverged,psnr,ssim,lpips\n");
    for one in all {
        let kind = if one.room { "room" } else { "object" };
        let [psnr, ssim, lpips] =
            one.measured.map(|value| value.map_or_else(String::new, |value| format!("{value:.4}")));
        let method = one.method.replace([',', '"', '\n'], ";");
        let Reached { split, scene, views, seeds, diverged, .. } = one;
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{split},{kind},{scene},{views},{method},{seeds},{diverged},{psnr},{ssim},{lpips}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reached(scene: &str, method: &str, psnr: f64) -> Reached {
        let (scene, method) = (scene.to_owned(), method.to_owned());
        let measured = [Some(psnr), Some(0.9), None];
        Reached { split: Split::Test, room: false, scene, method, views: 50, seeds: 1, diverged: 0, measured }
    }

    /// If this failed, a method would get its place by the scenes that it was run on, or by how unlike scenes are.
    #[test]
    fn methods_are_compared_on_the_same_scenes() {
        let mut all = Vec::new();
        for (scene, level, gain) in [("a", 20.0, 1.0), ("b", 30.0, 2.0), ("c", 40.0, 3.0)] {
            all.extend([reached(scene, "random", level), reached(scene, "ours", level + gain)]);
        }
        all.push(reached("d", "random", 90.0));
        all.push(reached("a", "mine", 22.5));
        let [table] = &tables(&all)[..] else { panic!("several tables") };
        let names: Vec<&str> = table.places.iter().map(|place| place.method.as_str()).collect();
        // One scene more in favour of a method is no place before those that have all.
        assert_eq!((names, table.reference.as_str()), (vec!["ours", "random", "mine"], "ours"));
        let random = &table.places[1];
        let less = random.less.unwrap();
        assert_eq!((random.scenes, random.means[0]), (3, Some(30.0)));
        assert!((less.mean + 2.0).abs() < 1e-12 && (less.half.unwrap() - 4.303 / 3f64.sqrt()).abs() < 1e-9);
        assert!(markdown(&tables(&all)).contains("| random | 3 | -2.00 ± 2.48 | 30.00 | 0.900 | – |"));
        assert!(csv(&[reached("a", "m,x", 1.0)]).contains(",m;x,1,0,1.0000,0.9000,\n"));
    }
}

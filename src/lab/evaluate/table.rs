//! The tables of an evaluation, for people and for programs.

use std::fmt::Write;

use super::competitor::Competitor;
use super::kind::Kind;
use super::request::EvaluationRequest;
use super::results::{Interval, METRICS, Outcome, Row, measured};
use super::scene_means::{SceneMean, means_over_scenes};
use super::settings::{BaselinesFrom, InputsFrom, Shown, Space};
use crate::planner::plan::target::RegionChoice;
use crate::planner::quality::expected::or_zero;
use crate::planner::quality::viewers::Viewers;
use crate::scene::region::Shape;
use crate::splats::run::record::{DIVERGED_DB, PASSING_DB};

/// Twice the squared error, in decibels.
const TWICE_DB: f64 = 3.01;

/// Decimals of each metric.
pub(crate) const DECIMALS: [usize; METRICS.len()] = [2, 4, 4, 4];

/// What the numbers are of. `left` runs are still to come.
pub(crate) fn description(request: &EvaluationRequest, left: usize) -> String {
    let settings = &request.settings;
    let mut text = format!(
        "{}; {} iterations of training{}, at most {} splats, {}. Mean and half of the 95% interval over seeds \
         (Student's t).",
        conditions(request),
        settings.iterations,
        if settings.antialiased { " with the filter against aliasing (`--antialiased`)" } else { "" },
        settings.max_splats,
        seeds(request)
    );
    if request.sets() == Kind::Object.sets() {
        text += " Test views: half and full look at the centre from half of the region's outer radius and from the whole, random from \
                 anywhere between; all is their mean.";
    }
    if left > 0 {
        // Writing to a string cannot fail.
        let _ = write!(text, " Not complete: runs still to come: {left}.");
    }
    text
}

/// Which seeds there are, in words.
fn seeds(request: &EvaluationRequest) -> String {
    match (request.first_seed, request.seeds) {
        (first, 1) => format!("seed {first}"),
        (0, count) => format!("{count} seeds"),
        (first, count) => format!("{count} seeds from {first}"),
    }
}

/// A table for each metric, as Markdown.
pub(crate) fn markdown(request: &EvaluationRequest, outcome: &Outcome) -> String {
    let Outcome { rows, left, .. } = outcome;
    let mut text = description(request, *left) + "\n";
    for line in facts(outcome).chain(warnings(outcome)) {
        text += &format!("\n{line}\n");
    }
    let columns = request.columns();
    for (metric, name) in measured(rows) {
        let arrow = if name.starts_with("LPIPS") { "lower is better" } else { "higher is better" };
        let _ = write!(text, "\n## {name} ({arrow})\n\n| scene | method | views |");
        columns.iter().for_each(|column| text += &format!(" {column} |"));
        let _ = writeln!(text, " choice, s |\n|{}", "---|".repeat(columns.len() + 4));
        for row in rows {
            let [scene, method] = [&row.scene, row.method.name()].map(|name| name.replace('|', "\\|"));
            let _ = write!(text, "| {scene} | {method} | {} |", row.views);
            for mean in &row.measured[metric] {
                let cell = mean.map_or_else(|| "–".into(), |interval| cell(interval, DECIMALS[metric]));
                let _ = write!(text, " {cell} |");
            }
            let _ = writeln!(text, " {} |", row.seconds.map_or_else(|| "–".into(), |seconds| cell(seconds, 2)));
        }
    }
    text + &over_scenes(rows)
}

/// The means over scenes as Markdown; nothing of one scene.
fn over_scenes(rows: &[Row]) -> String {
    let means = means_over_scenes(rows);
    let Some(first) = means.first() else { return String::new() };
    let mut text = format!("\n## Means over scenes\n\n{}\n\n| method | views | scenes |", paired(first));
    let metrics: Vec<(usize, &str)> = measured(rows).collect();
    metrics.iter().for_each(|(_, name)| text += &format!(" {name} | difference |"));
    let _ = writeln!(text, "\n|{}", "---|".repeat(3 + 2 * metrics.len()));
    for mean in &means {
        let name = mean.method.name().replace('|', "\\|");
        let _ = write!(text, "| {name} | {} | {} |", mean.views, mean.scenes);
        for (metric, _) in &metrics {
            for value in mean.shown(*metric) {
                let _ = write!(text, " {} |", value.map_or_else(|| "–".into(), |of| cell(of, DECIMALS[*metric])));
            }
        }
        text.push('\n');
    }
    text
}

/// What means over scenes are, in words.
pub(crate) fn paired(mean: &SceneMean) -> String {
    format!(
        "The last column of each scene, mean over the scenes that all methods have, and the difference from {} on the same scenes with half \
         of its 95% interval over scenes (Student's t).",
        mean.reference
    )
}

/// What the numbers were made under.
pub(crate) fn facts(outcome: &Outcome) -> impl Iterator<Item = String> {
    [ceilings(outcome), in_studio(outcome)].into_iter().flatten()
}

/// What a reader must be warned of.
pub(crate) fn warnings(outcome: &Outcome) -> impl Iterator<Item = String> {
    [outside(&outcome.rows), drowned(outcome), apart(&outcome.rows)].into_iter().flatten()
}

/// Scenes that the built-in studio lights.
fn in_studio(outcome: &Outcome) -> Option<String> {
    let scenes = &outcome.studio;
    (!scenes.is_empty()).then(|| format!("No lamps and no `--env`: a built-in studio lights {}.", scenes.join(", ")))
}

/// Given cameras that stand where no other method may put any.
fn outside(rows: &[Row]) -> Option<String> {
    let of = |row: &Row| {
        let Row { scene, views, seeds, outside, .. } = row;
        format!("{scene}, {}, {views} views ({outside} of {})", row.method.name(), *seeds * *views as usize)
    };
    let rows: Vec<String> = rows.iter().filter(|row| row.outside > 0).map(of).collect();
    (!rows.is_empty()).then(|| {
        format!("Given cameras that stand outside of the region and limits of the other methods: {}.", rows.join("; "))
    })
}

/// Rows of which some trainings diverged, if any.
fn apart(rows: &[Row]) -> Option<String> {
    let of = |row: &Row| {
        let Row { scene, views, seeds, diverged, .. } = row;
        format!("{scene}, {}, {views} views ({diverged} of {seeds})", row.method.name())
    };
    let rows: Vec<String> = rows.iter().filter(|row| row.diverged > 0).map(of).collect();
    (!rows.is_empty()).then(|| {
        let listed = rows.join("; ");
        format!(
            "Trainings that diverged (PSNR on the training photos fell by more than {PASSING_DB} dB on the way, or was more than \
             {DIVERGED_DB} dB below its best in the end): {listed}."
        )
    })
}

/// What the noise of the test photographs keeps any model from.
fn ceilings(outcome: &Outcome) -> Option<String> {
    let of: Vec<String> = outcome.ceilings.iter().map(|(scene, psnr)| format!("{scene} {psnr:.1} dB")).collect();
    (!of.is_empty()).then(|| format!("PSNR of a perfect model, for the noise of the test photos: {}.", of.join(", ")))
}

/// Rows whose error is so little above the noise's that this decides.
fn drowned(outcome: &Outcome) -> Option<String> {
    let drowned = |row: &&Row| {
        let psnr = row.measured[0].last().copied().flatten().map(|interval| interval.mean);
        psnr.zip(outcome.ceilings.get(&row.scene)).is_some_and(|(psnr, ceiling)| psnr > ceiling - TWICE_DB)
    };
    let of = |row: &Row| format!("{}, {}, {} views", row.scene, row.method.name(), row.views);
    let rows: Vec<String> = outcome.rows.iter().filter(drowned).map(of).collect();
    (!rows.is_empty()).then(|| {
        let listed = rows.join("; ");
        format!("Noise hides differences: the error of these is less than twice that of the test photos' noise, of which `--test-spp` makes less: {listed}.")
    })
}

/// What methods chose on and which pictures were trained on.
fn conditions(request: &EvaluationRequest) -> String {
    let settings = &request.settings;
    if request.kind == Kind::Pool {
        return format!(
            "Methods chose among the photos of a pool that are not held out, those that need a model by one of {} of them; \
             photos shrunk by {}",
            settings.inputs, settings.shrink
        );
    }
    let inputs = match settings.inputs_from {
        InputsFrom::Uniform => format!("{} input photos", settings.inputs),
        InputsFrom::Random => {
            format!("{} input photos from places at random (`--inputs-from random`)", settings.inputs)
        }
        InputsFrom::Biased => format!("{} input photos from one side (`--inputs-from biased`)", settings.inputs),
    };
    let inputs = match settings.input_samples {
        same if same == settings.samples => inputs,
        samples => format!("{inputs} with {samples} samples"),
    };
    let shown = match settings.shown {
        Shown::Proxy if settings.space == Space::Known => {
            format!("a surface made from {inputs}, within the space that these prove free (`--space known`)")
        }
        Shown::Proxy => format!("a surface made from {inputs}"),
        Shown::True => format!("the scene's own mesh (`--surface true`), scored from {inputs}"),
    };
    let baselines = match settings.baselines_from {
        BaselinesFrom::Sphere if request.kind == Kind::Object => {
            ", baselines from the region's outer sphere (`--baselines-from sphere`)"
        }
        _ => "",
    };
    let situation = request.situation.words();
    let limits: String = request.limits.lines().into_iter().map(|line| format!("; {line}")).collect();
    let RegionChoice { shape, clearance, .. } = settings.region;
    let mut region = match shape {
        Some(Shape::Box { min, max }) => format!(", cameras and tests in the box from {min} to {max}"),
        _ => String::new(),
    };
    if let Some(clearance) = clearance {
        // Writing to a string cannot fail.
        let _ = write!(region, ", no camera nearer to things than {clearance}");
    }
    let finer = match settings.test_samples {
        same if same == settings.samples => String::new(),
        samples => format!(" with {samples} samples"),
    };
    let given = match request.methods.iter().any(|method| matches!(method, Competitor::Cameras(_))) {
        true if request.kind == Kind::Room => {
            ", cameras:FILE are where the file has them, but for those that had to move"
        }
        true => ", cameras:FILE are where the file has them",
        false => "",
    };
    let own_lenses = |method: &Competitor| matches!(method, Competitor::Cameras(given) if given.has_own_lenses());
    let mut lenses = String::new();
    if request.methods.iter().any(own_lenses) {
        lenses += ", lenses:FILE with the lenses of the file";
    }
    if request.methods.iter().any(|method| matches!(method, Competitor::Through(_))) {
        // Writing to a string cannot fail.
        let _ = write!(
            lenses,
            ", METHOD@DEGREES with a field of view of so many degrees in place of {}, which tests have",
            settings.fov_deg
        );
    }
    let looking = if request.viewers.is_default() { "" } else { ", test views from where `--viewers` says" };
    let tests = match &request.viewers {
        Viewers::Cameras(all) => settings.tests.min(all.len() as u32),
        _ => settings.tests,
    };
    format!(
        "Methods chose on {shown}{region}{situation}{limits}{baselines}{given}{lenses}{looking}; pictures of {0} x {0} pixels with {1} samples, {2} test views a set{finer}",
        settings.size, settings.samples, tests
    )
}

/// A line for each scene, method, budget, set and metric.
pub fn csv(request: &EvaluationRequest, rows: &[Row]) -> String {
    let columns = request.columns();
    let mut text = String::from("scene,method,views,seeds,set,metric,mean,half_interval_95\n");
    for row in rows {
        let quoted = |name: &str| format!("\"{}\"", name.replace('"', "\"\""));
        let (scene, method) = (quoted(&row.scene), row.method.name());
        let method = if method.contains('"') { quoted(method) } else { method.to_owned() };
        let mut line = |set: &str, metric: &str, interval: Option<Interval>| {
            let mean = interval.map_or_else(String::new, |interval| interval.mean.to_string());
            let half = interval.and_then(|interval| interval.half).map_or_else(String::new, |half| half.to_string());
            let _ = writeln!(text, "{scene},{method},{},{},{set},{metric},{mean},{half}", row.views, row.seeds);
        };
        for (metric, name) in measured(rows) {
            for (set, mean) in columns.iter().zip(&row.measured[metric]) {
                line(set, name, *mean);
            }
        }
        line("", "choice_seconds", row.seconds);
        if row.outside > 0 {
            line("", "outside", Some(Interval { mean: row.outside as f64, half: None }));
        }
        if row.diverged > 0 {
            line("", "diverged", Some(Interval { mean: row.diverged as f64, half: None }));
        }
    }
    text
}

/// A mean with half of its interval, where it has one.
pub fn cell(Interval { mean, half }: Interval, decimals: usize) -> String {
    let mean = or_zero(mean, decimals);
    match half {
        Some(half) => format!("{mean:.decimals$} ± {half:.decimals$}"),
        None => format!("{mean:.decimals$}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner::methods::Method;

    fn row() -> Row {
        let of = |mean, half| Some(Interval { mean, half });
        Row {
            scene: "cup, \"red\"".into(),
            method: Competitor::Method(Method::PaperNoVds),
            views: 20,
            seeds: 3,
            diverged: 0,
            seconds: of(1.5, None),
            outside: 0,
            measured: [
                vec![of(20.0, Some(0.5)), of(21.0, Some(0.25)), of(19.0, None), of(20.0, Some(0.3))],
                vec![of(0.81, Some(0.01)); 4],
                vec![None; 4],
                vec![None; 4],
            ],
        }
    }

    fn outcome(rows: &[Row]) -> Outcome {
        Outcome { rows: rows.to_vec(), ..Outcome::new(Kind::Object, Vec::new(), 0) }
    }

    /// If this failed, a table of grain would look like one of methods, or a clean one like grain.
    #[test]
    fn rows_near_the_noise_of_the_tests_are_named() {
        let of = |ceiling: Option<f64>| {
            let ceilings = ceiling.map(|ceiling| (row().scene, ceiling)).into_iter().collect();
            let outcome = Outcome { ceilings, ..outcome(&[row()]) };
            (super::ceilings(&outcome), drowned(&outcome))
        };
        assert_eq!(of(None), (None, None));
        // The mean over the sets is 20 dB.
        let (line, warning) = of(Some(23.1));
        assert!(line.unwrap().contains("cup, \"red\" 23.1 dB") && warning.is_none());
        let warning = of(Some(22.9)).1.unwrap();
        assert!(
            warning.contains("--test-spp") && warning.ends_with(": cup, \"red\", paper-no-vds, 20 views."),
            "{warning}"
        );
    }

    /// If this failed, numbers would be under the wrong headings, or a missing one would look like a zero.
    #[test]
    fn known_numbers_stand_where_they_belong() {
        let request = EvaluationRequest {
            seeds: 3,
            first_seed: 7,
            ..EvaluationRequest::quick(Kind::Object, vec![Competitor::Method(Method::PaperNoVds)], vec![20])
        };
        let text = markdown(&request, &outcome(&[row()]));
        assert!(text.contains(", 3 seeds from 7. Mean"), "{text}");
        let line = "| cup, \"red\" | paper-no-vds | 20 | 20.00 ± 0.50 | 21.00 ± 0.25 | 19.00 | 20.00 ± 0.30 | 1.50 |";
        assert!(text.contains(line), "{text}");
        assert!(text.contains("| 20 | – | – | – | – | 1.50 |") && text.contains("10 input photos"), "{text}");
        assert!(!text.contains("VGG16") && !text.contains("diverged"), "{text}");
        let broken = [Row { diverged: 2, ..row() }];
        assert!(csv(&request, &broken).ends_with("\"cup, \"\"red\"\"\",paper-no-vds,20,3,,diverged,2,\n"));
        let broken = markdown(&request, &outcome(&broken));
        assert!(
            broken.contains("below its best in the end): cup, \"red\", paper-no-vds, 20 views (2 of 3).\n"),
            "{broken}"
        );
        let csv = csv(&request, &[row()]);
        let lines: Vec<&str> = csv.lines().collect();
        assert_eq!(lines.len(), 1 + 3 * 4 + 1);
        assert_eq!(lines[1], "\"cup, \"\"red\"\"\",paper-no-vds,20,3,half,PSNR,20,0.5");
        assert!(lines[3].ends_with("random,PSNR,19,") && lines[9].ends_with("half,LPIPS,,"), "{csv}");
        assert!(lines[13].ends_with(",,choice_seconds,1.5,"));
        let given: Competitor = "cameras:a|\"b\".json".parse().unwrap();
        let given = Row { method: given, seconds: None, outside: 7, ..row() };
        let text = markdown(&request, &outcome(std::slice::from_ref(&given)));
        assert!(text.contains("| cameras:a\\|\"b\".json | 20 |") && text.contains("20.00 ± 0.30 | – |"), "{text}");
        assert!(text.contains("cup, \"red\", cameras:a|\"b\".json, 20 views (7 of 60)."), "{text}");
        assert!(super::csv(&request, &[given]).contains(",\"cameras:a|\"\"b\"\".json\",20,3,half,PSNR,20,0.5"));
    }

    /// If this failed, a table of rooms or pools would have columns that were not measured.
    #[test]
    fn a_kind_has_its_own_columns() {
        let one = Row { measured: row().measured.map(|all| all[..1].to_vec()), ..row() };
        let request = EvaluationRequest {
            seeds: 3,
            ..EvaluationRequest::quick(Kind::Pool, vec![Competitor::Method(Method::Ours)], vec![20])
        };
        let text = markdown(&request, &outcome(std::slice::from_ref(&one)));
        assert!(text.contains("| scene | method | views | held-out | choice, s |\n|---|---|---|---|---|\n"), "{text}");
        assert!(text.contains("| 20 | 20.00 ± 0.50 | 1.50 |") && text.contains("shrunk by 8"), "{text}");
        // The views of an object's three sets are explained, where these are the tests.
        assert!(!text.contains("half and full"), "{text}");
        assert!(
            description(&EvaluationRequest { kind: Kind::Object, ..request.clone() }, 0)
                .contains("half and full look at the centre")
        );
        let room = EvaluationRequest { kind: Kind::Room, ..request };
        assert!(csv(&room, std::slice::from_ref(&one)).contains(",20,3,random,PSNR,20,0.5"));
        // And where the user specifies viewers, one of its own.
        let up_to_eye_height = EvaluationRequest { viewers: Viewers::Heights { low: 0.0, high: 1.7 }, ..room };
        assert!(csv(&up_to_eye_height, &[one]).contains(",20,3,viewers,PSNR,20,0.5"));
    }
}

//! The tables of an evaluation, for people and for programs.

use std::fmt::Write;

use super::request::{Request, Shown};
use super::results::{COLUMNS, Interval, METRICS, Row};

/// Decimals of each metric.
const DECIMALS: [usize; 3] = [2, 4, 4];

/// A table for each metric, as Markdown.
pub fn markdown(request: &Request, rows: &[Row]) -> String {
    let settings = &request.settings;
    let shown = match settings.shown {
        Shown::Proxy => format!("a surface made from {} input photos", settings.inputs),
        Shown::True => format!("the scene's own mesh (`--surface true`), scored from {} input photos", settings.inputs),
    };
    let mut text = format!(
        "Methods chose on {shown}; pictures of {0} x {0} pixels with {1} samples, {2} iterations of training, at most {3} \
         splats, {4} test views a set, {5} seeds. Mean and half of the 95% interval over seeds (Student's t).\n",
        settings.size, settings.samples, settings.iterations, settings.max_splats, settings.tests, request.seeds
    );
    for (metric, name) in METRICS.iter().enumerate() {
        let arrow = if *name == "LPIPS" { "lower is better" } else { "higher is better" };
        // Writing to a string cannot fail.
        let _ = write!(text, "\n## {name} ({arrow})\n\n| scene | method | views |");
        COLUMNS.iter().for_each(|column| text += &format!(" {column} |"));
        text += " choice, s |\n|---|---|---|---|---|---|---|---|\n";
        for row in rows {
            let _ = write!(text, "| {} | {} | {} |", row.scene.replace('|', "\\|"), row.method, row.views);
            for measured in &row.measured[metric] {
                let cell = measured.map_or_else(|| "–".into(), |interval| cell(interval, DECIMALS[metric]));
                let _ = write!(text, " {cell} |");
            }
            let _ = writeln!(text, " {} |", cell(row.seconds, 2));
        }
    }
    text
}

/// A line for each scene, method, budget, set and metric.
pub fn csv(rows: &[Row]) -> String {
    let mut text = String::from("scene,method,views,seeds,set,metric,mean,half_interval_95\n");
    for row in rows {
        let scene = format!("\"{}\"", row.scene.replace('"', "\"\""));
        let mut line = |set: &str, metric: &str, interval: Option<Interval>| {
            let mean = interval.map_or_else(String::new, |interval| interval.mean.to_string());
            let half = interval.and_then(|interval| interval.half).map_or_else(String::new, |half| half.to_string());
            let _ = writeln!(text, "{scene},{},{},{},{set},{metric},{mean},{half}", row.method, row.views, row.seeds);
        };
        for (metric, columns) in METRICS.iter().zip(&row.measured) {
            for (set, measured) in COLUMNS.iter().zip(columns) {
                line(set, metric, *measured);
            }
        }
        line("", "choice_seconds", Some(row.seconds));
    }
    text
}

fn cell(Interval { mean, half }: Interval, decimals: usize) -> String {
    match half {
        Some(half) => format!("{mean:.decimals$} ± {half:.decimals$}"),
        None => format!("{mean:.decimals$}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::request::{Method, Settings};

    fn row() -> Row {
        let of = |mean, half| Some(Interval { mean, half });
        Row {
            scene: "cup, \"red\"".into(),
            method: Method::WithoutVds,
            views: 20,
            seeds: 3,
            seconds: Interval { mean: 1.5, half: None },
            measured: [
                [of(20.0, Some(0.5)), of(21.0, Some(0.25)), of(19.0, None), of(20.0, Some(0.3))],
                [of(0.81, Some(0.01)); 4],
                [None; 4],
            ],
        }
    }

    /// If this failed, numbers would stand under the wrong heads, or a missing one would look like a zero.
    #[test]
    fn known_numbers_stand_where_they_belong() {
        let request =
            Request { methods: vec![Method::WithoutVds], budgets: vec![20], seeds: 3, settings: Settings::QUICK };
        let text = markdown(&request, &[row()]);
        let line = "| cup, \"red\" | ours-no-vds | 20 | 20.00 ± 0.50 | 21.00 ± 0.25 | 19.00 | 20.00 ± 0.30 | 1.50 |";
        assert!(text.contains(line), "{text}");
        assert!(text.contains("| 20 | – | – | – | – | 1.50 |") && text.contains("10 input photos"), "{text}");
        let csv = csv(&[row()]);
        let lines: Vec<&str> = csv.lines().collect();
        assert_eq!(lines.len(), 1 + 3 * 4 + 1);
        assert_eq!(lines[1], "\"cup, \"\"red\"\"\",ours-no-vds,20,3,half,PSNR,20,0.5");
        assert!(lines[3].ends_with("random,PSNR,19,") && lines[9].ends_with("half,LPIPS,,"), "{csv}");
        assert!(lines[13].ends_with(",,choice_seconds,1.5,"));
    }
}

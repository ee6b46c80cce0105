//! What benchmarks make of their samples, and how two of their reports compare.
#![allow(dead_code, reason = "benches use the rest")]

use std::path::Path;

use camsplat::scene::random;
use report::arguments::Arguments;
use report::compare::{self, Change, Comparison, Verdict};
use report::document::{Amount, Document, Row};
use report::times::Times;

#[path = "../benches/report"]
mod report {
    pub mod arguments;
    pub mod compare;
    pub mod document;
    pub mod times;
}

const PEAKS: [f64; 2] = [10.0, 50.0];
const AMOUNT: Amount = Amount { count: 1000, bytes: 12_000, operations: 0 };

/// Nine batches of three samples as benches have them: a least time, delays above it of which most are small, and what a batch shares.
fn samples(seed: u64, least: f64, noise: f64, drift: f64) -> Times {
    let uniform = |stream: u32, i: u32| random::uniforms(seed, stream, i)[0];
    let delay = |i: u32| -noise * uniform(0, i).max(1e-9).ln();
    let batch = |b: u32| {
        let shared = 1.0 + drift * uniform(1, b);
        (3 * b..3 * b + 3).map(|i| least * shared * (1.0 + delay(i))).collect()
    };
    Times::new(&(0..9).map(batch).collect::<Vec<_>>())
}

fn row(name: &str, times: &Times) -> Row {
    Row::new(name, AMOUNT, times, PEAKS)
}

fn document(rows: Vec<Row>) -> Document {
    Document {
        bench: "primitives".into(),
        device: "a device".into(),
        driver: "a driver 1.0".into(),
        vulkan: "1.3.0".into(),
        commit: "0123456789ab".into(),
        shaders: "0123456789abcdef".into(),
        copy_gb_per_s: PEAKS[0],
        arithmetic_gflop_per_s: PEAKS[1],
        rows,
        facts: vec![serde_json::json!({ "name": "pairs", "value": 5 })],
    }
}

fn arguments(line: &str) -> camsplat::Result<Arguments> {
    Arguments::parse(line.split_whitespace().map(str::to_owned))
}

/// If this failed, a row's percentiles would be those of other samples, or its interval narrower than its noise.
#[test]
fn percentiles_and_intervals_are_those_of_the_samples() {
    let up_to = |count: u32| Times::apart((1..=count).rev().map(f64::from).collect());
    assert_eq!([0.0, 0.1, 0.5, 0.9, 1.0].map(|part| up_to(21).quantile(part)), [1.0, 3.0, 11.0, 19.0, 21.0]);
    assert_eq!(up_to(4).median(), 2.5);
    assert!(Times::apart(Vec::new()).median().is_nan());
    // Tables of the sign test.
    for (count, interval) in [
        (0, None),
        (5, None),
        (6, Some([1.0, 6.0])),
        (9, Some([2.0, 8.0])),
        (20, Some([6.0, 15.0])),
        (31, Some([10.0, 22.0])),
        (100, Some([40.0, 61.0])),
    ] {
        assert_eq!(up_to(count).median_interval(), interval, "{count} samples");
    }
    let batches = Times::new(&[vec![9.0, 1.0, 2.0], vec![5.0, 3.0], vec![6.0]]);
    assert_eq!((batches.count(), batches.batches(), batches.median(), batches.median_interval()), (6, 3, 4.0, None));
    let batches = Times::new(&vec![vec![9.0, 1.0, 2.0]; 6]);
    assert_eq!((batches.median(), batches.median_interval()), (2.0, Some([2.0, 2.0])));
    // The median of the shared part is half of the drift.
    let holds = |seed: &u64| {
        let [low, high] = samples(*seed, 1.0, 0.0, 1.0).median_interval().unwrap();
        (low..=high).contains(&1.5)
    };
    let held = (0..2000).filter(holds).count();
    assert!((1880..1960).contains(&held), "{held} of 2000 intervals hold the median");
}

/// If this failed, ratios to the peaks would mislead, or appear where nobody counted.
#[test]
fn rows_are_held_against_the_peaks() {
    let amount = Amount { count: 10, bytes: 1000, operations: 400 };
    let row = Row::new("scan", amount, &Times::apart(vec![200.0; 7]), PEAKS);
    assert_eq!((row.ratio_to_copy, row.ratio_to_arithmetic, row.samples), (Some(0.5), Some(0.04), 7));
    assert_eq!(row.to_string().len(), Row::HEADINGS.len());
    let row = Row::new("scan", Amount { bytes: 0, operations: 0, ..amount }, &Times::apart(vec![200.0]), PEAKS);
    assert_eq!((row.ratio_to_copy, row.ratio_to_arithmetic, row.ns_median_interval), (None, None, None));
}

/// If this failed, noise would count as a regression, or a regression as noise.
#[test]
fn a_row_is_slower_where_noise_cannot_explain_it() {
    let verdicts = |ratio: f64, factor: f64, [noise, drift]: [f64; 2]| -> Vec<Verdict> {
        let times = |seed: u64, least: f64| row("a", &samples(seed, least, noise, drift));
        let pair = |seed: u64| Change::new(&times(2 * seed, 100.0), &times(2 * seed + 1, 100.0 * ratio), factor);
        (0..1000).map(|seed| pair(seed).verdict).collect()
    };
    let count = |verdicts: &[Verdict], verdict| verdicts.iter().filter(|one| **one == verdict).count();
    // At the factor itself the interval errs on this side in 2.5% of cases.
    for noise in [[0.05, 0.0], [0.01, 0.1]] {
        let at_factor = verdicts(1.0, 1.0, noise);
        let wrong = [Verdict::Slower, Verdict::Faster].map(|verdict| count(&at_factor, verdict));
        assert!(wrong.iter().all(|wrong| *wrong < 40), "{wrong:?} of 1000 at {noise:?}");
    }
    let within = verdicts(1.0, 1.02, [0.02, 0.01]);
    assert!(count(&within, Verdict::Same) > 950 && count(&within, Verdict::Slower) == 0);
    assert!(count(&verdicts(1.1, 1.02, [0.02, 0.02]), Verdict::Slower) > 950);
    assert!(count(&verdicts(0.9, 1.02, [0.02, 0.02]), Verdict::Faster) > 950);
    let noisy = verdicts(1.1, 1.02, [1.0, 0.5]);
    assert!(count(&noisy, Verdict::Slower) < 50 && count(&noisy, Verdict::Unclear) > 500);
    let once = row("a", &Times::apart(vec![1.0]));
    assert_eq!(Change::new(&once, &row("a", &Times::apart(vec![9.0])), 1.02).verdict, Verdict::TooFewSamples);
}

/// If this failed, a comparison would leave rows out without a word, or count them wrongly.
#[test]
fn a_comparison_names_every_row() {
    let of = |least: f64| samples(1, least, 0.001, 0.0);
    let before = document(vec![row("scan", &of(100.0)), row("sort", &of(200.0)), row("gone", &of(1.0))]);
    let now = document(vec![row("scan", &of(150.0)), row("sort", &of(200.0)), row("fresh", &of(1.0))]);
    let compared = |before, now, line| Comparison::new(before, now, &arguments(line).unwrap());
    let Comparison { table, slower, disturbed } = compared(&before, &now, "").unwrap();
    let line = |name: &str| table.lines().find(|line| line.starts_with(name)).unwrap().to_owned();
    assert!(slower == 1 && !disturbed, "{table}");
    assert!(line("scan").ends_with(" slower") && line("scan").contains(" 1.500 "), "{table}");
    assert!(line("sort").ends_with(" same"), "{table}");
    assert!(line("fresh").contains("not in the report to compare with"), "{table}");
    assert!(line("gone").contains("only in the report to compare with"), "{table}");
    let Comparison { table, slower, .. } = compared(&before, &now, "--factor 1.6 sc").unwrap();
    assert!(slower == 0 && !table.contains("gone"), "{table}");
    assert_eq!(compared(&now, &now, "--factor 1").unwrap().slower, 0);
    assert!(compared(&document(vec![row("other", &of(1.0))]), &now, "").is_err());
}

/// If this failed, a busy device would count as slower code, or one with a faster clock hide slower code.
#[test]
fn rows_are_not_judged_where_the_device_is_not_what_it_was() {
    let of = |copy: f64| {
        document(vec![row("copy", &samples(1, copy, 0.001, 0.0)), row("scan", &samples(2, 10.0, 0.001, 0.0))])
    };
    for (copy, expected) in [(100.0, false), (110.0, true), (90.0, true)] {
        let Comparison { slower, disturbed, .. } =
            Comparison::new(&of(100.0), &of(copy), &arguments("").unwrap()).unwrap();
        assert_eq!((slower, disturbed), (0, expected));
    }
}

/// If this failed, times of two devices would be compared as if the code had changed.
#[test]
fn reports_of_other_devices_are_refused() {
    let here = document(Vec::new());
    assert!(compare::check(&document(Vec::new()), &here).is_ok());
    for (name, there) in [
        ("bench", Document { bench: "plan".into(), ..document(Vec::new()) }),
        ("device", Document { device: "another".into(), ..document(Vec::new()) }),
        ("driver", Document { driver: "a driver 1.1".into(), ..document(Vec::new()) }),
    ] {
        let refusal = compare::check(&there, &here).unwrap_err().to_string();
        assert!(refusal.contains(name), "{refusal}");
    }
}

/// If this failed, a report could not be compared with later, or another file would be taken for one.
#[test]
fn a_report_is_read_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("deep/report.json");
    let written = document(vec![row("scan", &samples(1, 100.0, 0.1, 0.0)), row("once", &Times::apart(vec![3.0]))]);
    written.write(&path).unwrap();
    let read = Document::read(&path).unwrap();
    assert_eq!(serde_json::to_value(&read).unwrap(), serde_json::to_value(&written).unwrap());
    std::fs::write(&path, "{}").unwrap();
    assert!(Document::read(&path).err().unwrap().to_string().contains("no report of these benchmarks"));
    assert!(Document::read(Path::new("absent.json")).is_err());
}

/// If this failed, a misspelt option would measure for minutes and compare nothing.
#[test]
fn arguments_are_those_of_the_page() {
    let plain = arguments("--bench").unwrap();
    assert!(plain == arguments("").unwrap() && plain.wants("scan", 5) && !plain.names("scan", 5));
    let all = arguments("scan --compare before.json --factor 1.1 --bench").unwrap();
    assert_eq!((all.compare, all.factor), (Some("before.json".into()), 1.1));
    let filtered = arguments("scan/65536").unwrap();
    assert!(filtered.names("scan", 65_536) && filtered.wants("scan", 65_536) && !filtered.wants("scan", 655_360));
    let filtered = arguments("sort").unwrap();
    assert!(filtered.wants("radix_sort_keys", 1) && !filtered.wants("scan", 1));
    for line in ["--compare", "--factor 0.5", "--factor x", "--factor inf", "--compared a", "one two"] {
        assert!(arguments(line).is_err(), "{line}");
    }
}

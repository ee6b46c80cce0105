//! Two reports of the same bench: which rows have become slower, and which differences may be noise.

use std::fmt::Write as _;

use camsplat::{Error, Result};

use super::arguments::Arguments;
use super::document::{Document, PEAKS, Row};

/// What a comparison says of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// By more than the factor, and so is the whole confidence interval.
    Slower,
    /// The same the other way.
    Faster,
    /// Within the factor.
    Same,
    /// Beyond the factor, but the confidence interval is not.
    Unclear,
    /// One of the reports has too few batches of samples for a confidence interval.
    TooFewSamples,
}

impl Verdict {
    fn name(self) -> &'static str {
        match self {
            Self::Slower => "slower",
            Self::Faster => "faster",
            Self::Same => "same",
            Self::Unclear => "unclear",
            Self::TooFewSamples => "too few samples",
        }
    }
}

/// How many times as long a row takes as before.
#[derive(Debug)]
pub struct Change {
    /// Of the medians.
    pub ratio: f64,
    /// The ratio's 95% confidence interval; none with too few samples.
    pub interval: Option<[f64; 2]>,
    /// What that means.
    pub verdict: Verdict,
}

impl Change {
    /// Compares a row with what it was.
    pub fn new(before: &Row, now: &Row, factor: f64) -> Self {
        let ratio = now.ns_median / before.ns_median;
        let interval = interval(before, now);
        let verdict = match interval {
            None => Verdict::TooFewSamples,
            Some([low, _]) if low > factor => Verdict::Slower,
            Some([_, high]) if high < 1.0 / factor => Verdict::Faster,
            _ if (1.0 / factor..=factor).contains(&ratio) => Verdict::Same,
            _ => Verdict::Unclear,
        };
        Self { ratio, interval, verdict }
    }
}

/// The interval of the ratio of two medians, from that of each: on either side the distances to their bounds add up in squares,
/// as logarithms (Zou and Donner 2008, "Construction of confidence limits about effect measures").
fn interval(before: &Row, now: &Row) -> Option<[f64; 2]> {
    let [before_low, before_high] = before.ns_median_interval?;
    let [now_low, now_high] = now.ns_median_interval?;
    let ratio = (now.ns_median / before.ns_median).ln();
    let below = (now.ns_median / now_low).ln().hypot((before_high / before.ns_median).ln());
    let above = (now_high / now.ns_median).ln().hypot((before.ns_median / before_low).ln());
    Some([(ratio - below).exp(), (ratio + above).exp()])
}

/// Holds that two reports can be compared: of one bench, on one device, by one driver.
///
/// # Errors
/// Where they cannot.
pub fn check(before: &Document, now: &Document) -> Result<()> {
    let kinds = [
        ("bench", &before.bench, &now.bench),
        ("device", &before.device, &now.device),
        ("driver", &before.driver, &now.driver),
    ];
    match kinds.iter().find(|(_, before, now)| before != now) {
        None => Ok(()),
        Some((kind, before, now)) => Err(Error::request(format!(
            "the report to compare with is of the {kind} {before:?}, this one of {now:?}; compare reports of the same {kind}"
        ))),
    }
}

/// What a comparison found.
pub struct Comparison {
    /// All rows of both reports that the filter leaves in.
    pub table: String,
    /// How many of the bench's rows are slower.
    pub slower: usize,
    /// Whether the device's peaks have changed: then rows would have with the same code.
    pub disturbed: bool,
}

impl Comparison {
    /// Compares row by row.
    ///
    /// # Errors
    /// Where the reports have no row in common.
    pub fn new(before: &Document, now: &Document, arguments: &Arguments) -> Result<Self> {
        let factor = arguments.factor;
        let mut table = format!(
            "compared with commit {}, shaders {}\n{:<33} {:>10} {:>11} {:>11} {:>6}  {:<16} verdict\n",
            before.commit, before.shaders, "name", "count", "before us", "now us", "ratio", "95% interval"
        );
        let (mut common, mut slower, mut disturbed) = (0, 0, false);
        for row in &now.rows {
            let _ = write!(table, "{:<33} {:>10} ", row.name, row.count);
            let Some(old) = before.find(row) else {
                let _ = writeln!(table, "not in the report to compare with");
                continue;
            };
            let Change { ratio, interval, verdict } = Change::new(old, row, factor);
            let interval = interval.map_or("-".into(), |[low, high]| format!("{low:.3} to {high:.3}"));
            let [us_before, us_now] = [old, row].map(|row| row.ns_median * 1e-3);
            let _ = writeln!(table, "{us_before:>11.1} {us_now:>11.1} {ratio:>6.3}  {interval:<16} {}", verdict.name());
            if PEAKS.contains(&row.name.as_str()) {
                disturbed |= matches!(verdict, Verdict::Slower | Verdict::Faster);
            } else {
                common += 1;
                slower += usize::from(verdict == Verdict::Slower);
            }
        }
        for row in before.rows.iter().filter(|row| arguments.wants(&row.name, row.count) && now.find(row).is_none()) {
            let _ = writeln!(table, "{:<33} {:>10} only in the report to compare with", row.name, row.count);
        }
        if common == 0 {
            return Err(Error::request("the two reports have no row in common; compare the same rows"));
        }
        let _ = writeln!(table, "{slower} of {common} rows are slower by more than a factor of {factor}");
        Ok(Self { table, slower, disturbed })
    }
}

//! A report as a file: where and of what it was measured, the device's peaks, and a row for each measurement.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use camsplat::{Error, Result};
use serde::{Deserialize, Serialize};

use super::times::Times;

/// The rows of what the device can do at best: a copy, and arithmetic in registers.
pub const PEAKS: [&str; 2] = ["copy", "arithmetic"];

/// What a bench writes.
#[derive(Serialize, Deserialize)]
pub struct Document {
    /// The bench's name.
    pub bench: String,
    /// The device's name.
    pub device: String,
    /// Name and version of its driver.
    pub driver: String,
    /// Vulkan's version on the device.
    pub vulkan: String,
    /// The source's commit; a plus after it marks changed files.
    pub commit: String,
    /// A hash of the compiled shaders.
    pub shaders: String,
    /// Bytes read and written per nanosecond by a large copy.
    pub copy_gb_per_s: f64,
    /// Floating-point operations per nanosecond of multiply-adds in registers.
    pub arithmetic_gflop_per_s: f64,
    /// Times.
    pub rows: Vec<Row>,
    /// Values other than times.
    pub facts: Vec<serde_json::Value>,
}

/// What one run of a row amounts to. Bytes and operations are the least that the work needs; zero where they are not counted.
#[derive(Clone, Copy)]
pub struct Amount {
    /// Elements.
    pub count: u64,
    /// Bytes read and written.
    pub bytes: u64,
    /// Arithmetic operations on floats or integers; a multiply-add is two.
    pub operations: u64,
}

/// The time of one measurement.
#[derive(Serialize, Deserialize)]
pub struct Row {
    /// What was measured.
    pub name: String,
    /// Elements.
    pub count: u64,
    /// A tenth of the samples is below it.
    pub ns_p10: f64,
    /// Half of the samples is below it.
    pub ns_median: f64,
    /// Nine tenths of the samples are below it.
    pub ns_p90: f64,
    /// The median's 95% confidence interval; absent with fewer than six batches.
    pub ns_median_interval: Option<[f64; 2]>,
    /// Samples, none of them of the warm-up.
    pub samples: usize,
    /// Batches that the samples were taken in.
    pub batches: usize,
    /// Bytes of [`Amount`].
    pub bytes: u64,
    /// Operations of [`Amount`].
    pub operations: u64,
    /// The bytes' rate over the copy's; absent where bytes are not counted.
    pub ratio_to_copy: Option<f64>,
    /// The operations' rate over that of multiply-adds; absent where operations are not counted.
    pub ratio_to_arithmetic: Option<f64>,
    /// Median time of each stage, all its runs in a sample together.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub stages_ns_median: BTreeMap<String, f64>,
    /// Wall time of one run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wall_seconds: Option<f64>,
}

impl Row {
    /// Without stages and wall time. `peaks` are bytes and operations per nanosecond.
    pub fn new(name: &str, amount: Amount, times: &Times, peaks: [f64; 2]) -> Self {
        let ns_median = times.median();
        let ratio = |amount: u64, peak: f64| (amount > 0).then(|| amount as f64 / ns_median / peak);
        Self {
            name: name.into(),
            count: amount.count,
            ns_p10: times.quantile(0.1),
            ns_median,
            ns_p90: times.quantile(0.9),
            ns_median_interval: times.median_interval(),
            samples: times.count(),
            batches: times.batches(),
            bytes: amount.bytes,
            operations: amount.operations,
            ratio_to_copy: ratio(amount.bytes, peaks[0]),
            ratio_to_arithmetic: ratio(amount.operations, peaks[1]),
            stages_ns_median: BTreeMap::new(),
            wall_seconds: None,
        }
    }

    /// The columns of a row as text; times are in microseconds, rates in millions of elements a second, and the last two are ratios
    /// to the peaks.
    pub const HEADINGS: &str = "name                                   count      p10 us   median us      p90 us        M/s    copy arithmetic";
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, count, ns_median, .. } = self;
        write!(f, "{name:<33} {count:>10}")?;
        for ns in [self.ns_p10, *ns_median, self.ns_p90] {
            write!(f, " {:>11.1}", ns * 1e-3)?;
        }
        let ratio = |ratio: Option<f64>| ratio.map_or("-".into(), |ratio| format!("{ratio:.3}"));
        let [copy, arithmetic] = [self.ratio_to_copy, self.ratio_to_arithmetic].map(ratio);
        write!(f, " {:>10.3} {copy:>7} {arithmetic:>10}", 1e3 * *count as f64 / ns_median)?;
        self.wall_seconds.map_or(Ok(()), |seconds| write!(f, "  wall {:.1} ms", seconds * 1e3))
    }
}

impl Document {
    /// Of copy and arithmetic, each a nanosecond.
    pub fn peaks(&self) -> [f64; 2] {
        [self.copy_gb_per_s, self.arithmetic_gflop_per_s]
    }

    /// The row of the same name and count as another.
    pub fn find(&self, other: &Row) -> Option<&Row> {
        self.rows.iter().find(|row| row.name == other.name && row.count == other.count)
    }

    /// Reads a file that [`Document::write`] wrote.
    ///
    /// # Errors
    /// Where it cannot be read or is no report.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, e))?;
        serde_json::from_str(&text)
            .map_err(|e| Error::input(path, format!("no report of these benchmarks ({e}); measure it again")))
    }

    /// Writes it, and its folder where there is none.
    ///
    /// # Errors
    /// Where the file system refuses.
    pub fn write(&self, path: &Path) -> Result<()> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        }
        let text = serde_json::to_string_pretty(self).map_err(|e| Error::input(path, e.to_string()))?;
        std::fs::write(path, text + "\n").map_err(|e| Error::io(path, e))
    }
}

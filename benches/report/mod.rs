//! What the benchmarks share: GPU time of a recording, and a report of rows on the terminal and as JSON.
//!
//! A row has a fixed number of samples after a warm-up, by the device's timestamps, and is held against two peaks of the device
//! that are measured first: of a copy, and of arithmetic. On a CPU device only ratios mean anything. The page on all this is
//! `docs/internals/benchmarks.md`.
//!
//! `CAMSPLAT_DEVICE` picks the device; `CAMSPLAT_BENCH_OUT` sets where the JSON goes.
#![allow(dead_code, unused_imports, reason = "each bench uses a part")]

mod arguments;
mod compare;
mod document;
mod job;
mod peaks;
mod times;

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use camsplat::engine::vulkan::{Context, ContextOptions};
use camsplat::{Error, Result};

use arguments::Arguments;
use compare::Comparison;
pub use document::Amount;
use document::{Document, PEAKS, Row};
pub use job::{Job, Sample};
pub use times::Times;

/// The device that the environment selects, or the best one.
pub fn context() -> Result<Arc<Context>> {
    Context::new(&ContextOptions { device: std::env::var("CAMSPLAT_DEVICE").ok(), ..ContextOptions::default() })
}

/// Runs a bench: the device's peaks, the bench's rows, and the comparison that the command line asks for. The exit code is 1 where a row
/// has become slower, and 2 where something could not be measured or compared.
pub fn run(bench: &str, rows: impl FnOnce(Arc<Context>, &mut Report) -> Result<()>) -> ExitCode {
    match count_slower(bench, rows) {
        Ok(slower) => ExitCode::from(u8::from(slower > 0)),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

/// Measures, writes and compares.
fn count_slower(bench: &str, rows: impl FnOnce(Arc<Context>, &mut Report) -> Result<()>) -> Result<usize> {
    let arguments = Arguments::parse(std::env::args().skip(1))?;
    let context = context()?;
    let document = header(bench, &context);
    let before = arguments.compare.as_deref().map(Document::read).transpose()?;
    // Now, not after minutes of measuring.
    before.as_ref().map_or(Ok(()), |before| compare::check(before, &document))?;
    let mut report = Report { arguments, document };
    report.measure_peaks(&context)?;
    rows(context, &mut report)?;
    let Report { arguments, document } = report;
    let path = std::env::var_os("CAMSPLAT_BENCH_OUT")
        .map_or_else(|| PathBuf::from(format!("target/bench/{bench}.json")), PathBuf::from);
    document.write(&path)?;
    println!("\n{}", path.display());
    let Some(before) = before else { return Ok(0) };
    let Comparison { table, slower, disturbed } = Comparison::new(&before, &document, &arguments)?;
    print!("\n{table}");
    if disturbed {
        let remedy = "measure both again on an otherwise idle device, or pass a greater --factor";
        return Err(Error::request(format!(
            "the device's peaks are not those of the report to compare with; {remedy}"
        )));
    }
    Ok(slower)
}

/// A report without rows, whose peaks are not measured yet.
fn header(bench: &str, context: &Context) -> Document {
    let physical = context.physical();
    let (major, minor, patch) = physical.api;
    let build = env!("CAMSPLAT_BUILD").trim_start_matches("commit ");
    let (commit, shaders) = build.split_once(", shaders ").unwrap_or((build, "unknown"));
    Document {
        bench: bench.into(),
        device: physical.name.clone(),
        driver: physical.driver.trim().into(),
        vulkan: format!("{major}.{minor}.{patch}"),
        commit: commit.into(),
        shaders: shaders.into(),
        copy_gb_per_s: f64::NAN,
        arithmetic_gflop_per_s: f64::NAN,
        rows: Vec::new(),
        facts: Vec::new(),
    }
}

/// Times of what [`Report::sampled`] measured.
pub struct Measured {
    /// Of whole samples.
    pub whole: Times,
    /// Of each stage.
    pub stages: BTreeMap<&'static str, Times>,
}

impl Measured {
    fn new(batches: &[Vec<Sample>]) -> Self {
        let times = |of: &dyn Fn(&Sample) -> Option<f64>| {
            let batches: Vec<Vec<f64>> = batches.iter().map(|batch| batch.iter().filter_map(of).collect()).collect();
            Times::new(&batches)
        };
        let names: BTreeSet<&str> = batches.iter().flatten().flat_map(|sample| sample.stages.keys().copied()).collect();
        let stages = names.into_iter().map(|name| (name, times(&|sample| sample.stages.get(name).copied())));
        Self { stages: stages.collect(), whole: times(&|sample| Some(sample.ns)) }
    }
}

/// Rows of one bench.
pub struct Report {
    arguments: Arguments,
    document: Document,
}

impl Report {
    /// Measures copy and arithmetic, prints where the report is from, and adds the two rows.
    fn measure_peaks(&mut self, context: &Arc<Context>) -> Result<()> {
        let (copied, copies) = peaks::copies(context)?;
        let (computed, multiply_adds) = peaks::multiply_adds(context)?;
        let [copies, multiply_adds] = [copies, multiply_adds].map(|batches| Measured::new(&batches));
        let document = &mut self.document;
        document.copy_gb_per_s = copied.bytes as f64 / copies.whole.median();
        document.arithmetic_gflop_per_s = computed.operations as f64 / multiply_adds.whole.median();
        let Document { bench, device, driver, vulkan, commit, shaders, .. } = document;
        println!("{bench} on {device}; {driver}; Vulkan {vulkan}\ncommit {commit}, shaders {shaders}");
        let [copy, arithmetic] = document.peaks();
        println!("peaks: copy {copy:.1} GB/s, arithmetic {arithmetic:.1} GFLOP/s\n\n{}", Row::HEADINGS);
        let [copy, arithmetic] = PEAKS;
        self.measured(copy, copied, &copies);
        self.measured(arithmetic, computed, &multiply_adds);
        Ok(())
    }

    /// Whether a filter leaves this row in, or there is none.
    pub fn wants(&self, name: &str, count: u64) -> bool {
        self.arguments.wants(name, count)
    }

    /// Whether there is a filter that leaves this row in.
    pub fn names(&self, name: &str, count: u64) -> bool {
        self.arguments.names(name, count)
    }

    /// Measures a job and adds its row, unless a filter leaves it out.
    pub fn row(&mut self, name: &str, amount: Amount, job: &mut Job) -> Result<()> {
        if self.wants(name, amount.count) {
            let measured = Measured::new(&job.sample()?);
            self.measured(name, amount, &measured);
        }
        Ok(())
    }

    /// Adds the row of what `run` measures so many times, with the device awake and for so long that each sample is a batch.
    pub fn sampled(
        &mut self,
        name: &str,
        amount: Amount,
        samples: usize,
        mut run: impl FnMut() -> Result<Sample>,
    ) -> Result<Measured> {
        let batches = (0..samples).map(|_| Ok(vec![run()?])).collect::<Result<Vec<_>>>()?;
        let measured = Measured::new(&batches);
        self.measured(name, amount, &measured);
        Ok(measured)
    }

    fn measured(&mut self, name: &str, amount: Amount, measured: &Measured) {
        let mut row = Row::new(name, amount, &measured.whole, self.document.peaks());
        row.stages_ns_median = measured.stages.iter().map(|(name, ns)| ((*name).into(), ns.median())).collect();
        self.add(row);
    }

    /// Adds the row of one stage of what [`Report::sampled`] measured.
    pub fn stage(&mut self, name: &str, stage: &str, amount: Amount, times: &Times) {
        self.add(Row::new(&format!("{name}/{stage}"), amount, times, self.document.peaks()));
    }

    /// Adds the row of whole runs, with the wall time of one.
    pub fn total(&mut self, name: &str, count: u64, gpu_ns: Vec<f64>, wall_seconds: f64) {
        let amount = Amount { count, bytes: 0, operations: 0 };
        let row = Row::new(name, amount, &Times::apart(gpu_ns), self.document.peaks());
        self.add(Row { wall_seconds: Some(wall_seconds), ..row });
    }

    /// Adds the row of a single run of which only the wall time is known.
    pub fn wall(&mut self, name: &str, count: u64, seconds: f64) {
        self.total(name, count, vec![1e9 * seconds], seconds);
    }

    fn add(&mut self, row: Row) {
        println!("{row}");
        self.document.rows.push(row);
    }

    /// Adds values other than times.
    pub fn facts(&mut self, facts: serde_json::Value) {
        self.document.facts.push(facts);
    }
}

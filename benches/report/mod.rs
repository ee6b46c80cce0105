//! What the benches share: GPU time of a recording, and a report of rows on the terminal and as JSON.
//!
//! Criterion decides how often a recording runs and keeps its statistics; times are the device's timestamps. Every row
//! is also held against the copy bandwidth of the device, measured first. On a CPU device only ratios mean anything.
//!
//! `CAMSPLAT_DEVICE` picks the device; `CAMSPLAT_BENCH_OUT` says where the JSON goes.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use camsplat::primitives::Copy;
use camsplat::vulkan::recorder::Timing;
use camsplat::vulkan::{Buffer, Context, Options, Recorder};
use camsplat::{Error, Result};
use criterion::{BenchmarkId, Criterion, SamplingMode, Throughput};

/// The device that the environment asks for, or the best one.
pub fn context() -> Result<Arc<Context>> {
    Context::new(&Options { device: std::env::var("CAMSPLAT_DEVICE").ok(), ..Options::default() })
}

/// A recording to measure, and one that brings back what it changes.
pub struct Job<'a> {
    restore: Recorder<'a>,
    work: Recorder<'a>,
}

impl<'a> Job<'a> {
    /// Records both; `work` takes at most `stages` stages, copies and fills.
    pub fn new(
        context: &Arc<Context>,
        stages: u32,
        restore: impl FnOnce(&mut Recorder<'a>),
        work: impl FnOnce(&mut Recorder<'a>) -> Result<()>,
    ) -> Result<Self> {
        let mut job = Self { restore: Recorder::new(context)?, work: Recorder::timed(context, stages)? };
        restore(&mut job.restore);
        work(&mut job.work)?;
        Ok(job)
    }

    /// Runs both and says when the work's stages ran.
    pub fn run(&mut self) -> Result<Vec<Timing>> {
        self.restore.submit_and_wait()?;
        self.work.submit_and_wait()?;
        self.work.timings()
    }
}

/// Nanoseconds from the start of the first stage to the end of the last.
fn span(timings: &[Timing]) -> f64 {
    timings.last().map_or(0.0, |last| last.end) - timings.first().map_or(0.0, |first| first.start)
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Median GPU time, in nanoseconds, of a recording of at most 64 stages that runs `samples` times.
pub fn measure<'a>(
    context: &Arc<Context>,
    samples: usize,
    work: impl FnOnce(&mut Recorder<'a>) -> Result<()>,
) -> Result<f64> {
    let mut job = Job::new(context, 64, |_| {}, work)?;
    let mut spans = (0..samples).map(|_| Ok(span(&job.run()?))).collect::<Result<Vec<_>>>()?;
    Ok(median(&mut spans))
}

/// What one run of a job amounts to.
#[derive(Clone, Copy)]
pub struct Amount {
    /// Elements.
    pub count: u64,
    /// Bytes read and written.
    pub bytes: u64,
    /// Operations, as the row's name counts them.
    pub operations: u64,
}

/// Keeps the device busy for a while: an idle GPU runs at a fraction of its clock and needs time to leave it.
fn wake(commands: &mut Recorder<'_>) -> Result<()> {
    let start = Instant::now();
    while start.elapsed() < Duration::from_millis(500) {
        for _ in 0..20 {
            commands.submit()?;
        }
        commands.wait()?;
    }
    Ok(())
}

/// Rows of one bench.
pub struct Report {
    criterion: Criterion,
    device: String,
    driver: String,
    /// Bytes read and written per nanosecond by a large copy.
    copy: f64,
    rows: Vec<serde_json::Value>,
}

impl Report {
    /// Measures the copy bandwidth and starts a report.
    pub fn new(context: &Arc<Context>) -> Result<Self> {
        let physical = context.physical();
        let bytes = (1 << 30).min(physical.storage_range / 2).min(context.memory_available() / 8) & !15;
        let from = Buffer::device(context, "copy source", bytes)?;
        let to = Buffer::device(context, "copy target", bytes)?;
        // Memory that was never written may not be there yet.
        let mut first = Recorder::new(context)?;
        first.fill(&from, 1);
        first.fill(&to, 1);
        first.submit_and_wait()?;
        let copy = Copy::new(context)?;
        let mut busy = Recorder::new(context)?;
        copy.record(&mut busy, &from, &to);
        wake(&mut busy)?;
        let ns = measure(context, 100, |recorder| {
            copy.record(recorder, &from, &to);
            Ok(())
        })?;
        let criterion = Criterion::default()
            .sample_size(20)
            .warm_up_time(Duration::from_millis(200))
            .measurement_time(Duration::from_millis(500))
            .configure_from_args();
        let bandwidth = 2.0 * bytes as f64 / ns;
        println!("{}, {}: copies {bandwidth:.1} GB/s", physical.name, physical.driver);
        Ok(Self {
            criterion,
            device: physical.name.clone(),
            driver: physical.driver.clone(),
            copy: bandwidth,
            rows: Vec::new(),
        })
    }

    /// Measures a job and adds its row, unless Criterion's filter leaves it out.
    pub fn row(&mut self, name: &str, amount: Amount, job: &mut Job<'_>) -> Result<()> {
        wake(&mut job.work)?;
        let mut spans = Vec::new();
        let mut stages: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        let mut failure = None;
        let mut run = || -> Result<f64> {
            let timings = job.run()?;
            let mut totals: BTreeMap<&str, f64> = BTreeMap::new();
            for timing in &timings {
                *totals.entry(timing.name).or_default() += timing.end - timing.start;
            }
            for (stage, total) in totals {
                stages.entry(stage).or_default().push(total);
            }
            spans.push(span(&timings));
            Ok(span(&timings))
        };
        let mut group = self.criterion.benchmark_group(name);
        group.throughput(Throughput::Elements(amount.count)).sampling_mode(SamplingMode::Flat);
        group.bench_function(BenchmarkId::from_parameter(amount.count), |bencher| {
            bencher.iter_custom(|iterations| {
                let mut total = 0.0;
                for _ in 0..iterations {
                    match run() {
                        Ok(ns) => total += ns,
                        Err(error) => failure = Some(error),
                    }
                }
                // Criterion divides by what it is told, and a failed run told nothing.
                Duration::from_nanos((total as u64).max(1))
            });
        });
        group.finish();
        if let Some(error) = failure {
            return Err(error);
        }
        if spans.is_empty() {
            return Ok(());
        }
        let samples = spans.len();
        let ns = median(&mut spans);
        let ratio = amount.bytes as f64 / ns / self.copy;
        println!(
            "{name} {}: {:.1} us, {:.3} G/s, {:.1} GB/s, {ratio:.3} of a copy",
            amount.count,
            ns * 1e-3,
            amount.count as f64 / ns,
            amount.bytes as f64 / ns,
        );
        let stages: BTreeMap<&str, f64> = stages.iter_mut().map(|(stage, ns)| (*stage, median(ns))).collect();
        self.rows.push(serde_json::json!({
            "name": name, "count": amount.count, "ns_median": ns, "bytes": amount.bytes,
            "operations": amount.operations, "ratio_to_copy": ratio, "samples": samples, "stages_ns_median": stages,
        }));
        Ok(())
    }

    /// Adds a row of a whole run, timed `totals` times in nanoseconds of GPU time, with the wall time of one run.
    #[allow(dead_code, reason = "only one of the benches has whole runs")]
    pub fn total(&mut self, name: &str, count: u64, totals: &mut [f64], wall_seconds: f64) {
        let ns = median(totals);
        println!("{name}: {:.2} ms of GPU time, {:.1} ms of wall time", ns * 1e-6, wall_seconds * 1e3);
        self.rows.push(serde_json::json!({
            "name": name, "count": count, "ns_median": ns, "samples": totals.len(), "wall_seconds": wall_seconds,
        }));
    }

    /// Ends the report: Criterion's summary, and the rows as JSON in `CAMSPLAT_BENCH_OUT` or `target/bench/<bench>.json`.
    pub fn finish(self, bench: &str) -> Result<()> {
        self.criterion.final_summary();
        let path = std::env::var_os("CAMSPLAT_BENCH_OUT")
            .map_or_else(|| PathBuf::from(format!("target/bench/{bench}.json")), PathBuf::from);
        let report = serde_json::json!({
            "device": self.device, "driver": self.driver, "copy_gb_per_s": self.copy, "rows": self.rows,
        });
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        }
        std::fs::write(&path, format!("{report:#}\n")).map_err(|e| Error::io(&path, e))?;
        println!("{}", path.display());
        Ok(())
    }
}

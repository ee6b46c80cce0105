//! What the benchmarks share: GPU time of a recording, and a report of rows on the terminal and as JSON.
//!
//! Criterion decides how often a recording runs and keeps its statistics; times are the device's timestamps. Every row is also
//! compared with the copy bandwidth of the device, measured first. On a CPU device only ratios mean anything.
//!
//! `CAMSPLAT_DEVICE` picks the device; `CAMSPLAT_BENCH_OUT` sets where the JSON goes.
#![allow(dead_code, reason = "each bench uses a part")]

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use camsplat::primitives::Copy;
use camsplat::vulkan::recorder::Timing;
use camsplat::vulkan::{Buffer, Context, Options, Recorder};
use camsplat::{Error, Result};
use criterion::{BenchmarkId, Criterion, SamplingMode, Throughput};

/// The device that the environment selects, or the best one.
pub fn context() -> Result<Arc<Context>> {
    Context::new(&Options { device: std::env::var("CAMSPLAT_DEVICE").ok(), ..Options::default() })
}

/// A recording to measure, and one that brings back what it changes.
pub struct Job<'a> {
    restore: Recorder,
    work: Recorder,
}

impl<'a> Job<'a> {
    /// Records both; `work` takes at most `stages` stages, copies and fills.
    pub fn new(
        context: &Arc<Context>,
        stages: u32,
        restore: impl FnOnce(&mut Recorder),
        work: impl FnOnce(&mut Recorder) -> Result<()>,
    ) -> Result<Self> {
        let mut job = Self { restore: Recorder::new(context)?, work: Recorder::timed(context, stages)? };
        restore(&mut job.restore);
        work(&mut job.work)?;
        Ok(job)
    }

    /// Runs both and returns when the work's stages ran.
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
    work: impl FnOnce(&mut Recorder) -> Result<()>,
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

/// GPU time of what a row measures, in nanoseconds.
pub struct Sample {
    /// From the first stage's start to the last one's end.
    pub ns: f64,
    /// Of each stage, all its runs together.
    pub stages: BTreeMap<&'static str, f64>,
}

impl Sample {
    fn new(timings: &[Timing]) -> Self {
        let mut stages: BTreeMap<&'static str, f64> = BTreeMap::new();
        for timing in timings {
            *stages.entry(timing.name).or_default() += timing.end - timing.start;
        }
        Self { ns: span(timings), stages }
    }
}

/// Keeps the device busy for a while: an idle GPU runs at a fraction of its clock and needs time to leave it.
fn wake(commands: &mut Recorder) -> Result<()> {
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
        self.sampled(name, amount, || Ok(Sample::new(&job.run()?))).map(|_| ())
    }

    /// Adds the row of what `run` measures and answers its medians; none where Criterion's filter leaves it out.
    pub fn sampled(
        &mut self,
        name: &str,
        amount: Amount,
        mut run: impl FnMut() -> Result<Sample>,
    ) -> Result<Option<Sample>> {
        let mut samples = Vec::new();
        let mut failure = None;
        let mut group = self.criterion.benchmark_group(name);
        group.throughput(Throughput::Elements(amount.count)).sampling_mode(SamplingMode::Flat);
        group.bench_function(BenchmarkId::from_parameter(amount.count), |bencher| {
            bencher.iter_custom(|iterations| {
                let mut total = 0.0;
                for _ in 0..iterations {
                    match run() {
                        Ok(sample) => {
                            total += sample.ns;
                            samples.push(sample);
                        }
                        Err(error) => failure = Some(error),
                    }
                }
                // Criterion divides by this duration, which is zero for a failed run.
                Duration::from_nanos((total as u64).max(1))
            });
        });
        group.finish();
        if let Some(error) = failure {
            return Err(error);
        }
        if samples.is_empty() {
            return Ok(None);
        }
        let mut spans: Vec<f64> = samples.iter().map(|sample| sample.ns).collect();
        let mut stages: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
        for (stage, ns) in samples.iter().flat_map(|sample| &sample.stages) {
            stages.entry(stage).or_default().push(*ns);
        }
        let ns = median(&mut spans);
        let stages = stages.into_iter().map(|(stage, mut ns)| (stage, median(&mut ns))).collect();
        let medians = Sample { ns, stages };
        let ratio = amount.bytes as f64 / ns / self.copy;
        println!(
            "{name} {}: {:.1} us, {:.3} G/s, {:.1} GB/s, {ratio:.3} of a copy",
            amount.count,
            ns * 1e-3,
            amount.count as f64 / ns,
            amount.bytes as f64 / ns,
        );
        self.rows.push(serde_json::json!({
            "name": name, "count": amount.count, "ns_median": ns, "bytes": amount.bytes,
            "operations": amount.operations, "ratio_to_copy": ratio, "samples": samples.len(),
            "stages_ns_median": medians.stages,
        }));
        Ok(Some(medians))
    }

    /// Adds the row of one stage of what [`Report::sampled`] measured; `share` is its part of all stages' time.
    pub fn stage(&mut self, name: &str, stage: &str, amount: Amount, ns: f64, share: f64) {
        let ratio = amount.bytes as f64 / ns / self.copy;
        let against = if amount.bytes > 0 { format!("{ratio:>8.3} of a copy") } else { String::new() };
        println!("  {stage:<20} {:>12.1} us {:>6.1}% {against}", ns * 1e-3, 100.0 * share);
        self.rows.push(serde_json::json!({
            "name": format!("{name}/{stage}"), "count": amount.count, "ns_median": ns, "bytes": amount.bytes,
            "ratio_to_copy": ratio, "share": share,
        }));
    }

    /// Adds a row of a whole run, timed `totals` times in nanoseconds of GPU time, with the wall time of one run.
    pub fn total(&mut self, name: &str, count: u64, totals: &mut [f64], wall_seconds: f64) {
        let ns = median(totals);
        println!("{name}: {:.2} ms of GPU time, {:.1} ms of wall time", ns * 1e-6, wall_seconds * 1e3);
        self.rows.push(serde_json::json!({
            "name": name, "count": count, "ns_median": ns, "samples": totals.len(), "wall_seconds": wall_seconds,
        }));
    }

    /// Adds a value other than a time.
    pub fn facts(&mut self, row: serde_json::Value) {
        self.rows.push(row);
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

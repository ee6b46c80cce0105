//! What is measured: a recording whose stages the device times.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use camsplat::Result;
use camsplat::engine::vulkan::recorder::Timing;
use camsplat::engine::vulkan::{Context, Recorder};

/// How long the device is kept busy before a job's first batch of samples,
const WARM_UP: Duration = Duration::from_millis(500);
/// and before each other: what drifts should have time to.
const BETWEEN: Duration = Duration::from_millis(250);
/// Batches of samples. With nine of them, the second and the eighth median bound a 95% confidence interval.
const BATCHES: usize = 9;
/// Samples of a batch.
const BATCH: usize = 3;

/// A recording to measure, and one that brings back what it changes.
pub struct Job {
    restore: Recorder,
    work: Recorder,
}

impl Job {
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

    /// Times runs in batches.
    pub fn sample(&mut self) -> Result<Vec<Vec<Sample>>> {
        let mut batches = Vec::new();
        for batch in 0..BATCHES {
            self.keep_busy(if batch == 0 { WARM_UP } else { BETWEEN })?;
            batches.push((0..BATCH).map(|_| Ok(Sample::new(&self.run()?))).collect::<Result<_>>()?);
        }
        Ok(batches)
    }

    /// An idle GPU runs at a fraction of its clock and needs time to leave it.
    fn keep_busy(&mut self, time: Duration) -> Result<()> {
        let start = Instant::now();
        // Many submissions at a time leave no pauses between short recordings; long ones begin with a single submission.
        let mut submissions = 1;
        while start.elapsed() < time {
            for _ in 0..submissions {
                self.work.submit()?;
            }
            self.work.wait()?;
            submissions = 20.min(2 * submissions);
        }
        Ok(())
    }
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
        let ns = timings.last().map_or(0.0, |last| last.end) - timings.first().map_or(0.0, |first| first.start);
        Self { ns, stages }
    }
}

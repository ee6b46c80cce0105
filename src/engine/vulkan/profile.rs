//! What ran when: a table of GPU time per stage, and a trace that Perfetto and Chromium's tracing page open.

use std::time::Instant;

use super::recorder::Timing;

/// Spans of host and device time, gathered while a command runs.
pub struct Profile {
    origin: Instant,
    host: Vec<(String, f64, f64)>,
    device: Vec<(&'static str, f64, f64)>,
    gpu_ns: f64,
}

impl Default for Profile {
    fn default() -> Self {
        Self { origin: Instant::now(), host: Vec::new(), device: Vec::new(), gpu_ns: 0.0 }
    }
}

/// One row of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The stage's name: that of its shader file.
    pub name: &'static str,
    /// Times that it ran.
    pub runs: usize,
    /// All its GPU time, milliseconds.
    pub total_ms: f64,
    /// Median GPU time of a run, microseconds.
    pub median_us: f64,
}

impl Profile {
    /// Adds a span of host time that began at `start` and ends now.
    pub fn host(&mut self, name: &str, start: Instant) {
        let from = start.duration_since(self.origin).as_secs_f64() * 1e6;
        self.host.push((name.to_owned(), from, self.origin.elapsed().as_secs_f64() * 1e6));
    }

    /// Adds the stages of a submission that was made at `submitted`. Device and host clocks are not synchronised: the
    /// first stage is taken to start when its submission was made.
    pub fn device(&mut self, submitted: Instant, timings: &[Timing]) {
        let offset = submitted.duration_since(self.origin).as_secs_f64() * 1e6;
        self.device.extend(timings.iter().map(|t| (t.name, offset + t.start * 1e-3, offset + t.end * 1e-3)));
        if let (Some(first), Some(last)) = (timings.first(), timings.last()) {
            self.gpu_ns += last.end - first.start;
        }
    }

    /// GPU time of all submissions, with the gaps between their stages but not those between submissions, milliseconds.
    pub fn gpu_ms(&self) -> f64 {
        self.gpu_ns * 1e-6
    }

    /// GPU time per stage, longest first.
    pub fn rows(&self) -> Vec<Row> {
        let mut names: Vec<&'static str> = self.device.iter().map(|span| span.0).collect();
        names.sort_unstable();
        names.dedup();
        let mut rows: Vec<Row> = names
            .into_iter()
            .map(|name| {
                let spans = self.device.iter().filter(|span| span.0 == name);
                let mut times: Vec<f64> = spans.map(|span| span.2 - span.1).collect();
                times.sort_unstable_by(f64::total_cmp);
                Row {
                    name,
                    runs: times.len(),
                    total_ms: times.iter().sum::<f64>() * 1e-3,
                    median_us: times[times.len() / 2],
                }
            })
            .collect();
        rows.sort_by(|a, b| b.total_ms.total_cmp(&a.total_ms));
        rows
    }

    /// The table as text.
    pub fn table(&self) -> String {
        let rows = self.rows();
        let all: f64 = rows.iter().map(|row| row.total_ms).sum();
        let mut text = format!("{:<24} {:>8} {:>12} {:>12} {:>7}\n", "stage", "runs", "total ms", "median us", "share");
        for row in rows {
            text += &format!(
                "{:<24} {:>8} {:>12.3} {:>12.2} {:>6.1}%\n",
                row.name,
                row.runs,
                row.total_ms,
                row.median_us,
                100.0 * row.total_ms / all.max(f64::MIN_POSITIVE)
            );
        }
        text += &format!("{:<24} {:>8} {:>12.3}\n", "all stages", "", all);
        text
    }

    /// The spans in the JSON trace-event format.
    pub fn trace(&self) -> String {
        let span = |name: &str, track: u32, from: f64, to: f64| serde_json::json!({"name": name, "ph": "X", "pid": 1, "tid": track, "ts": from, "dur": to - from});
        let title = |track: u32, name: &str| serde_json::json!({"name": "thread_name", "ph": "M", "pid": 1, "tid": track, "args": {"name": name}});
        let mut events = vec![title(1, "host"), title(2, "device")];
        events.extend(self.host.iter().map(|(name, from, to)| span(name, 1, *from, *to)));
        events.extend(self.device.iter().map(|(name, from, to)| span(name, 2, *from, *to)));
        serde_json::json!({"traceEvents": events, "displayTimeUnit": "ms"}).to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computed directly. If this failed, the benchmarks would attribute the host's gaps to the device, or leave out the device's own.
    #[test]
    fn gpu_time_has_the_gaps_within_submissions_only() {
        let mut profile = Profile::default();
        let timing = |start, end| Timing { name: "stage", start, end };
        for timings in [&[timing(0.0, 1e6), timing(3e6, 4e6)][..], &[timing(7e6, 9e6)], &[]] {
            profile.device(Instant::now(), timings);
        }
        assert!((profile.gpu_ms() - 6.0).abs() < 1e-9);
        assert!((profile.rows()[0].total_ms - 4.0).abs() < 1e-9);
    }
}

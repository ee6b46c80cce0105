//! What the samples of a row say of its time.

/// Times of the same work in nanoseconds. Samples of a batch directly follow one another and share what drifts: clocks, temperature, other
/// programs. Noise is therefore judged by batches.
pub struct Times {
    samples: Vec<f64>,
    // Medians of the batches; both are sorted.
    batches: Vec<f64>,
}

impl Times {
    /// Of batches.
    pub fn new(batches: &[Vec<f64>]) -> Self {
        let medians = batches.iter().map(|batch| quantile(&sorted(batch.clone()), 0.5)).collect();
        Self { samples: sorted(batches.concat()), batches: sorted(medians) }
    }

    /// Of samples that lie apart: each is a batch.
    pub fn apart(samples: Vec<f64>) -> Self {
        let samples = sorted(samples);
        Self { batches: samples.clone(), samples }
    }

    /// How many samples there are.
    pub fn count(&self) -> usize {
        self.samples.len()
    }

    /// How many batches there are.
    pub fn batches(&self) -> usize {
        self.batches.len()
    }

    /// The value that a part of the samples is below, interpolated between neighbours; not a number where there are none.
    pub fn quantile(&self, part: f64) -> f64 {
        quantile(&self.samples, part)
    }

    /// Half of the samples are below it.
    pub fn median(&self) -> f64 {
        self.quantile(0.5)
    }

    /// A 95% confidence interval of the median: medians of two batches, whatever their distribution is. With fewer than six batches
    /// there is none.
    pub fn median_interval(&self) -> Option<[f64; 2]> {
        let count = self.batches.len();
        // So many batches are below the true median with a binomial probability, since each is with one of 1/2.
        let mut probability = 0.5f64.powi(count as i32);
        let mut outside = 0.0;
        let mut skipped = 0;
        while outside + probability <= 0.025 && skipped < count {
            outside += probability;
            probability *= (count - skipped) as f64 / (skipped + 1) as f64;
            skipped += 1;
        }
        let first = skipped.checked_sub(1)?;
        Some([self.batches[first], self.batches[count - 1 - first]])
    }
}

fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values
}

fn quantile(sorted: &[f64], part: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = part * last as f64;
    let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    below + place.fract() * (above - below)
}

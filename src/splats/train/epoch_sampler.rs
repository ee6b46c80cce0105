//! The order in which training looks at photos.

use crate::scene::random;

const VIEW_STREAM: u32 = 0x4600_0000;

/// Which photo an iteration looks at: every photo once, in another order in each epoch.
pub(super) struct EpochSampler {
    seed: u64,
    photos: u32,
    round: Option<u32>,
    order: Vec<u32>,
}

impl EpochSampler {
    /// A sampler over so many photos.
    pub fn new(seed: u64, photos: u32) -> Self {
        Self { seed, photos, round: None, order: Vec::new() }
    }

    /// The photo of an iteration.
    pub fn photo(&mut self, iteration: u32) -> u32 {
        let round = iteration / self.photos;
        if self.round != Some(round) {
            self.order = (0..self.photos).collect();
            random::shuffle(&mut self.order, self.seed, VIEW_STREAM + round);
            self.round = Some(round);
        }
        self.order[(iteration % self.photos) as usize]
    }
}

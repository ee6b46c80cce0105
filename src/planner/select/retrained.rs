//! FisherRF as published (Jiang, Lei and Daniilidis 2024): the model is trained on the views that have been chosen, and further
//! with each new one. On one fixed model it is [`super::information::fisher`].

use std::ops::ControlFlow;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::information;
use super::pool::Pool;
use crate::engine::vulkan::Context;
use crate::files::photos::{Photo, PhotoSet};
use crate::scene::proxy::Proxy;
use crate::scene::surface::Points;
use crate::splats::config::{Background, Start, Strategy, TrainConfig};
use crate::splats::data::pictures;
use crate::splats::data::start;
use crate::splats::data::store::PhotoStore;
use crate::splats::render::frame::Frame;
use crate::splats::train::trainer::Trainer;
use crate::splats::uncertainty::fisher::Fisher;
use crate::{Error, Result};

/// Points of the surface that training starts from at most, and the stream that they are drawn from.
const POINTS: u32 = 20_000;
const POINT_STREAM: u32 = 0x5045_0002;

/// Most iterations, as in any training.
const MAX_ITERATIONS: u32 = 10_000_000;

/// Takes a photograph: the photo that is given, with an image; [`Error::Interrupted`] where the user stops.
pub type Photograph<'p> = &'p mut dyn FnMut(&Photo) -> Result<Photo>;

/// How to train and to choose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RetrainingSettings {
    /// Added to what is known of each parameter.
    pub lambda: f32,
    /// Views by farthest view sampling to begin with, where there are none.
    pub first: u32,
    /// Iterations before the next view is chosen, for each view that there is.
    pub every: u32,
    /// Most splats.
    pub max_splats: u32,
    /// Each pixel of the pictures is a square of so many of the photos'.
    pub shrink: u32,
    /// What lies behind everything.
    pub background: Background,
    /// Whether the model is trained and rendered with the antialiasing filter.
    pub antialiased: bool,
}

impl Default for RetrainingSettings {
    fn default() -> Self {
        let information::InformationSettings { lambda, first, .. } = information::InformationSettings::default();
        Self {
            lambda,
            first,
            every: 100,
            max_splats: 200_000,
            shrink: 1,
            background: Background::Black,
            antialiased: false,
        }
    }
}

impl RetrainingSettings {
    /// Iterations until the last of `views` is chosen, where `begin` of them are there at first.
    pub fn iterations(&self, begin: u32, views: u32) -> u32 {
        (begin..views).fold(0, |sum, views| views.saturating_mul(self.every).saturating_add(sum))
    }

    /// The same with as many iterations for each view as leave the choice of `views` within `iterations` in all, at least one
    /// and at most as before.
    pub fn within(self, iterations: u32, views: u32) -> Self {
        let once = Self { every: 1, ..self }.iterations(self.first, views).max(1);
        Self { every: (iterations / once).clamp(1, self.every.max(1)), ..self }
    }

    /// Rejects invalid settings.
    ///
    /// # Errors
    /// In a line that names the option.
    pub fn validate(&self) -> Result<()> {
        let limits = [
            ("`train_every`", self.every, 1, 100_000),
            ("`max_splats`", self.max_splats, 1, 1 << 26),
            ("`shrink`", self.shrink, 1, 64),
        ];
        match limits.into_iter().find(|(_, value, low, high)| !(low..=high).contains(&value)) {
            Some((name, value, low, high)) => Err(Error::request(format!("{name} is {value}; give {low} to {high}"))),
            None => Ok(()),
        }
    }
}

/// After the photos that are chosen in any case, or else a few by farthest view sampling, always the one whose Fisher
/// information about the model is largest beside that of those chosen; the model is trained on these, from points of the
/// surface on, with `every` iterations for each of them before the next is chosen.
///
/// # Errors
/// A photo that cannot be taken or read, or a device that fails or has not enough memory.
pub fn fisher(
    context: &Arc<Context>,
    pool: &Pool<'_>,
    proxy: &Proxy,
    settings: RetrainingSettings,
    photograph: Photograph<'_>,
) -> Result<Vec<usize>> {
    settings.validate()?;
    let mut chosen = information::beginning(pool, settings.first);
    let iterations = settings.iterations(chosen.len() as u32, pool.count as u32);
    if iterations == 0 {
        return Ok(chosen);
    }
    if iterations > MAX_ITERATIONS {
        let (every, count) = (settings.every, pool.count);
        let what = format!("`train_every` {every} makes {iterations} iterations for {count} views");
        return Err(Error::request(format!("{what}; give less, for at most {MAX_ITERATIONS}")));
    }
    let RetrainingSettings { background, antialiased, .. } = settings;
    let config =
        TrainConfig { seed: pool.seed, background, antialiased, ..TrainConfig::new(iterations, settings.max_splats) }
            .with_strategy(Strategy::Mcmc, Start::Points);
    let mut trainer = trainer(context, pool, proxy, config, settings.shrink)?;
    let mut fisher = Fisher::of_training(context, &trainer, settings.lambda)?;
    for view in &chosen {
        add(&mut trainer, pool, *view, settings.shrink, photograph)?;
    }
    loop {
        let until = trainer.done() + settings.every * chosen.len() as u32;
        trainer.run(until, None, |_| ControlFlow::Continue(()))?;
        fisher.renew(&trainer)?;
        for view in &chosen {
            fisher.learn(*view)?;
        }
        let mut best: Option<(usize, f64)> = None;
        for view in pool.allowed.iter().copied().filter(|view| !chosen.contains(view)) {
            // NaN counts as least.
            let worth = fisher.worth(view)?.max(f64::NEG_INFINITY);
            if best.is_none_or(|(_, most)| worth > most) {
                best = Some((view, worth));
            }
        }
        let Some((view, _)) = best else { return Ok(chosen) };
        chosen.push(view);
        if chosen.len() == pool.count {
            return Ok(chosen);
        }
        add(&mut trainer, pool, view, settings.shrink, photograph)?;
    }
}

/// A trainer with the views of all photos of the pool and no picture of any.
fn trainer(
    context: &Arc<Context>,
    pool: &Pool<'_>,
    proxy: &Proxy,
    config: TrainConfig,
    shrink: u32,
) -> Result<Trainer> {
    let cameras = pictures::cameras(&pool.set.photos, shrink);
    let count = POINTS.min(config.max_splats) as usize;
    let positions = proxy.sample(count, config.seed, POINT_STREAM).into_iter().map(|point| point.position).collect();
    let set = PhotoSet { points: Points { positions, ..Points::default() }, ..PhotoSet::default() };
    let frame = Frame::new(&cameras, &set.points.positions);
    let start = start::start(&set, &frame, &start::StartSettings::from(&config))?;
    let views = cameras.iter().map(|camera| frame.view(camera)).collect();
    // Half of what is free, as in any training.
    let store = PhotoStore::new(context, context.memory_available() / 2);
    Trainer::new(context, config, &start, views, store)
}

/// Takes a photograph and trains on it from now on.
fn add(trainer: &mut Trainer, pool: &Pool<'_>, view: usize, shrink: u32, photograph: Photograph<'_>) -> Result<()> {
    let photo = photograph(&pool.set.photos[view])?;
    let settings = pictures::PictureSettings { shrink, ..pictures::PictureSettings::default() };
    for picture in pictures::pictures(&[photo], &settings)? {
        trainer.add_photo(view as u32, &picture?.pixels)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computed directly. If this failed, a run would train longer than requested, or not as published.
    #[test]
    fn iterations_are_a_hundred_for_each_view_or_what_the_limit_leaves() {
        let published = RetrainingSettings::default();
        // 100 (4 + 5 + ... + 19), as in the published schedule of 20 views.
        assert_eq!(published.iterations(4, 20), 18_400);
        assert_eq!(published.within(1_000_000, 20), published);
        let short = published.within(10_000, 100);
        assert_eq!((short.every, short.iterations(4, 100)), (2, 9888));
        assert_eq!(published.within(10, 100).every, 1);
        assert_eq!(published.iterations(4, 4), 0);
    }
}

//! The configuration of a training run.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::files::photos::PhotoSet;
use crate::scene::gaussians::MAX_DEGREE;
use crate::{Error, Result};

/// How the number of Gaussians changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Strategy {
    /// A hard budget: dead Gaussians move to where living ones are (3DGS-MCMC).
    Mcmc,
    /// Adaptive density control: clone, split and prune by gradients (3DGS).
    Adc,
}

/// What a run's number of iterations is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Preset {
    /// The 30000 iterations of the papers.
    Full,
    /// 7000 iterations: about a quarter of the time.
    Fast,
}

impl Preset {
    /// Iterations of a training with the preset.
    pub fn iterations(self) -> u32 {
        match self {
            Self::Full => 30_000,
            Self::Fast => 7000,
        }
    }
}

/// Where the Gaussians of a run lie at its start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Anywhere in the scene.
    Random,
    /// At points of surfaces.
    Points,
    /// At points of surfaces whose normals are known: flat on the surface.
    Surface,
}

impl Start {
    /// What a capture gives.
    pub fn of(set: &PhotoSet) -> Self {
        match set.points.normals.iter().any(|normal| *normal != DVec3::ZERO) {
            _ if !set.has_surface_points() => Self::Random,
            true => Self::Surface,
            false => Self::Points,
        }
    }
}

/// What lies behind all splats.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Background {
    /// Black.
    Black,
    /// White.
    White,
    /// A new colour in every iteration; test views are rendered on black.
    Random,
}

/// What masks, or alpha channels, say of what they leave out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Masks {
    /// It is background: no splats are to be there.
    #[default]
    Background,
    /// Nothing: passers-by, the own shadow, a tripod; the photo counts for nothing there.
    Ignore,
}

/// Configuration of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainConfig {
    /// Iterations of the training, a picture each.
    pub iterations: u32,
    /// Most Gaussians.
    pub max_splats: u32,
    /// How their number changes.
    pub strategy: Strategy,
    /// Degree of the harmonics, 0 to 3.
    pub degree: u32,
    /// What lies behind all splats.
    pub background: Background,
    /// Opacities reduced by what the low-pass widens.
    pub antialiased: bool,
    /// Opacities and sizes held down by more than usual, above all at first (MCMC).
    #[serde(default)]
    pub suppress_floaters: bool,
    /// An exposure and white balance is learnt for each photo.
    #[serde(default)]
    pub exposure: bool,
    /// The pose of each photo is corrected.
    #[serde(default)]
    pub refine_poses: bool,
    /// What masks mean.
    #[serde(default)]
    pub masks: Masks,
    /// Gradients summed by atomic additions of floats: no two runs are the same.
    pub fast: bool,
    /// Seed of every random draw.
    pub seed: u64,
    /// Opacity at the start.
    pub init_opacity: f64,
    /// Standard deviation at the start, in mean distances to the nearest neighbours.
    pub init_scale: f64,
}

/// Iterations from which small Gaussians have the time to spread: from the few points of a reconstruction, and from many random
/// places.
const LONG: [u32; 2] = [10_000, 1_000];
/// Opacity up to which a Gaussian is dead.
pub const MIN_OPACITY: f32 = 0.005;
/// Iterations between two steps of the harmonics but for the constant one, which are three quarters of all parameters; their rate is
/// as much higher.
pub(super) const HARMONICS_EVERY: u32 = 2;
/// Runs of at least so many iterations end with falling rates. The papers let that of the centres fall alone: the other parameters
/// then jitter about their best values until the last iteration, which costs 0.15 to 0.2 dB. Shorter runs need every step
/// (docs/results/training.md).
const SETTLING_FROM: u32 = 5000;
/// One over the share of a run in which rates fall.
const SETTLING: u32 = 5;
/// What is left of a rate in the end.
const SETTLED: f64 = 0.05;
/// Iterations that the schedule of the papers is written for; shorter runs go through it faster.
const SCHEDULE: f64 = 30_000.0;
/// Factor of the population at each refinement of the papers' schedule, until the budget is spent.
const GROWTH: f64 = 1.05;
/// Weight of the mean opacity and of the mean standard deviation in the loss (MCMC).
const REGULARISATION: f64 = 0.01;
/// Times as much at the start of a run that suppresses floaters.
const SUPPRESSION: f64 = 32.0;
/// Relocations in an epoch (a pass over all photos), at most: a copy starts without moments, and until photos show it the
/// regularisers of opacity and size fade it. Relocated too often, live Gaussians fade sooner than photos can strengthen them
/// (docs/reference/training.md).
const RELOCATIONS_A_ROUND: usize = 5;
/// Relocations that remain in a run for any number of photos, if it had as many.
const FEWEST_RELOCATIONS: u32 = 20;

/// The schedule of a run, in iterations from zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    /// A degree of harmonics more every so often.
    pub degree_every: u32,
    /// First refinement.
    pub refine_from: u32,
    /// No refinement from here on.
    pub refine_until: u32,
    /// Iterations between refinements.
    pub refine_every: u32,
    /// Factor of the population at a refinement, until the budget is spent (MCMC).
    pub growth: f64,
    /// Iterations between resets of the opacities (adaptive density control).
    pub reset_every: u32,
    /// From here on rates fall.
    pub settle_from: u32,
    /// All of them.
    pub iterations: u32,
}

impl TrainConfig {
    /// Defaults for a run of so many iterations that starts at a capture's points.
    pub fn new(iterations: u32, max_splats: u32) -> Self {
        let (init_opacity, init_scale) = beginning(Strategy::Mcmc, iterations, Start::Points);
        Self {
            iterations,
            max_splats,
            strategy: Strategy::Mcmc,
            degree: MAX_DEGREE,
            background: Background::Black,
            antialiased: false,
            suppress_floaters: false,
            exposure: false,
            refine_poses: false,
            masks: Masks::Background,
            fast: false,
            seed: 0,
            init_opacity,
            init_scale,
        }
    }

    /// The same with another strategy and its start values.
    pub fn with_strategy(self, strategy: Strategy, start: Start) -> Self {
        let (init_opacity, init_scale) = beginning(strategy, self.iterations, start);
        Self { strategy, init_opacity, init_scale, ..self }
    }

    /// Rejects invalid settings.
    ///
    /// # Errors
    /// In a line that names the option.
    pub fn validate(&self) -> Result<()> {
        let refuse = |what: String| Err(Error::request(what));
        if !(1..=10_000_000).contains(&self.iterations) {
            return refuse(format!("`iterations` is {}; give 1 to 10000000", self.iterations));
        }
        if !(1..=1 << 26).contains(&self.max_splats) {
            return refuse(format!("`max_splats` is {}; give 1 to {}", self.max_splats, 1 << 26));
        }
        if self.degree > MAX_DEGREE {
            return refuse(format!("`degree` is {}; give 0 to {MAX_DEGREE}", self.degree));
        }
        if !(self.init_opacity > 0.0 && self.init_opacity < 1.0) {
            return refuse(format!("`init_opacity` is {}; give a number between 0 and 1", self.init_opacity));
        }
        if !(self.init_scale > 0.0 && self.init_scale <= 100.0) {
            return refuse(format!("`init_scale` is {}; give a number between 0 and 100", self.init_scale));
        }
        if self.suppress_floaters && self.strategy == Strategy::Adc {
            return refuse(
                "`suppress_floaters` raises penalties that only the strategy mcmc has; use that, or leave it out"
                    .into(),
            );
        }
        Ok(())
    }

    /// The background that test views are shown over.
    pub fn test_background(&self) -> [f32; 3] {
        match self.background {
            Background::White => [1.0; 3],
            Background::Black | Background::Random => [0.0; 3],
        }
    }

    /// The schedule of a run on so many photos: that of the papers, compressed for runs of fewer than 30,000 iterations. Where
    /// MCMC would relocate more than five times per epoch, relocations are rarer, as long as twenty of them remain, and the
    /// population grows by more at each. In the end of a long run rates fall, unless it begins without photos: those that join it late are
    /// to be learnt like the others.
    pub fn schedule(&self, photos: usize) -> Schedule {
        let share = (f64::from(self.iterations) / SCHEDULE).min(1.0);
        let scaled = |iterations: f64| ((iterations * share).round() as u32).max(1);
        let mcmc = self.strategy == Strategy::Mcmc;
        let (refine_from, refine_until) = (scaled(500.0), scaled(if mcmc { 25_000.0 } else { 15_000.0 }));
        // Gradients and moments need a few steps between two changes.
        let planned = scaled(100.0).max(10);
        let most = (refine_until - refine_from) / FEWEST_RELOCATIONS;
        let apart = u32::try_from(photos / RELOCATIONS_A_ROUND).unwrap_or(u32::MAX).min(most);
        let refine_every = if mcmc { planned.max(apart) } else { planned };
        Schedule {
            degree_every: scaled(1000.0),
            refine_from,
            refine_until,
            refine_every,
            // Rounded, so that every machine has the same: a checkpoint may be taken up on another.
            growth: (GROWTH.powf(f64::from(refine_every) / f64::from(planned)) * 1e12).round() / 1e12,
            // Opacities need a few hundred steps to come back.
            reset_every: scaled(3000.0).max(500),
            settle_from: match self.iterations {
                SETTLING_FROM.. if photos > 0 => self.iterations - self.iterations / SETTLING,
                _ => self.iterations,
            },
            iterations: self.iterations,
        }
    }
}

/// Opacity and scale at the start: small and dense Gaussians that spread; where there is no time to spread or they are split, wide
/// ones, which are faint where they may be in the way of one another, and opaque where they cover a surface.
fn beginning(strategy: Strategy, iterations: u32, start: Start) -> (f64, f64) {
    let long = LONG[usize::from(start == Start::Random)];
    match start {
        _ if strategy == Strategy::Mcmc && iterations >= long => (0.5, 0.1),
        Start::Surface => (0.95, 0.9),
        Start::Points | Start::Random => (0.1, 1.0),
    }
}

impl Schedule {
    /// Degree of the harmonics that take part in an iteration.
    pub fn degree(&self, iteration: u32, most: u32) -> u32 {
        (iteration / self.degree_every).min(most)
    }

    /// Factor of all rates of Adam but that of the centres, which falls by itself: geometrically to a twentieth at the end of the run.
    pub fn settling(&self, iteration: u32) -> f64 {
        let falls = f64::from(iteration.saturating_sub(self.settle_from));
        SETTLED.powf(falls / f64::from((self.iterations - self.settle_from).max(1)))
    }

    /// Weight of the mean opacity and of the mean standard deviation in the loss of an iteration (MCMC): that of the paper or, where
    /// floaters are suppressed, falling to that geometrically from 32 times as much (docs/results/training.md).
    pub fn regularisation(&self, iteration: u32, suppress_floaters: bool) -> f64 {
        let left = 1.0 - f64::from(iteration) / f64::from(self.iterations);
        if suppress_floaters { REGULARISATION * SUPPRESSION.powf(left) } else { REGULARISATION }
    }

    /// Whether a refinement follows the iteration.
    pub fn refines_after(&self, iteration: u32) -> bool {
        let next = iteration + 1;
        next > self.refine_from && next < self.refine_until && next.is_multiple_of(self.refine_every)
    }

    /// Refinements after iterations before this one.
    pub fn refinements_before(&self, iteration: u32) -> u32 {
        (0..iteration).filter(|&i| self.refines_after(i)).count() as u32
    }

    /// Whether opacities are reset after the iteration.
    pub fn resets_after(&self, iteration: u32) -> bool {
        let next = iteration + 1;
        next < self.refine_until && next.is_multiple_of(self.reset_every)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schedule(iterations: u32, photos: usize) -> Schedule {
        TrainConfig::new(iterations, 100_000).schedule(photos)
    }

    /// Computed directly. If this failed, rooms of hundreds of photos would be relocated more often than photos show their
    /// splats, which made training diverge; or the schedule for few photos would change.
    #[test]
    fn relocations_are_as_in_the_papers_or_five_in_a_round_of_photos() {
        for (iterations, photos, every) in [
            (30_000, 300, 100),
            (30_000, 1000, 200),
            (7000, 0, 23),
            (7000, 50, 23),
            (7000, 115, 23),
            (7000, 120, 24),
            (7000, 300, 60),
            (300, 20, 10),
            (2, 300, 10),
            (1, 300, 10),
        ] {
            assert_eq!(schedule(iterations, photos).refine_every, every, "{iterations} iterations, {photos} photos");
        }
        assert_eq!(schedule(7000, 50).growth, GROWTH);
        let adaptive = TrainConfig::new(7000, 100_000).with_strategy(Strategy::Adc, Start::Points).schedule(300);
        assert_eq!(adaptive.refine_every, 23);
    }

    /// If this failed, a run would end with parameters that still jitter, a short one before it gets anywhere, photos that join late would
    /// hardly be learnt, or rates would fall while splats still have far to go.
    #[test]
    fn rates_fall_in_the_last_fifth_of_a_long_run() {
        let long = schedule(10_000, 9);
        assert!((0..=8000).all(|iteration| long.settling(iteration) == 1.0));
        assert!((8000..10_000).all(|iteration| long.settling(iteration) > long.settling(iteration + 1)));
        for (iteration, left) in [(9000, 0.05f64.sqrt()), (10_000, 0.05)] {
            assert!((long.settling(iteration) - left).abs() < 1e-12, "{iteration}");
        }
        for stays in [schedule(1, 9), schedule(300, 9), schedule(3000, 9), schedule(18_400, 0)] {
            assert!((0..stays.iterations).all(|iteration| stays.settling(iteration) == 1.0), "{stays:?}");
        }
    }

    /// If this failed, floaters would not be held down while they form, or detail would be held down to the end.
    #[test]
    fn penalties_fall_from_many_times_those_of_the_paper() {
        let schedule = schedule(1000, 9);
        let weights: Vec<f64> = (0..=1000).map(|iteration| schedule.regularisation(iteration, true)).collect();
        assert!(weights.windows(2).all(|pair| pair[0] > pair[1]));
        for (iteration, weight) in [(0, 0.32), (600, 0.04), (1000, 0.01)] {
            assert!((weights[iteration] - weight).abs() < 1e-12, "{iteration}: {}", weights[iteration]);
        }
        assert!((0..1000).all(|iteration| schedule.regularisation(iteration, false) == 0.01));
        let classic = TrainConfig::new(1000, 9).with_strategy(Strategy::Adc, Start::Points);
        let refused = TrainConfig { suppress_floaters: true, ..classic }.validate().unwrap_err().to_string();
        assert!(refused.contains("suppress_floaters") && refused.contains("mcmc"), "{refused}");
    }

    /// If this failed, a short run on many photos would end with a fraction of its splats, or without a relocation.
    #[test]
    fn runs_on_many_photos_grow_as_far_as_those_on_few() {
        for (iterations, photos) in [(7000, 300), (7000, 1000), (2000, 5000), (300, 200), (30_000, usize::MAX)] {
            let [few, many] = [10, photos].map(|photos| {
                let schedule = schedule(iterations, photos);
                let refinements = schedule.refinements_before(iterations);
                (refinements, f64::from(refinements) * schedule.growth.ln())
            });
            assert!(many.0 >= few.0.min(FEWEST_RELOCATIONS), "{iterations}, {photos}: {} refinements", many.0);
            assert!((many.1 / few.1 - 1.0).abs() < 0.1, "{iterations}, {photos}: {} and {}", few.1, many.1);
        }
    }
}

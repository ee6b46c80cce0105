//! What a training run is told.

use serde::{Deserialize, Serialize};

use crate::scene::gaussians::MOST_DEGREE;
use crate::{Error, Result};

/// How the number of Gaussians changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Strategy {
    /// A hard budget: dead Gaussians move to where living ones are (3DGS-MCMC).
    Mcmc,
    /// Clone, split and prune by gradients (3DGS).
    Classic,
}

/// What lies behind everything.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Background {
    /// Black.
    Black,
    /// White.
    White,
    /// Another colour in every iteration; test views are shown over black.
    Random,
}

/// Configuration of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Config {
    /// Iterations.
    pub iterations: u32,
    /// Most Gaussians.
    pub max_splats: u32,
    /// How their number changes.
    pub strategy: Strategy,
    /// Degree of the harmonics, 0 to 3.
    pub degree: u32,
    /// What lies behind everything.
    pub background: Background,
    /// Opacities reduced by what the low-pass widens.
    pub antialiased: bool,
    /// Gradients summed by atomic additions of floats: no two runs are the same.
    pub fast: bool,
    /// Seed of every random draw.
    pub seed: u64,
    /// Opacity at the start.
    pub first_opacity: f64,
    /// Standard deviation at the start, in mean distances to the nearest neighbours.
    pub first_scale: f64,
}

/// Iterations from which small Gaussians have the time to spread: from the few points of a reconstruction, and from many random
/// places.
const LONG: [u32; 2] = [10_000, 1_000];
/// Opacity up to which a Gaussian is dead.
pub const LEAST_OPACITY: f32 = 0.005;
/// Iterations that the schedule of the papers is written for; shorter runs go through it faster.
const SCHEDULE: f64 = 30_000.0;

/// When what happens, in iterations from zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// A degree of harmonics more every so often.
    pub degree_every: u32,
    /// First refinement.
    pub refine_from: u32,
    /// No refinement from here on.
    pub refine_until: u32,
    /// Iterations between refinements.
    pub refine_every: u32,
    /// Iterations between resets of the opacities (classic).
    pub reset_every: u32,
}

impl Config {
    /// Defaults for a run of so many iterations that starts at a capture's points.
    pub fn new(iterations: u32, max_splats: u32) -> Self {
        let (first_opacity, first_scale) = beginning(Strategy::Mcmc, iterations, true);
        Self {
            iterations,
            max_splats,
            strategy: Strategy::Mcmc,
            degree: MOST_DEGREE,
            background: Background::Black,
            antialiased: false,
            fast: false,
            seed: 0,
            first_opacity,
            first_scale,
        }
    }

    /// The same with another strategy and what that starts with, at `points` or at random places.
    pub fn with_strategy(self, strategy: Strategy, points: bool) -> Self {
        let (first_opacity, first_scale) = beginning(strategy, self.iterations, points);
        Self { strategy, first_opacity, first_scale, ..self }
    }

    /// Refuses what makes no sense.
    ///
    /// # Errors
    /// In a line that names the option.
    pub fn validate(&self) -> Result<()> {
        let refuse = |what: String| Err(Error::request(what));
        if !(1..=10_000_000).contains(&self.iterations) {
            return refuse(format!("--iterations is {}; give 1 to 10000000", self.iterations));
        }
        if !(1..=1 << 26).contains(&self.max_splats) {
            return refuse(format!("--max-splats is {}; give 1 to {}", self.max_splats, 1 << 26));
        }
        if self.degree > MOST_DEGREE {
            return refuse(format!("--sh is {}; give 0 to {MOST_DEGREE}", self.degree));
        }
        if !(self.first_opacity > 0.0 && self.first_opacity < 1.0) {
            return refuse(format!("--first-opacity is {}; give a number between 0 and 1", self.first_opacity));
        }
        if !(self.first_scale > 0.0 && self.first_scale <= 100.0) {
            return refuse(format!("--first-scale is {}; give a number between 0 and 100", self.first_scale));
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

    /// The schedule: that of the papers, compressed for runs of fewer than 30,000 iterations.
    pub fn schedule(&self) -> Schedule {
        let share = (f64::from(self.iterations) / SCHEDULE).min(1.0);
        let scaled = |iterations: f64| ((iterations * share).round() as u32).max(1);
        Schedule {
            degree_every: scaled(1000.0),
            refine_from: scaled(500.0),
            refine_until: scaled(if self.strategy == Strategy::Mcmc { 25_000.0 } else { 15_000.0 }),
            // Gradients and moments need a few steps between two changes.
            refine_every: scaled(100.0).max(10),
            // Opacities need a few hundred steps to come back.
            reset_every: scaled(3000.0).max(500),
        }
    }
}

/// Opacity and scale at the start: small and dense Gaussians that spread, or wide and faint ones, where there is no time to
/// spread or they are split.
fn beginning(strategy: Strategy, iterations: u32, points: bool) -> (f64, f64) {
    let long = LONG[usize::from(!points)];
    if strategy == Strategy::Mcmc && iterations >= long { (0.5, 0.1) } else { (0.1, 1.0) }
}

impl Schedule {
    /// Degree of the harmonics that take part in an iteration.
    pub fn degree(&self, iteration: u32, most: u32) -> u32 {
        (iteration / self.degree_every).min(most)
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

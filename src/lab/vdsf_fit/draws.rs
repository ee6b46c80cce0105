//! A stream of random numbers for one sample of the population.

use std::f64::consts::TAU;

use glam::DVec3;

use crate::scene::random;

/// Draws keyed by (seed, stream), taken one after the other.
pub struct Draws {
    seed: u64,
    stream: u32,
    next: u32,
}

impl Draws {
    /// The start of a stream.
    pub fn new(seed: u64, stream: u32) -> Self {
        Self { seed, stream, next: 0 }
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        let value = random::uniforms(self.seed, self.stream, self.next)[0];
        self.next += 1;
        value
    }

    /// Uniform in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in the logarithm, in [low, high).
    pub fn scale(&mut self, low: f64, high: f64) -> f64 {
        low * libm::exp(libm::log(high / low) * self.unit())
    }

    /// An integer, `low` to `high`, both included.
    pub fn count(&mut self, low: u32, high: u32) -> u32 {
        low + random::below(random::bits(self.seed, self.stream, self.next_index())[0], high - low + 1)
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// A unit vector whose height above the plane across `up` is uniform in [low, high].
    pub fn direction(&mut self, up: DVec3, low: f64, high: f64) -> DVec3 {
        let height = self.between(low, high);
        let angle = TAU * self.unit();
        let (side, other) = up.any_orthonormal_pair();
        let across = (1.0 - height * height).max(0.0).sqrt();
        (across * (libm::cos(angle) * side + libm::sin(angle) * other) + height * up).normalize()
    }

    fn next_index(&mut self) -> u32 {
        self.next += 1;
        self.next - 1
    }
}

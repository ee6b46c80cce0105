//! The fit of the VDSF: a synthetic population of surfaces, what a few photos see of each, how densely each must be
//! sampled, and the cubic between the two.
//!
//! Bit for bit the same on every run and for any number of threads: random numbers are counted, sums have a fixed order.
//! Transcendental functions are those of the `libm` crate, not the system's, which differ in last bits; the octahedral
//! grid alone uses the system's, so coefficients are rounded to eight digits.

mod density;
mod draws;
mod lighting;
mod material;
mod neighbourhood;
pub mod plot;
mod quadrature;
mod radiance;
pub mod regression;

pub use density::Sparse;
pub use lighting::{Lighting, Lobe, Profile};
pub use material::Material;
pub use neighbourhood::Neighbourhood;

use density::Views;
use draws::Draws;
use radiance::Sample;
use regression::{rising_cubic, spearman};

use crate::engine::parallel::mapped;
use crate::photogrammetry::vds::vdsf::{Quality, VERSION, Vdsf};
use crate::{Error, Result};

/// Root mean square error that interpolation must keep, in luma.
pub(crate) const EPSILON: f64 = 0.03;

/// Samples of the fit that is built in.
pub const SAMPLES: usize = 1000;

/// Seed of the fit that is built in.
pub const SEED: u64 = 1;

/// Fewest and most samples that a cubic is fitted to.
pub(crate) const RANGE: [usize; 2] = [50, 1_000_000];

/// Share of the variances that the range covers. Above it samples are few and need no more views as variance grows: the
/// score is level there, which a cubic cannot be by itself.
const COVERED: f64 = 0.90;

/// A surface in its surroundings.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Its material.
    pub material: Material,
    /// Its neighbourhood.
    pub neighbourhood: Neighbourhood,
    /// Its lighting.
    pub lighting: Lighting,
    /// Mean luma of the photos: the exposure is such that a white-balanced scene which reflects half of the mean
    /// incoming radiance has it. What is brighter than 1 is clipped.
    pub key: f64,
}

/// What was measured of one surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Variance of the luma that one draw of sparse views saw.
    pub variance: f64,
    /// The variance that random draws see on average.
    pub expected: f64,
    /// Views over the hemisphere that interpolation to [`EPSILON`] needs.
    pub density: f64,
    /// Perceptual roughness of the material.
    pub roughness: f64,
}

impl Observation {
    /// The density as the VDSF gives it: its logarithm, 0 for one view and 1 for the most that are tried. Ratios are what
    /// matters of a relative density, and errors of the fit are then about equally large everywhere.
    pub fn score(&self) -> f64 {
        libm::log(self.density) / libm::log(most_views())
    }
}

/// The largest number of views that is tried.
pub(crate) fn most_views() -> f64 {
    density::SIZES[density::SIZES.len() - 1] as f64
}

impl Scene {
    /// Number `index` of the population of this seed.
    pub fn draw(seed: u64, index: u32) -> Self {
        let mut draws = Draws::new(seed, 2 * index);
        Self {
            material: Material::draw(&mut draws),
            neighbourhood: Neighbourhood::draw(&mut draws),
            lighting: Lighting::draw(&mut draws),
            key: draws.between(0.18, 0.5),
        }
    }
}

/// Measures scenes, each with draws of its own, over all cores; the order of the results is that of the scenes.
pub fn observe(scenes: &[Scene], sparse: Sparse, seed: u64) -> Vec<Observation> {
    let views = Views::new(seed);
    mapped(scenes, |index, scene| measure(scene, &views, sparse, seed, index as u32))
}

/// Measures one scene.
fn measure(scene: &Scene, views: &Views, sparse: Sparse, seed: u64, index: u32) -> Observation {
    let sample = Sample::new(scene.material, scene.neighbourhood, &scene.lighting);
    let exposure = scene.key / (0.5 * scene.lighting.mean());
    let open: Vec<bool> = views.directions.iter().map(|v| scene.neighbourhood.open(*v)).collect();
    let photo = |(v, open): (&glam::DVec3, &bool)| if *open { (exposure * sample.radiance(*v)).min(1.0) } else { 0.0 };
    let values: Vec<f64> = views.directions.iter().zip(&open).map(photo).collect();
    // Streams of scenes are even, those of their views odd.
    let mut draws = Draws::new(seed, 2 * index + 1);
    Observation {
        variance: sparse.variance(&values, &views.directions, &open, &mut draws),
        expected: density::expected_variance(&values, &open),
        density: views.density(&values, &open, EPSILON),
        roughness: scene.material.roughness,
    }
}

/// Draws a population, measures it and fits the cubic to it. Also returns what was measured.
///
/// # Errors
/// When the number of samples is not in [`RANGE`], or a thread fails.
pub fn fit(samples: usize, seed: u64) -> Result<(Vdsf, Vec<Observation>)> {
    let [fewest, most] = RANGE;
    if !(fewest..=most).contains(&samples) {
        return Err(Error::request(format!("{samples} samples make no fit; give {fewest} to {most}")));
    }
    let scenes: Vec<Scene> = (0u32..).take(samples).map(|index| Scene::draw(seed, index)).collect();
    let observations = observe(&scenes, Sparse::FITTED, seed);
    Ok((fit_to(&observations, seed), observations))
}

/// The cubic for these observations.
fn fit_to(observations: &[Observation], seed: u64) -> Vdsf {
    let mut variances: Vec<f64> = observations.iter().map(|seen| seen.variance).collect();
    variances.sort_by(f64::total_cmp);
    let high = round(variances[((variances.len() - 1) as f64 * COVERED) as usize]);
    let points: Vec<(f64, f64)> =
        observations.iter().map(|seen| ((seen.variance / high).min(1.0), seen.score())).collect();
    let [a0, a1, a2, a3] = rising_cubic(&points);
    let coefficients = [a0, a1 / high, a2 / (high * high), a3 / (high * high * high)].map(round);
    let quality = Quality { r_squared: 0.0, spearman: 0.0, spearman_expected: 0.0, saturated: 0.0 };
    let mut vdsf = Vdsf {
        version: VERSION,
        coefficients,
        range: [0.0, high],
        epsilon: EPSILON,
        seed,
        samples: observations.len(),
        quality,
    };
    vdsf.quality = quality_of(&vdsf, observations);
    vdsf
}

/// How well a VDSF explains observations.
pub(crate) fn quality_of(vdsf: &Vdsf, observations: &[Observation]) -> Quality {
    let n = observations.len() as f64;
    let mean = observations.iter().map(Observation::score).sum::<f64>() / n;
    let (mut total, mut rest) = (0.0, 0.0);
    for seen in observations {
        total += (seen.score() - mean) * (seen.score() - mean);
        rest += (seen.score() - vdsf.apply(seen.variance)) * (seen.score() - vdsf.apply(seen.variance));
    }
    let rank = |variance: fn(&Observation) -> f64| {
        let pairs: Vec<(f64, f64)> =
            observations.iter().map(|seen| (vdsf.apply(variance(seen)), seen.density)).collect();
        spearman(&pairs)
    };
    let saturated = observations.iter().filter(|seen| seen.density == most_views()).count() as f64 / n;
    Quality {
        r_squared: round(1.0 - rest / total),
        spearman: round(rank(|seen| seen.variance)),
        spearman_expected: round(rank(|seen| seen.expected)),
        saturated: round(saturated),
    }
}

/// Rounded to eight significant digits.
fn round(x: f64) -> f64 {
    // What Rust prints in scientific notation it parses.
    format!("{x:.7e}").parse().unwrap_or(x)
}

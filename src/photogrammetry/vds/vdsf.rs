//! The view dependency score function (VDSF): from the variance of a point's intensity over a few photos to how densely
//! the directions around it should be sampled.
//!
//! A cubic, as in the paper ("Camera Splatting for Continuous View Optimization", Lee et al. 2026), whose coefficients
//! were not published; ours are fitted by `lab/vdsf_fit` and kept in `vdsf.json`.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::{Error, Result};

/// The file that is built in, as `camsplat vdsf fit` writes it.
const EMBEDDED: &str = include_str!("vdsf.json");

/// Version of the population and the measurements. It changes with whatever changes the coefficients.
pub const VERSION: u32 = 1;

/// A fitted VDSF, `s = a0 + a1 v + a2 v^2 + a3 v^3`, and how good the fit is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vdsf {
    /// [`VERSION`] of what it was fitted to.
    pub version: u32,
    /// a0 to a3.
    pub coefficients: [f64; 4],
    /// Variances the fit holds for; those outside count as the nearer end.
    pub range: [f64; 2],
    /// Root mean square error, in luma, that the density must keep.
    pub epsilon: f64,
    /// Seed of the population.
    pub seed: u64,
    /// Number of samples in the population.
    pub samples: usize,
    /// How well the curve explains the population.
    pub quality: Quality,
}

/// Figures of a fit on the population it was fitted to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quality {
    /// Share of the variance of the log density that the curve explains.
    pub r_squared: f64,
    /// Spearman's rank correlation of score and density, variance from one draw of 5 to 15 spread views.
    pub spearman: f64,
    /// The same, variance as expected over random draws.
    pub spearman_expected: f64,
    /// Share of the samples whose density reaches the largest number of views tried.
    pub saturated: f64,
}

impl Vdsf {
    /// The one that is built in.
    pub fn embedded() -> Self {
        // The text is a constant of this crate, and a test parses it: what cannot be parsed does not ship.
        Self::parse(Path::new("vdsf.json"), EMBEDDED).expect("the built-in vdsf.json is tested to parse")
    }

    /// Reads what [`Vdsf::text`] wrote.
    ///
    /// # Errors
    /// When it is no such JSON, not finite, its range is empty, or the cubic falls somewhere in its range.
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let vdsf: Self = serde_json::from_str(text)
            .map_err(|e| Error::input(path, format!("no VDSF: {e}; make one with `camsplat vdsf fit`")))?;
        let [low, high] = vdsf.range;
        if !(low >= 0.0 && low < high) {
            return Err(Error::input(path, format!("the range of variances [{low}, {high}] is empty or negative")));
        }
        if vdsf.least_slope() < 0.0 {
            return Err(Error::input(path, "the cubic falls within its range; fit one with `camsplat vdsf fit`"));
        }
        Ok(vdsf)
    }

    /// The file: JSON, numbers in the shortest digits that read back as the same bits.
    ///
    /// # Errors
    /// None in practice: all fields are plain numbers.
    pub fn text(&self) -> Result<String> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|e| Error::request(format!("the VDSF cannot be written as JSON: {e}")))?;
        Ok(text + "\n")
    }

    /// The score of an intensity variance (luma of linear RGB in [0, 1], squared differences summed and divided by the
    /// number of views less one): log density in units where 0 is one view over the hemisphere and 1 the most that were
    /// tried. Not yet normalised over the points of a surface.
    pub fn apply(&self, variance: f64) -> f64 {
        let v = variance.clamp(self.range[0], self.range[1]);
        let [a0, a1, a2, a3] = self.coefficients;
        a0 + v * (a1 + v * (a2 + v * a3))
    }

    /// The least slope of the cubic over its range, exactly: its slope is a quadratic, least at an end or where the
    /// curvature changes sign.
    pub fn least_slope(&self) -> f64 {
        let [_, a1, a2, a3] = self.coefficients;
        let [low, high] = self.range;
        let slope = |v: f64| a1 + v * (2.0 * a2 + v * 3.0 * a3);
        let least = slope(low).min(slope(high));
        let turn = -a2 / (3.0 * a3);
        if low < turn && turn < high { least.min(slope(turn)) } else { least }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, every command that scores view dependency would end in a panic.
    #[test]
    fn the_embedded_file_parses() {
        let vdsf = Vdsf::parse(Path::new("vdsf.json"), EMBEDDED).unwrap();
        assert_eq!(vdsf.version, VERSION, "the file is of another version than the code: fit it again");
        assert_eq!(vdsf.text().unwrap(), EMBEDDED);
    }

    /// A score that falls while the variance rises would place fewer cameras where more are needed.
    #[test]
    fn the_embedded_score_rises_and_is_clamped_outside() {
        let vdsf = Vdsf::embedded();
        assert!(vdsf.least_slope() > 0.0);
        let [low, high] = vdsf.range;
        let scores: Vec<f64> = (0..=1000).map(|i| vdsf.apply(low + (high - low) * f64::from(i) / 1000.0)).collect();
        assert!(scores.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!(vdsf.apply(low - 1.0), scores[0]);
        assert_eq!(vdsf.apply(high + 1.0), vdsf.apply(high));
    }

    /// A hand-edited file with a dent would silently break the order of scores.
    #[test]
    fn a_cubic_that_falls_is_refused() {
        let mut vdsf = Vdsf::embedded();
        // Slope 3 (v - 1/2)^2 - 0.01, negative around the middle only.
        (vdsf.coefficients, vdsf.range) = ([0.0, 0.74, -1.5, 1.0], [0.0, 1.0]);
        assert!((vdsf.least_slope() + 0.01).abs() < 1e-12);
        let message = Vdsf::parse(Path::new("a.json"), &vdsf.text().unwrap()).unwrap_err().to_string();
        assert!(message.contains("the cubic falls within its range"), "{message}");
        vdsf.range = [0.1, 0.1];
        assert!(Vdsf::parse(Path::new("a.json"), &vdsf.text().unwrap()).is_err());
    }
}

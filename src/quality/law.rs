//! The law of expected error: what splats will get wrong at a look, from the views nearest to it.
//!
//! For a pixel of a viewer that shows surface point p from direction d and distance D, let g1 <= g2 <= g3 be the angles at p
//! between d and the directions of the training views that see p (2 rad where there are fewer), and r the distance of the nearest
//! of them over D: `log e^2 = a + 0.97 g1 + 0.12 g2 + 0.36 g3 + 0.44 max(ln r, 0)`, where `a` is the material's, the texture's
//! and the light's alone. A pixel beside an object looks at the empty place where its ray passes the object's middle, by the same law
//! at a twentieth of the weight. docs/quality.md has the measurements.

use super::nearest::{FARTHEST, Near};

crate::gpu_struct! {
    /// The law as the device has it (`shared/law.glsl`): the logarithm of the squared error of trained splats at a look, beside
    /// what the material itself makes of it.
    pub struct Law {
        /// By the angle of the first, second and third nearest view that sees the point, in radians.
        pub angle: [f32; 3],
        /// By the logarithm of the nearest one's distance over the viewer's, where it is farther away.
        pub farther: f32,
        /// Weight of a look beside the surface of an object, where splats must leave nothing.
        pub background: f32,
        /// Unused.
        pub spare0: f32,
        /// Unused.
        pub spare1: f32,
        /// Unused.
        pub spare2: f32,
    }
}

impl Law {
    /// The one that is built in, fitted to the pixels of trained splats (docs/quality.md).
    pub fn embedded() -> Self {
        Self { angle: [0.971, 0.121, 0.362], farther: 0.442, background: 0.05, ..Self::default() }
    }

    /// Logarithm of the squared error at a look at `distance` whose nearest views are these, beside what the material makes
    /// of it.
    pub fn log_error(&self, found: &[Near], distance: f64) -> f64 {
        let angle = |k: usize| found.get(k).map_or(FARTHEST, |near| near.cost);
        let by_angle: f64 = (0..3).map(|k| f64::from(self.angle[k]) * angle(k)).sum();
        let log_ratio = found.first().map_or(0.0, |near| (near.distance / distance).ln());
        by_angle + f64::from(self.farther) * log_ratio.max(0.0)
    }
}

/// Decibels of trained PSNR for a decibel of the law (docs/quality.md).
const SLOPE: f64 = 1.25;
/// What is left of the difference of two layouts, as a standard deviation in decibels: of layouts that are expected to be alike,
/// which differ by their rotation and the training's chance, and for each decibel that they are expected to differ by.
const SPREAD: [f64; 2] = [0.2, 0.3];

impl Law {
    /// What a difference of expected errors, in the law's decibels, comes to in trained PSNR.
    pub fn decibels(&self, difference: f64) -> f64 {
        SLOPE * difference
    }

    /// Standard deviation of a difference that is expected to be `decibels`, in decibels.
    pub fn spread(&self, decibels: f64) -> f64 {
        SPREAD[0].hypot(SPREAD[1] * decibels)
    }
}

//! The law of expected error: what splats will get wrong at a look, from the views nearest to it.
//!
//! For a pixel of a viewer that shows surface point p from direction d, let g1 <= g2 <= g3 be the angles at p between d
//! and the directions of the training views that see p (2 rad where there are fewer), and r the footprint of the nearest one's picture
//! at p (distance times the tangent of half its wider field of view: pictures count as having equally many pixels) over that of the
//! viewer's. With `z = b1 g1 + b3 g3 + c max(ln r, 0)`, the error is `e^2 = exp(a) / (exp(-z) + exp(-m))`, where `a` is the material's,
//! the texture's and the light's alone: it rises by `z` and ends at `m`, since what is not known at all is not worse than that. A pixel
//! beside an object looks at the empty place where its ray passes the object's middle, by the same law at a small weight.
//! `lab/quality_fit` makes the coefficients, `law_of_objects.json` and `law_of_rooms.json` have them; docs/reference/quality.md says
//! what they are of.

use std::path::Path;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::engine::vulkan::shaders::glsl::shared::look;
use crate::{Error, Result};

/// Views at least this far from a viewer's direction, in radians, count as none.
pub(crate) const FARTHEST: f64 = look::FARTHEST;
/// The files that are built in, in the form of `camsplat quality fit`: of objects, and of rooms.
const OBJECTS: &str = include_str!("law_of_objects.json");
const ROOMS: &str = include_str!("law_of_rooms.json");
/// Where a law without an end ends: its exponential is the last but a few that single precision holds.
pub(crate) const NO_END: f64 = 80.0;
/// Largest coefficient: far beyond what splats show, and far below what single precision holds.
const STEEPEST: f64 = 1000.0;

/// A view of the point of a look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Near {
    /// Angle at the point between the viewer and the view, in radians; for splats, and what they are off by otherwise.
    pub cost: f64,
    /// Unit direction from the point to the view.
    pub direction: DVec3,
    /// Distance of the view.
    pub distance: f64,
    /// Of the view's picture at the point: distance times the tangent of half its wider field of view.
    pub footprint: f64,
    /// Which view.
    pub view: u32,
}

crate::gpu_struct! {
    /// The law as the device has it (`shared/law.glsl`): the squared error of trained splats at a look, beside what the material itself
    /// makes of it. The default has no rise, and ends at once.
    pub struct Law {
        /// By the angle of the first, second and third nearest view that sees the point, in radians.
        pub angle: [f32; 3],
        /// By the logarithm of the nearest one's footprint over the viewer's, where it is larger.
        pub farther: f32,
        /// Weight of a look beside the surface of an object, where splats must leave nothing.
        pub background: f32,
        /// Logarithm of the error that it never reaches.
        pub most: f32,
        /// Unused.
        pub spare0: f32,
        /// Unused.
        pub spare1: f32,
    }
}

impl Law {
    /// The one that is built in, of objects or of rooms.
    pub fn embedded(object: bool) -> Self {
        Coefficients::embedded(object).on_device()
    }

    /// Squared error at a look whose viewer's picture has this footprint and whose nearest views are these, beside what the material makes
    /// of it.
    pub fn error(&self, found: &[Near], footprint: f64) -> f64 {
        let angle = |k: usize| found.get(k).map_or(FARTHEST, |near| near.cost);
        let log_ratio = found.first().map_or(0.0, |near| (near.footprint / footprint).ln());
        self.of([angle(0), angle(1), angle(2)], log_ratio)
    }

    /// The same by the angles of the three nearest views and the logarithm of the nearest one's footprint over the viewer's.
    pub fn of(&self, angles: [f64; 3], log_ratio: f64) -> f64 {
        let by_angle: f64 = (0..3).map(|k| f64::from(self.angle[k]) * angles[k]).sum();
        let rise = by_angle + f64::from(self.farther) * log_ratio.max(0.0);
        1.0 / ((-rise).exp() + f64::from(-self.most).exp())
    }

    /// Decibels by which error is larger where the nearest views are all 0.7 rad away than where they look as the viewer does: what colours
    /// of error span on either side of the median, so that they show as much by a flat law as by a steep one.
    pub fn span_db(&self) -> f64 {
        10.0 * (self.of([0.7; 3], 0.0) / self.of([0.0; 3], 0.0)).log10()
    }

    /// How fast an error rises with the sum that it rises by.
    pub fn slope(&self, error: f64) -> f64 {
        error * (1.0 - error * f64::from(-self.most).exp())
    }
}

/// The law's coefficients.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coefficients {
    /// `b1`, for a radian of the nearest view's angle.
    pub nearest: f64,
    /// `b3`, for a radian of the third nearest one's. The second adds nothing to the two.
    pub third: f64,
    /// `c`, by the logarithm of the nearest one's footprint over the viewer's.
    pub farther: f64,
    /// `m`, where it ends; none where it rises without an end.
    pub most: Option<f64>,
    /// Weight of a look beside the surface of an object.
    pub background: f64,
}

impl Coefficients {
    /// Of the law that is built in, of objects or of rooms.
    pub fn embedded(object: bool) -> Self {
        Fitted::embedded(object).coefficients
    }

    /// Rejects a law by which more views could be worse than fewer: plans would move away from what viewers look at.
    ///
    /// # Errors
    /// In a line that names the coefficient.
    pub fn check(&self) -> Result<()> {
        let all = [
            ("nearest", self.nearest, [0.0, STEEPEST]),
            ("third", self.third, [0.0, STEEPEST]),
            ("farther", self.farther, [0.0, STEEPEST]),
            ("most", self.most.unwrap_or(NO_END), [1e-6, NO_END]),
            ("background", self.background, [0.0, STEEPEST]),
        ];
        match all.into_iter().find(|(_, value, [least, most])| !(least..=most).contains(&value)) {
            Some((name, value, [least, most])) => Err(Error::request(format!(
                "the law's coefficient {name:?} is {value}, and error must rise with angle and footprint, and be finite; it is between {least} and {most}"
            ))),
            None => Ok(()),
        }
    }

    /// As the device has it.
    pub fn on_device(&self) -> Law {
        let [nearest, third, farther, background] =
            [self.nearest, self.third, self.farther, self.background].map(|value| value as f32);
        let most = self.most.unwrap_or(NO_END) as f32;
        Law { angle: [nearest, 0.0, third], farther, background, most, ..Law::default() }
    }
}

/// A fitted law, and what it was fitted to: the contents of a law's file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fitted {
    /// What was fitted.
    pub coefficients: Coefficients,
    /// Standard deviation in decibels of the trained difference of two layouts with the same lens about the expected one: of layouts that are
    /// expected to be alike, which differ by their rotation and the training's chance, and for each decibel that they are expected to differ
    /// by. Of three scenes or more each by the law of the others, and of what is held out; else of what it was fitted to.
    pub spread: [f64; 2],
    /// Whether the first of these is that of the law that was built in, for want of layouts that are expected to be alike.
    pub borrowed: bool,
    /// Standard deviations of `nearest`, `third`, `farther`, of the logarithm of `background` and of `most`, by leaving out one scene at a
    /// time, with the law's form held; none of fewer than three scenes.
    pub deviation: Option<[f64; 5]>,
    /// Scenes it was fitted to.
    pub scenes: Vec<String>,
    /// Scenes it was only compared with.
    pub held_out: Vec<String>,
    /// Trained layouts it was fitted to.
    pub layouts: usize,
}

impl Fitted {
    /// The one that is built in, of objects or of rooms.
    pub fn embedded(object: bool) -> Self {
        let text = if object { OBJECTS } else { ROOMS };
        // The texts are constants of this crate, and a test parses them: what cannot be parsed does not ship.
        Self::parse(Path::new("the built-in law"), text).expect("the built-in laws are tested to parse")
    }

    /// Reads what [`Fitted::text`] wrote.
    ///
    /// # Errors
    /// Where it is no such JSON or no law.
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let fitted: Self = serde_json::from_str(text)
            .map_err(|e| Error::input(path, format!("no law: {e}; make one with `camsplat quality fit`")))?;
        fitted.coefficients.check()?;
        Ok(fitted)
    }

    /// The file: JSON, numbers in the shortest digits that read back as the same bits.
    ///
    /// # Errors
    /// None in practice: all fields are plain numbers and names.
    pub fn text(&self) -> Result<String> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|e| Error::request(format!("the law cannot be written as JSON: {e}")))?;
        Ok(text + "\n")
    }

    /// Standard deviation of a difference that is expected to be `decibels`, in decibels.
    pub fn spread(&self, decibels: f64) -> f64 {
        self.spread[0].hypot(self.spread[1] * decibels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, every plan and score would end in a panic.
    #[test]
    fn the_embedded_laws_parse_and_are_written_as_they_were() {
        for (object, text) in [(true, OBJECTS), (false, ROOMS)] {
            let fitted = Fitted::embedded(object);
            assert_eq!(fitted.text().unwrap(), text);
            // A weight beside the surface is an object's.
            assert_eq!(fitted.coefficients.background > 0.0, object);
        }
        let good = Coefficients::embedded(true);
        for (wrong, said) in [
            (Coefficients { third: -0.1, ..good }, "\"third\" is -0.1"),
            (Coefficients { most: Some(0.0), ..good }, "\"most\" is 0"),
            // With a steep rise both exponentials would be zero.
            (Coefficients { most: Some(100.0), ..good }, "\"most\" is 100"),
            (Coefficients { nearest: 1e39, ..good }, "\"nearest\""),
            (Coefficients { farther: f64::NAN, ..good }, "\"farther\" is NaN"),
        ] {
            let refused = wrong.check().unwrap_err().to_string();
            assert!(refused.contains(said), "{refused}");
        }
    }
}

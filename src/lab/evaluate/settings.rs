//! The size of an evaluation, and what methods are given.

use serde::Serialize;

use crate::lab::path_tracer::lightmap::Light;
use crate::planner::plan::target::RegionChoice;
use crate::scene::camera::Intrinsics;
use crate::scene::gaussians::MAX_DEGREE;

/// What the methods are shown of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Shown {
    /// A surface made from the input photos
    Proxy,
    /// The scene's own mesh
    True,
}

/// Which space methods may place cameras in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Space {
    /// Wherever the region, the limits and the surface leave room
    #[default]
    Open,
    /// Where the input photos prove that one can stand, as for captures
    Known,
}

/// Where around an object baselines may put cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum BaselinesFrom {
    /// Anywhere in the region that the planner has too
    Region,
    /// On its outer sphere, as the discrete methods of the paper do
    Sphere,
}

/// How the places of an object's input photos are chosen, which people choose in different ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum InputsFrom {
    /// From all around, evenly
    Uniform,
    /// From all around, at random
    Random,
    /// Evenly from one side, a third of the sphere
    Biased,
}

fn is_open(space: &Space) -> bool {
    *space == Space::Open
}

/// A region that follows from a scene's bounds.
pub(crate) const BY_BOUNDS: RegionChoice = RegionChoice { shape: None, floor: None, clearance: None, stood: None };

/// The size of everything.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EvaluationSettings {
    /// Side of the pictures in pixels.
    pub size: u32,
    /// Field of view of all cameras that photograph a scene, in degrees.
    pub fov_deg: f64,
    /// Where diffuse light comes from.
    pub light: Light,
    /// Samples of a pixel.
    pub samples: u32,
    /// Samples of a pixel of the input photos.
    pub input_samples: u32,
    /// Samples of a pixel of the test views: their noise counts against whatever is compared with them.
    pub test_samples: u32,
    /// Input photos: what methods are shown is made from them.
    pub inputs: u32,
    /// Where they are taken from.
    pub inputs_from: InputsFrom,
    /// Views of each set of tests.
    pub tests: u32,
    /// Iterations of training.
    pub iterations: u32,
    /// Most splats.
    pub max_splats: u32,
    /// What the methods are shown of the scene.
    pub shown: Shown,
    /// Which space they may place cameras in; tests are from the whole region.
    #[serde(skip_serializing_if = "is_open")]
    pub space: Space,
    /// Each pixel of a pool's photo is a square of so many stored ones.
    pub shrink: u32,
    /// Where around an object baselines may put cameras.
    pub baselines_from: BaselinesFrom,
    /// The user's limits on where in a room cameras may be placed.
    pub region: RegionChoice,
    /// Degree of the harmonics of the splats.
    pub degree: u32,
    /// Whether splats are trained and rendered with the antialiasing filter.
    pub antialiased: bool,
}

impl EvaluationSettings {
    /// The whole protocol, for a GPU.
    pub const WHOLE: Self = Self {
        size: 800,
        fov_deg: Self::FOV_DEG,
        light: Light::Traced,
        samples: 256,
        input_samples: 256,
        test_samples: 256,
        inputs: 10,
        inputs_from: InputsFrom::Uniform,
        tests: 200,
        iterations: 30_000,
        max_splats: 1_000_000,
        shown: Shown::Proxy,
        space: Space::Open,
        shrink: 1,
        baselines_from: BaselinesFrom::Region,
        region: BY_BOUNDS,
        degree: MAX_DEGREE,
        antialiased: false,
    };
    /// What two cores compute in minutes.
    pub const QUICK: Self = Self {
        size: 96,
        fov_deg: Self::FOV_DEG,
        light: Light::Traced,
        samples: 8,
        input_samples: 8,
        test_samples: 8,
        inputs: 10,
        inputs_from: InputsFrom::Uniform,
        tests: 12,
        iterations: 300,
        max_splats: 5000,
        shown: Shown::Proxy,
        space: Space::Open,
        shrink: 8,
        baselines_from: BaselinesFrom::Region,
        region: BY_BOUNDS,
        degree: MAX_DEGREE,
        antialiased: false,
    };

    /// The planner's default.
    const FOV_DEG: f64 = 50.0;

    /// The camera of all photographs.
    pub fn intrinsics(&self) -> Intrinsics {
        Intrinsics::from_fov(self.size, self.size, self.fov_deg.to_radians())
    }
}

//! The light map: diffuse light over the whole surface of a scene, baked once and read by all photographs, so that these have no noise
//! of it, and all see the same world.

mod bake;
mod file;
pub(crate) mod layout;
mod smooth;
mod trust;

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use self::bake::Found;
use self::layout::Layout;
use super::assembly::Assembly;
use super::layout::Sum;
use crate::Result;
use crate::engine::vulkan::Context;

pub(crate) use self::file::FILE;

/// How a light map is baked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LightmapSettings {
    /// Cells of the map, over both sides of all triangles.
    pub cells: u32,
    /// Most rays of a cell; it has a quarter of them at least.
    pub rays: u32,
    /// Error of a cell's direct light, relative to all of its light, from which it needs no more rays. Photographs show the mean of
    /// some ten cells.
    pub tolerance: f32,
    /// Samples of a picture's pixel: with more of them less is read off the map where it is off.
    pub samples: u32,
    /// Key of the random numbers.
    pub seed: u64,
}

/// Cells for each pixel of a picture, and how few and many they are in all.
const CELLS_OF_A_PIXEL: u64 = 4;
const CELLS: [u64; 2] = [20_000, 3_000_000];
/// Samples of a picture for each ray of a cell, and how few and many rays it has at most.
const SAMPLES_OF_A_RAY: u64 = 8192;
const RAYS: [u64; 2] = [64, 2048];

impl LightmapSettings {
    /// As fine as pictures of so many pixels show, with rays in proportion to the samples of a picture, which are few on CPUs.
    pub fn new(pixels: u64, samples: u32, seed: u64) -> Self {
        let cells = (CELLS_OF_A_PIXEL * pixels).clamp(CELLS[0], CELLS[1]) as u32;
        let rays = (pixels * u64::from(samples) / SAMPLES_OF_A_RAY).clamp(RAYS[0], RAYS[1]) as u32;
        Self { cells, rays, tolerance: 0.03, samples, seed }
    }
}

/// Where the diffuse light of photographs comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Light {
    /// A map of the scene's light, baked once
    #[default]
    Baked,
    /// Paths from every pixel
    Traced,
}

impl Light {
    /// Samples of a pixel that pictures usually have.
    pub fn samples(self) -> u32 {
        match self {
            Self::Baked => 64,
            Self::Traced => 256,
        }
    }
}

/// The light of a scene.
pub struct LightMap {
    pub(super) layout: Layout,
    /// Irradiance of each cell, of compact sources alone.
    pub(super) cells: Vec<Vec3>,
    /// Irradiance at each corner of cells, of all else.
    pub(super) corners: Vec<Vec3>,
    /// Whether photographs follow what a cell throws back in place of reading it off the corners.
    pub(super) followed: Vec<bool>,
    /// At which light is packed.
    scale: f32,
}

impl LightMap {
    /// Bakes the light of a scene, in most detail where views from `eyes`, in the world, see it; `observe` receives the share that is done, and returns whether to go on.
    ///
    /// # Errors
    /// Where the device has too little memory, fails, or `observe` requests a stop.
    pub fn bake(
        context: &Arc<Context>,
        assembly: &Assembly,
        settings: &LightmapSettings,
        eyes: &[DVec3],
        observe: impl FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Self> {
        let layout = Layout::new(assembly, settings.cells, eyes);
        let laid_out = assembly.for_light_map();
        bake::bake(context, &laid_out, layout, settings, observe)
    }

    fn of(assembly: &Assembly, layout: Layout, sums: &[Sum], samples: u32) -> Self {
        let found: Vec<Found> = sums.iter().map(Found::new).collect();
        let mut corners = smooth::smooth(assembly, &layout, &found);
        let mut cells: Vec<Vec3> = sums.iter().map(bake::compact).collect();
        // As they come back from a file, so that pictures do not depend on whether it was kept.
        let scale = file::scale_of(cells.iter().chain(&corners));
        for light in cells.iter_mut().chain(&mut corners) {
            *light = file::unpacked(file::packed(*light, scale), scale);
        }
        let followed = trust::followed(assembly, &layout, sums, &corners, samples);
        Self { layout, cells, corners, followed, scale }
    }

    /// Number of cells.
    pub fn cells(&self) -> usize {
        self.cells.len()
    }
}

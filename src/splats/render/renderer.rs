//! Pictures of Gaussians that are trained, by whatever program.

use std::sync::Arc;

use super::frame::View;
use super::layout::{self, PassPush};
use super::rasterizer::{self, Model, Rasterizer, Size, Sizes};
use super::wanted::Wanted;
use crate::engine::vulkan::footprint::Footprint;
use crate::engine::vulkan::{Buffer, Context};
use crate::scene::gaussians::Gaussians;
use crate::{Error, Result};

/// A picture. Values run row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendering {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// sRGB colour over the background, and what is left of the light behind (1 - alpha).
    pub pixels: Vec<[f32; 4]>,
    /// Sum of depths as the colours are summed, in the frame's units; the expected depth is this over alpha. Empty where it was
    /// not requested.
    pub depths: Vec<f32>,
}

impl Rendering {
    /// Of a picture over black: sRGB colours that are not multiplied by alpha, and alpha. Zero where nothing is seen.
    pub fn straight(&self) -> Vec<[f32; 4]> {
        let straight = |&[r, g, b, left]: &[f32; 4]| match 1.0 - left {
            alpha if alpha > 0.0 => [r / alpha, g / alpha, b / alpha, alpha],
            _ => [0.0; 4],
        };
        self.pixels.iter().map(straight).collect()
    }

    /// Expected depths along the optical axis, in units of which the frame's has `unit`. Zero where nothing is seen.
    pub fn expected_depths(&self, unit: f64) -> Vec<f32> {
        let expected = |(sum, pixel): (&f32, &[f32; 4])| match 1.0 - pixel[3] {
            alpha if alpha > 0.0 => (unit * f64::from(*sum) / f64::from(alpha)) as f32,
            _ => 0.0,
        };
        self.depths.iter().zip(&self.pixels).map(expected).collect()
    }
}

/// Gaussians on the device, and what makes pictures of them.
pub(crate) struct Renderer {
    pub(in crate::splats) model: Model,
    pub(in crate::splats) rasterizer: Rasterizer,
    view: Buffer,
    wanted: Wanted,
    pub(in crate::splats) degree: u32,
}

impl Renderer {
    /// Brings Gaussians, which are in a frame whose origin is near (see [`super::frame::Frame`]), to the device, for pictures of
    /// at most `largest` size.
    ///
    /// # Errors
    /// Where there are none, or the device has not enough memory.
    pub fn new(context: &Arc<Context>, gaussians: &Gaussians, largest: Size, wanted: Wanted) -> Result<Self> {
        let count = u32::try_from(gaussians.len()).unwrap_or(u32::MAX);
        if count == 0 {
            return Err(Error::request("there are no splats to render"));
        }
        let renderer = Self::empty(context, count, gaussians.degree, largest, wanted)?;
        renderer.model.parameters.upload(&layout::to_planes(gaussians, gaussians.degree, count as usize))?;
        renderer.model.population.upload(&[count])?;
        Ok(renderer)
    }

    /// Capacity for so many Gaussians with harmonics up to `degree`. Their number is not set yet.
    ///
    /// # Errors
    /// Where the device has not enough memory.
    pub(in crate::splats) fn empty(
        context: &Arc<Context>,
        most: u32,
        degree: u32,
        largest: Size,
        wanted: Wanted,
    ) -> Result<Self> {
        let capacity = most.saturating_mul(4).clamp(1 << 16, 1 << 28);
        let sizes = Sizes { gaussians: most, capacity, pixels: largest.pixels(), tiles: largest.tiles() };
        let bytes = 4 * layout::planes(degree) as u64 * u64::from(most);
        check(context, sizes, wanted, &[("parameters", bytes)])?;
        Ok(Self {
            model: Model::new(context, most, degree)?,
            rasterizer: Rasterizer::new(context, sizes, wanted)?,
            view: Buffer::device(context, "view", size_of::<View>() as u64)?,
            wanted,
            degree,
        })
    }

    /// The picture of a view of at most the largest size.
    ///
    /// # Errors
    /// Where the view is larger, or the device fails or has not enough memory.
    pub fn picture(&mut self, view: &View, background: [f32; 3]) -> Result<Rendering> {
        let size = Size { width: view.width, height: view.height };
        let sizes = *self.rasterizer.sizes();
        if size.width == 0 || size.height == 0 || size.pixels() > sizes.pixels || size.tiles() > sizes.tiles {
            let what = format!("a picture of {} x {} pixels was not provided for", size.width, size.height);
            return Err(Error::request(what));
        }
        self.view.upload(&[*view])?;
        let push = PassPush { stride: self.model.stride, degree: self.degree, background, ..PassPush::default() };
        self.rasterizer.render(&self.model, &self.view, size, push)?;
        let pixels = size.pixels() as usize;
        let depths = if self.wanted.depths { self.rasterizer.depths.download(pixels)? } else { Vec::new() };
        let picture = self.rasterizer.picture.download(pixels)?;
        Ok(Rendering { width: size.width, height: size.height, pixels: picture, depths })
    }
}

/// Checks that the device has the memory for pictures, beside `more` buffers.
fn check(context: &Context, sizes: Sizes, wanted: Wanted, more: &[(&'static str, u64)]) -> Result<()> {
    let buffers = [rasterizer::buffers(context, &sizes, wanted).as_slice(), more].concat();
    // Both entries represent all that a sort and a scan take.
    let footprint = Footprint { buffers, several: vec!["sort", "scan"] };
    footprint.check(context, "the picture", |name| match name {
        "picture" | "ends" | "tile_ends" | "ranges" | "depths" => "make smaller pictures or take a larger device",
        "parameters" | "projected" => "take fewer splats or a larger device",
        _ => "take fewer splats, smaller pictures or a larger device",
    })
}

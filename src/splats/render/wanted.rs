//! What pictures of Gaussians need beside their colours, and how many threads share a tile.

use super::layout::TILE;
use crate::engine::vulkan::Context;
use crate::{Error, Result};

/// What pictures need.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wanted {
    /// Opacities reduced by what the low-pass widens (Mip-Splatting's 2D filter).
    pub antialiased: bool,
    /// Sums of depths beside the colours.
    pub depths: bool,
    /// Gradients afterwards.
    pub gradients: bool,
    /// Gradients summed by atomic additions of floats, in whatever order they come: no two runs are the same.
    pub fast: bool,
    /// How the pixels of a tile are divided; none for what suits the device.
    pub threads: Option<Threads>,
}

impl Wanted {
    /// How the pixels of a tile are divided on a device.
    ///
    /// # Errors
    /// Where no stages do that.
    pub fn divided(self, context: &Context) -> Result<Threads> {
        self.threads.unwrap_or(Threads::of(context)).check()
    }
}

/// Threads of a workgroup of the stages that work on a tile of 256 pixels: powers of two up to 256. Gradients are sums over
/// pixels, in an order that depends on their number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Threads {
    /// Of compositing: as many as lanes, or more.
    pub forward: u32,
    /// That share a block of pixels there, and a tile in its gradient: 8 or 32.
    pub lanes: u32,
    /// Of the loss: at least 16.
    pub loss: u32,
    /// Of the Fisher information.
    pub squares: u32,
}

impl Threads {
    /// A pixel each, for GPUs.
    pub const WIDE: Self = Self { forward: 256, lanes: 32, loss: 256, squares: 256 };
    /// Many pixels each, for CPUs, on which barriers and shared memory cost more than arithmetic; eight threads fill a vector.
    pub const NARROW: Self = Self { forward: 16, lanes: 8, loss: 32, squares: 64 };

    /// Those that suit a device.
    pub fn of(context: &Context) -> Self {
        if context.physical().is_cpu() { Self::NARROW } else { Self::WIDE }
    }

    /// Rejects numbers that no stage supports.
    ///
    /// # Errors
    /// In a line with the numbers.
    pub fn check(self) -> Result<Self> {
        let Self { forward, lanes, loss, squares } = self;
        let divide = [forward, loss, squares].iter().all(|n| n.is_power_of_two() && *n <= TILE * TILE);
        if divide && matches!(lanes, 8 | 32) && forward >= lanes && loss >= TILE {
            return Ok(self);
        }
        Err(Error::request(format!("no stages divide a tile among so many threads: {self:?}; see their fields")))
    }
}

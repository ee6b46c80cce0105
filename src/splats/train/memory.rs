//! How much device memory a training run takes, known before anything is allocated.

use super::loss::{self, Record};
use super::{exposure, poses, test_poses};
use crate::engine::vulkan::Context;
use crate::splats::config::{Strategy, TrainConfig};
use crate::splats::render::frame::View;
use crate::splats::render::layout;
use crate::splats::render::rasterizer::{self, Size, Sizes};
use crate::splats::render::wanted::Wanted;

/// Capacity for instances that a run starts with: three tiles for every Gaussian that there may be, and enough for few large ones.
pub fn first_capacity(max_splats: u32) -> u32 {
    max_splats.saturating_mul(3).clamp(1 << 18, 1 << 28)
}

/// Sizes for pictures of these views.
pub fn sizes(config: &TrainConfig, views: &[View], capacity: u32) -> Sizes {
    let of = |view: &View| Size { width: view.width, height: view.height };
    Sizes {
        gaussians: config.max_splats,
        capacity,
        pixels: views.iter().map(|view| of(view).pixels()).max().unwrap_or(1),
        tiles: views.iter().map(|view| of(view).tiles()).max().unwrap_or(1),
    }
}

/// Long-lived buffers of a run by name and bytes, but for the photos.
pub fn footprint(context: &Context, config: &TrainConfig, sizes: &Sizes, views: usize) -> Vec<(&'static str, u64)> {
    let planes = 4 * layout::planes(config.degree) as u64 * u64::from(config.max_splats);
    let wanted = wanted(config);
    let mut buffers = vec![
        ("parameters", planes),
        ("first", planes),
        ("second", planes),
        ("statistics", statistics(config)),
        ("forces", forces(config)),
        ("population", 4),
        ("views", (size_of::<View>() * views) as u64),
        ("control", 4),
        ("history", size_of::<Record>() as u64 * u64::from(config.iterations)),
        ("mailbox", 16),
    ];
    buffers.extend(rasterizer::buffers(context, sizes, wanted));
    buffers.extend(loss::buffers(sizes));
    if config.exposure {
        buffers.extend(exposure::buffers(sizes, views));
    }
    if config.refine_poses {
        buffers.extend(poses::buffers(sizes, views));
        buffers.extend(test_poses::buffers(sizes, config));
    }
    buffers
}

/// Bytes of the statistics that adaptive density control decides by.
pub(super) fn statistics(config: &TrainConfig) -> u64 {
    if config.strategy == Strategy::Adc { 8 * u64::from(config.max_splats) } else { 0 }
}

/// Bytes of what turning each Gaussian about the camera and moving it change in the loss, where poses are corrected.
pub(super) fn forces(config: &TrainConfig) -> u64 {
    if config.refine_poses { 4 * poses::LEARNT as u64 * u64::from(config.max_splats) } else { 0 }
}

/// What a run needs of its pictures.
pub(super) fn wanted(config: &TrainConfig) -> Wanted {
    Wanted { antialiased: config.antialiased, depths: false, gradients: true, fast: config.fast, threads: None }
}

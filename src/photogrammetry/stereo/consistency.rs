//! Which depths other views agree with.

use std::sync::Arc;

use super::frame::StereoView;
use crate::Result;
use crate::engine::vulkan::pace::{Pace, in_parts};
use crate::engine::vulkan::{Buffer, Context, Pipeline};

crate::gpu_struct! {
    /// Push constants of `check_depth`.
    pub(crate) struct CheckPush {
        /// The view that is checked.
        pub reference: u32,
        /// Views in all.
        pub count: u32,
        /// Difference of depth that still agrees, as a fraction of depth.
        pub tolerance: f32,
    }
}

crate::stage!(
    /// How many views agree with each depth, and how many see through it.
    pub(crate) CheckDepthStage = check_depth(CheckPush) { read views, read depths, write support } with [StereoView]
);

/// Other views' evidence about a depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Support {
    /// Views whose own depth there is the same.
    pub agree: u32,
    /// Views that see past it.
    pub through: u32,
}

/// The support of every depth of every view; `depths` holds all views' pixels, 0 where there is none.
///
/// # Errors
/// Where device memory runs out or the device fails.
pub fn check(
    context: &Arc<Context>,
    views: &[StereoView],
    view_buffer: &Buffer,
    depths: &[f32],
    tolerance: f32,
) -> Result<Vec<Support>> {
    let pipeline = Pipeline::new::<CheckDepthStage>(context, &())?;
    let depth_buffer = Buffer::from_slice(context, "depths", depths)?;
    let support = Buffer::device(context, "support", 4 * depths.len() as u64)?;
    in_parts(context, &mut Pace::new(context, 1), [views.len() as u32, 1], |commands, part| {
        for reference in part {
            let view = &views[reference as usize];
            commands
                .stage(&pipeline, CheckDepthStage { views: view_buffer, depths: &depth_buffer, support: &support })
                .push(&CheckPush { reference, count: views.len() as u32, tolerance })
                .groups([view.width.div_ceil(8), view.height.div_ceil(8), 1]);
        }
        Ok(())
    })?;
    let words: Vec<u32> = support.download(depths.len())?;
    Ok(words.into_iter().map(|word| Support { agree: word & 0xffff, through: word >> 16 }).collect())
}

/// The support of one pixel: the twin of `check_depth`.
pub fn support(views: &[StereoView], depths: &[f32], reference: usize, [x, y]: [u32; 2], tolerance: f32) -> Support {
    let view = &views[reference];
    let depth = depths[(view.first + y * view.width + x) as usize];
    let mut support = Support::default();
    if depth <= 0.0 {
        return support;
    }
    let p = view.unproject(x as f32 + 0.5, y as f32 + 0.5, depth);
    for (_, other) in views.iter().enumerate().filter(|(other, _)| *other != reference) {
        let Some((texel, far)) = other.texel(p) else { continue };
        if depths[texel] <= 0.0 {
            continue;
        }
        let off = far / depths[texel] - 1.0;
        if off.abs() <= tolerance {
            support.agree += 1;
        } else if off < -3.0 * tolerance {
            support.through += 1;
        }
    }
    support
}

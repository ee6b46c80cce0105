//! The largest value under a window (`max_pool.comp`).

use super::network::{Pool, Size};
use crate::engine::vulkan::stage::Stage;
use crate::engine::vulkan::{Buffer, Pipeline, Recorder};

crate::gpu_struct! {
    /// Push constants of [`MaxPoolStage`].
    pub struct PoolPush {
        /// Width of the input.
        pub width: u32,
        /// Height of the input.
        pub height: u32,
        /// Channels of the layer.
        pub channels: u32,
        /// Width of the output.
        pub out_width: u32,
        /// Height of the output.
        pub out_height: u32,
        /// Pixels along a side of the window.
        pub window: u32,
        /// Pixels of the input from one pixel of the output to the next.
        pub stride: u32,
    }
}

crate::stage!(
    /// A thread per value of the output.
    pub MaxPoolStage = max_pool(PoolPush) { read source, write target }
);

/// Records the pooling of `source`, of `size`, to `target`, of `out`.
pub fn record<'a>(
    recorder: &mut Recorder,
    pipeline: &'a Pipeline,
    pool: Pool,
    [source, target]: [&'a Buffer; 2],
    [size, out]: [Size; 2],
) {
    let push = PoolPush {
        width: size.width,
        height: size.height,
        channels: out.channels,
        out_width: out.width,
        out_height: out.height,
        window: pool.window,
        stride: pool.stride,
    };
    let groups = (out.values() as u32).div_ceil(MaxPoolStage::SHADER.local_size[0]);
    recorder.stage(pipeline, MaxPoolStage { source, target }).push(&push).linear(groups);
}

/// The twin of `max_pool`: `source` channel by channel, row by row.
pub fn max_pool(pool: Pool, source: &[f32], size: Size, out: Size) -> Vec<f32> {
    let mut target = Vec::with_capacity(out.values());
    for (c, y) in (0..out.channels).flat_map(|c| (0..out.height).map(move |y| (c, y))) {
        for x in 0..out.width {
            let (v, u) = (y * pool.stride, x * pool.stride);
            let rows = (v..v + pool.window).map(|v| ((c * size.height + v) * size.width + u) as usize);
            let values = rows.flat_map(|first| &source[first..first + pool.window as usize]);
            target.push(values.copied().fold(f32::NEG_INFINITY, f32::max));
        }
    }
    target
}

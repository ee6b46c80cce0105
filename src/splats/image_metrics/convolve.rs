//! Convolution, bias and ReLU of a layer (`convolve.comp`; on CPUs `convolve_lanes.comp`).

use std::sync::Arc;

use super::network::{Convolution, Size};
use super::weights::Layer;
use crate::engine::vulkan::shaders::glsl::splats::image_metrics::{convolution as glsl, convolve_lanes};
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::{Error, Result};

crate::gpu_struct! {
    /// Push constants of [`ConvolveStage`].
    pub struct ConvolvePush {
        /// Width of the input.
        pub width: u32,
        /// Height of the input.
        pub height: u32,
        /// Channels of the output.
        pub out_channels: u32,
        /// Width of the output.
        pub out_width: u32,
        /// Height of the output.
        pub out_height: u32,
        /// Pixels of the input from one pixel of the output to the next.
        pub stride: u32,
        /// Rows and columns of zeros around the input.
        pub padding: u32,
        /// Taps over 16, rounded up.
        pub steps: u32,
    }
}

crate::stage!(
    /// A workgroup per 64 channels of 64 pixels.
    pub(crate) ConvolveStage = convolve(ConvolvePush) { read weights, read biases, read taps, read source, write target }
);
crate::stage!(
    /// A workgroup, a subgroup of eight lanes, per 32 channels of 32 pixels.
    pub(crate) ConvolveLanesStage = convolve_lanes(ConvolvePush) {
        read weights, read biases, read taps, read source, write target,
    }
);

/// Which of two stages with the same result convolves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConvolutionKernel {
    /// Values are shared in shared memory: for GPUs.
    Shared,
    /// Values are shared among the lanes of a subgroup of eight: for CPUs.
    Lanes,
}

/// The stage.
pub struct Convolve {
    pipeline: Pipeline,
    way: ConvolutionKernel,
}

impl Convolve {
    /// Compiles the stage that suits the device.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn new(context: &Arc<Context>) -> Result<Self> {
        let physical = context.physical();
        let narrow = physical.is_cpu() && physical.subgroup_width == Some(convolve_lanes::LANES);
        Self::by(context, if narrow { ConvolutionKernel::Lanes } else { ConvolutionKernel::Shared })
    }

    /// Compiles one of them.
    ///
    /// # Errors
    /// Where the device fails, or its subgroups are not those that [`ConvolutionKernel::Lanes`] asks for.
    pub fn by(context: &Arc<Context>, way: ConvolutionKernel) -> Result<Self> {
        if way == ConvolutionKernel::Lanes && context.physical().subgroup_width != Some(convolve_lanes::LANES) {
            let what = format!("{} has no subgroups of {}", context.physical().name, convolve_lanes::LANES);
            return Err(Error::request(what));
        }
        let pipeline = match way {
            ConvolutionKernel::Shared => Pipeline::new::<ConvolveStage>(context, &())?,
            ConvolutionKernel::Lanes => Pipeline::new::<ConvolveLanesStage>(context, &())?,
        };
        Ok(Self { pipeline, way })
    }
}

/// Channels, and pixels, that a workgroup makes; as in the shader.
const TILE: u32 = glsl::TILE;
/// Taps that it takes at a time; as in the shader.
const STEP: u32 = glsl::STEP;

/// A layer's weights on the device, in the order in which the stage reads them.
pub struct Kernels {
    convolution: Convolution,
    weights: Buffer,
    biases: Buffer,
    taps: Buffer,
}

impl Kernels {
    /// Uploads a layer.
    ///
    /// # Errors
    /// Where device memory runs out or the device fails.
    pub fn new(context: &Arc<Context>, layer: &Layer) -> Result<Self> {
        let convolution = layer.convolution;
        let (kernel, count) = (convolution.kernel as usize, convolution.taps() as usize);
        let rows = convolution.taps().next_multiple_of(STEP) as usize;
        let columns = convolution.to.next_multiple_of(TILE) as usize;
        let mut weights = vec![0f32; rows * columns];
        for (channel, kernels) in layer.weights.chunks(count).enumerate() {
            for (tap, weight) in kernels.iter().enumerate() {
                weights[tap * columns + channel] = *weight;
            }
        }
        // What fills the last step up reads the first value, times weights of zero.
        let mut taps = vec![0u32; rows];
        for (tap, packed) in taps[..count].iter_mut().enumerate() {
            let (channel, row, column) = (tap / (kernel * kernel), tap / kernel % kernel, tap % kernel);
            *packed = (channel << 16 | row << 8 | column) as u32;
        }
        Ok(Self {
            convolution,
            weights: Buffer::from_slice(context, "weights", &weights)?,
            biases: Buffer::from_slice(context, "biases", &layer.biases)?,
            taps: Buffer::from_slice(context, "taps", &taps)?,
        })
    }

    /// Records the layer from `source`, of `size`, to `target`, of `out`.
    pub fn record<'a>(
        &'a self,
        recorder: &mut Recorder,
        convolve: &'a Convolve,
        [source, target]: [&'a Buffer; 2],
        [size, out]: [Size; 2],
    ) {
        let groups = |channels, pixels| out.channels.div_ceil(channels) * out.pixels().div_ceil(pixels);
        let push = ConvolvePush {
            width: size.width,
            height: size.height,
            out_channels: out.channels,
            out_width: out.width,
            out_height: out.height,
            stride: self.convolution.stride,
            padding: self.convolution.padding,
            steps: self.convolution.taps().div_ceil(STEP),
        };
        let Self { weights, biases, taps, .. } = self;
        let Convolve { pipeline, way } = convolve;
        match way {
            ConvolutionKernel::Shared => recorder
                .stage(pipeline, ConvolveStage { weights, biases, taps, source, target })
                .push(&push)
                .linear(groups(TILE, TILE)),
            ConvolutionKernel::Lanes => recorder
                .stage(pipeline, ConvolveLanesStage { weights, biases, taps, source, target })
                .push(&push)
                .linear(groups(convolve_lanes::CHANNELS, convolve_lanes::PIXELS)),
        }
    }
}

/// The twin of `convolve`, in f64: `source` channel by channel, row by row.
pub fn convolve(layer: &Layer, source: &[f32], size: Size, out: Size) -> Vec<f32> {
    let Convolution { from, kernel, stride, padding, .. } = layer.convolution;
    let mut target = Vec::with_capacity(out.values());
    for channel in 0..out.channels {
        for (y, x) in (0..out.height).flat_map(|y| (0..out.width).map(move |x| (y, x))) {
            let mut sum = f64::from(layer.biases[channel as usize]);
            for (c, row) in (0..from).flat_map(|c| (0..kernel).map(move |row| (c, row))) {
                let v = (y * stride + row).wrapping_sub(padding);
                for column in 0..kernel {
                    let u = (x * stride + column).wrapping_sub(padding);
                    if u < size.width && v < size.height {
                        let weight = layer.weights[(((channel * from + c) * kernel + row) * kernel + column) as usize];
                        let value = source[((c * size.height + v) * size.width + u) as usize];
                        sum += f64::from(weight) * f64::from(value);
                    }
                }
            }
            target.push(sum.max(0.0) as f32);
        }
    }
    target
}

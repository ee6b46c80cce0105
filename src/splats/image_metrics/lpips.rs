//! LPIPS on the device: how different two pictures look (Zhang et al. 2018, "The Unreasonable Effectiveness of Deep
//! Features as a Perceptual Metric"), version 0.1 with its learnt weights.

use std::sync::Arc;

use super::Rgb8;
use super::convolve::{Convolve, Kernels};
use super::lpips_distance::{DistancePush, LpipsDistanceStage};
use super::lpips_planes::{LpipsPlanesStage, PlanesPush, values};
use super::max_pool::{self, MaxPoolStage};
use super::network::{Network, Pool, Size, Step, TAPS};
use super::weights::Weights;
use crate::engine::primitives::{Count, Operation, Reduce};
use crate::engine::vulkan::pace::Pace;
use crate::engine::vulkan::stage::Stage;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::{Error, Result};

/// A network on the device. Buffers are kept from one pair of pictures to the next of the same size.
pub struct Lpips {
    context: Arc<Context>,
    network: Network,
    parts: Vec<Part>,
    /// What the bytes of a picture mean.
    values: Buffer,
    pipelines: Pipelines,
    buffers: Option<LayerBuffers>,
    // Of millions of products of a channel read and one written.
    pace: Pace,
}

/// Such products of the first submission, in millions: a tenth of a second of a device that does half a million million operations a second.
const FIRST_PRODUCTS: u32 = 2500;

/// A step of the network with its weights.
enum Part {
    Convolve(Box<Kernels>),
    Pool(Pool),
    /// What each channel counts.
    Compare(Buffer),
}

struct Pipelines {
    planes: Pipeline,
    convolve: Convolve,
    max_pool: Pipeline,
    distance: Pipeline,
}

/// Buffers for pictures of one size.
struct LayerBuffers {
    sizes: Vec<Size>,
    /// Bytes of each picture, on the host and on the device.
    pictures: [[Buffer; 2]; 2],
    // Of each picture, what a step reads and what it writes, in turns.
    features: [[Buffer; 2]; 2],
    distances: Buffer,
    sums: Buffer,
    reduce: Reduce,
}

impl Lpips {
    /// Uploads the weights.
    ///
    /// # Errors
    /// Where device memory runs out or the device fails.
    pub fn new(context: &Arc<Context>, weights: &Weights) -> Result<Self> {
        let (mut layers, mut linear) = (weights.layers.iter(), weights.linear.iter());
        // Weights have a layer for each convolution and a list of what channels count for each comparison: so none is skipped.
        let parts = weights.network.steps().iter().filter_map(|step| match step {
            Step::Convolve(_) => layers.next().map(|layer| Ok(Part::Convolve(Box::new(Kernels::new(context, layer)?)))),
            Step::Pool(pool) => Some(Ok(Part::Pool(*pool))),
            Step::Tap => linear.next().map(|counts| Ok(Part::Compare(Buffer::from_slice(context, "counts", counts)?))),
        });
        Ok(Self {
            context: context.clone(),
            network: weights.network,
            parts: parts.collect::<Result<_>>()?,
            values: Buffer::from_slice(context, "values", &values())?,
            pipelines: Pipelines {
                planes: Pipeline::new::<LpipsPlanesStage>(context, &())?,
                convolve: Convolve::new(context)?,
                max_pool: Pipeline::new::<MaxPoolStage>(context, &())?,
                distance: Pipeline::new::<LpipsDistanceStage>(context, &())?,
            },
            buffers: None,
            pace: Pace::new(context, FIRST_PRODUCTS),
        })
    }

    /// The network.
    pub fn network(&self) -> Network {
        self.network
    }

    /// Refuses pictures that are too small for the network or too large for the device.
    ///
    /// # Errors
    /// As for [`Lpips::distance`].
    pub fn check(context: &Context, network: Network, width: u32, height: u32) -> Result<()> {
        Needs::new(context, network, Size { channels: 3, width, height }).map(|_| ())
    }

    /// The distance of two pictures: 0 where they are the same, about 1 where they have nothing in common.
    ///
    /// # Errors
    /// Where the pictures differ in size, are smaller than [`Network::least`] or too large for the device, or it fails.
    pub fn distance(&mut self, a: &Rgb8, b: &Rgb8) -> Result<f64> {
        Ok(self.per_layer(a, b)?.iter().sum())
    }

    /// What each of the layers that are compared adds to the distance.
    ///
    /// # Errors
    /// As for [`Lpips::distance`].
    pub fn per_layer(&mut self, a: &Rgb8, b: &Rgb8) -> Result<[f64; TAPS]> {
        a.check_size(b)?;
        let size = Size { channels: 3, width: a.width(), height: a.height() };
        // The old buffers go first: both may not fit.
        let kept = self.buffers.take().filter(|buffers| buffers.sizes.first() == Some(&size));
        let buffers = match kept {
            Some(buffers) => buffers,
            None => LayerBuffers::new(&self.context, self.network, size)?,
        };
        let mut pace = self.pace.clone();
        let layers = self.run(&buffers, [a, b], &mut pace);
        self.pace = pace;
        self.buffers = Some(buffers);
        layers
    }

    fn run(&self, buffers: &LayerBuffers, pictures: [&Rgb8; 2], pace: &mut Pace) -> Result<[f64; TAPS]> {
        let mut commands = Recorder::paced(&self.context)?;
        for (picture, ([host, device], features)) in pictures.iter().zip(buffers.pictures.iter().zip(&buffers.features))
        {
            host.write(picture.pixels())?;
            commands.copy(host, device, device.size());
            let bound = LpipsPlanesStage { picture: device, values: &self.values, planes: &features[0] };
            let pixels = buffers.sizes[0].pixels();
            let groups = pixels.div_ceil(LpipsPlanesStage::SHADER.local_size[0]);
            commands.stage(&self.pipelines.planes, bound).push(&PlanesPush { pixels }).linear(groups);
        }
        let (mut from, mut pixels) = (0, Vec::with_capacity(TAPS));
        let (mut products, mut since) = (0, 0);
        for (part, sizes) in self.parts.iter().zip(buffers.sizes.windows(2)) {
            let sizes = [sizes[0], sizes[1]];
            let in_turns = buffers.features.each_ref().map(|buffers| [&buffers[from], &buffers[1 - from]]);
            match part {
                Part::Convolve(kernels) => {
                    let [read, written] = sizes;
                    let each = u64::from(read.channels) * u64::from(written.channels) * u64::from(written.pixels());
                    for buffers in in_turns {
                        let more = (each / 1_000_000) as u32;
                        if since > 0 && since + more > pace.items() {
                            commands.cut()?;
                            since = 0;
                        }
                        (products, since) = (products + more, since + more);
                        kernels.record(&mut commands, &self.pipelines.convolve, buffers, sizes);
                    }
                    from = 1 - from;
                }
                Part::Pool(pool) => {
                    for buffers in in_turns {
                        max_pool::record(&mut commands, &self.pipelines.max_pool, *pool, buffers, sizes);
                    }
                    from = 1 - from;
                }
                Part::Compare(counts) => {
                    let [[first, _], [second, _]] = in_turns;
                    let count = sizes[0].pixels();
                    commands
                        .stage(
                            &self.pipelines.distance,
                            LpipsDistanceStage { weights: counts, first, second, distances: &buffers.distances },
                        )
                        .push(&DistancePush { channels: sizes[0].channels, pixels: count })
                        .linear(count.div_ceil(LpipsDistanceStage::SHADER.local_size[0]));
                    let tap = pixels.len() as u32;
                    buffers.reduce.record(&mut commands, &buffers.distances, Count::Host(count), &buffers.sums, tap)?;
                    pixels.push(f64::from(count));
                }
            }
        }
        pace.took(products, commands.submit_and_wait()?);
        let sums: Vec<f32> = buffers.sums.download(TAPS)?;
        Ok(std::array::from_fn(|tap| f64::from(sums[tap]) / pixels[tap]))
    }
}

/// What comparing pictures of one size takes.
struct Needs {
    sizes: Vec<Size>,
    /// Bytes of the largest layer.
    largest: u64,
    /// Pixels of the largest layer that is compared.
    pixels: u32,
}

impl Needs {
    fn new(context: &Context, network: Network, size: Size) -> Result<Self> {
        let Size { width, height, .. } = size;
        let sizes = network.sizes(width, height).ok_or_else(|| {
            let (name, least) = (network.name(), network.least());
            Error::request(format!(
                "LPIPS with {name} needs {least} pixels a side and the images have {width} x {height}; compare larger ones"
            ))
        })?;
        let refuse = |part: &str, wanted, available| {
            Err(Error::OutOfMemory {
                what: format!("LPIPS with {} of {width} x {height} pixels ({part})", network.name()),
                wanted,
                available,
                remedy: "compare smaller images, take the smaller network (AlexNet) or a larger device".into(),
            })
        };
        // Some devices show a shader no more than a part of a buffer, so that the largest layer may be too large by itself.
        let largest = 4 * sizes.iter().map(|size| size.values() as u64).max().unwrap_or(0);
        let physical = context.physical();
        let limit = physical.storage_range.min(physical.allocation);
        if largest > limit {
            return refuse("the largest layer", largest, limit);
        }
        let pixels = compared_pixels(network, &sizes);
        let all = 2 * picture_bytes(size) + room_bytes(largest, pixels);
        let free = context.memory_available();
        if all > free {
            return refuse("what is kept of both", all, free);
        }
        Ok(Self { sizes, largest, pixels })
    }
}

impl LayerBuffers {
    fn new(context: &Arc<Context>, network: Network, size: Size) -> Result<Self> {
        let Needs { sizes, largest, pixels } = Needs::new(context, network, size)?;
        let features = |name| Buffer::device(context, name, largest);
        let bytes = picture_bytes(size);
        let picture = || Ok([Buffer::host(context, "picture", bytes)?, Buffer::device(context, "picture", bytes)?]);
        Ok(Self {
            pictures: [picture()?, picture()?],
            features: [
                [features("features a 0")?, features("features a 1")?],
                [features("features b 0")?, features("features b 1")?],
            ],
            distances: Buffer::device(context, "distances", 4 * u64::from(pixels))?,
            sums: Buffer::device(context, "sums", 4 * TAPS as u64)?,
            reduce: Reduce::new(context, Operation::SumF32, pixels)?,
            sizes,
        })
    }
}

/// Pixels of the largest layer that is compared.
fn compared_pixels(network: Network, sizes: &[Size]) -> u32 {
    let compared = network.steps().iter().zip(sizes).filter(|(step, _)| **step == Step::Tap);
    compared.map(|(_, size)| size.pixels()).max().unwrap_or(0)
}

/// Bytes of a picture, a byte for each value, in whole words.
fn picture_bytes(size: Size) -> u64 {
    (size.values() as u64).next_multiple_of(4)
}

/// Bytes of the buffers for layers of at most `largest` bytes.
fn room_bytes(largest: u64, pixels: u32) -> u64 {
    4 * largest + 4 * u64::from(pixels) + Reduce::footprint(pixels)
}

//! Weights of LPIPS: those of AlexNet come with the crate, others from safetensors files.

use std::path::Path;

use half::f16;
use safetensors::{Dtype, SafeTensors};

use super::network::{Convolution, Network};
use crate::{Error, Result};

/// AlexNet's, in half precision; licences beside the file.
const ALEX: &[u8] = include_bytes!("../../../assets/lpips/alex_f16.safetensors");

/// Taps and side of the largest kernel that the stage takes; see [`Convolution::taps`].
const MAX_TAPS: u32 = 32_768;
const MAX_SIDE: u32 = 255;

/// A convolution with its weights.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    pub(super) convolution: Convolution,
    pub(super) weights: Vec<f32>,
    pub(super) biases: Vec<f32>,
}

impl Layer {
    /// `weights` lie by channel of the output, channel of the input, row and column; `biases` by channel of the output.
    ///
    /// # Errors
    /// Where these are not as many as the convolution has, or it is none: no stride, no kernel or one that is too large.
    pub fn new(convolution: Convolution, weights: Vec<f32>, biases: Vec<f32>) -> Result<Self> {
        let Convolution { from, to, kernel, stride, .. } = convolution;
        let is_one = stride > 0
            && (1..=MAX_SIDE).contains(&kernel)
            && (1..=MAX_TAPS).contains(&from)
            && (1..=MAX_TAPS).contains(&to)
            && convolution.taps() <= MAX_TAPS;
        let counts = [weights.len(), biases.len()];
        if !is_one || counts != [to as usize * convolution.taps() as usize, to as usize] {
            let what =
                format!("{counts:?} weights and biases make no layer of {convolution:?}; give as many as it has");
            return Err(Error::request(what));
        }
        Ok(Self { convolution, weights, biases })
    }
}

/// All weights of a network.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    pub(super) network: Network,
    pub(super) layers: Vec<Layer>,
    pub(super) linear: Vec<Vec<f32>>,
}

impl Weights {
    /// AlexNet's that come with the crate, in half precision: distances differ from those of full precision by less
    /// than 1e-3.
    ///
    /// # Errors
    /// None that a user could cause.
    pub fn alex() -> Result<Self> {
        Self::parse(Path::new("the weights of AlexNet in this program"), ALEX, Network::Alex)
    }

    /// Reads a safetensors file: `conv{i}.weight` (out, in, rows, columns), `conv{i}.bias` (out) and `lin{i}.weight`
    /// (channels), each in f16 or f32. Other tensors are ignored.
    ///
    /// # Errors
    /// [`Error::Io`] where the system refuses; [`Error::Input`] where the file is damaged or cut short, or a tensor is
    /// missing, of another shape or type, or not finite.
    pub fn read(path: &Path, network: Network) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|source| match source.kind() {
            std::io::ErrorKind::NotFound => Error::input(path, "there is no such file or folder; check the path"),
            std::io::ErrorKind::IsADirectory => Error::input(path, "this is a folder; give a file of weights"),
            _ => Error::io(path, source),
        })?;
        Self::parse(path, &bytes, network)
    }

    /// As [`Weights::read`], of the bytes of a file; `path` is for messages only.
    ///
    /// # Errors
    /// As for [`Weights::read`].
    pub fn parse(path: &Path, bytes: &[u8], network: Network) -> Result<Self> {
        let file = SafeTensors::deserialize(bytes).map_err(|e| {
            // What the message quotes of the file may hold line breaks, and be of any length.
            let why: String = e.to_string().chars().filter(|c| !c.is_control()).take(200).collect();
            Error::input(path, format!("this is no whole safetensors file ({why}); copy or make it again"))
        })?;
        let tensor = |name: String, shape: &[u32]| tensor(path, &file, &name, shape, network);
        let layer = |(i, convolution): (usize, Convolution)| {
            let Convolution { from, to, kernel, .. } = convolution;
            let weights = tensor(format!("conv{i}.weight"), &[to, from, kernel, kernel])?;
            Layer::new(convolution, weights, tensor(format!("conv{i}.bias"), &[to])?)
        };
        Ok(Self {
            network,
            layers: network.convolutions().enumerate().map(layer).collect::<Result<_>>()?,
            linear: (network.taps().enumerate())
                .map(|(i, channels)| tensor(format!("lin{i}.weight"), &[channels]))
                .collect::<Result<_>>()?,
        })
    }

    /// The network that they are of.
    pub fn network(&self) -> Network {
        self.network
    }

    /// CRC-32 of all values.
    pub fn fingerprint(&self) -> u32 {
        let of_layers = self.layers.iter().flat_map(|layer| [&layer.weights, &layer.biases]);
        let mut crc = crc32fast::Hasher::new();
        of_layers.chain(&self.linear).for_each(|values| crc.update(bytemuck::cast_slice(values)));
        crc.finalize()
    }

    /// Its convolutions in order.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// For each layer that is compared, what each channel counts.
    pub fn linear(&self) -> &[Vec<f32>] {
        &self.linear
    }
}

/// The values of a tensor, which must have `shape`.
fn tensor(path: &Path, file: &SafeTensors, name: &str, shape: &[u32], network: Network) -> Result<Vec<f32>> {
    let refuse = |what: String| {
        let remedy = format!("give weights of {} as scripts/make_lpips_weights.py writes them", network.name());
        Error::input(path, format!("{what}; {remedy}"))
    };
    let Ok(view) = file.tensor(name) else { return Err(refuse(format!("it has no tensor {name:?}"))) };
    let wanted: Vec<usize> = shape.iter().map(|side| *side as usize).collect();
    if view.shape() != wanted {
        return Err(refuse(format!("{name:?} has the shape {:?}, not {wanted:?}", view.shape())));
    }
    // The reader has checked shape and type against the available bytes.
    let values: Vec<f32> = match view.dtype() {
        Dtype::F32 => view.data().chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect(),
        Dtype::F16 => view.data().chunks_exact(2).map(|b| f16::from_le_bytes([b[0], b[1]]).to_f32()).collect(),
        other => return Err(refuse(format!("{name:?} is of type {other:?}, not F16 or F32"))),
    };
    match values.iter().all(|value| value.is_finite()) {
        true => Ok(values),
        false => Err(refuse(format!("{name:?} holds values that are not finite"))),
    }
}

//! Weights of LPIPS's networks as files, made here.
#![allow(dead_code, reason = "each test binary uses a part")]

use camsplat::splats::image_metrics::Network;
use camsplat::splats::image_metrics::network::Convolution;
use half::f16;
use safetensors::{Dtype, serialize, tensor::TensorView};

/// A safetensors file in f16 with every tensor of a network. `value` gets the tensor's name, the index of the value
/// and how many values make one channel.
pub fn file(network: Network, value: impl Fn(&str, usize, usize) -> f32) -> Vec<u8> {
    let mut tensors = Vec::new();
    let mut add = |name: String, shape: Vec<usize>| {
        let (count, channel) = (shape.iter().product::<usize>(), shape[1..].iter().product());
        let bytes = (0..count).flat_map(|i| f16::from_f32(value(&name, i, channel)).to_le_bytes()).collect::<Vec<u8>>();
        tensors.push((name, shape, bytes));
    };
    for (i, Convolution { from, to, kernel, .. }) in network.convolutions().enumerate() {
        add(format!("conv{i}.weight"), [to, from, kernel, kernel].map(|side| side as usize).to_vec());
        add(format!("conv{i}.bias"), vec![to as usize]);
    }
    for (i, channels) in network.taps().enumerate() {
        add(format!("lin{i}.weight"), vec![channels as usize]);
    }
    let views =
        tensors.iter().map(|(name, shape, bytes)| (name, TensorView::new(Dtype::F16, shape.clone(), bytes).unwrap()));
    serialize(views, None).unwrap()
}

/// VGG16 with weights of our own, which keep values at about the size that they have (He et al. 2015).
pub fn vgg() -> Vec<u8> {
    // In [-1, 1), by SplitMix64 (Steele et al. 2014).
    let noise = |i: usize| {
        let mut z = (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) as i64 as f64 / 2f64.powi(63)) as f32
    };
    file(Network::Vgg, |name, i, channel| match name {
        _ if name.starts_with("lin") => noise(i).abs(),
        _ if name.ends_with(".bias") => 0.05 * noise(i),
        _ => noise(i) * (6.0 / channel as f32).sqrt(),
    })
}

//! PSNR, SSIM and LPIPS against other programs, and every stage against its twin with the validation layers on.

use std::path::Path;
use std::sync::LazyLock;

use crate::support::buffers::random;
use crate::support::data::data_folder;
use crate::support::device::{context, silent};
use crate::support::images::Image;
use crate::support::lpips_weights::{file, vgg};
use camsplat::engine::vulkan::{Buffer, Pipeline, Recorder};
use camsplat::splats::image_metrics::convolve::{ConvolutionKernel, Convolve, Kernels, convolve};
use camsplat::splats::image_metrics::lpips_distance::{DistancePush, LpipsDistanceStage, lpips_distance};
use camsplat::splats::image_metrics::lpips_planes::{self, LpipsPlanesStage, PlanesPush, lpips_planes};
use camsplat::splats::image_metrics::max_pool::{self, MaxPoolStage, max_pool};
use camsplat::splats::image_metrics::network::{Convolution, Pool, Size, Step};
use camsplat::splats::image_metrics::weights::Layer;
use camsplat::splats::image_metrics::{Lpips, Network, Rgb8, Weights, psnr, ssim};
use camsplat::{Error, Result};
use half::f16;
use serde_json::Value;

/// Random values in [-1, 1).
fn values(seed: u64, count: usize) -> Vec<f32> {
    random(seed, count).into_iter().map(|word| (f64::from(word) / f64::from(1u32 << 31) - 1.0) as f32).collect()
}

/// If this failed, our figures could not be compared with those of other programs. The expected ones are scikit-image's (0.26):
///
/// ```python
/// import numpy as np
/// from skimage.metrics import peak_signal_noise_ratio as psnr, structural_similarity as ssim
/// def image(w, h, seed, amount):
///     i = np.arange(3 * w * h, dtype=np.uint64)
///     noise = ((i * 2654435761 + seed * 2246822519) % 2**32 >> 24) % amount
///     return ((5 * (i // 3 % w) + 3 * (i // 3 // w) + 50 * (i % 3)) % 200 + noise).astype(np.uint8).reshape(h, w, 3)
/// for w, h, p, q in [(61, 47, (1, 20), (2, 20)), (61, 47, (1, 1), (2, 56)),
///                    (11, 11, (3, 50), (4, 50)), (200, 13, (5, 3), (6, 9))]:
///     a, b = image(w, h, *p), image(w, h, *q)
///     print(psnr(a, b, data_range=255), ssim(a, b, gaussian_weights=True, sigma=1.5, use_sample_covariance=False,
///                                            data_range=255, channel_axis=2))
/// ```
#[test]
fn psnr_and_ssim_are_those_of_scikit_image() {
    for (width, height, (seed_a, amount_a), (seed_b, amount_b), expected) in [
        (61, 47, (1, 20), (2, 20), [30.435_715_0, 0.836_307_2]),
        (61, 47, (1, 1), (2, 56), [18.443_392_7, 0.535_308_7]),
        (11, 11, (3, 50), (4, 50), [20.315_049_8, 0.000_628_3]),
        (200, 13, (5, 3), (6, 9), [35.890_389_6, 0.975_020_3]),
    ] {
        let (a, b) = (Image::new(width, height, seed_a, amount_a), Image::new(width, height, seed_b, amount_b));
        let found = [psnr(&a.view(), &b.view()).unwrap(), ssim(&a.view(), &b.view()).unwrap()];
        for (found, expected) in found.into_iter().zip::<[f64; 2]>(expected) {
            assert!((found - expected).abs() < 1e-6, "{width} x {height}: {found}, not {expected}");
        }
    }
}

/// If this failed, an image that is right in every pixel would not be distinguished from one that nearly is.
#[test]
fn the_same_image_is_infinitely_like_itself() {
    let image = Image::new(20, 30, 7, 40);
    assert_eq!(psnr(&image.view(), &image.view()).unwrap(), f64::INFINITY);
    assert_eq!(ssim(&image.view(), &image.view()).unwrap(), 1.0);
}

/// If this failed, images that cannot be compared would end in a panic, or in a number.
#[test]
fn what_cannot_be_compared_is_refused() {
    let (a, b, small) = (Image::new(32, 40, 1, 9), Image::new(40, 32, 1, 9), Image::new(40, 10, 1, 9));
    let says = |result: Result<f64>, fragment: &str| {
        let message = result.unwrap_err().to_string();
        assert!(message.contains(fragment) && message.lines().count() == 1, "{message}");
    };
    let context = context();
    let mut lpips = Lpips::new(&context, &Weights::alex().unwrap()).unwrap();
    says(psnr(&a.view(), &b.view()), "32 x 40 and 40 x 32");
    says(ssim(&a.view(), &b.view()), "32 x 40 and 40 x 32");
    says(lpips.distance(&a.view(), &b.view()), "32 x 40 and 40 x 32");
    says(ssim(&small.view(), &small.view()), "SSIM needs 11 pixels a side");
    says(lpips.distance(&small.view(), &small.view()), "AlexNet needs 31 pixels a side");
    assert!(Rgb8::new(2, 2, &[0; 11]).is_err() && Rgb8::new(0, 2, &[]).is_err());
    assert!(Rgb8::new(u32::MAX, u32::MAX, &[0; 3]).is_err());
    silent(&context);
}

/// If this failed, a convolution would be wrong at a border, past a whole tile or step, or for a stride or padding that
/// neither network has.
#[test]
fn convolve_matches_its_twin() -> Result<()> {
    let context = context();
    let mut ways = vec![Convolve::by(&context, ConvolutionKernel::Shared)?];
    if context.physical().subgroup_width == Some(8) {
        ways.push(Convolve::by(&context, ConvolutionKernel::Lanes)?);
    }
    for (from, to, kernel, stride, padding, width, height) in [
        (3, 64, 11, 4, 2, 35, 41),
        (1, 1, 1, 1, 0, 5, 3),
        (5, 70, 3, 1, 1, 13, 9),
        (17, 129, 5, 2, 3, 12, 15),
        (64, 3, 7, 3, 0, 20, 31),
        (6, 10, 2, 5, 4, 1, 1),
        (512, 65, 3, 1, 1, 9, 8),
        // As many taps as there may be: the most iterations of its loops.
        (32_768, 2, 1, 1, 0, 3, 2),
    ] {
        let convolution = Convolution { from, to, kernel, stride, padding };
        let size = Size { channels: from, width, height };
        let out = convolution.of(size).unwrap();
        let scale = 1.0 / (convolution.taps() as f32).sqrt();
        let weights = values(1, (to * convolution.taps()) as usize).into_iter().map(|weight| scale * weight).collect();
        let layer = Layer::new(convolution, weights, values(2, to as usize))?;
        let source = values(3, size.values());
        let input = Buffer::from_slice(&context, "input", &source)?;
        let kernels = Kernels::new(&context, &layer)?;
        let expected = convolve(&layer, &source, size, out);
        assert!(expected.contains(&0.0) || expected.len() < 4, "ReLU has something to do");
        let mut first = None;
        for way in &ways {
            let output = Buffer::from_slice(&context, "output", &vec![-7f32; out.values() + 1])?;
            let mut commands = Recorder::new(&context)?;
            kernels.record(&mut commands, way, [&input, &output], [size, out]);
            commands.submit_and_wait()?;
            let mut found: Vec<f32> = output.download(out.values() + 1)?;
            assert_eq!(found.pop(), Some(-7.0), "{convolution:?} writes past its end");
            for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
                assert!((found - expected).abs() < 1e-5, "{convolution:?}, value {i}: {found}, not {expected}");
            }
            let first = first.get_or_insert_with(|| found.clone());
            assert_eq!(*first, found, "{convolution:?}: the ways differ in bits");
        }
    }
    silent(&context);
    Ok(())
}

/// If this failed, a pool would look beside its window, or leave the last row out.
#[test]
fn max_pool_matches_its_twin() -> Result<()> {
    let context = context();
    let pipeline = Pipeline::new::<MaxPoolStage>(&context, &())?;
    for (window, stride, channels, width, height) in
        [(3, 2, 5, 17, 24), (2, 2, 70, 9, 7), (1, 1, 1, 1, 1), (4, 3, 2, 4, 13)]
    {
        let pool = Pool { window, stride };
        let size = Size { channels, width, height };
        let out = pool.of(size).unwrap();
        let source = values(4, size.values());
        let input = Buffer::from_slice(&context, "input", &source)?;
        let output = Buffer::from_slice(&context, "output", &vec![7f32; out.values() + 1])?;
        let mut commands = Recorder::new(&context)?;
        max_pool::record(&mut commands, &pipeline, pool, [&input, &output], [size, out]);
        commands.submit_and_wait()?;
        let expected = [max_pool(pool, &source, size, out), vec![7.0]].concat();
        assert_eq!(output.download::<f32>(out.values() + 1)?, expected, "{pool:?}");
    }
    silent(&context);
    Ok(())
}

/// If this failed, networks would see other colours than they were trained with, or the last pixels of a picture whose bytes do not fill
/// whole words would be those of another.
#[test]
fn lpips_planes_matches_its_twin() -> Result<()> {
    let context = context();
    let pipeline = Pipeline::new::<LpipsPlanesStage>(&context, &())?;
    let values = Buffer::from_slice(&context, "values", lpips_planes::values().as_flattened())?;
    for (width, height) in [(1, 1), (16, 16), (13, 5), (67, 3)] {
        let bytes: Vec<u8> = random(9, 3 * width * height).into_iter().map(|word| (word >> 24) as u8).collect();
        let picture = Rgb8::new(width as u32, height as u32, &bytes)?;
        let mut words = bytes.clone();
        words.resize(bytes.len().next_multiple_of(4), 0);
        let words = Buffer::from_slice(&context, "picture", &words)?;
        let output = Buffer::device(&context, "output", 4 * bytes.len() as u64)?;
        let push = PlanesPush { pixels: (width * height) as u32 };
        let mut commands = Recorder::new(&context)?;
        let bound = LpipsPlanesStage { picture: &words, values: &values, planes: &output };
        commands.stage(&pipeline, bound).push(&push).linear(push.pixels.div_ceil(64));
        commands.submit_and_wait()?;
        assert_eq!(output.download::<f32>(bytes.len())?, lpips_planes(&picture), "{width} x {height}");
    }
    silent(&context);
    Ok(())
}

/// If this failed, features would be weighed wrongly, or a pixel without any be NaN.
#[test]
fn lpips_distance_matches_its_twin() -> Result<()> {
    let context = context();
    let pipeline = Pipeline::new::<LpipsDistanceStage>(&context, &())?;
    for (channels, pixels) in [(1, 1), (64, 63), (192, 65), (512, 130)] {
        let features = |seed| -> Vec<f32> {
            let values = values(seed, channels * pixels);
            // Pixel 0 has no features, as a black one may have after ReLU.
            values.iter().enumerate().map(|(i, v)| if i % pixels == 0 { 0.0 } else { v.max(0.0) }).collect()
        };
        let (first, second) = (features(5), features(6));
        let weights: Vec<f32> = values(7, channels).iter().map(|weight| weight.abs()).collect();
        let [a, b, w] = [&first, &second, &weights].map(|data| Buffer::from_slice(&context, "features", data));
        let (a, b, w) = (a?, b?, w?);
        let output = Buffer::device(&context, "output", 4 * pixels as u64)?;
        for (other, other_features) in [(&b, &second), (&a, &first)] {
            let mut commands = Recorder::new(&context)?;
            let push = DistancePush { channels: channels as u32, pixels: pixels as u32 };
            let groups = push.pixels.div_ceil(64);
            let bound = LpipsDistanceStage { weights: &w, first: &a, second: other, distances: &output };
            commands.stage(&pipeline, bound).push(&push).linear(groups);
            commands.submit_and_wait()?;
            let expected = lpips_distance(&weights, &first, other_features, pixels);
            for (found, expected) in output.download::<f32>(pixels)?.into_iter().zip(expected) {
                assert!((found - expected).abs() <= 1e-5 * expected, "{channels} channels: {found}, not {expected}");
            }
        }
    }
    silent(&context);
    Ok(())
}

/// LPIPS by the twins of its stages.
fn by_twins(weights: &Weights, a: &Rgb8, b: &Rgb8) -> Vec<f64> {
    let steps = weights.network().steps();
    let sizes = weights.network().sizes(a.width(), a.height()).unwrap();
    let (mut layers, mut linear) = (weights.layers().iter(), weights.linear().iter());
    let mut features = [lpips_planes(a), lpips_planes(b)];
    let mut distances = Vec::new();
    for (step, sizes) in steps.iter().zip(sizes.windows(2)) {
        match step {
            Step::Convolve(_) => {
                let layer = layers.next().unwrap();
                features = features.map(|source| convolve(layer, &source, sizes[0], sizes[1]));
            }
            Step::Pool(pool) => features = features.map(|source| max_pool(*pool, &source, sizes[0], sizes[1])),
            Step::Tap => {
                let pixels = sizes[0].pixels() as usize;
                let found = lpips_distance(linear.next().unwrap(), &features[0], &features[1], pixels);
                distances.push(found.into_iter().map(f64::from).sum::<f64>() / pixels as f64);
            }
        }
    }
    distances
}

static VGG: LazyLock<Weights> = LazyLock::new(|| Weights::parse(Path::new("vgg"), &vgg(), Network::Vgg).unwrap());

/// If this failed, layers would be in the wrong order, buffers of one size be used for another, or a result depend on
/// what was compared before.
#[test]
fn whole_networks_match_their_twins_and_keep_their_buffers() -> Result<()> {
    let context = context();
    for (weights, first, second) in [(&Weights::alex()?, (33, 47), (40, 31)), (&*VGG, (17, 16), (16, 21))] {
        let pair = |(width, height)| [Image::new(width, height, 1, 30), Image::new(width, height, 2, 56)];
        let measure = |lpips: &mut Lpips, size| {
            let [a, b] = pair(size);
            lpips.per_layer(&a.view(), &b.view())
        };
        let mut lpips = Lpips::new(&context, weights)?;
        let found = measure(&mut lpips, first)?;
        let [a, b] = pair(first);
        let expected = by_twins(weights, &a.view(), &b.view());
        assert!(expected.iter().all(|layer| *layer > 1e-4), "there is something to compare: {expected:?}");
        for (layer, expected_layer) in found.iter().zip(&expected) {
            assert!((layer - expected_layer).abs() < 1e-5, "{:?}: {found:?}, not {expected:?}", weights.network());
        }
        assert_eq!(lpips.distance(&a.view(), &a.view())?, 0.0, "an image is not like itself");
        let other = measure(&mut lpips, second)?;
        assert_eq!(other, measure(&mut Lpips::new(&context, weights)?, second)?, "another size");
        assert_eq!(lpips.distance(&a.view(), &b.view())?, found.iter().sum::<f64>(), "the first size again");
    }
    silent(&context);
    Ok(())
}

/// If this failed, a large image would be measured by a part of its pixels, or end in a message about a buffer.
#[test]
fn images_beyond_the_device_are_refused() -> Result<()> {
    let context = context();
    let pixels = context.physical().storage_range.min(context.physical().allocation) / (4 * 64) + 1;
    if pixels > 1 << 22 {
        println!("skipped: the device takes large images");
        return Ok(());
    }
    let image = Image { width: pixels as u32 / 16 + 1, height: 16, pixels: vec![0; 48 * (pixels as usize / 16 + 1)] };
    let error = Lpips::new(&context, &VGG)?.distance(&image.view(), &image.view()).unwrap_err();
    assert!(matches!(error, Error::OutOfMemory { .. }), "{error}");
    assert!(error.to_string().contains("VGG16") && error.to_string().contains("smaller images"), "{error}");
    silent(&context);
    Ok(())
}

/// If this failed, weights that are damaged or of another network would be measured with.
#[test]
fn weights_that_are_none() {
    let whole = file(Network::Alex, |_, _, _| 0.5);
    let path = Path::new("w.safetensors");
    let refused = |bytes: &[u8], fragments: &[&str]| {
        let message = Weights::parse(path, bytes, Network::Alex).unwrap_err().to_string();
        assert!(message.starts_with("w.safetensors: ") && message.lines().count() == 1, "{message}");
        assert!(fragments.iter().all(|fragment| message.contains(fragment)), "{fragments:?} not in {message}");
    };
    assert!(Weights::parse(path, &whole, Network::Alex).is_ok());
    for length in [0, 1, 8, 9, 100, whole.len() / 2, whole.len() - 1] {
        refused(&whole[..length], &["no whole safetensors file", "copy or make it again"]);
    }
    refused(&[&[0xff; 8], &whole[8..]].concat(), &["no whole safetensors file"]);
    // The header's length does not change.
    let with = |from: &str, to: &str| {
        let at = whole.windows(from.len()).position(|window| window == from.as_bytes()).unwrap();
        [&whole[..at], to.as_bytes(), &whole[at + to.len()..]].concat()
    };
    refused(&with("conv3.bias", "conv3.bios"), &["no tensor \"conv3.bias\"", "AlexNet", "make_lpips_weights.py"]);
    refused(
        &with("[64,3,11,11]", "[3,64,11,11]"),
        &["\"conv0.weight\" has the shape [3, 64, 11, 11], not [64, 3, 11, 11]"],
    );
    refused(&with("\"F16\"", "\"I16\""), &["is of type I16, not F16 or F32"]);
    // A name with a line break in it does not break the message.
    refused(&with("\"F16\"", "\"F\\n\""), &["no whole safetensors file", "unknown variant"]);
    let mut infinite = whole.clone();
    let last = infinite.len() - 2;
    infinite[last..].copy_from_slice(&f16::INFINITY.to_le_bytes());
    refused(&infinite, &["not finite"]);
    let other = Weights::parse(path, &whole, Network::Vgg).unwrap_err().to_string();
    assert!(other.contains("\"conv0.weight\" has the shape [64, 3, 11, 11], not [64, 3, 3, 3]"), "{other}");
    assert!(
        Weights::read(Path::new("none.safetensors"), Network::Vgg).unwrap_err().to_string().contains("no such file")
    );
}

/// If this failed, a layer would be made of the wrong number of weights, or loop longer than some drivers do.
#[test]
fn layers_that_are_none() {
    let layer = |from, kernel, stride, count| {
        let convolution = Convolution { from, to: 2, kernel, stride, padding: 0 };
        Layer::new(convolution, vec![0.0; count], vec![0.0; 2]).is_ok()
    };
    assert!(layer(3, 2, 1, 24));
    assert!(!layer(3, 2, 1, 23) && !layer(3, 2, 0, 24) && !layer(0, 2, 1, 0) && !layer(3, 0, 1, 0));
    assert!(!layer(32_769, 1, 1, 2 * 32_769) && !layer(1, 256, 1, 2 * 65_536) && !layer(u32::MAX, 2, 1, 0));
}

fn load(path: &Path) -> Image {
    let image = image::open(path).unwrap().to_rgb8();
    Image { width: image.width(), height: image.height(), pixels: image.into_raw() }
}

/// If this failed, our LPIPS would differ from the metric that papers report.
#[test]
#[ignore = "needs the folder CAMSPLAT_DATA"]
fn lpips_is_that_of_the_reference() -> Result<()> {
    let folder = data_folder().join("lpips");
    let golden: Value = serde_json::from_slice(&std::fs::read(folder.join("golden.json")).unwrap()).unwrap();
    let context = context();
    let full = Weights::read(&folder.join("lpips_alex.safetensors"), Network::Alex)?;
    let vgg = Weights::read(&folder.join("lpips_vgg16_f16.safetensors"), Network::Vgg)?;
    for (weights, name, tolerance) in
        [(full, "alex_f32", 1e-5), (Weights::alex()?, "alex_f32", 1e-3), (vgg, "vgg_f16", 1e-5)]
    {
        let mut lpips = Lpips::new(&context, &weights)?;
        for pair in golden[name]["pairs"].as_array().unwrap() {
            let [a, b] = ["a", "b"].map(|side| load(&folder.join(pair[side].as_str().unwrap())));
            let layers = lpips.per_layer(&a.view(), &b.view())?;
            let expected = pair["per_layer"].as_array().unwrap().iter().map(|layer| layer.as_f64().unwrap());
            let found = layers.into_iter().chain([layers.iter().sum()]);
            for (found, expected) in found.zip(expected.chain(pair["distance"].as_f64())) {
                assert!((found - expected).abs() < tolerance, "{name} {pair}: {found}, not {expected}");
            }
        }
    }
    silent(&context);
    Ok(())
}

/// If this failed, real images would be measured otherwise than made ones. Expected figures as above, of the files in the
/// folder.
#[test]
#[ignore = "needs the folder CAMSPLAT_DATA"]
fn psnr_and_ssim_of_real_images_are_those_of_scikit_image() {
    let folder = data_folder().join("lpips");
    for (a, b, expected) in [
        ("ex_ref", "ex_p0", [18.045_541_4, 0.436_746_1]),
        ("ex_ref", "ex_p1", [13.867_510_1, 0.295_903_1]),
        ("apple", "pear", [6.497_826_5, 0.135_987_4]),
    ] {
        let [a, b] = [a, b].map(|name| load(&folder.join(name).with_extension("png")));
        let found = [psnr(&a.view(), &b.view()).unwrap(), ssim(&a.view(), &b.view()).unwrap()];
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6, "{found}, not {expected}");
        }
    }
}

//! `camsplat metrics`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::options::{DeviceOptions, print_messages};
use super::overwrite_guard::check_output_file;
use super::session::Ended;
use crate::files::io::folder::{check_file, write_files};
use crate::files::photos::Header;
use crate::files::photos::decode::{Encoded, encoded};
use crate::splats::image_metrics::{ImageMetrics, Lpips, Network, Rgb8, SSIM_WINDOW, Weights, psnr, ssim};
use crate::{Error, Result};

/// Arguments of `camsplat metrics`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Image, or folder of images (PNG, JPEG)
    images: PathBuf,
    /// Reference image, or folder of reference images of the same names and sizes; extensions may differ
    reference: PathBuf,
    /// Networks that LPIPS is measured with
    #[arg(long, value_enum, default_value = "alex")]
    lpips: Networks,
    /// Weights of AlexNet (safetensors) [default: those in this program, in half precision]
    #[arg(long, value_name = "FILE")]
    lpips_alex: Option<PathBuf>,
    /// Weights of VGG16 (safetensors); scripts/make_lpips_weights.py makes them
    #[arg(long, value_name = "FILE", env = "CAMSPLAT_LPIPS_VGG")]
    lpips_vgg: Option<PathBuf>,
    /// Background behind transparent pixels
    #[arg(long, value_enum, default_value = "black")]
    background: Background,
    /// Write the metrics here too
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceOptions,
}

/// Networks to measure LPIPS with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Networks {
    Alex,
    Vgg,
    Both,
    None,
}

/// What transparent pixels are laid over.
#[derive(Clone, Copy, Debug, Serialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
enum Background {
    Black,
    White,
}

/// An image and its reference.
struct Pair {
    name: String,
    files: [PathBuf; 2],
}

/// Files to compare, and names that are in one folder only.
struct Pairs {
    pairs: Vec<Pair>,
    unpaired: [Vec<String>; 2],
}

/// What is written as JSON.
#[derive(Serialize)]
struct Record<'a> {
    images: &'a Path,
    reference: &'a Path,
    background: Background,
    mean: ImageMetrics,
    pairs: Vec<Measured<'a>>,
    only_in_images: &'a [String],
    only_in_reference: &'a [String],
}

/// A pair's metrics.
#[derive(Serialize)]
struct Measured<'a> {
    name: &'a str,
    #[serde(flatten)]
    metrics: ImageMetrics,
}

/// Measures and prints.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    if let Some(file) = &arguments.json {
        check_file(file)?;
    }
    let Pairs { pairs, unpaired } = pairs(&arguments.images, &arguments.reference)?;
    if let Some(file) = &arguments.json {
        let weights = [&arguments.lpips_alex, &arguments.lpips_vgg];
        check_output_file(file, pairs.iter().flat_map(|pair| &pair.files).chain(weights.into_iter().flatten()))?;
    }
    let weights = weights(arguments)?;
    pairs.iter().try_for_each(|pair| check_size(pair, &weights))?;
    say!("pairs    {}, transparent pixels over {}", pairs.len(), arguments.background.name());
    for (names, folder) in unpaired.iter().zip([&arguments.images, &arguments.reference]) {
        if !names.is_empty() {
            say!("unpaired {} only in {}: {}", names.len(), folder.display(), names.join(", "));
        }
    }
    let context = if weights.is_empty() { None } else { Some(arguments.device.open()?) };
    let mut lpips = Vec::new();
    if let Some(context) = &context {
        say!("device   {}", context.physical().title());
        lpips = weights.iter().map(|weights| Lpips::new(context, weights)).collect::<Result<Vec<_>>>()?;
    }
    let width = pairs.iter().map(|pair| pair.name.chars().count()).max().unwrap_or(0).max(8);
    print_row(width, "image", &["PSNR", "SSIM"].into_iter().chain(weights.iter().map(heading)).collect::<Vec<_>>());
    let mut measured = Vec::with_capacity(pairs.len());
    for pair in &pairs {
        let metrics = measure(pair, arguments.background, &mut lpips)?;
        print_metrics(width, &pair.name, &metrics);
        measured.push(Measured { name: &pair.name, metrics });
    }
    let mean = ImageMetrics::mean(measured.iter().map(|measured| measured.metrics));
    print_metrics(width, "mean", &mean);
    if let Some(context) = &context {
        print_messages(context);
    }
    if let Some(file) = &arguments.json {
        let record = Record {
            images: &arguments.images,
            reference: &arguments.reference,
            background: arguments.background,
            mean,
            pairs: measured,
            only_in_images: &unpaired[0],
            only_in_reference: &unpaired[1],
        };
        let text = serde_json::to_string_pretty(&record)
            .map_err(|e| Error::request(format!("the metrics cannot be written: {e}")))?;
        write_files(&[(file, text.as_bytes())])?;
    }
    Ok(Ended::Done)
}

impl Background {
    fn name(self) -> &'static str {
        match self {
            Self::Black => "black",
            Self::White => "white",
        }
    }

    fn colour(self) -> [u8; 3] {
        match self {
            Self::Black => [0; 3],
            Self::White => [255; 3],
        }
    }
}

/// The weights of every network that was asked for.
fn weights(arguments: &Arguments) -> Result<Vec<Weights>> {
    let mut weights = Vec::new();
    if matches!(arguments.lpips, Networks::Alex | Networks::Both) {
        weights.push(match &arguments.lpips_alex {
            Some(file) => Weights::read(file, Network::Alex)?,
            None => Weights::alex()?,
        });
    }
    if matches!(arguments.lpips, Networks::Vgg | Networks::Both) {
        let Some(file) = &arguments.lpips_vgg else {
            return Err(Error::request(
                "LPIPS with VGG16 needs its weights; make them with scripts/make_lpips_weights.py and name the file with \
                 --lpips-vgg or CAMSPLAT_LPIPS_VGG",
            ));
        };
        weights.push(Weights::read(file, Network::Vgg)?);
    }
    Ok(weights)
}

/// Pairs two files, or the files of two folders by their names without extensions.
fn pairs(images: &Path, reference: &Path) -> Result<Pairs> {
    for path in [images, reference] {
        if !path.exists() {
            return Err(Error::input(path, "there is no such file or folder; check the path"));
        }
    }
    if images.is_dir() != reference.is_dir() {
        let folder = if images.is_dir() { images } else { reference };
        return Err(Error::input(folder, "this is a folder and the other is not; give two images or two folders"));
    }
    if !images.is_dir() {
        let name = images.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let pair = Pair { name, files: [images.to_owned(), reference.to_owned()] };
        return Ok(Pairs { pairs: vec![pair], unpaired: [Vec::new(), Vec::new()] });
    }
    let (found, mut left) = (images_in(images)?, images_in(reference)?);
    let (mut pairs, mut alone) = (Vec::new(), Vec::new());
    for (name, file) in found {
        match left.remove(&name) {
            Some(other) => pairs.push(Pair { name, files: [file, other] }),
            None => alone.push(name),
        }
    }
    if pairs.is_empty() {
        let what =
            format!("no image here has the name of one in {}; names count without extension", reference.display());
        return Err(Error::input(images, what));
    }
    Ok(Pairs { pairs, unpaired: [alone, left.into_keys().collect()] })
}

/// The images of a folder by their names without extensions.
fn images_in(folder: &Path) -> Result<BTreeMap<String, PathBuf>> {
    let entries = std::fs::read_dir(folder).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
    let mut images: BTreeMap<String, PathBuf> = BTreeMap::new();
    for entry in entries.map_err(|source| Error::io(folder, source))? {
        let path = entry.path();
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        if !matches!(extension.as_str(), "png" | "jpg" | "jpeg") || path.is_dir() {
            continue;
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if images.contains_key(&name) {
            return Err(Error::input(folder, format!("two images are called {name:?}; leave one of them here")));
        }
        images.insert(name, path);
    }
    if images.is_empty() {
        return Err(Error::input(folder, "the folder holds no PNG or JPEG images; name one that does"));
    }
    Ok(images)
}

/// Refuses, before anything is computed, a pair of different sizes or one that is too small.
fn check_size(pair: &Pair, weights: &[Weights]) -> Result<()> {
    let size = |file: &Path| {
        let header = Header::read(file)
            .map_err(|e| Error::input(file, format!("the image cannot be decoded ({e}); give a PNG or JPEG file")))?;
        Ok((header.width, header.height))
    };
    let [image, reference] = &pair.files;
    let ((width, height), other) = (size(image)?, size(reference)?);
    if (width, height) != other {
        let (reference, (other_width, other_height)) = (reference.display(), other);
        let what = format!(
            "it has {width} x {height} pixels and its reference {reference} {other_width} x {other_height}; give them \
             one size"
        );
        return Err(Error::input(image, what));
    }
    let of_network = |weights: &Weights| (heading(weights), weights.network().least(), " or another --lpips");
    let mut needs = std::iter::once(("SSIM", SSIM_WINDOW, "")).chain(weights.iter().map(of_network));
    match needs.find(|(_, least, _)| width.min(height) < *least) {
        Some((metric, least, otherwise)) => {
            let what = format!("it has {width} x {height} pixels and {metric} needs {least} a side");
            Err(Error::input(image, format!("{what}; give larger images{otherwise}")))
        }
        None => Ok(()),
    }
}

/// Measures a pair.
fn measure(pair: &Pair, background: Background, lpips: &mut [Lpips]) -> Result<ImageMetrics> {
    let [image, reference] = [0, 1].map(|i| encoded(&pair.files[i], background.colour()));
    let (image, reference) = (image?, reference?);
    let [a, b] = [view(&image)?, view(&reference)?];
    let mut metrics = ImageMetrics { psnr: psnr(&a, &b)?, ssim: ssim(&a, &b)?, lpips_alex: None, lpips_vgg: None };
    for lpips in lpips {
        let distance = Some(lpips.distance(&a, &b)?);
        match lpips.network() {
            Network::Alex => metrics.lpips_alex = distance,
            Network::Vgg => metrics.lpips_vgg = distance,
        }
    }
    Ok(metrics)
}

fn view(image: &Encoded) -> Result<Rgb8<'_>> {
    Rgb8::new(image.width, image.height, &image.pixels)
}

fn heading(weights: &Weights) -> &'static str {
    match weights.network() {
        Network::Alex => "LPIPS alex",
        Network::Vgg => "LPIPS vgg",
    }
}

fn print_metrics(width: usize, name: &str, metrics: &ImageMetrics) {
    let lpips = [metrics.lpips_alex, metrics.lpips_vgg].into_iter().flatten().map(|d| format!("{d:.4}"));
    let cells: Vec<String> =
        [format!("{:.2}", metrics.psnr), format!("{:.4}", metrics.ssim)].into_iter().chain(lpips).collect();
    print_row(width, name, &cells.iter().map(String::as_str).collect::<Vec<_>>());
}

fn print_row(width: usize, name: &str, cells: &[&str]) {
    let cells: String = cells.iter().map(|cell| format!(" {cell:>11}")).collect();
    say!("{name:<width$}{cells}");
}

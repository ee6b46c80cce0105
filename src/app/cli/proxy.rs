//! `camsplat proxy`.

use std::path::PathBuf;

use clap::Args;

use super::options::{DeviceOptions, ImageOptions, print_messages};
use super::overwrite_guard::check_output_file;
use super::session::Ended;
use crate::files::io::depth_maps::DepthMaps;
use crate::files::io::folder::{check_file, write_files};
use crate::files::io::photos;
use crate::files::io::ply::write;
use crate::photogrammetry::stereo::{self, Reconstruction, StereoOptions};
use crate::{Error, Result};

/// Arguments of `camsplat proxy`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Photos with poses: COLMAP folder, transforms.json, NSVF folder
    capture: PathBuf,
    /// PLY file to write: oriented points that `plan` reads
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Maximum number of photos to use; the most evenly spread are chosen
    #[arg(long, default_value_t = 30)]
    photos: usize,
    /// Longest side in pixels that photos are shrunk to
    #[arg(long, default_value_t = 320)]
    resolution: u32,
    /// Depth hypotheses per pixel before refinement
    #[arg(long, default_value_t = 64, conflicts_with = "depths")]
    hypotheses: u32,
    /// Do not carve a visual hull from masks or alpha
    #[arg(long)]
    no_hull: bool,
    /// Take the depth range from the capture's sparse points, not from its cameras
    #[arg(long)]
    use_points: bool,
    /// Smallest depth, in the capture's units [default: from where the cameras look, in a walk from the capture's points or by stereo]
    #[arg(long, requires = "far")]
    near: Option<f64>,
    /// Largest depth, in the capture's units [default: as --near]
    #[arg(long, requires = "near")]
    far: Option<f64>,
    /// Depth maps to take in place of stereo: NAME.png (16 bits, millimetres) or NAME.npy (the capture's units), along the optical axis
    /// [default: those of Polycam's raw export]
    #[arg(long, value_name = "FOLDER")]
    depths: Option<PathBuf>,
    /// Make depths by stereo though the capture brings depth maps along
    #[arg(long, conflicts_with = "depths")]
    no_depths: bool,
    /// Confidence of the depth maps, NAME.png or NAME.npy [default: the folder `confidence` beside the depths, where there is one]
    #[arg(long, value_name = "FOLDER", conflicts_with = "no_depths")]
    confidence: Option<PathBuf>,
    /// Least confidence of depths that count, in the maps' own values [default: above a third of the largest in PNG, the median in .npy]
    #[arg(long, value_name = "VALUE", conflicts_with = "no_depths")]
    min_confidence: Option<f64>,
    #[command(flatten)]
    images: ImageOptions,
    /// Memory for photos that are being decoded, in MiB
    #[arg(long, default_value_t = 1024, value_name = "MIB")]
    memory: u64,
    /// Seed of the choice of photos and of the refinement
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    device: DeviceOptions,
}

impl Arguments {
    fn options(&self) -> Result<StereoOptions> {
        for (option, value, low, high) in
            [("--resolution", self.resolution, 64, 1024), ("--hypotheses", self.hypotheses, 16, 256)]
        {
            if !(low..=high).contains(&value) {
                return Err(Error::request(format!("{option} is {value}; give {low} to {high}")));
            }
        }
        if let Some(least) = self.min_confidence.filter(|least| !least.is_finite()) {
            return Err(Error::request(format!("--min-confidence is {least}; give a number")));
        }
        let depths = self.near.zip(self.far).map(|(near, far)| [near, far]);
        if let Some([near, far]) = depths.filter(|[near, far]| !(*near > 0.0 && far > near && far.is_finite())) {
            return Err(Error::request(format!("--near {near} and --far {far} are no range; give 0 < near < far")));
        }
        Ok(StereoOptions {
            photos: self.photos,
            resolution: self.resolution,
            hypotheses: self.hypotheses,
            hull: !self.no_hull,
            use_points: self.use_points,
            depths,
            maps: self.maps()?,
            memory: self.memory.saturating_mul(1 << 20),
            skip_unreadable: self.images.skip_missing,
            seed: self.seed,
        })
    }

    /// The depth maps that the options name, or that the capture brings along.
    fn maps(&self) -> Result<Option<DepthMaps>> {
        let given = self.depths.clone().map(DepthMaps::new);
        let found = given.or_else(|| DepthMaps::of_capture(&self.capture).filter(|_| !self.no_depths));
        let Some(mut maps) = found else {
            return match self.confidence.is_some() || self.min_confidence.is_some() {
                true => Err(Error::request(
                    "--confidence and --min-confidence are for depth maps; name these with --depths",
                )),
                false => Ok(None),
            };
        };
        maps.confidence = self.confidence.clone().or(maps.confidence);
        maps.min_confidence = self.min_confidence;
        if let Some(folder) = [Some(&maps.folder), maps.confidence.as_ref()].into_iter().flatten().find(|f| !f.is_dir())
        {
            return Err(Error::input(
                folder,
                "this is no folder; give one with a map for each photo, NAME.png or NAME.npy",
            ));
        }
        if maps.min_confidence.is_some() && maps.confidence.is_none() {
            let what =
                "there is no folder confidence/ beside the depth maps; name that of their confidence with --confidence";
            return Err(Error::input(&maps.folder, what));
        }
        Ok(Some(maps))
    }
}

/// Makes the surface, writes it and prints what came out.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let options = arguments.options()?;
    check_file(&arguments.out)?;
    check_output_file(&arguments.out, [&arguments.capture])?;
    let set = photos::read(&arguments.capture, &arguments.images.options())?;
    for note in &set.notes {
        say!("{note}");
    }
    let context = arguments.device.open()?;
    say!("device   {}", context.physical().title());
    let found = stereo::reconstruct(&context, &set, &options)?;
    print_messages(&context);
    write_files(&[(&arguments.out, &write::surface_points(&found.points))])?;
    print(&found);
    say!("proxy    {}", arguments.out.display());
    Ok(Ended::Done)
}

/// Prints how a surface came about.
fn print(found: &Reconstruction) {
    let Reconstruction { points, from_depths, photos, skipped, notes, pairs, depths: [near, far], kept, seconds } =
        found;
    for reason in skipped {
        say!("left out: {reason}");
    }
    for note in notes {
        say!("{note}");
    }
    let (compared, source) = match pairs {
        0 => (String::new(), "depth maps"),
        _ => (format!("{pairs} pairs compared, "), "stereo"),
    };
    say!("photos   {} used, {compared}depths from {near:.3} to {far:.3}", photos.len());
    let all = points.positions.len();
    say!(
        "points   {all}: {from_depths} from {source}, {} from the hull; {:.0}% of pixels kept a depth",
        all - from_depths,
        100.0 * kept
    );
    let stages: Vec<String> = seconds.iter().map(|(name, seconds)| format!("{name} {seconds:.2} s")).collect();
    say!("time     {:.2} s: {}", seconds.iter().map(|(_, s)| s).sum::<f64>(), stages.join(", "));
}

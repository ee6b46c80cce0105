//! `camsplat render`.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use super::options::{DeviceOptions, parse_size, print_messages};
use super::overwrite_guard::check_output_folder;
use super::progress::{Progress, stop_on_interrupt};
use super::session::Ended;
use crate::Result;
use crate::files::io;
use crate::files::io::folder::OutputFolder;
use crate::files::io::picture::{Format, renamed};
use crate::splats::render::pictures::{Job, Outcome, RenderSettings, resize};

/// Arguments of `camsplat render`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Trained splats from any program: .ply in the usual 3DGS layout or packed, .spz, .sog, .splat, or .glb with
    /// KHR_gaussian_splatting
    model: PathBuf,
    /// Cameras in the model's frame: COLMAP folder, transforms.json, plan.json, NSVF folder, .log trajectory
    cameras: PathBuf,
    /// Folder to write: a picture for each camera, by the camera's name
    #[arg(long)]
    out: PathBuf,
    /// Write into a folder that is not empty; files of the same names are replaced, all others stay
    #[arg(long)]
    force: bool,
    /// Format of the pictures
    #[arg(long, value_enum, default_value = "png")]
    format: Format,
    /// Write alpha, and leave the background out
    #[arg(long, conflicts_with = "background")]
    alpha: bool,
    /// Write depths too, as NAME.depth.exr: the expected depth along the optical axis in the model's units, 0 where nothing is
    /// seen
    #[arg(long)]
    depth: bool,
    /// Colour behind everything: black, white, or sRGB values R,G,B from 0 to 1
    #[arg(long, default_value = "black", value_parser = parse_colour, value_name = "COLOUR")]
    background: Colour,
    /// The model was trained with antialiasing (Mip-Splatting's 2D filter) [default: as its file says]
    #[arg(long)]
    antialiased: bool,
    /// Size of the pictures in pixels, of the same shape as the cameras' [default: the cameras']
    #[arg(long, value_parser = parse_size, value_name = "WxH")]
    size: Option<(u32, u32)>,
    /// Nearest depth that is drawn, in the model's units [default: 0.01 of the cameras' extent]
    #[arg(long)]
    near: Option<f64>,
    #[command(flatten)]
    device: DeviceOptions,
}

/// An sRGB colour.
type Colour = [f32; 3];

/// Renders and writes.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let folder = OutputFolder::create(&arguments.out, arguments.force)?;
    check_output_folder(&arguments.out, [&arguments.model, &arguments.cameras])?;
    let (mut cameras, notes) = io::read_cameras_with_notes(&arguments.cameras)?;
    if let Some((width, height)) = arguments.size {
        resize(&mut cameras, width, height)?;
    }
    let (gaussians, more) = io::read_gaussians_with_notes(&arguments.model)?;
    let settings = RenderSettings {
        format: arguments.format,
        alpha: arguments.alpha,
        depth: arguments.depth,
        background: arguments.background,
        antialiased: arguments.antialiased || gaussians.antialiased,
        near: arguments.near,
    };
    let job = Job::new(&cameras, settings)?;
    for note in notes.iter().chain(&renamed(&cameras)).chain(&more) {
        say!("{note}");
    }
    let context = arguments.device.open()?;
    say!("device   {}", context.physical().title());

    stop_on_interrupt()?;
    let start = Instant::now();
    let all = cameras.len() as u32;
    let progress = Progress::over("rendering", all, "pictures");
    let outcome = job.run(&context, gaussians, &folder, |done| progress.advance(done, all));
    progress.finish();
    let Outcome { pictures, empty } = outcome?;
    print_messages(&context);
    if pictures < all {
        folder.commit()?;
        say!("stopped after {pictures} of {all} pictures, which are written; --force makes all of them anew");
        return Ok(Ended::Stopped);
    }
    folder.commit()?;
    let seconds = start.elapsed().as_secs_f64();
    say!("pictures {all} in {seconds:.2} s, {:.1} a second", f64::from(all) / seconds);
    if empty > 0 {
        say!("         {empty} show nothing: check that the cameras are in the model's frame");
    }
    say!("written  {}", arguments.out.display());
    Ok(Ended::Done)
}

/// Reads a colour, such as black or 0.2,0.5,1.
fn parse_colour(text: &str) -> Result<Colour, String> {
    let values: Vec<f32> = match text {
        "black" => vec![0.0; 3],
        "white" => vec![1.0; 3],
        _ => text.split(',').map(str::parse).collect::<Result<_, _>>().unwrap_or_default(),
    };
    match values[..] {
        [r, g, b] if values.iter().all(|value| (0.0..=1.0).contains(value)) => Ok([r, g, b]),
        _ => Err("give black, white, or red, green and blue from 0 to 1, such as 0.2,0.5,1".into()),
    }
}

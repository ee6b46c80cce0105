//! `camsplat capture`.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use clap::{Args, ValueEnum};
use glam::DVec3;

use super::options::{DeviceOptions, parse_size, print_messages};
use super::overwrite_guard::check_output_folder;
use super::progress::{Progress, stop_on_interrupt};
use super::session::{Ended, go_on};
use crate::engine::vulkan::Context;
use crate::files::io;
use crate::files::io::environment::read_environment;
use crate::files::io::gltf::read_model;
use crate::files::io::picture::renamed;
use crate::lab::path_tracer::assembly::Assembly;
use crate::lab::path_tracer::capture::{self, Outcome};
use crate::lab::path_tracer::inside::cameras_inside;
use crate::lab::path_tracer::lightmap::{self, Light, LightMap};
use crate::lab::path_tracer::metering::metered;
use crate::lab::path_tracer::outputs::{Outputs, Record, named, recorded_exposure};
use crate::lab::path_tracer::tracer::Tracer;
use crate::scene::camera::Camera;
use crate::splats::render::pictures::resize;
use crate::{Error, Result};

/// Arguments of `camsplat capture`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Scene with its materials and lamps: a .glb or .gltf file
    scene: PathBuf,
    /// Cameras in the scene's frame: plan.json, COLMAP folder, transforms.json, NSVF folder, .log trajectory
    cameras: PathBuf,
    /// Folder to write: images, transforms.json, a COLMAP model with points, masks. A stopped capture continues
    #[arg(long)]
    out: PathBuf,
    /// Write into a folder that is not empty; files of the same names are replaced, all others stay
    #[arg(long)]
    force: bool,
    /// Environment map that lights the scene: an equirectangular .hdr file, +Y up
    #[arg(long, value_name = "FILE")]
    env: Option<PathBuf>,
    /// Samples of each pixel [default: 256; where light is baked 64, and up to four times as many where their error would be seen]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    spp: Option<u32>,
    /// Diffuse light: baked once into a map of the scene (light.map), so that photographs have next to no noise of it, or traced for each pixel
    /// [default: baked where nine of ten cameras stand within the scene's bounds, as in a room]
    #[arg(long, value_enum)]
    light: Option<Light>,
    /// Size of the pictures in pixels, of the same shape as the cameras' [default: the cameras']
    #[arg(long, value_parser = parse_size, value_name = "WxH")]
    size: Option<(u32, u32)>,
    /// Seed of every random number
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Exposure of the 8-bit pictures, in stops: each doubles the light; `auto` meters so that a hundredth of the pixels is brighter
    /// than white. One for all, so that views agree
    #[arg(long, value_name = "STOPS", default_value = "0", allow_hyphen_values = true, value_parser = parse_stops)]
    exposure: Stops,
    /// Background behind the scene
    #[arg(long, value_enum, default_value = "auto")]
    background: Background,
    /// Write depths along the optical axis, as depth/NAME.exr, in the scene's units; 0 where nothing is seen
    #[arg(long)]
    depth: bool,
    /// Write normals in the scene's axes, as normals/NAME.exr
    #[arg(long)]
    normals: bool,
    /// Write linear radiance too, as linear/NAME.exr
    #[arg(long)]
    exr: bool,
    #[command(flatten)]
    device: DeviceOptions,
}

/// An exposure in stops, or metered.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stops {
    Auto,
    At(f32),
}

/// What is behind the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Background {
    /// The environment where nine of ten cameras stand within the scene's bounds, as in a room; else nothing
    Auto,
    /// Nothing: alpha is 0, and masks are written
    Alpha,
    /// The environment, or black: pictures are opaque
    Env,
}

/// Percentage of pixels brighter than white from which a line says so.
const CLIPPED: f64 = 2.0;

/// Photographs and writes.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let inputs = [Some(&arguments.scene), Some(&arguments.cameras), arguments.env.as_ref()];
    check_output_folder(&arguments.out, inputs.into_iter().flatten())?;
    let (mut cameras, mut notes) = io::read_cameras_with_notes(&arguments.cameras)?;
    if let Some((width, height)) = arguments.size {
        resize(&mut cameras, width, height)?;
    }
    notes.extend(renamed(&cameras));
    let cameras = named(&cameras)?;
    let model = read_model(&arguments.scene, &mut notes)?;
    let environment = arguments.env.as_deref().map(|path| read_environment(path, &mut notes)).transpose()?;
    let assembly = Assembly::new(&model, environment.as_ref()).map_err(|error| match error {
        Error::Request(what) => Error::input(&arguments.scene, what),
        other => other,
    })?;
    let pixels = |camera: &Camera| u64::from(camera.intrinsics.width) * u64::from(camera.intrinsics.height);
    let most = cameras.iter().map(pixels).max().unwrap_or(1);
    // One that strays through a window makes no object of a room.
    let inside = cameras.iter().filter(|camera| assembly.contains(camera.pose.position)).count();
    let within = 10 * inside >= 9 * cameras.len();
    if inside > 0 && inside < cameras.len() {
        notes.push(format!("{} of {} cameras stand outside of the scene", cameras.len() - inside, cameras.len()));
    }
    let light = arguments.light.unwrap_or(if within { Light::Baked } else { Light::Traced });
    let samples = arguments.spp.unwrap_or(light.samples());
    // A metered capture that was stopped continues as it was metered.
    let recorded =
        (arguments.exposure == Stops::Auto && !arguments.force).then(|| recorded_exposure(&arguments.out)).flatten();
    let mut record = Record {
        version: env!("CARGO_PKG_VERSION").into(),
        scene: assembly.checksum(),
        samples,
        light: (light == Light::Baked).then(|| lightmap::LightmapSettings::new(most, samples, arguments.seed)),
        seed: arguments.seed,
        exposure: match arguments.exposure {
            Stops::At(stops) => stops,
            Stops::Auto => recorded.unwrap_or_default(),
        },
        show_sky: match arguments.background {
            Background::Auto => within,
            Background::Alpha => false,
            Background::Env => true,
        },
        depth: arguments.depth,
        normals: arguments.normals,
        exr: arguments.exr,
        cameras,
    };
    let outputs = Outputs::new(&arguments.out, &record, arguments.force)?;
    for note in &notes {
        say!("{note}");
    }
    let sky = if environment.is_some() { " and an environment" } else { "" };
    let materials: BTreeSet<u32> = model.faces.iter().map(|face| face.material).collect();
    say!(
        "scene    {}: {} triangles, {} materials, {} lights{sky}",
        arguments.scene.display(),
        model.faces.len(),
        materials.len(),
        assembly.lights()
    );
    let lit = model.faces.iter().any(|face| !model.materials[face.material as usize].unlit);
    if lit && assembly.lights() == 0 && environment.is_none() {
        say!(
            "warning  no lamp, nothing that emits and no environment: what is not unlit stays dark; give --env FILE.hdr"
        );
    }
    say!("behind   {}", if record.show_sky { "the environment" } else { "nothing: alpha and masks are written" });
    let inside = cameras_inside(&model, &assembly, &record.cameras);
    if !inside.is_empty() {
        say!("warning  {} cameras stand inside of something: {}", inside.len(), inside.join(", "));
    }
    drop(model);
    let context = arguments.device.open()?;
    say!("device   {}", context.physical().title());
    stop_on_interrupt()?;
    let eyes: Vec<DVec3> = record.cameras.iter().map(|camera| camera.pose.position).collect();
    let (tracer, baked) = match &record.light {
        None => (Tracer::new(&context, assembly, most)?, None),
        Some(settings) => {
            let Some((light, kept)) = light_of(&context, &assembly, settings, &eyes, &arguments.out)? else {
                return Ok(Ended::Stopped);
            };
            let tracer = Tracer::lit(&context, &assembly, most, &light)?;
            (tracer, Some((light, assembly, kept)))
        }
    };
    if arguments.exposure == Stops::Auto {
        if recorded.is_none() {
            record.exposure = metered(&tracer, &record.cameras, record.show_sky, record.seed, go_on)?;
        }
        say!("exposure {:+.2} stops, metered", record.exposure);
    }
    let tracer = tracer.exposed(record.exposure);
    if let (Some((light, assembly, false)), Some(settings)) = (&baked, &record.light) {
        // The record first: a folder with nothing but light would be nobody's.
        outputs.begin(&record, false)?;
        light.write(&arguments.out.join(lightmap::FILE), assembly, settings, &eyes)?;
    }
    let start = Instant::now();
    let all = record.cameras.len() as u32;
    let progress = Progress::over("photographing", all, "pictures");
    let outcome = capture::run(&tracer, &record, &outputs, &arguments.out, |done| {
        done.map_or_else(go_on, |done| progress.advance(done, all))
    });
    progress.finish();
    let Outcome { pictures, kept, mended, empty, mut dark, brighter, points, noise } = outcome?;
    print_messages(&context);
    if kept > 0 {
        say!("kept     {kept} pictures of an earlier run");
    }
    if mended > 0 {
        say!("mended   {mended} pictures that were damaged, or whose masks or maps were: taken again");
    }
    if pictures < all {
        let how = if arguments.force { "the same command without --force" } else { "the same command" };
        say!("stopped after {pictures} of {all} pictures, which stay; {how} goes on from there");
        return Ok(Ended::Stopped);
    }
    say!("pictures {} in {:.2} s", all - kept, start.elapsed().as_secs_f64());
    if let Some(psnr) = noise.psnr() {
        say!(
            "noise    {psnr:.1} dB, the PSNR of a perfect model against these pictures (mean of {})",
            noise.pictures()
        );
    }
    if empty > 0 {
        say!("         {empty} show nothing: check that the cameras are in the scene's frame");
    }
    dark.retain(|name| !inside.contains(&name.as_str()));
    if !dark.is_empty() {
        let what = "are black: no light reaches what they see, or their cameras stand inside of something";
        say!("warning  {} pictures {what}: {}", dark.len(), dark.join(", "));
    }
    let clipped = 100.0 * brighter[0] as f64 / brighter[1].max(1) as f64;
    if clipped > CLIPPED {
        let lower =
            if arguments.exposure == Stops::Auto { "a lower --exposure keeps" } else { "--exposure auto keeps" };
        say!("warning  {clipped:.1}% of the pixels are brighter than white and lose their colour; {lower} them");
    }
    if points == 0 {
        say!(
            "warning  no opaque pixel that was looked at shows the surface: the model has no points, and most trainers \
             want some to start from"
        );
    }
    say!("written  {}, with {points} points of the surface", arguments.out.display());
    Ok(Ended::Done)
}

/// The light map that lies in the folder, or a new one, and whether it was there; none where it was stopped.
fn light_of(
    context: &Arc<Context>,
    assembly: &Assembly,
    settings: &lightmap::LightmapSettings,
    eyes: &[DVec3],
    folder: &Path,
) -> Result<Option<(LightMap, bool)>> {
    if let Some(light) = LightMap::read(&folder.join(lightmap::FILE), assembly, settings, eyes)? {
        say!("light    kept from an earlier run, {} cells", light.cells());
        return Ok(Some((light, true)));
    }
    let start = Instant::now();
    let progress = Progress::over("baking light", 100, "%");
    let baked = LightMap::bake(context, assembly, settings, eyes, |share| {
        let go_on = go_on();
        if go_on.is_break() { go_on } else { progress.advance((100.0 * share) as u32, 100) }
    });
    progress.finish();
    match baked {
        Err(Error::Interrupted) => {
            say!("stopped while the light was baked; nothing is written");
            Ok(None)
        }
        baked => {
            let light = baked?;
            say!("light    {} cells, baked in {:.2} s", light.cells(), start.elapsed().as_secs_f64());
            Ok(Some((light, false)))
        }
    }
}

/// Reads an exposure in stops.
fn parse_stops(text: &str) -> Result<Stops, String> {
    if text == "auto" {
        return Ok(Stops::Auto);
    }
    let stops = text.parse().ok().filter(|stops: &f32| (-20.0..=20.0).contains(stops));
    stops.map(Stops::At).ok_or_else(|| "give stops from -20 to 20, or auto".into())
}

//! `camsplat demo`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use glam::DVec3;

use super::options::{DeviceOptions, print_messages, print_target};
use super::plan::print_plan;
use super::progress::{Progress, stop_on_interrupt};
use crate::io::folder::OutputFolder;
use crate::plan::config::{Config, Preset};
use crate::plan::job::{self, RegionChoice, Target, Tools};
use crate::scene::camera::Intrinsics;
use crate::scene::samples;
use crate::{Error, Result, report};

/// Arguments of `camsplat demo`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Folder to write
    #[arg(long, default_value = "camsplat-demo")]
    out: PathBuf,
    #[command(flatten)]
    device: DeviceOptions,
}

/// Plans both scenes. Reports of an earlier demo in the same folder are replaced.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    stop_on_interrupt()?;
    std::fs::create_dir_all(&arguments.out).map_err(|source| Error::io(&arguments.out, source))?;
    let context = arguments.device.open()?;
    say!("device   {} ({})", context.physical().name, context.physical().driver.trim());
    let intrinsics = Intrinsics::from_fov(800, 800, 50f64.to_radians());
    let scenes = [("object", samples::object(), Preset::Object, 50), ("room", samples::room(), Preset::Room, 300)];
    for (name, surface, preset, views) in scenes {
        say!();
        let folder = OutputFolder::create(&arguments.out.join(name), true)?;
        let target = Target::new(&surface, name, preset, &RegionChoice::default(), DVec3::Z, &intrinsics)?;
        print_target(&target);
        let config = Config::new(preset, views);
        let progress = Progress::new(config.iterations);
        let plan =
            job::run(&context, &target, intrinsics, &[], config, Tools::default(), |event| progress.observe(event));
        progress.finish();
        let plan = plan?;
        print_messages(&context);
        let path = folder.path().join("report.html");
        report::folder::write(&plan, &target, folder)?;
        print_plan(&plan);
        say!("report   {}", path.display());
        if plan.interrupted() {
            return Ok(ExitCode::from(super::INTERRUPTED));
        }
    }
    Ok(ExitCode::SUCCESS)
}

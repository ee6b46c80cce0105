//! `camsplat demo`.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use clap::Args;
use glam::DVec3;

use super::options::{DeviceOptions, print_messages, print_target};
use super::outcome::print_plan;
use super::progress::{Progress, stop_on_interrupt};
use super::session::{Ended, go_on};
use crate::evaluate::demo::{self, Event, Size, Step};
use crate::evaluate::results::{Interval, Row, measured};
use crate::evaluate::scene::{Scene, Setting};
use crate::evaluate::situation::Situation;
use crate::io::folder::{OutputFolder, check_folder, write_files};
use crate::plan::config::{Config, Preset};
use crate::plan::job::{self, Tools};
use crate::plan::target::{RegionChoice, Target};
use crate::scene::camera::Intrinsics;
use crate::scene::samples;
use crate::scene::samples::textured::two_rooms_model;
use crate::scene::surface::Surface;
use crate::vulkan::Context;
use crate::{Error, Result, report};

/// The scene that is photographed, and its folder.
const PHOTOGRAPHED: &str = "two-rooms";

/// The file that says that a folder is of a demo.
const MARK: &str = ".camsplat-demo";

/// Arguments of `camsplat demo`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Folder to write
    #[arg(long, default_value = "camsplat-demo")]
    out: PathBuf,
    #[command(flatten)]
    device: DeviceOptions,
}

/// Plans for two scenes, then photographs two rooms as planned and in other ways, and trains on that. Reports of an earlier demo in the same folder are
/// replaced; its photographs and splats are taken as they are.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    stop_on_interrupt()?;
    let start = Instant::now();
    let Arguments { out, device } = arguments;
    std::fs::create_dir_all(out).map_err(|source| Error::io(out, source))?;
    let mark = out.join(MARK);
    check_folder(out, mark.is_file()).map_err(|error| match error {
        Error::NotEmpty { path } => {
            Error::input(path, "the folder is not empty and holds no demo; name another with --out")
        }
        other => other,
    })?;
    write_files(&[(&mark, env!("CARGO_PKG_VERSION").as_bytes())])?;
    let context = device.open()?;
    say!("device   {}", context.physical().title());
    let scenes = [("object", samples::object(), Preset::Object, 50), ("room", samples::room(), Preset::Room, 300)];
    for (name, surface, preset, views) in scenes {
        say!("");
        if !plan(&context, out, name, &surface, preset, views)? {
            return Ok(Ended::Stopped);
        }
    }
    say!(
        "\nNow the full pipeline: two rooms are photographed as planned, at random and on a grid, and splats trained on each."
    );
    match photograph(&context, out) {
        Err(Error::Interrupted) => {
            say!("{}", super::STOPPED);
            return Ok(Ended::Stopped);
        }
        photographed => photographed?,
    }
    say!("\nall      {:.0} s; open {}", start.elapsed().as_secs_f64(), out.join("report.html").display());
    Ok(Ended::Done)
}

/// Plans for a scene that is known; false where it was broken off.
fn plan(context: &Arc<Context>, out: &Path, name: &str, surface: &Surface, preset: Preset, views: u32) -> Result<bool> {
    let intrinsics = Intrinsics::from_fov(800, 800, 50f64.to_radians());
    let folder = OutputFolder::create(&out.join(name), true)?;
    let target = Target::new(surface, name, preset, &RegionChoice::default(), DVec3::Z, &intrinsics)?;
    print_target(&target);
    let config = Config::new(preset, views);
    let progress = Progress::new(config.iterations);
    let plan = job::run(context, &target, intrinsics, &[], config, Tools::default(), |event| progress.observe(event));
    progress.finish();
    let plan = plan?;
    print_messages(context);
    let path = folder.path().join("report.html");
    report::folder::write(&plan, &target, folder)?;
    print_plan(&plan);
    say!("report   {}", path.display());
    Ok(!plan.interrupted())
}

/// Runs the full pipeline in two rooms, and writes the demo's page.
fn photograph(context: &Arc<Context>, out: &Path) -> Result<()> {
    let size = Size::DEMO;
    let model = two_rooms_model();
    let (surface, intrinsics) = (model.surface(), size.settings.intrinsics());
    let setting = Setting { preset: Preset::Room, situation: Situation::TwoRooms, ..Setting::default() };
    let scene = Scene::new(Path::new(PHOTOGRAPHED), &setting, (model, None), surface, &intrinsics)?;
    let demo = demo::run(context, out, size, &scene, &mut |event| {
        if let Event::Done(Step { name, what, seconds }) = event {
            say!("{name:<8} {what}: {seconds:.1} s");
        }
        go_on()
    });
    print_messages(context);
    let demo = demo?;
    let plans = [("object", "An object that is known, 50 views"), ("room", "A furnished room, 300 views")];
    report::demo::write(&demo, out, &plans)?;
    print_scores(&demo.outcome.rows);
    say!("\n{}", demo.sentence());
    Ok(())
}

fn print_scores(rows: &[Row]) {
    say!("\nheld-out views");
    for (metric, name) in measured(rows) {
        for row in rows {
            let cell = |interval: &Option<_>| {
                interval.map_or_else(|| "-".into(), |Interval { mean, .. }| format!("{mean:.3}"))
            };
            let cells: String = row.measured[metric].iter().map(|value| format!(" {:>12}", cell(value))).collect();
            say!("{name:<6} {:<11}{cells}", row.method.name());
        }
    }
}

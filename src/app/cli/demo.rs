//! `camsplat demo`.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use clap::Args;

use super::options::{DeviceOptions, print_messages};
use super::progress::stop_on_interrupt;
use super::session::{Ended, go_on};
use crate::app::report;
use crate::engine::vulkan::Context;
use crate::files::io::folder::{check_folder, write_files};
use crate::lab::evaluate::demo::{self, DemoEvent, METHODS, Size, Step, title};
use crate::lab::evaluate::results::{Interval, Row, measured};
use crate::{Error, Result};

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

/// Photographs two rooms as planned and in other ways, and trains on that. The page of an earlier demo in the same folder is replaced;
/// its photographs and splats are taken as they are.
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
    let Size { views, .. } = Size::DEMO;
    say!(
        "\nWhere should the cameras stand? Two rooms are photographed {views} times from planned places, {views} times from random places and\n\
         {views} times from a grid at eye height. A 3D model is trained on each set of photos, and asked for held-out views.\n"
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

/// Plans, photographs, trains and tests, and writes the demo's page.
fn photograph(context: &Arc<Context>, out: &Path) -> Result<()> {
    let size = Size::DEMO;
    let scene = size.scene(PHOTOGRAPHED)?;
    let demo = demo::run(context, out, size, &scene, &mut |event| {
        if let DemoEvent::Done(Step { name, what, seconds }) = event {
            say!("{name:<8} {what} ({seconds:.0} s)");
        }
        go_on()
    });
    print_messages(context);
    let demo = demo?;
    report::demo::write(&demo, &scene, out)?;
    print_scores(&demo.outcome.rows);
    say!("\n{}", demo.sentence());
    Ok(())
}

fn print_scores(rows: &[Row]) {
    say!("\nheld-out views");
    for (metric, name) in measured(rows) {
        for (method, row) in METHODS.iter().zip(rows) {
            let value = row.measured[metric].first().copied().flatten();
            let value = value.map_or_else(|| "-".into(), |Interval { mean, .. }| format!("{mean:.3}"));
            say!("{name:<6} {:<21} {value:>7}", title(*method));
        }
    }
}

//! `camsplat convert`.

use std::path::PathBuf;

use clap::Args;

use super::session::Ended;
use crate::files::io;
use crate::files::io::folder::{check_file, replace_file};
use crate::files::io::splats::{self, SplatFormat};
use crate::{Error, Result};

/// Arguments of `camsplat convert`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Trained splats: .ply, .compressed.ply, .spz, .sog, .splat, or .glb with KHR_gaussian_splatting
    model: PathBuf,
    /// File to write, in the format that its name says: .ply, .compressed.ply, .spz, .sog, .splat or .glb
    out: PathBuf,
    /// Format of the file, whatever its name
    #[arg(long, value_enum)]
    format: Option<SplatFormat>,
    /// Replace a file that is there
    #[arg(long)]
    force: bool,
}

/// Reads and writes.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let Arguments { model, out, .. } = arguments;
    let format = arguments.format.map_or_else(|| SplatFormat::of(out), Ok)?;
    check_file(out)?;
    if out.exists() && !arguments.force {
        return Err(Error::input(out, "a file is already here; pass `force` to replace it, or name another"));
    }
    let (gaussians, mut notes) = io::read_gaussians_with_notes(model)?;
    let bytes = splats::write(&gaussians, format, &mut notes)?;
    for note in notes {
        say!("{note}");
    }
    replace_file(out, |file| file.write_all(&bytes))?;
    let before = std::fs::metadata(model).map_or(0, |file| file.len());
    say!("written  {}: {}, {} before", out.display(), size(bytes.len() as u64), size(before));
    Ok(Ended::Done)
}

/// Bytes in words.
pub(super) fn size(bytes: u64) -> String {
    match bytes {
        ..0x10_0000 => format!("{:.1} KiB", bytes as f64 / 1024.0),
        _ => format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20)),
    }
}

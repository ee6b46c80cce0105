//! Trained splats, in the formats of viewers and trainers.
//!
//! | format | named | read by | written |
//! |---|---|---|---|
//! | 3DGS's layout, PLY | `.ply` | [`super::ply`] | whole |
//! | packed, of PlayCanvas and SuperSplat | `.compressed.ply` | [`super::ply`] | rounded |
//! | antimatter15's | `.splat` | [`dot_splat`] | rounded, without harmonics |
//! | SPZ of Niantic, 2 to 4 | `.spz` | [`spz`] | rounded |
//! | SOG of PlayCanvas, 2 | `.sog` | [`sog`] | rounded |
//! | glTF with KHR_gaussian_splatting | `.glb`, `.gltf` | [`super::gltf`] | whole |
//!
//! Values keep the axes and units of the model in all of them. [`surface`] takes splats for points of a surface.

mod codebook;
pub mod dot_splat;
pub(in crate::files::io) mod order;
pub(in crate::files::io) mod quantised;
mod radiance;
pub mod sog;
pub mod spz;
pub mod surface;
pub(in crate::files::io) mod usable;

use std::path::Path;

use super::{gltf, ply};
use crate::error::{Error, Result};
use crate::scene::gaussians::Gaussians;

/// A format that splats are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum SplatFormat {
    /// 3DGS's own layout, which most programs read, without loss
    Ply,
    /// PLY of PlayCanvas and SuperSplat (.compressed.ply), rounded
    Packed,
    /// The format of the first web viewers, rounded and without harmonics
    Splat,
    /// SPZ of version 3, rounded
    Spz,
    /// SPZ of version 4, which newer programs read, rounded
    Spz4,
    /// SOG of PlayCanvas, the smallest, rounded
    Sog,
    /// glTF with KHR_gaussian_splatting (.glb), without loss
    Glb,
}

impl SplatFormat {
    /// All of them.
    pub const ALL: [Self; 7] = [Self::Ply, Self::Packed, Self::Splat, Self::Spz, Self::Spz4, Self::Sog, Self::Glb];

    /// The format that a file of that name has.
    ///
    /// # Errors
    /// Where the name ends otherwise.
    pub fn of(path: &Path) -> Result<Self> {
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        let ends = [
            (".compressed.ply", Self::Packed),
            (".ply", Self::Ply),
            (".splat", Self::Splat),
            (".spz", Self::Spz),
            (".sog", Self::Sog),
            (".glb", Self::Glb),
        ];
        let found = ends.into_iter().find(|(end, _)| name.ends_with(end)).map(|(_, format)| format);
        found.ok_or_else(|| {
            Error::input(
                path,
                "splats are written as .ply, .compressed.ply, .splat, .spz, .sog or .glb; end the name so",
            )
        })
    }

    /// How names of such files end.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Ply => "ply",
            Self::Packed => "compressed.ply",
            Self::Splat => "splat",
            Self::Spz | Self::Spz4 => "spz",
            Self::Sog => "sog",
            Self::Glb => "glb",
        }
    }
}

/// Whether a file is one of splats that is no PLY file, which may hold other things.
pub(super) fn is_splats(path: &Path, bytes: &[u8]) -> bool {
    let is_gltf = bytes.starts_with(b"glTF") || ends(path, "gltf");
    spz::is_spz(bytes) || sog::is_sog(bytes) || ends(path, "splat") || is_gltf && gltf::holds_splats(path, bytes)
}

fn ends(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|own| own.eq_ignore_ascii_case(extension))
}

/// Reads splats from the bytes of a file of any of the formats: what it begins with counts for more than its name.
///
/// # Errors
/// Where it is of no such format, damaged, or holds no splats that can be used.
pub fn parse(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Gaussians> {
    if bytes.starts_with(b"ply") {
        ply::gaussians(path, bytes, notes)
    } else if spz::is_spz(bytes) {
        spz::parse(path, bytes, notes)
    } else if sog::is_sog(bytes) {
        sog::parse(path, bytes, notes)
    } else if bytes.starts_with(b"glTF") || ends(path, "gltf") {
        gltf::parse_splats(path, bytes, notes)
    } else if ends(path, "splat") {
        dot_splat::parse(path, bytes, notes)
    } else {
        let what = "this is no file of splats that is read; give .ply, .spz, .sog, .splat, or .glb with KHR_gaussian_splatting";
        Err(Error::input(path, what))
    }
}

/// The bytes of a file of splats. The notes say what the format has no place for.
///
/// # Errors
/// Where there are more splats than the format holds.
pub fn write(gaussians: &Gaussians, format: SplatFormat, notes: &mut Vec<String>) -> Result<Vec<u8>> {
    if gaussians.antialiased && matches!(format, SplatFormat::Splat | SplatFormat::Glb) {
        notes.push(
            "the format cannot say that the model was trained with antialiasing: whoever draws it has to know".into(),
        );
    }
    if gaussians.degree > 0 && format == SplatFormat::Splat {
        notes.push("the format has no harmonics: colours are the same from all sides".into());
    }
    Ok(match format {
        SplatFormat::Ply => ply::write::gaussians(gaussians),
        SplatFormat::Packed => ply::packed(gaussians),
        SplatFormat::Splat => dot_splat::write(gaussians),
        SplatFormat::Spz => spz::write(gaussians, 3),
        SplatFormat::Spz4 => spz::write(gaussians, 4),
        SplatFormat::Sog => sog::write(gaussians)?,
        SplatFormat::Glb => gltf::write_splats(gaussians)?,
    })
}

#[cfg(test)]
mod tests;

//! Light maps as files: a line of JSON that says what light it is, then a word for each cell and corner, a bit for each cell, and a
//! checksum.

use std::fs;
use std::path::Path;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::layout::Layout;
use super::{LightMap, LightmapSettings};
use crate::files::io::folder::replace_file;
use crate::lab::path_tracer::assembly::Assembly;
use crate::{Error, Result};

/// Name of the file in a folder of photographs.
pub(crate) const FILE: &str = "light.map";
/// Raised with every change of what is baked under the same settings.
const REVISION: u32 = 2;

/// What a light map is of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Header {
    revision: u32,
    scene: u32,
    settings: LightmapSettings,
    /// Checksum of where views are from.
    eyes: u32,
    scale: f32,
}

fn checksum(eyes: &[DVec3]) -> u32 {
    let words: Vec<[f64; 3]> = eyes.iter().map(DVec3::to_array).collect();
    crc32fast::hash(bytemuck::cast_slice(&words))
}

/// The scale at which light is packed, so that the brightest has room.
pub(super) fn scale_of<'l>(light: impl IntoIterator<Item = &'l Vec3>) -> f32 {
    let most = light.into_iter().map(|light| light.max_element()).fold(0.0, f32::max);
    if most > 0.0 { 32_768.0 / most } else { 1.0 }
}

/// Three numbers of nine bits with a common exponent of five (EXT_texture_shared_exponent), and back.
pub(super) fn packed(light: Vec3, scale: f32) -> u32 {
    let light = (light * scale).clamp(Vec3::ZERO, Vec3::splat(65_408.0));
    let most = light.max_element();
    if most < 1e-7 {
        return 0;
    }
    let mut exponent = (most.log2().floor() as i32).max(-16) + 16;
    // Rounding up may need one more.
    if (most * (24.0 - exponent as f32).exp2()).round() > 511.0 {
        exponent += 1;
    }
    let [r, g, b] = (light * (24.0 - exponent as f32).exp2()).to_array().map(|v| (v.round() as u32).min(511));
    r | g << 9 | b << 18 | (exponent as u32) << 27
}

pub(super) fn unpacked(word: u32, scale: f32) -> Vec3 {
    let part = |shift: u32| (word >> shift & 511) as f32;
    Vec3::new(part(0), part(9), part(18)) * (((word >> 27) as f32 - 24.0).exp2() / scale)
}

impl LightMap {
    /// Writes it.
    ///
    /// # Errors
    /// Where the system refuses.
    pub fn write(&self, path: &Path, assembly: &Assembly, settings: &LightmapSettings, eyes: &[DVec3]) -> Result<()> {
        let (scene, scale) = (assembly.checksum(), self.scale);
        let header = Header { revision: REVISION, scene, settings: *settings, eyes: checksum(eyes), scale };
        // Plain numbers can always be written.
        let mut bytes = serde_json::to_vec(&header).unwrap_or_default();
        bytes.push(b'\n');
        for light in self.cells.iter().chain(&self.corners) {
            bytes.extend(packed(*light, scale).to_le_bytes());
        }
        let bits = |cells: &[bool]| (0..).zip(cells).map(|(bit, followed)| u8::from(*followed) << bit).sum::<u8>();
        bytes.extend(self.followed.chunks(8).map(bits));
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        replace_file(path, |file| file.write_all(&bytes))
    }

    /// Reads one back; nothing where there is none, or it is of another scene, other settings, another program, or damaged: it is
    /// baked anew then.
    ///
    /// # Errors
    /// Where there is a file that the system refuses to read.
    pub fn read(path: &Path, assembly: &Assembly, settings: &LightmapSettings, eyes: &[DVec3]) -> Result<Option<Self>> {
        let bytes = match fs::read(path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(source) => return Err(Error::io(path, source)),
        };
        Ok(Self::parse(&bytes, assembly, settings, eyes))
    }

    fn parse(bytes: &[u8], assembly: &Assembly, settings: &LightmapSettings, eyes: &[DVec3]) -> Option<Self> {
        let (content, crc) = bytes.split_last_chunk::<4>()?;
        let end = content.iter().position(|byte| *byte == b'\n')?;
        let header: Header = serde_json::from_slice(&content[..end]).ok()?;
        let is_asked = header.revision == REVISION
            && header.scene == assembly.checksum()
            && header.settings == *settings
            && header.eyes == checksum(eyes);
        if !is_asked || crc32fast::hash(content) != u32::from_le_bytes(*crc) {
            return None;
        }
        let layout = Layout::new(assembly, settings.cells, eyes);
        let cells = layout.owners.len();
        let (words, bits) = content[end + 1..].split_at_checked(4 * (cells + layout.corners as usize))?;
        if bits.len() != cells.div_ceil(8) {
            return None;
        }
        let words = words.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
        let mut light: Vec<Vec3> = words.map(|word| unpacked(word, header.scale)).collect();
        let corners = light.split_off(cells);
        let followed = (0..cells).map(|cell| bits[cell / 8] >> (cell % 8) & 1 != 0).collect();
        Some(Self { layout, cells: light, corners, followed, scale: header.scale })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    /// If this failed, light that was read back would be of another colour or strength than what was baked.
    #[test]
    fn packed_light_is_within_a_five_hundredth_of_the_brightest_channel_and_packs_to_itself() {
        for i in 0..20_000 {
            let [a, b, c, d] = random::uniforms(5, 0, i);
            let light = Vec3::new(a as f32, b as f32, c as f32) * ((30.0 * d - 25.0) as f32).exp2();
            let scale = scale_of(&[Vec3::splat(20.0)]);
            let found = unpacked(packed(light, scale), scale);
            let error = (found - light).abs().max_element();
            assert!(error <= light.max_element() / 500.0 + 1e-9, "{light} came back as {found}");
            assert_eq!(unpacked(packed(found, scale), scale), found);
        }
        let scale = scale_of(&[Vec3::new(3.0, 40.0, 1.0), Vec3::ONE]);
        assert!((unpacked(packed(Vec3::new(3.0, 40.0, 1.0), scale), scale).y / 40.0 - 1.0).abs() < 2e-3);
        assert_eq!(unpacked(packed(Vec3::ZERO, 1.0), 1.0), Vec3::ZERO);
    }
}

//! `.splat`, the splats of the first web viewer (github.com/antimatter15/splat): 32 bytes each and no header. Positions and standard
//! deviations are single precision, colours, opacity and rotation are eight bits; colours are the same from all sides.

use std::path::Path;

use glam::DVec3;

use super::quantised::{byte, logit};
use super::usable::usable;
use crate::error::{Error, Result};
use crate::scene::gaussians::Gaussians;
use crate::scene::harmonics::CONSTANT;

/// Bytes of a splat.
const EACH: usize = 32;

/// Reads the bytes of a file.
///
/// # Errors
/// Where they are no whole number of splats, or no splat can be used.
pub fn parse(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Gaussians> {
    if bytes.is_empty() || !bytes.len().is_multiple_of(EACH) {
        let what = format!(
            "{} bytes are no whole number of splats, of {EACH} bytes each; copy or export it again",
            bytes.len()
        );
        return Err(Error::input(path, what));
    }
    let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    let three = |b: &[u8]| [float(b), float(&b[4..]), float(&b[8..])];
    let splats = || bytes.chunks_exact(EACH);
    let gaussians = Gaussians {
        centres: splats().map(|s| DVec3::from(three(s).map(f64::from))).collect(),
        log_scales: splats().map(|s| three(&s[12..]).map(f32::ln)).collect(),
        rotations: splats().map(|s| [28, 29, 30, 31].map(|k| (f32::from(s[k]) - 128.0) / 128.0)).collect(),
        opacities: splats().map(|s| logit(s[27]) as f32).collect(),
        degree: 0,
        harmonics: splats()
            .flat_map(|s| [24, 25, 26].map(|k| ((f64::from(s[k]) / 255.0 - 0.5) / CONSTANT) as f32))
            .collect(),
        antialiased: false,
    };
    let gaussians = usable(path, gaussians, notes)?;
    notes.push(format!("{} splats without harmonics (.splat): values are rounded", gaussians.len()));
    Ok(gaussians)
}

/// Bytes of a file, the splats that show most first, as viewers that draw what has come expect.
pub fn write(gaussians: &Gaussians) -> Vec<u8> {
    let each = 3 * gaussians.coefficients();
    let shown =
        |i: usize| gaussians.opacity(i).ln() + gaussians.log_scales[i].iter().map(|s| f64::from(*s)).sum::<f64>();
    let mut order: Vec<(usize, f64)> = (0..gaussians.len()).map(|i| (i, shown(i))).collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut bytes = Vec::with_capacity(EACH * order.len());
    for (i, _) in order {
        let scales = gaussians.log_scales[i].map(f32::exp);
        let centre = gaussians.centres[i].as_vec3().to_array();
        centre.iter().chain(&scales).for_each(|v| bytes.extend(v.to_le_bytes()));
        bytes.extend(
            gaussians.harmonics[each * i..][..3].iter().map(|v| byte(255.0 * (CONSTANT * f64::from(*v) + 0.5))),
        );
        bytes.push(byte(255.0 * gaussians.opacity(i)));
        let rotation = gaussians.rotations[i].map(f64::from);
        let length = rotation.iter().map(|v| v * v).sum::<f64>().sqrt();
        bytes.extend(rotation.map(|v| byte(128.0 * v / length + 128.0)));
    }
    bytes
}

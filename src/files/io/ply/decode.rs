//! The values of splats from the columns of a file: the usual 3DGS layout, and the packed one of PlayCanvas and SuperSplat.

use std::path::Path;

use glam::DVec3;

use super::elements::{self, Columns};
use super::header::Header;
use crate::error::{Error, Result};
use crate::files::io::splats::quantised;
use crate::scene::harmonics;

/// Splats that share one set of bounds in a packed file.
pub(super) const CHUNK: usize = 256;

/// Harmonics of packed files span -4 to 4.
pub(super) const PACKED_SPAN: f64 = 8.0;

/// Splats as a file has them, one entry of every list each. Nothing is checked but that there are as many of each.
pub(super) struct Decoded {
    pub centres: Vec<DVec3>,
    /// Natural logarithms of the standard deviations along the axes; the third of flat splats is minus infinity.
    pub log_scales: Vec<DVec3>,
    /// World-from-splat quaternions (w, x, y, z) of any length.
    pub rotations: Vec<[f64; 4]>,
    /// Opacities as logits, one per Gaussian.
    pub opacities: Vec<f64>,
    /// Coefficients of the constant harmonic.
    pub constants: Vec<DVec3>,
    /// Coefficients of the others, a column for each: f_rest_0 and on, up to the first that is missing; all of red first.
    pub rest: Vec<Vec<f64>>,
    /// Whether the file has no third scale (2DGS).
    pub flat: bool,
}

impl Decoded {
    /// Reads a file that [`is_splats`] accepts.
    pub fn read(path: &Path, bytes: &[u8], header: &Header) -> Result<Self> {
        if !is_packed(header) {
            let mut decoded = trained(path, header, &mut elements::read(path, bytes, header, is_used)?)?;
            decoded.centres.iter_mut().for_each(|centre| *centre += header.origin);
            return Ok(decoded);
        }
        let mut columns = elements::read(path, bytes, header, |_, _| true)?;
        packed(path, &mut columns)
    }
}

/// Whether a file holds splats, trained or packed, rather than points or a mesh.
pub(super) fn is_splats(header: &Header) -> bool {
    let has = |name: &str| header.kind("vertex", name).is_some();
    is_packed(header) || ["scale_0", "rot_0"].into_iter().all(has) && (has("f_dc_0") || has("opacity") && has("red"))
}

/// Whether a file has the packed layout.
pub(super) fn is_packed(header: &Header) -> bool {
    header.kind("vertex", "packed_position").is_some()
}

/// Whether a property of a trained file is read.
fn is_used(element: &str, property: &str) -> bool {
    let starts = ["f_dc_", "f_rest_", "scale_", "rot_"].iter().any(|start| property.starts_with(start));
    element == "vertex" && (starts || ["x", "y", "z", "opacity", "red", "green", "blue"].contains(&property))
}

/// Decodes a trained file: opacity as logit, scales as logarithms, rotations w first and of any length. Where there are no harmonics at all,
/// the colour of points counts.
fn trained(path: &Path, header: &Header, columns: &mut Columns) -> Result<Decoded> {
    if header.kind("vertex", "f_dc_0").is_none()
        && let Some(colours) = super::vectors(columns, ["red", "green", "blue"])
    {
        let full = super::full(header.kind("vertex", "red"));
        let constants = colours.iter().map(|colour| (*colour / full - 0.5) / harmonics::CONSTANT);
        for (axis, name) in ["f_dc_0", "f_dc_1", "f_dc_2"].into_iter().enumerate() {
            columns.insert("vertex", name, constants.clone().map(|constant| constant[axis]).collect());
        }
    }
    let [x, y, z, red, green, blue, opacities, scale_0, scale_1, rot_0, rot_1, rot_2, rot_3] = required(
        path,
        columns,
        [
            "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "rot_0", "rot_1", "rot_2",
            "rot_3",
        ],
    )?;
    let scale_2 = columns.scalars("vertex", "scale_2");
    let vectors = |[x, y, z]: [&[f64]; 3]| (0..x.len()).map(|i| DVec3::new(x[i], y[i], z[i])).collect::<Vec<_>>();
    let third = |i: usize| scale_2.as_ref().map_or(f64::NEG_INFINITY, |scales| scales[i]);
    Ok(Decoded {
        centres: vectors([&x, &y, &z]),
        log_scales: (0..x.len()).map(|i| DVec3::new(scale_0[i], scale_1[i], third(i))).collect(),
        rotations: (0..x.len()).map(|i| [rot_0[i], rot_1[i], rot_2[i], rot_3[i]]).collect(),
        opacities,
        constants: vectors([&red, &green, &blue]),
        rest: rest(columns, "vertex"),
        flat: scale_2.is_none(),
    })
}

/// Decodes a packed file: 256 splats share the bounds of their centres (11, 10 and 11 bits), log scales (the same) and
/// colours (8 bits each, and the opacity); rotations are the three smaller components in 10 bits each after 2 bits for
/// which one was left out, in the order w, x, y, z. Older files bound no colours: they span [0, 1]. Harmonics, where there
/// are any, are an element of their own in 8 bits each: 0 and 255 are the ends of the span, the others the middles of 256
/// even steps, as PlayCanvas' own splat-transform has it.
fn packed(path: &Path, columns: &mut Columns) -> Result<Decoded> {
    let [centre, rotation, scale, colour] =
        required(path, columns, ["packed_position", "packed_rotation", "packed_scale", "packed_color"])?;
    let mut corner = |names: [&str; 3]| -> Option<Vec<DVec3>> {
        let [x, y, z] = names.map(|name| columns.scalars("chunk", name));
        Some(x?.into_iter().zip(y?).zip(z?).map(|((x, y), z)| DVec3::new(x, y, z)).collect())
    };
    let centres = corner(["min_x", "min_y", "min_z"]).zip(corner(["max_x", "max_y", "max_z"]));
    let scales = corner(["min_scale_x", "min_scale_y", "min_scale_z"]).zip(corner([
        "max_scale_x",
        "max_scale_y",
        "max_scale_z",
    ]));
    let colours = corner(["min_r", "min_g", "min_b"]).zip(corner(["max_r", "max_g", "max_b"]));
    let (Some(centres), Some(scales)) = (centres, scales) else {
        let what = "the element \"chunk\" lacks bounds of positions or scales; export the splat again";
        return Err(Error::input(path, what));
    };
    if centres.0.len() < centre.len().div_ceil(CHUNK) {
        return Err(Error::input(
            path,
            format!(
                "{} splats need {} chunks of {CHUNK} and there are {}; export the splat again",
                centre.len(),
                centre.len().div_ceil(CHUNK),
                centres.0.len()
            ),
        ));
    }
    let mut rest = rest(columns, "sh");
    if let Some(column) = rest.first()
        && column.len() != centre.len()
    {
        let what =
            format!("{} splats have {} rows of the element \"sh\"; export the splat again", centre.len(), column.len());
        return Err(Error::input(path, what));
    }
    rest.iter_mut().flatten().for_each(|value| *value = unpack_harmonic(*value));
    let colours = colours.unwrap_or_else(|| (vec![DVec3::ZERO; centres.0.len()], vec![DVec3::ONE; centres.0.len()]));
    let between = |(min, max): &(Vec<DVec3>, Vec<DVec3>), i: usize, t: DVec3| {
        let (min, max) = (min[i / CHUNK], max[i / CHUNK]);
        min + t * (max - min)
    };
    let constant = |i: usize| {
        let [red, green, blue, _] = (colour[i] as u32).to_be_bytes().map(|v| f64::from(v) / 255.0);
        (between(&colours, i, DVec3::new(red, green, blue)) - 0.5) / harmonics::CONSTANT
    };
    let logit = |i: usize| quantised::logit(colour[i] as u32 as u8);
    let each = 0..centre.len();
    Ok(Decoded {
        centres: each.clone().map(|i| between(&centres, i, unpack_vector(centre[i] as u32))).collect(),
        log_scales: each.clone().map(|i| between(&scales, i, unpack_vector(scale[i] as u32))).collect(),
        rotations: each.clone().map(|i| unpack_rotation(rotation[i] as u32)).collect(),
        opacities: each.clone().map(logit).collect(),
        constants: each.map(constant).collect(),
        rest,
        flat: false,
    })
}

/// Columns of the vertices that a splat file must have.
fn required<const N: usize>(path: &Path, columns: &mut Columns, names: [&str; N]) -> Result<[Vec<f64>; N]> {
    let found = names.map(|name| columns.scalars("vertex", name));
    let missing: Vec<&str> = names.into_iter().zip(&found).filter(|(_, f)| f.is_none()).map(|(name, _)| name).collect();
    if missing.is_empty() {
        // None is missing, so that every default is replaced.
        return Ok(found.map(Option::unwrap_or_default));
    }
    let what =
        format!("the element \"vertex\" has no property {}, as splats must; export it again", missing.join(", "));
    Err(Error::input(path, what))
}

/// Takes f_rest_0 and on, up to the first that is missing.
fn rest(columns: &mut Columns, element: &str) -> Vec<Vec<f64>> {
    (0..).map_while(|k| columns.scalars(element, &format!("f_rest_{k}"))).collect()
}

/// The `bits` of `packed` above `shift` as a fraction of their largest value.
fn fraction(packed: u32, shift: u32, bits: u32) -> f64 {
    let largest = (1 << bits) - 1;
    f64::from((packed >> shift) & largest) / f64::from(largest)
}

/// Three fractions of 11, 10 and 11 bits.
fn unpack_vector(packed: u32) -> DVec3 {
    DVec3::new(fraction(packed, 21, 11), fraction(packed, 11, 10), fraction(packed, 0, 11))
}

/// Which of w, x, y, z is largest, and the others from -sqrt(1/2) to sqrt(1/2).
fn unpack_rotation(packed: u32) -> [f64; 4] {
    let others = [20, 10, 0].map(|shift| (fraction(packed, shift, 10) - 0.5) * std::f64::consts::SQRT_2);
    quantised::from_smallest_three((packed >> 30) as usize, others).map(f64::from)
}

/// A coefficient from its byte.
fn unpack_harmonic(byte: f64) -> f64 {
    let part = match byte {
        0.0 => 0.0,
        255.0 => 1.0,
        _ => (byte + 0.5) / 256.0,
    };
    PACKED_SPAN * (part - 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, packed rotations would be unpacked in another component order than they were written in.
    #[test]
    fn the_packed_rotation_restores_every_component_order() {
        let wxyz = [0.1f64, -0.2, 0.3, -0.4];
        for left_out in 0..4 {
            let mut unit = wxyz;
            unit[left_out] =
                (1.0 - wxyz.iter().enumerate().filter(|(i, _)| *i != left_out).map(|(_, v)| v * v).sum::<f64>()).sqrt();
            let mut packed = left_out as u32;
            for (_, v) in unit.iter().enumerate().filter(|(i, _)| *i != left_out) {
                packed = packed << 10 | ((v / std::f64::consts::SQRT_2 + 0.5) * 1023.0).round() as u32;
            }
            let q = unpack_rotation(packed);
            let error = q.iter().zip(unit).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(error < 2e-3, "{left_out}: {q:?} for {unit:?}");
        }
    }
}

//! Trained splats as points: the usual 3DGS layout, and the packed layout of PlayCanvas and SuperSplat.
//!
//! Each splat becomes a point with a disc: its centre; the shortest axis as the normal, of unknown sign; as the radius
//! twice the geometric mean of the standard deviations along the two longer axes, so that the disc has the area of the
//! splat's two-sigma ellipse: neighbours overlap there, and what lies behind is hidden as it is in a render. The colour is that of the constant harmonic. Splats with an opacity under
//! [`LEAST_OPACITY`] are left out: most of them are haze around the surface. The higher harmonics, where there are any, say
//! how much and along which directions the splat's radiance varies.

use std::path::Path;

use glam::{DQuat, DVec3};

use super::super::checks;
use super::elements::Columns;
use super::radiance::Radiance;
use crate::error::{Error, Result};
use crate::scene::colour;
use crate::scene::harmonics::{self, Lobe};
use crate::scene::surface::{Points, Surface};

/// Splats that are fainter than this are no surface.
pub const LEAST_OPACITY: f64 = 0.1;

/// Splats that share one set of bounds in a packed file.
const CHUNK: usize = 256;

/// A decoded splat.
struct Splat {
    centre: DVec3,
    /// Natural logarithms of the standard deviations along the axes.
    log_scales: DVec3,
    /// World-from-splat rotation of any length.
    rotation: DQuat,
    opacity: f64,
    /// sRGB.
    colour: DVec3,
    /// Variance of its luma over all directions, and the lobe along which it varies, where there are harmonics.
    variation: Option<(f32, Lobe)>,
}

/// Whether a property of a trained file is read.
pub(super) fn is_used(element: &str, property: &str) -> bool {
    let starts = ["f_dc_", "f_rest_", "scale_", "rot_"].iter().any(|start| property.starts_with(start));
    element == "vertex" && (starts || ["x", "y", "z", "opacity"].contains(&property))
}

/// Reads the columns of a trained file: opacity as logit, scales as logarithms, rotations w first and of any length.
/// Files without a third scale hold flat splats (2DGS), whose normal is the third axis.
pub(super) fn trained(path: &Path, columns: &mut Columns, notes: &mut Vec<String>) -> Result<Surface> {
    let mut take = |name: &str| column(path, columns, name);
    let centre = [take("x")?, take("y")?, take("z")?];
    let dc = [take("f_dc_0")?, take("f_dc_1")?, take("f_dc_2")?];
    let (opacity, scale_0, scale_1) = (take("opacity")?, take("scale_0")?, take("scale_1")?);
    let rotation = [take("rot_0")?, take("rot_1")?, take("rot_2")?, take("rot_3")?];
    let scale_2 = columns.scalars("vertex", "scale_2");
    let vector = |columns: &[Vec<f64>; 3], i: usize| DVec3::new(columns[0][i], columns[1][i], columns[2][i]);
    let radiance = Radiance::take(columns);
    let splats = (0..opacity.len()).map(|i| {
        let colour = 0.5 + harmonics::CONSTANT * vector(&dc, i);
        Splat {
            centre: vector(&centre, i),
            log_scales: DVec3::new(scale_0[i], scale_1[i], scale_2.as_ref().map_or(f64::MIN, |s| s[i])),
            rotation: DQuat::from_xyzw(rotation[1][i], rotation[2][i], rotation[3][i], rotation[0][i]),
            opacity: 1.0 / (1.0 + (-opacity[i]).exp()),
            colour,
            variation: radiance.as_ref().map(|radiance| radiance.variation(i, colour)),
        }
    });
    points(path, splats, notes)
}

/// Reads the columns of a packed file: 256 splats share the bounds of their centres (11, 10 and 11 bits), log scales
/// (the same) and colours (8 bits each, and the opacity); rotations are the three smaller components in 10 bits each
/// after 2 bits for which one was left out, in the order w, x, y, z. Older files bound no colours: they span [0, 1].
pub(super) fn packed(path: &Path, columns: &mut Columns, notes: &mut Vec<String>) -> Result<Surface> {
    let mut packed = |name: &str| column(path, columns, name);
    let (centre, rotation) = (packed("packed_position")?, packed("packed_rotation")?);
    let (scale, colour) = (packed("packed_scale")?, packed("packed_color")?);
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
        let what = "the element `chunk` lacks bounds of positions or scales; export the splat again";
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
    let colours = colours.unwrap_or_else(|| (vec![DVec3::ZERO; centres.0.len()], vec![DVec3::ONE; centres.0.len()]));
    let between = |(min, max): &(Vec<DVec3>, Vec<DVec3>), i: usize, t: DVec3| {
        let (min, max) = (min[i / CHUNK], max[i / CHUNK]);
        min + t * (max - min)
    };
    let splats = (0..centre.len()).map(|i| {
        let [red, green, blue, alpha] = (colour[i] as u32).to_be_bytes().map(|v| f64::from(v) / 255.0);
        Splat {
            centre: between(&centres, i, unpack_vector(centre[i] as u32)),
            log_scales: between(&scales, i, unpack_vector(scale[i] as u32)),
            rotation: unpack_rotation(rotation[i] as u32),
            opacity: alpha,
            colour: between(&colours, i, DVec3::new(red, green, blue)),
            variation: None,
        }
    });
    points(path, splats, notes)
}

/// A column of the vertices that a splat file must have.
fn column(path: &Path, columns: &mut Columns, name: &str) -> Result<Vec<f64>> {
    columns.scalars("vertex", name).ok_or_else(|| {
        Error::input(path, format!("the element `vertex` has no property {name}, as splats must; export it again"))
    })
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

/// The three smaller components, each at most sqrt(1/2) in size, and the largest from the unit length.
fn unpack_rotation(packed: u32) -> DQuat {
    let [a, b, c] = [20, 10, 0].map(|shift| (fraction(packed, shift, 10) - 0.5) * std::f64::consts::SQRT_2);
    let largest = (1.0 - a * a - b * b - c * c).max(0.0).sqrt();
    let [w, x, y, z] = match packed >> 30 {
        0 => [largest, a, b, c],
        1 => [a, largest, b, c],
        2 => [a, b, largest, c],
        _ => [a, b, c, largest],
    };
    DQuat::from_xyzw(x, y, z, w)
}

/// The splats that are opaque enough as points.
fn points(path: &Path, splats: impl Iterator<Item = Splat>, notes: &mut Vec<String>) -> Result<Surface> {
    let mut points = Points::default();
    let mut misshapen = Vec::new();
    let mut faint = 0;
    let mut count = 0;
    for (i, splat) in splats.enumerate() {
        count += 1;
        if splat.opacity < LEAST_OPACITY {
            faint += 1;
            continue;
        }
        let (thin, longer) = split_axes(splat.log_scales);
        let radius = 2.0 * (0.5 * (longer[0] + longer[1])).exp() as f32;
        let length = splat.rotation.length();
        if !(splat.opacity.is_finite() && radius.is_finite() && radius > 0.0 && length > 1e-9 && length.is_finite()) {
            misshapen.push(i);
            continue;
        }
        points.positions.push(splat.centre);
        points.normals.push((splat.rotation.normalize() * thin).normalize_or_zero());
        points.radii.push(radius);
        points.colours.push(colour::bytes(splat.colour));
        if let Some((variance, lobe)) = splat.variation {
            points.variances.push(variance);
            points.lobes.push(lobe);
        }
    }
    if let Some(first) = misshapen.first() {
        return Err(Error::input(
            path,
            format!(
                "{} of {count} splats have an opacity, scale or rotation that is not finite or has no size; first at \
                 vertex {first}; remove them",
                misshapen.len()
            ),
        ));
    }
    if faint > 0 {
        notes.push(format!("{faint} of {count} splats with an opacity under {LEAST_OPACITY} were left out"));
    }
    if points.positions.is_empty() && faint > 0 {
        let what = format!("all {count} splats have an opacity under {LEAST_OPACITY}; nothing is left to plan for");
        return Err(Error::input(path, what));
    }
    checks::finite(path, &points.positions, "point")?;
    Ok(Surface::Points(points))
}

/// The axis with the smallest scale as a unit vector, and the two other scales.
fn split_axes(scales: DVec3) -> (DVec3, [f64; 2]) {
    if scales.x <= scales.y && scales.x <= scales.z {
        (DVec3::X, [scales.y, scales.z])
    } else if scales.y <= scales.z {
        (DVec3::Y, [scales.x, scales.z])
    } else {
        (DVec3::Z, [scales.x, scales.y])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three splats in the layout of 3DGS; the second is faint. `rest` stands for harmonics that nobody needs here.
    fn file(rotation: [f32; 4]) -> Vec<u8> {
        let names = "x y z f_dc_0 f_dc_1 f_dc_2 f_rest_0 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
        let properties: String = names.split(' ').map(|n| format!("property float {n}\n")).collect();
        let mut bytes =
            format!("ply\nformat binary_little_endian 1.0\nelement vertex 3\n{properties}end_header\n").into_bytes();
        for (x, opacity) in [(0.0, 2.0), (1.0, -5.0), (2.0, 0.0)] {
            let row: [f32; 11] = [x, 0.0, 0.0, 0.0, 10.0, -10.0, 9.0, opacity, 0.0, 2.0f32.ln(), 0.01f32.ln()];
            row.iter().chain(&rotation).for_each(|v| bytes.extend(v.to_le_bytes()));
        }
        bytes
    }

    fn read(bytes: &[u8]) -> (Result<Surface>, Vec<String>) {
        let mut notes = Vec::new();
        (super::super::parse(Path::new("a.ply"), bytes, &mut notes), notes)
    }

    /// If this failed, the discs of a splat would face or measure wrongly, and haze would count as surface.
    #[test]
    fn a_splat_becomes_a_disc_across_its_shortest_axis() {
        // A quarter turn about x, of length 3, takes z to -y.
        let (surface, notes) = read(&file([3.0 * 0.5f32.sqrt(), 3.0 * 0.5f32.sqrt(), 0.0, 0.0]));
        let Surface::Points(points) = surface.unwrap() else { panic!("not points") };
        assert_eq!(points.positions, [DVec3::ZERO, DVec3::new(2.0, 0.0, 0.0)]);
        assert!((points.normals[0] - DVec3::NEG_Y).length() < 1e-6, "{:?}", points.normals);
        assert!((points.radii[0] - 2.0 * 2.0f32.sqrt()).abs() < 1e-6, "{:?}", points.radii);
        assert_eq!(points.colours[0], [128, 255, 0]);
        assert!(!points.oriented);
        assert_eq!(notes, ["1 of 3 splats with an opacity under 0.1 were left out"]);
    }

    /// If this failed, a rotation without direction would become a NaN normal.
    #[test]
    fn rotations_without_length_are_counted() {
        let (surface, _) = read(&file([0.0; 4]));
        assert!(surface.unwrap_err().to_string().contains("2 of 3 splats have an opacity, scale or rotation"));
    }

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
            let error = [q.w, q.x, q.y, q.z].iter().zip(unit).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(error < 2e-3, "{left_out}: {q:?} for {unit:?}");
        }
    }
}

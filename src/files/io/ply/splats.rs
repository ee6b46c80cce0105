//! Trained splats as points.
//!
//! Each splat becomes a point with a disc: its centre; the shortest axis as the normal, of unknown sign; as the radius
//! twice the geometric mean of the standard deviations along the two longer axes, so that the disc has the area of the
//! splat's two-sigma ellipse: neighbours overlap there, and what lies behind is hidden as it is in a render. The colour is that of the constant harmonic. Splats with an opacity under
//! [`MIN_OPACITY`] are left out: most of them are haze around the surface. The higher harmonics, where there are any, give how
//! much the splat's radiance varies.

use std::path::Path;

use glam::{DQuat, DVec3};

use super::super::checks;
use super::decode::Decoded;
use super::radiance::Radiance;
use crate::error::{Error, Result};
use crate::scene::surface::{Points, Surface};
use crate::scene::{colour, harmonics};

/// Splats that are fainter than this are no surface.
pub const MIN_OPACITY: f64 = 0.1;

/// The splats that are opaque enough as points. Flat splats (2DGS) have the third axis as their normal.
pub(super) fn points(path: &Path, splats: &Decoded, notes: &mut Vec<String>) -> Result<Surface> {
    let mut points = Points::default();
    let mut misshapen = Vec::new();
    let mut faint = 0;
    let count = splats.centres.len();
    let radiance = Radiance::new(&splats.rest);
    for i in 0..count {
        let opacity = 1.0 / (1.0 + (-splats.opacities[i]).exp());
        if opacity < MIN_OPACITY {
            faint += 1;
            continue;
        }
        let (thin, longer) = split_axes(splats.log_scales[i]);
        let radius = 2.0 * (0.5 * (longer[0] + longer[1])).exp() as f32;
        let [w, x, y, z] = splats.rotations[i];
        let rotation = DQuat::from_xyzw(x, y, z, w);
        let length = rotation.length();
        if !(opacity.is_finite() && radius.is_finite() && radius > 0.0 && length > 1e-9 && length.is_finite()) {
            misshapen.push(i);
            continue;
        }
        let plain = 0.5 + harmonics::CONSTANT * splats.constants[i];
        points.positions.push(splats.centres[i]);
        points.normals.push((rotation.normalize() * thin).normalize_or_zero());
        points.radii.push(radius);
        points.colours.push(colour::bytes(plain));
        if let Some(radiance) = &radiance {
            points.variances.push(radiance.variance(i, plain));
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
        notes.push(format!("{faint} of {count} splats with an opacity under {MIN_OPACITY} were left out"));
    }
    if points.positions.is_empty() && faint > 0 {
        let what = format!("all {count} splats have an opacity under {MIN_OPACITY}; nothing is left to plan for");
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

    /// Three splats in the layout of 3DGS; the second is faint. `rest` adds harmonics that are not needed here.
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
}

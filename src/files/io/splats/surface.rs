//! Trained splats as points of a surface.
//!
//! Each splat becomes a point with a disc: its centre; the shortest axis as the normal, of unknown sign; as the radius
//! twice the geometric mean of the standard deviations along the two longer axes, so that the disc has the area of the
//! splat's two-sigma ellipse: neighbours overlap there, and what lies behind is hidden as it is in a render. The colour is that of the
//! constant harmonic. Splats with an opacity under [`MIN_OPACITY`] are left out: most of them are haze around the surface. The higher
//! harmonics, where there are any, give how much the splat's radiance varies.

use std::path::Path;

use glam::{DQuat, DVec3, Vec3};

use super::radiance::Radiance;
use crate::error::{Error, Result};
use crate::scene::gaussians::Gaussians;
use crate::scene::surface::{Points, Surface};
use crate::scene::{colour, harmonics};

/// Splats that are fainter than this are no surface.
pub const MIN_OPACITY: f64 = 0.1;

/// The splats that are opaque enough as points. Of flat ones (2DGS) the third axis is the normal.
///
/// # Errors
/// Where none is.
pub fn points(path: &Path, splats: &Gaussians, notes: &mut Vec<String>) -> Result<Surface> {
    let mut points = Points::default();
    let mut faint = 0;
    let count = splats.len();
    let each = 3 * splats.coefficients();
    let radiance = Radiance::new(splats);
    for i in 0..count {
        if splats.opacity(i) < MIN_OPACITY {
            faint += 1;
            continue;
        }
        let (thin, longer) = split_axes(Vec3::from_array(splats.log_scales[i]).as_dvec3());
        let [w, x, y, z] = splats.rotations[i].map(f64::from);
        let rotation = DQuat::from_xyzw(x, y, z, w).normalize();
        let constant = &splats.harmonics[each * i..][..3];
        let plain = 0.5 + harmonics::CONSTANT * Vec3::from_slice(constant).as_dvec3();
        points.positions.push(splats.centres[i]);
        points.normals.push((rotation * thin).normalize_or_zero());
        points.radii.push(2.0 * (0.5 * (longer[0] + longer[1])).exp() as f32);
        points.colours.push(colour::bytes(plain));
        if let Some(radiance) = &radiance {
            points.variances.push(radiance.variance(i, plain));
        }
    }
    if faint > 0 {
        notes.push(format!("{faint} of {count} splats with an opacity under {MIN_OPACITY} were left out"));
    }
    if points.positions.is_empty() {
        let what = format!("all {count} splats have an opacity under {MIN_OPACITY}; nothing is left to plan for");
        return Err(Error::input(path, what));
    }
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

    /// Three splats; the second is faint.
    fn three(rotation: [f32; 4]) -> Gaussians {
        Gaussians {
            centres: (0..3).map(|i| DVec3::new(f64::from(i), 0.0, 0.0)).collect(),
            log_scales: vec![[0.0, 2.0f32.ln(), 0.01f32.ln()]; 3],
            rotations: vec![rotation; 3],
            opacities: vec![2.0, -5.0, 0.0],
            degree: 0,
            harmonics: [0.0, 10.0, -10.0].repeat(3),
            antialiased: false,
        }
    }

    /// If this failed, the discs of a splat would face or measure wrongly, and haze would count as surface.
    #[test]
    fn a_splat_becomes_a_disc_across_its_shortest_axis() {
        let mut notes = Vec::new();
        // A quarter turn about x, of length 3, takes z to -y.
        let splats = three([3.0 * 0.5f32.sqrt(), 3.0 * 0.5f32.sqrt(), 0.0, 0.0]);
        let Surface::Points(points) = points(Path::new("a.ply"), &splats, &mut notes).unwrap() else {
            panic!("not points")
        };
        assert_eq!(points.positions, [DVec3::ZERO, DVec3::new(2.0, 0.0, 0.0)]);
        assert!((points.normals[0] - DVec3::NEG_Y).length() < 1e-6, "{:?}", points.normals);
        assert!((points.radii[0] - 2.0 * 2.0f32.sqrt()).abs() < 1e-6, "{:?}", points.radii);
        assert_eq!(points.colours[0], [128, 255, 0]);
        assert!(!points.oriented);
        assert_eq!(notes, ["1 of 3 splats with an opacity under 0.1 were left out"]);
    }

    /// If this failed, a model that is haze alone would be planned for as an empty surface.
    #[test]
    fn haze_alone_is_refused() {
        let haze = Gaussians { opacities: vec![-5.0; 3], ..three([1.0, 0.0, 0.0, 0.0]) };
        let message = points(Path::new("a.ply"), &haze, &mut Vec::new()).unwrap_err().to_string();
        assert!(message.contains("all 3 splats have an opacity under 0.1"), "{message}");
    }
}

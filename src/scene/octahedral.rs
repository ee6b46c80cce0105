//! Equal-area octahedral map of the sphere (Clarberg 2008, "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD"):
//! every texel of an R x R image has solid angle 4 pi / R^2. Twin of `shaders/glsl/shared/octahedral.glsl`.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_4};

use glam::{DVec2, DVec3};

/// Unit direction at `square` in [-1, 1]^2.
pub fn direction(square: DVec2) -> DVec3 {
    let a = square.abs();
    let d = 1.0 - (a.x + a.y);
    let r = 1.0 - d.abs();
    let phi = if r == 0.0 { 0.0 } else { FRAC_PI_4 * ((a.y - a.x) / r + 1.0) };
    let f = r * (2.0 - r * r).sqrt();
    let side = |x: f64| if x < 0.0 { -1.0 } else { 1.0 };
    let z = if d < 0.0 { r * r - 1.0 } else { 1.0 - r * r };
    DVec3::new(f * phi.cos() * side(square.x), f * phi.sin() * side(square.y), z)
}

/// Direction of the centre of a texel, row-major.
pub(crate) fn texel_centre(texel: u32, resolution: u32) -> DVec3 {
    let at = DVec2::new((texel % resolution) as f64 + 0.5, (texel / resolution) as f64 + 0.5);
    direction(2.0 * at / resolution as f64 - 1.0)
}

/// Directions of all texel centres, row-major.
pub fn directions(resolution: u32) -> Vec<DVec3> {
    (0..resolution * resolution).map(|texel| texel_centre(texel, resolution)).collect()
}

/// The texel, row-major, in which unit direction `n` falls.
pub fn texel(n: DVec3, resolution: u32) -> u32 {
    let r = (1.0 - n.z.abs()).max(0.0).sqrt();
    let phi = if n.x == 0.0 && n.y == 0.0 { 0.0 } else { n.y.abs().atan2(n.x.abs()) * FRAC_2_PI };
    let mut square = DVec2::new(r - phi * r, phi * r);
    if n.z < 0.0 {
        square = DVec2::new(1.0 - square.y, 1.0 - square.x);
    }
    let side = |x: f64| if x < 0.0 { -1.0 } else { 1.0 };
    square *= DVec2::new(side(n.x), side(n.y));
    let at = |x: f64| (((0.5 * x + 0.5).max(0.0) * resolution as f64) as u32).min(resolution - 1);
    at(square.y) * resolution + at(square.x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plain mean over texels is the integral over the sphere only if all texels have the same solid angle.
    #[test]
    fn texels_have_equal_area() {
        let (resolution, fine) = (8, 64);
        for texel in 0..resolution * resolution {
            // Spherical area by the triangles of a fine grid within the texel.
            let corner = DVec2::new((texel % resolution) as f64, (texel / resolution) as f64);
            let at = |x: u32, y: u32| {
                let p = corner + DVec2::new(x as f64, y as f64) / fine as f64;
                direction(2.0 * p / resolution as f64 - 1.0)
            };
            let area = |a: DVec3, b: DVec3, c: DVec3| 0.5 * (b - a).cross(c - a).length();
            let mut sum = 0.0;
            for y in 0..fine {
                for x in 0..fine {
                    let (a, b, c, d) = (at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1));
                    sum += area(a, b, c) + area(b, d, c);
                }
            }
            let expected = 4.0 * std::f64::consts::PI / (resolution * resolution) as f64;
            assert!((sum / expected - 1.0).abs() < 2e-3, "texel {texel}: {sum} against {expected}");
        }
    }

    /// The depth map is looked up by direction: the wrong texel would be a wrong occlusion.
    #[test]
    fn a_texels_centre_falls_in_that_texel() {
        for resolution in [8, 16, 24, 40] {
            for texel in 0..resolution * resolution {
                let n = texel_centre(texel, resolution);
                assert!((n.length() - 1.0).abs() < 1e-12);
                assert_eq!(super::texel(n, resolution), texel);
            }
        }
    }
}

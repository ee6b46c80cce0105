//! Camera models of COLMAP: what their parameters mean.

use crate::scene::camera::Intrinsics;
use crate::scene::lens::Distortion;

/// A camera model: what the parameters mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Projection {
    /// Number in binary files.
    pub id: u32,
    /// Name in text files.
    pub name: &'static str,
    /// Number of parameters.
    pub parameters: usize,
    /// Whether one focal length serves both axes: f cx cy ... instead of fx fy cx cy ...
    pub one_focal: bool,
}

/// The models of COLMAP 4, which numbers them 0 to 17.
pub(crate) const PROJECTIONS: [Projection; 18] = [
    projection(0, "SIMPLE_PINHOLE", 3, true),
    projection(1, "PINHOLE", 4, false),
    projection(2, "SIMPLE_RADIAL", 4, true),
    projection(3, "RADIAL", 5, true),
    projection(4, "OPENCV", 8, false),
    projection(5, "OPENCV_FISHEYE", 8, false),
    projection(6, "FULL_OPENCV", 12, false),
    projection(7, "FOV", 5, false),
    projection(8, "SIMPLE_RADIAL_FISHEYE", 4, true),
    projection(9, "RADIAL_FISHEYE", 5, true),
    projection(10, "THIN_PRISM_FISHEYE", 12, false),
    projection(11, "RAD_TAN_THIN_PRISM_FISHEYE", 16, false),
    projection(12, "SIMPLE_DIVISION", 4, true),
    projection(13, "DIVISION", 5, false),
    projection(14, "SIMPLE_FISHEYE", 3, true),
    projection(15, "FISHEYE", 4, false),
    projection(16, "EUCM", 6, false),
    // A panorama of width x height, which no pinhole holds: known so that it can be left out.
    projection(17, "EQUIRECTANGULAR", 2, false),
];

const fn projection(id: u32, name: &'static str, parameters: usize, one_focal: bool) -> Projection {
    Projection { id, name, parameters, one_focal }
}

/// Intrinsics that images share.
#[derive(Clone, Debug, PartialEq)]
pub struct Lens {
    /// How the parameters were read.
    pub projection: Projection,
    /// The pinhole part.
    pub intrinsics: Intrinsics,
    /// The parameters after the pinhole part, in COLMAP's order.
    pub distortion: Vec<f64>,
}

impl Lens {
    /// Splits COLMAP's parameters into the pinhole part and the distortion.
    ///
    /// # Errors
    /// What is wrong, where the model is no perspective lens or the numbers are not those of one.
    pub fn new(projection: Projection, [width, height]: [u32; 2], parameters: &[f64]) -> Result<Self, String> {
        let Projection { name, parameters: count, one_focal, .. } = projection;
        if parameters.len() != count {
            return Err(format!("{name} takes {count} parameters and there are {}", parameters.len()));
        }
        let (focal, rest) = match *parameters {
            [f, ref rest @ ..] if one_focal => ([f, f], rest),
            [fx, fy, ref rest @ ..] => ([fx, fy], rest),
            _ => ([0.0; 2], parameters),
        };
        let Some((&principal, distortion)) = rest.split_first_chunk::<2>() else {
            return Err(format!("{name} is a panorama; cut perspective images from it"));
        };
        if width == 0 || height == 0 {
            return Err(format!("its images have {width} x {height} pixels"));
        }
        if !parameters.iter().all(|parameter| parameter.is_finite()) || focal.iter().any(|focal| *focal <= 0.0) {
            return Err(format!("its parameters are {parameters:?}, which is no lens"));
        }
        Ok(Self {
            projection,
            intrinsics: Intrinsics { width, height, focal, principal },
            distortion: distortion.to_vec(),
        })
    }

    /// A lens with a distortion in the form that holds every model, the inverse of [`Lens::unified`]; none where no model of COLMAP's
    /// has such a distortion.
    pub fn of(intrinsics: Intrinsics, distortion: Distortion) -> Option<Self> {
        let Distortion { fisheye, fov, division, unified, radial, rational, tangential: [p1, p2], prism, after_radial } =
            distortion;
        let [k1, k2, k3, k4, ..] = radial;
        let (name, parameters) = if distortion.is_none() {
            ("PINHOLE", Vec::new())
        } else if after_radial {
            ("RAD_TAN_THIN_PRISM_FISHEYE", [&radial[..], &[p1, p2], &prism].concat())
        } else if fisheye && ([p1, p2] != [0.0; 2] || prism != [0.0; 4]) {
            ("THIN_PRISM_FISHEYE", vec![k1, k2, p1, p2, k3, k4, prism[0], prism[2]])
        } else if fisheye {
            ("OPENCV_FISHEYE", vec![k1, k2, k3, k4])
        } else if fov != 0.0 {
            ("FOV", vec![fov])
        } else if division != 0.0 {
            ("DIVISION", vec![division])
        } else if unified != [0.0; 2] {
            ("EUCM", unified.to_vec())
        } else if rational != [0.0; 3] || k3 != 0.0 {
            ("FULL_OPENCV", vec![k1, k2, p1, p2, k3, rational[0], rational[1], rational[2]])
        } else {
            ("OPENCV", vec![k1, k2, p1, p2])
        };
        let projection = *PROJECTIONS.iter().find(|projection| projection.name == name)?;
        let lens = Self { projection, intrinsics, distortion: parameters };
        (lens.unified() == distortion).then_some(lens)
    }

    /// COLMAP's parameters, in its order.
    pub fn parameters(&self) -> Vec<f64> {
        let focal = if self.projection.one_focal { &self.intrinsics.focal[..1] } else { &self.intrinsics.focal };
        [focal, &self.intrinsics.principal, &self.distortion].concat()
    }

    /// The distortion in the form that holds every model (formulae: COLMAP's `models.h`).
    pub fn unified(&self) -> Distortion {
        let none = Distortion::default();
        let k = |i: usize| self.distortion.get(i).copied().unwrap_or(0.0);
        let radial = |indices: &[usize]| {
            let mut factors = [0.0; 6];
            factors.iter_mut().zip(indices).for_each(|(factor, i)| *factor = k(*i));
            factors
        };
        match self.projection.name {
            "SIMPLE_RADIAL" => Distortion { radial: radial(&[0]), ..none },
            "RADIAL" => Distortion { radial: radial(&[0, 1]), ..none },
            "OPENCV" => Distortion { radial: radial(&[0, 1]), tangential: [k(2), k(3)], ..none },
            "FULL_OPENCV" => Distortion {
                radial: radial(&[0, 1, 4]),
                rational: [k(5), k(6), k(7)],
                tangential: [k(2), k(3)],
                ..none
            },
            "FOV" => Distortion { fov: k(0), ..none },
            "SIMPLE_DIVISION" | "DIVISION" => Distortion { division: k(0), ..none },
            // With alpha of zero it is a pinhole, whatever beta.
            "EUCM" if k(0) != 0.0 => Distortion { unified: [k(0), k(1)], ..none },
            "SIMPLE_FISHEYE" | "FISHEYE" => Distortion { fisheye: true, ..none },
            "OPENCV_FISHEYE" => Distortion { fisheye: true, radial: radial(&[0, 1, 2, 3]), ..none },
            "SIMPLE_RADIAL_FISHEYE" => Distortion { fisheye: true, radial: radial(&[0]), ..none },
            "RADIAL_FISHEYE" => Distortion { fisheye: true, radial: radial(&[0, 1]), ..none },
            "THIN_PRISM_FISHEYE" => Distortion {
                fisheye: true,
                radial: radial(&[0, 1, 4, 5]),
                tangential: [k(2), k(3)],
                prism: [k(6), 0.0, k(7), 0.0],
                ..none
            },
            "RAD_TAN_THIN_PRISM_FISHEYE" => Distortion {
                fisheye: true,
                radial: radial(&[0, 1, 2, 3, 4, 5]),
                tangential: [k(6), k(7)],
                prism: [k(8), k(9), k(10), k(11)],
                after_radial: true,
                ..none
            },
            // Pinholes.
            _ => none,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, the coefficients of a lens would be taken for one another: each model at one point, by the formulae of
    /// COLMAP's `models.h` written out, with a different number for every parameter.
    #[test]
    fn every_model_bends_as_colmap_says() {
        let (u, v) = (0.4f64, -0.3f64);
        let r2 = u * u + v * v;
        let r = r2.sqrt();
        let theta = r.atan();
        let (fu, fv) = (u * theta / r, v * theta / r);
        let t2 = theta * theta;
        let series = |k: &[f64], x: f64| k.iter().rev().fold(0.0, |sum, k| (sum + k) * x);
        let tangent = |x: f64, y: f64, p1: f64, p2: f64| {
            let r2 = x * x + y * y;
            (2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y))
        };
        let full = (1.0 + series(&[0.1, 0.02, 0.03], r2)) / (1.0 + series(&[0.04, 0.05, 0.06], r2));
        let (tu, tv) = tangent(u, v, 1e-3, 2e-3);
        let (gu, gv) = tangent(fu, fv, 1e-3, 2e-3);
        let prism = 1.0 + series(&[0.1, 0.02, 0.03, 0.04], t2);
        let fov = (2.0 * r * 0.4f64.tan()).atan() / (r * 0.8);
        let six = 1.0 + series(&[0.1, 0.02, 0.03, 0.04, 0.05, 0.06], t2);
        let (su, sv) = (six * fu, six * fv);
        let s2 = su * su + sv * sv;
        let both = 2.0 * (1e-3 * su + 2e-3 * sv);
        let division = 2.0 / (1.0 + (1.0 + 4.0 * 0.2 * r2).sqrt());
        let unified = 1.0 / (0.6 * (1.0 + 1.1 * r2).sqrt() + 0.4);
        let cases: [(&str, &[f64], [f64; 2]); 13] = [
            ("RADIAL", &[0.1, 0.02], [u, v].map(|x| x * (1.0 + series(&[0.1, 0.02], r2)))),
            ("FULL_OPENCV", &[0.1, 0.02, 1e-3, 2e-3, 0.03, 0.04, 0.05, 0.06], [u * full + tu, v * full + tv]),
            ("FOV", &[0.8], [u * fov, v * fov]),
            ("SIMPLE_DIVISION", &[-0.2], [u * division, v * division]),
            ("DIVISION", &[-0.2], [u * division, v * division]),
            ("SIMPLE_FISHEYE", &[], [fu, fv]),
            ("FISHEYE", &[], [fu, fv]),
            ("EUCM", &[0.6, 1.1], [u * unified, v * unified]),
            ("OPENCV_FISHEYE", &[0.1, 0.02, 0.03, 0.04], [fu * prism, fv * prism]),
            ("SIMPLE_RADIAL_FISHEYE", &[0.1], [fu, fv].map(|x| x * (1.0 + 0.1 * t2))),
            ("RADIAL_FISHEYE", &[0.1, 0.02], [fu, fv].map(|x| x * (1.0 + series(&[0.1, 0.02], t2)))),
            (
                "THIN_PRISM_FISHEYE",
                &[0.1, 0.02, 1e-3, 2e-3, 0.03, 0.04, 5e-3, 6e-3],
                [fu * prism + gu + 5e-3 * t2, fv * prism + gv + 6e-3 * t2],
            ),
            (
                "RAD_TAN_THIN_PRISM_FISHEYE",
                &[0.1, 0.02, 0.03, 0.04, 0.05, 0.06, 1e-3, 2e-3, 5e-3, 6e-3, 7e-3, 8e-3],
                [
                    su + both * su + s2 * 1e-3 + 5e-3 * s2 + 6e-3 * s2 * s2,
                    sv + both * sv + s2 * 2e-3 + 7e-3 * s2 + 8e-3 * s2 * s2,
                ],
            ),
        ];
        for (name, distortion, expected) in cases {
            let projection = *PROJECTIONS.iter().find(|p| p.name == name).unwrap();
            let focal: &[f64] = if projection.one_focal { &[100.0] } else { &[100.0, 100.0] };
            let parameters = [focal, &[50.0, 60.0], distortion].concat();
            let lens = Lens::new(projection, [100, 120], &parameters).unwrap();
            let bent = lens.unified().distort(glam::DVec2::new(u, v)).to_array();
            for axis in 0..2 {
                assert!((bent[axis] - expected[axis]).abs() < 1e-12, "{name}: {bent:?} instead of {expected:?}");
            }
        }
    }

    /// If this failed, a lens that is none would reach the projection, and every pixel be NaN.
    #[test]
    fn what_is_no_lens_is_refused() {
        let made = |name: &str, size: [u32; 2], parameters: &[f64]| {
            let projection = *PROJECTIONS.iter().find(|p| p.name == name).unwrap();
            Lens::new(projection, size, parameters).unwrap_err()
        };
        assert!(made("PINHOLE", [9, 9], &[5.0; 3]).contains("takes 4 parameters and there are 3"));
        assert!(made("PINHOLE", [9, 0], &[5.0; 4]).contains("9 x 0 pixels"));
        assert!(made("PINHOLE", [9, 9], &[5.0, -5.0, 4.0, 4.0]).contains("no lens"));
        assert!(made("SIMPLE_RADIAL", [9, 9], &[5.0, 4.0, 4.0, f64::NAN]).contains("no lens"));
        assert!(made("EQUIRECTANGULAR", [9, 9], &[9.0, 9.0]).contains("panorama"));
    }
}

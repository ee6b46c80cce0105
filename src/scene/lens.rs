//! Lenses: a pinhole and what it does not explain.
//!
//! One form holds every distortion model that COLMAP, nerfstudio and OpenCV know. Formulae: the camera models in COLMAP's
//! documentation (`models.h`) and OpenCV's calib3d.

use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

use super::camera::Intrinsics;

/// How directions are bent before the pinhole maps them to pixels.
///
/// From (u, v) = (x/z, y/z), with r = |(u, v)|: a fisheye scales (u, v) by theta/r, theta = atan r; the FOV model scales by
/// `atan(2 r tan(w/2)) / (r w)`, the division model by `2 / (1 + sqrt(1 - 4 k r^2))`, the enhanced unified model by
/// `1 / (alpha sqrt(1 + beta r^2) + 1 - alpha)`. Then (u, v) is scaled by `(1 + sum a_i r^2i) / (1 + sum b_i r^2i)`, and tangential and prism
/// terms are added.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Distortion {
    /// Whether the radius is an angle.
    pub fisheye: bool,
    /// The FOV model's angle in radians; zero for every other model.
    pub fov: f64,
    /// The division model's k; zero for every other model.
    #[serde(default)]
    pub division: f64,
    /// Alpha and beta of the enhanced unified model; zero for every other model.
    #[serde(default)]
    pub unified: [f64; 2],
    /// Factors of r^2, r^4, ... r^12 in the numerator.
    pub radial: [f64; 6],
    /// Factors of r^2, r^4, r^6 in the denominator.
    pub rational: [f64; 3],
    /// OpenCV's p1, p2.
    pub tangential: [f64; 2],
    /// Factors of r^2 and r^4 in x, and of the same in y.
    pub prism: [f64; 4],
    /// Whether tangential and prism terms are taken of the radially distorted point (RAD_TAN_THIN_PRISM_FISHEYE) and not of the
    /// undistorted one (all others).
    pub after_radial: bool,
}

/// A pinhole with distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// The pinhole.
    pub intrinsics: Intrinsics,
    /// The distortion.
    pub distortion: Distortion,
    /// Radius |(x/z, y/z)| past which directions are outside the lens, since the distortion folds back there.
    limit: f64,
}

/// Steps of the search for the radius at which a distortion folds back, and the tangent it is searched up to.
const LIMIT_STEPS: u32 = 512;
const WIDEST: f64 = 50.0;

impl Distortion {
    /// Whether there is none.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// (u, v) before distortion to what the pinhole is applied to.
    pub fn distort(&self, p: DVec2) -> DVec2 {
        let r = p.length();
        let turned = if r < 1e-9 {
            1.0
        } else if self.fisheye {
            r.atan() / r
        } else if self.fov > 0.0 {
            (2.0 * r * (0.5 * self.fov).tan()).atan() / (r * self.fov)
        } else if self.division != 0.0 {
            // Not a number past the radius that the model reaches, where `limit` ends.
            2.0 / (1.0 + (1.0 - 4.0 * self.division * r * r).sqrt())
        } else {
            let [alpha, beta] = self.unified;
            1.0 / (alpha * (1.0 + beta * r * r).sqrt() + 1.0 - alpha)
        };
        let p = turned * p;
        let r2 = p.length_squared();
        let series = |factors: &[f64]| factors.iter().rev().fold(0.0, |sum, k| (sum + k) * r2);
        let bent = (1.0 + series(&self.radial)) / (1.0 + series(&self.rational)) * p;
        let (q, r2) = if self.after_radial { (bent, bent.length_squared()) } else { (p, r2) };
        let [p1, p2] = self.tangential;
        let [x2, x4, y2, y4] = self.prism;
        let (tangent_x, tangent_y) = if self.after_radial {
            // That model has the two the other way about.
            let both = 2.0 * q.dot(DVec2::new(p1, p2));
            (both * q.x + r2 * p1, both * q.y + r2 * p2)
        } else {
            (2.0 * p1 * q.x * q.y + p2 * (r2 + 2.0 * q.x * q.x), 2.0 * p2 * q.x * q.y + p1 * (r2 + 2.0 * q.y * q.y))
        };
        bent + DVec2::new(tangent_x + x2 * r2 + x4 * r2 * r2, tangent_y + y2 * r2 + y4 * r2 * r2)
    }

    /// The radius at which the radial part stops to grow.
    fn limit(&self) -> f64 {
        let radial = Self { tangential: [0.0; 2], prism: [0.0; 4], ..*self };
        if radial.is_none() {
            return f64::INFINITY;
        }
        let mut last = 0.0;
        for step in 1..=LIMIT_STEPS {
            // Even steps of the angle.
            let r = (f64::from(step) / f64::from(LIMIT_STEPS) * WIDEST.atan()).tan();
            let bent = radial.distort(DVec2::new(r, 0.0)).x;
            if bent <= last || bent.is_nan() {
                return (f64::from(step - 1) / f64::from(LIMIT_STEPS) * WIDEST.atan()).tan();
            }
            last = bent;
        }
        WIDEST
    }
}

impl Lens {
    /// A lens.
    pub fn new(intrinsics: Intrinsics, distortion: Distortion) -> Self {
        Self { intrinsics, distortion, limit: distortion.limit() }
    }

    /// Radius |(x/z, y/z)| past which directions are outside the lens; infinite for a pinhole.
    pub fn limit(&self) -> f64 {
        self.limit
    }

    /// Pixel of a point in camera axes (X right, Y down, Z forward); none behind the camera or where the lens bends no
    /// light to. It may lie outside the image.
    pub fn project(&self, p: DVec3) -> Option<DVec2> {
        let flat = p.truncate() / p.z;
        if !(p.z > 0.0 && flat.length() <= self.limit) {
            return None;
        }
        let Intrinsics { focal, principal, .. } = self.intrinsics;
        Some(DVec2::from(focal) * self.distortion.distort(flat) + DVec2::from(principal))
    }

    /// As [`Lens::project`], and none outside the image.
    pub fn pixel(&self, p: DVec3) -> Option<DVec2> {
        let Intrinsics { width, height, .. } = self.intrinsics;
        let inside =
            |pixel: &DVec2| (0.0..f64::from(width)).contains(&pixel.x) && (0.0..f64::from(height)).contains(&pixel.y);
        self.project(p).filter(inside)
    }

    /// Unit direction in camera axes of what a pixel shows, by Newton's method on [`Lens::project`]; none where no direction
    /// in front of the camera maps there.
    pub fn unproject(&self, pixel: DVec2) -> Option<DVec3> {
        let Intrinsics { focal, principal, .. } = self.intrinsics;
        let target = (pixel - DVec2::from(principal)) / DVec2::from(focal);
        let mut p = target;
        if self.distortion.is_none() {
            return Some(p.extend(1.0).normalize());
        }
        if p.length() > self.limit {
            p *= 0.9 * self.limit / p.length();
        }
        for _ in 0..50 {
            let error = self.distortion.distort(p) - target;
            let h = 1e-6 * (1.0 + p.length());
            let by_x = (self.distortion.distort(p + DVec2::new(h, 0.0)) - error - target) / h;
            let by_y = (self.distortion.distort(p + DVec2::new(0.0, h)) - error - target) / h;
            let determinant = by_x.perp_dot(by_y);
            let step = DVec2::new(error.perp_dot(by_y), by_x.perp_dot(error)) / determinant;
            if !step.is_finite() {
                return None;
            }
            p -= step.clamp_length_max(0.5 * (1.0 + p.length()));
            if step.length() < 1e-12 * (1.0 + p.length()) {
                break;
            }
        }
        let found = (self.distortion.distort(p) - target).length() < 1e-7 && p.length() <= self.limit;
        found.then(|| p.extend(1.0).normalize())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lens(distortion: Distortion) -> Lens {
        Lens::new(Intrinsics { width: 640, height: 480, focal: [500.0, 510.0], principal: [320.0, 240.0] }, distortion)
    }

    fn models() -> Vec<Distortion> {
        let none = Distortion::default();
        vec![
            none,
            Distortion { radial: [-0.1, 0.02, 0.0, 0.0, 0.0, 0.0], ..none },
            Distortion { radial: [0.1, -0.02, 0.0, 0.0, 0.0, 0.0], tangential: [1e-3, -2e-3], ..none },
            Distortion { radial: [0.3, 0.1, 0.01, 0.0, 0.0, 0.0], rational: [0.2, 0.05, 0.01], ..none },
            Distortion { fisheye: true, radial: [0.02, -0.01, 0.001, 0.0, 0.0, 0.0], ..none },
            Distortion { fov: 0.9, ..none },
            Distortion { division: -0.2, ..none },
            Distortion { division: 0.3, ..none },
            Distortion { unified: [0.6, 1.1], ..none },
            Distortion { fisheye: true, tangential: [1e-3, 2e-3], prism: [1e-3, 0.0, -1e-3, 0.0], ..none },
            Distortion { fisheye: true, tangential: [1e-3, 2e-3], prism: [1e-3; 4], after_radial: true, ..none },
        ]
    }

    /// If this failed, a pixel would be laid to another direction than the one that it shows.
    #[test]
    fn unprojection_undoes_projection() {
        for (model, distortion) in models().into_iter().enumerate() {
            let lens = lens(distortion);
            for (x, y) in [(0.0, 0.0), (0.3, -0.2), (-0.5, 0.4), (0.6, 0.45)] {
                let p = DVec3::new(x, y, 1.0);
                let pixel = lens.project(2.0 * p).unwrap();
                let back = lens.unproject(pixel).unwrap();
                assert!((back - p.normalize()).length() < 1e-9, "model {model}: {p} came back as {back}");
            }
        }
    }

    /// Barrel distortion grows without bound: past its fold, what is far outside the image would appear inside it.
    #[test]
    fn what_lies_past_the_fold_is_not_seen() {
        let lens = lens(Distortion { radial: [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0], ..Distortion::default() });
        // r (1 - 0.3 r^2) is greatest at r = 1.054, and zero at r = 1.826.
        assert!((lens.limit() - 1.054).abs() < 0.03, "{}", lens.limit());
        assert!(lens.project(DVec3::new(1.8, 0.0, 1.0)).is_none());
        assert!(lens.project(DVec3::new(0.9, 0.0, 1.0)).is_some());
        assert!(lens.project(DVec3::new(0.0, 0.0, -1.0)).is_none());
        assert!(lens.unproject(DVec2::new(5000.0, 240.0)).is_none());
    }

    /// Computed directly: OpenCV's formulae at (0.5, 0.25). A swapped coefficient would shift every photo by pixels.
    #[test]
    fn opencv_by_hand() {
        let lens = lens(Distortion {
            radial: [0.1, 0.01, 0.0, 0.0, 0.0, 0.0],
            tangential: [0.001, 0.002],
            ..Distortion::default()
        });
        let (u, v, r2) = (0.5, 0.25, 0.3125f64);
        let radial = 1.0 + 0.1 * r2 + 0.01 * r2 * r2;
        let x = u * radial + 2.0 * 0.001 * u * v + 0.002 * (r2 + 2.0 * u * u);
        let y = v * radial + 2.0 * 0.002 * u * v + 0.001 * (r2 + 2.0 * v * v);
        let pixel = lens.project(DVec3::new(1.0, 0.5, 2.0)).unwrap();
        assert!((pixel - DVec2::new(500.0 * x + 320.0, 510.0 * y + 240.0)).length() < 1e-9, "{pixel}");
    }
}

//! From a Gaussian in the world to one in the picture, and gradients the other way (EWA splatting, Zwicker et al. 2001, as
//! in Kerbl et al. 2023).

use glam::{DMat2, DMat3, DVec2, DVec3};

use super::{Rules, Splat, View};
use crate::scene::harmonics;

/// Part of the picture's size beyond its edges where the Jacobian still follows the ray.
const MARGIN: f64 = 0.15;

/// A splat in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// Mean m in pixels.
    pub mean: DVec2,
    /// Covariance with the low-pass filter, in square pixels: xx, xy, yy.
    pub covariance: [f64; 3],
    /// Inverse of the covariance: A, B, C of `0.5 (A dx^2 + C dy^2) + B dx dy`.
    pub conic: [f64; 3],
    /// Opacity, made up for the filter where the rules require it.
    pub opacity: f64,
    /// sRGB, not below zero.
    pub colour: DVec3,
    /// Depth along the camera's axis.
    pub depth: f64,
}

/// Gradient by the values of a [`Projected`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gradient {
    /// By the mean, per pixel.
    pub mean: DVec2,
    /// By A, B and C.
    pub conic: [f64; 3],
    /// By the opacity.
    pub opacity: f64,
    /// By the colour.
    pub colour: DVec3,
}

/// The splat in the picture; none where it is too near, has no size, or is fainter than the rules' least alpha.
pub fn project(splat: &Splat, view: &View, rules: &Rules) -> Option<Projected> {
    let p = view.rotation * splat.centre + view.translation;
    if p.z < view.near {
        return None;
    }
    let shape = Shape::new(splat, view, p, rules.low_pass());
    let opacity = logistic(splat.opacity) * if rules.antialiased { shape.compensation() } else { 1.0 };
    if shape.determinant <= 0.0 || !shape.determinant.is_finite() || opacity < rules.least_alpha {
        return None;
    }
    Some(Projected {
        mean: DVec2::from_array(view.focal) * p.truncate() / p.z + DVec2::from_array(view.principal),
        covariance: shape.covariance,
        conic: shape.conic(),
        opacity,
        colour: unclamped_colour(splat, direction(splat, view)).max(DVec3::ZERO),
        depth: p.z,
    })
}

/// Gradient by the splat from that by what it is in the picture; zero where it is not drawn.
pub fn backward(splat: &Splat, view: &View, rules: &Rules, by: &Gradient) -> Splat {
    let mut to = Splat::zero(splat.harmonics.len());
    if project(splat, view, rules).is_none() {
        return to;
    }
    let p = view.rotation * splat.centre + view.translation;
    let shape = Shape::new(splat, view, p, rules.low_pass());

    // 1 - o has no digits left where o is all but 1.
    let (opacity, clear) = (logistic(splat.opacity), logistic(-splat.opacity));
    let (compensation, by_compensation) =
        if rules.antialiased { (shape.compensation(), by.opacity * opacity) } else { (1.0, 0.0) };
    to.opacity = by.opacity * compensation * opacity * clear;

    let by_factor = shape.by_factor(by.conic, by_compensation);
    let by_jacobian = multiplied(by_factor, shape.spread.transpose());
    // N = J W with W = R Q diag(s); columns of the gradient by W.
    let by_spread = DMat3::from_cols_array_2d(&std::array::from_fn(|column| {
        (shape.jacobian[0] * by_factor[0][column] + shape.jacobian[1] * by_factor[1][column]).to_array()
    }));
    let by_axes = view.rotation.transpose() * by_spread;
    let mut by_rotation = DMat3::ZERO;
    for k in 0..3 {
        to.log_scale[k] = shape.scale[k] * shape.rotation.col(k).dot(by_axes.col(k));
        *by_rotation.col_mut(k) = shape.scale[k] * by_axes.col(k);
    }
    to.rotation = by_quaternion(splat.rotation, by_rotation);

    let by_point = shape.by_point(view, p, by_jacobian) + by_point_of_mean(view, p, by.mean);
    to.centre = view.rotation.transpose() * by_point + backward_colour(splat, view, by.colour, &mut to.harmonics);
    to
}

/// The covariance in the picture and what it is made of.
///
/// It is `N N^T + b I` with the filter's variance b and the 2 x 3 factor N = J R Q diag(s). Determinants come from the minors of N
/// (Cauchy and Binet), which are squares: differences of products would lose all digits for long, thin splats.
struct Shape {
    rotation: DMat3,
    scale: DVec3,
    /// R Q diag(s).
    spread: DMat3,
    /// Rows of J.
    jacobian: [DVec3; 2],
    /// The ray (a, b) that J is for, and whether each was left as it was.
    ray: [(f64, bool); 2],
    /// Rows of N.
    factor: [DVec3; 2],
    /// Cross product of the rows of N; its length squared is the determinant without the filter.
    minors: DVec3,
    covariance: [f64; 3],
    determinant: f64,
}

impl Shape {
    fn new(splat: &Splat, view: &View, p: DVec3, blur: f64) -> Self {
        let rotation = matrix(unit(splat.rotation));
        let scale = splat.log_scale.exp();
        let spread = view.rotation * rotation * DMat3::from_diagonal(scale);
        let ray = clamped_ray(view, p);
        let [fx, fy] = view.focal;
        let jacobian = [DVec3::new(fx, 0.0, -fx * ray[0].0) / p.z, DVec3::new(0.0, fy, -fy * ray[1].0) / p.z];
        let factor = multiplied(jacobian, spread);
        let minors = factor[0].cross(factor[1]);
        let plain = [factor[0].length_squared(), factor[0].dot(factor[1]), factor[1].length_squared()];
        Self {
            rotation,
            scale,
            spread,
            jacobian,
            ray,
            factor,
            minors,
            covariance: [plain[0] + blur, plain[1], plain[2] + blur],
            determinant: minors.length_squared() + blur * (plain[0] + plain[2]) + blur * blur,
        }
    }

    fn conic(&self) -> [f64; 3] {
        let [xx, xy, yy] = self.covariance;
        [yy / self.determinant, -xy / self.determinant, xx / self.determinant]
    }

    /// Root of the part of the determinant that is there without the filter.
    fn compensation(&self) -> f64 {
        self.minors.length() / self.determinant.sqrt()
    }

    /// Gradient by the rows of N.
    fn by_factor(&self, by_conic: [f64; 3], by_compensation: f64) -> [DVec3; 2] {
        let [a, b, c] = self.conic();
        let conic = DMat2::from_cols_array(&[a, b, b, c]);
        // B represents two entries of the symmetric matrix.
        let by_inverse = DMat2::from_cols_array(&[by_conic[0], 0.5 * by_conic[1], 0.5 * by_conic[1], by_conic[2]]);
        let by_covariance = -conic * by_inverse * conic - 0.5 * by_compensation * self.compensation() * conic;
        let [first, second] = self.factor;
        let by_length = by_compensation / self.determinant.sqrt() * self.minors.normalize_or_zero();
        [
            2.0 * (by_covariance.col(0)[0] * first + by_covariance.col(1)[0] * second) + second.cross(by_length),
            2.0 * (by_covariance.col(0)[1] * first + by_covariance.col(1)[1] * second) + by_length.cross(first),
        ]
    }

    /// Gradient by the point in the camera's frame, through J.
    fn by_point(&self, view: &View, p: DVec3, by_jacobian: [DVec3; 2]) -> DVec3 {
        let mut by_point = DVec3::ZERO;
        for axis in 0..2 {
            let (ray, followed) = self.ray[axis];
            by_point.z -= by_jacobian[axis].dot(self.jacobian[axis]) / p.z;
            if followed {
                let by_ray = -view.focal[axis] / p.z * by_jacobian[axis].z;
                by_point[axis] += by_ray / p.z;
                by_point.z -= by_ray * ray / p.z;
            }
        }
        by_point
    }
}

/// Slopes x/z and y/z of the ray to `p`, clamped to a margin about the picture, and whether each is still that of the ray.
fn clamped_ray(view: &View, p: DVec3) -> [(f64, bool); 2] {
    let size = [f64::from(view.width), f64::from(view.height)];
    std::array::from_fn(|axis| {
        let (f, c) = (view.focal[axis], view.principal[axis]);
        let margin = MARGIN * size[axis] / f;
        let ray = p[axis] / p.z;
        let clamped = ray.max(-(c / f + margin)).min((size[axis] - c) / f + margin);
        (clamped, clamped == ray)
    })
}

fn by_point_of_mean(view: &View, p: DVec3, by_mean: DVec2) -> DVec3 {
    let by_ray = by_mean * DVec2::from_array(view.focal) / p.z;
    by_ray.extend(-by_ray.dot(p.truncate()) / p.z)
}

/// Rows of a 2 x 3 matrix times a 3 x 3 matrix.
fn multiplied(rows: [DVec3; 2], matrix: DMat3) -> [DVec3; 2] {
    rows.map(|row| matrix.transpose() * row)
}

/// Unit direction from the camera to the splat.
fn direction(splat: &Splat, view: &View) -> DVec3 {
    (splat.centre - view.centre()).normalize()
}

fn unclamped_colour(splat: &Splat, w: DVec3) -> DVec3 {
    let constant = DVec3::splat(0.5) + harmonics::CONSTANT * splat.harmonics[0];
    constant + splat.harmonics[1..].iter().zip(harmonics::above_constant(w)).map(|(h, b)| b * *h).sum::<DVec3>()
}

/// Fills in the gradient by the coefficients and returns that by the centre.
fn backward_colour(splat: &Splat, view: &View, by_colour: DVec3, by_harmonics: &mut [DVec3]) -> DVec3 {
    let w = direction(splat, view);
    let colour = unclamped_colour(splat, w);
    let by = DVec3::from_array(std::array::from_fn(|c| if colour[c] > 0.0 { by_colour[c] } else { 0.0 }));
    by_harmonics[0] = harmonics::CONSTANT * by;
    by_harmonics[1..].iter_mut().zip(harmonics::above_constant(w)).for_each(|(to, b)| *to = b * by);
    let slopes = harmonics::above_constant_slopes(w);
    let by_direction: DVec3 = splat.harmonics[1..].iter().zip(slopes).map(|(h, slope)| by.dot(*h) * slope).sum();
    (by_direction - w * w.dot(by_direction)) / (splat.centre - view.centre()).length()
}

/// 1 / (1 + exp(-x)).
fn logistic(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

fn unit(q: [f64; 4]) -> [f64; 4] {
    let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    q.map(|v| v / length)
}

/// Rotation of a unit quaternion (w, x, y, z).
fn matrix([w, x, y, z]: [f64; 4]) -> DMat3 {
    DMat3::from_cols(
        DVec3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        DVec3::new(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        DVec3::new(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
}

/// Gradient by a quaternion of any length from that by its rotation.
fn by_quaternion(q: [f64; 4], by_matrix: DMat3) -> [f64; 4] {
    let [w, x, y, z] = unit(q);
    let g = |row: usize, column: usize| by_matrix.col(column)[row];
    let by_unit = [
        2.0 * (x * (g(2, 1) - g(1, 2)) + y * (g(0, 2) - g(2, 0)) + z * (g(1, 0) - g(0, 1))),
        2.0 * (y * (g(1, 0) + g(0, 1)) + z * (g(2, 0) + g(0, 2)) + w * (g(2, 1) - g(1, 2)))
            - 4.0 * x * (g(1, 1) + g(2, 2)),
        2.0 * (x * (g(1, 0) + g(0, 1)) + z * (g(2, 1) + g(1, 2)) + w * (g(0, 2) - g(2, 0)))
            - 4.0 * y * (g(0, 0) + g(2, 2)),
        2.0 * (x * (g(2, 0) + g(0, 2)) + y * (g(2, 1) + g(1, 2)) + w * (g(1, 0) - g(0, 1)))
            - 4.0 * z * (g(0, 0) + g(1, 1)),
    ];
    let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    // Length means nothing, so only what is across the quaternion remains.
    let along: f64 = by_unit.iter().zip([w, x, y, z]).map(|(g, u)| g * u).sum();
    std::array::from_fn(|k| (by_unit[k] - along * [w, x, y, z][k]) / length)
}

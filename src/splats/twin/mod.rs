//! Rendering and training in plain Rust and double precision: what the shaders are tested against.
//!
//! Every formula is here once more, written for exactness, not for speed. Frames: the world of the splats; cameras with
//! OpenCV axes; pixels with the centre of the first at (0.5, 0.5).

mod composite;
pub mod fisher;
pub(crate) mod loss;
pub mod optimise;
mod pose;
pub(crate) mod project;
#[cfg(test)]
mod tests;

use glam::{DMat3, DVec2, DVec3};

use crate::engine::vulkan::shaders::glsl::splats::gaussian;
use crate::scene::gaussians::Gaussians;

pub use self::loss::loss;
pub use self::pose::by_pose;
pub use self::project::Projected;

/// What a picture is taken with: a pinhole, camera-from-world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Camera-from-world rotation R.
    pub rotation: DMat3,
    /// Camera-from-world translation t: a point x of the world is `R x + t` for the camera.
    pub translation: DVec3,
    /// Focal lengths in pixels (x, y).
    pub focal: [f64; 2],
    /// Principal point in pixels (x, y).
    pub principal: [f64; 2],
    /// Pixels in a row.
    pub width: u32,
    /// Rows of pixels.
    pub height: u32,
    /// Centres nearer than this, along the axis, are not drawn; more than 0.
    pub near: f64,
}

impl View {
    /// Camera centre in the world.
    pub fn centre(&self) -> DVec3 {
        -(self.rotation.transpose() * self.translation)
    }

    /// Pixels of the picture.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

/// A Gaussian, or the gradient by each of its values.
#[derive(Clone, Debug, PartialEq)]
pub struct Splat {
    /// Centre in the world.
    pub centre: DVec3,
    /// Natural logarithms of the standard deviations along the three axes.
    pub log_scale: DVec3,
    /// World-from-splat quaternion (w, x, y, z) of any length but zero.
    pub rotation: [f64; 4],
    /// Logit of the opacity.
    pub opacity: f64,
    /// 1, 4, 9 or 16 coefficients of red, green and blue.
    pub harmonics: Vec<DVec3>,
}

impl Splat {
    /// The gradient of what does not depend on a splat with so many coefficients.
    fn zero(coefficients: usize) -> Self {
        Self {
            centre: DVec3::ZERO,
            log_scale: DVec3::ZERO,
            rotation: [0.0; 4],
            opacity: 0.0,
            harmonics: vec![DVec3::ZERO; coefficients],
        }
    }
}

/// The hard decisions of a renderer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// Splats, and their parts at a pixel, with less alpha are skipped.
    pub least_alpha: f64,
    /// No splat hides more than this part of what is behind it.
    pub most_alpha: f64,
    /// A pixel is done before the splat that would leave less transmittance.
    pub least_transmittance: f64,
    /// Whether opacity makes up for what the low-pass filter adds to small splats.
    pub antialiased: bool,
}

impl Default for Rules {
    fn default() -> Self {
        Self { least_alpha: 1.0 / 255.0, most_alpha: 0.99, least_transmittance: 1e-4, antialiased: false }
    }
}

impl Rules {
    /// Variance in square pixels that the low-pass filter adds.
    pub(crate) fn low_pass(&self) -> f64 {
        if self.antialiased { gaussian::MIP_LOW_PASS } else { gaussian::LOW_PASS }
    }

    /// No hard decision by alpha: pictures are smooth in all parameters while the order of depths stays, so that differences give
    /// their gradients.
    pub fn smooth() -> Self {
        Self { least_alpha: 0.0, most_alpha: 1.0, least_transmittance: 0.0, antialiased: false }
    }
}

/// What a view sees, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// sRGB, composited over the background.
    pub colour: Vec<DVec3>,
    /// Part of the background that is seen, T; the picture's alpha is 1 - T.
    pub transmittance: Vec<f64>,
    /// Sum of depths along the axis, each times its part in the pixel; over alpha it is the expected depth.
    pub depth: Vec<f64>,
}

/// The Gaussians of a file one by one.
pub fn splats(gaussians: &Gaussians) -> Vec<Splat> {
    let coefficients = gaussians.coefficients();
    (0..gaussians.len())
        .map(|i| Splat {
            centre: gaussians.centres[i],
            log_scale: DVec3::from_array(gaussians.log_scales[i].map(f64::from)),
            rotation: gaussians.rotations[i].map(f64::from),
            opacity: f64::from(gaussians.opacities[i]),
            harmonics: gaussians.harmonics[3 * coefficients * i..3 * coefficients * (i + 1)]
                .chunks_exact(3)
                .map(|c| DVec3::new(f64::from(c[0]), f64::from(c[1]), f64::from(c[2])))
                .collect(),
        })
        .collect()
}

/// Renders splats over a background (sRGB).
pub fn render(splats: &[Splat], view: &View, rules: &Rules, background: DVec3) -> Picture {
    let projected = project_all(splats, view, rules);
    composite::forward(&projected, view, rules, background)
}

/// Gradient of a function of the picture by every splat, from its gradient by the colour of every pixel.
pub fn gradients(splats: &[Splat], view: &View, rules: &Rules, background: DVec3, by_colour: &[DVec3]) -> Vec<Splat> {
    gradients_and_means(splats, view, rules, background, by_colour).0
}

/// [`gradients`], and the gradient by every splat's mean in the picture, in pixels, which densification looks at. Both are
/// zero for splats that are not drawn.
pub fn gradients_and_means(
    splats: &[Splat],
    view: &View,
    rules: &Rules,
    background: DVec3,
    by_colour: &[DVec3],
) -> (Vec<Splat>, Vec<DVec2>) {
    let by_projected = projected_gradients(splats, view, rules, background, by_colour);
    let back = |(splat, by): (&Splat, &project::Gradient)| project::backward(splat, view, rules, by);
    let by_splat = splats.iter().zip(&by_projected).map(back).collect();
    (by_splat, by_projected.iter().map(|by| by.mean).collect())
}

/// Gradient by what every splat is in the picture; zero for splats that are not drawn.
pub fn projected_gradients(
    splats: &[Splat],
    view: &View,
    rules: &Rules,
    background: DVec3,
    by_colour: &[DVec3],
) -> Vec<project::Gradient> {
    composite::backward(&project_all(splats, view, rules), view, rules, background, by_colour)
}

fn project_all(splats: &[Splat], view: &View, rules: &Rules) -> Vec<Option<Projected>> {
    splats.iter().map(|splat| project::project(splat, view, rules)).collect()
}

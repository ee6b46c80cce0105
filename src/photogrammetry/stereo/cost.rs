//! How alike a window of a view and its image in the neighbours are: the twin of `photogrammetry/stereo/zncc.glsl`.
//!
//! The measure is one minus the zero-mean normalised cross-correlation; over the neighbours, the mean of the better half,
//! since an occlusion spoils the others only (Kang, Szeliski and Chai 2001, "Handling Occlusions in Dense Multi-view Stereo").

use glam::{Vec2, Vec3};

use super::frame::{MAX_PAIRS, StereoPair, StereoView};
use crate::engine::vulkan::shaders::glsl::photogrammetry::stereo::zncc;

/// Cost of what cannot be compared; matches cost 0 to 2.
pub const NO_MATCH: f32 = zncc::NO_MATCH as f32;
/// Half a window; of its pixels every other one is compared, as on a chequerboard.
const RADIUS: i32 = zncc::RADIUS;
/// Pixels compared.
const TAPS: f32 = zncc::TAPS as f32;
/// Added to the sums of squares: about the noise of shrunk 8-bit pictures.
const NOISE: f32 = zncc::NOISE as f32;

/// A plane in front of a view: inverse depth, which is linear in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Change of inverse depth from a pixel to the next along x and y.
    pub slope: Vec2,
    /// Inverse depth at the pixel.
    pub inverse_depth: f32,
}

/// What views look like, to be compared.
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    /// The views.
    pub views: &'a [StereoView],
    /// Brightness of all views' pixels.
    pub pictures: &'a [f32],
    /// [`MAX_PAIRS`] for each view, of which the first [`StereoView::pairs`] count.
    pub pairs: &'a [StereoPair],
}

impl Scene<'_> {
    /// Cost of a plane at a pixel of view `reference`.
    pub fn cost(&self, reference: usize, pixel: [i32; 2], plane: Plane) -> f32 {
        let view = &self.views[reference];
        let centre = Vec2::new(pixel[0] as f32 + 0.5, pixel[1] as f32 + 0.5);
        let around = self.brightness(view, pixel);
        let pairs = &self.pairs[MAX_PAIRS * reference..][..view.pairs as usize];
        let mut costs: Vec<f32> = pairs
            .iter()
            .filter_map(|pair| {
                let neighbour = &self.views[pair.view as usize];
                let at = carried(pair, centre, plane.inverse_depth);
                let inside =
                    at.x >= 0.0 && at.y >= 0.0 && at.x < neighbour.width as f32 && at.y < neighbour.height as f32;
                if !(at.z > 0.0 && inside) {
                    return None;
                }
                let [mut a, mut aa, mut b, mut bb, mut ab] = [0.0; 5];
                for [x, y] in taps() {
                    let off = Vec2::new(x as f32, y as f32);
                    let own = self.brightness(view, [pixel[0] + x, pixel[1] + y]) - around;
                    let to = carried(pair, centre + off, plane.inverse_depth + plane.slope.dot(off));
                    let other = self.sampled(neighbour, to.truncate()) - around;
                    a += own;
                    aa += own * own;
                    b += other;
                    bb += other * other;
                    ab += own * other;
                }
                Some(dissimilarity(a, aa, b, bb, ab))
            })
            .collect();
        costs.sort_unstable_by(f32::total_cmp);
        let half = costs.len().div_ceil(2);
        if half == 0 { NO_MATCH } else { costs[..half].iter().sum::<f32>() / half as f32 }
    }

    fn brightness(&self, view: &StereoView, [x, y]: [i32; 2]) -> f32 {
        let (x, y) = (x.clamp(0, view.width as i32 - 1) as u32, y.clamp(0, view.height as i32 - 1) as u32);
        self.pictures[(view.first + y * view.width + x) as usize]
    }

    fn sampled(&self, view: &StereoView, pixel: Vec2) -> f32 {
        let at = pixel.clamp(Vec2::ZERO, Vec2::new(view.width as f32, view.height as f32)) - 0.5;
        let low = at.floor();
        let part = at - low;
        let [x, y] = [low.x as i32, low.y as i32];
        let mix = |a: f32, b: f32, t: f32| a * (1.0 - t) + b * t;
        let upper = mix(self.brightness(view, [x, y]), self.brightness(view, [x + 1, y]), part.x);
        let lower = mix(self.brightness(view, [x, y + 1]), self.brightness(view, [x + 1, y + 1]), part.x);
        mix(upper, lower, part.y)
    }
}

/// The compared pixels of a window.
fn taps() -> impl Iterator<Item = [i32; 2]> {
    (-RADIUS..=RADIUS).flat_map(|y| (-RADIUS..=RADIUS).map(move |x| [x, y])).filter(|[x, y]| (x + y) % 2 == 0)
}

/// Where a pixel with an inverse depth is in the neighbour; z is positive in front of it.
fn carried(pair: &StereoPair, q: Vec2, w: f32) -> Vec3 {
    let at = q.extend(1.0);
    let x = Vec3::from(pair.row_x).dot(at) + pair.shift_x * w;
    let y = Vec3::from(pair.row_y).dot(at) + pair.shift_y * w;
    let z = Vec3::from(pair.row_z).dot(at) + pair.shift_z * w;
    Vec3::new(x / z, y / z, z)
}

/// 1 - ZNCC from sums over a window: of the reference, its squares, the neighbour, its squares, the products.
fn dissimilarity(a: f32, aa: f32, b: f32, bb: f32, ab: f32) -> f32 {
    let va = (aa - a * a / TAPS).max(0.0) + NOISE;
    let vb = (bb - b * b / TAPS).max(0.0) + NOISE;
    1.0 - (ab - a * b / TAPS) / (va * vb).sqrt()
}

//! Trained splats made small enough to embed, and the cameras that the page looks at them from.
//!
//! A splat takes 17 bytes: its place on a scale that is even near the middle and logarithmic far out, three scales, a quaternion, and a
//! colour without dependence on the view: the mean of what training cameras see.

use glam::DVec3;
use serde::Serialize;

use super::geometry::pack;
use super::scene_data::View;
use crate::scene::camera::{Camera, Pose, common_up};
use crate::scene::gaussians::Gaussians;
use crate::scene::harmonics;
use crate::splats::run::record::TrainRecord;

/// Splats on a page at most: with the pictures of test views, the page stays under 8 MB.
const MAX_SPLATS: usize = 150_000;
/// Test views and training cameras that can be looked through at most.
const MAX_TESTS: usize = 500;
const MAX_TRAINED: usize = 100;
/// Training cameras whose views of a splat's colour are averaged.
const SEEN_BY: usize = 8;
/// What flat splats are thinner than the largest at most, as a logarithm: 256 steps are for all of them.
const SCALES: f64 = 24.0;
/// Alpha below which nothing is drawn.
const FAINTEST: f64 = 1.0 / 255.0;

/// A trained model as the page shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    splats: SplatData,
    /// What the positions of the page are relative to.
    origin: DVec3,
    /// Distance from there within which most splats are.
    spread: f64,
    antialiased: bool,
    trained: Vec<Camera>,
    tests: Vec<Camera>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct SplatData {
    count: usize,
    /// Splats of the model.
    of: usize,
    /// A coordinate t in [-1, 1] is `sign(t) reach (exp(|t| range) - 1)` from the origin.
    reach: f64,
    range: f64,
    /// Standard deviations are `exp(low + step s)`.
    low: f64,
    step: f64,
    /// u16, three per splat: t from -1 to 1.
    places: String,
    /// u8, three per splat.
    scales: String,
    /// i8, four per splat: w, x, y, z.
    rotations: String,
    /// u8, four per splat: red, green, blue, opacity.
    colours: String,
}

#[derive(Serialize)]
struct ViewData<'a> {
    name: &'a str,
    /// Whether it was trained on; else it is a test view.
    trained: bool,
    psnr: Option<f64>,
    #[serde(flatten)]
    view: View,
}

/// What the page draws splats from.
#[derive(Serialize)]
pub(super) struct ModelData<'a> {
    splats: &'a SplatData,
    views: Vec<ViewData<'a>>,
    up: DVec3,
    extent: f64,
    background: [f32; 3],
    antialiased: bool,
}

impl Model {
    /// The Gaussians that matter most, and the cameras, all in the world.
    pub fn new(gaussians: &Gaussians, trained: &[Camera], tests: &[Camera]) -> Self {
        let kept = foremost(gaussians);
        let median = |of: &dyn Fn(usize) -> f64| {
            let mut values: Vec<f64> = kept.iter().map(|i| of(*i)).collect();
            let middle = values.len() / 2;
            if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
        };
        let origin = DVec3::from_array([0, 1, 2].map(|axis| median(&|i| gaussians.centres[i][axis])));
        let few: Vec<Camera> = every(trained, MAX_TRAINED).cloned().collect();
        let from: Vec<DVec3> = every(&few, SEEN_BY).map(|camera| camera.pose.position).collect();
        let mut away: Vec<f64> = kept.iter().map(|i| gaussians.centres[*i].distance(origin)).collect();
        away.sort_unstable_by(f64::total_cmp);
        let spread = away.get(49 * away.len() / 50).copied().unwrap_or(1.0);
        let reach = median(&|i| gaussians.centres[i].distance(origin)).max(f64::MIN_POSITIVE);
        let farthest = kept.iter().map(|i| (gaussians.centres[*i] - origin).abs().max_element()).fold(0.0, f64::max);
        let range = (farthest / reach).ln_1p().max(f64::MIN_POSITIVE);
        let place = |i: &usize| {
            let t = (gaussians.centres[*i] - origin).to_array().map(|v| v.signum() * (v.abs() / reach).ln_1p() / range);
            t.map(|t| (65_535.0 * 0.5 * (t + 1.0)).round() as u16)
        };
        let scales = || kept.iter().flat_map(|i| gaussians.log_scales[*i]).map(f64::from);
        let high = scales().fold(f64::NEG_INFINITY, f64::max);
        let low = scales().fold(f64::INFINITY, f64::min).min(f64::MAX).max(high - SCALES);
        let step = ((high.max(low) - low) / 255.0).max(f64::MIN_POSITIVE);
        let quaternion = |i: &usize| {
            let values = gaussians.rotations[*i].map(f64::from);
            let length = values.iter().map(|v| v * v).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
            values.map(|v| (127.0 * v / length).round() as i8)
        };
        let splats = SplatData {
            count: kept.len(),
            of: gaussians.len(),
            reach,
            range,
            low: if low.is_finite() { low } else { 0.0 },
            step,
            places: pack(kept.iter().flat_map(place), u16::to_le_bytes),
            scales: pack(scales().map(|s| ((s.max(low) - low) / step).round() as u8), |s| [s]),
            rotations: pack(kept.iter().flat_map(quaternion), i8::to_le_bytes),
            colours: pack(kept.iter().map(|i| colour(gaussians, *i, &from)), |c| c),
        };
        let antialiased = gaussians.antialiased;
        Self { splats, origin, spread, antialiased, trained: few, tests: tests.to_vec() }
    }

    /// The data of a page without a training run: the splats alone, seen from outside, with `up` upwards.
    #[cfg(feature = "cli")]
    pub(super) fn alone(&self, up: DVec3) -> ModelData<'_> {
        let background = [0.0; 3];
        let Self { splats, spread, antialiased, .. } = self;
        ModelData { splats, views: Vec::new(), up, extent: *spread, background, antialiased: *antialiased }
    }

    /// The data of the page: test views first, the worst of them foremost.
    pub(super) fn data<'a>(&'a self, record: &'a TrainRecord) -> ModelData<'a> {
        let rank = |name: &str| record.test_views.iter().position(|view| view.name == name);
        let mut tests: Vec<(Option<usize>, &Camera)> =
            self.tests.iter().map(|camera| (rank(&camera.name), camera)).collect();
        tests.sort_by_key(|(rank, _)| rank.unwrap_or(usize::MAX));
        let test = |(rank, camera): &(Option<usize>, &'a Camera)| {
            self.view(camera, false, rank.map(|rank| record.test_views[rank].quality.psnr))
        };
        let mut views: Vec<ViewData> = tests.iter().take(MAX_TESTS).map(test).collect();
        views.extend(self.trained.iter().map(|camera| self.view(camera, true, None)));
        let poses: Vec<Pose> = self.trained.iter().map(|camera| camera.pose).collect();
        ModelData {
            splats: &self.splats,
            views,
            up: common_up(&poses).unwrap_or(DVec3::Z),
            extent: record.photos.extent,
            background: record.config.test_background(),
            antialiased: record.config.antialiased,
        }
    }

    fn view<'a>(&self, camera: &'a Camera, trained: bool, psnr: Option<f64>) -> ViewData<'a> {
        let psnr = psnr.filter(|psnr| psnr.is_finite());
        ViewData { name: &camera.name, trained, psnr, view: View::new(camera, self.origin) }
    }
}

/// So many items at most, evenly spaced, from the first on.
fn every<T>(items: &[T], most: usize) -> impl Iterator<Item = &T> {
    items.iter().step_by(items.len().div_ceil(most).max(1))
}

/// Numbers, ascending, of the Gaussians whose opacity times area is largest; those that are not finite or show nothing are left out.
fn foremost(gaussians: &Gaussians) -> Vec<usize> {
    let weight = |i: usize| {
        let scales = gaussians.log_scales[i];
        // The area is that of the two longer axes.
        let area = scales.iter().sum::<f32>() - scales.iter().copied().fold(f32::INFINITY, f32::min);
        gaussians.opacity(i).ln() + f64::from(area)
    };
    let is_seen = |i: &usize| gaussians.is_finite(*i) && gaussians.opacity(*i) >= FAINTEST;
    let mut kept: Vec<(f64, usize)> = (0..gaussians.len()).filter(is_seen).map(|i| (weight(i), i)).collect();
    if kept.len() > MAX_SPLATS {
        kept.select_nth_unstable_by(MAX_SPLATS, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        kept.truncate(MAX_SPLATS);
    }
    let mut kept: Vec<usize> = kept.into_iter().map(|(_, i)| i).collect();
    kept.sort_unstable();
    kept
}

/// Mean colour as seen from some places, and opacity.
fn colour(gaussians: &Gaussians, i: usize, from: &[DVec3]) -> [u8; 4] {
    let row = gaussians.coefficients();
    let coefficients = gaussians.harmonics[3 * row * i..][..3 * row].as_chunks::<3>().0;
    let coefficient = |k: usize| DVec3::from_array(coefficients[k].map(f64::from));
    let constant = DVec3::splat(0.5) + harmonics::CONSTANT * coefficient(0);
    let seen = |place: &DVec3| {
        let direction = (gaussians.centres[i] - place).normalize_or(DVec3::Z);
        let above = (1..row).zip(harmonics::above_constant(direction)).map(|(k, basis)| basis * coefficient(k));
        (constant + above.sum::<DVec3>()).clamp(DVec3::ZERO, DVec3::ONE)
    };
    let mean = match from.len() {
        0 => constant.clamp(DVec3::ZERO, DVec3::ONE),
        count => from.iter().map(seen).sum::<DVec3>() / count as f64,
    };
    let byte = |value: f64| (255.0 * value).round() as u8;
    [byte(mean.x), byte(mean.y), byte(mean.z), byte(gaussians.opacity(i))]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a page would show faint dust in place of a surface, or be too large to be opened.
    #[test]
    fn the_largest_and_most_opaque_are_kept() {
        let count = MAX_SPLATS + 1000;
        let mut gaussians = Gaussians {
            centres: vec![DVec3::X; count],
            log_scales: vec![[-3.0, -3.0, -9.0]; count],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; count],
            opacities: vec![0.0; count],
            degree: 0,
            harmonics: vec![0.0; 3 * count],
            antialiased: false,
        };
        (gaussians.opacities[7], gaussians.log_scales[8], gaussians.centres[9].x) = (-9.0, [-8.0; 3], f64::NAN);
        (gaussians.opacities[count - 1], gaussians.log_scales[count - 2]) = (3.0, [-1.0, -1.0, -9.0]);
        let kept = foremost(&gaussians);
        assert_eq!(kept.len(), MAX_SPLATS);
        assert!([7, 8, 9].iter().all(|i| kept.binary_search(i).is_err()));
        assert!([count - 2, count - 1].iter().all(|i| kept.binary_search(i).is_ok()));
    }

    /// If this failed, splats of captures far from the origin would fall on a coarse grid, or those far out would end at the middle.
    #[test]
    fn places_are_fine_in_the_middle_and_reach_far_out() {
        let centres: Vec<DVec3> = [-0.3, -0.1, 0.0, 0.1, 0.2, 500.0].map(|x| DVec3::new(4e6 + x, 0.0, 0.0)).to_vec();
        let count = centres.len();
        let gaussians = Gaussians {
            centres: centres.clone(),
            log_scales: vec![[-3.0; 3]; count],
            rotations: vec![[0.0, 0.0, 2.0, 0.0]; count],
            opacities: vec![2.0; count],
            degree: 0,
            harmonics: vec![0.0; 3 * count],
            antialiased: false,
        };
        let Model { splats, origin, .. } = Model::new(&gaussians, &[], &[]);
        let bytes = base64::Engine::decode(&base64::engine::general_purpose::STANDARD, &splats.places).unwrap();
        for (i, centre) in centres.iter().enumerate() {
            let t = 2.0 * f64::from(u16::from_le_bytes([bytes[6 * i], bytes[6 * i + 1]])) / 65_535.0 - 1.0;
            let x = t.signum() * splats.reach * (t.abs() * splats.range).exp_m1();
            let away = centre.x - origin.x;
            assert!((x - away).abs() < 2e-4 * (splats.reach + away.abs()), "{x} is not {away}");
        }
    }
}

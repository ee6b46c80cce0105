//! View dependency: how much the look of a surface changes with the view, from photos.
//!
//! [`observe`] finds on the device which photos see a point and how bright it is there, [`gains`] the exposure of each
//! photo, [`variance`] how much the intensity of a point varies beyond that. The variance becomes a score by a cubic, the [`vdsf`],
//! which `lab/vdsf_fit` makes, and scores are spread over [1, 2]. [`scoring`] does it all.

pub mod gains;
pub mod observe;
pub mod picture;
pub mod pyramid;
pub mod scoring;
pub(crate) mod variance;
pub mod vdsf;

use std::collections::HashMap;

use glam::DVec3;

use self::gains::Gains;
use self::observe::Observations;
use self::vdsf::Vdsf;
use crate::engine::parallel::in_parallel;
use crate::files::photos::Photo;
use crate::scene::proxy::SurfacePoint;
use crate::scene::surface::Points;

/// Quantiles of the VDSF that become the scores 1 and 2: what lies outside counts as the nearer one. A single point on
/// an edge that no photo registers well would otherwise set the scale of all.
const ENDS: [f64; 2] = [0.01, 0.99];

/// Scores of points from photos.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// The points with scores in [1, 2], in the photos' world frame.
    pub points: Points,
    /// Photos that see each point.
    pub views: Vec<u32>,
    /// Variance of each point's intensity; none where fewer than two photos see it. Such a point has the score 1.
    pub variances: Vec<Option<f64>>,
    /// VDSF of these variances at the scores 1 and 2.
    pub ends: [f64; 2],
    /// Exposure of each photo.
    pub gains: Gains,
    /// Median over the points of their mean intensity, before it was brought to [`GREY`]; none where exposures were
    /// taken as they are.
    pub level: Option<f64>,
}

/// Points that a thread takes at a time.
const POINTS_AT_ONCE: usize = 256;

impl Estimate {
    /// `cloud` with the scores of its points, which are matched by position; otherwise unchanged, so that a plan for it has the
    /// same surface as a reader of the file. Points without a match have the score 1.
    pub fn onto(&self, cloud: &Points) -> Points {
        let key = |p: &DVec3| p.to_array().map(f64::to_bits);
        let numbers: HashMap<[u64; 3], usize> =
            self.points.positions.iter().enumerate().map(|(i, position)| (key(position), i)).collect();
        let found: Vec<Option<usize>> = cloud.positions.iter().map(|p| numbers.get(&key(p)).copied()).collect();
        Points { scores: found.iter().map(|i| i.map_or(1.0, |i| self.points.scores[i])).collect(), ..cloud.clone() }
    }
}

/// Luma that the points are brought to: middle grey, what the photos are exposed for that the VDSF is made from.
pub(crate) const GREY: f64 = 0.18;

/// Statistics of a point's views: variance and mean of its intensity; none where they are too few.
type Statistics = Option<(f64, f64)>;

/// Scores points from what photos show of them; `observations` are those of `points`, photo by photo of `photos`.
/// `vdsf` makes a score of a variance.
///
/// With `exposure`, each photo's gain and offset are evened out, and then all are brought to one exposure: photos that
/// are a stop brighter vary four times as much, without the surface being any glossier.
pub fn estimate(
    points: &[SurfacePoint],
    photos: &[Photo],
    observations: &Observations,
    exposure: bool,
    vdsf: impl Fn(f64) -> f64,
) -> Estimate {
    let gains = if exposure { Gains::fit(observations, photos.len()) } else { Gains::none(photos.len()) };
    let mut statistics: Vec<Statistics> = vec![None; points.len()];
    in_parallel(&mut statistics, POINTS_AT_ONCE, |chunk, statistics| {
        for (i, statistics) in (chunk * POINTS_AT_ONCE..).zip(statistics) {
            *statistics = point_statistics(points[i].position, photos, observations.of(i), &gains);
        }
    });
    let means = || statistics.iter().flatten().map(|(_, mean)| *mean).collect::<Vec<_>>();
    let level = exposure.then(|| quantile(means(), 0.5)).filter(|level| *level > 0.0);
    let factor = level.map_or(1.0, |level| (GREY / level).powi(2));
    let variances: Vec<Option<f64>> =
        statistics.iter().map(|statistics| statistics.map(|(variance, _)| factor * variance)).collect();
    let (scores, ends) = scores(&variances, vdsf);
    Estimate {
        points: Points {
            positions: points.iter().map(|point| point.position).collect(),
            normals: points.iter().map(|point| point.normal).collect(),
            radii: points.iter().map(|point| point.radius as f32).collect(),
            colours: points.iter().map(|point| point.colour).collect(),
            scores,
            oriented: true,
            ..Points::default()
        },
        views: (0..points.len()).map(|i| observations.of(i).0.len() as u32).collect(),
        variances,
        ends,
        gains,
        level,
    }
}

/// Scores in [1, 2] of the variances of a surface's points, and the values of `vdsf` that became 1 and 2. A point
/// without a variance has the score 1, and so have all where none varies more than another.
pub fn scores(variances: &[Option<f64>], vdsf: impl Fn(f64) -> f64) -> (Vec<f32>, [f64; 2]) {
    let raw: Vec<Option<f64>> = variances.iter().map(|variance| variance.map(&vdsf)).collect();
    let ends = ENDS.map(|part| quantile(raw.iter().flatten().copied().collect(), part));
    let score = |raw: &Option<f64>| match raw {
        Some(raw) if ends[1] > ends[0] => (1.0 + ((raw - ends[0]) / (ends[1] - ends[0])).clamp(0.0, 1.0)) as f32,
        _ => 1.0,
    };
    (raw.iter().map(score).collect(), ends)
}

/// Scores points that have variances but no scores: trained splats with harmonics. Whether there are any.
pub fn score_by_variances(points: &mut Points) -> bool {
    if points.variances.is_empty() || !points.scores.is_empty() {
        return false;
    }
    let variances: Vec<Option<f64>> = points.variances.iter().map(|v| Some(f64::from(*v))).collect();
    let vdsf = Vdsf::embedded();
    points.scores = scores(&variances, |v| vdsf.apply(v)).0;
    true
}

/// The scored data of a point at `position`.
fn point_statistics(
    position: DVec3,
    photos: &[Photo],
    (seen_in, intensities): (&[u32], &[f32]),
    gains: &Gains,
) -> Statistics {
    let toward: Vec<DVec3> =
        seen_in.iter().map(|k| (photos[*k as usize].camera.pose.position - position).normalize_or_zero()).collect();
    let corrected: Vec<f64> =
        seen_in.iter().zip(intensities).map(|(k, v)| gains.corrected(*k as usize, f64::from(*v))).collect();
    let believed = variance::believed(&corrected, &toward);
    let corrected: Vec<f64> =
        corrected.into_iter().zip(believed).filter(|(_, believed)| *believed).map(|(value, _)| value).collect();
    variance::moments(&corrected)
}

/// The value that the given part of `values` lies below; zero of nothing.
pub fn quantile(mut values: Vec<f64>, part: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let at = (part * (values.len() - 1) as f64).round() as usize;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

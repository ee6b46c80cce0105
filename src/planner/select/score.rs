//! How good a subset is, on points that the choice has not seen.

use glam::DVec3;

use super::sight::Survey;
use crate::engine::parallel::in_parallel;
use crate::files::photos::PhotoSet;
use crate::planner::metrics::PointMetrics;
use crate::planner::metrics::score_point::{RESOLUTION, of_rays};
use crate::scene::octahedral;

/// A direction counts at a point where some photo of the pool that sees the point lies within this angle of it.
const REACH_DEG: f64 = 15.0;

/// Scores subsets of a pool on the points of a survey: the metrics of a plan, but for the real frusta in place of the
/// pinhole's, and for the directions in which the pool can show a point in place of those that the region reaches.
pub(crate) struct SubsetScorer<'s> {
    survey: &'s Survey,
    /// Focal length of each photo in pixels.
    focal: Vec<f64>,
    /// World units in one of the planner's.
    world: f64,
    directions: Vec<DVec3>,
    /// Per point and texel: whether the pool can show the point from there.
    reach: Vec<bool>,
}

impl<'s> SubsetScorer<'s> {
    /// Prepares to score; `world` is the length of the planner's unit in the user's world.
    pub fn new(survey: &'s Survey, set: &PhotoSet, world: f64) -> Self {
        let directions = octahedral::directions(RESOLUTION);
        let texels = directions.len();
        let near = REACH_DEG.to_radians().cos();
        let mut reach = vec![false; survey.points.len() * texels];
        in_parallel(&mut reach, texels, |point, reach| {
            for photo in survey.sight.photos_that_see(point) {
                let n = survey.direction(point, photo).as_dvec3();
                reach.iter_mut().zip(&directions).for_each(|(reach, w)| *reach |= w.dot(n) > near);
            }
        });
        let focal = set.photos.iter().map(|photo| 0.5 * photo.camera.intrinsics.focal.iter().sum::<f64>()).collect();
        Self { survey, focal, world, directions, reach }
    }

    /// What each point gets from the photos of a subset.
    pub fn score(&self, subset: &[usize]) -> Vec<PointMetrics> {
        let survey = self.survey;
        let texels = self.directions.len();
        let mut scores = vec![PointMetrics::default(); survey.points.len()];
        in_parallel(&mut scores, 1, |point, score| {
            let (mut rays, mut finest) = (Vec::new(), f64::INFINITY);
            for &photo in subset.iter().filter(|photo| survey.sight.sees(point, **photo)) {
                rays.push(survey.direction(point, photo).as_dvec3());
                let away = survey.centres[photo].distance(survey.probes[point].position.into());
                finest = finest.min(f64::from(away) * self.world / self.focal[photo]);
            }
            let reach = &self.reach[point * texels..(point + 1) * texels];
            let reachable = self.directions.iter().zip(reach).filter(|(_, reach)| **reach).map(|(w, _)| *w);
            score[0] = of_rays(&rays, finest, reachable, texels);
        });
        scores
    }
}

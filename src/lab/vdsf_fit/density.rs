//! How many views it takes to interpolate a radiance, and what a few views see of it.

use std::f64::consts::TAU;

use glam::DVec3;

use super::draws::Draws;
use crate::scene::octahedral;

/// Numbers of views over the hemisphere that are tried, each about 1.45 times the one before.
pub const SIZES: [usize; 16] = [1, 2, 3, 4, 6, 9, 13, 19, 28, 41, 60, 88, 128, 186, 256, 360];

/// Side of the equal-area octahedral map that radiance is tabulated on.
const RESOLUTION: u32 = 64;

/// Least cosine between normal and view: at a more grazing angle a photo shows little of a surface.
const GRAZING: f64 = 0.1;

/// Sets of views of each size.
const ROTATIONS: u32 = 4;

/// Views that a direction is interpolated from.
const NEAREST: usize = 4;

/// Views in reach of a direction, nearest first; those beyond [`NEAREST`] stand in for hidden ones.
const REACH: usize = 10;

/// The directions a point is seen from, and sets of views among them. The same for all samples.
pub(crate) struct Views {
    /// Unit directions on the grid, above the horizon.
    pub directions: Vec<DVec3>,
    /// By size, then by rotation.
    sets: Vec<Vec<Set>>,
}

/// A set of evenly spread views.
struct Set {
    /// Indices of the views among the directions.
    views: Vec<u32>,
    /// By direction: up to [`REACH`] views, nearest first, and their weights; none where the direction is a view.
    near: Vec<Vec<(u32, f64)>>,
}

impl Views {
    /// Spreads the views: Fibonacci lattices, turned and shifted, on the nearest grid directions.
    pub fn new(seed: u64) -> Self {
        let mut directions = octahedral::directions(RESOLUTION);
        directions.retain(|direction| direction.z >= GRAZING);
        // A stream that no sample has.
        let mut draws = Draws::new(seed, u32::MAX);
        let mut set = |size: usize| {
            let (shift, turn) = (draws.unit(), draws.unit());
            let mut views: Vec<u32> = fibonacci(size, shift, turn).map(|view| nearest(view, &directions)).collect();
            views.sort_unstable();
            views.dedup();
            Set::new(views, &directions)
        };
        let sets = SIZES.iter().map(|size| (0..ROTATIONS).map(|_| set(*size)).collect()).collect();
        Self { directions, sets }
    }

    /// Root mean square error of interpolating `values` (one for each direction, `open` marks those that can be seen) from
    /// each of [`SIZES`] views: inverse squared distances over the nearest [`NEAREST`] that are open.
    fn errors(&self, values: &[f64], open: &[bool]) -> Vec<f64> {
        let error = |sets: &Vec<Set>| {
            let (mut sum, mut count) = (0.0, 0.0);
            for set in sets {
                let seen = || set.views.iter().filter(|view| open[**view as usize]);
                let mean = seen().map(|view| values[*view as usize]).sum::<f64>() / seen().count().max(1) as f64;
                for (at, near) in set.near.iter().enumerate().filter(|(at, near)| open[*at] && !near.is_empty()) {
                    let (mut value, mut weights) = (0.0, 0.0);
                    for (view, weight) in near.iter().filter(|(view, _)| open[*view as usize]).take(NEAREST) {
                        value += weight * values[*view as usize];
                        weights += weight;
                    }
                    let value = if weights > 0.0 { value / weights } else { mean };
                    sum += (value - values[at]) * (value - values[at]);
                    count += 1.0;
                }
            }
            (sum / f64::max(count, 1.0)).sqrt()
        };
        self.sets.iter().map(error).collect()
    }

    /// The least number of views, as a real number, that keeps the error at `epsilon`: between sizes the logarithm of
    /// the error is linear in that of the number. From 1 to the largest of [`SIZES`].
    pub fn density(&self, values: &[f64], open: &[bool], epsilon: f64) -> f64 {
        let errors = self.errors(values, open);
        match errors.iter().position(|error| *error <= epsilon) {
            Some(0) => SIZES[0] as f64,
            Some(at) => {
                let (above, below) = (libm::log(errors[at - 1] / epsilon), libm::log(epsilon / errors[at].max(1e-12)));
                let ratio = SIZES[at] as f64 / SIZES[at - 1] as f64;
                SIZES[at - 1] as f64 * libm::exp(libm::log(ratio) * above / (above + below))
            }
            None => SIZES[SIZES.len() - 1] as f64,
        }
    }
}

impl Set {
    fn new(views: Vec<u32>, directions: &[DVec3]) -> Self {
        let near = |(at, direction): (usize, &DVec3)| {
            if views.binary_search(&(at as u32)).is_ok() {
                return Vec::new();
            }
            let mut near: Vec<(u32, f64)> =
                views.iter().map(|view| (*view, directions[*view as usize].distance_squared(*direction))).collect();
            let by_distance = |a: &(u32, f64), b: &(u32, f64)| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0));
            if near.len() > REACH {
                near.select_nth_unstable_by(REACH, by_distance);
                near.truncate(REACH);
            }
            near.sort_unstable_by(by_distance);
            near.into_iter().map(|(view, distance)| (view, 1.0 / distance)).collect()
        };
        let near = directions.iter().enumerate().map(near).collect();
        Self { views, near }
    }
}

/// Index of the direction that is nearest to `view`, the first where there are several.
fn nearest(view: DVec3, directions: &[DVec3]) -> u32 {
    let mut best = (f64::INFINITY, 0);
    for (index, direction) in directions.iter().enumerate() {
        let distance = direction.distance_squared(view);
        if distance < best.0 {
            best = (distance, index as u32);
        }
    }
    best.1
}

/// `count` directions evenly spread over the part of the hemisphere that is not grazing: a Fibonacci lattice shifted
/// along its spiral (by `shift` in [0, 1)) and turned about +Z.
fn fibonacci(count: usize, shift: f64, turn: f64) -> impl Iterator<Item = DVec3> {
    const INVERSE_GOLDEN: f64 = 0.618_033_988_749_894_9;
    (0..count).map(move |i| {
        let z = GRAZING + (1.0 - GRAZING) * (i as f64 + shift) / count as f64;
        let across = (1.0 - z * z).max(0.0).sqrt();
        let angle = TAU * (turn + i as f64 * INVERSE_GOLDEN);
        DVec3::new(across * libm::cos(angle), across * libm::sin(angle), z)
    })
}

/// A few photos: how many see a point, and how they are spread.
#[derive(Clone, Copy, Debug)]
pub struct Sparse {
    /// Fewest and most views; any number between is as likely.
    pub count: [u32; 2],
    /// Each view is the farthest from those before it of this many random ones (Mitchell 1991, "Spectrally Optimal
    /// Sampling for Distribution Ray Tracing"): 1 draws at random, more draw spread, as a photographer walks around.
    pub candidates: u32,
}

impl Sparse {
    /// What the VDSF is fitted to.
    pub const FITTED: Self = Self { count: [5, 15], candidates: 4 };

    /// Variance of the `values` that one draw of views among the `directions` that are `open` sees. Squared differences
    /// from the mean are summed and divided by the count less one, so that random draws of any count agree on average.
    pub fn variance(&self, values: &[f64], directions: &[DVec3], open: &[bool], draws: &mut Draws) -> f64 {
        let seen: Vec<usize> = (0..values.len()).filter(|at| open[*at]).collect();
        let count = draws.count(self.count[0], self.count[1]);
        let mut drawn: Vec<usize> = Vec::new();
        for _ in 0..count {
            let mut best = (-1.0, 0);
            for _ in 0..self.candidates {
                let at = seen[draws.count(0, seen.len() as u32 - 1) as usize];
                let gaps = drawn.iter().map(|other| directions[at].distance_squared(directions[*other]));
                let gap = gaps.fold(f64::INFINITY, f64::min);
                if gap > best.0 {
                    best = (gap, at);
                }
            }
            drawn.push(best.1);
        }
        variance(&drawn.iter().map(|at| values[*at]).collect::<Vec<f64>>())
    }
}

/// What [`Sparse::variance`] is on average over random draws.
pub(crate) fn expected_variance(values: &[f64], open: &[bool]) -> f64 {
    let seen: Vec<f64> = values.iter().zip(open).filter(|(_, open)| **open).map(|(value, _)| *value).collect();
    variance(&seen) * (seen.len() as f64 - 1.0) / seen.len() as f64
}

/// Squared differences from the mean, summed, over the count less one.
fn variance(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / (values.len() as f64 - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn radiance(views: &Views, sharpness: f64) -> Vec<f64> {
        let axis = DVec3::new(0.3, 0.2, 0.9).normalize();
        views.directions.iter().map(|v| 0.8 * libm::exp(sharpness * (axis.dot(*v) - 1.0))).collect()
    }

    /// Density is what all is fitted to: a narrower highlight and a smaller error must need more views, and a constant radiance
    /// one.
    #[test]
    fn narrower_highlights_need_more_views() {
        let views = Views::new(5);
        let open = vec![true; views.directions.len()];
        let needed = |sharpness, epsilon| views.density(&radiance(&views, sharpness), &open, epsilon);
        assert_eq!(needed(0.0, 0.03), 1.0);
        let broad = [0.1, 0.5, 2.0, 8.0, 20.0].map(|sharpness| needed(sharpness, 0.03));
        assert!(broad.windows(2).all(|pair| pair[0] < pair[1]), "{broad:?}");
        assert!(needed(2.0, 0.02) > broad[2]);
    }

    /// Hidden directions hold no radiance: the values there must not change what is measured.
    #[test]
    fn hidden_directions_do_not_matter() {
        let views = Views::new(5);
        let open: Vec<bool> = views.directions.iter().map(|v| v.x > 0.1).collect();
        let mut values = radiance(&views, 8.0);
        let sparse = Sparse { count: [5, 15], candidates: 4 };
        let measure = |values: &[f64]| {
            let variance = sparse.variance(values, &views.directions, &open, &mut Draws::new(1, 1));
            (views.density(values, &open, 0.03), expected_variance(values, &open), variance)
        };
        let before = measure(&values);
        values.iter_mut().zip(&open).filter(|(_, open)| !**open).for_each(|(value, _)| *value = 1e3);
        assert_eq!(before, measure(&values));
    }

    /// The variance of few views must have, on average, the documented value, whatever their number.
    #[test]
    fn random_draws_see_the_expected_variance_on_average() {
        let views = Views::new(5);
        let open = vec![true; views.directions.len()];
        let values = radiance(&views, 3.0);
        let expected = expected_variance(&values, &open);
        for count in [2, 5, 15] {
            let sparse = Sparse { count: [count, count], candidates: 1 };
            let mut draws = Draws::new(2, count);
            let draw = |_| sparse.variance(&values, &views.directions, &open, &mut draws);
            let mean = (0..20_000).map(draw).sum::<f64>() / 20_000.0;
            assert!((mean / expected - 1.0).abs() < 0.03, "{count} views: {mean} for {expected}");
        }
    }
}

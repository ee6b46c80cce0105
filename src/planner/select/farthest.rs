//! Farthest view sampling (NeRF Director, Xiao et al. 2024): again and again the view whose distance to the nearest chosen one
//! is greatest.

use std::f64::consts::PI;

use glam::DVec3;

use crate::engine::parallel::in_parallel;

/// How two views differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distance {
    /// The angle between their directions from the region's centre.
    GreatCircle,
    /// The distance between their centres. Its square, which the published code takes, puts views in the same order.
    Chord,
    /// The great circle, and pi times one less the share of points that both saw.
    Shared,
}

/// Views, by their index in the list, with their positions and points.
pub struct Metric {
    places: Vec<DVec3>,
    shared: Option<Shared>,
}

impl Metric {
    /// Distances by places: centres, or unit vectors for the great circle.
    pub fn new(places: Vec<DVec3>) -> Self {
        Self { places, shared: None }
    }

    /// The great circle between unit vectors, and pi times one less the share of the points that each view saw.
    pub fn with_shared(self, saw: Vec<Vec<u32>>) -> Self {
        Self { shared: Some(Shared::new(saw)), ..self }
    }

    /// Continues from `chosen`, which must not be empty, until `count` are chosen. Of equally far ones the first.
    pub fn farthest(&self, mut chosen: Vec<usize>, count: usize) -> Vec<usize> {
        let mut apart = vec![f64::INFINITY; self.places.len()];
        let most = self.shared.as_ref().map_or(1, Shared::most);
        let mut nearer = |view: usize| {
            let place = self.places[view];
            match &self.shared {
                // Squares of lengths and of chords are in the order of lengths and of arcs.
                None => apart.iter_mut().zip(&self.places).for_each(|(apart, other)| {
                    *apart = apart.min(place.distance_squared(*other));
                }),
                Some(shared) => {
                    let common = shared.with(view);
                    for ((apart, other), common) in apart.iter_mut().zip(&self.places).zip(common) {
                        let arc = 2.0 * (0.5 * place.distance(*other)).min(1.0).asin();
                        *apart = apart.min(arc + PI * (1.0 - f64::from(common) / f64::from(most)));
                    }
                }
            }
            // No longer a candidate.
            apart[view] = f64::NEG_INFINITY;
            let first =
                |best: (usize, f64), (view, apart): (usize, &f64)| if *apart > best.1 { (view, *apart) } else { best };
            apart.iter().enumerate().fold((0, f64::NEG_INFINITY), first).0
        };
        let mut next = 0;
        for view in &chosen {
            next = nearer(*view);
        }
        while chosen.len() < count.min(self.places.len()) {
            chosen.push(next);
            next = nearer(next);
        }
        chosen
    }
}

/// Points that views have in common.
struct Shared {
    /// Points of each view.
    points: Vec<Vec<u32>>,
    /// Views of each point.
    views: Vec<Vec<u32>>,
}

impl Shared {
    fn new(points: Vec<Vec<u32>>) -> Self {
        let count = points.iter().flatten().max().map_or(0, |most| *most as usize + 1);
        let mut views = vec![Vec::new(); count];
        for (view, points) in (0u32..).zip(&points) {
            points.iter().for_each(|point| views[*point as usize].push(view));
        }
        Self { points, views }
    }

    /// How many points each view shares with `view`, itself included.
    fn with(&self, view: usize) -> Vec<u32> {
        let mut counts = vec![0; self.points.len()];
        for point in &self.points[view] {
            self.views[*point as usize].iter().for_each(|other| counts[*other as usize] += 1);
        }
        counts
    }

    /// The most points that any two views share; at least 1.
    fn most(&self) -> u32 {
        let mut most = vec![1; self.points.len()];
        in_parallel(&mut most, 1, |view, most| {
            let others = self.with(view).into_iter().enumerate().filter(|(other, _)| *other != view);
            most[0] = others.map(|(_, count)| count).max().unwrap_or(0).max(1);
        });
        most.into_iter().max().unwrap_or(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    fn places(count: u32, unit: bool) -> Vec<DVec3> {
        let place = |i| {
            let [u, v, w, _] = random::uniforms(7, 0, i);
            random::direction(u, v) * if unit { 1.0 } else { 1.0 + w }
        };
        (0..count).map(place).collect()
    }

    /// By the definition, all distances anew at every step.
    fn brute_force(count: usize, views: usize, distance: impl Fn(usize, usize) -> f64) -> Vec<usize> {
        let mut chosen = vec![3];
        while chosen.len() < count {
            let apart = |view: usize| chosen.iter().map(|c| distance(*c, view)).fold(f64::INFINITY, f64::min);
            let mut best = (0, f64::NEG_INFINITY);
            for view in (0..views).filter(|view| !chosen.contains(view)) {
                if apart(view) > best.1 {
                    best = (view, apart(view));
                }
            }
            chosen.push(best.0);
        }
        chosen
    }

    /// If this failed, the row "FVS" of a table would be of some other method.
    #[test]
    fn every_distance_chooses_as_its_definition_says() {
        let (centres, units) = (places(200, false), places(200, true));
        let euclidean = brute_force(40, 200, |a, b| centres[a].distance(centres[b]));
        let squared = brute_force(40, 200, |a, b| centres[a].distance(centres[b]).powi(2));
        let chosen = Metric::new(centres).farthest(vec![3], 40);
        assert_eq!((&chosen, &chosen), (&euclidean, &squared));
        let arc = |a: usize, b: usize| 2.0 * (0.5 * units[a].distance(units[b])).min(1.0).asin();
        assert_eq!(Metric::new(units.clone()).farthest(vec![3], 40), brute_force(40, 200, arc));

        // Every view sees the points of a third of the sphere about it.
        let points = places(500, true);
        let sees = |view: &DVec3| (0..500u32).filter(|i| points[*i as usize].dot(*view) > 0.3).collect::<Vec<_>>();
        let saw: Vec<Vec<u32>> = units.iter().map(sees).collect();
        let common = |a: usize, b: usize| saw[a].iter().filter(|point| saw[b].contains(point)).count() as f64;
        let pairs = (0..200).flat_map(|a| (0..a).map(move |b| (a, b)));
        let most = pairs.map(|(a, b)| common(a, b)).fold(1.0, f64::max);
        let photogrammetric = brute_force(20, 200, |a, b| arc(a, b) + PI * (1.0 - common(a, b) / most));
        assert_eq!(Metric::new(units.clone()).with_shared(saw.clone()).farthest(vec![3], 20), photogrammetric);
    }

    /// If this failed, a pool as large as the request would lose views or give one twice.
    #[test]
    fn all_of_a_pool_can_be_chosen_even_from_one_place() {
        for places in [places(20, false), vec![DVec3::ONE; 20]] {
            let mut chosen = Metric::new(places).farthest(vec![5, 2], 30);
            assert_eq!(chosen[..2], [5, 2]);
            chosen.sort_unstable();
            assert_eq!(chosen, (0..20).collect::<Vec<_>>());
        }
    }
}

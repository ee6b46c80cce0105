//! The order in which to visit cameras: a short tour through free space.

use glam::DVec3;

use super::free_space::FreeSpace;
use super::legs::{Legs, length};

/// Places that a tour is made of at most: lengths between all pairs are kept, and every way through others is looked at.
pub const MAX_PLACES: usize = 2000;
/// Places that a tour is begun from, of which the shortest counts.
const BEGINNINGS: usize = 8;
/// Most places in a row that are moved elsewhere as one.
const ROW: usize = 3;

/// An order of places, and the way from the first to the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Tour {
    /// Indices of the places in the order of the visit.
    pub order: Vec<usize>,
    /// Corners of the way: all places in this order, and what lies between where there is something to go around.
    pub path: Vec<DVec3>,
    /// Legs for which no way was found that keeps the clearance.
    pub blocked: usize,
}

impl Tour {
    /// A short tour of `places`, [`MAX_PLACES`] at most, in the frame of the free space, open at both ends, which begins at the
    /// lower one. It is a local optimum: no part of it gets shorter by going it backwards, or by visiting three places or
    /// fewer at another time.
    pub fn new(space: &FreeSpace, places: &[DVec3]) -> Self {
        let legs = Legs::new(space, places);
        // One more place, as near to all others, closes the tour; it is cut open there.
        let n = places.len();
        let distance = |a: usize, b: usize| if a == n || b == n { 0.0 } else { legs.length(a, b) };
        let around = |order: &[usize]| (0..=n).map(|i| distance(order[i], order[(i + 1) % (n + 1)])).sum::<f64>();
        let mut best: Option<(f64, Vec<usize>)> = None;
        for beginning in (0..n).step_by(n.div_ceil(BEGINNINGS).max(1)) {
            let mut order = nearest_first(n, beginning, distance);
            order.push(n);
            while shorten(&mut order, distance) {}
            let length = around(&order);
            if best.as_ref().is_none_or(|(least, _)| length < *least) {
                best = Some((length, order));
            }
        }
        let mut order = best.map_or_else(Vec::new, |(_, order)| order);
        if let Some(cut) = order.iter().position(|place| *place == n) {
            order.rotate_left(cut);
            order.remove(0);
        }
        if let (Some(first), Some(last)) = (order.first(), order.last())
            && (places[*last].z, *last) < (places[*first].z, *first)
        {
            order.reverse();
        }
        let mut path: Vec<DVec3> = order.first().map(|first| places[*first]).into_iter().collect();
        let pairs = || order.windows(2).map(|pair| (pair[0], pair[1]));
        pairs().for_each(|(from, to)| path.extend(legs.way(from, to)));
        let blocked = pairs().filter(|(from, to)| legs.blocked(*from, *to)).count();
        Self { order, path, blocked }
    }

    /// Length of the way.
    pub fn length(&self) -> f64 {
        length(&self.path)
    }
}

/// All of `n` places, from one always on to the nearest that is left.
fn nearest_first(n: usize, beginning: usize, distance: impl Fn(usize, usize) -> f64) -> Vec<usize> {
    let mut left: Vec<usize> = (0..n).filter(|i| *i != beginning).collect();
    let mut order = vec![beginning];
    while let Some(next) = (0..left.len()).min_by(|a, b| {
        let from = order[order.len() - 1];
        distance(from, left[*a]).total_cmp(&distance(from, left[*b]))
    }) {
        order.push(left.remove(next));
    }
    order
}

/// Shortens a closed tour: goes parts of it backwards (2-opt) and visits rows of places elsewhere (Or-opt). Whether anything was gained.
fn shorten(order: &mut [usize], distance: impl Fn(usize, usize) -> f64) -> bool {
    let n = order.len();
    if n < 4 {
        return false;
    }
    // Less is rounding.
    let least = 1e-9 * (0..n).map(|i| distance(order[i], order[(i + 1) % n])).sum::<f64>() / n as f64;
    let mut shorter = false;
    for i in 0..n - 1 {
        for j in i + 2..n {
            let [a, b, c, d] = [order[i], order[i + 1], order[j], order[(j + 1) % n]];
            if a != d && distance(a, b) + distance(c, d) - distance(a, c) - distance(b, d) > least {
                order[i + 1..=j].reverse();
                shorter = true;
            }
        }
    }
    for row in 1..=ROW.min(n - 3) {
        for _ in 0..n {
            // The row is always the first places, of the tour turned by one.
            order.rotate_left(1);
            let (first, last) = (order[0], order[row - 1]);
            let (before, after) = (order[n - 1], order[row]);
            let gained = distance(before, first) + distance(last, after) - distance(before, after);
            let at = |k: usize| (order[k], order[k + 1]);
            let costs = (row..n - 1).flat_map(|k| {
                let (a, b) = at(k);
                let open = distance(a, b);
                [
                    (distance(a, first) + distance(last, b) - open, k, false),
                    (distance(a, last) + distance(first, b) - open, k, true),
                ]
            });
            let cheapest = costs.min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((_, k, backwards)) = cheapest.filter(|(cost, ..)| gained - cost > least) {
                if backwards {
                    order[..row].reverse();
                }
                order[..=k].rotate_left(row);
                shorter = true;
            }
        }
    }
    shorter
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::scene::proxy::{Occluder, Orientation, Proxy};
    use crate::scene::random;
    use crate::scene::region::{Region, Shape};
    use crate::scene::samples;

    /// The space around a cube of side one, or two rooms with a door between them, in a box.
    fn space(triangles: Vec<[DVec3; 3]>, half: f64) -> FreeSpace {
        let shape = Shape::Box { min: DVec3::splat(-half), max: DVec3::splat(half) };
        let region = Region { shape, up: DVec3::Z, floor: None, clearance: 0.1 };
        FreeSpace::new(&Occluder::Triangles(triangles), &region, 48).unwrap()
    }

    fn cube() -> Vec<[DVec3; 3]> {
        match Proxy::new(&samples::cube(), Orientation::Trusted).unwrap().occluder {
            Occluder::Triangles(triangles) => triangles,
            Occluder::Discs(_) => unreachable!("a cube is a mesh"),
        }
    }

    /// The length of the shortest order of all.
    fn shortest(places: &[DVec3], visited: &mut Vec<usize>, best: &mut f64) {
        if visited.len() == places.len() {
            let way: Vec<DVec3> = visited.iter().map(|i| places[*i]).collect();
            *best = best.min(length(&way));
        }
        for i in 0..places.len() {
            if !visited.contains(&i) {
                visited.push(i);
                shortest(places, visited, best);
                visited.pop();
            }
        }
    }

    /// If this failed, tours would be longer than they need to be: where everything is in sight of everything, a few places are visited in
    /// the best order there is, and places on a circle one after the other.
    #[test]
    fn tours_are_short() {
        let far = space(cube().iter().map(|t| t.map(|p| 0.1 * p - DVec3::splat(2.8))).collect(), 3.0);
        for seed in 0..20 {
            let places: Vec<DVec3> =
                (0..7).map(|i| DVec3::from_slice(&random::uniforms(seed, 0, i)) * 4.0 - 2.0).collect();
            let mut best = f64::INFINITY;
            shortest(&places, &mut Vec::new(), &mut best);
            let tour = Tour::new(&far, &places);
            assert!(tour.length() < 1.02 * best, "{} where {best} would do", tour.length());
        }
        let around: Vec<DVec3> = (0..60u32)
            .map(|i| {
                let angle = TAU * f64::from(i * 7 % 60) / 60.0;
                DVec3::new(2.0 * angle.cos(), 2.0 * angle.sin(), 0.5)
            })
            .collect();
        let tour = Tour::new(&far, &around);
        let chord = 4.0 * (TAU / 120.0).sin();
        assert!((tour.length() - 59.0 * chord).abs() < 1e-9, "{}", tour.length());
        let mut sorted = tour.order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..60).collect::<Vec<_>>());
    }

    /// If this failed, whoever follows a tour would bump into the object: it passes every place and keeps the clearance between them.
    #[test]
    fn a_tour_goes_around_what_is_between() {
        let around = space(cube(), 1.5);
        let places = [DVec3::new(-1.2, 0.0, 0.0), DVec3::new(1.2, 0.0, 0.0)];
        let tour = Tour::new(&around, &places);
        // The shortest way touches two edges of the cube grown by the clearance.
        let (across, aside) = (1.2, 0.6f64);
        let best = 2.0 * ((across - 0.5f64).hypot(aside) + 0.5);
        assert!(tour.length() > 0.95 * best && tour.length() < 1.15 * best, "{} for {best}", tour.length());
        assert_eq!((tour.blocked, tour.path[0], tour.path[tour.path.len() - 1]), (0, places[0], places[1]));
        for pair in tour.path.windows(2) {
            for i in 0..=50 {
                let p = pair[0].lerp(pair[1], f64::from(i) / 50.0);
                let away = (p.abs() - 0.5).max(DVec3::ZERO).length();
                assert!(away >= 0.1 - 3f64.sqrt() * around.grid.cell && away > 0.0, "{p} is {away} away");
            }
        }
    }

    /// If this failed, a tour of two rooms would go through the wall between them instead of the door, or many times.
    #[test]
    fn a_tour_of_two_rooms_takes_the_door_once() {
        let quad = |y: [f64; 2]| {
            let at = |y: f64, z: f64| DVec3::new(0.0, y, z);
            let [a, b, c, d] = [at(y[0], -2.0), at(y[1], -2.0), at(y[1], 2.0), at(y[0], 2.0)];
            [[a, b, c], [a, c, d]]
        };
        let wall: Vec<[DVec3; 3]> = [quad([-2.0, 0.8]), quad([1.6, 2.0])].concat();
        let rooms = space(wall, 1.9);
        let places: Vec<DVec3> = (0..24)
            .map(|i| {
                let [x, y, z, _] = random::uniforms(5, 0, i);
                let side = if i % 2 == 0 { 1.0 } else { -1.0 };
                DVec3::new(side * (0.3 + 1.3 * x), 3.0 * y - 1.6, 3.0 * z - 1.5)
            })
            .collect();
        let tour = Tour::new(&rooms, &places);
        let crossings: Vec<f64> = tour
            .path
            .windows(2)
            .filter(|pair| pair[0].x * pair[1].x < 0.0)
            .map(|pair| pair[0].lerp(pair[1], pair[0].x / (pair[0].x - pair[1].x)).y)
            .collect();
        assert!(crossings.len() == 1 && (0.8..1.6).contains(&crossings[0]), "through the wall at {crossings:?}");
        assert_eq!(tour.blocked, 0);
    }

    /// If this failed, a place inside of something would end the program or stay unvisited and unsaid.
    #[test]
    fn a_place_that_is_shut_off_is_said() {
        let around = space(cube(), 1.5);
        let places = [DVec3::new(-1.2, 0.0, 0.0), DVec3::ZERO, DVec3::new(1.2, 0.0, 0.1)];
        let tour = Tour::new(&around, &places);
        assert!(tour.order.len() == 3 && tour.blocked >= 1 && tour.path.contains(&DVec3::ZERO), "{tour:?}");
        assert_eq!(Tour::new(&around, &places[..1]).path, [places[0]]);
        assert_eq!(Tour::new(&around, &[]).order, Vec::<usize>::new());
    }
}

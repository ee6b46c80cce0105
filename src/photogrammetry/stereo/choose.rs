//! Which photos to use, and which of them to compare with one another.

use glam::{DVec2, DVec3};

use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::random;

use super::frame::MAX_PAIRS;

/// Stream of the random numbers that the first photo is drawn with.
const FIRST: u32 = 0x7072_6f78;
/// Angles between viewing directions, in degrees: best for a comparison, and the least and most that one is made at.
const BEST_ANGLE: f64 = 18.0;
const MIN_ANGLE: f64 = 3.0;
const MAX_ANGLE: f64 = 60.0;
/// Part of a view's rays that a neighbour must see.
const MIN_OVERLAP: f64 = 0.3;

/// `count` of the directions, spread by farthest-point sampling over the sphere; the first is drawn with `seed`. Indices in
/// rising order.
pub fn spread(directions: &[DVec3], count: usize, seed: u64) -> Vec<usize> {
    if count >= directions.len() {
        return (0..directions.len()).collect();
    }
    let mut next = random::below(random::bits(seed, FIRST, 0)[0], directions.len() as u32) as usize;
    let mut closeness = vec![f64::NEG_INFINITY; directions.len()];
    let mut chosen = Vec::with_capacity(count);
    while chosen.len() < count {
        chosen.push(next);
        closeness[next] = f64::INFINITY;
        for (i, direction) in directions.iter().enumerate() {
            closeness[i] = closeness[i].max(direction.dot(directions[next]));
        }
        // The first of equals, so that the choice does not depend on how ties fall.
        next = (0..directions.len()).fold(0, |best, i| if closeness[i] < closeness[best] { i } else { best });
    }
    chosen.sort_unstable();
    chosen
}

/// Up to [`MAX_PAIRS`] neighbours of each view, best first: those that see much of what it sees, at an angle between
/// viewing directions that is wide enough to resolve depths and narrow enough for pictures to be alike. `ranges` are the
/// depths that each view is searched in.
pub fn neighbours(cameras: &[Camera], ranges: &[[f64; 2]]) -> Vec<Vec<usize>> {
    let of = |reference: usize| {
        let mut scored: Vec<(f64, usize)> = (0..cameras.len())
            .filter(|other| *other != reference)
            .filter_map(|other| {
                let angle = between(&cameras[reference], &cameras[other], ranges[reference]).to_degrees();
                let overlap = overlap(&cameras[reference], &cameras[other], ranges[reference]);
                if !(MIN_ANGLE..=MAX_ANGLE).contains(&angle) || overlap < MIN_OVERLAP {
                    return None;
                }
                let width = if angle < BEST_ANGLE { 8.0 } else { 20.0 };
                Some((overlap * (-0.5 * ((angle - BEST_ANGLE) / width).powi(2)).exp(), other))
            })
            .collect();
        scored.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        scored.into_iter().take(MAX_PAIRS).map(|(_, other)| other).collect()
    };
    (0..cameras.len()).map(of).collect()
}

/// Angle in radians at which two cameras see the middle of what the first looks at.
fn between(a: &Camera, b: &Camera, [near, far]: [f64; 2]) -> f64 {
    let middle = a.pose.position + 2.0 / (1.0 / near + 1.0 / far) * a.pose.forward();
    (a.pose.position - middle).angle_between(b.pose.position - middle)
}

/// Part of the points on a view's rays, at three depths, that another camera sees.
fn overlap(a: &Camera, b: &Camera, [near, far]: [f64; 2]) -> f64 {
    const SIDE: u32 = 5;
    let Intrinsics { width, height, focal, principal } = a.intrinsics;
    let mut seen = 0;
    for step in 0..SIDE * SIDE {
        let part = (DVec2::new(f64::from(step % SIDE), f64::from(step / SIDE)) + 0.5) / f64::from(SIDE);
        let pixel = part * DVec2::new(f64::from(width), f64::from(height));
        let ray = ((pixel - DVec2::from(principal)) / DVec2::from(focal)).extend(1.0);
        for depth in [0.25, 0.5, 0.75].map(|t| 1.0 / (t / near + (1.0 - t) / far)) {
            seen += u32::from(b.sees(a.pose.position + a.pose.rotation * (depth * ray)));
        }
    }
    f64::from(seen) / f64::from(3 * SIDE * SIDE)
}

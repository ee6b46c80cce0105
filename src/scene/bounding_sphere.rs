//! The smallest sphere around a set of points.

use glam::{DMat3, DVec3};

/// Centre and radius of the smallest sphere that contains all `points`; `None` where there are none.
///
/// Farthest-point pivoting (Gaertner, "Fast and Robust Smallest Enclosing Balls", 1999): the point that sticks out most
/// joins the at most four that hold the sphere, the smallest sphere of those five takes over, until nothing sticks out.
/// The radius grows with every pivot, so the loop ends; the result is exact to a relative 1e-9.
pub fn bounding_sphere(points: &[DVec3]) -> Option<(DVec3, f64)> {
    let mut support = vec![*points.first()?];
    // What rounding does to distances between points that lie far away from the origin, as georeferenced ones do.
    let rounding = 4.0 * f64::EPSILON * support[0].abs().max_element();
    let (mut centre, mut radius) = (support[0], 0.0);
    loop {
        let far = points
            .iter()
            .copied()
            .fold(centre, |a, b| if b.distance_squared(centre) > a.distance_squared(centre) { b } else { a });
        let distance = far.distance(centre);
        if distance <= radius * (1.0 + 1e-9) + rounding {
            return Some((centre, distance.max(radius)));
        }
        support.push(far);
        let Some((next, r, held_by)) = smallest_of_few(&support, rounding) else { return Some((centre, distance)) };
        if r <= radius {
            // Rounding has stopped the growth: the old centre with the farthest distance is as good as it gets.
            return Some((centre, distance));
        }
        (centre, radius, support) = (next, r, held_by);
    }
}

/// The smallest sphere around at most five points, with the points on its boundary that determine it. Distances may be wrong by
/// `rounding`.
fn smallest_of_few(points: &[DVec3], rounding: f64) -> Option<(DVec3, f64, Vec<DVec3>)> {
    let mut best: Option<(DVec3, f64, Vec<DVec3>)> = None;
    for subset in 1u32..1 << points.len() {
        let chosen: Vec<DVec3> =
            points.iter().enumerate().filter(|(i, _)| subset >> i & 1 == 1).map(|(_, p)| *p).collect();
        let Some(centre) = circumcentre(&chosen) else { continue };
        let radius = centre.distance(chosen[0]);
        let contains =
            points.iter().all(|p| p.distance(centre) <= radius * (1.0 + 1e-12) + rounding.max(f64::MIN_POSITIVE));
        if contains && best.as_ref().is_none_or(|(_, r, _)| radius < *r) {
            best = Some((centre, radius, chosen));
        }
    }
    best
}

/// The point of the affine hull of one to four points that is equally far from all of them; `None` where they are
/// affinely dependent.
fn circumcentre(points: &[DVec3]) -> Option<DVec3> {
    let origin = *points.first()?;
    let edges: Vec<DVec3> = points[1..].iter().map(|p| *p - origin).collect();
    let offset = match *edges.as_slice() {
        [] => DVec3::ZERO,
        [a] => 0.5 * a,
        [a, b] => {
            let normal = a.cross(b);
            (a.length_squared() * b.cross(normal) + b.length_squared() * normal.cross(a))
                / (2.0 * normal.length_squared())
        }
        [a, b, c] => {
            let squares = 0.5 * DVec3::new(a.length_squared(), b.length_squared(), c.length_squared());
            DMat3::from_cols(a, b, c).transpose().inverse() * squares
        }
        _ => return None,
    };
    offset.is_finite().then_some(origin + offset)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    fn cloud(n: u32, seed: u64) -> Vec<DVec3> {
        (0..n)
            .map(|i| {
                let [x, y, z, _] = random::uniforms(seed, 0, i);
                DVec3::new(4.0 * x, y, 2.0 * z)
            })
            .collect()
    }

    /// A point outside would let cameras of a default shell be inside the object.
    #[test]
    fn every_point_is_inside_and_the_sphere_is_tight() {
        for seed in 0..20 {
            let points = cloud(500, seed);
            let (centre, radius) = bounding_sphere(&points).unwrap();
            let farthest = points.iter().map(|p| p.distance(centre)).fold(0.0, f64::max);
            assert!(farthest <= radius * (1.0 + 1e-8));
            // No sphere around a centre nearby is smaller.
            for i in 0..50 {
                let [u, v, ..] = random::uniforms(seed, 1, i);
                let other = centre + 1e-3 * random::direction(u, v);
                let needed = points.iter().map(|p| p.distance(other)).fold(0.0, f64::max);
                assert!(needed >= radius * (1.0 - 1e-9), "seed {seed}: {needed} < {radius}");
            }
        }
    }

    /// Known answers; a bounding box's diagonal would overstate the sphere's radius by 73%.
    #[test]
    fn known_shapes_have_known_spheres() {
        let sphere: Vec<DVec3> = (0..2000)
            .map(|i| {
                let [u, v, ..] = random::uniforms(3, 0, i);
                DVec3::ONE + 2.0 * random::direction(u, v)
            })
            .collect();
        let (centre, radius) = bounding_sphere(&sphere).unwrap();
        assert!((centre - DVec3::ONE).length() < 0.02 && (radius - 2.0).abs() < 0.01);
        let cube: Vec<DVec3> =
            (0..8).map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2))).collect();
        let (centre, radius) = bounding_sphere(&cube).unwrap();
        assert!((centre - DVec3::splat(0.5)).length() < 1e-9 && (radius - 0.75f64.sqrt()).abs() < 1e-9);
    }

    /// Degenerate sets must end with an answer and not with a loop.
    #[test]
    fn degenerate_sets_have_spheres_too() {
        assert_eq!(bounding_sphere(&[]), None);
        assert_eq!(bounding_sphere(&[DVec3::ONE; 5]), Some((DVec3::ONE, 0.0)));
        let line: Vec<DVec3> = (0..11).map(|i| DVec3::X * f64::from(i)).collect();
        assert_eq!(bounding_sphere(&line), Some((DVec3::X * 5.0, 5.0)));
        let ring: Vec<DVec3> = (0..360)
            .map(|i| {
                let (s, c) = f64::from(i).to_radians().sin_cos();
                DVec3::new(c, s, 0.0)
            })
            .collect();
        let (centre, radius) = bounding_sphere(&ring).unwrap();
        assert!(centre.length() < 1e-9 && (radius - 1.0).abs() < 1e-9);
    }
}

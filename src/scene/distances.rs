//! Distances of straight legs from points and triangles.

use glam::DVec3;

/// Distance of a point from the straight leg between two places.
pub fn leg_to_point(from: DVec3, to: DVec3, point: DVec3) -> f64 {
    let along = to - from;
    let share = ((point - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    point.distance(from + share * along)
}

/// Distance of a triangle from the straight leg between two places, which may be one.
pub fn leg_to_triangle(from: DVec3, to: DVec3, [a, b, c]: &[DVec3; 3]) -> f64 {
    let normal = (*b - *a).cross(*c - *a).normalize_or_zero();
    // Whether a point of the triangle's plane is in it.
    let inside =
        |p: DVec3| [(a, b), (b, c), (c, a)].iter().all(|(p0, p1)| (**p1 - **p0).cross(p - **p0).dot(normal) >= 0.0);
    let [above, beyond] = [from, to].map(|p| (p - *a).dot(normal));
    if above * beyond <= 0.0 && above != beyond && inside(from + (to - from) * (above / (above - beyond))) {
        return 0.0;
    }
    let ends = [(from, above), (to, beyond)].into_iter().filter(|(p, height)| inside(*p - *height * normal));
    let edges = [(a, b), (b, c), (c, a)].map(|(p, q)| between(from, to, *p, *q));
    ends.map(|(_, height)| height.abs()).chain(edges).fold(f64::INFINITY, f64::min)
}

/// Distance of two straight legs from each other.
fn between(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    let (u, v, w) = (b - a, d - c, a - c);
    let (uu, uv, vv, uw, vw) = (u.dot(u), u.dot(v), v.dot(v), u.dot(w), v.dot(w));
    let across = uu * vv - uv * uv;
    let s = if across > 1e-12 * uu * vv { ((uv * vw - vv * uw) / across).clamp(0.0, 1.0) } else { 0.0 };
    // The nearest of the other leg to that point, and of this leg to that one.
    let t = if vv > 0.0 { ((uv * s + vw) / vv).clamp(0.0, 1.0) } else { 0.0 };
    let s = if uu > 0.0 { ((uv * t - uw) / uu).clamp(0.0, 1.0) } else { 0.0 };
    (w + s * u - t * v).length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    fn vector(stream: u32, i: u32) -> DVec3 {
        let [x, y, z, _] = random::uniforms(7, stream, i);
        DVec3::new(x, y, z) - 0.5
    }

    /// Against a fine net of points of leg and triangle. If this failed, a mission through a wall would pass, or one past it be refused.
    #[test]
    fn distances_are_those_of_sampled_points() {
        for i in 0..300 {
            let [from, to, a, b, c] = [0, 1, 2, 3, 4].map(|stream| vector(stream, i));
            // Every third leg is a single point.
            let to = if i % 3 == 0 { from } else { to };
            let found = leg_to_triangle(from, to, &[a, b, c]);
            let steps = 60;
            let mut sampled = f64::INFINITY;
            for j in 0..=steps {
                for k in 0..=steps - j {
                    let [v, w] = [j, k].map(|n| f64::from(n) / f64::from(steps));
                    sampled = sampled.min(leg_to_point(from, to, a + v * (b - a) + w * (c - a)));
                }
            }
            assert!(found <= sampled + 1e-12 && found > sampled - 0.02, "{i}: {found}, but {sampled} is sampled");
        }
    }
}

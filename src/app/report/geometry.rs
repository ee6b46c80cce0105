//! Geometry made small enough to embed: split, quantised, base64.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use super::SurfacePoint;

/// Triangles a page holds at most after splitting; a soup that is larger to begin with is left as it is.
const MAX_TRIANGLES: usize = 60_000;

/// Little-endian bytes of `values` as base64, which the page turns back into a typed array.
pub(crate) fn pack<T: Copy, const N: usize>(
    values: impl IntoIterator<Item = T>,
    bytes: impl Fn(T) -> [u8; N],
) -> String {
    STANDARD.encode(values.into_iter().flat_map(bytes).collect::<Vec<u8>>())
}

/// Lowest and highest corner of `points`, those that are not finite left out; `None` where no point is left.
pub fn bounds(points: impl IntoIterator<Item = DVec3>) -> Option<(DVec3, DVec3)> {
    points.into_iter().filter(|p| p.is_finite()).fold(None, |bounds, p| match bounds {
        None => Some((p, p)),
        Some((low, high)) => Some((low.min(p), high.max(p))),
    })
}

/// Bounds per axis between the 2nd and the 98th percentile. In a room these lie on the walls, for a wall holds far more
/// than 2% of the points, and a few strays outside move nothing.
pub fn robust_bounds(points: &[SurfacePoint]) -> Option<(DVec3, DVec3)> {
    let mut low = DVec3::ZERO;
    let mut high = DVec3::ZERO;
    for axis in 0..3 {
        let mut values: Vec<f64> = points.iter().map(|p| p.position[axis]).filter(|v| v.is_finite()).collect();
        values.sort_unstable_by(f64::total_cmp);
        let last = values.len().checked_sub(1)?;
        low[axis] = values[last / 50];
        high[axis] = values[last - last / 50];
    }
    Some((low, high))
}

/// Halves long edges until heat can be shown on them: a wall of two triangles has too few corners to carry it.
///
/// Every edge above one length is halved in all the triangles that share it, so no cracks open. The length is twice the
/// mean distance between `points` samples, or more where that would take too many triangles. Returns the corners of the
/// new triangles and the index of the triangle that each came from.
pub fn split(corners: &[[DVec3; 3]], points: usize) -> (Vec<[DVec3; 3]>, Vec<usize>) {
    let area: f64 = corners.iter().map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length()).filter(|a| a.is_finite()).sum();
    let mut length = 2.0 * (area / points.max(1) as f64).sqrt();
    while length > 0.0 && length.is_finite() {
        if let Some(done) = split_to(corners, length) {
            return done;
        }
        length *= 1.5;
    }
    (corners.to_vec(), (0..corners.len()).collect())
}

/// [`split`] to a given longest edge; `None` once more triangles arise than a page should hold.
fn split_to(corners: &[[DVec3; 3]], length: f64) -> Option<(Vec<[DVec3; 3]>, Vec<usize>)> {
    let limit = MAX_TRIANGLES.max(corners.len());
    let (mut out, mut sources) = (Vec::new(), Vec::new());
    for (source, triangle) in corners.iter().enumerate() {
        let mut open = vec![*triangle];
        while let Some([a, b, c]) = open.pop() {
            let edges = [a.distance_squared(b), b.distance_squared(c), c.distance_squared(a)];
            let longest = edges.into_iter().fold(0.0, f64::max);
            if !(longest > length * length && longest.is_finite()) {
                out.push([a, b, c]);
                sources.push(source);
                continue;
            }
            // Turned so that the longest edge is the first.
            let [a, b, c] = match edges {
                [e, _, _] if e == longest => [a, b, c],
                [_, e, _] if e == longest => [b, c, a],
                _ => [c, a, b],
            };
            let middle = 0.5 * (a + b);
            open.push([a, middle, c]);
            open.push([middle, b, c]);
            if out.len() + open.len() + corners.len() - source - 1 > limit {
                return None;
            }
        }
    }
    Some((out, sources))
}

/// Index of the nearest of `points` to each place; zeros where there are no points to choose from.
pub fn nearest(points: &[SurfacePoint], places: impl Iterator<Item = DVec3>) -> Vec<u16> {
    let positions: Vec<[f64; 3]> = points.iter().map(|p| p.position.to_array()).collect();
    match ImmutableKdTree::<f64, 3>::new_from_slice(&positions) {
        Ok(tree) if !points.is_empty() => places
            .map(|c| tree.query(&c.to_array()).nearest_one::<SquaredEuclidean<f64>>().execute().item as u16)
            .collect(),
        _ => vec![0; places.count()],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Were it to lose or overlap anything, heat would be drawn twice or not at all.
    #[test]
    fn splitting_keeps_the_area_and_shortens_every_edge() {
        let wall = [
            [DVec3::ZERO, DVec3::X * 4.0, DVec3::new(4.0, 3.0, 0.0)],
            [DVec3::ZERO, DVec3::new(4.0, 3.0, 0.0), DVec3::Y * 3.0],
        ];
        let (corners, sources) = split(&wall, 300);
        let area: f64 = corners.iter().map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length()).sum();
        assert!((area - 12.0).abs() < 1e-9);
        assert!(corners.iter().all(|[a, b, c]| a.distance(*b).max(b.distance(*c)).max(c.distance(*a)) <= 0.4 + 1e-12));
        assert_eq!(sources.len(), corners.len());
        assert!(sources.iter().all(|s| *s < 2));
    }

    /// Were a stray point enough to move the bounds, a room's walls would hide its inside.
    #[test]
    fn strays_do_not_move_the_robust_bounds() {
        let mut points: Vec<SurfacePoint> = (0..=100)
            .map(|i| SurfacePoint {
                position: DVec3::splat(f64::from(i).clamp(10.0, 90.0)),
                colour: [0; 3],
                gap: 0.0,
                views: 0,
                score: 1.0,
                error: 0.0,
            })
            .collect();
        points[50].position = DVec3::splat(1e6);
        points[51].position = DVec3::NAN;
        assert_eq!(robust_bounds(&points), Some((DVec3::splat(10.0), DVec3::splat(90.0))));
        assert_eq!(robust_bounds(&[]), None);
    }

    #[test]
    fn splitting_stops_at_what_a_page_can_hold() {
        let huge = [[DVec3::ZERO, DVec3::X, DVec3::Y]];
        let (corners, _) = split(&huge, 10_000_000);
        assert!(corners.len() > 10_000 && corners.len() <= MAX_TRIANGLES);
    }

    #[test]
    fn a_triangle_that_is_not_finite_passes_through() {
        let broken = [[DVec3::NAN, DVec3::X, DVec3::Y], [DVec3::ZERO, DVec3::X, DVec3::Y]];
        assert!(split(&broken, 10).0.len() >= 2);
    }
}

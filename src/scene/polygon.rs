//! Polygons cut into triangles.

use glam::{DVec2, DVec3};

/// Triangles of a face by the places of its corners: a fan about the first where it is convex, else ears cut off one after the other, in
/// the plane across its mean normal (Newell's). Three corners are the triangle itself, fewer are none.
pub fn triangles(corners: &[DVec3]) -> Vec<[usize; 3]> {
    let fan = || (2..corners.len()).map(|i| [0, i - 1, i]).collect();
    let next = |i: usize| corners[(i + 1) % corners.len()];
    let normal: DVec3 = (0..corners.len()).map(|i| corners[i].cross(next(i))).sum();
    let (3.., Some(normal)) = (corners.len(), (normal).try_normalize()) else { return fan() };
    let (across, along) = normal.any_orthonormal_pair();
    // From the first corner, so that nothing is lost far from the origin.
    let flat: Vec<DVec2> =
        corners.iter().map(|corner| *corner - corners[0]).map(|p| DVec2::new(p.dot(across), p.dot(along))).collect();
    let count = flat.len();
    let extent = flat.iter().map(|p| p.length_squared()).fold(0.0, f64::max);
    let turn = |i: usize| area(flat[i], flat[(i + 1) % count], flat[(i + 2) % count]);
    // A fan about the first corner is right where every one of its triangles goes round the same way.
    let fanned = |i: usize| area(flat[0], flat[i - 1], flat[i]);
    let convex = (0..count).all(|i| turn(i) > -1e-9 * extent) && (2..count).all(|i| fanned(i) > -1e-9 * extent);
    if count == 3 || convex { fan() } else { triangulated(&flat).unwrap_or_else(fan) }
}

/// Twice the area of a triangle, positive where its corners go round to the left.
pub(super) fn area(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Triangles of a simple polygon whose corners go round to the left, by cutting off one ear after the other; none where there is no ear.
pub(super) fn triangulated(corners: &[DVec2]) -> Option<Vec<[usize; 3]>> {
    let mut left: Vec<usize> = (0..corners.len()).collect();
    let mut faces = Vec::with_capacity(corners.len().saturating_sub(2));
    while left.len() > 2 {
        let count = left.len();
        let ear = |i: &usize| {
            let [before, at, after] = [left[(i + count - 1) % count], left[*i], left[(i + 1) % count]];
            let [a, b, c] = [before, at, after].map(|corner| corners[corner]);
            let inside = |p: DVec2| area(a, b, p) >= 0.0 && area(b, c, p) >= 0.0 && area(c, a, p) >= 0.0;
            let others = left.iter().map(|corner| corners[*corner]).filter(|p| ![a, b, c].contains(p));
            area(a, b, c) > 0.0 && !others.into_iter().any(inside)
        };
        // What lies on a line has no area, and is cut off without a face.
        let flat = |i: &usize| {
            let [a, b, c] = [left[(i + count - 1) % count], left[*i], left[(i + 1) % count]].map(|at| corners[at]);
            area(a, b, c) == 0.0
        };
        if let Some(i) = (0..count).find(ear) {
            faces.push([left[(i + count - 1) % count], left[i], left[(i + 1) % count]]);
            left.remove(i);
        } else {
            left.remove((0..count).find(flat)?);
        }
    }
    (!faces.is_empty()).then_some(faces)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn total(corners: &[DVec3]) -> f64 {
        let area = |[a, b, c]: &[usize; 3]| 0.5 * (corners[*b] - corners[*a]).cross(corners[*c] - corners[*a]).length();
        triangles(corners).iter().map(area).sum()
    }

    /// If this failed, walls with windows and L-shaped floors would reach beyond their outlines, and points be drawn and seen there.
    #[test]
    fn faces_have_their_true_area() {
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let ell = [[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]];
        let arrow = [[0.0, 0.0], [2.0, 1.0], [4.0, 0.0], [2.0, 4.0]];
        // A square hole of side 2 in one of 4, joined to the outline by a slit.
        let hole = [
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ];
        for (outline, wanted) in [(&square[..], 4.0), (&ell[..], 6.0), (&arrow[..], 6.0), (&hole[..], 12.0)] {
            for shift in 0..outline.len() {
                for (origin, u, v) in [
                    (DVec3::ZERO, DVec3::X, DVec3::Y),
                    (DVec3::new(5e5, 5e6, 100.0), DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.0, -1.0, 0.0)),
                ] {
                    let corners: Vec<DVec3> = (0..outline.len())
                        .map(|i| outline[(i + shift) % outline.len()])
                        .map(|[x, y]| origin + x * u + y * v)
                        .collect();
                    let found = total(&corners);
                    assert!((found - wanted).abs() < 1e-6, "{outline:?} from {shift}: {found}, not {wanted}");
                    assert_eq!(triangles(&corners).len(), corners.len() - 2);
                }
            }
        }
        assert_eq!(triangles(&[DVec3::ZERO, DVec3::X, DVec3::ONE, DVec3::Y]), [[0, 1, 2], [0, 2, 3]]);
        assert!(triangles(&[DVec3::ZERO, DVec3::X]).is_empty());
        // Without an area it is cut all the same: such triangles are dropped later, and counted.
        assert_eq!(triangles(&[DVec3::ZERO; 4]).len(), 2);
    }
}

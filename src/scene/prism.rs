//! Upright prisms over polygons: closed meshes with all faces outward.

use glam::{DVec2, DVec3};

use super::polygon::{area, triangulated};
use super::volume::Triangle;

/// The prism over a polygon, between two heights along `up` (of unit length). Corners go round either way, and may be at any height.
///
/// # Errors
/// What is wrong with the polygon, as a continuation of its name.
pub fn prism(corners: &[DVec3], up: DVec3, [low, high]: [f64; 2]) -> Result<Vec<Triangle>, &'static str> {
    let across = up.any_orthonormal_vector();
    let along = up.cross(across);
    let middle = corners.iter().sum::<DVec3>() / corners.len().max(1) as f64;
    let mut flat: Vec<DVec2> =
        corners.iter().map(|corner| DVec2::new((corner - middle).dot(across), (corner - middle).dot(along))).collect();
    let turn: f64 = (0..flat.len()).map(|i| flat[i].perp_dot(flat[(i + 1) % flat.len()])).sum();
    if turn < 0.0 {
        flat.reverse();
    }
    if crosses_itself(&flat) {
        return Err("crosses itself; draw its corners in their order around it");
    }
    let faces = triangulated(&flat).ok_or("encloses no area; give the corners of an area")?;
    let ground = middle - middle.dot(up) * up;
    let at = |i: usize, height: f64| ground + flat[i].x * across + flat[i].y * along + height * up;
    let caps = faces
        .iter()
        .flat_map(|[a, b, c]| [[at(*a, high), at(*b, high), at(*c, high)], [at(*c, low), at(*b, low), at(*a, low)]]);
    let sides = (0..flat.len()).flat_map(|i| {
        let j = (i + 1) % flat.len();
        [[at(i, low), at(j, low), at(j, high)], [at(i, low), at(j, high), at(i, high)]]
    });
    Ok(caps.chain(sides).collect())
}

/// Whether two sides cross that are no neighbours.
fn crosses_itself(corners: &[DVec2]) -> bool {
    let count = corners.len();
    let side = |i: usize| (corners[i], corners[(i + 1) % count]);
    (0..count).any(|i| {
        let (a, b) = side(i);
        // The last side is a neighbour of the first.
        (i + 2..count).filter(|j| (j + 1) % count != i).any(|j| {
            let (c, d) = side(j);
            area(a, b, c) * area(a, b, d) < 0.0 && area(c, d, a) * area(c, d, b) < 0.0
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::limits::Limits;
    use crate::scene::volume::Volume;

    fn volume(triangles: &[Triangle]) -> f64 {
        triangles.iter().map(|[a, b, c]| a.dot(b.cross(*c)) / 6.0).sum()
    }

    /// If this failed, a zone would have another shape than was drawn: its notch filled, or its faces inward.
    #[test]
    fn a_prism_has_the_shape_of_its_polygon() {
        // An L of area 3, drawn either way, with a corner on a straight side, on an axis that is not upright in these coordinates.
        let l = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        let up = DVec3::Y;
        let mut corners: Vec<DVec3> = l.iter().map(|[z, x]| DVec3::new(10.0 + x, 7.0, z - 5.0)).collect();
        for _ in 0..2 {
            let triangles = prism(&corners, up, [1.0, 3.0]).unwrap();
            assert!((volume(&triangles) - 6.0).abs() < 1e-9, "{}", volume(&triangles));
            let limits = Limits { keep_out: vec![Volume { triangles, ..Volume::default() }], ..Limits::default() };
            let inside = |x: f64, y: f64, z: f64| limits.in_a_volume(DVec3::new(10.0 + x, y, z - 5.0));
            assert!(inside(0.5, 2.0, 0.5) && inside(0.5, 2.0, 1.5) && inside(1.5, 2.9, 0.5));
            assert!(
                !inside(1.5, 2.0, 1.5) && !inside(0.5, 3.1, 0.5) && !inside(0.5, 0.9, 0.5) && !inside(-0.1, 2.0, 0.5)
            );
            corners.reverse();
        }
    }

    /// If this failed, a polygon that nothing is inside of would bar nothing, without a word.
    #[test]
    fn polygons_that_are_none_are_refused() {
        let at =
            |corners: &[[f64; 2]]| -> Vec<DVec3> { corners.iter().map(|[x, y]| DVec3::new(*x, *y, 0.0)).collect() };
        let bow = at(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]);
        assert!(prism(&bow, DVec3::Z, [0.0, 1.0]).unwrap_err().contains("crosses itself"));
        let line = at(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]);
        assert!(prism(&line, DVec3::Z, [0.0, 1.0]).unwrap_err().contains("no area"));
    }
}

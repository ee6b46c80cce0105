//! Which way is up in a mesh that does not say it.

use glam::DVec3;

use super::surface::Mesh;

/// Part of the height, from the lowest point, within which ground lies.
const BOTTOM: f64 = 0.15;
/// Least cosine between the normal of what is level and up.
const LEVEL: f64 = 0.8;
/// Part of the footprint from which on level faces at the bottom are what everything stands on.
const GROUND: f64 = 0.5;
/// Height over the shorter side of the footprint below which a mesh is land.
const FLAT: f64 = 0.3;

/// Up, of the two axes that programs use (+y and +z): the one along which the mesh is flat, or has level faces under most of it; none where
/// that is so of both or of neither.
pub fn upright(mesh: &Mesh) -> Option<DVec3> {
    let min = mesh.positions.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let max = mesh.positions.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let size = max - min;
    let [y, z] = [DVec3::Y, DVec3::Z].map(|up| {
        let height = size.dot(up);
        let sides = [0, 1, 2].into_iter().filter(|axis| up[*axis] == 0.0).map(|axis| size[axis]);
        let (shorter, footprint) =
            sides.fold((f64::INFINITY, 1.0), |(least, area), side| (side.min(least), side * area));
        let level: f64 = mesh
            .triangles
            .iter()
            .filter_map(|corners| {
                let [a, b, c] = corners.map(|i| mesh.positions.get(i as usize).copied());
                let (a, b, c) = (a?, b?, c?);
                let twice = (b - a).cross(c - a);
                let low = ((a + b + c) / 3.0 - min).dot(up) < BOTTOM * height;
                (low && twice.dot(up).abs() > LEVEL * twice.length()).then(|| 0.5 * twice.dot(up).abs())
            })
            .sum();
        height < FLAT * shorter || level > GROUND * footprint
    });
    match (y, z) {
        (true, false) => Some(DVec3::Y),
        (false, true) => Some(DVec3::Z),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::limits::box_triangles;

    fn boxes(boxes: &[([f64; 3], [f64; 3])], turned: bool) -> Mesh {
        let mut mesh = Mesh::default();
        for (min, max) in boxes {
            for corners in box_triangles(DVec3::from_array(*min), DVec3::from_array(*max)) {
                let first = mesh.positions.len() as u32;
                let place = |p: DVec3| if turned { DVec3::new(p.x, p.z, -p.y) } else { p };
                mesh.positions.extend(corners.map(place));
                mesh.triangles.push([first, first + 1, first + 2]);
            }
        }
        mesh
    }

    /// If this failed, a reconstruction would be planned for lying on its side, with half of the cameras under ground, as every OBJ with +z
    /// up was.
    #[test]
    fn up_is_found_where_the_ground_shows_it() {
        let lawn = ([-80.0, -60.0, -0.2], [80.0, 60.0, 0.0]);
        let tall = ([-4.0, -3.0, 0.0], [4.0, 3.0, 90.0]);
        let plinth = ([-1.0, -1.0, 0.0], [1.0, 1.0, 0.4]);
        let statue = ([-0.5, -0.4, 0.4], [0.4, 0.5, 4.0]);
        for (what, found) in [
            (&[lawn, ([10.0, -4.0, 0.0], [22.0, 6.0, 8.0])][..], true),
            (&[lawn, tall], true),
            (&[plinth, statue], true),
            // A box stands on any of its sides.
            (&[([0.0; 3], [1.0; 3])], false),
        ] {
            assert_eq!(upright(&boxes(what, false)), found.then_some(DVec3::Z), "{what:?}");
            assert_eq!(upright(&boxes(what, true)), found.then_some(DVec3::Y), "{what:?}");
        }
        assert_eq!(upright(&Mesh::default()), None);
    }
}

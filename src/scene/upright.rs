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
/// Part of the height by which the mean height of land is above its median.
const RISES: f64 = 0.01;

/// Up, along one of the axes that programs use (y and z), either way: that along which level faces lie under most of the mesh; where there is
/// none, that along which it is flat and rises from most of itself. None where several are such.
pub fn upright(mesh: &Mesh) -> Option<DVec3> {
    let axes = [DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z].map(|up| (up, shows(mesh, up)));
    let mut level = axes.iter().filter(|(_, [level, _])| *level);
    let mut land = axes.iter().filter(|(_, [_, land])| *land);
    match (level.next(), level.next(), land.next(), land.next()) {
        (Some((up, _)), None, ..) | (None, None, Some((up, _)), None) => Some(*up),
        _ => None,
    }
}

/// Whether level faces lie under most of the mesh, and whether it is land, along a direction up.
fn shows(mesh: &Mesh, up: DVec3) -> [bool; 2] {
    let corners: Vec<[DVec3; 3]> = mesh
        .triangles
        .iter()
        .filter_map(|triangle| {
            let [a, b, c] = triangle.map(|i| mesh.positions.get(i as usize).copied());
            Some([a?, b?, c?])
        })
        .collect();
    let min = corners.iter().flatten().copied().fold(DVec3::INFINITY, DVec3::min);
    let max = corners.iter().flatten().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let size = max - min;
    let height = size.dot(up.abs());
    let sides = [0, 1, 2].into_iter().filter(|axis| up[*axis] == 0.0).map(|axis| size[axis]);
    let (shorter, footprint) = sides.fold((f64::INFINITY, 1.0), |(least, area), side| (side.min(least), side * area));
    let lowest = (min * up).min(max * up).element_sum();
    // Height of each face above the lowest point, and the part of the footprint that it covers.
    let faces: Vec<(f64, f64, bool)> = corners
        .iter()
        .map(|[a, b, c]| {
            let twice = (*b - *a).cross(*c - *a);
            let covered = 0.5 * twice.dot(up).abs();
            ((*a + *b + *c).dot(up) / 3.0 - lowest, covered, twice.dot(up).abs() > LEVEL * twice.length())
        })
        .collect();
    let level: f64 =
        faces.iter().filter(|(above, _, level)| *level && *above < BOTTOM * height).map(|face| face.1).sum();
    // Land rises from most of itself: its mean height is above its median.
    let mut heights: Vec<(f64, f64)> = faces.iter().map(|(above, covered, _)| (*above, *covered)).collect();
    heights.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = heights.iter().map(|face| face.1).sum();
    let mean = heights.iter().map(|(above, covered)| above * covered).sum::<f64>() / all;
    let mut passed = 0.0;
    let median = heights.iter().find(|(_, covered)| {
        passed += covered;
        passed >= 0.5 * all
    });
    let land = height < FLAT * shorter && median.is_some_and(|(median, _)| mean - median > RISES * height);
    [level > GROUND * footprint, land]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::volume::box_triangles;

    fn boxes(boxes: &[([f64; 3], [f64; 3])], place: fn(DVec3) -> DVec3) -> Mesh {
        let mut mesh = Mesh::default();
        for (min, max) in boxes {
            for corners in box_triangles(DVec3::from_array(*min), DVec3::from_array(*max)) {
                let first = mesh.positions.len() as u32;
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
            type Frame = (fn(DVec3) -> DVec3, DVec3);
            let frames: [Frame; 4] = [
                (|p| p, DVec3::Z),
                (|p| DVec3::new(p.x, p.z, -p.y), DVec3::Y),
                (|p| DVec3::new(p.x, -p.z, p.y), DVec3::NEG_Y),
                (|p| DVec3::new(p.y, p.x, -p.z), DVec3::NEG_Z),
            ];
            for (place, up) in frames {
                assert_eq!(upright(&boxes(what, place)), found.then_some(up), "{what:?}");
            }
        }
        assert_eq!(upright(&Mesh::default()), None);
    }
}

//! Which parts of a mesh are inside out.

use std::collections::HashMap;

use glam::DVec3;

use super::sets::Sets;

/// Which side of a surface is the visible one, where the surface itself does not show it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Orientation {
    /// Winding and normals are right as they are.
    Trusted,
    /// The surface is seen from outside: an object around this world point.
    Outward(DVec3),
    /// The surface is seen from inside: a room around this world point.
    Inward(DVec3),
}

/// Which sides of the triangles of a mesh are visible ones.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Sides {
    /// Indices of the triangles whose winding contradicts the orientation.
    pub inside_out: Vec<usize>,
    /// Whether the part of each triangle can be meant either way; empty where none can.
    pub either: Vec<bool>,
}

/// The visible sides by parts: the triangles connected through vertices at equal positions.
///
/// A part around the centre of a room shows it its inner side (it may have holes: windows, a missing ceiling); every other closed part shows
/// its outer side. An open part can be meant either way and keeps its winding.
pub(super) fn sides(triangles: &[[DVec3; 3]], orientation: Orientation) -> Sides {
    let room = match orientation {
        Orientation::Trusted => return Sides::default(),
        Orientation::Outward(_) => None,
        Orientation::Inward(centre) => Some(centre),
    };
    let mut sides = Sides::default();
    for part in parts(triangles) {
        let of_part = || part.iter().map(|i| &triangles[*i]);
        let turns = room.map_or(0.0, |centre| of_part().map(|t| solid_angle(t, centre)).sum::<f64>() / SPHERE);
        let reference = triangles[part[0]][0];
        let (mut area, mut flux, mut volume) = (0.0, DVec3::ZERO, 0.0);
        for &[a, b, c] in of_part() {
            let twice = (b - a).cross(c - a);
            area += twice.length();
            flux += twice;
            volume += twice.dot(a - reference);
        }
        let (is_around, is_closed) = (turns.abs() > 0.5, flux.length() < 1e-6 * area);
        if (is_around && turns > 0.0) || (!is_around && is_closed && volume < 0.0) {
            sides.inside_out.extend(&part);
        }
        if !is_around && !is_closed {
            sides.either.resize(triangles.len(), false);
            part.iter().for_each(|i| sides.either[*i] = true);
        }
    }
    sides
}

/// Steradians of the whole sphere.
const SPHERE: f64 = 4.0 * std::f64::consts::PI;

/// Signed solid angle of a triangle seen from `eye`, positive where its back is seen (outward winding, from inside).
/// Van Oosterom and Strackee, "The Solid Angle of a Plane Triangle" (1983).
fn solid_angle(triangle: &[DVec3; 3], eye: DVec3) -> f64 {
    let [a, b, c] = triangle.map(|p| p - eye);
    let [la, lb, lc] = [a.length(), b.length(), c.length()];
    2.0 * a.dot(b.cross(c)).atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
}

/// The triangles of each connected part, parts ordered by their first triangle.
fn parts(triangles: &[[DVec3; 3]]) -> Vec<Vec<usize>> {
    let mut sets = Sets::new(triangles.len());
    let mut first_at: HashMap<[u64; 3], usize> = HashMap::new();
    for (i, corners) in triangles.iter().enumerate() {
        for corner in corners {
            // Adding zero makes both zeros one.
            let other = *first_at.entry((*corner + DVec3::ZERO).to_array().map(f64::to_bits)).or_insert(i);
            sets.join(i, other);
        }
    }
    let mut index = HashMap::new();
    let mut parts: Vec<Vec<usize>> = Vec::new();
    for i in 0..triangles.len() {
        let slot = *index.entry(sets.root(i)).or_insert(parts.len());
        if slot == parts.len() {
            parts.push(Vec::new());
        }
        parts[slot].push(i);
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::surface::Surface;
    use crate::scene::{proxy::Occluder, proxy::Proxy, samples};

    fn corners(surface: &Surface) -> Vec<[DVec3; 3]> {
        match Proxy::new(surface, Orientation::Trusted).unwrap().occluder {
            Occluder::Triangles(triangles) => triangles,
            Occluder::Discs(_) => unreachable!(),
        }
    }

    fn turned(triangles: &[[DVec3; 3]]) -> Vec<[DVec3; 3]> {
        triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect()
    }

    /// An object file with inverted winding would have its probes look into its inside.
    #[test]
    fn an_inverted_object_is_turned_and_a_right_one_left() {
        let right = corners(&samples::sphere(1.0, 12));
        assert!(sides(&right, Orientation::Outward(DVec3::ZERO)) == Sides::default());
        let wrong = turned(&right);
        assert_eq!(sides(&wrong, Orientation::Outward(DVec3::ZERO)).inside_out.len(), wrong.len());
        assert!(sides(&wrong, Orientation::Trusted) == Sides::default());
    }

    /// Walls must face in and furniture out, whatever the file's winding, and even with a window missing.
    #[test]
    fn walls_face_in_and_furniture_faces_out() {
        let furniture: Vec<[DVec3; 3]> =
            corners(&samples::cube()).iter().map(|t| t.map(|p| 0.2 * p + DVec3::new(0.5, 0.0, 0.0))).collect();
        let mut walls: Vec<[DVec3; 3]> = corners(&samples::cube()).iter().map(|t| t.map(|p| 3.0 * p)).collect();
        walls.truncate(walls.len() - 2);
        let n = furniture.len();
        let room = Orientation::Inward(DVec3::ZERO);
        let wrong = sides(&[furniture.clone(), walls.clone()].concat(), room).inside_out;
        assert_eq!(wrong, (n..n + walls.len()).collect::<Vec<_>>());
        let wrong = sides(&[turned(&furniture), turned(&walls)].concat(), room).inside_out;
        assert_eq!(wrong, (0..n).collect::<Vec<_>>());
    }

    /// A sheet is open: its sides cannot be distinguished, so the file's winding is kept.
    #[test]
    fn an_open_sheet_keeps_its_winding() {
        let sheet = corners(&samples::plane(1.0, 4));
        for sheet in [turned(&sheet), sheet] {
            let Sides { inside_out, either } = sides(&sheet, Orientation::Outward(DVec3::Z));
            assert!(inside_out.is_empty() && either.len() == sheet.len() && either.iter().all(|either| *either));
        }
    }
}

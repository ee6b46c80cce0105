//! Furnished rooms, and surroundings of objects, to be photographed: furniture and textures, all made by code. +Y up.
//!
//! [`rooms`](two_rooms_model) and [`furnished`](furnished_room) say where things stand; `seats`, `cabinets`, `fittings` and `things` make them of the pieces of
//! `furnisher` and `shapes`, in finishes of `palette`. Textures are named in `texture`; what they show is in `wood`, `walls`, `cloth`,
//! `print`, `paintings` and `nature`, all from the noise of `noise`.

mod cabinets;
mod cloth;
mod clutter;
mod fittings;
mod furnished;
mod furnisher;
mod nature;
mod noise;
mod paintings;
mod palette;
mod print;
mod rooms;
mod seats;
mod shapes;
mod texture;
mod things;
mod walls;
mod wood;

pub use self::clutter::Surroundings;
pub use self::furnished::{SingleRoom, furnished_room};
pub use self::rooms::two_rooms_model;

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::furnisher::{Finish, Furnisher};
    use super::texture::Texture;
    use super::*;
    use crate::scene::model::{Face, Material, Model};

    /// The corners of a triangle.
    fn corners(model: &Model, face: &Face) -> [DVec3; 3] {
        face.corners.map(|v| model.vertices[v as usize].position)
    }

    fn area(model: &Model, face: &Face) -> f64 {
        let [a, b, c] = corners(model, face);
        0.5 * (b - a).cross(c - a).length()
    }

    fn volume(model: &Model) -> f64 {
        let tetrahedron = |face: &Face| {
            let [a, b, c] = corners(model, face);
            a.cross(b).dot(c) / 6.0
        };
        model.faces.iter().map(tetrahedron).sum()
    }

    fn made(make: impl FnOnce(&mut Furnisher)) -> Model {
        let mut model = Model::default();
        make(&mut Furnisher::new(&mut model, DAffine3::IDENTITY));
        model
    }

    /// Whether every edge is that of two triangles, in opposite directions, by the positions of its ends.
    fn is_closed(model: &Model) -> bool {
        let key = |v: u32| model.vertices[v as usize].position.to_array().map(|x| (1e7 * x).round() as i64);
        let mut edges = std::collections::BTreeMap::new();
        for face in &model.faces {
            for k in 0..3 {
                let (a, b) = (key(face.corners[k]), key(face.corners[(k + 1) % 3]));
                *edges.entry((a.min(b), a.max(b))).or_insert(0) += if a < b { 1 } else { -1 };
            }
        }
        edges.values().all(|sum| *sum == 0)
    }

    /// If this failed, pieces would be seen from inside, have holes, or be larger than they were asked for.
    #[test]
    fn solids_are_closed_and_face_out() {
        let paint = Finish::of(Texture::Paint);
        let outline = [[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]];
        let prism = 64.0 / 2.0 * (std::f64::consts::TAU / 64.0).sin() * 2.0;
        let cases = [
            (made(|add| add.block(DVec3::new(1.0, 0.0, 3.0), DVec3::new(0.0, 2.0, 0.0), paint)), 6.0),
            (made(|add| add.turned(&outline, 64, paint)), prism),
            (made(|add| add.rod(DVec3::ZERO, DVec3::new(0.0, 1.2, 1.6), 1.0, 64, paint)), prism),
            (made(|add| add.ball(DVec3::ONE, 1.0, 64, paint)), 4.18),
            (made(|add| add.cushion(DVec3::ZERO, DVec3::splat(2.0), [0.01, 0.0], 6, paint)), 8.0),
        ];
        for (i, (model, expected)) in cases.iter().enumerate() {
            assert!((volume(model) / expected - 1.0).abs() < 0.01, "solid {i}: {} for {expected}", volume(model));
            assert!(is_closed(model), "solid {i} has holes");
        }
        let pillow = made(|add| add.pillow(DVec3::new(0.3, 0.2, 0.1), 8, paint));
        assert!(is_closed(&pillow) && (0.01..0.048).contains(&volume(&pillow)), "{}", volume(&pillow));
    }

    /// If this failed, smooth pieces would be shaded as if light came from behind them.
    #[test]
    fn normals_are_on_the_side_that_triangles_face() {
        let model = two_rooms_model();
        for face in &model.faces {
            let [a, b, c] = corners(&model, face);
            let own = (b - a).cross(c - a).normalize().as_vec3();
            for v in face.corners {
                let normal = model.vertices[v as usize].normal;
                assert!(
                    (normal.length() - 1.0).abs() < 1e-4 && normal.dot(own) > -0.2,
                    "{a} {b} {c}: {normal} on {own}"
                );
            }
        }
    }

    /// If this failed, something would stick out of the rooms, be seen through their walls and make them larger than they are.
    #[test]
    fn everything_is_inside_the_walls_and_rooms_face_in() {
        let model = two_rooms_model();
        let (low, high) = (DVec3::ZERO, DVec3::new(10.0, 2.6, 5.0));
        for vertex in &model.vertices {
            let p = vertex.position;
            assert!(p.cmpge(low - 1e-9).all() && p.cmple(high + 1e-9).all(), "{p} is outside");
        }
        // Most of what there is is the air that the walls face.
        assert!(volume(&model) < -90.0, "{}", volume(&model));
        // Nothing but the wall itself is between the rooms.
        let within = |x: f64| x > 6.0 + 1e-9 && x < 6.1 - 1e-9;
        assert!(!model.vertices.iter().any(|vertex| within(vertex.position.x)));
    }

    /// If this failed, cameras could not walk from one room to the other, or would find no place to look around from.
    #[test]
    fn the_way_between_the_rooms_is_free() {
        let model = two_rooms_model();
        // Around the table, through the doorway, to the bed and to the desk: boxes from above the rugs to above one's head.
        for (from, to) in [
            ([1.2, 1.3], [1.75, 3.6]),
            ([4.2, 1.6], [5.4, 3.9]),
            ([5.0, 2.2], [7.2, 2.9]),
            ([1.4, 3.6], [5.4, 4.2]),
            ([6.9, 1.75], [9.2, 2.8]),
        ] {
            let (low, high) = (DVec3::new(from[0], 0.03, from[1]), DVec3::new(to[0], 1.85, to[1]));
            for face in &model.faces {
                let triangle = corners(&model, face);
                let (min, max) = (
                    triangle.iter().fold(DVec3::MAX, |m, p| m.min(*p)),
                    triangle.iter().fold(DVec3::MIN, |m, p| m.max(*p)),
                );
                assert!(min.cmpge(high).any() || max.cmple(low).any(), "{min} to {max} is in the way");
            }
        }
    }

    /// If this failed, photographs would be full of noise from small lamps, or take long.
    #[test]
    fn lamps_are_few_and_large() {
        let model = two_rooms_model();
        let shining: Vec<&Face> =
            model.faces.iter().filter(|face| model.materials[face.material as usize].shines()).collect();
        assert!((20..=60).contains(&shining.len()), "{} triangles shine", shining.len());
        assert!(model.lamps.is_empty());
        for face in shining {
            let [a, b, c] = corners(&model, face);
            let longest = (b - a).length().max((c - b).length()).max((a - c).length());
            assert!(area(&model, face) > 5e-3 && longest > 0.19, "a lamp of {} m² at {a}", area(&model, face));
        }
    }

    /// If this failed, the scene would be larger than what planners and tracers are quick with, or be made of flat colours.
    #[test]
    fn the_scene_is_of_a_sensible_size() {
        let model = two_rooms_model();
        assert!((15_000..=25_000).contains(&model.faces.len()), "{} triangles", model.faces.len());
        let texels: usize = model.images.iter().map(|image| image.pixels.len()).sum();
        assert!(texels <= 6_000_000, "{texels} texels");
        assert!(model.faces.iter().all(|face| area(&model, face) > 1e-9));
        let mapped = |material: &Material| material.base_map.or(material.emission_map).is_some();
        assert!(model.materials.iter().all(mapped));
        assert_eq!(model, two_rooms_model());
    }

    /// If this failed, a box among which an object is photographed would reach beyond the volume that cameras keep out of, hide less than it
    /// did, or be the same as all others.
    #[test]
    fn things_fill_their_boxes() {
        let (min, max) = (DVec3::new(1.0, -0.5, 2.0), DVec3::new(2.0, 1.1, 3.0));
        for number in 0..6 {
            let mut model = Model::default();
            Surroundings::new(&mut model, 1.3).thing(min, max, number);
            let (low, high) = model
                .vertices
                .iter()
                .fold((DVec3::MAX, DVec3::MIN), |(lo, hi), vertex| (lo.min(vertex.position), hi.max(vertex.position)));
            assert!(low.cmpge(min - 1e-9).all() && high.cmple(max + 1e-9).all(), "{number}: {low} to {high}");
            assert!((low - min).length() < 0.02 && (high - max).length() < 0.02, "{number}: {low} to {high}");
            assert!((12..1500).contains(&model.faces.len()) && !model.images.is_empty());
            assert!(volume(&model) > 0.6 * (max - min).element_product(), "{number}: {}", volume(&model));
        }
    }
}

//! Demo scenes and fixtures made by our own code: z up, metres, colours per triangle.

mod parts;
mod photographed;
pub mod textured;

use std::f64::consts::TAU;

use glam::DVec3;

use self::parts::{Finish, Parts, Stuff};
pub use self::photographed::{object_model, studio};
use super::surface::Surface;

const STEEL: Finish = Finish { colour: [196, 202, 208], stuff: Stuff::Metal, score: 2.0 };
const BRASS: Finish = Finish { colour: [204, 164, 78], stuff: Stuff::Metal, score: 1.8 };
const GLAZE: Finish = Finish { colour: [40, 92, 148], stuff: Stuff::Glazed, score: 1.5 };
const CLAY: Finish = Finish::matt([176, 96, 62]);
const CHALK: Finish = Finish::matt([226, 222, 212]);
const SLATE: Finish = Finish::matt([74, 82, 92]);
const LEAF: Finish = Finish::matt([88, 132, 70]);

/// An object of about unit size whose parts hide one another: on a disc are a pedestal with a steel sphere inside a
/// tilted ring, six fins, and three small spheres between the fins. Scores are above 1 where it shines.
pub fn object() -> Surface {
    object_parts().surface()
}

fn object_parts() -> Parts {
    let mut parts = Parts::default();
    parts.cylinder(DVec3::new(0.0, 0.0, -0.45), 0.5, 0.06, 96, CHALK);
    parts.cylinder(DVec3::new(0.0, 0.0, -0.39), 0.12, 0.35, 48, CLAY);
    parts.sphere(DVec3::new(0.0, 0.0, 0.12), 0.17, 64, STEEL);
    parts.torus(DVec3::new(0.0, 0.0, 0.12), DVec3::new(0.5, 0.0, 0.866), 0.31, 0.05, [96, 24], BRASS);
    for i in 0..6 {
        let (sin, cos) = (TAU * f64::from(i) / 6.0).sin_cos();
        let out = DVec3::new(cos, sin, 0.0);
        let finish = if i % 2 == 0 { SLATE } else { LEAF };
        parts.block(
            0.32 * out + DVec3::new(0.0, 0.0, -0.24),
            [0.13 * out, 0.012 * DVec3::Z.cross(out), 0.15 * DVec3::Z],
            6,
            finish,
        );
        if i % 2 == 0 {
            let (sin, cos) = (TAU * (f64::from(i) + 0.5) / 6.0).sin_cos();
            parts.sphere(DVec3::new(0.3 * cos, 0.3 * sin, -0.32), 0.07, 32, GLAZE);
        }
    }
    parts
}

/// A furnished room, 6 x 4 x 2.8 m, one corner at the origin: walls that face in with two windows, a door and a
/// picture as colours, a table with four chairs, a shelf with boxes, a sofa with cushions, a floor lamp.
pub fn room() -> Surface {
    let mut parts = Parts::default();
    parts.room(DVec3::new(6.0, 4.0, 2.8), 0.2, wall_colour);

    let wood = Finish::matt([150, 104, 62]);
    let dark = Finish::matt([92, 62, 40]);
    table(&mut parts, DVec3::new(3.9, 1.6, 0.0), DVec3::new(0.8, 0.45, 0.74), wood);
    for (x, y, back) in [(3.5, 0.85, -1.0), (4.3, 0.85, -1.0), (3.5, 2.35, 1.0), (4.3, 2.35, 1.0)] {
        chair(&mut parts, DVec3::new(x, y, 0.0), back, dark);
    }
    parts.cylinder(DVec3::new(3.7, 1.6, 0.74), 0.06, 0.22, 32, GLAZE);
    parts.sphere(DVec3::new(4.2, 1.6, 0.84), 0.1, 32, STEEL);
    shelf(&mut parts, DVec3::new(0.2, 2.2, 0.0), wood);
    sofa(&mut parts, DVec3::new(1.6, 0.5, 0.0));
    parts.cylinder(DVec3::new(0.4, 0.5, 0.0), 0.16, 0.03, 32, SLATE);
    parts.cylinder(DVec3::new(0.4, 0.5, 0.03), 0.015, 1.4, 16, BRASS);
    parts.sphere(DVec3::new(0.4, 0.5, 1.58), 0.17, 32, Finish::matt([250, 236, 196]));
    parts.surface()
}

/// What is painted on the inside of the room, at point `p` of the wall with inward normal `n`.
fn wall_colour(p: DVec3, n: DVec3) -> [u8; 3] {
    let within = |v: f64, lo: f64, hi: f64| (lo..hi).contains(&v);
    let window = n.y < -0.5 && within(p.z, 0.9, 2.2) && (within(p.x, 0.9, 2.4) || within(p.x, 3.6, 5.1));
    let door = n.x < -0.5 && within(p.y, 2.6, 3.5) && p.z < 2.05;
    let picture = n.y > 0.5 && within(p.x, 3.0, 4.4) && within(p.z, 1.2, 2.1);
    let plank = 16 * ((p.x / 0.2).floor() as i64).rem_euclid(3) as u8;
    match () {
        () if window => [186, 216, 240],
        () if door => [120, 84, 58],
        () if picture && ((p.x / 0.2).floor() + (p.z / 0.2).floor()) % 2.0 == 0.0 => [176, 52, 44],
        () if picture => [38, 56, 110],
        () if n.z > 0.5 => [148 + plank, 112 + plank, 80 + plank],
        () if n.z < -0.5 => [240, 240, 236],
        () if n.x > 0.5 => [168, 186, 172],
        () => [222, 214, 198],
    }
}

/// A table top of half extents `half` (x, y) at height `half.z` on four legs; `at` is the middle of its footprint.
fn table(parts: &mut Parts, at: DVec3, half: DVec3, finish: Finish) {
    parts.aligned(at + DVec3::Z * (half.z - 0.02), DVec3::new(half.x, half.y, 0.02), 4, finish);
    for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        let foot = at + DVec3::new(sx * (half.x - 0.05), sy * (half.y - 0.05), 0.0);
        parts.cylinder(foot, 0.03, half.z - 0.04, 8, finish);
    }
}

/// A chair whose back is on the side `back` (-1 or 1) along y.
fn chair(parts: &mut Parts, at: DVec3, back: f64, finish: Finish) {
    table(parts, at, DVec3::new(0.21, 0.21, 0.45), finish);
    parts.aligned(at + DVec3::new(0.0, back * 0.19, 0.68), DVec3::new(0.2, 0.02, 0.22), 3, finish);
}

/// An open shelf along x = 0 with boxes of many colours on its boards; `at` is the middle of its footprint.
fn shelf(parts: &mut Parts, at: DVec3, finish: Finish) {
    for side in [-0.78, 0.78] {
        parts.aligned(at + DVec3::new(0.0, side, 0.9), DVec3::new(0.17, 0.02, 0.9), 3, finish);
    }
    for level in 0..5 {
        let board = at + DVec3::Z * (0.05 + 0.42 * f64::from(level));
        parts.aligned(board, DVec3::new(0.17, 0.755, 0.015), 3, finish);
        if level == 4 {
            continue;
        }
        for slot in 0..5 {
            let pick = (level * 5 + slot) as usize;
            let height = [0.12, 0.16, 0.09, 0.14][pick % 4];
            let colour = [
                [188, 70, 60],
                [70, 120, 90],
                [214, 176, 84],
                [78, 96, 150],
                [200, 196, 188],
                [120, 78, 120],
                [60, 60, 64],
            ][pick % 7];
            let centre = board + DVec3::new(0.0, -0.6 + 0.3 * f64::from(slot), 0.016 + height);
            parts.aligned(centre, DVec3::new(0.11, 0.1, height), 2, Finish::matt(colour));
        }
    }
}

/// A sofa with its back to the wall y = 0; `at` is the middle of its footprint.
fn sofa(parts: &mut Parts, at: DVec3) {
    let cloth = Finish::matt([96, 112, 132]);
    let cushion = Finish::matt([206, 148, 92]);
    parts.aligned(at + DVec3::Z * 0.2, DVec3::new(0.9, 0.4, 0.2), 4, cloth);
    parts.aligned(at + DVec3::new(0.0, -0.32, 0.63), DVec3::new(0.9, 0.08, 0.225), 4, cloth);
    for side in [-0.98, 0.98] {
        parts.aligned(at + DVec3::new(side, 0.0, 0.3), DVec3::new(0.075, 0.4, 0.3), 4, cloth);
    }
    for side in [-0.45, 0.45] {
        parts.sphere(at + DVec3::new(side, -0.12, 0.53), 0.12, 24, cushion);
    }
}

/// A sphere around the origin with `segments` meridians and half as many parallels.
pub fn sphere(radius: f64, segments: u32) -> Surface {
    let mut parts = Parts::default();
    parts.sphere(DVec3::ZERO, radius, segments, CHALK);
    parts.surface()
}

/// The unit cube around the origin, two triangles a side.
pub fn cube() -> Surface {
    let mut parts = Parts::default();
    parts.aligned(DVec3::ZERO, DVec3::splat(0.5), 1, CHALK);
    parts.surface()
}

/// A square in the plane z = 0 around the origin, facing up: sides of length `side`, cut into `cells` x `cells`.
pub fn plane(side: f64, cells: u32) -> Surface {
    let mut parts = Parts::default();
    let half = 0.5 * side;
    parts.sheet(DVec3::new(-half, -half, 0.0), [DVec3::X * side, DVec3::Y * side], [cells; 2], |_| CHALK);
    parts.surface()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::proxy::{Occluder, Orientation, Proxy};
    use crate::scene::similarity::Similarity;
    use crate::visibility::bvh::Bvh;
    use crate::visibility::raycast::Ray;

    fn mesh(surface: &Surface) -> &crate::scene::surface::Mesh {
        match surface {
            Surface::Mesh(mesh) => mesh,
            Surface::Points(_) => unreachable!(),
        }
    }

    /// Demos must run in seconds, and pass all of our checks.
    #[test]
    fn demo_scenes_are_of_a_sensible_size_and_whole() {
        for scene in [object(), room()] {
            let mesh = mesh(&scene);
            assert!((5_000..=20_000).contains(&mesh.triangles.len()), "{} triangles", mesh.triangles.len());
            assert_eq!((mesh.colours.len(), mesh.scores.len()), (mesh.triangles.len(), mesh.positions.len()));
            assert!(mesh.scores.iter().all(|s| (1.0..=2.0).contains(s)) && mesh.scores.contains(&2.0));
            assert_eq!(Proxy::new(&scene, Orientation::Trusted).unwrap().dropped, 0);
        }
        let proxy = Proxy::new(&object(), Orientation::Trusted).unwrap();
        assert!((0.5..0.7).contains(&proxy.sphere.1), "radius {}", proxy.sphere.1);
        let (min, max) = Proxy::new(&room(), Orientation::Trusted).unwrap().bounds();
        assert!(min.length() < 1e-9 && (max - DVec3::new(6.0, 4.0, 2.8)).length() < 1e-9);
    }

    /// A part with its winding inverted would be a hole in every image of the demo.
    #[test]
    fn every_part_faces_the_right_way() {
        let volume = |surface: &Surface| {
            let mesh = mesh(surface);
            let corner = |v: u32| mesh.positions[v as usize];
            mesh.triangles.iter().map(|[a, b, c]| corner(*a).dot(corner(*b).cross(corner(*c))) / 6.0).sum::<f64>()
        };
        assert!((volume(&cube()) - 1.0).abs() < 1e-12);
        let ball = 4.0 / 3.0 * std::f64::consts::PI;
        assert!((volume(&sphere(1.0, 64)) / ball - 1.0).abs() < 0.01);
        for (scene, orientation) in
            [(object(), Orientation::Outward(DVec3::ZERO)), (room(), Orientation::Inward(DVec3::new(2.5, 2.5, 1.5)))]
        {
            let trusted = Proxy::new(&scene, Orientation::Trusted).unwrap();
            assert_eq!(trusted.occluder, Proxy::new(&scene, orientation).unwrap().occluder);
        }
    }

    /// The object is a demo of occlusion: a good part of its surface must be hidden from any one direction, while facing
    /// it.
    #[test]
    fn parts_of_the_object_hide_one_another() {
        let proxy = Proxy::new(&object(), Orientation::Trusted).unwrap();
        let bvh = Bvh::new(&proxy.occluder, &Similarity::IDENTITY).unwrap();
        let (mut facing, mut hidden) = (0, 0);
        for direction in [DVec3::X, DVec3::Y, DVec3::new(0.6, 0.0, 0.8)] {
            for p in proxy.sample(2000, 0, 0).iter().filter(|p| p.normal.dot(direction) > 0.0) {
                facing += 1;
                let origin = (p.position + p.lift * p.normal).as_vec3();
                let ray = Ray { origin, direction: direction.as_vec3(), t_min: 0.0, t_max: f32::MAX };
                hidden += u32::from(bvh.any_hit(&ray));
            }
        }
        let fraction = f64::from(hidden) / f64::from(facing);
        assert!((0.1..0.6).contains(&fraction), "{fraction} of what faces a view is hidden");
    }

    /// A plane that faces down, or off its place, would break every test that uses it.
    #[test]
    fn the_plane_faces_up() {
        let proxy = Proxy::new(&plane(2.0, 3), Orientation::Trusted).unwrap();
        let Occluder::Triangles(triangles) = &proxy.occluder else { unreachable!() };
        assert_eq!(triangles.len(), 18);
        assert!(proxy.sample(50, 0, 0).iter().all(|p| p.normal == DVec3::Z));
        assert_eq!(proxy.bounds(), (DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, 1.0, 0.0)));
    }
}

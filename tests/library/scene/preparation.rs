//! The CPU side of scene preparation as a whole: surface to proxy, hierarchy, free space and baselines.

use camsplat::scene::free_space::{FreeSpace, RESOLUTION};
use camsplat::scene::layouts;
use camsplat::scene::proxy::{Orientation, Proxy, SurfacePoint};
use camsplat::scene::random;
use camsplat::scene::region::{Region, Shape};
use camsplat::scene::samples;
use camsplat::scene::similarity::Similarity;
use camsplat::scene::surface::{Mesh, Points, Surface};
use camsplat::visibility::bvh::Bvh;
use camsplat::visibility::raycast::Ray;
use glam::{DQuat, DVec3};

fn mesh(surface: Surface) -> Mesh {
    match surface {
        Surface::Mesh(mesh) => mesh,
        Surface::Points(_) => unreachable!(),
    }
}

/// The points of a mesh as a cloud without normals or radii, as a sparse model has them.
fn cloud_of(proxy: &Proxy, count: usize) -> Surface {
    let positions = proxy.sample(count, 42, 0).iter().map(|p| p.position).collect();
    Surface::Points(Points { positions, ..Points::default() })
}

fn open_sky(bvh: &Bvh, p: &SurfacePoint, direction: DVec3) -> bool {
    let origin = (p.position + p.lift * p.normal).as_vec3();
    !bvh.any_hit(&Ray { origin, direction: direction.as_vec3(), t_min: 0.0, t_max: f32::MAX })
}

/// A cloud without normals must block nearly what the mesh it was taken from blocks: holes between the discs, or discs
/// that are too large, would show up here.
#[test]
fn discs_of_a_cloud_block_what_the_mesh_blocks() {
    let mut ball = mesh(samples::sphere(1.0, 64));
    let alone = Proxy::new(&Surface::Mesh(ball.clone()), Orientation::Trusted).unwrap();
    let shade = mesh(samples::plane(1.2, 16));
    let base = ball.positions.len() as u32;
    ball.positions.extend(shade.positions.iter().map(|p| *p + 1.5 * DVec3::Z));
    ball.triangles.extend(shade.triangles.iter().map(|t| t.map(|v| v + base)));
    ball.colours.clear();
    ball.scores.clear();
    let shaded = Proxy::new(&Surface::Mesh(ball), Orientation::Trusted).unwrap();
    let discs = Proxy::new(&cloud_of(&shaded, 20_000), Orientation::Outward(DVec3::ZERO)).unwrap();
    let truth = Bvh::new(&shaded.occluder, &Similarity::IDENTITY).unwrap();
    let found = Bvh::new(&discs.occluder, &Similarity::IDENTITY).unwrap();
    let (mut same, mut all, mut blocked) = (0, 0, 0);
    for (i, p) in alone.sample(3000, 1, 1).into_iter().enumerate() {
        let [u, v, ..] = random::uniforms(7, 0, i as u32);
        let direction = random::direction(u, v);
        if direction.dot(p.normal) > 0.2 {
            let lifted = SurfacePoint { lift: 0.03, ..p };
            let open = open_sky(&truth, &lifted, direction);
            all += 1;
            blocked += u32::from(!open);
            same += u32::from(open == open_sky(&found, &lifted, direction));
        }
    }
    assert!(blocked > 30, "only {blocked} rays are blocked: the test tests little");
    assert!(f64::from(same) > 0.97 * f64::from(all), "{same} of {all} rays agree");
}

/// Discs overlap at slightly different tilts: with too small a lift a point would be blocked by its neighbours, and
/// with too large a one it would look through walls.
#[test]
fn points_of_a_cloud_see_out_but_not_through() {
    let ball = Proxy::new(&samples::sphere(1.0, 64), Orientation::Trusted).unwrap();
    let cloud = Proxy::new(&cloud_of(&ball, 20_000), Orientation::Outward(DVec3::ZERO)).unwrap();
    let bvh = Bvh::new(&cloud.occluder, &Similarity::IDENTITY).unwrap();
    let points = cloud.sample(1000, 3, 0);
    let see = |sign: f64| points.iter().filter(|p| open_sky(&bvh, p, sign * p.position.normalize())).count();
    assert!(see(1.0) > 990, "{} of 1000 points see straight out", see(1.0));
    assert!(see(-1.0) < 5, "{} of 1000 points see through the ball", see(-1.0));
}

/// A scene scaled, moved and rotated must give the same samples, scaled, moved and rotated: plans depend on it.
#[test]
fn samples_move_with_the_scene() {
    let rotation = DQuat::from_rotation_x(0.8);
    let map = Similarity { rotation, scale: 250.0, translation: DVec3::new(40.0, -7.0, 900.0) };
    let original = mesh(samples::object());
    let mut moved = original.clone();
    moved.positions.iter_mut().for_each(|p| *p = map.point(*p));
    let here = Proxy::new(&Surface::Mesh(original), Orientation::Trusted).unwrap();
    let there = Proxy::new(&Surface::Mesh(moved), Orientation::Trusted).unwrap();
    for (a, b) in here.sample(500, 1, 0).iter().zip(there.sample(500, 1, 0)) {
        assert!(map.point(a.position).distance(b.position) < 1e-6 * map.scale);
        assert!(map.direction(a.normal).distance(b.normal) < 1e-6);
        assert!((map.length(a.lift) - b.lift).abs() < 1e-6 * b.lift && a.colour == b.colour);
    }
}

/// Cameras of the room's default region are in the room, clear of its furniture and walls.
#[test]
fn the_room_has_free_space_around_its_furniture() {
    let proxy = Proxy::new(&samples::room(), Orientation::Trusted).unwrap();
    let region = Region::inside_room(proxy.robust_bounds(), None, DVec3::Z).unwrap();
    let space = FreeSpace::new(&proxy.occluder, &region, RESOLUTION).unwrap();
    assert!((0.6..0.98).contains(&space.free_fraction), "{} of the room is free", space.free_fraction);
    assert!(space.is_free(DVec3::new(2.5, 2.0, 1.7)));
    for inside in [DVec3::new(1.6, 0.5, 0.2), DVec3::new(3.9, 1.6, 0.73), DVec3::new(0.4, 0.5, 1.58)] {
        assert!(!space.is_free(inside), "{inside} is inside furniture");
    }
    let bvh = Bvh::new(&proxy.occluder, &Similarity::IDENTITY).unwrap();
    for pose in layouts::random(&space, 200, 5, false) {
        let (origin, direction) = (pose.position.as_vec3(), pose.forward().as_vec3());
        let hit = bvh.closest_hit(&Ray { origin, direction, t_min: 0.0, t_max: f32::MAX }).expect("a room is closed");
        assert!(f64::from(hit.distance) > region.clearance - 3f64.sqrt() * space.grid.cell);
    }
}

/// The object's default shell is all free, and both baselines are in it, looking in, once mapped back to the world.
#[test]
fn controls_of_the_object_stand_in_its_shell() {
    let proxy = Proxy::new(&samples::object(), Orientation::Trusted).unwrap();
    let region = Region::around_object(proxy.sphere, 0.35, DVec3::Z, None).unwrap();
    let Shape::Shell { centre, r_min, r_max } = region.shape else { unreachable!() };
    let there = Similarity::to_unit_sphere(centre, r_max);
    let internal = region.transformed(&there).unwrap();
    let space = FreeSpace::new(&proxy.occluder.transformed(&there), &internal, 64).unwrap();
    assert_eq!(space.free_fraction, 1.0);
    let back = there.inverse();
    let baselines = [layouts::random(&space, 50, 1, true), layouts::fibonacci_shell(&internal, 50).unwrap()];
    for pose in baselines.iter().flatten().map(|pose| back.pose(pose)) {
        let distance = pose.position.distance(centre);
        assert!(distance > r_min - 1e-9 && distance < r_max + 1e-9);
        assert!(pose.forward().dot((centre - pose.position).normalize()) > 1.0 - 1e-6);
    }
}

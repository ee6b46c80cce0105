//! Rays through the hierarchy: the CPU twin of the device's traversal, with the same formulas in the same precision.

use glam::{Vec3, Vec4};

use super::bvh::{Bvh, COUNT_SHIFT, Disc, LEAF, Node, Primitives, STACK, Triangle, WIDTH};
use crate::engine::vulkan::shaders::glsl::shared::bvh as glsl;

/// A ray in the normalised frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Hits closer than this do not count.
    pub t_min: f32,
    /// Hits farther than this do not count.
    pub t_max: f32,
}

/// The closest hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray.
    pub distance: f32,
    /// Index of the primitive in the occluder.
    pub primitive: u32,
}

/// Distance at which a ray enters a box that it misses, and to what a ray does not hit.
pub(super) const MISS: f32 = glsl::MISS as f32;
/// Direction components smaller than this count as this: a slab test without division by zero.
const MIN_SLOPE: f32 = 1e-12;
/// Far ends of slabs are widened by this factor, so that rounding cannot lose a box: 1 + 2 gamma(3), Ize, "Robust BVH Ray
/// Traversal" (2013).
const WIDER: f32 = 1.000_000_4;
/// Barycentric coordinates may be this much outside a triangle, so that no ray slips between two.
const EDGE: f32 = 1e-6;

impl Bvh {
    /// The closest hit of `ray`. Both sides of every primitive block.
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let mut best = None;
        let mut ray = *ray;
        self.visit(ray, |slot| {
            if let Some((distance, primitive)) = self.intersect(slot, &ray) {
                // Distances never grow; of equals the one met last stays, on the device as well.
                ray.t_max = distance;
                best = Some(Hit { distance, primitive });
            }
            Some(ray.t_max)
        });
        best
    }

    /// Whether anything blocks `ray`.
    pub fn any_hit(&self, ray: &Ray) -> bool {
        let mut blocked = false;
        self.visit(*ray, |slot| {
            blocked = self.intersect(slot, ray).is_some();
            (!blocked).then_some(ray.t_max)
        });
        blocked
    }

    /// Calls `test` with the slot of every primitive whose box the ray may meet, nearer boxes first. `test` returns how
    /// far the ray still reaches, or `None` to stop.
    fn visit(&self, ray: Ray, mut test: impl FnMut(u32) -> Option<f32>) {
        let inverse = ray.direction.map(inverse_slope);
        let mut t_max = ray.t_max;
        let mut stack = [0u32; STACK as usize];
        let mut size = 0;
        let mut child = 0;
        loop {
            if child & LEAF != 0 {
                let first = child & ((1 << COUNT_SHIFT) - 1);
                let count = (child ^ LEAF) >> COUNT_SHIFT;
                for slot in first..first + count {
                    match test(slot) {
                        Some(reach) => t_max = reach,
                        None => return,
                    }
                }
            } else {
                let (children, entered) = children_entered(&self.nodes[child as usize], &ray, inverse, t_max);
                for waits in (1..entered).rev() {
                    stack[size] = children[waits];
                    size += 1;
                }
                if entered > 0 {
                    child = children[0];
                    continue;
                }
            }
            if size == 0 {
                return;
            }
            size -= 1;
            child = stack[size];
        }
    }

    /// Distance to, and index of, the primitive in `slot`, where the ray hits it.
    fn intersect(&self, slot: u32, ray: &Ray) -> Option<(f32, u32)> {
        match &self.primitives {
            Primitives::Triangles(triangles) => {
                let triangle = &triangles[slot as usize];
                intersect_triangle(triangle, ray).map(|t| (t, triangle.index))
            }
            Primitives::Discs(discs) => {
                let disc = &discs[slot as usize];
                intersect_disc(disc, ray).map(|t| (t, disc.index))
            }
        }
    }
}

/// One over a direction's component, finite.
pub(super) fn inverse_slope(slope: f32) -> f32 {
    let least = if slope < 0.0 { -MIN_SLOPE } else { MIN_SLOPE };
    1.0 / if slope.abs() < MIN_SLOPE { least } else { slope }
}

/// The children of a node that a ray enters, nearest first, and how many they are.
fn children_entered(node: &Node, ray: &Ray, inverse: Vec3, t_max: f32) -> ([u32; WIDTH], usize) {
    let slabs = |lo: [f32; WIDTH], hi: [f32; WIDTH], axis: usize| {
        let t = |side: [f32; WIDTH]| (Vec4::from(side) - ray.origin[axis]) * inverse[axis];
        let (a, b) = (t(lo), t(hi));
        (a.min(b), a.max(b))
    };
    let x = slabs(node.lo_x, node.hi_x, 0);
    let y = slabs(node.lo_y, node.hi_y, 1);
    let z = slabs(node.lo_z, node.hi_z, 2);
    let enter = x.0.max(y.0).max(z.0).max(Vec4::splat(ray.t_min));
    let leave = (x.1.min(y.1).min(z.1) * WIDER).min(Vec4::splat(t_max));
    let hit = enter.cmple(leave);
    let mut order = Vec4::select(hit, enter, Vec4::splat(f32::INFINITY)).to_array();
    let mut children = node.children;
    for (i, j) in [(0, 1), (2, 3), (0, 2), (1, 3), (1, 2)] {
        if order[j] < order[i] {
            order.swap(i, j);
            children.swap(i, j);
        }
    }
    (children, hit.bitmask().count_ones() as usize)
}

/// Distance to a triangle from either side: Moeller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection" (1997).
fn intersect_triangle(triangle: &Triangle, ray: &Ray) -> Option<f32> {
    let (e1, e2) = (Vec3::from(triangle.e1), Vec3::from(triangle.e2));
    let p = ray.direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = ray.origin - Vec3::from(triangle.v0);
    let u = s.dot(p) / determinant;
    let q = s.cross(e1);
    let v = ray.direction.dot(q) / determinant;
    let t = e2.dot(q) / determinant;
    (u >= -EDGE && v >= -EDGE && u + v <= 1.0 + EDGE && t >= ray.t_min && t <= ray.t_max).then_some(t)
}

/// Distance to a disc from either side.
fn intersect_disc(disc: &Disc, ray: &Ray) -> Option<f32> {
    let normal = Vec3::from(disc.normal);
    let slope = normal.dot(ray.direction);
    if slope == 0.0 {
        return None;
    }
    let to_centre = Vec3::from(disc.centre) - ray.origin;
    let t = normal.dot(to_centre) / slope;
    let off = t * ray.direction - to_centre;
    (off.length_squared() <= disc.radius * disc.radius && t >= ray.t_min && t <= ray.t_max).then_some(t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::proxy::{self, Occluder, Orientation, Proxy};
    use crate::scene::similarity::Similarity;
    use crate::scene::{random, samples};
    use glam::DVec3;

    /// A plane that a ray meets in double precision.
    struct Candidate {
        primitive: u32,
        t: f64,
        /// How far single precision may be off in `t`: more, the more grazing the ray.
        slack: f64,
        /// How far inside the primitive the hit is, relative to its size; negative outside.
        rim: f64,
        /// How far single precision may be off in `rim`.
        rim_slack: f64,
    }

    fn candidate(occluder: &Occluder, i: usize, ray: &Ray) -> Candidate {
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let (p, n, size) = match occluder {
            Occluder::Triangles(triangles) => {
                let [a, b, c] = triangles[i];
                let n = (b - a).cross(c - a);
                let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
                (a, n, n.length() / longest)
            }
            Occluder::Discs(discs) => (discs[i].centre, discs[i].normal, discs[i].radius),
        };
        let t = n.dot(p - o) / n.dot(d);
        let x = o + t * d;
        let rim = match occluder {
            Occluder::Triangles(triangles) => {
                let [a, b, c] = triangles[i];
                let part = |p: DVec3, q: DVec3| (q - p).cross(x - p).dot(n) / n.length_squared();
                part(a, b).min(part(b, c)).min(part(c, a))
            }
            Occluder::Discs(discs) => 1.0 - x.distance(discs[i].centre) / discs[i].radius,
        };
        let scale = 1.0 + o.length() + p.length();
        // Corners and normals carry single precision's error, which a flat triangle and a grazing ray magnify.
        let slack = 4e-6 * scale / (n.normalize().dot(d).abs() * size.min(1.0));
        Candidate { primitive: i as u32, t, slack, rim, rim_slack: 1e-5 + slack / size }
    }

    /// Compares one ray with brute force over all primitives; what rounding decides may fall either way. Returns whether
    /// the ray surely hits something.
    fn agrees(bvh: &Bvh, occluder: &Occluder, ray: &Ray) -> bool {
        let (t_min, t_max) = (f64::from(ray.t_min), f64::from(ray.t_max));
        let all: Vec<Candidate> = (0..occluder.len()).map(|i| candidate(occluder, i, ray)).collect();
        let sure = all
            .iter()
            .filter(|c| c.rim > c.rim_slack && c.t > t_min + c.slack && c.t < t_max - c.slack)
            .map(|c| c.t + c.slack)
            .fold(f64::INFINITY, f64::min);
        match bvh.closest_hit(ray) {
            Some(hit) => {
                let t = f64::from(hit.distance);
                let c = &all[hit.primitive as usize];
                assert!(t >= t_min && t <= t_max && t <= sure, "{hit:?} where {sure} is the first: {ray:?}");
                assert!(c.primitive == hit.primitive && c.rim > -c.rim_slack, "{hit:?} is no hit of {ray:?}");
                assert!((c.t - t).abs() <= c.slack || !c.t.is_finite(), "{hit:?} is at {}: {ray:?}", c.t);
            }
            None => assert!(sure.is_infinite(), "missed a hit at {sure}: {ray:?}"),
        }
        assert_eq!(bvh.any_hit(ray), bvh.closest_hit(ray).is_some(), "{ray:?}");
        sure.is_finite()
    }

    fn point(seed: u64, stream: u32, index: u32) -> DVec3 {
        let [x, y, z, _] = random::uniforms(seed, stream, index);
        2.0 * DVec3::new(x, y, z) - 1.0
    }

    fn ray(seed: u64, index: u32) -> Ray {
        let [u, v, w, _] = random::uniforms(seed, 100, index);
        let (t_min, t_max) = if w < 0.5 { (0.0, f32::MAX) } else { (0.2, 0.7) };
        let direction = random::direction(u, v).as_vec3().normalize();
        Ray { origin: point(seed, 101, index).as_vec3(), direction, t_min, t_max }
    }

    fn triangles(seed: u64, n: u32, size: f64) -> Occluder {
        let corner = |i, k| point(seed, 9, i) + size * point(seed, k, i);
        Occluder::Triangles((0..n).map(|i| [0, 1, 2].map(|k| corner(i, k))).collect())
    }

    fn discs(seed: u64, n: u32, size: f64) -> Occluder {
        let disc = |i| proxy::Disc {
            centre: point(seed, 9, i),
            normal: point(seed, 0, i).normalize(),
            radius: size * (0.1 + random::uniforms(seed, 1, i)[0]),
        };
        Occluder::Discs((0..n).map(disc).collect())
    }

    /// A hit that the tree loses or invents is a camera that is wrongly thought to see, or not to see, a point.
    #[test]
    fn rays_agree_with_brute_force_on_random_scenes() {
        let mut hits = 0;
        for seed in 0..12 {
            let size = [0.05, 0.3, 1.5][seed as usize % 3];
            for occluder in [triangles(seed, 150, size), discs(seed, 150, size)] {
                let bvh = Bvh::new(&occluder, &Similarity::IDENTITY).unwrap();
                hits += (0..200).filter(|i| agrees(&bvh, &occluder, &ray(seed, *i))).count();
            }
        }
        assert!(hits > 1000, "only {hits} rays hit anything: the test tests little");
    }

    /// Fresh seeds on every run find what a fixed set never meets; a failure prints the seed.
    #[test]
    fn rays_agree_with_brute_force_on_fresh_seeds() {
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap();
        let seed = now.as_nanos() as u64;
        println!("seed {seed}");
        for occluder in [triangles(seed, 300, 0.2), discs(seed, 300, 0.2)] {
            let bvh = Bvh::new(&occluder, &Similarity::IDENTITY).unwrap();
            for i in 0..300 {
                agrees(&bvh, &occluder, &ray(seed, i));
            }
        }
    }

    /// Axis-parallel rays divide by zero in a careless slab test, and do so exactly on the boxes of axis-aligned walls.
    #[test]
    fn axis_parallel_rays_are_no_exception() {
        let proxy = Proxy::new(&samples::cube(), Orientation::Trusted).unwrap();
        let bvh = Bvh::new(&proxy.occluder, &Similarity::IDENTITY).unwrap();
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let mut direction = Vec3::ZERO;
                direction[axis] = sign;
                for (offset, expected) in [(0.1, Some(1.5)), (0.5, Some(1.5)), (0.6, None)] {
                    let mut origin = Vec3::splat(0.1);
                    origin[(axis + 1) % 3] = offset;
                    origin[axis] = -2.0 * sign;
                    let ray = Ray { origin, direction, t_min: 0.0, t_max: f32::MAX };
                    let found = bvh.closest_hit(&ray).map(|hit| hit.distance);
                    assert_eq!(found.is_some(), expected.is_some(), "{ray:?}");
                    assert!(found.zip(expected).is_none_or(|(a, b): (f32, f32)| (a - b).abs() < 1e-6));
                }
            }
        }
    }

    /// A ray within a primitive's plane has no single hit: any answer but a wrong distance will do, and never a NaN.
    #[test]
    fn rays_within_a_plane_do_not_break() {
        let triangle = Occluder::Triangles(vec![[DVec3::ZERO, DVec3::X, DVec3::Y]]);
        let disc = Occluder::Discs(vec![proxy::Disc { centre: DVec3::ZERO, normal: DVec3::Z, radius: 1.0 }]);
        for occluder in [triangle, disc] {
            let bvh = Bvh::new(&occluder, &Similarity::IDENTITY).unwrap();
            for i in 0..200 {
                let [u, v, ..] = random::uniforms(1, 0, i);
                let (s, c) = (std::f64::consts::TAU * u).sin_cos();
                let direction = DVec3::new(c, s, 0.0).as_vec3();
                let ray = Ray { origin: Vec3::new(-2.0 * v as f32, 0.3, 0.0), direction, t_min: 0.0, t_max: 10.0 };
                assert!(bvh.closest_hit(&ray).is_none_or(|hit| (0.0..=10.0).contains(&hit.distance)));
                let above = Ray { origin: ray.origin + Vec3::Z * 0.01, ..ray };
                assert_eq!(bvh.closest_hit(&above), None, "a parallel ray above hits nothing");
            }
        }
    }

    /// Neighbouring triangles share edges: a ray that slips between two sees through a closed surface.
    #[test]
    fn a_closed_surface_has_no_cracks() {
        let proxy = Proxy::new(&samples::sphere(0.8, 40), Orientation::Trusted).unwrap();
        let Occluder::Triangles(faces) = &proxy.occluder else { unreachable!() };
        let bvh = Bvh::new(&proxy.occluder, &Similarity::IDENTITY).unwrap();
        for (i, [a, b, _]) in faces.iter().enumerate() {
            let on_edge = a.lerp(*b, random::uniforms(2, 0, i as u32)[0]);
            for target in [*a, on_edge] {
                let origin = 0.1 * point(2, 1, i as u32);
                let direction = (target - origin).as_vec3().normalize();
                let ray = Ray { origin: origin.as_vec3(), direction, t_min: 0.0, t_max: f32::MAX };
                assert!(bvh.any_hit(&ray), "leaks at {target}");
            }
        }
    }

    /// Distances on a real scene, not only on confetti.
    #[test]
    fn rays_agree_with_brute_force_in_the_demo_room() {
        let proxy = Proxy::new(&samples::room(), Orientation::Trusted).unwrap();
        let there = Similarity::to_unit_sphere(proxy.sphere.0, proxy.sphere.1);
        let internal = proxy.occluder.transformed(&there);
        let bvh = Bvh::new(&proxy.occluder, &there).unwrap();
        for (i, p) in proxy.sample(60, 1, 0).iter().enumerate() {
            let [u, v, ..] = random::uniforms(1, 50, i as u32);
            let d = random::direction(u, v);
            let d = if d.dot(p.normal) < 0.0 { -d } else { d };
            let origin = there.point(p.position + p.lift * p.normal).as_vec3();
            let ray = Ray { origin, direction: d.as_vec3().normalize(), t_min: 0.0, t_max: f32::MAX };
            assert!(agrees(&bvh, &internal, &ray) || bvh.closest_hit(&ray).is_some(), "a room is closed");
        }
    }

    /// Nothing to hit and one thing to hit are ordinary scenes.
    #[test]
    fn empty_and_single_scenes_work() {
        let ray = Ray { origin: Vec3::new(0.2, 0.2, 1.0), direction: Vec3::NEG_Z, t_min: 0.0, t_max: f32::MAX };
        for empty in [Occluder::Triangles(vec![]), Occluder::Discs(vec![])] {
            let bvh = Bvh::new(&empty, &Similarity::IDENTITY).unwrap();
            assert!(bvh.closest_hit(&ray).is_none() && !bvh.any_hit(&ray));
        }
        let single = Occluder::Triangles(vec![[DVec3::ZERO, DVec3::X, DVec3::Y]]);
        let bvh = Bvh::new(&single, &Similarity::IDENTITY).unwrap();
        assert_eq!(bvh.closest_hit(&ray), Some(Hit { distance: 1.0, primitive: 0 }));
        assert_eq!(bvh.closest_hit(&Ray { t_max: 0.9, ..ray }), None);
        assert_eq!(bvh.closest_hit(&Ray { t_min: 1.1, ..ray }), None);
    }
}

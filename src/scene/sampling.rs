//! Points drawn evenly from a proxy.

use std::f64::consts::PI;

use glam::DVec3;

use super::proxy::{Disc, Occluder, Proxy, SurfacePoint};
use super::random;

/// Draw index of the offset of a systematic sample; primitives use the indices from zero.
const OFFSET: u32 = u32::MAX;

impl Proxy {
    /// `count` points, even over the surface, in random order (so that any part of them is a sample as well).
    ///
    /// Triangles: systematic sampling of the area (each triangle gets its expected number of points, give or take
    /// one) and a uniform position within. Discs: their centres, with a probability that grows with the disc's area and
    /// never exceeds one, so that they are distinct while there are enough of them; streams 2k and 2k + 1 draw from two
    /// interleaved halves of the cloud, so that they share no point while each takes at most half of it.
    pub fn sample(&self, count: usize, seed: u64, stream: u32) -> Vec<SurfacePoint> {
        let mut points = match &self.occluder {
            Occluder::Triangles(triangles) => self.sample_triangles(triangles, count, seed, stream),
            Occluder::Discs(discs) => self.sample_discs(discs, |disc| disc.radius.powi(2), count, seed, stream),
        };
        random::shuffle(&mut points, seed, stream);
        points
    }

    /// As [`Self::sample`], but of a cloud each point is as likely as any other: where structure from motion found many, it finds many again.
    pub fn sample_features(&self, count: usize, seed: u64, stream: u32) -> Vec<SurfacePoint> {
        let Occluder::Discs(discs) = &self.occluder else { return self.sample(count, seed, stream) };
        let mut points = self.sample_discs(discs, |_| 1.0, count, seed, stream);
        random::shuffle(&mut points, seed, stream);
        points
    }

    fn sample_triangles(&self, triangles: &[[DVec3; 3]], count: usize, seed: u64, stream: u32) -> Vec<SurfacePoint> {
        let twice: Vec<DVec3> = triangles.iter().map(|[a, b, c]| (b - a).cross(c - a)).collect();
        let drawn: Vec<usize> =
            (0..triangles.len()).filter(|i| !self.buried.get(*i).is_some_and(|buried| *buried)).collect();
        let area = 0.5 * drawn.iter().map(|i| twice[*i].length()).sum::<f64>();
        let radius = (area / (PI * count.max(1) as f64)).sqrt();
        let step = area / count as f64;
        let mut next = step * random::uniforms(seed, stream, OFFSET)[0];
        let mut passed = 0.0;
        let mut points = Vec::with_capacity(count);
        for &i in &drawn {
            let ([a, b, c], normal) = (triangles[i], twice[i]);
            passed += 0.5 * normal.length();
            let last = drawn.last() == Some(&i);
            // Rounding may leave the last point just beyond the sum of the areas: it belongs to the last triangle.
            while points.len() < count && (next < passed || last) {
                // At most 2^32 points have streams of their own.
                let [u, v, ..] = random::uniforms(seed, stream, points.len() as u32);
                let root = u.sqrt();
                let weights = [1.0 - root, root * (1.0 - v), root * v];
                let [sa, sb, sc] = self.scores[i].map(f64::from);
                points.push(SurfacePoint {
                    position: weights[0] * a + weights[1] * b + weights[2] * c,
                    normal: normal.normalize(),
                    radius,
                    lift: self.lift(i),
                    colour: self.colours[i],
                    score: (weights[0] * sa + weights[1] * sb + weights[2] * sc) as f32,
                    either_side: self.either_side.get(i).is_some_and(|either| *either),
                });
                next += step;
            }
        }
        points
    }

    /// Centres of discs, each with a probability by its weight.
    fn sample_discs(
        &self,
        discs: &[Disc],
        weight: impl Fn(&Disc) -> f64,
        count: usize,
        seed: u64,
        stream: u32,
    ) -> Vec<SurfacePoint> {
        // The discs lie along a space-filling curve, so every other one is an even half of the cloud.
        let [offset_word, flip, ..] = random::bits(seed, stream / 2, OFFSET);
        let offset = f64::from(random::uniform(offset_word));
        let parity = (flip ^ stream) as usize & 1;
        let (own, other): (Vec<usize>, Vec<usize>) =
            (0..discs.len()).filter(|i| !self.buried.get(*i).is_some_and(|b| *b)).partition(|i| i & 1 == parity);
        let mut chosen = Vec::with_capacity(count);
        for half in [own, other].iter().cycle() {
            let wanted = (count - chosen.len()).min(half.len());
            let weights: Vec<f64> = half.iter().map(|i| weight(&discs[*i])).collect();
            chosen.extend(systematic(&weights, wanted, offset).into_iter().map(|i| half[i]));
            if chosen.len() == count || discs.is_empty() {
                break;
            }
        }
        let point = |i: usize| SurfacePoint {
            position: discs[i].centre,
            normal: discs[i].normal,
            radius: discs[i].radius,
            lift: self.lift(i),
            colour: self.colours[i],
            score: self.scores[i][0],
            either_side: false,
        };
        chosen.into_iter().map(point).collect()
    }
}

/// `count` distinct indices, each included with a probability proportional to its weight, but at most one: systematic
/// sampling with unequal probabilities. `count` is at most the number of weights, which are positive; `offset` in [0, 1).
fn systematic(weights: &[f64], count: usize, offset: f64) -> Vec<usize> {
    if count == weights.len() {
        return (0..count).collect();
    }
    // Raise the common factor until the capped probabilities sum to `count`: each pass caps at least one more.
    let (mut certain, mut factor) = (0, 0.0);
    while certain < count {
        let open: f64 = weights.iter().filter(|w| factor * **w < 1.0).sum();
        let next = (count - certain) as f64 / open;
        let now_certain = weights.iter().filter(|w| next * **w >= 1.0).count();
        factor = next;
        if now_certain <= certain {
            break;
        }
        certain = now_certain;
    }
    // Away from both ends, so that rounding in the sum cannot lose or add a point.
    let mut level = 0.001 + 0.998 * offset;
    let mut chosen = Vec::with_capacity(count);
    for (i, weight) in weights.iter().enumerate() {
        level += (factor * weight).min(1.0);
        if level >= (chosen.len() + 1) as f64 {
            chosen.push(i);
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::proxy::Orientation;
    use crate::scene::samples;
    use crate::scene::surface::{Mesh, Points, Surface};
    use std::collections::HashSet;

    fn cloud(n: u32) -> Proxy {
        let positions = (0..n)
            .map(|i| {
                let [u, v, ..] = random::uniforms(4, 0, i);
                random::direction(u, v)
            })
            .collect();
        Proxy::new(&Surface::Points(Points { positions, ..Points::default() }), Orientation::Trusted).unwrap()
    }

    fn keys(points: &[SurfacePoint]) -> HashSet<[u64; 3]> {
        points.iter().map(|p| p.position.to_array().map(f64::to_bits)).collect()
    }

    /// Points that crowd on small triangles would weight the plan toward finely meshed parts.
    #[test]
    fn triangles_are_sampled_by_area() {
        let positions = vec![
            DVec3::ZERO,
            DVec3::X,
            DVec3::Y,
            DVec3::new(9.0, 0.0, 1.0),
            DVec3::new(12.0, 0.0, 1.0),
            DVec3::new(9.0, 1.0, 1.0),
        ];
        let mesh = Mesh { positions, triangles: vec![[0, 1, 2], [3, 4, 5]], ..Mesh::default() };
        let proxy = Proxy::new(&Surface::Mesh(mesh), Orientation::Trusted).unwrap();
        for seed in 0..10 {
            let points = proxy.sample(400, seed, 0);
            let small = points.iter().filter(|p| p.position.z < 0.5).count();
            assert!((99..=101).contains(&small), "{small} of 400 on a quarter of the area");
            assert!(points.iter().all(|p| p.normal == DVec3::Z));
        }
        let mean =
            proxy.sample(4000, 1, 0).iter().filter(|p| p.position.z < 0.5).map(|p| p.position).sum::<DVec3>() / 1000.0;
        assert!((mean - DVec3::new(1.0 / 3.0, 1.0 / 3.0, 0.0)).length() < 0.02, "centroid {mean}");
    }

    /// A point off the surface, a bent normal or a lost colour would show up in every later stage.
    #[test]
    fn sampled_points_lie_on_the_surface_with_its_attributes() {
        let proxy = Proxy::new(&samples::sphere(1.0, 48), Orientation::Trusted).unwrap();
        for p in proxy.sample(1000, 7, 1) {
            assert!((p.position.length() - 1.0).abs() < 0.01);
            assert!(p.normal.dot(p.position) > 0.99 && (p.normal.length() - 1.0).abs() < 1e-12);
            assert!(p.score == 1.0 && (p.lift - 1e-4).abs() < 1e-8);
        }
    }

    /// Scores belong to vertices: between a plain and a shiny one they must rise evenly.
    #[test]
    fn scores_are_interpolated_between_vertices() {
        let positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let mesh = Mesh { positions, triangles: vec![[0, 1, 2]], scores: vec![1.0, 2.0, 1.0], ..Mesh::default() };
        let proxy = Proxy::new(&Surface::Mesh(mesh), Orientation::Trusted).unwrap();
        for p in proxy.sample(100, 0, 0) {
            assert!((f64::from(p.score) - 1.0 - p.position.x).abs() < 1e-6);
        }
    }

    /// The metrics must be taken on points that the planner never used.
    #[test]
    fn two_streams_share_no_point_while_the_cloud_is_large_enough() {
        let proxy = cloud(5000);
        for seed in 0..4 {
            let (a, b) = (proxy.sample(2000, seed, 0), proxy.sample(2500, seed, 1));
            let (a, b) = (keys(&a), keys(&b));
            assert_eq!((a.len(), b.len()), (2000, 2500), "points must be distinct");
            assert!(a.is_disjoint(&b));
        }
        let all = proxy.sample(5000, 0, 0);
        assert_eq!(keys(&all).len(), 5000);
        assert_eq!(proxy.sample(12_345, 0, 0).len(), 12_345);
        assert_eq!(proxy.sample(0, 0, 0).len(), 0);
    }

    /// The same request must give the same points, and another seed others.
    #[test]
    fn samples_depend_on_the_seed_alone() {
        for proxy in [cloud(1000), Proxy::new(&samples::cube(), Orientation::Trusted).unwrap()] {
            assert_eq!(proxy.sample(50, 3, 0), proxy.sample(50, 3, 0));
            assert_ne!(proxy.sample(50, 3, 0), proxy.sample(50, 4, 0));
        }
    }

    /// A half of the cloud that is scanned ten times as densely must not get ten times as many points, but for features, of which it has them.
    #[test]
    fn uneven_clouds_are_sampled_evenly() {
        let positions: Vec<DVec3> = (0..11_000)
            .map(|i| {
                let [u, v, ..] = random::uniforms(8, 0, i);
                DVec3::new(u + if i < 1000 { 0.0 } else { 1.0 }, v, 0.0)
            })
            .collect();
        let points = Points { positions, ..Points::default() };
        let proxy = Proxy::new(&Surface::Points(points), Orientation::Outward(DVec3::NEG_Z)).unwrap();
        let sparse = proxy.sample(600, 0, 0).iter().filter(|p| p.position.x < 1.0).count();
        assert!((220..=380).contains(&sparse), "{sparse} of 600 on the sparse half");
        let features = proxy.sample_features(600, 0, 0).iter().filter(|p| p.position.x < 1.0).count();
        assert!((35..=75).contains(&features), "{features} features of 600 on the half with an eleventh of the points");
    }

    /// An inclusion probability off by its cap would give too many or too few points.
    #[test]
    fn systematic_samples_have_the_exact_size() {
        for n in [1u32, 2, 7, 100, 1001] {
            let weights: Vec<f64> = (0..n).map(|i| random::uniforms(6, 0, i)[0].powi(4) + 1e-9).collect();
            for count in 0..=(n as usize).min(60) {
                for offset in [0.0, 0.3, 0.999_999_9] {
                    let chosen = systematic(&weights, count, offset);
                    assert_eq!(chosen.len(), count, "n {n}, count {count}, offset {offset}");
                    assert!(chosen.windows(2).all(|w| w[0] < w[1]));
                }
            }
        }
    }
}

//! Neighbours that structure from motion can join: cameras that see the same surface from directions that are not far apart.
//!
//! Photos register where features are matched between them, which fails where the surface is seen at too wide an angle from one to the
//! other, or is in one of the pictures only. Cameras that are to connect are linked by a minimum spanning tree (Prim 1957) over what
//! keeps each pair from sharing enough; its edges are penalised (`links.glsl`), and it is made anew as the cameras move.

use glam::{DVec3, Vec3};

use super::config::QualityConfig;
use super::shared::Anchor;
use crate::engine::parallel::{in_parallel, mapped};
use crate::engine::vulkan::shaders::glsl::planner::plan::expected_quality::links as glsl;
use crate::planner::plan::shared::CameraState;
use crate::scene::camera::Pose;
use crate::scene::proxy::Proxy;
use crate::scene::sets::Sets;
use crate::visibility::bvh::Bvh;
use crate::visibility::device_scene::SceneGeometry;
use crate::visibility::probe_depth::Probe;
use crate::visibility::raycast::Ray;

/// Cameras of a plan that is to connect: pairs of them are looked at.
pub(super) const MAX_CAMERAS: u32 = 2000;
/// Iterations between one tree and the next.
pub(super) const EVERY: u32 = 10;
/// Points of the surface that pairs are compared by.
const POINTS: usize = 1024;
/// Places in free space that these points face.
const PLACES: u32 = 128;
/// Stream of these points.
const LINK_STREAM: u32 = 0x6c69_6e6b;
/// Part that both of two cameras must see of what the one sees that sees less, and so many points at least.
const SHARED: f64 = 0.3;
const MIN_SHARED: usize = 6;
/// Part of what a kept camera sees that one linked to it must see too, at the angles in degrees at and beyond which it is this: someone who
/// asks for narrower angles has lost photos, and those that turn where they stand differ by no angle at all.
const OF_KEPT: [(f64, f64); 2] = [(20.0, 0.3), (5.0, 0.6)];
/// Points of a link that pull.
const ANCHORS: usize = 16;
/// Weight of the penalty, at first and at last, against expected quality, whose gradient by a camera is about one over their number.
/// Heavy from the start, it would hold the cameras where they first connect.
const WEIGHT: [f32; 2] = [10.0, 100.0];
/// Parts of the way from a kept camera at which a camera may begin.
const BEGUN: [f64; 7] = [1.0, 0.7, 0.5, 0.35, 0.25, 0.15, 0.05];
/// Weight of an angle that costs nothing: of links that cost nothing the tree takes those at small angles.
const SLIGHT: f32 = 1e-3;
/// What a pair costs that nothing joins, beside its distance: more than any penalty.
const APART: f32 = 10.0;

/// Anchors that a plan of so many cameras has at most: each edge of the tree has two ends.
pub(super) fn anchors(splats: u64) -> u64 {
    (2 * ANCHORS as u64 * splats.saturating_sub(1)).max(1)
}

/// Which cameras can be neighbours.
pub struct Links {
    /// Widest angle at a point between neighbours, in radians.
    angle: f32,
    /// Whether only kept cameras are neighbours.
    direct: bool,
    /// Part of what one of two cameras sees that both must see: of the kept one, else of the one that sees less.
    shared: f64,
    points: Vec<Probe>,
}

/// What a camera sees of the points.
pub struct Sight {
    centre: Vec3,
    /// Unit direction to each point.
    toward: Vec<Vec3>,
    /// Angle of each point off the axis; infinite where something hides it.
    off: Vec<f32>,
    /// Half angle of the cone inscribed in the picture.
    half_cone: f32,
    /// Points in that cone.
    seen: Vec<u32>,
}

impl Links {
    /// Neighbours at points of the surface of `proxy`, where cameras are to connect.
    pub fn of(own: &QualityConfig, proxy: &Proxy, geometry: &SceneGeometry, seed: u64) -> Option<Self> {
        let degrees = own.connect?;
        let shared = if own.direct { of_kept(f64::from(degrees)) } else { SHARED };
        let places: Vec<DVec3> = (0..PLACES).map(|i| geometry.free.sample(seed, LINK_STREAM, i)).collect();
        let points = geometry.facing(proxy.sample_features(POINTS, seed, LINK_STREAM), &places);
        let points = points.iter().map(|point| Probe::new(point, geometry)).collect();
        Some(Self { angle: degrees.to_radians(), direct: own.direct, shared, points })
    }

    /// What cameras see, by camera.
    pub fn sights(&self, bvh: &Bvh, splats: &[CameraState]) -> Vec<Sight> {
        mapped(splats, |_, splat| self.sight(bvh, splat))
    }

    fn sight(&self, bvh: &Bvh, splat: &CameraState) -> Sight {
        let (centre, direction) = (Vec3::from(splat.centre), Vec3::from(splat.direction));
        let half_cone = splat.tan_x.min(splat.tan_y).atan();
        let mut sight = Sight { centre, toward: Vec::new(), off: Vec::new(), half_cone, seen: Vec::new() };
        for (number, point) in (0..).zip(&self.points) {
            let origin = Vec3::from(point.position);
            let ray = origin - centre;
            let t_max = ray.length().max(1e-6);
            let toward = ray / t_max;
            let back = Ray { origin, direction: -toward, t_min: 0.0, t_max };
            let hidden = !point.faces(-toward) || bvh.any_hit(&back);
            let off = if hidden { f32::INFINITY } else { between(toward, direction) };
            if off <= half_cone {
                sight.seen.push(number);
            }
            sight.toward.push(toward);
            sight.off.push(off);
        }
        sight
    }

    /// Points that two cameras must share, the first of which is kept where only kept ones are neighbours: what the other sees may be
    /// next to nothing that is known. Of a kept picture that is larger, as much as the other would show of it from there.
    fn least(&self, a: &Sight, b: &Sight) -> usize {
        let of = if self.direct {
            a.seen.len() as f64 * f64::from(b.half_cone.tan() / a.half_cone.tan()).powi(2).min(1.0)
        } else {
            a.seen.len().min(b.seen.len()) as f64
        };
        MIN_SHARED.max((self.shared * of).ceil() as usize)
    }

    /// Whether two cameras share enough at an angle that is not too wide.
    fn join(&self, a: &Sight, b: &Sight) -> bool {
        let shared =
            a.seen.iter().map(|point| *point as usize).filter(|point| {
                b.off[*point] <= b.half_cone && between(a.toward[*point], b.toward[*point]) <= self.angle
            });
        shared.count() >= self.least(a, b)
    }

    /// The points that cost a pair least, as many as it must share, and what these cost in the mean; none where too few are seen by
    /// either that nothing hides from the other.
    fn cheapest(&self, a: &Sight, b: &Sight, scratch: &mut Vec<(f32, u32)>) -> Option<f32> {
        let cost = |point: &u32| {
            let i = *point as usize;
            let parallax = between(a.toward[i], b.toward[i]);
            let cost = |angle: f32, free: f64, most: f32| past(f64::from(angle) - free * f64::from(most)).0 as f32;
            let off = |sight: &Sight| cost(sight.off[i], glsl::WITHIN_PICTURE, sight.half_cone);
            cost(parallax, glsl::WITHIN_ANGLE, self.angle) + off(a) + off(b) + SLIGHT * parallax
        };
        let of_a = a.seen.iter().filter(|point| b.off[**point as usize].is_finite());
        // A kept camera will never show more than it does.
        let of_b = b.seen.iter().filter(|point| {
            let off = a.off[**point as usize];
            !self.direct && off > a.half_cone && off.is_finite()
        });
        scratch.clear();
        scratch.extend(of_a.chain(of_b).map(|point| (cost(point), *point)));
        let least = self.least(a, b);
        if scratch.len() < least {
            return None;
        }
        scratch.select_nth_unstable_by(least - 1, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        scratch.truncate(least);
        Some(scratch.iter().map(|(cost, _)| cost).sum::<f32>() / least as f32)
    }

    /// Where cameras that are linked to kept ones begin, for `poses` in the planner's frame that they would have otherwise, each with the
    /// tangents of half the fields of view of its lens: what shares nothing with a kept camera would be pulled nowhere, so each begins on
    /// the way from the kept one that is nearest, as far along as the two connect. `settled` brings a position to where cameras can be.
    pub(in crate::planner::plan) fn begun(
        &self,
        bvh: &Bvh,
        kept: &[(Pose, CameraState)],
        lenses: &[[f32; 2]],
        poses: &[Pose],
        settled: impl Fn(DVec3) -> DVec3 + Sync,
    ) -> Vec<Pose> {
        if !self.direct || kept.is_empty() {
            return poses.to_vec();
        }
        let sight = |[tan_x, tan_y]: [f32; 2], pose: &Pose| {
            let mut splat = CameraState { tan_x, tan_y, ..CameraState::default() };
            splat.place(pose);
            self.sight(bvh, &splat)
        };
        let sights = mapped(kept, |_, (_, splat)| self.sight(bvh, splat));
        mapped(poses, |j, pose| {
            let away = |from: &Pose| from.position.distance(pose.position) * (2.0 - from.forward().dot(pose.forward()));
            let all = kept.iter().map(|(from, _)| from);
            let Some(from) = all.min_by(|a, b| away(a).total_cmp(&away(b))) else { return *pose };
            let along = |part: f64| Pose {
                position: settled(from.position.lerp(pose.position, part)),
                rotation: from.rotation.slerp(pose.rotation, part),
            };
            let joined = |pose: &Pose| {
                let sight = sight(lenses[j], pose);
                sights.iter().any(|kept| self.join(kept, &sight))
            };
            let ways = BEGUN.map(along);
            ways.into_iter().find(joined).unwrap_or(ways[BEGUN.len() - 1])
        })
    }

    /// Edges of a minimum spanning tree over the cameras, of which the first `kept` hang together already; the cheapest edge of each other
    /// one to these, where only these are neighbours.
    fn tree(&self, sights: &[&Sight], kept: usize) -> Vec<(usize, usize)> {
        // By camera outside of the tree: what its cheapest link into the tree costs, and to whom.
        let mut open: Vec<(f32, usize)> = vec![(f32::INFINITY, 0); sights.len()];
        let mut within = vec![false; sights.len()];
        let mut edges = Vec::new();
        let mut new: Vec<usize> = (0..kept.max(1)).collect();
        loop {
            new.iter().for_each(|joined| within[*joined] = true);
            in_parallel(&mut open, 8, |chunk, open| {
                let mut scratch = Vec::new();
                for (j, open) in (8 * chunk..).zip(open).filter(|(j, _)| !within[*j]) {
                    for joined in &new {
                        let (a, b) = (sights[*joined], sights[j]);
                        let apart = || APART + a.centre.distance(b.centre);
                        let cost = self.cheapest(a, b, &mut scratch).unwrap_or_else(apart);
                        if cost < open.0 {
                            *open = (cost, *joined);
                        }
                    }
                }
            });
            let left = (0..sights.len()).filter(|j| !within[*j]);
            let Some(next) = left.min_by(|a, b| open[*a].0.total_cmp(&open[*b].0)) else { return edges };
            edges.push((open[next].1, next));
            within[next] = true;
            new = if self.direct && kept > 0 { Vec::new() } else { vec![next] };
        }
    }

    /// What pulls each camera to its neighbours after `done` of the run: where its anchors begin, one more than there are cameras, and the
    /// anchors. The first of `splats` are kept and never move: what they see is `kept`.
    pub fn anchors(&self, bvh: &Bvh, splats: &[CameraState], kept: &[Sight], done: f32) -> (Vec<u32>, Vec<Anchor>) {
        let moving = self.sights(bvh, &splats[kept.len()..]);
        let sights: Vec<&Sight> = kept.iter().chain(&moving).collect();
        let mut of: Vec<Vec<Anchor>> = vec![Vec::new(); splats.len()];
        let mut scratch = Vec::new();
        for (i, j) in self.tree(&sights, kept.len()) {
            if self.cheapest(sights[i], sights[j], &mut scratch).is_none() {
                continue;
            }
            scratch.sort_unstable_by_key(|(_, point)| *point);
            let count = scratch.len().min(ANCHORS);
            let weight = WEIGHT[0] * (WEIGHT[1] / WEIGHT[0]).powf(done) / (splats.len() * count) as f32;
            for k in 0..count {
                let point = self.points[scratch[k * scratch.len() / count].1 as usize].position;
                let toward = |other: usize| Anchor { point, weight, other: splats[other].centre, spare: 0 };
                of[i].push(toward(j));
                of[j].push(toward(i));
            }
        }
        let mut starts = vec![0];
        for anchors in &of {
            starts.push(starts[starts.len() - 1] + anchors.len() as u32);
        }
        (starts, of.concat())
    }

    /// Sizes of the groups of cameras that hang together, the largest first; the first `kept` cameras are one.
    pub(in crate::planner::plan) fn groups(&self, bvh: &Bvh, splats: &[CameraState], kept: usize) -> Vec<usize> {
        let sights = self.sights(bvh, splats);
        let mut sets = Sets::new(splats.len());
        (1..kept).for_each(|j| _ = sets.join(0, j));
        for j in kept.max(1)..splats.len() {
            for i in 0..if self.direct && kept > 0 { kept } else { j } {
                if sets.root(i) != sets.root(j) && self.join(&sights[i], &sights[j]) {
                    sets.join(i, j);
                }
            }
        }
        let mut sizes = vec![0; splats.len()];
        (0..splats.len()).for_each(|j| sizes[sets.root(j)] += 1);
        sizes.retain(|size| *size > 0);
        sizes.sort_unstable_by(|a, b| b.cmp(a));
        sizes
    }
}

/// The part of what a kept camera sees that one linked to it must see, by the widest angle between the two in degrees.
fn of_kept(degrees: f64) -> f64 {
    let [(wide, least), (narrow, most)] = OF_KEPT;
    least + ((wide - degrees) / (wide - narrow)).clamp(0.0, 1.0) * (most - least)
}

/// Angle between unit vectors.
fn between(a: Vec3, b: Vec3) -> f32 {
    a.dot(b).clamp(-1.0, 1.0).acos()
}

/// Huber's loss of an angle past what costs nothing, and its slope: the twin of `past`.
fn past(x: f64) -> (f64, f64) {
    match x {
        _ if x <= 0.0 => (0.0, 0.0),
        _ if x < glsl::KNEE => (0.5 * x * x / glsl::KNEE, x / glsl::KNEE),
        _ => (x - 0.5 * glsl::KNEE, 1.0),
    }
}

/// The twin of `add_link`: the penalty on a camera at `centre` that looks along unit `direction`, and its gradient by centre and by
/// direction (as if the direction were a free vector); `angle` and `half_cone` as in [`Links`].
pub fn penalty(
    (centre, direction): (DVec3, DVec3),
    anchors: &[Anchor],
    angle: f64,
    half_cone: f64,
) -> (f64, DVec3, DVec3) {
    let (mut loss, mut by_centre, mut by_direction) = (0.0, DVec3::ZERO, DVec3::ZERO);
    for anchor in anchors {
        let [point, other] = [anchor.point, anchor.other].map(|v| Vec3::from(v).as_dvec3());
        let weight = f64::from(anchor.weight);
        let ray = point - centre;
        let (n, m) = (ray.normalize(), (point - other).normalize());
        let [parallax_cosine, off_cosine] = [m, direction].map(|v| n.dot(v).clamp(-1.0, 1.0));
        let parallax = past(parallax_cosine.acos() - glsl::WITHIN_ANGLE * angle);
        let off = past(off_cosine.acos() - glsl::WITHIN_PICTURE * half_cone);
        loss += weight * (parallax.0 + off.0);
        let by = |slope: f64, cosine: f64| weight * slope / (1.0 - cosine * cosine).max(1e-8).sqrt();
        let (by_parallax, by_off) = (by(parallax.1, parallax_cosine), by(off.1, off_cosine));
        let by_n = by_parallax * m + by_off * direction;
        by_centre += (by_n - by_n.dot(n) * n) / ray.length();
        by_direction -= by_off * n;
    }
    (loss, by_centre, by_direction)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    fn vector(stream: u32, index: u32) -> DVec3 {
        let [x, y, z, _] = random::uniforms(11, stream, index);
        2.0 * DVec3::new(x, y, z) - 1.0
    }

    /// If this failed, a photo that is asked for could show hardly anything that is known: all of that may be in one that there is, and
    /// structure from motion still finds too little to place it. In a room with plain walls it placed none of those.
    #[test]
    fn a_linked_photo_shows_much_of_what_the_kept_one_does() {
        let sight = |seen: std::ops::Range<u32>| {
            let off = (0..100).map(|i| if seen.contains(&i) { 0.1 } else { 1.0 }).collect();
            Sight { centre: Vec3::ZERO, toward: vec![Vec3::Z; 100], off, half_cone: 0.4, seen: seen.collect() }
        };
        let links = |direct, shared| Links { angle: 0.3, direct, shared, points: Vec::new() };
        let kept = sight(0..80);
        // All of the little that one sees, and less than half of what the other does.
        assert!(!links(true, 0.3).join(&kept, &sight(70..90)) && links(false, 0.3).join(&kept, &sight(70..90)));
        assert!(links(true, 0.3).join(&kept, &sight(50..100)) && !links(true, 0.6).join(&kept, &sight(50..100)));
        // What pulls the other is in the kept one's picture.
        let mut scratch = Vec::new();
        assert!(links(true, 0.3).cheapest(&kept, &sight(70..90), &mut scratch).is_some_and(|cost| cost > 0.1));
        assert!(scratch.len() == 24 && scratch.iter().all(|(_, point)| *point < 80), "{scratch:?}");
        // A lens twice as long shows a quarter of the picture from the same place.
        let longer = Sight { half_cone: (0.5 * 0.4f32.tan()).atan(), ..sight(70..90) };
        assert!(links(true, 0.3).join(&kept, &longer));
        assert!(
            [40.0, 20.0, 12.5, 5.0, 1.0]
                .map(of_kept)
                .into_iter()
                .zip([0.3, 0.3, 0.45, 0.6, 0.6])
                .all(|(a, b)| (a - b).abs() < 1e-12)
        );
    }

    /// If this failed, cameras that are to connect would be pulled another way than toward each other, only slowly and unnoticed.
    #[test]
    fn the_gradient_of_the_penalty_is_that_of_finite_differences() {
        let mut pulled = 0;
        for i in 0..200 {
            let (centre, direction) = (3.0 * vector(0, i).normalize(), vector(1, i).normalize());
            let anchors: Vec<Anchor> = (0..3)
                .map(|k| Anchor {
                    point: (0.7 * vector(2, 3 * i + k)).as_vec3().to_array(),
                    weight: 0.5,
                    other: (3.0 * vector(3, 3 * i + k).normalize()).as_vec3().to_array(),
                    spare: 0,
                })
                .collect();
            let at = |centre: DVec3, direction: DVec3| penalty((centre, direction.normalize()), &anchors, 0.3, 0.4);
            let (loss, by_centre, by_direction) = at(centre, direction);
            let across = by_direction - by_direction.dot(direction) * direction;
            pulled += usize::from(loss > 0.0);
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                let step = 1e-6 * axis;
                let by = |up: f64, down: f64| (up - down) / 2e-6;
                let found = by(at(centre + step, direction).0, at(centre - step, direction).0);
                assert!((found - by_centre.dot(axis)).abs() < 1e-6, "{i}: {found} of {by_centre} along {axis}");
                let found = by(at(centre, direction + step).0, at(centre, direction - step).0);
                assert!((found - across.dot(axis)).abs() < 1e-6, "{i}: {found} of {across} around {axis}");
            }
        }
        assert!(pulled > 150, "{pulled} of 200 cameras were pulled at all");
    }
}

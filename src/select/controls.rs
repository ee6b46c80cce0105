//! Simple ways to choose from a pool, against which a selection is measured.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::PI;

use glam::DVec3;

use super::assignment::assign;
use super::sight::Sight;
use crate::parallel::in_parallel;
use crate::photos::PhotoSet;
use crate::scene::camera::Pose;
use crate::scene::random;
use crate::scene::region::Region;

/// Stream of the random control, and of the first photo of farthest view sampling.
const CONTROL_STREAM: u32 = 0x5e1e_0000;
/// Photos up to which all pairs are worth counting shared points of.
const MOST_SHARED: usize = 4000;

/// What may be chosen.
pub struct Pool<'a> {
    /// The capture.
    pub set: &'a PhotoSet,
    /// Where cameras could stand: its centre and radius are the measure of directions and distances.
    pub region: &'a Region,
    /// What each photo sees of the optimisation's points.
    pub sight: &'a Sight,
    /// Photos that are chosen in any case, ascending.
    pub must: &'a [usize],
    /// Photos that may be chosen, `must` included, ascending.
    pub allowed: &'a [usize],
    /// How many to choose.
    pub count: usize,
    /// Seed.
    pub seed: u64,
}

/// How two photos differ, for farthest view sampling (NeRF Director).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distance {
    /// The angle between their directions from the region's centre.
    GreatCircle,
    /// The distance between their centres.
    Chord,
    /// The great circle, and pi times one less the share of points that both saw.
    Shared,
}

impl Pool<'_> {
    fn pose(&self, photo: usize) -> &Pose {
        &self.set.photos[photo].camera.pose
    }

    /// Allowed photos that are not yet among `chosen`.
    fn free(&self, chosen: &[usize]) -> Vec<usize> {
        let mut taken = vec![false; self.set.photos.len()];
        chosen.iter().for_each(|photo| taken[*photo] = true);
        self.allowed.iter().copied().filter(|photo| !taken[*photo]).collect()
    }

    /// How far a planned camera is from a photo: the distance of their centres in radii of the region, and the angle between
    /// their axes.
    pub fn distance(&self, planned: &Pose, photo: usize) -> f64 {
        let pose = self.pose(photo);
        let away = planned.position.distance(pose.position) / self.region.bounding_sphere().1;
        away + planned.forward().angle_between(pose.forward())
    }

    /// `must`, and for each planned camera a photo of its own, nearest in sum.
    pub fn assigned(&self, planned: &[Pose]) -> Vec<usize> {
        let free = self.free(self.must);
        // The search comes back to a row again and again.
        let mut distances = vec![0f32; planned.len() * free.len()];
        in_parallel(&mut distances, free.len(), |row, distances| {
            let photos = distances.iter_mut().zip(&free);
            photos.for_each(|(distance, photo)| *distance = self.distance(&planned[row], *photo) as f32);
        });
        let columns = assign(planned.len(), free.len(), |row, column| f64::from(distances[row * free.len() + column]));
        self.must.iter().copied().chain(columns.into_iter().map(|column| free[column])).collect()
    }

    /// `must`, and for each planned camera the nearest photo, as in the paper: a photo that is nearest to two stands for
    /// both, so that there may be fewer than were asked for.
    pub fn nearest(&self, planned: &[Pose]) -> Vec<usize> {
        let mut chosen = self.must.to_vec();
        for pose in planned {
            let nearest =
                self.allowed.iter().min_by(|a, b| self.distance(pose, **a).total_cmp(&self.distance(pose, **b)));
            chosen.extend(nearest.filter(|photo| !chosen.contains(photo)));
        }
        chosen
    }

    /// Photos at random.
    pub fn random(&self) -> Vec<usize> {
        let mut free = self.free(self.must);
        random::shuffle(&mut free, self.seed, CONTROL_STREAM);
        self.must.iter().copied().chain(free).take(self.count).collect()
    }

    /// Farthest view sampling: again and again the photo whose distance to the nearest chosen one is greatest; the first at
    /// random. None where counting shared points would take too long.
    pub fn farthest(&self, distance: Distance) -> Option<Vec<usize>> {
        if distance == Distance::Shared && self.set.photos.len() > MOST_SHARED {
            return None;
        }
        let shared = (distance == Distance::Shared).then(|| Shared::new(self.saw()));
        let most = shared.as_ref().map_or(1, Shared::most);
        let centre = self.region.bounding_sphere().0;
        let outward = |photo: usize| (self.pose(photo).position - centre).try_normalize().unwrap_or(DVec3::Z);
        let mut chosen = self.must.to_vec();
        let mut apart = vec![f64::INFINITY; self.set.photos.len()];
        let mut near = |photo: usize| {
            let shared = shared.as_ref().map_or_else(Vec::new, |shared| shared.with(photo));
            for &other in self.allowed {
                let great_circle = || 2.0 * (0.5 * outward(photo).distance(outward(other))).min(1.0).asin();
                let away = match distance {
                    Distance::GreatCircle => great_circle(),
                    Distance::Chord => self.pose(photo).position.distance(self.pose(other).position),
                    Distance::Shared => great_circle() + PI * (1.0 - f64::from(shared[other]) / f64::from(most)),
                };
                apart[other] = apart[other].min(away);
            }
            apart.clone()
        };
        let mut far = Vec::new();
        for photo in self.must {
            far = near(*photo);
        }
        while chosen.len() < self.count {
            let free = self.free(&chosen);
            let next = if chosen.is_empty() {
                let word = random::bits(self.seed, CONTROL_STREAM + 1, 0)[0];
                free[random::below(word, free.len() as u32) as usize]
            } else {
                // The first of the farthest.
                *free.iter().rev().max_by(|a, b| far[**a].total_cmp(&far[**b]))?
            };
            chosen.push(next);
            far = near(next);
        }
        Some(chosen)
    }

    /// Points that each photo saw: by the reconstruction's tracks, or else of the optimisation's points.
    fn saw(&self) -> Vec<Vec<u32>> {
        if self.set.tracks.is_empty() {
            return self.sight.by_photo();
        }
        let mut lists = vec![Vec::new(); self.set.photos.len()];
        for (point, track) in (0u32..).zip(&self.set.tracks) {
            track.iter().for_each(|photo| lists[*photo as usize].push(point));
        }
        lists
    }

    /// Greedy coverage: the photo that shows most points for the first time; once all that can be are seen, the one that
    /// shows most points that fewer than three show.
    pub fn coverage(&self) -> Vec<usize> {
        let seen = self.sight.by_photo();
        let mut views = vec![0u32; self.sight.bits.len() / self.sight.words];
        let mut chosen = self.must.to_vec();
        for photo in self.must {
            seen[*photo].iter().for_each(|point| views[*point as usize] += 1);
        }
        // Both counts only shrink as photos are chosen: most need not be taken again (Minoux 1978).
        let worth = |photo: usize, views: &[u32]| {
            let below = |bound: u32| seen[photo].iter().filter(|point| views[**point as usize] < bound).count();
            ((below(1), below(3)), Reverse(photo))
        };
        let mut bounds: BinaryHeap<_> =
            self.free(&chosen).into_iter().map(|photo| ((usize::MAX, usize::MAX), Reverse(photo))).collect();
        while chosen.len() < self.count {
            let Some((_, Reverse(photo))) = bounds.pop() else { break };
            let now = worth(photo, &views);
            if bounds.peek().is_some_and(|next| *next > now) {
                bounds.push(now);
            } else {
                seen[photo].iter().for_each(|point| views[*point as usize] += 1);
                chosen.push(photo);
            }
        }
        chosen
    }
}

/// Points that photos have in common.
struct Shared {
    /// Points of each photo.
    points: Vec<Vec<u32>>,
    /// Photos of each point.
    photos: Vec<Vec<u32>>,
}

impl Shared {
    fn new(points: Vec<Vec<u32>>) -> Self {
        let count = points.iter().flatten().max().map_or(0, |most| *most as usize + 1);
        let mut photos = vec![Vec::new(); count];
        for (photo, points) in (0u32..).zip(&points) {
            points.iter().for_each(|point| photos[*point as usize].push(photo));
        }
        Self { points, photos }
    }

    /// How many points each photo shares with `photo`, itself included.
    fn with(&self, photo: usize) -> Vec<u32> {
        let mut counts = vec![0; self.points.len()];
        for point in &self.points[photo] {
            self.photos[*point as usize].iter().for_each(|other| counts[*other as usize] += 1);
        }
        counts
    }

    /// The most points that any two photos share; at least 1.
    fn most(&self) -> u32 {
        let mut most = vec![1; self.points.len()];
        in_parallel(&mut most, 1, |photo, most| {
            let others = self.with(photo).into_iter().enumerate().filter(|(other, _)| *other != photo);
            most[0] = others.map(|(_, count)| count).max().unwrap_or(0).max(1);
        });
        most.into_iter().max().unwrap_or(1)
    }
}

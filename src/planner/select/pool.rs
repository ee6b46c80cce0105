//! Simple ways to choose from a pool, against which a selection is measured.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DVec3;

use super::assignment::assign;
use super::farthest::{Distance, Metric};
use super::sight::Sight;
use crate::engine::parallel::in_parallel;
use crate::files::photos::PhotoSet;
use crate::scene::camera::Pose;
use crate::scene::random;
use crate::scene::region::Region;

/// Stream of the random baseline, and of the first photo of farthest view sampling.
const CONTROL_STREAM: u32 = 0x5e1e_0000;

/// What may be chosen.
pub struct Pool<'a> {
    /// The capture.
    pub set: &'a PhotoSet,
    /// The region of the cameras: its centre and radius are the measure of directions and distances.
    pub region: &'a Region,
    /// What each photo sees of the optimisation's points.
    pub sight: &'a Sight,
    /// Photos that are chosen in any case, ascending.
    pub include: &'a [usize],
    /// Photos that may be chosen, `include` included, ascending.
    pub allowed: &'a [usize],
    /// How many to choose.
    pub count: usize,
    /// Seed of what is drawn at random.
    pub seed: u64,
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

    /// `include`, and for each planned camera a photo of its own, nearest in sum.
    pub fn assigned(&self, planned: &[Pose]) -> Vec<usize> {
        let free = self.free(self.include);
        // The search comes back to a row again and again.
        let mut distances = vec![0f32; planned.len() * free.len()];
        in_parallel(&mut distances, free.len(), |row, distances| {
            let photos = distances.iter_mut().zip(&free);
            photos.for_each(|(distance, photo)| *distance = self.distance(&planned[row], *photo) as f32);
        });
        let columns = assign(planned.len(), free.len(), |row, column| f64::from(distances[row * free.len() + column]));
        self.include.iter().copied().chain(columns.into_iter().map(|column| free[column])).collect()
    }

    /// `include`, and for each planned camera the nearest photo, as in the paper: a photo that is nearest to two serves both, so
    /// that there may be fewer than requested.
    pub fn nearest(&self, planned: &[Pose]) -> Vec<usize> {
        let mut chosen = self.include.to_vec();
        for pose in planned {
            let nearest =
                self.allowed.iter().min_by(|a, b| self.distance(pose, **a).total_cmp(&self.distance(pose, **b)));
            chosen.extend(nearest.filter(|photo| !chosen.contains(photo)));
        }
        chosen
    }

    /// Photos at random.
    pub fn random(&self) -> Vec<usize> {
        let mut free = self.free(self.include);
        random::shuffle(&mut free, self.seed, CONTROL_STREAM);
        self.include.iter().copied().chain(free).take(self.count).collect()
    }

    /// Farthest view sampling after `include`; the first at random where there is none.
    pub fn farthest(&self, distance: Distance) -> Vec<usize> {
        let centre = self.region.bounding_sphere().0;
        let position = |photo: &usize| self.pose(*photo).position;
        let outward = |photo: &usize| (position(photo) - centre).try_normalize().unwrap_or(DVec3::Z);
        let metric = match distance {
            Distance::GreatCircle => Metric::new(self.allowed.iter().map(outward).collect()),
            Distance::Chord => Metric::new(self.allowed.iter().map(position).collect()),
            Distance::Shared => {
                let mut saw = self.saw();
                let saw = self.allowed.iter().map(|photo| std::mem::take(&mut saw[*photo])).collect();
                Metric::new(self.allowed.iter().map(outward).collect()).with_shared(saw)
            }
        };
        // `include` is a part of `allowed`, and both ascend.
        let mut chosen: Vec<usize> =
            self.include.iter().filter_map(|photo| self.allowed.binary_search(photo).ok()).collect();
        if chosen.is_empty() && self.count > 0 && !self.allowed.is_empty() {
            let word = random::bits(self.seed, CONTROL_STREAM + 1, 0)[0];
            chosen.push(random::below(word, self.allowed.len() as u32) as usize);
        }
        metric.farthest(chosen, self.count).into_iter().map(|place| self.allowed[place]).collect()
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
        let mut chosen = self.include.to_vec();
        for photo in self.include {
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

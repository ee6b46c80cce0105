//! The space that a capture proves free.

use glam::DVec3;

use super::PhotoSet;
use crate::Result;
use crate::engine::parallel;
use crate::scene::known::{KnownSpace, step};
use crate::scene::sight::Sight;

/// Points that two photos saw at least where somebody went from one to the other and nothing is between.
const SHARED: usize = 8;

impl PhotoSet {
    /// Indices of the points that each photo saw, rising; of all photos none where nothing says which see them.
    pub(crate) fn seen(&self) -> Vec<Vec<u32>> {
        let mut seen: Vec<Vec<u32>> = vec![Vec::new(); self.photos.len()];
        for (point, track) in (0..).zip(&self.tracks) {
            for photo in track {
                seen[*photo as usize].push(point);
            }
        }
        seen.iter_mut().for_each(|points| points.dedup());
        seen
    }

    /// The space that its photos prove free, `reach` around where they were taken, by default two of a photographer's steps. `surface`:
    /// points of a surface in the same frame that is denser than its own points. `up`, a unit vector: half of `reach` goes up and down.
    ///
    /// # Errors
    /// As [`KnownSpace::proven`].
    pub fn known_space(&self, surface: &[DVec3], reach: Option<f64>, up: DVec3) -> Result<KnownSpace> {
        let seen = self.seen();
        let (taken, sights) = self.sights(&seen, surface);
        let joined = |a: usize, b: usize| !self.tells() || shared(&seen[taken[a]], &seen[taken[b]]) >= SHARED;
        KnownSpace::proven(&sights, joined, reach, up)
    }

    /// A photographer's step, as its photos show it; see [`step`].
    pub fn step(&self) -> f64 {
        step(&self.sights(&self.seen(), &[]).1)
    }

    /// Bounds of the places where its photos were taken, those of stray poses apart. None without photos.
    pub fn stood(&self) -> Option<(DVec3, DVec3)> {
        let near = self.reach();
        let places = self.photos.iter().map(|photo| photo.camera.pose.position).filter(|p| near.holds(*p));
        places.map(|p| (p, p)).reduce(|(low, high), (p, _)| (low.min(p), high.max(p)))
    }

    /// How far its photos see: nine tenths of its points are nearer to the middle of where they were taken. None without points.
    pub fn depth(&self) -> Option<f64> {
        let places = self.photos.iter().map(|photo| photo.camera.pose.position);
        let middle = places.sum::<DVec3>() / self.photos.len().max(1) as f64;
        let mut away: Vec<f64> = self.points.positions.iter().map(|point| point.distance(middle)).collect();
        let rank = away.len() * 9 / 10;
        (rank > 0).then(|| *away.select_nth_unstable_by(rank, f64::total_cmp).1)
    }

    /// Whether anything says which photos saw which points.
    fn tells(&self) -> bool {
        self.tracks.iter().any(|track| !track.is_empty())
    }

    /// What its photos show to be free, those of stray poses apart, and their indices.
    fn sights(&self, seen: &[Vec<u32>], surface: &[DVec3]) -> (Vec<usize>, Vec<Sight>) {
        let near = self.reach();
        let taken: Vec<usize> =
            (0..self.photos.len()).filter(|i| near.holds(self.photos[*i].camera.pose.position)).collect();
        let beside = if surface.is_empty() && !self.tells() { &self.points.positions[..] } else { surface };
        let sights = parallel::mapped(&taken, |_, photo| {
            let points = seen[*photo].iter().map(|point| self.points.positions[*point as usize]);
            Sight::new(&self.photos[*photo].camera, points, beside)
        });
        (taken, sights)
    }
}

/// How many numbers two rising lists share.
fn shared(a: &[u32], b: &[u32]) -> usize {
    let (mut i, mut j, mut count) = (0, 0, 0);
    while i < a.len() && j < b.len() {
        count += usize::from(a[i] == b[j]);
        (i, j) = (i + usize::from(a[i] <= b[j]), j + usize::from(a[i] >= b[j]));
    }
    count
}

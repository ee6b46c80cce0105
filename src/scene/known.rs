//! Known space: where the photos of a capture prove that a camera can be.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::distance_transform::nearest_sites;
use super::sight::Sight;
use super::similarity::Similarity;
use super::voxels::{Grid, enclosed};
use crate::engine::parallel;
use crate::{Error, Result};

/// Voxels along the longest side of the space.
const RESOLUTION: f64 = 128.0;
/// How many steps a photographer goes from where photos were taken. A step is as long as nine of ten between neighbouring photos, and at
/// least one part of the distance of what they saw, since frames of a video are closer to each other than anybody steps, and at most another.
const STEPS: f64 = 2.0;
const LEAST_STEP: f64 = 0.125;
const MOST_STEP: f64 = 0.5;
/// How many times as far it is up or down: a photographer walks, but does not fly, and ceilings are plain.
const CLIMB: f64 = 2.0;
/// Around a photo so much is free, as a part of the median distance of what it saw and of the step: somebody stood there, and could have
/// held the camera elsewhere.
const ARM: [f64; 2] = [0.1, 0.5];
/// Neighbours of a photo to which the way is free where both saw the same: somebody went there.
const NEIGHBOURS: usize = 8;

/// A space in which cameras and viewers may be, as voxels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct KnownSpace {
    grid: Grid,
    free: Vec<bool>,
    /// Voxels with photos in them, rising; empty where no photos proved it.
    photos: Vec<u32>,
    /// How far from the nearest photo it ends; zero where none did.
    reach: f64,
    /// From the frame in which it is asked to that of the grid.
    to_grid: Similarity,
}

impl KnownSpace {
    /// What `sights` prove free within `reach` of where photos were taken, half of it up or down, by default two of a photographer's
    /// steps: what their rays pass, what an arm reaches around each, and the ways between neighbours that are no farther apart and `joined`.
    /// `up` is a unit vector.
    ///
    /// # Errors
    /// [`Error::Request`] where there are no sights, or all of one place.
    pub fn proven(
        sights: &[Sight],
        joined: impl Fn(usize, usize) -> bool + Sync,
        reach: Option<f64>,
        up: DVec3,
    ) -> Result<Self> {
        let places: Vec<DVec3> = sights.iter().map(|sight| sight.position).collect();
        let reach = reach.unwrap_or_else(|| STEPS * step(sights));
        if !(reach > 0.0 && reach.is_finite()) {
            return Err(Error::request("`reach`: the photos show no step; give a length above zero"));
        }
        let low = places.iter().copied().fold(DVec3::INFINITY, DVec3::min) - reach;
        let high = places.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max) + reach;
        let grid = Grid::over(low, high, RESOLUTION);
        let mut photos: Vec<u32> = places.iter().map(|place| grid.index(grid.voxel(*place)) as u32).collect();
        photos.sort_unstable();
        photos.dedup();
        let mut is_photo = vec![false; grid.voxels()];
        photos.iter().for_each(|i| is_photo[*i as usize] = true);
        let nearest = nearest_sites(grid.dims, |i| is_photo[i]);
        // From centre to centre, so that no place in a voxel is beyond. Up or down it is farther, and another photo may be nearer.
        let most = reach - 3f64.sqrt() * grid.cell;
        let centre = |i: u32| grid.centre(grid.coordinates(i as usize));
        let near = |place: DVec3, photo: u32| {
            let offset = place - centre(photo);
            (offset + (CLIMB - 1.0) * offset.dot(up) * up).length() <= most
        };
        let within = |i: usize| {
            let (place, first) = (centre(i as u32), nearest[i]);
            near(place, first)
                || (place.distance(centre(first)) <= most && photos.iter().any(|photo| near(place, *photo)))
        };
        let mut free = vec![false; grid.voxels()];
        let layer = grid.dims[0] as usize * grid.dims[1] as usize;
        parallel::in_parallel(&mut free, layer, |z, free| {
            for (i, free) in free.iter_mut().enumerate() {
                let i = z * layer + i;
                let centre = grid.centre(grid.coordinates(i));
                *free = within(i) && sights.iter().any(|sight| sight.proves(centre, 0.5 * grid.cell));
            }
        });
        let arm = |sight: &Sight| (ARM[0] * sight.middle).min(ARM[1] * sight.nearest).min(ARM[1] * reach);
        let arms: Vec<f64> = sights.iter().map(arm).collect();
        let mut mark = |from: usize, to: usize| {
            let (a, b, radius) = (places[from], places[to], arms[from].min(arms[to]));
            grid.around(a, b, radius).for_each(|i| free[i] = true);
        };
        for photo in 0..places.len() {
            mark(photo, photo);
            let mut others: Vec<(f64, usize)> = (0..places.len())
                .filter(|other| *other != photo)
                .map(|other| (places[photo].distance(places[other]), other))
                .filter(|(away, _)| *away <= reach)
                .collect();
            others.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            for (_, other) in others.into_iter().take(NEIGHBOURS).filter(|(_, other)| joined(photo, *other)) {
                mark(photo, other);
            }
        }
        Ok(Self { grid, free, photos, reach, to_grid: Similarity::IDENTITY })
    }

    /// The inside of a closed volume.
    ///
    /// # Errors
    /// [`Error::Request`] where it holds nothing.
    pub fn inside(triangles: &[[DVec3; 3]]) -> Result<Self> {
        let corners = || triangles.iter().flatten().copied();
        let (low, high) =
            (corners().fold(DVec3::INFINITY, DVec3::min), corners().fold(DVec3::NEG_INFINITY, DVec3::max));
        let empty = || Error::request("`space`: the volume holds nothing; give a closed mesh or boxes");
        if triangles.is_empty() || low.cmpeq(high).any() {
            return Err(empty());
        }
        let grid = Grid::over(low, high, RESOLUTION);
        let free = enclosed(&grid, triangles);
        if !free.contains(&true) {
            return Err(empty());
        }
        Ok(Self { grid, free, photos: Vec::new(), reach: 0.0, to_grid: Similarity::IDENTITY })
    }

    /// Whether it holds `p`.
    pub fn holds(&self, p: DVec3) -> bool {
        let p = self.to_grid.point(p);
        self.grid.holds(p) && self.free[self.grid.index(self.grid.voxel(p))]
    }

    /// Whether it holds the centre and the corners of a cube.
    pub(super) fn holds_cube(&self, centre: DVec3, half: f64) -> bool {
        let corner = |bits: u32| {
            centre + half * DVec3::from_array([0, 1, 2].map(|axis| if bits >> axis & 1 == 0 { -1.0 } else { 1.0 }))
        };
        self.holds(centre) && (0..8).all(|bits| self.holds(corner(bits)))
    }

    /// Places of photos in it, one of each voxel that has some.
    pub fn photos(&self) -> impl Iterator<Item = DVec3> {
        let back = self.to_grid.inverse();
        self.photos.iter().map(move |i| back.point(self.grid.centre(self.grid.coordinates(*i as usize))))
    }

    /// Lowest and highest corner of what it may hold.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let size = self.grid.cell * DVec3::from_array(self.grid.dims.map(f64::from));
        let back = self.to_grid.inverse();
        let (a, b) = (back.point(self.grid.origin), back.point(self.grid.origin + size));
        (a.min(b), a.max(b))
    }

    /// How far from the nearest photo it ends; none where no photos proved it.
    pub fn reach(&self) -> Option<f64> {
        (self.reach > 0.0).then(|| self.to_grid.inverse().length(self.reach))
    }

    /// The space in another frame.
    pub fn transformed(&self, similarity: &Similarity) -> Self {
        Self { to_grid: self.to_grid.after(&similarity.inverse()), ..self.clone() }
    }

    /// In words, on one line.
    pub fn line(&self) -> String {
        match self.reach() {
            Some(reach) => {
                format!(
                    "cameras in space that photos prove free, within {reach:.3} of where one was taken, half of it up or down"
                )
            }
            None => "cameras in the space that was given".into(),
        }
    }
}

/// A photographer's step, as photos show it.
pub fn step(sights: &[Sight]) -> f64 {
    let places: Vec<DVec3> = sights.iter().map(|sight| sight.position).collect();
    let mut edges = spanning_tree(&places);
    let usual = quantile(&mut edges, 0.9);
    let mut distances: Vec<f64> = sights.iter().map(|sight| sight.middle).filter(|middle| *middle > 0.0).collect();
    let away = quantile(&mut distances, 0.5);
    usual.max(LEAST_STEP * away).min(if away > 0.0 { MOST_STEP * away } else { f64::INFINITY })
}

/// The value below which a share of all lie; zero where there are none.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    let rank = (share * values.len().saturating_sub(1) as f64).round() as usize;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(rank, f64::total_cmp).1 }
}

/// Lengths of the edges of the shortest tree that joins all places (Prim).
fn spanning_tree(places: &[DVec3]) -> Vec<f64> {
    let mut away = vec![f64::INFINITY; places.len()];
    let mut left: Vec<usize> = (1..places.len()).collect();
    let (mut last, mut edges) = (0, Vec::new());
    while !left.is_empty() {
        left.iter().for_each(|i| away[*i] = away[*i].min(places[*i].distance(places[last])));
        let nearest = (0..left.len()).min_by(|a, b| away[left[*a]].total_cmp(&away[left[*b]]));
        // There is one, since some are left.
        last = left.swap_remove(nearest.unwrap_or_default());
        edges.push(away[last]);
    }
    edges
}

/// As a file has it.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    /// Lowest corner of the first voxel, in the frame of the surface.
    origin: DVec3,
    /// Side of a voxel.
    cell: f64,
    /// Voxels along x, y and z; x runs fastest.
    dims: [u32; 3],
    /// Numbers of voxels in turn that are not free, that are free, and so on.
    runs: Vec<u32>,
    photos: Vec<u32>,
    reach: f64,
}

impl From<KnownSpace> for Stored {
    /// Only spaces in the frame of the surface are written: those of records.
    fn from(KnownSpace { grid, free, photos, reach, .. }: KnownSpace) -> Self {
        let (mut runs, mut last) = (vec![0], false);
        for free in free {
            if free != last {
                runs.push(0);
                last = free;
            }
            // The first was pushed above.
            if let Some(run) = runs.last_mut() {
                *run += 1;
            }
        }
        Self { origin: grid.origin, cell: grid.cell, dims: grid.dims, runs, photos, reach }
    }
}

impl TryFrom<Stored> for KnownSpace {
    type Error = String;

    fn try_from(Stored { origin, cell, dims, runs, photos, reach }: Stored) -> Result<Self, String> {
        let count = dims.iter().try_fold(1u32, |count, side| count.checked_mul(*side)).unwrap_or(0);
        let sum = runs.iter().try_fold(0u32, |sum, run| sum.checked_add(*run));
        let sound = origin.is_finite() && cell > 0.0 && cell.is_finite() && reach >= 0.0 && reach.is_finite();
        if count == 0 || sum != Some(count) || !sound || photos.iter().any(|photo| *photo >= count) {
            return Err("the known space is damaged".into());
        }
        let run = |(i, run): (usize, &u32)| std::iter::repeat_n(i % 2 == 1, *run as usize);
        let free = runs.iter().enumerate().flat_map(run).collect();
        Ok(Self { grid: Grid { origin, cell, dims }, free, photos, reach, to_grid: Similarity::IDENTITY })
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::scene::camera::{Camera, Intrinsics, Pose};
    use crate::scene::random;

    /// Photos from a gallery before a wall at x = 0 that reaches far to all sides, at x from 2 to 4.
    fn cameras() -> Vec<Camera> {
        let intrinsics = Intrinsics::from_fov(400, 300, 1.1);
        let camera = |i: u32| {
            let [u, v, w, _] = random::uniforms(5, 1, i);
            let position = DVec3::new(2.0 + 2.0 * u, 4.0 * v - 2.0, 1.0 + w);
            let pose = Pose::looking(position, DVec3::new(-1.0, 0.3 * (w - 0.5), 0.2 * (u - 0.5)), DVec3::Z);
            Camera { name: format!("{i}"), pose, intrinsics }
        };
        (0..24).map(camera).collect()
    }

    /// Points of the wall, and a few wrong ones far behind it.
    fn points() -> Vec<DVec3> {
        let point = |i: u32| {
            let [u, v, w, _] = random::uniforms(5, 2, i);
            let on_wall = DVec3::new(0.01 * w, 12.0 * u - 6.0, 8.0 * v - 3.0);
            if i.is_multiple_of(100) { on_wall - DVec3::X * 4.0 } else { on_wall }
        };
        (0..2000).map(point).collect()
    }

    fn space(reach: Option<f64>) -> (Vec<Camera>, KnownSpace) {
        let (cameras, points) = (cameras(), points());
        let sights: Vec<Sight> = cameras
            .iter()
            .map(|camera| Sight::new(camera, points.iter().copied().filter(|p| camera.sees(*p)), &[]))
            .collect();
        let space = KnownSpace::proven(&sights, |_, _| true, reach, DVec3::Z).unwrap();
        (cameras, space)
    }

    fn spots() -> impl Iterator<Item = DVec3> {
        (0..20_000).map(|i| {
            let [u, v, w, _] = random::uniforms(5, 3, i);
            DVec3::new(10.0 * u - 4.0, 10.0 * v - 5.0, 8.0 * w - 3.0)
        })
    }

    /// If this failed, cameras would be planned behind the wall that was photographed, or nowhere but where photos were taken.
    #[test]
    fn nothing_is_known_behind_what_was_photographed_and_the_way_to_it_is() {
        let (cameras, space) = space(Some(1.2));
        let nearest = |p: DVec3| cameras.iter().map(|c| c.pose.position.distance(p)).fold(f64::INFINITY, f64::min);
        // Up and down it is twice as far, from whichever photo that is least.
        let climb = |from: DVec3, to: DVec3| (to - from).truncate().length().hypot(2.0 * (to - from).z);
        let climbed = |p: DVec3| cameras.iter().map(|c| climb(c.pose.position, p)).fold(f64::INFINITY, f64::min);
        let (mut held, mut open) = (0, 0);
        let heights = cameras.iter().map(|c| c.pose.position.z);
        let (lowest, highest) =
            (heights.clone().fold(f64::INFINITY, f64::min), heights.fold(f64::NEG_INFINITY, f64::max));
        for p in spots() {
            let inside = space.holds(p);
            // Nobody flies to a ceiling that no point shows.
            assert!(!inside || (lowest - 0.6..=highest + 0.6).contains(&p.z), "{p} is too high or too low");
            assert!(!inside || (p.x > 0.0 && nearest(p) <= 1.2), "{p} is behind the wall or out of reach");
            held += usize::from(inside);
            // Before the wall, among the photos and within reach of them.
            if (1.0..2.5).contains(&p.x) && p.y.abs() < 1.0 && (1.0..2.0).contains(&p.z) && climbed(p) < 1.0 {
                assert!(inside, "{p} was seen to be free");
                open += 1;
            }
        }
        assert!(held > 100 && open > 20, "{held} {open}");
        assert!(cameras.iter().all(|camera| space.holds(camera.pose.position)), "somebody stood there");
    }

    /// If this failed, a video would allow no step aside, or a few photos far from each other none between them.
    #[test]
    fn a_step_is_that_of_the_photos_and_more_than_that_of_a_video() {
        let sight = |x: f64| {
            let camera = Camera {
                name: "a".into(),
                pose: Pose::looking(DVec3::X * x, DVec3::Y, DVec3::Z),
                intrinsics: Intrinsics::from_fov(100, 100, 1.0),
            };
            let seen = (0..9).map(|i| DVec3::new(x + 0.1 * f64::from(i) - 0.4, 4.0, 0.0));
            Sight::new(&camera, seen, &[])
        };
        let spaced = |step: f64| (0..20).map(|i| sight(step * f64::from(i))).collect::<Vec<_>>();
        let reach =
            |step: f64| KnownSpace::proven(&spaced(step), |_, _| true, None, DVec3::Z).unwrap().reach().unwrap();
        assert!((reach(0.8) - 1.6).abs() < 1e-9 && (reach(0.01) - 1.0).abs() < 0.02, "{} {}", reach(0.8), reach(0.01));
        assert!(KnownSpace::proven(&[sight(0.0)], |_, _| true, Some(0.0), DVec3::Z).is_err());
    }

    /// If this failed, a plan that is scored, or replanned, would be so within another space than its own.
    #[test]
    fn a_space_is_the_same_in_files_and_in_other_frames() {
        let (_, space) = space(None);
        let json = serde_json::to_string(&space).unwrap();
        assert_eq!(serde_json::from_str::<KnownSpace>(&json).unwrap(), space);
        for damaged in [json.replacen("\"runs\":[", "\"runs\":[7,", 1), json.replacen("\"cell\":", "\"cell\":-", 1)] {
            assert!(serde_json::from_str::<KnownSpace>(&damaged).is_err());
        }
        let there =
            Similarity { rotation: DQuat::from_rotation_y(0.7), scale: 0.2, translation: DVec3::new(3.0, 1.0, -8.0) };
        let moved = space.transformed(&there);
        assert!(spots().all(|p| moved.holds(there.point(p)) == space.holds(p)));
        assert!((moved.reach().unwrap() - 0.2 * space.reach().unwrap()).abs() < 1e-9);
    }
}

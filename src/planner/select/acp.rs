//! Progressive camera placement (Kopanas and Drettakis, "Improving NeRF Quality by Progressive Camera Placement for
//! Free-Viewpoint Navigation", 2023): greedily the view that makes the directions from which the nodes of a grid are seen most
//! uniform, and nodes seen most often.
//!
//! A node's histogram of directions has 5 x 10 bins in polar angle and azimuth about up. Divided by the bins' solid angles and
//! normalised it is a density p; `A = 1 - 1/2 sum |p - 1/50|`, zero for a node that no view sees, `F` is the part of the
//! views that see the node, and the sum of `A + F^0.05` over the nodes is made as large as it can be, view by view. The gain
//! of a count in each bin of each node is kept in a table, so that a view's gain is a sum of entries, and choosing one changes
//! the entries of the nodes in its frustum only.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::pool::Pool;
use crate::engine::parallel::in_parallel;
use crate::scene::camera::Camera;
use crate::visibility::device_scene::SceneGeometry;
use crate::visibility::raycast::Ray;
use crate::{Error, Result};

/// Bins of the polar angle and of the azimuth, and in all.
const POLAR: usize = 5;
const AZIMUTH: usize = 10;
const BINS: usize = POLAR * AZIMUTH;
/// Power that the part of the views that see a node is raised to.
const POWER: f64 = 0.05;
/// Pairs of node and view that are supported: as many words in all where every view sees every node.
const MAX_PAIRS: u64 = 1 << 29;
/// How much wider than the views' bounds the grid is, over all.
const WIDER: f64 = 1.2;

/// AcpSettings of the method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AcpSettings {
    /// Nodes along each side of the grid, at most 64.
    pub grid: u32,
    /// Whether the surface hides nodes; as published it does not.
    pub occlusion: bool,
}

impl Default for AcpSettings {
    fn default() -> Self {
        Self { grid: 32, occlusion: false }
    }
}

/// Chooses from a pool, after the photos that are chosen in any case; nodes hidden by `occluder` are not seen.
///
/// # Errors
/// A pool that is too large for the grid.
pub fn choose(pool: &Pool<'_>, settings: AcpSettings, occluder: Option<&SceneGeometry>) -> Result<Vec<usize>> {
    let views = pool.allowed.len() as u64;
    if u64::from(settings.grid).pow(3).saturating_mul(views) > MAX_PAIRS {
        let what = format!("{views} views are too many for a grid of {0} x {0} x {0} nodes; give fewer", settings.grid);
        return Err(Error::request(format!("`method` acp: {what}")));
    }
    let cameras: Vec<&Camera> = pool.set.photos.iter().map(|photo| &photo.camera).collect();
    let nodes = nodes(pool.allowed.iter().map(|photo| cameras[*photo].pose.position), settings.grid);
    let mut seen = vec![Vec::new(); pool.allowed.len()];
    in_parallel(&mut seen, 1, |i, seen| seen[0] = counts(cameras[pool.allowed[i]], &nodes, pool.region.up, occluder));
    let mut state = State::new(nodes.len());
    let mut chosen: Vec<usize> =
        pool.include.iter().filter_map(|photo| pool.allowed.binary_search(photo).ok()).collect();
    chosen.iter().for_each(|place| state.add(&seen[*place]));
    let mut free: Vec<usize> = (0..pool.allowed.len()).filter(|place| !chosen.contains(place)).collect();
    while chosen.len() < pool.count && !free.is_empty() {
        let mut gains = vec![0.0; free.len()];
        in_parallel(&mut gains, 1, |i, gain| gain[0] = state.gain(&seen[free[i]]));
        // The first of the best.
        let best = (1..free.len()).fold(0, |best, i| if gains[i] > gains[best] { i } else { best });
        let place = free.remove(best);
        state.add(&seen[place]);
        chosen.push(place);
    }
    Ok(chosen.into_iter().map(|place| pool.allowed[place]).collect())
}

/// Centres of the cells of a grid over the bounds of positions, widened.
fn nodes(positions: impl Iterator<Item = DVec3>, grid: u32) -> Vec<DVec3> {
    let grid = grid.clamp(1, 64);
    let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (min, max) = positions.fold(empty, |(min, max), p| (min.min(p), max.max(p)));
    let (middle, size) = (0.5 * (min + max), WIDER * (max - min));
    let node = |i: u32| {
        let cell = DVec3::new(f64::from(i % grid), f64::from(i / grid % grid), f64::from(i / (grid * grid)));
        middle + size * ((cell + 0.5) / f64::from(grid) - 0.5)
    };
    (0..grid * grid * grid).map(node).collect()
}

/// The nodes that a camera sees, each with the bin that it counts in.
fn counts(camera: &Camera, nodes: &[DVec3], up: DVec3, occluder: Option<&SceneGeometry>) -> Vec<u32> {
    let centre = camera.pose.position;
    let open = |node: DVec3| {
        occluder.is_none_or(|scene| {
            let [origin, to] = [centre, node].map(|p| scene.to_internal.point(p).as_vec3());
            let direction = (to - origin).normalize_or_zero();
            !scene.bvh.any_hit(&Ray { origin, direction, t_min: 0.0, t_max: origin.distance(to) })
        })
    };
    // There are at most 2^18 nodes: both fit a word.
    let seen = nodes.iter().enumerate().filter(|(_, node)| camera.sees(**node) && open(**node));
    seen.map(|(i, node)| (i * BINS + bin(centre - *node, up)) as u32).collect()
}

/// The bin of a direction.
fn bin(direction: DVec3, up: DVec3) -> usize {
    let (x, y) = up.any_orthonormal_pair();
    let height = (direction.dot(up) / direction.length().max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0);
    let polar = (height.acos() / PI * POLAR as f64) as usize;
    let turn = (direction.dot(y).atan2(direction.dot(x)) / TAU).rem_euclid(1.0);
    polar.min(POLAR - 1) * AZIMUTH + ((turn * AZIMUTH as f64) as usize).min(AZIMUTH - 1)
}

/// One over the solid angle of the bins of a ring.
fn weight(polar: usize) -> f64 {
    let height = |edge: usize| (PI * edge as f64 / POLAR as f64).cos();
    AZIMUTH as f64 / (TAU * (height(polar) - height(polar + 1)))
}

/// What is known of the nodes.
struct State {
    /// How often each was seen from each bin.
    histograms: Vec<u16>,
    /// Views that see each.
    views: Vec<u32>,
    /// Views in all.
    count: u32,
    /// Gain in A of a count in each bin of each node.
    uniformity: Vec<f64>,
    /// Gain in the power of the number of views that see each node.
    frequency: Vec<f64>,
    weights: [f64; POLAR],
}

impl State {
    fn new(nodes: usize) -> Self {
        let mut state = Self {
            histograms: vec![0; nodes * BINS],
            views: vec![0; nodes],
            count: 0,
            uniformity: vec![0.0; nodes * BINS],
            frequency: vec![1.0; nodes],
            weights: std::array::from_fn(weight),
        };
        let untouched = gains(&state.histograms[..BINS], &state.weights);
        state.uniformity.chunks_exact_mut(BINS).for_each(|row| row.copy_from_slice(&untouched));
        state
    }

    /// What the sum over nodes grows by, but for what it loses with any view alike.
    fn gain(&self, seen: &[u32]) -> f64 {
        let (mut uniformity, mut frequency) = (0.0, 0.0);
        for entry in seen {
            uniformity += self.uniformity[*entry as usize];
            frequency += self.frequency[*entry as usize / BINS];
        }
        uniformity + frequency / f64::from(self.count + 1).powf(POWER)
    }

    fn add(&mut self, seen: &[u32]) {
        self.count += 1;
        let mut touched = vec![false; self.views.len()];
        for entry in seen {
            let node = *entry as usize / BINS;
            let bin = &mut self.histograms[*entry as usize];
            *bin = bin.saturating_add(1);
            self.views[node] += 1;
            let views = f64::from(self.views[node]);
            self.frequency[node] = (views + 1.0).powf(POWER) - views.powf(POWER);
            touched[node] = true;
        }
        let (histograms, weights) = (&self.histograms, &self.weights);
        in_parallel(&mut self.uniformity, BINS, |node, row| {
            if touched[node] {
                row.copy_from_slice(&gains(&histograms[node * BINS..][..BINS], weights));
            }
        });
    }
}

/// Gain in A of one more count in each bin of a histogram.
fn gains(histogram: &[u16], weights: &[f64; POLAR]) -> [f64; BINS] {
    let density: [f64; BINS] = std::array::from_fn(|bin| f64::from(histogram[bin]) * weights[bin / AZIMUTH]);
    let total: f64 = density.iter().sum();
    let even = 1.0 / BINS as f64;
    let off = |total: f64| density.iter().map(|value| (value / total - even).abs()).sum::<f64>();
    let before = if total > 0.0 { 1.0 - 0.5 * off(total) } else { 0.0 };
    // The bins of a ring raise the total alike.
    let rings: [f64; POLAR] = std::array::from_fn(|ring| off(total + weights[ring]));
    std::array::from_fn(|bin| {
        let weight = weights[bin / AZIMUTH];
        let after = total + weight;
        let moved = ((density[bin] + weight) / after - even).abs() - (density[bin] / after - even).abs();
        1.0 - 0.5 * (rings[bin / AZIMUTH] + moved) - before
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::photos::{Photo, PhotoSet};
    use crate::planner::select::sight::Sight;
    use crate::scene::camera::{Intrinsics, Pose};
    use crate::scene::lens::Distortion;
    use crate::scene::random;
    use crate::scene::region::{Region, Shape};

    const UP: DVec3 = DVec3::Y;

    fn set(count: u32) -> PhotoSet {
        let photo = |i: u32| {
            let [x, y, z, u] = random::uniforms(5, 0, i);
            let [v, ..] = random::uniforms(5, 1, i);
            let pose = Pose::looking(DVec3::new(4.0 * x, 2.0 * y, 3.0 * z), random::direction(u, v), UP);
            let camera = Camera { name: format!("{i}"), pose, intrinsics: Intrinsics::from_fov(64, 48, 1.2) };
            Photo { camera, distortion: Distortion::default(), image: None, mask: None }
        };
        PhotoSet { photos: (0..count).map(photo).collect(), ..PhotoSet::default() }
    }

    fn chosen(set: &PhotoSet, must: &[usize], count: usize, grid: u32) -> Vec<usize> {
        let region =
            Region { shape: Shape::Box { min: DVec3::ZERO, max: DVec3::ONE }, up: UP, floor: None, clearance: 0.0 };
        let allowed: Vec<usize> = (0..set.photos.len()).collect();
        let sight = Sight::empty(0, set.photos.len());
        let pool = Pool { set, region: &region, sight: &sight, include: must, allowed: &allowed, count, seed: 0 };
        choose(&pool, AcpSettings { grid, occlusion: false }, None).unwrap()
    }

    /// The objective by its definition, for a subset as a whole.
    fn energy(set: &PhotoSet, subset: &[usize], grid: u32) -> f64 {
        let nodes = nodes(set.photos.iter().map(|photo| photo.camera.pose.position), grid);
        let (x, y) = UP.any_orthonormal_pair();
        let energy = |node: &DVec3| {
            let mut histogram = [[0.0; AZIMUTH]; POLAR];
            let mut views = 0.0;
            for camera in subset.iter().map(|photo| &set.photos[*photo].camera).filter(|camera| camera.sees(*node)) {
                let w = (camera.pose.position - *node).normalize();
                let (polar, azimuth) = (w.dot(UP).acos(), w.dot(y).atan2(w.dot(x)).rem_euclid(TAU));
                histogram[(polar / (PI / 5.0)) as usize][(azimuth / (TAU / 10.0)) as usize] += 1.0;
                views += 1.0;
            }
            if views == 0.0 {
                return 0.0;
            }
            let solid =
                |ring: usize| TAU / 10.0 * ((PI * ring as f64 / 5.0).cos() - (PI * (ring + 1) as f64 / 5.0).cos());
            let density = |ring: usize, k: usize| histogram[ring][k] / solid(ring);
            let bins = || (0..POLAR).flat_map(|ring| (0..AZIMUTH).map(move |k| (ring, k)));
            let total: f64 = bins().map(|(ring, k)| density(ring, k)).sum();
            let off: f64 = bins().map(|(ring, k)| (density(ring, k) / total - 0.02).abs()).sum();
            1.0 - 0.5 * off + (views / subset.len() as f64).powf(0.05)
        };
        nodes.iter().map(energy).sum()
    }

    /// If this failed, the tables would have drifted from the objective, and the row "ACP" would be of some other method.
    #[test]
    fn every_pick_is_the_best_by_the_definition() {
        let (set, grid) = (set(40), 6);
        for must in [&[][..], &[7, 20]] {
            let subset = chosen(&set, must, 10, grid);
            assert_eq!(&subset[..must.len()], must);
            for picked in must.len()..10 {
                let with = |photo: usize| energy(&set, &[&subset[..picked], &[photo]].concat(), grid);
                let best = (0..40).filter(|photo| !subset[..picked].contains(photo)).map(with).fold(0.0, f64::max);
                let taken = with(subset[picked]);
                assert!(taken > best - 1e-9 * best, "pick {picked}: {taken} of {best}");
            }
        }
    }

    /// If this failed, nodes behind a wall would draw cameras to it although occlusion was requested.
    #[test]
    fn a_wall_hides_nodes_where_occlusion_is_asked_for() {
        use crate::scene::proxy::{Orientation, Proxy};
        let proxy = Proxy::new(&crate::scene::samples::cube(), Orientation::Trusted).unwrap();
        let shape = Shape::Box { min: DVec3::splat(-3.0), max: DVec3::splat(3.0) };
        let region = Region { shape, up: UP, floor: None, clearance: 0.1 };
        let scene = SceneGeometry::new(&proxy, &region).unwrap();
        let pose = Pose::looking(DVec3::new(-2.5, 0.0, 0.0), DVec3::X, UP);
        let camera = Camera { name: "a".into(), pose, intrinsics: Intrinsics::from_fov(64, 64, 1.0) };
        let nodes = [DVec3::new(-1.0, 0.0, 0.0), DVec3::new(2.0, 0.0, 0.0), DVec3::new(2.0, 2.0, 0.0)];
        let seen =
            |occluder| counts(&camera, &nodes, UP, occluder).into_iter().map(|e| e as usize / BINS).collect::<Vec<_>>();
        assert_eq!((seen(None), seen(Some(&scene))), (vec![0, 1, 2], vec![0, 2]));
    }
}

//! What training starts from: Gaussians at a capture's points, or anywhere in the scene where there are none.

use std::num::NonZero;

use glam::{DQuat, DVec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::engine::parallel::in_parallel;
use crate::files::photos::PhotoSet;
use crate::files::photos::volume::{self, Volume};
use crate::scene::camera::Camera;
use crate::scene::gaussians::{Gaussians, coefficients};
use crate::scene::harmonics::CONSTANT;
use crate::scene::random;
use crate::scene::surface::Points;
use crate::splats::config::TrainConfig;
use crate::splats::render::frame::Frame;
use crate::{Error, Result};

/// Streams of random numbers: which points are taken, and places and colours where there are none.
const SUBSET_STREAM: u32 = 0x6a05_0000;
const PLACE_STREAM: u32 = 0x6a05_0001;
const COLOUR_STREAM: u32 = 0x6a05_0002;

/// Nearest other points whose mean distance is a Gaussian's scale, and the bounds of that distance in the training frame:
/// points may coincide, or lie far from all others.
const NEIGHBOURS: usize = 3;
const SCALES: [f64; 2] = [1e-4, 0.1];

/// Half the side of the cube in the training frame in which Gaussians lie where cameras have no common focus, as in gsplat.
const REACH: f64 = 3.0;

/// Thickness of a Gaussian on a surface, in its widths.
const FLATNESS: f32 = 0.1;

/// Points to a chunk of work.
const CHUNK: usize = 1024;

/// How to start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartSettings {
    /// Most Gaussians; of more points, as many are chosen at random.
    pub budget: usize,
    /// Gaussians where the capture has no points.
    pub random: usize,
    /// Degree of the harmonics, 0 to 3.
    pub degree: u32,
    /// What the mean distance to neighbours is multiplied by.
    pub scale: f64,
    /// Opacity, between 0 and 1.
    pub opacity: f64,
    /// Of the choice among points, and of random Gaussians.
    pub seed: u64,
}

impl Default for StartSettings {
    fn default() -> Self {
        Self { budget: 1_000_000, random: 100_000, degree: 3, scale: 1.0, opacity: 0.1, seed: 0 }
    }
}

impl From<&TrainConfig> for StartSettings {
    fn from(config: &TrainConfig) -> Self {
        Self {
            budget: config.max_splats as usize,
            degree: config.degree,
            scale: config.init_scale,
            opacity: config.init_opacity,
            seed: config.seed,
            ..Self::default()
        }
    }
}

/// The Gaussians that training of a capture starts from, in the training frame: from its points where it has any, else random
/// within what the cameras look at.
///
/// # Errors
/// Where no search tree over the points can be built.
pub fn start(set: &PhotoSet, frame: &Frame, settings: &StartSettings) -> Result<Gaussians> {
    match set.points.positions.is_empty() {
        true => at_random(&set.cameras(), frame, settings),
        false => at_points(&set.points, frame, settings),
    }
}

/// Gaussians at points of the world, of their colours (grey where they have none), as wide as the points' spacing; flat on the
/// surface, where points have a normal.
fn at_points(points: &Points, frame: &Frame, settings: &StartSettings) -> Result<Gaussians> {
    let chosen = chosen(points.positions.len(), settings);
    let centres = chosen.iter().map(|i| frame.to_training.point(points.positions[*i as usize])).collect();
    let colour = |i: &u32| points.colours.get(*i as usize).map_or([0.5; 3], |c| c.map(|v| f64::from(v) / 255.0));
    let mut gaussians = gaussians(centres, chosen.iter().map(colour), settings)?;
    for (i, &point) in chosen.iter().enumerate() {
        let Some(normal) = points.normals.get(point as usize).filter(|normal| **normal != DVec3::ZERO) else {
            continue;
        };
        let turn = DQuat::from_rotation_arc(DVec3::Z, frame.to_training.direction(*normal));
        gaussians.rotations[i] = [turn.w, turn.x, turn.y, turn.z].map(|v| v as f32);
        gaussians.log_scales[i][2] += FLATNESS.ln();
    }
    Ok(gaussians)
}

/// Gaussians anywhere in the cube around what the cameras look at, of any colours.
fn at_random(cameras: &[Camera], frame: &Frame, settings: &StartSettings) -> Result<Gaussians> {
    let Volume { centre, radius } = cube(cameras, frame);
    let count = settings.random.min(settings.budget).min(u32::MAX as usize) as u32;
    let place = |i: u32| {
        let [x, y, z, _] = random::uniforms(settings.seed, PLACE_STREAM, i);
        centre + radius * (2.0 * DVec3::new(x, y, z) - 1.0)
    };
    let colour = |i: u32| {
        let [r, g, b, _] = random::uniforms(settings.seed, COLOUR_STREAM, i);
        [r, g, b]
    };
    gaussians((0..count).map(place).collect(), (0..count).map(colour), settings)
}

/// Middle and half the side of the cube that random Gaussians lie in, in the training frame.
fn cube(cameras: &[Camera], frame: &Frame) -> Volume {
    let ball = volume::around_focus(cameras).map(|Volume { centre, radius }| Volume {
        centre: frame.to_training.point(centre),
        radius: frame.to_training.length(radius),
    });
    // Cameras that turn on the spot look at themselves.
    ball.filter(|ball| ball.radius > 0.01).unwrap_or(Volume { centre: DVec3::ZERO, radius: REACH })
}

/// Which of `count` points are taken: all that the budget allows, in their order.
fn chosen(count: usize, settings: &StartSettings) -> Vec<u32> {
    let mut chosen: Vec<u32> = (0..count.min(u32::MAX as usize) as u32).collect();
    if chosen.len() > settings.budget {
        random::shuffle(&mut chosen, settings.seed, SUBSET_STREAM);
        chosen.truncate(settings.budget);
        chosen.sort_unstable();
    }
    chosen
}

/// Round Gaussians at `centres` with sRGB colours in [0, 1].
fn gaussians(
    centres: Vec<DVec3>,
    colours: impl Iterator<Item = [f64; 3]>,
    settings: &StartSettings,
) -> Result<Gaussians> {
    let count = centres.len();
    let log_scale = |spacing: &f64| [(settings.scale * spacing).ln() as f32; 3];
    let log_scales = spacings(&centres)?.iter().map(log_scale).collect();
    let row = 3 * coefficients(settings.degree);
    let mut harmonics = vec![0.0; row * count];
    for (harmonics, colour) in harmonics.chunks_exact_mut(row).zip(colours) {
        harmonics[..3].copy_from_slice(&colour.map(|value| ((value - 0.5) / CONSTANT) as f32));
    }
    Ok(Gaussians {
        centres,
        log_scales,
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; count],
        opacities: vec![(settings.opacity / (1.0 - settings.opacity)).ln() as f32; count],
        degree: settings.degree,
        harmonics,
        antialiased: false,
    })
}

/// Mean distance of each point to the three nearest others, within [`SCALES`].
fn spacings(centres: &[DVec3]) -> Result<Vec<f64>> {
    let [least, most] = SCALES;
    let positions: Vec<[f64; 3]> = centres.iter().map(DVec3::to_array).collect();
    if positions.is_empty() {
        return Ok(Vec::new());
    }
    let tree: ImmutableKdTree<f64, 3> = ImmutableKdTree::new_from_slice(&positions)
        .map_err(|e| Error::request(format!("points: no search tree over them can be built: {e}")))?;
    // The nearest of all is the point itself.
    let wanted = NonZero::new(NEIGHBOURS + 1).unwrap_or(NonZero::<usize>::MIN);
    let spacing = |p: &[f64; 3]| {
        let found = tree.query(p).nearest_n::<SquaredEuclidean<f64>>(wanted).execute();
        let mut distances: Vec<f64> = found.into_iter().map(|hit| hit.distance.sqrt()).collect();
        distances.sort_unstable_by(f64::total_cmp);
        let others = distances.get(1..).unwrap_or_default();
        if others.is_empty() { most } else { (others.iter().sum::<f64>() / others.len() as f64).clamp(least, most) }
    };
    let mut spacings = vec![0.0; positions.len()];
    in_parallel(&mut spacings, CHUNK, |chunk, values| {
        let positions = &positions[chunk * CHUNK..];
        values.iter_mut().zip(positions).for_each(|(value, p)| *value = spacing(p));
    });
    Ok(spacings)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::photos::Photo;
    use crate::scene::camera::{Intrinsics, Pose};
    use crate::scene::lens::Distortion;
    use crate::scene::similarity::Similarity;
    use crate::splats::config::Start;

    const STILL: Frame = Frame { to_training: Similarity::IDENTITY };

    fn cloud(positions: Vec<DVec3>) -> PhotoSet {
        PhotoSet { points: Points { positions, ..Points::default() }, ..PhotoSet::default() }
    }

    /// Scattered points, none twice.
    fn scattered(count: u32) -> Vec<DVec3> {
        (0..count).map(|i| DVec3::from_slice(&random::uniforms(7, 0, i)[..3])).collect()
    }

    fn scales(positions: Vec<DVec3>, settings: &StartSettings) -> Vec<f64> {
        let start = start(&cloud(positions), &STILL, settings).unwrap();
        assert!(start.log_scales.iter().all(|[x, y, z]| x == y && y == z));
        start.log_scales.iter().map(|[x, ..]| f64::from(*x).exp()).collect()
    }

    /// Computed directly. If this failed, the start would be a fog or a dust, and training slow.
    #[test]
    fn scales_are_mean_distances_to_three_neighbours() {
        let line: Vec<DVec3> = [0.0, 1.0, 3.0, 7.0, 20.0].iter().map(|x| 0.001 * *x * DVec3::X).collect();
        let expected = [11.0 / 3.0, 3.0, 3.0, 17.0 / 3.0, 49.0 / 3.0];
        for factor in [1.0, 0.1] {
            let found = scales(line.clone(), &StartSettings { scale: factor, ..StartSettings::default() });
            for (found, expected) in found.iter().zip(expected) {
                assert!((found / (0.001 * factor * expected) - 1.0).abs() < 1e-6, "{found} and {expected}");
            }
        }
        // Fewer neighbours than three; none; and one too far.
        let two = scales(vec![DVec3::ZERO, 0.02 * DVec3::Y], &StartSettings::default());
        assert!(two.iter().all(|scale| (scale - 0.02).abs() < 1e-8), "{two:?}");
        for lonely in [vec![DVec3::ONE], vec![DVec3::ZERO, DVec3::ONE]] {
            let scales = scales(lonely, &StartSettings::default());
            assert!(scales.iter().all(|scale| (scale - SCALES[1]).abs() < 1e-7), "{scales:?}");
        }
    }

    /// If this failed, points that lie twice in a cloud would be of no width, whose logarithm is infinite.
    #[test]
    fn points_at_one_place_have_a_width() {
        for count in [2, 4, 5, 3000] {
            let mut positions = vec![DVec3::splat(0.3); count];
            positions.push(DVec3::X);
            let scales = scales(positions, &StartSettings::default());
            let least = if count < 4 { SCALES[1] } else { SCALES[0] };
            assert!(scales[..count].iter().all(|scale| (scale / least - 1.0).abs() < 1e-5), "{count}: {:?}", scales[0]);
            assert!((scales[count] / SCALES[1] - 1.0).abs() < 1e-5);
        }
    }

    /// Against all pairs. If this failed, the tree would miss neighbours.
    #[test]
    fn neighbours_are_those_of_brute_force() {
        let mut positions = scattered(1500);
        positions.extend_from_within(..400);
        let found = spacings(&positions).unwrap();
        for (i, found) in found.iter().enumerate() {
            let others = positions.iter().enumerate().filter(|(j, _)| *j != i);
            let mut distances: Vec<f64> = others.map(|(_, p)| p.distance(positions[i])).collect();
            distances.sort_unstable_by(f64::total_cmp);
            let mean = (distances[..3].iter().sum::<f64>() / 3.0).clamp(SCALES[0], SCALES[1]);
            assert!((found - mean).abs() < 1e-12, "{found} and {mean}");
        }
    }

    /// Computed directly. If this failed, the first picture would have other colours than the points, or training begin in the
    /// wrong frame.
    #[test]
    fn points_become_round_gaussians_of_their_colours() {
        let mut set = cloud(scattered(10));
        set.points.colours = (0..10).map(|i| [25 * i, 255, 0]).collect();
        let frame = Frame { to_training: Similarity::to_unit_sphere(DVec3::X, 4.0) };
        let settings = StartSettings { degree: 2, opacity: 0.5, ..StartSettings::default() };
        let start = start(&set, &frame, &settings).unwrap();
        assert_eq!((start.len(), start.degree, start.harmonics.len()), (10, 2, 270));
        for i in 0..10 {
            assert_eq!(start.centres[i], (set.points.positions[i] - DVec3::X) / 4.0);
            assert_eq!((start.rotations[i], start.opacities[i]), ([1.0, 0.0, 0.0, 0.0], 0.0));
            let harmonics = &start.harmonics[27 * i..27 * (i + 1)];
            let colour: Vec<f32> = harmonics[..3].iter().map(|h| 255.0 * (0.5 + 0.282_094_8 * h)).collect();
            let expected = [25.0 * i as f32, 255.0, 0.0];
            assert!(colour.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3), "{colour:?}");
            assert!(harmonics[3..].iter().all(|h| *h == 0.0));
        }
        set.points.colours.clear();
        assert!(super::start(&set, &frame, &settings).unwrap().harmonics.iter().all(|h| *h == 0.0));
        let faint = super::start(&set, &frame, &StartSettings::default()).unwrap();
        assert!((f64::from(faint.opacities[0]) + 9f64.ln()).abs() < 1e-6);
    }

    /// If this failed, a short training would begin as a fog of balls, or with discs that stand on end.
    #[test]
    fn points_with_normals_become_discs_that_lie_on_the_surface() {
        let mut set = cloud(scattered(3));
        set.points.normals = vec![DVec3::new(0.6, 0.0, 0.8), DVec3::ZERO, -DVec3::Z];
        let turned = Similarity { rotation: DQuat::from_rotation_x(0.5), ..STILL.to_training };
        let start = start(&set, &Frame { to_training: turned }, &StartSettings::default()).unwrap();
        for (i, normal) in set.points.normals.iter().enumerate() {
            let [x, y, z] = start.log_scales[i];
            let flat = if *normal == DVec3::ZERO { 1.0 } else { FLATNESS };
            assert!(x == y && ((z - x).exp() - flat).abs() < 1e-6, "{i}");
            let [w, x, y, z] = start.rotations[i].map(f64::from);
            let thin = DQuat::from_xyzw(x, y, z, w) * DVec3::Z;
            assert!(flat == 1.0 || (thin - turned.direction(*normal)).length() < 1e-6, "{i}: {thin}");
        }
        let from = |set: &PhotoSet| Start::of(set);
        assert_eq!(from(&set), Start::Surface);
        set.points.normals = vec![DVec3::ZERO; 3];
        assert_eq!(from(&set), Start::Points);
        set.tracks = vec![Vec::new(); 3];
        assert_eq!(from(&set), Start::Random);
    }

    /// If this failed, a capture of many points would not fit the budget, or two runs differ.
    #[test]
    fn more_points_than_the_budget_are_thinned_by_the_seed() {
        let set = cloud(scattered(1000));
        let with =
            |budget, seed| start(&set, &STILL, &StartSettings { budget, seed, ..StartSettings::default() }).unwrap();
        let some = with(100, 1);
        assert_eq!(some, with(100, 1));
        assert_eq!(some.len(), 100);
        assert_ne!(some.centres, with(100, 2).centres);
        let mut places = some.centres.iter().map(|p| set.points.positions.iter().position(|q| q == p).unwrap());
        assert!(places.by_ref().is_sorted());
        // Spacings are those of the points that were taken.
        assert_eq!(
            some.log_scales,
            start(&cloud(some.centres.clone()), &STILL, &StartSettings::default()).unwrap().log_scales
        );
        assert_eq!(with(1000, 1).centres, set.points.positions);
    }

    fn photos(pose: impl Fn(f64) -> Pose) -> PhotoSet {
        let photo = |i: u32| {
            let intrinsics = Intrinsics::from_fov(400, 400, 0.7);
            let camera = Camera { name: format!("{i}"), pose: pose(f64::from(i)), intrinsics };
            Photo { camera, distortion: Distortion::default(), image: None, mask: None }
        };
        PhotoSet { photos: (0..20).map(photo).collect(), ..PhotoSet::default() }
    }

    /// If this failed, a synthetic scene, which has no points, would start with nothing where its object is.
    #[test]
    fn without_points_the_place_that_cameras_look_at_is_filled() {
        let at = DVec3::new(10.0, 20.0, 30.0);
        let away = |t: f64| 4.0 * DVec3::new(0.8 * t.cos(), 0.8 * t.sin(), 0.6);
        let settings = StartSettings { random: 5000, seed: 3, ..StartSettings::default() };
        let inward = photos(|t| Pose::looking(at + away(t), -away(t), DVec3::Z));
        let frame = Frame::new(&inward.cameras(), &[]);
        let start = |set: &PhotoSet| start(set, &Frame::new(&set.cameras(), &[]), &settings).unwrap();
        let world = frame.gaussians_to_world(start(&inward));
        assert_eq!((world.len(), &world), (5000, &frame.gaussians_to_world(start(&inward))));
        // What half the picture shows at the focus: 4 sin 0.35.
        let side = 4.0 * 0.35f64.sin();
        let reach = world.centres.iter().map(|p| (*p - at).abs().max_element()).fold(0.0, f64::max);
        assert!(reach <= side + 1e-9 && reach > 0.99 * side, "{reach} of {side}");
        let middle = world.centres.iter().sum::<DVec3>() / 5000.0;
        assert!(middle.distance(at) < 0.05, "{middle}");
        let red: Vec<f32> = world.harmonics.iter().step_by(48).map(|h| 0.5 + 0.282_094_8 * h).collect();
        let mean = red.iter().sum::<f32>() / 5000.0;
        assert!(red.iter().all(|r| (-1e-6..1.0).contains(r)) && (mean - 0.5).abs() < 0.02, "{mean}");
        // Looking outwards, and turning on the spot: three extents around the cameras.
        for set in [
            photos(|t| Pose::looking(at + away(t), away(t), DVec3::Z)),
            photos(|t| Pose::looking(at, away(t), DVec3::Z)),
        ] {
            let reach = start(&set).centres.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
            assert!(reach <= 3.0 && reach > 2.97, "{reach}");
        }
        let few = super::start(&inward, &frame, &StartSettings { budget: 70, ..settings }).unwrap();
        assert_eq!(few.len(), 70);
    }

    /// If this failed, a capture in millimetres would start otherwise than the same in metres.
    #[test]
    fn a_capture_in_another_unit_starts_the_same() {
        let settings = StartSettings { random: 500, ..StartSettings::default() };
        for points in [0, 200] {
            // A power of two: nothing is rounded otherwise.
            let starts = [1.0, 4096.0].map(|unit| {
                let away = |t: f64| DVec3::new(4.0 * t.cos(), 3.0 * t.sin(), 2.0);
                let mut set = photos(|t| Pose::looking(unit * (DVec3::X + away(t)), -away(t), DVec3::Z));
                set.points.positions = scattered(points).into_iter().map(|p| unit * p).collect();
                start(&set, &Frame::new(&set.cameras(), &set.points.positions), &settings).unwrap()
            });
            assert_eq!(starts[0], starts[1]);
            assert_eq!(starts[0].len(), if points > 0 { 200 } else { 500 });
        }
    }
}

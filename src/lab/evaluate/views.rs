//! Cameras around an object that no method chooses: of the input photos and of the tests.

use glam::{DQuat, DVec3};

use super::kind::Kind;
use super::settings::InputsFrom;
use crate::scene::camera::{Camera, Intrinsics, Pose};
use crate::scene::layouts;
use crate::scene::random;
use crate::scene::region::Region;
use crate::visibility::device_scene::SceneGeometry;
use crate::{Error, Result};

/// Seed, and streams of the test views, which are the same in all runs.
const SEED: u64 = 0x7465_7374;
const STREAMS: [u32; 3] = [1, 2, 3];
/// Stream of input views at random.
const INPUTS: u32 = 5;
/// Part of the surface's points that a test view of random orientation has in its picture.
const VISIBLE: f64 = 0.5;
/// Draws of a random test view; the next one looks at the centre.
const DRAWS: u32 = 10_000;

/// Input cameras in the middle of the region, looking in: on Fibonacci points of its sphere, at random, or on those of three times
/// as many Fibonacci points that are farthest to one side.
///
/// # Errors
/// Where the region is no shell.
pub fn inputs(
    (region, geometry): (&Region, &SceneGeometry),
    intrinsics: Intrinsics,
    from: InputsFrom,
    count: u32,
) -> Result<Vec<Camera>> {
    let to_internal = &geometry.to_internal;
    let free = |place| geometry.free.is_free(to_internal.point(place));
    let even_of = |count: u32| {
        layouts::even_where(region, count as usize, 0.5, DQuat::IDENTITY, free).map_err(|_| {
            Error::request(
                "input photos: region and limits leave hardly any of the sphere in the middle of the shell; allow more of it",
            )
        })
    };
    let even = even_of(count)?;
    let poses = match from {
        InputsFrom::Uniform => even,
        InputsFrom::Biased => {
            let mut poses = even_of(3 * count)?;
            let side = region.up.any_orthonormal_vector();
            let aside = |pose: &Pose| pose.forward().dot(side);
            poses.sort_by(|a, b| aside(a).total_cmp(&aside(b)));
            poses.truncate(count as usize);
            poses
        }
        InputsFrom::Random => {
            let (centre, _) = region.bounding_sphere();
            let anywhere = |(i, pose): (u32, &Pose)| {
                let drawn = (0..DRAWS).map(|draw| {
                    let [u, v, ..] = random::uniforms(SEED, INPUTS, i + draw * count);
                    let out = random::direction(u, v);
                    Pose::looking(centre + pose.position.distance(centre) * out, -out, region.up)
                });
                // Where hardly any position is free the even one is used.
                drawn.into_iter().find(|drawn| free(drawn.position)).unwrap_or(*pose)
            };
            (0..).zip(&even).map(anywhere).collect()
        }
    };
    Ok(poses.iter().enumerate().map(|(i, pose)| camera(format!("input_{i:04}"), *pose, intrinsics)).collect())
}

/// Test cameras, `count` of each set: on the spheres of half and of full radius of the region, looking in; and anywhere between
/// these spheres in random directions with at least half of the `points` of the surface in the picture.
pub fn tests(region: &Region, points: &[DVec3], intrinsics: Intrinsics, count: u32) -> Vec<Camera> {
    let (centre, radius) = region.bounding_sphere();
    let towards = |set: usize, i: u32| {
        let [u, v, ..] = random::uniforms(SEED, STREAMS[set], i);
        random::direction(u, v)
    };
    let looking_in = |set: usize, radius: f64, i: u32| {
        let out = towards(set, i);
        Pose::looking(centre + radius * out, -out, region.up)
    };
    let anywhere = |i: u32| {
        let drawn = (0..DRAWS).map(|draw| {
            let [u, v, w, _] = random::uniforms(SEED, STREAMS[2], i * DRAWS + draw);
            let [x, y, ..] = random::uniforms(SEED, STREAMS[2] + 1, i * DRAWS + draw);
            // Even in volume between the radii.
            let distance = radius * (0.125 + 0.875 * w).cbrt();
            Pose::looking(centre + distance * random::direction(u, v), random::direction(x, y), region.up)
        });
        let shows = |pose: &Pose| {
            let camera = camera(String::new(), *pose, intrinsics);
            let seen = points.iter().filter(|point| camera.sees(**point)).count();
            seen as f64 >= VISIBLE * points.len() as f64
        };
        drawn.into_iter().find(shows).unwrap_or_else(|| looking_in(2, radius, i))
    };
    let mut cameras = Vec::new();
    for (set, name) in Kind::Object.sets().iter().enumerate() {
        for i in 0..count {
            let pose = match set {
                0 => looking_in(set, 0.5 * radius, i),
                1 => looking_in(set, radius, i),
                _ => anywhere(i),
            };
            cameras.push(camera(format!("{name}_{i:04}"), pose, intrinsics));
        }
    }
    cameras
}

/// A camera of the evaluation's.
pub fn camera(name: String, pose: Pose, intrinsics: Intrinsics) -> Camera {
    Camera { name, pose, intrinsics }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::evaluate::settings::EvaluationSettings;
    use crate::scene::limits::{Limits, Wall};
    use crate::scene::proxy::{Orientation, Proxy};
    use crate::scene::samples;

    /// If this failed, input photos would be taken from behind a wall, and show methods its back.
    #[test]
    fn inputs_keep_the_limits() {
        let region = Region::around_object((DVec3::ZERO, 0.5), 25f64.to_radians(), DVec3::Y, None).unwrap();
        let proxy = Proxy::new(&samples::sphere(0.5, 12), Orientation::Trusted).unwrap();
        let wall = Wall { point: DVec3::new(-0.6, 0.0, 0.0), normal: DVec3::X };
        let limits = Limits { walls: vec![wall], ..Limits::default() };
        let geometry = SceneGeometry::among(&proxy, &region, &limits).unwrap();
        for from in [InputsFrom::Uniform, InputsFrom::Random, InputsFrom::Biased] {
            let cameras = inputs((&region, &geometry), EvaluationSettings::QUICK.intrinsics(), from, 20).unwrap();
            assert_eq!(cameras.len(), 20);
            assert!(cameras.iter().all(|camera| camera.pose.position.x > -0.6), "{from:?}");
        }
    }

    /// If this failed, photos from one side would be from all around, or those at random even.
    #[test]
    fn inputs_stand_where_they_should() {
        let region = Region::around_object((DVec3::ONE, 0.5), 25f64.to_radians(), DVec3::Y, None).unwrap();
        let ball = samples::sphere(0.05, 12);
        let proxy = Proxy::new(&ball, Orientation::Trusted).unwrap();
        let geometry = SceneGeometry::new(&proxy, &region).unwrap();
        let places = |from| -> Vec<DVec3> {
            let cameras = inputs((&region, &geometry), EvaluationSettings::QUICK.intrinsics(), from, 20).unwrap();
            cameras.iter().map(|camera| camera.pose.position - DVec3::ONE).collect()
        };
        let (even, random, side) =
            (places(InputsFrom::Uniform), places(InputsFrom::Random), places(InputsFrom::Biased));
        let middle = even[0].length();
        assert!([&even, &random, &side].iter().all(|places| places.len() == 20));
        assert!(even.iter().chain(&random).chain(&side).all(|place| (place.length() - middle).abs() < 1e-9));
        let mean = |places: &[DVec3]| places.iter().sum::<DVec3>() / (20.0 * middle);
        let least = |places: &[DVec3]| {
            let apart = |i: usize| (0..i).map(move |j| places[i].angle_between(places[j]));
            (1..20).flat_map(apart).fold(f64::INFINITY, f64::min)
        };
        // Of a third of the sphere the mean is two thirds of the radius from the centre.
        let towards = mean(&side);
        assert!(mean(&even).length() < 0.05 && (towards.length() - 2.0 / 3.0).abs() < 0.05, "{towards}");
        assert!(towards.y.abs() < 0.1, "from above or below: {towards}");
        assert!(mean(&random).length() < 0.5 && least(&random) < 0.5 * least(&even), "{}", least(&random));
    }

    /// If this failed, tests would be of views that show nothing, or of other distances than the table states.
    #[test]
    fn test_views_stand_where_they_should_and_see_the_object() {
        let region = Region::around_object((DVec3::ONE, 0.5), 25f64.to_radians(), DVec3::Y, None).unwrap();
        let points: Vec<DVec3> = (0..100)
            .map(|i| {
                let [u, v, ..] = random::uniforms(0, 0, i);
                DVec3::ONE + 0.5 * random::direction(u, v)
            })
            .collect();
        let cameras = tests(&region, &points, EvaluationSettings::QUICK.intrinsics(), 30);
        let full = region.bounding_sphere().1;
        assert_eq!(cameras.len(), 90);
        for camera in &cameras {
            let distance = camera.pose.position.distance(DVec3::ONE) / full;
            let seen = points.iter().filter(|point| camera.sees(**point)).count();
            let aside = camera.pose.forward().angle_between(DVec3::ONE - camera.pose.position);
            let (low, high, least) = match camera.name.split('_').next() {
                // The outline of a ball so near reaches beyond the picture.
                Some("half") => (0.5, 0.5, 1),
                Some("full") => (1.0, 1.0, 100),
                _ => (0.5, 1.0, 50),
            };
            assert!(low - 1e-9 <= distance && distance <= high + 1e-9, "{}: {distance}", camera.name);
            assert!(seen >= least, "{}: {seen}", camera.name);
            assert!(camera.name.starts_with("random") || aside < 1e-6, "{}: {aside}", camera.name);
        }
    }
}

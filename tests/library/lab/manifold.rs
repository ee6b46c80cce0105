//! Manifold sampling on the device: perturbed pictures and the noise's steps against the twin, and the resulting cameras.

use std::ops::ControlFlow;

use crate::support::device::{context, silent};
use crate::support::splats::{Draws, scene, twin_view, view};
use camsplat::lab::baselines::manifold::{self, ManifoldSettings};
use camsplat::planner::plan::config::Preset;
use camsplat::planner::plan::problem::Problem;
use camsplat::planner::plan::target::{RegionChoice, Target};
use camsplat::planner::select::information::Model;
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::gaussians::Gaussians;
use camsplat::scene::random;
use camsplat::scene::region::Shape;
use camsplat::scene::samples;
use camsplat::splats::render::layout::{self, HARMONICS, OPACITY};
use camsplat::splats::render::rasterizer::Size;
use camsplat::splats::twin::{self, Rules};
use camsplat::splats::uncertainty::manifold::{Manifold, learnt, perturbation, rate};
use camsplat::{Error, Result};
use glam::DVec3;

const SEED: u64 = 0x5_0000_0003;

/// Noise in all parameters, a part of the rates' bound.
fn noise(gaussians: &Gaussians, part: f64) -> Vec<f32> {
    let (count, mut draw) = (gaussians.len(), Draws::new(4));
    let planes = layout::planes(gaussians.degree);
    (0..planes * count).map(|i| rate(i / count) * (part * (1.0 + draw.one())) as f32).collect()
}

/// The model as a draw moves it.
fn moved(gaussians: &Gaussians, scales: &[f32], draw: u32) -> Gaussians {
    let count = gaussians.len();
    let base = layout::to_planes(gaussians, gaussians.degree, count);
    let value = |(i, value): (usize, &f32)| value + scales[i] * perturbation(SEED, i as u32, draw);
    let values: Vec<f32> = base.iter().enumerate().map(value).collect();
    layout::from_planes(&values, gaussians.degree, count, count)
}

/// If this failed, views would be compared by another variance than that of their pictures, or each under other perturbations.
#[test]
fn the_spread_is_the_variance_of_perturbed_pictures() -> Result<()> {
    let context = context();
    let size = Size { width: 37, height: 29 };
    let other = {
        let mut other = view(size.width, size.height);
        other.focal = [30.0, 31.0];
        other
    };
    let views = [view(size.width, size.height), other];
    for (degree, antialiased) in [(0, false), (2, false), (1, true)] {
        let gaussians = scene(60 + u64::from(degree), 120, degree);
        let scales = noise(&gaussians, 20.0);
        let mut manifold = Manifold::new(&context, &gaussians, size, antialiased, (SEED, 1.0))?;
        manifold.set_scales(&scales)?;
        assert_eq!(manifold.scales()?, scales);
        let found = manifold.spread(&views, 5..9)?;
        let rules = Rules { antialiased, ..Rules::default() };
        for (view, found) in views.iter().zip(&found) {
            let picture = |draw| {
                let splats = twin::splats(&moved(&gaussians, &scales, draw));
                twin::render(&splats, &twin_view(view), &rules, DVec3::ZERO).colour
            };
            let pictures: Vec<Vec<DVec3>> = (5..9).map(picture).collect();
            let pixels = pictures[0].len();
            let variance = |i: usize| {
                let mean = pictures.iter().map(|picture| picture[i]).sum::<DVec3>() / 4.0;
                pictures.iter().map(|picture| (picture[i] - mean).length_squared()).sum::<f64>() / 3.0
            };
            let expected = (0..pixels).map(variance).sum::<f64>() / pixels as f64;
            assert!((found - expected).abs() < 2e-3 * expected, "degree {degree}: {found}, not {expected}");
        }
        // Alone, a view is worth the same; with other draws it is not.
        assert_eq!(manifold.spread(&views[1..], 5..9)?[0], found[1]);
        assert_ne!(manifold.spread(&views[1..], 9..13)?[0], found[1]);
    }
    let gaussians = scene(60, 5, 0);
    let mut manifold = Manifold::new(&context, &gaussians, size, false, (SEED, 1.0))?;
    assert_eq!(manifold.spread(&views, 0..4)?, [0.0; 2]);
    assert!(manifold.spread(&[view(8, 8)], 0..4).is_err() && manifold.spread(&views, 0..1000).is_err());
    silent(&context);
    Ok(())
}

/// If this failed, noise would grow where pictures suffer from it, and only worse plans would show it.
#[test]
fn noise_takes_the_steps_of_the_twin() -> Result<()> {
    let context = context();
    let size = Size { width: 33, height: 35 };
    let view = view(size.width, size.height);
    let reward = 2e-3;
    for (degree, antialiased) in [(0, false), (2, true)] {
        let gaussians = scene(70 + u64::from(degree), 90, degree);
        let count = gaussians.len();
        let scales = noise(&gaussians, 20.0);
        let mut manifold = Manifold::new(&context, &gaussians, size, antialiased, (SEED, reward))?;
        manifold.set_scales(&scales)?;
        let rules = Rules { antialiased, ..Rules::default() };
        let render = |gaussians: &Gaussians| {
            twin::render(&twin::splats(gaussians), &twin_view(&view), &rules, DVec3::ZERO).colour
        };
        let target = render(&gaussians);
        let mut expected: Vec<f64> = scales.iter().map(|scale| f64::from(*scale)).collect();
        let mut moments = vec![[0.0; 2]; expected.len()];
        let worth = f64::from(reward) / (3.0 * count as f64);
        let mut doubtful = vec![false; expected.len()];
        for step in 0..2u32 {
            manifold.learn(&view, 3)?;
            let now: Vec<f32> = expected.iter().map(|scale| *scale as f32).collect();
            let perturbed = moved(&gaussians, &now, step);
            let pixels = target.len();
            let by_colour: Vec<DVec3> =
                render(&perturbed).iter().zip(&target).map(|(x, y)| 2.0 / (3 * pixels) as f64 * (*x - *y)).collect();
            let splats = twin::splats(&perturbed);
            let by = twin::gradients(&splats, &twin_view(&view), &rules, DVec3::ZERO, &by_colour);
            for (i, expected) in expected.iter_mut().enumerate() {
                let (plane, by) = (i / count, &by[i % count]);
                let by_parameter = match plane {
                    0..3 => by.centre[plane],
                    3..6 => by.log_scale[plane - 3],
                    6..10 => by.rotation[plane - 6],
                    OPACITY => by.opacity,
                    _ => by.harmonics[(plane - HARMONICS) / 3][(plane - HARMONICS) % 3],
                };
                let draw = f64::from(perturbation(SEED, i as u32, step));
                // Adam's first steps follow the sign alone, which rounding may turn where both sides are all but equal.
                doubtful[i] |= (draw * by_parameter - worth).abs() < 0.02 * worth.max((draw * by_parameter).abs());
                let rate = f64::from(rate(plane));
                *expected = learnt(*expected, by_parameter, draw, worth, &mut moments[i], rate, step as i32 + 1);
            }
        }
        let off = |i: usize, found: f32| {
            (f64::from(found) - expected[i]).abs() > 0.05 * f64::from(rate(i / count)) && !doubtful[i]
        };
        let wrong = manifold.scales()?.into_iter().enumerate().filter(|(i, found)| off(*i, *found)).count();
        let sure = doubtful.iter().filter(|doubtful| !**doubtful).count();
        assert!(wrong * 200 < sure && sure * 10 > 9 * expected.len(), "{wrong} of {sure} are off");
    }
    silent(&context);
    Ok(())
}

/// A ball of opaque Gaussians about the origin.
fn ball() -> Gaussians {
    let mut gaussians = Gaussians { degree: 0, ..Gaussians::default() };
    for i in 0..200 {
        let [u, v, w, x] = random::uniforms(8, 0, i);
        gaussians.centres.push(random::direction(u, v));
        gaussians.log_scales.push([-1.8; 3]);
        gaussians.rotations.push([1.0, 0.0, 0.0, 0.0]);
        gaussians.opacities.push(4.0);
        gaussians.harmonics.extend([w, x, u].map(|colour| (2.0 * colour - 1.0) as f32));
    }
    gaussians
}

/// If this failed, a model would be thought certain of what no view has shown.
#[test]
fn what_no_view_shows_keeps_its_noise() -> Result<()> {
    let context = context();
    let gaussians = ball();
    let size = Size { width: 40, height: 40 };
    let view = view(size.width, size.height);
    let mut manifold = Manifold::new(&context, &gaussians, size, false, (SEED, ManifoldSettings::default().reward))?;
    for _ in 0..150 {
        manifold.learn(&view, 1)?;
    }
    let scales = manifold.scales()?;
    let eye = DVec3::from(view.position.map(f64::from)).normalize();
    let mean = |keep: &dyn Fn(f64) -> bool| {
        let kept: Vec<f32> = (0..gaussians.len())
            .filter(|i| keep(gaussians.centres[*i].dot(eye)))
            .flat_map(|i| [0, 1, 2].map(|c| scales[(HARMONICS + c) * gaussians.len() + i]))
            .collect();
        kept.iter().sum::<f32>() / kept.len() as f32
    };
    let (seen, hidden) = (mean(&|height| height > 0.6), mean(&|height| height < -0.2));
    assert!(hidden > 0.9 * 100.0 * rate(HARMONICS) && seen < 0.5 * hidden, "{seen} of what is seen, {hidden}");
    silent(&context);
    Ok(())
}

/// If this failed, cameras would be placed where the model is known, or two runs place them in two ways.
#[test]
fn cameras_are_placed_where_no_view_has_been() -> Result<()> {
    let context = context();
    let shape = Shape::Shell { centre: DVec3::ZERO, r_min: 2.8, r_max: 3.4 };
    let choice = RegionChoice { shape: Some(shape), floor: None, clearance: Some(0.0), stood: None };
    let model = Model { path: "ball".into(), gaussians: ball(), antialiased: false };
    let intrinsics = Intrinsics::from_fov(96, 96, 0.8);
    let kept: Vec<Camera> = (0..8)
        .map(|i| {
            let [u, v, ..] = random::uniforms(6, 0, i);
            let out = (random::direction(u, v) + 1.4 * DVec3::X).normalize();
            Camera { name: format!("{i}"), pose: Pose::looking(3.0 * out, -out, DVec3::Z), intrinsics }
        })
        .collect();
    let target = Target::new(&samples::object(), "object", Preset::Object, &choice, DVec3::Z, &intrinsics)?;
    let settings = ManifoldSettings { learn: 150, steps: 10, rate: 0.02, side: 48, ..ManifoldSettings::default() };
    let place = |kept: &[Camera], count: usize, mut most: usize| {
        let mut go_on = || {
            most = most.wrapping_sub(1);
            if most == usize::MAX { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let problem = Problem::new(&target, intrinsics, kept)?;
        manifold::place(&context, &problem, &model, (settings, 2), count, &mut go_on)
    };
    let whole = |kept: &[Camera], count| place(kept, count, count);
    let placed = whole(&kept, 2)?;
    assert_eq!(placed.len(), 2);
    for pose in &placed {
        assert!((pose.position.length() - 3.1).abs() < 1e-6 && pose.position.x < 0.0, "{}", pose.position);
    }
    assert_eq!(whole(&kept, 2)?, placed);
    assert!(matches!(place(&kept, 2, 1), Err(Error::Interrupted)), "stopped before the second");
    // Without views, four come first; fewer than four are of these.
    assert_eq!(whole(&[], 3)?.len(), 3);
    silent(&context);
    Ok(())
}

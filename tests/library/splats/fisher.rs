//! Information of views about a model, on the device, against the twin in double precision: Fisher information, coverage.

use crate::support::device::{context, silent};
use crate::support::splats::{Draws, scene, twin_view};
use camsplat::Result;
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::gaussians::Gaussians;
use camsplat::splats::render::frame::Frame;
use camsplat::splats::render::layout;
use camsplat::splats::twin::{self, Rules};
use camsplat::splats::uncertainty::cover::{Cover, bins};
use camsplat::splats::uncertainty::fisher::{Criterion, Fisher};
use glam::DVec3;

const LAMBDA: f32 = 1e-6;

/// Cameras on a sphere that look past the origin; extents of 1, so that the frame only moves.
fn cameras(count: usize, width: u32, height: u32) -> Vec<Camera> {
    let mut draw = Draws::new(5);
    let mut camera = |i: usize| {
        let position = 3.0 * draw.vector().normalize();
        let pose = Pose::looking(position, 0.2 * draw.vector() - position, DVec3::Z);
        Camera { name: format!("{i}"), pose, intrinsics: Intrinsics::from_fov(width, height, 0.9) }
    };
    (0..count).map(&mut camera).collect()
}

/// Planes of a view's information, rotations left out, as the twin has them.
fn expected(gaussians: &Gaussians, cameras: &[Camera], view: usize, antialiased: bool) -> Vec<Vec<f64>> {
    let frame = Frame::new(cameras, &gaussians.centres);
    let splats = twin::splats(&frame.gaussians_to_training(gaussians.clone()));
    let rules = Rules { antialiased, ..Rules::default() };
    let information = twin::fisher::information(&splats, &twin_view(&frame.view(&cameras[view])), &rules);
    let mut planes = vec![vec![0.0; gaussians.len()]; layout::planes(gaussians.degree)];
    for (i, splat) in information.iter().enumerate() {
        let mut put =
            |plane: usize, values: &[f64]| values.iter().zip(plane..).for_each(|(v, plane)| planes[plane][i] = *v);
        put(layout::CENTRE, &splat.centre.to_array());
        put(layout::LOG_SCALE, &splat.log_scale.to_array());
        put(layout::OPACITY, &[splat.opacity]);
        splat.harmonics.iter().enumerate().for_each(|(k, h)| put(layout::HARMONICS + 3 * k, &h.to_array()));
    }
    planes
}

/// Squares cannot be checked by descending: a wrong form would only rank views otherwise, and nothing else would show it.
#[test]
fn the_information_of_a_view_agrees_with_the_twin() -> Result<()> {
    let context = context();
    let cases = [
        ("one splat", 1, 0, 40, 24, false),
        ("odd size, degree 1", 60, 1, 37, 29, false),
        ("smaller than a tile", 40, 2, 9, 5, false),
        ("degree 3", 200, 3, 33, 35, false),
        ("antialiased", 200, 3, 33, 35, true),
    ];
    for (seed, (name, count, degree, width, height, antialiased)) in cases.into_iter().enumerate() {
        let (gaussians, cameras) = (scene(seed as u64 + 20, count, degree), cameras(4, width, height));
        let mut fisher = Fisher::new(&context, gaussians.clone(), &cameras, antialiased, LAMBDA)?;
        fisher.learn(1)?;
        let known = fisher.known()?;
        for (plane, want) in expected(&gaussians, &cameras, 1, antialiased).iter().enumerate() {
            let got = &known[plane * count..][..count];
            let size = want.iter().map(|v| v * v).sum::<f64>().sqrt();
            let error = got.iter().zip(want).map(|(a, b)| (f64::from(*a) - b).powi(2)).sum::<f64>().sqrt();
            assert!(error <= 1e-4 * size, "{name}: plane {plane} is off by {error} of {size}");
        }
    }
    silent(&context);
    Ok(())
}

/// If this failed, the view that is chosen would not be the one that adds most to what is known.
#[test]
fn what_a_view_is_worth_is_its_information_over_what_is_known() -> Result<()> {
    let context = context();
    let (gaussians, cameras) = (scene(31, 80, 1), cameras(5, 32, 24));
    let mut fisher = Fisher::new(&context, gaussians.clone(), &cameras, false, 1e-2)?;
    fisher.learn(0)?;
    fisher.learn(3)?;
    let of = |view| expected(&gaussians, &cameras, view, false).concat();
    let known: Vec<f64> = of(0).iter().zip(of(3)).map(|(a, b)| a + b).collect();
    for view in 0..5 {
        let want: f64 = of(view).iter().zip(&known).map(|(h, known)| h / (known + 1e-2)).sum();
        let got = fisher.worth(view)?;
        assert!((got - want).abs() <= 1e-3 * want, "view {view} is worth {got}, not {want}");
        assert_eq!(got, fisher.worth(view)?);
    }
    assert!(fisher.worth(5).is_err());
    // The rises of the determinant's logarithm and of the trace of a diagonal matrix.
    let logs = |h: f64, known: f64| (h + known + 1e-2).ln() - (known + 1e-2).ln();
    for (criterion, by) in [(Criterion::Determinant, &logs as &dyn Fn(f64, f64) -> f64), (Criterion::Trace, &|h, _| h)]
    {
        fisher = fisher.by(criterion);
        let want: f64 = of(2).iter().zip(&known).map(|(h, known)| by(*h, *known)).sum();
        let got = fisher.worth(2)?;
        assert!((got - want).abs() <= 1e-3 * want, "{criterion:?}: {got}, not {want}");
    }
    silent(&context);
    Ok(())
}

/// If this failed, COVER would go where the model has been seen from, or nowhere.
#[test]
fn what_is_not_covered_agrees_with_the_definition() -> Result<()> {
    let context = context();
    let (gaussians, cameras) = (scene(41, 90, 0), cameras(6, 40, 30));
    let mut cover = Cover::new(&context, gaussians.clone(), &cameras, false)?;
    let frame = Frame::new(&cameras, &gaussians.centres);
    let splats = twin::splats(&frame.gaussians_to_training(gaussians));
    let parts = |view: usize| -> Vec<f64> {
        let view = twin_view(&frame.view(&cameras[view]));
        let reds = vec![DVec3::X; view.pixels()];
        let by = twin::projected_gradients(&splats, &view, &Rules::default(), DVec3::ZERO, &reds);
        by.iter().map(|by| by.colour.x).collect()
    };
    let from = |view: usize, i: usize| (twin_view(&frame.view(&cameras[view])).centre() - splats[i].centre).normalize();
    let mut seen = vec![Vec::<DVec3>::new(); splats.len()];
    for taken in [None, Some(2), Some(5)] {
        if let Some(taken) = taken {
            cover.learn(taken)?;
            for (i, _) in parts(taken).iter().enumerate().filter(|(_, part)| **part > 0.0) {
                let nearest = bins().into_iter().max_by(|a, b| a.dot(from(taken, i)).total_cmp(&b.dot(from(taken, i))));
                seen[i].extend(nearest);
            }
        }
        for view in 0..6 {
            let parts = parts(view);
            let coverage =
                |i: usize| 0.5 * (1.0 + seen[i].iter().map(|bin| bin.dot(from(view, i))).fold(-1.0, f64::max));
            let covered: f64 = parts.iter().enumerate().map(|(i, part)| part * coverage(i)).sum();
            let (want, got) = (1.0 - covered / parts.iter().sum::<f64>(), cover.worth(view)?);
            assert!((got - want).abs() < 1e-4, "view {view} after {taken:?}: {got}, not {want}");
        }
    }
    silent(&context);
    Ok(())
}

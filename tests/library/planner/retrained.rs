//! FisherRF with training between its choices, on a small capture.

use crate::support::device::{context, silent};
use crate::support::splats::capture;
use camsplat::files::io::photos::{self, ReadOptions};
use camsplat::files::photos::{Photo, PhotoSet};
use camsplat::planner::plan::config::Preset;
use camsplat::planner::plan::target::{RegionChoice, Target};
use camsplat::planner::select::pool::Pool;
use camsplat::planner::select::retrained::{self, RetrainingSettings};
use camsplat::planner::select::sight::Sight;
use camsplat::scene::surface::Surface;
use camsplat::{Error, Result};
use glam::DVec3;

/// A capture of a ball of Gaussians about the origin, and its surface.
fn captured() -> (tempfile::TempDir, PhotoSet, Target) {
    let folder = tempfile::tempdir().unwrap();
    capture::write(folder.path(), 14, 32);
    let set = photos::read(folder.path(), &ReadOptions::default()).unwrap();
    let intrinsics = set.photos[0].camera.intrinsics;
    let surface = Surface::Points(set.points.clone());
    let choice = RegionChoice::default();
    let target = Target::new(&surface, "points", Preset::Object, &choice, DVec3::Z, &intrinsics).unwrap();
    (folder, set, target)
}

/// What is chosen, and the photos that were taken for it, by index.
fn choose(
    set: &PhotoSet,
    target: &Target,
    must: &[usize],
    (count, every): (usize, u32),
) -> Result<(Vec<usize>, Vec<usize>)> {
    let context = context();
    let allowed: Vec<usize> = (0..set.photos.len()).collect();
    let sight = Sight::empty(0, set.photos.len());
    let pool = Pool { set, region: &target.region, sight: &sight, include: must, allowed: &allowed, count, seed: 5 };
    let mut taken = Vec::new();
    let mut photograph = |photo: &Photo| {
        taken.extend(set.photos.iter().position(|other| other.camera.name == photo.camera.name));
        Ok(photo.clone())
    };
    let settings = RetrainingSettings { every, max_splats: 200, ..RetrainingSettings::default() };
    let chosen = retrained::fisher(&context, &pool, &target.proxy, settings, &mut photograph)?;
    silent(&context);
    Ok((chosen, taken))
}

/// If this failed, the model would not be trained on what was chosen, on something else as well, or two runs would choose two
/// ways.
#[test]
fn every_view_is_photographed_once_before_the_next_is_chosen() -> Result<()> {
    let (_folder, set, target) = captured();
    let (chosen, taken) = choose(&set, &target, &[], (7, 4))?;
    assert_eq!(chosen.len(), 7);
    // The last is trained on by the caller.
    assert_eq!(taken, chosen[..6]);
    let mut sorted = chosen.clone();
    sorted.sort_unstable();
    sorted.dedup();
    assert_eq!(sorted.len(), 7, "{chosen:?}");
    assert_eq!(choose(&set, &target, &[], (7, 4))?.0, chosen);
    // The first four are there before anything is trained; if no more are requested, nothing is.
    let (few, taken) = choose(&set, &target, &[], (4, 4))?;
    assert_eq!((&few[..], &taken[..]), (&chosen[..4], &[][..]));
    Ok(())
}

/// If this failed, the choice would not be by what the views so far do not show.
#[test]
fn the_next_view_is_from_the_side_that_has_not_been_seen() -> Result<()> {
    let (_folder, set, target) = captured();
    let position = |photo: usize| set.photos[photo].camera.pose.position;
    let mut by_side: Vec<usize> = (0..set.photos.len()).collect();
    by_side.sort_by(|a, b| position(*b).x.total_cmp(&position(*a).x));
    let mut must = by_side[..5].to_vec();
    must.sort_unstable();
    // Long enough for the fog that training starts with to become a surface that hides what is behind it.
    let (chosen, taken) = choose(&set, &target, &must, (6, 60))?;
    assert_eq!((&chosen[..5], &taken), (&must[..], &must));
    let away = |photo: usize| {
        let angles = must.iter().map(|known| position(*known).angle_between(position(photo)));
        angles.fold(f64::INFINITY, f64::min)
    };
    let mut free: Vec<f64> = by_side[5..].iter().map(|photo| away(*photo)).collect();
    free.sort_by(f64::total_cmp);
    assert!(away(chosen[5]) > free[free.len() / 2], "{} of {free:?}", away(chosen[5]));
    Ok(())
}

/// If this failed, a stop would take effect after hours.
#[test]
fn a_photograph_that_is_not_taken_ends_the_choice() -> Result<()> {
    let (_folder, set, target) = captured();
    let context = context();
    let allowed: Vec<usize> = (0..set.photos.len()).collect();
    let sight = Sight::empty(0, set.photos.len());
    let pool =
        Pool { set: &set, region: &target.region, sight: &sight, include: &[], allowed: &allowed, count: 9, seed: 5 };
    let mut left = 5;
    let mut photograph = |photo: &Photo| {
        left -= 1;
        if left > 0 { Ok(photo.clone()) } else { Err(Error::Interrupted) }
    };
    let settings = RetrainingSettings { every: 2, max_splats: 200, ..RetrainingSettings::default() };
    let ended = retrained::fisher(&context, &pool, &target.proxy, settings, &mut photograph);
    assert!(matches!(ended, Err(Error::Interrupted)));
    assert_eq!(left, 0);
    Ok(())
}

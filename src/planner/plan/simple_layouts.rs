//! Simple layouts that a plan begins from, and is never worse than.

use glam::{DQuat, DVec3};

use super::config::{Config, Preset};
use crate::Result;
use crate::planner::quality::viewers::Viewers;
use crate::scene::camera::{Camera, Pose};
use crate::scene::layouts;
use crate::scene::region::Shape;
use crate::visibility::device_scene::SceneGeometry;

/// Cameras in all the turned even spheres together. Two rotations of 20 views differ by 0.2 dB when trained, which expected
/// quality predicts in part, and the more views there are the less a rotation matters (docs/results/objects.md).
const TURNED: u32 = 640;
/// Fewest and most rotations.
const ROTATIONS: [u32; 2] = [8, 32];

/// A simple layout: its name, and the ways to place it, of which the best by expected quality is taken.
pub(crate) type Family = (String, Vec<Vec<Pose>>);

/// Simple layouts of `config.views` cameras in the planner's frame, at free places: around an object the even sphere in the middle of
/// the shell, as much of it as is feasible for cameras, in several rotations, and where people look from one side only, as much
/// of that; in a room a grid at eye height and rings along the walls; cameras at random in both. Beside cameras that are kept,
/// which are given in the user's world, also what is left of an even sphere for all when each of them has taken the place that is
/// nearest to it.
pub fn layouts(config: &Config, geometry: &SceneGeometry, kept: &[Camera]) -> Vec<Family> {
    let (views, seed) = (config.views as usize, config.seed);
    let inward = config.preset == Preset::Object;
    let mut layouts: Vec<Family> = Vec::new();
    if let (true, Shape::Shell { r_min, r_max, .. }) = (inward, geometry.region.shape) {
        let rotations = (TURNED / config.views.max(1)).clamp(ROTATIONS[0], ROTATIONS[1]);
        let even = |count: usize, rotations: u32, viewers: &Viewers| {
            let turned = |index| even_layout(geometry, viewers, count, layouts::turn(&geometry.region, seed, index));
            (0..rotations).filter_map(|index| turned(index).ok()).collect::<Vec<_>>()
        };
        let radius = 0.5 * (r_min + r_max) / r_max;
        let mut add = |name: String, ways: Vec<Vec<Pose>>| {
            // Where the region leaves no sphere in any rotation there is none.
            if !ways.is_empty() {
                layouts.push((name, ways));
            }
        };
        add(format!("even sphere at {radius:.2} of the outer radius"), even(views, rotations, &Viewers::Region));
        if matches!(config.viewers, Viewers::Cone { .. } | Viewers::Heights { .. }) {
            let name = format!("even at {radius:.2} of the outer radius where viewers are");
            add(name, even(views, rotations, &config.viewers));
        }
        if !kept.is_empty() {
            let taken: Vec<DVec3> =
                kept.iter().map(|camera| geometry.to_internal.point(camera.pose.position)).collect();
            let all = even(views + kept.len(), ROTATIONS[1], &Viewers::Region);
            let left = all.into_iter().map(|poses| layouts::left_beside(poses, &taken)).collect();
            add("even sphere less the cameras that are kept".to_owned(), left);
        }
    }
    if !inward {
        layouts.push(("grid at eye height".to_owned(), vec![layouts::grid(&geometry.free, views)]));
        layouts.push(("rings along the walls".to_owned(), vec![layouts::rings(&geometry.free, views)]));
    }
    layouts.push(("random".to_owned(), vec![layouts::random(&geometry.free, views, seed, inward)]));
    for pose in layouts.iter_mut().flat_map(|(_, ways)| ways).flatten() {
        pose.position = geometry.settle(pose.position);
    }
    layouts
}

/// Cameras even over the part of the sphere in the middle of the shell where positions are feasible and viewers look from.
///
/// # Errors
/// Where the region is no shell, or leaves hardly any of that sphere.
pub(crate) fn even_layout(geometry: &SceneGeometry, viewers: &Viewers, count: usize, turn: DQuat) -> Result<Vec<Pose>> {
    let allowed = |place| geometry.free.is_free(place) && viewers.face(geometry, place);
    layouts::even_where(&geometry.region, count, 0.5, turn, allowed)
}

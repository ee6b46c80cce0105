//! Simple layouts that a plan begins from, and is never worse than.

use glam::DVec3;

use super::config::{Config, Preset};
use crate::Result;
use crate::scene::baselines;
use crate::scene::camera::{Camera, Pose};
use crate::scene::region::Shape;
use crate::visibility::device_scene::SceneGeometry;

/// Cameras in all the turned even spheres together. Two rotations of 20 views train 0.2 dB apart, which expected quality tells in
/// part, and the more views there are the less a rotation matters (docs/quality.md).
const TURNED: u32 = 640;
/// Fewest and most rotations.
const ROTATIONS: [u32; 2] = [8, 32];

/// A simple layout: its name, and the ways to place it, of which the best by expected quality is taken.
pub type Family = (String, Vec<Vec<Pose>>);

/// Simple layouts of `config.views` cameras in the planner's frame, at free places: the even sphere in the middle of the shell around
/// an object, in several rotations; in a room a grid at eye height; cameras at random in both. Beside cameras that are kept, which are given in the user's world,
/// also what is left of an even sphere for all when each of them has taken the place that is nearest to it.
pub fn layouts(config: &Config, geometry: &SceneGeometry, kept: &[Camera]) -> Vec<Family> {
    let (views, seed) = (config.views as usize, config.seed);
    let inward = config.preset == Preset::Object;
    let mut layouts: Vec<Family> = Vec::new();
    if let (true, Shape::Shell { r_min, r_max, .. }) = (inward, geometry.region.shape) {
        let rotations = 0..(TURNED / config.views.max(1)).clamp(ROTATIONS[0], ROTATIONS[1]);
        let turned = |index| baselines::turn(&geometry.region, seed, index);
        let turned = rotations.map(|index| baselines::even_shell(&geometry.region, views, 0.5, turned(index)));
        // Where the floor leaves no sphere there is none in any rotation.
        if let Ok(poses) = turned.collect::<Result<Vec<_>>>() {
            layouts.push((format!("even sphere at {:.2} of the outer radius", 0.5 * (r_min + r_max) / r_max), poses));
        }
        let turned = |index| baselines::turn(&geometry.region, seed, index);
        let all = views + kept.len();
        let left = (0..ROTATIONS[1]).map(|index| baselines::even_shell(&geometry.region, all, 0.5, turned(index)));
        if let (false, Ok(ways)) = (kept.is_empty(), left.collect::<Result<Vec<_>>>()) {
            let taken: Vec<DVec3> =
                kept.iter().map(|camera| geometry.to_internal.point(camera.pose.position)).collect();
            let left = ways.into_iter().map(|poses| less(poses, &taken)).collect();
            layouts.push(("even sphere less the cameras that are kept".to_owned(), left));
        }
    }
    if !inward {
        layouts.push(("grid at eye height".to_owned(), vec![baselines::grid(&geometry.free, views)]));
    }
    layouts.push(("random".to_owned(), vec![baselines::random(&geometry.free, views, seed, inward)]));
    for pose in layouts.iter_mut().flat_map(|(_, ways)| ways).flatten() {
        pose.position = geometry.settle(pose.position);
    }
    layouts
}

/// The poses that are left when each of these places, one after the other, has taken the one nearest to it.
fn less(mut poses: Vec<Pose>, taken: &[DVec3]) -> Vec<Pose> {
    for place in taken {
        let away = |pose: &Pose| pose.position.distance_squared(*place);
        let nearest = (0..poses.len()).min_by(|a, b| away(&poses[*a]).total_cmp(&away(&poses[*b])));
        nearest.map(|nearest| poses.swap_remove(nearest));
    }
    poses
}

//! Simple layouts that a plan begins from, and is never worse than.

use super::config::{Config, Preset};
use crate::scene::baselines;
use crate::scene::camera::Pose;
use crate::scene::region::Shape;
use crate::visibility::device_scene::SceneGeometry;

/// Parts of the way through the shell that even layouts stand at, each turned in its own way: nearer to either end photographs of
/// an object train worse (docs/quality.md).
const PARTS: [f64; 6] = [0.5, 0.5, 0.5, 0.5, 0.35, 0.65];

/// Simple layouts of `config.views` cameras in the planner's frame, each at free places: even spheres at several distances around
/// an object; in a room a grid at eye height; cameras at random in both.
pub fn layouts(config: &Config, geometry: &SceneGeometry) -> Vec<(String, Vec<Pose>)> {
    let (views, seed) = (config.views as usize, config.seed);
    let inward = config.preset == Preset::Object;
    let mut layouts = Vec::new();
    if let (true, Shape::Shell { r_min, r_max, .. }) = (inward, geometry.region.shape) {
        for (part, index) in PARTS.into_iter().zip(0..) {
            let turn = baselines::turn(&geometry.region, seed, index);
            if let Ok(poses) = baselines::even_shell(&geometry.region, views, part, turn) {
                let distance = (r_min + part * (r_max - r_min)) / r_max;
                layouts.push((format!("even sphere at {distance:.2} of the outer radius"), poses));
            }
        }
    }
    if !inward {
        layouts.push(("grid at eye height".to_owned(), baselines::grid(&geometry.free, views)));
    }
    layouts.push(("random".to_owned(), baselines::random(&geometry.free, views, seed, inward)));
    for (_, poses) in &mut layouts {
        for pose in poses {
            pose.position = geometry.settle(pose.position);
        }
    }
    layouts
}

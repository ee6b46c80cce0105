//! Which points of the surface become point cameras, and what they ask for.

use std::sync::Arc;

use super::config::{Config, Preset};
use crate::scene::harmonics;
use crate::scene::proxy::SurfacePoint;
use crate::visibility::device_scene::DeviceScene;
use crate::visibility::probe_depth::ProbeMaps;
use crate::vulkan::Context;
use crate::{Error, Result};

/// The points that some feasible position sees, as far as a coarse map can tell; the others would only dilute a batch.
pub(super) fn reachable(
    context: &Arc<Context>,
    scene: &DeviceScene,
    points: Vec<SurfacePoint>,
    preset: Preset,
) -> Result<Vec<SurfacePoint>> {
    let maps = ProbeMaps::new(context, scene, &points, 16)?;
    let seen: Vec<SurfacePoint> =
        points.into_iter().zip(&maps.probes).filter(|(_, probe)| probe.sky > 0.0).map(|(point, _)| point).collect();
    if seen.is_empty() {
        let outside = match preset {
            Preset::Object => "",
            Preset::Room => ", or give --preset object for a surface that is seen from outside",
        };
        return Err(Error::request(format!(
            "no point of the surface can be seen from the region; move or enlarge it (--shell, --box, --floor, --clearance){outside}"
        )));
    }
    Ok(seen)
}

/// How the targets of `points` vary with direction; empty where they do not or shall not.
pub(super) fn lobes(config: &Config, points: &[SurfacePoint]) -> Vec<harmonics::Lobe> {
    let varies = points.iter().any(|point| point.lobe != harmonics::Lobe::default());
    let wanted = varies && config.vds && config.directional;
    if wanted { points.iter().map(|point| point.lobe).collect() } else { Vec::new() }
}

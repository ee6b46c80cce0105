//! Which points of the surface become point cameras.

use std::sync::Arc;

use super::config::Preset;
use crate::engine::vulkan::Context;
use crate::scene::proxy::SurfacePoint;
use crate::visibility::device_scene::DeviceScene;
use crate::visibility::probe_depth::{Probe, ProbeMaps};
use crate::{Error, Result};

/// Texels along a side of the maps that test which points can be seen.
const COARSE: u32 = 16;

/// Maps, with `resolution` texels along a side, of the points that some feasible position sees, as far as a coarse map shows;
/// the others would only dilute a batch.
pub(super) fn reachable(
    context: &Arc<Context>,
    scene: &DeviceScene,
    points: Vec<SurfacePoint>,
    resolution: u32,
    preset: Preset,
) -> Result<ProbeMaps> {
    let maps = ProbeMaps::new(context, scene, &points, COARSE)?;
    let seen = |probe: &Probe| probe.sky > 0.0;
    let points: Vec<SurfacePoint> =
        points.into_iter().zip(&maps.probes).filter(|(_, probe)| seen(probe)).map(|(point, _)| point).collect();
    if points.is_empty() {
        return Err(unseen(preset));
    }
    // Few views need no finer ones.
    match resolution {
        COARSE => maps.with(context, seen),
        _ => {
            drop(maps);
            ProbeMaps::new(context, scene, &points, resolution)
        }
    }
}

/// The error where the region sees nothing of the surface.
pub(super) fn unseen(preset: Preset) -> Error {
    let outside = match preset {
        Preset::Object => ", or give `preset` room for a room that is seen from inside",
        Preset::Room => ", or give `preset` object for a surface that is seen from outside",
    };
    Error::request(format!(
        "no point of the surface can be seen from the region; move or enlarge it (`shell`, `box`, `floor`, `clearance`){outside}"
    ))
}

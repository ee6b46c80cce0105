//! How much device memory a plan takes, known before anything is allocated.

use super::buffers;
use super::config::Config;
use super::objective::Objective;
use super::shared::Settings;
use crate::Result;
use crate::engine::vulkan::Context;
use crate::engine::vulkan::footprint::Footprint;
use crate::planner::metrics::score_point;

/// What the metrics need beside everything else: depth maps of the held-out points, and lists of directions.
const HELD_OUT: &str = "held-out metrics";
/// The scene's buffers.
const SCENE: &str = "surface and region";

/// The buffers of a plan; `scene` is the size of surface and region on the device.
pub(super) fn footprint(
    context: &Context,
    settings: &Settings,
    config: &Config,
    objective: &dyn Objective,
    scene: u64,
) -> Footprint {
    let mut found = vec![(SCENE, scene)];
    found.extend(buffers::sizes(settings, config.checkpoint_every));
    found.extend(objective.buffers(context, settings, block(settings, config, objective)));
    found.push((HELD_OUT, score_point::footprint(2 * u64::from(config.held_out), settings.splats.into())));
    Footprint { buffers: found, several: [&[SCENE, HELD_OUT], objective.several()].concat() }
}

/// Checks a plan's footprint against the device.
///
/// # Errors
/// As for [`Footprint::check`].
pub fn check(footprint: &Footprint, context: &Context) -> Result<()> {
    footprint.check(context, "the plan", |name| match name {
        HELD_OUT => "use fewer held-out points (`held_out`)",
        "history" => "run fewer iterations (`iterations`)",
        "snapshots" => "plan fewer views, or take fewer checkpoints (`checkpoint_every`)",
        _ => "plan fewer views, or use fewer probes (`probes`) or texels (`resolution`)",
    })
}

/// Refuses counts that no surface could make fit the device, before the host has placed a single splat.
///
/// # Errors
/// As for [`check`].
pub(super) fn check_counts(settings: &Settings, config: &Config, context: &Context) -> Result<()> {
    check(&Footprint { buffers: buffers::sizes(settings, config.checkpoint_every), several: Vec::new() }, context)
}

/// Iterations of a block of commands: snapshots, and what the objective does between iterations, all fall on the start of one.
pub(super) fn block(s: &Settings, config: &Config, objective: &dyn Objective) -> u32 {
    // Intervals longer than the run never occur, except at the start.
    let within = |every: u32| if every > s.iterations { 0 } else { every };
    let (mut common, mut rest) = (within(config.checkpoint_every.max(1)), within(objective.period()));
    while rest > 0 {
        (common, rest) = (rest, common % rest);
    }
    if common > 0 { common } else { s.iterations }
}

//! The paper's objective (docs/reference/method.md): points of the surface are cameras that see the splats of the planned cameras, and
//! their pictures should be evenly bright.

mod binned;
mod capacity;
mod config;
pub mod dense;
mod pass;
pub mod regulariser;
pub mod relocate;
pub mod scale;
pub mod shared;
mod start_scale;
mod state;

use std::sync::Arc;

pub use capacity::largest;
pub use config::{Kernel, MAX_DENSE, PaperConfig, Pass, Start};
pub use pass::PaperPass;
use shared::{PaperConstants, PaperSettings, Scale, Tally};

use self::capacity::Capacity;
use super::config::{Config, Preset};
use super::objective::{self, Objective};
use super::preparation::PROBE_STREAM;
use super::problem::Problem;
use super::shared::{CameraState, Gradient, Settings};
use crate::engine::vulkan::Context;
use crate::engine::vulkan::footprint::Footprint;
use crate::engine::vulkan::physical::Physical;
use crate::scene::proxy::SurfacePoint;
use crate::scene::random;
use crate::visibility::device_scene::DeviceScene;
use crate::visibility::probe_depth::Probe;
use crate::{Error, Result};

/// Pairs of texel and visible splat an iteration from which on binning pays; see docs/results/planner.md.
const DENSE_WORK: f64 = 3e7;

/// Words of the mailbox that are this objective's.
pub(super) mod mailbox {
    use crate::planner::plan::clock::mailbox::OWN;

    /// Most splats that any probe saw in the dense pass, where these were more than the capacity.
    pub const MAX_VISIBLE: usize = OWN;
    /// Most (probe, splat) pairs that any iteration of the binned pass needed.
    pub const MAX_PAIRS: usize = OWN + 1;
    /// Most (tile, splat) instances that any iteration of the binned pass needed.
    pub const MAX_INSTANCES: usize = OWN + 2;
}

/// The objective, ready for a problem.
#[derive(Clone)]
struct Paper {
    settings: PaperSettings,
    constants: PaperConstants,
    preset: Preset,
    points: Vec<SurfacePoint>,
    start_scale: f32,
    round_length: u32,
    binned: bool,
}

/// Draws the probes from the surface and settles scale, resolution and capacity for the cameras at the start, which it gathers in one place
/// where that is asked for.
///
/// # Errors
/// A configuration that does not suit the problem or the device.
pub(super) fn prepare(
    context: &Context,
    problem: &Problem<'_>,
    config: &Config,
    own: &PaperConfig,
    start: &mut [CameraState],
) -> Result<Arc<dyn Objective>> {
    let (geometry, physical) = (&*problem.geometry, context.physical());
    if own.start == Start::Identical {
        start_scale::identical(&mut start[problem.kept.len()..], config, geometry);
    }
    let mut points = problem.points(own.pool as usize, config, PROBE_STREAM)?;
    random::shuffle(&mut points, config.seed, PROBE_STREAM);
    let few: Vec<Probe> = points.iter().take(start_scale::PROBES).map(|point| Probe::new(point, geometry)).collect();
    let visible = start_scale::visible(start, &few, geometry);
    let start_scale = own.scale.unwrap_or_else(|| start_scale::scale(visible.seen));
    let resolution = own.resolution.unwrap_or_else(|| start_scale::resolution(start_scale));
    points.truncate(capacity::pool(points.len(), config.probes, resolution, physical));

    let (probes, splats) = (config.probes.min(points.len() as u32), start.len() as u32);
    let binned = match own.pass {
        Pass::Dense => false,
        Pass::Binned => true,
        Pass::Auto => {
            let work = f64::from(probes * resolution * resolution) * visible.gated;
            work > DENSE_WORK || splats > MAX_DENSE
        }
    };
    if !binned && splats > MAX_DENSE {
        return Err(Error::request(format!(
            "the dense pass takes at most {MAX_DENSE} cameras; use `pass` binned or auto"
        )));
    }
    if u64::from(probes) * u64::from(splats) > 1 << 28 {
        return Err(Error::request(format!(
            "{splats} cameras times {probes} point cameras a step is more than 2^28; use fewer probes (`probes`)"
        )));
    }
    let [threads, each] = dense_shape(physical);
    let room = Capacity::new([splats, probes], visible.gated, binned, start_scale, resolution, physical);
    let settings = PaperSettings {
        probes,
        pool: points.len() as u32,
        capacity: room.pairs,
        row: if binned { 0 } else { room.pairs },
        instances: room.instances,
        blocks: if binned { 1 } else { (resolution * resolution).div_ceil(threads * each) },
        seed: (config.seed ^ (config.seed >> 32)) as u32,
        relocate_every: if own.iterative { 0 } else { own.relocate_every },
        relocate_until: (own.relocate_until * config.iterations as f32) as u32,
        weighted: own.vds as u32,
        equal: own.equal_probes as u32,
        alpha: own.alpha,
        gate_softness: config.gate_softness,
        lr_scale: if own.iterative { 0.0 } else { own.lr_scale },
        lambda_reg: own.lambda_reg,
        lambda_scale: own.lambda_scale,
        scale_floor: 0.5 * start_scale,
    };
    let (gate, kernel, occlusion) = (config.gate, own.kernel, own.occlusion);
    Ok(Arc::new(Paper {
        settings,
        constants: PaperConstants { resolution, gate, kernel, occlusion, threads, each },
        preset: config.preset,
        points,
        start_scale,
        round_length: if own.iterative { (config.iterations / 5).max(1) } else { 0 },
        binned,
    }))
}

impl Objective for Paper {
    fn round_length(&self) -> u32 {
        self.round_length
    }

    fn period(&self) -> u32 {
        self.settings.relocate_every
    }

    fn buffers(&self, context: &Context, run: &Settings, _block: u32) -> Vec<(&'static str, u64)> {
        let (s, resolution) = (&self.settings, self.constants.resolution);
        let (splats, probes, texels) = (u64::from(run.splats), u64::from(s.probes), u64::from(resolution * resolution));
        let rows = probes * u64::from(s.blocks) * u64::from(s.capacity);
        let of = |size: usize, count: u64| size as u64 * count;
        let mut buffers = vec![
            ("slots", 4 * probes * splats),
            ("partials", of(size_of::<Gradient>(), if self.binned { s.capacity.into() } else { rows })),
            ("paper", size_of::<PaperSettings>() as u64),
            ("scale", size_of::<Scale>() as u64),
            ("probes", of(size_of::<Probe>(), s.pool.into())),
            ("depth", 4 * u64::from(s.pool) * texels),
            ("directions", 16 * texels),
            ("tallies", of(size_of::<Tally>(), probes * u64::from(s.blocks))),
            ("deficit", 4 * probes * texels),
            ("order", 4 * splats),
        ];
        match self.binned {
            true => buffers.extend(binned::footprint(context, run, s, resolution)),
            false => buffers.push(("visible", 4 * rows)),
        }
        buffers
    }

    fn several(&self) -> &'static [&'static str] {
        &["sort", "scan"]
    }

    fn on_device(
        &self,
        context: &Arc<Context>,
        scene: &Arc<DeviceScene>,
        run: &Settings,
        footprint: &Footprint,
    ) -> Result<Box<dyn objective::Pass>> {
        Ok(Box::new(PaperPass::new(context, scene, run, self, footprint)?))
    }

    fn with_capacity(&self, [pairs, instances]: [u32; 2]) -> Option<Arc<dyn Objective>> {
        if !self.binned {
            return None;
        }
        let mut larger = self.clone();
        let s = &mut larger.settings;
        // A quarter more than the run needed.
        s.capacity = s.capacity.max(pairs.saturating_add(pairs / 4));
        s.instances = s.instances.max(instances.saturating_add(instances / 4));
        Some(Arc::new(larger))
    }
}

/// Threads of a workgroup of the dense pass and texels of a thread: many small workgroups fill a GPU; on a CPU fewer
/// threads do more each, since a barrier costs each of them a switch.
fn dense_shape(physical: &Physical) -> [u32; 2] {
    if physical.is_cpu() { [64, 4] } else { [256, 1] }
}

//! Expected quality, the default objective (docs/reference/quality.md): the error that viewers are expected to see of what the photographs
//! train, by a law that was fitted to trained splats.

mod config;
pub mod links;
mod pass;
pub mod shared;
pub mod viewed;

use std::sync::Arc;

pub use config::QualityConfig;
use links::Links;
pub use pass::QualityPass;
use shared::{Anchor, QualitySettings, ViewerLoss};

use self::viewed::{TOGETHER, draws, lanes};
use super::config::{Config, Preset};
use super::gate::Gate;
use super::objective::{Objective, Pass};
use super::preparation::{PROBE_STREAM, Preparation};
use super::problem::Problem;
use super::shared::{CameraState, Gradient, Settings};
use crate::engine::vulkan::Context;
use crate::engine::vulkan::footprint::Footprint;
use crate::planner::quality::expected::{LOOKS, MAX_ON_CPU};
use crate::planner::quality::law::Law;
use crate::planner::quality::look::{Look, Surroundings, Viewer};
use crate::scene::camera::Intrinsics;
use crate::scene::proxy::SurfacePoint;
use crate::scene::random;
use crate::visibility::device_scene::{DeviceScene, SceneGeometry};
use crate::{Error, Result};

/// Points that test whether the region sees the surface at all.
const REACHABLE: u32 = 256;
/// Key that separates the viewers of a run from those that judge it.
const VIEWER_SEED: u64 = 0x6c6f_6f6b;

/// The objective, ready for a problem.
#[derive(Clone)]
struct Quality {
    settings: QualitySettings,
    gate: Gate,
    preset: Preset,
    seed: u32,
    points: Vec<SurfacePoint>,
    /// What looks are drawn from, and what they take of the surface.
    viewers: Vec<Viewer>,
    around: Surroundings,
    law: Law,
    /// Threads of a look.
    lanes: u32,
    /// Which cameras are neighbours, where they are to connect.
    links: Option<Arc<Links>>,
}

/// Draws the viewers of a run.
///
/// # Errors
/// A configuration that does not suit the problem or the device.
pub(super) fn prepare(
    context: &Context,
    problem: &Problem<'_>,
    config: &Config,
    own: &QualityConfig,
    start: &[CameraState],
) -> Result<Arc<dyn Objective>> {
    let (geometry, proxy, splats) = (&*problem.geometry, &problem.target.proxy, start.len() as u32);
    if context.physical().is_cpu() && splats > MAX_ON_CPU {
        return Err(Error::request(format!(
            "on a CPU device expected quality is of at most {MAX_ON_CPU} cameras, and these are {splats}; use a GPU, or fewer"
        )));
    }
    if own.connect.is_some() && splats > links::MAX_CAMERAS {
        return Err(Error::request(format!(
            "`connect` is for at most {} cameras, and these are {splats}; plan fewer, or leave it out",
            links::MAX_CAMERAS
        )));
    }
    let viewers = viewers(config, geometry, &problem.viewers_lens)?;
    let mut points = problem.points(REACHABLE as usize, config, PROBE_STREAM)?;
    random::shuffle(&mut points, config.seed, PROBE_STREAM);
    let links = Links::of(own, proxy, geometry, config.seed).map(Arc::new);
    let settings = QualitySettings {
        viewers: config.probes,
        gate_softness: config.gate_softness,
        link_angle: own.connect.unwrap_or(0.0).to_radians(),
    };
    let law = own.law.on_device();
    Ok(Arc::new(Quality {
        settings,
        gate: config.gate,
        preset: config.preset,
        seed: (config.seed ^ (config.seed >> 32)) as u32,
        points,
        viewers,
        around: Surroundings::new(geometry, proxy.sphere, config.preset == Preset::Object, &law),
        law,
        lanes: lanes(context.physical()),
        links,
    }))
}

/// Viewers of a whole run: those of each iteration are its own.
fn viewers(config: &Config, geometry: &SceneGeometry, intrinsics: &Intrinsics) -> Result<Vec<Viewer>> {
    let count = config.iterations.saturating_mul(config.probes).min(config::MAX_VIEWERS);
    let inward = config.preset == Preset::Object;
    let cameras = config.viewers.sample(geometry, *intrinsics, inward, config.seed ^ VIEWER_SEED, count)?;
    Ok(cameras.iter().map(|camera| Viewer::new(camera, geometry)).collect())
}

impl Objective for Quality {
    fn period(&self) -> u32 {
        if self.links.is_some() { links::EVERY } else { 0 }
    }

    fn buffers(&self, _context: &Context, run: &Settings, block: u32) -> Vec<(&'static str, u64)> {
        let (viewers, splats) = (u64::from(self.settings.viewers), u64::from(run.splats));
        let looks = viewers * u64::from(LOOKS);
        let drawn = looks * u64::from(draws(self.settings.viewers, block));
        let (starts, anchors) = if self.links.is_some() { (splats + 1, links::anchors(splats)) } else { (1, 1) };
        let of = |size: usize, count: u64| size as u64 * count;
        vec![
            // Three partials a look.
            ("slots", 4 * 3 * looks),
            ("partials", of(size_of::<Gradient>(), 3 * looks)),
            ("quality", size_of::<QualitySettings>() as u64),
            ("viewer losses", of(size_of::<ViewerLoss>(), viewers)),
            ("viewers", of(size_of::<Viewer>(), self.viewers.len() as u64)),
            ("looks", of(size_of::<Look>(), drawn)),
            ("errors", 4 * looks),
            ("viewer arrivals", 4 * viewers),
            ("anchor starts", 4 * starts),
            ("anchors", of(size_of::<Anchor>(), anchors)),
        ]
    }

    fn on_device(
        &self,
        context: &Arc<Context>,
        scene: &Arc<DeviceScene>,
        run: &Settings,
        footprint: &Footprint,
    ) -> Result<Box<dyn Pass>> {
        Ok(Box::new(QualityPass::new(context, scene, run, self, footprint)?))
    }
}

impl Preparation {
    /// The same run with several threads to a look, or one, instead of what suits the device; as it is where another objective is minimised.
    pub fn with_shared_looks(self, context: &Context, shared: bool) -> Self {
        let objective: &dyn std::any::Any = &*self.objective;
        let Some(own) = objective.downcast_ref::<Quality>().cloned() else { return self };
        self.with_objective(context, Arc::new(Quality { lanes: if shared { TOGETHER } else { 1 }, ..own }))
    }
}

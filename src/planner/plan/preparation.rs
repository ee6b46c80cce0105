//! What is fixed of a run before the device has allocated anything.

use std::sync::Arc;

use super::config::{Config, MAX_VIEWS};
use super::objective::Objective;
use super::problem::Problem;
use super::shared::{CameraState, Settings};
use super::{footprint, start};
use crate::engine::vulkan::Context;
use crate::engine::vulkan::footprint::Footprint;
use crate::scene::camera::{Camera, Pose};
use crate::visibility::device_scene::SceneGeometry;
use crate::{Error, Result};

/// Stream of the surface's samples for probes; held-out points take another.
pub(crate) const PROBE_STREAM: u32 = 0;

/// Everything about a run that is known before the device has allocated anything.
#[derive(Clone)]
pub struct Preparation {
    pub(super) config: Config,
    pub(super) settings: Settings,
    pub(super) start: Vec<CameraState>,
    pub(super) objective: Arc<dyn Objective>,
    pub(super) scene_bytes: u64,
    pub(super) footprint: Footprint,
}

impl Preparation {
    /// Places the splats; `prepare` makes the objective ready for them, kept ones first.
    ///
    /// # Errors
    /// A configuration that makes no sense, and those of `prepare`.
    pub(crate) fn of(
        context: &Context,
        problem: &Problem<'_>,
        config: Config,
        prepare: impl FnOnce(&Config, &mut Vec<CameraState>) -> Result<Arc<dyn Objective>>,
    ) -> Result<Self> {
        config.validate()?;
        if config.views > MAX_VIEWS {
            return Err(Error::request(format!("`views` is {}; give at most {MAX_VIEWS}", config.views)));
        }
        let kept = u32::try_from(problem.kept.len()).unwrap_or(u32::MAX);
        let mut settings = Settings {
            splats: config.views.saturating_add(kept),
            kept,
            iterations: config.iterations,
            round_length: 0,
            lr_position: config.lr_position,
            lr_direction: config.lr_direction,
            decay: config.decay,
            lambda_bound: config.lambda_bound,
        };
        footprint::check_counts(&settings, &config, context)?;
        let kept = problem.kept.iter().map(|camera| splat(camera, &problem.geometry));
        let mut start: Vec<CameraState> =
            kept.chain(start::splats(&config, &problem.geometry, |j| problem.lens_of(j))).collect();
        let objective = prepare(&config, &mut start)?;
        settings.round_length = objective.round_length();
        if settings.round_length > 0 {
            settings.iterations = settings.round_length.saturating_mul(config.views);
        }
        let scene_bytes = problem.geometry.bytes();
        let footprint = footprint::footprint(context, &settings, &config, &*objective, scene_bytes);
        Ok(Self { config, settings, start, objective, scene_bytes, footprint })
    }

    /// The same run with this objective.
    pub(super) fn with_objective(mut self, context: &Context, objective: Arc<dyn Objective>) -> Self {
        self.footprint = footprint::footprint(context, &self.settings, &self.config, &*objective, self.scene_bytes);
        self.objective = objective;
        self
    }

    /// The same run from other places: poses of the planned splats in the planner's frame.
    pub fn starting_from(mut self, poses: &[Pose]) -> Self {
        for (splat, pose) in self.start[self.settings.kept as usize..].iter_mut().zip(poses) {
            splat.place(pose);
        }
        self
    }

    /// Device memory that the run takes.
    pub fn footprint(&self) -> &Footprint {
        &self.footprint
    }
}

/// A camera of the user's world as a splat.
pub(super) fn splat(camera: &Camera, geometry: &SceneGeometry) -> CameraState {
    let [tan_x, tan_y] = start::tangents(&camera.intrinsics);
    let mut splat = CameraState { tan_x, tan_y, ..CameraState::default() };
    splat.place(&geometry.to_internal.pose(&camera.pose));
    splat
}

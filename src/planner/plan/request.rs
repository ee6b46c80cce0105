//! The library's entry point: a plan in one expression.

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::DVec3;

use super::config::{Config, Preset};
use super::pipeline::{self, Plan, PlanEvent, Tools};
use super::problem::Problem;
use super::target::{RegionChoice, Target};
use crate::engine::vulkan::{Context, ContextOptions};
use crate::files::io::checks;
use crate::planner::quality::viewers::Viewers;
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::limits::Limits;
use crate::scene::region::Shape;
use crate::scene::surface::Surface;
use crate::{Error, Result};

/// Plans `views` cameras for a surface: around an object, with 800 x 800 pixels and a field of view of 50 degrees, +Y up, unless the
/// request says otherwise. Lengths are in the surface's units, positions in its frame.
///
/// ```
/// use camsplat::scene::samples;
///
/// let plan = camsplat::plan(&samples::object(), 12).up(glam::DVec3::Z).floor(0.0).run()?;
/// for camera in &plan.record.cameras {
///     let forward = camera.pose.rotation * glam::DVec3::Z; // OpenCV axes: x right, y down, z forward
///     println!("{} stands at {} and looks along {forward}", camera.name, camera.pose.position);
/// }
/// # assert_eq!(plan.record.cameras.len(), 12);
/// # assert!(plan.record.cameras.iter().all(|camera| camera.pose.position.z >= 0.0));
/// # Ok::<(), camsplat::Error>(())
/// ```
pub fn plan(surface: &Surface, views: u32) -> PlanRequest<'_> {
    PlanRequest {
        surface,
        config: Config::new(Preset::Object, views),
        iterations: None,
        choice: RegionChoice::default(),
        limits: Limits::default(),
        up: DVec3::Y,
        lens: Intrinsics::from_fov(800, 800, 50f64.to_radians()),
        kept: Vec::new(),
    }
}

/// The request for [`plan()`]. What is left out follows from the surface.
#[derive(Clone, Debug)]
#[must_use = "a request plans nothing until it is run"]
pub struct PlanRequest<'s> {
    surface: &'s Surface,
    config: Config,
    iterations: Option<u32>,
    choice: RegionChoice,
    limits: Limits,
    up: DVec3,
    lens: Intrinsics,
    kept: Vec<Camera>,
}

impl PlanRequest<'_> {
    /// The cameras are inside a room, not around an object.
    pub fn room(mut self) -> Self {
        let Config { seed, views, viewers, .. } = self.config;
        self.config = Config { seed, viewers, ..Config::new(Preset::Room, views) };
        self
    }

    /// The region of the cameras: a shell or a box.
    pub fn region(mut self, shape: Shape) -> Self {
        self.choice.shape = Some(shape);
        self
    }

    /// Cameras and viewers stay above this height along up.
    pub fn floor(mut self, height: f64) -> Self {
        self.choice.floor = Some(height);
        self
    }

    /// No camera is closer to the surface than this.
    pub fn clearance(mut self, distance: f64) -> Self {
        self.choice.clearance = Some(distance);
        self
    }

    /// Walls, volumes to keep out of, heights and walkable ground.
    pub fn limits(mut self, limits: Limits) -> Self {
        self.limits = limits;
        self
    }

    /// Which way is up: a direction of any length.
    pub fn up(mut self, up: DVec3) -> Self {
        self.up = up;
        self
    }

    /// The intrinsics that all planned cameras share.
    pub fn lens(mut self, lens: Intrinsics) -> Self {
        self.lens = lens;
        self
    }

    /// Cameras that exist already: they count, and never move.
    pub fn keep(mut self, cameras: &[Camera]) -> Self {
        self.kept = cameras.to_vec();
        self
    }

    /// Where viewers will look from at the trained model.
    pub fn viewers(mut self, viewers: Viewers) -> Self {
        self.config.viewers = viewers;
        self
    }

    /// Another seed gives another plan; the same seed the same bits on the same device and driver.
    pub fn seed(mut self, seed: u64) -> Self {
        self.config.seed = seed;
        self
    }

    /// So many iterations in place of what does for an object (100) or a room (600).
    pub fn iterations(mut self, iterations: u32) -> Self {
        self.iterations = Some(iterations);
        self
    }

    /// Plans on the best Vulkan device there is.
    ///
    /// # Errors
    /// As [`Self::run_on`]; also where no Vulkan device is found.
    pub fn run(self) -> Result<Plan> {
        self.run_on(&Context::new(&ContextOptions::default())?)
    }

    /// Plans on a device that is open already, such as one that [`Context::adopt`] took over from a host application.
    ///
    /// # Errors
    /// [`crate::Error::Request`] where surface, region, limits or configuration make no sense or leave cameras no place,
    /// and where the device fails or has too little memory.
    pub fn run_on(self, context: &Arc<Context>) -> Result<Plan> {
        self.run_watched(context, |_, _| ControlFlow::Continue(()))
    }

    /// As [`Self::run_on`]. `observe` is called every few milliseconds with the iterations that are done and all of them, and may end
    /// the descent early; the plan is what there is by then, and [`Plan::interrupted`].
    ///
    /// # Errors
    /// As [`Self::run_on`].
    pub fn run_watched(
        self,
        context: &Arc<Context>,
        mut observe: impl FnMut(u32, u32) -> ControlFlow<()>,
    ) -> Result<Plan> {
        let Self { surface, mut config, iterations, choice, limits, up, lens, kept } = self;
        config.iterations = iterations.unwrap_or(config.iterations);
        config.validate()?;
        checks::sound("surface".as_ref(), surface)?;
        if !kept.is_empty() {
            checks::cameras("kept cameras".as_ref(), kept.iter())?;
        }
        let up = up.try_normalize().ok_or_else(|| Error::request(format!("`up` is {up}; give a direction")))?;
        let sizes = lens.width > 0 && lens.height > 0;
        if !sizes || !lens.focal.iter().all(|focal| focal.is_finite() && *focal > 0.0) {
            return Err(Error::request(format!(
                "the lens has {} x {} pixels and focal lengths of {:?}; give numbers above zero",
                lens.width, lens.height, lens.focal
            )));
        }
        let target = Target::new(surface, "surface", config.preset, &choice, up, &lens)?.within(limits)?;
        let observe = |event| match event {
            PlanEvent::Iterations(done, all) => observe(done, all),
            PlanEvent::Preparing | PlanEvent::Captured(_) | PlanEvent::Scoring => ControlFlow::Continue(()),
        };
        let problem = Problem::new(&target, lens, &kept)?;
        let mut plan = pipeline::run(context, &problem, config, Tools::default(), observe)?;
        plan.sort_for_a_tour();
        Ok(plan)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::samples;

    /// If this failed, a program that plans through the library would get another plan than the command line gives.
    #[test]
    fn what_a_request_says_is_what_is_planned() {
        let context = Context::new(&ContextOptions::default()).unwrap();
        let room = Shape::Box { min: DVec3::new(0.3, 0.3, 0.4), max: DVec3::new(5.7, 3.7, 2.4) };
        let limits = Limits { heights: Some([0.9, 1.4]), ..Limits::default() };
        let lens = Intrinsics::from_fov(640, 480, 1.0);
        let surface = samples::room();
        let request =
            plan(&surface, 9).seed(4).room().up(DVec3::Z).region(room).clearance(0.1).limits(limits).lens(lens);
        let Plan { record, .. } = request.clone().run_on(&context).unwrap();
        assert_eq!((record.cameras.len(), record.seed, record.region.clearance), (9, 4, 0.1));
        for camera in &record.cameras {
            let height = camera.pose.position.z;
            assert!((0.9 - 1e-9..=1.4 + 1e-9).contains(&height) && camera.intrinsics == lens, "{camera:?}");
        }
        let more = request.keep(&record.cameras[..2]).run_on(&context).unwrap();
        assert_eq!((more.record.kept, more.record.cameras.len()), (2, 11));
        let short = plan(&surface, 3).iterations(7).room().up(DVec3::Z);
        let mut all = Vec::new();
        let watched = short.run_watched(&context, |_, iterations| {
            all.push(iterations);
            ControlFlow::Break(())
        });
        assert!(watched.unwrap().interrupted() || all.is_empty(), "it went on after it was told to stop");
        assert!(all.iter().all(|iterations| *iterations == 7), "{all:?}");
        let no_lens = Intrinsics::from_fov(0, 480, 1.0);
        for refused in
            [plan(&surface, 3).up(DVec3::ZERO), plan(&surface, 3).up(DVec3::NAN), plan(&surface, 3).lens(no_lens)]
        {
            assert!(refused.run_on(&context).is_err(), "planned all the same");
        }
        let refused = plan(&surface, 0).run_on(&context).err().map(|error| error.to_string());
        assert!(refused.is_some_and(|what| what.contains("views")), "no cameras at all were planned");
    }
}

//! A third objective, added without a line in the two that there are.

use std::ops::{ControlFlow, Range};

use glam::{DVec3, Vec3};

use super::*;
use crate::engine::vulkan::{ContextOptions, Pipeline};
use crate::planner::plan::config::{Config, Preset};
use crate::planner::plan::planner::Planner;
use crate::planner::plan::preparation::Preparation;
use crate::planner::plan::problem::Problem;
use crate::planner::plan::shared::{Control, Gradient, Moments};
use crate::planner::plan::target::{RegionChoice, Target};
use crate::planner::plan::update::UpdateConstants;
use crate::scene::camera::Intrinsics;
use crate::scene::samples;
use crate::visibility::device_scene::DeviceRegion;

crate::gpu_struct! {
    /// Push constants of [`UpdateToyStage`].
    struct ToyPush {
        /// Where the cameras come to.
        pub place: [f32; 3],
    }
}

crate::stage!(
    /// One Adam step toward the place.
    UpdateToyStage = update_toy<UpdateConstants>(ToyPush) {
        read settings, write control, write splats, read slots, read partials, write moments, write terms, write gradients,
        read region, read free_distance, write history, write mailbox, write arrivals,
    } with [Settings, Control, CameraState, Gradient, Moments, DeviceRegion, Record]
);

/// Cameras come to a place.
struct Toy(Vec3);

struct ToyPass {
    update: Pipeline,
    place: Vec3,
}

impl Objective for Toy {
    fn buffers(&self, _context: &Context, _settings: &Settings, _block: u32) -> Vec<(&'static str, u64)> {
        // It has no partials of its own.
        vec![("slots", 4), ("partials", size_of::<Gradient>() as u64)]
    }

    fn on_device(
        &self,
        context: &Arc<Context>,
        _scene: &Arc<DeviceScene>,
        _settings: &Settings,
        _footprint: &Footprint,
    ) -> Result<Box<dyn Pass>> {
        let update = Pipeline::new::<UpdateToyStage>(context, &UpdateConstants { threads: 64 })?;
        Ok(Box::new(ToyPass { update, place: self.0 }))
    }
}

impl Pass for ToyPass {
    fn reset(&self, _run: &Run, _commands: &mut Recorder) -> Result<()> {
        Ok(())
    }

    fn record(&self, run: &Run, commands: &mut Recorder, iterations: Range<u32>, _block: u32) -> Result<()> {
        let b = &run.buffers;
        for _ in iterations {
            commands
                .stage(
                    &self.update,
                    UpdateToyStage {
                        settings: &b.settings,
                        control: &b.control,
                        splats: &b.splats,
                        slots: &b.slots,
                        partials: &b.partials,
                        moments: &b.moments,
                        terms: &b.terms,
                        gradients: &b.gradients,
                        region: &run.scene.region,
                        free_distance: &run.scene.free_distance,
                        history: &b.history,
                        mailbox: &b.mailbox,
                        arrivals: &b.arrivals,
                    },
                )
                .push(&ToyPush { place: self.place.to_array() })
                .linear(run.settings.splats);
        }
        Ok(())
    }

    fn stages(&self) -> u32 {
        1
    }
}

/// If this failed, what both objectives share would have become one's own, so that a third could not be added beside them.
#[test]
fn a_third_objective_brings_only_what_is_its_own() -> Result<()> {
    let context = Context::new(&ContextOptions::default())?;
    let lens = Intrinsics::from_fov(800, 600, 60f64.to_radians());
    let choice = RegionChoice::default();
    let target = Target::new(&samples::object(), "object", Preset::Object, &choice, DVec3::Z, &lens)?;
    let problem = Problem::new(&target, lens, &[])?;
    let scene = Arc::new(problem.on(&context)?);
    let place = Vec3::new(0.5, 0.6, 0.3);
    // At the default rate so many steps are as long as the region is wide.
    let config = Config { iterations: 400, ..Config::new(Preset::Object, 9) };
    let preparation = Preparation::of(&context, &problem, config, |_, _| Ok(Arc::new(Toy(place))))?;
    let planner = Planner::new(&context, &scene, preparation)?;
    let outcome = planner.run(None, |_| ControlFlow::Continue(()))?;
    let squares =
        |splats: &[CameraState]| splats.iter().map(|s| Vec3::from(s.centre).distance_squared(place)).sum::<f32>();
    let (first, last) = (outcome.history[0].loss, squares(&planner.splats()?));
    assert!((first - squares(planner.start())).abs() < 1e-3 * first, "{first} of {}", squares(planner.start()));
    assert!(outcome.history.len() == 400 && last < 0.1 * first, "{last} of {first}");
    Ok(())
}

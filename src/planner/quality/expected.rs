//! Expected quality of a set of cameras on looks that no optimiser has used (`expected.comp`), and its twin.

use std::sync::{Arc, Mutex};

use super::law::Law;
use super::look::{Caster, Look, LookPush, LookStage, Surroundings, Viewer, place};
use super::nearest::nearest_cameras;
use crate::engine::parallel::lock;
use crate::engine::vulkan::pace::{Pace, in_parts};
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::planner::metrics::score_point::{View, view};
use crate::scene::camera::Camera;
use crate::visibility::bvh::{Node, TraversalConstants};
use crate::visibility::device_scene::{DeviceScene, SceneGeometry};
use crate::{Error, Result};

crate::gpu_struct! {
    /// Push constants of `expected`.
    pub(crate) struct ExpectedPush {
        /// Cameras whose photos are judged.
        pub views: u32,
        /// Viewer of the first workgroup.
        pub first: u32,
    }
}

crate::gpu_struct! {
    /// What a viewer is expected to see.
    pub(crate) struct ViewerError {
        /// Weighted sum of the errors of all looks, over their number.
        pub error: f32,
        /// Looks that show the surface.
        pub shown: u32,
        /// Of these, looks whose point no view sees.
        pub unseen: u32,
        /// Unused.
        pub spare0: f32,
    }
}

crate::stage!(
    /// A workgroup per viewer, a thread per look.
    pub(crate) ExpectedStage = expected<TraversalConstants>(ExpectedPush) {
        read nodes, read primitives, read looks, read cameras, read law, write errors, write viewer_errors,
    } with [Node, Look, View, Law, ViewerError]
);

/// Looks of a viewer along a side of its picture.
pub const SIDE: u32 = 8;
/// Looks of a viewer.
pub const LOOKS: u32 = SIDE * SIDE;
/// Pairs of viewer and camera of the first submission.
const FIRST_PAIRS: u32 = 1 << 12;
/// Cameras that the walks over them can take before lavapipe would end them: 65,535 iterations an invocation, of which the rays of
/// a look take up to a third.
pub(crate) const MAX_ON_CPU: u32 = 2500;
/// Viewers that show the surface in fewer looks than this are ignored.
pub(crate) const MIN_SHOWN: u32 = 4;

/// The quality that viewers are expected to see of the model trained on a set of cameras.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Expectation {
    /// Mean over viewers of ten times the decimal logarithm of the mean expected squared error of their looks, in the law's own
    /// decibels: lower is better.
    pub error_db: f64,
    /// Share of the looks whose point no camera sees, the mean over viewers.
    pub unseen: f64,
    /// By viewer, in their order; none for those that show too little of the surface.
    pub viewers: Vec<Option<f32>>,
}

/// A difference of quality as texts have it, with its sign and unit: +0.00 dB, never -0.00 dB, where it rounds to nothing.
pub fn decibels(difference: f64, decimals: usize) -> String {
    format!("{:+.decimals$} dB", or_zero(difference, decimals))
}

/// The value, or zero where so many decimals show it as zero, whose sign says nothing then.
pub fn or_zero(value: f64, decimals: usize) -> f64 {
    if value.abs() < 0.5 * 0.1f64.powi(decimals as i32) { 0.0 } else { value }
}

/// Viewers with what they see, ready to judge sets of cameras.
pub struct Judge<'a> {
    context: Arc<Context>,
    scene: &'a DeviceScene,
    viewers: Vec<Camera>,
    looks: Buffer,
    law: Buffer,
    errors: Buffer,
    viewer_errors: Buffer,
    pipeline: Pipeline,
    // Of pairs of viewer and camera.
    pace: Mutex<Pace>,
}

impl<'a> Judge<'a> {
    /// Draws the looks of `viewers`, given in the user's world.
    ///
    /// # Errors
    /// Where device memory runs out or the device fails.
    pub fn new(
        context: &Arc<Context>,
        scene: &'a DeviceScene,
        around: Surroundings,
        viewers: Vec<Camera>,
        law: &Law,
        seed: u64,
    ) -> Result<Self> {
        let pool: Vec<Viewer> = viewers.iter().map(|viewer| Viewer::new(viewer, &scene.geometry)).collect();
        let count = pool.len() as u32;
        let looks = Buffer::device(context, "looks", u64::from(count * LOOKS) * size_of::<Look>() as u64)?;
        let viewer_buffer = Buffer::from_slice(context, "viewers", &pool)?;
        let control = Buffer::from_slice(context, "control", &[0u32])?;
        let draw = Pipeline::new::<LookStage>(context, &scene.constants())?;
        let mut commands = Recorder::new(context)?;
        commands
            .stage(
                &draw,
                LookStage {
                    nodes: &scene.nodes,
                    primitives: &scene.primitives,
                    control: &control,
                    viewers: &viewer_buffer,
                    looks: &looks,
                },
            )
            .push(&push(count, around, seed))
            .linear((count * LOOKS).div_ceil(64));
        commands.submit_and_wait()?;
        drop(commands);
        Ok(Self {
            context: context.clone(),
            scene,
            looks,
            law: Buffer::from_slice(context, "law", &[*law])?,
            errors: Buffer::device(context, "errors", u64::from(4 * count * LOOKS))?,
            viewer_errors: Buffer::device(
                context,
                "viewer_errors",
                u64::from(count) * size_of::<ViewerError>() as u64,
            )?,
            pipeline: Pipeline::new::<ExpectedStage>(context, &scene.constants())?,
            viewers,
            pace: Mutex::new(Pace::new(context, FIRST_PAIRS)),
        })
    }

    /// The viewers, in the user's world.
    pub fn viewers(&self) -> &[Camera] {
        &self.viewers
    }

    /// What the viewers look at, [`LOOKS`] each, in the planner's frame.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn looks(&self) -> Result<Vec<Look>> {
        self.looks.download(self.viewers.len() * LOOKS as usize)
    }

    /// Judges cameras, given in the user's world.
    ///
    /// # Errors
    /// Where device memory runs out or the device fails.
    pub fn expect(&self, cameras: &[Camera]) -> Result<Expectation> {
        self.expect_of(self.viewers.len(), cameras)
    }

    /// Judges cameras, given in the user's world, by the first so many viewers alone.
    ///
    /// # Errors
    /// As [`Judge::expect`].
    pub fn expect_of(&self, viewers: usize, cameras: &[Camera]) -> Result<Expectation> {
        let viewers = viewers.min(self.viewers.len());
        if self.context.physical().is_cpu() && cameras.len() > MAX_ON_CPU as usize {
            return Err(Error::request(format!(
                "on a CPU device expected quality is of at most {MAX_ON_CPU} cameras, and these are {}; use a GPU, or fewer",
                cameras.len()
            )));
        }
        let views: Vec<View> = cameras.iter().map(|camera| view(&self.scene.geometry, camera)).collect();
        let views = if views.is_empty() { vec![View::default()] } else { views };
        let camera_buffer = Buffer::from_slice(&self.context, "cameras", &views)?;
        let most = self.context.physical().groups[0];
        in_parts(&self.context, &mut lock(&self.pace), [viewers as u32, views.len() as u32], |commands, part| {
            for first in part.clone().step_by(most as usize) {
                commands
                    .stage(
                        &self.pipeline,
                        ExpectedStage {
                            nodes: &self.scene.nodes,
                            primitives: &self.scene.primitives,
                            looks: &self.looks,
                            cameras: &camera_buffer,
                            law: &self.law,
                            errors: &self.errors,
                            viewer_errors: &self.viewer_errors,
                        },
                    )
                    .push(&ExpectedPush { views: cameras.len() as u32, first })
                    .groups([most.min(part.end - first), 1, 1]);
            }
            Ok(())
        })?;
        Ok(aggregate(&self.viewer_errors.download::<ViewerError>(viewers)?))
    }

    /// Expected errors by look of the cameras that all viewers judged last, negative where no view sees the point, zero where the
    /// look shows no surface.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn errors(&self) -> Result<Vec<f32>> {
        self.errors.download(self.viewers.len() * LOOKS as usize)
    }
}

fn push(count: u32, around: Surroundings, seed: u64) -> LookPush {
    around.push(count, count, SIDE, (seed ^ (seed >> 32)) as u32)
}

/// The mean over viewers.
fn aggregate(viewer_errors: &[ViewerError]) -> Expectation {
    let counts = |viewer_error: &&ViewerError| viewer_error.shown >= MIN_SHOWN;
    let decibels = |viewer_error: &ViewerError| 10.0 * viewer_error.error.max(f32::MIN_POSITIVE).log10();
    let all = viewer_errors.iter().filter(counts).count().max(1) as f64;
    Expectation {
        error_db: viewer_errors
            .iter()
            .filter(counts)
            .map(|viewer_error| f64::from(decibels(viewer_error)))
            .sum::<f64>()
            / all,
        unseen: viewer_errors.iter().filter(counts).map(|v| f64::from(v.unseen) / f64::from(v.shown)).sum::<f64>()
            / all,
        viewers: viewer_errors
            .iter()
            .map(|viewer_error| counts(&viewer_error).then(|| decibels(viewer_error)))
            .collect(),
    }
}

/// The twin of [`Judge`]: the looks of `viewers` and what is expected of `cameras` there, both given in the user's world.
pub fn expect(
    geometry: &SceneGeometry,
    around: Surroundings,
    viewers: &[Camera],
    cameras: &[Camera],
    law: &Law,
    seed: u64,
) -> (Vec<Look>, Expectation) {
    let LookPush { seed, .. } = push(viewers.len() as u32, around, seed);
    let caster = Caster::new(geometry, around);
    let views: Vec<View> = cameras.iter().map(|camera| view(geometry, camera)).collect();
    let mut looks = Vec::new();
    let mut viewer_errors = Vec::new();
    for (viewer, index) in viewers.iter().map(|viewer| Viewer::new(viewer, geometry)).zip(0..) {
        let mut viewer_error = ViewerError::default();
        let (mut sum, mut looked) = (0.0, 0);
        for pixel in 0..LOOKS {
            let look = caster.look(&viewer, place(seed, index, pixel, SIDE));
            if look.distance > 0.0 {
                let found = nearest_cameras(&geometry.bvh, &look, &views);
                let surface = u32::from(look.normal != [0.0; 3]);
                looked += 1;
                viewer_error.shown += surface;
                viewer_error.unseen += surface * u32::from(found.is_empty());
                sum += f64::from(look.weight) * law.error(&found, f64::from(look.footprint));
            }
            looks.push(look);
        }
        viewer_error.error = if looked > 0 { (sum / f64::from(looked)) as f32 } else { 0.0 };
        viewer_errors.push(viewer_error);
    }
    (looks, aggregate(&viewer_errors))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a plan would be said to lose -0.00 dB.
    #[test]
    fn a_difference_that_rounds_to_nothing_has_no_minus() {
        let texts = [-0.004, -0.0, 0.004, -0.006, 1.25].map(|db| decibels(db, 2));
        assert_eq!(texts, ["+0.00 dB", "+0.00 dB", "+0.00 dB", "-0.01 dB", "+1.25 dB"]);
        assert_eq!(decibels(-0.04, 1), "+0.0 dB");
    }
}

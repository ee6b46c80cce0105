//! A plan in two passes: half of the views on the initial surface, the rest on the surface improved by their photographs.

use super::artifact::{ArtifactEvent, Observe};
use super::scene_artifacts::{MethodInputs, SceneArtifacts, read_photos};
use crate::planner::methods::Method;
use crate::planner::plan::config::Config;
use crate::planner::plan::pipeline::{self, Plan, Tools};
use crate::planner::plan::problem::Problem;
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::surface::Surface;
use crate::{Error, Result};

/// Plans half of the views on the surface of the input photos, takes their photographs, and plans the rest beside them on the surface
/// of all photos so far. The equivalent commands are `camsplat plan`, taking the photos, `camsplat proxy`
/// and `camsplat plan --keep`. The record is of the second pass, beside the cameras of the first, which it counts as kept; its time is that
/// of both plans, without photographs and surface.
///
/// # Errors
/// Where a plan does not fit the device, photographs cannot be taken, the photos give no surface, or `observe` stopped it.
pub fn run(
    artifacts: &SceneArtifacts<'_>,
    given: MethodInputs<'_>,
    (lens, kept): (Intrinsics, &[Camera]),
    config: &Config,
    observe: Observe,
) -> Result<Plan> {
    let context = artifacts.context();
    let first = Config { views: config.views / 2, ..config.clone() };
    let rest = Config { views: config.views - first.views, ..config.clone() };
    let target = artifacts.target(given, &artifacts.scene().region, false)?;
    let tools = Tools::default();
    let problem = Problem { lens, ..Problem::new(&target, artifacts.intrinsics(), kept)? };
    let begun = pipeline::run(context, &problem, first, tools, |_| observe(ArtifactEvent::Working))?;
    if begun.interrupted() {
        return Err(Error::Interrupted);
    }
    let taken = artifacts.settled(&begun.record.cameras, observe);
    let photos = artifacts.photographs(&taken, observe)?;
    let mut set = read_photos(given.inputs)?;
    set.photos.extend(read_photos(&photos)?.photos);
    let known = Surface::Points(artifacts.reconstructed(&set)?);
    let target = artifacts.held(artifacts.target_of(&known, &artifacts.scene().region)?, &known, || Ok(set))?;
    let tools = Tools::default();
    let viewers_lens = problem.viewers_lens;
    let problem = Problem { viewers_lens, ..Problem::new(&target, lens, &taken)? };
    let mut plan = pipeline::run(context, &problem, rest, tools, |_| observe(ArtifactEvent::Working))?;
    plan.record.method = Method::OursTwoPasses.name().to_owned();
    plan.record.seconds += begun.record.seconds;
    Ok(plan)
}

//! A plan in two passes: half of the views where what is known says, the rest when these have been photographed and more is known.

use super::bench::{Bench, read_photos};
use super::stage::{Event, Observe, Stage};
use crate::Result;
use crate::peers::request::Method as Placing;
use crate::plan::config::Config;
use crate::plan::job::{self, Plan, Tools};
use crate::scene::camera::Camera;
use crate::scene::surface::Surface;

/// Plans half of the views on the surface of the input photos, takes their photographs, and plans the rest beside them on the surface
/// of all photos so far; none where `observe` broke it off. By hand it is `camsplat plan`, a walk with the camera, `camsplat proxy`
/// and `camsplat plan --keep`. The record is of the second pass, beside the cameras of the first, which it counts as kept; its time is that
/// of both plans, without photographs and surface.
///
/// # Errors
/// Where a plan does not fit the device, photographs cannot be taken, or the photos give no surface.
pub fn run(
    bench: &Bench<'_>,
    (inputs, shown): (&Stage, &Stage),
    kept: &[Camera],
    config: &Config,
    observe: Observe,
) -> Result<Option<Plan>> {
    let (context, intrinsics) = (bench.context(), bench.intrinsics());
    let first = Config { views: config.views / 2, ..config.clone() };
    let rest = Config { views: config.views - first.views, ..config.clone() };
    let target = bench.target(shown, &bench.scene().region, false)?;
    let tools = Tools::default();
    let begun = job::run(context, &target, intrinsics, kept, first, tools, |_| observe(Event::Working))?;
    if begun.interrupted() {
        return Ok(None);
    }
    let taken = bench.standing(&begun.record.cameras, observe);
    let Some(photos) = bench.photographs(&taken, observe)? else { return Ok(None) };
    let mut set = read_photos(inputs)?;
    set.photos.extend(read_photos(&photos)?.photos);
    let known = Surface::Points(bench.reconstructed(&set)?);
    let target = bench.target_of(&known, &bench.scene().region)?;
    let tools = Tools::default();
    let mut plan = job::run(context, &target, intrinsics, &taken, rest, tools, |_| observe(Event::Working))?;
    plan.record.method = Placing::OursTwoPasses.name().to_owned();
    plan.record.seconds += begun.record.seconds;
    Ok(Some(plan))
}

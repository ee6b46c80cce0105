//! Baking: rays from every cell of the light map, in passes that each see what those before have found.

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::Vec3;

use super::layout::Layout;
use super::{LightMap, LightmapSettings};
use crate::engine::vulkan::footprint::Footprint;
use crate::engine::vulkan::stage::Stage;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::lab::path_tracer::assembly::Assembly;
use crate::lab::path_tracer::buffers::{SceneBuffers, bound};
use crate::lab::path_tracer::layout::{BakeGatherPush, BakeGatherStage, BakeSettlePush, BakeSettleStage, Sum};
use crate::lab::path_tracer::pace::PathPace;
use crate::scene::random;
use crate::{Error, Result};

/// Stream of the seeds of light maps.
const SEED_STREAM: u32 = 0x6c69_6768;
/// Passes of few rays that each forget those before: after so many the light of as many bounces is there.
const FIRST_PASSES: u32 = 16;
const FIRST_RAYS: u32 = 1;
/// Most rays of a later pass; the first of these has four.
const MAX_PASS: u32 = 64;

/// What a bake is made on.
struct Baker<'b> {
    context: &'b Arc<Context>,
    gather: Pipeline,
    settle: Pipeline,
    scene: SceneBuffers,
    sides: Buffer,
    patches: Buffer,
    owners: Buffer,
    sums: Buffer,
    cells: Buffer,
    count: u32,
    seed: u32,
    pace: PathPace,
}

/// Bakes the light of a scene that was laid out for it; `observe` receives the share that is done, and returns whether to go on.
///
/// # Errors
/// Where the device has too little memory, fails, or `observe` requests a stop.
pub(super) fn bake(
    context: &Arc<Context>,
    assembly: &Assembly,
    layout: Layout,
    settings: &LightmapSettings,
    mut observe: impl FnMut(f64) -> ControlFlow<()>,
) -> Result<LightMap> {
    let count = layout.owners.len() as u32;
    let mut list = assembly.footprint();
    list.extend(layout.footprint());
    list.extend([("owners", 4 * u64::from(count)), ("sums", size_of::<Sum>() as u64 * u64::from(count))]);
    Footprint { buffers: list, several: Vec::new() }.check(
        context,
        "the light map",
        |_| "take a scene with fewer triangles, a larger device, or traced light (`light`)",
    )?;
    let mut baker = Baker {
        context,
        gather: Pipeline::new::<BakeGatherStage>(context, &())?,
        settle: Pipeline::new::<BakeSettleStage>(context, &())?,
        scene: SceneBuffers::new(context, assembly)?,
        sides: Buffer::from_slice(context, "sides", &layout.sides)?,
        patches: Buffer::from_slice(context, "patches", &layout.patches)?,
        owners: Buffer::from_slice(context, "owners", &layout.owners)?,
        sums: Buffer::from_slice(context, "sums", &vec![Sum::default(); count as usize])?,
        cells: Buffer::from_slice(context, "cells", &vec![[0f32; 4]; count as usize])?,
        count,
        seed: random::bits(settings.seed, SEED_STREAM, 0)[0],
        pace: PathPace::new(context),
    };
    for pass in 0..FIRST_PASSES {
        // Rays have numbers of their own, apart from those that count in the end.
        let first = u32::MAX / 2 + pass * FIRST_RAYS;
        baker.pass([first, FIRST_RAYS], true, settings, || observe(0.0))?;
    }
    let (mut done, mut rays) = (0, 4);
    while done < settings.rays {
        rays = rays.min(settings.rays - done);
        let share = f64::from(done) / f64::from(settings.rays);
        // What the first passes have found is what the first rays that count see.
        baker.pass([done, rays], done == 0, settings, || observe(share))?;
        done += rays;
        rays = (2 * rays).min(MAX_PASS);
    }
    let sums: Vec<Sum> = baker.sums.download(count as usize)?;
    drop(baker);
    Ok(LightMap::of(assembly, layout, &sums, settings.samples))
}

impl Baker<'_> {
    /// Adds rays to all cells that need some, and lets the map have what is known then.
    fn pass(
        &mut self,
        [first_ray, rays]: [u32; 2],
        anew: bool,
        settings: &LightmapSettings,
        mut go_on: impl FnMut() -> ControlFlow<()>,
    ) -> Result<()> {
        let mut first = 0;
        while first < self.count {
            Error::unless_stopped(go_on())?;
            let mut commands = Recorder::paced(self.context)?;
            let cells = self.pace.items(rays).min(self.count - first);
            let each = self.pace.in_one_dispatch(rays);
            for ray in (0..rays).step_by(each as usize) {
                let push = BakeGatherPush {
                    first,
                    count: cells,
                    seed: self.seed,
                    first_ray: first_ray + ray,
                    rays: each.min(rays - ray),
                    anew: u32::from(anew && ray == 0),
                    tolerance: settings.tolerance,
                    least: settings.rays / 4,
                };
                self.record(&mut commands, &push);
            }
            first += cells;
            if first == self.count {
                let stage = BakeSettleStage { sums: &self.sums, cells: &self.cells };
                let groups = self.count.div_ceil(BakeSettleStage::SHADER.local_size[0]);
                commands.stage(&self.settle, stage).push(&BakeSettlePush { count: self.count }).linear(groups);
            }
            self.pace.took([cells, rays], commands.submit_and_wait()?);
        }
        Ok(())
    }

    fn record(&self, commands: &mut Recorder, push: &BakeGatherPush) {
        let bound = bound!(
            BakeGatherStage, self.scene, sides: &self.sides, patches: &self.patches, cells: &self.cells,
            owners: &self.owners, sums: &self.sums
        );
        let groups = push.count.div_ceil(BakeGatherStage::SHADER.local_size[0]);
        commands.stage(&self.gather, bound).push(push).linear(groups);
    }
}

/// What is known of a cell in the end.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Found {
    /// Irradiance of sources that are not compact.
    pub direct: Vec3,
    /// Irradiance of what reflects widely.
    pub bounced: Vec3,
    /// Mean of one over the distance of what is met.
    pub nearness: f32,
    /// Variance of the luma of `direct`, as one of many cells has it.
    pub variance: f32,
}

impl Found {
    pub fn new(sum: &Sum) -> Self {
        let n = sum.rays;
        if n <= 0.0 {
            return Self::default();
        }
        let [direct, bounced] = [sum.direct, sum.bounced].map(|v| Vec3::from(v) / n);
        // Half the difference between the means of two halves is off zero by as much as the mean of all is off the truth.
        Self { direct, bounced, nearness: sum.nearness / n, variance: (sum.halves / n).powi(2) }
    }
}

/// Irradiance of a cell of compact sources.
pub(super) fn compact(sum: &Sum) -> Vec3 {
    if sum.rays > 0.0 { Vec3::from(sum.compact) / sum.rays } else { Vec3::ZERO }
}

/// The twin of `bake_settle`: irradiance of a cell, of all sources.
#[cfg(test)]
fn bake_settle(sum: &Sum) -> Vec3 {
    let [direct, bounced, compact] = [sum.direct, sum.bounced, sum.compact].map(Vec3::from);
    if sum.rays > 0.0 { (direct + bounced + compact) / sum.rays } else { Vec3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, cells would have another light than their rays brought, or a bound on error that is too low or too high.
    #[test]
    fn a_cell_is_the_mean_of_its_rays_and_its_variance_that_of_halves() -> Result<()> {
        let context = Context::new(&crate::engine::vulkan::ContextOptions::default())?;
        let sum = |i: u32| {
            let [a, b, c, d] = random::bits(1, 2, i).map(random::uniform);
            let rays = if i.is_multiple_of(7) { 0.0 } else { 1.0 + (100.0 * d).floor() };
            Sum { direct: [a, b, c], bounced: [b, c, a], compact: [c, 0.0, a], rays, halves: 0.3 * b, ..Sum::default() }
        };
        let sums: Vec<Sum> = (0..1000).map(sum).collect();
        let pipeline = Pipeline::new::<BakeSettleStage>(&context, &())?;
        let source = Buffer::from_slice(&context, "sums", &sums)?;
        let cells = Buffer::from_slice(&context, "cells", &vec![[7f32; 4]; sums.len()])?;
        let mut commands = Recorder::new(&context)?;
        let stage = BakeSettleStage { sums: &source, cells: &cells };
        commands
            .stage(&pipeline, stage)
            .push(&BakeSettlePush { count: sums.len() as u32 })
            .linear(1000u32.div_ceil(64));
        commands.submit_and_wait()?;
        for (cell, sum) in cells.download::<[f32; 4]>(sums.len())?.iter().zip(&sums) {
            assert!((Vec3::from_slice(cell) - bake_settle(sum)).abs().max_element() < 1e-6);
            let found = Found::new(sum);
            if sum.rays > 0.0 {
                assert!((found.direct + found.bounced + compact(sum) - bake_settle(sum)).abs().max_element() < 1e-6);
                assert!((found.variance.sqrt() - sum.halves / sum.rays).abs() < 1e-6);
            }
        }
        Ok(())
    }
}

//! Depths by stereo: each view's planes, less what other views do not agree with, and the gaps between them.

use std::sync::Arc;

use super::depth::Sweeper;
use super::frame::{Frame, device_pairs, device_views};
use super::hull::Hull;
use super::{Clock, Measured, StereoOptions, choose, consistency, cost, smooth};
use crate::engine::vulkan::Context;
use crate::scene::camera::Camera;
use crate::{Error, Result};

/// Worst match that counts as one.
const MAX_COST: f32 = 0.5;
/// Pixels of the smallest patch of depth that stays, in a picture of 100,000.
const MIN_PATCH: usize = 50;
/// Difference of depth at which two views still agree, as a fraction of depth.
const TOLERANCE: f32 = 0.01;

/// The depths of frames between those of `ranges`, inside the hull where there is one.
///
/// # Errors
/// Where no two of the photos overlap, and where the device fails.
pub(super) fn measured(
    context: &Arc<Context>,
    frames: &[Frame],
    ranges: &[[f64; 2]],
    hull: &Hull,
    options: &StereoOptions,
    clock: &mut Clock,
) -> Result<Measured> {
    let cameras: Vec<Camera> = frames.iter().map(|frame| frame.camera.clone()).collect();
    let neighbours = choose::neighbours(&cameras, ranges);
    let pairs: usize = neighbours.iter().map(Vec::len).sum();
    if pairs == 0 {
        return Err(Error::request(
            "no two of the photos see the same from 3 to 60 degrees apart; give more photos of the same place (`photos`)",
        ));
    }
    let mut views = device_views(&cameras, ranges);
    views.iter_mut().zip(&neighbours).for_each(|(view, near)| view.pairs = near.len() as u32);
    let pictures: Vec<f32> = frames.iter().flat_map(|frame| frame.brightness.iter().copied()).collect();
    let sweeper = Sweeper::new(context, &views, &pictures, &device_pairs(&cameras, &neighbours))?;
    let mut maps = Vec::with_capacity(views.len());
    for (reference, frame) in frames.iter().enumerate() {
        let mut map = sweeper.depth(reference, options.hypotheses, usize::MAX, hull, options.seed)?;
        for pixel in 0..frame.len() {
            if map.costs[pixel] > MAX_COST || frame.hides(pixel) {
                map.costs[pixel] = cost::NO_MATCH;
            }
        }
        map.drop_specks(frame.camera.intrinsics.width as usize, MIN_PATCH * frame.len() / 100_000);
        maps.push(map);
    }
    clock.stage("depth");

    let mut depths: Vec<f32> = maps.iter().flat_map(|map| (0..map.costs.len()).map(|pixel| map.depth(pixel))).collect();
    let check = |depths: &[f32]| consistency::check(context, &views, &sweeper.view_buffer, depths, TOLERANCE);
    let least_agree = if views.len() >= 12 { 2 } else { 1 };
    let support = check(&depths)?;
    for (depth, support) in depths.iter_mut().zip(support) {
        if support.agree < least_agree || support.through >= support.agree {
            *depth = 0.0;
        }
    }
    clock.stage("check");

    // What closes a gap in one view must agree with another's depth or filling.
    let mut closed = depths.clone();
    for (view, frame) in views.iter().zip(frames) {
        let pixels = view.first as usize..view.first as usize + frame.len();
        let gaps = smooth::across_gaps(frame, &depths[pixels.clone()]);
        closed[pixels].iter_mut().zip(gaps).filter(|(_, gap)| *gap > 0.0).for_each(|(depth, gap)| *depth = gap);
    }
    for (i, support) in check(&closed)?.into_iter().enumerate() {
        if depths[i] <= 0.0 && (support.agree == 0 || support.through >= support.agree) {
            closed[i] = 0.0;
        }
    }
    for (view, map) in views.iter().zip(&mut maps) {
        let pixels = view.first as usize..view.first as usize + map.costs.len();
        map.close(view.width as usize, &depths[pixels.clone()], &closed[pixels]);
    }
    clock.stage("gaps");
    Ok(Measured { views, depths: closed, maps, pairs })
}

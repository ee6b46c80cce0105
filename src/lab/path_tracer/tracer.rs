//! Photographs by path tracing, on the device.

use std::ops::ControlFlow;
use std::sync::Arc;

use super::assembly::Assembly;
use super::buffers::{SceneBuffers, bound};
pub use super::layout::Strategy;
use super::layout::{
    FirstHitPush, FirstHitStage, PhotographBakedStage, PhotographConstants, PhotographPush, PhotographStage,
};
use super::lightmap::LightMap;
use super::noise::{self, Halves};
use super::pace::{CPU_PATHS, GPU_PATHS};
use crate::engine::vulkan::footprint::Footprint;
use crate::engine::vulkan::pace::Pace;
use crate::engine::vulkan::stage::Stage;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::random;
use crate::{Error, Result};

/// Stream of the seeds of photographs.
const SEED_STREAM: u32 = 0x7068_6f74;
/// Paths of one dispatch on a GPU: the more samples a thread takes, the less it waits for others in the end. On CPU devices
/// it takes one, since the loops of a thread must stay short there: past 65,535 iterations they end silently.
const GPU_DISPATCH: u64 = 1 << 23;
/// Bytes of a pixel: its sum, and what lies in its middle.
const PIXEL: u64 = 16;
/// Bytes of what is known of its error.
const SPREAD: u64 = 8;
/// With a light map, pixels whose error would be seen have up to so many times as many samples as others.
const MORE_SAMPLES: u32 = 4;

/// How photographs are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exposure {
    /// Samples of a pixel; with a light map, at least.
    pub samples: u32,
    /// Key of the random numbers.
    pub seed: u64,
    /// Whether the environment is seen behind the scene; alpha is 0 there where not.
    pub show_sky: bool,
}

/// A photograph, by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Photograph {
    /// Columns of pixels.
    pub width: u32,
    /// Linear radiance, multiplied by alpha, and alpha.
    pub pixels: Vec<[f32; 4]>,
}

/// What lies in the middle of pixels: unit normals in the world, on the camera's side, and the depth along the optical
/// axis in world units; zeros where there is nothing.
pub(crate) type FirstHits = Vec<[f32; 4]>;

/// A scene on the device, ready for photographs up to a size.
pub struct Tracer {
    context: Arc<Context>,
    photograph: Pipeline,
    first_hit: Pipeline,
    scene: SceneBuffers,
    light: Option<LightBuffers>,
    chosen: Buffer,
    exposure: Buffer,
    found: Buffer,
    assembly: Assembly,
    pixels: u64,
    gain: f32,
}

/// A light map on the device.
struct LightBuffers {
    photograph: Pipeline,
    sides: Buffer,
    patches: Buffer,
    cells: Buffer,
    corners: Buffer,
    spread: Buffer,
}

impl LightBuffers {
    fn new(context: &Arc<Context>, light: &LightMap, pixels: u64) -> Result<Self> {
        let corners: Vec<[f32; 4]> = light.corners.iter().map(|v| v.extend(0.0).to_array()).collect();
        let followed = light.followed.iter().map(|followed| f32::from(u8::from(*followed)));
        let cells: Vec<[f32; 4]> = light.cells.iter().zip(followed).map(|(v, w)| v.extend(w).to_array()).collect();
        Ok(Self {
            photograph: Pipeline::new::<PhotographBakedStage>(context, &())?,
            sides: Buffer::from_slice(context, "sides", &light.layout.sides)?,
            patches: Buffer::from_slice(context, "patches", &light.layout.patches)?,
            cells: Buffer::from_slice(context, "cells", &cells)?,
            corners: Buffer::from_slice(context, "corners", &corners)?,
            spread: Buffer::device(context, "spread", SPREAD * pixels)?,
        })
    }
}

impl Tracer {
    /// Uploads a scene; photographs have `pixels` pixels at most.
    ///
    /// # Errors
    /// Where the device has too little memory for it, or fails.
    pub fn new(context: &Arc<Context>, assembly: Assembly, pixels: u64) -> Result<Self> {
        Self::with(context, assembly, pixels, Strategy::Both, false)
    }

    /// As [`Tracer::new`], with a strategy, and with rays counted in place of alpha.
    ///
    /// # Errors
    /// As [`Tracer::new`].
    pub fn with(
        context: &Arc<Context>,
        assembly: Assembly,
        pixels: u64,
        strategy: Strategy,
        count_rays: bool,
    ) -> Result<Self> {
        Self::made(context, assembly, pixels, strategy, count_rays, None)
    }

    /// As [`Tracer::new`], for photographs of a scene with its light map.
    ///
    /// # Errors
    /// As [`Tracer::new`].
    pub fn lit(context: &Arc<Context>, assembly: &Assembly, pixels: u64, light: &LightMap) -> Result<Self> {
        let laid_out = assembly.for_light_map();
        Self::made(context, laid_out, pixels, Strategy::Both, false, Some(light))
    }

    fn made(
        context: &Arc<Context>,
        assembly: Assembly,
        pixels: u64,
        strategy: Strategy,
        count_rays: bool,
        light: Option<&LightMap>,
    ) -> Result<Self> {
        let mut list = assembly.footprint();
        list.extend([("exposure", PIXEL * pixels), ("found", PIXEL * pixels), ("chosen", 4 * pixels)]);
        if let Some(light) = light {
            list.extend(light.layout.footprint());
            list.push(("spread", SPREAD * pixels));
        }
        Footprint { buffers: list, several: Vec::new() }.check(context, "the scene", |name| match name {
            "texels" => "take smaller textures, or a larger device",
            "exposure" | "found" | "chosen" => "take smaller pictures (`size`)",
            _ => "take a scene with fewer triangles, or a larger device",
        })?;
        Ok(Self {
            photograph: Pipeline::new::<PhotographStage>(context, &PhotographConstants { strategy, count_rays })?,
            first_hit: Pipeline::new::<FirstHitStage>(context, &())?,
            chosen: Buffer::device(context, "chosen", 4 * pixels)?,
            exposure: Buffer::device(context, "exposure", PIXEL * pixels)?,
            found: Buffer::device(context, "found", PIXEL * pixels)?,
            context: context.clone(),
            scene: SceneBuffers::new(context, &assembly)?,
            light: light.map(|light| LightBuffers::new(context, light, pixels)).transpose()?,
            assembly,
            pixels,
            gain: 1.0,
        })
    }

    /// The same for pictures of an exposure in stops, which decides what error is seen.
    pub fn exposed(self, stops: f32) -> Self {
        Self { gain: stops.exp2(), ..self }
    }

    /// The scene.
    pub fn assembly(&self) -> &Assembly {
        &self.assembly
    }

    /// Takes a photograph; `number` is that of the camera among its own, and keys its random numbers.
    ///
    /// # Errors
    /// Where the picture is larger than announced, the device fails, or `go_on`, which is called between submissions, requests a stop.
    pub fn photograph(
        &self,
        camera: &Camera,
        number: u32,
        exposure: Exposure,
        go_on: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Photograph> {
        self.taken(camera, number, exposure, 0, go_on).map(|(photograph, _)| photograph)
    }

    /// The same, with the mean squared error of the picture's sRGB values, from 0 to 1, by two halves of its samples; none of one sample.
    ///
    /// # Errors
    /// As [`Tracer::photograph`].
    pub(super) fn photograph_and_error(
        &self,
        camera: &Camera,
        number: u32,
        exposure: Exposure,
        go_on: impl FnMut() -> ControlFlow<()>,
    ) -> Result<(Photograph, Option<f64>)> {
        let (photograph, halves) = self.taken(camera, number, exposure, exposure.samples / 2, go_on)?;
        let error = halves.and_then(|halves| noise::error(&photograph.pixels, &halves, self.gain));
        Ok((photograph, error))
    }

    /// Takes a photograph, and puts down what its first `half` samples show where there are any.
    fn taken(
        &self,
        camera: &Camera,
        number: u32,
        exposure: Exposure,
        half: u32,
        mut go_on: impl FnMut() -> ControlFlow<()>,
    ) -> Result<(Photograph, Option<Halves>)> {
        let pixels = self.check(&camera.intrinsics)?;
        let mut first_half = Vec::new();
        let on_cpu = self.context.physical().is_cpu();
        let first_paths = if on_cpu { CPU_PATHS } else { GPU_PATHS };
        let part = first_paths.min(u64::from(pixels)) as u32;
        let most_samples = if on_cpu { 1 } else { (GPU_DISPATCH / u64::from(part)) as u32 };
        let all_samples = exposure.samples * if self.light.is_some() { MORE_SAMPLES } else { 1 };
        // Pixels are asked whether they are known when their samples have doubled.
        let asked = |sample: u32| match &self.light {
            Some(_) => exposure.samples * (sample / exposure.samples + 1).next_power_of_two(),
            None => u32::MAX,
        };
        for first in (0..pixels).step_by(part as usize) {
            let count = part.min(pixels - first);
            let mut sample = 0;
            // Of samples, anew for each part: what sky takes says nothing of glass.
            let mut pace = Pace::new(&self.context, (first_paths / u64::from(part)) as u32);
            while sample < all_samples {
                Error::unless_stopped(go_on())?;
                let mut commands = Recorder::paced(&self.context)?;
                let from = sample;
                let until = if sample < half { half } else { all_samples };
                let last = until.min(sample.saturating_add(pace.items()));
                while sample < last {
                    let samples = most_samples.min(last - sample).min(asked(sample) - sample);
                    let push = self.push(camera, number, exposure, [first, count], [sample, samples]);
                    self.record(&mut commands, &push);
                    sample += samples;
                }
                pace.took(sample - from, commands.submit_and_wait()?);
                if sample == half && half > 0 {
                    first_half.extend(self.exposure.download_from::<[f32; 4]>(first as usize, count as usize)?);
                }
            }
        }
        let sums: Vec<[f32; 4]> = self.exposure.download(pixels as usize)?;
        let mean = |sum: [f32; 4], samples: f32| sum.map(|v| v / samples);
        let samples: Vec<u32> = match &self.light {
            None => vec![exposure.samples; pixels as usize],
            Some(light) => {
                let spread: Vec<[f32; 2]> = light.spread.download(pixels as usize)?;
                spread.into_iter().map(|[_, samples]| samples as u32).collect()
            }
        };
        let pixels = sums.into_iter().zip(&samples).map(|(sum, samples)| mean(sum, *samples as f32)).collect();
        let halves = (half > 0).then_some(Halves { first: first_half, count: half, all: samples });
        Ok((Photograph { width: camera.intrinsics.width, pixels }, halves))
    }

    /// Records `samples` of a part of a picture, each a first one and a count, for callers that submit and time it themselves.
    ///
    /// # Errors
    /// Where the picture is larger than announced.
    pub fn record_part(
        &self,
        commands: &mut Recorder,
        camera: &Camera,
        exposure: Exposure,
        pixels: [u32; 2],
        samples: [u32; 2],
    ) -> Result<()> {
        self.check(&camera.intrinsics)?;
        let push = self.push(camera, 0, exposure, pixels, samples);
        self.record(commands, &push);
        Ok(())
    }

    /// Sums of the pixels so far, in the order of the picture.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn sums(&self, pixels: usize) -> Result<Vec<[f32; 4]>> {
        self.exposure.download(pixels)
    }

    fn record(&self, commands: &mut Recorder, push: &PhotographPush) {
        let groups = push.count.div_ceil(PhotographStage::SHADER.local_size[0]);
        if let Some(light) = &self.light {
            let bound = bound!(
                PhotographBakedStage, self.scene, sides: &light.sides, patches: &light.patches, cells: &light.cells,
                corners: &light.corners, exposure: &self.exposure, spread: &light.spread
            );
            commands.stage(&light.photograph, bound).push(push).linear(groups);
            return;
        }
        let bound = bound!(PhotographStage, self.scene, exposure: &self.exposure);
        commands.stage(&self.photograph, bound).push(push).linear(groups);
    }

    /// What lies in the middle of pixels of a picture: of those listed, or of all.
    ///
    /// # Errors
    /// As [`Tracer::photograph`].
    pub fn first_hits(&self, camera: &Camera, listed: Option<&[u32]>) -> Result<FirstHits> {
        let pixels = self.check(&camera.intrinsics)?;
        let count = listed.map_or(pixels, |listed| listed.len() as u32);
        if let Some(listed) = listed {
            self.chosen.upload(listed)?;
        }
        let [position, right, down, forward] = self.axes(camera);
        let [focal, principal] = lens(&camera.intrinsics);
        let push = FirstHitPush {
            position,
            count,
            right,
            width: camera.intrinsics.width,
            down,
            chosen_only: u32::from(listed.is_some()),
            forward,
            spare0: 0,
            focal,
            principal,
        };
        let b = &self.scene;
        let bound = FirstHitStage {
            nodes: &b.nodes,
            primitives: &b.primitives,
            vertices: &b.vertices,
            faces: &b.faces,
            materials: &b.materials,
            maps: &b.maps,
            texels: &b.texels,
            setting: &b.setting,
            chosen: &self.chosen,
            found: &self.found,
        };
        let mut commands = Recorder::new(&self.context)?;
        commands.stage(&self.first_hit, bound).push(&push).linear(count.div_ceil(FirstHitStage::SHADER.local_size[0]));
        commands.submit_and_wait()?;
        self.found.download(count as usize)
    }

    /// Number of pixels of a picture, which must fit.
    fn check(&self, intrinsics: &Intrinsics) -> Result<u32> {
        let pixels = u64::from(intrinsics.width) * u64::from(intrinsics.height);
        if pixels > self.pixels || pixels > u64::from(u32::MAX) {
            return Err(Error::request(format!("a picture of {pixels} pixels is larger than what was announced")));
        }
        Ok(pixels as u32)
    }

    fn push(
        &self,
        camera: &Camera,
        number: u32,
        exposure: Exposure,
        [first, count]: [u32; 2],
        [first_sample, samples]: [u32; 2],
    ) -> PhotographPush {
        let [position, right, down, forward] = self.axes(camera);
        let [focal, principal] = lens(&camera.intrinsics);
        PhotographPush {
            position,
            first,
            right,
            count,
            down,
            width: camera.intrinsics.width,
            forward,
            seed: random::bits(exposure.seed, SEED_STREAM, number)[0],
            focal,
            principal,
            first_sample,
            samples,
            show_sky: u32::from(exposure.show_sky),
            gain: self.gain,
            least: exposure.samples,
        }
    }

    /// Centre and axes of a camera about the scene's own centre.
    fn axes(&self, camera: &Camera) -> [[f32; 3]; 4] {
        let axes = glam::DMat3::from_quat(camera.pose.rotation);
        let position = camera.pose.position - self.assembly.centre;
        [position, axes.x_axis, axes.y_axis, axes.z_axis].map(|v| v.as_vec3().to_array())
    }
}

fn lens(intrinsics: &Intrinsics) -> [[f32; 2]; 2] {
    [intrinsics.focal, intrinsics.principal].map(|pair| pair.map(|v| v as f32))
}

//! Photographs by path tracing, on the device.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytemuck::Zeroable;

use super::assembly::Assembly;
pub use super::layout::Strategy;
use super::layout::{FirstHitPush, FirstHitStage, Light, Map, PhotographConstants, PhotographPush, PhotographStage};
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::random;
use crate::vulkan::footprint::Footprint;
use crate::vulkan::stage::Stage;
use crate::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::{Error, Result};

/// Stream of the seeds of photographs.
const SEED_STREAM: u32 = 0x7068_6f74;
/// Paths of the first submission of a picture, and pixels of a part of it at most: on a CPU they should end within a second, so
/// that a run can be stopped, on a GPU long before a watchdog interferes.
const CPU_PATHS: u64 = 1 << 17;
const GPU_PATHS: u64 = 1 << 20;
/// How long a submission should take: it has twice as many samples while it takes less than half of that.
const SUBMISSION: Duration = Duration::from_millis(200);
/// Paths of one dispatch on a GPU: the more samples a thread takes, the less it waits for others in the end. On CPU devices
/// it takes one, since the loops of a thread must stay short there: past 65,535 iterations they end silently.
const GPU_DISPATCH: u64 = 1 << 23;
/// Bytes of a pixel: its sum, and what lies in its middle.
const PIXEL: u64 = 16;

/// How photographs are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exposure {
    /// Samples of a pixel.
    pub samples: u32,
    /// Key of the random numbers.
    pub seed: u64,
    /// Whether the environment is seen behind the scene; alpha is 0 there where not.
    pub show_sky: bool,
}

/// A photograph, by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Photograph {
    /// Columns.
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
    chosen: Buffer,
    exposure: Buffer,
    found: Buffer,
    assembly: Assembly,
    pixels: u64,
}

/// A scene on the device.
struct SceneBuffers {
    nodes: Buffer,
    primitives: Buffer,
    vertices: Buffer,
    faces: Buffer,
    materials: Buffer,
    maps: Buffer,
    texels: Buffer,
    lights: Buffer,
    sky: Buffer,
    aliases: Buffer,
    albedo: Buffer,
    setting: Buffer,
}

impl SceneBuffers {
    fn new(context: &Arc<Context>, a: &Assembly) -> Result<Self> {
        // A shader may not be bound to nothing: where there is nothing, one element is bound that no index refers to.
        Ok(Self {
            nodes: Buffer::from_slice(context, "nodes", &a.bvh.nodes)?,
            primitives: Buffer::from_slice(context, "primitives", &a.primitives)?,
            vertices: Buffer::from_slice(context, "vertices", &a.vertices)?,
            faces: Buffer::from_slice(context, "faces", &a.faces)?,
            materials: Buffer::from_slice(context, "materials", &a.materials)?,
            maps: filled(context, "maps", &a.maps, Map::zeroed())?,
            texels: filled(context, "texels", &a.texels, [0; 4])?,
            lights: filled(context, "lights", &a.lights, Light::zeroed())?,
            sky: filled(context, "sky", &a.sky, [0.0; 4])?,
            aliases: filled(context, "aliases", &a.aliases, [0; 2])?,
            albedo: Buffer::from_slice(context, "albedo", &a.albedo)?,
            setting: Buffer::from_slice(context, "setting", &[a.setting])?,
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
        let mut list = assembly.footprint();
        list.extend([("exposure", PIXEL * pixels), ("found", PIXEL * pixels), ("chosen", 4 * pixels)]);
        Footprint { buffers: list, several: &[] }.check(context, "the scene", |name| match name {
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
            assembly,
            pixels,
        })
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
        mut go_on: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Photograph> {
        let pixels = self.check(&camera.intrinsics)?;
        let on_cpu = self.context.physical().kind == "CPU";
        let first_paths = if on_cpu { CPU_PATHS } else { GPU_PATHS };
        let part = first_paths.min(u64::from(pixels)) as u32;
        let most_samples = if on_cpu { 1 } else { (GPU_DISPATCH / u64::from(part)) as u32 };
        let mut per_submission = (first_paths / u64::from(part)) as u32;
        for first in (0..pixels).step_by(part as usize) {
            let count = part.min(pixels - first);
            let mut sample = 0;
            while sample < exposure.samples {
                Error::unless_stopped(go_on())?;
                let begun = Instant::now();
                let mut commands = Recorder::new(&self.context)?;
                let last = exposure.samples.min(sample.saturating_add(per_submission));
                while sample < last {
                    let samples = most_samples.min(last - sample);
                    let push = self.push(camera, number, exposure, [first, count], [sample, samples]);
                    self.record(&mut commands, &push);
                    sample += samples;
                }
                commands.submit_and_wait()?;
                match begun.elapsed() {
                    short if short < SUBMISSION / 2 => per_submission *= 2,
                    long if long > SUBMISSION => per_submission = (per_submission / 2).max(1),
                    _ => {}
                }
                per_submission = per_submission.min(exposure.samples);
            }
        }
        let sums: Vec<[f32; 4]> = self.exposure.download(pixels as usize)?;
        let mean = |sum: [f32; 4]| sum.map(|v| v / exposure.samples as f32);
        let pixels = sums.into_iter().map(mean).collect();
        Ok(Photograph { width: camera.intrinsics.width, pixels })
    }

    /// Records `samples` of a part of a picture, each a first one and a count, for callers that submit and time it themselves.
    ///
    /// # Errors
    /// Where the picture is larger than announced.
    pub fn record_part<'a>(
        &'a self,
        commands: &mut Recorder<'a>,
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

    fn record<'a>(&'a self, commands: &mut Recorder<'a>, push: &PhotographPush) {
        let b = &self.scene;
        let bound = PhotographStage {
            nodes: &b.nodes,
            primitives: &b.primitives,
            vertices: &b.vertices,
            faces: &b.faces,
            materials: &b.materials,
            maps: &b.maps,
            texels: &b.texels,
            lights: &b.lights,
            sky: &b.sky,
            aliases: &b.aliases,
            albedo: &b.albedo,
            setting: &b.setting,
            exposure: &self.exposure,
        };
        commands
            .stage(&self.photograph, bound)
            .push(push)
            .linear(push.count.div_ceil(PhotographStage::SHADER.local_size[0]));
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

fn filled<T: bytemuck::NoUninit>(context: &Arc<Context>, name: &str, data: &[T], instead: T) -> Result<Buffer> {
    if data.is_empty() {
        Buffer::from_slice(context, name, &[instead])
    } else {
        Buffer::from_slice(context, name, data)
    }
}

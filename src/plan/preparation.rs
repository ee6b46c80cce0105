//! What is fixed of a run before the device has allocated anything.

use std::sync::Arc;

use super::config::{Config, MAX_DENSE, MAX_VIEWS, Objective, Pass, Preset};
use super::footprint::{self, Room};
use super::links::{self, Links};
use super::problem::Problem;
use super::shared::{Settings, Splat};
use super::start;
use crate::quality::expected::MAX_ON_CPU;
use crate::quality::law::Law;
use crate::quality::look::{Surroundings, Viewer};
use crate::scene::camera::{Camera, Intrinsics, Pose};
use crate::scene::proxy::SurfacePoint;
use crate::scene::random;
use crate::visibility::device_scene::SceneGeometry;
use crate::visibility::probe_depth::Probe;
use crate::vulkan::Context;
use crate::vulkan::footprint::Footprint;
use crate::vulkan::physical::Physical;
use crate::{Error, Result};

/// Pairs of texel and visible splat an iteration from which on binning pays; see docs/results/planner.md.
const DENSE_WORK: f64 = 3e7;

/// Points that test whether the region sees the surface at all, where no point cameras are drawn from it.
const REACHABLE: u32 = 256;
/// Sums over looks stay within lavapipe's bound on loops.
const MAX_VIEWERS_A_STEP: u32 = 16_384;
/// Key that separates the viewers of a run from those that judge it.
const VIEWER_SEED: u64 = 0x6c6f_6f6b;

/// Stream of the surface's samples for probes; held-out points take another.
pub(crate) const PROBE_STREAM: u32 = 0;

/// Everything about a run that is known before the device has allocated anything.
#[derive(Clone)]
pub struct Preparation {
    pub(super) config: Config,
    pub(super) settings: Settings,
    pub(super) points: Vec<SurfacePoint>,
    /// Viewers that looks are drawn from, and what looks take of the surface (quality).
    pub(super) viewers: Vec<Viewer>,
    pub(super) around: Surroundings,
    pub(super) start: Vec<Splat>,
    pub(super) start_scale: f32,
    pub(super) resolution: u32,
    pub(super) binned: bool,
    /// Threads of a look (quality).
    pub(super) lanes: u32,
    pub(super) scene_bytes: u64,
    pub(super) footprint: Footprint,
    /// Which cameras are neighbours, where they are to connect.
    pub(super) links: Option<Arc<Links>>,
}

impl Preparation {
    /// Draws the probes from the surface, places the splats and settles scale, resolution and memory.
    ///
    /// # Errors
    /// A configuration that makes no sense.
    pub fn new(context: &Context, problem: &Problem<'_>, config: Config) -> Result<Self> {
        let Problem { target, geometry, lens: intrinsics, kept } = problem;
        let proxy = &target.proxy;
        config.validate()?;
        if config.views > MAX_VIEWS {
            return Err(Error::request(format!("`views` is {}; give at most {MAX_VIEWS}", config.views)));
        }
        footprint::check_counts(&config, kept.len(), context)?;
        let quality = config.objective == Objective::Quality;
        let viewers = match quality {
            true => viewers(&config, geometry, intrinsics)?,
            false => Vec::new(),
        };
        // Looks replace point cameras; these only detect a surface that no camera can see.
        let pool = if quality { REACHABLE } else { config.pool };
        let mut points = proxy.sample(pool as usize, config.seed, PROBE_STREAM);
        random::shuffle(&mut points, config.seed, PROBE_STREAM);
        let kept_splats = kept.iter().map(|camera| splat(camera, geometry));
        let start: Vec<Splat> = kept_splats.chain(start::splats(&config, geometry, intrinsics)).collect();
        let few: Vec<Probe> = points.iter().take(start::PROBES).map(|point| Probe::new(point, geometry)).collect();
        let visible = start::visible(&start, &few, geometry);
        let start_scale = config.scale.unwrap_or_else(|| start::scale(visible.seen));
        let resolution = config.resolution.unwrap_or_else(|| start::resolution(start_scale));
        points.truncate(footprint::pool(points.len(), config.probes, resolution, context.physical()));

        let probes = if quality { config.probes } else { config.probes.min(points.len() as u32) };
        let splats = start.len() as u32;
        let [threads, each] = dense_shape(context.physical());
        let binned = match config.pass {
            Pass::Dense => false,
            Pass::Binned => true,
            Pass::Auto => {
                let work = f64::from(probes * resolution * resolution) * visible.gated;
                !quality && (work > DENSE_WORK || splats > MAX_DENSE)
            }
        };
        if binned && quality {
            return Err(Error::request("only `objective` splat has a binned pass; leave `pass` out"));
        }
        if quality && context.physical().is_cpu() && splats > MAX_ON_CPU {
            return Err(Error::request(format!(
                "on a CPU device expected quality is of at most {MAX_ON_CPU} cameras, and these are {splats}; use a GPU, or fewer"
            )));
        }
        if config.connect.is_some() && splats > links::MAX_CAMERAS {
            return Err(Error::request(format!(
                "`connect` is for at most {} cameras, and these are {splats}; plan fewer, or leave it out",
                links::MAX_CAMERAS
            )));
        }
        if quality && probes > MAX_VIEWERS_A_STEP {
            return Err(Error::request(format!(
                "`probes` is {probes}; give at most {MAX_VIEWERS_A_STEP} viewers a step"
            )));
        }
        if !binned && !quality && splats > MAX_DENSE {
            return Err(Error::request(format!(
                "the dense pass takes at most {MAX_DENSE} cameras; use `pass` binned or auto"
            )));
        }
        if u64::from(probes) * u64::from(splats) > 1 << 28 {
            return Err(Error::request(format!(
                "{splats} cameras times {probes} point cameras a step is more than 2^28; use fewer probes (`probes`)"
            )));
        }
        let room = Room::new(splats, probes, visible.gated, binned, start_scale, resolution, context.physical());
        let round_length = if config.iterative { (config.iterations / 5).max(1) } else { 0 };
        let settings = Settings {
            splats,
            kept: kept.len() as u32,
            probes,
            pool: points.len() as u32,
            capacity: room.capacity,
            instances: room.instances,
            row: if binned { 0 } else { room.capacity },
            blocks: if binned || quality { 1 } else { (resolution * resolution).div_ceil(threads * each) },
            iterations: if config.iterative { round_length * config.views } else { config.iterations },
            round_length,
            seed: (config.seed ^ (config.seed >> 32)) as u32,
            relocate_every: if config.iterative || quality { 0 } else { config.relocate_every },
            relocate_until: (config.relocate_until * config.iterations as f32) as u32,
            weighted: config.vds as u32,
            equal: config.equal_probes as u32,
            alpha: config.alpha,
            gate_softness: config.gate_softness,
            lr_position: config.lr_position,
            lr_direction: config.lr_direction,
            lr_scale: if config.iterative || quality { 0.0 } else { config.lr_scale },
            decay: config.decay,
            lambda_reg: config.lambda_reg,
            lambda_bound: config.lambda_bound,
            lambda_scale: config.lambda_scale,
            scale_floor: 0.5 * start_scale,
            link_angle: config.connect.unwrap_or(0.0).to_radians(),
        };
        let scene_bytes = geometry.bytes();
        let footprint = footprint::footprint(context, &settings, &config, resolution, scene_bytes, binned);
        let links = config.connect.map(|degrees| Links::new(proxy, geometry, config.seed, degrees)).map(Arc::new);
        let object = config.preset == Preset::Object;
        let around = Surroundings::new(geometry, proxy.sphere, object, &Law::embedded());
        Ok(Self {
            config,
            settings,
            points,
            viewers,
            around,
            start,
            start_scale,
            resolution,
            binned,
            lanes: super::viewed::lanes(context.physical()),
            scene_bytes,
            footprint,
            links,
        })
    }

    /// The same run with capacity for so many pairs and instances in the binned pass, and a quarter more.
    pub(super) fn with_capacity(mut self, context: &Context, [pairs, instances]: [u32; 2]) -> Self {
        self.settings.capacity = self.settings.capacity.max(pairs.saturating_add(pairs / 4));
        self.settings.instances = self.settings.instances.max(instances.saturating_add(instances / 4));
        let (settings, config) = (&self.settings, &self.config);
        self.footprint =
            footprint::footprint(context, settings, config, self.resolution, self.scene_bytes, self.binned);
        self
    }

    /// The same run from other places: poses of the planned splats in the planner's frame.
    pub fn starting_from(mut self, poses: &[Pose]) -> Self {
        for (splat, pose) in self.start[self.settings.kept as usize..].iter_mut().zip(poses) {
            splat.place(pose);
        }
        self
    }

    /// The same run with several threads to a look, or one, instead of what suits the device.
    pub fn with_shared_looks(self, shared: bool) -> Self {
        Self { lanes: if shared { super::viewed::TOGETHER } else { 1 }, ..self }
    }

    /// Whether the binned pass was taken.
    pub fn binned(&self) -> bool {
        self.binned
    }

    /// Device memory that the run takes.
    pub fn footprint(&self) -> &Footprint {
        &self.footprint
    }
}

/// A camera of the user's world as a splat.
pub(super) fn splat(camera: &Camera, geometry: &SceneGeometry) -> Splat {
    let [tan_x, tan_y] = start::tangents(&camera.intrinsics);
    let mut splat = Splat { tan_x, tan_y, ..Splat::default() };
    splat.place(&geometry.to_internal.pose(&camera.pose));
    splat
}

impl Splat {
    /// Gives it the pose of a camera in the planner's frame.
    pub(super) fn place(&mut self, pose: &Pose) {
        self.centre = pose.position.as_vec3().to_array();
        self.direction = pose.forward().as_vec3().normalize().to_array();
    }
}

/// Viewers of a whole run: those of each iteration are its own.
fn viewers(config: &Config, geometry: &SceneGeometry, intrinsics: &Intrinsics) -> Result<Vec<Viewer>> {
    let count = config.viewers_drawn();
    let inward = config.preset == Preset::Object;
    let cameras = config.viewers.sample(geometry, *intrinsics, inward, config.seed ^ VIEWER_SEED, count)?;
    Ok(cameras.iter().map(|camera| Viewer::new(camera, geometry)).collect())
}

/// Threads of a workgroup of the dense pass and texels of a thread: many small workgroups fill a GPU; on a CPU fewer
/// threads do more each, since a barrier costs each of them a switch.
pub(super) fn dense_shape(physical: &Physical) -> [u32; 2] {
    if physical.is_cpu() { [64, 4] } else { [256, 1] }
}

/// Most splats whose updates leave threads of a GPU idle.
const FEW: u32 = 512;

/// Threads of a workgroup of the update, one to a splat: the sums of few splats are shared among more threads.
pub(super) fn update_threads(physical: &Physical, splats: u32) -> u32 {
    if physical.is_cpu() || splats > FEW { 64 } else { 256 }
}

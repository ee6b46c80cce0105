//! What photos show of surface points, on the device (`observe.comp`): which photos see a point, through their real
//! lenses, and how bright it is there. And the twin.

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};

use super::pyramid::Pyramid;
use super::variance::median;
use crate::engine::vulkan::shaders::glsl::photogrammetry::vds::observe as glsl;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::files::photos::{Photo, PhotoSet};
use crate::scene::proxy::{Proxy, SurfacePoint};
use crate::scene::similarity::Similarity;
use crate::visibility::bvh::{Bvh, Node, Primitives, TraversalConstants};
use crate::visibility::lens_view::LensView;
use crate::visibility::raycast::Ray;
use crate::{Error, Result};

crate::gpu_struct! {
    /// Push constants of `observe`.
    pub(crate) struct ObservePush {
        /// Surface points.
        pub points: u32,
        /// The photo's camera.
        pub view: u32,
        /// Texels of the photo's finest level along a row.
        pub width: u32,
        /// Rows of the photo's finest level.
        pub height: u32,
        /// Levels of its pyramid.
        pub levels: u32,
        /// Where in `photo` a bit per point begins: whether the photo is known to see it.
        pub matched: u32,
    }
}

crate::gpu_struct! {
    /// A surface point in the frame that rays are cast in.
    pub struct ObservedPoint {
        /// Where it is.
        pub position: [f32; 3],
        /// How far to step off the surface before the ray is cast.
        pub lift: f32,
        /// Unit normal toward the visible side.
        pub normal: [f32; 3],
        /// Width of what is averaged over.
        pub footprint: f32,
    }
}

crate::stage!(
    /// A thread per surface point: what one photo shows of it.
    pub(crate) ObserveStage = observe<TraversalConstants>(ObservePush) {
        read nodes, read primitives, read surface, read views, read photo, write intensities,
    } with [Node, ObservedPoint, LensView]
);

/// Least cosine between a point's normal and the way to the camera: past 80 degrees a footprint is all neighbours.
const MIN_COSINE: f32 = glsl::MIN_COSINE as f32;
/// Photos under way on the device: one is copied there while another is sampled.
const SLOTS: usize = 2;

/// Points and cameras, ready to be observed.
pub struct Scene {
    /// The points.
    pub points: Vec<ObservedPoint>,
    /// A camera per photo.
    pub views: Vec<LensView>,
    /// What blocks rays.
    pub bvh: Bvh,
    /// Points that each photo is known to see, whatever blocks the way: empty where nothing is known, or a list per
    /// photo.
    pub matched: Vec<Vec<u32>>,
}

/// What the photos show of each point: for every point the photos that see it, in order, and the intensities there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Observations {
    /// Where the observations of each point start, and where the last ones end: one more than there are points.
    pub starts: Vec<usize>,
    /// The photo of each observation.
    pub photos: Vec<u32>,
    /// Luma of linear RGB in [0, 1] of each observation.
    pub intensities: Vec<f32>,
}

/// Buffers for a photo on its way through the device.
struct Slot {
    staging: Buffer,
    photo: Buffer,
    intensities: Buffer,
}

impl Scene {
    /// Maps points and photos into the frame in which the proxy's bounding sphere is the unit sphere.
    ///
    /// A point's intensity is averaged over a patch as wide as the radius of its disc, or as a pixel of the usual
    /// photo at the proxy's centre where that is more: every photo then measures the same patch, be it near or far.
    ///
    /// # Errors
    /// Where the proxy is too large or too far out for the hierarchy.
    pub fn new(proxy: &Proxy, points: &[SurfacePoint], photos: &[Photo]) -> Result<Self> {
        let to_internal = Similarity::to_unit_sphere(proxy.sphere.0, proxy.sphere.1.max(f64::MIN_POSITIVE));
        let pixel =
            |photo: &Photo| photo.camera.pose.position.distance(proxy.sphere.0) / photo.camera.intrinsics.focal[0];
        let coarse = median(&mut photos.iter().map(pixel).collect::<Vec<_>>());
        let observed = |point: &SurfacePoint| ObservedPoint {
            position: to_internal.point(point.position).as_vec3().to_array(),
            lift: to_internal.length(point.lift) as f32,
            normal: to_internal.direction(point.normal).as_vec3().to_array(),
            footprint: to_internal.length(point.radius.max(coarse)) as f32,
        };
        Ok(Self {
            points: points.iter().map(observed).collect(),
            views: photos.iter().map(|photo| LensView::new(photo, &to_internal)).collect(),
            bvh: Bvh::new(&proxy.occluder, &to_internal)?,
            matched: Vec::new(),
        })
    }

    /// Takes over from the tracks of a capture which photos see a point: those it was found in. Discs cover too much of a sparse
    /// cloud for rays to be reliable: they block from a tenth to a half of the matches that the cloud was made from. `points` are
    /// those that the scene was made of; ones that are none of the capture's are left to the rays.
    pub fn with_tracks(mut self, points: &[SurfacePoint], capture: &PhotoSet) -> Self {
        let key = |p: DVec3| p.to_array().map(f64::to_bits);
        let tracks: HashMap<_, _> =
            capture.points.positions.iter().zip(&capture.tracks).map(|(p, track)| (key(*p), track)).collect();
        self.matched = vec![Vec::new(); self.views.len()];
        for (i, point) in (0..).zip(points) {
            for photo in tracks.get(&key(point.position)).into_iter().copied().flatten() {
                self.matched[*photo as usize].push(i);
            }
        }
        self
    }

    /// A bit per point: whether the photo is known to see it.
    fn bits(&self, view: usize) -> Vec<u32> {
        let mut bits = vec![0; self.points.len().div_ceil(32)];
        self.matched.get(view).into_iter().flatten().for_each(|point| bits[*point as usize / 32] |= 1 << (point % 32));
        bits
    }

    /// Observes every point in the photos that `next` gives, each with its index among the cameras, in any order and
    /// until it gives none. Photos follow one another on the device without waiting for the host.
    ///
    /// # Errors
    /// Those of `next`; a photo larger than its camera; a device that fails or has too little memory.
    pub fn observe(
        &self,
        context: &Arc<Context>,
        mut next: impl FnMut() -> Result<Option<(usize, Pyramid)>>,
    ) -> Result<Observations> {
        let nodes = Buffer::from_slice(context, "nodes", &self.bvh.nodes)?;
        let (primitives, discs) = match &self.bvh.primitives {
            Primitives::Triangles(triangles) => (Buffer::from_slice(context, "primitives", triangles)?, false),
            Primitives::Discs(discs) => (Buffer::from_slice(context, "primitives", discs)?, true),
        };
        let surface = Buffer::from_slice(context, "surface", &self.points)?;
        let views = Buffer::from_slice(context, "views", &self.views)?;
        let pipeline = Pipeline::new::<ObserveStage>(context, &TraversalConstants { discs })?;
        let texels = |view: &LensView| Pyramid::size(view.size[0] as u32, view.size[1] as u32);
        let room = 4 * (self.views.iter().map(texels).max().unwrap_or(0) + self.points.len().div_ceil(32) as u64);
        let slot = || -> Result<Slot> {
            Ok(Slot {
                staging: Buffer::host(context, "photo_staging", room)?,
                photo: Buffer::device(context, "photo", room)?,
                intensities: Buffer::host(context, "intensities", 4 * self.points.len() as u64)?,
            })
        };
        let slots = if context.submits_one_by_one() { 1 } else { SLOTS };
        let slots = (0..slots).map(|_| slot()).collect::<Result<Vec<_>>>()?;
        let mut seen: Vec<Vec<(u32, f32)>> = vec![Vec::new(); self.views.len()];
        let mut running: VecDeque<(usize, &Slot, Recorder)> = VecDeque::new();
        let mut free: Vec<&Slot> = slots.iter().collect();
        let mut intensities = vec![0f32; self.points.len()];
        loop {
            let photo = next()?;
            if (free.is_empty() || photo.is_none())
                && let Some((view, slot, mut commands)) = running.pop_front()
            {
                commands.wait()?;
                slot.intensities.read_into(&mut intensities)?;
                let shown = || (0..).zip(&intensities).filter(|(_, v)| **v >= 0.0);
                // Counted first: spare capacity in thousands of lists would add up.
                seen[view].reserve_exact(shown().count());
                seen[view].extend(shown().map(|(point, v)| (point, *v)));
                free.push(slot);
            }
            let Some((view, mut pyramid)) = photo else {
                if running.is_empty() {
                    return Ok(self.gather(&seen));
                }
                continue;
            };
            let Some(slot) = free.pop() else {
                return Err(Error::request("no room is left for a photo on the device; run again"));
            };
            let matched = pyramid.texels.len() as u32;
            pyramid.texels.extend(self.bits(view));
            slot.staging.write(&pyramid.texels)?;
            let mut commands = Recorder::new(context)?;
            commands.copy(&slot.staging, &slot.photo, 4 * pyramid.texels.len() as u64);
            commands
                .stage(
                    &pipeline,
                    ObserveStage {
                        nodes: &nodes,
                        primitives: &primitives,
                        surface: &surface,
                        views: &views,
                        photo: &slot.photo,
                        intensities: &slot.intensities,
                    },
                )
                .push(&ObservePush {
                    points: self.points.len() as u32,
                    view: view as u32,
                    width: pyramid.width,
                    height: pyramid.height,
                    levels: pyramid.levels,
                    matched,
                })
                .linear(self.points.len().div_ceil(64) as u32);
            commands.submit()?;
            running.push_back((view, slot, commands));
        }
    }

    /// What was seen, by photo, ordered by point.
    fn gather(&self, seen: &[Vec<(u32, f32)>]) -> Observations {
        let mut starts = vec![0; self.points.len() + 1];
        for (point, _) in seen.iter().flatten() {
            starts[*point as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let all = seen.iter().map(Vec::len).sum();
        let (mut photos, mut intensities) = (vec![0; all], vec![0.0; all]);
        let mut place = starts.clone();
        for (photo, shown) in (0..).zip(seen) {
            for (point, intensity) in shown {
                let at = &mut place[*point as usize];
                (photos[*at], intensities[*at]) = (photo, *intensity);
                *at += 1;
            }
        }
        Observations { starts, photos, intensities }
    }
}

impl Observations {
    /// Number of points.
    pub fn points(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Photos and intensities of a point.
    pub fn of(&self, point: usize) -> (&[u32], &[f32]) {
        let range = self.starts[point]..self.starts[point + 1];
        (&self.photos[range.clone()], &self.intensities[range])
    }
}

/// Pixel of a point in the frame of the view; none behind the camera, where the lens bends no light to, and outside the
/// image. Twin of `lens_pixel`, by [`Lens::pixel`](crate::scene::lens::Lens::pixel) of the photo that the view was
/// made of.
pub fn lens_pixel(view: &LensView, photo: &Photo, point: Vec3) -> Option<Vec2> {
    let off = (point - Vec3::from(view.position)).as_dvec3();
    let along = |axis: [f32; 3]| off.dot(Vec3::from(axis).as_dvec3());
    let pixel = photo.lens().pixel(DVec3::new(along(view.right), along(view.down), along(view.forward)))?;
    Some(pixel.as_vec2())
}

/// What a photo shows of a point, none where it does not: the twin of `observe`.
pub fn observe(scene: &Scene, point: usize, view: usize, photo: &Photo, pyramid: &Pyramid) -> Option<f32> {
    let known = scene.matched.get(view).is_some_and(|points| points.contains(&(point as u32)));
    let (point, view) = (&scene.points[point], &scene.views[view]);
    let (position, normal) = (Vec3::from(point.position), Vec3::from(point.normal));
    let camera = Vec3::from(view.position);
    let distance = camera.distance(position);
    let cosine = normal.dot(camera - position) / distance;
    if !known && cosine <= MIN_COSINE {
        return None;
    }
    let texels = pyramid.width as f32 / view.size[0];
    let pixel = (texels * lens_pixel(view, photo, position)?).to_array();
    if pyramid.bilinear(0, pixel)[1] < 0.5 {
        return None;
    }
    let origin = position + point.lift * normal;
    let reach = camera.distance(origin);
    let ray = Ray { origin, direction: (camera - origin) / reach, t_min: 0.0, t_max: reach };
    if !known && scene.bvh.any_hit(&ray) {
        return None;
    }
    let wide = texels * view.focal[0] * point.footprint / distance * cosine.max(MIN_COSINE).sqrt();
    let level = wide.log2().clamp(0.0, (pyramid.levels - 1) as f32);
    let finer = level as u32;
    let [a, b] = [finer, (finer + 1).min(pyramid.levels - 1)].map(|level| pyramid.bilinear(level, pixel));
    let [luma, mask] = [0, 1].map(|i| a[i] + (level - finer as f32) * (b[i] - a[i]));
    (mask > 0.0).then(|| luma / mask)
}

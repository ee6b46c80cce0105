//! Which photos of a pool see which points of the surface (`sight.comp`), and the twin.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use crate::Result;
use crate::engine::parallel::in_parallel;
use crate::engine::vulkan::pace::{Pace, in_parts};
use crate::engine::vulkan::{Buffer, Context, Pipeline};
use crate::files::photos::Photo;
use crate::planner::quality::look::Look;
use crate::scene::lens::Lens;
use crate::scene::proxy::SurfacePoint;
use crate::visibility::bvh::{Node, TraversalConstants};
use crate::visibility::device_scene::{DeviceScene, SceneGeometry};
use crate::visibility::probe_depth::Probe;
use crate::visibility::raycast::Ray;

crate::gpu_struct! {
    /// Push constants of `sight`.
    pub(crate) struct SightPush {
        /// Point of the first workgroups.
        pub first: u32,
        /// Points of this dispatch.
        pub points: u32,
        /// Photos in the pool.
        pub photos: u32,
        /// Words of a point's row of bits, an even number.
        pub words: u32,
    }
}

crate::stage!(
    /// A workgroup per point and 64 photos.
    pub(crate) SightStage = sight<TraversalConstants>(SightPush) {
        read nodes, read primitives, read probes, read centres, read framed, write seen,
    } with [Node, Probe]
);

/// Rays of one dispatch: short enough for any watchdog.
const RAYS: usize = 1 << 20;

/// Which photos see which points: a bit each.
#[derive(Clone, Debug, PartialEq)]
pub struct Sight {
    /// How many photos there are.
    pub photos: usize,
    /// 32-bit words of a point's row, an even number.
    pub words: usize,
    /// Row by row, photo `i` at bit `i % 32` of word `i / 32`.
    pub bits: Vec<u32>,
}

/// Points of the surface and what a pool of photos sees of them.
pub struct Survey {
    /// The points, in the user's world.
    pub points: Vec<SurfacePoint>,
    /// The same in the planner's frame, lifted off the surface.
    pub probes: Vec<Probe>,
    /// Where the photos were taken from, in the planner's frame.
    pub centres: Vec<Vec3>,
    /// The visibility matrix.
    pub sight: Sight,
}

impl Sight {
    /// No photo sees any point.
    pub fn empty(points: usize, photos: usize) -> Self {
        let words = photos.div_ceil(64).max(1) * 2;
        Self { photos, words, bits: vec![0; points * words] }
    }

    /// Whether a photo sees a point.
    pub fn sees(&self, point: usize, photo: usize) -> bool {
        self.bits[point * self.words + photo / 32] >> (photo % 32) & 1 == 1
    }

    /// The photos that see a point, ascending.
    pub fn photos_that_see(&self, point: usize) -> impl Iterator<Item = usize> + '_ {
        let row = &self.bits[point * self.words..(point + 1) * self.words];
        row.iter().enumerate().flat_map(|(i, word)| {
            let mut left = *word;
            std::iter::from_fn(move || {
                let bit = left.trailing_zeros() as usize;
                left &= left.wrapping_sub(1);
                (bit < 32).then_some(32 * i + bit)
            })
        })
    }

    /// The points that each photo sees, ascending.
    pub fn by_photo(&self) -> Vec<Vec<u32>> {
        let mut lists = vec![Vec::new(); self.photos];
        for (point, number) in (0..self.bits.len() / self.words).zip(0u32..) {
            self.photos_that_see(point).for_each(|photo| lists[photo].push(number));
        }
        lists
    }

    /// Points that at least `least` photos of a subset see.
    pub fn covered(&self, subset: &[usize], least: usize) -> usize {
        let views = |point: usize| subset.iter().filter(|photo| self.sees(point, **photo)).count();
        (0..self.bits.len() / self.words).filter(|point| views(*point) >= least).count()
    }

    /// Bytes of the bits.
    pub fn bytes(&self) -> usize {
        4 * self.bits.len()
    }
}

impl Survey {
    /// Computes what `photos` see of `points`, both in the user's world: inside the image through the real lens, on the
    /// side that faces the photo, and nothing in between.
    ///
    /// # Errors
    /// Where device memory runs out or the device fails.
    pub fn new(
        context: &Arc<Context>,
        scene: &DeviceScene,
        photos: &[Photo],
        points: Vec<SurfacePoint>,
    ) -> Result<Self> {
        let probes: Vec<Probe> = points.iter().map(|point| Probe::new(point, &scene.geometry)).collect();
        let centres = centres(&scene.geometry, photos);
        let framed = framed(photos, &positions(&points));
        let sight = cast(context, scene, &probes, &centres, &framed)?;
        Ok(Self { points, probes, centres, sight })
    }

    /// Unit direction from a point to a photo, in the planner's frame.
    pub fn direction(&self, point: usize, photo: usize) -> Vec3 {
        direction(Vec3::from(self.probes[point].position), self.centres[photo])
    }
}

/// What `photos` see of looks, which are given in the planner's frame, and where they were taken from there.
///
/// # Errors
/// As [`Survey::new`].
pub(crate) fn sight_of(
    context: &Arc<Context>,
    scene: &DeviceScene,
    photos: &[Photo],
    looks: &[Look],
) -> Result<(Sight, Vec<Vec3>)> {
    let back = scene.geometry.to_internal.inverse();
    let probe = |look: &Look| Probe { position: look.position, normal: look.normal, score: 1.0, sky: 0.0 };
    let probes: Vec<Probe> = looks.iter().map(probe).collect();
    let positions: Vec<DVec3> = looks.iter().map(|look| back.point(Vec3::from(look.position).as_dvec3())).collect();
    let centres = centres(&scene.geometry, photos);
    let sight = cast(context, scene, &probes, &centres, &framed(photos, &positions))?;
    Ok((sight, centres))
}

/// Where photos were taken from, in the planner's frame.
fn centres(geometry: &SceneGeometry, photos: &[Photo]) -> Vec<Vec3> {
    photos.iter().map(|photo| geometry.to_internal.point(photo.camera.pose.position).as_vec3()).collect()
}

fn positions(points: &[SurfacePoint]) -> Vec<DVec3> {
    points.iter().map(|point| point.position).collect()
}

fn direction(from: Vec3, to: Vec3) -> Vec3 {
    let ray = to - from;
    ray / ray.length().max(1e-6)
}

/// Which points lie in which images, lens distortion and all.
pub fn framed(photos: &[Photo], points: &[DVec3]) -> Sight {
    let lenses: Vec<Lens> = photos.iter().map(Photo::lens).collect();
    let mut sight = Sight::empty(points.len(), photos.len());
    let words = sight.words;
    in_parallel(&mut sight.bits, words, |point, row| {
        for (i, (photo, lens)) in photos.iter().zip(&lenses).enumerate() {
            if in_image(photo, lens, points[point]) {
                row[i / 32] |= 1 << (i % 32);
            }
        }
    });
    sight
}

fn in_image(photo: &Photo, lens: &Lens, point: DVec3) -> bool {
    let pose = &photo.camera.pose;
    lens.pixel(pose.rotation.inverse() * (point - pose.position)).is_some()
}

fn cast(
    context: &Arc<Context>,
    scene: &DeviceScene,
    probes: &[Probe],
    centres: &[Vec3],
    framed: &Sight,
) -> Result<Sight> {
    let centres: Vec<[f32; 4]> = centres.iter().map(|c| c.extend(0.0).to_array()).collect();
    let pipeline = Pipeline::new::<SightStage>(context, &scene.constants())?;
    let probes_on_device = Buffer::from_slice(context, "probes", probes)?;
    let centres_on_device = Buffer::from_slice(context, "centres", &centres)?;
    let framed_on_device = Buffer::from_slice(context, "framed", &framed.bits)?;
    let seen = Buffer::device(context, "seen", framed.bytes() as u64)?;
    let rows = (RAYS / (32 * framed.words)).max(1);
    in_parts(context, &mut Pace::new(context, rows as u32), [probes.len() as u32, 1], |commands, part| {
        for first in part.clone().step_by(rows) {
            let points = (rows as u32).min(part.end - first);
            commands
                .stage(
                    &pipeline,
                    SightStage {
                        nodes: &scene.nodes,
                        primitives: &scene.primitives,
                        probes: &probes_on_device,
                        centres: &centres_on_device,
                        framed: &framed_on_device,
                        seen: &seen,
                    },
                )
                .push(&SightPush { first, points, photos: framed.photos as u32, words: framed.words as u32 })
                .linear(points * framed.words as u32 / 2);
        }
        Ok(())
    })?;
    Ok(Sight { bits: seen.download(framed.bits.len())?, ..*framed })
}

/// What `sight` computes, on the host and in the same precision: the twin.
pub fn sight(geometry: &SceneGeometry, photos: &[Photo], points: &[SurfacePoint]) -> Sight {
    let centres = centres(geometry, photos);
    let framed = framed(photos, &positions(points));
    let mut sight = Sight::empty(points.len(), photos.len());
    for (i, point) in points.iter().enumerate() {
        let probe = Probe::new(point, geometry);
        let origin = Vec3::from(probe.position);
        for photo in framed.photos_that_see(i) {
            let direction = direction(origin, centres[photo]);
            let t_max = origin.distance(centres[photo]).max(1e-6);
            let open = !geometry.bvh.any_hit(&Ray { origin, direction, t_min: 0.0, t_max });
            if open && probe.faces(direction) {
                sight.bits[i * sight.words + photo / 32] |= 1 << (photo % 32);
            }
        }
    }
    sight
}

//! Looks: what the pixels of viewers show of the surface, drawn on the device (`look.comp`), and their twin.
//!
//! A look is a surface point, the direction and the distance from which a viewer sees it. Error of trained splats is judged
//! look by look ([`super::law`]).

use glam::{DVec2, DVec3, Vec3};

use super::law::Law;
use crate::engine::vulkan::shaders::glsl::planner::quality::look as glsl;
use crate::scene::camera::Camera;
use crate::visibility::bvh::{Bvh, Node, Primitives, TraversalConstants};
use crate::visibility::device_scene::SceneGeometry;
use crate::visibility::raycast::Ray;

crate::gpu_struct! {
    /// A viewer's pinhole camera in the planner's frame: the ray through image position (u, v), each in [0, 1] from the
    /// top left corner, runs along `corner + u across + v along`.
    pub(crate) struct Viewer {
        /// Camera centre.
        pub position: [f32; 3],
        /// Tangent of half the wider field of view.
        pub widest: f32,
        /// Ray through the image's top left corner.
        pub corner: [f32; 3],
        /// Unused.
        pub spare0: f32,
        /// From there to the top right corner.
        pub across: [f32; 3],
        /// Unused.
        pub spare1: f32,
        /// From there to the bottom left corner.
        pub along: [f32; 3],
        /// Unused.
        pub spare2: f32,
    }
}

crate::gpu_struct! {
    /// What a viewer's pixel shows, in the planner's frame: a point of the surface, or, beside an object, the empty place where
    /// its ray passes the object's middle, since trained splats must leave nothing there.
    pub struct Look {
        /// The surface point, lifted off the surface on the viewer's side.
        pub position: [f32; 3],
        /// From there to the viewer; 0 where the look counts for nothing.
        pub distance: f32,
        /// Unit direction from the point to the viewer.
        pub direction: [f32; 3],
        /// Of the viewer's picture at the point: distance times the tangent of half its wider field of view.
        pub footprint: f32,
        /// Unit normal of the surface on the viewer's side; zero in empty space.
        pub normal: [f32; 3],
        /// Of the look in its viewer's mean: 1 on the surface.
        pub weight: f32,
    }
}

crate::gpu_struct! {
    /// Push constants of `look`.
    pub(crate) struct LookPush {
        /// Middle of the surface.
        pub middle: [f32; 3],
        /// Weight of looks beside the surface; 0: they count for nothing.
        pub background: f32,
        /// Viewers in the pool.
        pub pool: u32,
        /// Viewers of this draw.
        pub count: u32,
        /// Viewers that an iteration moves the draw on by.
        pub advance: u32,
        /// Pixels of a viewer along a side of its picture.
        pub side: u32,
        /// Seed of the pixels' places.
        pub seed: u32,
        /// Height above the surface at which a point counts as free, on meshes.
        pub lift: f32,
    }
}

crate::stage!(
    /// A thread per pixel of each viewer.
    pub(crate) LookStage = look<TraversalConstants>(LookPush) {
        read nodes, read primitives, read control, read viewers, write looks,
    } with [Node, Viewer, Look]
);

/// Stream of the pixels' places.
const PIXELS: u32 = glsl::PIXELS;
/// Lift off a mesh as a fraction of the surface's bounding radius.
const LIFT: f64 = 1e-4;

impl Viewer {
    /// The viewer of a camera, given in the user's world.
    pub fn new(camera: &Camera, geometry: &SceneGeometry) -> Self {
        let pose = geometry.to_internal.pose(&camera.pose);
        let k = &camera.intrinsics;
        let size = DVec2::new(f64::from(k.width), f64::from(k.height));
        let focal = DVec2::from(k.focal);
        let first = -DVec2::from(k.principal) / focal;
        let turned = |x: f64, y: f64, z: f64| (pose.rotation * DVec3::new(x, y, z)).as_vec3().to_array();
        Self {
            position: pose.position.as_vec3().to_array(),
            widest: k.widest() as f32,
            corner: turned(first.x, first.y, 1.0),
            across: turned(size.x / focal.x, 0.0, 0.0),
            along: turned(0.0, size.y / focal.y, 0.0),
            ..Self::default()
        }
    }
}

/// What looks take of a surface, in the planner's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surroundings {
    /// Its middle.
    pub middle: Vec3,
    /// Height above it, on meshes, at which a point is out of its way.
    pub lift: f32,
    /// Weight of looks beside it, where there is nothing; 0: these count for nothing.
    pub background: f32,
}

impl Surroundings {
    /// Of a surface with the given bounding sphere in the user's world: of an object, beside which is nothing, or of a room.
    pub fn new(geometry: &SceneGeometry, sphere: (DVec3, f64), object: bool, law: &Law) -> Self {
        let to_internal = &geometry.to_internal;
        Self {
            middle: to_internal.point(sphere.0).as_vec3(),
            lift: (LIFT * to_internal.length(sphere.1)) as f32,
            background: if object { law.background } else { 0.0 },
        }
    }

    /// For `count` viewers of a pool of as many as `pool`.
    pub(crate) fn push(&self, pool: u32, count: u32, side: u32, seed: u32) -> LookPush {
        let Self { middle, lift, background } = *self;
        LookPush { middle: middle.to_array(), background, pool, count, advance: count, side, seed, lift }
    }
}

/// Casts rays on the host as `look.comp` does on the device.
pub(crate) struct Caster<'a> {
    bvh: &'a Bvh,
    around: Surroundings,
    /// Slot of each primitive in the hierarchy.
    slots: Vec<u32>,
}

impl<'a> Caster<'a> {
    /// Over the surface of a scene.
    pub fn new(geometry: &'a SceneGeometry, around: Surroundings) -> Self {
        let indices: Vec<u32> = match &geometry.bvh.primitives {
            Primitives::Triangles(triangles) => triangles.iter().map(|triangle| triangle.index).collect(),
            Primitives::Discs(discs) => discs.iter().map(|disc| disc.index).collect(),
        };
        let mut slots = vec![0; indices.iter().max().map_or(0, |most| *most as usize + 1)];
        for (slot, index) in (0..).zip(indices) {
            slots[index as usize] = slot;
        }
        Self { bvh: &geometry.bvh, around, slots }
    }

    /// What the viewer shows at image position (u, v). A look at distance 0 where it counts for nothing: it is of the back of a disc,
    /// or beside the surface of a room.
    pub fn look(&self, viewer: &Viewer, at: [f32; 2]) -> Look {
        let none = Look::default();
        let origin = Vec3::from(viewer.position);
        let ray = Vec3::from(viewer.corner) + at[0] * Vec3::from(viewer.across) + at[1] * Vec3::from(viewer.along);
        let direction = ray.normalize();
        let Some(hit) = self.bvh.closest_hit(&Ray { origin, direction, t_min: 0.0, t_max: f32::MAX }) else {
            let along = (self.around.middle - origin).dot(direction);
            if self.around.background == 0.0 || along <= 0.0 {
                return none;
            }
            return Look {
                position: (origin + along * direction).to_array(),
                distance: along,
                footprint: along * viewer.widest,
                direction: (-direction).to_array(),
                weight: self.around.background,
                ..none
            };
        };
        let slot = self.slots[hit.primitive as usize] as usize;
        let (normal, lift) = match &self.bvh.primitives {
            Primitives::Triangles(triangles) => {
                let triangle = &triangles[slot];
                let normal = Vec3::from(triangle.e1).cross(Vec3::from(triangle.e2)).normalize_or_zero();
                (if normal.dot(direction) > 0.0 { -normal } else { normal }, self.around.lift)
            }
            Primitives::Discs(discs) if Vec3::from(discs[slot].normal).dot(direction) >= 0.0 => return none,
            Primitives::Discs(discs) => (Vec3::from(discs[slot].normal), discs[slot].radius),
        };
        Look {
            position: (origin + hit.distance * direction + lift * normal).to_array(),
            distance: hit.distance,
            footprint: hit.distance * viewer.widest,
            direction: (-direction).to_array(),
            normal: normal.to_array(),
            weight: 1.0,
        }
    }
}

/// Image position of pixel `pixel` of draw `draw` in a picture of `side` x `side` pixels: anywhere within the pixel.
pub fn place(seed: u32, draw: u32, pixel: u32, side: u32) -> [f32; 2] {
    let words = crate::scene::random::pcg4d([seed, PIXELS, draw, pixel]);
    let [u, v] = [words[0], words[1]].map(crate::scene::random::uniform);
    [(pixel % side) as f32 + u, (pixel / side % side) as f32 + v].map(|x| x / side as f32)
}

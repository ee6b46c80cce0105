//! A scene on the device, as the stages that follow paths are bound to it.

use std::sync::Arc;

use bytemuck::Zeroable;

use super::assembly::Assembly;
use super::layout::{Light, Map};
use crate::Result;
use crate::engine::vulkan::{Buffer, Context};

/// A scene on the device.
pub(super) struct SceneBuffers {
    pub nodes: Buffer,
    pub primitives: Buffer,
    pub vertices: Buffer,
    pub faces: Buffer,
    pub materials: Buffer,
    pub maps: Buffer,
    pub texels: Buffer,
    pub lights: Buffer,
    pub sky: Buffer,
    pub aliases: Buffer,
    pub albedo: Buffer,
    pub setting: Buffer,
}

impl SceneBuffers {
    pub fn new(context: &Arc<Context>, a: &Assembly) -> Result<Self> {
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

/// A stage bound to the buffers of a scene, and to others by name.
macro_rules! bound {
    ($stage:ident, $scene:expr, $($name:ident: $buffer:expr),*) => {
        $stage {
            nodes: &$scene.nodes,
            primitives: &$scene.primitives,
            vertices: &$scene.vertices,
            faces: &$scene.faces,
            materials: &$scene.materials,
            maps: &$scene.maps,
            texels: &$scene.texels,
            lights: &$scene.lights,
            sky: &$scene.sky,
            aliases: &$scene.aliases,
            albedo: &$scene.albedo,
            setting: &$scene.setting,
            $($name: $buffer),*
        }
    };
}
pub(super) use bound;

fn filled<T: bytemuck::NoUninit>(context: &Arc<Context>, name: &str, data: &[T], instead: T) -> Result<Buffer> {
    if data.is_empty() {
        Buffer::from_slice(context, name, &[instead])
    } else {
        Buffer::from_slice(context, name, data)
    }
}

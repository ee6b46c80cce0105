//! Command buffers, fences and queries that recordings are done with, kept for the next ones: making them takes some drivers
//! longer than a short recording runs, and other devices of the process have to wait meanwhile. Pipelines, which take longest,
//! are all kept: a shader has a few sets of constants.

use std::collections::HashMap;
use std::sync::Mutex;

use ash::vk;

use crate::engine::parallel::lock;

/// Of each kind but pipelines so many are kept.
const MAX_REUSABLE: usize = 16;

/// Unused objects; and pipelines, used or not, by the address of the shader, of which names may be alike, and its constants.
#[derive(Default)]
pub(super) struct Reusable {
    pub commands: Mutex<Vec<Commands>>,
    pub fences: Mutex<Vec<vk::Fence>>,
    pub queries: Mutex<Vec<Queries>>,
    pub pipelines: Mutex<HashMap<(usize, Vec<u32>), Compiled>>,
}

/// What a pipeline is made of; it lives as long as its context.
#[derive(Clone, Copy, Default)]
pub(super) struct Compiled {
    pub raw: vk::Pipeline,
    pub layout: vk::PipelineLayout,
    pub set_layout: vk::DescriptorSetLayout,
    pub module: vk::ShaderModule,
}

impl Compiled {
    /// # Safety
    /// It must be of the device, and nothing that was recorded with it may still run.
    pub unsafe fn destroy(self, device: &ash::Device) {
        // SAFETY: by the caller; destroying a null handle does nothing.
        unsafe {
            device.destroy_pipeline(self.raw, None);
            device.destroy_shader_module(self.module, None);
            device.destroy_pipeline_layout(self.layout, None);
            device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}

/// A command buffer in a pool of its own, so that recording on several threads shares none.
#[derive(Clone, Copy)]
pub(super) struct Commands {
    pub pool: vk::CommandPool,
    pub raw: vk::CommandBuffer,
}

/// Capacity in timestamps.
#[derive(Clone, Copy)]
pub(super) struct Queries {
    pub pool: vk::QueryPool,
    pub count: u32,
}

/// Keeps `unused`, and gives the oldest back where there are too many.
pub(super) fn keep<T>(reusable: &Mutex<Vec<T>>, unused: T) -> Option<T> {
    let mut reusable = lock(reusable);
    reusable.push(unused);
    (reusable.len() > MAX_REUSABLE).then(|| reusable.remove(0))
}

//! Command buffers, fences and queries that recordings are done with, kept for the next ones: making them takes some drivers
//! longer than a short recording runs, and other devices of the process have to wait meanwhile.

use std::sync::Mutex;

use ash::vk;

use super::context::Context;
use crate::Result;
use crate::parallel::lock;

/// Of each kind so many are kept.
const MAX_SPARES: usize = 16;

/// What nobody uses.
#[derive(Default)]
pub(super) struct Spares {
    commands: Mutex<Vec<Commands>>,
    fences: Mutex<Vec<vk::Fence>>,
    queries: Mutex<Vec<Queries>>,
}

/// A command buffer in a pool of its own, so that recording on several threads shares none.
#[derive(Clone, Copy)]
pub(super) struct Commands {
    pub pool: vk::CommandPool,
    pub raw: vk::CommandBuffer,
}

/// Room for so many timestamps.
#[derive(Clone, Copy)]
pub(super) struct Queries {
    pub pool: vk::QueryPool,
    pub count: u32,
}

/// Keeps `spare`, and gives the oldest back where there are too many.
fn keep<T>(spares: &Mutex<Vec<T>>, spare: T) -> Option<T> {
    let mut spares = lock(spares);
    spares.push(spare);
    (spares.len() > MAX_SPARES).then(|| spares.remove(0))
}

impl Context {
    /// A command buffer that nobody uses and that is not recording.
    pub(super) fn take_commands(&self) -> Result<Commands> {
        if let Some(commands) = lock(&self.spares.commands).pop() {
            return Ok(commands);
        }
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(self.physical().queue_family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        // SAFETY: the device is live and has this queue family.
        let pool = unsafe { self.device.create_command_pool(&info, None) }
            .map_err(|code| self.failure("vkCreateCommandPool", code))?;
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(pool)
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        // SAFETY: the pool was made above, and goes where it gives no command buffer.
        unsafe {
            match self.device.allocate_command_buffers(&info) {
                Ok(made) => Ok(Commands { pool, raw: made[0] }),
                Err(code) => {
                    self.device.destroy_command_pool(pool, None);
                    Err(self.failure("vkAllocateCommandBuffers", code))
                }
            }
        }
    }

    /// Takes a command buffer back, no submission of which is pending.
    pub(super) fn give_commands(&self, commands: Commands) {
        // SAFETY: by the caller's word nothing of the pool is pending.
        let reset = unsafe { self.device.reset_command_pool(commands.pool, vk::CommandPoolResetFlags::empty()) };
        let left = if reset.is_ok() { keep(&self.spares.commands, commands) } else { Some(commands) };
        if let Some(Commands { pool, .. }) = left {
            // SAFETY: of this one or one that is kept, nothing is pending.
            unsafe { self.device.destroy_command_pool(pool, None) };
        }
    }

    /// A fence that is not signalled and that nothing will signal.
    pub(super) fn take_fence(&self) -> Result<vk::Fence> {
        if let Some(fence) = lock(&self.spares.fences).pop() {
            return Ok(fence);
        }
        // SAFETY: the info is valid for the device.
        unsafe { self.device.create_fence(&vk::FenceCreateInfo::default(), None) }
            .map_err(|code| self.failure("vkCreateFence", code))
    }

    /// Takes a fence back that nothing will signal.
    pub(super) fn give_fence(&self, fence: vk::Fence) {
        // SAFETY: by the caller's word no submission that would signal it is pending.
        let reset = unsafe { self.device.reset_fences(&[fence]) };
        let left = if reset.is_ok() { keep(&self.spares.fences, fence) } else { Some(fence) };
        if let Some(fence) = left {
            // SAFETY: neither this one nor one that is kept will be signalled.
            unsafe { self.device.destroy_fence(fence, None) };
        }
    }

    /// Room for `count` timestamps; what it holds is to be reset.
    pub(super) fn take_queries(&self, count: u32) -> Result<Queries> {
        let mut spares = lock(&self.spares.queries);
        if let Some(at) = spares.iter().position(|queries| queries.count == count) {
            return Ok(spares.swap_remove(at));
        }
        drop(spares);
        let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(count);
        // SAFETY: the info is valid.
        let pool = unsafe { self.device.create_query_pool(&info, None) }
            .map_err(|code| self.failure("vkCreateQueryPool", code))?;
        Ok(Queries { pool, count })
    }

    /// Takes queries back that no pending submission writes.
    pub(super) fn give_queries(&self, queries: Queries) {
        if let Some(Queries { pool, .. }) = keep(&self.spares.queries, queries) {
            // SAFETY: by the caller's word no submission uses it any more, nor one that is kept.
            unsafe { self.device.destroy_query_pool(pool, None) };
        }
    }

    /// Destroys what is kept.
    pub(super) fn destroy_spares(&self) {
        let Spares { commands, fences, queries } = &self.spares;
        // SAFETY: nobody uses what is kept.
        unsafe {
            lock(commands).drain(..).for_each(|Commands { pool, .. }| self.device.destroy_command_pool(pool, None));
            lock(fences).drain(..).for_each(|fence| self.device.destroy_fence(fence, None));
            lock(queries).drain(..).for_each(|Queries { pool, .. }| self.device.destroy_query_pool(pool, None));
        }
    }
}

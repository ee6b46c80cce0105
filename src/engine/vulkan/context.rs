//! The context: one device and one queue, our own or a host application's.

use std::borrow::Cow;
use std::ffi::{CStr, CString};
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use ash::vk;
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};

use super::choice::{Choice, choose};
use super::instance::Instance;
use super::physical::{Physical, free_memory};
use super::queue::QueueLock;
use super::reuse::{Commands, Queries, Reusable, keep};
use super::timeline::Timeline;
use crate::engine::parallel::lock;
use crate::{Error, Result};

/// How to make a context.
#[derive(Clone, Debug, Default)]
pub struct ContextOptions {
    /// Index or part of the name of the device; the best one where absent.
    pub device: Option<String>,
    /// Run the validation layers (core and synchronisation); their messages are collected, see [`Context::messages`].
    pub validation: bool,
    /// Wait after every stage, so that a lost device names the stage that lost it.
    pub debug_sync: bool,
    /// Let RenderDoc take captures, see [`RenderDoc`](super::capture::RenderDoc).
    pub capture: bool,
    /// How long a submission may take before waiting for it is an error; a minute where absent, and without end on CPU devices, which are
    /// slow and do not hang.
    pub wait_limit: Option<Duration>,
}

/// What a submission is to take, unless a host says otherwise.
pub(super) const SUBMISSION_TIME: Duration = Duration::from_millis(100);
/// Longer than any submission is meant to take by a hundred times.
const WAIT_LIMIT: Duration = Duration::from_secs(60);

/// A device, its compute queue and its memory. Shared by everything that lives on the device.
pub struct Context {
    pub(super) device: ash::Device,
    pub(super) allocator: ManuallyDrop<Mutex<Allocator>>,
    pub(super) push_descriptor: ash::khr::push_descriptor::Device,
    pub(super) debug_utils: Option<ash::ext::debug_utils::Device>,
    pub(super) checkpoints: Option<ash::nv::device_diagnostic_checkpoints::Device>,
    pub(super) debug_sync: bool,
    wait_limit: Option<Duration>,
    notes: Vec<String>,
    /// Before names and labels, so that a host application's capture keeps them apart.
    prefix: String,
    /// The driver's cache of what it compiles.
    pub(super) pipeline_cache: vk::PipelineCache,
    pub(super) reusable: Reusable,
    queue: vk::Queue,
    queue_lock: Arc<dyn QueueLock>,
    submission_time: Option<Duration>,
    physical: Physical,
    owned: bool,
    // Bytes of buffers in device memory now, and most at once.
    allocated: [AtomicU64; 2],
    instance: Instance,
}

/// What [`Context::adopt`](super::host) and [`Context::new`] have in common.
pub(super) struct Parts {
    pub instance: Instance,
    pub physical: Physical,
    pub device: ash::Device,
    pub queue: vk::Queue,
    pub queue_lock: Arc<dyn QueueLock>,
    pub submission_time: Option<Duration>,
    pub checkpoints: bool,
    pub debug_sync: bool,
    pub wait_limit: Option<Duration>,
    pub notes: Vec<String>,
    pub prefix: String,
    pub owned: bool,
}

impl Context {
    /// Makes an instance and a device of our own.
    ///
    /// # Errors
    /// No loader, no driver, no such device, or a device that lacks what the engine needs.
    pub fn new(options: &ContextOptions) -> Result<Arc<Self>> {
        let instance = Instance::with_layers(options.validation, options.capture)?;
        let mut devices = Physical::all(&instance)?;
        let Choice { device, notes } = choose(&devices, options.device.as_deref())?;
        let physical = devices.swap_remove(device);
        let queue_info =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(physical.queue_family).queue_priorities(&[1.0])];
        let mut extensions = vec![ash::khr::push_descriptor::NAME.as_ptr()];
        if physical.checkpoints {
            extensions.push(ash::nv::device_diagnostic_checkpoints::NAME.as_ptr());
        }
        if physical.memory_budget {
            extensions.push(ash::ext::memory_budget::NAME.as_ptr());
        }
        if physical.portability {
            extensions.push(ash::khr::portability_subset::NAME.as_ptr());
        }
        let mut sizes = vk::PhysicalDeviceSubgroupSizeControlFeatures::default()
            .subgroup_size_control(true)
            .compute_full_subgroups(true);
        if physical.asked_width.is_some() {
            extensions.push(ash::ext::subgroup_size_control::NAME.as_ptr());
        }
        let mut floats =
            vk::PhysicalDeviceShaderAtomicFloatFeaturesEXT::default().shader_buffer_float32_atomic_add(true);
        if physical.atomic_floats {
            extensions.push(ash::ext::shader_atomic_float::NAME.as_ptr());
        }
        // Every device of Vulkan 1.2 has it.
        let mut timelines = vk::PhysicalDeviceTimelineSemaphoreFeatures::default().timeline_semaphore(true);
        let mut info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queue_info)
            .enabled_extension_names(&extensions)
            .push_next(&mut timelines);
        if physical.atomic_floats {
            info = info.push_next(&mut floats);
        }
        if physical.asked_width.is_some() {
            info = info.push_next(&mut sizes);
        }
        // SAFETY: the physical device belongs to this instance and lists every extension and feature that is enabled.
        let device = unsafe { instance.raw.create_device(physical.raw, &info, None) }
            .map_err(|code| Error::Vulkan { what: "vkCreateDevice", code })?;
        // SAFETY: the device was made with one queue of this family.
        let queue = unsafe { device.get_device_queue(physical.queue_family, 0) };
        let checkpoints = physical.checkpoints;
        Self::assemble(Parts {
            instance,
            physical,
            device,
            queue,
            queue_lock: Arc::new(Mutex::default()),
            submission_time: None,
            checkpoints,
            debug_sync: options.debug_sync,
            wait_limit: options.wait_limit,
            notes,
            prefix: String::new(),
            owned: true,
        })
    }

    pub(super) fn assemble(parts: Parts) -> Result<Arc<Self>> {
        let Parts { instance, physical, device, queue, queue_lock, checkpoints, debug_sync, .. } = parts;
        let Parts { submission_time, wait_limit, notes, prefix, owned, .. } = parts;
        let (allocator, pipeline_cache) = match allocator_and_cache(&instance, &physical, &device) {
            Ok(made) => made,
            Err(error) => {
                if owned {
                    // SAFETY: nothing has been made with the device.
                    unsafe { device.destroy_device(None) };
                }
                return Err(error);
            }
        };
        Ok(Arc::new(Self {
            allocator: ManuallyDrop::new(Mutex::new(allocator)),
            push_descriptor: ash::khr::push_descriptor::Device::new(&instance.raw, &device),
            debug_utils: instance.debug_utils.then(|| ash::ext::debug_utils::Device::new(&instance.raw, &device)),
            checkpoints: checkpoints
                .then(|| ash::nv::device_diagnostic_checkpoints::Device::new(&instance.raw, &device)),
            debug_sync,
            wait_limit: wait_limit.or((!physical.is_cpu()).then_some(WAIT_LIMIT)),
            notes,
            prefix,
            pipeline_cache,
            reusable: Reusable::default(),
            queue,
            queue_lock,
            submission_time,
            physical,
            owned,
            allocated: Default::default(),
            device,
            instance,
        }))
    }

    /// What the device is and can do.
    pub fn physical(&self) -> &Physical {
        &self.physical
    }

    /// What the user should know of the choice of the device: which GPU was passed over and for what, and whether there is none. A line each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// How long a submission may take; for ever where absent.
    pub(super) fn wait_limit(&self) -> Option<Duration> {
        self.wait_limit
    }

    /// What a submission is to take.
    pub(super) fn submission_time(&self) -> Duration {
        self.submission_time.unwrap_or(SUBMISSION_TIME)
    }

    /// Whether a host wants to wait for one submission at most: then each is waited for before the next.
    pub(crate) fn submits_one_by_one(&self) -> bool {
        self.submission_time.is_some()
    }

    /// Whether every stage is waited for.
    pub fn debug_sync(&self) -> bool {
        self.debug_sync
    }

    /// Bytes of buffers in device memory that are allocated now; those on the host do not count.
    pub fn allocated(&self) -> u64 {
        self.allocated[0].load(Ordering::Relaxed)
    }

    /// Most bytes of buffers in device memory that were allocated at once so far; those on the host do not count.
    pub fn peak_allocated(&self) -> u64 {
        self.allocated[1].load(Ordering::Relaxed)
    }

    pub(super) fn count_allocated(&self, bytes: u64) {
        let now = self.allocated[0].fetch_add(bytes, Ordering::Relaxed) + bytes;
        self.allocated[1].fetch_max(now, Ordering::Relaxed);
    }

    pub(super) fn count_freed(&self, bytes: u64) {
        self.allocated[0].fetch_sub(bytes, Ordering::Relaxed);
    }

    /// Messages of the validation layers so far. Empty where they are off, and must be empty where they are on.
    pub fn messages(&self) -> Vec<String> {
        lock(&self.instance.messages).clone()
    }

    /// Bytes of device memory that can still be taken.
    pub fn memory_available(&self) -> u64 {
        if !self.physical.memory_budget {
            return self.physical.heap;
        }
        free_memory(&self.instance, self.physical.raw)
    }

    /// Submits a command buffer between timeline semaphores, with a fence that is signalled when it has run. The queue is locked for the call.
    pub(super) fn submit(
        &self,
        commands: vk::CommandBuffer,
        fence: vk::Fence,
        after: &[Timeline],
        signal: &[Timeline],
    ) -> Result<()> {
        let [waits, signals] = [after, signal].map(|list| list.iter().map(|at| at.semaphore).collect::<Vec<_>>());
        let [from, to] = [after, signal].map(|list| list.iter().map(|at| at.value).collect::<Vec<_>>());
        let stages = vec![vk::PipelineStageFlags::ALL_COMMANDS; after.len()];
        let mut values = vk::TimelineSemaphoreSubmitInfo::default();
        values = values.wait_semaphore_values(&from).signal_semaphore_values(&to);
        let mut submit = vk::SubmitInfo::default().command_buffers(std::slice::from_ref(&commands));
        if !(after.is_empty() && signal.is_empty()) {
            submit = submit.wait_semaphores(&waits).wait_dst_stage_mask(&stages).signal_semaphores(&signals);
            submit = submit.push_next(&mut values);
        }
        let mut submitted = None;
        self.queue_lock.locked(&mut || {
            // A lock that calls twice would have the fence signalled twice.
            if submitted.is_none() {
                // SAFETY: the command buffer is recorded and of this device, the semaphores as the caller of `submit_between` guarantees; the
                // lock makes the queue ours for the call.
                submitted = Some(unsafe { self.device.queue_submit(self.queue, &[submit], fence) });
            }
        });
        submitted.ok_or(Error::Interrupted)?.map_err(|code| self.failure("vkQueueSubmit", code))
    }

    /// The error for a failed call; a lost device names the last stage that started, where the driver reports it.
    pub(super) fn failure(&self, what: &'static str, code: vk::Result) -> Error {
        match code {
            vk::Result::ERROR_DEVICE_LOST => Error::DeviceLost { stage: self.last_checkpoint() },
            code => Error::Vulkan { what, code },
        }
    }

    fn last_checkpoint(&self) -> String {
        let Some(functions) = &self.checkpoints else {
            return "unknown (`debug_sync` finds it out)".into();
        };
        // SAFETY: the extension is enabled; every marker set by the recorder points at a stage's static label.
        unsafe {
            let count = functions.get_queue_checkpoint_data_len(self.queue);
            let mut data = vec![vk::CheckpointDataNV::default(); count];
            functions.get_queue_checkpoint_data(self.queue, &mut data);
            let top = data.iter().find(|entry| entry.stage == vk::PipelineStageFlags::TOP_OF_PIPE);
            match top.or(data.first()) {
                Some(entry) if !entry.p_checkpoint_marker.is_null() => {
                    CStr::from_ptr(entry.p_checkpoint_marker.cast()).to_string_lossy().into_owned()
                }
                _ => "unknown".into(),
            }
        }
    }

    /// A name or label behind the host's prefix.
    pub(super) fn prefixed<'n>(&self, name: &'n CStr) -> Cow<'n, CStr> {
        prefixed(&self.prefix, name)
    }

    pub(super) fn name<T: vk::Handle>(&self, handle: T, name: &CStr) {
        if let Some(functions) = &self.debug_utils {
            let name = self.prefixed(name);
            let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(handle).object_name(&name);
            // SAFETY: the handle is live and of this device. A name that could not be set is not worth an error.
            let _ = unsafe { functions.set_debug_utils_object_name(&info) };
        }
    }
}

/// Where one fails, neither is there.
fn allocator_and_cache(
    instance: &Instance,
    physical: &Physical,
    device: &ash::Device,
) -> Result<(Allocator, vk::PipelineCache)> {
    let mut debug_settings = gpu_allocator::AllocatorDebugSettings::default();
    debug_settings.log_leaks_on_shutdown = false;
    let allocator = Allocator::new(&AllocatorCreateDesc {
        instance: instance.raw.clone(),
        device: device.clone(),
        physical_device: physical.raw,
        debug_settings,
        buffer_device_address: false,
        // Large blocks would take more from the device than was announced.
        allocation_sizes: gpu_allocator::AllocationSizes::new(16 << 20, 16 << 20),
    })
    .map_err(|e| Error::NoDevice(format!("{}: {e}", physical.name)))?;
    // SAFETY: the info is valid; the cache goes with the context.
    let cache = unsafe { device.create_pipeline_cache(&vk::PipelineCacheCreateInfo::default(), None) }
        .map_err(|code| Error::Vulkan { what: "vkCreatePipelineCache", code })?;
    Ok((allocator, cache))
}

fn prefixed<'n>(prefix: &str, name: &'n CStr) -> Cow<'n, CStr> {
    let both = || CString::new([prefix.as_bytes(), name.to_bytes()].concat());
    match prefix.is_empty() {
        true => Cow::Borrowed(name),
        // A prefix with a NUL is none.
        false => both().map_or(Cow::Borrowed(name), Cow::Owned),
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        self.destroy_reusable();
        // SAFETY: buffers, pipelines and recordings hold an `Arc` of this context, so none is left; each waited for its
        // own work. The allocator goes before the device, the device before the instance (the last field).
        unsafe {
            ManuallyDrop::drop(&mut self.allocator);
            self.device.destroy_pipeline_cache(self.pipeline_cache, None);
            if self.owned {
                self.device.destroy_device(None);
            }
        }
    }
}

impl Context {
    /// An unused command buffer that is not recording.
    pub(super) fn take_commands(&self) -> Result<Commands> {
        if let Some(commands) = lock(&self.reusable.commands).pop() {
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
        // SAFETY: the caller guarantees that nothing of the pool is pending.
        let reset = unsafe { self.device.reset_command_pool(commands.pool, vk::CommandPoolResetFlags::empty()) };
        let left = if reset.is_ok() { keep(&self.reusable.commands, commands) } else { Some(commands) };
        if let Some(Commands { pool, .. }) = left {
            // SAFETY: of this one or one that is kept, nothing is pending.
            unsafe { self.device.destroy_command_pool(pool, None) };
        }
    }

    /// A fence that is not signalled and that nothing will signal.
    pub(super) fn take_fence(&self) -> Result<vk::Fence> {
        if let Some(fence) = lock(&self.reusable.fences).pop() {
            return Ok(fence);
        }
        // SAFETY: the info is valid for the device.
        unsafe { self.device.create_fence(&vk::FenceCreateInfo::default(), None) }
            .map_err(|code| self.failure("vkCreateFence", code))
    }

    /// Takes a fence back that nothing will signal.
    pub(super) fn give_fence(&self, fence: vk::Fence) {
        // SAFETY: the caller guarantees that no submission that would signal it is pending.
        let reset = unsafe { self.device.reset_fences(&[fence]) };
        let left = if reset.is_ok() { keep(&self.reusable.fences, fence) } else { Some(fence) };
        if let Some(fence) = left {
            // SAFETY: neither this one nor one that is kept will be signalled.
            unsafe { self.device.destroy_fence(fence, None) };
        }
    }

    /// Queries for `count` timestamps; what it holds is to be reset.
    pub(super) fn take_queries(&self, count: u32) -> Result<Queries> {
        let mut reusable = lock(&self.reusable.queries);
        if let Some(at) = reusable.iter().position(|queries| queries.count == count) {
            return Ok(reusable.swap_remove(at));
        }
        drop(reusable);
        let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(count);
        // SAFETY: the info is valid.
        let pool = unsafe { self.device.create_query_pool(&info, None) }
            .map_err(|code| self.failure("vkCreateQueryPool", code))?;
        Ok(Queries { pool, count })
    }

    /// Takes queries back that no pending submission writes.
    pub(super) fn give_queries(&self, queries: Queries) {
        if let Some(Queries { pool, .. }) = keep(&self.reusable.queries, queries) {
            // SAFETY: the caller guarantees that no submission uses it any more, nor one that is kept.
            unsafe { self.device.destroy_query_pool(pool, None) };
        }
    }

    /// Destroys what is kept.
    pub(super) fn destroy_reusable(&self) {
        let Reusable { commands, fences, queries, pipelines } = &self.reusable;
        // SAFETY: what is kept is unused, as no recording is left that could run a pipeline.
        unsafe {
            lock(commands).drain(..).for_each(|Commands { pool, .. }| self.device.destroy_command_pool(pool, None));
            lock(fences).drain(..).for_each(|fence| self.device.destroy_fence(fence, None));
            lock(queries).drain(..).for_each(|Queries { pool, .. }| self.device.destroy_query_pool(pool, None));
            lock(pipelines).drain().for_each(|(_, compiled)| compiled.destroy(&self.device));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a host could not tell the engine's stages in a capture from its own, or a NUL in its prefix would end the process.
    #[test]
    fn names_are_behind_the_prefix() {
        assert_eq!(prefixed("camsplat/", c"look").as_ref(), c"camsplat/look");
        assert_eq!((prefixed("", c"look").as_ref(), prefixed("a\0b", c"look").as_ref()), (c"look", c"look"));
    }
}

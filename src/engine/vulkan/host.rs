//! Adopting a device that a host application made.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use ash::vk::{self, Handle};

use super::context::{Context, Parts};
use super::instance::Instance;
use super::physical::Physical;
pub use super::queue::QueueLock;
pub use super::timeline::Timeline;
use crate::{Error, Result};

/// A host application's Vulkan objects. All stay the host's: nothing here is destroyed by the engine.
pub struct HostDevice {
    /// The loaded Vulkan library.
    pub entry: ash::Entry,
    /// The host's instance, of Vulkan 1.2 or later.
    pub instance: ash::Instance,
    /// The physical device.
    pub physical: vk::PhysicalDevice,
    /// The logical device, made with `VK_KHR_push_descriptor` enabled.
    pub device: ash::Device,
    /// Family of `queue`, one with compute.
    pub queue_family: u32,
    /// The queue that the engine submits to where the host does not submit itself.
    pub queue: vk::Queue,
    /// Taken by the engine around every `vkQueueSubmit` to `queue`, a [`Mutex`] or the host's own; the host takes the same lock wherever it
    /// submits to the queue, presents, or waits for it or the whole device. A host that lends a queue that it does not use itself need not take it, and orders its work by timeline semaphores
    /// ([`Timeline`]).
    pub queue_lock: Arc<dyn QueueLock>,
    /// What a submission is to take; 100 ms where absent. Where it is given, the engine waits for each submission that it makes by itself
    /// before the next, so that the host's work waits for no more than one.
    pub submission_time: Option<Duration>,
    /// Whether `VK_EXT_debug_utils` is enabled on the instance: buffers, pipelines and stages then have names in captures.
    pub debug_utils: bool,
    /// What those names begin with ("camsplat/").
    pub prefix: String,
    /// Whether `VK_EXT_memory_budget` is enabled on the device: what fits is then decided by what is free, not by the heap's size.
    pub memory_budget: bool,
    /// As [`ContextOptions::wait_limit`](super::ContextOptions::wait_limit).
    pub wait_limit: Option<Duration>,
}

/// A host application's Vulkan objects as other bindings and C have them: dispatchable handles are pointers, and all may be cast to
/// 64 bits. For what they mean see [`HostDevice`].
#[derive(Clone, Copy, Debug)]
pub struct RawHost {
    /// The loader's `vkGetInstanceProcAddr`.
    pub get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
    /// `VkInstance`.
    pub instance: u64,
    /// `VkPhysicalDevice`.
    pub physical: u64,
    /// `VkDevice`.
    pub device: u64,
    /// `VkQueue`.
    pub queue: u64,
    /// Its family.
    pub queue_family: u32,
}

impl HostDevice {
    /// The same host by raw handles, with a lock of its own and without debug-utils.
    ///
    /// # Safety
    /// The handles must be valid and of one another, and `get_instance_proc_addr` that of the loader that made the instance.
    pub unsafe fn from_raw(host: RawHost) -> Self {
        let RawHost { get_instance_proc_addr, instance, physical, device, queue, queue_family } = host;
        // SAFETY: as the caller guarantees.
        unsafe {
            let functions = ash::StaticFn { get_instance_proc_addr };
            let instance = ash::Instance::load(&functions, vk::Instance::from_raw(instance));
            let device = ash::Device::load(instance.fp_v1_0(), vk::Device::from_raw(device));
            Self {
                entry: ash::Entry::from_static_fn(functions),
                instance,
                physical: vk::PhysicalDevice::from_raw(physical),
                device,
                queue_family,
                queue: vk::Queue::from_raw(queue),
                queue_lock: Arc::new(Mutex::default()),
                submission_time: None,
                debug_utils: false,
                prefix: String::new(),
                memory_budget: false,
                wait_limit: None,
            }
        }
    }
}

impl Context {
    /// Runs on a host application's device.
    ///
    /// # Safety
    /// Every handle in `host` must be valid and outlive the context and everything made with it, and the device must
    /// have been made with the extension and queue family that `host` names. While `queue_lock` has the engine submit, nothing else may use
    /// the queue: submit to it, present, or wait for it or for the whole device.
    ///
    /// # Errors
    /// Where the physical device lacks what the engine needs.
    pub unsafe fn adopt(host: HostDevice) -> Result<Arc<Self>> {
        let HostDevice { entry, instance, physical, device, queue_family, queue, queue_lock, debug_utils, .. } = host;
        let instance = Instance::adopt(entry, instance, debug_utils);
        let handle = physical;
        let mut physical = Physical::read(&instance, handle);
        if !physical.lacks.is_empty() {
            return Err(Error::NoDevice(format!("{} lacks {}", physical.name, physical.lacks.join(", "))));
        }
        // Without the extension the function is missing, and a call of it would end the process.
        // SAFETY: the device is the caller's, of this instance, and alive.
        let push = unsafe { instance.raw.get_device_proc_addr(device.handle(), c"vkCmdPushDescriptorSetKHR".as_ptr()) };
        if push.is_none() {
            return Err(Error::NoDevice(format!(
                "the device on {} was made without VK_KHR_push_descriptor; enable it when you create the device",
                physical.name
            )));
        }
        // SAFETY: as above.
        let named =
            unsafe { instance.raw.get_device_proc_addr(device.handle(), c"vkSetDebugUtilsObjectNameEXT".as_ptr()) };
        if debug_utils && named.is_none() {
            return Err(Error::NoDevice(format!(
                "names are wanted on {}, and the instance was made without VK_EXT_debug_utils; enable it, or do without",
                physical.name
            )));
        }
        // SAFETY: as above.
        let families = unsafe { instance.raw.get_physical_device_queue_family_properties(handle) };
        let lent = families.get(queue_family as usize);
        let Some(family) = lent.filter(|family| family.queue_flags.contains(vk::QueueFlags::COMPUTE)) else {
            return Err(Error::NoDevice(format!("queue family {queue_family} of {} cannot compute", physical.name)));
        };
        // Those of the family that the engine would have taken are another's.
        physical.timestamp_bits = family.timestamp_valid_bits;
        physical.queue_family = queue_family;
        physical.memory_budget &= host.memory_budget;
        physical.atomic_floats = false;
        // The host may not have enabled it.
        if physical.asked_width.take().is_some() {
            physical.subgroup_width = None;
        }
        Self::assemble(Parts {
            instance,
            physical,
            device,
            queue,
            queue_lock,
            submission_time: host.submission_time,
            checkpoints: false,
            debug_sync: false,
            wait_limit: host.wait_limit,
            notes: Vec::new(),
            prefix: host.prefix,
            owned: false,
        })
    }
}

//! Adopting a device that a host application made.

use std::sync::{Arc, Mutex};

use ash::vk;

use super::context::{Context, Parts};
use super::instance::Instance;
use super::physical::Physical;
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
    /// Taken by the engine around every submission to `queue`; the host takes the same lock around its own.
    pub queue_lock: Arc<Mutex<()>>,
    /// Whether `VK_EXT_debug_utils` is enabled on the instance.
    pub debug_utils: bool,
}

impl Context {
    /// Runs on a host application's device.
    ///
    /// # Safety
    /// Every handle in `host` must be valid and outlive the context and everything made with it, and the device must
    /// have been made with the extension and queue family that `host` names.
    ///
    /// # Errors
    /// Where the physical device lacks what the engine needs.
    pub unsafe fn adopt(host: HostDevice) -> Result<Arc<Self>> {
        let HostDevice { entry, instance, physical, device, queue_family, queue, queue_lock, debug_utils } = host;
        let instance = Instance::adopt(entry, instance, debug_utils);
        let mut physical = Physical::read(&instance, physical);
        if !physical.lacks.is_empty() {
            return Err(Error::NoDevice(format!("{} lacks {}", physical.name, physical.lacks.join(", "))));
        }
        physical.queue_family = queue_family;
        physical.memory_budget = false;
        physical.atomic_floats = false;
        Self::assemble(Parts {
            instance,
            physical,
            device,
            queue,
            queue_lock,
            checkpoints: false,
            debug_sync: false,
            owned: false,
        })
    }
}

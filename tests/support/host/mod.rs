//! A host application that lends its device to the engine.

use std::ffi::{CStr, c_char, c_void};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use ash::vk::{self, Handle};
use camsplat::Result;
use camsplat::engine::vulkan::host::{HostDevice, QueueLock, RawHost};
use camsplat::engine::vulkan::recorder::Kept;
use camsplat::engine::vulkan::{Context, Recorder};

/// A host application with a device, a queue and validation layers of its own.
pub struct Host {
    entry: ash::Entry,
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    pub device: ash::Device,
    pub queue: vk::Queue,
    queue_lock: Arc<Mutex<()>>,
    pub pool: vk::CommandPool,
    messenger: vk::DebugUtilsMessengerEXT,
    /// Messages of the validation layers.
    pub messages: Box<Mutex<Vec<String>>>,
}

unsafe extern "system" fn on_message(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: `user` is `Host::messages`, which outlives the messenger; the layer passes a valid `data`.
    unsafe {
        let text = (*data).message_as_c_str().unwrap_or(c"").to_string_lossy().into_owned();
        (*user.cast::<Mutex<Vec<String>>>()).lock().unwrap().push(text);
    }
    vk::FALSE
}

impl Host {
    /// A device like the one that the engine takes: the one called `name`.
    pub fn new(name: &str) -> Self {
        Self::with(name, &[ash::khr::push_descriptor::NAME.as_ptr()])
    }

    /// A device with these extensions enabled.
    pub fn with(name: &str, extensions_of_device: &[*const c_char]) -> Self {
        const FAMILY: u32 = 0;
        let messages = Box::<Mutex<Vec<String>>>::default();
        // SAFETY: every create-info lives to the end of its call, and every handle comes from the call before it.
        unsafe {
            let entry = ash::Entry::load().unwrap();
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
            let layers = [c"VK_LAYER_KHRONOS_validation".as_ptr()];
            let extensions = [ash::ext::debug_utils::NAME.as_ptr()];
            let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
            let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
            let info = vk::InstanceCreateInfo::default()
                .application_info(&application)
                .enabled_layer_names(&layers)
                .enabled_extension_names(&extensions)
                .push_next(&mut features);
            let instance = entry.create_instance(&info, None).unwrap();
            let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
                .message_severity(
                    vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
                )
                .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
                .pfn_user_callback(Some(on_message))
                .user_data((&raw const *messages).cast_mut().cast());
            let functions = ash::ext::debug_utils::Instance::new(&entry, &instance);
            let messenger = functions.create_debug_utils_messenger(&info, None).unwrap();
            let named = |raw: &vk::PhysicalDevice| {
                let properties = instance.get_physical_device_properties(*raw);
                properties.device_name_as_c_str().map(CStr::to_string_lossy).is_ok_and(|found| found == name)
            };
            let physical = instance.enumerate_physical_devices().unwrap().into_iter().find(named).unwrap();
            let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(FAMILY).queue_priorities(&[1.0])];
            let mut timelines = vk::PhysicalDeviceTimelineSemaphoreFeatures::default().timeline_semaphore(true);
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(extensions_of_device)
                .push_next(&mut timelines);
            let device = instance.create_device(physical, &info, None).unwrap();
            let queue = device.get_device_queue(FAMILY, 0);
            let info = vk::CommandPoolCreateInfo::default().queue_family_index(FAMILY);
            let pool = device.create_command_pool(&info, None).unwrap();
            let queue_lock = Arc::default();
            Self { entry, instance, physical, device, queue, queue_lock, pool, messenger, messages }
        }
    }

    pub fn adopted(&self) -> Arc<Context> {
        self.adopted_on(0).unwrap()
    }

    pub fn adopted_on(&self, queue_family: u32) -> Result<Arc<Context>> {
        // SAFETY: the host outlives every context of these tests.
        unsafe { Context::adopt(HostDevice { queue_family, ..self.lend() }) }
    }

    /// For a host that draws meanwhile, which wants submissions of so many milliseconds behind a lock of its own.
    pub fn adopted_between_frames(&self, queue_lock: Arc<dyn QueueLock>, milliseconds: u64) -> Arc<Context> {
        let submission_time = Some(Duration::from_millis(milliseconds));
        // SAFETY: the host outlives every context of these tests, and submits nothing while the engine does.
        unsafe { Context::adopt(HostDevice { queue_lock, submission_time, ..self.lend() }) }.unwrap()
    }

    /// What it lends.
    pub fn lend(&self) -> HostDevice {
        HostDevice {
            entry: self.entry.clone(),
            instance: self.instance.clone(),
            physical: self.physical,
            device: self.device.clone(),
            queue_family: 0,
            queue: self.queue,
            queue_lock: self.queue_lock.clone(),
            debug_utils: true,
            prefix: "camsplat/".into(),
            memory_budget: false,
            submission_time: None,
            wait_limit: None,
        }
    }

    /// As [`Host::adopted`], by handles without types and with a lock of the engine's own.
    pub fn adopted_raw(&self) -> Arc<Context> {
        let host = RawHost {
            get_instance_proc_addr: self.entry.static_fn().get_instance_proc_addr,
            instance: self.instance.handle().as_raw(),
            physical: self.physical.as_raw(),
            device: self.device.handle().as_raw(),
            queue: self.queue.as_raw(),
            queue_family: 0,
        };
        // SAFETY: as in `adopted`, and the host submits nothing while the engine does.
        unsafe { Context::adopt(HostDevice::from_raw(host)) }.unwrap()
    }

    /// Records into a command buffer of the host's.
    pub fn record(&self, context: &Arc<Context>, record: impl FnOnce(&mut Recorder)) -> (vk::CommandBuffer, Kept) {
        let info = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::SIMULTANEOUS_USE);
        // SAFETY: the command buffer is recorded between begin and end.
        unsafe {
            let commands = self.device.allocate_command_buffers(&info).unwrap();
            self.device.begin_command_buffer(commands[0], &begin).unwrap();
            let mut recorder = Recorder::host(context, commands[0]);
            record(&mut recorder);
            let kept = recorder.finish().unwrap();
            self.device.end_command_buffer(commands[0]).unwrap();
            (commands[0], kept)
        }
    }

    /// Submits what was recorded `times` times and waits.
    pub fn submit(&self, commands: vk::CommandBuffer, times: usize) {
        let commands = [commands];
        // SAFETY: what was recorded is alive in these tests, and waited for before this returns; the pool frees the command buffer.
        unsafe {
            let fence = self.device.create_fence(&vk::FenceCreateInfo::default(), None).unwrap();
            let submit = vec![vk::SubmitInfo::default().command_buffers(&commands); times];
            let queue = self.queue_lock.lock().unwrap();
            self.device.queue_submit(self.queue, &submit, fence).unwrap();
            drop(queue);
            self.device.wait_for_fences(&[fence], true, u64::MAX).unwrap();
            self.device.destroy_fence(fence, None);
        }
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        // SAFETY: nothing made with these is left, and nothing runs any more.
        unsafe {
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            let functions = ash::ext::debug_utils::Instance::new(&self.entry, &self.instance);
            functions.destroy_debug_utils_messenger(self.messenger, None);
            self.instance.destroy_instance(None);
        }
    }
}

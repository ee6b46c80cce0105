//! The planner inside a host application: the host's device, the host's command buffer, the host's submissions.

use std::ffi::{CStr, c_void};
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};

use ash::vk;
use camsplat::plan::config::{Config, Objective, Pass, Preset};
use camsplat::plan::planner::{Outcome, Planner};
use camsplat::plan::preparation::Preparation;
use camsplat::plan::record::Status;
use camsplat::plan::target::{RegionChoice, Target};
use camsplat::scene::camera::{Intrinsics, Pose};
use camsplat::scene::samples;
use camsplat::visibility::device_scene::DeviceScene;
use camsplat::vulkan::host::HostDevice;
use camsplat::vulkan::{Context, Options, Recorder};
use glam::DVec3;

/// A host application with a device, a queue and validation layers of its own.
struct Host {
    entry: ash::Entry,
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    device: ash::Device,
    queue: vk::Queue,
    queue_lock: Arc<Mutex<()>>,
    pool: vk::CommandPool,
    messenger: vk::DebugUtilsMessengerEXT,
    /// What the validation layers said.
    messages: Box<Mutex<Vec<String>>>,
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
    fn new(name: &str) -> Self {
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
            let extensions = [ash::khr::push_descriptor::NAME.as_ptr()];
            let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&extensions);
            let device = instance.create_device(physical, &info, None).unwrap();
            let queue = device.get_device_queue(FAMILY, 0);
            let info = vk::CommandPoolCreateInfo::default().queue_family_index(FAMILY);
            let pool = device.create_command_pool(&info, None).unwrap();
            let queue_lock = Arc::default();
            Self { entry, instance, physical, device, queue, queue_lock, pool, messenger, messages }
        }
    }

    fn adopted(&self) -> Arc<Context> {
        let host = HostDevice {
            entry: self.entry.clone(),
            instance: self.instance.clone(),
            physical: self.physical,
            device: self.device.clone(),
            queue_family: 0,
            queue: self.queue,
            queue_lock: self.queue_lock.clone(),
            debug_utils: true,
        };
        // SAFETY: the host outlives every context of these tests.
        unsafe { Context::adopt(host) }.unwrap()
    }

    /// Records into a command buffer of the host's, submits it `times` times and waits.
    fn run<'a>(&self, context: &Arc<Context>, times: usize, record: impl FnOnce(&mut Recorder<'a>)) {
        let info = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::SIMULTANEOUS_USE);
        // SAFETY: the command buffer is recorded between begin and end and waited for before this returns.
        unsafe {
            let commands = self.device.allocate_command_buffers(&info).unwrap();
            self.device.begin_command_buffer(commands[0], &begin).unwrap();
            let mut recorder = Recorder::host(context, commands[0]);
            record(&mut recorder);
            recorder.finish();
            self.device.end_command_buffer(commands[0]).unwrap();
            let fence = self.device.create_fence(&vk::FenceCreateInfo::default(), None).unwrap();
            let submit = vec![vk::SubmitInfo::default().command_buffers(&commands); times];
            let queue = self.queue_lock.lock().unwrap();
            self.device.queue_submit(self.queue, &submit, fence).unwrap();
            drop(queue);
            self.device.wait_for_fences(&[fence], true, u64::MAX).unwrap();
            self.device.destroy_fence(fence, None);
            self.device.free_command_buffers(self.pool, &commands);
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

/// Who runs the iterations.
enum Driver<'h> {
    /// The planner, on its own context.
    Planner,
    /// The host, block by block, each submitted again and again.
    Blocks(&'h Host),
    /// The planner, on the host's device and queue.
    PlannerOn(&'h Host),
}

/// Plans a small object and gives back what there is to compare, floats as they are.
fn plan(driver: &Driver<'_>, pass: Pass, own: &Arc<Context>) -> Outcome {
    let context = match driver {
        Driver::Planner => own.clone(),
        Driver::Blocks(host) | Driver::PlannerOn(host) => host.adopted(),
    };
    let intrinsics = Intrinsics::from_fov(800, 800, 50f64.to_radians());
    let choice = RegionChoice::default();
    let target = Target::new(&samples::object(), "object", Preset::Object, &choice, DVec3::Z, &intrinsics).unwrap();
    let short = Config {
        seed: 5,
        iterations: 60,
        pool: 256,
        objective: Objective::Splat,
        ..Config::of(Objective::Splat, Preset::Object, 12)
    };
    let config = Config { pass, relocate_every: 10, checkpoint_every: 20, ..short };
    let geometry = target.geometry().unwrap();
    let preparation = Preparation::new(&context, &geometry, &target.proxy, &intrinsics, &[], config).unwrap();
    let scene = DeviceScene::new(&context, geometry).unwrap();
    let planner = Planner::new(&context, &scene, preparation).unwrap();
    match driver {
        Driver::Planner | Driver::PlannerOn(_) => planner.run(None, |_| ControlFlow::Continue(())).unwrap(),
        Driver::Blocks(host) => {
            // One submission more than there are iterations for: it must do nothing.
            let blocks = planner.settings().iterations.div_ceil(planner.block());
            host.run(&context, blocks as usize + 1, |recorder| planner.record_block(recorder).unwrap());
            planner.outcome().unwrap()
        }
    }
}

/// Poses, history, iterations of the snapshots, poses of the snapshots.
type Bits = (Vec<[u64; 7]>, Vec<[u32; 6]>, Vec<u32>, Vec<[u64; 7]>);

/// Everything in an outcome that must not depend on who ran it, as bits.
fn bits(outcome: &Outcome) -> Bits {
    let pose = |pose: &Pose| {
        let (p, q) = (pose.position, pose.rotation);
        [p.x, p.y, p.z, q.w, q.x, q.y, q.z].map(f64::to_bits)
    };
    let poses = outcome.poses.iter().map(pose).collect();
    let history = outcome.history.iter().map(|r| {
        let floats = [r.loss, r.image, r.reg, r.bound, r.scale].map(f32::to_bits);
        [r.iteration, floats[0], floats[1], floats[2], floats[3], floats[4]]
    });
    let rows = outcome.snapshots.iter().map(|(iteration, _)| *iteration).collect();
    let snapshots = outcome.snapshots.iter().flat_map(|(_, poses)| poses.iter().map(pose)).collect();
    (poses, history.collect(), rows, snapshots)
}

/// If this failed, an application that embeds the planner would get another plan than the command gives for the same
/// seed, or one that changes with how it submits; or the planner would use the host's device in a way that Vulkan forbids.
#[test]
fn a_host_that_submits_itself_gets_the_same_bits() {
    let own = Context::new(&Options { validation: true, ..Options::default() }).unwrap();
    let host = Host::new(&own.physical().name);
    for pass in [Pass::Dense, Pass::Binned] {
        let expected = plan(&Driver::Planner, pass, &own);
        assert_eq!((expected.status, expected.history.len()), (Status::Complete, 60));
        assert_eq!(bits(&expected).2, [0, 20, 40, 60]);
        for (who, driver) in [("blocks", Driver::Blocks(&host)), ("planner", Driver::PlannerOn(&host))] {
            let found = plan(&driver, pass, &own);
            assert_eq!(found.status, Status::Complete, "{who}, {pass:?}");
            assert!(bits(&found) == bits(&expected), "{who}, {pass:?}: {:?} {:?}", found.poses, expected.poses);
        }
    }
    assert_eq!(own.messages(), [""; 0]);
    assert_eq!(*host.messages.lock().unwrap(), [""; 0]);
}

/// If this failed, the silence above could be that of layers that were never heard.
#[test]
fn the_host_hears_the_validation_layers() {
    let own = Context::new(&Options::default()).unwrap();
    let host = Host::new(&own.physical().name);
    // SAFETY: a buffer without any usage breaks a rule, but one that no memory depends on: it is never bound nor used.
    unsafe {
        let buffer = host.device.create_buffer(&vk::BufferCreateInfo::default().size(16), None);
        buffer.into_iter().for_each(|buffer| host.device.destroy_buffer(buffer, None));
    }
    assert!(!host.messages.lock().unwrap().is_empty());
}

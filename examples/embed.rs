//! Planning inside an application that owns Vulkan: entry, instance, device, queue and command buffer are all the host's.
//! The planner records its iterations into the host's command buffer, the host submits it, and then reads the poses.
//!
//! ```text
//! cargo run --release --example embed
//! ```

use std::error::Error;
use std::sync::{Arc, Mutex};

use ash::vk;
use camsplat::engine::vulkan::host::HostDevice;
use camsplat::engine::vulkan::{Context, Recorder};
use camsplat::planner::plan::config::{Config, Preset};
use camsplat::planner::plan::planner::Planner;
use camsplat::planner::plan::preparation::Preparation;
use camsplat::planner::plan::problem::Problem;
use camsplat::planner::plan::target::{RegionChoice, Target};
use camsplat::scene::camera::Intrinsics;
use camsplat::scene::samples;
use glam::DVec3;

/// What a host has before it uses camsplat.
struct Host {
    entry: ash::Entry,
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    device: ash::Device,
    queue_family: u32,
    queue: vk::Queue,
    /// A queue takes one submission at a time: the submitter, host or planner, holds this lock.
    queue_lock: Arc<Mutex<()>>,
    commands: vk::CommandPool,
}

impl Host {
    fn new() -> Result<Self, Box<dyn Error>> {
        // SAFETY: Vulkan calls are unsafe in ash throughout. Every create-info below lives to the end of its call, and
        // every handle comes from the call before it.
        unsafe {
            let entry = ash::Entry::load()?;
            // The planner needs at least Vulkan 1.2.
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
            let info = vk::InstanceCreateInfo::default().application_info(&application);
            let instance = entry.create_instance(&info, None)?;
            let physical = *instance.enumerate_physical_devices()?.first().ok_or("no Vulkan driver")?;
            let families = instance.get_physical_device_queue_family_properties(physical);
            let compute = families.iter().position(|family| family.queue_flags.contains(vk::QueueFlags::COMPUTE));
            let queue_family = compute.ok_or("no compute queue")? as u32;
            let queues =
                [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&[1.0])];
            // The one extension that the planner needs.
            let extensions = [ash::khr::push_descriptor::NAME.as_ptr()];
            let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&extensions);
            let device = instance.create_device(physical, &info, None)?;
            let queue = device.get_device_queue(queue_family, 0);
            let info = vk::CommandPoolCreateInfo::default().queue_family_index(queue_family);
            let commands = device.create_command_pool(&info, None)?;
            let queue_lock = Arc::default();
            Ok(Self { entry, instance, physical, device, queue_family, queue, queue_lock, commands })
        }
    }

    /// Lends everything to the planner; the host keeps it, and destroys it once the planner is gone.
    fn lend(&self) -> HostDevice {
        HostDevice {
            entry: self.entry.clone(),
            instance: self.instance.clone(),
            physical: self.physical,
            device: self.device.clone(),
            queue_family: self.queue_family,
            queue: self.queue,
            queue_lock: self.queue_lock.clone(),
            debug_utils: false,
            prefix: String::new(),
            memory_budget: false,
            submission_time: None,
            wait_limit: None,
        }
    }

    /// Submits `commands` so many times and waits for the last.
    fn run(&self, commands: vk::CommandBuffer, times: u32) -> Result<(), Box<dyn Error>> {
        let commands = [commands];
        let submit = vec![vk::SubmitInfo::default().command_buffers(&commands); times as usize];
        // SAFETY: the command buffer is recorded, for simultaneous use; the fence is destroyed when it has signalled.
        unsafe {
            let fence = self.device.create_fence(&vk::FenceCreateInfo::default(), None)?;
            {
                let _queue = self.queue_lock.lock().map_err(|_| "another thread panicked while it submitted")?;
                self.device.queue_submit(self.queue, &submit, fence)?;
            }
            self.device.wait_for_fences(&[fence], true, u64::MAX)?;
            self.device.destroy_fence(fence, None);
        }
        Ok(())
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        // SAFETY: nothing made with these is left, and nothing runs any more.
        unsafe {
            self.device.destroy_command_pool(self.commands, None);
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let host = Host::new()?;
    // SAFETY: the host outlives the context, and `lend` describes its device correctly.
    let context = unsafe { Context::adopt(host.lend()) }?;
    println!("planning on {}", context.physical().name);

    // A surface, a region around it and a configuration, as `camsplat plan` makes them from its arguments.
    let intrinsics = Intrinsics::from_fov(800, 800, 50f64.to_radians());
    let choice = RegionChoice::default();
    let target = Target::new(&samples::object(), "object", Preset::Object, &choice, DVec3::Z, &intrinsics)?;
    let config = Config { iterations: 200, ..Config::new(Preset::Object, 20) };

    // The planner's device state. Making it uploads the scene, through the host's queue.
    let problem = Problem::new(&target, intrinsics, &[])?;
    let preparation = Preparation::new(&context, &problem, config)?;
    let scene = Arc::new(problem.on(&context)?);
    let planner = Planner::new(&context, &scene, preparation)?;

    // One block of iterations, in the host's own command buffer. A host may record its own work before and after.
    let info = vk::CommandBufferAllocateInfo::default().command_pool(host.commands).command_buffer_count(1);
    let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::SIMULTANEOUS_USE);
    // SAFETY: the pool is the host's, and the command buffer is not in use yet.
    let commands = unsafe {
        let commands = host.device.allocate_command_buffers(&info)?[0];
        host.device.begin_command_buffer(commands, &begin)?;
        commands
    };
    // SAFETY: the command buffer is in the recording state, and `kept` lives until it has run.
    let mut recorder = unsafe { Recorder::host(&context, commands) };
    planner.record_block(&mut recorder)?;
    let kept = recorder.finish()?;
    // SAFETY: the command buffer is in the recording state.
    unsafe { host.device.end_command_buffer(commands) }?;

    // The device counts the iterations, so the same commands run again and again, and do nothing once the run is over.
    let blocks = planner.settings().iterations.div_ceil(planner.block());
    host.run(commands, blocks)?;
    drop(kept);

    let outcome = planner.outcome()?;
    println!("{} iterations, loss {:.4}", planner.done(), outcome.history.last().map_or(f32::NAN, |row| row.loss));
    for (i, pose) in outcome.poses.iter().take(5).enumerate() {
        println!("camera {i} stands at {:.3} and looks along {:.3}", pose.position, pose.forward());
    }
    Ok(())
}

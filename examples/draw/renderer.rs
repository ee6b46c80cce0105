//! A renderer without a window: its device, a picture, and its pipelines.

use std::error::Error;
use std::ffi::c_void;
use std::sync::{Arc, Mutex};

use ash::vk;
use camsplat::engine::vulkan::host::HostDevice;
use glam::Mat4;

/// Width and height of the picture.
pub const SIZE: [u32; 2] = [640, 480];
const FORMAT: vk::Format = vk::Format::R8G8B8A8_UNORM;
/// Bytes of a camera in the planner's buffer: its position is the first twelve.
const CAMERA: u32 = 32;

/// Sorted, distances come first that are largest: their bits are turned round.
const DISTANCES: &str = "#version 450
layout(local_size_x = 64) in;
layout(push_constant) uniform Push { vec4 eye; uint count; };
layout(binding = 0, std430) readonly buffer Cameras { vec4 cameras[]; };
layout(binding = 1, std430) writeonly buffer Keys { uint keys[]; };
layout(binding = 2, std430) writeonly buffer Numbers { uint numbers[]; };
void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= count) return;
    keys[i] = ~floatBitsToUint(distance(cameras[2 * i].xyz, eye.xyz));
    numbers[i] = i;
}";
const VERTEX: &str = "#version 450
layout(push_constant) uniform Push { mat4 view; };
layout(location = 0) in vec3 position;
layout(location = 0) out float depth;
void main() {
    gl_Position = view * vec4(position, 1.0);
    gl_PointSize = 90.0 / gl_Position.w;
    depth = gl_Position.w;
}";
const FRAGMENT: &str = "#version 450
layout(location = 0) in float depth;
layout(location = 0) out vec4 colour;
void main() { colour = vec4(1.0, 1.3 - depth / 6.0, 0.3, 0.8); }";

/// The renderer's own Vulkan, which it would have anyway.
pub struct Renderer {
    entry: ash::Entry,
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    pub device: ash::Device,
    family: u32,
    pub queue: vk::Queue,
    pub pool: vk::CommandPool,
    messenger: vk::DebugUtilsMessengerEXT,
    /// Messages of the validation layers.
    pub messages: Box<Mutex<Vec<String>>>,
    // What it has made, to be destroyed in the end.
    made: Vec<Made>,
}

enum Made {
    Buffer(vk::Buffer, vk::DeviceMemory),
    Image(vk::Image, vk::ImageView, vk::DeviceMemory),
    Pipeline(vk::Pipeline, vk::PipelineLayout),
    Descriptors(vk::DescriptorSetLayout, vk::DescriptorPool),
    Pass(vk::RenderPass, vk::Framebuffer),
}

pub type Fallible<T> = Result<T, Box<dyn Error>>;

unsafe extern "system" fn on_message(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: `user` is `Renderer::messages`, which outlives the messenger; the layer passes a valid `data`.
    unsafe {
        let text = (*data).message_as_c_str().unwrap_or(c"").to_string_lossy().into_owned();
        if let Ok(mut messages) = (*user.cast::<Mutex<Vec<String>>>()).lock() {
            messages.push(text);
        }
    }
    vk::FALSE
}

impl Renderer {
    /// A device that draws and computes on one queue; with the validation layers, synchronisation too, if requested.
    pub fn new(validation: bool) -> Fallible<Self> {
        let messages = Box::<Mutex<Vec<String>>>::default();
        // SAFETY: every create-info lives to the end of its call, and every handle comes from the call before it.
        unsafe {
            let entry = ash::Entry::load()?;
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
            let layers = [c"VK_LAYER_KHRONOS_validation".as_ptr()];
            let extensions = [ash::ext::debug_utils::NAME.as_ptr()];
            let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
            let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
            let mut info = vk::InstanceCreateInfo::default().application_info(&application);
            if validation {
                info = info.enabled_layer_names(&layers).enabled_extension_names(&extensions).push_next(&mut features);
            }
            let instance = entry.create_instance(&info, None)?;
            let messenger = if validation {
                let all = vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR;
                let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
                    .message_severity(all)
                    .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
                    .pfn_user_callback(Some(on_message))
                    .user_data((&raw const *messages).cast_mut().cast());
                ash::ext::debug_utils::Instance::new(&entry, &instance).create_debug_utils_messenger(&info, None)?
            } else {
                vk::DebugUtilsMessengerEXT::null()
            };
            let physical = *instance.enumerate_physical_devices()?.first().ok_or("no Vulkan driver")?;
            let both = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
            let families = instance.get_physical_device_queue_family_properties(physical);
            let family = families.iter().position(|family| family.queue_flags.contains(both));
            let family = family.ok_or("no queue that draws and computes")? as u32;
            let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
            let device_extensions = [ash::khr::push_descriptor::NAME.as_ptr()];
            let large_points = instance.get_physical_device_features(physical).large_points == vk::TRUE;
            let enabled = vk::PhysicalDeviceFeatures::default().large_points(large_points);
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&device_extensions)
                .enabled_features(&enabled);
            let device = instance.create_device(physical, &info, None)?;
            let queue = device.get_device_queue(family, 0);
            let info = vk::CommandPoolCreateInfo::default().queue_family_index(family);
            let pool = device.create_command_pool(&info, None)?;
            let made = Vec::new();
            Ok(Self { entry, instance, physical, device, family, queue, pool, messenger, messages, made })
        }
    }

    /// Memory for what has such requirements.
    fn memory(&self, needs: vk::MemoryRequirements, wanted: vk::MemoryPropertyFlags) -> Fallible<vk::DeviceMemory> {
        // SAFETY: the device is live, and the type is one that the requirements name.
        unsafe {
            let types = self.instance.get_physical_device_memory_properties(self.physical);
            let suits = |i: &u32| {
                let kind = types.memory_types[*i as usize];
                needs.memory_type_bits >> i & 1 == 1 && kind.property_flags.contains(wanted)
            };
            let index = (0..types.memory_type_count).find(suits).ok_or("no memory of the kind")?;
            let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(index);
            Ok(self.device.allocate_memory(&info, None)?)
        }
    }

    pub fn buffer(
        &mut self,
        size: u64,
        usage: vk::BufferUsageFlags,
        memory: vk::MemoryPropertyFlags,
    ) -> Fallible<(vk::Buffer, vk::DeviceMemory)> {
        // SAFETY: the buffer is bound once to memory that was made for it.
        unsafe {
            let buffer = self.device.create_buffer(&vk::BufferCreateInfo::default().size(size).usage(usage), None)?;
            let memory = self.memory(self.device.get_buffer_memory_requirements(buffer), memory)?;
            self.device.bind_buffer_memory(buffer, memory, 0)?;
            self.made.push(Made::Buffer(buffer, memory));
            Ok((buffer, memory))
        }
    }

    fn module(&self, source: &str, kind: shaderc::ShaderKind) -> Fallible<vk::ShaderModule> {
        let code = shaderc::Compiler::new()?.compile_into_spirv(source, kind, "draw.rs", "main", None)?;
        // SAFETY: the code is SPIR-V.
        Ok(unsafe {
            self.device.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(code.as_binary()), None)
        }?)
    }

    /// The picture, and the pass that draws it.
    pub fn target(&mut self) -> Fallible<(vk::Image, vk::RenderPass, vk::Framebuffer)> {
        let [width, height] = SIZE;
        // SAFETY: as in `buffer`; the attachment lives as long as its framebuffer.
        unsafe {
            let info = vk::ImageCreateInfo::default()
                .image_type(vk::ImageType::TYPE_2D)
                .format(FORMAT)
                .extent(vk::Extent3D { width, height, depth: 1 })
                .mip_levels(1)
                .array_layers(1)
                .samples(vk::SampleCountFlags::TYPE_1)
                .usage(vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC);
            let image = self.device.create_image(&info, None)?;
            let needs = self.device.get_image_memory_requirements(image);
            let memory = self.memory(needs, vk::MemoryPropertyFlags::DEVICE_LOCAL)?;
            self.device.bind_image_memory(image, memory, 0)?;
            let range = vk::ImageSubresourceRange::default()
                .aspect_mask(vk::ImageAspectFlags::COLOR)
                .level_count(1)
                .layer_count(1);
            let info = vk::ImageViewCreateInfo::default()
                .image(image)
                .view_type(vk::ImageViewType::TYPE_2D)
                .format(FORMAT)
                .subresource_range(range);
            let view = [self.device.create_image_view(&info, None)?];
            self.made.push(Made::Image(image, view[0], memory));
            let attachment = [vk::AttachmentDescription::default()
                .format(FORMAT)
                .samples(vk::SampleCountFlags::TYPE_1)
                .load_op(vk::AttachmentLoadOp::CLEAR)
                .store_op(vk::AttachmentStoreOp::STORE)
                .final_layout(vk::ImageLayout::TRANSFER_SRC_OPTIMAL)];
            let colour = [vk::AttachmentReference::default().layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)];
            let subpass = [vk::SubpassDescription::default().color_attachments(&colour)];
            let drawn = vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT;
            let read = vk::PipelineStageFlags::TRANSFER;
            let dependencies = [
                // The copy of the picture before.
                vk::SubpassDependency::default()
                    .src_subpass(vk::SUBPASS_EXTERNAL)
                    .src_stage_mask(read)
                    .dst_stage_mask(drawn)
                    .dst_access_mask(vk::AccessFlags::COLOR_ATTACHMENT_WRITE | vk::AccessFlags::COLOR_ATTACHMENT_READ),
                vk::SubpassDependency::default()
                    .dst_subpass(vk::SUBPASS_EXTERNAL)
                    .src_stage_mask(drawn)
                    .src_access_mask(vk::AccessFlags::COLOR_ATTACHMENT_WRITE)
                    .dst_stage_mask(read)
                    .dst_access_mask(vk::AccessFlags::TRANSFER_READ),
            ];
            let info = vk::RenderPassCreateInfo::default()
                .attachments(&attachment)
                .subpasses(&subpass)
                .dependencies(&dependencies);
            let pass = self.device.create_render_pass(&info, None)?;
            let info = vk::FramebufferCreateInfo::default()
                .render_pass(pass)
                .attachments(&view)
                .width(width)
                .height(height)
                .layers(1);
            let frame = self.device.create_framebuffer(&info, None)?;
            self.made.push(Made::Pass(pass, frame));
            Ok((image, pass, frame))
        }
    }

    /// Draws points from a buffer of cameras.
    pub fn draws(&mut self, pass: vk::RenderPass) -> Fallible<(vk::Pipeline, vk::PipelineLayout)> {
        let [width, height] = SIZE;
        // SAFETY: all that the pipeline is made of outlives the call.
        unsafe {
            let push = [vk::PushConstantRange {
                stage_flags: vk::ShaderStageFlags::VERTEX,
                offset: 0,
                size: size_of::<Mat4>() as u32,
            }];
            let info = vk::PipelineLayoutCreateInfo::default().push_constant_ranges(&push);
            let layout = self.device.create_pipeline_layout(&info, None)?;
            let modules = [
                self.module(VERTEX, shaderc::ShaderKind::Vertex)?,
                self.module(FRAGMENT, shaderc::ShaderKind::Fragment)?,
            ];
            let flags = [vk::ShaderStageFlags::VERTEX, vk::ShaderStageFlags::FRAGMENT];
            let stages = [0, 1]
                .map(|i| vk::PipelineShaderStageCreateInfo::default().stage(flags[i]).module(modules[i]).name(c"main"));
            let bindings = [vk::VertexInputBindingDescription::default().stride(CAMERA)];
            let attributes = [vk::VertexInputAttributeDescription::default().format(vk::Format::R32G32B32_SFLOAT)];
            let input = vk::PipelineVertexInputStateCreateInfo::default()
                .vertex_binding_descriptions(&bindings)
                .vertex_attribute_descriptions(&attributes);
            let assembly =
                vk::PipelineInputAssemblyStateCreateInfo::default().topology(vk::PrimitiveTopology::POINT_LIST);
            let area = [vk::Rect2D { offset: vk::Offset2D::default(), extent: vk::Extent2D { width, height } }];
            let (x, y) = (width as f32, height as f32);
            let viewport = [vk::Viewport { x: 0.0, y: 0.0, width: x, height: y, min_depth: 0.0, max_depth: 1.0 }];
            let viewports = vk::PipelineViewportStateCreateInfo::default().viewports(&viewport).scissors(&area);
            let raster = vk::PipelineRasterizationStateCreateInfo::default().line_width(1.0);
            let samples =
                vk::PipelineMultisampleStateCreateInfo::default().rasterization_samples(vk::SampleCountFlags::TYPE_1);
            let over = [vk::PipelineColorBlendAttachmentState::default()
                .blend_enable(true)
                .src_color_blend_factor(vk::BlendFactor::SRC_ALPHA)
                .dst_color_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
                .dst_alpha_blend_factor(vk::BlendFactor::ONE)
                .color_write_mask(vk::ColorComponentFlags::RGBA)];
            let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&over);
            let info = [vk::GraphicsPipelineCreateInfo::default()
                .stages(&stages)
                .vertex_input_state(&input)
                .input_assembly_state(&assembly)
                .viewport_state(&viewports)
                .rasterization_state(&raster)
                .multisample_state(&samples)
                .color_blend_state(&blend)
                .layout(layout)
                .render_pass(pass)];
            let pipeline = self.device.create_graphics_pipelines(vk::PipelineCache::null(), &info, None);
            let pipeline = pipeline.map_err(|(_, code)| code)?[0];
            modules.into_iter().for_each(|module| self.device.destroy_shader_module(module, None));
            self.made.push(Made::Pipeline(pipeline, layout));
            Ok((pipeline, layout))
        }
    }

    /// Finds distances: the pipeline and a descriptor set of cameras, keys and numbers.
    pub fn measures(
        &mut self,
        buffers: [vk::Buffer; 3],
    ) -> Fallible<(vk::Pipeline, vk::PipelineLayout, vk::DescriptorSet)> {
        let kind = vk::DescriptorType::STORAGE_BUFFER;
        // SAFETY: as in `draws`; the buffers outlive the set.
        unsafe {
            let slot = |i| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(i)
                    .descriptor_type(kind)
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            };
            let slots = [0, 1, 2].map(slot);
            let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&slots);
            let sets = [self.device.create_descriptor_set_layout(&info, None)?];
            let sizes = [vk::DescriptorPoolSize { ty: kind, descriptor_count: 3 }];
            let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
            let pool = self.device.create_descriptor_pool(&info, None)?;
            self.made.push(Made::Descriptors(sets[0], pool));
            let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&sets);
            let set = self.device.allocate_descriptor_sets(&info)?[0];
            let infos = buffers.map(|buffer| [vk::DescriptorBufferInfo { buffer, offset: 0, range: vk::WHOLE_SIZE }]);
            let write = |i: usize| {
                vk::WriteDescriptorSet::default()
                    .dst_set(set)
                    .dst_binding(i as u32)
                    .descriptor_type(kind)
                    .buffer_info(&infos[i])
            };
            let writes = [0, 1, 2].map(write);
            self.device.update_descriptor_sets(&writes, &[]);
            let push = [vk::PushConstantRange { stage_flags: vk::ShaderStageFlags::COMPUTE, offset: 0, size: 20 }];
            let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets).push_constant_ranges(&push);
            let layout = self.device.create_pipeline_layout(&info, None)?;
            let module = self.module(DISTANCES, shaderc::ShaderKind::Compute)?;
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main");
            let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout)];
            let pipeline = self.device.create_compute_pipelines(vk::PipelineCache::null(), &info, None);
            let pipeline = pipeline.map_err(|(_, code)| code)?[0];
            self.device.destroy_shader_module(module, None);
            self.made.push(Made::Pipeline(pipeline, layout));
            Ok((pipeline, layout, set))
        }
    }

    /// Lends its device to the engine.
    pub fn lend(&self, debug_utils: bool) -> HostDevice {
        HostDevice {
            entry: self.entry.clone(),
            instance: self.instance.clone(),
            physical: self.physical,
            device: self.device.clone(),
            queue_family: self.family,
            queue: self.queue,
            queue_lock: Arc::new(Mutex::default()),
            debug_utils,
            prefix: "camsplat/".into(),
            memory_budget: false,
            submission_time: None,
            wait_limit: None,
        }
    }
}

impl Drop for Renderer {
    fn drop(&mut self) {
        let device = &self.device;
        // SAFETY: nothing runs any more, and the engine's context is gone.
        unsafe {
            for made in self.made.drain(..).rev() {
                match made {
                    Made::Buffer(buffer, memory) => {
                        device.destroy_buffer(buffer, None);
                        device.free_memory(memory, None);
                    }
                    Made::Image(image, view, memory) => {
                        device.destroy_image_view(view, None);
                        device.destroy_image(image, None);
                        device.free_memory(memory, None);
                    }
                    Made::Pipeline(pipeline, layout) => {
                        device.destroy_pipeline(pipeline, None);
                        device.destroy_pipeline_layout(layout, None);
                    }
                    Made::Descriptors(layout, pool) => {
                        device.destroy_descriptor_pool(pool, None);
                        device.destroy_descriptor_set_layout(layout, None);
                    }
                    Made::Pass(pass, frame) => {
                        device.destroy_framebuffer(frame, None);
                        device.destroy_render_pass(pass, None);
                    }
                }
            }
            device.destroy_command_pool(self.pool, None);
            device.destroy_device(None);
            if self.messenger != vk::DebugUtilsMessengerEXT::null() {
                let functions = ash::ext::debug_utils::Instance::new(&self.entry, &self.instance);
                functions.destroy_debug_utils_messenger(self.messenger, None);
            }
            self.instance.destroy_instance(None);
        }
    }
}

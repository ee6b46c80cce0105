//! A renderer that draws what the planner leaves on the device, without a copy and without waiting in between: in one command buffer of its own
//! the planner goes on by a block, the renderer's stage finds how far each camera is from the viewer, the engine sorts by that in buffers
//! of the renderer's, and the cameras are drawn from back to front, the planner's buffer as vertices and the sorted numbers as indices.
//!
//! `cargo run --release --example draw -- cameras.png`

mod renderer;

use std::sync::Arc;

use ash::vk;
use camsplat::engine::primitives::{Count, RadixSort};
use camsplat::engine::vulkan::{Buffer, Context, Recorder};
use camsplat::planner::plan::config::{Config, Preset};
use camsplat::planner::plan::planner::Planner;
use camsplat::planner::plan::preparation::Preparation;
use camsplat::planner::plan::problem::Problem;
use camsplat::planner::plan::target::{RegionChoice, Target};
use camsplat::scene::camera::Intrinsics;
use camsplat::scene::samples;
use glam::{DVec3, Mat4, Vec3, Vec4};

use renderer::{Fallible, Renderer, SIZE};

const CAMERAS: u32 = 40;
/// Where the viewer is, in the planner's frame, in which the surface is within the unit sphere around the origin.
const EYE: Vec3 = Vec3::new(0.0, -4.5, 1.5);

fn main() -> Fallible<()> {
    let file = std::env::args_os().nth(1).ok_or("name the picture to write")?;
    let (pixels, _) = draw(8, false)?;
    let [width, height] = SIZE;
    let picture = image::RgbaImage::from_raw(width, height, pixels).ok_or("the picture has another size")?;
    picture.save(&file)?;
    println!("{}", std::path::Path::new(&file).display());
    Ok(())
}

/// From the planner's frame to clip space, seen from [`EYE`] towards the origin, for a picture so many times as wide as high.
fn looking(aspect: f32) -> Mat4 {
    let forward = -EYE.normalize();
    let right = forward.cross(Vec3::Z).normalize();
    let (near, far, zoom) = (0.1, 50.0, 2.4);
    let row = |axis: Vec3, by: f32| (by * axis).extend(-by * axis.dot(EYE));
    let depth = far / (far - near);
    let towards = row(forward, 1.0);
    Mat4::from_rows(
        row(right, zoom / aspect),
        row(forward.cross(right), zoom),
        depth * towards - Vec4::new(0.0, 0.0, 0.0, near * depth),
        towards,
    )
}

/// Draws the cameras after each of so many blocks of iterations: the pixels of the last picture, and what the validation layers said.
pub fn draw(frames: u32, validation: bool) -> Fallible<(Vec<u8>, Vec<String>)> {
    let mut renderer = Renderer::new(validation)?;
    // SAFETY: the renderer outlives the context and what is made with it, and describes its device correctly.
    let context = unsafe { Context::adopt(renderer.lend(validation)) }?;
    let intrinsics = Intrinsics::from_fov(800, 800, 50f64.to_radians());
    let choice = RegionChoice::default();
    let target = Target::new(&samples::object(), "object", Preset::Object, &choice, DVec3::Z, &intrinsics)?;
    let problem = Problem::new(&target, intrinsics, &[])?;
    let config = Config::new(Preset::Object, CAMERAS);
    let preparation = Preparation::new(&context, &problem, config)?;
    let scene = Arc::new(problem.on(&context)?);
    let planner = Planner::new(&context, &scene, preparation)?;

    // The renderer's buffers, which the engine sorts in place.
    let bytes = u64::from(4 * CAMERAS);
    let usage = vk::BufferUsageFlags::STORAGE_BUFFER
        | vk::BufferUsageFlags::TRANSFER_SRC
        | vk::BufferUsageFlags::TRANSFER_DST
        | vk::BufferUsageFlags::INDEX_BUFFER;
    let mut sortable = || renderer.buffer(bytes, usage, vk::MemoryPropertyFlags::DEVICE_LOCAL);
    let ((keys, _), (numbers, _)) = (sortable()?, sortable()?);
    // SAFETY: both are of the context's device, have that usage and size, and outlive the engine.
    let wrap = |name, raw| unsafe { Buffer::wrap(&context, name, raw, usage, [0, bytes]) };
    let [sorted_keys, sorted_numbers] = [wrap("keys", keys)?, wrap("numbers", numbers)?];
    let sort = RadixSort::new(&context, CAMERAS)?;

    let (image, pass, frame) = renderer.target()?;
    let (points, points_layout) = renderer.draws(pass)?;
    let (distances, distances_layout, set) = renderer.measures([planner.device_cameras().handle(), keys, numbers])?;
    let [width, height] = SIZE;
    let size = u64::from(4 * width * height);
    let host = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
    let (readback, memory) = renderer.buffer(size, vk::BufferUsageFlags::TRANSFER_DST, host)?;

    let view = looking(width as f32 / height as f32);
    let device = renderer.device.clone();
    // SAFETY: commands are recorded between begin and end; everything they use outlives their submissions, which are waited for below;
    // what the engine uses is in `kept`.
    let (commands, kept) = unsafe {
        let info = vk::CommandBufferAllocateInfo::default().command_pool(renderer.pool).command_buffer_count(1);
        let commands = device.allocate_command_buffers(&info)?[0];
        device.begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default())?;

        let mut engine = Recorder::host(&context, commands);
        planner.record_block(&mut engine)?;
        let planned = engine.finish()?;

        // What the engine has written is visible to whatever follows, and what the engine does next comes after it.
        device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, distances);
        device.cmd_bind_descriptor_sets(commands, vk::PipelineBindPoint::COMPUTE, distances_layout, 0, &[set], &[]);
        let [x, y, z] = EYE.to_array().map(f32::to_bits);
        let push = [x, y, z, 0, CAMERAS];
        let push = bytemuck::bytes_of(&push);
        device.cmd_push_constants(commands, distances_layout, vk::ShaderStageFlags::COMPUTE, 0, push);
        device.cmd_dispatch(commands, CAMERAS.div_ceil(64), 1, 1);

        let mut engine = Recorder::host(&context, commands);
        let order = sort.pairs(&mut engine, &sorted_keys, &sorted_numbers, Count::Host(CAMERAS), 32)?.values;
        let sorted = engine.finish()?;

        let area = vk::Rect2D { offset: vk::Offset2D::default(), extent: vk::Extent2D { width, height } };
        let clear = [vk::ClearValue { color: vk::ClearColorValue { float32: [0.05, 0.07, 0.1, 1.0] } }];
        let begin = vk::RenderPassBeginInfo::default().render_pass(pass).framebuffer(frame).render_area(area);
        device.cmd_begin_render_pass(commands, &begin.clear_values(&clear), vk::SubpassContents::INLINE);
        device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::GRAPHICS, points);
        let matrix = view.to_cols_array();
        let bytes = bytemuck::bytes_of(&matrix);
        device.cmd_push_constants(commands, points_layout, vk::ShaderStageFlags::VERTEX, 0, bytes);
        device.cmd_bind_vertex_buffers(commands, 0, &[planner.device_cameras().handle()], &[0]);
        device.cmd_bind_index_buffer(commands, order.handle(), order.offset(), vk::IndexType::UINT32);
        device.cmd_draw_indexed(commands, CAMERAS, 1, 0, 0, 0);
        device.cmd_end_render_pass(commands);

        let layers = vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1);
        let region = [vk::BufferImageCopy::default().image_subresource(layers).image_extent(vk::Extent3D {
            width,
            height,
            depth: 1,
        })];
        let from = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        device.cmd_copy_image_to_buffer(commands, image, from, readback, &region);
        let written = [vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
            .dst_access_mask(vk::AccessFlags::HOST_READ)];
        let (after, before) = (vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::HOST);
        device.cmd_pipeline_barrier(commands, after, before, vk::DependencyFlags::empty(), &written, &[], &[]);
        device.end_command_buffer(commands)?;
        (commands, [planned, sorted])
    };

    let mut pixels = vec![0; size as usize];
    // SAFETY: the queue is used by this thread alone; the memory is mapped and read when all has run.
    unsafe {
        let submitted = [commands];
        let submit = [vk::SubmitInfo::default().command_buffers(&submitted)];
        for _ in 0..frames {
            device.queue_submit(renderer.queue, &submit, vk::Fence::null())?;
            device.queue_wait_idle(renderer.queue)?;
        }
        let mapped = device.map_memory(memory, 0, size, vk::MemoryMapFlags::empty())?;
        mapped.cast::<u8>().copy_to_nonoverlapping(pixels.as_mut_ptr(), pixels.len());
    }
    drop(kept);
    drop((planner, sort, sorted_keys, sorted_numbers, scene, context));
    let messages = renderer.messages.lock().map_err(|_| "a message was lost")?.clone();
    Ok((pixels, messages))
}

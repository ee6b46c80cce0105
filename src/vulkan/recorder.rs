//! Recording: stages into a command buffer, with the barriers that their buffers call for.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;

use super::buffer::Buffer;
use super::context::{Context, lock};
use super::pipeline::Pipeline;
use super::stage::Access;
use crate::{Error, Result};

/// Writes stages into a command buffer. It borrows what it records, and waits for its submissions when dropped.
pub struct Recorder<'a> {
    context: Arc<Context>,
    raw: vk::CommandBuffer,
    owned: bool,
    ended: bool,
    fences: Vec<vk::Fence>,
    // Buffers touched since the last barrier.
    read: Vec<vk::Buffer>,
    written: Vec<vk::Buffer>,
    clock: Option<Clock>,
    failure: Option<Error>,
    borrowed: std::marker::PhantomData<&'a Buffer>,
}

struct Clock {
    pool: vk::QueryPool,
    capacity: u32,
    names: Vec<&'static str>,
    // One pair of timestamps around everything, not one around each stage.
    whole: bool,
}

/// GPU time of one stage, in nanoseconds since an arbitrary start that the stages of one recorder share.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// The stage's name.
    pub name: &'static str,
    /// When everything before it had ended.
    pub start: f64,
    /// When it had ended.
    pub end: f64,
}

impl<'a> Recorder<'a> {
    /// Begins a command buffer of our own, which may be submitted many times.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn new(context: &Arc<Context>) -> Result<Self> {
        let pool = lock(&context.command_pool);
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(*pool)
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        // SAFETY: the pool is this context's, and locked.
        let raw = unsafe { context.device.allocate_command_buffers(&info) }
            .map_err(|code| context.failure("vkAllocateCommandBuffers", code))?[0];
        drop(pool);
        let recorder = Self::around(context, raw, true);
        recorder.begin()?;
        Ok(recorder)
    }

    /// Like [`Recorder::new`], with a pair of timestamps around each of the first `capacity` stages, copies and fills.
    ///
    /// # Errors
    /// Where the device fails or its queue has no timestamps.
    pub fn timed(context: &Arc<Context>, capacity: u32) -> Result<Self> {
        Self::clocked(context, capacity, false)
    }

    /// Like [`Recorder::new`], with a pair of timestamps around the whole recording: stages run as close to one another
    /// as they do untimed.
    ///
    /// # Errors
    /// As for [`Recorder::timed`].
    pub fn timed_whole(context: &Arc<Context>) -> Result<Self> {
        let mut recorder = Self::clocked(context, 1, true)?;
        if let Some(clock) = &mut recorder.clock {
            clock.names.push("whole");
        }
        recorder.timestamp(false);
        Ok(recorder)
    }

    fn clocked(context: &Arc<Context>, capacity: u32, whole: bool) -> Result<Self> {
        let mut recorder = Self::new(context)?;
        if context.physical().timestamp_bits == 0 {
            return Err(Error::NoDevice(format!("{} has no timestamps", context.physical().name)));
        }
        let info =
            vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(2 * capacity.max(1));
        // SAFETY: the info is valid; the recording has begun, outside a render pass.
        unsafe {
            let pool = context
                .device
                .create_query_pool(&info, None)
                .map_err(|code| context.failure("vkCreateQueryPool", code))?;
            context.device.cmd_reset_query_pool(recorder.raw, pool, 0, 2 * capacity.max(1));
            recorder.clock = Some(Clock { pool, capacity, names: Vec::new(), whole });
        }
        Ok(recorder)
    }

    /// Records into a host application's command buffer, which the host begins, ends and submits.
    ///
    /// # Safety
    /// `raw` must be in the recording state, of the device that `context` adopted, and everything recorded must stay
    /// alive until the host's submission has ended. [`Recorder::finish`] must come before the host reads results.
    pub unsafe fn host(context: &Arc<Context>, raw: vk::CommandBuffer) -> Self {
        let mut recorder = Self::around(context, raw, false);
        recorder.barrier();
        recorder
    }

    /// Ends the part of a host's command buffer that this recorder wrote: what the host records next, and the host itself
    /// once its submission has ended, see the results.
    pub fn finish(mut self) {
        self.barrier();
    }

    fn around(context: &Arc<Context>, raw: vk::CommandBuffer, owned: bool) -> Self {
        Self {
            context: context.clone(),
            raw,
            owned,
            ended: false,
            fences: Vec::new(),
            read: Vec::new(),
            written: Vec::new(),
            clock: None,
            failure: None,
            borrowed: std::marker::PhantomData,
        }
    }

    fn begin(&self) -> Result<()> {
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::SIMULTANEOUS_USE);
        // SAFETY: the command buffer is ours and not pending.
        unsafe { self.context.device.begin_command_buffer(self.raw, &info) }
            .map_err(|code| self.context.failure("vkBeginCommandBuffer", code))?;
        // Whatever was submitted before may still be writing what this reads.
        self.barrier_now();
        Ok(())
    }

    /// Starts the record of one stage: `recorder.stage(&pipeline).bind(&[...]).push(&constants).groups([n, 1, 1])`.
    pub fn stage<'r>(&'r mut self, pipeline: &'a Pipeline) -> StageRecord<'r, 'a> {
        StageRecord { recorder: self, pipeline, buffers: Vec::new(), push: [0; 128], push_size: 0 }
    }

    /// Copies the first `bytes` bytes of `from` to the start of `to`.
    pub fn copy(&mut self, from: &'a Buffer, to: &'a Buffer, bytes: u64) {
        self.copy_region(from, 0, to, 0, bytes);
    }

    /// Copies `bytes` bytes between offsets.
    pub fn copy_region(&mut self, from: &'a Buffer, from_offset: u64, to: &'a Buffer, to_offset: u64, bytes: u64) {
        self.touch(&[from.handle()], &[to.handle()]);
        self.start_clock("copy");
        let region = [vk::BufferCopy::default().src_offset(from_offset).dst_offset(to_offset).size(bytes)];
        // SAFETY: both buffers are live for `'a`; the validation layers check the ranges in the tests.
        unsafe { self.context.device.cmd_copy_buffer(self.raw, from.handle(), to.handle(), &region) };
        self.stop_clock();
    }

    /// Fills a buffer with a 32-bit value.
    pub fn fill(&mut self, buffer: &'a Buffer, value: u32) {
        self.touch(&[], &[buffer.handle()]);
        self.start_clock("fill");
        // SAFETY: as in `copy_region`; buffer sizes are multiples of four.
        unsafe { self.context.device.cmd_fill_buffer(self.raw, buffer.handle(), 0, vk::WHOLE_SIZE, value) };
        self.stop_clock();
    }

    /// The one place that decides on barriers: what is read must not be pending as written, what is written must not
    /// be pending at all.
    fn touch(&mut self, read: &[vk::Buffer], written: &[vk::Buffer]) {
        let hazard = read.iter().any(|buffer| self.written.contains(buffer))
            || written.iter().any(|buffer| self.written.contains(buffer) || self.read.contains(buffer));
        if hazard {
            self.barrier();
        }
        self.read.extend_from_slice(read);
        self.written.extend_from_slice(written);
    }

    fn barrier(&mut self) {
        self.read.clear();
        self.written.clear();
        self.barrier_now();
    }

    fn barrier_now(&self) {
        let work = vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::TRANSFER;
        let writes = vk::AccessFlags::SHADER_WRITE | vk::AccessFlags::TRANSFER_WRITE;
        let reads = vk::AccessFlags::SHADER_READ
            | vk::AccessFlags::TRANSFER_READ
            | vk::AccessFlags::INDIRECT_COMMAND_READ
            | vk::AccessFlags::HOST_READ;
        let barrier = [vk::MemoryBarrier::default().src_access_mask(writes).dst_access_mask(reads | writes)];
        let after = work | vk::PipelineStageFlags::DRAW_INDIRECT | vk::PipelineStageFlags::HOST;
        // SAFETY: the command buffer is in the recording state.
        unsafe {
            self.context.device.cmd_pipeline_barrier(
                self.raw,
                work,
                after,
                vk::DependencyFlags::empty(),
                &barrier,
                &[],
                &[],
            );
        }
    }

    /// Ends the recording and submits it; may be called again, also while earlier submissions run.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn submit(&mut self) -> Result<()> {
        if let Some(failure) = self.failure.take() {
            return Err(failure);
        }
        if !self.ended {
            self.barrier();
            if self.clock.as_ref().is_some_and(|clock| clock.whole) {
                self.timestamp(true);
            }
            // SAFETY: the command buffer is in the recording state.
            unsafe { self.context.device.end_command_buffer(self.raw) }
                .map_err(|code| self.context.failure("vkEndCommandBuffer", code))?;
            self.ended = true;
        }
        // SAFETY: the info is valid for the device.
        let fence = unsafe { self.context.device.create_fence(&vk::FenceCreateInfo::default(), None) }
            .map_err(|code| self.context.failure("vkCreateFence", code))?;
        self.fences.push(fence);
        self.context.submit(&[self.raw], fence)
    }

    /// Waits for every submission so far.
    ///
    /// # Errors
    /// Where the device is lost; the error names the last stage that started, where the driver can tell.
    pub fn wait(&mut self) -> Result<()> {
        if self.fences.is_empty() {
            return Ok(());
        }
        // SAFETY: the fences are live and each was submitted.
        let waited = unsafe { self.context.device.wait_for_fences(&self.fences, true, u64::MAX) };
        for fence in self.fences.drain(..) {
            // SAFETY: the wait is over, so nothing will signal the fence.
            unsafe { self.context.device.destroy_fence(fence, None) };
        }
        waited.map_err(|code| self.context.failure("vkWaitForFences", code))
    }

    /// Submissions that have not ended yet.
    pub fn pending(&self) -> usize {
        // SAFETY: the fences are live.
        let running =
            |fence: &&vk::Fence| !matches!(unsafe { self.context.device.get_fence_status(**fence) }, Ok(true));
        self.fences.iter().filter(running).count()
    }

    /// [`Recorder::submit`] and [`Recorder::wait`].
    ///
    /// # Errors
    /// As for these.
    pub fn submit_and_wait(&mut self) -> Result<()> {
        self.submit()?;
        self.wait()
    }

    /// GPU times of the stages of a [`Recorder::timed`] recording whose submission has been waited for.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn timings(&self) -> Result<Vec<Timing>> {
        let Some(clock) = &self.clock else { return Ok(Vec::new()) };
        let mut ticks = vec![0u64; 2 * clock.names.len().min(clock.capacity as usize)];
        if ticks.is_empty() {
            return Ok(Vec::new());
        }
        // SAFETY: the first `ticks.len()` queries were written by the submission, which has ended.
        unsafe {
            self.context.device.get_query_pool_results(
                clock.pool,
                0,
                &mut ticks,
                vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT,
            )
        }
        .map_err(|code| self.context.failure("vkGetQueryPoolResults", code))?;
        let physical = self.context.physical();
        let mask = u64::MAX >> (64 - physical.timestamp_bits.clamp(1, 64));
        let origin = ticks[0] & mask;
        let since = |tick: u64| ((tick & mask).wrapping_sub(origin) & mask) as f64 * physical.timestamp_period as f64;
        let pairs = ticks.chunks_exact(2).zip(&clock.names);
        Ok(pairs.map(|(pair, name)| Timing { name, start: since(pair[0]), end: since(pair[1]) }).collect())
    }

    fn start_clock(&mut self, name: &'static str) {
        if let Some(clock) = &mut self.clock
            && !clock.whole
        {
            clock.names.push(name);
            self.timestamp(false);
        }
    }

    fn stop_clock(&mut self) {
        if self.clock.as_ref().is_some_and(|clock| !clock.whole) {
            self.timestamp(true);
        }
    }

    fn timestamp(&mut self, end: bool) {
        if let Some(clock) = &self.clock
            && clock.names.len() as u32 <= clock.capacity
        {
            let query = 2 * (clock.names.len() as u32 - 1) + end as u32;
            // SAFETY: the query lies inside the pool and was reset at the start of the recording.
            unsafe {
                self.context.device.cmd_write_timestamp(
                    self.raw,
                    vk::PipelineStageFlags::BOTTOM_OF_PIPE,
                    clock.pool,
                    query,
                );
            }
        }
    }

    /// Under `--debug-sync`: runs what was recorded so far, so that a failure can be laid to `stage`.
    fn run_now(&mut self, stage: &'static str) -> Result<()> {
        self.submit()?;
        self.wait().map_err(|error| match error {
            Error::DeviceLost { .. } => Error::DeviceLost { stage: stage.into() },
            other => other,
        })?;
        self.ended = false;
        self.begin()
    }
}

/// A stage being recorded; nothing happens before one of its last three methods is called.
pub struct StageRecord<'r, 'a> {
    recorder: &'r mut Recorder<'a>,
    pipeline: &'a Pipeline,
    buffers: Vec<&'a Buffer>,
    push: [u8; 128],
    push_size: usize,
}

enum Size<'a> {
    Groups([u32; 3]),
    Indirect(&'a Buffer, u64),
}

impl<'a> StageRecord<'_, 'a> {
    /// The buffers, in slot order.
    pub fn bind(mut self, buffers: &[&'a Buffer]) -> Self {
        self.buffers = buffers.to_vec();
        self
    }

    /// The push constants.
    pub fn push<T: Pod>(mut self, constants: &T) -> Self {
        let bytes = bytemuck::bytes_of(constants);
        self.push[..bytes.len()].copy_from_slice(bytes);
        self.push_size = bytes.len();
        self
    }

    /// Dispatches so many workgroups.
    pub fn groups(self, groups: [u32; 3]) {
        self.dispatch(&Size::Groups(groups));
    }

    /// Dispatches at least `count` workgroups, laid out in x and y so that no limit is met; the shader finds its own
    /// number with `group_index()` and returns where that is `count` or more.
    pub fn linear(self, count: u32) {
        let [x, y] = linear_groups(count);
        self.groups([x, y, 1]);
    }

    /// Dispatches as many workgroups as the three `u32` at byte `offset` of `buffer` say.
    pub fn indirect(self, buffer: &'a Buffer, offset: u64) {
        self.dispatch(&Size::Indirect(buffer, offset));
    }

    fn dispatch(self, size: &Size<'a>) {
        let Self { recorder, pipeline, buffers, push, push_size } = self;
        let stage = pipeline.stage;
        // A mismatch here is a mistake in this crate that no input can cause.
        assert_eq!(buffers.len(), stage.bindings.len(), "buffers of `{}`", stage.name);
        assert_eq!(push_size, stage.push_size as usize, "push constants of `{}`", stage.name);
        if matches!(size, Size::Groups(groups) if groups.contains(&0)) || recorder.failure.is_some() {
            return;
        }
        let of = |access| {
            let bound = buffers.iter().zip(stage.bindings).filter(move |(_, a)| **a == access);
            bound.map(|(buffer, _)| buffer.handle()).collect::<Vec<_>>()
        };
        let mut read = of(Access::Read);
        if let Size::Indirect(buffer, _) = size {
            read.push(buffer.handle());
        }
        recorder.touch(&read, &of(Access::Write));
        let infos: Vec<_> = buffers
            .iter()
            .map(|buffer| [vk::DescriptorBufferInfo::default().buffer(buffer.handle()).range(vk::WHOLE_SIZE)])
            .collect();
        let writes: Vec<_> = infos
            .iter()
            .enumerate()
            .map(|(slot, info)| {
                vk::WriteDescriptorSet::default()
                    .dst_binding(slot as u32)
                    .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                    .buffer_info(info)
            })
            .collect();
        recorder.start_clock(stage.name);
        // SAFETY: the command buffer is recording; pipeline and buffers are live for `'a`, which outlives the
        // recorder's submissions; counts were checked above.
        unsafe {
            let context = &recorder.context;
            let (device, raw) = (&context.device, recorder.raw);
            if let Some(labels) = &context.debug_utils {
                labels.cmd_begin_debug_utils_label(raw, &vk::DebugUtilsLabelEXT::default().label_name(stage.label));
            }
            if let Some(checkpoints) = &context.checkpoints {
                checkpoints.cmd_set_checkpoint(raw, stage.label.as_ptr().cast());
            }
            device.cmd_bind_pipeline(raw, vk::PipelineBindPoint::COMPUTE, pipeline.raw);
            if !writes.is_empty() {
                context.push_descriptor.cmd_push_descriptor_set(
                    raw,
                    vk::PipelineBindPoint::COMPUTE,
                    pipeline.layout,
                    0,
                    &writes,
                );
            }
            if push_size > 0 {
                let flags = vk::ShaderStageFlags::COMPUTE;
                device.cmd_push_constants(raw, pipeline.layout, flags, 0, &push[..push_size]);
            }
            match size {
                Size::Groups([x, y, z]) => device.cmd_dispatch(raw, *x, *y, *z),
                Size::Indirect(buffer, offset) => device.cmd_dispatch_indirect(raw, buffer.handle(), *offset),
            }
            if let Some(labels) = &context.debug_utils {
                labels.cmd_end_debug_utils_label(raw);
            }
        }
        recorder.stop_clock();
        if recorder.context.debug_sync && recorder.owned && recorder.clock.is_none() {
            recorder.failure = recorder.run_now(stage.name).err();
        }
    }
}

/// Workgroups in x and y for a linear dispatch of `count`: y is 1 up to the 65,535 groups that every device takes.
pub fn linear_groups(count: u32) -> [u32; 2] {
    if count <= 65_535 { [count, 1] } else { [32_768, count.div_ceil(32_768)] }
}

impl Drop for Recorder<'_> {
    fn drop(&mut self) {
        if !self.owned {
            return;
        }
        // A failure cannot be acted on here; a lost device runs nothing any more.
        let _ = self.wait();
        // SAFETY: no submission of this command buffer is pending.
        unsafe {
            if let Some(clock) = self.clock.take() {
                self.context.device.destroy_query_pool(clock.pool, None);
            }
            self.context.device.free_command_buffers(*lock(&self.context.command_pool), &[self.raw]);
        }
    }
}

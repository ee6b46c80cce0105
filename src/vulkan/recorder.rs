//! Recording: stages into a command buffer, with the barriers that their buffers need.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;

use super::buffer::Buffer;
use super::clock::Clock;
pub use super::clock::Timing;
use super::context::Context;
use super::pipeline::Pipeline;
use super::reuse::Commands;
use super::stage::{Access, Stage};
use super::timeline::Timeline;
use crate::{Error, Result};

/// Writes stages into a command buffer. It borrows what it records, and waits for its submissions when dropped.
pub struct Recorder<'a> {
    context: Arc<Context>,
    raw: vk::CommandBuffer,
    // Null where the command buffer is a host application's.
    pool: vk::CommandPool,
    ended: bool,
    fences: Vec<vk::Fence>,
    // Buffers touched since the last barrier.
    read: Vec<vk::Buffer>,
    written: Vec<vk::Buffer>,
    clock: Option<Clock>,
    failure: Option<Error>,
    borrowed: std::marker::PhantomData<&'a Buffer>,
}

impl<'a> Recorder<'a> {
    /// Begins a command buffer of our own, which may be submitted many times.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn new(context: &Arc<Context>) -> Result<Self> {
        let Commands { pool, raw } = context.take_commands()?;
        let recorder = Self::around(context, raw, pool);
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
            clock.start(context, recorder.raw, "whole");
        }
        Ok(recorder)
    }

    fn clocked(context: &Arc<Context>, capacity: u32, whole: bool) -> Result<Self> {
        let mut recorder = Self::new(context)?;
        if context.physical().timestamp_bits == 0 {
            return Err(Error::NoDevice(format!("{} has no timestamps", context.physical().name)));
        }
        recorder.clock = Some(Clock::new(context, recorder.raw, capacity, whole)?);
        Ok(recorder)
    }

    /// Records into a host application's command buffer, which the host begins, ends and submits.
    ///
    /// # Safety
    /// `raw` must be in the recording state, of the device that `context` adopted, and everything recorded must stay
    /// alive until the host's submission has ended. [`Recorder::finish`] must come before the host reads results.
    pub unsafe fn host(context: &Arc<Context>, raw: vk::CommandBuffer) -> Self {
        let mut recorder = Self::around(context, raw, vk::CommandPool::null());
        recorder.barrier();
        recorder
    }

    /// Ends the part of a host's command buffer that this recorder wrote: what the host records next, and the host itself
    /// once its submission has ended, see the results.
    pub fn finish(mut self) {
        self.barrier();
    }

    fn around(context: &Arc<Context>, raw: vk::CommandBuffer, pool: vk::CommandPool) -> Self {
        Self {
            context: context.clone(),
            raw,
            pool,
            ended: false,
            fences: Vec::new(),
            read: Vec::new(),
            written: Vec::new(),
            clock: None,
            failure: None,
            borrowed: std::marker::PhantomData,
        }
    }

    /// Whether the command buffer is ours to submit.
    fn owned(&self) -> bool {
        self.pool != vk::CommandPool::null()
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

    /// Starts the record of one stage: `recorder.stage(&fade, FadeStage { source, target }).push(&push).linear(groups)`.
    pub fn stage<'r, S: Stage<'a>>(&'r mut self, pipeline: &'a Pipeline, stage: S) -> StageRecord<'r, 'a, S::Push> {
        // A mismatch here is a mistake in this crate that no input can cause.
        assert_eq!(
            pipeline.shader.buffers,
            S::SHADER.buffers,
            "`{}` bound as `{}`",
            pipeline.shader.name,
            S::SHADER.name
        );
        StageRecord { recorder: self, pipeline, buffers: stage.in_order(), push: None }
    }

    /// Copies the first `bytes` bytes of `from` to the start of `to`.
    pub fn copy(&mut self, from: &'a Buffer, to: &'a Buffer, bytes: u64) {
        self.copy_region(from, 0, to, 0, bytes);
    }

    /// Copies `bytes` bytes between offsets.
    pub fn copy_region(&mut self, from: &'a Buffer, from_offset: u64, to: &'a Buffer, to_offset: u64, bytes: u64) {
        if from_offset.saturating_add(bytes) > from.size() || to_offset.saturating_add(bytes) > to.size() {
            let (from, to) = (from.name(), to.name());
            self.failure = Some(Error::Request(format!("a copy from {from:?} to {to:?} passes the end of a buffer")));
            return;
        }
        self.touch(&[from.handle()], &[to.handle()]);
        self.start_clock("copy");
        let region = [vk::BufferCopy::default().src_offset(from_offset).dst_offset(to_offset).size(bytes)];
        // SAFETY: both buffers are live for `'a`; the ranges lie within them.
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
        // SAFETY: there are no semaphores.
        unsafe { self.submit_between(&[], &[]) }
    }

    /// Like [`Recorder::submit`]: begins once the timeline semaphores `after` have their values, and then sets those of `signal`. So a
    /// host application orders its own submissions, on whatever queue, around the engine's without waiting on the host side.
    ///
    /// # Safety
    /// The semaphores must be timeline semaphores of the context's device, live until the submission has ended, and the host must have
    /// enabled `timelineSemaphore`; values that are signalled must be greater than the semaphores have by then.
    ///
    /// # Errors
    /// Where the device fails.
    pub unsafe fn submit_between(&mut self, after: &[Timeline], signal: &[Timeline]) -> Result<()> {
        if let Some(failure) = self.failure.take() {
            return Err(failure);
        }
        if !self.ended {
            self.barrier();
            if let Some(clock) = self.clock.as_ref().filter(|clock| clock.whole) {
                clock.stop(&self.context, self.raw);
            }
            // SAFETY: the command buffer is in the recording state.
            unsafe { self.context.device.end_command_buffer(self.raw) }
                .map_err(|code| self.context.failure("vkEndCommandBuffer", code))?;
            self.ended = true;
        }
        let fence = self.context.take_fence()?;
        let submitted = self.context.submit(self.raw, after, signal, fence);
        match submitted {
            Ok(()) => self.fences.push(fence),
            Err(_) => self.context.give_fence(fence),
        }
        submitted
    }

    /// Waits for every submission so far. Where that fails but the device is not lost, they may still run: it can be called again.
    ///
    /// # Errors
    /// Where the device is lost; the error names the last stage that started, where the driver reports it.
    pub fn wait(&mut self) -> Result<()> {
        if self.fences.is_empty() {
            return Ok(());
        }
        // SAFETY: the fences are live and each was submitted.
        let waited = unsafe { self.context.device.wait_for_fences(&self.fences, true, u64::MAX) };
        if matches!(waited, Ok(()) | Err(vk::Result::ERROR_DEVICE_LOST)) {
            // Nothing will signal them any more.
            self.fences.drain(..).for_each(|fence| self.context.give_fence(fence));
        }
        waited.map_err(|code| self.context.failure("vkWaitForFences", code))
    }

    /// Submissions that have not ended yet.
    pub fn pending(&self) -> usize {
        // Of a lost device nothing runs any more: waiting reports it.
        // SAFETY: the fences are live.
        let running =
            |fence: &&vk::Fence| matches!(unsafe { self.context.device.get_fence_status(**fence) }, Ok(false));
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
    /// Where the device fails, or nothing has been waited for.
    pub fn timings(&self) -> Result<Vec<Timing>> {
        if !self.ended || !self.fences.is_empty() {
            return Err(Error::request("times are there once a recording has been submitted and waited for"));
        }
        self.clock.as_ref().map_or_else(|| Ok(Vec::new()), |clock| clock.timings(&self.context))
    }

    fn start_clock(&mut self, name: &'static str) {
        if let Some(clock) = self.clock.as_mut().filter(|clock| !clock.whole) {
            clock.start(&self.context, self.raw, name);
        }
    }

    fn stop_clock(&self) {
        if let Some(clock) = self.clock.as_ref().filter(|clock| !clock.whole) {
            clock.stop(&self.context, self.raw);
        }
    }

    /// Under `--debug-sync`: runs what was recorded so far, so that a failure can be attributed to `stage`.
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
pub struct StageRecord<'r, 'a, P> {
    recorder: &'r mut Recorder<'a>,
    pipeline: &'a Pipeline,
    buffers: Vec<&'a Buffer>,
    push: Option<P>,
}

enum Size<'a> {
    Groups([u32; 3]),
    Indirect(&'a Buffer, u64),
}

impl<'a, P: Pod> StageRecord<'_, 'a, P> {
    /// The push constants.
    pub fn push(mut self, constants: &P) -> Self {
        self.push = Some(*constants);
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

    /// Dispatches as many workgroups as the three `u32` at byte `offset` of `buffer` give.
    pub fn indirect(self, buffer: &'a Buffer, offset: u64) {
        self.dispatch(&Size::Indirect(buffer, offset));
    }

    fn dispatch(self, size: &Size<'a>) {
        let Self { recorder, pipeline, buffers, push } = self;
        let shader = pipeline.shader;
        let push = push.as_ref().map_or(&[][..], bytemuck::bytes_of);
        // A mismatch here is a mistake in this crate that no input can cause.
        assert_eq!(push.len(), shader.push_size as usize, "push constants of `{}`", shader.name);
        if matches!(size, Size::Groups(groups) if groups.contains(&0)) || recorder.failure.is_some() {
            return;
        }
        let of = |access| {
            let bound = buffers.iter().zip(shader.buffers).filter(move |(_, (_, a))| *a == access);
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
        recorder.start_clock(shader.name);
        // SAFETY: the command buffer is recording; pipeline and buffers are live for `'a`, which outlives the
        // recorder's submissions; as many buffers are bound as the stage declares.
        unsafe {
            let context = &recorder.context;
            let (device, raw) = (&context.device, recorder.raw);
            if let Some(labels) = &context.debug_utils {
                labels.cmd_begin_debug_utils_label(raw, &vk::DebugUtilsLabelEXT::default().label_name(shader.label));
            }
            if let Some(checkpoints) = &context.checkpoints {
                checkpoints.cmd_set_checkpoint(raw, shader.label.as_ptr().cast());
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
            if !push.is_empty() {
                let flags = vk::ShaderStageFlags::COMPUTE;
                device.cmd_push_constants(raw, pipeline.layout, flags, 0, push);
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
        if recorder.context.debug_sync && recorder.owned() && recorder.clock.is_none() {
            recorder.failure = recorder.run_now(shader.name).err();
        }
    }
}

/// Workgroups in x and y for a linear dispatch of `count`: y is 1 up to the 65,535 groups that every device takes.
pub fn linear_groups(count: u32) -> [u32; 2] {
    if count <= 65_535 { [count, 1] } else { [32_768, count.div_ceil(32_768)] }
}

impl Drop for Recorder<'_> {
    fn drop(&mut self) {
        if !self.owned() {
            return;
        }
        // A failure cannot be acted on here; a lost device runs nothing any more. What may still run is left to its device.
        let _ = self.wait();
        if !self.fences.is_empty() {
            return;
        }
        if let Some(clock) = self.clock.take() {
            clock.give_back(&self.context);
        }
        self.context.give_commands(Commands { pool: self.pool, raw: self.raw });
    }
}

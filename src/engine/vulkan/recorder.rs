//! Recording: stages into a command buffer, with the barriers that their buffers need.

use std::sync::Arc;
use std::time::{Duration, Instant};

use ash::vk;

use super::buffer::Buffer;
use super::clock::Clock;
pub use super::clock::Timing;
use super::context::Context;
pub use super::kept::Kept;
use super::reuse::Commands;
use super::timeline::Timeline;
use crate::{Error, Result};

/// What is said of something recorded after that.
const SUBMITTED: &str = "a recording that was submitted takes nothing more; begin another";

/// Writes stages into a command buffer. It keeps what it records in memory, and waits for its submissions when dropped; one that is
/// forgotten instead frees nothing.
pub struct Recorder {
    pub(super) context: Arc<Context>,
    pub(super) raw: vk::CommandBuffer,
    // Null where the command buffer is a host application's.
    pool: vk::CommandPool,
    // Parts before it, which have ended.
    earlier: Vec<Commands>,
    ended: bool,
    // Whether all of it was submitted the last time.
    complete: bool,
    // Of each part of each submission, in order.
    fences: Vec<vk::Fence>,
    // When the last one ended, or the first was submitted.
    progress: Instant,
    // Buffers touched since the last barrier.
    read: Vec<vk::Buffer>,
    written: Vec<vk::Buffer>,
    pub(super) clock: Option<Clock>,
    pub(super) failure: Option<Error>,
    pub(super) kept: Kept,
    // The stages that were recorded first and last.
    stages: Option<[&'static str; 2]>,
    // Whether waiting has met its limit.
    given_up: bool,
    // Whether something may run that no fence reports, since a host's lock has panicked.
    lost_sight: bool,
}

impl Recorder {
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

    /// Like [`Recorder::new`], for work whose time decides how much is submitted next: [`Recorder::timed_whole`] where that can be.
    pub(crate) fn paced(context: &Arc<Context>) -> Result<Self> {
        // Timed as a whole, no stage could be waited for.
        let timed = context.physical().timestamp_bits > 0 && !context.debug_sync();
        if timed { Self::timed_whole(context) } else { Self::new(context) }
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
    /// `raw` must be in the recording state, outside a render pass, and of the device that `context` adopted. [`Recorder::finish`] must
    /// end the part, and what it answers must be kept until every submission of the command buffer has ended.
    pub unsafe fn host(context: &Arc<Context>, raw: vk::CommandBuffer) -> Self {
        let recorder = Self::around(context, raw, vk::CommandPool::null());
        recorder.barrier_at_an_edge();
        recorder
    }

    /// Ends the part of a host's command buffer that this recorder wrote: whatever the host records next, draws and copies too, and the host
    /// itself once its submission has ended, see the results. The answer keeps in memory what was recorded.
    ///
    /// # Errors
    /// Where something could not be recorded; the command buffer must not be submitted then.
    pub fn finish(mut self) -> Result<Kept> {
        if self.owned() {
            return Err(Error::request("only recordings into a host's command buffer are finished; submit this one"));
        }
        self.barrier_at_an_edge();
        self.failure.take().map_or_else(|| Ok(std::mem::take(&mut self.kept)), Err)
    }

    fn around(context: &Arc<Context>, raw: vk::CommandBuffer, pool: vk::CommandPool) -> Self {
        Self {
            context: context.clone(),
            raw,
            pool,
            earlier: Vec::new(),
            ended: false,
            complete: false,
            fences: Vec::new(),
            progress: Instant::now(),
            read: Vec::new(),
            written: Vec::new(),
            clock: None,
            failure: None,
            kept: Kept::new(context),
            stages: None,
            given_up: false,
            lost_sight: false,
        }
    }

    /// What follows is another submission, behind what was recorded so far: none is then longer than drivers allow. In a host's command
    /// buffer it does nothing.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn cut(&mut self) -> Result<()> {
        if !self.owned() || self.context.debug_sync {
            return Ok(());
        }
        if self.ended {
            self.refuse(SUBMITTED.into());
            return Ok(());
        }
        let Commands { pool, raw } = self.context.take_commands()?;
        let ended = self.end();
        self.earlier.push(Commands { pool: self.pool, raw: self.raw });
        (self.pool, self.raw) = (pool, raw);
        ended.and_then(|()| self.begin()).inspect_err(|error| self.refuse(error.to_string()))
    }

    fn end(&mut self) -> Result<()> {
        self.barrier_at_an_edge();
        self.read.clear();
        self.written.clear();
        // SAFETY: the command buffer is in the recording state.
        unsafe { self.context.device.end_command_buffer(self.raw) }
            .map_err(|code| self.context.failure("vkEndCommandBuffer", code))
    }

    /// Whether the command buffer is ours to submit.
    pub(super) fn owned(&self) -> bool {
        self.pool != vk::CommandPool::null()
    }

    fn begin(&self) -> Result<()> {
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::SIMULTANEOUS_USE);
        // SAFETY: the command buffer is ours and not pending.
        unsafe { self.context.device.begin_command_buffer(self.raw, &info) }
            .map_err(|code| self.context.failure("vkBeginCommandBuffer", code))?;
        // Whatever was submitted before may still be writing what this reads.
        self.barrier_at_an_edge();
        Ok(())
    }

    /// Copies the first `bytes` bytes of `from` to the start of `to`.
    pub fn copy(&mut self, from: &Buffer, to: &Buffer, bytes: u64) {
        self.copy_region(from, 0, to, 0, bytes);
    }

    /// Copies `bytes` bytes between offsets of two buffers.
    pub fn copy_region(&mut self, from: &Buffer, from_offset: u64, to: &Buffer, to_offset: u64, bytes: u64) {
        let fits = |buffer: &Buffer, offset: u64| offset.checked_add(bytes).is_some_and(|end| end <= buffer.size());
        if !fits(from, from_offset) || !fits(to, to_offset) {
            return self.refuse(format!("a copy from {:?} to {:?} passes the end of a buffer", from.name(), to.name()));
        }
        let [begin, end] = [from.memory.offset + from_offset, to.memory.offset + to_offset];
        if from.handle() == to.handle() && begin.abs_diff(end) < bytes {
            return self.refuse(format!("a copy from {:?} to {:?} overlaps itself", from.name(), to.name()));
        }
        if bytes == 0 || !self.keep([from, to]) {
            return;
        }
        self.touch(&[from.handle()], &[to.handle()]);
        self.begin_step("copy");
        let region = [vk::BufferCopy::default().src_offset(begin).dst_offset(end).size(bytes)];
        // SAFETY: both buffers are of this device and kept until this has run; the ranges lie within them and do not overlap.
        unsafe { self.context.device.cmd_copy_buffer(self.raw, from.handle(), to.handle(), &region) };
        self.stop_clock();
    }

    /// Fills a buffer with a 32-bit value.
    pub fn fill(&mut self, buffer: &Buffer, value: u32) {
        if !self.keep([buffer]) {
            return;
        }
        self.touch(&[], &[buffer.handle()]);
        self.begin_step("fill");
        let (memory, size) = (&buffer.memory, buffer.size());
        // SAFETY: as in `copy_region`; sizes of buffers and offsets in them are multiples of four.
        unsafe { self.context.device.cmd_fill_buffer(self.raw, memory.raw, memory.offset, size, value) };
        self.stop_clock();
    }

    /// Keeps buffers until this has run; false where that is in vain, since something cannot be recorded.
    pub(super) fn keep<'b>(&mut self, buffers: impl IntoIterator<Item = &'b Buffer>) -> bool {
        if self.ended {
            self.refuse(SUBMITTED.into());
            return false;
        }
        for buffer in buffers {
            if !Arc::ptr_eq(buffer.context(), &self.context) {
                self.refuse(format!("the buffer {:?} is of another context", buffer.name()));
            }
            self.kept.keep(&buffer.memory, &buffer.memory.last_kept);
        }
        self.failure.is_none()
    }

    /// Remembers what is wrong, of which the first is reported when this is submitted.
    pub(super) fn refuse(&mut self, what: String) {
        self.failure.get_or_insert(Error::Request(what));
    }

    /// The one place that decides on barriers: what is read must not be pending as written, what is written must not
    /// be pending at all.
    pub(super) fn touch(&mut self, read: &[vk::Buffer], written: &[vk::Buffer]) {
        let hazard = read.iter().any(|buffer| self.written.contains(buffer))
            || written.iter().any(|buffer| self.written.contains(buffer) || self.read.contains(buffer));
        if hazard {
            self.barrier();
        }
        self.read.extend_from_slice(read);
        self.written.extend_from_slice(written);
    }

    /// Between what this records.
    fn barrier(&mut self) {
        self.read.clear();
        self.written.clear();
        let work = vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::TRANSFER;
        let writes = vk::AccessFlags::SHADER_WRITE | vk::AccessFlags::TRANSFER_WRITE;
        let reads =
            vk::AccessFlags::SHADER_READ | vk::AccessFlags::TRANSFER_READ | vk::AccessFlags::INDIRECT_COMMAND_READ;
        self.barrier_of([work, work | vk::PipelineStageFlags::DRAW_INDIRECT], [writes, reads | writes]);
    }

    /// Where others come before and after: whatever they do, and the host.
    fn barrier_at_an_edge(&self) {
        let all = vk::PipelineStageFlags::ALL_COMMANDS;
        let any = vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE;
        self.barrier_of([all, all | vk::PipelineStageFlags::HOST], [vk::AccessFlags::MEMORY_WRITE, any]);
    }

    fn barrier_of(&self, [before, after]: [vk::PipelineStageFlags; 2], [made, seen]: [vk::AccessFlags; 2]) {
        let barrier = [vk::MemoryBarrier::default().src_access_mask(made).dst_access_mask(seen)];
        let none = vk::DependencyFlags::empty();
        // SAFETY: the command buffer is in the recording state.
        unsafe { self.context.device.cmd_pipeline_barrier(self.raw, before, after, none, &barrier, &[], &[]) };
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
    /// The semaphores must be timeline semaphores of the context's device, live until the submission has ended, and of a host's device it must
    /// have enabled `timelineSemaphore`; values that are signalled must be greater than the semaphores have by then.
    ///
    /// # Errors
    /// Where the device fails.
    pub unsafe fn submit_between(&mut self, after: &[Timeline], signal: &[Timeline]) -> Result<()> {
        self.end_recording()?;
        let last = self.parts() - 1;
        for part in 0..=last {
            self.submit_part(part, if part == 0 { after } else { &[] }, if part == last { signal } else { &[] })?;
        }
        Ok(())
    }

    /// Ends the recording, unless it has ended.
    fn end_recording(&mut self) -> Result<()> {
        if !self.owned() {
            return Err(Error::request("a host submits its command buffer itself; this recording is in one"));
        }
        if let Some(failure) = self.failure.take() {
            self.refuse("something could not be recorded, as was said before; record it anew".into());
            return Err(failure);
        }
        if !self.ended {
            if let Some(clock) = self.clock.as_ref().filter(|clock| clock.whole) {
                clock.stop(&self.context, self.raw);
            }
            self.end()?;
            self.ended = true;
        }
        Ok(())
    }

    fn submit_part(&mut self, part: usize, after: &[Timeline], signal: &[Timeline]) -> Result<()> {
        let raw = self.earlier.get(part).map_or(self.raw, |commands| commands.raw);
        let fence = self.context.take_fence()?;
        // Until the host's lock has returned, which may panic.
        let lost_sight = std::mem::replace(&mut self.lost_sight, true);
        let submitted = self.context.submit(raw, fence, after, signal);
        self.lost_sight = lost_sight;
        self.complete = submitted.is_ok() && part + 1 == self.parts();
        // Only now: a host may have kept its queue to itself for long.
        if self.fences.is_empty() {
            self.progress = Instant::now();
        }
        match submitted {
            Ok(()) => self.fences.push(fence),
            Err(_) => self.context.give_fence(fence),
        }
        submitted
    }

    /// Waits for every submission so far. Where that fails but the device is not lost, they may still run: it can be called again.
    ///
    /// # Errors
    /// Where the device is lost; the error names the last stage that started, where the driver reports it. Where a submission takes longer
    /// than [`ContextOptions::wait_limit`](super::ContextOptions::wait_limit) after those before it.
    pub fn wait(&mut self) -> Result<()> {
        let limit = self.context.wait_limit();
        let nanoseconds = limit.map_or(u64::MAX, |limit| limit.as_nanos().try_into().unwrap_or(u64::MAX));
        while let Some(fence) = self.fences.first() {
            // SAFETY: the fence is live and was submitted.
            let waited = unsafe { self.context.device.wait_for_fences(&[*fence], true, nanoseconds) };
            match waited {
                Ok(()) => self.give_fences(1),
                Err(vk::Result::TIMEOUT) => return Err(self.unfinished()),
                Err(code) => return Err(self.lost("vkWaitForFences", code)),
            }
        }
        self.given_up = false;
        Ok(())
    }

    /// How many times this was submitted and has not ended yet.
    ///
    /// # Errors
    /// As [`Recorder::wait`].
    pub fn pending(&mut self) -> Result<usize> {
        while let Some(fence) = self.fences.first() {
            // SAFETY: the fence is live.
            match unsafe { self.context.device.get_fence_status(*fence) } {
                Ok(true) => self.give_fences(1),
                Ok(false) => {
                    let late = self.context.wait_limit().is_some_and(|limit| self.progress.elapsed() > limit);
                    return if late { Err(self.unfinished()) } else { Ok(self.fences.len().div_ceil(self.parts())) };
                }
                Err(code) => return Err(self.lost("vkGetFenceStatus", code)),
            }
        }
        Ok(0)
    }

    /// Parts of a submission.
    fn parts(&self) -> usize {
        1 + self.earlier.len()
    }

    /// The error where the limit of waiting is reached.
    fn unfinished(&mut self) -> Error {
        let [first, last] = self.stages.unwrap_or(["none"; 2]);
        let seconds = self.context.wait_limit().unwrap_or_default().as_secs_f64();
        self.given_up = true;
        Error::Unfinished { first, last, seconds }
    }

    /// The error of a call that failed; of a lost device nothing will signal the fences any more.
    fn lost(&mut self, what: &'static str, code: vk::Result) -> Error {
        if code == vk::Result::ERROR_DEVICE_LOST {
            self.give_fences(self.fences.len());
        }
        self.context.failure(what, code)
    }

    /// Returns the first fences, which nothing will signal any more.
    fn give_fences(&mut self, count: usize) {
        self.fences.drain(..count).for_each(|fence| self.context.give_fence(fence));
        self.progress = Instant::now();
    }

    /// [`Recorder::submit`] and [`Recorder::wait`], of the parts between [cuts](Recorder::cut) one by one: a host's submissions wait for one
    /// part at most. Answers how long they took: by timestamps where the whole is timed, which leaves out what the host has on the queue.
    ///
    /// # Errors
    /// As for these.
    pub fn submit_and_wait(&mut self) -> Result<Duration> {
        self.end_recording()?;
        let mut took = Duration::ZERO;
        let whole = self.clock.as_ref().is_some_and(|clock| clock.whole);
        for part in 0..self.parts() {
            self.submit_part(part, &[], &[])?;
            let begun = Instant::now();
            self.wait()?;
            took += begun.elapsed();
        }
        if let (true, Some(timing)) = (whole, self.timings()?.first()) {
            took = Duration::from_secs_f64((timing.end - timing.start) * 1e-9);
        }
        Ok(took)
    }

    /// GPU times of the stages of a [`Recorder::timed`] recording whose submission has been waited for.
    ///
    /// # Errors
    /// Where the device fails, or nothing has been waited for.
    pub fn timings(&self) -> Result<Vec<Timing>> {
        if !self.complete || !self.fences.is_empty() {
            return Err(Error::request("times are there once a recording has been submitted and waited for"));
        }
        self.clock.as_ref().map_or_else(|| Ok(Vec::new()), |clock| clock.timings(&self.context))
    }

    /// Before a stage, copy or fill is recorded.
    pub(super) fn begin_step(&mut self, name: &'static str) {
        self.stages = Some([self.stages.map_or(name, |[first, _]| first), name]);
        if let Some(clock) = self.clock.as_mut().filter(|clock| !clock.whole) {
            clock.start(&self.context, self.raw, name);
        }
    }

    pub(super) fn stop_clock(&self) {
        if let Some(clock) = self.clock.as_ref().filter(|clock| !clock.whole) {
            clock.stop(&self.context, self.raw);
        }
    }

    /// Under `--debug-sync`: runs what was recorded so far, so that a failure can be attributed to `stage`.
    pub(super) fn run_now(&mut self, stage: &'static str) -> Result<()> {
        self.submit()?;
        self.wait().map_err(|error| match error {
            Error::DeviceLost { .. } => Error::DeviceLost { stage: stage.into() },
            other => other,
        })?;
        self.ended = false;
        self.begin()
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if !self.owned() {
            return;
        }
        // A failure cannot be acted on here; a lost device runs nothing any more. What may still run is left as it is, and with it what it uses.
        if !self.given_up {
            let _ = self.wait();
        }
        if self.lost_sight || !self.fences.is_empty() {
            std::mem::forget(std::mem::take(&mut self.kept));
            return;
        }
        if let Some(clock) = self.clock.take() {
            clock.give_back(&self.context);
        }
        self.earlier.push(Commands { pool: self.pool, raw: self.raw });
        self.earlier.drain(..).for_each(|part| self.context.give_commands(part));
    }
}

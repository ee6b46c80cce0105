//! Timestamps of what a command buffer records.

use ash::vk;

use super::context::Context;
use super::reuse::Queries;
use crate::Result;

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

/// Pairs of timestamps, one for each name. Its maker returns its queries.
pub(super) struct Clock {
    queries: Queries,
    capacity: u32,
    names: Vec<&'static str>,
    /// One pair around everything, not one around each stage.
    pub(super) whole: bool,
}

impl Clock {
    /// Capacity for `capacity` pairs, reset by `commands`, which must be recording.
    pub(super) fn new(context: &Context, commands: vk::CommandBuffer, capacity: u32, whole: bool) -> Result<Self> {
        let capacity = capacity.max(1);
        let queries = context.take_queries(2 * capacity)?;
        // SAFETY: the recording has begun, outside a render pass; the range is the whole pool.
        unsafe { context.device.cmd_reset_query_pool(commands, queries.pool, 0, queries.count) };
        Ok(Self { queries, capacity, names: Vec::new(), whole })
    }

    /// Begins the next pair; past the capacity nothing is written.
    pub(super) fn start(&mut self, context: &Context, commands: vk::CommandBuffer, name: &'static str) {
        self.names.push(name);
        self.timestamp(context, commands, false);
    }

    /// Ends the pair that was begun last.
    pub(super) fn stop(&self, context: &Context, commands: vk::CommandBuffer) {
        self.timestamp(context, commands, true);
    }

    fn timestamp(&self, context: &Context, commands: vk::CommandBuffer, end: bool) {
        if self.names.len() as u32 <= self.capacity {
            let query = 2 * (self.names.len() as u32 - 1) + end as u32;
            let stage = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
            // SAFETY: the query lies inside the pool and was reset at the start of the recording.
            unsafe { context.device.cmd_write_timestamp(commands, stage, self.queries.pool, query) };
        }
    }

    /// The pairs, once the submission that wrote them has ended.
    ///
    /// # Errors
    /// Where the device fails.
    pub(super) fn timings(&self, context: &Context) -> Result<Vec<Timing>> {
        let mut ticks = vec![0u64; 2 * self.names.len().min(self.capacity as usize)];
        if ticks.is_empty() {
            return Ok(Vec::new());
        }
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the first `ticks.len()` queries were written by the submission, which has ended.
        unsafe { context.device.get_query_pool_results(self.queries.pool, 0, &mut ticks, flags) }
            .map_err(|code| context.failure("vkGetQueryPoolResults", code))?;
        let physical = context.physical();
        let mask = u64::MAX >> (64 - physical.timestamp_bits.clamp(1, 64));
        let origin = ticks[0] & mask;
        let since = |tick: u64| ((tick & mask).wrapping_sub(origin) & mask) as f64 * physical.timestamp_period as f64;
        let pairs = ticks.chunks_exact(2).zip(&self.names);
        Ok(pairs.map(|(pair, name)| Timing { name, start: since(pair[0]), end: since(pair[1]) }).collect())
    }

    /// Gives the queries back; nothing that writes them may be pending.
    pub(super) fn give_back(self, context: &Context) {
        context.give_queries(self.queries);
    }
}

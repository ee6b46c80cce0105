//! What the device can do at best: a copy, and arithmetic in registers.

use std::sync::Arc;

use camsplat::Result;
use camsplat::engine::primitives::{Arithmetic, Copy};
use camsplat::engine::vulkan::{Buffer, Context, Recorder};

use super::document::Amount;
use super::job::{Job, Sample};

/// Copies as large as a storage buffer allows, up to a gibibyte.
pub fn copies(context: &Arc<Context>) -> Result<(Amount, Vec<Vec<Sample>>)> {
    let bytes = (1 << 30).min(context.physical().storage_range / 2).min(context.memory_available() / 8) & !15;
    let from = Buffer::device(context, "copy source", bytes)?;
    let to = Buffer::device(context, "copy target", bytes)?;
    // Memory that was never written may not be there yet.
    let mut first = Recorder::new(context)?;
    first.fill(&from, 1);
    first.fill(&to, 1);
    first.submit_and_wait()?;
    let copy = Copy::new(context)?;
    let mut job = Job::new(
        context,
        1,
        |_| {},
        |recorder| {
            copy.record(recorder, &from, &to);
            Ok(())
        },
    )?;
    Ok((Amount { count: bytes / 4, bytes: 2 * bytes, operations: 0 }, job.sample()?))
}

/// Multiply-adds by as many threads as fill the device.
pub fn multiply_adds(context: &Arc<Context>) -> Result<(Amount, Vec<Vec<Sample>>)> {
    const ROUNDS: u32 = 64;
    let threads = if context.physical().is_cpu() { 1 << 14 } else { 1 << 20 };
    let sums = Buffer::device(context, "sums", 4 * u64::from(threads))?;
    let arithmetic = Arithmetic::new(context)?;
    let mut job = Job::new(
        context,
        1,
        |_| {},
        |recorder| {
            // Values neither grow nor vanish.
            arithmetic.record(recorder, &sums, ROUNDS, [-1.0, 1.0]);
            Ok(())
        },
    )?;
    let operations = Arithmetic::operations(threads, ROUNDS);
    Ok((Amount { count: u64::from(threads), bytes: 0, operations }, job.sample()?))
}

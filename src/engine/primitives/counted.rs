//! Radix passes in three stages each, on any device: count the digits of each tile of keys, scan the counts, move every key (and its
//! value) to its place. No workgroup waits for another.
//!
//! Per pair a pass reads 4 bytes to count, then reads 8 and writes 8, and the table of counts adds 1: 21 bytes.

use std::sync::Arc;

use super::count::Bound;
use super::digits::{Digit, Sorted, digits};
use super::scan::{ScanRowsStage, record_rows};
use crate::Result;
use crate::engine::vulkan::shaders::glsl::engine::primitives::{
    digits as digit_glsl, radix, radix_rows_runs, radix_scatter_runs,
};
use crate::engine::vulkan::stage::GroupConstants;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};

crate::gpu_struct! {
    /// Push constants of [`RadixHistogramStage`] and [`RadixScatterStage`].
    pub(crate) struct RadixPush {
        /// Elements, or the most there can be.
        pub count: u32,
        /// Where in `counts` their number is; all ones where `count` is the number.
        pub count_index: u32,
        /// Lowest bit of the digit.
        pub shift: u32,
        /// As many ones as the digit has bits.
        pub mask: u32,
        /// Tiles from one digit's row of the table to the next.
        pub stride: u32,
    }
}

crate::specialisation! {
    /// Constants of [`RadixScatterStage`].
    pub(crate) struct RadixConstants {
        /// Threads per workgroup.
        local_size_x: u32,
        /// Whether keys have values.
        has_values: bool,
    }
}

crate::specialisation! {
    /// Constants of [`RadixScatterRunsStage`].
    pub(crate) struct RunConstants {
        /// Keys of a thread.
        run: u32,
        /// Whether keys have values.
        has_values: bool,
    }
}

crate::stage!(
    /// Counts the digits of each tile.
    pub(crate) RadixHistogramStage = radix_histogram<GroupConstants>(RadixPush) { read counts, read keys, write table }
);

crate::stage!(
    /// Moves keys and values to their places in the order of one digit.
    pub(crate) RadixScatterStage = radix_scatter<RadixConstants>(RadixPush) {
        read counts, read table, read totals, read keys, read values, write sorted_keys, write sorted_values,
    }
);

crate::specialisation! {
    /// Constants of [`RadixRowsRunsStage`].
    pub(crate) struct RowConstants {
        /// Keys of a tile.
        keys: u32,
    }
}

crate::stage!(
    /// Exclusive prefix sum of each row of the table of counts, in place, a row to a thread.
    pub(crate) RadixRowsRunsStage = radix_rows_runs<RowConstants>(RadixPush) { read counts, write table, write totals }
);

crate::stage!(
    /// As [`RadixScatterStage`], a run of keys to a thread.
    pub(crate) RadixScatterRunsStage = radix_scatter_runs<RunConstants>(RadixPush) {
        read counts, read table, read totals, read keys, read values, write sorted_keys, write sorted_values,
    }
);

const DIGITS: u64 = digit_glsl::DIGITS as u64;
const KEYS_PER_THREAD: u32 = radix::ITEMS;

/// Pipelines and scratch of such passes.
pub(super) struct Counted {
    histogram: Pipeline,
    rows: Pipeline,
    /// Whether keys are moved, and rows of the table summed, in the way of CPUs.
    runs: bool,
    scatter_keys: Pipeline,
    scatter_pairs: Pipeline,
    table: Buffer,
    totals: Buffer,
    tile: u32,
}

impl Counted {
    /// With the way of CPUs to sum rows and to move keys where `runs` is set.
    pub fn new(context: &Arc<Context>, most: u32, runs: bool) -> Result<Self> {
        let local_size_x = threads(context);
        let tile = local_size_x * KEYS_PER_THREAD;
        // Both stages have the same buffers and push constants.
        let scatter = |has_values| match runs {
            true => {
                let constants = RunConstants { run: tile / radix_scatter_runs::THREADS, has_values };
                Pipeline::new::<RadixScatterRunsStage>(context, &constants)
            }
            false => Pipeline::new::<RadixScatterStage>(context, &RadixConstants { local_size_x, has_values }),
        };
        Ok(Self {
            histogram: Pipeline::new::<RadixHistogramStage>(context, &GroupConstants { local_size_x })?,
            rows: match runs {
                true => Pipeline::new::<RadixRowsRunsStage>(context, &RowConstants { keys: tile })?,
                false => Pipeline::new::<ScanRowsStage>(context, &GroupConstants { local_size_x })?,
            },
            runs,
            scatter_keys: scatter(false)?,
            scatter_pairs: scatter(true)?,
            table: Buffer::device(context, "radix table", table_bytes(context, most))?,
            totals: Buffer::device(context, "radix totals", 4 * DIGITS)?,
            tile,
        })
    }

    /// Bytes of scratch beside the other half of the ping-pong.
    pub fn footprint(context: &Context, most: u32) -> u64 {
        table_bytes(context, most) + 4 * DIGITS
    }

    pub fn record<'a>(
        &'a self,
        recorder: &mut Recorder,
        bound: Bound<'a>,
        has_values: bool,
        bits: u32,
        [mut from, mut to]: [Sorted<'a>; 2],
    ) -> Sorted<'a> {
        let scatter = if has_values { &self.scatter_pairs } else { &self.scatter_keys };
        let tiles = bound.count.div_ceil(self.tile);
        for Digit { shift, mask } in digits(bits) {
            let push = RadixPush { count: bound.count, count_index: bound.index, shift, mask, stride: tiles };
            let counted = RadixHistogramStage { counts: bound.buffer, keys: from.keys, table: &self.table };
            recorder.stage(&self.histogram, counted).push(&push).linear(tiles);
            if self.runs {
                let rows = RadixRowsRunsStage { counts: bound.buffer, table: &self.table, totals: &self.totals };
                recorder.stage(&self.rows, rows).push(&push).linear((mask + 1).div_ceil(radix_rows_runs::THREADS));
            } else {
                let table = [mask + 1, self.tile, tiles];
                record_rows(recorder, &self.rows, bound, &self.table, table, (&self.totals, 0));
            }
            let moved = RadixScatterStage {
                counts: bound.buffer,
                table: &self.table,
                totals: &self.totals,
                keys: from.keys,
                values: from.values,
                sorted_keys: to.keys,
                sorted_values: to.values,
            };
            recorder.stage(scatter, moved).push(&push).linear(tiles);
            (from, to) = (to, from);
        }
        from
    }
}

fn table_bytes(context: &Context, most: u32) -> u64 {
    4 * DIGITS * most.div_ceil(threads(context) * KEYS_PER_THREAD) as u64
}

/// Threads per workgroup: 8 of the narrowest subgroups, but at least 64, which are 16 subgroups of 4: the stages that rank have shared
/// memory for the counts of no more. Software devices have narrow subgroups, run them in turns, and pay for every barrier: few threads
/// suit them.
fn threads(context: &Context) -> u32 {
    (8 * context.physical().subgroup_smallest).clamp(64, 256)
}

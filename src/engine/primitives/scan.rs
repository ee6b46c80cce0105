//! Exclusive prefix sum: sums of blocks, a scan of these sums, then each block on top of its offset.

use std::sync::Arc;

use super::count::{Bound, Count, check_index, check_most};
use super::reduce::{BLOCK, Operation, ReduceConstants, ReduceStage, record_blocks};
use crate::Result;
use crate::engine::vulkan::stage::GroupConstants;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};

crate::gpu_struct! {
    /// Push constants of [`ScanBlocksStage`].
    pub(crate) struct ScanPush {
        /// Elements, or the most there can be.
        pub count: u32,
        /// Where in `counts` their number is; all ones where `count` is the number.
        pub count_index: u32,
    }
}

crate::gpu_struct! {
    /// Push constants of [`ScanRowsStage`].
    pub(crate) struct RowsPush {
        /// Elements, or the most there can be.
        pub count: u32,
        /// Where in `counts` their number is; all ones where `count` is the number.
        pub count_index: u32,
        /// Elements per element of a row.
        pub block: u32,
        /// From one row to the next.
        pub stride: u32,
        /// Where in `totals` the first row's total goes.
        pub total_index: u32,
    }
}

crate::stage!(
    /// Exclusive prefix sum of each row of a table, in place, a workgroup per row.
    pub(crate) ScanRowsStage = scan_rows<GroupConstants>(RowsPush) { read counts, write rows, write totals }
);

crate::stage!(
    /// Exclusive prefix sum inside each block, on top of the block's offset.
    pub(crate) ScanBlocksStage = scan_blocks(ScanPush) { read counts, read elements, read offsets, write sums }
);

/// Exclusive prefix sum of `u32`, modulo 2³²: 12 bytes of traffic per element (two reads and a write).
pub struct Scan {
    reduce: Pipeline,
    rows: Pipeline,
    blocks: Pipeline,
    offsets: Buffer,
    most: u32,
}

impl Scan {
    /// A scan of at most `most` elements, up to 2²⁸.
    ///
    /// # Errors
    /// Where `most` is larger than that, or the device fails.
    pub fn new(context: &Arc<Context>, most: u32) -> Result<Self> {
        check_most(most)?;
        Ok(Self {
            reduce: Pipeline::new::<ReduceStage>(context, &ReduceConstants { operation: Operation::SumU32 })?,
            rows: Pipeline::new::<ScanRowsStage>(context, &GroupConstants { local_size_x: 256 })?,
            blocks: Pipeline::new::<ScanBlocksStage>(context, &())?,
            offsets: Buffer::device(context, "scan offsets", Self::footprint(most))?,
            most,
        })
    }

    /// Bytes of scratch that a scan of at most `most` elements owns.
    pub fn footprint(most: u32) -> u64 {
        4 * most.div_ceil(BLOCK) as u64
    }

    /// Writes to `output[i]` the sum of the elements of `input` before `i`, for each counted element, and the sum of
    /// all to `total.0` at the `u32` index `total.1`. The total may follow the sums in `output`, as rows of sparse matrices need
    /// it; it must not replace the counter. `input` and `output` must be two buffers.
    ///
    /// # Errors
    /// Where there are more elements than the capacity, or the total has no such place.
    pub fn record<'a>(
        &'a self,
        recorder: &mut Recorder,
        input: &'a Buffer,
        output: &'a Buffer,
        count: Count<'a>,
        total: (&'a Buffer, u32),
    ) -> Result<()> {
        let bound = count.within(self.most, &[input, output])?;
        check_index(total.0, total.1)?;
        record_blocks(recorder, &self.reduce, bound, input, &self.offsets);
        record_rows(recorder, &self.rows, bound, &self.offsets, [1, BLOCK, 0], total);
        let push = ScanPush { count: bound.count, count_index: bound.index };
        recorder
            .stage(
                &self.blocks,
                ScanBlocksStage { counts: bound.buffer, elements: input, offsets: &self.offsets, sums: output },
            )
            .push(&push)
            .linear(bound.count.div_ceil(BLOCK));
        Ok(())
    }
}

/// Scans a table of `rows` rows, `stride` apart, each with an element per `block` counted elements.
pub(super) fn record_rows<'a>(
    recorder: &mut Recorder,
    pipeline: &'a Pipeline,
    bound: Bound<'a>,
    table: &'a Buffer,
    [rows, block, stride]: [u32; 3],
    (totals, total_index): (&'a Buffer, u32),
) {
    let push = RowsPush { count: bound.count, count_index: bound.index, block, stride, total_index };
    recorder.stage(pipeline, ScanRowsStage { counts: bound.buffer, rows: table, totals }).push(&push).linear(rows);
}

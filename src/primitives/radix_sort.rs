//! Stable radix sort, least significant digit first.
//!
//! A pass sorts by one digit of at most 8 bits: count the digits of each tile of keys, scan the counts, move every key
//! (and its value) to its place. Per pair a pass reads 4 bytes to count, then reads 8 and writes 8, and the table of
//! counts adds 1: 21 bytes. Four passes are 84 bytes per pair (keys alone: 52), so the bound is the copy bandwidth over
//! that: 51 G pairs/s at 4.3 TB/s. What keeps a device below it is ranking, 8 ballots per key and pass.

use std::sync::Arc;

use super::count::{Bound, Count, check_most};
use super::scan::{ScanRowsStage, record_rows};
use crate::vulkan::shaders::glsl::primitives::radix;
use crate::vulkan::stage::GroupConstants;
use crate::vulkan::{Buffer, Context, Pipeline, Recorder};
use crate::{Error, Result};

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

const DIGITS: u64 = radix::DIGITS as u64;
const KEYS_PER_THREAD: u32 = radix::ITEMS;

/// Sorts `u32` keys, alone or with a `u32` value each, by their low bits; equal keys keep their order. Keys may be the
/// bits of `f32`s, as long as none is negative (nor -0.0): these sort as the numbers do.
pub struct RadixSort {
    histogram: Pipeline,
    rows: Pipeline,
    scatter_keys: Pipeline,
    scatter_pairs: Pipeline,
    table: Buffer,
    totals: Buffer,
    keys: Buffer,
    values: Buffer,
    tile: u32,
    most: u32,
}

/// Where sorted elements are: in the caller's buffers after an even number of passes, else in the sorter's, where what
/// lies behind the counted elements means nothing.
#[derive(Clone, Copy)]
pub struct Sorted<'a> {
    /// The keys.
    pub keys: &'a Buffer,
    /// Their values.
    pub values: &'a Buffer,
}

impl RadixSort {
    /// A sort of at most `most` elements, up to 2²⁸.
    ///
    /// # Errors
    /// Where `most` is larger than that, or the device fails.
    pub fn new(context: &Arc<Context>, most: u32) -> Result<Self> {
        check_most(most)?;
        let local_size_x = threads(context);
        let tile = local_size_x * KEYS_PER_THREAD;
        let table = 4 * DIGITS * most.div_ceil(tile) as u64;
        Ok(Self {
            histogram: Pipeline::new::<RadixHistogramStage>(context, &GroupConstants { local_size_x })?,
            rows: Pipeline::new::<ScanRowsStage>(context, &GroupConstants { local_size_x: row_threads(context) })?,
            scatter_keys: Pipeline::new::<RadixScatterStage>(
                context,
                &RadixConstants { local_size_x, has_values: false },
            )?,
            scatter_pairs: Pipeline::new::<RadixScatterStage>(
                context,
                &RadixConstants { local_size_x, has_values: true },
            )?,
            table: Buffer::device(context, "radix table", table)?,
            totals: Buffer::device(context, "radix totals", 4 * DIGITS)?,
            keys: Buffer::device(context, "radix keys", 4 * most as u64)?,
            values: Buffer::device(context, "radix values", 4 * most as u64)?,
            tile,
            most,
        })
    }

    /// Bytes of scratch that a sort of at most `most` elements owns: the other half of each ping-pong, and the table.
    pub fn footprint(context: &Context, most: u32) -> u64 {
        let tiles = most.div_ceil(threads(context) * KEYS_PER_THREAD) as u64;
        4 * (DIGITS * tiles + DIGITS + 2 * most as u64)
    }

    /// Passes that a sort by `bits` bits takes.
    pub fn passes(bits: u32) -> u32 {
        bits.div_ceil(8)
    }

    /// Sorts `keys` by their low `bits` bits (1 to 32) and returns where they then are; their old place is overwritten.
    ///
    /// # Errors
    /// Where there are more elements than the capacity, or `bits` is out of range.
    pub fn keys<'a>(
        &'a self,
        recorder: &mut Recorder<'a>,
        keys: &'a Buffer,
        count: Count<'a>,
        bits: u32,
    ) -> Result<&'a Buffer> {
        let bound = count.within(self.most, &[keys])?;
        // Keys stand in for the values, which the pipeline without values never touches.
        let here = Sorted { keys, values: keys };
        let there = Sorted { keys: &self.keys, values: &self.keys };
        Ok(self.record(recorder, &self.scatter_keys, [here, there], bound, bits)?.keys)
    }

    /// Sorts `keys` by their low `bits` bits (1 to 32), takes `values` along, and returns where both then are; their old
    /// places are overwritten.
    ///
    /// # Errors
    /// Where there are more elements than the capacity, or `bits` is out of range.
    pub fn pairs<'a>(
        &'a self,
        recorder: &mut Recorder<'a>,
        keys: &'a Buffer,
        values: &'a Buffer,
        count: Count<'a>,
        bits: u32,
    ) -> Result<Sorted<'a>> {
        let bound = count.within(self.most, &[keys, values])?;
        let here = Sorted { keys, values };
        let there = Sorted { keys: &self.keys, values: &self.values };
        self.record(recorder, &self.scatter_pairs, [here, there], bound, bits)
    }

    fn record<'a>(
        &'a self,
        recorder: &mut Recorder<'a>,
        scatter: &'a Pipeline,
        [mut from, mut to]: [Sorted<'a>; 2],
        bound: Bound<'a>,
        bits: u32,
    ) -> Result<Sorted<'a>> {
        if !(1..=32).contains(&bits) {
            return Err(Error::request(format!("keys are sorted by 1 to 32 bits, not by {bits}")));
        }
        let tiles = bound.count.div_ceil(self.tile);
        // Digits of equal width: few distinct digits make long runs, which are cheaper to write.
        let width = bits.div_ceil(Self::passes(bits));
        for shift in (0..bits).step_by(width as usize) {
            let mask = (1 << width.min(bits - shift)) - 1;
            let push = RadixPush { count: bound.count, count_index: bound.index, shift, mask, stride: tiles };
            let counted = RadixHistogramStage { counts: bound.buffer, keys: from.keys, table: &self.table };
            recorder.stage(&self.histogram, counted).push(&push).linear(tiles);
            let table = [mask + 1, self.tile, tiles];
            record_rows(recorder, &self.rows, bound, &self.table, table, (&self.totals, 0));
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
        Ok(from)
    }
}

/// Threads that scan a row of the table: on a CPU as many as fill a vector, since others would wait for them at every barrier, and
/// most rows are shorter than what 256 threads take at once.
fn row_threads(context: &Context) -> u32 {
    if context.physical().kind == "CPU" { 8 } else { threads(context) }
}

/// Threads per workgroup: 8 of the narrowest subgroups, but at least 64, which are 16 subgroups of 4: the scatter stage
/// has shared memory for the histograms of no more. Software devices have narrow subgroups, run them in turns, and pay
/// for every barrier: few threads suit them.
fn threads(context: &Context) -> u32 {
    (8 * context.physical().subgroup_smallest).clamp(64, 256)
}

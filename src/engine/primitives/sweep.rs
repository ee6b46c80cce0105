//! Radix passes in one stage each: every tile of keys learns from the tiles before it where its keys go (Onesweep), on devices on which
//! workgroups run on while others wait for them.
//!
//! Per pair a pass reads 8 bytes and writes 8, the states of the tiles add less than one, and all digits are counted before by reading
//! the keys once.

use std::sync::Arc;

use super::count::Bound;
use super::digits::{Digit, Sorted, digits, width};
use crate::Result;
use crate::engine::vulkan::shaders::glsl::engine::primitives::sweep;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};

crate::gpu_struct! {
    /// Push constants of [`RadixTotalsStage`].
    pub(crate) struct TotalsPush {
        /// Elements, or the most there can be.
        pub count: u32,
        /// Where in `counts` their number is; all ones where `count` is the number.
        pub count_index: u32,
        /// Bits that keys are sorted by.
        pub bits: u32,
        /// Bits of a digit.
        pub width: u32,
        /// Tiles that a workgroup counts.
        pub tiles: u32,
        /// Lines of `states` before those of tiles.
        pub groups: u32,
    }
}

crate::gpu_struct! {
    /// Push constants of [`RadixSweepStage`].
    pub(crate) struct SweepPush {
        /// Elements, or the most there can be.
        pub count: u32,
        /// Where in `counts` their number is; all ones where `count` is the number.
        pub count_index: u32,
        /// Lowest bit of the digit.
        pub shift: u32,
        /// As many ones as the digit has bits.
        pub mask: u32,
        /// Number of the pass.
        pub pass: u32,
        /// Where in `states` those of this pass begin.
        pub own_states: u32,
        /// Where those of the next pass begin.
        pub next_states: u32,
        /// Lines of `states` before those of tiles.
        pub groups: u32,
    }
}

crate::specialisation! {
    /// Constants of [`RadixTotalsStage`].
    pub(crate) struct TotalsConstants {
        /// Threads per workgroup.
        local_size_x: u32,
        /// Keys per thread.
        items: u32,
    }
}

crate::specialisation! {
    /// Constants of [`RadixSweepStage`].
    pub(crate) struct SweepConstants {
        /// Threads per workgroup.
        local_size_x: u32,
        /// Keys per thread.
        items: u32,
        /// Whether keys have values.
        has_values: bool,
        /// Most subgroups of a workgroup.
        subgroups: u32,
    }
}

crate::stage!(
    /// Counts the digits of all passes.
    pub(crate) RadixTotalsStage = radix_totals<TotalsConstants>(TotalsPush) {
        read counts, read keys, write header, write states,
    }
);

crate::stage!(
    /// Moves keys and values to their places in the order of one digit.
    pub(crate) RadixSweepStage = radix_sweep<SweepConstants>(SweepPush) {
        read counts, write header, write states, read keys, read values, write sorted_keys, write sorted_values,
    }
);

const DIGITS: u32 = sweep::DIGITS;
const PASSES: u32 = sweep::PASSES;
const GROUP: u32 = sweep::GROUP;
/// Most subgroups of a workgroup.
const SUBGROUPS: u32 = 16;
/// Workgroups that count, about: enough to fill a device, few enough that their sums are soon added up.
const COUNTING_GROUPS: u32 = 1024;
const HEADER_BYTES: u64 = 4 * (PASSES + PASSES * DIGITS) as u64;

/// Pipelines and scratch of such passes.
pub(super) struct Sweep {
    totals: Pipeline,
    sweep_keys: Pipeline,
    sweep_pairs: Pipeline,
    header: Buffer,
    states: Buffer,
    tile: u32,
}

impl Sweep {
    /// Whether a device sorts this way by itself.
    pub fn suits(context: &Context) -> bool {
        context.physical().runs_begun_groups
    }

    pub fn new(context: &Arc<Context>, most: u32) -> Result<Self> {
        let (local_size_x, items) = (threads(context), items(most));
        let sweep = |has_values| {
            let constants = SweepConstants { local_size_x, items, has_values, subgroups: SUBGROUPS };
            Pipeline::new::<RadixSweepStage>(context, &constants)
        };
        Ok(Self {
            totals: Pipeline::new::<RadixTotalsStage>(context, &TotalsConstants { local_size_x, items })?,
            sweep_keys: sweep(false)?,
            sweep_pairs: sweep(true)?,
            header: Buffer::device(context, "sweep header", HEADER_BYTES)?,
            states: Buffer::device(context, "sweep states", state_bytes(context, most))?,
            tile: local_size_x * items,
        })
    }

    /// Bytes of scratch beside the other half of the ping-pong.
    pub fn footprint(context: &Context, most: u32) -> u64 {
        HEADER_BYTES + state_bytes(context, most)
    }

    pub fn record<'a>(
        &'a self,
        recorder: &mut Recorder,
        bound: Bound<'a>,
        has_values: bool,
        bits: u32,
        [mut from, mut to]: [Sorted<'a>; 2],
    ) -> Sorted<'a> {
        let Bound { count, index: count_index, buffer: counts } = bound;
        let all = count.div_ceil(self.tile);
        let tiles = all.div_ceil(COUNTING_GROUPS);
        let groups = group_lines(all);
        recorder.fill(&self.header, 0);
        let counted = RadixTotalsStage { counts, keys: from.keys, header: &self.header, states: &self.states };
        let push = TotalsPush { count, count_index, bits, width: width(bits), tiles, groups };
        recorder.stage(&self.totals, counted).push(&push).linear(all.div_ceil(tiles.max(1)));
        let sweep = if has_values { &self.sweep_pairs } else { &self.sweep_keys };
        let halves = [0, (groups + all) * DIGITS];
        for (pass, Digit { shift, mask }) in (0..).zip(digits(bits)) {
            let half = pass as usize % 2;
            let [own_states, next_states] = [halves[half], halves[1 - half]];
            let push = SweepPush { count, count_index, shift, mask, pass, own_states, next_states, groups };
            let moved = RadixSweepStage {
                counts,
                header: &self.header,
                states: &self.states,
                keys: from.keys,
                values: from.values,
                sorted_keys: to.keys,
                sorted_values: to.values,
            };
            recorder.stage(sweep, moved).push(&push).linear(all);
            (from, to) = (to, from);
        }
        from
    }
}

fn threads(context: &Context) -> u32 {
    SUBGROUPS * context.physical().subgroup_smallest
}

/// Keys of a thread. Many make long runs of equal digits, which are cheaper to write; few keep more of the device busy in small sorts.
fn items(most: u32) -> u32 {
    if most > 1 << 22 { 22 } else { 16 }
}

/// Lines of states before those of the tiles.
fn group_lines(tiles: u32) -> u32 {
    1 + tiles.div_ceil(GROUP)
}

/// Of two passes: one that is read, one that is emptied.
fn state_bytes(context: &Context, most: u32) -> u64 {
    let tiles = most.div_ceil(threads(context) * items(most));
    2 * 4 * DIGITS as u64 * (group_lines(tiles) + tiles) as u64
}

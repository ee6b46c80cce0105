//! Stable radix sort, least significant digit first, in passes over a digit of at most 8 bits each.
//!
//! Where the device allows it a pass is one stage ([`sweep`](super::sweep)), elsewhere three ([`counted`](super::counted)), on CPUs with a
//! run of keys to a thread; all give the same bits. Four passes move 68 and 84 bytes per pair (keys alone: 36 and 52), so the bound is the
//! copy bandwidth over that.

use std::sync::Arc;

use super::count::{Bound, Count, check_most};
use super::counted::Counted;
use super::digits::{self, Sorted};
use super::sweep::Sweep;
use crate::engine::vulkan::{Buffer, Context, Recorder};
use crate::{Error, Result};

/// Sorts `u32` keys, alone or with a `u32` value each, by their low bits; equal keys keep their order. Keys may be the
/// bits of `f32`s, as long as none is negative (nor -0.0): these sort as the numbers do.
pub struct RadixSort {
    passes: Passes,
    keys: Buffer,
    values: Buffer,
    most: u32,
}

/// How a pass is made.
enum Passes {
    Sweep(Sweep),
    Counted(Counted),
}

impl RadixSort {
    /// A sort of at most `most` elements, up to 2²⁸.
    ///
    /// # Errors
    /// Where `most` is larger than that, or the device fails.
    pub fn new(context: &Arc<Context>, most: u32) -> Result<Self> {
        match Sweep::suits(context) {
            true => Self::with_waiting(context, most),
            false => Self::counted(context, most, context.physical().is_cpu()),
        }
    }

    /// As [`Self::new`], by the way that fits all devices: workgroups do not wait for one another.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn without_waiting(context: &Arc<Context>, most: u32) -> Result<Self> {
        Self::counted(context, most, false)
    }

    /// As [`Self::new`], with passes in which workgroups wait for one another, on any device: the sort goes wrong or hangs where they
    /// do not run on meanwhile
    /// ([`Physical::runs_begun_groups`](crate::engine::vulkan::physical::Physical::runs_begun_groups)). For tests on CPU devices, one of which that
    /// runs a workgroup after another never waits, and none hangs.
    ///
    /// # Errors
    /// As for [`Self::new`], and on other GPUs than those that sort this way by themselves, which it could hang.
    pub fn with_waiting(context: &Arc<Context>, most: u32) -> Result<Self> {
        let physical = context.physical();
        if !Sweep::suits(context) && !physical.is_cpu() {
            let name = &physical.name;
            return Err(Error::request(format!(
                "workgroups of {name} are not known to run on while others wait for them"
            )));
        }
        check_most(most)?;
        Self::by(context, most, Passes::Sweep(Sweep::new(context, most)?))
    }

    /// In three stages a pass, with a run of keys to a thread or as on GPUs.
    fn counted(context: &Arc<Context>, most: u32, runs: bool) -> Result<Self> {
        check_most(most)?;
        Self::by(context, most, Passes::Counted(Counted::new(context, most, runs)?))
    }

    fn by(context: &Arc<Context>, most: u32, passes: Passes) -> Result<Self> {
        Ok(Self {
            passes,
            keys: Buffer::device(context, "radix keys", 4 * most as u64)?,
            values: Buffer::device(context, "radix values", 4 * most as u64)?,
            most,
        })
    }

    /// Bytes of scratch that a sort of at most `most` elements owns: the other half of each ping-pong, and what its passes need.
    pub fn footprint(context: &Context, most: u32) -> u64 {
        let passes = if Sweep::suits(context) { Sweep::footprint } else { Counted::footprint };
        passes(context, most) + 8 * most as u64
    }

    /// Passes that a sort by `bits` bits takes.
    pub fn passes(bits: u32) -> u32 {
        digits::passes(bits)
    }

    /// Stages and fills that a sort by `bits` bits records.
    pub fn stages(&self, bits: u32) -> u32 {
        match self.passes {
            Passes::Sweep(_) => 2 + Self::passes(bits),
            Passes::Counted(_) => 3 * Self::passes(bits),
        }
    }

    /// Sorts `keys` by their low `bits` bits (1 to 32) and returns where they then are; their old place is overwritten.
    ///
    /// # Errors
    /// Where there are more elements than the capacity, or `bits` is out of range.
    pub fn keys<'a>(
        &'a self,
        recorder: &mut Recorder,
        keys: &'a Buffer,
        count: Count<'a>,
        bits: u32,
    ) -> Result<&'a Buffer> {
        let bound = count.within(self.most, &[keys])?;
        // Keys stand in for the values, which the pipeline without values never touches.
        let here = Sorted { keys, values: keys };
        let there = Sorted { keys: &self.keys, values: &self.keys };
        Ok(self.record(recorder, false, [here, there], bound, bits)?.keys)
    }

    /// Sorts `keys` by their low `bits` bits (1 to 32), takes `values` along, and returns where both then are; their old
    /// places are overwritten.
    ///
    /// # Errors
    /// Where there are more elements than the capacity, or `bits` is out of range.
    pub fn pairs<'a>(
        &'a self,
        recorder: &mut Recorder,
        keys: &'a Buffer,
        values: &'a Buffer,
        count: Count<'a>,
        bits: u32,
    ) -> Result<Sorted<'a>> {
        let bound = count.within(self.most, &[keys, values])?;
        let here = Sorted { keys, values };
        let there = Sorted { keys: &self.keys, values: &self.values };
        self.record(recorder, true, [here, there], bound, bits)
    }

    fn record<'a>(
        &'a self,
        recorder: &mut Recorder,
        has_values: bool,
        ways: [Sorted<'a>; 2],
        bound: Bound<'a>,
        bits: u32,
    ) -> Result<Sorted<'a>> {
        if !(1..=32).contains(&bits) {
            return Err(Error::request(format!("keys are sorted by 1 to 32 bits, not by {bits}")));
        }
        Ok(match &self.passes {
            Passes::Sweep(sweep) => sweep.record(recorder, bound, has_values, bits, ways),
            Passes::Counted(counted) => counted.record(recorder, bound, has_values, bits, ways),
        })
    }
}

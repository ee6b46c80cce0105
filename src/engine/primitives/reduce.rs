//! Reduction to one value, in a fixed order.

use std::sync::Arc;

use super::count::{Bound, Count, check_index, check_most};
use crate::Result;
use crate::engine::vulkan::shaders::glsl::engine::primitives::reduce as glsl;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};

crate::gpu_struct! {
    /// Push constants of [`ReduceStage`].
    pub(crate) struct ReducePush {
        /// Elements, or the most there can be.
        pub count: u32,
        /// Where in `counts` their number is; all ones where `count` is the number.
        pub count_index: u32,
        /// Counted elements per element that is bound.
        pub divide: u32,
        /// Elements per workgroup.
        pub block: u32,
        /// Where in `results` the first workgroup writes.
        pub result_index: u32,
    }
}

crate::specialisation! {
    /// Constants of [`ReduceStage`].
    pub(crate) struct ReduceConstants {
        /// What it does.
        operation: Operation,
    }
}

crate::stage!(
    /// Reduces each block of elements to one.
    pub(crate) ReduceStage = reduce<ReduceConstants>(ReducePush) { read counts, read elements, write results }
);

/// Elements that become one partial result.
pub(super) const BLOCK: u32 = 4096;

/// What to reduce with. Floats must not be NaN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Operation {
    /// Sum of `f32`, in an order that depends on their number alone; 0 of none.
    SumF32 = glsl::SUM_F32,
    /// Least `f32`; infinity of none. Which zero is less is unspecified.
    MinF32 = glsl::MIN_F32,
    /// Greatest `f32`; minus infinity of none. Which zero is greater is unspecified.
    MaxF32 = glsl::MAX_F32,
    /// Sum of `u32`, modulo 2³²; 0 of none.
    SumU32 = glsl::SUM_U32,
    /// Least `u32`; the greatest `u32` of none.
    MinU32 = glsl::MIN_U32,
    /// Greatest `u32`; 0 of none.
    MaxU32 = glsl::MAX_U32,
}

/// Reduces a buffer of 4-byte elements to one: 4 bytes of traffic per element.
pub struct Reduce {
    pipeline: Pipeline,
    partials: Buffer,
    most: u32,
}

impl Reduce {
    /// A reduction of at most `most` elements, up to 2²⁸.
    ///
    /// # Errors
    /// Where `most` is larger than that, or the device fails.
    pub fn new(context: &Arc<Context>, operation: Operation, most: u32) -> Result<Self> {
        check_most(most)?;
        let partials = Buffer::device(context, "reduce partials", Self::footprint(most))?;
        Ok(Self { pipeline: Pipeline::new::<ReduceStage>(context, &ReduceConstants { operation })?, partials, most })
    }

    /// Bytes of scratch that a reduction of at most `most` elements owns.
    pub fn footprint(most: u32) -> u64 {
        4 * most.div_ceil(BLOCK) as u64
    }

    /// Reduces the counted elements of `input` and writes the result to `output`, at the `u32` index `index`.
    ///
    /// # Errors
    /// Where there are more elements than the capacity, or `output` has no such index.
    pub fn record<'a>(
        &'a self,
        recorder: &mut Recorder,
        input: &'a Buffer,
        count: Count<'a>,
        output: &'a Buffer,
        index: u32,
    ) -> Result<()> {
        let bound = count.within(self.most, &[input])?;
        check_index(output, index)?;
        record_blocks(recorder, &self.pipeline, bound, input, &self.partials);
        let all = ReducePush {
            count: bound.count,
            count_index: bound.index,
            divide: BLOCK,
            block: u32::MAX,
            result_index: index,
        };
        recorder
            .stage(&self.pipeline, ReduceStage { counts: bound.buffer, elements: &self.partials, results: output })
            .push(&all)
            .linear(1);
        Ok(())
    }
}

/// Reduces every block of `input` to one element of `partials`.
pub(super) fn record_blocks<'a>(
    recorder: &mut Recorder,
    pipeline: &'a Pipeline,
    bound: Bound<'a>,
    input: &'a Buffer,
    partials: &'a Buffer,
) {
    let push = ReducePush { count: bound.count, count_index: bound.index, divide: 1, block: BLOCK, result_index: 0 };
    recorder
        .stage(pipeline, ReduceStage { counts: bound.buffer, elements: input, results: partials })
        .push(&push)
        .linear(bound.count.div_ceil(BLOCK));
}

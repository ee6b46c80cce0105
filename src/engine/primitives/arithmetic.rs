//! Multiply-adds in registers: the measure of the arithmetic that other stages could do.

use std::sync::Arc;

use crate::Result;
use crate::engine::vulkan::shaders::glsl::engine::primitives::multiply_add::STEPS;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};

crate::gpu_struct! {
    /// Push constants of [`MultiplyAddStage`].
    pub(crate) struct MultiplyAddPush {
        /// Threads that write a sum.
        pub count: u32,
        /// Rounds of multiply-adds.
        pub rounds: u32,
        /// What a chain's value is multiplied by,
        pub factor: f32,
        /// and what is added then.
        pub addend: f32,
    }
}

crate::stage!(
    /// Eight chains of multiply-adds a thread.
    pub(crate) MultiplyAddStage = multiply_add(MultiplyAddPush) { write target }
);

/// Multiply-adds as fast as the device does them.
pub struct Arithmetic {
    pipeline: Pipeline,
}

impl Arithmetic {
    /// Chains of a thread.
    pub const CHAINS: u32 = 8;
    /// Multiply-adds of a chain in a round.
    pub const STEPS: u32 = STEPS;

    /// Makes the stage.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn new(context: &Arc<Context>) -> Result<Self> {
        Ok(Self { pipeline: Pipeline::new::<MultiplyAddStage>(context, &())? })
    }

    /// Records a thread for each float of the target. Chain `c` of thread `i` starts with `i % 256 + c`; the thread writes the sum of its
    /// chains after so many rounds.
    pub fn record(&self, commands: &mut Recorder, target: &Buffer, rounds: u32, [factor, addend]: [f32; 2]) {
        let count = (target.size() / 4) as u32;
        commands
            .stage(&self.pipeline, MultiplyAddStage { target })
            .push(&MultiplyAddPush { count, rounds, factor, addend })
            .linear(count.div_ceil(256));
    }

    /// Floating-point operations of so many threads; a multiply-add is two.
    pub fn operations(threads: u32, rounds: u32) -> u64 {
        2 * u64::from(Self::CHAINS) * u64::from(Self::STEPS) * u64::from(threads) * u64::from(rounds)
    }
}

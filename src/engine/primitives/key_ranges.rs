//! Where the elements of each key are among sorted keys: 4 bytes read an element, 8 filled and 8 written a key.

use std::sync::Arc;

use super::count::{Bound, Count, check_most};
use crate::Result;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};

crate::gpu_struct! {
    /// Push constants of [`KeyRangesStage`].
    pub(crate) struct KeyRangesPush {
        /// Elements, or the most there can be.
        pub count: u32,
        /// Where in `counts` their number is; all ones where `count` is the number.
        pub count_index: u32,
    }
}

crate::stage!(
    /// First element of each key, and the one after the last.
    pub(crate) KeyRangesStage = key_ranges(KeyRangesPush) { read counts, read keys, write ranges }
);

/// Finds where the elements of each key begin and end.
pub struct KeyRanges {
    pipeline: Pipeline,
    most: u32,
}

impl KeyRanges {
    /// For at most `most` elements.
    ///
    /// # Errors
    /// More elements than primitives take, or a device that fails.
    pub fn new(context: &Arc<Context>, most: u32) -> Result<Self> {
        check_most(most)?;
        Ok(Self { pipeline: Pipeline::new::<KeyRangesStage>(context, &())?, most })
    }

    /// Records the first element of each key, and the one after the last, into the pairs of `ranges`; both are 0 of a key without
    /// elements. `keys` are sorted; those that `ranges` has no pair for are passed over.
    ///
    /// # Errors
    /// More elements than the buffers hold.
    pub fn record(&self, recorder: &mut Recorder, keys: &Buffer, count: Count<'_>, ranges: &Buffer) -> Result<()> {
        let Bound { count, index: count_index, buffer: counts } = count.within(self.most, &[keys])?;
        recorder.fill(ranges, 0);
        recorder
            .stage(&self.pipeline, KeyRangesStage { counts, keys, ranges })
            .push(&KeyRangesPush { count, count_index })
            .linear(count.div_ceil(256));
        Ok(())
    }
}

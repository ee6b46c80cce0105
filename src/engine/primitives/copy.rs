//! A copy by a compute stage: the measure of the bandwidth that other stages could have. `vkCmdCopyBuffer` is not always:
//! some drivers run it on a part of the device.

use std::sync::Arc;

use crate::Result;
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder};

crate::gpu_struct! {
    /// Push constants of [`CopyWordsStage`].
    pub(crate) struct CopyPush {
        /// Vectors of four words.
        pub count: u32,
    }
}

crate::stage!(
    /// Sixteen bytes a thread.
    pub(crate) CopyWordsStage = copy_words(CopyPush) { read source, write target }
);

/// Copies buffers by a compute stage.
pub struct Copy {
    pipeline: Pipeline,
}

impl Copy {
    /// Makes the stage.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn new(context: &Arc<Context>) -> Result<Self> {
        Ok(Self { pipeline: Pipeline::new::<CopyWordsStage>(context, &())? })
    }

    /// Copies as many whole vectors of sixteen bytes as both buffers hold.
    pub fn record(&self, commands: &mut Recorder, source: &Buffer, target: &Buffer) {
        let count = (source.size().min(target.size()) / 16) as u32;
        commands
            .stage(&self.pipeline, CopyWordsStage { source, target })
            .push(&CopyPush { count })
            .linear(count.div_ceil(256));
    }
}

//! What both ways through the splat pass read and write.

use super::shared::PaperSettings;
use crate::engine::vulkan::Buffer;
use crate::visibility::probe_depth::ProbeMaps;

/// Settings, probes and buffers of a run.
pub(super) struct State {
    pub(super) settings: PaperSettings,
    pub(super) maps: ProbeMaps,
    pub(super) directions: Buffer,
    pub(super) paper: Buffer,
    pub(super) scale: Buffer,
    pub(super) tallies: Buffer,
    pub(super) deficit: Buffer,
}

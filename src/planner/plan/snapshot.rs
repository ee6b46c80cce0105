//! Splats kept by iteration (`snapshot.comp`).

use super::shared::{CameraState, Control, Settings};

crate::gpu_struct! {
    /// Push constants of `snapshot`.
    pub(crate) struct SnapshotPush {
        /// Iterations between snapshots.
        pub interval: u32,
    }
}

crate::stage!(
    /// Copies the splats into row `iteration / interval`.
    pub(crate) SnapshotStage = snapshot(SnapshotPush) { read settings, read control, read splats, write snapshots }
    with [Settings, Control, CameraState]
);

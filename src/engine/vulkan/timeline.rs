//! Timeline semaphores of a host application.

use ash::vk;

/// A value that a timeline semaphore of the host's is to reach, see [`super::Recorder::submit_between`].
#[derive(Clone, Copy, Debug)]
pub struct Timeline {
    /// The semaphore, of the type `VK_SEMAPHORE_TYPE_TIMELINE`.
    pub semaphore: vk::Semaphore,
    /// The value.
    pub value: u64,
}

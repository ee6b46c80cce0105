//! The Vulkan layer: context, memory, stages, commands, timestamps, capture. All of the crate's `unsafe` is here.
//!
//! A stage is one compute shader and one host declaration of the same name ([`stage`]); the build checks the two against each
//! other. A [`recorder::Recorder`] writes stages into a command buffer, its own or a host application's, and is the one place
//! where barriers are inserted.

pub(crate) mod buffer;
pub mod capture;
mod choice;
mod clock;
pub(crate) mod context;
pub mod dispatch;
pub mod footprint;
pub mod host;
pub mod instance;
mod kept;
mod mapping;
pub(crate) mod pace;
pub mod physical;
pub(crate) mod pipeline;
pub mod profile;
mod queue;
pub mod recorder;
mod reuse;
pub(crate) mod shaders;
pub(crate) mod stage;
mod timeline;
mod transfer;

pub use buffer::Buffer;
pub use context::{Context, ContextOptions};
pub use pipeline::Pipeline;
pub use recorder::Recorder;

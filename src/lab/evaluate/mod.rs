//! What a choice of views is worth: photographs of the views, splats trained on them, and scores on held-out test views.
//!
//! [`request`] specifies what is compared and how, [`kind`] what differs between kinds of subjects. A [`subject`] is read and checked
//! first: a [`scene`] with [`views`] around an object or in the empty space of a [`room`], or a [`mod@pool`] of photos.
//! [`artifact`] keeps every artifact under a key of its inputs; [`scene_artifacts`] makes those of a scene, [`pool_artifacts`]
//! those of a pool, [`training`] and [`perceptual`] what both share. [`evaluation`] runs the whole request or a [`shard`] of it,
//! [`results`] means and intervals, [`table`] the tables; [`demo`] is the demo's pipeline. `docs/reference/evaluation.md` has the protocol.

pub(crate) mod artifact;
mod baseline;
mod choice;
pub(crate) mod competitor;
pub mod demo;
pub mod evaluation;
pub mod kind;
pub mod layouts;
mod passes;
pub(crate) mod perceptual;
pub(crate) mod pool;
pub(crate) mod pool_artifacts;
pub(crate) mod request;
pub mod results;
pub(crate) mod room;
pub mod scene;
pub(crate) mod scene_artifacts;
pub mod settings;
pub mod shard;
pub mod situation;
pub(crate) mod subject;
pub(crate) mod table;
pub(crate) mod training;
pub(crate) mod views;

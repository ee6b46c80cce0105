//! What a choice of views is worth: photographs of the views, splats trained on them, and scores on held-out test views.
//!
//! [`request`] specifies what is compared and how, [`kind`] what differs between kinds of subjects. A [`subject`] is read and checked
//! first: a [`scene`] with [`views`] around an object or in the empty space of a [`room`], or a [`mod@pool`] of photos.
//! [`artifact`] keeps every artifact under a key of its inputs; [`scene_artifacts`] makes those of a scene, [`pool_artifacts`]
//! those of a pool, [`training`] and [`perceptual`] what both share. [`destination`] guards what a folder holds already, [`evaluation`] runs
//! the whole request or a [`shard`] of it, [`results`] means and intervals over seeds, [`scene_means`] those over scenes, [`table`] and
//! [`latex`] the tables; [`given`] reads layouts of the user's, [`task`] writes what methods of other programs choose by; [`demo`] is the
//! demo's pipeline. `docs/reference/evaluation.md` has the protocol.

pub(crate) mod artifact;
mod baseline;
mod choice;
pub(crate) mod competitor;
pub mod demo;
pub mod destination;
pub mod evaluation;
pub(crate) mod given;
pub mod kind;
mod latex;
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
pub(crate) mod scene_means;
pub mod settings;
pub mod shard;
pub mod situation;
pub(crate) mod subject;
pub(crate) mod table;
pub(crate) mod task;
pub(crate) mod training;
pub(crate) mod views;

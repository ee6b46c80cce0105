//! What a choice of views is worth: photographs of the views, splats trained on them, and scores on held-out test views.
//!
//! [`request`] says what is compared and how, [`kind`] what each kind of subject has of its own. A [`subject`] is read and checked
//! first: a [`scene`] with [`views`] around an object or in the empty space of a [`room`], or a [`mod@pool`] of photos. [`stage`] keeps
//! every product under a key of its inputs; [`mod@bench`] makes those of a scene, [`choices`] those of a pool, [`training`] and
//! [`perceptual`] what both share. [`job`] makes all that is asked for, [`results`] means and intervals, [`table`] the tables;
//! [`tour`] goes the whole way once, as the demo does. `docs/reference/evaluation.md` has the protocol.

pub(crate) mod bench;
mod choice;
pub(crate) mod choices;
pub(crate) mod competitor;
pub(crate) mod job;
pub(crate) mod kind;
pub mod layouts;
mod passes;
mod peer;
pub(crate) mod perceptual;
pub(crate) mod pool;
pub(crate) mod request;
pub(crate) mod results;
pub(crate) mod room;
pub mod scene;
pub mod settings;
pub mod situation;
pub(crate) mod stage;
pub(crate) mod subject;
pub(crate) mod table;
pub mod tour;
pub(crate) mod training;
pub(crate) mod views;

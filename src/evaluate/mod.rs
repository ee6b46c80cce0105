//! What a choice of views is worth: photographs of the views, splats trained on them, and scores on held-out test views.
//!
//! [`request`] says what is compared and how, [`kind`] what each kind of subject has of its own. A [`subject`] is read and checked
//! first: a [`scene`] with [`views`] around an object or in the empty space of a [`room`], or a [`mod@pool`] of photos. [`stage`] keeps
//! every product under a key of its inputs; [`mod@bench`] makes those of a scene, [`choices`] those of a pool, [`training`] and
//! [`perceptual`] what both share. [`job`] makes all that is asked for, [`results`] means and intervals, [`table`] the tables;
//! [`tour`] goes the whole way once, as the demo does. `docs/reference/evaluation.md` has the protocol.

pub mod bench;
mod choice;
pub mod choices;
pub mod competitor;
pub mod job;
pub mod kind;
pub mod layouts;
mod passes;
mod peer;
pub mod perceptual;
pub mod pool;
pub mod request;
pub mod results;
pub mod room;
pub mod scene;
pub mod settings;
pub mod situation;
pub mod stage;
pub mod subject;
pub mod table;
pub mod tour;
pub mod training;
pub mod views;

//! What a choice of views is worth: photographs of the views, splats trained on them, and scores on views that nobody chose.
//!
//! [`request`] says what is compared and how, [`subject`] is a scene that is read, [`views`] are the cameras of inputs and
//! tests, [`stage`] keeps every product under a key of its inputs, [`mod@bench`] makes the products of a scene, [`job`] all that is
//! asked for, [`results`] means and intervals, [`table`] the tables. `docs/evaluation.md` has the protocol.

pub mod bench;
pub mod job;
mod peer;
pub mod request;
pub mod results;
pub mod stage;
pub mod subject;
pub mod table;
pub mod views;

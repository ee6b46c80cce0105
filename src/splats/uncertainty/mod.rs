//! What a view would add to a model, and where models are uncertain.

pub mod cover;
pub mod fisher;
pub mod manifold;

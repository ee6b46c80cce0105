//! Choosing from a pool: which K of the photos that have been taken train the best radiance field.
//!
//! The paper plans K cameras and takes the photo nearest to each. Here every planned camera gets a photo of its own
//! ([`assignment`]), and photos are then swapped ([`interchange`]) while the expected error of what viewers look at, on the real
//! frusta ([`objective`]), falls.

pub(crate) mod acp;
pub(crate) mod assignment;
pub mod farthest;
pub(crate) mod greedy;
pub mod information;
pub mod interchange;
pub mod objective;
pub mod pool;
pub mod request;
pub mod retrained;
pub mod rule;
pub(crate) mod score;
pub mod selection;
pub mod sharpness;
pub mod sight;

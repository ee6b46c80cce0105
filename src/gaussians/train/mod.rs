//! Iterations on the device: loss, gradients, Adam, growth within a budget.

pub(crate) mod density;
pub mod loss;
pub mod mcmc;
pub mod memory;
mod rounds;
pub mod trainer;
pub mod update;
